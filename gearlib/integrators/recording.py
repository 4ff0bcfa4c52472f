"""A run of a method with steps, and its record: samples, extrema, times and changes of contact."""

import math

import numpy as np

from gearlib.data import status
from gearlib.engines import orbit
from gearlib.engines.codes import BACKLASH, INVERSE, NORMAL
from gearlib.engines.linear.record import FORCE_SUM, SUMMARY_COLUMNS
from gearlib.engines.orbit import Record
from gearlib.integrators.right_hand_sides import FAR, NEAR, codes_of
from gearlib.integrators.steps.equation_of_motion import SIDE

TURN = 2.0 * math.pi
#: Beyond it a motion has no digits left, or no room for squares.
RANGE = 1e150
#: Rounding of the phase of a long run: a period that starts so close to a step begins with it.
SAME_PHASE = 1e-9
#: Column of a summary that holds the time at each contact code.
_TIMES = {NORMAL: orbit.TIME_NORMAL, BACKLASH: orbit.TIME_BACKLASH, INVERSE: orbit.TIME_INVERSE}


def within_range(z):
    """Return whether a state is finite with room for the squares that are taken of it."""
    return bool(np.abs(z).max() < RANGE)


def next_code(code, last, gap):
    """Return the next contact code on the way from one to another."""
    return int(last) if code == BACKLASH else (BACKLASH if gap > 0.0 else -code)


