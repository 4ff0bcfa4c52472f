"""Tables of the motion in contact at equal times, and the first loss of contact.

With X = C + a S (see `motion`) a motion in contact follows

    u(t) = u0 X(t) + u0' S(t),        u'(t) = u0' (X(t) - 2 a S(t)) - W^2 u0 S(t).

X and S are tabulated at equal times, `PER_RADIAN` to 1 / W. Their Taylor polynomials give the
motion between the entries, so that an orbit needs neither exp nor sine nor cosine.

Newton's method finds the loss of contact from the entry of the last one. No search has to show that
a root is the first: from a start that falls, it is the first within half an oscillation, since the
next descent starts at least half an oscillation after the first minimum; from another start, within
a whole oscillation, since the second descent starts later. Undecided cases are left to the closed
forms of `events`.

A level is a row of numbers, so that kernels select it by an index.
"""

import math

from gearlib.engines.jit import inlined, kernel
from gearlib.engines.pair.elementary import cos_sin, decay
from gearlib.engines.pair.motion import UNDERDAMPED, propagators

#: Number of entries to 1 / W.
PER_RADIAN = 12
#: Number of entries of a table: more than a turn of an oscillator far from critical damping.
ENTRIES = 96
#: Number of entries between those that are computed directly; others are products of two entries.
_DIRECT_ENTRIES = 8
#: Largest distance from an entry, in entries, of the polynomials: (0.75 / 12)^9 / 9! = 4e-17.
_MAX_ENTRY_DISTANCE = 0.75
#: Factor of the bound on the amplitude that allows for rounding.
MARGIN = 1.0 - 1e-12
#: Largest curvature in a last Newton step, whose error, the fourth power, is then rounding.
_MAX_LAST_CURVATURE = 1e-4
_MAX_STEPS = 8
#: Number of entries from one to the next that `lowest_entry` checks: a quarter of a radian.
_STRIDE = 3

# Columns of a level. LAST is the last entry of its table, EMPTY before the table is filled, NONE
# without a table. X2 to X8 and S2 to S8 are coefficients of the polynomials, the END columns X and
# S over the whole segment. WITHIN_HALF and WITHIN_TURN: whether the segment is shorter than half a
# turn and than a turn.
LENGTH, EQUILIBRIUM, SQUARE, TWICE_A, RATE, SPACING, PER_TIME = range(7)
TURN, BOUND, LAST, END_X, END_S, WITHIN_HALF, WITHIN_TURN = range(7, 14)
X2, X3, X4, X5, X6, X7, X8 = range(14, 21)
S2, S3, S4, S5, S6, S7, S8 = range(21, 28)
LEVEL_COLUMNS = 28
EMPTY, NONE = -1.0, -2.0


@kernel
def set_level(level, length, row):
    """Fill `row`, shape (28,), with the constants of a stiffness `Level`; its table stays empty.

    Segments of this stiffness have the phase length `length`.
    """
    natural = math.sqrt(level.square)
    oscillates = level.kind == UNDERDAMPED
    row[LENGTH] = length
    row[EQUILIBRIUM] = level.equilibrium
    row[SQUARE] = level.square
    row[TWICE_A] = 2.0 * level.a
    row[RATE] = 2.0 * level.a + natural
    row[SPACING], row[PER_TIME] = 1.0 / (PER_RADIAN * natural), PER_RADIAN * natural
    row[TURN] = 2.0 * math.pi / level.w if oscillates else math.inf
    row[BOUND] = level.square * level.equilibrium * level.equilibrium * MARGIN
    row[LAST] = EMPTY if oscillates else NONE
    c, s = propagators(level, length)
    row[END_X], row[END_S] = c + level.a * s, s
    row[WITHIN_HALF] = 1.0 if 2.0 * length < row[TURN] else 0.0
    row[WITHIN_TURN] = 1.0 if length < row[TURN] else 0.0


