"""Tables of motions in contact at equally spaced times, and the first loss of contact.

With X = C + a S (see `motion`) a motion in contact follows

    u(t) = u0 X(t) + u0' S(t),        u'(t) = u0' (X(t) - 2 a S(t)) - W^2 u0 S(t).

X and S are tabulated at equally spaced times, with `ENTRIES_PER_RADIAN` entries per time 1 / W.
Taylor polynomials give the motion between the entries, so an orbit needs no exponential, sine or
cosine.

Newton's method finds the loss of contact, starting from the table entry of the previous loss of
contact. A root is known to be the first one without a further search. If the motion starts
downwards, it is the first root within half an oscillation, because the next descent starts at least
half an oscillation after the first minimum. If the motion starts upwards, it is the first root
within a whole oscillation, because the second descent starts later. All other cases are left to the
closed forms of `events`.

The constants of a stiffness level are a row of an array, which kernels select by its index.
"""

import math

from gearlib.engines.jit import kernel_part
from gearlib.engines.pair.motion import (
    UNDERDAMPED,
    cos_sin,
    fundamental_solutions,
    negative_exponential,
)

#: Number of entries per time 1 / W.
ENTRIES_PER_RADIAN = 12
#: Number of entries of a table: more than a cycle of an oscillator far from critical damping.
ENTRIES = 96
#: Interval between entries that are computed directly; the others are products of two entries.
_DIRECT_ENTRIES = 8
#: Largest distance from an entry, in entries, for the polynomials: (0.75 / 12)^9 / 9! = 4e-17.
_MAX_ENTRY_DISTANCE = 0.75
#: Factor on the bound of the amplitude that allows for rounding.
ROUNDING_MARGIN = 1.0 - 1e-12
#: Largest nonlinearity of the last Newton step, whose error is its fourth power, and of a step that
#: includes terms of higher order.
_MAX_LAST_NONLINEARITY, _MAX_NONLINEARITY = 1e-4, 0.2
#: Largest speed, relative to acceleration / RATE_BOUND, at which a motion counts as near a minimum.
_MAX_SPEED_AT_MINIMUM = 1e-2
_MAX_NEWTON_STEPS = 8
#: `lowest_entry` checks every third entry, one per quarter of a radian.
_ENTRY_STRIDE = 3

# Columns of the row of a stiffness level with u'' + DAMPING u' + STIFFNESS u = 0. Contact lasts if
# the energy STIFFNESS u^2 + u' (u' + DAMPING u) is below MAX_ENERGY. LAST_ENTRY of the
# table is UNFILLED before the table is filled, NO_TABLE without a table. END_X and END_S are X and
# S at the end of the segment. The WITHIN columns tell whether the segment is shorter than half a
# cycle and than a cycle of the oscillation. X2 to X8 and S2 to S8 are Taylor coefficients.
SEGMENT_LENGTH, EQUILIBRIUM, STIFFNESS, DAMPING, RATE_BOUND, SPACING, ENTRIES_PER_TIME = range(7)
CYCLE_TIME, MAX_ENERGY, LAST_ENTRY, END_X, END_S, WITHIN_HALF_CYCLE, WITHIN_CYCLE = range(7, 14)
X2, X3, X4, X5, X6, X7, X8 = range(14, 21)
S2, S3, S4, S5, S6, S7, S8 = range(21, 28)
LEVEL_COLUMNS = 28
UNFILLED, NO_TABLE = -1.0, -2.0


