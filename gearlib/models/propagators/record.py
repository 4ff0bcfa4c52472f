"""What derivatives of a piecewise-linear run record: samples, events, extrema, shares of time.

Pieces of the motion come as Taylor series of the state and its tangents. An extremum is a turning
point, the end of the record or, of a force, a switch of the stiffness: the first moves, but changes
nothing by that.
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from gearlib.kernels.codes import BACKLASH, INVERSE, NORMAL

#: A turning point this close to a flank line, in static deflections, is a grazing.
_CLOSEST = 1e-10
#: Phases closer than this are one.
_ONE = 1e-12
#: Places of a piece at which its series are looked at; so much beyond its ends that a turning point
#: right at one is seen, and how much higher a series may be in between, over the range of all.
_PLACES = np.array([-0.02, *np.linspace(0.0, 1.0, 9), 1.02])
_BETWEEN = 0.05
#: A turning point may lie so far outside its piece by rounding.
_OUTSIDE = 1e-9
#: What is higher by less than this share is not higher: ends of pieces next to a turning point.
_HIGHER = 1e-12
#: Pieces that are kept, at least, before those that matter are sifted out.
_MANY = 512
#: How exactly a turning point is placed within a piece.
_EXACT = 1e-15


class _Piece(NamedTuple):
    codes: tuple
    segments: tuple
    terms: np.ndarray  #: of the Taylor series over the piece, shape (J, n, 1 + f + k)
    #: Of position, distances from near and far flank, and force, shape (J, 4 m).
    curves: np.ndarray
    table: np.ndarray  #: their values at places, shape (11, 4 m)
    #: By what the ends move for each mesh, where a switch of its stiffness is, shape (2, m, k).
    moved: np.ndarray


class Record:
    """Filled piece by piece; m meshes, k directions, f tangents of starts."""

    def __init__(self, varied, free, samples_per_period, start, codes):
        self.varied, self.free = varied, free
        self.meshes, self.k = varied.near.shape[1], len(varied.near) - 1
        self._step = 2.0 * math.pi / samples_per_period if samples_per_period else math.inf
        self._start = start
        #: Derivatives of the recorded functionals, lists of (r, k); (phase, velocity) of events.
        self.samples: list = []
        self.events: list = []
        #: Times in normal mesh, backlash, inverse mesh, and in mesh at lower stiffness.
        self.times = np.zeros((4, self.meshes, self.k))
        self.apart = [code == BACKLASH for code in codes]
        #: Whether a turning point lies on a flank line.
        self.touching = self._begun = False
        self._taken, self._pieces = 0, []
        # How many of the pieces have been looked at for touches; with how many they are sifted.
        self._looked, self._most = 0, _MANY
        self._moved = np.zeros((self.meshes, self.k))

    def event(self, mesh, before, after, segment, moved, velocity):
        """Note an event that moves by `moved`, its velocity by `velocity`."""
        self.events.append((moved, velocity))
        places = {NORMAL: 0, BACKLASH: 1, INVERSE: 2}
        self.times[places[before], mesh] += moved
        self.times[places[after], mesh] -= moved
        for code, sign in ((before, 1.0), (after, -1.0)):
            if code != BACKLASH and self.varied.low(code, segment, mesh):
                self.times[3, mesh] += sign * moved
        self.apart[mesh] = True

    def switch(self, mesh, low, moved):
        """Note a switch from the lower stiffness or to it, in contact."""
        self.times[3, mesh] += moved if low else -moved
        if self._pieces:
            self._pieces[-1].moved[1, mesh] = moved
        self._moved[mesh] = moved

    def add(self, start, length, codes, segments, terms):
        """Take a piece: the terms of its series at `start` + s `length`, (J, n, 1 + f + k)."""
        rows, slopes = self.varied.rows(codes, segments)
        phases = []
        while (at := self._start + self._taken * self._step) < start + length - _ONE:
            phases.append(max(at - start, 0.0) / length)
            self._taken += 1
        if phases:
            at = np.tensordot(_powers(phases, len(terms)), terms, 1)
            own = rows @ at[..., 1 + self.free :]
            self.samples.extend(own + np.einsum("krn,sn->srk", slopes, at[..., 0]))
        m = self.meshes
        near, far = (self.varied.lines[flank][0] for flank in (NORMAL, INVERSE))
        curves = terms[:, :, 0] @ np.concatenate([rows[:m], near, far, rows[3 * m : 4 * m]]).T
        moved = np.stack([self._moved, np.zeros_like(self._moved)])
        table = _powers(_PLACES, len(terms)) @ curves
        if len(self._pieces) > self._most:
            self._sift()
        self._pieces.append(_Piece(codes, segments, terms, curves, table, moved))
        self._moved = np.zeros_like(self._moved)

    def extrema(self):
        """Return the derivatives of largest and smallest displacement and force, (4, m, k)."""
        m = self.meshes
        found = np.zeros((4, m, self.k))
        self._sift()
        for j in range(m):
            floor = 0.0 if self.apart[j] else -math.inf
            for place, sign in enumerate((1.0, -1.0)):
                found[place, j] = self._extremum(j, j, sign, -math.inf)
                found[2 + place, j] = self._extremum(j, 3 * m + j, sign, floor)
        return found

    def _sift(self):
        """Look for touches, and keep the pieces that may have an extremum, and the last."""
        m = self.meshes
        self.touching |= any(self._touches(column) for column in range(m, 3 * m))
        self._begun = True
        columns = [*range(m), *range(3 * m, 4 * m)]
        near = [self._near(column, sign)[0] for column in columns for sign in (1.0, -1.0)]
        kept = np.unique(np.concatenate([*near, [len(self._pieces) - 1]]))
        self._pieces = [self._pieces[i] for i in kept]
        # A slow mesh rests: where most pieces stay, twice as many may come before the next look.
        self._looked, self._most = len(kept), max(_MANY, 2 * len(kept))

    def _near(self, column, sign):
        """Return the pieces that may hold the largest `sign` times a curve, and its reach."""
        table = np.array([piece.table[1:-1, column] for piece in self._pieces])
        tops, reach = (sign * table).max(axis=1), np.ptp(table) + np.abs(table).max()
        return np.flatnonzero(tops >= tops.max() - _BETWEEN * reach), reach

    def _extremum(self, mesh, column, sign, best):
        """Return the derivatives of the largest `sign` times a curve of a mesh, or of `best`."""
        (numbers, reach), slope = self._near(column, sign), np.zeros(self.k)
        near = [self._pieces[i] for i in numbers]
        turning = [(piece, s, None) for piece in near for s in _turning(piece, column)]
        ends = [(piece, float(end), end) for piece in near for end in (0, 1)]
        for piece, s, end in turning + ends:
            value = sign * (_powers([s], len(piece.terms)) @ piece.curves[:, column])[0]
            if value > best + _HIGHER * reach:
                best, slope = value, self._slope(piece, mesh, column, s, end)
        return slope

    def _slope(self, piece, mesh, column, s, end):
        """Return the derivatives of a curve at a place, (k,); an end moves with its switch."""
        rows, slopes = self.varied.rows(piece.codes, piece.segments)
        at = np.tensordot(_powers([s], len(piece.terms))[0], piece.terms, 1)
        found = rows[column] @ at[:, 1 + self.free :] + slopes[:, column] @ at[:, 0]
        if end is not None and piece.moved[end, mesh].any():
            matrix, _ = self.varied.matrix(piece.codes, piece.segments)
            found = found + rows[column] @ matrix @ at[:, 0] * piece.moved[end, mesh]
        return found

    def _touches(self, column):
        """Return whether a turning point of a distance from a flank lies on its line."""
        for i, piece in enumerate(self._pieces[self._looked :]):
            if np.abs(piece.table[:, column]).min() < _BETWEEN:
                # A start at rest on a line is no touch.
                first = not (i or self._begun)
                for s in (s for s in _turning(piece, column) if s > _OUTSIDE or not first):
                    at = _powers([s], len(piece.terms)) @ piece.curves[:, column]
                    if abs(at[0]) <= _CLOSEST:
                        return True
        return False


def _powers(places, count):
    """Return the powers of places, shape (places, count)."""
    return np.power.outer(np.asarray(places, float), np.arange(count))


def _turning(piece, column):
    """Return the places of the turning points of a curve within its piece."""
    order = np.arange(1, len(piece.curves))
    slopes, powers = piece.curves[1:, column] * order, order - 1

    def rate(s):
        return slopes @ s**powers

    values = [rate(s) for s in _PLACES]
    found = [
        brentq(rate, _PLACES[i], _PLACES[i + 1], xtol=_EXACT)
        for i, value in enumerate(values[:-1])
        if value == 0.0 or (value < 0.0) != (values[i + 1] < 0.0)
    ]
    return [s for s in found if -_OUTSIDE <= s <= 1.0 + _OUTSIDE]
