"""What is recorded of an orbit, read off its arcs: extrema, fractions, samples, events, period."""

import math

from gearlib.kernels.arrays import copy, enlarged
from gearlib.kernels.closed_form.event_by_event import (
    CONTACT,
    DISPLACEMENT,
    DURATION,
    LEVEL,
    START,
    VELOCITY,
)
from gearlib.kernels.closed_form.flight import fly, lowest_time
from gearlib.kernels.closed_form.oscillator import UNDERDAMPED, evolve, turning_time
from gearlib.kernels.codes import BACKLASH, INVERSE, NORMAL
from gearlib.kernels.jit import inlined, kernel, uncounted
from gearlib.kernels.polynomial import highest

# Columns of the summary of an orbit. The TIME columns hold phase, BOUNCES a count.
(
    X_MAX,
    X_MIN,
    FORCE_MAX,
    FORCE_MIN,
    TIME_NORMAL,
    TIME_BACKLASH,
    TIME_INVERSE,
    TIME_LOW,
    BOUNCES,
) = range(9)
SUMMARY_COLUMNS = 9

# Columns of the sample table and of the event table.
SAMPLE_X, SAMPLE_V, SAMPLE_A, SAMPLE_CONTACT, SAMPLE_STIFFNESS, SAMPLE_FORCE = range(6)
SAMPLE_COLUMNS = 6
EVENT_PERIOD, EVENT_PHASE, EVENT_FROM, EVENT_TO, EVENT_VELOCITY = range(5)
EVENT_COLUMNS = 5

#: Longest orbit that is looked for, in mesh periods; with run-out also in repeats of it.
MAX_PERIOD = 16
#: Mesh periods before the end whose states are kept, to compare two spans of the longest orbit;
#: with run-out `strobe_periods`.
STROBE_PERIODS = 2 * MAX_PERIOD - 1
#: Stroboscopic states this close, in units of the orbit's height (or of the static deflection if
#: that is larger), are the same: far above the rounding of a run, far below a visible difference.
SAME_STATE = 1e-6


@kernel
def clear_summary(summary):
    """Prepare a summary, shape (9,), for `add_arcs`."""
    summary[:] = 0.0
    summary[X_MAX] = -math.inf
    summary[X_MIN] = math.inf
    summary[FORCE_MAX] = -math.inf
    summary[FORCE_MIN] = math.inf


@uncounted
def unresolved(summary):
    """Return whether an extremum could not be found."""
    for k in range(FORCE_MIN + 1):
        if math.isnan(summary[k]):
            return True
    return False


@kernel
def _add_displacement(m, lev, contact, x, summary):
    summary[X_MAX] = max(summary[X_MAX], x)
    summary[X_MIN] = min(summary[X_MIN], x)
    force = 0.0
    if contact == NORMAL:
        force = lev.stiffness * x
    elif contact == INVERSE:
        force = lev.stiffness * (x + m.gap)
    summary[FORCE_MAX] = max(summary[FORCE_MAX], force)
    summary[FORCE_MIN] = min(summary[FORCE_MIN], force)


