"""Floquet multipliers of a periodic motion by Hill's method: the variations over harmonics.

Small deviations obey y'' + a(tau) y' + (h(tau) y)' + b(tau) y = 0, the terms of which are those of
`MeshEquation.variation`. With y = exp(l tau) sum_k y_k exp(i k tau / n), cut at |k| <= K, this is a
quadratic eigenvalue problem in l with 2 (2 K + 1) eigenvalues, of which two mean something: every
exponent l returns as l + i k / n, the worse the farther from the middle. Kept are those whose
eigenvectors are the most symmetric about k = 0 (Lazarus, Thomas, C. R. Mecanique 338 (2010)
510-517), paired so that the product of their multipliers is that of Liouville's formula: at a real
negative multiplier an exponent and its conjugate are equally symmetric, and only the product tells
two multipliers from one that is found twice.
"""

import numpy as np
from scipy.sparse.linalg import ArpackNoConvergence, eigs

#: Harmonics of the variations at most: the matrix costs their number cubed.
MOST = 100
#: Exponents among which the two are sought.
_CANDIDATES = 8
#: Restarts of ARPACK; without strong damping four are enough.
_MAX_RESTARTS = 10
#: Off the middle between the exponents, where a double one would make the matrix singular.
_ASIDE = 1e-3 + 0.7e-3j


def multipliers(equation, coefficients, harmonics=None):
    """Return the two Floquet multipliers of the period, complex, largest first.

    `coefficients`, shape (equation.harmonics + 1,), are those of the motion. `harmonics`, K, is
    as many as the motion has, at most 100, by default.
    """
    most = min(equation.harmonics, MOST) if harmonics is None else harmonics
    k = np.arange(-most, most + 1)
    variation = equation.variation(*equation.motion(coefficients))
    a, h, b = (np.fft.fft(part, norm="forward")[k[:, None] - k] for part in variation)
    # With u = (l + i k) y + h y: linear in l for (y, u).
    rate = np.diag(1j * k / equation.period)
    matrix = np.block([[-rate - h, np.eye(k.size)], [a @ h - b, -rate - a]])
    # Liouville: the two exponents lie on either side of minus half the mean damping, and the
    # copies of either farther from there than itself.
    mean = np.mean(variation[0] + variation[1])
    start = np.exp(-np.abs(np.tile(k, 2))).astype(complex)
    near = -mean / 2.0 + _ASIDE
    count = min(_CANDIDATES, 2 * k.size - 2)
    try:
        exponents, vectors = eigs(matrix, count, sigma=near, v0=start, maxiter=_MAX_RESTARTS)
    except ArpackNoConvergence:
        # The copies of strongly damped exponents are nearly equally far from the middle.
        exponents, vectors = np.linalg.eig(matrix)
    share = np.abs(vectors[: k.size]) ** 2
    skew = np.abs(k @ share) / share.sum(axis=0)
    length = 2.0 * np.pi * equation.period
    found = np.exp(length * exponents[np.argsort(skew, kind="stable")])
    pair = np.array(_pair(found, np.exp(-length * mean)))
    return pair[np.argsort(-np.abs(pair), kind="stable")]


def _pair(found, product):
    """Return the most symmetric multiplier, and the one whose product with it is `product`."""
    scale = max(abs(product), np.finfo(float).tiny)
    miss = np.abs(found[0] * found[1:] - product) / scale
    return found[0], found[1 + int(np.argmin(miss))]