@kernel
def fill_table(level, row, table):
    """Tabulate the free motions X and S of a stiffness `Level` in contact at equal times.

    Fills `table`, shape (ENTRIES, 2), and their Taylor coefficients in `row`, the constants of the
    level, see `set_level`. X starts with displacement 1 and velocity 0, S with 0 and 1.
    """
    twice_a, square, spacing = row[TWICE_A], row[SQUARE], row[SPACING]
    # Taylor coefficients follow from u'' = -2 a u' - W^2 u.
    x, next_x, s, next_s = 1.0, 0.0, 0.0, 1.0
    for n in range(7):
        factor = -1.0 / ((n + 1) * (n + 2))
        x, next_x = next_x, factor * (twice_a * (n + 1) * next_x + square * x)
        s, next_s = next_s, factor * (twice_a * (n + 1) * next_s + square * s)
        row[X2 + n], row[S2 + n] = next_x, next_s
    count = int(min(row[LENGTH] * row[PER_TIME] + 2.0, ENTRIES))
    row[LAST] = count - 1
    for k in range(count):
        if k < _DIRECT_ENTRIES or k % _DIRECT_ENTRIES == 0:
            t = k * spacing
            cosine, sine = cos_sin(level.w * t)
            decayed = decay(level.a * t)
            s = decayed * sine / level.w
            table[k, 0], table[k, 1] = decayed * cosine + level.a * s, s
        else:
            # Products of two entries keep errors from adding up along the table.
            x, s = table[k - k % _DIRECT_ENTRIES, 0], table[k - k % _DIRECT_ENTRIES, 1]
            step_x, step_s = table[k % _DIRECT_ENTRIES, 0], table[k % _DIRECT_ENTRIES, 1]
            table[k, 0] = x * step_x - square * s * step_s
            table[k, 1] = x * step_s + s * (step_x - twice_a * step_s)


@inlined
def move_by(levels, i, u, v, x, s):
    """Return the displacement and velocity of a motion in contact at a later time.

    It starts with displacement u from the equilibrium and velocity v. x and s are the values of the
    free motions X and S at that time; row i of `levels` holds the constants of the stiffness level.
    """
    return u * x + v * s, v * (x - levels[i, TWICE_A] * s) - levels[i, SQUARE] * u * s


@inlined
def step_by_series(levels, i, u, v, t):
    """Return the displacement and velocity of a motion in contact a short time t later or earlier.

    It starts with displacement u from the equilibrium and velocity v. Row i of `levels` holds the
    Taylor coefficients (X2 ... S8) of the free motions X and S of the stiffness level.
    """
    q = t * t
    x = levels[i, X6] + t * levels[i, X7] + q * levels[i, X8]
    x = levels[i, X2] + t * levels[i, X3] + q * (levels[i, X4] + t * levels[i, X5] + q * x)
    s = levels[i, S6] + t * levels[i, S7] + q * levels[i, S8]
    s = levels[i, S2] + t * levels[i, S3] + q * (levels[i, S4] + t * levels[i, S5] + q * s)
    return move_by(levels, i, u, v, 1.0 + q * x, t + q * s)


@inlined
def provably_stays(half, turn, v, end_x, end_v):
    """Return whether a motion in contact provably has no minimum below the flank line.

    `half` and `turn` say whether it takes less than half an oscillation and less than a whole one;
    v and end_v are its first and last velocity, end_x its last displacement, 0 being the flank
    line. Within an oscillation, a motion that rises first and falls last only has a maximum.
    """
    if not end_x >= 0.0:
        return False
    if half:
        return v >= 0.0 or end_v < 0.0
    return turn and v >= 0.0 and end_v < 0.0


@inlined
def _step_to_line(height, speed, acceleration, jerk, rate):
    """Return (step, curvature): time until a height becomes zero, by its inverted Taylor series.

    `height`, `speed`, `acceleration` and `jerk` are its value and derivatives; `rate` is an upper
    bound of the rates of the oscillator. A large `curvature` means an inaccurate step.
    """
    inverse = 1.0 / speed
    r = -height * inverse
    q = 0.5 * acceleration * inverse * r
    correction = q * (2.0 * q - 1.0) - (1.0 / 6.0) * jerk * inverse * r * r
    curvature = abs(q) + rate * abs(r)
    return (r * (1.0 + correction) if curvature < 0.2 else r), curvature


