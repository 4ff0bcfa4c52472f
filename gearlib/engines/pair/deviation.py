"""How a small deviation goes along the arcs of an orbit: its linearised maps.

Along a phase of contact or a flight a deviation w = (dx, dx') obeys the linearised equation of
motion, in closed form. A stiffness switch happens at a fixed phase and leaves w as it is. A flank
crossing multiplies it by the saltation matrix

    S = I + (f_after - f_before) n^T / (n . f_before),   n = (1, 0),   f = (x', x''),

and because the mesh force is zero on a flank line, x'' jumps by the damping alone, which is
proportional to x': S = [[1, 0], [(x''_after - x''_before) / x', 1]] is finite even when the
crossing is tangential. There it depends on the side from which the crossing is looked at.
"""

import math

from gearlib.engines.codes import BACKLASH
from gearlib.engines.jit import inlined, kernel
from gearlib.engines.pair.damped_oscillator import propagators
from gearlib.engines.pair.event_by_event import CONTACT, DURATION, LEVEL


@inlined
def multiply(a, b, c, d, matrix):
    """matrix <- [[a, b], [c, d]] matrix."""
    for j in range(2):
        first, second = matrix[0, j], matrix[1, j]
        matrix[0, j] = a * first + b * second
        matrix[1, j] = c * first + d * second


@kernel
def follow_arcs(m, arcs, count, previous, matrix):
    """Multiply `matrix`, shape (2, 2), by the maps of arcs 0 ... count - 1.

    `previous` is the contact code before the first arc. Returns that of the last one.
    """
    for i in range(count):
        contact = int(arcs[i, CONTACT])
        lev = m.high if arcs[i, LEVEL] == 1.0 else m.low
        if contact != previous:
            before = m.drag if previous == BACKLASH else lev.a
            after = m.drag if contact == BACKLASH else lev.a
            multiply(1.0, 0.0, -2.0 * (after - before), 1.0, matrix)
            previous = contact
        t = arcs[i, DURATION]
        if contact == BACKLASH:
            decay = math.exp(-2.0 * m.drag * t)
            reach = -math.expm1(-2.0 * m.drag * t) / (2.0 * m.drag) if m.drag > 0.0 else t
            multiply(1.0, reach, 0.0, decay, matrix)
        else:
            c, s = propagators(lev, t)
            multiply(c + lev.a * s, s, -lev.square * s, c - lev.a * s, matrix)
    return previous
