"""Runs of solvers in Python and their record; runs split at switches and at contact of any mesh.

`Recorded` is a run and what is recorded of it. `Whole` takes steps over everything; `Split` goes
from switch to switch and from contact to contact, where a subclass says how its solver takes one
phase, which no event interrupts.
"""

import itertools
import math
from typing import Any, NamedTuple

import numpy as np

from gearlib.data import status
from gearlib.kernels import orbit
from gearlib.kernels.codes import BACKLASH, BOTH, INVERSE, NORMAL
from gearlib.kernels.several_meshes.record import FORCE_SUM, SUMMARY_COLUMNS
from gearlib.kernels.steps.equation_of_motion import SIDE

TURN = 2.0 * math.pi
#: Flank lines of `right_hand_sides`.
NEAR, FAR = 0, 1
#: Beyond it a motion has no digits left, or no room for squares.
RANGE = 1e150


class Recorded:
    """A run and its record; subclasses say how the span is gone through."""

    def __init__(self, problem):
        self.problem, self.evaluations = problem, 0
        self.meshes = range(len(problem.gaps))
        # Time below the mean since phase 0, by contact code + 1 and mesh.
        spans = np.diff(problem.starts)[:, None] * problem.low
        self._below = np.concatenate([0.0 * spans[:, :1], np.cumsum(spans, axis=1)], axis=1)

    def run(self, state, periods, record_periods, samples, events, limit, summary):
        """Run; arguments and returns as of `gearlib.integrators`."""
        problem = self.problem
        self.summary, self.limit = np.empty((len(self.meshes), SUMMARY_COLUMNS)), limit
        for row in self.summary:
            orbit.clear_summary(row)
        self.summary[:, FORCE_SUM] = 0.0
        self.keep_events, self.found = len(events) > 0, []
        self.first, self.periods = periods - record_periods, periods
        self.samples, self.rows = len(samples), []
        self.per_period = len(samples) // record_periods
        kept = min(periods, orbit.strobe_periods(problem.repeats))
        self.strobe = periods - kept
        self.strobes = np.empty((len(self.meshes), kept + 1, 2))
        (z, codes), code, period = problem.start(state), status.OVERFLOW, 0
        if within_range(z):
            # What a diverging run overflows in is told by its status.
            with np.errstate(all="ignore"):
                z, code = self.go(z, codes)
        if code == status.OK:
            self.add_strobe(periods, z)
            period = self._period()
            if len(samples):
                problem.fill(self.rows, samples)
        if self.found:
            # A step over several changes of contact notes them mesh by mesh.
            rows = sorted(self.found, key=lambda row: (*row[:2], row[-1]))
            events = np.array(rows)[:, : events.shape[1]]
        summary[...] = self.summary.reshape(*summary.shape[:-1], -1)[..., : summary.shape[-1]]
        found = len(self.found) if code == status.OK else 0
        return *problem.ends(TURN * periods, z), period, events, found, code, self.evaluations

    def go(self, z, codes):
        """Go through the whole span from state z; return the state at its end and the status."""
        raise NotImplementedError

    def _period(self):
        found = []
        for row, strobes in zip(self.summary, self.strobes, strict=True):
            height = row[orbit.X_MAX] - row[orbit.X_MIN]
            args = self.problem.tuning, height, self.problem.repeats
            found.append(orbit.orbit_period(strobes, *args))
        return 0 if 0 in found else math.lcm(*found)

    def add_strobe(self, n, z):
        """Keep the state at the start of mesh period n, if it is one of the last."""
        if n >= self.strobe:
            self.strobes[:, n - self.strobe] = np.transpose(self.problem.observe(TURN * n, z))

    def add_point(self, t, z, segment, codes):
        """Add a state to the extrema; return its forces and their rates."""
        force, rate = self.problem.forces(t, z, segment, codes)
        s = self.summary
        for values, high, low in (
            (self.problem.observe(t, z)[0], orbit.X_MAX, orbit.X_MIN),
            (force, orbit.FORCE_MAX, orbit.FORCE_MIN),
        ):
            s[:, high], s[:, low] = np.maximum(s[:, high], values), np.minimum(s[:, low], values)
        return force, rate

    def add_force(self, h, start, end):
        """Add the mean force of a step by the forces and their rates at both ends."""
        (force, rate), (last, last_rate) = start, end
        self.summary[:, FORCE_SUM] += h / 2.0 * (force + last) + h * h / 12.0 * (rate - last_rate)

    def add_samples(self, end, dense, segment=None, codes=None):
        """Fill the samples before `end`; segment and codes by default those of the state.

        ``dense(phases)`` returns states, shape (k, size).
        """
        times = []
        while len(self.rows) + len(times) < self.samples:
            t = TURN * (self.first + (len(self.rows) + len(times)) / self.per_period)
            if t >= end - SIDE:
                break
            times.append(t)
        if not times:
            return
        for t, z in zip(times, dense(np.array(times)), strict=True):
            p = self.problem.segment(t) if segment is None else segment
            own = self.problem.codes(t, z) if codes is None else codes
            self.add_point(t, z, p, own)
            self.rows.append((t, np.array(z), p, own))

    def add_time(self, j, start, end, code):
        """Add the time of mesh j at one contact code."""
        row, table = self.summary[j], self._below[code + 1, :, j]
        column = {NORMAL: orbit.TIME_NORMAL, INVERSE: orbit.TIME_INVERSE}
        row[column.get(code, orbit.TIME_BACKLASH)] += end - start
        if code != BACKLASH:
            starts = self.problem.starts
            (a, x), (b, y) = (divmod(t, starts[-1]) for t in (start, end))
            below = np.interp((x, y), starts, table)
            row[orbit.TIME_LOW] += (b - a) * table[-1] + (below[1] - below[0])

    def add_event(self, t, z, j, before, after):
        """Note a change of contact of mesh j."""
        if before == NORMAL:
            self.summary[j, orbit.BOUNCES] += 1.0
        if self.keep_events:
            n = int(t // TURN)
            speed = float(self.problem.observe(t, z)[1][j])
            self.found.append((n, t - n * TURN, before, after, speed, j))


def within_range(z):
    """Return whether a state is finite with room for the squares that the kernels take."""
    return all(abs(x) < RANGE for x in z.tolist())


class Whole(Recorded):
    """Steps over switches and contact; contact is that of the state."""

    def right_side(self, t, z):
        """Return dz/dtau."""
        self.evaluations += 1
        return self.problem.field(t, z)

    def record(self, start, end, z, new, dense):
        """Record a step from (start, z) to (end, new), from where the record begins."""
        problem, opening = self.problem, max(start, TURN * self.first)
        if opening >= end:
            return
        self.add_samples(end, dense)
        state = z if opening == start else dense(np.array([opening]))[0]
        first = opening, state, problem.segment(opening), problem.codes(opening, state)
        # At the end of a step the stiffness just before it.
        last = end, new, problem.segment(end - 2.0 * SIDE), problem.codes(end, new)
        self.add_force(end - opening, self.add_point(*first), self.add_point(*last))
        lines = problem.lines(start, z), problem.lines(end, new)
        codes = problem.codes(start, z)
        for j in self.meshes:
            code, at = int(codes[j]), opening
            while code != last[3][j]:
                after = _after(code, last[3][j], problem.gaps[j])
                line = NEAR if NORMAL in (code, after) else FAR
                a, b = lines[0][line][j], lines[1][line][j]
                share = a / (a - b) if a != b else 0.0
                crossing = start + share * (end - start)
                if crossing > opening:
                    self.add_time(j, at, crossing, code)
                    self.add_event(crossing, z + share * (new - z), j, code, after)
                    at = crossing
                code = after
            self.add_time(j, at, end, code)


def _after(code, last, gap):
    """Return the next contact code on the way from one to another."""
    return int(last) if code == BACKLASH else (BACKLASH if gap > 0.0 else -code)


class Exit(NamedTuple):
    """A flank line that ends a phase of contact."""

    mesh: int
    line: int  #: NEAR or FAR
    direction: int  #: sign with which its distance goes through zero
    after: int  #: the next contact code of the mesh


class Phase(NamedTuple):
    """What a solver made of one phase."""

    t: float  #: its end, from the start of the mesh period
    z: Any  #: the state there
    hit: int | None = None  #: which of the exits ended it; None: the end that was asked for
    points: Any = ()  #: pairs (phase, state) of step ends, where they are kept; first the start
    dense: Any = None  #: dense output ``dense(phases)``, where it is kept


class Stall(Exception):
    """A solver that could not go on."""


class Split(Recorded):
    """Runs from switch to switch, and from contact to contact.

    Phases are counted from the start of the mesh period, so that rounding does not grow with it.
    What several meshes do at the same instant comes one after the other, in phases of no length.
    """

    #: How far off a line a phase starts that begins on it, in units of the state's norm: an event
    #: function that is zero there is found at once, or hides its next zero.
    OFF = 1e-14

    def __init__(self, problem):
        super().__init__(problem)
        starts, first = problem.starts, problem.first.tolist()
        #: Of each mesh period: rows (segment, its start, its end).
        self._pieces = []
        for a, b in itertools.pairwise(first):
            bounds = (starts[a : b + 1] - starts[a]).tolist()
            bounds[-1] = TURN
            self._pieces.append(list(zip(range(a, b), bounds, bounds[1:], strict=False)))

    def away(self, z):
        """Return how far off a line a phase from state z starts: more than the rounding of z."""
        return self.OFF * max(1.0, math.sqrt(z @ z))

    def solve(self, n, start, end, z, segment, codes, exits):
        """Return the `Phase` from (start, z) in mesh period n; a subclass does it.

        With points and dense output where the phase is recorded, `keep`.

        Raises
        ------
        Stall
            If the solver cannot go on.
        """
        raise NotImplementedError

    def exits(self, codes):
        """Return the `Exit`s of contact codes."""
        found = []
        for j, code in enumerate(codes.tolist()):
            gap = self.problem.gaps[j]
            if code == BACKLASH:
                found.append(Exit(j, NEAR, 1, NORMAL))
                if gap < math.inf:
                    found.append(Exit(j, FAR, -1, INVERSE))
            else:
                after, own = _after(code, BACKLASH, gap), NEAR if code == NORMAL else FAR
                found.append(Exit(j, own, -code, after))
                if self.problem.closing[j]:
                    found.append(Exit(j, FAR - own, -code, BOTH))
        return found

    def go(self, z, codes):
        """Go through the run; return (z, status)."""
        problem = self.problem
        if problem.jammed(0.0, z):
            return z, status.JAMMED
        for leave in self.exits(codes):
            if problem.lines(0.0, z)[leave.line][leave.mesh] == 0.0:
                problem.put(0.0, z, *leave[:2], -leave.direction * self.away(z))
        done, z, codes, code = self.skip(z, codes)
        if code != status.OK:
            return z, code
        exits = self.exits(codes)
        for n in range(done, self.periods):
            self.add_strobe(n, z)
            self.keep, runs = n >= self.first, 0
            for segment, t, end in self._pieces[n % len(self._pieces)]:
                while t < end:
                    runs += 1
                    if runs > self.limit:
                        return z, status.EVENT_LIMIT
                    # On a flank within rounding: the solver may see no change of sign.
                    hit = problem.due(TURN * n + t, z, exits, 0.5 * self.away(z))
                    if hit is None:
                        try:
                            phase = self.solve(n, t, end, z, segment, codes, exits)
                        except Stall:
                            return z, status.STALLED if within_range(z) else status.OVERFLOW
                        if self.keep:
                            self._record(n, t, phase, segment, codes)
                        t, z, hit = phase.t, phase.z, phase.hit
                    if hit is not None:
                        codes = self._change(TURN * n + t, z, codes, exits[hit])
                        exits = self.exits(codes)
                        if BOTH in codes:
                            return z, status.JAMMED
            if not within_range(z):
                return z, status.OVERFLOW
        return z, status.OK

    def skip(self, z, codes):
        """Go through unrecorded periods at once, if the solver can.

        Returns (number of periods, z, contact codes, status).
        """
        return 0, z, codes, status.OK

    def _record(self, n, start, phase, segment, codes):
        turn = TURN * n
        # A sample that rounding puts just before the phase is one at its start.
        self.add_samples(
            turn + phase.t,
            lambda times: phase.dense(np.clip(times - turn, start, phase.t)),
            segment,
            codes,
        )
        before = None
        for t, z in phase.points:
            after = self.add_point(turn + t, z, segment, codes)
            if before is not None:
                self.add_force(t - before[0], before[1], after)
            before = t, after
        for j, code in enumerate(codes.tolist()):
            self.add_time(j, turn + start, turn + phase.t, code)

    def _change(self, t, z, codes, leave):
        """Put z just beyond the line that ended a phase; return the new contact codes."""
        self.problem.put(t, z, *leave[:2], leave.direction * self.away(z))
        if self.keep:
            self.add_event(t, z, leave.mesh, int(codes[leave.mesh]), leave.after)
        codes = codes.copy()
        codes[leave.mesh] = leave.after
        return codes
