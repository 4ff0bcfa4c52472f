"""The Dormand-Prince pair 4(5) with step control, without events, for sharp or smoothed contact."""

import numpy as np

from gearlib.engines.codes import OK
from gearlib.integrators.method import ABSOLUTE_TOLERANCE, RELATIVE_TOLERANCE, Integrator, option
from gearlib.integrators.right_hand_sides import OneDegree
from gearlib.integrators.run import MESH_PERIOD, Run
from gearlib.integrators.steps.embedded import DENSE_WEIGHTS, StepControl, take_embedded_steps
from gearlib.parameters import Positive

#: Number of steps that are taken before they are recorded together.
_STEPS_PER_RECORD = 1_024
#: Fractions of a step at which ode45 returns the solution by default ("Refine"), besides its ends.
_REFINEMENT = np.array([0.25, 0.5, 0.75])


class EmbeddedPair(Integrator):
    """The Dormand-Prince pair with the step control of MATLAB's ode45."""

    ORDER = 5
    EVENTS = "step control only; changes between step ends, by a straight line"
    OPTIONS = {
        "rtol": RELATIVE_TOLERANCE,
        "atol": ABSOLUTE_TOLERANCE,
        "max_step": option(
            None, Positive | None, "longest step, rad of mesh phase; None: a tenth of the run"
        ),
    }

    def create_run(self, model, tuning: float, rtol: float, atol: float, max_step) -> Run:
        """Return the `Run` of a model at one tuning (mesh frequency / natural frequency).

        `rtol` is the relative tolerance of a step, `atol` the absolute one in static deflections. A
        step is at most `max_step` rad of mesh phase long, by default (None) a tenth of the run.
        """
        return _AdaptiveRun(OneDegree(model, tuning), rtol=rtol, atol=atol, max_step=max_step)


class Smoothed(Integrator):
    """Contact smoothed by tanh, at a tight tolerance.

    The smoothed contact force differs from the exact force. Close to first contact it is too small
    by up to 0.14 / sharpness times the mean mesh force, and just out of contact it is negative by
    the same amount. At a contact event the errors add up to an impulse of order 1 / sharpness^2.
    Samples contain the smoothed force; their contact states follow from the displacement.
    """

    ORDER = 5
    EVENTS = "none: contact and damping change smoothly; stiffness switches by step control"
    OPTIONS = {
        "sharpness": option(
            100.0,
            Positive,
            "per static deflection, in H1 = (1 + tanh(sharpness x)) / 2, in H2 and in the damping",
        ),
        "rtol": option(1e-9, Positive, "tolerance of a step, relative and in static deflections"),
    }

    def create_run(self, model, tuning: float, sharpness: float, rtol: float) -> Run:
        """Return the `Run` of a model at one tuning (mesh frequency / natural frequency).

        The contact force is proportional to (1 + tanh(sharpness x)) / 2. `rtol` is the relative
        tolerance of a step, and also its absolute tolerance in static deflections.
        """
        return _AdaptiveRun(
            OneDegree(model, tuning, sharpness), rtol=rtol, atol=rtol, max_step=None
        )


class _AdaptiveRun(Run):
    """Run of a model with one degree of freedom and adaptive step lengths."""

    problem: OneDegree

    def integrate(self, state: np.ndarray) -> tuple[np.ndarray, int]:
        """Integrate over the whole run from a state (x, x') at phase 0; return (state, status).

        The status is EVENT_LIMIT if more than `max_events` steps are attempted in a mesh period.
        """
        problem, end = self.problem, MESH_PERIOD * self.periods
        rtol, atol, max_step = (self.solver_options[name] for name in ("rtol", "atol", "max_step"))
        step_control = StepControl(rtol, atol, max_step or 0.1 * MESH_PERIOD * self.periods)
        # Length of the next step, index of the current mesh period, steps attempted in it.
        progress = np.zeros(3)
        equation = problem.mesh, problem.contact_law, step_control
        t, states = np.zeros(_STEPS_PER_RECORD + 1), np.empty((_STEPS_PER_RECORD + 1, 2))
        stages = np.empty((_STEPS_PER_RECORD, len(DENSE_WEIGHTS), 2))
        states[0] = state
        # The strobes (states at the starts of the last mesh periods) are also recorded.
        record_start = MESH_PERIOD * min(self.first_recorded, self.first_strobe)
        # Each iteration takes up to _STEPS_PER_RECORD steps.
        while t[0] < end:
            count, status, evaluations = take_embedded_steps(
                equation, record_start, end, self.max_events, progress, t, states, stages
            )
            self.evaluations += evaluations
            if status != OK:
                return states[count], status
            self._record_steps(t[: count + 1], states[: count + 1], stages[:count])
            t[0], states[0] = t[count], states[count]
        return states[0].copy(), OK

    def _record_steps(self, t: np.ndarray, states: np.ndarray, stages: np.ndarray) -> None:
        """Record k steps, with extrema also at the points inside them that ode45 returns.

        `t` are the mesh phases of the step ends, shape (k + 1,), `states`, (k + 1, 2), the states
        there, and `stages`, (k, 7, 2), the derivatives (x', x'') at the seven Runge-Kutta stages.
        """
        # In records, phases are counted from the start of a mesh period.
        period, step_lengths = int(t[0] / MESH_PERIOD), np.diff(t)
        local_t = t - MESH_PERIOD * period
        # Coefficients of the powers 1 to 4 of the fraction of a step, shape (k, 2, 4).
        weighted_stages = np.tensordot(stages, DENSE_WEIGHTS, axes=(1, 0))
        coefficients = step_lengths[:, None, None] * weighted_stages

        def interpolate(phases: np.ndarray) -> np.ndarray:
            """Return the states, (n, 2), at phases inside the steps, (n,), by dense output.

            The dense output of each step is a polynomial of degree 4.
            """
            i = np.searchsorted(local_t, phases, side="right") - 1
            i = np.clip(i, 0, len(step_lengths) - 1)
            fraction = ((phases - local_t[i]) / step_lengths[i])[:, None]
            polynomial = coefficients[i, :, 3]
            for power in (2, 1, 0):
                polynomial = polynomial * fraction + coefficients[i, :, power]
            return states[i] + fraction * polynomial

        refined_phases = (local_t[:-1, None] + step_lengths[:, None] * _REFINEMENT).ravel()
        self.record_steps(period, local_t, states, interpolate, refined_phases)


METHODS = {"rk45": EmbeddedPair(), "smoothed": Smoothed()}
