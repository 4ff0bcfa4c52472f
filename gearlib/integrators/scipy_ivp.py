"""scipy's solvers of initial-value problems, as they come or split at switches and contact.

``events=False``: one run over the whole span, the loop of `scipy.integrate.solve_ivp` step by step,
so that dense output is kept only where it is looked at. ``events=True``: what a careful user
writes; `solve_ivp` ends at every switch of stiffness, and at contact by terminal events, and is
started again.
"""

from functools import partial

from gearlib import checks
from gearlib.data import status
from gearlib.integrators.each import run_each
from gearlib.integrators.option import Option
from gearlib.integrators.right_hand_sides import problem_of
from gearlib.integrators.split import TURN, Phase, Split, Stall, Whole, within_range

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


def takes(pair):
    """Return whether it takes a model: it takes all."""
    return True


def run(pair, tuning, state, *arguments, solver, rtol, atol, events):
    """Run one tuning; see `gearlib.integrators`."""
    kind = _Split if events else _Whole
    return kind(problem_of(pair, tuning), solver, rtol, atol).run(state, *arguments)


def run_many(pair, *arguments, **options):
    """Run many tunings; see `gearlib.integrators`."""
    run_each(partial(run, pair, **options), *arguments)


class _Whole(Whole):
    """One run over the whole span."""

    def __init__(self, problem, solver, rtol, atol):
        super().__init__(problem)
        self.solver, self.rtol, self.atol = solver, rtol, atol

    def go(self, z, codes):
        """Go through the run; return (z, status)."""
        from scipy import integrate

        kind, end = getattr(integrate, self.solver), TURN * self.periods
        solver = kind(self.right_side, 0.0, z, end, rtol=self.rtol, atol=self.atol)
        strobe, counted, period = max(self.strobe, 1), 0, 0
        self.add_strobe(0, z)
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
            if TURN * strobe > solver.t and TURN * self.first >= solver.t:
                continue
            dense = solver.dense_output()
            while strobe < self.periods and TURN * strobe <= solver.t:
                self.add_strobe(strobe, dense(TURN * strobe))
                strobe += 1
            self.record(t, solver.t, z, solver.y.copy(), lambda times, of=dense: of(times).T)
        return solver.y, status.OK


class _Split(Split):
    """Runs of `solve_ivp` with terminal events."""

    def __init__(self, problem, solver, rtol, atol):
        super().__init__(problem)
        self.solver, self.rtol, self.atol = solver, rtol, atol

    def _crossing(self, n, leave):
        """Return the event function of an exit in mesh period n."""

        def function(t, z):
            return self.problem.lines(TURN * n + t, z)[leave.line][leave.mesh]

        function.terminal = True  # type: ignore[attr-defined]
        function.direction = leave.direction  # type: ignore[attr-defined]
        return function

    def solve(self, n, start, end, z, segment, codes, exits):
        """Take one phase; see `Split`."""
        from scipy.integrate import solve_ivp

        def rate(t, z):
            self.evaluations += 1
            return self.problem.rate(TURN * n + t, z, segment, codes)

        done = solve_ivp(
            rate,
            (start, end),
            z,
            method=self.solver,
            rtol=self.rtol,
            atol=self.atol,
            dense_output=self.keep and len(self.rows) < self.samples,
            events=[self._crossing(n, leave) for leave in exits],
        )
        if done.status < 0:
            raise Stall
        hit = None
        if done.status == 1:
            hit = next(i for i, times in enumerate(done.t_events) if times.size)
        dense = (lambda times: done.sol(times).T) if done.sol is not None else None
        points = zip(done.t, done.y.T, strict=True)
        return Phase(done.t[-1], done.y[:, -1].copy(), hit, points, dense)
