"""A whole run: its periods gone through fast, those at its end recorded."""

import math

import numpy as np

from gearlib.engines import orbit
from gearlib.engines.codes import EVENT_LIMIT, OK, OVERFLOW
from gearlib.engines.copies import copy
from gearlib.engines.jit import inlined, kernel
from gearlib.engines.overflow import within_range
from gearlib.engines.pair import recorded_arcs
from gearlib.engines.pair.events import ARC_COLUMNS
from gearlib.engines.pair.motion import contact_of
from gearlib.engines.pair.settling import (
    NEAR,
    after_repeats,
    check_settled,
    not_settled,
    repeat_of,
)
from gearlib.engines.pair.whole_periods import (
    AHEAD,
    KEPT,
    advance,
    new_work,
    set_mesh,
    set_start,
)

FIRST_ARCS = 32
#: Periods between two looks at whether a run has settled; after each attempt to prove it twice as
#: many pass as after the one before.
_LOOK = 8
#: An orbit that a run follows as closely as this is recorded over one repeat of its own.
_ON_ORBIT = 1e-13
#: A run of which no more than its end is asked has settled this close to its orbit, where states
#: this close to each other are one: an orbit with two such points hardly contracts. Without an
#: event it may be as far off as is not seen in a figure. Shares of the state.
_CLOSE, _SAME, _SEEN = 1e-6, 1e-5, 1e-3


@kernel
def outcome(x, v, count, limit):
    """Return the status of a run that ended in (x, v) after `count` arcs of a period."""
    if count > limit:
        return EVENT_LIMIT
    return OK if within_range(x, v) else OVERFLOW


@inlined
def whole_period(m, work, n, contact, x, v, limit, arcs):
    """Go through mesh period n and keep all its arcs; return as `advance`, and the arc table."""
    memory, before = work.memory, (contact, x, v)
    flight = memory[0], memory[1], memory[2], memory[3]
    contact, x, v, count = advance(m, work, n, contact, x, v, np.int64(1), limit, arcs)
    if arcs.shape[0] < count <= limit:
        arcs = np.empty((2 * count, ARC_COLUMNS))
        memory[0], memory[1], memory[2], memory[3] = flight
        contact, x, v, count = advance(m, work, n, *before, np.int64(1), limit, arcs)
    return contact, x, v, count, arcs


