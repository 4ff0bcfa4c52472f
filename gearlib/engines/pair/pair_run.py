"""A whole run: fast periods without a record, then recorded periods."""

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
    MAX_DISTANCE,
    after_repeats,
    check_settled,
    not_settled,
    repeat_of,
)
from gearlib.engines.pair.whole_periods import (
    REMAINING,
    STORED_PERIODS,
    advance,
    new_work,
    set_mesh,
    set_start,
)

#: Number of rows of a new arc table.
FIRST_ARC_ROWS = 32
#: Number of periods between checks whether a run has settled; it doubles after each failed proof.
_CHECK_INTERVAL = 8
#: Largest distance from an orbit of which a single repeat is recorded, as a share of the state.
_ORBIT_DISTANCE = 1e-13
#: Largest distance D of a motion whose period is proven after its run, distance at which states
#: count as equal, and largest D of a motion without events, which no figure would show.
_END_DISTANCE, _SAME_STATE, _VISIBLE_DISTANCE = 1e-6, 1e-5, 1e-3


@kernel
def outcome(x, v, count, limit):
    """Return the status of a run after a mesh period: OK, EVENT_LIMIT or OVERFLOW.

    x and v are displacement and velocity at its end, `count` is the number of its arcs, at most
    `limit`.
    """
    if count > limit:
        return EVENT_LIMIT
    return OK if within_range(x, v) else OVERFLOW


@inlined
def whole_period(mesh, work, n, contact, x, v, limit, arcs):
    """Run through mesh period n of a `Mesh` and keep all its arcs, in a table enlarged as needed.

    The motion starts with a contact code, displacement x and velocity v. `work` is storage prepared
    for the mesh, `limit` the largest number of arcs, `arcs`, shape (k, 6), an arc table. Returns
    (contact code, x, v, number of arcs, arc table) at the end of the period.
    """
    memory, start = work.memory, (contact, x, v)
    flight = memory[0], memory[1], memory[2], memory[3]
    contact, x, v, count = advance(mesh, work, n, contact, x, v, np.int64(1), limit, arcs)
    if arcs.shape[0] < count <= limit:
        arcs = np.empty((2 * count, ARC_COLUMNS))
        memory[0], memory[1], memory[2], memory[3] = flight
        contact, x, v, count = advance(mesh, work, n, *start, np.int64(1), limit, arcs)
    return contact, x, v, count, arcs


