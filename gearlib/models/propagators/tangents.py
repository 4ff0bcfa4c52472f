"""Tangents of a piecewise-linear motion: what it changes by with parameters and with its start.

Here the tables of `gearlib.kernels.slopes` are made, for the combinations of contacts that a motion
meets; the kernels take the tangents through it.
"""

from copy import copy
from typing import Any, NamedTuple

import numpy as np

from gearlib.kernels import orbit
from gearlib.kernels.codes import BACKLASH, INVERSE, NORMAL
from gearlib.kernels.slopes import recorded_slopes as recorded
from gearlib.kernels.slopes.itinerary import (
    ARC,
    COLUMNS,
    CROSSING,
    FROM,
    KIND,
    LEFT,
    MESH,
    MET,
    PERIOD,
    SWITCH,
    TO,
    itinerary,
)
from gearlib.kernels.slopes.through_arcs import Boundaries, Work, walk
from gearlib.kernels.slopes.turning_points import BOUNDS
from gearlib.models.propagators.slope_bases import bases_of

_TURN = 2.0 * np.pi
#: States this close, relative, repeat. So many repeats are worth a map.
_AT_REST, _LEAST_REPEATS = 1e-13, 4
#: So many repeats without an event, over the number of components, are worth a map.
_MANY = 2
#: Places at which curves are looked at, within a step of a Taylor series.
_PLACES = 8


class Motion(NamedTuple):
    """A motion through mesh periods, all of its events recorded."""

    states: np.ndarray  #: by phase at the start of each period, shape (periods, n)
    codes: tuple  #: contact of all meshes at the start
    events: np.ndarray  #: columns of `orbit` and the number of the mesh, shape (e, 6)


