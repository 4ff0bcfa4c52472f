"""Proof that a run has settled on an orbit; the linearised map then gives the remaining periods.

Let P be the map of p mesh periods, M its derivative at the stroboscopic state s along the arcs of
the orbit, and d = P(s) - s. With a fixed sequence of events and

    D = sum_j |M^j| |d|    far below the distance from any grazing,

P has one fixed point within about D of s, and all later states lie within D of s. After k repeats
the state is P(s) + (M^k - I) e with e = -M (I - M)^-1 d. The curvature of P causes an error of D^2
divided by the lowest speed at an event, which is below rounding. There is no proof if M does not
contract fast enough (next to a fold, without damping), if an event is close to grazing, or if d is
too large: a run that creeps past a fold has not settled.
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.engines.codes import DRIVE, NO_CONTACT
from gearlib.engines.jit import kernel_part
from gearlib.engines.orbit import MAX_PERIOD, is_within_range
from gearlib.engines.pair import events
from gearlib.engines.pair.maps import multiply_by_arc_maps
from gearlib.engines.pair.motion import (
    UNDERDAMPED,
    evolve,
    free_flight,
    lowest_point_time,
    next_turning_time,
)
from gearlib.engines.pair.whole_periods import STORED_PERIODS, advance_periods

#: Largest D of a settled run, in units of the static deflection or of the state, if that is larger.
MAX_DISTANCE = 1e-10
#: An orbit does not graze a flank line if it stays at least this far away, in static deflections,
#: or crosses the line at this speed or faster, in static deflections per unit of natural time.
#: MAX_DISTANCE^2 / _GRAZING_SPEED is below rounding.
_GRAZING_DISTANCE, _GRAZING_SPEED = 1e-5, 1e-3
#: Smallest ratio of the speed at a flank line to D, for which M hardly changes within D.
_SPEED_OVER_DISTANCE = 1e4
#: M contracts if |M^1024| <= 1 / 2, i.e. if its multipliers are below 0.9993.
_DOUBLINGS = 10
#: Largest number of arcs of a mesh period in a proof.
_MAX_ARCS = 64


class SettledOrbit(NamedTuple):
    """Orbit on which a run has settled, and the offset of the run from it."""

    period: int  #: p, period of the orbit in mesh periods; 0 if the run has not settled
    x: float  #: displacement of the offset e = P(s) - fixed point of P, in static deflections
    v: float  #: velocity of e, dx/dtau
    matrix: tuple  #: M, row by row


@kernel_part
def no_settled_orbit():
    """Return the `SettledOrbit` of a run that has not been proven to settle."""
    return SettledOrbit(0, 0.0, 0.0, (1.0, 0.0, 0.0, 1.0))


@kernel_part
def _state_norm(pair, x, v):
    """Return the norm of a state (x, v) in units of the static deflection.

    The velocity dx/dtau is multiplied by the tuning in `pair` (`PairConstants`), which gives the
    derivative by natural time.
    """
    return math.hypot(x, pair.tuning * v)


@kernel_part
def repeat_period(pair, workspace, n, relative_tolerance):
    """Return the smallest number of mesh periods after which the stored states repeat, or 0.

    The state (x, v) after n periods is compared with the earlier states in `workspace`, a ring
    buffer of the last STORED_PERIODS states. `relative_tolerance` is relative to the norm of the
    state or to one static deflection, whichever is larger; `pair` holds the tuning.
    """
    x, v = workspace.states[n % STORED_PERIODS, 0], workspace.states[n % STORED_PERIODS, 1]
    tolerance = relative_tolerance * max(1.0, _state_norm(pair, x, v))
    for p in range(1, min(n, MAX_PERIOD) + 1):
        row = (n - p) % STORED_PERIODS
        if (
            abs(workspace.states[row, 0] - x) <= tolerance
            and pair.tuning * abs(workspace.states[row, 1] - v) <= tolerance
        ):
            return p
    return 0


@kernel_part
def _avoids_grazing(line, x, speed, margin, orbit_distance):
    """Return whether a motion at displacement x with a `speed` avoids grazing a flank line.

    Grazing means touching a flank with almost zero speed. The motion avoids it if its distance from
    the flank line at the displacement `line` exceeds `margin`, or if it is fast enough for a proof
    that covers all states within `orbit_distance` of the orbit.
    """
    min_speed = max(_GRAZING_SPEED, _SPEED_OVER_DISTANCE * orbit_distance)
    return abs(x - line) > margin or abs(speed) > min_speed


@kernel_part
def all_arcs_avoid_grazing(pair, arcs, arc_count, orbit_distance):
    """Return whether no arc of a motion comes close to grazing a flank line.

    An arc is the motion between two events; grazing means touching a flank with almost zero speed.
    The ends and turning points of the first `arc_count` rows of the arc table `arcs`, shape (n, 6),
    are checked. `pair` holds the `PairConstants`. The proof has to cover all states within
    `orbit_distance` of the orbit.
    """
    margin = max(_GRAZING_DISTANCE, 10.0 * orbit_distance)
    for i in range(arc_count):
        contact = int(arcs[i, events.CONTACT])
        level = pair.high_level if arcs[i, events.LEVEL] == 1.0 else pair.low_level
        x, v = arcs[i, events.DISPLACEMENT], arcs[i, events.VELOCITY]
        duration = arcs[i, events.DURATION]
        if contact == NO_CONTACT:
            speed = pair.tuning * v
            is_clear = _avoids_grazing(0.0, x, speed, margin, orbit_distance)
            is_clear = is_clear and _avoids_grazing(
                -pair.backlash_ratio, x, speed, margin, orbit_distance
            )
            if v < 0.0:
                time = lowest_point_time(pair.drag, pair.load, v)
                if time < duration:
                    min_x, _ = free_flight(pair.drag, pair.load, x, v, time)
                    is_clear = is_clear and min_x + pair.backlash_ratio > margin
            x, v = free_flight(pair.drag, pair.load, x, v, duration)
            is_clear = is_clear and _avoids_grazing(
                -pair.backlash_ratio, x, pair.tuning * v, margin, orbit_distance
            )
        else:
            line = 0.0 if contact == DRIVE else -pair.backlash_ratio
            equilibrium = line + level.equilibrium
            is_clear = _avoids_grazing(line, x, pair.tuning * v, margin, orbit_distance)
            time = next_turning_time(level, x - equilibrium, v)
            # The first two turning points are the extrema, because amplitudes never grow.
            for _ in range(2):
                if not time < duration:
                    break
                u, _v = evolve(level, x - equilibrium, v, time)
                is_clear = is_clear and abs(u + equilibrium - line) > margin
                if level.damping_kind != UNDERDAMPED:
                    break
                time += math.pi / level.frequency
        if not is_clear:
            return False
    return True


@kernel_part(inlined=True)
def matrix_product(a, b):
    """Return the product a b of two 2 x 2 matrices, each a tuple of four entries, row by row."""
    return (
        a[0] * b[0] + a[1] * b[2],
        a[0] * b[1] + a[1] * b[3],
        a[2] * b[0] + a[3] * b[2],
        a[2] * b[1] + a[3] * b[3],
    )


@kernel_part(inlined=True)
def _map_norm(pair, matrix):
    """Return the Frobenius norm of a 2 x 2 map of states in units of the static deflection.

    `matrix` is a tuple of four entries, row by row, for states (x, dx/dtau). Velocities are
    multiplied by the tuning in `pair` (`PairConstants`), so that both components have the same
    unit.
    """
    upper, lower = matrix[1] / pair.tuning, matrix[2] * pair.tuning
    return math.sqrt(matrix[0] * matrix[0] + upper * upper + lower * lower + matrix[3] * matrix[3])


@kernel_part
def power_sum_bound(pair, matrix):
    """Return an upper bound of 1 + |M| + |M^2| + ..., or infinity if M hardly contracts.

    `matrix` is the 2 x 2 map M of perturbations, a tuple of its entries row by row; `pair` holds
    the `PairConstants`.
    """
    total = 1.0
    for _ in range(_DOUBLINGS):
        # Doubling the number of terms multiplies the sum by at most 1 + |matrix|.
        total *= 1.0 + _map_norm(pair, matrix)
        matrix = matrix_product(matrix, matrix)
    # `matrix` is now the first power that is not in the sum. If its norm is at most 1 / 2, the
    # remaining terms add up to at most the same amount.
    return 2.0 * total if _map_norm(pair, matrix) <= 0.5 else math.inf


@kernel_part
def prove_settled(pair, workspace, n, contact, x, v, period_count, max_arcs, tolerance):
    """Run through `period_count` mesh periods and try to prove convergence to an orbit.

    After n mesh periods the motion has the contact state `contact` (1, 0, -1), displacement x and
    velocity v. A period has at most `max_arcs` arcs (parts between two events). The proof requires
    that no arc comes close to grazing a flank, that the map of perturbations contracts, and that
    the remaining distance from the orbit is at most `tolerance` times the norm of the state. `pair`
    holds the `PairConstants`, and `workspace` has been prepared for them. Returns (contact state,
    x, v, number of arcs, `SettledOrbit`) at the end of these periods.
    """
    arcs, jacobian = np.empty((_MAX_ARCS, events.ARC_COLUMNS)), np.empty((2, 2))
    jacobian[0, 0] = jacobian[1, 1] = 1.0
    jacobian[0, 1] = jacobian[1, 0] = 0.0
    start_x, start_v, previous_contact, is_clear, arc_count = x, v, contact, True, 0
    for i in range(period_count):
        contact, x, v, arc_count = advance_periods(
            pair, workspace, n + i, contact, x, v, 1, max_arcs, arcs
        )
        if arc_count > max_arcs or not is_within_range(x, v):
            return contact, x, v, arc_count, no_settled_orbit()
        is_clear = is_clear and arc_count <= _MAX_ARCS
        if is_clear:
            is_clear = all_arcs_avoid_grazing(pair, arcs, arc_count, tolerance)
            previous_contact = multiply_by_arc_maps(
                pair, arcs, arc_count, previous_contact, jacobian
            )
    if not is_clear:
        return contact, x, v, arc_count, no_settled_orbit()
    matrix = jacobian[0, 0], jacobian[0, 1], jacobian[1, 0], jacobian[1, 1]
    dx, dv = x - start_x, v - start_v
    max_distance = tolerance * max(1.0, _state_norm(pair, x, v))
    # The distance from the orbit is at most the sum of all later steps M^j (dx, dv).
    if not power_sum_bound(pair, matrix) * _state_norm(pair, dx, dv) <= max_distance:
        return contact, x, v, arc_count, no_settled_orbit()
    a, b, c, d = 1.0 - matrix[0], -matrix[1], -matrix[2], 1.0 - matrix[3]
    # Replace the step (dx, dv) by (I - M)^-1 (dx, dv), where I - M = [[a, b], [c, d]].
    factor = 1.0 / (a * d - b * c)
    dx, dv = factor * (d * dx - b * dv), factor * (a * dv - c * dx)
    offset_x = -(matrix[0] * dx + matrix[1] * dv)
    offset_v = -(matrix[2] * dx + matrix[3] * dv)
    return contact, x, v, arc_count, SettledOrbit(period_count, offset_x, offset_v, matrix)


@kernel_part
def offset_after_repeats(settled, k):
    """Return the offset (x, v) of a settled run from its orbit after k >= 0 repeats, M^k e.

    `settled`, a `SettledOrbit`, holds the present offset e and the map M of one repeat. The power
    is computed by repeated squaring.
    """
    x, v, power = settled.x, settled.v, settled.matrix
    while k > 0:
        if k % 2 == 1:
            x, v = power[0] * x + power[1] * v, power[2] * x + power[3] * v
        power = matrix_product(power, power)
        k //= 2
    return x, v
