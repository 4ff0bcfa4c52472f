"""Classical Runge-Kutta in fixed steps over switches and contact, as Simulink's ode4 takes them."""

from functools import partial

from gearlib import checks
from gearlib.integrators import models_with_steps, trains_in_python
from gearlib.integrators.each import run_each
from gearlib.integrators.option import Option
from gearlib.kernels.steps.fixed import Scheme, run_steps

ORDER = 4
MODELS = f"{models_with_steps.MODELS}, or gear trains"
EVENTS = "steps go over switches and contact; changes between step ends, by a straight line"
OPTIONS = {
    "steps_per_period": Option(
        200, partial(checks.integer, low=1), "equal steps of one mesh period"
    )
}
_SCHEME = Scheme(True, False, 0.0, 0.0, 0.0, 0.0)


def takes(pair):
    """Return whether the model is one mesh with one degree of freedom, or a gear train."""
    return models_with_steps.takes(pair) or bool(pair.mesh_names)


def run(pair, tuning, state, *arguments, steps_per_period):
    """Run one tuning; see `gearlib.integrators`."""
    if pair.mesh_names:
        problem = trains_in_python.Problem(pair, tuning)
        return trains_in_python.FixedSteps(problem, steps_per_period).run(state, *arguments)
    return run_steps(pair.law(tuning), _SCHEME, steps_per_period, *state, *arguments)


def run_many(pair, *arguments, **options):
    """Run many tunings; see `gearlib.integrators`."""
    run_each(partial(run, pair, **options), *arguments)
