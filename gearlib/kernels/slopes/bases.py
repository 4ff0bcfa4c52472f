"""Coordinates in which the matrix of an arc falls into blocks of nearly equal eigenvalues.

Let A V = V T with T of such blocks. A slope dA of A is then, with a matrix S,

    dA = V D V^-1 + A S - S A,        D of the same blocks,

so that w + S z instead of a tangent w, with w' = A w + dA z, feels no more of dA than D: a few
numbers. Where eigenvalues differ, S divides by their difference (Daleckii, Krein 1965); what it
would have to divide by too little stays in D. Free motions, whose Jordan blocks hold a constant
force, are such a block. With a larger share of T in one block the basis is better conditioned; one
block for all is the matrix exponential.
"""

from typing import NamedTuple

import numpy as np

from gearlib.kernels.jit import kernel

#: Coupling of equal eigenvalues, relative, that is rounding; entries of an eigenvector in another
#: one's place that are too large.
_ROUNDING, _SLANT = 1e-14, 1e2


class Bases(NamedTuple):
    """The bases of C matrices: n components, s of which move, M complex coordinates, k slopes.

    Of a conjugate pair one coordinate is kept. Real parts come before imaginary parts, coordinates
    by which T is diagonal before blocks of T by which it is not.
    """

    into: np.ndarray  #: shape (C, n, 2 M)
    out: np.ndarray  #: shape (C, 2 M, n)
    blocks: np.ndarray  #: int, where blocks begin; the last two their end, shape (C, M + 2)
    norms: np.ndarray  #: of those blocks without their means, the root of a high power, (C, M + 2)
    matrix: np.ndarray  #: T, complex, shape (C, M, M)
    slopes: np.ndarray  #: D, complex, shape (C, k, M, M)
    diagonal: np.ndarray  #: its diagonal, shape (C, k, 2 M)
    pairs: np.ndarray  #: int, rows and columns of its other entries where T is diagonal, (C, P, 2)
    shift: np.ndarray  #: S, shape (C, n, k n)


@kernel
def clusters(values, near, cluster, kept):
    """Number eigenvalues, shape (n,), by their clusters in order of appearance.

    Two belong together if they are nearer than `near`, by themselves or by others between them.
    `kept` tells 2 for a cluster above the real axis, 1 for one that meets it, 0 for one below.
    """
    n, count = values.shape[0], 0
    group, stack = np.full(n, -1), np.empty(n, np.int64)
    for first in range(n):
        if group[first] >= 0:
            continue
        group[first], stack[0], size, real = first, first, 1, False
        while size > 0:
            size -= 1
            i = stack[size]
            a = complex(values[i].real, abs(values[i].imag))
            real = real or 2.0 * a.imag < near
            for j in range(n):
                if group[j] < 0 and abs(complex(values[j].real, abs(values[j].imag)) - a) < near:
                    group[j], stack[size] = first, j
                    size += 1
        for i in range(n):
            if group[i] == first:
                kept[i] = 1 if real else 2 if values[i].imag > 0.0 else 0
    cluster[:] = -1
    for i in range(n):
        if cluster[i] < 0:
            for j in range(i, n):
                if group[j] == group[i] and kept[j] == kept[i]:
                    cluster[j] = count
            count += 1
    return count


