"""Contact: the motion of one stiffness level in a table of equal times, and when it leaves a flank.

With X = C + a S (see `oscillator`) a state in contact goes by

    u(t) = u0 X(t) + u0' S(t),        u'(t) = u0' (X(t) - 2 a S(t)) - W^2 u0 S(t).

X and S are tabulated at equal times, `PER_RADIAN` to 1 / W; from an entry to any time next to it
lead their Taylor polynomials. Hence neither exp nor sine nor cosine is needed along an orbit.

The instant at which the flank is left is found by Newton's method from the entry at which it was
left last. That a root is the first one needs no search: with X falling, it is the first within half
a turn of the oscillator, since the next way down starts half a turn after the first minimum at the
earliest; from a start that does not fall, within a whole turn, since the first way down ends, and
the second starts, later. What this does not decide is left to the closed forms of `crossing`.

A level is a row of numbers, so that either level is found by its index.
"""

import math

from gearlib.engines.jit import inlined, kernel
from gearlib.engines.pair.elementary import cos_sin, decay
from gearlib.engines.pair.motion import UNDERDAMPED, propagators

PER_RADIAN = 12
#: Entries of a table: more than a turn of an oscillator that is not next to critical damping.
ENTRIES = 96
#: Entries that are computed one by one; the others are products of two of them.
_FIRST = 8
#: Farthest from an entry, in entries, that the polynomials go: (0.75 / 12)^9 / 9! = 4e-17.
_NEXT_TO = 0.75
#: Room for rounding in the bound on the amplitude.
MARGIN = 1.0 - 1e-12
#: A last step of Newton's method bends this little: what it leaves out, its fourth power, is
#: rounding.
_SHORT = 1e-4
_MAX_STEPS = 8
#: Entries from one to the next that `lowest_entry` looks at: a quarter of a radian.
_STRIDE = 3

# Columns of a level. LAST is the last entry of its table, EMPTY before that is filled, NONE when
# there is none; X2 to X8 and S2 to S8 are coefficients of the polynomials; the END columns are the
# map of the whole segment; WITHIN_HALF, WITHIN_TURN say whether the segment is shorter than that.
(
    LENGTH,
    EQUILIBRIUM,
    SQUARE,
    TWICE_A,
    RATE,
    SPACING,
    PER_TIME,
    TURN,
    BOUND,
    LAST,
    END_X,
    END_S,
    WITHIN_HALF,
    WITHIN_TURN,
    X2,
    X3,
    X4,
    X5,
    X6,
    X7,
    X8,
    S2,
    S3,
    S4,
    S5,
    S6,
    S7,
    S8,
) = range(28)
LEVEL_COLUMNS = 28
EMPTY, NONE = -1.0, -2.0


@kernel
def set_level(lev, length, row):
    """Fill the row of a level whose segments have the given length; its table stays empty."""
    natural = math.sqrt(lev.square)
    swings = lev.kind == UNDERDAMPED
    row[LENGTH], row[EQUILIBRIUM], row[SQUARE], row[TWICE_A] = (
        length,
        lev.equilibrium,
        lev.square,
        2.0 * lev.a,
    )
    row[RATE] = 2.0 * lev.a + natural
    row[SPACING], row[PER_TIME] = 1.0 / (PER_RADIAN * natural), PER_RADIAN * natural
    row[TURN] = 2.0 * math.pi / lev.w if swings else math.inf
    row[BOUND] = lev.square * lev.equilibrium * lev.equilibrium * MARGIN
    row[LAST] = EMPTY if swings else NONE
    c, s = propagators(lev, length)
    row[END_X], row[END_S] = c + lev.a * s, s
    row[WITHIN_HALF] = 1.0 if 2.0 * length < row[TURN] else 0.0
    row[WITHIN_TURN] = 1.0 if length < row[TURN] else 0.0


@kernel
def fill_table(lev, row, table):
    """Fill the table, shape (ENTRIES, 2), of an under-damped level, and its polynomials."""
    twice_a, square, spacing = row[TWICE_A], row[SQUARE], row[SPACING]
    # u'' = -2 a u' - W^2 u, coefficient by coefficient.
    x, next_x, s, next_s = 1.0, 0.0, 0.0, 1.0
    for n in range(7):
        share = -1.0 / ((n + 1) * (n + 2))
        x, next_x = next_x, share * (twice_a * (n + 1) * next_x + square * x)
        s, next_s = next_s, share * (twice_a * (n + 1) * next_s + square * s)
        row[X2 + n], row[S2 + n] = next_x, next_s
    count = int(min(row[LENGTH] * row[PER_TIME] + 2.0, ENTRIES))
    row[LAST] = count - 1
    for k in range(count):
        if k < _FIRST or k % _FIRST == 0:
            t = k * spacing
            cosine, sine = cos_sin(lev.w * t)
            gone = decay(lev.a * t)
            s = gone * sine / lev.w
            table[k, 0], table[k, 1] = gone * cosine + lev.a * s, s
        else:
            # Each of two factors: errors do not add up along the table.
            x, s = table[k - k % _FIRST, 0], table[k - k % _FIRST, 1]
            y, r = table[k % _FIRST, 0], table[k % _FIRST, 1]
            table[k, 0], table[k, 1] = x * y - square * s * r, x * r + s * (y - twice_a * r)


