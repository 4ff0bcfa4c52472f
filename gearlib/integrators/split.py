"""Runs of solvers in Python and their record; runs split at switches and at contact.

`Recorded` is a run and what is recorded of it. `Split` goes from switch to switch and from contact
to contact; a subclass says how its solver takes one phase, which no event interrupts.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from gearlib.data import status
from gearlib.kernels import orbit
from gearlib.kernels.codes import BACKLASH, BOTH, INVERSE, NORMAL
from gearlib.kernels.overflow import within_range
from gearlib.kernels.steps.equation_of_motion import SIDE
from gearlib.kernels.steps.recording import add_stretch, add_values, note

_TURN = 2.0 * math.pi
#: Flank lines of `problems`: displacements over the normal and over the far flank.
NEAR, FAR = 0, 1


class Recorded:
    """A run and its record; subclasses say how the span is gone through."""

    def __init__(self, problem):
        self.problem = problem
        self.evaluations = 0

    def run(self, tuning, state, periods, record_periods, samples, events, limit, summary):
        """Run; arguments and returns as of `gearlib.integrators`."""
        orbit.clear_summary(summary)
        self.samples, self.events, self.summary, self.limit = samples, events, summary, limit
        self.per_period = samples.shape[0] // record_periods
        self.first, self.periods = periods - record_periods, periods
        self.taken, self.found = 0, 0
        self.kept = min(periods, orbit.strobe_periods(self.problem.repeats))
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
        period = orbit.orbit_period(self.strobes, tuning, height, self.problem.repeats)
        return x, v, period, self.events, self.found, code, self.evaluations

    def go(self, z, contact):
        """Go through the whole span from state z; return the state at its end and the status."""
        raise NotImplementedError

    def piece_at(self, t):
        """Return the piece of the stiffness just after a phase."""
        phase = (t + SIDE) % _TURN
        piece = int(np.searchsorted(self.problem.breaks, phase, side="right")) - 1
        return min(piece, len(self.problem.low) - 1)

    def contact_at(self, t, z):
        """Return the contact code of the displacement."""
        near, far = self.problem.lines(t, z)
        return NORMAL if near >= 0.0 else (INVERSE if far <= 0.0 else BACKLASH)

    def jammed(self, t, z):
        """Return whether both flanks touch at once, by more than rounding."""
        if not self.problem.closing:
            return False
        near, far = self.problem.lines(t, z)
        return near >= 0.0 and far < -1e-13 * max(1.0, np.abs(z).max())

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
        """Fill the samples before `end`; piece and contact by default those of the state.

        ``dense(phases)`` returns states, shape (k, m).
        """
        times = []
        for taken in range(self.taken, self.samples.shape[0]):
            t = _TURN * (self.first + taken / self.per_period)
            if t >= end - SIDE:
                break
            times.append(t)
        if not times:
            return
        for t, z in zip(times, dense(np.array(times)), strict=True):
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


class Exit(NamedTuple):
    """A flank line that ends a phase of contact."""

    line: int  #: NEAR or FAR
    direction: int  #: sign with which its displacement goes through zero
    after: int  #: the next contact code


def exits_of(contact, gap, closing=False):
    """Return the `Exit`s of a contact code at a backlash in static deflections.

    `closing`: whether both flanks might touch at once.
    """
    if contact == BACKLASH:
        far = [Exit(FAR, -1, INVERSE)] if gap < math.inf else []
        return [Exit(NEAR, 1, NORMAL), *far]
    after = BACKLASH if gap > 0.0 else -contact
    both = [Exit(FAR, -1, BOTH) if contact == NORMAL else Exit(NEAR, 1, BOTH)]
    own = [Exit(NEAR, -1, after) if contact == NORMAL else Exit(FAR, 1, after)]
    return own + both if closing else own


class Phase(NamedTuple):
    """What a solver made of one phase."""

    t: float  #: its end, from the start of the mesh period
    z: Any  #: the state there
    hit: int | None = None  #: which of the exits ended it; None: the end that was asked for
    points: Any = ()  #: pairs (phase, state) of step ends, where they are kept
    dense: Any = None  #: dense output ``dense(phases)``, where it is kept


class Stall(Exception):
    """A solver that could not go on."""


class Split(Recorded):
    """Runs from switch to switch, and from contact to contact.

    Phases are counted from the start of the mesh period, so that rounding does not grow with it.
    """

    #: How far off a line a phase starts that begins on it, in units of the largest coordinate: an
    #: event function that is zero there is found at once, or hides its next zero.
    OFF = 1e-14

    def off(self, z):
        """Return how far off a line a phase from state z starts: more than the rounding of z."""
        return self.OFF * max(1.0, np.abs(z).max())

    def solve(self, n, start, end, z, piece, contact, keep):
        """Return the `Phase` from (start, z) in mesh period n; a subclass does it.

        With `keep` it has points and dense output.

        Raises
        ------
        Stall
            If the solver cannot go on.
        """
        raise NotImplementedError

    def go(self, z, contact):
        """Go through the run; return (z, status)."""
        problem, breaks = self.problem, self.problem.breaks.tolist()
        pieces = range(len(problem.low))
        codes = NORMAL, BACKLASH, INVERSE
        self.exits = {code: exits_of(code, problem.gap, problem.closing) for code in codes}
        if self.jammed(0.0, z):
            return z, status.JAMMED
        for leave in self.exits[contact]:
            if problem.lines(0.0, z)[leave.line] == 0.0:
                z[0] -= leave.direction * self.off(z)
        done, z, contact, code = self.skip(z, contact)
        if code != status.OK:
            return z, code
        for n in range(done, self.periods):
            self.add_strobe(n, _TURN * n, z)
            keep, runs = n >= self.first, 0
            for piece in pieces:
                t, end = breaks[piece], breaks[piece + 1]
                while t < end:
                    runs += 1
                    if runs > self.limit:
                        return z, status.EVENT_LIMIT
                    try:
                        done = self.solve(n, t, end, z, piece, contact, keep)
                    except Stall:
                        grown = not within_range(*problem.observe(_TURN * n + t, z))
                        return z, status.OVERFLOW if grown else status.STALLED
                    if keep:
                        self._record(n, t, done, piece, contact)
                    t, z = done.t, done.z
                    if done.hit is not None:
                        leave = self.exits[contact][done.hit]
                        if leave.after == BOTH:
                            return z, status.JAMMED
                        contact = self._change(n, t, z, contact, leave)
            if not within_range(*problem.observe(_TURN * (n + 1), z)):
                return z, status.OVERFLOW
        return z, status.OK

    def skip(self, z, contact):
        """Go through unrecorded periods at once, if the solver can; see there for one that does.

        Returns (number of periods, z, contact code, status).
        """
        return 0, z, contact, status.OK

    def _record(self, n, start, done, piece, contact):
        turn = _TURN * n
        if self.taken < self.samples.shape[0]:
            # A sample that rounding puts just before the phase is one at its start.
            self.add_samples(
                turn + done.t,
                lambda times: done.dense(np.clip(times - turn, start, done.t)),
                piece,
                contact,
            )
        for t, z in done.points:
            self.add_point(turn + t, z, piece, contact)
        self.add_time(turn + start, turn + done.t, contact)

    def _change(self, n, t, z, contact, leave):
        """Put z on the line that ended a phase; return the new contact code."""
        at = _TURN * n + t
        z[0] += leave.direction * self.off(z) - self.problem.lines(at, z)[leave.line]
        if n >= self.first:
            self.add_event(at, z, contact, leave.after)
        return leave.after
