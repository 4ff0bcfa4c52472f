"""Motion from event to event through a segment of constant stiffness, by closed forms only.

An *arc* is the part of a trajectory between two events, which has one closed form. A row of the arc
table holds

    start (phase from the start of the mesh period), duration, contact state,
    stiffness level (0 C_min, 1 C_max), displacement and velocity at the start.

The first crossing of a flank line is proven to be the first without sampling. In contact, the
turning points are known in closed form and their depths decrease, so the first minimum after the
start is the deepest: the motion crosses the line once on the way to it, or never. A free flight has
one lowest point and therefore one descent and one climb.
"""

import math

from gearlib.engines.codes import COAST, DRIVE, NO_CONTACT
from gearlib.engines.jit import kernel_part
from gearlib.engines.pair.motion import (
    UNDERDAMPED,
    climb_time,
    evolve,
    fall_time,
    free_flight,
    lowest_point_time,
    next_turning_time,
)

#: Dips below a flank line that are smaller than this fraction of the deflections count as rounding,
#: and hence as grazing without an event.
GRAZING_TOLERANCE = 4e-16
#: Largest number of Newton steps. Each eighth step halves the bracket, and 60 halvings suffice.
_MAX_NEWTON_STEPS = 480


@kernel_part
def descent_time(level, u, v, line, max_time):
    """Return the first time in [0, max_time] at which a motion in contact falls through a line.

    The time is infinity if it does not. The motion starts with displacement u and velocity v in a
    `StiffnessLevel`, a linear oscillator; u and `line` count from its equilibrium. If the motion
    starts below the line, its velocity must be negative. Only the first descent is searched,
    because later minima are higher.
    """
    if u <= line and v < 0.0:
        return 0.0
    turning_time = next_turning_time(level, u, v)
    # The first descent lasts from the first maximum, or from the start, to the next minimum.
    descent_start, descent_end = 0.0, math.inf
    if level.damping_kind == UNDERDAMPED:
        half_oscillation = math.pi / level.frequency
        if v < 0.0:
            descent_end = turning_time
        elif v > 0.0:
            descent_start, descent_end = turning_time, turning_time + half_oscillation
        elif u > 0.0:
            descent_end = half_oscillation
        else:
            descent_start, descent_end = half_oscillation, 2.0 * half_oscillation
    elif v < 0.0:
        descent_end = turning_time
    elif turning_time < math.inf:
        descent_start = turning_time
    elif v > 0.0 or u <= 0.0:
        # The motion creeps up to the equilibrium or rests there.
        return math.inf
    end = min(descent_end, max_time)
    if end <= descent_start:
        return math.inf
    # The motion crosses the line if it ends below it; dips as small as rounding are ignored.
    end_u, _ = evolve(level, u, v, end)
    if not end_u < line - GRAZING_TOLERANCE * (abs(u) + abs(line)):
        return math.inf
    return _descent_root(level, u, v, line, descent_start, end)


@kernel_part
def _descent_root(level, u, v, line, lower, upper):
    """Return the time in [lower, upper] at which a motion in contact falls through a line.

    At time 0 the motion has displacement u and velocity v in a `StiffnessLevel`, a linear
    oscillator; u and `line` count from its equilibrium. It falls monotonically between `lower`
    and `upper`. Newton's method is safeguarded by bisection.
    """
    t = 0.5 * (lower + upper)
    for step in range(_MAX_NEWTON_STEPS):
        height, speed = evolve(level, u, v, t)
        if height > line:
            lower = t
        else:
            upper = t
        if abs(height - line) <= 2e-16 * abs(line):
            break
        new_t = t - (height - line) / speed if speed < 0.0 else lower
        # Bisect instead if the step leaves the bracket, and in every eighth step.
        if not lower < new_t < upper or step % 8 == 7:
            new_t = 0.5 * (lower + upper)
        step_size = abs(new_t - t)
        t = new_t
        if step_size <= 2e-16 * upper:
            break
    return t


@kernel_part
def next_impact(drag, load, backlash_ratio, x, v):
    """Return (duration, flank) of a free flight up to its next impact on a flank.

    The flight x'' + 2 drag x' = load starts with displacement -backlash_ratio <= x <= 0 and
    velocity v; the ratio > 0 may be infinite. The flank is 1 for the drive side (x = 0) and -1 for
    the coast side (x = -backlash_ratio).
    """
    # The load acts upwards, so a rising flight reaches the drive-side flank.
    if v >= 0.0:
        return climb_time(drag, load, -x, v), 1
    if x <= -backlash_ratio:
        return 0.0, -1
    # A falling flight hits the coast-side flank if its lowest point lies beyond it, else it turns.
    t = lowest_point_time(drag, load, v)
    min_x, _ = free_flight(drag, load, x, v, t)
    if min_x < -backlash_ratio * (1.0 + GRAZING_TOLERANCE):
        return min(fall_time(drag, load, x + backlash_ratio, v), t), -1
    return t + climb_time(drag, load, -min_x, 0.0), 1


# Columns of the arc table, see the docstring of this module.
START, DURATION, CONTACT, LEVEL, DISPLACEMENT, VELOCITY = range(6)
ARC_COLUMNS = 6


