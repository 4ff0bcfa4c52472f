"""Methods of integration, which the argument ``method=`` chooses.

A method is a `method.Integrator` in the table ``METHODS`` of its module. A method that needs
another package declares it as ``PACKAGE`` and imports it when it runs. Engines are loaded only when
a method is chosen, because each start of the workflow reads the table of methods.
"""

from collections import UserDict
from importlib import import_module
from typing import Any, NamedTuple

from gearlib import checks
from gearlib.parameters import METHOD_MODULES


class _IntegratorTable(UserDict):
    """Mapping from names of methods to `Integrator`s; a module is loaded on first use."""

    def __getitem__(self, name: str):
        """Return the `Integrator` of the method that is called `name`."""
        return import_module(f"{__name__}.{self.data[name]}").METHODS[name]


METHODS = _IntegratorTable(METHOD_MODULES)

#: Methods that are chosen by default; the others are for comparison.
AUTOMATIC = ("exact", "taylor")


class Method(NamedTuple):
    """Description of a method that ``method=`` can name."""

    name: str
    order: int | None  #: order of its steps; None: closed forms, or several solvers
    events: str  #: treatment of switches of stiffness and of changes of contact
    models: str  #: models that it can run
    options: dict  #: option name -> (default, meaning)
    available: bool = True  #: whether its package is installed
    note: str = ""  #: command that installs its package, empty for methods of the library


def methods() -> list[Method]:
    """Return the descriptions of all methods that ``method=`` can name."""
    return [describe_method(name) for name in METHODS]


def describe_method(name: str) -> Method:
    """Return the description of the method of integration that is called `name`.

    It says whether the package that the method needs, if any, is installed.
    """
    method = METHODS[name]
    options = {key: (option.default, option.text) for key, option in method.OPTIONS.items()}
    is_available, note = True, ""
    if method.PACKAGE is not None:
        is_available, note = method.PACKAGE.available(), method.PACKAGE.note()
    return Method(name, method.ORDER, method.EVENTS, method.MODELS, options, is_available, note)


def _methods_for(model) -> list[str]:
    """Return the names of the methods of integration that can run a model."""
    return [name for name, method in METHODS.items() if method.supports(model)]


def reason_unsupported(model, name: str) -> str:
    """Return the reason why the method called `name` cannot run a model, empty if it can.

    The reason is a sentence for an error message.
    """
    method, model_class = METHODS[name], type(model).__name__
    if method.supports(model):
        return ""
    return f"method = {name!r} is not allowed for this {model_class}: it takes {method.MODELS}"


def choose_method(model, name: Any, options: dict | None) -> tuple[str, Any, dict]:
    """Return (name, `Integrator`, all options) of the method of integration that runs a model.

    `name` is the name of the method, or None for "exact" if it can run the model, else "taylor".
    `options` maps names of options of the method to values; the others have their defaults. Raises
    ValueError if the method is unknown or cannot run the model or if an option is invalid, and
    `MissingPackage` if its package is missing.
    """
    from gearlib.integrators.method import MissingPackage
    from gearlib.models.model import is_model

    allowed = "a GearPair, OneDegreePair, SixDegreePair or DeadZoneOscillator"
    checks.require(is_model(model), "model", model, allowed)
    if name is None:
        name = next((name for name in AUTOMATIC if METHODS[name].supports(model)), None)
    checks.check_choice("method", name, tuple(METHODS))
    # Other methods are looked up only for an error message, because their modules load slowly.
    reason = reason_unsupported(model, name)
    if reason:
        names = ", ".join(map(repr, _methods_for(model)))
        raise ValueError(f"{reason}; it must be one of {names}")
    method = describe_method(name)
    if not method.available:
        names = ", ".join(repr(n) for n in _methods_for(model) if describe_method(n).available)
        raise MissingPackage(
            f"method = {name!r} needs a package that is not installed: {method.note}, or take "
            f"one of {names}"
        )
    return name, METHODS[name], _checked_options(name, options)


def _checked_options(method_name: str, options: dict | None) -> dict:
    """Return all options of the method called `method_name`, with defaults for missing options.

    `options` maps names to values, or is None. Raises ValueError if the method has no option of a
    name or does not allow the value.
    """
    known_options = METHODS[method_name].OPTIONS
    values = {option_name: option.default for option_name, option in known_options.items()}
    for option_name, value in checks.check_options(options).items():
        if option_name not in known_options:
            known_names = ", ".join(map(repr, known_options)) or "no options"
            raise ValueError(
                f"options[{option_name!r}] = {value!r} is not allowed: method {method_name!r} "
                f"knows {known_names}"
            )
        values[option_name] = known_options[option_name].check(f"options[{option_name!r}]", value)
    return values
