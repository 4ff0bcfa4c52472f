"""Small deviations of a motion along Taylor steps.

Along a step a deviation w obeys w'' + drag(t) w' + stiff(t) w = 0, with the series of the step. At
a flank line the damping jumps, and with it w' as in `gearlib.engines.pair.maps`.
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
#: x^20 / 20! = 1e-17 at x = 1.18.
_CONVERGED = 1.18
#: Rows of the series of a deviation: w, w', terms of w'' so far, drag, stiff, stiff over c(tau).
_W, _RATE, _PULL, _DRAG, _STIFF, _STEEP = range(6)


@inlined
def stiffest_of(law):
    """Return a bound of the stiffness of both flanks over its period."""
    near = _stiffest(law.pieces, law.stiffness)
    return max(near, _stiffest(law.far_pieces, law.far_stiffness))


@inlined
def _stiffest(pieces, waves):
    """Return a bound of a stiffness over its period."""
    total = 0.0
    for i in range(waves.shape[0]):
        total += math.hypot(waves[i, 1], waves[i, 2])
    # A straight piece is highest at the start of itself or of the next one.
    return total + pieces[:, 0].max()


@inlined
def reach_of(row, stiffest, contact, x, v):
    """Return how far the series of a deviation at (x, x') carries.

    A deviation swings with the frequency of the contact though the motion may be slow, or rest:
    its own terms, (frequency h)^k / k!, have to fall below rounding by k = ORDER.
    """
    u = abs(x - row[LINE]) if contact != BACKLASH else 0.0
    slope = 1.0 + (2.0 * abs(row[P2]) + 3.0 * row[P3] * u) * u
    drag = row[D1] + (2.0 * row[D2] + 3.0 * row[D3] * abs(v)) * abs(v)
    return _CONVERGED / (math.sqrt(row[GROUND] + stiffest * slope) + drag)


@kernel
def _fill_equation(row, contact, sign, series, deviation):
    """Fill drag and stiff for a step with `row`, the constants of its contact and piece."""
    drag, stiff, steep = deviation[_DRAG], deviation[_STIFF], deviation[_STEEP]
    d2, d3, p2, p3 = sign * row[D2], row[D3], row[P2], row[P3]
    for k in range(ORDER):
        drag[k] = 2.0 * d2 * series[V, k] + 3.0 * d3 * series[V_SQUARE, k]
        deflection = series[X, k] - (row[LINE] if k == 0 else 0.0)
        steep[k] = 2.0 * p2 * deflection + 3.0 * p3 * series[U_SQUARE, k]
        stiff[k] = 0.0
    drag[0] += row[D1]
    steep[0] += 1.0
    if contact == BACKLASH:
        return
    for i in range(ORDER):
        # A stiffness without harmonics has two terms.
        if series[C, i] != 0.0:
            for k in range(ORDER - i):
                stiff[i + k] += series[C, i] * steep[k]


@inlined
def _value(row, t):
    """Return the sum of a series at t."""
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
def follow(row, contact, sign, h, series, deviation, matrix):
    """Take the columns of a map, shape (2, 2), through a step of length h.

    `row` has the constants of its contact and piece; `deviation` is storage.
    """
    _fill_equation(row, contact, sign, series, deviation)
    ground = row[GROUND]
    w, rate, pull = deviation[_W], deviation[_RATE], deviation[_PULL]
    drag, stiff = deviation[_DRAG], deviation[_STIFF]
    terms = ORDER
    while terms > 1 and drag[terms - 1] == 0.0 and stiff[terms - 1] == 0.0:
        terms -= 1
    for j in range(2):
        w[0], rate[0] = matrix[0, j], matrix[1, j]
        pull[:] = 0.0
        for k in range(ORDER):
            # The effect of the terms so far on all that follow.
            for i in range(min(terms, ORDER - k)):
                pull[k + i] -= drag[i] * rate[k] + stiff[i] * w[k]
            w[k + 1] = rate[k] * _INVERSE[k]
            rate[k + 1] = (pull[k] - ground * w[k]) * _INVERSE[k]
        matrix[0, j], matrix[1, j] = _value(w, h), _value(rate, h)


@inlined
def _damping(row, speed):
    """Return the damping force over x' at the speed |x'|."""
    return row[D1] + row[D2] * speed + row[D3] * speed * speed


@kernel
def cross(constants, piece, before, after, v, matrix):
    """Take a map from one contact to another; without a way between the flanks, over both."""
    first, speed = before, abs(v)
    while first != after:
        then = after if first == BACKLASH or after == BACKLASH else BACKLASH
        jump = _damping(constants[then + 1, piece], speed)
        jump -= _damping(constants[first + 1, piece], speed)
        for j in range(2):
            matrix[1, j] -= jump * matrix[0, j]
        first = then
