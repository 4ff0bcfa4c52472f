"""First crossing of a flank line, proven to be the first.

Nothing is sampled. In contact the turning points are known in closed form and their depths
decrease, so the first minimum after the start is the deepest: either the way down to it crosses
the line, once, or nothing ever does. In flight there is one lowest point, and likewise one
descent and one climb.
"""

import math

from gearlib.engines.jit import kernel
from gearlib.engines.pair.damped_oscillator import UNDERDAMPED, evolve, turning_time
from gearlib.engines.pair.flight import climb_time, fall_time, fly, lowest_time

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
