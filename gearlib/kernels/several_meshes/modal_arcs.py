"""Modes of one combination of contacts and stiffness levels: tables made on first use, and kept.

A motion visits few of the combinations that m meshes may form. In the modes of one of them the
state is y: oscillating pairs first, whose complex amplitudes turn, real modes, then a block for
what is slow or cannot be told apart (free motions, the constant), whose series is summed. With z
of `TrainSystem`, z = out y and y = into z.

The distances of the meshes from their flank lines are products of rows with y. Over a piece of
theta they are polynomials to rounding, whose Bernstein coefficients are products of `curves` with
y; and the sizes of the amplitudes bound them for all time.

`gearlib.models.propagators.modal_frame` fills the tables. The product of a table and a state adds
columns, which the compiler does with all lanes of the vector unit: tables are stored by columns,
filled up to eighths.
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.kernels.jit import kernel, uncounted, woven
from gearlib.kernels.several_meshes.sparse_series import price_of

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
#: Norm of a block times its piece, by the degree: 0.63^16 / 16! and 2^24 / 24! are 3e-17.
BLOCKS = {LEAST: 0.63, DEGREE: 2.0}
#: |lambda| of the fastest mode times a piece: the Chebyshev series of e^(lambda t) on a piece, cut
#: behind the degree, is exact to 2 (2.4 / 4)^16 / 16! = 3e-17 and 2 (7.2 / 4)^24 / 24! = 4e-18.
REACHES = {LEAST: 2.4, DEGREE: 7.2}
#: Most components of a block whose series is tabulated.
SMALL = 8
#: Terms of a series below this share of the state are nothing, whatever the scales.
_NOTHING = 1e-30


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
    series: np.ndarray  #: of a small one over the piece, columns of its terms: (c, SMALL, ...)
    filled: np.ndarray  #: int, length of these columns before what is nothing, shape (c,)
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
    """Return empty `Modes`; what is not filled takes no memory.

    Parameters
    ----------
    n, meshes : int
    lengths : int
        Different lengths of segments.
    combinations : int
        That there are, at most.
    memory : int
        Bytes at most.
    """
    wide, degree = filled_up(n), DEGREE if n >= _MANY else LEAST
    each = 2 * n * wide + n * n + meshes * n * (2 * degree + 4) + SMALL**2 * (degree + 1)
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
        np.empty((c, SMALL, SMALL * (degree + 1))),
        np.zeros(c, np.int64),
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


@kernel
def fill_curves(tables, c, rows, exponentials, powers):
    """Fill the Bernstein coefficients of the distances of combination c over its piece.

    Parameters
    ----------
    tables : Modes
        With rates, block and piece of c.
    c : int
    rows : ndarray, shape (2, m, n)
        Distances as functionals of y, far and near.
    exponentials : ndarray, shape (k, degree + 1)
        From the terms (z / 2)^i / i! of e^(z (s - 1/2)) to Bernstein coefficients on [0, 1].
    powers : ndarray, shape (degree + 1, degree + 1)
        From powers of s to them.
    """
    pairs, single, n, piece = (
        tables.pairs[c],
        tables.single[c],
        tables.block.shape[1],
        tables.piece[c],
    )
    degree = powers.shape[0] - 1
    real, imaginary = np.empty(degree + 1), np.empty(degree + 1)
    curves = tables.curves[c]
    for k in range(pairs + single):
        half = 0.5 * piece * complex(tables.rates[c, k, 0], tables.rates[c, k, 1])
        term = np.exp(half)
        real[:] = 0.0
        imaginary[:] = 0.0
        for i in range(exponentials.shape[0]):
            for r in range(degree + 1):
                real[r] += term.real * exponentials[i, r]
                imaginary[r] += term.imag * exponentials[i, r]
            term *= half / (i + 1)
        for line in range(2):
            for j in range(rows.shape[1]):
                if k < pairs:
                    u, v = rows[line, j, 2 * k], rows[line, j, 2 * k + 1]
                    for r in range(degree + 1):
                        curves[line, j, 2 * k, r] = u * real[r] + v * imaginary[r]
                        curves[line, j, 2 * k + 1, r] = v * real[r] - u * imaginary[r]
                else:
                    for r in range(degree + 1):
                        curves[line, j, pairs + k, r] = rows[line, j, pairs + k] * real[r]
    first = 2 * pairs + single
    row, new = np.empty(n - first), np.empty(n - first)
    for line in range(2):
        for j in range(rows.shape[1]):
            for i in range(n - first):
                row[i] = rows[line, j, first + i]
                for r in range(degree + 1):
                    curves[line, j, first + i, r] = row[i]
            for k in range(1, degree + 1):
                for i in range(n - first):
                    new[i] = 0.0
                for q in range(n - first):
                    share = row[q] * piece / k
                    for i in range(n - first):
                        new[i] += share * tables.block[c, q, i]
                row, new = new, row
                for i in range(n - first):
                    for r in range(degree + 1):
                        curves[line, j, first + i, r] += row[i] * powers[k, r]


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
    # The constant alone stays as it is.
    if 1 < n - first <= SMALL:
        parts = term[: tables.filled[c]]
        _advance_small(tables.series[c], n - first, tables.piece[c], t, y[first:], parts)
    elif n - first > 1:
        _advance_block(tables.block[c], n - first, tables.piece[c], t, y[first:], term, image)


@uncounted
def fill_series(block, piece, series):
    """Fill the terms of e^(block piece s), by columns, of a block up to `SMALL` components.

    Returns how long the columns are, an even number of terms, before what is nothing.
    """
    n, filled, length = block.shape[0], 0, series.shape[1]
    for i in range(n if n <= SMALL else 0):
        for q in range(length):
            series[i, q] = 1.0 if q == i else 0.0
        for k in range(SMALL, length, SMALL):
            for r in range(n):
                for j in range(n):
                    series[i, k + r] += block[r, j] * series[i, k - SMALL + j]
                series[i, k + r] *= piece * SMALL / k
                if not abs(series[i, k + r]) <= _NOTHING:
                    filled = max(filled, k)
    return (filled // (2 * SMALL) + 1) * 2 * SMALL


@uncounted
def _advance_small(series, size, piece, t, y, parts):
    """Take the components of a small block, by its tabulated series."""
    steps = max(math.ceil(t / piece - 1e-9), 1.0)
    share, done = t / (steps * piece), 0.0
    while done < steps:
        for q in range(parts.shape[0]):
            parts[q] = 0.0
        for i in range(size):
            u = y[i]
            for q in range(parts.shape[0]):
                parts[q] += series[i, q] * u
        for r in range(size):
            # Two sums that do not wait for one another.
            even, odd, k = 0.0, 0.0, parts.shape[0] - 2 * SMALL + r
            while k >= 0:
                even = even * (share * share) + parts[k]
                odd = odd * (share * share) + parts[k + SMALL]
                k -= 2 * SMALL
            y[r] = even + share * odd
        done += 1.0


@uncounted
def _advance_block(block, size, piece, t, y, term, image):
    """Take the components of the block, over pieces on which their series ends."""
    steps = max(math.ceil(t / piece - 1e-9), 1.0)
    h, done = t / steps, 0.0
    while done < steps:
        largest = 0.0
        for r in range(size):
            term[r] = y[r]
            largest = max(largest, abs(y[r]))
        k, rest = 0, 1.0
        while rest > _NOTHING * largest and k <= DEGREE:
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
