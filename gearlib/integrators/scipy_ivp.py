"""scipy's solvers of initial-value problems, as they come or split at switches and contact.

``events=False``: one run over the whole span, the loop of `scipy.integrate.solve_ivp` step by step,
so that dense output is kept only where it is looked at. ``events=True``: what a careful user
writes; `solve_ivp` ends at every switch of stiffness, and at contact by terminal events, and is
started again.
"""

import math
from functools import partial

import numpy as np

from gearlib import checks
from gearlib.data import status
from gearlib.integrators import trains_in_python
from gearlib.integrators.each import run_each
from gearlib.integrators.option import Option
from gearlib.integrators.right_hand_sides import problem_of
from gearlib.integrators.split import Phase, Recorded, Split, Stall
from gearlib.kernels.codes import BACKLASH, NORMAL
from gearlib.kernels.overflow import within_range
from gearlib.kernels.steps.equation_of_motion import SIDE

#: That of the solver: 5, 8, 5, or up to 12.
ORDER = None
EVENTS = "as option events says: none, or switches end a run and contact is a terminal event"
MODELS = "all: one or six degrees of freedom, gear trains"
SOLVERS = ("RK45", "DOP853", "Radau", "LSODA")
OPTIONS = {
    "solver": Option("RK45", partial(checks.one_of, choices=SOLVERS), f"one of {SOLVERS}"),
    "rtol": Option(1e-3, checks.finite_positive, "relative tolerance of a step"),
    "atol": Option(
        1e-6, checks.finite_positive, "absolute tolerance, static deflections and dx/dtau"
    ),
    "events": Option(
        False,
        partial(checks.one_of, choices=(False, True)),
        "whether runs are split at switches of stiffness and at contact",
    ),
}
_TURN = 2.0 * math.pi


def takes(pair):
    """Return whether it takes a model: it takes all."""
    return True


def run(pair, tuning, state, *arguments, solver, rtol, atol, events):
    """Run one tuning; see `gearlib.integrators`."""
    if pair.mesh_names:
        train = _SplitTrain if events else _WholeTrain
        problem = trains_in_python.Problem(pair, tuning)
        return train(problem, solver, rtol, atol).run(state, *arguments)
    kind = _Split if events else _Whole
    return kind(problem_of(pair, tuning), solver, rtol, atol).run(tuning, state, *arguments)


def run_many(pair, *arguments, **options):
    """Run many tunings; see `gearlib.integrators`."""
    run_each(partial(run, pair, **options), *arguments)