@kernel_part
def fill_level_constants(level, length, row):
    """Fill `row`, shape (LEVEL_COLUMNS,), with the constants of a `StiffnessLevel`.

    The level is the linear oscillator u'' + DAMPING u' + STIFFNESS u = 0 of a mesh in contact; u
    counts from its equilibrium. `length`, in rad of mesh phase, is the length of a segment of this
    stiffness. END_X and END_S are the displacements at its end of motions that start with
    displacement 1 and with velocity 1. LAST_ENTRY is UNFILLED until `fill_table` is called, or
    NO_TABLE if the level does not oscillate.
    """
    natural_frequency = math.sqrt(level.natural_squared)
    oscillates = level.damping_kind == UNDERDAMPED
    row[SEGMENT_LENGTH] = length
    row[EQUILIBRIUM] = level.equilibrium
    row[STIFFNESS] = level.natural_squared
    row[DAMPING] = 2.0 * level.decay_rate
    row[RATE_BOUND] = 2.0 * level.decay_rate + natural_frequency
    row[SPACING] = 1.0 / (ENTRIES_PER_RADIAN * natural_frequency)
    row[ENTRIES_PER_TIME] = ENTRIES_PER_RADIAN * natural_frequency
    row[CYCLE_TIME] = 2.0 * math.pi / level.frequency if oscillates else math.inf
    # A motion with less energy never reaches the flank line, which is one static deflection away
    # from the equilibrium.
    max_energy = level.natural_squared * level.equilibrium * level.equilibrium
    row[MAX_ENERGY] = max_energy * ROUNDING_MARGIN
    row[LAST_ENTRY] = UNFILLED if oscillates else NO_TABLE
    c, s = fundamental_solutions(level, length)
    row[END_X], row[END_S] = c + level.decay_rate * s, s
    row[WITHIN_HALF_CYCLE] = 1.0 if 2.0 * length < row[CYCLE_TIME] else 0.0
    row[WITHIN_CYCLE] = 1.0 if length < row[CYCLE_TIME] else 0.0


@kernel_part
def fill_table(level, row, table):
    """Fill `table`, shape (ENTRIES, 2), with two solutions X and S of a `StiffnessLevel`.

    The level is the linear oscillator of a mesh in contact. X starts with displacement 1 and
    velocity 0, S with displacement 0 and velocity 1; entries are equally spaced in time. `row`
    holds the constants from `fill_level_constants` and is filled with the Taylor coefficients of X
    and S.
    """
    damping, stiffness, spacing = row[DAMPING], row[STIFFNESS], row[SPACING]
    # Taylor coefficients follow from u'' = -damping u' - stiffness u.
    x, next_x, s, next_s = 1.0, 0.0, 0.0, 1.0
    for n in range(X8 - X2 + 1):
        factor = -1.0 / ((n + 1) * (n + 2))
        x, next_x = next_x, factor * (damping * (n + 1) * next_x + stiffness * x)
        s, next_s = next_s, factor * (damping * (n + 1) * next_s + stiffness * s)
        row[X2 + n], row[S2 + n] = next_x, next_s
    entry_count = int(min(row[SEGMENT_LENGTH] * row[ENTRIES_PER_TIME] + 2.0, ENTRIES))
    row[LAST_ENTRY] = entry_count - 1
    for k in range(entry_count):
        if k < _DIRECT_ENTRIES or k % _DIRECT_ENTRIES == 0:
            t = k * spacing
            cosine, sine = cos_sin(level.frequency * t)
            decay_factor = negative_exponential(level.decay_rate * t)
            s = decay_factor * sine / level.frequency
            table[k, 0], table[k, 1] = decay_factor * cosine + level.decay_rate * s, s
        else:
            # Each entry is a product of two others, so errors do not accumulate along the table.
            x, s = table[k - k % _DIRECT_ENTRIES, 0], table[k - k % _DIRECT_ENTRIES, 1]
            step_x, step_s = table[k % _DIRECT_ENTRIES, 0], table[k % _DIRECT_ENTRIES, 1]
            table[k, 0] = x * step_x - stiffness * s * step_s
            table[k, 1] = x * step_s + s * (step_x - damping * step_s)


@kernel_part(inlined=True)
def advance_by_responses(levels, i, u, v, x, s):
    """Return displacement and velocity of a motion in contact, from (u, v), at a later time.

    x and s are the values of two solutions at that time: x starts with displacement 1 and velocity
    0, s with displacement 0 and velocity 1. Row i of `levels` holds the constants of the oscillator
    at one stiffness level; displacements count from its equilibrium.
    """
    return u * x + v * s, v * (x - levels[i, DAMPING] * s) - levels[i, STIFFNESS] * u * s


