"""Gain and offset of a sensor found in 50 digits: what is left of measured values.

By normal equations: nothing of how the library does it.
"""

import mpmath
from mpmath import mp

mp.dps = 50


def left(measured, modelled, basis, gain):
    """Return what least squares leave: gain times modelled, plus columns of a basis, less measured.

    gain: whether it is unknown; else it is 1.
    """
    wanted = measured if gain else [y - f for y, f in zip(measured, modelled, strict=True)]
    columns = [*([modelled] if gain else []), *basis]
    if not columns:
        return [-y for y in wanted]
    normal = mpmath.matrix([[mp.fdot(a, b) for b in columns] for a in columns])
    best = mpmath.lu_solve(normal, mpmath.matrix([mp.fdot(a, wanted) for a in columns]))
    return [mp.fdot(best, row) - y for *row, y in zip(*columns, wanted, strict=True)]
