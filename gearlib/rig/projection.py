"""Eliminate the unknown gain and offset of a sensor, which enter residuals linearly.

Measured y = g f(p) + B c + noise, g and c unknown: for given p the best g and c are a linear least
squares problem, and only what it leaves is a residual of p (variable projection, Golub and Pereyra
1973).
"""

import numpy as np


def projected(measured, modelled, basis, unknown_gain):
    """Return (residuals, gain).

    Parameters
    ----------
    measured, modelled : ndarray, shape (n,)
        Over their standard deviations.
    basis : ndarray, shape (n, b)
        Columns of what is added by amounts unknown: offset, waves.
    unknown_gain : bool

    Returns
    -------
    residuals : ndarray, shape (n,)
    gain : float
    """
    if not unknown_gain:
        residuals = modelled - measured
        if basis.shape[1]:
            q = np.linalg.qr(basis)[0]
            residuals = residuals - q @ (q.T @ residuals)
        return residuals, 1.0
    columns = np.column_stack([modelled, basis])
    q, r = np.linalg.qr(columns)
    size = np.abs(np.diag(r))
    if not size.min() > 1e-12 * size.max():
        # A model that stands still has no gain.
        return -measured, 0.0
    weights = np.linalg.solve(r, q.T @ measured)
    return columns @ weights - measured, float(weights[0])
