"""Free motions and natural modes of a train, from its springs and masses one by one.

With K = F^T k F and M = H^T m H, sums over springs and masses, a matrix K of floating-point numbers
no longer holds a mesh of 1 N/m beside a shaft of 1e17. So K and M are never formed:

* What no spring resists, F v = 0, is decided by the directions of the springs alone. They are
  scaled by powers of 2 and eliminated, which leaves ratios of radii as they are.
* Natural frequencies are singular values of k^(1/2) F R^-1 with M = R^T R. Elimination with the
  largest pivots and Jacobi's rotations from one side find the small ones to as many digits as the
  large ones. Demmel, Gu, Eisenstat, Slapnicar, Veselic, Drmac: Linear Algebra Appl. 299 (1999)
  21-80; Drmac, Veselic: SIAM J. Matrix Anal. Appl. 29 (2008) 1322-1342.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import qr, solve_triangular
from scipy.linalg.lapack import dgejsv

#: Of directions scaled to 1: less is rounding of the angles and radii of a drawing.
_MIN_PIVOT = 1e-6
#: Of the largest entry of a direction: less is rounding of a sine or cosine that is 0.
_ROUNDED_ENTRY = 1e-13
#: Of the stiffest spring: a softer one carries less than the rounding of the torques.
_MIN_STIFFNESS_SHARE = 1e-18
#: Passes of the scaling of rows and columns; each halves the decades between them.
_SCALING_PASSES = 12


class Linear(NamedTuple):
    """A linear train: n coordinates, k free motions, s springs."""

    free: np.ndarray  #: motions that no spring resists, mass-normalised, shape (n, k)
    squares: np.ndarray  #: angular frequencies, squared, ascending, shape (n - k,)
    shapes: np.ndarray  #: mass-normalised, shape (n, n - k)
    #: Stretch of each spring in each mode times root of its stiffness, over the frequency:
    #: the square is its share of the strain energy; shape (s, n - k), orthonormal.
    strains: np.ndarray


def linear(springs, masses):
    """Return the `Linear` train of springs and masses.

    Each are directions, functionals of the n coordinates, shape (s, n), and values >= 0, (s,).
    """
    rows, stiffness, kept = _significant(springs, _MIN_STIFFNESS_SHARE)
    free = _null_space(rows)
    weights, heavy, _ = _significant(masses, 0.0)
    weighted = np.sqrt(heavy)[:, None] * weights
    root = np.empty((free.shape[0], free.shape[0]))
    triangle, order = qr(weighted, mode="r", pivoting=True)
    # Coordinates of unit mass: motions are q = root z.
    root[order] = solve_triangular(triangle[: len(root)], np.eye(len(root)))
    rank = rows.shape[1] - free.shape[1]
    values, left, right = _singular(np.sqrt(stiffness)[:, None] * (rows @ root), rank)
    (factor,) = qr(weighted @ free, mode="r")
    factor = factor[: free.shape[1]] * np.where(np.diagonal(factor) < 0.0, -1.0, 1.0)[:, None]
    free = solve_triangular(factor, free.T, trans="T").T
    shapes = root @ right
    signs = _signs(shapes)
    strains = np.zeros((kept.size, rank))
    strains[kept] = left * signs
    return Linear(free, values**2, shapes * signs, strains)


def _signs(shapes):
    """Return the signs with which the first large component of each shape is positive."""
    sizes = np.abs(shapes)
    # Not the largest: of several alike rounding would choose.
    first = np.argmax(sizes >= 0.5 * sizes.max(axis=0, initial=0.0), axis=0)
    return np.where(shapes[first, np.arange(shapes.shape[1])] < 0.0, -1.0, 1.0)


def _significant(parts, least):
    """Return directions and values of parts above `least` of the largest, and which they are."""
    rows, values = parts
    sizes = np.abs(rows)
    rows = np.where(
        sizes > _ROUNDED_ENTRY * sizes.max(axis=1, keepdims=True, initial=0.0), rows, 0.0
    )
    weight = values * (rows**2).sum(axis=1)
    kept = weight > least * weight.max(initial=0.0)
    return rows[kept], values[kept], kept


def _eliminated(matrix, most, close=0.0):
    """Eliminate with the largest pivots, at most so many and none of `close` or less.

    Returns (left, pivots, right, columns): matrix = left diag(pivots) right, but for what is left
    over; the columns of the pivots in their order. Entries of left and right are at most 1.
    """
    remaining = matrix.copy()
    left, pivots, right, columns = [], [], [], []
    while len(pivots) < most and remaining.size:
        i, j = np.unravel_index(np.argmax(np.abs(remaining)), remaining.shape)
        pivot = remaining[i, j]
        if not abs(pivot) > close:
            break
        left.append(remaining[:, j] / pivot)
        right.append(remaining[i] / pivot)
        remaining = remaining - np.outer(left[-1], remaining[i])
        remaining[i], remaining[:, j] = 0.0, 0.0
        pivots.append(pivot)
        columns.append(int(j))
    shapes = (-1, matrix.shape[0]), (-1, matrix.shape[1])
    lefts, rights = np.reshape(left, shapes[0]), np.reshape(right, shapes[1])
    return lefts.T, np.array(pivots), rights, columns


def _null_space(rows):
    """Return a basis of what all rows map to 0, shape (n, k), by their directions only."""
    n = rows.shape[1]
    scaled, weights = rows.copy(), np.ones(n)
    for _ in range(_SCALING_PASSES):
        along = _power(np.abs(scaled).max(axis=1, initial=0.0))
        scaled *= along[:, None]
        across = _power(np.abs(scaled).max(axis=0, initial=0.0))
        scaled *= across
        weights *= across
        if (along == 1.0).all() and (across == 1.0).all():
            break
    _, _, right, pivoted = _eliminated(scaled, n, _MIN_PIVOT)
    loose = [j for j in range(n) if j not in pivoted]
    basis = np.eye(n)[:, loose]
    # A row of its pivot is 0 until then.
    for row, j in zip(right[::-1], pivoted[::-1], strict=True):
        basis[j] = -(row @ basis)
    return weights[:, None] * basis


def _power(size):
    """Return the power of 2 that brings sizes half way to 1; 1 for those that are 0."""
    with np.errstate(divide="ignore"):
        exponent = np.where(size > 0.0, np.log2(size), 0.0)
    return np.exp2(-np.rint(exponent / 2.0))


def _singular(matrix, rank):
    """Return singular values, ascending, left and right vectors of a matrix of known rank."""
    left, pivots, right, _ = _eliminated(matrix, rank)
    turned, triangle, order = qr(left * pivots, mode="economic", pivoting=True)
    values, right, left = _jacobi((triangle @ right[order]).T)
    return values, turned @ left, right


def _jacobi(matrix):
    """Return singular values, ascending, left and right vectors of a matrix (m, n), m >= n.

    Its columns may be of any size, if they are far from parallel: small values are as exact as
    large ones.
    """
    if not matrix.size:
        return np.empty(0), np.empty((len(matrix), 0)), np.empty((0, 0))
    values, left, right, scale, _, info = dgejsv(matrix, 0, 0, 0, 1, 1, 1)
    if info != 0:
        raise np.linalg.LinAlgError("the singular values do not converge")
    order = slice(None, None, -1)
    return values[order] * (scale[0] / scale[1]), left[:, order], right[:, order]
