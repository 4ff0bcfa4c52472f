"""Tangents of a piecewise-linear motion: what it changes by with parameters and with its start.

The motion is gone through again from event to event. Between them z' = A z, so that a tangent
w = dz/dp at fixed phase obeys w' = A w + (dA/dp) z, and both have one Taylor series. Where dz/dtau
jumps at a phase that moves by dtau,

    w+ = w- + (f- - f+) dtau.

On a flank line row z = 0 the jump is as large as the speed, f- - f+ = s (row f), and the phase
moves by dtau = -(row w + (d row/dp) z) / (row f): the speed cancels. The rates of the map M of
small deviations, a product of those of arcs and of crossings, S = 1 - s row, follow in the same
way; see `docs/theory/sensitivities.md`.
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.kernels import orbit
from gearlib.kernels.codes import BACKLASH, INVERSE, NORMAL
from gearlib.kernels.exponential import ORDER, REACH
from gearlib.models.propagators.record import Record

#: An event slower than this, in static deflections by natural time, is a grazing: see
#: `gearlib.kernels.closed_form.sensitivity`.
SLOWEST = 1e-5
_TURN = 2.0 * math.pi
#: States this close, relative, repeat. So many repeats are worth a map, and so many times that
#: the same matrix goes over the same span.
_AT_REST, _WORTH, _OFTEN = 1e-13, 4, 8
#: Terms of a series below this share of the state are nothing.
_NOTHING = 1e-20


class Motion(NamedTuple):
    """A motion through mesh periods, all of its events recorded."""

    states: np.ndarray  #: by phase at the start of each period, shape (periods, n)
    codes: tuple  #: contact of all meshes at the start
    events: np.ndarray  #: columns of `orbit` and the number of the mesh, shape (e, 6)


class Walk:
    """A motion with its tangents, period by period.

    Parameters
    ----------
    varied : Varied
    motion : Motion
    tangents : ndarray, shape (s, f + k)
        At the start: f of starts alone, then one for each direction.
    rates : bool
        Whether the first s tangents, an identity, are the map of small deviations whose rates are
        wanted.
    """

    def __init__(self, varied, motion, tangents, rates=False):
        self.varied, self.motion = varied, motion
        self.k = len(varied.near) - 1
        n, columns = motion.states.shape[1], tangents.shape[1]
        self.free = columns - self.k
        #: The state, and its tangents.
        self.z = np.zeros((n, 1 + columns))
        self.z[:, 0] = motion.states[0]
        self.z[: varied.size, 1:] = tangents
        self.rates = np.zeros((self.k, varied.size, varied.size)) if rates else None
        self.grazing, self.record = False, None
        #: (Effects, span) -> how often it was met, or its `_map`.
        self._maps: dict = {}
        self.codes = motion.codes
        at = motion.events[:, orbit.EVENT_PERIOD].astype(int)
        self._events = [motion.events[at == i] for i in range(len(motion.states))]
        ((_, first), *_) = varied.cuts(0)
        self.segments = (first,) * len(self.codes)

    def on_a_line(self, close):
        """Return whether the start is on a flank line where the damping jumps, and moves off it."""
        varied = self.varied
        for flank, (rows, slopes) in varied.lines.items():
            reach = rows @ self.z[:, 1 + self.free :] + (slopes @ self.z[:, 0]).T
            size = np.abs(rows * self.z[:, 0]).sum(axis=1)
            at = np.abs(rows @ self.z[:, 0]) <= close * size
            for j in np.flatnonzero(at & reach.any(axis=1)):
                sides = [
                    ((*self.codes[:j], code, *self.codes[j + 1 :]), self.segments)
                    for code in (flank, BACKLASH)
                ]
                jump, _ = varied.jump(*sides, flank, j)
                if np.abs(jump).max() > close * np.abs(varied.matrix(*sides[0])[0]).max():
                    return True
        return False

    @property
    def tangents(self):
        """Those of the components that move, shape (s, f + k)."""
        return self.z[: self.varied.size, 1:]

    def go(self, record_from=None, samples_per_period=0):
        """Go through all periods; return the `Record` from one on, or None."""
        first, repeat = self._settled(record_from or 0)
        i = 0
        while i < len(self.motion.states):
            if i == first:
                i = self._leap(i, repeat, record_from)
                first = -1
            if i == record_from:
                start = _TURN * i
                self.record = Record(self.varied, self.free, samples_per_period, start, self.codes)
            self._through(i)
            i += 1
        return self.record

    def _settled(self, end):
        """Return (period from which states before `end` repeat, after how many), or (-1, 0)."""
        states = self.motion.states[: end + 1]
        for repeat in (self.varied.repeats * n for n in (1, 2, 3, 4)):
            size = np.abs(states[repeat:]).max(axis=1, initial=1.0)
            moving = np.abs(states[repeat:] - states[:-repeat]).max(axis=1) > _AT_REST * size
            first = int(np.flatnonzero(moving)[-1]) + 1 if moving.any() else 0
            first += -first % self.varied.repeats
            if first + _WORTH * repeat < end:
                return first, repeat
        return -1, 0

    def _leap(self, first, repeat, end):
        """Go through periods that repeat, by powers of one linear map; return where it ends."""
        s, columns = self.varied.size, self.z.shape[1] - 1
        # The map of a start, and what directions add in one repeat.
        tangents = np.hstack([np.eye(s), np.zeros((s, self.k))])
        once = Walk(self.varied, self.motion, tangents)
        once.codes, once.segments, once._maps = self.codes, self.segments, self._maps
        for i in range(first, first + repeat):
            once._through(i)
        power = np.zeros((s + columns, s + columns))
        power[:s, :s], power[s:, s:] = once.tangents[:, :s], np.eye(columns)
        power[:s, s + self.free :] = once.tangents[:, s:]
        count = (end - first) // repeat
        self.tangents[:] = np.linalg.matrix_power(power, count)[:s] @ np.vstack(
            [self.tangents, np.eye(columns)]
        )
        self.codes, self.segments = once.codes, once.segments
        return first + count * repeat

    def _through(self, i):
        """Go through period i from its start."""
        varied = self.varied
        self.z[:, 0], self.start = self.motion.states[i], _TURN * i
        stops = [(phase, None, p) for phase, p in varied.cuts(i % varied.repeats)]
        stops += [(row[orbit.EVENT_PHASE], row, None) for row in self._events[i]]
        t, whole = 0.0, True
        for phase, event, segment in sorted(stops, key=lambda stop: stop[0]):
            self._carry(t, phase, whole and event is None)
            t, whole = max(t, phase), event is None
            if event is None:
                self._switch(t, segment)
            else:
                self._cross(t, event)
        self._carry(t, _TURN, whole)

    def _carry(self, t, end, whole):
        """Go from phase t to `end` of a period; `whole` segments and steps have maps."""
        span, longest = end - t, self.varied.longest(self.segments)
        if self.record is None and self.rates is None and span > 0.0:
            if whole and self._by_map(span):
                return
            while span >= longest and self._by_map(longest):
                span -= longest
        if span <= 0.0:
            return
        matrix, slopes = self.varied.matrix(self.codes, self.segments)
        count = self._steps(span)
        h, flat = span / count, slopes.reshape(-1, len(matrix))
        share = REACH * h / longest
        for step in range(count):
            terms, size = [self.z], 1.0
            for j in range(1, ORDER + 4):
                size *= share / j
                term = matrix @ terms[-1]
                term[:, 1 + self.free :] += (flat @ terms[-1][:, 0]).reshape(self.k, -1).T
                terms.append(term * (h / j))
                if size < _NOTHING:
                    break
            if self.rates is not None:
                self._carry_rates(matrix, slopes, h, len(terms))
            if self.record is not None:
                own = self.codes, self.segments
                self.record.add(self.start + t + step * h, h, *own, np.array(terms))
            self.z = sum(reversed(terms))

    def _steps(self, span):
        """Return in how many steps to go over a span; rounding asks for no further one."""
        return math.ceil(span / self.varied.longest(self.segments) * (1.0 - 1e-12))

    def _by_map(self, span):
        """Go on by a span if that is worth a map; return whether it was."""
        key = self.varied.effects(self.codes, self.segments), span
        known = self._maps.get(key, 0)
        if not isinstance(known, tuple):
            self._maps[key] = self._map(span) if known == _OFTEN else known + 1
            return False
        one, ahead = known
        moved = (ahead @ self.z[:, 0]).reshape(self.k, -1).T
        self.z = one @ self.z
        self.z[:, 1 + self.free :] += moved
        return True

    def _map(self, span):
        """Return (the exponential over a span, its slopes), shapes (n, n) and (k n, n)."""
        matrix, slopes = self.varied.matrix(self.codes, self.segments)
        count = self._steps(span)
        one, ahead = np.eye(len(matrix)), np.zeros_like(slopes)
        whole, rates = one, ahead
        for j in range(1, ORDER + 4):
            ahead = (matrix @ ahead + slopes @ one) * (span / count / j)
            one = matrix @ one * (span / count / j)
            whole, rates = whole + one, rates + ahead
        one, ahead = whole, rates
        for _ in range(count - 1):
            rates, whole = one @ rates + ahead @ whole, one @ whole
        return whole, rates.reshape(-1, len(matrix))

    def _carry_rates(self, matrix, slopes, h, count):
        s = self.varied.size
        a, rates = matrix[:s, :s], slopes[:, :s, :s]
        one, all_ = self.z[:s, 1 : 1 + s], self.rates
        for j in range(1, count):
            all_ = (a @ all_ + rates @ one) * (h / j)
            one = a @ one * (h / j)
            self.rates = self.rates + all_

    def _cross(self, t, event):
        """Let a mesh cross a flank line at phase t of the period."""
        varied, j = self.varied, int(event[orbit.EVENT_COLUMNS])
        before, code = (self.codes, self.segments), int(event[orbit.EVENT_TO])
        after = (*self.codes[:j], code, *self.codes[j + 1 :]), self.segments
        flank = NORMAL if NORMAL in (self.codes[j], code) else INVERSE
        row, row_slopes = (one[..., j, :] for one in varied.lines[flank])
        matrix, _ = varied.matrix(*before)
        rate = matrix @ self.z[:, 0]
        speed = float(row @ rate)
        reach = row @ self.z[:, 1:]
        reach[self.free :] += row_slopes @ self.z[:, 0]
        slow = not abs(speed) * varied.tuning > SLOWEST
        moved = np.full(self.k, math.nan) if slow else -reach[self.free :] / speed
        jump, jump_slopes = varied.jump(before, after, flank, j)
        if self.rates is not None:
            s = varied.size
            one, saltation = self.z[:s, 1 : 1 + s], np.eye(s) - np.outer(jump, row)[:s, :s]
            own, other = (varied.matrix(*side)[0][:s, :s] for side in (before, after))
            change = moved[:, None, None] * (saltation @ own - other @ saltation)
            change -= jump_slopes[:, :s, None] * row[:s]
            self.rates = saltation @ self.rates + change @ one
        if self.record is not None:
            velocity, slopes = varied.rows(*before)
            place = len(self.codes) + j
            own = velocity[place] @ self.z[:, 1 + self.free :] + slopes[:, place] @ self.z[:, 0]
            own += velocity[place] @ rate * moved
            self.record.event(j, self.codes[j], code, self.segments[j], moved, own)
            self.grazing = self.grazing or slow
        self.z[:, 1:] -= np.outer(jump, reach)
        self.codes = after[0]

    def _switch(self, t, segment):
        """Let the stiffness of all meshes become that of another segment."""
        varied = self.varied
        if segment in self.segments:
            return
        for j, (code, old) in enumerate(zip(self.codes, self.segments, strict=True)):
            moved = varied.moves(code, j, old, segment)
            segments = (*self.segments[:j], segment, *self.segments[j + 1 :])
            if moved is not None:
                first, last = (
                    varied.matrix(self.codes, one)[0] for one in (self.segments, segments)
                )
                self.z[:, 1 + self.free :] += np.outer((first - last) @ self.z[:, 0], moved)
                if self.rates is not None:
                    s = varied.size
                    change = ((first - last)[:s, :s] @ self.z[:s, 1 : 1 + s])[None]
                    self.rates = self.rates + moved[:, None, None] * change
                if self.record is not None:
                    self.record.switch(j, varied.low(code, old, j), moved)
            self.segments = segments
