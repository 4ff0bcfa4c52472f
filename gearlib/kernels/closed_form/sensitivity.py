"""Derivatives of what a run records: final state, samples, events, extrema, shares of time.

The run is gone through again, arc by arc, with its tangents.
"""

import math

import numpy as np

from gearlib.kernels.closed_form.arc_tangents import (
    DECAY,
    DRAG,
    EQUILIBRIUM,
    GAP,
    PULL,
    RATES,
    SQUARE,
    STIFFNESS,
    SWITCH,
    carry,
    enter,
    flank_of,
    leave,
    line_of,
    line_rate,
    rates_of,
    switch_phase,
)
from gearlib.kernels.closed_form.damped_oscillator import UNDERDAMPED, turning_time
from gearlib.kernels.closed_form.event_by_event import (
    ARC_COLUMNS,
    CONTACT,
    DISPLACEMENT,
    DURATION,
    LEVEL,
    START,
    VELOCITY,
)
from gearlib.kernels.closed_form.flight import lowest_time
from gearlib.kernels.closed_form.mesh_constants import contact_of
from gearlib.kernels.closed_form.pair_run import FIRST_ARCS, outcome, whole_period
from gearlib.kernels.closed_form.settling import multiplied, repeat_of, sum_of_powers
from gearlib.kernels.closed_form.whole_periods import new_work, set_mesh, set_start
from gearlib.kernels.codes import BACKLASH, INVERSE, OK, OVERFLOW
from gearlib.kernels.jit import inlined, kernel
from gearlib.kernels.overflow import within_range

#: An event slower than this, in static deflections by natural time, or a turning point this close
#: to a flank line, in static deflections, is a grazing: rounding over the square of the speed is
#: what is left of the digits of the phase.
SLOWEST, CLOSEST = 1e-5, 1e-10
#: A state that repeats to rounding.
_AT_REST = 1e-14
_FIRST_LOOK = 16
# Extrema, in the order of the summary of an orbit; columns of samples and of events.
X_MAX, X_MIN, FORCE_MAX, FORCE_MIN = range(4)
EXTREMA = 4
SAMPLE_COLUMNS = 4  #: displacement, velocity, acceleration, force
EVENT_COLUMNS = 2  #: phase, velocity
#: Times in normal mesh, backlash, inverse mesh, and in mesh at C_min.
TIMES = 4


@kernel
def follow(m, rates, arcs, count, before, contact, x, tangents):
    """Take tangents through the arcs of a mesh period that ends in `contact` at `x`.

    `before` is the contact code of the arc before. Returns that of the last one.
    """
    switch = 0
    for i in range(count):
        switch = enter(m, rates, arcs[i], before, switch, tangents)
        carry(m, rates, arcs[i], arcs[i, DURATION], tangents, tangents)
        before = int(arcs[i, CONTACT])
    leave(m, rates, contact, x, switch, tangents)
    return before


@kernel
def consider(m, rates, contact, level, x, slope, best, extrema):
    """Compare a point of the orbit, whose displacement changes by `slope`, with the extrema."""
    which = int(level)
    lev = m.high if which == 1 else m.low
    k = slope.shape[0]
    if x > best[X_MAX]:
        best[X_MAX] = x
        for j in range(k):
            extrema[X_MAX, j] = slope[j]
    if x < best[X_MIN]:
        best[X_MIN] = x
        for j in range(k):
            extrema[X_MIN, j] = slope[j]
    deflection = 0.0 if contact == BACKLASH else x - line_of(m, contact)
    force = lev.stiffness * deflection
    far = 1.0 if contact == INVERSE else 0.0
    for place in (FORCE_MAX, FORCE_MIN):
        if force > best[place] if place == FORCE_MAX else force < best[place]:
            best[place] = force
            for j in range(k):
                extrema[place, j] = 0.0
                if contact != BACKLASH:
                    extrema[place, j] = rates[STIFFNESS + which, j] * deflection
                    extrema[place, j] += lev.stiffness * (slope[j] + far * rates[GAP, j])


