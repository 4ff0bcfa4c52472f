"""Linear maps of small perturbations along the arcs of an orbit and over mesh periods.

In contact and in free flight, a perturbation w = (dx, dx') obeys the linearised equation of motion,
which has a closed-form solution. A stiffness switch happens at a fixed phase and does not change w.
A flank crossing multiplies w by the saltation matrix

    S = I + (f_after - f_before) n^T / (n . f_before),   n = (1, 0),   f = (x', x'').

The mesh force is zero on a flank line, so x'' jumps by the damping force alone, which is
proportional to x'. Hence S = [[1, 0], [(x''_after - x''_before) / x', 1]] is finite even if the
crossing is tangential. There S depends on the side from which the flank line is approached.
"""

import math

import numpy as np

from gearlib.engines.codes import EVENT_LIMIT, NO_CONTACT, OK, OVERFLOW
from gearlib.engines.jit import kernel, kernel_part
from gearlib.engines.orbit import is_within_range
from gearlib.engines.pair.events import ARC_COLUMNS, CONTACT, DURATION, LEVEL, march_period
from gearlib.engines.pair.motion import fundamental_solutions, pair_contact_state


@kernel_part(inlined=True)
def multiply_from_left(a, b, c, d, matrix):
    """Replace `matrix`, shape (2, 2), by the product [[a, b], [c, d]] @ matrix, in place."""
    for j in range(2):
        upper, lower = matrix[0, j], matrix[1, j]
        matrix[0, j] = a * upper + b * lower
        matrix[1, j] = c * upper + d * lower


@kernel_part
def multiply_by_arc_maps(pair, arcs, arc_count, previous_contact, matrix):
    """Multiply `matrix`, shape (2, 2), from the left by the Jacobian matrices of successive arcs.

    An arc is the motion between two events; its Jacobian matrix maps small perturbations (dx, dx').
    The first `arc_count` rows of the arc table `arcs`, shape (n, 6), are used. `pair` holds the
    `PairConstants`, and `previous_contact` is the contact state (1, 0, -1) before the first arc.
    Returns the contact state of the last arc.
    """
    for i in range(arc_count):
        contact = int(arcs[i, CONTACT])
        level = pair.high_level if arcs[i, LEVEL] == 1.0 else pair.low_level
        if contact != previous_contact:
            # Apply the saltation matrix of the flank crossing. The mesh force is zero there, so the
            # acceleration jumps by the damping force only, in proportion to the velocity.
            decay_before = pair.drag if previous_contact == NO_CONTACT else level.decay_rate
            decay_after = pair.drag if contact == NO_CONTACT else level.decay_rate
            multiply_from_left(1.0, 0.0, -2.0 * (decay_after - decay_before), 1.0, matrix)
            previous_contact = contact
        t = arcs[i, DURATION]
        if contact == NO_CONTACT:
            decay = math.exp(-2.0 * pair.drag * t)
            # Displacement due to a unit initial velocity.
            response = t
            if pair.drag > 0.0:
                response = -math.expm1(-2.0 * pair.drag * t) / (2.0 * pair.drag)
            multiply_from_left(1.0, response, 0.0, decay, matrix)
        else:
            # Jacobian matrix of a linear oscillator with the decay rate a.
            c, s = fundamental_solutions(level, t)
            a = level.decay_rate
            multiply_from_left(c + a * s, s, -level.natural_squared * s, c - a * s, matrix)
    return previous_contact


@kernel
def fill_period_maps(pair, x, v, periods, max_arcs, matrices):
    """Run through mesh periods and fill the Jacobian matrix of each; return (x, v, status).

    The motion starts with displacement x and velocity v at mesh phase 0. `matrices`, shape
    (periods, 2, 2), is filled with the derivatives of the state at the end of each period with
    respect to the state at its start. `pair` holds the `PairConstants`. A period has at most
    `max_arcs` arcs, parts of the motion between two events.
    """
    arcs = np.empty((64, ARC_COLUMNS))
    contact = pair_contact_state(pair.backlash_ratio, x, v)
    previous_contact = contact
    for i in range(periods):
        start = contact, x, v
        contact, x, v, arc_count = march_period(pair, contact, x, v, arcs, max_arcs)
        if arc_count > max_arcs:
            return x, v, EVENT_LIMIT
        # If the arc table was too small, run the period again with a larger one.
        if arc_count > arcs.shape[0]:
            arcs = np.empty((2 * arc_count, ARC_COLUMNS))
            contact, x, v = start
            contact, x, v, arc_count = march_period(pair, contact, x, v, arcs, max_arcs)
        if not is_within_range(x, v):
            return x, v, OVERFLOW
        matrices[i, 0, 0] = matrices[i, 1, 1] = 1.0
        matrices[i, 0, 1] = matrices[i, 1, 0] = 0.0
        previous_contact = multiply_by_arc_maps(
            pair, arcs, arc_count, previous_contact, matrices[i]
        )
    return x, v, OK
