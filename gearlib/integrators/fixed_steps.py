"""Fixed-step methods without events: classical Runge-Kutta, Newmark and generalised-alpha."""

import math
from functools import partial
from typing import Annotated, Any, Literal

import numpy as np

from gearlib.engines.codes import OK
from gearlib.integrators.method import Integrator, option
from gearlib.integrators.right_hand_sides import OneDegree, PiecewiseLinear, right_hand_side
from gearlib.integrators.run import MAX_STATE, MESH_PERIOD, Run
from gearlib.integrators.steps.fixed import (
    Scheme,
    tabulate_excitation,
    take_steps,
    take_train_steps,
)
from gearlib.parameters import CHOICE, Count, Fraction

#: Number of steps that are taken before they are recorded together.
_STEPS_PER_RECORD = 8_192


class FixedSteps(Integrator):
    """Base class of fixed-step methods; a subclass defines its `Scheme`."""

    EVENTS = "steps cross switches and contact changes, located by linear interpolation"
    OPTIONS = {"steps_per_period": option(200, Count, "number of equal steps per mesh period")}
    #: ``scheme(**options)`` returns the `Scheme` for all options other than `steps_per_period`.
    scheme: Any

    def create_run(self, model, tuning: float, steps_per_period: int, **options) -> Run:
        """Return the `Run` of a model at one tuning (mesh frequency / natural frequency).

        Each mesh period has `steps_per_period` equal steps. The other options, e.g. the treatment
        of contact, define the `Scheme`.
        """
        return _FixedStepRun(
            right_hand_side(model, tuning), steps_per_period, self.scheme(**options)
        )


class RungeKutta(FixedSteps):
    """The classical Runge-Kutta method, like Simulink's ode4."""

    ORDER = 4
    MODELS = f"{Integrator.MODELS}, or gear trains"

    def supports(self, model) -> bool:
        """Return whether the model is one mesh with one degree of freedom, or a gear train."""
        return model.has_pair_equation or bool(model.mesh_names)

    def scheme(self) -> Scheme:
        """Return the `Scheme` of the classical Runge-Kutta method."""
        return Scheme(runge_kutta=True)


class Newmark(FixedSteps):
    """Newmark's average-acceleration method, gamma = 1/2 and beta = 1/4."""

    ORDER = 2
    OPTIONS = {
        **FixedSteps.OPTIONS,
        "contact": option(
            "iterated",
            Annotated[Literal["frozen", "iterated"], CHOICE],
            "contact and damping frozen at the start of the step, or iterated to rounding error",
        ),
    }

    def scheme(self, contact: str) -> Scheme:
        """Return the `Scheme` for the treatment of contact, "frozen" or "iterated"."""
        return Scheme(runge_kutta=False, iterated=contact == "iterated", beta=0.25, gamma=0.5)


class GeneralisedAlpha(FixedSteps):
    """The generalised-alpha method, with numerical damping by its spectral radius.

    Chung, Hulbert: J. Appl. Mech. 60 (1993) 371-375. Mesh force and damping are evaluated at the
    fraction 1 - alpha_f of the step.
    """

    ORDER = 2
    OPTIONS = {
        **Newmark.OPTIONS,
        "spectral_radius": option(
            0.8,
            Fraction,
            "rho_inf, spectral radius at infinite frequency; 1: no numerical damping",
        ),
    }

    def scheme(self, contact: str, spectral_radius: float) -> Scheme:
        """Return the `Scheme` with Chung and Hulbert's optimal parameters.

        If `contact` is "frozen", a step uses contact and damping at its start; if it is "iterated",
        they are iterated until the equation of motion is satisfied. `spectral_radius`, from 0 to 1,
        is the spectral radius at infinite frequency, which determines the numerical damping.
        """
        alpha_m = (2.0 * spectral_radius - 1.0) / (spectral_radius + 1.0)
        alpha_f = spectral_radius / (spectral_radius + 1.0)
        shift = alpha_f - alpha_m
        beta, gamma = 0.25 * (1.0 + shift) ** 2, 0.5 + shift
        constants = {"alpha_m": alpha_m, "alpha_f": alpha_f, "beta": beta, "gamma": gamma}
        return Scheme(runge_kutta=False, iterated=contact == "iterated", **constants)