@kernel
def add_arcs(m, arcs, count, summary):
    """Add arcs 0 ... count - 1 to the summary; extrema are those of the closed forms."""
    for i in range(count):
        contact = int(arcs[i, CONTACT])
        lev = m.high if arcs[i, LEVEL] == 1.0 else m.low
        duration, x, v = arcs[i, DURATION], arcs[i, DISPLACEMENT], arcs[i, VELOCITY]
        _add_displacement(m, lev, contact, x, summary)
        known = i + 1 < count
        end, end_v = (arcs[i + 1, DISPLACEMENT], arcs[i + 1, VELOCITY]) if known else (0.0, 0.0)
        if contact == BACKLASH:
            summary[TIME_BACKLASH] += duration
            if v < 0.0 and not (known and end_v < 0.0):
                t = lowest_time(m.drag, m.pull, v)
                if t < duration:
                    lowest, _ = fly(m.drag, m.pull, x, v, t)
                    _add_displacement(m, lev, contact, lowest, summary)
            if not known:
                end, _ = fly(m.drag, m.pull, x, v, duration)
            # A flight lands on the line, not a rounding error past it.
            end = min(max(end, -m.gap), 0.0)
            _add_displacement(m, lev, contact, end, summary)
            continue
        shift = lev.rest if contact == NORMAL else lev.rest - m.gap
        summary[TIME_NORMAL if contact == NORMAL else TIME_INVERSE] += duration
        if arcs[i, LEVEL] == 0.0:
            summary[TIME_LOW] += duration
        if not known:
            end, end_v = evolve(lev, x - shift, v, duration)
            end += shift
        # The first two turning points are the highest and the lowest: amplitudes never grow. Within
        # half a turn there is one at most, and behind it the velocity has another sign.
        if not (v * end_v > 0.0 and lev.w * duration < math.pi):
            t = turning_time(lev, x - shift, v)
            for _ in range(2):
                if not t < duration:
                    break
                u, _v = evolve(lev, x - shift, v, t)
                _add_displacement(m, lev, contact, u + shift, summary)
                if lev.kind != UNDERDAMPED:
                    break
                t += math.pi / lev.w
        end = max(end, 0.0) if contact == NORMAL else min(end, -m.gap)
        _add_displacement(m, lev, contact, end, summary)


@kernel
def add_curve(curve, to_bernstein, work, summary, most, least):
    """Add the extrema of a polynomial on [0, 1] to two columns of the summary.

    Arguments as of `gearlib.kernels.polynomial.highest`; `curve` is negated.
    """
    summary[most] = highest(curve, to_bernstein, work, summary[most])
    for k in range(curve.shape[0]):
        curve[k] = -curve[k]
    summary[least] = -highest(curve, to_bernstein, work, -summary[least])


@uncounted
def add_time(contact, length, low, summary):
    """Add a stretch of one contact code to the summary, `low`: at the lower stiffness."""
    if contact == BACKLASH:
        summary[TIME_BACKLASH] += length
        summary[FORCE_MAX] = max(summary[FORCE_MAX], 0.0)
        summary[FORCE_MIN] = min(summary[FORCE_MIN], 0.0)
        return
    summary[TIME_NORMAL if contact == NORMAL else TIME_INVERSE] += length
    if low:
        summary[TIME_LOW] += length


@kernel
def note(events, found, period, phase, before, after, velocity, summary):
    """Count a change of contact and append it to the event table, if one is wanted."""
    if before == NORMAL:
        summary[BOUNCES] += 1.0
    if events.shape[0] > 0:
        events, found = add_event(events, found, period, phase, before, after, velocity)
    return events, found


@kernel
def add_event(events, found, period, phase, before, after, velocity):
    """Append one event to the table, enlarged as needed; return (events, rows in use)."""
    if found == events.shape[0]:
        events = enlarged(events, 2 * found + 16)
    events[found, EVENT_PERIOD] = period
    events[found, EVENT_PHASE] = phase
    events[found, EVENT_FROM] = before
    events[found, EVENT_TO] = after
    events[found, EVENT_VELOCITY] = velocity
    return events, found + 1


@kernel
def add_events(arcs, count, previous, period, events, found):
    """Append the changes of contact between successive arcs to the event table.

    `previous` is the contact code before the first arc, `period` the number of the mesh period,
    `found` the rows in use. Returns (events, found, previous); `events` is enlarged as needed.
    """
    for i in range(count):
        contact = int(arcs[i, CONTACT])
        if contact != previous:
            events, found = add_event(
                events, found, period, arcs[i, START], previous, contact, arcs[i, VELOCITY]
            )
            previous = contact
    return events, found, previous