class Walk:
    """A motion with its tangents, period by period.

    Parameters
    ----------
    slopes : MatrixSlopes
    motion : Motion
    tangents : ndarray, shape (s, f + k)
        At the start: f of starts alone, then one for each direction.
    rates : bool
        Whether the first s tangents, an identity, are the map of small deviations whose rates are
        wanted.
    """

    def __init__(self, slopes, motion, tangents, rates=False):
        self.slopes, self.motion, self._rates = slopes, motion, rates
        self.k = len(slopes.near) - 1
        self.q = 1 + tangents.shape[1] - self.k
        #: The state, its tangents, and by directions what free tangents change by.
        self.block = self._block(motion.states[0], tangents)
        self._plan()
        #: The `recorded_slopes.Tables`, and whether an event in them is a grazing.
        self.tables: Any = None
        self.grazing = False

    def _block(self, state, tangents):
        more = self.k * (self.q - 1) if self._rates else 0
        block = np.zeros((1 + tangents.shape[1] + more, state.size))
        block[0], block[1 : 1 + tangents.shape[1], : self.slopes.size] = state, tangents.T
        return block

    def _plan(self):
        """Lay down the steps of the motion, and the tables of what they meet."""
        places, (states, codes, events) = self.slopes.places, self.motion
        m, e = len(codes), int(places.effect.max()) + 1
        rows = len(states) * (2 + int(np.diff(places.first).max()) * (1 + m)) + 2 * len(events)
        steps, times = np.empty((rows, COLUMNS), np.int64), np.empty((rows, 2))
        contacts, own = np.empty((rows, 2, m), np.int64), np.zeros(m, np.int64)
        codes = np.array(codes, np.int64)
        found = itinerary(places, codes, own, events, len(states), steps, times, contacts)
        self._steps, self._times, contacts = steps[:found], times[:found], contacts[:found]
        #: Contact codes and segments at the end.
        self.codes, self.segments = tuple(codes.tolist()), tuple(own.tolist())
        effects = places.effect[contacts[:, 0] + 1, contacts[:, 1], np.arange(m)]
        self._which, self._met = self._combinations(effects, contacts, e)
        self._begins = np.append(np.flatnonzero(self._steps[:, KIND] == PERIOD), found)
        pairs = [self.slopes.matrix(*one) for one in self._met]
        self._bases = bases_of(pairs[: 1 + self._which[self._steps[:, KIND] == ARC].max()])
        kind, j = self._steps[:, KIND], self._steps[:, MESH] * (self._steps[:, KIND] != PERIOD)
        old = places.effect[self._steps[:, FROM] + 1, self._steps[:, LEFT], j]
        new = places.effect[self._steps[:, TO] + 1, self._steps[:, MET], j]
        meets = np.flatnonzero((kind == CROSSING) | (kind == SWITCH))
        keys = (((j * 2 + (kind == SWITCH)) * e + old) * e + new)[meets]
        _, first, inverse = np.unique(keys, return_index=True, return_inverse=True)
        self._where = np.zeros(found, np.int64)
        self._where[meets] = inverse
        rows = meets[first]
        self._bounds = self._boundaries(pairs, self._steps[rows], old[rows], new[rows])
        self._work = self._storage()

    def _storage(self):
        """Return the `Work` of the block."""
        rows, full = len(self.block), self._bases.into.shape[2]
        return Work(
            self.block,
            np.zeros((rows, full)),
            np.zeros((rows, full)),
            np.empty((2, rows, full // 2), complex),
            np.empty(rows),
            np.empty(self.k),
            np.empty(self.k),
            np.empty((3, 6 * len(self.codes))),
            np.empty((BOUNDS, 3 * len(self.codes))),
        )

    def _combinations(self, effects, contacts, e):
        """Return (number of the combination of each step, (codes, segments) of each).

        Those of arcs come first.
        """
        if e ** effects.shape[1] < 2**62:
            effects = effects @ e ** np.arange(effects.shape[1])
        unique = {"axis": 0, "return_index": True, "return_inverse": True}
        _, first, which = np.unique(effects, **unique)
        which = which.ravel()
        order = np.argsort(~np.isin(np.arange(len(first)), which[self._steps[:, KIND] == ARC]))
        met = [tuple(map(tuple, contacts[i].tolist())) for i in first[order]]
        return np.argsort(order)[which], met

    def _boundaries(self, pairs, steps, old, new):
        """Return the `Boundaries` of crossings and switches, of meshes from `old` to `new`."""
        slopes, k, n = self.slopes, self.k, self.block.shape[1]
        count = max(len(steps), 1)
        table = Boundaries(
            np.zeros((count, n)),
            np.zeros((count, k, n)),
            np.zeros((count, n)),
            np.zeros((count, n)),
            np.zeros((count, k, n)),
            np.zeros((count, n, n)),
            np.zeros((count, k)),
            slopes.course,
            np.array([matrix.T for matrix, _ in pairs]),
            float(slopes.tuning),
        )
        for i, step in enumerate(steps):
            j, code, before, after = int(step[MESH]), int(step[FROM]), int(old[i]), int(new[i])
            if step[KIND] == CROSSING:
                flank = NORMAL if NORMAL in (code, int(step[TO])) else INVERSE
                lines, moved = slopes.lines[flank]
                table.row[i], table.row_slopes[i] = lines[j], moved[:, j]
                table.speed[i] = slopes.speed(flank, j)
                table.jump[i], table.jump_slopes[i] = slopes.jump(flank, j, before, after)
            else:
                table.difference[i] = slopes.difference(j, before, after).T
                table.moved[i] = slopes.moves(code, j, int(step[LEFT]), int(step[MET]))
        return table

    def on_a_line(self, close):
        """Return whether the start is on a flank line where the damping jumps, and moves off it."""
        slopes, z, own = self.slopes, self.block[0], slice(self.q, self.q + self.k)
        codes = self.motion.codes
        segments = (int(slopes.places.first[0]),) * len(codes)
        for flank, (rows, moved) in slopes.lines.items():
            reach = rows @ self.block[own].T + (moved @ z).T
            most = np.abs(rows) @ np.abs(self.block[own]).T + (np.abs(moved) @ np.abs(z)).T
            size = np.abs(rows * z).sum(axis=1)
            at = np.abs(rows @ z) <= close * size
            for j in np.flatnonzero(at & (np.abs(reach) > close * most).any(axis=1)):
                touching = (*codes[:j], flank, *codes[j + 1 :])
                effect = slopes.effects(touching, segments)[j]
                jump, _ = slopes.jump(flank, j, effect, 0)
                size = np.abs(slopes.matrix(touching, segments)[0]).max()
                if np.abs(jump).max() > close * size:
                    return True
        return False

    @property
    def tangents(self):
        """Those of the components that move, shape (s, f + k)."""
        return self.block[1 : self.q + self.k, : self.slopes.size].T

    @property
    def rates(self):
        """What the map of free tangents changes by, shape (k, s, f)."""
        own = self.block[self.q + self.k :, : self.slopes.size]
        return own.reshape(self.q - 1, self.k, self.slopes.size).transpose(1, 2, 0)

    def go(self, record_from=None, samples_per_period=0, events=0):
        """Go through all periods; return the `recorded_slopes.Tables` from one on, or None."""
        last = len(self.motion.states)
        end = last if record_from is None else record_from
        first, repeat = self._settled(end) if not self._rates else (-1, 0)
        if first >= 0:
            self._through_all(0, first)
            first = self._leap(first, repeat, end)
        self._through_all(max(first, 0), end)
        if record_from is not None:
            self.tables = self._recording(record_from, samples_per_period, events)
            self._through(end, last, True)
            self.tables.moved[:] = 0.0
            recorded.end_record(self.tables, self.q, self._work)
        return self.tables

    def _through_all(self, first, last):
        """Go through mesh periods; stretches of many without an event by the map of one."""
        repeat, n = self.slopes.repeats, self.block.shape[1]
        events = self.motion.events[:, orbit.EVENT_PERIOD].astype(int)
        marks = np.unique(
            np.concatenate([[first - 1], events[(events >= first) & (events < last)]])
        )
        for begin, end in zip(marks, [*marks[1:], last], strict=True):
            # In the first period behind an event, and in that of the start, contacts may differ.
            begin, quiet = max(begin, first), max(begin + 1, 1)
            count = (end - quiet) // repeat
            if count > _MANY * n and not self._rates:
                self._through(begin, quiet)
                self._by_map(quiet, repeat, count)
                begin = quiet + count * repeat
            self._through(begin, end)

    def _by_map(self, first, repeat, count):
        """Go through `count` repeats of the excitation without events by one linear map."""
        n, k, q = self.block.shape[1], self.k, self.q
        once = copy(self)
        once.q, once._rates = 1 + n, True
        once.block = np.zeros(((1 + n) * (1 + k), n))
        once.block[1 : 1 + n] = np.eye(n)
        once._work = once._storage()
        once._through(first, first + repeat)
        one, ahead = once.block[1 : 1 + n], once.block[1 + n + k :].reshape(n, k * n)
        rows = self.block[1:].copy()
        for i in range(count):
            rows = rows @ one
            rows[q - 1 :] += (self.motion.states[first + i * repeat] @ ahead).reshape(k, n)
        self.block[1:] = rows

    def _through(self, first, last, recording=False):
        """Go through mesh periods `first` to `last`, the latter left out."""
        own = slice(self._begins[first], self._begins[last])
        if self.tables is None:
            self.tables = self._recording(0, 0, 0)
        grazing = walk(
            self._bases,
            self._bounds,
            self.motion.states,
            self._steps[own],
            self._times[own],
            self._which[own],
            self._where[own],
            self.q,
            self._rates,
            self._work,
            recording,
            self.tables,
        )
        self.grazing = self.grazing or grazing

    def _recording(self, first, samples_per_period, events):
        """Return the `recorded_slopes.Tables` from a period on; without samples, empty ones."""
        own, k, m = self.slopes, self.k, len(self.codes)
        count, n, full = self._bases.into.shape
        begin = self._begins[first]
        met = np.unique(self._which[begin:]) if samples_per_period else np.empty(0, int)
        met = met[met < len(self._bases.into)]
        every = own.rows(*self._met[0])
        velocity, velocity_slopes = (one[..., m : 2 * m, :] for one in every)
        functionals = len(every[0])
        periods = len(self.motion.states) - first if samples_per_period else 0
        phase, codes = _TURN * first, np.zeros((count, m), np.int64)
        stiffness = np.zeros((count, m))
        rows, slopes = np.zeros((count, functionals, n)), np.zeros((count, k, functionals, n))
        of_states = np.zeros((count, full, functionals * k))
        curves, sizes = np.zeros((count, full, 6 * m)), np.zeros((count, 3, full // 2, 3 * m))
        lines = np.concatenate([own.lines[flank][0] for flank in (NORMAL, INVERSE)])
        for i in met:
            codes[i], segments = self._met[i]
            stiffness[i] = own.stiffness(tuple(codes[i].tolist()), segments)[0].real
            rows[i], slopes[i] = own.rows(*self._met[i])
            out, shift = self._bases.out[i], self._bases.shift[i].reshape(n, k, n)
            moved = (slopes[i] - rows[i] @ np.moveaxis(shift, 0, 2)) @ out.T
            of_states[i] = np.moveaxis(moved, 2, 0).reshape(full, -1)
            curve = np.concatenate([rows[i, :m], lines])
            rate = curve @ self._bounds.matrix[i].T
            curves[i] = out @ np.concatenate([curve, rate]).T
            # Shares of complex coordinates, whose rates follow by the matrix.
            half, matrix = full // 2, self._bases.matrix[i].T
            share = curves[i, :half, : 3 * m] - 1j * curves[i, half:, : 3 * m]
            sizes[i] = np.abs([np.linalg.matrix_power(matrix, j) @ share for j in (0, 1, 4)])
        best = np.full((4, m), -np.inf)
        best[1::2] = np.inf
        contacts = self._met[self._which[min(begin, len(self._which) - 1)]][0]
        return recorded.Tables(
            rows,
            slopes,
            np.ascontiguousarray(np.swapaxes(rows @ np.swapaxes(self._bases.out, 1, 2), 1, 2)),
            of_states,
            curves,
            sizes,
            velocity,
            velocity_slopes,
            lines @ self._bounds.matrix[0].T,
            codes,
            stiffness,
            own.places.low,
            own.longest / _PLACES,
            bool((own.position[0] == own.near[0]).all()),
            np.zeros((periods * samples_per_period, k, functionals)),
            np.zeros((events, 2, k)),
            np.zeros((4, m, k)),
            best,
            np.zeros((4, m, k)),
            np.array(contacts) == BACKLASH,
            np.zeros((m, k)),
            np.zeros(5, np.int64),
            np.zeros(1),
            _TURN * np.arange(len(self.motion.states)),
            phase + _TURN / max(samples_per_period, 1) * np.arange(periods * samples_per_period),
        )

    def _settled(self, end):
        """Return (period from which states before `end` repeat, after how many), or (-1, 0)."""
        states = self.motion.states[: end + 1]
        for repeat in (self.slopes.repeats * n for n in (1, 2, 3, 4)):
            size = np.abs(states[repeat:]).max(axis=1, initial=1.0)
            moving = np.abs(states[repeat:] - states[:-repeat]).max(axis=1) > _AT_REST * size
            first = int(np.flatnonzero(moving)[-1]) + 1 if moving.any() else 0
            first += -first % self.slopes.repeats
            if first + _LEAST_REPEATS * repeat < end:
                return first, repeat
        return -1, 0

    def _leap(self, first, repeat, end):
        """Go through periods that repeat, by powers of one linear map; return where it ends."""
        s, kept, columns = self.slopes.size, self.tangents.copy(), self.tangents.shape[1]
        # The map of a start, and what directions add in one repeat.
        once = copy(self)
        once.q = 1 + s
        start = np.hstack([np.eye(s), np.zeros((s, self.k))])
        once.block = once._block(self.motion.states[first], start)
        once._work = once._storage()
        once._through(first, first + repeat)
        power = np.zeros((s + columns, s + columns))
        power[:s, :s], power[s:, s:] = once.tangents[:, :s], np.eye(columns)
        power[:s, s + self.q - 1 :] = once.tangents[:, s:]
        count = (end - first) // repeat
        both = np.vstack([kept, np.eye(columns)])
        self.tangents[:] = np.linalg.matrix_power(power, count)[:s] @ both
        return first + count * repeat
