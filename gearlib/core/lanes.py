"""Many bouncing orbits in lockstep: one orbit per lane, one bounce of every lane at a time.

A *lane* holds an orbit that has just landed on the normal flank. One step of all lanes takes each
of them to its next landing: the rest of the present stretch, perhaps one whole stretch, leaving
the flank in the stretch after that, a flight. The loops run over the lanes without a branch, so
that the compiler turns them into vector instructions.

A lane's step counts only with the proofs of `transit`: no minimum below the flank line before the
root, the root on the first way down, the flight clear of the far flank, the last step of Newton's
method short enough to be exact. A lane without them stays where it is, for the plain march to take
that orbit on. No lane looks at another: an orbit is the same to the last bit in any company.
"""

import math

import numpy as np

from gearlib.core.elementary import cos_sin, decay
from gearlib.core.flight import phi_below_two
from gearlib.core.jit import inlined, kernel
from gearlib.core.oscillator import UNDERDAMPED
from gearlib.core.transit import (
    MARGIN,
    MAX_NEWTON,
    SHORT,
    speed_in_flight,
    step_to_line,
    stretch_map,
    taylor_step,
)

#: Lanes in lockstep: enough vectors to hide the latency of one behind the others.
LANES = 16

#: Newton's method in one lane; a lost lane stays lost for the rest of the step.
LOST, SEARCHING, SETTLED = -1.0, 0.0, 1.0

# Rows of the lane table, one flat array: the compiler then sees that rows do not overlap.
# Constants of the mesh, those of C_min before those of C_max.
(
    DECAY,
    DRAG,
    PULL,
    ESCAPE,
    PERIOD,
    W0,
    W1,
    SQUARE0,
    SQUARE1,
    REST0,
    REST1,
    RATE0,
    RATE1,
    LENGTH0,
    LENGTH1,
    XX0,
    XX1,
    XV0,
    XV1,
    XC0,
    XC1,
    VX0,
    VX1,
    VV0,
    VV1,
    VC0,
    VC1,
    TURNS0,
    TURNS1,
    BOUND0,
    BOUND1,
    # The orbit: period and phase of its last landing, landing speed, whether the lane is in use.
    COUNT,
    PHASE,
    SPEED,
    # Where propagators were last computed: rest of the landing stretch (with the frequency it
    # belongs to), exits in the stretches of C_min and of C_max, flight.
    NEAR_W,
    NEAR_T,
    NEAR_C,
    NEAR_S,
    EXIT0_T,
    EXIT0_C,
    EXIT0_S,
    EXIT1_T,
    EXIT1_C,
    EXIT1_S,
    AIR_T,
    AIR_DECAY,
    AIR_FIRST,
    AIR_SECOND,
    # Within a step.
    REMAIN,
    FRESH_T,
    PROVEN,
    FIRST,
    LEVEL,
    BEGIN,
    U,
    V,
    TRY_T,
    TRY_C,
    TRY_S,
    STEP,
    STATE,
    LEAVING,
    LANDED,
    # Three and six rows: what `COUNT` to `SPEED` and `EXIT0_T` to `EXIT1_S` are to become.
    NEXT,
) = range(0, 64 * LANES, LANES)
NEXT_EXIT = NEXT + 3 * LANES
_ROWS = 72


@inlined
def pick(first, a, b):
    """Return a or b, both at hand.

    A load under a condition keeps a loop from being vectorised. A store that may leave a value as
    it was becomes a masked one, which is slow: such values go to another row and are copied.
    """
    return a if first else b


@kernel
def _to_stretch_end(s, n):
    """Propagators over the rest of the landing stretch, anew only where the last are too far."""
    far = 0
    for i in range(n):
        low = s[PHASE + i] < s[LENGTH0 + i]
        w = pick(low, s[W0 + i], s[W1 + i])
        rate = pick(low, s[RATE0 + i], s[RATE1 + i])
        remain = pick(low, s[LENGTH0 + i], s[PERIOD + i]) - s[PHASE + i]
        near = (abs(remain - s[NEAR_T + i]) * rate < SHORT) & (s[NEAR_W + i] == w)
        s[REMAIN + i] = remain
        s[FRESH_T + i] = pick(near, s[NEAR_T + i], remain)
        far += 0 if near else 1
    if far == 0:
        return
    for i in range(n):
        w = pick(s[PHASE + i] < s[LENGTH0 + i], s[W0 + i], s[W1 + i])
        t = s[FRESH_T + i]
        c, sine = cos_sin(w * t)
        e = decay(s[DECAY + i] * t)
        s[NEAR_W + i] = w
        s[NEAR_T + i] = t
        s[NEAR_C + i] = e * c
        s[NEAR_S + i] = e * sine / w


