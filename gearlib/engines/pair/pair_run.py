"""Runs of a gear pair: mesh periods without a record, which are faster, then recorded periods.

One call can also run many tunings or many initial states, or fill Poincare sections.
"""

import math

import numpy as np

from gearlib.engines import orbit
from gearlib.engines.codes import EVENT_LIMIT, OK, OVERFLOW
from gearlib.engines.jit import inlined_kernel, kernel
from gearlib.engines.matrices import copy
from gearlib.engines.orbit import is_within_range
from gearlib.engines.pair import sampling, settling
from gearlib.engines.pair.events import ARC_COLUMNS, START
from gearlib.engines.pair.motion import contact_of, mesh_at_tuning
from gearlib.engines.pair.whole_periods import (
    FLIGHT_DURATION,
    IMPACT_SPEED,
    REMAINING,
    START_SPEED,
    STORED_PERIODS,
    advance_periods,
    new_work,
    set_mesh,
    set_start,
)

#: Number of rows of a new arc table.
FIRST_ARC_ROWS = 32
#: Number of mesh periods between checks whether a run has settled; it doubles after a failed proof.
_CHECK_INTERVAL = 8
#: Largest distance from an orbit, as a fraction of the state, at which only one repeat is recorded.
_ORBIT_DISTANCE = 1e-13
#: Largest distance D from its orbit of a motion whose period is proven after the run, distance at
#: which states count as equal, and largest D of a motion without events, too small to be visible.
_END_DISTANCE, _SAME_STATE, _VISIBLE_DISTANCE = 1e-6, 1e-5, 1e-3


@kernel
def period_status(x, v, arc_count, max_arcs):
    """Return the status of a run after a mesh period: OK, EVENT_LIMIT or OVERFLOW.

    x and v are displacement and velocity at its end. EVENT_LIMIT means that it had more than
    `max_arcs` arcs (parts of the motion between two events); `arc_count` is its number of arcs.
    """
    if arc_count > max_arcs:
        return EVENT_LIMIT
    return OK if is_within_range(x, v) else OVERFLOW


@inlined_kernel
def run_whole_period(mesh, work, n, contact, x, v, max_arcs, arcs):
    """Run through mesh period n and keep all its arcs, the parts of the motion between two events.

    The motion starts with the contact code `contact` (1, 0, -1), displacement x and velocity v. The
    arc table `arcs`, shape (k, 6), is enlarged if needed, up to `max_arcs` rows. `mesh` holds the
    `PairConstants`, and `work` is storage prepared for them. Returns (contact code, x, v, number of
    arcs, arc table) at the end of the period.
    """
    memory, start = work.memory, (contact, x, v)
    # A free flight in progress at the start is kept in case the period has to be run again.
    remaining, duration = memory[REMAINING], memory[FLIGHT_DURATION]
    start_speed, impact_speed = memory[START_SPEED], memory[IMPACT_SPEED]
    contact, x, v, count = advance_periods(
        mesh, work, n, contact, x, v, np.int64(1), max_arcs, arcs
    )
    # The table was too small, so that the period is run once more from the same start.
    if arcs.shape[0] < count <= max_arcs:
        arcs = np.empty((2 * count, ARC_COLUMNS))
        memory[REMAINING], memory[FLIGHT_DURATION] = remaining, duration
        memory[START_SPEED], memory[IMPACT_SPEED] = start_speed, impact_speed
        contact, x, v, count = advance_periods(mesh, work, n, *start, np.int64(1), max_arcs, arcs)
    return contact, x, v, count, arcs


