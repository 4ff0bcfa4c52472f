"""One degree of freedom as a compiled right-hand side, for solvers that call back.

All numbers of a branch, one piece of the stiffness with one contact code, are one array:

    d1, d2, d3, c and its slope at the start of the piece, that start, 1 in contact and 0 in the
    backlash, how far the flank lies below 0, p2, p3, number of harmonics of F and of c, e, rows of
    the harmonics.
"""

import math

import numpy as np

from gearlib.kernels.codes import BACKLASH, INVERSE
from gearlib.kernels.jit import kernel
from gearlib.kernels.taylor.series import damping_of

#: Where the rows of the harmonics begin.
ROWS = 13


def pack(law, piece, contact):
    """Return the numbers of a branch of a `gearlib.kernels.taylor.series.Law`."""
    far = contact == INVERSE
    stiffness = law.far_stiffness if far else law.stiffness
    return np.array(
        [
            *damping_of(law, contact),
            *(law.far_pieces if far else law.pieces)[piece],
            law.breaks[piece],
            0.0 if contact == BACKLASH else 1.0,
            -law.lower if far else -law.upper,
            *law.powers,
            len(law.force),
            len(stiffness),
            law.ground,
            *law.force.ravel(),
            *stiffness.ravel(),
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
    total = _waves(t, p, ROWS, forces) - (p[0] + (p[1] + p[2] * abs(v)) * abs(v)) * v - p[12] * x
    if p[6] == 0.0:
        return total
    c = p[3] + p[4] * (t - p[5]) + _waves(t, p, ROWS + 3 * forces, stiffnesses)
    u = x + p[7]
    return total - c * (u + (p[8] * abs(u) + p[9] * u * u) * u)


@kernel
def fill_rate(t, z, out, p):
    """Fill `out` with (x', x'')."""
    out[0] = z[1]
    out[1] = acceleration(t, z[0], z[1], p)
