"""Fixed steps over switches and contact: classical Runge-Kutta, Newmark, generalised-alpha."""

import math
from functools import partial
from typing import Any

import numpy as np

from gearlib import checks
from gearlib.engines.codes import OK
from gearlib.integrators.method import Integrator, Option
from gearlib.integrators.recording import RANGE, TURN, Run
from gearlib.integrators.right_hand_sides import OneDegree, problem_of
from gearlib.integrators.steps.fixed import Scheme, nodes, take_steps, take_train_steps

#: Number of steps that are taken before they are recorded together.
_STEPS_PER_RECORD = 8_192


class FixedSteps(Integrator):
    """A method in fixed steps; a subclass gives its `Scheme`."""

    EVENTS = "steps go over switches and contact; changes between step ends, by a straight line"
    OPTIONS = {
        "steps_per_period": Option(
            200, partial(checks.integer, low=1), "equal steps of one mesh period"
        )
    }
    #: ``scheme(**options)`` returns the `Scheme` of the options besides the steps.
    scheme: Any

    def solver(self, model, tuning, span, steps_per_period, **options):
        """Return the `Run` of a model at one tuning over a span of mesh periods."""
        return _Run(problem_of(model, tuning), steps_per_period, self.scheme(**options))


class RungeKutta(FixedSteps):
    """Classical Runge-Kutta, as Simulink's ode4."""

    ORDER = 4
    MODELS = f"{Integrator.MODELS}, or gear trains"

    def takes(self, model):
        """Return whether the model is one mesh with one degree of freedom, or a gear train."""
        return model.one_mesh or bool(model.mesh_names)

    def scheme(self):
        """Return the `Scheme`."""
        return Scheme(True)


class Newmark(FixedSteps):
    """Newmark's average acceleration, gamma = 1/2 and beta = 1/4."""

    ORDER = 2
    OPTIONS = {
        **FixedSteps.OPTIONS,
        "contact": Option(
            "iterated",
            partial(checks.one_of, choices=("frozen", "iterated")),
            "contact and damping of the step start, or iterated until the residual is rounding",
        ),
    }

    def scheme(self, contact):
        """Return the `Scheme`."""
        return Scheme(False, contact == "iterated", 0.0, 0.0, 0.25, 0.5)


class GeneralisedAlpha(FixedSteps):
    """The generalised-alpha method, with the numerical damping of its spectral radius.

    Chung, Hulbert: J. Appl. Mech. 60 (1993) 371-375. Mesh force and damping are those of the middle
    state at share 1 - alpha_f of the step.
    """

    ORDER = 2
    OPTIONS = {
        **Newmark.OPTIONS,
        "spectral_radius": Option(
            0.8,
            partial(checks.number, allowed="from 0 to 1", accept=lambda r: 0.0 <= r <= 1.0),
            "rho_inf: what is left per step of the fastest oscillations; 1: no numerical damping",
        ),
    }

    def scheme(self, contact, spectral_radius):
        """Return the `Scheme` of Chung and Hulbert's optimal parameters."""
        alpha_m = (2.0 * spectral_radius - 1.0) / (spectral_radius + 1.0)
        alpha_f = spectral_radius / (spectral_radius + 1.0)
        shift = alpha_f - alpha_m
        beta, gamma = 0.25 * (1.0 + shift) ** 2, 0.5 + shift
        return Scheme(False, contact == "iterated", alpha_m, alpha_f, beta, gamma)


class _Run(Run):
    """A run in equal steps of a mesh period."""

    def __init__(self, problem, steps, scheme):
        super().__init__(problem)
        self.steps, self.scheme = steps, scheme
        if isinstance(problem, OneDegree):
            share = 0.5 if scheme.runge_kutta else 1.0 - scheme.alpha_f
            self.nodes, self.acceleration = nodes(problem.law, steps, share), math.nan

    def take(self, period, states):
        """Fill states, shape (k + 1, size), from the first, at a period; return the status."""
        problem = self.problem
        if isinstance(problem, OneDegree):
            code, evaluations, self.acceleration = take_steps(
                problem.contact, self.scheme, self.nodes, self.acceleration, states
            )
        else:
            code, evaluations = take_train_steps(
                problem.system, problem.closing, period, self.steps, states, RANGE
            )
        self.evaluations += evaluations
        return code

    def between(self, t, z, phases):
        """Return states at phases: cubics through step ends (t, z) and the rates there."""
        i = np.clip(np.searchsorted(t, phases, side="right") - 1, 0, len(t) - 2)
        h = (t[i + 1] - t[i])[:, None]
        share, rise = (phases - t[i])[:, None] / h, z[i + 1] - z[i]
        first, last = h * self.problem.rates_of_steps(t[i], z[i], t[i + 1], z[i + 1])
        bend, twist = 3.0 * rise - 2.0 * first - last, first + last - 2.0 * rise
        return z[i] + share * (first + share * (bend + share * twist))

    def go(self, z, codes):
        """Integrate over the whole span from state z; return the final state and the status."""
        stretch, n = max(1, _STEPS_PER_RECORD // self.steps), 0
        table = np.empty((min(stretch, self.periods) * self.steps + 1, z.size))
        starts = TURN * np.arange(stretch + 1)[:, None]
        t = (starts + TURN / self.steps * np.arange(self.steps)).ravel()
        wanted = min(self.first, self.strobe)
        while n < self.periods:
            count = min(stretch, (wanted if n < wanted else self.periods) - n)
            states = table[: count * self.steps + 1]
            states[0] = z
            code = self.take(n, states)
            if code != OK:
                return states[-1], code
            if n >= wanted:
                phases = t[: len(states)]
                self.record(n, phases, states, partial(self.between, phases, states))
            z, n = states[-1].copy(), n + count
        return z, OK


METHODS = {
    "rk4": RungeKutta(),
    "newmark": Newmark(),
    "generalised_alpha": GeneralisedAlpha(),
}
