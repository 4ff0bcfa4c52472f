"""Methods behind the one ``method=`` name: each says which models it takes, and runs them.

=====================  =======================================================================
module                 responsibility
=====================  =======================================================================
``exact``              closed forms between events: linear damping, rectangular
                       stiffness, one or six degrees of freedom
``taylor_steps``       Taylor steps of order 20 that end at events: any model of one
                       degree
``rk4``                for comparison: classical Runge-Kutta in fixed steps
``rk45``               for comparison: embedded pair under step control, as ode45
``newmark``            for comparison: average acceleration in fixed steps
``generalised_alpha``  for comparison: with numerical damping, in fixed steps
``scipy_ivp``          for comparison ("scipy"): scipy's solvers, as they come or split
``smoothed``           for comparison: contact smoothed by tanh
``models_with_steps``  models and law of the methods with steps
``right_hand_sides``   models as right-hand sides for solvers in Python, any number of meshes
``option``             an option of a method: default, check, meaning
``each``               many tunings for a method that runs one
``split``              record of solvers in Python; runs over everything, or split at events
``peers``              solvers from packages of others, which `methods` says whether are there
=====================  =======================================================================

A method is a module that offers

``ORDER``, ``EVENTS``, ``MODELS``
    order of its steps (None: closed forms, or several), how it meets events, which models it
    takes, in words;
``OPTIONS``
    name -> `option.Option`;
``takes(pair)``
    whether it takes a model;
``run(pair, tuning, state, periods, record_periods, samples, events, limit, summary, **options)``
    one run; arguments as of `gearlib.kernels.closed_form.pair_run.run`, whose returns are followed
    by the number of evaluations of the right-hand side;
``run_many(pair, tunings, order, state, carry, span, rows, **options)``
    ``tunings[order]``, with the state carried along or not; `Span` and `Rows` are those of
    `gearlib.runs.run_arguments`.
"""

from collections import UserDict
from importlib import import_module
from typing import TYPE_CHECKING, NamedTuple

from gearlib import checks
from gearlib.models.model import is_model
from gearlib.removed import REMOVED, sentence

if TYPE_CHECKING:  # what any run may load by name, for `workflow.sources`: that of AUTOMATIC
    from gearlib.integrators import exact, taylor_steps  # noqa: F401


class _Modules(UserDict):
    """Name of a method -> its module, loaded on first use: most runs need one of them."""

    def __getitem__(self, name):
        entry = self.data[name]
        return import_module(f"{__name__}.{entry}") if isinstance(entry, str) else entry


METHODS = _Modules(
    {
        "exact": "exact",
        "taylor": "taylor_steps",
        "rk4": "rk4",
        "rk45": "rk45",
        "newmark": "newmark",
        "generalised_alpha": "generalised_alpha",
        "scipy": "scipy_ivp",
        "smoothed": "smoothed",
        "heyoka": "peers.heyoka",
    }
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
    module = METHODS[name]
    options = {key: (option.default, option.meaning) for key, option in module.OPTIONS.items()}
    return Method(name, module.ORDER, module.EVENTS, module.MODELS, options, *_availability(module))


def _availability(module):
    package = getattr(module, "PACKAGE", None)
    return (True, "") if package is None else (package.available(), package.note())


def _takers(pair):
    return [name for name, module in METHODS.items() if module.takes(pair)]


def refusal(pair, method):
    """Return why a method does not take a model, a clause; empty where it does."""
    module = METHODS[method]
    if module.takes(pair):
        return ""
    return (
        f"method = {method!r} is not allowed for this {type(pair).__name__}: it takes "
        f"{module.MODELS}"
    )


def choose(pair, method, options):
    """Return (name, module, options) for a pair: the method named, or "exact" or "taylor".

    Raises
    ------
    ValueError
        If the method is unknown or does not take the model, or an option is unknown or has an
        impossible value. Also an ImportError if the method's package is not installed.
    """
    if not is_model(pair):
        raise ValueError(
            f"pair = {pair!r} is not allowed: it must be a GearPair, OneDegreePair, SixDegreePair "
            "or DeadZoneOscillator"
        )
    if method is None:
        method = next((name for name in AUTOMATIC if METHODS[name].takes(pair)), None)
    # Where nothing is refused, no other method is loaded.
    if method not in tuple(METHODS) or refusal(pair, method):
        if method in REMOVED:
            raise ValueError(sentence(method))
        checks.one_of("method", method, tuple(METHODS))
        names = ", ".join(map(repr, _takers(pair)))
        raise ValueError(f"{refusal(pair, method)}; it must be one of {names}")
    available, note = _availability(METHODS[method])
    if not available:
        from gearlib.integrators.peers.package import MissingPackage

        raise MissingPackage(
            f"method = {method!r} needs a package that is not installed: {note}, or take one of "
            f"{', '.join(repr(name) for name in _takers(pair) if about(name).available)}"
        )
    known = METHODS[method].OPTIONS
    chosen = {name: option.default for name, option in known.items()}
    for name, value in checks.options(options).items():
        if name not in known:
            raise ValueError(
                f"options[{name!r}] = {value!r} is not allowed: method {method!r} knows "
                f"{', '.join(map(repr, known)) or 'no options'}"
            )
        chosen[name] = known[name].check(f"options[{name!r}]", value)
    return method, METHODS[method], chosen
