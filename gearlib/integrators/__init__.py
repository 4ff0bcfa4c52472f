"""Methods of integration that the argument ``method=`` names.

A method is a `method.Integrator` in the table ``METHODS`` of its module. A method that needs
another package names it as ``PACKAGE`` and imports it when it runs.
"""

from collections import UserDict
from importlib import import_module
from typing import TYPE_CHECKING, NamedTuple

from gearlib import checks
from gearlib.integrators.method import MissingPackage
from gearlib.models.model import is_model
from gearlib.removed import REMOVED, sentence

if TYPE_CHECKING:  # loaded by name in any run, for `workflow.sources`: that of AUTOMATIC
    from gearlib.integrators import method  # noqa: F401


class _Methods(UserDict):
    """Mapping of the name of a method to its `Integrator`, whose module is loaded on first use."""

    def __getitem__(self, name):
        return import_module(f"{__name__}.{self.data[name]}").METHODS[name]


METHODS = _Methods(
    exact="method",
    taylor="method",
    rk4="fixed_steps",
    rk45="embedded_pair",
    newmark="fixed_steps",
    generalised_alpha="fixed_steps",
    scipy="scipy_ivp",
    smoothed="embedded_pair",
    heyoka="heyoka",
)

#: Methods that are chosen by default; the others are for comparison.
AUTOMATIC = ("exact", "taylor")


class Method(NamedTuple):
    """Description of a method that ``method=`` can name."""

    name: str
    order: int | None  #: order of its steps; None: closed forms, or several solvers
    events: str  #: how it treats switches of stiffness and changes of contact
    models: str  #: which models it can run
    options: dict  #: name -> (default, meaning)
    available: bool = True  #: whether its package is installed
    note: str = ""  #: command that installs its package, empty for methods of the library


def methods():
    """Return the methods that ``method=`` knows, as a list of `Method`."""
    return [about(name) for name in METHODS]


def about(name):
    """Return the description of a method, a `Method`, by its name."""
    method = METHODS[name]
    options = {key: (option.default, option.meaning) for key, option in method.OPTIONS.items()}
    package = method.PACKAGE
    requirement = () if package is None else (package.available(), package.note())
    return Method(name, method.ORDER, method.EVENTS, method.MODELS, options, *requirement)


def _methods_for(model):
    """Return the names of the methods that can run a model."""
    return [name for name, method in METHODS.items() if method.takes(model)]


def refusal(model, name):
    """Return the reason why a method cannot run a model, or an empty text if it can."""
    method, kind = METHODS[name], type(model).__name__
    if method.takes(model):
        return ""
    return f"method = {name!r} is not allowed for this {kind}: it takes {method.MODELS}"


def choose(model, name, options):
    """Return the name, the `Integrator` and all options of the method that runs a model.

    Without a name "exact" is chosen if it can run the model, else "taylor". ValueError is raised if
    the method is unknown or cannot run the model or if an option is wrong, `MissingPackage` if the
    package of the method is not installed.
    """
    if not is_model(model):
        raise ValueError(
            f"pair = {model!r} is not allowed: it must be a GearPair, OneDegreePair, SixDegreePair "
            "or DeadZoneOscillator"
        )
    if name is None:
        name = next((name for name in AUTOMATIC if METHODS[name].takes(model)), None)
    if name not in tuple(METHODS) or refusal(model, name):
        if name in REMOVED:
            raise ValueError(sentence(name))
        checks.one_of("method", name, tuple(METHODS))
        names = ", ".join(map(repr, _methods_for(model)))
        raise ValueError(f"{refusal(model, name)}; it must be one of {names}")
    method = METHODS[name]
    if not about(name).available:
        raise MissingPackage(
            f"method = {name!r} needs a package that is not installed: {about(name).note}, or take "
            f"one of {', '.join(repr(n) for n in _methods_for(model) if about(n).available)}"
        )
    values = {key: option.default for key, option in method.OPTIONS.items()}
    for key, value in checks.options(options).items():
        if key not in method.OPTIONS:
            raise ValueError(
                f"options[{key!r}] = {value!r} is not allowed: method {name!r} knows "
                f"{', '.join(map(repr, method.OPTIONS)) or 'no options'}"
            )
        values[key] = method.OPTIONS[key].check(f"options[{key!r}]", value)
    return name, method, values
