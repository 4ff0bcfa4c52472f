"""Base of all methods: description, options, needed package, sweeps; and the automatic methods."""

from collections.abc import Callable
from importlib.util import find_spec
from typing import Any, ClassVar, NamedTuple

from gearlib import checks
from gearlib.engines.protocol import run_each


class Option(NamedTuple):
    """One entry of a method's ``OPTIONS``."""

    default: Any
    check: Callable  #: ``check(name, value)`` returns the value or raises ValueError
    meaning: str


class MissingPackage(ImportError, ValueError):
    """A method was asked for whose package is not installed."""


class Package(NamedTuple):
    """The package that a method needs."""

    module: str  #: under which name it is imported
    distribution: str  #: under which name it is installed

    def available(self):
        """Return whether the package can be found; it is not imported."""
        return find_spec(self.module) is not None

    def note(self):
        """Return what to install, one clause."""
        return f"pip install {self.distribution}"


#: Options of several methods.
RELATIVE = Option(1e-3, checks.finite_positive, "relative tolerance of a step")
ABSOLUTE = Option(
    1e-6, checks.finite_positive, "absolute tolerance, static deflections and dx/dtau"
)


class Integrator:
    """A method; a subclass gives `solver` and, unless it takes one mesh, `takes`."""

    #: Order of its steps; None: closed forms, or several.
    ORDER: ClassVar[int | None] = None
    #: How it meets switches of stiffness and flank lines, and which models it takes, in words.
    EVENTS: ClassVar[str] = ""
    MODELS: ClassVar[str] = "one degree of freedom, any damping, stiffness and excitation"
    #: Name -> `Option`; the package it needs, None: none besides those of the library.
    OPTIONS: ClassVar[dict] = {}
    PACKAGE: ClassVar[Package | None] = None

    #: ``solver(model, tuning, span, **options)`` returns a `gearlib.integrators.recording.Run`.
    solver: Any

    def run(self, model, tuning, state, span, samples=0, keep_events=True, **options):
        """Run one tuning with so many samples in a recorded period; return a `Record`."""
        tables = model.empty_record(span.recorded * samples, int(keep_events))
        return self.solver(model, tuning, span, **options).run(state, span, *tables)

    def takes(self, model):
        """Return whether it takes a model."""
        return model.one_mesh

    def sweep(self, model, tunings, order, state, carry, span, rows, **options):
        """Run many tunings of a model; see `gearlib.engines.protocol.Base.sweep`."""

        def run(tuning, before):
            start = tuple(before.final) if before else state
            return self.run(model, tuning, start, span, keep_events=False, **options)

        run_each(run, tunings, order, carry, rows)


class Exact(Integrator):
    """Closed forms between events: linear damping and rectangular stiffness."""

    NAME = "exact"
    EVENTS = "phases end at switches and crossings, which are isolated by proof"
    MODELS = "linear damping with rectangular stiffness, one or six degrees of freedom"

    def takes(self, model):
        """Return whether a model has an engine for the method."""
        return self.NAME in model.propagators

    def run(self, model, tuning, state, span, samples=0, keep_events=True, **options):
        """Run one tuning; see `Integrator.run`."""
        engine = model.propagator(tuning, self.NAME, **options)
        return engine.run(engine.start(state), span, samples, keep_events=keep_events)

    def sweep(self, model, tunings, *arguments, **options):
        """Run many tunings; see `gearlib.engines.protocol.Base.sweep`."""
        model.propagator(tunings[0], self.NAME, **options).sweep(tunings, *arguments)


class Taylor(Exact):
    """Taylor steps of order 20 that end at events: every model of one degree of freedom."""

    NAME = "taylor"
    # Order and tolerance of `gearlib.engines.taylor.propagator`, which is loaded where it runs.
    ORDER = 20
    EVENTS = "steps end at switches and crossings, which are isolated in Bernstein form"
    MODELS = Integrator.MODELS
    OPTIONS = {
        "tolerance": Option(
            1e-16,
            checks.finite_positive,
            "truncation error of a step, static deflections; by default that of rounding",
        )
    }


METHODS = {"exact": Exact(), "taylor": Taylor()}
