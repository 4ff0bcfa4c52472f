"""Unknown phase of a shaft, eliminated: mesh orders turn by a multiple of one angle.

A course that begins at the mesh phase a instead of 0 has the orders e^{i k a} c_k. For given
parameters the best angle is a maximum of a trigonometric polynomial: starts on the circle, then
Newton's method. Its derivative by the parameters follows from that at the maximum.
"""

import numpy as np

#: Starts on the circle for each order.
_STARTS = 8


def turned(measured, modelled, slopes, weights):
    """Return (modelled orders, their derivatives, angle), turned to the measured ones.

    Parameters
    ----------
    measured, modelled : ndarray, shape (blocks, orders)
        Complex, from the first order on.
    slopes : ndarray, shape (blocks, orders, k)
        Derivatives of `modelled`.
    weights : ndarray, shape (blocks,)
        One over the variances.
    """
    k = np.arange(1, measured.shape[1] + 1)
    # Their sum of products, which is to be largest: sum of Re p_k e^{i k a}, any gain > 0.
    product = np.einsum("b,bk,bk->k", weights, measured.conj(), modelled)
    by = np.einsum("b,bk,bkp->kp", weights, measured.conj(), slopes)

    def bend(angle, power):
        return ((1j * k) ** power * product * np.exp(1j * np.multiply.outer(angle, k))).real.sum(-1)

    grid = np.linspace(0.0, 2.0 * np.pi, _STARTS * k.size, endpoint=False)
    angle = float(grid[bend(grid, 0).argmax()])
    for _ in range(50):
        curvature = bend(angle, 2)
        # Where the sum is not bent downwards, a step uphill.
        step = -bend(angle, 1) / (curvature if curvature < 0.0 else -(k**2 @ np.abs(product)))
        angle += float(np.clip(step, -np.pi / k.size, np.pi / k.size))
        if abs(step) < 1e-14:
            break
    turn = np.exp(1j * k * angle)
    curvature = bend(angle, 2)
    moved = -(1j * k * turn @ by).real / curvature if curvature < 0.0 else np.zeros(by.shape[1])
    ahead = slopes + 1j * (k[:, None] * moved) * modelled[:, :, None]
    return modelled * turn, ahead * turn[:, None], angle
