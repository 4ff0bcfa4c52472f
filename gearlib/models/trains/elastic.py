"""Free motions and natural modes of a train, computed from its single springs and masses.

The matrices K = F^T k F and M = H^T m H are sums over springs and masses. In floating-point numbers
K would lose a mesh of 1 N/m beside a shaft of 1e17 N/m, so K and M are never formed:

* Free motions, F v = 0, follow from the directions of the springs alone, which are scaled by powers
  of 2 and eliminated. This does not round ratios of radii.
* Natural frequencies are singular values of k^(1/2) F R^-1 with M = R^T R. Elimination with
  complete pivoting and one-sided Jacobi rotations find small ones to as many digits as large ones.
  Demmel, Gu, Eisenstat, Slapnicar, Veselic, Drmac: Linear Algebra Appl. 299 (1999) 21-80; Drmac,
  Veselic: SIAM J. Matrix Anal. Appl. 29 (2008) 1322-1342.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import qr, solve_triangular
from scipy.linalg.lapack import dgejsv

#: Smaller pivots, relative to directions of size 1, come from rounded angles and radii.
_MIN_PIVOT = 1e-6
#: Entries below this fraction of the largest entry of a row are a sine or cosine that should be 0.
_ROUNDED_ENTRY = 1e-13
#: Springs below this fraction of the stiffest carry less than the rounding error of the torques.
_MIN_RELATIVE_STIFFNESS = 1e-18
#: Number of passes that scale rows and columns; each halves the decades between their sizes.
_SCALING_PASSES = 12

#: Springs or masses: (row vectors of n coordinates, (s, n), stiffnesses or masses >= 0, (s,)).
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
    """Return the rigid-body motions and natural modes of a system of springs and masses.

    `springs` and `masses` are pairs (rows, values). Row i of `rows`, shape (s, n), maps the n
    coordinates to the elongation of spring i, or their rates to the velocity of mass i; values[i]
    is its stiffness in N/m or its mass in kg. Rigid-body ("free") motions are those that no spring
    resists. The result is a `LinearModes`.
    """
    spring_rows, stiffness, is_significant = _without_negligible(springs, _MIN_RELATIVE_STIFFNESS)
    free_motions = _null_space(spring_rows)
    coordinate_count, free_count = free_motions.shape
    rank = coordinate_count - free_count
    mass_rows, mass_values, _ = _without_negligible(masses, 0.0)
    weighted_rows = np.sqrt(mass_values)[:, None] * mass_rows
    # In the coordinates z with q = root z the mass matrix is the identity, so that the singular
    # values of the weighted springs are the natural frequencies.
    root = np.empty((coordinate_count, coordinate_count))
    triangle, order = qr(weighted_rows, mode="r", pivoting=True)
    root[order] = solve_triangular(triangle[:coordinate_count], np.eye(coordinate_count))
    weighted_springs = np.sqrt(stiffness)[:, None] * (spring_rows @ root)
    frequencies, left, right = _singular_values(weighted_springs, rank)
    # This triangular factor makes the free motions orthonormal with respect to the mass.
    (factor,) = qr(weighted_rows @ free_motions, mode="r")
    factor = factor[:free_count] * np.where(np.diagonal(factor) < 0.0, -1.0, 1.0)[:, None]
    free_motions = solve_triangular(factor, free_motions.T, trans="T").T
    shapes = root @ right
    # The first entry of at least half the largest size is positive. The sign of the largest entry
    # would depend on rounding errors where several entries are equally large.
    sizes = np.abs(shapes)
    sign_rows = np.argmax(sizes >= 0.5 * sizes.max(axis=0, initial=0.0), axis=0)
    signs = np.where(shapes[sign_rows, np.arange(shapes.shape[1])] < 0.0, -1.0, 1.0)
    strains = np.zeros((is_significant.size, rank))
    strains[is_significant] = left * signs
    return LinearModes(free_motions, frequencies**2, shapes * signs, strains)


def _without_negligible(elements, min_fraction) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Leave out negligible springs or masses; return the others as (rows, values, mask).

    `elements` is the pair (row vectors of shape (s, n), s stiffnesses or masses). An element is
    left out if its value, times its squared row, is at most `min_fraction` of the largest such
    product. `mask`, shape (s,), is True for the elements that are kept. Entries of a row that
    differ from 0 only by rounding are set to 0.
    """
    rows, values = elements
    sizes = np.abs(rows)
    smallest = _ROUNDED_ENTRY * sizes.max(axis=1, keepdims=True, initial=0.0)
    rows = np.where(sizes > smallest, rows, 0.0)
    weight = values * (rows**2).sum(axis=1)
    mask = weight > min_fraction * weight.max(initial=0.0)
    return rows[mask], values[mask], mask