@kernel
def turning_points(m, rates, arc, tangents, scratch, slope, best, extrema):
    """Compare the turning points of an arc with the extrema; return whether one grazes."""
    contact, v = int(arc[CONTACT]), arc[VELOCITY]
    lev = m.high if arc[LEVEL] == 1.0 else m.low
    if contact == BACKLASH:
        # A load that pulls down, as of a run-up, has a highest point instead.
        t = lowest_time(m.drag, abs(m.pull), -abs(v)) if v * m.pull < 0.0 else math.inf
    else:
        t = turning_time(lev, arc[DISPLACEMENT] - line_of(m, contact) - lev.equilibrium, v)
    grazing = False
    # The first two are the highest and the lowest: amplitudes never grow.
    for _ in range(2):
        if not t < arc[DURATION]:
            break
        x, _v = carry(m, rates, arc, t, tangents, scratch)
        for j in range(slope.shape[0]):
            slope[j] = scratch[0, j]
        consider(m, rates, contact, arc[LEVEL], x, slope, best, extrema)
        grazing = grazing or min(abs(x), abs(x + m.gap)) <= CLOSEST
        if contact == BACKLASH or lev.kind != UNDERDAMPED:
            break
        t += math.pi / lev.w
    return grazing


@inlined
def sample(m, rates, arc, t, tangents, scratch, row):
    """Fill `row`, shape (4, k), with the derivatives of a sample at t after the start of an arc."""
    contact, which = int(arc[CONTACT]), int(arc[LEVEL])
    x, v = carry(m, rates, arc, t, tangents, scratch)
    lev = m.high if which == 1 else m.low
    far = 1.0 if contact == INVERSE else 0.0
    deflection = x - line_of(m, contact)
    for j in range(tangents.shape[1]):
        along, rate = scratch[0, j], scratch[1, j]
        row[0, j], row[1, j] = along, rate
        if contact == BACKLASH:
            row[2, j] = rates[PULL, j] - 2.0 * (rates[DRAG, j] * v + m.drag * rate)
            row[3, j] = 0.0
            continue
        bending = along + far * rates[GAP, j]
        row[2, j] = (
            -2.0 * (rates[DECAY, j] * v + lev.a * rate)
            - rates[SQUARE + which, j] * (deflection - lev.equilibrium)
            - lev.square * (bending - rates[EQUILIBRIUM + which, j])
        )
        row[3, j] = rates[STIFFNESS + which, j] * deflection + lev.stiffness * bending


@kernel
def event_rates(m, rates, lev, before, after, v, tangents, moved, event):
    """Fill `moved`, shape (k,), by how the phase of an event moves, and `event`, shape (2, k).

    `tangents` are those before the event, at fixed phase; `event` gets phase and velocity. Returns
    whether it is a grazing: then all are NaN.
    """
    grazing = not abs(v) * m.tuning > SLOWEST
    loss = m.drag if before == BACKLASH else lev.a
    acceleration = m.pull - 2.0 * loss * v
    flank = flank_of(before, after)
    for j in range(moved.shape[0]):
        line = line_rate(rates, j, flank)
        moved[j] = math.nan if grazing else (line - tangents[0, j]) / v
        event[0, j] = moved[j]
        event[1, j] = tangents[1, j] + acceleration * moved[j]
    return grazing


@inlined
def _switch_times(rates, switch, contact, times):
    """Add by how much longer the flanks touch at C_min, for a switch to it (0) or from it (1)."""
    if contact != BACKLASH:
        for j in range(times.shape[1]):
            times[3, j] += rates[SWITCH + 1, j] if switch == 1 else -rates[SWITCH, j]


@inlined
def event_times(level, before, after, moved, times):
    """Add by how much longer each phase of contact lasts on both sides of an event."""
    for j in range(times.shape[1]):
        times[1 - before, j] += moved[j]
        times[1 - after, j] -= moved[j]
        if level == 0.0:
            times[3, j] += moved[j] * (abs(before) - abs(after))


