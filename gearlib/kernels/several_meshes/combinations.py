"""Tables of one combination of contacts and stiffness levels, built when it is first met and kept.

A motion visits few of the combinations that m meshes may form. Of each that it does visit, the
tables hold what takes a state along and what tells whether a flank line is reached:

* exp(A h) of a whole substep, one for each length of substep of the mesh period, when needed;
* the rows of A that give accelerations, for the Taylor series over a part of one;
* the rows d_j (A H)^k / k!, whose products with a state are the coefficients of the distance from a
  flank as a polynomial of theta / H, where H is the longest substep.

Only the exponentials of whole substeps depend on the tuning, if the train has no harmonics and no
gyroscopic terms: a sweep keeps the rest. The product of a table and a state adds columns, which the
compiler does with all lanes of the vector unit: tables are stored by columns, filled up to eighths.
"""

from typing import NamedTuple

import numpy as np

from gearlib.kernels.arrays import copy_rows
from gearlib.kernels.jit import inlined, kernel
from gearlib.kernels.piecewise_linear.system import ORDER, exponential

#: Rows of a distance that a first look takes; those of higher degree are bounded together.
LOOK = 8
#: Rows behind those, up to degree ORDER, filled up.
BEHIND = 16
#: Bytes that the tables of one thread may take, half of them exponentials; beyond, they are
#: forgotten and begun anew, which changes no result.
MEMORY = 2**28
#: Combinations that are kept at most, whatever their size.
_MOST = 4096


class Combinations(NamedTuple):
    """Tables of up to c combinations of a `TrainSystem`; n components, m meshes, N coordinates."""

    known: np.ndarray  #: int, (combinations, exponentials) in use, shape (2,)
    slots: np.ndarray  #: int, where to look for a key: index of the combination or -1
    keys: np.ndarray  #: int, shape (c,)
    a: np.ndarray  #: shape (c, n, n)
    rate: np.ndarray  #: accelerations by columns of A, shape (c, n, N filled up)
    look: np.ndarray  #: first rows of all distances, shape (c, n, LOOK m)
    behind: np.ndarray  #: rows of higher degree, shape (c m, n, BEHIND)
    tail: np.ndarray  #: sums of the magnitudes of those, shape (c, n, m filled up)
    at: np.ndarray  #: int, where the exponential of each length of substep is, -1: nowhere
    step: np.ndarray  #: these exponentials, shape (s, n, n filled up)


@kernel
def filled_up(count):
    """Return the next multiple of eight."""
    return (count + 7) // 8 * 8


def combinations(n, coordinates, meshes, lengths, memory=MEMORY):
    """Return empty `Combinations`; what is not filled takes no memory.

    Parameters
    ----------
    n, coordinates, meshes : int
    lengths : int
        Different lengths of substeps.
    memory : int
        Bytes at most.
    """
    wide, narrow, lines = filled_up(n), filled_up(coordinates), filled_up(meshes)
    each = n * n + n * (narrow + LOOK * meshes + lines) + meshes * n * BEHIND
    c = int(min(max(memory // (16 * each), 2), _MOST))
    steps = int(min(max(memory // (16 * n * wide), 2), c * lengths))
    slots = 1
    while slots < 4 * c:
        slots *= 2
    return Combinations(
        np.zeros(2, np.int64),
        np.full(slots, -1, np.int64),
        np.empty(c, np.int64),
        np.empty((c, n, n)),
        np.zeros((c, n, narrow)),
        np.empty((c, n, LOOK * meshes)),
        np.zeros((c * meshes, n, BEHIND)),
        np.zeros((c, n, lines)),
        np.full((c, lengths), -1, np.int64),
        np.zeros((steps, n, wide)),
    )


@kernel
def forget(known, slots, at):
    """Empty the tables."""
    known[:] = 0
    slots[:] = -1
    at[:] = -1


@kernel
def forget_lengths(known, at):
    """Empty what depends on the tuning even if the matrices do not."""
    known[1] = 0
    at[:] = -1


@inlined
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


@kernel
def by_columns(matrix, columns):
    """Store a matrix by columns."""
    for r in range(matrix.shape[0]):
        for i in range(matrix.shape[1]):
            columns[i, r] = matrix[r, i]


@kernel
def matrix_of(system, effects, a):
    """Fill `a`, shape (n, n), with the matrix of a combination of effects, shape (m,)."""
    copy_rows(system.free, a)
    for j in range(effects.shape[0]):
        for k in range(2):
            push, grip = system.push[j, effects[j], k], system.grip[j, effects[j], k]
            for r in range(push.shape[0]):
                if push[r] != 0.0:
                    for i in range(push.shape[0]):
                        a[r, i] += push[r] * grip[i]


@kernel
def _fill(system, tables, c, effects):
    """Fill the tables of combination c, but for the exponentials of whole substeps."""
    m, n = system.near.shape
    coordinates = (n - 1) // 2 - system.harmonics.shape[0]
    a, h = tables.a[c], system.longest
    matrix_of(system, effects, a)
    by_columns(a[coordinates : 2 * coordinates], tables.rate[c])
    row, new = np.empty(n), np.empty(n)
    for j in range(m):
        for i in range(n):
            row[i], tables.tail[c, i, j] = system.near[j, i], 0.0
        for k in range(ORDER + 1):
            for i in range(n):
                if k < LOOK:
                    tables.look[c, i, LOOK * j + k] = row[i]
                else:
                    tables.behind[m * c + j, i, k - LOOK] = row[i]
                    tables.tail[c, i, j] += abs(row[i])
                new[i] = 0.0
            for r in range(n):
                if row[r] != 0.0:
                    share = row[r] * h / (k + 1)
                    for i in range(n):
                        new[i] += share * a[r, i]
            row, new = new, row


@kernel
def combination(system, tables, effects):
    """Return the index of a combination of effects, int, shape (m,), filled on first use."""
    key, base = 0, system.push.shape[1]
    for j in range(effects.shape[0]):
        key = key * base + effects[j]
    mask = tables.slots.shape[0] - 1
    # Multiplied by an odd number near the golden ratio, so that neighbours lie apart.
    home = (key * 0x1E3779B97F4A7C15 >> 20) & mask
    slot = home
    while tables.slots[slot] >= 0:
        if tables.keys[tables.slots[slot]] == key:
            return tables.slots[slot]
        slot = (slot + 1) & mask
    c = tables.known[0]
    if c == tables.keys.shape[0]:
        forget(tables.known, tables.slots, tables.at)
        c, slot = 0, home
    tables.slots[slot], tables.keys[c] = c, key
    tables.known[0] = c + 1
    _fill(system, tables, c, effects)
    return c


@kernel
def whole_step(tables, c, kind, length):
    """Return where exp(A length) of combination c is in ``step``; `kind` numbers the length."""
    if tables.at[c, kind] < 0:
        if tables.known[1] == tables.step.shape[0]:
            forget_lengths(tables.known, tables.at)
        s = tables.known[1]
        n = tables.a.shape[1]
        by_columns(exponential(tables.a[c], n, length), tables.step[s])
        tables.at[c, kind] = s
        tables.known[1] = s + 1
    return tables.at[c, kind]