@kernel
def skip(m, work, contact, x, v, periods, limit):
    """Go through `periods` mesh periods from tau = 0, unrecorded; `limit` arcs in each.

    Returns (contact, x, v, status, repeat, on_orbit): `repeat`, the periods after which the orbit
    repeats if the run has settled, else 0; of a run that has, at least the last `repeat` periods
    have been gone through. `on_orbit`: whether it is at rest on it but for rounding.
    """
    n, look, pause = np.int64(0), 2 * _LOOK, _LOOK
    settled, on_orbit = not_settled(), False
    no_arcs = np.empty((0, ARC_COLUMNS))
    while n < periods:
        some = min(_LOOK - n % _LOOK, periods - n)
        contact, x, v, count = advance(m, work, n, contact, x, v, some, limit, no_arcs)
        n += some
        status = outcome(x, v, count, limit)
        if status != OK:
            return contact, x, v, status, 0, False
        if settled.repeat > 0 or n < look:
            continue
        repeat = repeat_of(m, work, n, NEAR)
        if repeat == 0 or periods - n < repeat:
            continue
        contact, x, v, count, settled = check_settled(
            m, work, n, contact, x, v, repeat, limit, NEAR
        )
        n += repeat
        status = outcome(x, v, count, limit)
        if status != OK:
            return contact, x, v, status, 0, False
        look, pause = n + pause, 2 * pause
        if settled.repeat > 0:
            k = max(0, (periods - n) // repeat - 1)
            far_x, far_v = after_repeats(settled, k)
            if k > 0:
                x, v = x - settled.x + far_x, v - settled.v + far_v
                contact = contact_of(m.gap, x, v)
                work.memory[AHEAD] = -1.0
                n += k * repeat
            size = max(1.0, abs(x), m.tuning * abs(v))
            on_orbit = max(abs(far_x), m.tuning * abs(far_v)) <= _ON_ORBIT * size
    return contact, x, v, OK, settled.repeat, on_orbit


@kernel
def run(m, x, v, periods, record_periods, samples, events, limit, summary):
    """Run one mesh from the state (x, v) at tau = 0, in static deflections and dx/dtau.

    The last `record_periods` of its `periods` are recorded: `samples`, shape (record_periods * n,
    6), are filled with n equal steps a period, n = 0 for none; `events`, shape (k, 5), enlarged as
    needed, k = 0 for none; `summary`, shape (9,). A period has `limit` arcs at most.

    Returns (x, v, period, events, found, status): the state at the end, the period in mesh periods
    of the orbit on which the run has settled by proof (0: it has not), the table and its rows in
    use, OK, EVENT_LIMIT or OVERFLOW.
    """
    work = new_work()
    set_mesh(work, m)
    return run_at(m, work, x, v, periods, record_periods, samples, events, limit, summary)


@kernel
def run_at(m, work, x, v, periods, record_periods, samples, events, limit, summary):
    """The same as `run` with a work that is at hand."""
    if not within_range(x, v):
        return x, v, 0, events, 0, OVERFLOW
    contact = contact_of(m.gap, x, v)
    set_start(work, x, v)
    unseen = periods - record_periods
    contact, x, v, status, repeat, on_orbit = skip(m, work, contact, x, v, unseen, limit)
    if status != OK:
        return x, v, 0, events, 0, status
    orbit.clear_summary(summary)
    want_events = events.shape[0] > 0
    per_period = samples.shape[0] // record_periods
    # Of a settled orbit one repeat is gone through.
    seen = repeat if on_orbit and record_periods % repeat == 0 else record_periods
    found = 0
    arcs = np.empty((FIRST_ARCS, ARC_COLUMNS))
    previous = contact
    for i in range(seen):
        n = unseen + i
        contact, x, v, count, arcs = whole_period(m, work, n, contact, x, v, limit, arcs)
        status = outcome(x, v, count, limit)
        if status != OK:
            return x, v, 0, events, 0, status
        recorded_arcs.add_arcs(m, arcs, count, summary)
        bounces, last = recorded_arcs.count_bounces(arcs, count, previous)
        summary[orbit.BOUNCES] += bounces
        if want_events:
            events, found, _ = recorded_arcs.add_events(arcs, count, previous, n, events, found)
        if per_period > 0:
            rows = samples[i * per_period : (i + 1) * per_period]
            orbit.equal_steps(rows, orbit.SAMPLE_AT, 2.0 * math.pi)
            recorded_arcs.sample_arcs(m, arcs, count, rows)
        previous = last
    for k in range(orbit.TIME_NORMAL, orbit.SUMMARY_COLUMNS):
        summary[k] *= record_periods / seen
    if seen < record_periods:
        events, found = orbit.repeat_record(samples, events, found, seen, record_periods)
    period = _period(m, work, periods, unseen, unseen + seen, repeat, summary)
    if repeat == 0:
        period = _proven(m, work, periods, contact, x, v, limit, summary)
    return x, v, period, events, found, OK


@kernel
def _proven(m, work, n, contact, x, v, limit, summary):
    """Return the period of the orbit on which the motion settles from its state after n periods.

    States that repeat may be those of a transient: 0 where nothing is proven.
    """
    period, near = repeat_of(m, work, n, _SAME), _CLOSE
    if summary[orbit.TIME_BACKLASH] == 0.0 and summary[orbit.TIME_INVERSE] == 0.0:
        # The map is linear as long as contact is kept, and has but one orbit; within a period
        # deviations grow by less than the factor of which this is the inverse.
        lowest = 0.1 * summary[orbit.X_MIN]
        period, near = 1, max(near, min(_SEEN, lowest) / max(1.0, abs(x), m.tuning * abs(v)))
    if period == 0:
        return 0
    _, _, _, _, settled = check_settled(m, work, n, contact, x, v, period, limit, near)
    return settled.repeat


@kernel
def _period(m, work, periods, unseen, end, repeat, summary):
    """Return the period of an orbit from its states up to that after period `end`.

    Of a settled run those before its recorded periods and after `end` are repeats of them.
    """
    kept = min(periods, orbit.STROBE_PERIODS)
    strobes = np.empty((kept + 1, 2))
    for i in range(kept + 1):
        n = periods - kept + i
        if repeat > 0 and n <= unseen - repeat:
            n += (unseen - n) // repeat * repeat
        if n > end:
            n -= (n - end + repeat - 1) // repeat * repeat
        copy(work.states[n % KEPT], strobes[i])
    height = summary[orbit.X_MAX] - summary[orbit.X_MIN]
    return orbit.orbit_period(strobes, m.tuning, height)