@kernel_part(inlined=True)
def advance_by_series(levels, i, u, v, t):
    """Return displacement and velocity of a motion in contact, from (u, v), after a short time t.

    Row i of `levels` holds the constants of the oscillator at one stiffness level; displacements
    count from its equilibrium. X2 to X8 are the Taylor coefficients of the solution X that starts
    with displacement 1 and velocity 0, S2 to S8 of the solution S that starts with displacement 0
    and velocity 1.
    """
    # Horner's scheme for X = 1 + X2 t^2 + ... and S = t + S2 t^2 + ....
    q = t * t
    x = levels[i, X6] + t * levels[i, X7] + q * levels[i, X8]
    x = levels[i, X2] + t * levels[i, X3] + q * (levels[i, X4] + t * levels[i, X5] + q * x)
    s = levels[i, S6] + t * levels[i, S7] + q * levels[i, S8]
    s = levels[i, S2] + t * levels[i, S3] + q * (levels[i, S4] + t * levels[i, S5] + q * s)
    return advance_by_responses(levels, i, u, v, 1.0 + q * x, t + q * s)


@kernel_part(inlined=True)
def provably_stays_in_contact(is_half_cycle, is_cycle, v, end_x, end_v):
    """Return whether a motion in contact provably has no minimum below the flank line.

    Its velocity is v at the start and `end_v` at the end, where its displacement from the flank
    line (at which the flanks just touch) is `end_x`. `is_half_cycle` and `is_cycle` tell whether it
    is shorter than half a cycle and than a cycle of the oscillation.
    """
    if not end_x >= 0.0:
        return False
    # Within half a cycle there is at most one extremum. If the motion rises at first or falls at
    # last, this is not a minimum.
    if is_half_cycle:
        return v >= 0.0 or end_v < 0.0
    # Within a cycle, a motion that rises at first and falls at last has only a maximum.
    return is_cycle and v >= 0.0 and end_v < 0.0


@kernel_part(inlined=True)
def _step_to_line(height, speed, acceleration, jerk, rate):
    """Return (step, nonlinearity): the time until a height is zero, by an inverted Taylor series.

    `height`, `speed`, `acceleration` and `jerk` are the height above the flank line and its
    derivatives; `rate` is an upper bound on the rates of the oscillator. The error of the step
    grows with the nonlinearity, a dimensionless estimate of the terms of higher order. If the
    nonlinearity is too large, the step is a plain Newton step.
    """
    inverse = 1.0 / speed
    r = -height * inverse
    q = 0.5 * acceleration * inverse * r
    correction = q * (2.0 * q - 1.0) - (1.0 / 6.0) * jerk * inverse * r * r
    nonlinearity = abs(q) + rate * abs(r)
    step = r * (1.0 + correction) if nonlinearity < _MAX_NONLINEARITY else r
    return step, nonlinearity


@kernel_part(inlined=True)
def first_loss_of_contact(levels, tables, i, u, v, k, max_time):
    """Return (time, velocity, table entry) of the first loss of contact within `max_time`.

    The motion starts with displacement u from the equilibrium of stiffness level i and velocity v.
    Newton's method starts from entry k of `tables[i]`, shape (ENTRIES, 2): two solutions at equally
    spaced times, with initial displacement 1 and with initial velocity 1. `levels[i]` holds the
    constants of the level. The time is -1 if the loss of contact is not proven to be the first one.
    It is the first one within one oscillation if the motion starts upwards, because there is only
    one descent, and within half an oscillation if it starts downwards.
    """
    equilibrium = levels[i, EQUILIBRIUM]
    stiffness, damping = levels[i, STIFFNESS], levels[i, DAMPING]
    rate, last_entry = levels[i, RATE_BOUND], int(levels[i, LAST_ENTRY])
    for _ in range(_MAX_NEWTON_STEPS):
        if k < 0 or k > last_entry:
            break
        x, speed = advance_by_responses(levels, i, u, v, tables[i, k, 0], tables[i, k, 1])
        # Contact is lost only while the displacement falls.
        if not speed < 0.0:
            break
        acceleration = -damping * speed - stiffness * x
        jerk = -damping * acceleration - stiffness * speed
        t, _ = _step_to_line(equilibrium + x, speed, acceleration, jerk, rate)
        entry_distance = t * levels[i, ENTRIES_PER_TIME]
        # Near an entry, the Taylor polynomial is exact, and one more step reaches the root.
        if abs(entry_distance) <= _MAX_ENTRY_DISTANCE:
            x, speed = advance_by_series(levels, i, x, speed, t)
            acceleration = -damping * speed - stiffness * x
            jerk = -damping * acceleration - stiffness * speed
            step, nonlinearity = _step_to_line(equilibrium + x, speed, acceleration, jerk, rate)
            speed += step * (acceleration + 0.5 * step * jerk)
            t += k * levels[i, SPACING] + step
            max_first_time = levels[i, CYCLE_TIME] if v >= 0.0 else 0.5 * levels[i, CYCLE_TIME]
            is_accurate = nonlinearity < _MAX_LAST_NONLINEARITY
            if is_accurate and speed < 0.0 and 0.0 < t <= max_time and t <= max_first_time:
                return t, speed, k
            break
        if not abs(entry_distance) <= ENTRIES:
            break
        # Otherwise start the next Newton step from the entry nearest to the estimate.
        k += int(math.floor(entry_distance + 0.5))
    return -1.0, 0.0, k


