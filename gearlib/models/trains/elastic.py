"""Rigid-body and elastic modes of a train, computed from its individual springs and masses.

The matrices K = F^T k F and M = H^T m H are sums over springs and masses. In floating-point
arithmetic K would lose a mesh of 1 N/m next to a shaft of 1e17 N/m, so K and M are never formed:

* Rigid-body modes, F v = 0, depend only on the directions of the springs. The rows of F are scaled
  by powers of 2 and eliminated, which does not round ratios of radii.
* Natural frequencies are the singular values of k^(1/2) F R^-1 with M = R^T R. Elimination with
  complete pivoting and one-sided Jacobi rotations compute small values as accurately as large ones.
  Demmel, Gu, Eisenstat, Slapnicar, Veselic, Drmac: Linear Algebra Appl. 299 (1999) 21-80; Drmac,
  Veselic: SIAM J. Matrix Anal. Appl. 29 (2008) 1322-1342.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import qr, solve_triangular
from scipy.linalg.lapack import dgejsv

#: Pivot tolerance for scaled rows; smaller pivots come from rounded angles and radii.
_MIN_PIVOT = 1e-6
#: Entries of a row below this fraction of its largest entry are rounding errors.
_ROUNDED_ENTRY = 1e-13
#: Springs below this fraction of the stiffest spring carry less than the rounding error of torques.
_MIN_RELATIVE_STIFFNESS = 1e-18
#: Number of passes that balance rows and columns; each halves the logarithm of their size ratio.
_SCALING_PASSES = 12

#: Springs or masses: (row vectors of n coordinates, (s, n), stiffnesses or masses >= 0, (s,)).
Elements = tuple[np.ndarray, np.ndarray]


class LinearModes(NamedTuple):
    """Modes of a linear train with n coordinates, k rigid-body modes and s springs."""

    free_motions: np.ndarray  #: mass-normalised rigid-body modes, shape (n, k)
    squared_frequencies: np.ndarray  #: squared angular frequencies, ascending, shape (n - k,)
    shapes: np.ndarray  #: mass-normalised mode shapes, shape (n, n - k)
    #: Elongation of each spring in each elastic mode, times the square root of its stiffness, over
    #: the angular frequency, shape (s, n - k). The columns are orthonormal; the squares are
    #: fractions of the strain energy.
    strains: np.ndarray


def free_motions_and_modes(springs: Elements, masses: Elements) -> LinearModes:
    """Compute the rigid-body modes and elastic modes of a system of springs and masses.

    `springs` and `masses` are pairs (rows, values). Row i of `rows`, shape (s, n), maps the n
    coordinates to the elongation of spring i, or their rates to the velocity of mass i; values[i]
    is its stiffness in N/m or its mass in kg. Rigid-body modes ("free motions") do not elongate any
    spring.
    """
    spring_rows, stiffness, is_significant = _drop_negligible(springs, _MIN_RELATIVE_STIFFNESS)
    free_motions = _null_space(spring_rows)
    coordinate_count, free_count = free_motions.shape
    rank = coordinate_count - free_count
    mass_rows, mass_values, _ = _drop_negligible(masses, 0.0)
    weighted_rows = np.sqrt(mass_values)[:, None] * mass_rows
    # In the coordinates z with q = root z the mass matrix is the identity matrix, so that the
    # singular values of the weighted springs are the natural frequencies.
    root = np.empty((coordinate_count, coordinate_count))
    triangle, order = qr(weighted_rows, mode="r", pivoting=True)
    root[order] = solve_triangular(triangle[:coordinate_count], np.eye(coordinate_count))
    weighted_springs = np.sqrt(stiffness)[:, None] * (spring_rows @ root)
    frequencies, left, right = _singular_values(weighted_springs, rank)
    # Orthonormalize the rigid-body modes with respect to the mass matrix.
    (factor,) = qr(weighted_rows @ free_motions, mode="r")
    factor = factor[:free_count] * np.where(np.diagonal(factor) < 0.0, -1.0, 1.0)[:, None]
    free_motions = solve_triangular(factor, free_motions.T, trans="T").T
    shapes = root @ right
    # Make the first entry positive that is at least half as large as the largest entry. The sign of
    # the largest entry itself would depend on rounding errors if several entries are equally large.
    magnitudes = np.abs(shapes)
    sign_rows = np.argmax(magnitudes >= 0.5 * magnitudes.max(axis=0, initial=0.0), axis=0)
    signs = np.where(shapes[sign_rows, np.arange(shapes.shape[1])] < 0.0, -1.0, 1.0)
    strains = np.zeros((is_significant.size, rank))
    strains[is_significant] = left * signs
    return LinearModes(free_motions, frequencies**2, shapes * signs, strains)


def _drop_negligible(elements, min_fraction) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Drop negligible springs or masses, and return the others as (rows, values, mask).

    `elements` is a pair (row vectors of shape (s, n), s stiffnesses or masses). The weight of an
    element is its value times the squared norm of its row; elements with at most `min_fraction` of
    the largest weight are dropped. `mask`, shape (s,), is True for the remaining elements. Entries
    of a row that differ from 0 only by rounding are set to 0.
    """
    rows, values = elements
    magnitudes = np.abs(rows)
    tolerance = _ROUNDED_ENTRY * magnitudes.max(axis=1, keepdims=True, initial=0.0)
    rows = np.where(magnitudes > tolerance, rows, 0.0)
    weights = values * (rows**2).sum(axis=1)
    mask = weights > min_fraction * weights.max(initial=0.0)
    return rows[mask], values[mask], mask


