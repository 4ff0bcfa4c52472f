"""Bases of the matrices of a motion and of what they change by, for `gearlib.kernels.slopes`."""

import numpy as np
from scipy.linalg import matrix_balance, schur

from gearlib.kernels.slopes.bases import Bases, clusters, gather, solve, split, straighten

#: Eigenvalues closer than this (by phase) stay in one block; by so much more where the basis has a
#: larger condition number than this.
_NEAR, _FARTHER, _CONDITION = 0.03, 4.0, 1e5

#: Power whose root is a norm.
_POWER = 16


def bases_of(pairs):
    """Return the `Bases` of pairs (matrix, slopes), shapes (n, n) and (k, n, n)."""
    k, n = pairs[0][1].shape[:2]
    found = [_basis(matrix, slopes) for matrix, slopes in pairs]
    count, most = len(found), max(len(one[0]) for one in found)
    table = Bases(
        np.zeros((count, n, 2 * most)),
        np.zeros((count, 2 * most, n)),
        np.zeros((count, most + 2), np.int64),
        np.zeros((count, most + 2)),
        np.zeros((count, most, most), complex),
        np.zeros((count, k, most, most), complex),
        np.zeros((count, k, 2 * most)),
        np.full((count, most * most + 1, 2), -1),
        np.zeros((count, n, k * n)),
    )
    for i, (into, out, blocks, matrix, slopes, shift) in enumerate(found):
        m = len(into)
        table.into[i, :, :m], table.into[i, :, most : most + m] = into.real.T, into.imag.T
        table.out[i, :m], table.out[i, most : most + m] = out.real.T, -out.imag.T
        table.blocks[i, : len(blocks)] = blocks
        for b, (first, last) in enumerate(zip(blocks, blocks[1:], strict=False)):
            own = matrix[first:last, first:last]
            table.norms[i, b] = _norm(own - np.eye(last - first) * np.trace(own) / (last - first))
        table.matrix[i, :m, :m], table.slopes[i, :, :m, :m] = matrix, slopes
        diagonal = np.diagonal(table.slopes[i], axis1=1, axis2=2)
        table.diagonal[i] = np.hstack([diagonal.real, diagonal.imag])
        straight = np.arange(most) < blocks[0]
        pairs = straight & straight[:, None] & table.slopes[i].any(axis=0)
        pairs = np.argwhere(pairs & ~np.eye(most, dtype=bool))
        table.pairs[i, : len(pairs)] = pairs
        table.shift[i] = np.moveaxis(shift, 2, 0).reshape(n, -1)
    return table


def _norm(block):
    """Return the norm of a block, as its powers grow: free motions soon have none."""
    power = np.linalg.matrix_power(block, _POWER)
    return min(np.linalg.norm(block), np.linalg.norm(power) ** (1.0 / _POWER))


def _basis(a, slopes):
    """Return (into, out, blocks, T, D, S) of a matrix and its slopes; see `Bases`."""
    n, near = len(a), _NEAR
    scale = matrix_balance(a, permute=False, separate=True)[1][0]
    a = a * scale / scale[:, None]
    triangle, vectors = schur(a, output="complex")
    cluster, kept = np.empty((2, n), np.int64)
    while True:
        t, q = triangle.copy(), vectors.copy()
        count = clusters(np.diag(t).copy(), near, cluster, kept)
        gather(t, q, cluster, kept)
        basis = q @ split(t, cluster)
        t = np.where(cluster[:, None] == cluster, t, 0.0)
        block = straighten(t, cluster, basis)
        basis /= np.sqrt((basis.real**2 + basis.imag**2).sum(axis=0))
        inverse = np.linalg.inv(basis)
        condition = np.linalg.norm(inverse) * np.sqrt(n)
        if condition < _CONDITION or count == 1:
            break
        near *= _FARTHER
    matrix = np.triu(np.where(cluster[:, None] == cluster, inverse @ a @ basis, 0.0))
    straight = ~block & (cluster[:, None] == cluster)
    matrix[straight] = (matrix * np.eye(n))[straight]
    rows = np.flatnonzero(kept)
    rows = rows[np.argsort(block[rows], kind="stable")]
    into, out = inverse[rows], basis[:, rows] * kept[rows]
    changes = into @ (slopes * scale / scale[:, None]) @ basis
    shift = np.empty_like(changes)
    blocks = np.empty((len(slopes), rows.size, rows.size), complex)
    solve(matrix, cluster, rows, changes, shift, blocks)
    shift = (out @ shift @ inverse).real / scale * scale[:, None]
    ends = np.flatnonzero(np.diff(cluster[rows], prepend=-1, append=count))
    ends = np.append(ends[ends >= rows.size - block[rows].sum()], rows.size)
    return into / scale, out * scale[:, None], ends, matrix[np.ix_(rows, rows)], blocks, shift