def _complete_pivoting(matrix, max_pivots, min_pivot=0.0):
    """Factor a matrix by Gaussian elimination with complete pivoting.

    Each pivot is the largest remaining entry. The elimination stops after `max_pivots` pivots, or
    when no remaining entry is larger than `min_pivot`. Returns (left, pivots, right, columns): the
    matrix equals left @ diag(pivots) @ right up to the remaining entries, and `columns` lists the
    column index of each pivot. No entry of `left` and `right` exceeds 1.
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
        # These entries are 0 up to rounding; set them exactly, so that they are never pivots again.
        remaining[i], remaining[:, j] = 0.0, 0.0
        pivots.append(pivot)
        columns.append(int(j))
    row_count, column_count = matrix.shape
    lefts, rights = np.reshape(left, (-1, row_count)), np.reshape(right, (-1, column_count))
    return lefts.T, np.array(pivots), rights, columns


def _null_space(rows: np.ndarray) -> np.ndarray:
    """Return a basis of the null space of `rows`, shape (s, n), as the columns of an (n, k) array.

    Rows and columns are first scaled by powers of 2, which is exact, until their largest entries
    are of similar size; then one threshold separates pivots from rounding errors. Each column
    without a pivot belongs to one vector of the basis.
    """
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
    # Back substitution: `pivot_row` is 1 in column j, and basis[j] is still 0 when the row is
    # multiplied by the basis.
    for pivot_row, j in zip(right[::-1], pivot_columns[::-1], strict=True):
        basis[j] = -(pivot_row @ basis)
    # Undo the scaling of the columns.
    return weights[:, None] * basis


def _balancing_powers(sizes: np.ndarray) -> np.ndarray:
    """Return the power of 2 nearest to 1 / sqrt(size) for each of the sizes, or 1 where it is 0.

    Multiplication by a power of 2 does not round.
    """
    with np.errstate(divide="ignore"):
        exponent = np.where(sizes > 0.0, np.log2(sizes), 0.0)
    return np.exp2(-np.rint(exponent / 2.0))


def _singular_values(matrix: np.ndarray, rank: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the nonzero singular values of a matrix of known rank, with their vectors.

    The result is (values, left vectors, right vectors), with ascending values and one vector per
    column. The matrix is factored by elimination with complete pivoting, and then by one-sided
    Jacobi rotations (LAPACK's dgejsv), which find small values to as many digits as large ones.
    """
    left, pivots, right, _ = _complete_pivoting(matrix, rank)
    orthogonal, triangle, order = qr(left * pivots, mode="economic", pivoting=True)
    factor = (triangle @ right[order]).T
    if not factor.size:
        return np.empty(0), orthogonal @ np.empty((0, 0)), np.empty((len(factor), 0))
    # LAPACK computes both kinds of vectors, without restricted range, transposition or
    # perturbation. The factor is transposed, so that its left vectors are our right ones.
    values, right, left, scale, _, info = dgejsv(
        factor, joba=0, jobu=0, jobv=0, jobr=0, jobt=1, jobp=1
    )
    if info != 0:
        raise np.linalg.LinAlgError("the singular values do not converge")
    ascending = slice(None, None, -1)
    # LAPACK may scale the values to avoid overflow; this factor restores them.
    values = values[ascending] * (scale[0] / scale[1])
    return values, orthogonal @ left[:, ascending], right[:, ascending]