@kernel_part(inlined=True)
def lowest_entry(levels, tables, i, u, v):
    """Return (k, is_below): the table entry k at which a motion in contact is lowest.

    If a checked entry lies below the flank line, k is the first such entry and `is_below` is True.
    Every third entry is checked. The motion starts with displacement u from the equilibrium of
    stiffness level i and velocity v. `levels[i]` holds the constants of the level, `tables[i]`,
    shape (ENTRIES, 2), two solutions at equally spaced times, with initial displacement 1 and with
    initial velocity 1.
    """
    # Displacement of the flank line from the equilibrium.
    line = -levels[i, EQUILIBRIUM]
    min_height, lowest_k, k = math.inf, 0, 0
    while k <= int(levels[i, LAST_ENTRY]):
        height = u * tables[i, k, 0] + v * tables[i, k, 1]
        if height < min_height:
            min_height, lowest_k = height, k
            if height < line:
                break
        k += _ENTRY_STRIDE
    return lowest_k, min_height < line


@kernel_part(inlined=True)
def first_minimum_is_above(levels, tables, i, u, v, k):
    """Return whether the first minimum of a motion in contact provably lies above the flank line.

    The motion starts with displacement u from the equilibrium of stiffness level i and velocity v.
    `levels[i]` holds the constants of the level, `tables[i]`, shape (ENTRIES, 2), two solutions at
    equally spaced times, with initial displacement 1 and with initial velocity 1. Newton's method
    for zero velocity starts at entry k. A minimum within one oscillation is the first one, and
    later minima are higher.
    """
    stiffness, damping = levels[i, STIFFNESS], levels[i, DAMPING]
    for _ in range(_MAX_NEWTON_STEPS):
        if k < 0 or k > int(levels[i, LAST_ENTRY]):
            break
        x, speed = advance_by_responses(levels, i, u, v, tables[i, k, 0], tables[i, k, 1])
        acceleration = -damping * speed - stiffness * x
        t = -speed / acceleration
        entry_distance = t * levels[i, ENTRIES_PER_TIME]
        if not (acceleration > 0.0 and abs(entry_distance) <= ENTRIES):
            break
        # Near an entry, the Taylor polynomial is exact.
        if abs(entry_distance) <= _MAX_ENTRY_DISTANCE:
            x, speed = advance_by_series(levels, i, x, speed, t)
            acceleration = -damping * speed - stiffness * x
            t += k * levels[i, SPACING]
            max_speed_times_rate = _MAX_SPEED_AT_MINIMUM * acceleration
            is_close = abs(speed) * levels[i, RATE_BOUND] < max_speed_times_rate
            at_minimum = acceleration > 0.0 and is_close
            # Twice the depth of the minimum below x, v^2 / (2 u''), is a safe margin.
            min_height = levels[i, EQUILIBRIUM] * ROUNDING_MARGIN + x - speed * speed / acceleration
            return at_minimum and 0.0 < t <= levels[i, CYCLE_TIME] and min_height > 0.0
        k += int(math.floor(entry_distance + 0.5))
    return False