@kernel
def skip(mesh, work, contact, x, v, periods, limit):
    """Run through mesh periods from tau = 0 without a record, at most `limit` arcs in each.

    The motion starts with a contact code, displacement x and velocity v; `work` is storage prepared
    for the `Mesh`. Once it has settled, remaining periods are replaced by the linearised map.
    Returns (contact code, x, v, status, repeat, on_orbit): `repeat` is the period of the settled
    orbit or 0, `on_orbit` whether the distance from the orbit is rounding.
    """
    n, next_check, pause = np.int64(0), 2 * _CHECK_INTERVAL, _CHECK_INTERVAL
    settled, on_orbit = not_settled(), False
    no_arcs = np.empty((0, ARC_COLUMNS))
    while n < periods:
        step = min(_CHECK_INTERVAL - n % _CHECK_INTERVAL, periods - n)
        contact, x, v, count = advance(mesh, work, n, contact, x, v, step, limit, no_arcs)
        n += step
        status = outcome(x, v, count, limit)
        if status != OK:
            return contact, x, v, status, 0, False
        if settled.repeat > 0 or n < next_check:
            continue
        repeat = repeat_of(mesh, work, n, MAX_DISTANCE)
        if repeat == 0 or periods - n < repeat:
            continue
        contact, x, v, count, settled = check_settled(
            mesh, work, n, contact, x, v, repeat, limit, MAX_DISTANCE
        )
        n += repeat
        status = outcome(x, v, count, limit)
        if status != OK:
            return contact, x, v, status, 0, False
        next_check, pause = n + pause, 2 * pause
        if settled.repeat > 0:
            k = max(0, (periods - n) // repeat - 1)
            far_x, far_v = after_repeats(settled, k)
            if k > 0:
                x, v = x - settled.x + far_x, v - settled.v + far_v
                contact = contact_of(mesh.gap, x, v)
                work.memory[REMAINING] = -1.0
                n += k * repeat
            size = max(1.0, abs(x), mesh.tuning * abs(v))
            on_orbit = max(abs(far_x), mesh.tuning * abs(far_v)) <= _ORBIT_DISTANCE * size
    return contact, x, v, OK, settled.repeat, on_orbit


@kernel
def run(mesh, x, v, periods, record_periods, samples, events, limit, summary):
    """Run a `Mesh` from displacement x, in static deflections, and velocity v = dx/dtau at tau = 0.

    The last `record_periods` of its `periods` are recorded. `samples`, shape (record_periods * n,
    6), receive n equal steps per period, n may be 0; `events`, shape (k, 5), are enlarged as needed
    unless k = 0; `summary`, shape (9,), is filled. A period has at most `limit` arcs.

    Returns (x, v, period, events, rows, status): the last state, the proven period of the orbit in
    mesh periods or 0, the event table and its rows in use, OK, EVENT_LIMIT or OVERFLOW.
    """
    work = new_work()
    set_mesh(work, mesh)
    return run_at(mesh, work, x, v, periods, record_periods, samples, events, limit, summary)


@kernel
def run_at(mesh, work, x, v, periods, record_periods, samples, events, limit, summary):
    """Run a `Mesh` as `run` does, with storage `work` prepared by `set_mesh`.

    x and v are displacement and velocity at tau = 0. `samples`, `events` and `summary` receive the
    record of the last `record_periods`; `limit` is the largest number of arcs of a period. Returns
    (x, v, period of the orbit or 0, event table, its rows in use, status).
    """
    if not within_range(x, v):
        return x, v, 0, events, 0, OVERFLOW
    contact = contact_of(mesh.gap, x, v)
    set_start(work, x, v)
    unrecorded = periods - record_periods
    contact, x, v, status, repeat, on_orbit = skip(mesh, work, contact, x, v, unrecorded, limit)
    if status != OK:
        return x, v, 0, events, 0, status
    orbit.clear_summary(summary)
    want_events = events.shape[0] > 0
    per_period = samples.shape[0] // record_periods
    # A settled orbit is computed over one repeat only.
    computed = repeat if on_orbit and record_periods % repeat == 0 else record_periods
    event_rows = 0
    arcs = np.empty((FIRST_ARC_ROWS, ARC_COLUMNS))
    previous = contact
    for i in range(computed):
        n = unrecorded + i
        contact, x, v, count, arcs = whole_period(mesh, work, n, contact, x, v, limit, arcs)
        status = outcome(x, v, count, limit)
        if status != OK:
            return x, v, 0, events, 0, status
        recorded_arcs.add_arcs(mesh, arcs, count, summary)
        bounces, last = recorded_arcs.count_bounces(arcs, count, previous)
        summary[orbit.BOUNCES] += bounces
        if want_events:
            events, event_rows, _ = recorded_arcs.add_events(
                arcs, count, previous, n, events, event_rows
            )
        if per_period > 0:
            period_samples = samples[i * per_period : (i + 1) * per_period]
            orbit.fill_sample_phases(period_samples, orbit.SAMPLE_PHASE, 2.0 * math.pi)
            recorded_arcs.sample_arcs(mesh, arcs, count, period_samples)
        previous = last
    for k in range(orbit.TIME_NORMAL, orbit.SUMMARY_COLUMNS):
        summary[k] *= record_periods / computed
    if computed < record_periods:
        events, event_rows = orbit.repeat_record(
            samples, events, event_rows, computed, record_periods
        )
    period = _recorded_period(
        mesh, work, periods, unrecorded, unrecorded + computed, repeat, summary
    )
    if repeat == 0:
        period = _proven_period(mesh, work, periods, contact, x, v, limit, summary)
    return x, v, period, events, event_rows, OK


@kernel
def _proven_period(mesh, work, n, contact, x, v, limit, summary):
    """Return the proven period of the orbit to which a motion converges after n periods, or 0.

    After n periods it has a contact code, displacement x and velocity v. Stored states in `work`
    may repeat in a transient as well, so that a proof is needed. `limit` is the largest number of
    arcs of a period; `summary`, shape (9,), describes the recorded periods.
    """
    period, tolerance = repeat_of(mesh, work, n, _SAME_STATE), _END_DISTANCE
    if summary[orbit.TIME_BACKLASH] == 0.0 and summary[orbit.TIME_INVERSE] == 0.0:
        # Without loss of contact the map is linear and has one orbit; within a period deviations
        # grow by a factor of less than 10.
        lowest = 0.1 * summary[orbit.X_MIN]
        period = 1
        tolerance = max(
            tolerance, min(_VISIBLE_DISTANCE, lowest) / max(1.0, abs(x), mesh.tuning * abs(v))
        )
    if period == 0:
        return 0
    _, _, _, _, settled = check_settled(mesh, work, n, contact, x, v, period, limit, tolerance)
    return settled.repeat


@kernel
def _recorded_period(mesh, work, periods, unrecorded, end, repeat, summary):
    """Return the period of an orbit by comparison of its states after each mesh period.

    `work` stores the states after periods `unrecorded` to `end` of a run of `periods`. If the run
    has settled, its period is `repeat` (else 0) and other states are repetitions of stored states.
    `summary`, shape (9,), gives the height of the orbit.
    """
    strobe_count = min(periods, orbit.STROBE_PERIODS)
    strobes = np.empty((strobe_count + 1, 2))
    for i in range(strobe_count + 1):
        n = periods - strobe_count + i
        if repeat > 0 and n <= unrecorded - repeat:
            n += (unrecorded - n) // repeat * repeat
        if n > end:
            n -= (n - end + repeat - 1) // repeat * repeat
        copy(work.states[n % STORED_PERIODS], strobes[i])
    height = summary[orbit.X_MAX] - summary[orbit.X_MIN]
    return orbit.orbit_period(strobes, mesh.tuning, height)
