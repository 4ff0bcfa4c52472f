"""scipy's solvers of initial-value problems, as they come or split at switches and contact.

``events=False``: one run over the whole span, the loop of `scipy.integrate.solve_ivp` step by step,
so that dense output is kept only where it is looked at. ``events=True``: what a careful user
writes; `solve_ivp` ends at every switch of stiffness, and at contact by terminal events, and is
started again.
"""

from functools import partial

import numpy as np

from gearlib import checks
from gearlib.data import status
from gearlib.integrators.method import ABSOLUTE, RELATIVE, Integrator, Option
from gearlib.integrators.recording import TURN, Run, within_range
from gearlib.integrators.right_hand_sides import problem_of
from gearlib.integrators.split import Phase, Split, Stall

SOLVERS = ("RK45", "DOP853", "Radau", "LSODA")
#: Number of steps that are taken before they are recorded together.
_STEPS_PER_RECORD = 1_000


class Scipy(Integrator):
    """The solvers of scipy."""

    EVENTS = "as option events says: none, or switches end a run and contact is a terminal event"
    MODELS = "all: one or six degrees of freedom, gear trains"
    OPTIONS = {
        "solver": Option("RK45", partial(checks.one_of, choices=SOLVERS), f"one of {SOLVERS}"),
        "rtol": RELATIVE,
        "atol": ABSOLUTE,
        "events": Option(
            False,
            partial(checks.one_of, choices=(False, True)),
            "whether runs are split at switches of stiffness and at contact",
        ),
    }

    def takes(self, model):
        """Return True: the method can run all models."""
        return True

    def solver(self, model, tuning, span, solver, rtol, atol, events):
        """Return the `Run` of a model at one tuning over a span of mesh periods."""
        kind = _Split if events else _Whole
        return kind(problem_of(model, tuning), method=solver, rtol=rtol, atol=atol)


class _Whole(Run):
    """One run over the whole span."""

    def go(self, z, codes):
        """Integrate over the whole span from state z; return the final state and the status."""
        from scipy import integrate

        def rate(t, z):
            self.evaluations += 1
            return self.problem.field(t, z)

        tolerances = dict(self.settings)
        kind = getattr(integrate, tolerances.pop("method"))
        solver = kind(rate, 0.0, z, TURN * self.periods, **tolerances)
        counted, period, steps = 0, 0, []
        if self.strobe == 0:
            self.add_strobes(np.array([0]), z[None])
        while solver.status == "running":
            t, z = solver.t, solver.y.copy()
            if int(t // TURN) > period:
                period, counted = int(t // TURN), 0
            if counted >= self.limit:
                return z, status.EVENT_LIMIT
            counted += 1
            solver.step()
            if not within_range(solver.y):
                return solver.y, status.OVERFLOW
            if self.problem.jammed(solver.t, solver.y):
                return solver.y, status.JAMMED
            if solver.status == "failed":
                return z, status.STALLED
            recorded = solver.t > TURN * self.first
            if recorded or solver.t // TURN > max(t // TURN, self.strobe - 1):
                steps.append((t, z, solver.dense_output()))
            if steps and (not recorded or len(steps) == _STEPS_PER_RECORD):
                self._record(steps, solver)
                steps = []
        if steps:
            self._record(steps, solver)
        return solver.y, status.OK

    def _record(self, steps, solver):
        """Record steps (phase, state, dense output) up to the present state of a solver."""
        from scipy.integrate import OdeSolution

        starts, states, outputs = zip(*steps, strict=True)
        t, n = np.array([*starts, solver.t]), int(starts[0] // TURN)
        solution, turn = OdeSolution(t, outputs), TURN * n
        states = np.array([*states, solver.y])
        self.record(n, t - turn, states, lambda phases: solution(phases + turn).T)


class _Split(Split):
    """Runs of `solve_ivp` with terminal events."""

    def _distance(self, turn, leave, t, z):
        """Return the distance from the line of an exit, in the mesh period from `turn` on."""
        return self.problem.lines(turn + t, z)[leave.line][leave.mesh]

    def solve(self, turn, start, end, z, segment, codes, exits):
        """Take one phase; see `Split`."""
        from scipy.integrate import solve_ivp

        def rate(t, z):
            self.evaluations += 1
            return self.problem.rate(turn + t, z, segment, codes)

        events = [partial(self._distance, turn, leave) for leave in exits]
        for event, leave in zip(events, exits, strict=True):
            vars(event).update(terminal=True, direction=leave.direction)
        done = solve_ivp(
            rate,
            (start, end),
            z,
            dense_output=self.keep and self.taken < len(self.samples),
            events=events,
            **self.settings,
        )
        if done.status < 0:
            raise Stall
        hit = next((i for i, times in enumerate(done.t_events) if times.size), None)
        dense = (lambda times: done.sol(times).T) if done.sol is not None else None
        return Phase(done.t, done.y.T, hit, dense)


METHODS = {"scipy": Scipy()}