@kernel
def repeat_record(samples, events, found, seen, periods):
    """Repeat the samples and events of the first `seen` of so many periods up to their end.

    Returns (events, found) as `add_event`.
    """
    rows, first = samples.shape[0] // periods * seen, found
    for k in range(rows, samples.shape[0]):
        copy(samples[k - rows], samples[k])
    for n in range(seen, periods, seen):
        for i in range(first):
            phase, velocity = events[i, EVENT_PHASE], events[i, EVENT_VELOCITY]
            before, after = int(events[i, EVENT_FROM]), int(events[i, EVENT_TO])
            period = int(events[i, EVENT_PERIOD]) + n
            events, found = add_event(events, found, period, phase, before, after, velocity)
    return events, found


@kernel
def count_bounces(arcs, count, previous):
    """Return (losses of normal contact among the arcs, contact code of the last arc)."""
    bounces = 0
    for i in range(count):
        contact = int(arcs[i, CONTACT])
        if previous == NORMAL and contact != NORMAL:
            bounces += 1
        previous = contact
    return bounces, previous


@inlined
def in_arc(m, arc, t):
    """Return (x, v, acceleration, force) at the phase t from the start of the mesh period."""
    contact = int(arc[CONTACT])
    lev = m.high if arc[LEVEL] == 1.0 else m.low
    x, v, t = arc[DISPLACEMENT], arc[VELOCITY], t - arc[START]
    if contact == BACKLASH:
        x, v = fly(m.drag, m.pull, x, v, t)
        return x, v, m.pull - 2.0 * m.drag * v, 0.0
    shift = lev.rest if contact == NORMAL else lev.rest - m.gap
    u, v = evolve(lev, x - shift, v, t)
    return u + shift, v, -2.0 * lev.a * v - lev.square * u, lev.stiffness * (u + lev.rest)


@kernel
def sample_arcs(m, arcs, count, samples):
    """Fill `samples`, shape (n, 6), with the states at n equal steps of one mesh period.

    At an event or a stiffness switch the state just after it is taken.
    """
    n = samples.shape[0]
    i = 0
    for k in range(n):
        t = 2.0 * math.pi * k / n
        while i + 1 < count and arcs[i + 1, START] <= t:
            i += 1
        x, v, acceleration, force = in_arc(m, arcs[i], t)
        samples[k, SAMPLE_X] = x
        samples[k, SAMPLE_V] = v
        samples[k, SAMPLE_A] = acceleration
        samples[k, SAMPLE_CONTACT] = arcs[i, CONTACT]
        samples[k, SAMPLE_STIFFNESS] = (m.high if arcs[i, LEVEL] == 1.0 else m.low).stiffness
        samples[k, SAMPLE_FORCE] = force


@kernel
def strobe_periods(repeats):
    """Return how many periods before the end `orbit_period` looks at."""
    return 2 * MAX_PERIOD * repeats - 1


@kernel
def orbit_period(strobes, tuning, height, repeats=1):
    """Return the smallest n such that the last n stroboscopic states repeat after n periods.

    n is at most 16 mesh periods, or a multiple, up to the 16th, of the `repeats` mesh periods after
    which a run-out repeats. An n that is none has to hold all through a repeat, since a slow
    run-out moves little from a period to the next.

    Parameters
    ----------
    strobes : ndarray, shape (k + 1, 2)
        Displacement and velocity at the end of each of the last k periods, and before them.
    tuning : float
        nu; turns dx/dtau into a displacement.
    height : float
        Height of the orbit, the scale of the comparison.
    repeats : int, default 1
        Mesh periods after which the excitation repeats.

    Returns
    -------
    int
        0 if there is none, or too few periods to tell.
    """
    last = strobes.shape[0] - 1
    tolerance = SAME_STATE * max(1.0, height)
    for i in range(2 * MAX_PERIOD):
        n = i + 1 if i < MAX_PERIOD else (i + 1 - MAX_PERIOD) * repeats
        span = max(n, repeats)
        if last < n + span - 1:
            return 0
        same = True
        for j in range(span):
            dx = abs(strobes[last - j % n, 0] - strobes[last - j - n, 0])
            dv = abs(strobes[last - j % n, 1] - strobes[last - j - n, 1])
            if not (dx <= tolerance and tuning * dv <= tolerance):
                same = False
                break
        if same:
            return n
    return 0
