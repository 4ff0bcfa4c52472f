"""Piecewise-linear systems with many coordinates: their matrices and Taylor series.

Within a segment of the mesh period with constant stiffness, and as long as the contact state does
not change, the state obeys z' = A z. Constants and harmonics are components of z (of frequency zero
and n), so that the excitation needs no separate terms. A segment is divided into equal substeps
(`substeps` is their number), so short that the Taylor polynomial of degree ORDER is the solution to
rounding, by the bound |remainder| <= (|A| h)^(ORDER + 1) / (ORDER + 1)! e^(|A| h).
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.kernels.arrays import copy
from gearlib.kernels.codes import BACKLASH, BOTH
from gearlib.kernels.jit import inlined, kernel

ORDER = 20
#: |A| h of a substep: (1.3)^21 / 21! e^1.3 = 2e-17.
REACH = 1.3
#: Overlap of both flanks at a start, in shares of the terms of a distance, that is no rounding.
_JAM = 1e-13
#: A sum this small, as a share of its parts, is the rounding of zero.
REST = 1e-14


class System(NamedTuple):
    """All matrices of one model at one tuning: n components, p segments."""

    a: np.ndarray  #: z' = a[contact + 1, segment] z, shape (3, p, n, n)
    starts: np.ndarray  #: phases that bound the segments, shape (p + 1,), 0 to 2 pi
    substeps: np.ndarray  #: number of substeps of every segment, int, shape (p,)
    low: np.ndarray  #: whether a segment is one of C_min, shape (p,)
    stiffness: np.ndarray  #: c by contact code (0: that of the normal flank), shape (3, p)
    near: np.ndarray  #: functional y, displacement over the normal flank, shape (n,)
    far: np.ndarray  #: functional y - s, displacement over the far flank, shape (n,)
    position: np.ndarray  #: functional x, the displacement that is recorded, shape (n,)
    fix: int  #: the component that is moved by rounding to put a state on a line
    harmonics: np.ndarray  #: frequencies of the cosine-sine pairs at the end of z, shape (m,)
    tuning: float
    repeats: int = 1  #: mesh periods after which the excitation repeats
    first: int = 0  #: mesh period of the excitation in which runs begin
    closing: bool = False  #: whether both flanks might touch at once, see `may_close`


class Tables(NamedTuple):
    """Where the entries of the matrices are, for series that skip the zeros."""

    counts: np.ndarray  #: entries of every row of A, shape (3, p, n)
    columns: np.ndarray  #: their columns, shape (3, p, n, n)


class Part(NamedTuple):
    """The part of a `System` that decides its events, and the rest, which does not act on it.

    The state of the whole is ``back @ (state of the part) + rest_back @ (state of the rest)``, with
    a rest that obeys one constant matrix whatever the contact.
    """

    system: System  #: of the part, r components
    into: np.ndarray  #: from the whole to the part, shape (r, n)
    back: np.ndarray  #: shape (n, r)
    rest: np.ndarray  #: matrix of the rest, shape (q, q)
    rest_into: np.ndarray  #: shape (q, n)
    rest_back: np.ndarray  #: shape (n, q)


class Scratch(NamedTuple):
    """Work arrays of a run."""

    other: np.ndarray  #: shape (n,)
    series: np.ndarray  #: Taylor coefficients of the state, shape (ORDER + 1, n)
    gap: np.ndarray  #: shape (ORDER + 1,)
    scaled: np.ndarray  #: shape (ORDER + 1,)
    work: np.ndarray  #: of `polynomial.first_fall`


@kernel
def tables(system):
    """Return the `Tables` of a system."""
    counts = np.zeros(system.a.shape[:3], dtype=np.int64)
    columns = np.empty(system.a.shape, dtype=np.int64)
    for i in range(counts.shape[0]):
        for p in range(counts.shape[1]):
            for r in range(counts.shape[2]):
                for c in range(counts.shape[2]):
                    if system.a[i, p, r, c] != 0.0:
                        columns[i, p, r, counts[i, p, r]] = c
                        counts[i, p, r] += 1
    return Tables(counts, columns)


@kernel
def scratch(n):
    """Return `Scratch` for n components."""
    return Scratch(
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
                    factor = a[r, c] * length / k
                    for j in range(n):
                        new[r, j] += factor * term[c, j]
        term = new
        total += term
    return total


@kernel
def carry(a, z, length, times):
    """Take z, shape (q,), along z' = a z by `times` equal lengths: powers of its exponential."""
    q = z.shape[0]
    if q == 0:
        return
    norm = 0.0
    for r in range(q):
        norm = max(norm, np.abs(a[r]).sum() * length)
    halvings = 0
    while norm > REACH:
        norm *= 0.5
        halvings += 1
    power = exponential(a, q, length / 2.0**halvings)
    for _ in range(halvings):
        power = product(power, power)
    while times > 0:
        if times % 2:
            copy(image(power, z), z)
        power = product(power, power)
        times //= 2