def _eliminate_with_complete_pivoting(matrix, max_pivots, min_pivot=0.0):
    """Factor a matrix by Gaussian elimination with complete pivoting.

    Each pivot is the largest remaining entry. The elimination stops after `max_pivots` pivots, or
    when all remaining entries are at most `min_pivot`. Returns (left, pivots, right, columns): the
    matrix is left @ diag(pivots) @ right up to the remaining entries, and `columns` lists the
    column indices of the pivots. No entry of `left` and `right` exceeds 1 in magnitude.
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
        # Remove rounding errors, so that these entries cannot become pivots.
        remaining[i], remaining[:, j] = 0.0, 0.0
        pivots.append(pivot)
        columns.append(int(j))
    row_count, column_count = matrix.shape
    left_factor = np.reshape(left, (-1, row_count)).T
    right_factor = np.reshape(right, (-1, column_count))
    return left_factor, np.array(pivots), right_factor, columns


def _null_space(rows: np.ndarray) -> np.ndarray:
    """Return a basis of the null space of `rows`, shape (s, n), as the columns of an (n, k) array.

    Rows and columns are first balanced by powers of 2, which is exact, so that a single threshold
    separates pivots from rounding errors.
    """
    n = rows.shape[1]
    scaled, column_scales = rows.copy(), np.ones(n)
    for _ in range(_SCALING_PASSES):
        row_scale = _balancing_powers(np.abs(scaled).max(axis=1, initial=0.0))
        scaled *= row_scale[:, None]
        column_scale = _balancing_powers(np.abs(scaled).max(axis=0, initial=0.0))
        scaled *= column_scale
        column_scales *= column_scale
        if (row_scale == 1.0).all() and (column_scale == 1.0).all():
            break
    _, _, right, pivot_columns = _eliminate_with_complete_pivoting(scaled, n, _MIN_PIVOT)
    # Each column without a pivot corresponds to one basis vector.
    free_columns = [j for j in range(n) if j not in pivot_columns]
    basis = np.eye(n)[:, free_columns]
    # Back substitution: entry j of `pivot_row` is 1, and basis[j] is still 0 in the product.
    for pivot_row, j in zip(right[::-1], pivot_columns[::-1], strict=True):
        basis[j] = -(pivot_row @ basis)
    return column_scales[:, None] * basis


def _balancing_powers(magnitudes: np.ndarray) -> np.ndarray:
    """Return the powers of 2 nearest to 1 / sqrt(magnitudes), or 1 for the magnitude 0.

    Multiplication by a power of 2 is exact.
    """
    with np.errstate(divide="ignore"):
        exponents = np.where(magnitudes > 0.0, np.log2(magnitudes), 0.0)
    return np.exp2(-np.rint(exponents / 2.0))


def _singular_values(matrix: np.ndarray, rank: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the nonzero singular values and singular vectors of a matrix of known rank.

    The result is (values, left vectors, right vectors), with ascending values and one vector per
    column. Elimination with complete pivoting and one-sided Jacobi rotations (LAPACK's dgejsv)
    compute small values as accurately as large ones.
    """
    left, pivots, right, _ = _eliminate_with_complete_pivoting(matrix, rank)
    orthogonal, triangle, order = qr(left * pivots, mode="economic", pivoting=True)
    factor = (triangle @ right[order]).T
    if not factor.size:
        return np.empty(0), orthogonal @ np.empty((0, 0)), np.empty((len(factor), 0))
    # The options request both kinds of vectors, without restricted range, transposition or
    # perturbation. The factor is transposed, so that its left vectors are right vectors here.
    values, right, left, scale, _, info = dgejsv(
        factor, joba=0, jobu=0, jobv=0, jobr=0, jobt=1, jobp=1
    )
    if info != 0:
        raise np.linalg.LinAlgError("the computation of singular values did not converge")
    # LAPACK returns descending values, and may scale them to avoid overflow.
    ascending = slice(None, None, -1)
    values = values[ascending] * (scale[0] / scale[1])
    return values, orthogonal @ left[:, ascending], right[:, ascending]