@kernel
def _to_exit_stretch(s, n):
    """State at the start of the stretch in which the flank is left, and the first guess there."""
    for i in range(n):
        a = s[DECAY + i]
        low = s[PHASE + i] < s[LENGTH0 + i]
        w = pick(low, s[W0 + i], s[W1 + i])
        square = pick(low, s[SQUARE0 + i], s[SQUARE1 + i])
        rest = pick(low, s[REST0 + i], s[REST1 + i])
        u, v, d = -rest, s[SPEED + i], s[REMAIN + i] - s[NEAR_T + i]
        c, sine = s[NEAR_C + i], s[NEAR_S + i]
        end_u = u * c + (v + a * u) * sine
        end_v = v * c - (a * v + square * u) * sine
        end_u, v = taylor_step(end_u, end_v, 2.0 * a, square, d)
        x = rest + end_u
        turned = w * s[REMAIN + i]
        single = turned < math.pi
        double = (turned < 2.0 * math.pi) & (v < 0.0)
        proven = (x >= 0.0) & (single | double)
        # The whole stretch that follows, if it is proven to stay in contact.
        other_rest = pick(low, s[REST1 + i], s[REST0 + i])
        next_x = (
            pick(low, s[XX1 + i], s[XX0 + i]) * x
            + pick(low, s[XV1 + i], s[XV0 + i]) * v
            + pick(low, s[XC1 + i], s[XC0 + i])
        )
        next_v = (
            pick(low, s[VX1 + i], s[VX0 + i]) * x
            + pick(low, s[VV1 + i], s[VV0 + i]) * v
            + pick(low, s[VC1 + i], s[VC0 + i])
        )
        turned = pick(low, s[TURNS1 + i], s[TURNS0 + i])
        up, down = v >= 0.0, next_v < 0.0
        single = (turned < math.pi) & (up | down)
        double = (turned < 2.0 * math.pi) & up & down
        other = x - other_rest
        form = pick(low, s[SQUARE1 + i], s[SQUARE0 + i]) * other * other + v * (v + 2.0 * a * other)
        bounded = form < pick(low, s[BOUND1 + i], s[BOUND0 + i])
        passes = ((next_x >= 0.0) & (single | double)) | bounded
        exit_low = low == passes
        x = next_x if passes else x
        s[V + i] = next_v if passes else v
        s[U + i] = x - pick(exit_low, s[REST0 + i], s[REST1 + i])
        s[LEVEL + i] = 0.0 if exit_low else 1.0
        s[BEGIN + i] = pick(low, s[LENGTH0 + i], s[PERIOD + i]) + (
            pick(passes, pick(low, s[LENGTH1 + i], s[LENGTH0 + i]), 0.0)
        )
        s[PROVEN + i] = 1.0 if proven else 0.0
        s[TRY_T + i] = pick(exit_low, s[EXIT0_T + i], s[EXIT1_T + i])
        s[TRY_C + i] = pick(exit_low, s[EXIT0_C + i], s[EXIT1_C + i])
        s[TRY_S + i] = pick(exit_low, s[EXIT0_S + i], s[EXIT1_S + i])


@kernel
def _step_to_exit(s, n):
    """One step of Newton's method to the flank line; return how many lanes want another."""
    more = 0
    for i in range(n):
        low = s[LEVEL + i] == 0.0
        a = s[DECAY + i]
        square = pick(low, s[SQUARE0 + i], s[SQUARE1 + i])
        rest = pick(low, s[REST0 + i], s[REST1 + i])
        rate = pick(low, s[RATE0 + i], s[RATE1 + i])
        u, v, c, sine = s[U + i], s[V + i], s[TRY_C + i], s[TRY_S + i]
        above = u * c + (v + a * u) * sine
        speed = v * c - (a * v + square * u) * sine
        acceleration = -2.0 * a * speed - square * above
        jerk = -2.0 * a * acceleration - square * speed
        step, short = step_to_line(rest + above, speed, acceleration, jerk, rate)
        going = (speed < 0.0) & (s[TRY_T + i] > 0.0)
        s[STEP + i] = step
        _, s[LEAVING + i] = taylor_step(above, speed, 2.0 * a, square, step)
        s[STATE + i] = pick(going, pick(short, SETTLED, SEARCHING), LOST)
        more += 1 if going & (not short) else 0
    return more