class _FixedStepRun(Run):
    """Run of a model with fixed steps."""

    def __init__(self, problem: OneDegree | PiecewiseLinear, steps_per_period: int, scheme: Scheme):
        """Store the right-hand side and the scheme, and tabulate the excitation of all steps.

        `problem` is the right-hand side of a model; a mesh period has `steps_per_period` steps.
        `scheme` is the Runge-Kutta or generalised-alpha method with its constants.
        """
        super().__init__(problem)
        self.steps_per_period, self.scheme = steps_per_period, scheme
        if isinstance(problem, OneDegree):
            # Position in a step at which the method evaluates stiffness and external force.
            middle_fraction = 0.5 if scheme.runge_kutta else 1.0 - scheme.alpha_f
            self.excitation = tabulate_excitation(problem.mesh, steps_per_period, middle_fraction)
            # With NaN, the first step computes the acceleration from the equation of motion.
            self.acceleration = math.nan

    def _take_steps(self, period: int, states: np.ndarray) -> int:
        """Take k steps from the start of mesh period number `period` and return the status.

        The first row of `states`, shape (k + 1, size), is the initial state, and the other rows are
        filled with the states at the step ends.
        """
        problem = self.problem
        if isinstance(problem, OneDegree):
            status, evaluations, self.acceleration = take_steps(
                problem.contact_law, self.scheme, self.excitation, self.acceleration, states
            )
        else:
            status, evaluations = take_train_steps(
                problem.system, problem.may_jam, period, self.steps_per_period, states, MAX_STATE
            )
        self.evaluations += evaluations
        return status

    def _interpolate(self, t: np.ndarray, states: np.ndarray, phases: np.ndarray) -> np.ndarray:
        """Return the states, (n, size), at mesh `phases`, (n,), by cubic Hermite interpolation.

        `t`, shape (k + 1,), are the phases of the step ends, and `states`, shape (k + 1, size), the
        states there. The cubic of a step matches the states and their derivatives at both ends.
        """
        # Index of the step in which each phase lies.
        i = np.clip(np.searchsorted(t, phases, side="right") - 1, 0, len(t) - 2)
        step_lengths = (t[i + 1] - t[i])[:, None]
        fraction, change = (phases - t[i])[:, None] / step_lengths, states[i + 1] - states[i]
        rates = self.problem.rates_at_step_ends(t[i], states[i], t[i + 1], states[i + 1])
        start_slope, end_slope = step_lengths * rates
        quadratic = 3.0 * change - 2.0 * start_slope - end_slope
        cubic = start_slope + end_slope - 2.0 * change
        return states[i] + fraction * (start_slope + fraction * (quadratic + fraction * cubic))

    def integrate(self, state: np.ndarray) -> tuple[np.ndarray, int]:
        """Integrate over the whole run from a state at phase 0; return (final state, status).

        Steps are taken in batches of whole mesh periods, and only the last batches are recorded.
        """
        steps, period = self.steps_per_period, 0
        periods_per_batch = max(1, _STEPS_PER_RECORD // steps)
        batch_states = np.empty((min(periods_per_batch, self.periods) * steps + 1, state.size))
        period_starts = MESH_PERIOD * np.arange(periods_per_batch + 1)[:, None]
        batch_phases = (period_starts + MESH_PERIOD / steps * np.arange(steps)).ravel()
        # The strobes (states at the starts of the last mesh periods) are also recorded.
        record_start = min(self.first_recorded, self.first_strobe)
        while period < self.periods:
            # Each batch of mesh periods is recorded either completely or not at all.
            next_stop = record_start if period < record_start else self.periods
            period_count = min(periods_per_batch, next_stop - period)
            states = batch_states[: period_count * steps + 1]
            states[0] = state
            status = self._take_steps(period, states)
            if status != OK:
                return states[-1], status
            if period >= record_start:
                t = batch_phases[: len(states)]
                self.record_steps(period, t, states, partial(self._interpolate, t, states))
            state, period = states[-1].copy(), period + period_count
        return state, OK


METHODS = {"rk4": RungeKutta(), "newmark": Newmark(), "generalised_alpha": GeneralisedAlpha()}
