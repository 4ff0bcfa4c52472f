"""What all methods share: their description, options, needed package, and sweeps as a loop."""

import math
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from typing import Any, ClassVar, NamedTuple

import numpy as np

from gearlib import checks
from gearlib.data import status
from gearlib.data.summary import reach
from gearlib.engines import orbit


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
STEPS_PER_PERIOD = Option(200, partial(checks.integer, low=1), "equal steps of one mesh period")
RELATIVE = Option(1e-3, checks.finite_positive, "relative tolerance of a step")
ABSOLUTE = Option(
    1e-6, checks.finite_positive, "absolute tolerance, static deflections and dx/dtau"
)


class Integrator:
    """A method; a subclass gives `run` and, unless it takes one mesh, `takes`."""

    #: Order of its steps; None: closed forms, or several.
    ORDER: ClassVar[int | None] = None
    #: How it meets switches of stiffness and flank lines, and which models it takes, in words.
    EVENTS: ClassVar[str] = ""
    MODELS: ClassVar[str] = "one degree of freedom, any damping, stiffness and excitation"
    #: Name -> `Option`; the package it needs, None: none besides those of the library.
    OPTIONS: ClassVar[dict] = {}
    PACKAGE: ClassVar[Package | None] = None

    #: ``run(model, tuning, state, *record, **options)`` runs one tuning; `record` and returns are
    #: those of `gearlib.engines.pair.pair_run.run`, periods first, and the number of
    #: evaluations of the right-hand side.
    run: Any

    def takes(self, model):
        """Return whether it takes a model."""
        return model.one_mesh

    def run_many(self, model, *arguments, **options):
        """Run many tunings of a model; arguments as of `run_each` behind `run`."""
        run_each(partial(self.run, model, **options), *arguments)


def run_each(run, tunings, order, state, carry, span, rows):
    """Run ``tunings[order]`` one after the other, with the state carried along or not.

    ``run(tuning, state, *record)`` is one run of a method, see `Integrator.run`; `span` and `rows`
    are `Span` and `Rows` of `gearlib.runs.run_arguments`.
    """
    samples, events = np.empty((0, orbit.SAMPLE_COLUMNS)), np.empty((0, orbit.EVENT_COLUMNS))
    bound, summaries, ends, codes = rows
    current = state
    for i in order:
        record = span.periods, span.recorded, samples, events, span.limit, summaries[i]
        x, v, period, _, _, code, _ = run(float(tunings[i]), current, *record)
        if code == status.OK and reach(summaries[i]) > bound:
            code = status.OVERFLOW
        ok = code == status.OK
        if not ok:
            summaries[i] = math.nan
        ends[i] = np.ravel([x, v]) if ok else math.nan
        codes[i] = period, code
        current = (x, v) if ok and carry else state