@kernel
def _anchor_exit(s, n):
    """Propagators at the end of the last step, where it was not short."""
    for i in range(n):
        w = pick(s[LEVEL + i] == 0.0, s[W0 + i], s[W1 + i])
        t = s[TRY_T + i] + pick(s[STATE + i] == SEARCHING, s[STEP + i], 0.0)
        turned = w * t
        inside = (turned <= 2.0 * math.pi) & (t > 0.0)
        c, sine = cos_sin(pick(inside, turned, 0.0))
        e = decay(pick(inside, s[DECAY + i] * t, 0.0))
        s[TRY_T + i] = pick(inside, t, -1.0)
        s[TRY_C + i] = e * c
        s[TRY_S + i] = e * sine / w


@kernel
def _prove_exit(s, n):
    """The exit as part of the orbit: proven first, clear of the far flank."""
    for i in range(n):
        low = s[LEVEL + i] == 0.0
        w = pick(low, s[W0 + i], s[W1 + i])
        length = pick(low, s[LENGTH0 + i], s[LENGTH1 + i])
        t, speed = s[TRY_T + i] + s[STEP + i], s[LEAVING + i]
        turn = pick(s[V + i] >= 0.0, 2.0 * math.pi, math.pi)
        inside = (t > 0.0) & (t <= length) & (w * t <= turn)
        leaves = (speed < 0.0) & (speed * speed < s[ESCAPE + i])
        found = (s[STATE + i] == SETTLED) & inside & leaves
        s[FIRST + i] = pick(found, 1.0, 0.0)
        s[BEGIN + i] += t
        # The new anchors; those of a failed lane are set anew at its next landing.
        s[NEXT_EXIT + i] = pick(low, s[TRY_T + i], s[EXIT0_T + i])
        s[NEXT_EXIT + LANES + i] = pick(low, s[TRY_C + i], s[EXIT0_C + i])
        s[NEXT_EXIT + 2 * LANES + i] = pick(low, s[TRY_S + i], s[EXIT0_S + i])
        s[NEXT_EXIT + 3 * LANES + i] = pick(low, s[EXIT1_T + i], s[TRY_T + i])
        s[NEXT_EXIT + 4 * LANES + i] = pick(low, s[EXIT1_C + i], s[TRY_C + i])
        s[NEXT_EXIT + 5 * LANES + i] = pick(low, s[EXIT1_S + i], s[TRY_S + i])
    for i in range(6 * LANES):
        s[EXIT0_T + i] = s[NEXT_EXIT + i]


@kernel
def _step_to_landing(s, n):
    """One step of Newton's method to the landing; return how many lanes want another."""
    more = 0
    for i in range(n):
        b, f, v, t = s[DRAG + i], s[PULL + i], s[LEAVING + i], s[AIR_T + i]
        height = t * (v * s[AIR_FIRST + i] + f * t * s[AIR_SECOND + i])
        speed = v * s[AIR_DECAY + i] + f * t * s[AIR_FIRST + i]
        acceleration = f - 2.0 * b * speed
        jerk = -2.0 * b * acceleration
        step, short = step_to_line(height, speed, acceleration, jerk, 2.0 * b)
        going = (speed > 0.0) & (t > 0.0) & (2.0 * b * (t + step) < 2.0)
        s[STEP + i] = step
        s[V + i] = speed_in_flight(b, speed, acceleration, step)
        s[STATE + i] = pick(going, pick(short, SETTLED, SEARCHING), LOST)
        more += 1 if going & (not short) else 0
    return more


@kernel
def _anchor_flight(s, n):
    """Propagators of the flight at the end of the last step, where it was not short."""
    for i in range(n):
        t = s[AIR_T + i] + pick(s[STATE + i] == SEARCHING, s[STEP + i], 0.0)
        gone, first, second = phi_below_two(2.0 * s[DRAG + i] * t)
        s[AIR_T + i] = t
        s[AIR_DECAY + i] = gone
        s[AIR_FIRST + i] = first
        s[AIR_SECOND + i] = second