@kernel
def gather(t, q, cluster, kept):
    """Bring clusters of a complex Schur form, a = q t q^*, together by rotations; all in place."""
    n = t.shape[0]
    for end in range(n - 1, 0, -1):
        for j in range(end):
            if cluster[j] <= cluster[j + 1]:
                continue
            a, b = t[j, j + 1], t[j + 1, j + 1] - t[j, j]
            size = np.hypot(abs(a), abs(b))
            # The first column is the eigenvector of the second eigenvalue.
            a, b = a / size, b / size
            for i in range(n):
                x, y = t[i, j], t[i, j + 1]
                t[i, j], t[i, j + 1] = a * x + b * y, a.conjugate() * y - b.conjugate() * x
                x, y = q[i, j], q[i, j + 1]
                q[i, j], q[i, j + 1] = a * x + b * y, a.conjugate() * y - b.conjugate() * x
            for i in range(n):
                x, y = t[j, i], t[j + 1, i]
                t[j, i] = a.conjugate() * x + b.conjugate() * y
                t[j + 1, i] = a * y - b * x
            t[j + 1, j] = 0.0
            cluster[j], cluster[j + 1] = cluster[j + 1], cluster[j]
            kept[j], kept[j + 1] = kept[j + 1], kept[j]


@kernel
def split(t, cluster):
    """Return y with t y = y d, d the blocks of a triangular t that clusters make."""
    n = t.shape[0]
    y = np.zeros_like(t)
    for j in range(n):
        y[j, j] = 1.0
        for i in range(j - 1, -1, -1):
            if cluster[i] == cluster[j]:
                continue
            total = 0.0j
            for other in range(i + 1, j + 1):
                total -= t[i, other] * y[other, j]
            for other in range(j):
                if cluster[other] == cluster[j]:
                    total += y[i, other] * t[other, j]
            y[i, j] = total / (t[i, i] - t[j, j])
    return y


@kernel
def straighten(t, cluster, basis):
    """Diagonalise the clusters of a block-diagonal t that are well-conditioned, in place.

    Returns, by coordinates, whether a cluster stays a block.
    """
    n = t.shape[0]
    block, size = np.zeros(n, np.bool_), 0.0
    for i in range(n):
        size = max(size, abs(t[i, i]))
    first = 0
    while first < n:
        last = first + 1
        while last < n and cluster[last] == cluster[first]:
            last += 1
        own, fits = np.eye(last - first) + 0.0j, True
        for j in range(first, last):
            for i in range(j - 1, first - 1, -1):
                total, apart = 0.0j, t[j, j] - t[i, i]
                for other in range(i + 1, j + 1):
                    total += t[i, other] * own[other - first, j - first]
                if abs(total) > _ROUNDING * size:
                    fits = fits and abs(total) < _SLANT * abs(apart)
                    own[i - first, j - first] = total / apart if fits else 0.0
        if fits:
            turned = np.zeros((n, last - first), t.dtype)
            for r in range(n):
                for j in range(last - first):
                    for i in range(j + 1):
                        turned[r, j] += basis[r, first + i] * own[i, j]
            for j in range(last - first):
                for r in range(n):
                    basis[r, first + j] = turned[r, j]
                for i in range(j):
                    t[first + i, first + j] = 0.0
        else:
            block[first:last] = True
        first = last
    return block


@kernel
def solve(t, cluster, rows, slopes, shift, blocks):
    """Fill shift and blocks of slopes, shape (k, M, n), of whose rows `rows` are kept.

    t x - x t = slopes between clusters, shift = x, shape (k, M, n); within them they are `blocks`,
    shape (k, M, M).
    """
    k, m, n = slopes.shape
    for one in range(k):
        for j in range(n):
            for r in range(m - 1, -1, -1):
                i = rows[r]
                if cluster[i] == cluster[j]:
                    shift[one, r, j] = 0.0
                    continue
                total = slopes[one, r, j]
                for other in range(r + 1, m):
                    if cluster[rows[other]] != cluster[i]:
                        break
                    total -= t[i, rows[other]] * shift[one, other, j]
                for other in range(j - 1, -1, -1):
                    if cluster[other] != cluster[j]:
                        break
                    total += shift[one, r, other] * t[other, j]
                shift[one, r, j] = total / (t[i, i] - t[j, j])
        for r in range(m):
            for c in range(m):
                same = cluster[rows[r]] == cluster[rows[c]]
                blocks[one, r, c] = slopes[one, r, rows[c]] if same else 0.0