@inlined
def first_loss_of_contact(levels, tables, i, u, v, k, horizon):
    """Return (time, velocity, table entry) of the first loss of contact within the time `horizon`.

    The motion starts with displacement u from the equilibrium of stiffness level i and velocity v.
    Newton's method starts from entry k of `tables[i]`, the motion at equal times; `levels[i]` holds
    the constants of the level. The time is -1 if the loss is not proven to be the first.
    """
    equilibrium = levels[i, EQUILIBRIUM]
    square = levels[i, SQUARE]
    twice_a = levels[i, TWICE_A]
    rate, last = levels[i, RATE], int(levels[i, LAST])
    for _ in range(_MAX_STEPS):
        if k < 0 or k > last:
            break
        above, speed = move_by(levels, i, u, v, tables[i, k, 0], tables[i, k, 1])
        if not speed < 0.0:
            break
        acceleration = -twice_a * speed - square * above
        jerk = -twice_a * acceleration - square * speed
        t, _ = _step_to_line(equilibrium + above, speed, acceleration, jerk, rate)
        entries = t * levels[i, PER_TIME]
        if abs(entries) <= _MAX_ENTRY_DISTANCE:
            above, speed = step_by_series(levels, i, above, speed, t)
            acceleration = -twice_a * speed - square * above
            jerk = -twice_a * acceleration - square * speed
            step, curvature = _step_to_line(equilibrium + above, speed, acceleration, jerk, rate)
            speed += step * (acceleration + 0.5 * step * jerk)
            t += k * levels[i, SPACING] + step
            turn = levels[i, TURN] if v >= 0.0 else 0.5 * levels[i, TURN]
            is_accurate = curvature < _MAX_LAST_CURVATURE
            if is_accurate and speed < 0.0 and 0.0 < t <= horizon and t <= turn:
                return t, speed, k
            break
        if not abs(entries) <= ENTRIES:
            break
        k += int(math.floor(entries + 0.5))
    return -1.0, 0.0, k


@inlined
def lowest_entry(levels, tables, i, u, v):
    """Return (k, is_below): the table entry where a motion in contact is lowest.

    It is the first entry below the flank line if there is one (`is_below`). Every third entry is
    checked. The motion starts with displacement u from the equilibrium of stiffness level i and
    velocity v; `levels[i]` holds constants of the level, `tables[i]` its motion at equal times.
    """
    line = -levels[i, EQUILIBRIUM]
    lowest, lowest_k, k = math.inf, 0, 0
    while k <= int(levels[i, LAST]):
        height = u * tables[i, k, 0] + v * tables[i, k, 1]
        if height < lowest:
            lowest, lowest_k = height, k
            if height < line:
                break
        k += _STRIDE
    return lowest_k, lowest < line


@inlined
def first_minimum_is_above(levels, tables, i, u, v, k):
    """Return whether the first minimum of a motion in contact provably lies above the flank line.

    The motion starts with displacement u from the equilibrium of stiffness level i and velocity v;
    `levels[i]` holds constants of the level, `tables[i]` its motion at equal times. The search
    starts at entry k. A minimum within an oscillation is the first one, later ones are higher.
    """
    square, twice_a = levels[i, SQUARE], levels[i, TWICE_A]
    for _ in range(_MAX_STEPS):
        if k < 0 or k > int(levels[i, LAST]):
            break
        above, speed = move_by(levels, i, u, v, tables[i, k, 0], tables[i, k, 1])
        acceleration = -twice_a * speed - square * above
        t = -speed / acceleration
        entries = t * levels[i, PER_TIME]
        if not (acceleration > 0.0 and abs(entries) <= ENTRIES):
            break
        if abs(entries) <= _MAX_ENTRY_DISTANCE:
            above, speed = step_by_series(levels, i, above, speed, t)
            acceleration = -twice_a * speed - square * above
            t += k * levels[i, SPACING]
            at_minimum = acceleration > 0.0 and abs(speed) * levels[i, RATE] < 1e-2 * acceleration
            # Near zero velocity, v^2 / u'' is twice the depth down to the minimum.
            lowest = levels[i, EQUILIBRIUM] * MARGIN + above - speed * speed / acceleration
            return at_minimum and 0.0 < t <= levels[i, TURN] and lowest > 0.0
        k += int(math.floor(entries + 0.5))
    return False