@kernel
def set_harmonics(system, z, phase):
    """Put the constant and the harmonics of z, shape (n,), to their values at `phase`."""
    n, m = z.shape[0], system.harmonics.shape[0]
    z[n - 2 * m - 1] = 1.0
    for j in range(m):
        z[n - 2 * m + 2 * j] = math.cos(system.harmonics[j] * phase)
        z[n - 2 * m + 2 * j + 1] = math.sin(system.harmonics[j] * phase)


@kernel
def image(matrix, z):
    """Return matrix z: small ones are faster by hand than by a linear algebra library."""
    out = np.zeros(matrix.shape[0])
    for r in range(matrix.shape[0]):
        for c in range(matrix.shape[1]):
            out[r] += matrix[r, c] * z[c]
    return out


@kernel
def product(a, b):
    """Return the product of two matrices."""
    out = np.zeros((a.shape[0], b.shape[1]))
    for r in range(a.shape[0]):
        for k in range(a.shape[1]):
            for c in range(b.shape[1]):
                out[r, c] += a[r, k] * b[k, c]
    return out


@kernel
def expand(a, counts, columns, z, series):
    """Fill the Taylor coefficients of the state from z; `a` has few entries in a row."""
    n = z.shape[0]
    copy(z, series[0])
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
    copy(series[ORDER], out)
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
    """Return a functional, shape (n,) or longer, of z, shape (n,)."""
    total = 0.0
    for r in range(z.shape[0]):
        total += functional[r] * z[r]
    return total


@inlined
def next_contact(contact, line):
    """Return the contact behind a flank line that a motion crosses, 1 drive, -1 coast side.

    A flank of its own it leaves; from the other one it would come into contact with `BOTH`.
    """
    if contact == line:
        return BACKLASH
    return BOTH if contact == -line else line


def may_close(near, far, one):
    """Return whether both flanks might touch at once: whether far - near can fall below zero.

    Both touch where near >= 0 >= far. Proven for all time if far - near is a constant and harmonics
    that are smaller together; where coordinates move it, or harmonics might, the run has to tell.

    Parameters
    ----------
    near, far : ndarray, shape (..., n)
        Functionals of the distances.
    one : int
        The component that is 1; coordinates come before it, harmonics after it.

    Returns
    -------
    ndarray of bool, shape (...)
    """
    rows = (far - near).real
    cosines, sines = rows[..., one + 1 :: 2], rows[..., one + 2 :: 2]
    most = np.hypot(cosines, sines).sum(axis=-1) * (1.0 + 1e-12)
    return rows[..., :one].any(axis=-1) | ((most > 0.0) & (rows[..., one] <= most))


@kernel
def behind(far, z):
    """Return whether a state lies behind the coast-side line by more than rounding.

    z of shape (n,) or longer. Where the drive side touches, both do.
    """
    value, size = 0.0, 0.0
    for r in range(far.shape[0]):
        value += far[r] * z[r]
        size += abs(far[r] * z[r])
    return value < -_JAM * size
