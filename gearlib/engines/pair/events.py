"""Motion from event to event through a segment of constant stiffness, by closed forms only.

An *arc* is a piece of orbit with one closed form. A row of the arc table holds

    start (phase from the start of the mesh period), duration, contact code,
    stiffness level (0 C_min, 1 C_max), displacement and velocity at its start.

The first crossing of a flank line is proven to be the first, without sampling. In contact the
turning points are known in closed form and their depths decrease, so that the first minimum after
the start is the deepest: the motion crosses the line once on the way to it, or never. In flight
there is one lowest point, and likewise one descent and one climb.
"""

import math

from gearlib.engines.codes import BACKLASH, INVERSE, NORMAL
from gearlib.engines.jit import kernel
from gearlib.engines.pair.motion import (
    UNDERDAMPED,
    climb_time,
    evolve,
    fall_time,
    fly,
    lowest_time,
    turning_time,
)

#: Dips below a line that are smaller than this share of the deflections count as rounding, and
#: hence as grazing without an event.
GRAZING_TOLERANCE = 4e-16
#: Largest number of Newton steps. Every eighth halves the bracket, so that 60 halvings suffice.
_MAX_ITERATIONS = 480


@kernel
def descent_time(level, u, v, line, horizon):
    """Return the first time in [0, horizon] at which a motion in contact falls through a line.

    The time is infinity if there is none. The motion starts with displacement u and velocity v, in
    a stiffness `Level`; u and `line` count from its equilibrium. A start below the line must fall.
    """
    if u <= line and v < 0.0:
        return 0.0
    turn = turning_time(level, u, v)
    # Times at which the descent begins and ends.
    descent_start, descent_end = 0.0, math.inf
    if level.kind == UNDERDAMPED:
        half_turn = math.pi / level.w
        if v < 0.0:
            descent_end = turn
        elif v > 0.0:
            descent_start, descent_end = turn, turn + half_turn
        elif u > 0.0:
            descent_end = half_turn
        else:
            descent_start, descent_end = half_turn, 2.0 * half_turn
    elif v < 0.0:
        descent_end = turn
    elif turn < math.inf:
        descent_start = turn
    elif v > 0.0 or u <= 0.0:
        # The motion creeps up to the equilibrium, or stays in it.
        return math.inf
    end = min(descent_end, horizon)
    if end <= descent_start:
        return math.inf
    lowest, speed = evolve(level, u, v, end)
    if not lowest < line - GRAZING_TOLERANCE * (abs(u) + abs(line)):
        return math.inf
    return _descent_root(level, u, v, line, descent_start, end)


@kernel
def _descent_root(level, u, v, line, low, high):
    """Return the time in [low, high] at which a motion in contact falls through a line.

    The motion starts at time 0 with displacement u and velocity v, in a stiffness `Level`; u and
    `line` count from its equilibrium. The motion falls monotonically between `low` and `high`.
    """
    t = 0.5 * (low + high)
    for step in range(_MAX_ITERATIONS):
        height, speed = evolve(level, u, v, t)
        if height > line:
            low = t
        else:
            high = t
        if abs(height - line) <= 2e-16 * abs(line):
            break
        new_t = t - (height - line) / speed if speed < 0.0 else low
        if not low < new_t < high or step % 8 == 7:
            new_t = 0.5 * (low + high)
        step_size = abs(new_t - t)
        t = new_t
        if step_size <= 2e-16 * high:
            break
    return t


@kernel
def landing(drag, load, gap, x, v):
    """Return (t, side): the duration of a flight through the backlash, and the flank it hits.

    The flight x'' + 2 drag x' = load starts with displacement -gap <= x <= 0 and velocity v; the
    backlash `gap` > 0 may be infinite. `side` is 1 for the drive-side flank (x = 0) and -1 for the
    back-side flank (x = -gap).
    """
    if v >= 0.0:
        return climb_time(drag, load, -x, v), 1
    if x <= -gap:
        return 0.0, -1
    t = lowest_time(drag, load, v)
    lowest, _ = fly(drag, load, x, v, t)
    if lowest < -gap * (1.0 + GRAZING_TOLERANCE):
        return min(fall_time(drag, load, x + gap, v), t), -1
    return t + climb_time(drag, load, -lowest, 0.0), 1


# Columns of an arc table, see the docstring of this module.
START, DURATION, CONTACT, LEVEL, DISPLACEMENT, VELOCITY = range(6)
ARC_COLUMNS = 6