@kernel_part(merged=True)
def next_event(pair, level, contact, x, v, max_duration):
    """Return (duration, new contact state, x, v) at the next change of contact of a gear pair.

    The motion starts with displacement x, velocity v and the contact state `contact` (1 drive side,
    0 no contact, -1 coast side). `pair` holds the `PairConstants`, and `level` is the
    `StiffnessLevel` (linear oscillator) of the present stiffness. If no flank line is crossed
    within `max_duration`, the result is the state after this time with the same contact state;
    otherwise x lies exactly on the line.
    """
    if contact == NO_CONTACT:
        t, flank = next_impact(pair.drag, pair.load, pair.backlash_ratio, x, v)
        if t > max_duration:
            x, v = free_flight(pair.drag, pair.load, x, v, max_duration)
            return max_duration, contact, x, v
        _, v = free_flight(pair.drag, pair.load, x, v, t)
        if flank == DRIVE:
            return t, DRIVE, 0.0, max(v, 0.0)
        return t, COAST, -pair.backlash_ratio, min(v, 0.0)
    # Displacements u count from the equilibrium, which lies above the flank line.
    if contact == DRIVE:
        u = x - level.equilibrium
        t = descent_time(level, u, v, -level.equilibrium, max_duration)
        if t <= max_duration:
            _, speed = evolve(level, u, v, t)
            if speed < 0.0:
                # Without backlash, loss of contact on one side means contact on the other side.
                return t, (COAST if pair.backlash_ratio == 0.0 else NO_CONTACT), 0.0, speed
        u, v = evolve(level, u, v, max_duration)
        return max_duration, contact, u + level.equilibrium, v
    # By symmetry, coast-side contact ends when -u falls through the static deflection.
    u = x + pair.backlash_ratio - level.equilibrium
    t = descent_time(level, -u, -v, level.equilibrium, max_duration)
    if t <= max_duration:
        _, speed = evolve(level, u, v, t)
        contact_after = DRIVE if pair.backlash_ratio == 0.0 else NO_CONTACT
        return t, contact_after, -pair.backlash_ratio, max(speed, 0.0)
    u, v = evolve(level, u, v, max_duration)
    return max_duration, contact, u + level.equilibrium - pair.backlash_ratio, v


@kernel_part
def march_segment(pair, level_index, start, length, contact, x, v, arcs, arc_count, max_arcs):
    """Run through a segment of constant stiffness; return (contact state, x, v, number of arcs).

    An arc is the motion between two events. The segment has stiffness level 0 (C_min) or 1 (C_max)
    and the phase `length` from phase `start` of the mesh period; the motion enters it with a
    contact state (1, 0, -1), displacement x and velocity v. Rows of the arc table `arcs`, shape (n,
    6), are filled from row `arc_count` on. If more than `max_arcs` arcs are needed, the number is
    max_arcs + 1. `pair` holds the `PairConstants`.
    """
    _, contact, x, v, arc_count = march_rest_of_segment(
        pair, level_index, start, 0.0, length, contact, x, v, arcs, arc_count, max_arcs, False
    )
    return contact, x, v, arc_count


@kernel_part
def march_rest_of_segment(
    pair, level_index, start, t, length, contact, x, v, arcs, arc_count, max_arcs, until_impact
):
    """Run through the rest of a segment of constant stiffness, from the phase t after its start.

    Returns (t, contact state, x, v, number of arcs) at the end of the segment or, with
    `until_impact`, at the next impact on the drive-side flank. At t the motion has a contact state
    (1, 0, -1), displacement x and velocity v. The segment starts at the phase `start` of the mesh
    period and has the phase `length` and stiffness level 0 (C_min) or 1 (C_max). Arcs, the parts of
    the motion between two events, are written to `arcs`, (n, 6), from row `arc_count` on, as far as
    the table has rows. More than `max_arcs` arcs end the run with the number max_arcs + 1. `pair`
    holds the `PairConstants`.
    """
    level = pair.high_level if level_index == 1 else pair.low_level
    while t < length:
        if arc_count >= max_arcs:
            return t, contact, x, v, max_arcs + 1
        duration, new_contact, new_x, new_v = next_event(pair, level, contact, x, v, length - t)
        if arc_count < arcs.shape[0]:
            arcs[arc_count, START] = start + t
            arcs[arc_count, DURATION] = duration
            arcs[arc_count, CONTACT] = contact
            arcs[arc_count, LEVEL] = level_index
            arcs[arc_count, DISPLACEMENT] = x
            arcs[arc_count, VELOCITY] = v
        arc_count += 1
        x, v = new_x, new_v
        # There is no event before the end of the segment.
        if new_contact == contact:
            return length, contact, x, v, arc_count
        contact = new_contact
        t += duration
        if until_impact and contact == DRIVE:
            break
    return t, contact, x, v, arc_count


@kernel_part
def march_period(pair, contact, x, v, arcs, max_arcs):
    """Run through one mesh period; return (contact state, x, v, number of arcs) at its end.

    An arc is the motion between two events. `pair` holds the `PairConstants`. The motion starts in
    the middle of the C_max segment with a contact state (1, 0, -1), displacement x and velocity v.
    The arc table `arcs`, shape (n, 6), is filled; a run through more than `max_arcs` arcs ends
    early.
    """
    arc_count, start = 0, 0.0
    for segment in range(3):
        # The segments are one half of C_max (level 1), C_min (0) and the other half of C_max.
        level_index = 1 - segment % 2
        length = pair.half_high_length if level_index == 1 else pair.low_length
        contact, x, v, arc_count = march_segment(
            pair, level_index, start, length, contact, x, v, arcs, arc_count, max_arcs
        )
        if arc_count > max_arcs:
            break
        start += length
    return contact, x, v, arc_count
