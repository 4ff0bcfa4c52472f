"""Maps of small deviations along the arcs of an orbit, and over mesh periods.

Along a phase of contact or a flight a deviation w = (dx, dx') obeys the linearised equation of
motion, in closed form. A stiffness switch happens at a fixed phase and leaves w as it is. A flank
crossing multiplies it by the saltation matrix

    S = I + (f_after - f_before) n^T / (n . f_before),   n = (1, 0),   f = (x', x''),

and because the mesh force is zero on a flank line, x'' jumps by the damping alone, which is
proportional to x': S = [[1, 0], [(x''_after - x''_before) / x', 1]] is finite even when the
crossing is tangential. There it depends on the side from which the crossing is approached.
"""

import math

import numpy as np

from gearlib.engines.codes import BACKLASH, EVENT_LIMIT, OK, OVERFLOW
from gearlib.engines.jit import inlined, kernel
from gearlib.engines.overflow import within_range
from gearlib.engines.pair.events import ARC_COLUMNS, CONTACT, DURATION, LEVEL, march_period
from gearlib.engines.pair.motion import contact_of, propagators


@inlined
def multiply(a, b, c, d, matrix):
    """Replace `matrix`, shape (2, 2), by the product [[a, b], [c, d]] matrix."""
    for j in range(2):
        first, second = matrix[0, j], matrix[1, j]
        matrix[0, j] = a * first + b * second
        matrix[1, j] = c * first + d * second


@kernel
def follow_arcs(mesh, arcs, count, previous, matrix):
    """Multiply `matrix`, shape (2, 2), from the left by the linearised maps of `count` arcs.

    `arcs`, shape (n, 6), is the arc table of a motion of the `Mesh`, and `previous` the contact
    code before its first arc. Returns the contact code of the last arc.
    """
    for i in range(count):
        contact = int(arcs[i, CONTACT])
        level = mesh.high if arcs[i, LEVEL] == 1.0 else mesh.low
        if contact != previous:
            # The saltation matrix: only the damping changes at a flank line.
            before = mesh.drag if previous == BACKLASH else level.a
            after = mesh.drag if contact == BACKLASH else level.a
            multiply(1.0, 0.0, -2.0 * (after - before), 1.0, matrix)
            previous = contact
        t = arcs[i, DURATION]
        if contact == BACKLASH:
            decay = math.exp(-2.0 * mesh.drag * t)
            # The displacement per initial velocity after the time t.
            shift = -math.expm1(-2.0 * mesh.drag * t) / (2.0 * mesh.drag) if mesh.drag > 0.0 else t
            multiply(1.0, shift, 0.0, decay, matrix)
        else:
            c, s = propagators(level, t)
            multiply(c + level.a * s, s, -level.square * s, c - level.a * s, matrix)
    return previous


@kernel
def fill_period_maps(mesh, x, v, periods, limit, matrices):
    """Run through mesh periods and fill the Jacobian matrix of each; return (x, v, status).

    The motion starts with displacement x and velocity v at tau = 0. `matrices`, shape (periods, 2,
    2), receive the derivatives of the state at the end of each period with respect to the state at
    its start. `limit` is the largest number of arcs of a period.
    """
    arcs = np.empty((64, ARC_COLUMNS))
    contact = contact_of(mesh.gap, x, v)
    previous = contact
    for i in range(periods):
        start = contact, x, v
        contact, x, v, count = march_period(mesh, contact, x, v, arcs, limit)
        if count > limit:
            return x, v, EVENT_LIMIT
        if count > arcs.shape[0]:
            arcs = np.empty((2 * count, ARC_COLUMNS))
            contact, x, v = start
            contact, x, v, count = march_period(mesh, contact, x, v, arcs, limit)
        if not within_range(x, v):
            return x, v, OVERFLOW
        matrices[i, 0, 0] = matrices[i, 1, 1] = 1.0
        matrices[i, 0, 1] = matrices[i, 1, 0] = 0.0
        previous = follow_arcs(mesh, arcs, count, previous, matrices[i])
    return x, v, OK
