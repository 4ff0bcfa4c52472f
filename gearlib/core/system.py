"""Piecewise-linear systems with many coordinates: their matrices, tables and Taylor series.

While a contact code and a stretch of the mesh period last, the state obeys z' = A z. Constants and
harmonics are components of z (of frequency zero and n), so that excitation needs nothing of its
own. A stretch is cut into equal *knots*, so short that the Taylor polynomial of degree ORDER is
the solution to rounding, by the bound |remainder| <= (|A| h)^(ORDER + 1) / (ORDER + 1)! e^(|A| h).
"""

from typing import NamedTuple

import numpy as np

from gearlib.core.jit import inlined, kernel

ORDER = 20
#: |A| h of a knot: (1.3)^21 / 21! e^1.3 = 2e-17.
REACH = 1.3
#: Terms from this degree on are bounded together: (1.3)^7 / 7! = 1e-3 of the state.
TAIL = 7
#: A way within a knot goes by an exponential of so many equal parts and a short series.
PARTS = 8


class System(NamedTuple):
    """All matrices of one model at one tuning: n components, p stretches."""

    a: np.ndarray  #: z' = a[contact + 1, stretch] z, shape (3, p, n, n)
    starts: np.ndarray  #: phases that bound the stretches, shape (p + 1,), 0 to 2 pi
    knots: np.ndarray  #: knots of every stretch, int, shape (p,)
    low: np.ndarray  #: whether a stretch is one of C_min, shape (p,)
    stiffness: np.ndarray  #: c by contact code (0: that of the normal flank), shape (3, p)
    near: np.ndarray  #: functional y, displacement over the normal flank, shape (n,)
    far: np.ndarray  #: functional y - s, displacement over the far flank, shape (n,)
    position: np.ndarray  #: functional x, the displacement that is recorded, shape (n,)
    fix: int  #: the component that is moved by rounding to put a state on a line
    harmonics: np.ndarray  #: frequencies of the cosine-sine pairs at the end of z, shape (m,)
    tuning: float


class Tables(NamedTuple):
    """What `System` needs precomputed; filled on first use, stretch by stretch."""

    ready: np.ndarray  #: bool, shape (3, p)
    step: np.ndarray  #: exp(A h), shape (3, p, n, n)
    near: np.ndarray  #: rows of y along a knot, shape (3, p, ORDER + 1, n)
    far: np.ndarray  #: rows of y - s
    near_tail: (
        np.ndarray
    )  #: sums of the magnitudes of the rows from degree TAIL on, shape (3, p, n)
    far_tail: np.ndarray
    counts: np.ndarray  #: entries of every row of A, shape (3, p, n)
    columns: np.ndarray  #: their columns, shape (3, p, n, n)
    entries: np.ndarray  #: number of entries of A, shape (3, p)
    places: np.ndarray  #: their rows and columns, shape (3, p, n n, 2)
    values: np.ndarray  #: shape (3, p, n n)
    fine: np.ndarray  #: exp(A h j / PARTS), j = 1 ... PARTS - 1, shape (3, p, PARTS - 1, n, n)


class Scratch(NamedTuple):
    """Arrays that a march writes to."""

    z: np.ndarray  #: shape (n,)
    other: np.ndarray  #: shape (n,)
    series: np.ndarray  #: Taylor coefficients of the state, shape (ORDER + 1, n)
    gap: np.ndarray  #: shape (ORDER + 1,)
    scaled: np.ndarray  #: shape (ORDER + 1,)
    work: np.ndarray  #: of `polynomial.first_fall`


@kernel
def tables(system):
    """Return empty `Tables`."""
    contacts, p, n, _ = system.a.shape
    return Tables(
        np.zeros((contacts, p), dtype=np.bool_),
        np.empty((contacts, p, n, n)),
        np.empty((contacts, p, ORDER + 1, n)),
        np.empty((contacts, p, ORDER + 1, n)),
        np.zeros((contacts, p, n)),
        np.zeros((contacts, p, n)),
        np.zeros((contacts, p, n), dtype=np.int64),
        np.empty((contacts, p, n, n), dtype=np.int64),
        np.zeros((contacts, p), dtype=np.int64),
        np.empty((contacts, p, n * n, 2), dtype=np.int64),
        np.empty((contacts, p, n * n)),
        np.empty((contacts, p, PARTS - 1, n, n)),
    )


@kernel
def scratch(n):
    """Return `Scratch` for n components."""
    return Scratch(
        np.empty(n),
        np.empty(n),
        np.empty((ORDER + 1, n)),
        np.empty(ORDER + 1),
        np.empty(ORDER + 1),
        np.empty((50, ORDER + 2)),
    )


