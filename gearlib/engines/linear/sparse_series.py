"""Combinations of contacts without modes: the power series of the state, by what is not zero.

Modes of many coordinates cost as much as a thousand steps of the series, and a train of many meshes
that part one after the other hardly ever sees a combination again. So it goes by the series until
the steps in a combination have cost as much as its modes would: never more than twice the least.
"""

import math

import numpy as np

from gearlib.engines import exponential
from gearlib.engines.jit import uncounted, woven

#: Number of a combination that has no modes, in place of its row in their tables.
SERIES = -2
#: |A| times the unit of a series: behind degree 23 the rest is less than 4/3 of its last term.
REACH = 6.0
#: Largest last term of a series, as a share of the state.
_LAST = 2e-17
#: Components from which modes have to pay, and steps of the series for modes, over their square.
_MANY, _PRICE = 60, 0.015


def price_of(n):
    """Return how many steps of the series the modes of n components cost; 0: fewer than count."""
    return int(_PRICE * n * n) if n >= _MANY else 0


def sparse_of(system, wanted=False):
    """Return the fields of a `Grid` that say what is not zero: of `free` by rows, of the meshes.

    It comes first, `count` and `touched` of it; empty where modes cost less than they save and the
    series is not `wanted`.
    """
    names = "columns", "count", "places", "touched", "values"
    n = system.free.shape[0]
    if not (price_of(n) or wanted):
        none = np.zeros((0, 0), np.int64), np.zeros(0, np.int64)
        return dict(zip(names, (*none, *none, np.zeros((0, 0))), strict=True))
    moved = (system.near != 0.0) | (system.far != 0.0)
    moved |= (system.grip != 0.0).any(axis=(1, 2)) | (system.push != 0.0).any(axis=(1, 2))
    columns, count = _first(system.free != 0.0)
    values = np.take_along_axis(system.free, columns, axis=1)
    return dict(zip(names, (columns, count, *_first(moved), values), strict=True))


def _first(which):
    """Return the places of what is true in the rows of a table, and how many there are."""
    count = which.sum(axis=1)
    return np.argsort(~which, axis=1, kind="stable")[:, : count.max()].copy(), count


@uncounted
def _image(system, grid, effects, z, share, out):
    """Fill `out` with share A z of a combination of effects."""
    for r in range(grid.count.shape[0]):
        total = 0.0
        for i in range(grid.count[r]):
            total += grid.values[r, i] * z[grid.columns[r, i]]
        out[r] = share * total
    for j in range(effects.shape[0]):
        # Without friction the second force has no grip.
        for k in range(2 if effects[j] > 0 else 0):
            grip, push, force = system.grip[j, effects[j], k], system.push[j, effects[j], k], 0.0
            for i in range(grid.touched[j]):
                r = grid.places[j, i]
                force += grip[r] * z[r]
            if force != 0.0:
                force *= share
                for i in range(grid.touched[j]):
                    r = grid.places[j, i]
                    out[r] += push[r] * force


@uncounted
def _chirp(grid, k, unit, terms):
    """Fill term k + 1 of the rates of harmonics whose phase is quadratic in theta.

    Behind the coordinates and their rates come the rate of the phase, and of each harmonic cosine,
    sine and their rates: c' = -w nu s, so that c'' = -w (nu' s + nu s'), and alike of the sine.
    """
    pace = grid.pace
    nu, change = terms[0, pace], terms[1, pace]
    for j in range(grid.chirp.shape[0]):
        i, share = pace + 1 + 4 * j, grid.chirp[j] / (k + 1)
        for side in range(2):
            # The sine for the cosine, and the other way round.
            value, rate = i + 1 - side, i + 3 - side
            total = change * terms[k, value] + unit * nu * terms[k, rate]
            if k > 0:
                total += unit * change * terms[k - 1, rate]
            terms[k + 1, i + 2 + side] = share * total if side == 1 else -share * total


@uncounted
def expand(system, grid, effects, z, terms):
    """Fill `terms`, shape (degree + 1, n filled up), with the series of z; return its unit.

    That is the theta on which it ends.
    """
    last, n = terms.shape[0] - 1, grid.count.shape[0]
    unit = REACH / exponential.REACH * system.longest
    size, rest = 0.0, 0.0
    for r in range(n):
        terms[0, r] = z[r]
        size = max(size, abs(z[r]))
    for k in range(last):
        _image(system, grid, effects, terms[k], unit / (k + 1), terms[k + 1])
        if grid.chirp.shape[0] > 0:
            _chirp(grid, k, unit, terms)
    for r in range(n):
        rest = max(rest, abs(terms[last, r]))
    # The terms of a linear system bound what follows them; where it rests they are nothing.
    share = 1.0
    if _LAST * size < rest < math.inf:
        share = (_LAST * size / rest) ** (1.0 / last)
    power = 1.0
    for k in range(1, last + 1):
        power *= share
        for r in range(n):
            terms[k, r] *= power
    return unit * share


@uncounted
def fill_distances_of(system, grid, terms, curves):
    """Fill `curves`, (2, m, degree + 2): powers of the distances, far and near, their rounding."""
    for j in range(grid.touched.shape[0]):
        for side in range(2):
            row = system.near[j] if side == 1 else system.far[j]
            size = 0.0
            for i in range(grid.touched[j]):
                r = grid.places[j, i]
                size += abs(row[r] * terms[0, r])
            for k in range(terms.shape[0]):
                total = 0.0
                for i in range(grid.touched[j]):
                    r = grid.places[j, i]
                    total += row[r] * terms[k, r]
                curves[side, j, k] = total
            curves[side, j, terms.shape[0]] = size


@woven
def sum_of(terms, n, share, out):
    """Fill `out` with a state of n components, at a share of the unit of its series."""
    for r in range(n):
        out[r] = terms[terms.shape[0] - 1, r]
    for k in range(terms.shape[0] - 2, -1, -1):
        for r in range(n):
            out[r] = out[r] * share + terms[k, r]


@uncounted
def go_by_series(system, grid, effects, length, z, terms):
    """Take a state, or a deviation, by a length of theta; the contacts stay."""
    left = length
    while left > 0.0:
        unit = expand(system, grid, effects, z, terms)
        part = min(unit, left)
        sum_of(terms, grid.count.shape[0], part / unit, z)
        left -= part


@woven
def may_reach(curve, sign, degree):
    """Return whether the powers of a distance leave open if it comes to zero from this side."""
    rest = 0.0
    for k in range(1, degree + 1):
        rest += abs(curve[k])
    return not sign * curve[0] > rest + 1e-14 * curve[degree + 1]