class Run:
    """A run of a problem of `right_hand_sides`; a subclass goes through its span.

    Phases are counted from the start of a mesh period n, so that rounding does not grow with it.
    """

    def __init__(self, problem, **settings):
        self.problem, self.settings, self.evaluations = problem, settings, 0
        self.meshes = range(len(problem.gaps))
        # Time below the mean since phase 0, by contact code + 1 and mesh.
        spans = np.diff(problem.starts)[:, None] * problem.low
        self._below = np.concatenate([0.0 * spans[:, :1], np.cumsum(spans, axis=1)], axis=1)

    def go(self, z, codes):
        """Integrate over the whole span from state z; return the final state and the status."""
        raise NotImplementedError

    def run(self, state, span, samples, events, summary):
        """Run over a span and fill the tables; return the `Record`."""
        problem, m, periods = self.problem, len(self.meshes), span.periods
        self.first, self.periods, self.limit = periods - span.recorded, periods, span.max_events
        self.samples, self.taken = samples, 0
        self.per_period = len(samples) // span.recorded
        self.keep_events, self.events = len(events) > 0, []
        self.summary = np.empty((m, SUMMARY_COLUMNS))
        for row in self.summary:
            orbit.clear_summary(row)
        kept = min(periods, orbit.strobe_periods(problem.repeats))
        self.strobe, self.strobes = periods - kept, np.empty((m, kept + 1, 2))
        (z, codes), code, period = problem.start(state), status.OVERFLOW, 0
        if within_range(z):
            # What a diverging run overflows in is told by its status.
            with np.errstate(all="ignore"):
                z, code = self.go(z, codes)
        if code == status.OK:
            self.add_strobes(np.array([periods]), z[None])
            period = self._period()
        if self.events:
            # A step over several changes of contact notes them mesh by mesh.
            rows = sorted(self.events, key=lambda row: (*row[:2], row[-1]))
            events = np.array(rows)[:, : events.shape[1]]
        summary[...] = self.summary.reshape(*summary.shape[:-1], -1)[..., : summary.shape[-1]]
        events = events[: len(self.events) if code == status.OK else 0]
        final = np.ravel(problem.ends(TURN * periods, z))
        return Record(z, final, period, samples, events, summary, code, self.evaluations)

    def _period(self):
        """Return after how many mesh periods the strobes of all meshes repeat, 0: after none."""
        heights = self.summary[:, orbit.X_MAX] - self.summary[:, orbit.X_MIN]
        tuning, repeats = self.problem.tuning, self.problem.repeats
        periods = [
            orbit.orbit_period(strobes, tuning, height, repeats)
            for strobes, height in zip(self.strobes, heights, strict=True)
        ]
        return 0 if 0 in periods else math.lcm(*periods)

    def add_strobes(self, periods, states):
        """Keep the states, shape (k, size), at the starts of mesh periods, those of the last."""
        values = self.problem.observe(TURN * (periods % self.problem.repeats), states)
        self.strobes[:, periods - self.strobe] = np.transpose(values, (2, 1, 0))

    def record(self, n, t, z, dense, shown=()):
        """Record steps over switches and contact, whose contact is that of the states.

        Step ends lie at t, shape (k + 1,), counted from the start of mesh period n, with states z,
        shape (k + 1, size); contact changes on straight lines between them. ``dense(phases)``
        returns states between them; at the phases `shown` the solution is shown too.
        """
        problem, turn = self.problem, TURN * (n % self.problem.repeats)
        kept = np.arange(max(self.strobe, n), self.periods)
        starts = TURN * (kept - n)
        kept = kept[(starts > t[0] - SAME_PHASE) & (starts < t[-1])]
        if kept.size:
            self.add_strobes(kept, dense(TURN * (kept - n)))
        begin = TURN * (self.first - n)
        if t[-1] <= begin:
            return
        skipped = max(int(np.searchsorted(t, begin, side="right")) - 1, 0)
        t, z = t[skipped:], z[skipped:]
        nodes, states = t.copy(), z.copy()
        if t[0] < begin:
            nodes[0], states[0] = begin, dense(np.array([begin]))[0]
        self._add_samples(n, t[-1], dense)
        lines = problem.lines(turn + t, z)
        codes = codes_of(lines)
        # At the end of a step the stiffness just before it.
        before = problem.segment(turn + t[1:] - 2.0 * SIDE)
        after = np.append(problem.segment(turn + nodes[:-1]), before[-1])
        self._add_steps(turn + nodes, states, before, after, problem.codes(turn + nodes, states))
        if len(shown):
            shown = shown[shown > nodes[0]]
            self._add_points(turn + shown, dense(shown), problem.segment(turn + shown - 2.0 * SIDE))
        for j in self.meshes:
            same = codes[:-1, j] == codes[1:, j]
            unchanged = nodes[:-1][same], t[1:][same], codes[1:, j][same]
            stretches = [
                stretch
                for i in np.flatnonzero(~same).tolist()
                for stretch in self._changes(n, j, i, float(nodes[i]), t, z, lines, codes)
            ]
            changed = np.array(stretches).reshape(-1, 3).T
            begins, ends, during = (np.append(*a) for a in zip(unchanged, changed, strict=True))
            self._add_times(j, turn + begins, turn + ends, during)

    def record_phase(self, n, t, z, dense, segment, codes):
        """Record steps that begin and end within one segment and one phase of contact."""
        turn = TURN * (n % self.problem.repeats)
        segments = np.full(len(t), segment)
        # A sample that rounding puts just before the phase is one at its start.
        self._add_samples(n, t[-1], lambda s: dense(np.clip(s, t[0], t[-1])), segment, codes)
        self._add_steps(turn + t, z, segments[1:], segments, np.tile(codes, (len(t), 1)))
        for j in self.meshes:
            self._add_times(j, turn + t[:1], turn + t[-1:], codes[j : j + 1])

    def _add_samples(self, n, end, dense, segment=None, codes=None):
        """Fill the samples before `end`; segment and codes by default those of the state."""
        problem, turn = self.problem, TURN * (n % self.problem.repeats)
        before = (self.first - n) * self.per_period
        most = min(len(self.samples), int(end / TURN * self.per_period) - before + 2)
        phases = TURN * (np.arange(self.taken, most) + before) / max(self.per_period, 1)
        phases = phases[phases < end - SIDE]
        if not phases.size:
            return
        t, z = turn + phases, dense(phases)
        segments = problem.segment(t) if segment is None else np.full(len(t), segment)
        codes = problem.codes(t, z) if codes is None else np.tile(codes, (len(t), 1))
        self._add_points(t, z, segments, codes)
        rows = self.samples[self.taken : self.taken + len(t)]
        problem.fill(rows, t, z, segments, codes)
        self.taken += len(t)

    def _add_points(self, t, z, segments, codes=None):
        """Add states to the extrema; return their forces and the rates of these, shape (k, m)."""
        codes = self.problem.codes(t, z) if codes is None else codes
        forces, rates = self.problem.forces(t, z, segments, codes)
        s = self.summary
        for values, high, low in (
            (self.problem.observe(t, z)[0], orbit.X_MAX, orbit.X_MIN),
            (forces, orbit.FORCE_MAX, orbit.FORCE_MIN),
        ):
            s[:, high] = np.maximum(s[:, high], values.max(axis=0, initial=-math.inf))
            s[:, low] = np.minimum(s[:, low], values.min(axis=0, initial=math.inf))
        return forces, rates

    def _add_steps(self, t, z, before, after, codes):
        """Add steps to extrema and mean force, which takes forces and rates at their ends.

        Segments just before and after a step end may differ.
        """
        h, (forces, rates) = np.diff(t)[:, None], self._add_points(t, z, after, codes)
        last, last_rates = forces[1:].copy(), rates[1:].copy()
        i = np.flatnonzero(before != after[1:])
        if i.size:
            points = t[i + 1], z[i + 1], before[i], codes[i + 1]
            last[i], last_rates[i] = self._add_points(*points)
        areas = h / 2.0 * (forces[:-1] + last) + h * h / 12.0 * (rates[:-1] - last_rates)
        self.summary[:, FORCE_SUM] += areas.sum(axis=0)

    def _add_times(self, j, start, end, codes):
        """Add the times of mesh j at contact codes, each from a start to an end."""
        for code, column in _TIMES.items():
            a, b = start[codes == code], end[codes == code]
            self.summary[j, column] += (b - a).sum()
            if code != BACKLASH:
                low = self._time_below(j, code, b) - self._time_below(j, code, a)
                self.summary[j, orbit.TIME_LOW] += low.sum()

    def _time_below(self, j, code, t):
        """Return the time below the mean stiffness since phase 0, of a mesh at a contact code."""
        starts, table = self.problem.starts, self._below[code + 1, :, j]
        turns, inside = np.divmod(t, starts[-1])
        return turns * table[-1] + np.interp(inside, starts, table)

    def _changes(self, n, j, i, opening, t, z, lines, codes):
        """Note the changes of contact of mesh j in step i, which is recorded from `opening`.

        Returns rows (begin, end, contact code) of the stretches between them.
        """
        code, last = int(codes[i, j]), int(codes[i + 1, j])
        start, end, stretches = float(t[i]), float(t[i + 1]), []
        while code != last:
            after = next_code(code, last, self.problem.gaps[j])
            line = NEAR if NORMAL in (code, after) else FAR
            a, b = float(lines[i, line, j]), float(lines[i + 1, line, j])
            share = a / (a - b) if a != b else 0.0
            crossing = start + share * (end - start)
            if crossing > opening:
                self.add_event(n, crossing, z[i] + share * (z[i + 1] - z[i]), j, code, after)
                stretches.append((opening, crossing, code))
                opening = crossing
            code = after
        return [*stretches, (opening, end, code)]

    def add_event(self, n, t, z, j, before, after):
        """Note a change of contact of mesh j."""
        if before == NORMAL:
            self.summary[j, orbit.BOUNCES] += 1.0
        if self.keep_events:
            more = int(t // TURN)
            turn = TURN * (n % self.problem.repeats)
            speed = float(self.problem.observe(turn + t, z)[1][j])
            self.events.append((n + more, t - more * TURN, before, after, speed, j))
