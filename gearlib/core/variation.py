"""Variational equations of one degree of freedom: how small deviations grow along an orbit.

The maps of closed forms are those of `deviation`; a Taylor step carries the deviation as a series.
"""

import math

import numpy as np

from gearlib.core.deviation import follow_arcs, multiply
from gearlib.core.jit import inlined, kernel
from gearlib.core.march import ARC_COLUMNS, march_period, within_range
from gearlib.core.mesh import BACKLASH, NORMAL, contact_between, contact_of
from gearlib.core.nonlinear import take_step
from gearlib.core.run import EVENT_LIMIT, OK, OVERFLOW
from gearlib.core.series import ORDER, damping_of, storage

#: x^20 / 20! = 1e-17 at x = 1.18.
_CONVERGED = 1.18


@kernel
def vary(m, x, v, periods, limit, matrices):
    """Go through mesh periods from (x, v) at tau = 0 and fill the map of each.

    Parameters
    ----------
    m : Mesh
    x, v : float
    periods : int
    limit : int
        Most arcs in one mesh period.
    matrices : ndarray, shape (periods, 2, 2)
        Filled with the derivative of the state at the end of each period by that at its start.

    Returns
    -------
    x, v : float
    status : int
    """
    arcs = np.empty((64, ARC_COLUMNS))
    contact = contact_of(m.gap, x, v)
    previous = contact
    for i in range(periods):
        before = contact, x, v
        contact, x, v, count = march_period(m, contact, x, v, arcs, limit)
        if count > limit:
            return x, v, EVENT_LIMIT
        if count > arcs.shape[0]:
            arcs = np.empty((2 * count, ARC_COLUMNS))
            contact, x, v = before
            contact, x, v, count = march_period(m, contact, x, v, arcs, limit)
        if not within_range(x, v):
            return x, v, OVERFLOW
        matrices[i] = np.eye(2)
        previous = follow_arcs(m, arcs, count, previous, matrices[i])
    return x, v, OK


@kernel
def _follow_step(law, contact, sign, h, s, work, matrix):
    """Multiply `matrix` by the map of one Taylor step, whose series are in `s`."""
    drag, stiffness, a, b = work[0], work[1], work[2], work[3]
    damping = damping_of(law, contact)
    d1, d2, d3 = damping[0], sign * damping[1], damping[2]
    side = 1.0 if contact > 0 else -1.0
    p2, p3 = side * law.powers[0], law.powers[1]
    for k in range(ORDER):
        # Derivatives of the damping force by x' and of the mesh force by x, as series of time.
        drag[k] = 2.0 * d2 * s.v[k]
        slope = 2.0 * p2 * s.u[k] if contact != BACKLASH else 0.0
        for i in range(k + 1):
            drag[k] += 3.0 * d3 * s.v[i] * s.v[k - i]
            if contact != BACKLASH:
                slope += 3.0 * p3 * s.u[i] * s.u[k - i]
        work[4, k] = slope
    drag[0] += d1
    work[4, 0] += 1.0
    for k in range(ORDER):
        stiffness[k] = 0.0
        if contact != BACKLASH:
            for i in range(k + 1):
                stiffness[k] += s.c[i] * work[4, k - i]
    stiffness[0] += law.ground
    image = work[5]
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
def _reach(law, stiffest, contact, x, v):
    """Return how far the series of a deviation at (x, x') carries.

    A deviation swings with the frequency of the contact though the motion may be slow, or rest:
    its own terms, (frequency h)^k / k!, have to fall below rounding by k = ORDER.
    """
    u = 0.0
    if contact != BACKLASH:
        u = abs(x - (law.upper if contact == NORMAL else law.lower))
    slope = 1.0 + (2.0 * law.powers[0] + 3.0 * law.powers[1] * u) * u
    damping = damping_of(law, contact)
    drag = damping[0] + (2.0 * damping[1] + 3.0 * damping[2] * abs(v)) * abs(v)
    return _CONVERGED / (math.sqrt(law.ground + stiffest * slope) + drag)


@kernel
def vary_nonlinear(law, to_bernstein, x, v, periods, limit, matrices):
    """The same as `vary` for the nonlinear mesh, in Taylor steps."""
    s = storage()
    work = np.zeros((6, ORDER + 1))
    contact, sign = contact_between(law.upper, law.lower, x, v), math.copysign(1.0, v)
    previous = contact
    stiffest = max(
        _stiffest(law.pieces, law.stiffness), _stiffest(law.far_pieces, law.far_stiffness)
    )
    for n in range(periods):
        matrix = matrices[n]
        matrix[:] = np.eye(2)
        steps = 0
        for piece in range(law.pieces.shape[0]):
            phase, end = law.breaks[piece], law.breaks[piece + 1]
            while phase < end:
                if steps >= limit:
                    return x, v, EVENT_LIMIT
                steps += 1
                speed = v
                old = sign
                stop = min(end, phase + _reach(law, stiffest, contact, x, v))
                h, during, contact, sign, x, v = take_step(
                    law, to_bernstein, piece, phase, stop, contact, sign, x, v, s
                )
                # A step from rest sets out with the sign of its acceleration.
                old = math.copysign(1.0, s.v[1]) if speed == 0.0 else old
                if during != previous:
                    before, after = damping_of(law, previous), damping_of(law, during)
                    jump = after[0] - before[0] + (after[1] - before[1]) * abs(speed)
                    jump += (after[2] - before[2]) * speed * speed
                    multiply(1.0, 0.0, -jump, 1.0, matrix)
                    previous = during
                _follow_step(law, during, old, h, s, work, matrix)
                phase += h
                if not within_range(x, v):
                    return x, v, OVERFLOW
    return x, v, OK