@kernel
def _record(m, rates, arcs, count, before, contact, x, tangents, tables):
    """Take tangents through a mesh period that is recorded; arguments otherwise as of `follow`.

    `tables` are (samples of this period, events, best extrema, extrema, times, events so far).
    Returns (contact code of the last arc, events so far, whether it grazes).
    """
    samples, events, best, extrema, times, found = tables
    k, n = tangents.shape[1], samples.shape[0]
    scratch, slope, moved = np.empty((2, k)), np.empty(k), np.empty(k)
    event = np.empty((EVENT_COLUMNS, k))
    level, switch, taken, grazing = arcs[0, LEVEL], 0, 0, False
    for i in range(count):
        arc = arcs[i]
        after, at, v = int(arc[CONTACT]), arc[DISPLACEMENT], arc[VELOCITY]
        passed = switch
        while passed < 2 and arc[START] >= switch_phase(m, passed):
            _switch_times(rates, passed, before, times)
            passed += 1
        if after != before:
            lev = m.high if level == 1.0 else m.low
            slow = event_rates(m, rates, lev, before, after, v, tangents, moved, event)
            grazing = grazing or slow
            if found < events.shape[0]:
                for j in range(k):
                    events[found, 0, j], events[found, 1, j] = event[0, j], event[1, j]
            found += 1
            left = before
            if left != BACKLASH and after != BACKLASH:
                # No way between the flanks: one is left and the other met at once.
                event_times(arc[LEVEL], left, BACKLASH, moved, times)
                for j in range(k):
                    moved[j] += (line_rate(rates, j, after) - line_rate(rates, j, left)) / v
                left = BACKLASH
            event_times(arc[LEVEL], left, after, moved, times)
            for j in range(k):
                slope[j] = line_rate(rates, j, flank_of(before, after))
            # No mesh force on the flank line.
            consider(m, rates, BACKLASH, level, at, slope, best, extrema)
        else:
            for j in range(k):
                shift = rates[SWITCH + passed - 1, j] if i > 0 and passed > switch else 0.0
                slope[j] = tangents[0, j] + v * shift
            consider(m, rates, before, level, at, slope, best, extrema)
            consider(m, rates, after, arc[LEVEL], at, slope, best, extrema)
        switch = enter(m, rates, arc, before, switch, tangents)
        before, level = after, arc[LEVEL]
        turns = turning_points(m, rates, arc, tangents, scratch, slope, best, extrema)
        grazing = grazing or turns
        while taken < n:
            t = 2.0 * math.pi * taken / n
            if i + 1 < count and arcs[i + 1, START] <= t:
                break
            sample(m, rates, arc, t - arc[START], tangents, scratch, samples[taken])
            taken += 1
        carry(m, rates, arc, arc[DURATION], tangents, tangents)
    for j in range(k):
        slope[j] = tangents[0, j]
    consider(m, rates, before, level, x, slope, best, extrema)
    for passed in range(switch, 2):
        _switch_times(rates, passed, contact, times)
    leave(m, rates, contact, x, switch, tangents)
    return before, found, grazing


@kernel
def _repeat(power, tangents, shift):
    """tangents <- power tangents + shift, for a map by rows; both may be one."""
    for j in range(tangents.shape[1]):
        x, v = tangents[0, j], tangents[1, j]
        tangents[0, j] = power[0] * x + power[1] * v + shift[0, j]
        tangents[1, j] = power[2] * x + power[3] * v + shift[1, j]


