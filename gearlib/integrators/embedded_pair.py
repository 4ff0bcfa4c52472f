"""The Dormand-Prince pair 4(5) under step control, of sharp or smoothed contact; no events."""

import numpy as np

from gearlib import checks
from gearlib.engines.codes import OK
from gearlib.integrators.method import ABSOLUTE, RELATIVE, Integrator, Option
from gearlib.integrators.recording import TURN, Run
from gearlib.integrators.right_hand_sides import OneDegree
from gearlib.integrators.steps.embedded import DENSE, Control, take_embedded_steps

#: Number of steps that are taken before they are recorded together.
_STEPS_PER_RECORD = 1_024
#: Shares of a step at which ode45 shows the solution by default ("Refine"), besides its ends.
_SHOWN = np.array([0.25, 0.5, 0.75])


def _max_step(name, value):
    return None if value is None else checks.finite_positive(name, value)


class EmbeddedPair(Integrator):
    """As MATLAB's ode45."""

    ORDER = 5
    EVENTS = "step control only; changes between step ends, by a straight line"
    OPTIONS = {
        "rtol": RELATIVE,
        "atol": ABSOLUTE,
        "max_step": Option(
            None, _max_step, "longest step, rad of mesh phase; None: a tenth of the run"
        ),
    }

    def solver(self, model, tuning, span, rtol, atol, max_step):
        """Return the `Run` of a model at one tuning over a span of mesh periods."""
        control = Control(rtol, atol, max_step or 0.1 * TURN * span.periods)
        return _Run(OneDegree(model, tuning), control=control)


class Smoothed(Integrator):
    """Contact smoothed by tanh, at a tight tolerance.

    Another model than the sharp law: up to 0.14 / sharpness of the mean mesh force is missing on
    the flanks, and as much pulls next to them. Crossed at a speed, both make an impulse of the
    order of 1 / sharpness^2. Samples hold the smoothed force; their contact code is that of the
    displacement.
    """

    ORDER = 5
    EVENTS = "none: contact and damping change smoothly; switches of stiffness by step control"
    OPTIONS = {
        "sharpness": Option(
            100.0,
            checks.finite_positive,
            "per static deflection, of H1 = (1 + tanh(sharpness x)) / 2; H2 and damping likewise",
        ),
        "rtol": Option(
            1e-9, checks.finite_positive, "tolerance of a step, relative and in static deflections"
        ),
    }

    def solver(self, model, tuning, span, sharpness, rtol):
        """Return the `Run` of a model at one tuning over a span of mesh periods."""
        control = Control(rtol, rtol, 0.1 * TURN * span.periods)
        return _Run(OneDegree(model, tuning, sharpness), control=control)


class _Run(Run):
    """A run under step control."""

    def go(self, z, codes):
        """Integrate over the whole span from state z; return the final state and the status."""
        problem, end, place = self.problem, TURN * self.periods, np.zeros(3)
        t, states = np.zeros(_STEPS_PER_RECORD + 1), np.empty((_STEPS_PER_RECORD + 1, 2))
        stages = np.empty((_STEPS_PER_RECORD, 7, 2))
        states[0], wanted = z, TURN * min(self.first, self.strobe)
        while t[0] < end:
            law = problem.law, problem.contact, self.settings["control"]
            count, code, evaluations = take_embedded_steps(
                *law, wanted, end, self.limit, place, t, states, stages
            )
            self.evaluations += evaluations
            if code != OK:
                return states[count], code
            self._record(t[: count + 1], states[: count + 1], stages[:count])
            t[0], states[0] = t[count], states[count]
        return states[0].copy(), OK

    def _record(self, t, z, stages):
        """Record steps that have been taken, with the points that ode45 shows."""
        n, h = int(t[0] / TURN), np.diff(t)
        local = t - TURN * n
        terms = h[:, None, None] * np.tensordot(stages, DENSE, axes=(1, 0))

        def between(phases):
            i = np.clip(np.searchsorted(local, phases, side="right") - 1, 0, len(h) - 1)
            share = ((phases - local[i]) / h[i])[:, None]
            total = terms[i, :, 3]
            for power in (2, 1, 0):
                total = total * share + terms[i, :, power]
            return z[i] + share * total

        shown = (local[:-1, None] + h[:, None] * _SHOWN).ravel()
        self.record(n, local, z, between, shown)


METHODS = {"rk45": EmbeddedPair(), "smoothed": Smoothed()}
