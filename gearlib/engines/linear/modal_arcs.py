"""Modes of one combination of contacts and stiffness levels: tables made on first use, and kept.

A motion visits few of the combinations that m meshes may form. In the modes of one of them the
state is y: oscillating pairs first, whose complex amplitudes turn, real modes, then a block for
what is slow or cannot be told apart (free motions, the constant), whose series is summed. With z
of `TrainSystem`, z = out y and y = into z.

The distances of the meshes from their flank lines are products of rows with y. Over a piece of
theta they are polynomials to rounding, whose Bernstein coefficients are products of `curves` with
y; and the sizes of the amplitudes bound them for all time.

`gearlib.engines.linear.modal_frame` fills the tables. The product of a table and a state adds
columns, which the compiler does with all lanes of the vector unit: tables are stored by columns,
filled up to eighths.
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.engines.jit import uncounted, woven
from gearlib.engines.linear.sparse_series import price_of

#: Degree of the polynomials of distances over a piece, the least and the most: where changing modes
#: costs more than roots, as of many components, long pieces pay.
LEAST, DEGREE = 15, 23
#: Components from which the most is taken.
_MANY = 20
#: Bytes that the tables of one thread may take; beyond, they are forgotten and begun anew, which
#: changes no result.
MEMORY = 2**28
#: Combinations that are kept at most, and turns over lengths of segments for each.
_MOST, TURNS = 1024, 64
#: |lambda| of the fastest mode times a piece: the Chebyshev series of e^(lambda t) on a piece, cut
#: behind the degree, is exact to 2 (2.4 / 4)^16 / 16! = 3e-17 and 2 (7.2 / 4)^24 / 24! = 4e-18.
REACHES = {LEAST: 2.4, DEGREE: 7.2}
#: Terms of a series below this share of the state are nothing, whatever the scales; most terms.
_NOTHING, _MAX_TERMS = 1e-30, 60


class Modes(NamedTuple):
    """Tables of up to c combinations of a `TrainSystem`: n components, m meshes."""

    known: np.ndarray  #: int, (combinations, turns) in use, shape (2,)
    slots: np.ndarray  #: int, where to look for a key: index of the combination or -1
    steps: np.ndarray  #: int, of the series of a combination that would have this slot
    price: np.ndarray  #: int, how many of them its modes cost, shape (1,)
    keys: np.ndarray  #: int8, effects of all meshes, shape (c, m)
    pairs: np.ndarray  #: int, oscillating pairs, shape (c,)
    single: np.ndarray  #: int, real modes behind them, shape (c,)
    rates: np.ndarray  #: (growth, angular frequency) by theta of pairs and real modes, (c, n, 2)
    block: np.ndarray  #: matrix of the components behind these, shape (c, n, n)
    pace: np.ndarray  #: rate of its fastest motion, about, shape (c,)
    piece: np.ndarray  #: theta over which `curves` hold, shape (c,)
    into: np.ndarray  #: from z to y, by columns, shape (c, n, n filled up)
    out: np.ndarray  #: from y to z, by columns
    curves: np.ndarray  #: Bernstein coefficients, far and near, (c, 2, m, n, degree + 1)
    swing: np.ndarray  #: largest share of a mode in the distances, far and near, (c, 2, m, n)
    level: np.ndarray  #: distances without the modes, far and near, shape (c, 2, m)
    steady: np.ndarray  #: bool, whether `swing` and `level` bound them, shape (c, 2, m)
    at: np.ndarray  #: int, where the turn over each length of segment is, -1: nowhere, (c, k)
    turns: np.ndarray  #: factors of the modes, shape (s, n)


def modes(n, meshes, lengths, combinations=_MOST, memory=MEMORY):
    """Return empty `Modes` for so many different lengths of segments, of at most so many bytes."""
    wide, degree = filled_up(n), DEGREE if n >= _MANY else LEAST
    each = 2 * n * wide + n * n + meshes * n * (2 * degree + 4)
    c = int(min(max(memory // (8 * each), 2), _MOST, max(combinations, 16)))
    # Combinations without modes are counted too.
    slots, price = 2**14 if price_of(n) else 1, price_of(n)
    while slots < 4 * c:
        slots *= 2
    return Modes(
        np.zeros(2, np.int64),
        np.full(slots, -1, np.int64),
        np.zeros(slots, np.int64),
        np.full(1, price),
        np.empty((c, meshes), np.int8),
        np.zeros(c, np.int64),
        np.zeros(c, np.int64),
        np.empty((c, n, 2)),
        np.empty((c, n, n)),
        np.empty(c),
        np.empty(c),
        np.empty((c, n, wide)),
        np.empty((c, n, wide)),
        np.empty((c, 2, meshes, n, degree + 1)),
        np.empty((c, 2, meshes, n)),
        np.empty((c, 2, meshes)),
        np.zeros((c, 2, meshes), np.bool_),
        np.full((c, min(lengths, TURNS)), -1, np.int64),
        np.empty((c * min(lengths, TURNS), n)),
    )


def filled_up(count):
    """Return the next multiple of eight."""
    return (count + 7) // 8 * 8


@uncounted
def slot_of(slots, keys, effects):
    """Return the slot of a combination of effects, or the free one where it belongs."""
    mask, key, m = slots.shape[0] - 1, 0, effects.shape[0]
    for j in range(m):
        # Whatever overflows: an odd number near the golden ratio, so that neighbours lie apart.
        key = (key + effects[j]) * 0x1E3779B97F4A7C15
    slot = (key >> 20) & mask
    while slots[slot] >= 0:
        j, own = 0, keys[slots[slot]]
        while j < m and own[j] == effects[j]:
            j += 1
        if j == m:
            break
        slot = (slot + 1) & mask
    return slot


def forget(tables):
    """Empty the tables."""
    tables.known[:] = 0
    tables.slots[:] = -1
    tables.steps[:] = 0
    tables.at[:] = -1


def forget_lengths(tables):
    """Empty what depends on the tuning even if the matrices do not."""
    tables.known[1] = 0
    tables.at[:] = -1


@woven
def multiply(columns, c, z, out):
    """out = matrix c times z, for matrices stored by columns, shape (c, n, w)."""
    n, w = columns.shape[1], columns.shape[2]
    for r in range(w):
        out[r] = 0.0
    j = 0
    while j + 3 < n:
        p, q, s, t = z[j], z[j + 1], z[j + 2], z[j + 3]
        for r in range(w):
            out[r] += (columns[c, j, r] * p + columns[c, j + 1, r] * q) + (
                columns[c, j + 2, r] * s + columns[c, j + 3, r] * t
            )
        j += 4
    while j < n:
        p = z[j]
        for r in range(w):
            out[r] += columns[c, j, r] * p
        j += 1


@woven
def turn_by(tables, c, t, factors):
    """Fill `factors`, shape (n,), with what the modes of combination c turn and shrink by in t."""
    pairs = tables.pairs[c]
    for k in range(pairs):
        size, angle = math.exp(tables.rates[c, k, 0] * t), tables.rates[c, k, 1] * t
        factors[2 * k], factors[2 * k + 1] = size * math.cos(angle), size * math.sin(angle)
    for k in range(tables.single[c]):
        factors[2 * pairs + k] = math.exp(tables.rates[c, pairs + k, 0] * t)


@woven
def turn_over(tables, c, kind, t):
    """Return where the factors of a whole segment are in ``turns``; `kind` numbers its length."""
    if tables.at[c, kind] < 0:
        s = tables.known[1]
        turn_by(tables, c, t, tables.turns[s])
        tables.at[c, kind] = s
        tables.known[1] = s + 1
    return tables.at[c, kind]


@woven
def advance(tables, c, factors, t, y, term, image):
    """Take y, shape (n,) or longer, by t: `factors` are those of `turn_by`."""
    pairs, single, n = tables.pairs[c], tables.single[c], tables.block.shape[1]
    for k in range(pairs):
        u, v, p, q = y[2 * k], y[2 * k + 1], factors[2 * k], factors[2 * k + 1]
        y[2 * k], y[2 * k + 1] = p * u - q * v, q * u + p * v
    first = 2 * pairs + single
    for k in range(2 * pairs, first):
        y[k] *= factors[k]
    _advance_block(tables.block[c], n - first, tables.pace[c], t, y[first:], term, image)


@uncounted
def _advance_block(block, size, pace, t, y, term, image):
    """Take the components of the block, by steps in which their series ends soon."""
    # The constant alone stays as it is.
    steps = max(math.ceil(t * pace), 1.0) if size > 1 else 0.0
    h, done = t / max(steps, 1.0), 0.0
    while done < steps:
        largest = 0.0
        for r in range(size):
            term[r] = y[r]
            largest = max(largest, abs(y[r]))
        k, rest = 0, 1.0
        while rest > _NOTHING * largest and k < _MAX_TERMS:
            k += 1
            share, rest = h / k, 0.0
            for r in range(size):
                total = 0.0
                for i in range(size):
                    total += block[r, i] * term[i]
                image[r] = share * total
                rest = max(rest, abs(image[r]))
            for r in range(size):
                term[r] = image[r]
                y[r] += term[r]
        done += 1.0
