"""One degree of freedom as a compiled right-hand side, for solvers that call back.

All numbers of a branch, one piece of the stiffness with one contact code, are one array:

    d1, d2, d3, c and its slope at the start of the piece, that start, 1 in contact and 0 in the
    backlash, distance of the far flank (0 in normal mesh), p2, p3, number of harmonics of F and of
    c, their rows.
"""

import math

import numpy as np

from gearlib.kernels.codes import BACKLASH, NORMAL
from gearlib.kernels.jit import kernel


def pack(law, piece, contact):
    """Return the numbers of a branch of a `gearlib.kernels.taylor.series.Law`."""
    return np.array(
        [
            *(law.oil if contact == BACKLASH else law.material),
            *law.pieces[piece],
            law.breaks[piece],
            0.0 if contact == BACKLASH else 1.0,
            0.0 if contact == NORMAL else law.gap,
            *law.powers,
            len(law.force),
            len(law.stiffness),
            *law.force.ravel(),
            *law.stiffness.ravel(),
        ]
    )


@kernel
def _waves(t, p, first, count):
    total = 0.0
    for j in range(first, first + 3 * count, 3):
        if p[j] == 0.0:
            total += p[j + 1]
        else:
            total += p[j + 1] * math.cos(p[j] * t) + p[j + 2] * math.sin(p[j] * t)
    return total


@kernel
def acceleration(t, x, v, p):
    """Return x'' on the branch with the numbers p, at phase t of the mesh period."""
    forces, stiffnesses = int(p[10]), int(p[11])
    total = _waves(t, p, 12, forces) - (p[0] + (p[1] + p[2] * abs(v)) * abs(v)) * v
    if p[6] == 0.0:
        return total
    c = p[3] + p[4] * (t - p[5]) + _waves(t, p, 12 + 3 * forces, stiffnesses)
    u = x + p[7]
    return total - c * (u + (p[8] * abs(u) + p[9] * u * u) * u)


@kernel
def fill_rate(t, z, out, p):
    """Fill `out` with (x', x'')."""
    out[0] = z[1]
    out[1] = acceleration(t, z[0], z[1], p)
