"""Small deviations from a motion along Taylor steps.

Along a step a deviation w obeys w'' + drag(t) w' + stiff(t) w = 0, drag and stiff being Taylor
series. At a flank line the damping jumps, and with it w' as in `gearlib.engines.pair.maps`.
"""

import math

import numpy as np

from gearlib.engines.codes import BACKLASH
from gearlib.engines.jit import inlined, kernel
from gearlib.engines.taylor.series import (
    D1,
    D2,
    D3,
    GROUND,
    LINE,
    ORDER,
    P2,
    P3,
    U_SQUARE,
    V_SQUARE,
    C,
    V,
    X,
)

_INVERSE = 1.0 / np.arange(1, ORDER + 2)  # of k + 1
#: Largest frequency times step: x^20 / 20! = 1e-17 at x = 1.18.
_MAX_ANGLE = 1.18
#: Rows of the series of a deviation: w, w', terms of w'' so far, drag, stiff, stiff over c(tau).
_W, _RATE, _ACCELERATION, _DRAG, _STIFF, _SLOPE = range(6)


@inlined
def max_stiffness(law):
    """Return a bound of the mesh stiffness of both flanks over the mesh period."""
    near = _max_of_waves(law.stiffness_lines, law.stiffness_harmonics)
    return max(near, _max_of_waves(law.coast_stiffness_lines, law.coast_stiffness_harmonics))


@inlined
def _max_of_waves(pieces, waves):
    """Return a bound of a stiffness over its period.

    `pieces`, shape (m, 2), are its straight pieces, `waves`, shape (j, 3), its harmonics.
    """
    total = 0.0
    for i in range(waves.shape[0]):
        total += math.hypot(waves[i, 1], waves[i, 2])
    # A straight piece has its maximum at its start or at the start of the next piece.
    return total + pieces[:, 0].max()


@inlined
def longest_deviation_step(row, stiffest, contact, x, v):
    """Return the longest step in phase over which the series of a deviation converges.

    A deviation swings with the frequency of the contact even if the motion is slow. Its terms,
    (frequency h)^k / k!, have to fall below rounding by k = ORDER. `row` has the constants of the
    contact and the piece, `stiffest` is `max_stiffness` of the law.
    """
    deflection = abs(x - row[LINE]) if contact != BACKLASH else 0.0
    slope = 1.0 + (2.0 * abs(row[P2]) + 3.0 * row[P3] * deflection) * deflection
    drag = row[D1] + (2.0 * row[D2] + 3.0 * row[D3] * abs(v)) * abs(v)
    return _MAX_ANGLE / (math.sqrt(row[GROUND] + stiffest * slope) + drag)


@kernel
def _fill_equation(row, contact, sign, series, deviation):
    """Fill the series drag and stiff of `deviation` for a step in which the motion has `series`.

    `row` has the constants of the contact and the piece, `sign` is the sign of x'.
    """
    drag, stiff, slope = deviation[_DRAG], deviation[_STIFF], deviation[_SLOPE]
    d2, d3, p2, p3 = sign * row[D2], row[D3], row[P2], row[P3]
    for k in range(ORDER):
        drag[k] = 2.0 * d2 * series[V, k] + 3.0 * d3 * series[V_SQUARE, k]
        deflection = series[X, k] - (row[LINE] if k == 0 else 0.0)
        slope[k] = 2.0 * p2 * deflection + 3.0 * p3 * series[U_SQUARE, k]
        stiff[k] = 0.0
    drag[0] += row[D1]
    slope[0] += 1.0
    if contact == BACKLASH:
        return
    for i in range(ORDER):
        # A stiffness without harmonics has only two coefficients.
        if series[C, i] != 0.0:
            for k in range(ORDER - i):
                stiff[i + k] += series[C, i] * slope[k]


@inlined
def _value(row, t):
    """Return the value at t of the power series in `row`."""
    total = row[ORDER]
    for k in range(ORDER - 1, -1, -1):
        total = total * t + row[k]
    return total


@inlined
def set_identity(matrix):
    """Fill a map, shape (2, 2), with the identity."""
    matrix[0, 0] = matrix[1, 1] = 1.0
    matrix[0, 1] = matrix[1, 0] = 0.0


@kernel
def map_step(row, contact, sign, h, series, deviation, matrix):
    """Multiply a map of deviations, shape (2, 2), by the map of a step of length h.

    `row` has the constants of the contact and the piece, `series` the motion; `deviation`, shape
    (6, ORDER + 1), is storage.
    """
    _fill_equation(row, contact, sign, series, deviation)
    ground = row[GROUND]
    w, rate, acceleration = deviation[_W], deviation[_RATE], deviation[_ACCELERATION]
    drag, stiff = deviation[_DRAG], deviation[_STIFF]
    terms = ORDER
    while terms > 1 and drag[terms - 1] == 0.0 and stiff[terms - 1] == 0.0:
        terms -= 1
    for j in range(2):
        w[0], rate[0] = matrix[0, j], matrix[1, j]
        acceleration[:] = 0.0
        for k in range(ORDER):
            # Add the products of coefficient k to all later terms.
            for i in range(min(terms, ORDER - k)):
                acceleration[k + i] -= drag[i] * rate[k] + stiff[i] * w[k]
            w[k + 1] = rate[k] * _INVERSE[k]
            rate[k + 1] = (acceleration[k] - ground * w[k]) * _INVERSE[k]
        matrix[0, j], matrix[1, j] = _value(w, h), _value(rate, h)


@inlined
def _damping(row, speed):
    """Return the damping force over x' at the speed |x'|."""
    return row[D1] + row[D2] * speed + row[D3] * speed * speed


@kernel
def map_crossing(constants, piece, contact_before, contact_after, v, matrix):
    """Multiply a map by the saltation matrix of a change of contact at the velocity v.

    Without a backlash a change between both flanks crosses both lines.
    """
    contact, speed = contact_before, abs(v)
    while contact != contact_after:
        next_contact = (
            contact_after if contact == BACKLASH or contact_after == BACKLASH else BACKLASH
        )
        jump = _damping(constants[next_contact + 1, piece], speed)
        jump -= _damping(constants[contact + 1, piece], speed)
        for j in range(2):
            matrix[1, j] -= jump * matrix[0, j]
        contact = next_contact