@kernel
def _skip(m, rates, work, contact, x, v, tangents, periods, limit):
    """Take state and tangents through mesh periods that are not recorded.

    Where the state repeats to rounding on an orbit that attracts, each repeat is the same linear
    map of the tangents, whose powers follow by squaring.

    Returns (contact, x, v, contact code of the last arc, status).
    """
    arcs, n, look, before = np.empty((FIRST_ARCS, ARC_COLUMNS)), 0, _FIRST_LOOK, contact
    # Of one repeat: its map, and the tangents of a start that does not change.
    matrix, none, shift = np.empty((2, 2)), np.zeros((RATES, 2)), np.empty_like(tangents)
    until = repeat = 0
    while n < periods:
        contact, x, v, count, arcs = whole_period(m, work, n, contact, x, v, limit, arcs)
        status = outcome(x, v, count, limit)
        if status != OK:
            return contact, x, v, before, status
        if n < until:
            follow(m, none, arcs, count, before, contact, x, matrix)
        going = shift if n < until else tangents
        before = follow(m, rates, arcs, count, before, contact, x, going)
        n += 1
        if n == until:
            power = matrix[0, 0], matrix[0, 1], matrix[1, 0], matrix[1, 1]
            _repeat(power, tangents, shift)
            look = 2 * n
            if sum_of_powers(m, power) < math.inf:
                left = (periods - n) // repeat
                n += left * repeat
                while left > 0:
                    if left % 2 == 1:
                        _repeat(power, tangents, shift)
                    _repeat(power, shift, shift)
                    power = multiplied(power, power)
                    left //= 2
        elif n > until and n >= look:
            repeat = repeat_of(m, work, n, _AT_REST)
            if repeat > 0 and periods - n >= 2 * repeat:
                until = n + repeat
                shift.fill(0.0)
                matrix[0, 0] = matrix[1, 1] = 1.0
                matrix[0, 1] = matrix[1, 0] = 0.0
    return contact, x, v, before, OK


@kernel
def go_through(m, slopes, x, v, tangents, periods, limit):
    """Take tangents through mesh periods; arguments as of `differentiate`. Returns the status."""
    if not within_range(x, v):
        return OVERFLOW
    rates, work = rates_of(m, slopes), new_work()
    set_mesh(work, m)
    set_start(work, x, v)
    contact = contact_of(m.gap, x, v)
    return _skip(m, rates, work, contact, x, v, tangents, periods, limit)[4]


@kernel
def differentiate(
    m, slopes, x, v, tangents, periods, record_periods, limit, samples, events, extrema, times
):
    """Take tangents through a run from the state (x, v) at tau = 0; otherwise as `run`.

    `slopes`, shape (k, 8): what the ratios of `mesh` and the tuning change by, for each direction;
    `tangents`, shape (2, k): what the state at tau = 0 changes by, changed in place to the end.
    Filled with derivatives: `samples`, shape (record_periods * n, 4, k), of displacement, velocity,
    acceleration, force; `events`, shape (e, 2, k), of phase and velocity, NaN for a grazing;
    `extrema`, shape (4, k), of displacement and force; `times`, shape (4, k), of those in normal
    mesh, backlash, inverse mesh and at C_min.

    Returns (found, status, grazing): recorded events, OK, EVENT_LIMIT or OVERFLOW, and whether the
    recorded motion touches a flank line.
    """
    if not within_range(x, v):
        return 0, OVERFLOW, False
    rates, work = rates_of(m, slopes), new_work()
    set_mesh(work, m)
    set_start(work, x, v)
    contact = contact_of(m.gap, x, v)
    unseen = periods - record_periods
    contact, x, v, before, status = _skip(m, rates, work, contact, x, v, tangents, unseen, limit)
    if status != OK:
        return 0, status, False
    best = np.array([-math.inf, math.inf, -math.inf, math.inf])
    times.fill(0.0)
    per_period = samples.shape[0] // record_periods
    arcs, found, grazing = np.empty((FIRST_ARCS, ARC_COLUMNS)), 0, False
    for i in range(record_periods):
        contact, x, v, count, arcs = whole_period(m, work, unseen + i, contact, x, v, limit, arcs)
        status = outcome(x, v, count, limit)
        if status != OK:
            return found, status, False
        seen = samples[i * per_period : (i + 1) * per_period]
        tables = seen, events, best, extrema, times, found
        before, found, touches = _record(
            m, rates, arcs, count, before, contact, x, tangents, tables
        )
        grazing = grazing or touches
    return found, OK, grazing
