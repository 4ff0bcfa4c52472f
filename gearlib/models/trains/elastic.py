"""Free motions and natural modes of a train, computed from its single springs and masses.

The matrices K = F^T k F and M = H^T m H are sums over springs and masses. In floating-point numbers
K would lose a mesh of 1 N/m beside a shaft of 1e17 N/m, so K and M are never formed:

* Free motions, F v = 0, follow from the directions of the springs alone, which are scaled by powers
  of 2 and eliminated. This does not round ratios of radii.
* Natural frequencies are singular values of k^(1/2) F R^-1 with M = R^T R. Elimination with the
  largest pivots and Jacobi's rotations from one side find the small ones to as many digits as the
  large ones. Demmel, Gu, Eisenstat, Slapnicar, Veselic, Drmac: LinearModes Algebra Appl. 299 (1999)
  21-80; Drmac, Veselic: SIAM J. Matrix Anal. Appl. 29 (2008) 1322-1342.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import qr, solve_triangular
from scipy.linalg.lapack import dgejsv

#: Smaller pivots of directions of size 1 are rounding errors of rounded angles and radii.
_MIN_PIVOT = 1e-6
#: Smaller entries, over the largest of a direction, are a sine or cosine that should be 0.
_ROUNDED_ENTRY = 1e-13
#: Softer springs, over the stiffest, carry less than the rounding error of the torques.
_MIN_RELATIVE_STIFFNESS = 1e-18
#: Passes that scale rows and columns; each halves the decades between their sizes.
_SCALING_PASSES = 12


#: Pair (row vectors of n coordinates, shape (s, n), stiffness or mass >= 0, shape (s,)).
Elements = tuple[np.ndarray, np.ndarray]


class LinearModes(NamedTuple):
    """Modes of a linear train with n coordinates, k free motions and s springs."""

    free_motions: np.ndarray  #: motions that no spring resists, mass-normalised, shape (n, k)
    squared_frequencies: np.ndarray  #: squared angular frequencies, ascending, shape (n - k,)
    shapes: np.ndarray  #: mass-normalised mode shapes, shape (n, n - k)
    #: Stretch of each spring in each mode times the root of its stiffness, over the frequency. The
    #: squares are shares of the strain energy; shape (s, n - k), orthonormal.
    strains: np.ndarray


def free_motions_and_modes(springs: Elements, masses: Elements) -> LinearModes:
    """Return the free motions and natural modes of a system of springs and masses.

    Springs and masses are each a pair: row vectors of the n coordinates, (s, n), and stiffnesses in
    N/m or masses in kg, (s,).
    """
    rows, stiffness, significant = _without_negligible(springs, _MIN_RELATIVE_STIFFNESS)
    free = _null_space(rows)
    mass_rows, mass_values, _ = _without_negligible(masses, 0.0)
    weighted = np.sqrt(mass_values)[:, None] * mass_rows
    root = np.empty((free.shape[0], free.shape[0]))
    triangle, order = qr(weighted, mode="r", pivoting=True)
    # The coordinates z with q = root z have unit mass.
    root[order] = solve_triangular(triangle[: len(root)], np.eye(len(root)))
    rank = rows.shape[1] - free.shape[1]
    frequencies, left, right = _singular_values(np.sqrt(stiffness)[:, None] * (rows @ root), rank)
    # This triangular factor makes the free motions orthonormal with respect to the mass.
    (factor,) = qr(weighted @ free, mode="r")
    factor = factor[: free.shape[1]] * np.where(np.diagonal(factor) < 0.0, -1.0, 1.0)[:, None]
    free = solve_triangular(factor, free.T, trans="T").T
    shapes = root @ right
    # The first large entry of each shape is positive. If several components are largest, rounding
    # errors would choose among them.
    sizes = np.abs(shapes)
    first = np.argmax(sizes >= 0.5 * sizes.max(axis=0, initial=0.0), axis=0)
    signs = np.where(shapes[first, np.arange(shapes.shape[1])] < 0.0, -1.0, 1.0)
    strains = np.zeros((significant.size, rank))
    strains[significant] = left * signs
    return LinearModes(free, frequencies**2, shapes * signs, strains)


def _without_negligible(elements, min_fraction) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (rows, values, mask) of the springs or masses that are not negligible.

    An element is negligible if it is smaller than a fraction of the largest one.
    """
    rows, values = elements
    sizes = np.abs(rows)
    smallest = _ROUNDED_ENTRY * sizes.max(axis=1, keepdims=True, initial=0.0)
    rows = np.where(sizes > smallest, rows, 0.0)
    weight = values * (rows**2).sum(axis=1)
    mask = weight > min_fraction * weight.max(initial=0.0)
    return rows[mask], values[mask], mask


