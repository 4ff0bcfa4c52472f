"""Classical Runge-Kutta in fixed steps over switches and contact, as Simulink's ode4 takes them."""

from functools import partial

from gearlib import checks
from gearlib.integrators.each import run_each
from gearlib.integrators.one_degree import MODELS, takes
from gearlib.integrators.option import Option
from gearlib.kernels.steps.fixed import Scheme, run_steps

__all__ = ["EVENTS", "MODELS", "OPTIONS", "ORDER", "run", "run_many", "takes"]

ORDER = 4
EVENTS = "steps go over switches and contact; changes between step ends, by a straight line"
OPTIONS = {
    "steps_per_period": Option(
        200, partial(checks.integer, low=1), "equal steps of one mesh period"
    )
}
_SCHEME = Scheme(True, False, 0.0, 0.0, 0.0, 0.0)


def run(pair, tuning, state, *arguments, steps_per_period):
    """Run one tuning; see `gearlib.integrators`."""
    return run_steps(pair.law(tuning), _SCHEME, steps_per_period, *state, *arguments)


def run_many(pair, *arguments, **options):
    """Run many tunings; see `gearlib.integrators`."""
    run_each(partial(run, pair, **options), *arguments)