@inlined
def go_by(levels, i, u, v, x, s):
    """Return (u, u') by the given X and S of level i."""
    return u * x + v * s, v * (x - levels[i, TWICE_A] * s) - levels[i, SQUARE] * u * s


@inlined
def step(levels, i, u, v, t):
    """Return (u, u') a short time later or earlier, by the Taylor polynomials of level i."""
    q = t * t
    x = levels[i, X6] + t * levels[i, X7] + q * levels[i, X8]
    x = levels[i, X2] + t * levels[i, X3] + q * (levels[i, X4] + t * levels[i, X5] + q * x)
    s = levels[i, S6] + t * levels[i, S7] + q * levels[i, S8]
    s = levels[i, S2] + t * levels[i, S3] + q * (levels[i, S4] + t * levels[i, S5] + q * s)
    return go_by(levels, i, u, v, 1.0 + q * x, t + q * s)


@inlined
def stays(half, turn, v, end_x, end_v):
    """Return whether a motion in contact is proven to have no minimum below the flank line.

    `half`, `turn`: whether it takes less than half a turn, than a turn. A minimum needs a fall
    before it and a rise after it; within a turn, a motion that rises first and falls last has a
    maximum only.
    """
    if not end_x >= 0.0:
        return False
    if half:
        return v >= 0.0 or end_v < 0.0
    return turn and v >= 0.0 and end_v < 0.0


@inlined
def _step_to_line(height, speed, acceleration, jerk, rate):
    """Return (step, bend): the step in time to height 0 by the series of the height, inverted."""
    inverse = 1.0 / speed
    r = -height * inverse
    q = 0.5 * acceleration * inverse * r
    correction = q * (2.0 * q - 1.0) - (1.0 / 6.0) * jerk * inverse * r * r
    bend = abs(q) + rate * abs(r)
    return (r * (1.0 + correction) if bend < 0.2 else r), bend


@inlined
def leaving(levels, tables, i, u, v, k, horizon):
    """Return (t, speed, entry): when the flank is left within `horizon`, proven first.

    The search starts from entry k of the table of level i. Without a proof t = -1.
    """
    equilibrium, square, twice_a = levels[i, EQUILIBRIUM], levels[i, SQUARE], levels[i, TWICE_A]
    rate, last = levels[i, RATE], int(levels[i, LAST])
    for _ in range(_MAX_STEPS):
        if k < 0 or k > last:
            break
        above, speed = go_by(levels, i, u, v, tables[i, k, 0], tables[i, k, 1])
        if not speed < 0.0:
            break
        acceleration = -twice_a * speed - square * above
        jerk = -twice_a * acceleration - square * speed
        t, _ = _step_to_line(equilibrium + above, speed, acceleration, jerk, rate)
        entries = t * levels[i, PER_TIME]
        if abs(entries) <= _NEXT_TO:
            above, speed = step(levels, i, above, speed, t)
            acceleration = -twice_a * speed - square * above
            jerk = -twice_a * acceleration - square * speed
            more, bend = _step_to_line(equilibrium + above, speed, acceleration, jerk, rate)
            speed += more * (acceleration + 0.5 * more * jerk)
            t += k * levels[i, SPACING] + more
            turn = levels[i, TURN] if v >= 0.0 else 0.5 * levels[i, TURN]
            if bend < _SHORT and speed < 0.0 and 0.0 < t <= horizon and t <= turn:
                return t, speed, k
            break
        if not abs(entries) <= ENTRIES:
            break
        k += int(math.floor(entries + 0.5))
    return -1.0, 0.0, k


@inlined
def lowest_entry(levels, tables, i, u, v):
    """Return (k, below): an entry below the flank line, the first of those looked at, if any.

    Else the lowest of them.
    """
    line = -levels[i, EQUILIBRIUM]
    lowest, at, k = math.inf, 0, 0
    while k <= int(levels[i, LAST]):
        height = u * tables[i, k, 0] + v * tables[i, k, 1]
        if height < lowest:
            lowest, at = height, k
            if height < line:
                break
        k += _STRIDE
    return at, lowest < line


@inlined
def stays_above(levels, tables, i, u, v, k):
    """Return whether the first minimum, next to entry k, is proven to lie above the flank line.

    A minimum within a turn is the first one, and no later one is lower. Where the velocity is next
    to zero, v^2 / u'' is twice the depth that is left.
    """
    square, twice_a = levels[i, SQUARE], levels[i, TWICE_A]
    for _ in range(_MAX_STEPS):
        if k < 0 or k > int(levels[i, LAST]):
            break
        above, speed = go_by(levels, i, u, v, tables[i, k, 0], tables[i, k, 1])
        acceleration = -twice_a * speed - square * above
        t = -speed / acceleration
        entries = t * levels[i, PER_TIME]
        if not (acceleration > 0.0 and abs(entries) <= ENTRIES):
            break
        if abs(entries) <= _NEXT_TO:
            above, speed = step(levels, i, above, speed, t)
            acceleration = -twice_a * speed - square * above
            t += k * levels[i, SPACING]
            calm = acceleration > 0.0 and abs(speed) * levels[i, RATE] < 1e-2 * acceleration
            left = levels[i, EQUILIBRIUM] * MARGIN + above - speed * speed / acceleration
            return calm and 0.0 < t <= levels[i, TURN] and left > 0.0
        k += int(math.floor(entries + 0.5))
    return False
