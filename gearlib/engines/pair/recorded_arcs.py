"""What is recorded of a period, read off its arcs: extrema, times in contact, samples, events."""

import math

from gearlib.engines.codes import BACKLASH, INVERSE, NORMAL
from gearlib.engines.jit import inlined, kernel
from gearlib.engines.orbit import (
    FORCE_MAX,
    FORCE_MIN,
    SAMPLE_A,
    SAMPLE_AT,
    SAMPLE_CONTACT,
    SAMPLE_FORCE,
    SAMPLE_STIFFNESS,
    SAMPLE_V,
    SAMPLE_X,
    TIME_BACKLASH,
    TIME_INVERSE,
    TIME_LOW,
    TIME_NORMAL,
    X_MAX,
    X_MIN,
    add_event,
)
from gearlib.engines.pair.events import (
    CONTACT,
    DISPLACEMENT,
    DURATION,
    LEVEL,
    START,
    VELOCITY,
)
from gearlib.engines.pair.motion import UNDERDAMPED, evolve, fly, lowest_time, turning_time


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
        shift = lev.equilibrium if contact == NORMAL else lev.equilibrium - m.gap
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
    shift = lev.equilibrium if contact == NORMAL else lev.equilibrium - m.gap
    u, v = evolve(lev, x - shift, v, t)
    return u + shift, v, -2.0 * lev.a * v - lev.square * u, lev.stiffness * (u + lev.equilibrium)


@kernel
def sample_arcs(m, arcs, count, samples):
    """Fill `samples`, shape (n, 6), with the states at the phases in their column `SAMPLE_AT`.

    At an event or a stiffness switch the state just after it is taken.
    """
    i = 0
    for k in range(samples.shape[0]):
        t = samples[k, SAMPLE_AT]
        while i + 1 < count and arcs[i + 1, START] <= t:
            i += 1
        x, v, acceleration, force = in_arc(m, arcs[i], t)
        samples[k, SAMPLE_X] = x
        samples[k, SAMPLE_V] = v
        samples[k, SAMPLE_A] = acceleration
        samples[k, SAMPLE_CONTACT] = arcs[i, CONTACT]
        samples[k, SAMPLE_STIFFNESS] = (m.high if arcs[i, LEVEL] == 1.0 else m.low).stiffness
        samples[k, SAMPLE_FORCE] = force
