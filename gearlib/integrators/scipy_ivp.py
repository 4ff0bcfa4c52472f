"""scipy's solvers of initial-value problems, as they come or split at switches and contact.

``events=False``: one run over the whole span, the loop of `scipy.integrate.solve_ivp` step by step,
so that dense output is kept only where it is looked at. ``events=True``: what a careful user
writes; `solve_ivp` ends at every switch of stiffness, and at contact by terminal events, and is
started again.
"""

import math
from functools import partial

import numpy as np

from gearlib import checks, status
from gearlib.core import orbit
from gearlib.core.field import SIDE
from gearlib.core.march import within_range
from gearlib.core.mesh import BACKLASH, INVERSE, NORMAL
from gearlib.core.recording import add_stretch, add_values, note
from gearlib.integrators.each import run_each
from gearlib.integrators.option import Option
from gearlib.integrators.problems import problem_of
from gearlib.models.one_degree import OneDegreePair
from gearlib.models.six_degrees import SixDegreePair
from gearlib.pair import GearPair

#: That of the solver: 5, 8, 5, or up to 12.
ORDER = None
EVENTS = "as option events says: none, or switches end a run and contact is a terminal event"
MODELS = "all, one or six degrees of freedom"
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
#: How far off a line a run is started again: exactly on it the same event would be found again.
_OFF = 1e-14


def takes(pair):
    """Return whether the model is one of the library's."""
    return isinstance(pair, (GearPair, OneDegreePair, SixDegreePair))


def run(pair, tuning, state, *arguments, solver, rtol, atol, events):
    """Run one tuning; see `gearlib.integrators`."""
    march = _Split if events else _Whole
    return march(problem_of(pair, tuning), solver, rtol, atol).run(tuning, state, *arguments)


def run_many(pair, *arguments, **options):
    """Run many tunings; see `gearlib.integrators`."""
    run_each(partial(run, pair, **options), *arguments)


