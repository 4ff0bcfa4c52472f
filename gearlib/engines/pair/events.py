"""From one event to the next through a segment of constant stiffness, by closed forms only.

An *arc* is a piece of orbit with one closed form. A row of the arc table holds

    start (phase from the start of the mesh period), duration, contact code,
    stiffness level (0 C_min, 1 C_max), displacement and velocity at its start.

The first crossing of a flank line is proven to be the first; nothing is sampled. In contact the
turning points are known in closed form and their depths decrease, so the first minimum after the
start is the deepest: either the way down to it crosses the line, once, or nothing ever does. In
flight there is one lowest point, and likewise one descent and one climb.
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

#: A dip below a line smaller than this share of the deflections at hand cannot be told from
#: rounding and counts as grazing from inside: no event.
GRAZING = 4e-16
#: Of Newton's method; every eighth halves the bracket: 60 halvings leave nothing.
_MAX_ITERATIONS = 480


@kernel
def descent_time(lev, u, v, line, horizon):
    """Return the first t in [0, horizon] at which u(t) falls through `line`, infinity if none.

    The start must not lie below the line (beyond rounding) unless it falls. `line` is in
    displacements from the equilibrium of `lev`.
    """
    if u <= line and v < 0.0:
        return 0.0
    turn = turning_time(lev, u, v)
    # Where the way down begins and where it ends.
    top, bottom = 0.0, math.inf
    if lev.kind == UNDERDAMPED:
        half_turn = math.pi / lev.w
        if v < 0.0:
            bottom = turn
        elif v > 0.0:
            top, bottom = turn, turn + half_turn
        elif u > 0.0:
            bottom = half_turn
        else:
            top, bottom = half_turn, 2.0 * half_turn
    elif v < 0.0:
        bottom = turn
    elif turn < math.inf:
        top = turn
    elif v > 0.0 or u <= 0.0:
        # Creeps up to the equilibrium, or stays in it.
        return math.inf
    end = min(bottom, horizon)
    if end <= top:
        return math.inf
    lowest, speed = evolve(lev, u, v, end)
    if not lowest < line - GRAZING * (abs(u) + abs(line)):
        return math.inf
    return _descent_root(lev, u, v, line, top, end)


@kernel
def _descent_root(lev, u, v, line, low, high):
    """Return the root of u(t) = line on [low, high], where u falls monotonically through it."""
    t = 0.5 * (low + high)
    for step in range(_MAX_ITERATIONS):
        height, speed = evolve(lev, u, v, t)
        if height > line:
            low = t
        else:
            high = t
        if abs(height - line) <= 2e-16 * abs(line):
            break
        new = t - (height - line) / speed if speed < 0.0 else low
        if not low < new < high or step % 8 == 7:
            new = 0.5 * (low + high)
        moved = abs(new - t)
        t = new
        if moved <= 2e-16 * high:
            break
    return t


@kernel
def landing(b, f, gap, x, v):
    """Return (t, side): when and where a flight at -gap <= x <= 0 ends.

    side is 1 for the normal flank (x = 0), -1 for the far flank (x = -gap). `gap` > 0 may be
    infinite.
    """
    if v >= 0.0:
        return climb_time(b, f, -x, v), 1
    if x <= -gap:
        return 0.0, -1
    t = lowest_time(b, f, v)
    lowest, _ = fly(b, f, x, v, t)
    if lowest < -gap * (1.0 + GRAZING):
        return min(fall_time(b, f, x + gap, v), t), -1
    return t + climb_time(b, f, -lowest, 0.0), 1


START, DURATION, CONTACT, LEVEL, DISPLACEMENT, VELOCITY = range(6)
ARC_COLUMNS = 6


@kernel
def next_event(m, lev, contact, x, v, horizon):
    """Return (duration, new contact, x, v): the arc's length and the state at its end.

    The arc ends at the first crossing of a flank line or after `horizon`; then the new contact
    code is the old one. On a flank line x is set to it exactly.
    """
    if contact == BACKLASH:
        t, side = landing(m.drag, m.pull, m.gap, x, v)
        if t > horizon:
            x, v = fly(m.drag, m.pull, x, v, horizon)
            return horizon, contact, x, v
        _, v = fly(m.drag, m.pull, x, v, t)
        if side == NORMAL:
            return t, NORMAL, 0.0, max(v, 0.0)
        return t, INVERSE, -m.gap, min(v, 0.0)
    if contact == NORMAL:
        u = x - lev.equilibrium
        t = descent_time(lev, u, v, -lev.equilibrium, horizon)
        if t <= horizon:
            _, speed = evolve(lev, u, v, t)
            if speed < 0.0:
                return t, (INVERSE if m.gap == 0.0 else BACKLASH), 0.0, speed
        u, v = evolve(lev, u, v, horizon)
        return horizon, contact, u + lev.equilibrium, v
    # Inverse mesh, mirrored: the flank is left when -u falls through the equilibrium deflection.
    u = x + m.gap - lev.equilibrium
    t = descent_time(lev, -u, -v, lev.equilibrium, horizon)
    if t <= horizon:
        _, speed = evolve(lev, u, v, t)
        return t, (NORMAL if m.gap == 0.0 else BACKLASH), -m.gap, max(speed, 0.0)
    u, v = evolve(lev, u, v, horizon)
    return horizon, contact, u + lev.equilibrium - m.gap, v


@kernel
def march(m, which, start, length, contact, x, v, arcs, count, limit):
    """Go through one segment; return (contact, x, v, count) at its end.

    The segment of stiffness level `which` (0 C_min, 1 C_max) begins `start` after the mesh period
    and is `length` long. The arc table `arcs`, shape (n, 6), is filled from row `count` on, n = 0
    for nothing; count = limit + 1 is returned when `limit` does not suffice.
    """
    _, contact, x, v, count = march_on(
        m, which, start, 0.0, length, contact, x, v, arcs, count, limit, False
    )
    return contact, x, v, count


@kernel
def march_on(m, which, start, t, length, contact, x, v, arcs, count, limit, to_landing):
    """Go on in a segment from t after its start; arguments otherwise as of `march`.

    With `to_landing` only to the next landing on the normal flank. Returns (t, contact, x, v,
    count).
    """
    lev = m.high if which == 1 else m.low
    while t < length:
        if count >= limit:
            return t, contact, x, v, limit + 1
        duration, new_contact, new_x, new_v = next_event(m, lev, contact, x, v, length - t)
        if count < arcs.shape[0]:
            arcs[count, START] = start + t
            arcs[count, DURATION] = duration
            arcs[count, CONTACT] = contact
            arcs[count, LEVEL] = which
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
def march_period(m, contact, x, v, arcs, limit):
    """Go through one mesh period from the middle of a C_max segment; return as `march`."""
    contact, x, v, count = march(m, 1, 0.0, m.half_high, contact, x, v, arcs, 0, limit)
    if count <= limit:
        contact, x, v, count = march(
            m, 0, m.half_high, m.whole_low, contact, x, v, arcs, count, limit
        )
    if count <= limit:
        contact, x, v, count = march(
            m, 1, m.half_high + m.whole_low, m.half_high, contact, x, v, arcs, count, limit
        )
    return contact, x, v, count