@kernel
def run_unrecorded(mesh, work, contact, x, v, periods, max_arcs):
    """Run through a number of mesh `periods` from mesh phase 0 without a record.

    The motion starts with the contact code `contact` (1, 0, -1), displacement x and velocity v; a
    period has at most `max_arcs` arcs (parts between two events). Once the motion has provably
    settled on a periodic orbit, the linearised map replaces the remaining periods. `mesh` holds the
    `PairConstants`, and `work` is storage prepared for them. Returns (contact code, x, v, status,
    repeat, is_on_orbit): `repeat` is the period of the settled orbit or 0, and `is_on_orbit` says
    whether the distance from the orbit is below rounding.
    """
    n, next_check, check_interval = np.int64(0), 2 * _CHECK_INTERVAL, _CHECK_INTERVAL
    settled, is_on_orbit = settling.unsettled(), False
    no_arcs = np.empty((0, ARC_COLUMNS))
    while n < periods:
        step = min(_CHECK_INTERVAL - n % _CHECK_INTERVAL, periods - n)
        contact, x, v, count = advance_periods(
            mesh, work, n, contact, x, v, step, max_arcs, no_arcs
        )
        n += step
        status = period_status(x, v, count, max_arcs)
        if status != OK:
            return contact, x, v, status, 0, False
        if settled.repeat > 0 or n < next_check:
            continue
        # If stored states repeat, a proof is tried, which itself takes `repeat` periods.
        repeat = settling.repeat_period(mesh, work, n, settling.MAX_DISTANCE)
        if repeat == 0 or periods - n < repeat:
            continue
        contact, x, v, count, settled = settling.prove_settled(
            mesh, work, n, contact, x, v, repeat, max_arcs, settling.MAX_DISTANCE
        )
        n += repeat
        status = period_status(x, v, count, max_arcs)
        if status != OK:
            return contact, x, v, status, 0, False
        # Proofs cost time, so that their intervals grow.
        next_check, check_interval = n + check_interval, 2 * check_interval
        if settled.repeat > 0:
            # All but the last repeats are skipped by the linearised map.
            k = max(0, (periods - n) // repeat - 1)
            offset_x, offset_v = settling.offset_after_repeats(settled, k)
            if k > 0:
                x, v = x - settled.x + offset_x, v - settled.v + offset_v
                contact = contact_of(mesh.backlash_ratio, x, v)
                work.memory[REMAINING] = -1.0
                n += k * repeat
            state_size = max(1.0, abs(x), mesh.tuning * abs(v))
            distance = max(abs(offset_x), mesh.tuning * abs(offset_v))
            is_on_orbit = distance <= _ORBIT_DISTANCE * state_size
    return contact, x, v, OK, settled.repeat, is_on_orbit


@kernel
def run(mesh, x, v, periods, record_periods, samples, events, max_arcs, summary):
    """Run a gear pair from displacement x and velocity v at mesh phase 0; record its last periods.

    x is in static deflections, v is its derivative by mesh phase, and `mesh` holds the
    `PairConstants`. The last `record_periods` of the mesh `periods` are recorded: `samples`, shape
    (record_periods * n, 6), receive n equal steps per period, where n may be 0; the event table
    `events`, shape (k, 5), is enlarged as needed unless k = 0; `summary` receives extrema and
    contact times. A period has at most `max_arcs` arcs, parts of the motion between two events.

    Returns (x, v, period, events, event count, status): the final state, the proven period of the
    orbit in mesh periods or 0, the event table with its number of events, and OK, EVENT_LIMIT or
    OVERFLOW.
    """
    work = new_work()
    set_mesh(work, mesh)
    return run_with_storage(
        mesh, work, x, v, periods, record_periods, samples, events, max_arcs, summary
    )


@kernel
def run_with_storage(mesh, work, x, v, periods, record_periods, samples, events, max_arcs, summary):
    """Run a gear pair as `run` does, with storage `work` that `set_mesh` has prepared.

    `mesh` holds the `PairConstants`; x and v are displacement and velocity at mesh phase 0. The
    last `record_periods` of all `periods` are recorded in `samples`, `events` and `summary`;
    `max_arcs` is the largest number of arcs (parts between two events) of a period. Returns (x, v,
    period of the orbit or 0, event table, number of events, status).
    """
    if not is_within_range(x, v):
        return x, v, 0, events, 0, OVERFLOW
    contact = contact_of(mesh.backlash_ratio, x, v)
    set_start(work, x, v)
    first_recorded = periods - record_periods
    contact, x, v, status, repeat, is_on_orbit = run_unrecorded(
        mesh, work, contact, x, v, first_recorded, max_arcs
    )
    if status != OK:
        return x, v, 0, events, 0, status
    orbit.clear_summary(summary)
    samples_per_period = samples.shape[0] // record_periods
    # On a settled orbit, one repeat is computed and recorded, then copied.
    computed_periods = repeat if is_on_orbit and record_periods % repeat == 0 else record_periods
    event_rows = 0
    arcs = np.empty((FIRST_ARC_ROWS, ARC_COLUMNS))
    previous_code = contact
    for i in range(computed_periods):
        n = first_recorded + i
        contact, x, v, arc_count, arcs = run_whole_period(
            mesh, work, n, contact, x, v, max_arcs, arcs
        )
        status = period_status(x, v, arc_count, max_arcs)
        if status != OK:
            return x, v, 0, events, 0, status
        sampling.add_arcs_to_summary(mesh, arcs, arc_count, summary)
        events, event_rows, previous_code = sampling.record_events(
            arcs, arc_count, previous_code, n, events, event_rows, summary
        )
        if samples_per_period > 0:
            period_samples = samples[i * samples_per_period : (i + 1) * samples_per_period]
            orbit.fill_sample_phases(period_samples, orbit.SAMPLE_PHASE, 2.0 * math.pi)
            sampling.sample_arcs(mesh, arcs, arc_count, period_samples)
    for k in orbit.SUMS:
        summary[k] *= record_periods / computed_periods
    if computed_periods < record_periods:
        events, event_rows = orbit.repeat_record(
            samples, events, event_rows, computed_periods, record_periods
        )
    period = _period_of_stored_states(
        mesh, work, periods, first_recorded, first_recorded + computed_periods, repeat, summary
    )
    if repeat == 0:
        period = _proven_period(mesh, work, periods, contact, x, v, max_arcs, summary)
    return x, v, period, events, event_rows, OK


@kernel
def _proven_period(mesh, work, n, contact, x, v, max_arcs, summary):
    """Return the proven period of the orbit to which a motion converges, or 0 without a proof.

    After n mesh periods the motion has the contact code `contact` (1, 0, -1), displacement x and
    velocity v. The states that `work` stores may repeat in a transient as well, so that a proof is
    needed. `mesh` holds the `PairConstants`, `max_arcs` is the largest number of arcs (parts
    between two events) in a period, and `summary` holds extrema and contact times of the recorded
    periods.
    """
    period, tolerance = settling.repeat_period(mesh, work, n, _SAME_STATE), _END_DISTANCE
    if summary[orbit.TIME_NO_CONTACT] == 0.0 and summary[orbit.TIME_COAST] == 0.0:
        # Without contact loss the map of a period is linear and has a single orbit, so that a
        # distance is allowed that is too small for a loss of contact. Within a period, deviations
        # grow by less than a factor of 10.
        lowest = 0.1 * summary[orbit.X_MIN]
        period = 1
        tolerance = max(
            tolerance, min(_VISIBLE_DISTANCE, lowest) / max(1.0, abs(x), mesh.tuning * abs(v))
        )
    if period == 0:
        return 0
    _, _, _, _, settled = settling.prove_settled(
        mesh, work, n, contact, x, v, period, max_arcs, tolerance
    )
    return settled.repeat


@kernel
def _period_of_stored_states(mesh, work, periods, first_stored, last_stored, repeat, summary):
    """Return the period of an orbit, from a comparison of its states after each mesh period.

    `work` stores the states after the mesh periods `first_stored` to `last_stored` of a run of
    `periods`. If the run has settled on an orbit, `repeat` is its period, else 0; states that were
    not computed then equal stored states. `summary` gives the displacement range of the orbit,
    which scales the tolerance; `mesh` holds the `PairConstants`.
    """
    strobe_count = min(periods, orbit.STROBE_PERIODS)
    strobes = np.empty((strobe_count + 1, 2))
    for i in range(strobe_count + 1):
        n = periods - strobe_count + i
        # The number n of the period is shifted by whole repeats into the stored range.
        if repeat > 0 and n <= first_stored - repeat:
            n += (first_stored - n) // repeat * repeat
        if n > last_stored:
            n -= (n - last_stored + repeat - 1) // repeat * repeat
        copy(work.states[n % STORED_PERIODS], strobes[i])
    displacement_range = summary[orbit.X_MAX] - summary[orbit.X_MIN]
    return orbit.orbit_period(strobes, mesh.tuning, displacement_range)


@kernel
def run_many(
    pair_parameters, tunings, order, state, warm_start, span, max_x, summaries, ends, outcomes
):
    """Run a gear pair at the tunings ``tunings[order]`` and fill a row of each table per tuning.

    A tuning is mesh frequency over natural frequency; `mesh_at_tuning` takes it with the seven
    ratios `pair_parameters`. A run lasts a `Span` of mesh periods and starts from `state`, shape
    (2,), or, with `warm_start`, from the end of the previous run unless that failed. A displacement
    beyond `max_x` gives the status OVERFLOW. The tables have a row for each tuning: `summaries`,
    the final states `ends`, (n, 2), and `outcomes`, int, (n, 2), with period and status. A failed
    run leaves NaN in `summaries` and `ends`.
    """
    samples = np.empty((0, orbit.SAMPLE_COLUMNS))
    events = np.empty((0, orbit.EVENT_COLUMNS))
    work = new_work()
    x, v = state[0], state[1]
    for i in order:
        mesh = mesh_at_tuning(pair_parameters, tunings[i])
        set_mesh(work, mesh)
        arguments = samples, events, span.max_events, summaries[i]
        x, v, period, _, _, status = run_with_storage(
            mesh, work, x, v, span.periods, span.recorded, *arguments
        )
        if status == OK and max(summaries[i, orbit.X_MAX], -summaries[i, orbit.X_MIN]) > max_x:
            status = OVERFLOW
        if status != OK:
            summaries[i, :] = math.nan
            ends[i, :] = math.nan
        else:
            ends[i, 0], ends[i, 1] = x, v
        if status != OK or not warm_start:
            x, v = state[0], state[1]
        outcomes[i, 0], outcomes[i, 1] = period, status


@kernel
def run_many_states(mesh, states, periods, max_arcs, ends, statuses):
    """Run a gear pair through a number of mesh `periods` from each of many `states`, shape (k, 2).

    A state is displacement and velocity at mesh phase 0; `mesh` holds the `PairConstants`. The
    final states go to `ends`, shape (k, 2), the statuses to `statuses`, shape (k,). A period with
    more than `max_arcs` arcs, parts of the motion between two events, ends a run.
    """
    work = new_work()
    set_mesh(work, mesh)
    for i in range(states.shape[0]):
        x, v = states[i, 0], states[i, 1]
        status = OVERFLOW
        if is_within_range(x, v):
            set_start(work, x, v)
            _, x, v, status, _, _ = run_unrecorded(
                mesh, work, contact_of(mesh.backlash_ratio, x, v), x, v, periods, max_arcs
            )
        ends[i, 0], ends[i, 1], statuses[i] = x, v, status


@kernel
def fill_sections(mesh, states, settle_periods, phase, max_arcs, table, ends, statuses):
    """Fill `table` with the states (x, v) of n motions at one phase of each mesh period.

    `table` has the shape (n, periods, 2), and `mesh` holds the `PairConstants`. The motions start
    from `states`, shape (n, 2), at mesh phase 0, and `settle_periods` mesh periods pass before the
    first entry. `phase` lies in [0, 2 pi). The final states go to `ends`, shape (n, 2), the
    statuses to `statuses`, shape (n,). A period with more than `max_arcs` arcs (parts between two
    events) ends a motion, and its later entries stay unchanged.
    """
    work, arcs = new_work(), np.empty((16, ARC_COLUMNS))
    set_mesh(work, mesh)
    for j in range(states.shape[0]):
        x, v, status = states[j, 0], states[j, 1], OVERFLOW
        if is_within_range(x, v):
            set_start(work, x, v)
            contact = contact_of(mesh.backlash_ratio, x, v)
            contact, x, v, status, _, _ = run_unrecorded(
                mesh, work, contact, x, v, settle_periods, max_arcs
            )
            for period in range(table.shape[1]):
                if status != OK:
                    break
                contact, x, v, arc_count, arcs = run_whole_period(
                    mesh, work, settle_periods + period, contact, x, v, max_arcs, arcs
                )
                status = period_status(x, v, arc_count, max_arcs)
                if status == EVENT_LIMIT:
                    break
                # The state at the phase lies in the last arc that starts before it.
                i = 0
                while i + 1 < arc_count and arcs[i + 1, START] <= phase:
                    i += 1
                table[j, period, 0], table[j, period, 1], _, _ = sampling.state_in_arc(
                    mesh, arcs[i], phase
                )
        ends[j, 0], ends[j, 1], statuses[j] = x, v, status