class _March:
    """A run and its record; subclasses say how the span is gone through."""

    def __init__(self, problem, solver, rtol, atol):
        self.problem, self.solver, self.rtol, self.atol = problem, solver, rtol, atol
        self.evaluations = 0

    def run(self, tuning, state, periods, record_periods, samples, events, limit, summary):
        """Run; arguments and returns as of `gearlib.integrators`."""
        orbit.clear_summary(summary)
        self.samples, self.events, self.summary, self.limit = samples, events, summary, limit
        self.per_period = samples.shape[0] // record_periods
        self.first, self.periods = periods - record_periods, periods
        self.taken, self.found = 0, 0
        self.kept = min(periods, orbit.STROBE_PERIODS)
        self.strobes = np.empty((self.kept + 1, 2))
        z, contact = self.problem.start(state)
        x, v = self.problem.observe(0.0, z)
        code = status.OVERFLOW
        if within_range(x, v):
            # What a diverging run overflows in is told by its status.
            with np.errstate(all="ignore"):
                z, code = self.go(z, contact)
            x, v = self.problem.observe(_TURN * periods, z)
        if code != status.OK:
            return x, v, 0, self.events, 0, code, self.evaluations
        self.strobes[self.kept] = x, v
        height = summary[orbit.X_MAX] - summary[orbit.X_MIN]
        period = orbit.orbit_period(self.strobes, tuning, height)
        return x, v, period, self.events, self.found, code, self.evaluations

    def piece_at(self, t):
        """Return the piece of the stiffness just after a phase."""
        phase = (t + SIDE) % _TURN
        piece = int(np.searchsorted(self.problem.breaks, phase, side="right")) - 1
        return min(piece, len(self.problem.low) - 1)

    def contact_at(self, t, z):
        """Return the contact code of the displacement."""
        near, far = self.problem.lines(t, z)
        return NORMAL if near >= 0.0 else (INVERSE if far <= 0.0 else BACKLASH)

    def add_strobe(self, n, t, z):
        """Keep the state at the start of period n, if it is one of the last."""
        row = n - (self.periods - self.kept)
        if row >= 0:
            self.strobes[row] = self.problem.observe(t, z)

    def add_point(self, t, z, piece, contact):
        """Add a state to the extrema; return its row of the sample table."""
        row = self.problem.sample(t, z, piece, contact)
        add_values(row[orbit.SAMPLE_X], row[orbit.SAMPLE_FORCE], self.summary)
        return row

    def add_samples(self, end, dense, piece=None, contact=None):
        """Fill the samples before `end`; piece and contact by default those of the state."""
        while self.taken < self.samples.shape[0]:
            t = _TURN * (self.first + self.taken / self.per_period)
            if t >= end - SIDE:
                break
            z = dense(t)
            p = self.piece_at(t) if piece is None else piece
            c = self.contact_at(t, z) if contact is None else contact
            self.samples[self.taken] = self.add_point(t, z, p, c)
            self.taken += 1

    def add_time(self, start, end, contact):
        """Add the time at one contact code."""
        problem = self.problem
        add_stretch(problem.breaks, problem.low, start, end, contact, self.summary)

    def add_event(self, t, z, before, after):
        """Note a change of contact."""
        n = int(t // _TURN)
        v = self.problem.observe(t, z)[1]
        self.events, self.found = note(
            self.events, self.found, n, t - n * _TURN, before, after, v, self.summary
        )


class _Whole(_March):
    """One run over the whole span."""

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
        self.add_samples(end, dense)
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


class _Split(_March):
    """Runs from switch to switch, and from contact to contact."""

    def _choices(self, contact):
        """Return rows (event function, line, next contact code) of a contact code."""

        def crossing(line, direction):
            def function(t, z, *_):
                return self.problem.lines(t, z)[line]

            function.terminal, function.direction = True, direction
            return function

        gap = self.problem.gap
        if contact == BACKLASH:
            rows = [(crossing(0, 1), 0, NORMAL)]
            return rows + [(crossing(1, -1), 1, INVERSE)] if gap < math.inf else rows
        after = BACKLASH if gap > 0.0 else -contact
        return [(crossing(0, -1), 0, after) if contact == NORMAL else (crossing(1, 1), 1, after)]

    def go(self, z, contact):
        """Go through the run; return (z, status)."""
        choices = {code: self._choices(code) for code in (NORMAL, BACKLASH, INVERSE)}
        breaks = self.problem.breaks
        for n in range(self.periods):
            self.add_strobe(n, _TURN * n, z)
            runs = 0
            for piece in range(len(self.problem.low)):
                t, end = _TURN * n + breaks[piece], _TURN * n + breaks[piece + 1]
                while t < end:
                    if runs >= self.limit:
                        return z, status.EVENT_LIMIT
                    runs += 1
                    done = self._solve(t, end, z, piece, contact, choices[contact], n)
                    z = done.y[:, -1].copy()
                    if not within_range(*self.problem.observe(done.t[-1], z)):
                        return z, status.OVERFLOW
                    if done.status < 0:
                        return z, status.STALLED
                    if n >= self.first:
                        self.add_samples(done.t[-1], done.sol, piece, contact)
                        for when, state in zip(done.t, done.y.T, strict=True):
                            self.add_point(when, state, piece, contact)
                        self.add_time(t, done.t[-1], contact)
                    t = done.t[-1]
                    if done.status == 1:
                        contact = self._change(done, t, z, contact, choices[contact], n)
        return z, status.OK

    def _solve(self, start, end, z, piece, contact, choices, n):
        from scipy.integrate import solve_ivp

        def rate(t, z):
            self.evaluations += 1
            return self.problem.rate(t, z, piece, contact)

        return solve_ivp(
            rate,
            (start, end),
            z,
            method=self.solver,
            rtol=self.rtol,
            atol=self.atol,
            dense_output=n >= self.first and self.taken < self.samples.shape[0],
            events=[choice[0] for choice in choices],
        )

    def _change(self, done, t, z, contact, choices, n):
        """Put z on the other side of the line that ended a run; return the new contact code."""
        hit = next(i for i, times in enumerate(done.t_events) if times.size)
        _, line, after = choices[hit]
        up = (contact, after) in ((BACKLASH, NORMAL), (INVERSE, BACKLASH), (INVERSE, NORMAL))
        z[0] += (_OFF if up else -_OFF) - self.problem.lines(t, z)[line]
        if n >= self.first:
            self.add_event(t, z, contact, after)
        return after
