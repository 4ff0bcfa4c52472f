"""Classical Runge-Kutta in fixed steps over switches and contact, as Simulink's ode4 takes them."""

from functools import partial

from gearlib import checks
from gearlib.data import status
from gearlib.integrators import models_with_steps
from gearlib.integrators.each import run_each
from gearlib.integrators.option import Option
from gearlib.integrators.right_hand_sides import Linear
from gearlib.integrators.split import RANGE, TURN, Whole, within_range
from gearlib.kernels.steps import train_steps
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
        return _Trains(Linear(pair, tuning), steps_per_period).run(state, *arguments)
    return run_steps(pair.law(tuning), _SCHEME, steps_per_period, *state, *arguments)


def run_many(pair, *arguments, **options):
    """Run many tunings; see `gearlib.integrators`."""
    run_each(partial(run, pair, **options), *arguments)


class _Trains(Whole):
    """Equal steps of a mesh period."""

    #: Evaluations in one step.
    STAGES = 4

    def __init__(self, problem, steps_per_period):
        super().__init__(problem)
        self.steps = steps_per_period

    def go(self, z, codes):
        """Go through the run; return (z, status)."""
        h, problem, system = TURN / self.steps, self.problem, self.problem.system
        for n in range(self.first):
            self.add_strobe(n, z)
            closing = problem.closing
            z, taken, jam = train_steps.runge_kutta_period(system, closing, n, self.steps, z, RANGE)
            self.evaluations += self.STAGES * taken
            if jam or not within_range(z):
                return z, status.JAMMED if jam else status.OVERFLOW
        for n in range(self.first, self.periods):
            self.add_strobe(n, z)
            for i in range(self.steps):
                t = TURN * n + i * h
                new = train_steps.runge_kutta_step(system, t, h, z)
                self.evaluations += self.STAGES
                if problem.jammed(t + h, new):
                    return new, status.JAMMED
                if not within_range(new):
                    return new, status.OVERFLOW
                self.record(t, t + h, z, new, _line(t, h, z, new))
                z = new
        return z, status.OK


def _line(t, h, z, new):
    """Return the straight line from (t, z) to (t + h, new)."""
    return lambda times: z + (times[:, None] - t) / h * (new - z)