@kernel
def next_event(mesh, level, contact, x, v, horizon):
    """Return (duration, new contact code, x, v): duration of an arc, and the state at its end.

    The arc starts with displacement x, velocity v and a contact code (1 drive side, 0 loss, -1 back
    side), in a `Mesh` at a stiffness `Level`. It ends at the first crossing of a flank line, where
    x is exact, or after the time `horizon`, where the contact code does not change.
    """
    if contact == BACKLASH:
        t, side = landing(mesh.drag, mesh.load, mesh.gap, x, v)
        if t > horizon:
            x, v = fly(mesh.drag, mesh.load, x, v, horizon)
            return horizon, contact, x, v
        _, v = fly(mesh.drag, mesh.load, x, v, t)
        if side == NORMAL:
            return t, NORMAL, 0.0, max(v, 0.0)
        return t, INVERSE, -mesh.gap, min(v, 0.0)
    if contact == NORMAL:
        u = x - level.equilibrium
        t = descent_time(level, u, v, -level.equilibrium, horizon)
        if t <= horizon:
            _, speed = evolve(level, u, v, t)
            if speed < 0.0:
                return t, (INVERSE if mesh.gap == 0.0 else BACKLASH), 0.0, speed
        u, v = evolve(level, u, v, horizon)
        return horizon, contact, u + level.equilibrium, v
    # Back-side contact is mirrored: it ends when -u falls through the static deflection.
    u = x + mesh.gap - level.equilibrium
    t = descent_time(level, -u, -v, level.equilibrium, horizon)
    if t <= horizon:
        _, speed = evolve(level, u, v, t)
        return t, (NORMAL if mesh.gap == 0.0 else BACKLASH), -mesh.gap, max(speed, 0.0)
    u, v = evolve(level, u, v, horizon)
    return horizon, contact, u + level.equilibrium - mesh.gap, v


@kernel
def march(mesh, level_index, start, length, contact, x, v, arcs, count, limit):
    """Run through a segment of constant stiffness; return (contact code, x, v, number of arcs).

    The segment has stiffness level 0 (C_min) or 1 (C_max) and covers the phase `length` from phase
    `start` of the mesh period; the motion enters it with a contact code, displacement x and
    velocity v. Rows of the arc table `arcs`, shape (n, 6), are filled from row `count` on. If more
    than `limit` arcs are needed, the number is limit + 1.
    """
    _, contact, x, v, count = march_on(
        mesh, level_index, start, 0.0, length, contact, x, v, arcs, count, limit, False
    )
    return contact, x, v, count


@kernel
def march_on(mesh, level_index, start, t, length, contact, x, v, arcs, count, limit, to_landing):
    """Run through the rest of a segment of constant stiffness, from the phase t after its start.

    Returns (t, contact code, x, v, number of arcs) at its end, or with `to_landing` at the next
    landing on the drive-side flank. Other arguments as in `march`: stiffness level 0 or 1, phases
    `start` and `length` of the segment, state (x, v), arc table, its rows in use, and their limit.
    """
    level = mesh.high if level_index == 1 else mesh.low
    while t < length:
        if count >= limit:
            return t, contact, x, v, limit + 1
        duration, new_contact, new_x, new_v = next_event(mesh, level, contact, x, v, length - t)
        if count < arcs.shape[0]:
            arcs[count, START] = start + t
            arcs[count, DURATION] = duration
            arcs[count, CONTACT] = contact
            arcs[count, LEVEL] = level_index
            arcs[count, DISPLACEMENT] = x
            arcs[count, VELOCITY] = v
        count += 1
        x, v = new_x, new_v
        if new_contact == contact:
            return length, contact, x, v, count
        contact = new_contact
        t += duration
        if to_landing and contact == NORMAL:
            break
    return t, contact, x, v, count


@kernel
def march_period(mesh, contact, x, v, arcs, limit):
    """Run through one mesh period; return (contact code, x, v, number of arcs) at its end.

    The motion starts with a contact code, displacement x and velocity v in the middle of the C_max
    segment. The arc table `arcs`, shape (n, 6), is filled; `limit` is the largest number of arcs.
    """
    count, start = 0, 0.0
    for segment in range(3):
        level_index = 1 - segment % 2
        length = mesh.half_high if level_index == 1 else mesh.whole_low
        contact, x, v, count = march(
            mesh, level_index, start, length, contact, x, v, arcs, count, limit
        )
        if count > limit:
            break
        start += length
    return contact, x, v, count
