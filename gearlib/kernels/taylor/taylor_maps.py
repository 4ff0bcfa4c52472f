"""Growth of small deviations over mesh periods: a Taylor step carries a deviation as a series."""

import math

import numpy as np

from gearlib.kernels.closed_form.deviation import multiply
from gearlib.kernels.closed_form.mesh_constants import contact_between
from gearlib.kernels.codes import BACKLASH, EVENT_LIMIT, OK, OVERFLOW, UNRESOLVED
from gearlib.kernels.jit import inlined, kernel
from gearlib.kernels.overflow import within_range
from gearlib.kernels.taylor.series import (
    D1,
    D2,
    D3,
    GROUND,
    LINE,
    ORDER,
    P2,
    P3,
    ROWS,
    U_SQUARE,
    V_SQUARE,
    C,
    U,
    V,
    tables,
)
from gearlib.kernels.taylor.taylor_run import take_step

#: x^20 / 20! = 1e-17 at x = 1.18.
_CONVERGED = 1.18


@kernel
def _follow_step(constants, piece, contact, sign, h, series, work, matrix):
    """Multiply `matrix` by the map of one Taylor step."""
    row = constants[contact + 1, piece]
    # Derivatives of the damping force by x' and of the mesh force by x, as series of time.
    drag, slope, stiffness, a, b, image = work[0], work[1], work[2], work[3], work[4], work[5]
    for k in range(ORDER):
        drag[k] = 2.0 * sign * row[D2] * series[V, k] + 3.0 * row[D3] * series[V_SQUARE, k]
        slope[k] = 2.0 * row[P2] * series[U, k] + 3.0 * row[P3] * series[U_SQUARE, k]
    drag[0] += row[D1]
    slope[0] += 1.0
    for k in range(ORDER):
        stiffness[k] = 0.0
        if contact != BACKLASH:
            for i in range(k + 1):
                stiffness[k] += series[C, i] * slope[k - i]
    stiffness[0] += row[GROUND]
    for j in range(2):
        a[0], b[0] = (1.0, 0.0) if j == 0 else (0.0, 1.0)
        for k in range(ORDER):
            total = 0.0
            for i in range(k + 1):
                total += drag[i] * b[k - i] + stiffness[i] * a[k - i]
            a[k + 1] = b[k] / (k + 1.0)
            b[k + 1] = -total / (k + 1.0)
        first, second = 0.0, 0.0
        for k in range(ORDER, -1, -1):
            first, second = first * h + a[k], second * h + b[k]
        image[2 * j], image[2 * j + 1] = first, second
    multiply(image[0], image[2], image[1], image[3], matrix)


@inlined
def _stiffest(pieces, waves):
    """Return a bound of a stiffness over its period."""
    total = 0.0
    for i in range(waves.shape[0]):
        total += math.hypot(waves[i, 1], waves[i, 2])
    # A straight piece is highest at the start of itself or of the next one.
    return total + pieces[:, 0].max()


@inlined
def _reach(row, stiffest, contact, x, v):
    """Return how far the series of a deviation at (x, x') carries.

    A deviation swings with the frequency of the contact though the motion may be slow, or rest:
    its own terms, (frequency h)^k / k!, have to fall below rounding by k = ORDER.
    """
    u = abs(x - row[LINE]) if contact != BACKLASH else 0.0
    slope = 1.0 + (2.0 * abs(row[P2]) + 3.0 * row[P3] * u) * u
    drag = row[D1] + (2.0 * row[D2] + 3.0 * row[D3] * abs(v)) * abs(v)
    return _CONVERGED / (math.sqrt(row[GROUND] + stiffest * slope) + drag)


@kernel
def vary_nonlinear(law, to_bernstein, x, v, periods, limit, matrices):
    """Go through mesh periods from (x, v) at tau = 0 and fill the map of each, in Taylor steps.

    Arguments and returns as of `gearlib.kernels.closed_form.pair_maps.vary`, but for the `Law`.
    """
    constants, harmonics = tables(law)
    series, isolation = np.zeros((ROWS, ORDER + 1)), np.empty((50, ORDER + 2))
    work = np.zeros((6, ORDER + 1))
    contact, sign = contact_between(law.upper, law.lower, x, v), math.copysign(1.0, v)
    previous = contact
    stiffest = max(
        _stiffest(law.pieces, law.stiffness), _stiffest(law.far_pieces, law.far_stiffness)
    )
    for n in range(periods):
        matrix = matrices[n]
        matrix[0, 0] = matrix[1, 1] = 1.0
        matrix[0, 1] = matrix[1, 0] = 0.0
        steps = 0
        for piece in range(law.pieces.shape[0]):
            phase, end = law.breaks[piece], law.breaks[piece + 1]
            while phase < end:
                if steps >= limit:
                    return x, v, EVENT_LIMIT
                steps += 1
                speed = v
                old = sign
                row = constants[contact + 1, piece]
                stop = min(end, phase + _reach(row, stiffest, contact, x, v))
                h, during, contact, sign, x, v = take_step(
                    constants,
                    harmonics,
                    to_bernstein,
                    piece,
                    phase,
                    stop,
                    contact,
                    sign,
                    x,
                    v,
                    series,
                    isolation,
                )
                if h < 0.0:
                    return x, v, UNRESOLVED
                # A step from rest sets out with the sign of its acceleration.
                old = math.copysign(1.0, series[V, 1]) if speed == 0.0 else old
                if during != previous:
                    before, after = constants[previous + 1, piece], constants[during + 1, piece]
                    jump = after[D1] - before[D1] + (after[D2] - before[D2]) * abs(speed)
                    jump += (after[D3] - before[D3]) * speed * speed
                    multiply(1.0, 0.0, -jump, 1.0, matrix)
                    previous = during
                _follow_step(constants, piece, during, old, h, series, work, matrix)
                phase += h
                if not within_range(x, v):
                    return x, v, OVERFLOW
    return x, v, OK