class _Whole(Recorded):
    """One run over the whole span."""

    def __init__(self, problem, solver, rtol, atol):
        super().__init__(problem)
        self.solver, self.rtol, self.atol = solver, rtol, atol

    def go(self, z, contact):
        """Go through the run; return (z, status)."""
        from scipy import integrate

        def rate(t, z):
            self.evaluations += 1
            return self.problem.rate(t, z, self.piece_at(t), self.contact_at(t, z))

        end, opening = _TURN * self.periods, _TURN * self.first
        solver = getattr(integrate, self.solver)(rate, 0.0, z, end, rtol=self.rtol, atol=self.atol)
        strobe, counted, period = self.periods - self.kept, 0, 0
        if strobe == 0:
            self.add_strobe(0, 0.0, z)
            strobe = 1
        while solver.status == "running":
            t, z = solver.t, solver.y.copy()
            if int(t // _TURN) > period:
                period, counted = int(t // _TURN), 0
            if counted >= self.limit:
                return z, status.EVENT_LIMIT
            counted += 1
            solver.step()
            if not within_range(*self.problem.observe(solver.t, solver.y)):
                return solver.y, status.OVERFLOW
            if self.jammed(solver.t, solver.y):
                return solver.y, status.JAMMED
            if solver.status == "failed":
                return z, status.STALLED
            if _TURN * strobe > solver.t and opening >= solver.t:
                continue
            dense = solver.dense_output()
            while strobe < self.periods and _TURN * strobe <= solver.t:
                self.add_strobe(strobe, _TURN * strobe, dense(_TURN * strobe))
                strobe += 1
            if opening < solver.t:
                self._record(max(t, opening), t, z, solver, dense)
        return solver.y, status.OK

    def _record(self, start, t, z, solver, dense):
        """Record the step from (t, z), from `start` on."""
        end, new = solver.t, solver.y
        lines = [np.array(self.problem.lines(*at)) for at in ((t, z), (end, new))]
        self.add_samples(end, lambda times: dense(times).T)
        state = dense(start)
        self.add_point(start, state, self.piece_at(start), self.contact_at(start, state))
        # At the end of a step the stiffness just before it.
        self.add_point(end, new, self.piece_at(end - 2.0 * SIDE), self.contact_at(end, new))
        code, last, at = self.contact_at(t, z), self.contact_at(end, new), start
        while code != last:
            after = last if code == BACKLASH else (BACKLASH if self.problem.gap > 0.0 else -code)
            which = 0 if NORMAL in (code, after) else 1
            share = lines[0][which] / (lines[0][which] - lines[1][which])
            crossing = t + share * (end - t)
            if crossing > start:
                self.add_time(at, crossing, code)
                self.add_event(crossing, z + share * (new - z), code, after)
                at = crossing
            code = after
        self.add_time(at, end, code)


class _Split(Split):
    """Runs of `solve_ivp` with terminal events."""

    def __init__(self, problem, solver, rtol, atol):
        super().__init__(problem)
        self.solver, self.rtol, self.atol = solver, rtol, atol

    def _crossings(self, n, contact):
        """Return the event functions of a contact code in mesh period n."""

        def crossing(line, direction):
            def function(t, z, *_):
                return self.problem.lines(_TURN * n + t, z)[line]

            function.terminal, function.direction = True, direction  # type: ignore[attr-defined]
            return function

        return [crossing(leave.line, leave.direction) for leave in self.exits[contact]]

    def solve(self, n, start, end, z, piece, contact, keep):
        """Take one phase; see `Split`."""
        from scipy.integrate import solve_ivp

        def rate(t, z):
            self.evaluations += 1
            return self.problem.rate(_TURN * n + t, z, piece, contact)

        done = solve_ivp(
            rate,
            (start, end),
            z,
            method=self.solver,
            rtol=self.rtol,
            atol=self.atol,
            dense_output=keep and self.taken < self.samples.shape[0],
            events=self._crossings(n, contact),
        )
        if done.status < 0:
            raise Stall
        hit = None
        if done.status == 1:
            hit = next(i for i, times in enumerate(done.t_events) if times.size)
        dense = (lambda times: done.sol(times).T) if done.sol is not None else None
        points = zip(done.t, done.y.T, strict=True)
        return Phase(done.t[-1], done.y[:, -1].copy(), hit, points, dense)


class _WholeTrain(trains_in_python.Whole):
    """One run of a gear train over the whole span."""

    def __init__(self, problem, solver, rtol, atol):
        super().__init__(problem)
        self.solver, self.rtol, self.atol = solver, rtol, atol

    def go(self, z):
        """Go through the run; return (z, status)."""
        from scipy import integrate

        kind = getattr(integrate, self.solver)
        end = _TURN * self.periods
        solver = kind(self.right_side, 0.0, z, end, rtol=self.rtol, atol=self.atol)
        self.add_strobe(0, z)
        period, counted = 0, 0
        while solver.status == "running":
            t, z = solver.t, solver.y.copy()
            if int(t // _TURN) > period:
                period, counted = int(t // _TURN), 0
            counted += 1
            if counted > self.limit:
                return z, status.EVENT_LIMIT
            solver.step()
            if not np.abs(solver.y).max() < trains_in_python.RANGE:
                return solver.y, status.OVERFLOW
            if self.problem.jammed(solver.t, solver.y):
                return solver.y, status.JAMMED
            if solver.status == "failed":
                return z, status.STALLED
            dense = solver.dense_output()
            for n in range(math.floor(t / _TURN) + 1, math.floor(solver.t / _TURN) + 1):
                self.add_strobe(n, dense(_TURN * n))
            self.record(t, solver.t, z, solver.y.copy(), dense)
        return solver.y, status.OK


class _SplitTrain(trains_in_python.Split):
    """Runs of `solve_ivp` with terminal events of all meshes."""

    def __init__(self, problem, solver, rtol, atol):
        super().__init__(problem)
        self.solver, self.rtol, self.atol = solver, rtol, atol

    def _crossing(self, mesh, line, direction):
        problem = self.problem
        row = (problem.system.near, problem.system.far)[line][mesh]

        def function(t, z):
            return row @ problem.full(t, z)

        function.terminal, function.direction = True, direction  # type: ignore[attr-defined]
        return function

    def solve(self, start, end, z, segment, codes, exits):
        """Take one phase; see `several_meshes.Split`."""
        from scipy.integrate import solve_ivp

        problem = self.problem

        def rate(t, z):
            self.evaluations += 1
            return problem.rate(problem.full(t, z), segment, codes)

        done = solve_ivp(
            rate,
            (start, end),
            z,
            method=self.solver,
            rtol=self.rtol,
            atol=self.atol,
            dense_output=self.keep,
            events=[self._crossing(*leave[:3]) for leave in exits],
        )
        if done.status < 0:
            raise Stall
        hit = None
        if done.status == 1:
            hit = next(exits[i][:2] for i, times in enumerate(done.t_events) if times.size)
        points = list(zip(done.t.tolist(), done.y.T, strict=True))
        return trains_in_python.Phase(done.t[-1], done.y[:, -1].copy(), hit, points, done.sol)