def _complete_pivoting(matrix, max_pivots, min_pivot=0.0):
    """Factor a matrix by elimination with complete pivoting.

    It ends after `max_pivots` pivots or when they are not larger than `min_pivot`. Returns (left,
    pivots, right, columns of the pivots) with matrix = left diag(pivots) right up to the remainder.
    The entries of left and right are at most 1.
    """
    remaining = matrix.copy()
    left, pivots, right, columns = [], [], [], []
    while len(pivots) < max_pivots and remaining.size:
        i, j = np.unravel_index(np.argmax(np.abs(remaining)), remaining.shape)
        pivot = remaining[i, j]
        if not abs(pivot) > min_pivot:
            break
        left.append(remaining[:, j] / pivot)
        right.append(remaining[i] / pivot)
        remaining = remaining - np.outer(left[-1], remaining[i])
        remaining[i], remaining[:, j] = 0.0, 0.0
        pivots.append(pivot)
        columns.append(int(j))
    row_count, column_count = matrix.shape
    lefts, rights = np.reshape(left, (-1, row_count)), np.reshape(right, (-1, column_count))
    return lefts.T, np.array(pivots), rights, columns


def _null_space(rows: np.ndarray) -> np.ndarray:
    """Return a basis, shape (n, k), of the vectors that all row vectors, (s, n), map to 0."""
    n = rows.shape[1]
    scaled, weights = rows.copy(), np.ones(n)
    for _ in range(_SCALING_PASSES):
        row_scale = _balancing_powers(np.abs(scaled).max(axis=1, initial=0.0))
        scaled *= row_scale[:, None]
        column_scale = _balancing_powers(np.abs(scaled).max(axis=0, initial=0.0))
        scaled *= column_scale
        weights *= column_scale
        if (row_scale == 1.0).all() and (column_scale == 1.0).all():
            break
    _, _, right, pivot_columns = _complete_pivoting(scaled, n, _MIN_PIVOT)
    free_columns = [j for j in range(n) if j not in pivot_columns]
    basis = np.eye(n)[:, free_columns]
    # Back substitution: the row of a pivot column is 0 until its step.
    for row, j in zip(right[::-1], pivot_columns[::-1], strict=True):
        basis[j] = -(row @ basis)
    return weights[:, None] * basis


def _balancing_powers(sizes: np.ndarray) -> np.ndarray:
    """Return the powers of 2 nearest to 1 / sqrt(sizes), or 1 where a size is 0."""
    with np.errstate(divide="ignore"):
        exponent = np.where(sizes > 0.0, np.log2(sizes), 0.0)
    return np.exp2(-np.rint(exponent / 2.0))


def _singular_values(matrix: np.ndarray, rank: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (ascending singular values, left vectors, right vectors) of a matrix of known rank.

    Jacobi rotations find small singular values as exactly as large ones, because the columns after
    complete pivoting are far from parallel.
    """
    left, pivots, right, _ = _complete_pivoting(matrix, rank)
    orthogonal, triangle, order = qr(left * pivots, mode="economic", pivoting=True)
    factor = (triangle @ right[order]).T
    if not factor.size:
        return np.empty(0), orthogonal @ np.empty((0, 0)), np.empty((len(factor), 0))
    # Compute both kinds of vectors, without restricted range, transposition or perturbation.
    values, right, left, scale, _, info = dgejsv(
        factor, joba=0, jobu=0, jobv=0, jobr=0, jobt=1, jobp=1
    )
    if info != 0:
        raise np.linalg.LinAlgError("the singular values do not converge")
    ascending = slice(None, None, -1)
    values = values[ascending] * (scale[0] / scale[1])
    return values, orthogonal @ left[:, ascending], right[:, ascending]