@kernel
def _land(s, n, last):
    """Move the proven lanes to their landings; return how many are not."""
    failed = 0
    for i in range(n):
        period = s[PERIOD + i]
        phase = s[BEGIN + i] + s[AIR_T + i] + s[STEP + i]
        turns = pick(phase >= period, 1.0, 0.0) + pick(phase >= 2.0 * period, 1.0, 0.0)
        phase -= turns * period
        count = s[COUNT + i] + turns
        found = (s[STATE + i] == SETTLED) & (s[PROVEN + i] + s[FIRST + i] == 2.0)
        lands = found & (s[V + i] >= 0.0) & (phase < period) & (count <= last)
        s[NEXT + i] = pick(lands, count, s[COUNT + i])
        s[NEXT + LANES + i] = pick(lands, phase, s[PHASE + i])
        s[NEXT + 2 * LANES + i] = pick(lands, s[V + i], s[SPEED + i])
        s[LANDED + i] = pick(lands, 1.0, 0.0)
        failed += 0 if lands else 1
    for i in range(3 * LANES):
        s[COUNT + i] = s[NEXT + i]
    return failed


@kernel
def new_lanes():
    """Return a lane table with all lanes idle: what they hold is never proven."""
    s = np.full(_ROWS * LANES, -1.0)
    s[W0 : W1 + LANES] = 1.0
    return s


@kernel
def set_idle(s, i):
    """Let lane i never land."""
    s[EXIT0_T + i] = s[EXIT1_T + i] = s[AIR_T + i] = -1.0


@kernel
def suits(m):
    """Return whether an orbit of a mesh can go by lanes at all, and may settle down to do so."""
    oscillates = m.low.kind == UNDERDAMPED and m.high.kind == UNDERDAMPED
    return oscillates and m.gap > 0.0 and (m.low.a > 0.0 or m.drag > 0.0)


@kernel
def set_mesh(s, i, m):
    """Set the constants of lane i."""
    s[DECAY + i], s[DRAG + i], s[PULL + i] = m.low.a, m.drag, m.pull
    s[ESCAPE + i] = 2.0 * m.pull * m.gap * MARGIN
    s[PERIOD + i] = m.whole_low + 2.0 * m.half_high
    for j, lev, length in ((0, m.low, m.whole_low), (LANES, m.high, 2.0 * m.half_high)):
        along = stretch_map(lev, length)
        k = i + j
        s[W0 + k], s[SQUARE0 + k], s[REST0 + k] = lev.w, lev.square, lev.rest
        s[RATE0 + k], s[LENGTH0 + k] = 2.0 * lev.a + math.sqrt(lev.square), length
        s[XX0 + k], s[XV0 + k], s[XC0 + k] = along.xx, along.xv, along.x0
        s[VX0 + k], s[VV0 + k], s[VC0 + k] = along.vx, along.vv, along.v0
        s[TURNS0 + k], s[BOUND0 + k] = lev.w * length, along.bound
    s[NEAR_W + i] = -1.0
    set_idle(s, i)


@kernel
def set_orbit(s, i, count, phase, speed, which, leaving, airtime):
    """Set lane i to the landing at `phase` of mesh period `count`.

    The flank was left in a stretch of level `which`, after a time `leaving` in contact in it, for
    a flight of length `airtime`: the first guesses for the next bounce.
    """
    s[COUNT + i], s[PHASE + i], s[SPEED + i] = count, phase, speed
    w = s[W0 + i] if which == 0 else s[W1 + i]
    inside = 0.0 < leaving and w * leaving <= 2.0 * math.pi
    c, sine = cos_sin(w * leaving if inside else 0.0)
    e = decay(s[DECAY + i] * leaving if inside else 0.0)
    row = (EXIT0_T if which == 0 else EXIT1_T) + i
    s[row] = leaving if inside else -1.0
    s[row + LANES], s[row + 2 * LANES] = e * c, e * sine / w
    z = 2.0 * s[DRAG + i] * airtime
    s[AIR_T + i] = airtime if 0.0 <= z < 2.0 else -1.0
    s[AIR_DECAY + i], s[AIR_FIRST + i], s[AIR_SECOND + i] = phi_below_two(z)


@kernel
def bounce(s, n, last):
    """Take the first n lanes, a multiple of 4, to their next landings, not beyond period `last`.

    Returns
    -------
    int
        How many of them have not moved, idle ones included; `LANDED` says which.
    """
    _to_stretch_end(s, n)
    _to_exit_stretch(s, n)
    for _ in range(MAX_NEWTON):
        if _step_to_exit(s, n) == 0:
            break
        _anchor_exit(s, n)
    _prove_exit(s, n)
    for _ in range(MAX_NEWTON):
        if _step_to_landing(s, n) == 0:
            break
        _anchor_flight(s, n)
    return _land(s, n, last)
