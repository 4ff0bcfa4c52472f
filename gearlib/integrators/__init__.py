"""Integration methods, which are selected by the argument ``method=``.

A method is a `method.Integrator` in the table ``METHODS`` of its module. A method that requires
another package declares it as ``PACKAGE`` and imports it when it runs. Engines are loaded only when
a method is selected, because each start of the workflow reads the table of methods.
"""

from collections import UserDict
from importlib import import_module
from typing import Any, NamedTuple

from gearlib import checks
from gearlib.parameters import METHOD_MODULES


class _IntegratorTable(UserDict):
    """Mapping from method names to `Integrator`s, which loads each module on first use."""

    def __getitem__(self, name: str):
        """Return the `Integrator` with the given name."""
        return import_module(f"{__name__}.{self.data[name]}").METHODS[name]


METHODS = _IntegratorTable(METHOD_MODULES)

#: Default methods, in order of preference; all others are for comparison.
AUTOMATIC = ("exact", "taylor")


class Method(NamedTuple):
    """Description of an integration method."""

    name: str
    order: int | None  #: order of accuracy; None for closed forms or a choice of solvers
    events: str  #: treatment of stiffness switches and of contact changes
    models: str  #: supported models
    options: dict  #: option name -> (default, description)
    available: bool = True  #: whether the required package is installed
    note: str = ""  #: command that installs the required package, empty if there is none


def methods() -> list[Method]:
    """Return the descriptions of all integration methods."""
    return [describe_method(name) for name in METHODS]


def describe_method(name: str) -> Method:
    """Return the description of the integration method with the given name.

    It includes whether the package required by the method, if any, is installed.
    """
    method = METHODS[name]
    options = {
        key: (option.default, option.raw_description) for key, option in method.OPTIONS.items()
    }
    is_available, note = True, ""
    if method.PACKAGE is not None:
        is_available, note = method.PACKAGE.available(), method.PACKAGE.note()
    return Method(name, method.ORDER, method.EVENTS, method.MODELS, options, is_available, note)


def _supported_methods(model) -> list[str]:
    """Return the names of the integration methods that support a model."""
    return [name for name, method in METHODS.items() if method.supports(model)]


def reason_unsupported(model, name: str) -> str:
    """Return the reason why the method `name` does not support a model, or "" if it does.

    The reason is text for an error message.
    """
    method, model_class = METHODS[name], type(model).__name__
    if method.supports(model):
        return ""
    return f"method = {name!r} is not allowed for this {model_class}: it supports {method.MODELS}"


def choose_method(model, name: Any, options: dict | None) -> tuple[str, Any, dict]:
    """Return (name, `Integrator`, all options) of the integration method for a model.

    `name` is the name of the method, or None for "exact" if it supports the model, else "taylor".
    `options` maps option names to values; missing options get their defaults. Raise ValueError if
    the method is unknown or does not support the model, or if an option is invalid, and
    `MissingPackage` if a required package is missing.
    """
    from gearlib.integrators.method import MissingPackage
    from gearlib.models.model import is_model

    allowed = "a GearPair, OneDegreePair, SixDegreePair or DeadZoneOscillator"
    checks.require(is_model(model), "model", model, allowed)
    if name is None:
        name = next((name for name in AUTOMATIC if METHODS[name].supports(model)), None)
    checks.check_choice("method", name, tuple(METHODS))
    # Other methods are looked up only for an error message, because their modules are slow to load.
    reason = reason_unsupported(model, name)
    if reason:
        names = ", ".join(map(repr, _supported_methods(model)))
        raise ValueError(f"{reason}; it must be one of {names}")
    method = describe_method(name)
    if not method.available:
        names = ", ".join(
            repr(n) for n in _supported_methods(model) if describe_method(n).available
        )
        raise MissingPackage(
            f"method = {name!r} requires a package that is not installed: run {method.note!r}, or "
            f"use one of {names}"
        )
    return name, METHODS[name], _complete_options(name, options)


def _complete_options(method_name: str, options: dict | None) -> dict:
    """Check the options of a method, and fill in the defaults of missing options.

    `options` maps option names to values, or is None. Raise ValueError if an option is unknown or
    its value is not allowed.
    """
    known_options = METHODS[method_name].OPTIONS
    values = {option_name: option.default for option_name, option in known_options.items()}
    for option_name, value in checks.check_options(options).items():
        if option_name not in known_options:
            known_names = ", ".join(map(repr, known_options)) or "none"
            raise ValueError(
                f"options[{option_name!r}] = {value!r} is not allowed: the options of method "
                f"{method_name!r} are {known_names}"
            )
        values[option_name] = known_options[option_name].check(f"options[{option_name!r}]", value)
    return values
