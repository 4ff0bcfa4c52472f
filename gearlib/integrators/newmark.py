"""Newmark's average acceleration (gamma = 1/2, beta = 1/4) in fixed steps."""

from functools import partial

from gearlib import checks
from gearlib.integrators.each import run_each
from gearlib.integrators.models_with_steps import MODELS, takes
from gearlib.integrators.option import Option
from gearlib.kernels.steps.fixed import Scheme, run_steps

__all__ = ["EVENTS", "MODELS", "OPTIONS", "ORDER", "run", "run_many", "takes"]

ORDER = 2
EVENTS = "steps go over switches and contact; changes between step ends, by a straight line"
#: Shared with `gearlib.integrators.generalised_alpha`.
STEP_OPTIONS = {
    "steps_per_period": Option(
        200, partial(checks.integer, low=1), "equal steps of one mesh period"
    ),
    "contact": Option(
        "iterated",
        partial(checks.one_of, choices=("frozen", "iterated")),
        "contact and damping of the step start, or iterated until the residual is rounding",
    ),
}
OPTIONS = STEP_OPTIONS


def run(pair, tuning, state, *arguments, steps_per_period, contact):
    """Run one tuning; see `gearlib.integrators`."""
    scheme = Scheme(False, contact == "iterated", 0.0, 0.0, 0.25, 0.5)
    return run_steps(pair.law(tuning), scheme, steps_per_period, *state, *arguments)


def run_many(pair, *arguments, **options):
    """Run many tunings; see `gearlib.integrators`."""
    run_each(partial(run, pair, **options), *arguments)
