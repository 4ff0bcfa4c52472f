"""Methods behind the one ``method=`` name: each says which models it takes, and runs them.

A method is a `method.Integrator` in the table ``METHODS`` of its module. A solver from another
package names that as ``PACKAGE`` and imports it where it runs.
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
    """Name of a method -> the method; its module is loaded on first use: most runs need one."""

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

#: Methods that are chosen where none is named; the others are for comparison.
AUTOMATIC = ("exact", "taylor")


class Method(NamedTuple):
    """What `methods` says of one method."""

    name: str
    order: int | None  #: of its steps; None: closed forms, or several solvers
    events: str  #: how it meets stiffness switches and flank lines
    models: str  #: what it takes
    options: dict  #: name -> (default, meaning)
    available: bool = True  #: whether the package that it needs is installed
    note: str = ""  #: what to install for it, empty for methods of the library


def methods():
    """Return the methods that ``method=`` knows, as a list of `Method`."""
    return [about(name) for name in METHODS]


def about(name):
    """Return the `Method` of a name; no other is loaded."""
    method = METHODS[name]
    options = {key: (option.default, option.meaning) for key, option in method.OPTIONS.items()}
    package = method.PACKAGE
    requirement = () if package is None else (package.available(), package.note())
    return Method(name, method.ORDER, method.EVENTS, method.MODELS, options, *requirement)


def _takers(model):
    """Return the names of the methods that take a model."""
    return [name for name, method in METHODS.items() if method.takes(model)]


def refusal(model, name):
    """Return why a method does not take a model, a clause; empty where it does."""
    method, kind = METHODS[name], type(model).__name__
    if method.takes(model):
        return ""
    return f"method = {name!r} is not allowed for this {kind}: it takes {method.MODELS}"


def choose(model, name, options):
    """Return (name, method, options) for a model: the method named, or "exact" or "taylor".

    ValueError if the method is unknown or does not take the model, or an option is unknown or
    wrong; `MissingPackage` if the method's package is not installed.
    """
    if not is_model(model):
        raise ValueError(
            f"pair = {model!r} is not allowed: it must be a GearPair, OneDegreePair, SixDegreePair "
            "or DeadZoneOscillator"
        )
    if name is None:
        name = next((name for name in AUTOMATIC if METHODS[name].takes(model)), None)
    # Where nothing is refused, no other method is loaded.
    if name not in tuple(METHODS) or refusal(model, name):
        if name in REMOVED:
            raise ValueError(sentence(name))
        checks.one_of("method", name, tuple(METHODS))
        takers = ", ".join(map(repr, _takers(model)))
        raise ValueError(f"{refusal(model, name)}; it must be one of {takers}")
    method = METHODS[name]
    if not about(name).available:
        raise MissingPackage(
            f"method = {name!r} needs a package that is not installed: {about(name).note}, or take "
            f"one of {', '.join(repr(n) for n in _takers(model) if about(n).available)}"
        )
    chosen = {key: option.default for key, option in method.OPTIONS.items()}
    for key, value in checks.options(options).items():
        if key not in method.OPTIONS:
            raise ValueError(
                f"options[{key!r}] = {value!r} is not allowed: method {name!r} knows "
                f"{', '.join(map(repr, method.OPTIONS)) or 'no options'}"
            )
        chosen[key] = method.OPTIONS[key].check(f"options[{key!r}]", value)
    return name, method, chosen
