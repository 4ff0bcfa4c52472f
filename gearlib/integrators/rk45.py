"""The Dormand-Prince pair 4(5) under step control without event location, as MATLAB's ode45."""

import math
from functools import partial

from gearlib import checks
from gearlib.integrators.each import run_each
from gearlib.integrators.models_with_steps import MODELS, takes
from gearlib.integrators.option import Option
from gearlib.kernels.steps.embedded import Control, run_embedded

__all__ = ["EVENTS", "MODELS", "OPTIONS", "ORDER", "run", "run_many", "takes"]

ORDER = 5
EVENTS = "step control only; changes between step ends, by a straight line"


def _max_step(name, value):
    return None if value is None else checks.finite_positive(name, value)


OPTIONS = {
    "rtol": Option(1e-3, checks.finite_positive, "relative tolerance of a step"),
    "atol": Option(
        1e-6, checks.finite_positive, "absolute tolerance, static deflections and dx/dtau"
    ),
    "max_step": Option(
        None, _max_step, "longest step, rad of mesh phase; None: a tenth of the run"
    ),
}


def run(pair, tuning, state, periods, *arguments, rtol, atol, max_step):
    """Run one tuning; see `gearlib.integrators`."""
    longest = 0.1 * 2.0 * math.pi * periods if max_step is None else max_step
    control = Control(rtol, atol, longest)
    return run_embedded(pair.law(tuning), 0.0, control, *state, periods, *arguments)


def run_many(pair, *arguments, **options):
    """Run many tunings; see `gearlib.integrators`."""
    run_each(partial(run, pair, **options), *arguments)
