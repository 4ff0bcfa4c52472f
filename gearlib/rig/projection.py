"""Unknown gain and offset of a sensor, eliminated: they enter residuals linearly.

Measured y = g f(p) + B c + noise, g and c unknown: for given p the best g and c are a linear least
squares problem, and only what it leaves is a residual of p (variable projection, Golub and Pereyra
1973). Its derivative is exact.
"""

import numpy as np

#: Share of a derivative that is left of it by rounding.
_ROUNDING = 1e-10


def projected(measured, modelled, slopes, basis, unknown_gain):
    """Return (residuals, their derivatives, gain).

    Parameters
    ----------
    measured, modelled : ndarray, shape (n,)
        Over their standard deviations.
    slopes : ndarray, shape (n, k)
        Derivatives of `modelled`.
    basis : ndarray, shape (n, b)
        Columns of what is added by amounts unknown: offset, waves.
    unknown_gain : bool

    Returns
    -------
    residuals, derivatives : ndarray, shapes (n,), (n, k)
    gain : float
    """
    if not unknown_gain:
        if not basis.shape[1]:
            return modelled - measured, slopes, 1.0
        q = np.linalg.qr(basis)[0]
        rest, moved = modelled - measured, slopes - q @ (q.T @ slopes)
        return rest - q @ (q.T @ rest), moved, 1.0
    columns = np.column_stack([modelled, basis])
    q, r = np.linalg.qr(columns)
    size = np.abs(np.diag(r))
    if not size.min() > 1e-12 * size.max():
        # A model that stands still has no gain.
        return -measured, np.zeros_like(slopes), 0.0
    weights = np.linalg.solve(r, q.T @ measured)
    rest = columns @ weights - measured
    moved = weights[0] * (slopes - q @ (q.T @ slopes))
    # The gain follows the parameters: d(P y) = (1 - P) dF F+ y + ((1 - P) dF F+)^T y.
    first = np.linalg.solve(r.T, np.eye(len(r))[0])
    moved -= np.outer(q @ first, rest @ slopes)
    # What the gain takes up as a whole leaves rounding, along which a fit would wander.
    lost = np.linalg.norm(moved, axis=0) < _ROUNDING * abs(weights[0]) * np.linalg.norm(
        slopes, axis=0
    )
    moved[:, lost] = 0.0
    return rest, moved, float(weights[0])
