"""Gear trains for solvers in Python: right-hand side, record, and runs split at events.

States z hold coordinates in static deflections and their rates by theta, reference frequency times
time; runs go over the phase tau of the reference mesh. `Whole` takes steps over everything,
`Split` ends one at every switch of stiffness and at contact of every mesh, where a subclass says
how its solver takes one phase.
"""

import math
from bisect import bisect_right
from typing import Any, NamedTuple

import numpy as np

from gearlib.data import status
from gearlib.integrators.split import Stall
from gearlib.kernels import orbit
from gearlib.kernels.codes import BACKLASH, BOTH, INVERSE, NORMAL
from gearlib.kernels.several_meshes.record import FORCE_SUM
from gearlib.kernels.several_meshes.train_system import matrix_of
from gearlib.kernels.steps import train_steps as steps
from gearlib.kernels.steps.equation_of_motion import SIDE

_TURN = 2.0 * math.pi
#: How far from a flank line a phase starts that begins on it, in units of the largest coordinate,
#: as `gearlib.integrators.split.Split.OFF`.
_OFF = 1e-14
#: Beyond it a motion has no digits left.
RANGE = 1e150
#: Evaluations in one step of the classical Runge-Kutta method.
_STAGES = 4


class Problem:
    """A gear train at one tuning; n coordinates, m meshes."""

    def __init__(self, train, tuning):
        self.propagator = train.propagator(tuning, "exact")
        self.system, self.grid = self.propagator.system, self.propagator.grid
        self.tuning, self.size, self.repeats = tuning, train.size, train.repeats
        self.meshes = range(len(train.meshes))
        self.gaps = np.array([mesh.backlash for mesh in train.meshes])
        self._starts = self.system.starts.tolist()
        self._lines = np.concatenate([self.system.near, self.system.far])
        self._matrices: dict = {}
        # Moves of the coordinates that change the distance of one mesh only.
        half = self.size // 2
        lines = self.system.near[:, :half], self.system.far[:, :half]
        self._apart = [np.linalg.pinv(rows) for rows in lines]

    def start(self, state):
        """Return z for the initial state of a run."""
        return self.propagator.start(state) * self.propagator.scale

    def full(self, t, z):
        """Return z with the constant and the harmonics at a phase."""
        harmonics = self.system.harmonics
        whole = np.empty(self.size + 1 + 2 * harmonics.size)
        whole[: self.size], whole[self.size] = z, 1.0
        if not harmonics.size:
            return whole
        whole[self.size + 1 :: 2] = np.cos(harmonics * t)
        whole[self.size + 2 :: 2] = np.sin(harmonics * t)
        return whole

    def segment(self, t):
        """Return the segment of constant stiffness just after a phase."""
        at = bisect_right(self._starts, (t + SIDE) % (_TURN * self.repeats))
        return min(at, len(self._starts) - 1) - 1

    def codes(self, full):
        """Return the contact codes of distances, int, shape (m,)."""
        near, far = (self._lines @ full).reshape(2, -1)
        normal = near >= 0.0
        return normal * NORMAL + (~normal & (far <= 0.0)) * INVERSE

    def jammed(self, t, z):
        """Return whether both flanks touch at once in a mesh."""
        return steps.jammed(self.system, self.grid.closing, t, z)

    def rate(self, full, segment, codes):
        """Return dz/dtau."""
        key = segment, codes.tobytes()
        if key not in self._matrices:
            system, whole = self.system, np.empty_like(self.system.free)
            effects = np.array([system.effect[codes[j] + 1, segment, j] for j in self.meshes])
            matrix_of(system, effects, whole)
            self._matrices[key] = whole[: self.size] / self.tuning
        return self._matrices[key] @ full

    def forces(self, full, segment, codes):
        """Return (elastic forces of the meshes, their rates by phase), shape (m,) each."""
        s, grid = self.system, self.grid
        c = s.stiffness[codes + 1, segment, self.meshes] * (codes != BACKLASH)
        near = codes == NORMAL
        distance = np.where(near, s.near @ full, s.far @ full * (codes == INVERSE))
        speed = np.where(near, grid.rate @ full, grid.far_rate @ full)
        return c * distance, c * speed / self.tuning

    def off(self, t, z, mesh, line, side):
        """Put z just off a flank line of a mesh, to its positive (1) or negative (-1) side."""
        distance = float((self.system.near, self.system.far)[line][mesh] @ self.full(t, z))
        n = self.size // 2
        z[:n] += self._apart[line][:, mesh] * (side * _OFF * max(1.0, np.abs(z).max()) - distance)