@kernel
def exponential(a, n, length):
    """Return exp(a length) of the leading (n, n) block, |a| length within REACH: its series."""
    total, term = np.eye(n), np.eye(n)
    for k in range(1, ORDER + 1):
        new = np.zeros((n, n))
        for r in range(n):
            for c in range(n):
                if a[r, c] != 0.0:
                    new[r] += (a[r, c] * length / k) * term[c]
        term = new
        total += term
    return total


@kernel
def prepare(system, table, i, p):
    """Fill the tables of contact code i - 1 on stretch p."""
    n = system.near.shape[0]
    h = (system.starts[p + 1] - system.starts[p]) / system.knots[p]
    a = system.a[i, p]
    for r in range(n):
        for c in range(n):
            if a[r, c] != 0.0:
                table.columns[i, p, r, table.counts[i, p, r]] = c
                table.counts[i, p, r] += 1
                e = table.entries[i, p]
                table.places[i, p, e, 0], table.places[i, p, e, 1] = r, c
                table.values[i, p, e] = a[r, c]
                table.entries[i, p] += 1
    # Rows g (A h)^k / k!.
    for functional, rows in ((system.near, table.near[i, p]), (system.far, table.far[i, p])):
        rows[0] = functional
        for k in range(1, ORDER + 1):
            rows[k] = 0.0
            for r in range(n):
                if rows[k - 1, r] != 0.0:
                    rows[k] += rows[k - 1, r] * (h / k) * a[r]
    for k in range(TAIL, ORDER + 1):
        table.near_tail[i, p] += np.abs(table.near[i, p, k])
        table.far_tail[i, p] += np.abs(table.far[i, p, k])
    table.step[i, p] = exponential(a, n, h)
    part = exponential(a, n, h / PARTS)
    table.fine[i, p, 0] = part
    for j in range(1, PARTS - 1):
        table.fine[i, p, j] = part @ table.fine[i, p, j - 1]
    table.ready[i, p] = True


@inlined
def apply(matrix, z, out):
    """out = matrix z."""
    for r in range(z.shape[0]):
        total = 0.0
        for c in range(z.shape[0]):
            total += matrix[r, c] * z[c]
        out[r] = total


@kernel
def advance(fine, entries, places, values, i, p, h, t, z, term, image):
    """Take z by t along a knot of length h: by whole parts, and the rest by its Taylor series.

    The first six are fields of `Tables`; term and image are storage, shape (n,).
    """
    n = z.shape[0]
    part = min(int(PARTS * t / h), PARTS - 1)
    if part > 0:
        for r in range(n):
            total = 0.0
            for c in range(n):
                total += fine[i, p, part - 1, r, c] * z[c]
            term[r] = total
        for r in range(n):
            z[r] = term[r]
        t -= part * (h / PARTS)
    for r in range(n):
        term[r] = z[r]
    small = False
    for k in range(1, ORDER + 1):
        for r in range(n):
            image[r] = 0.0
        for e in range(entries[i, p]):
            image[places[i, p, e, 0]] += values[i, p, e] * term[places[i, p, e, 1]]
        largest, size = 0.0, 0.0
        for r in range(n):
            term[r] = image[r] * (t / k)
            z[r] += term[r]
            largest = max(largest, abs(term[r]))
            size = max(size, abs(z[r]))
        # Terms fall by a factor 6 k each, but for the scales of the components; two small ones
        # leave less than rounding.
        if largest <= 1e-18 * size and small:
            break
        small = largest <= 1e-18 * size


@kernel
def expand(a, counts, columns, z, series):
    """Fill the Taylor coefficients of the state from z; `a` has few entries in a row."""
    n = z.shape[0]
    series[0] = z
    for k in range(1, ORDER + 1):
        share = 1.0 / k
        for r in range(n):
            total = 0.0
            for j in range(counts[r]):
                c = columns[r, j]
                total += a[r, c] * series[k - 1, c]
            series[k, r] = total * share


@kernel
def evaluate(series, t, out):
    """Fill `out` with the state of a Taylor series at t."""
    out[:] = series[ORDER]
    for k in range(ORDER - 1, -1, -1):
        for r in range(out.shape[0]):
            out[r] = out[r] * t + series[k, r]


@kernel
def functional_of(series, functional, h, out):
    """Fill `out` with a functional of a Taylor series as a polynomial of t / h."""
    power = 1.0
    for k in range(ORDER + 1):
        total = 0.0
        for r in range(functional.shape[0]):
            total += functional[r] * series[k, r]
        out[k] = total * power
        power *= h


@kernel
def dot(functional, z):
    total = 0.0
    for r in range(z.shape[0]):
        total += functional[r] * z[r]
    return total