class Recorded:
    """A run and its record; subclasses say how the span is gone through."""

    def __init__(self, problem):
        self.problem, self.evaluations = problem, 0

    def run(self, state, periods, record_periods, samples, events, limit, summary):
        """Run; arguments and returns as of `gearlib.models.propagators.base.Base.run`."""
        problem = self.problem
        for row in summary:
            orbit.clear_summary(row)
        summary[:, FORCE_SUM] = 0.0
        self.summary, self.limit = summary, limit
        self.keep_events, self.found = len(events) > 0, []
        self.first, self.periods = periods - record_periods, periods
        self.raw = np.empty((len(samples), problem.system.near.shape[1] + len(summary) + 1))
        self.per_period, self.taken = len(samples) // record_periods, 0
        kept = min(periods, orbit.strobe_periods(problem.repeats))
        self.strobes = np.empty((len(summary), kept + 1, 2))
        z, code = problem.start(state), status.OVERFLOW
        if np.abs(z).max() < RANGE:
            with np.errstate(all="ignore"):
                z, code = self.go(z)
        if code == status.OK:
            self.add_strobe(periods, z)
            if len(samples):
                problem.propagator.fill(self.raw, samples)
        if self.found:
            # A step over several changes of contact notes them mesh by mesh.
            events = np.array(sorted(self.found, key=lambda row: (*row[:2], row[-1])))
        half, ends = z.size // 2, z / problem.propagator.scale
        period = self._period() if code == status.OK else 0
        return ends[:half], ends[half:], period, events, len(self.found), code, self.evaluations

    def go(self, z):
        """Go through the whole span from z; return the state at its end and the status."""
        raise NotImplementedError

    def _period(self):
        found = []
        for row, strobes in zip(self.summary, self.strobes, strict=True):
            height = row[orbit.X_MAX] - row[orbit.X_MIN]
            args = self.problem.tuning, height, self.problem.repeats
            found.append(orbit.orbit_period(strobes, *args))
        return 0 if 0 in found else math.lcm(*found)

    def add_strobe(self, n, z):
        """Keep distances and rates at the start of mesh period n, if it is one of the last."""
        row = n - (self.periods + 1 - self.strobes.shape[1])
        if row >= 0:
            full = self.problem.full(_TURN * n, z)
            self.strobes[:, row, 0] = self.problem.system.near @ full
            self.strobes[:, row, 1] = self.problem.grid.rate @ full / self.problem.tuning

    def add_step(self, ends, states, segments, dense, codes=None):
        """Record a step, if it is within the recorded periods.

        Parameters
        ----------
        ends : pair of float
            Its phases; the first is not before the record.
        states : pair of ndarray
        segments : pair of int
            Just behind its start, just before its end.
        dense : callable
            Phase -> state.
        codes : ndarray of int, optional
            Contact throughout; by default that of the states, with changes on a straight line.
        """
        problem, summary, (start, end) = self.problem, self.summary, ends
        fulls = [problem.full(t, z) for t, z in zip(ends, states, strict=True)]
        each = [problem.codes(full) if codes is None else codes for full in fulls]
        marks = [problem.forces(*at) for at in zip(fulls, segments, each, strict=True)]
        for full, (force, _) in zip(fulls, marks, strict=True):
            self._add_extrema(problem.system.near @ full, force)
        h = end - start
        # By the forces and their rates at both ends.
        (force, rate), (last, last_rate) = marks
        summary[:, FORCE_SUM] += h / 2.0 * (force + last) + h * h / 12.0 * (rate - last_rate)
        while self.taken < len(self.raw):
            at = _TURN * (self.first + self.taken / self.per_period)
            if at >= end - SIDE:
                break
            full = problem.full(at, dense(max(at, start)))
            own = problem.codes(full) if codes is None else codes
            self.raw[self.taken] = *full, *own, segments[0]
            self._add_extrema(problem.system.near @ full, problem.forces(full, segments[0], own)[0])
            self.taken += 1
        for j in problem.meshes:
            self._add_mesh(j, ends, fulls, each[0][j], each[1][j], segments[0])

    def _add_extrema(self, distance, force):
        s = self.summary
        for values, high, low in (
            (distance, orbit.X_MAX, orbit.X_MIN),
            (force, orbit.FORCE_MAX, orbit.FORCE_MIN),
        ):
            s[:, high], s[:, low] = np.maximum(s[:, high], values), np.minimum(s[:, low], values)

    def _add_mesh(self, j, ends, fulls, code, last, segment):
        """Add times and changes of contact of one mesh in a step."""
        problem, (start, end) = self.problem, ends
        at = start
        while code != last:
            after = last if code == BACKLASH else (BACKLASH if problem.gaps[j] > 0.0 else -code)
            near = NORMAL in (code, after)
            line = (problem.system.near if near else problem.system.far)[j]
            begin, close = (float(line @ full) for full in fulls)
            share = begin / (begin - close) if begin != close else 0.0
            crossing = start + share * (end - start)
            self._add_time(j, crossing - at, code, segment)
            self.add_event(crossing, fulls[0] + share * (fulls[1] - fulls[0]), j, code, after)
            at, code = crossing, after
        self._add_time(j, end - at, code, segment)

    def _add_time(self, j, span, code, segment):
        low = self.problem.system.low[code + 1, segment, j]
        orbit.add_time(int(code), span, low, self.summary[j])

    def add_event(self, t, full, j, before, after):
        """Note a change of contact of mesh j."""
        if before == NORMAL:
            self.summary[j, orbit.BOUNCES] += 1.0
        if self.keep_events:
            n = int(t // _TURN)
            speed = float(self.problem.grid.rate[j] @ full) / self.problem.tuning
            self.found.append((n, t - n * _TURN, before, after, speed, j))


class Whole(Recorded):
    """Steps over switches and contact."""

    def right_side(self, t, z):
        """Return dz/dtau; contact is that of the state."""
        self.evaluations += 1
        return steps.rate(self.problem.system, t, z)

    def record(self, start, end, z, new, dense):
        """Record a step from (start, z) to (end, new), from where the record begins."""
        opening = max(start, _TURN * self.first)
        if opening < end:
            state = z if opening == start else dense(opening)
            pieces = self.problem.segment(opening), self.problem.segment(end - 2.0 * SIDE)
            self.add_step((opening, end), (state, new), pieces, dense)


class FixedSteps(Whole):
    """Classical Runge-Kutta in equal steps of a mesh period."""

    def __init__(self, problem, steps_per_period):
        super().__init__(problem)
        self.steps = steps_per_period

    def go(self, z):
        """Go through the run; return (z, status)."""
        h, system = _TURN / self.steps, self.problem.system
        for n in range(self.first):
            self.add_strobe(n, z)
            closing = self.problem.grid.closing
            z, taken, jam = steps.runge_kutta_period(system, closing, n, self.steps, z, RANGE)
            self.evaluations += _STAGES * taken
            if jam or not np.abs(z).max() < RANGE:
                return z, status.JAMMED if jam else status.OVERFLOW
        for n in range(self.first, self.periods):
            self.add_strobe(n, z)
            for i in range(self.steps):
                t = _TURN * n + i * h
                new = steps.runge_kutta_step(system, t, h, z)
                self.evaluations += _STAGES
                if self.problem.jammed(t + h, new):
                    return new, status.JAMMED
                if not np.abs(new).max() < RANGE:
                    return new, status.OVERFLOW
                self.record(t, t + h, z, new, _line(t, h, z, new))
                z = new
        return z, status.OK


def _line(t, h, z, new):
    """Return the straight line from (t, z) to (t + h, new)."""
    return lambda at: z + (at - t) / h * (new - z)


class Phase(NamedTuple):
    """What a solver made of one phase."""

    t: float  #: its end
    z: Any  #: the state there
    hit: Any = None  #: (mesh, line) of the flank that ended it; None: the end that was asked for
    points: Any = ()  #: pairs (phase, state) of step ends, the first is the start
    dense: Any = None  #: phase -> state


class Split(Recorded):
    """Runs from switch to switch, and from contact to contact of any mesh.

    What several meshes do at the same instant comes one after the other, in phases of no length.
    """

    def solve(self, start, end, z, segment, codes, exits):
        """Return the `Phase` from (start, z); a subclass does it.

        `exits` are (mesh, line, direction, next code) of the flanks that may be met. With points
        and dense output only where the phase is recorded, `keep`.

        Raises
        ------
        Stall
            If the solver cannot go on.
        """
        raise NotImplementedError

    def exits(self, codes):
        """Return (mesh, line, direction, next code) of the flanks that end contacts."""
        found = []
        for j, code in enumerate(codes.tolist()):
            gap = self.problem.gaps[j]
            if code == BACKLASH:
                found.append((j, 0, 1, NORMAL))
                if gap < math.inf:
                    found.append((j, 1, -1, INVERSE))
            else:
                after = BACKLASH if gap > 0.0 else -code
                found.append((j, 0, -1, after) if code == NORMAL else (j, 1, 1, after))
                if self.problem.grid.closing[j]:
                    found.append((j, 1, -1, BOTH) if code == NORMAL else (j, 0, 1, BOTH))
        return found

    def go(self, z):
        """Go through the run; return (z, status)."""
        problem, system = self.problem, self.problem.system
        codes = problem.codes(problem.full(0.0, z))
        if problem.jammed(0.0, z):
            return z, status.JAMMED
        for j in problem.meshes:
            # On a line, within rounding: in contact, which may end at once.
            for line, code, row in ((0, NORMAL, system.near), (1, INVERSE, system.far)):
                if abs(row[j] @ problem.full(0.0, z)) < _OFF:
                    codes[j] = code
                    problem.off(0.0, z, j, line, code)
                    break
        for n in range(self.periods):
            self.add_strobe(n, z)
            self.keep, runs = n >= self.first, 0
            number = n % problem.repeats
            first, last = system.first_segment[number : number + 2]
            for segment in range(first, last):
                t, end = _TURN * n + (system.starts[segment : segment + 2] - system.starts[first])
                if segment + 1 == last:
                    end = _TURN * (n + 1)
                while t < end:
                    runs += 1
                    if runs > self.limit:
                        return z, status.EVENT_LIMIT
                    exits = self.exits(codes)
                    hit = self._due(t, z, exits)
                    if hit is None:
                        try:
                            done = self.solve(t, end, z, segment, codes, exits)
                        except Stall:
                            grown = not np.abs(z).max() < RANGE
                            return z, status.OVERFLOW if grown else status.STALLED
                        if self.keep:
                            pairs = zip(done.points, done.points[1:], strict=False)
                            for (a, y), (b, x) in pairs:
                                own = segment, segment
                                self.add_step((a, b), (y, x), own, done.dense, codes)
                        t, z, hit = done.t, done.z, done.hit
                    if hit is not None:
                        codes = self._change(t, z, codes, exits, hit)
                        if BOTH in codes:
                            return z, status.JAMMED
            if not np.abs(z).max() < RANGE:
                return z, status.OVERFLOW
        return z, status.OK

    def _due(self, t, z, exits):
        """Return (mesh, line) of a flank that z is on or beyond, on its way out; or None.

        On it within rounding: the solver may see the other sign and no change of sign.
        """
        problem, full = self.problem, self.problem.full(t, z)
        rounding = 0.5 * _OFF * max(1.0, np.abs(z).max())
        near, far = problem.system.near @ full, problem.system.far @ full
        for j, line, direction, _ in exits:
            if direction * (near, far)[line][j] > -rounding:
                speed = (problem.grid.rate, problem.grid.far_rate)[line][j] @ full
                if direction * speed > 0.0:
                    return j, line
        return None

    def _change(self, t, z, codes, exits, hit):
        """Put z just beyond the line that ended a phase; return the new contact codes."""
        j, line, direction, after = next(leave for leave in exits if leave[:2] == hit)
        self.problem.off(t, z, j, line, direction)
        if self.keep:
            self.add_event(t, self.problem.full(t, z), j, int(codes[j]), after)
        codes = codes.copy()
        codes[j] = after
        return codes
