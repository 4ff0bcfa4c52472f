"""One mesh period of a gear train, from contact event to contact event.

The modes of the present combination of contacts advance the state to the next stiffness switch or
to the next crossing of a flank line by any mesh. Crossings of several meshes that coincide within
rounding count as simultaneous. Their saltation matrices commute, so that the order does not matter
(`docs/theory/trains.md`).
"""

from gearlib.engines import orbit
from gearlib.engines.codes import BOTH, DRIVE, EVENT_LIMIT, JAMMED, OK, UNRESOLVED
from gearlib.engines.jit import kernel_part
from gearlib.engines.linear.distances import (
    fill_amplitudes,
    find_first_events,
    stays_clear_of_lines,
)
from gearlib.engines.linear.modal_arcs import (
    advance_modes,
    apply_stored_matrix,
    fill_mode_factors,
    find_segment_factors,
    find_slot,
)
from gearlib.engines.linear.sampling import sample_motion
from gearlib.engines.linear.sparse_series import (
    SERIES,
    advance_by_series,
    fill_distance_series,
    fill_taylor_series,
    sum_series,
)
from gearlib.engines.linear.train_system import (
    EVENT_ROWS,
    FIRST_EVENT_ROW,
    PERIOD_EVENTS,
    SAMPLES_TAKEN,
    SEGMENT,
    dot,
)

#: Largest time between simultaneous crossings, as a fraction of an interval of the distance
#: polynomials. It is needed near grazing, where the rounding error of an instant is unbounded.
_MAX_SIMULTANEOUS_STEP = 1e-13
#: Rounding error of the states of equal meshes, as a multiple of the rounding error of a distance.
_STATE_ROUNDING = 8.0
#: Requests to the caller in place of a status: the mode tables lack the combination
#: `RunState.force_indices`, the event table is full, the system has no further segments.
COMBINATION_MISSING, EVENTS_FULL, SEGMENTS_MISSING = -1, -2, -3

#: The event table has the columns of `orbit`, followed by the index of the mesh.
EVENT_MESH = orbit.EVENT_COLUMNS
EVENT_COLUMNS = orbit.EVENT_COLUMNS + 1


@kernel_part(refcounts=False, inlined=True)
def _cross_flank_line(system, constants, run, j, segment, perturbations):
    """Change the contact state of mesh j, which has reached a flank line, in `run`.

    The flank line is the displacement at which the flanks just touch. Small perturbations of the
    state, the rows of `perturbations`, shape (k, n or more), are multiplied by the saltation
    matrix. `segment` is the index of the present stiffness segment in the `TrainSystem` `system`.
    `constants` (`RunConstants`) holds the row vectors of the rates of the flank distances.
    """
    n = system.drive_distance_rows.shape[1]
    # A crossing of the drive-side line starts or ends drive-side contact.
    line = 1 if DRIVE in (run.contact[j], run.contact_after[j]) else -1
    run.start_line[j] = line
    if perturbations.shape[0] > 0:
        velocity_rows = (
            constants.drive_velocity_rows if line == 1 else constants.coast_velocity_rows
        )
        distance_rows = system.drive_distance_rows if line == 1 else system.coast_distance_rows
        speed = 0.0
        for r in range(n):
            speed += velocity_rows[j, r] * run.state[r]
        force_index_before = system.force_index[run.contact[j] + 1, segment, j]
        force_index_after = system.force_index[run.contact_after[j] + 1, segment, j]
        for r in range(n):
            run.term[r] = 0.0
        # The mesh force and the friction of the mesh make dz/dtheta jump.
        for k in range(2):
            force_after, force_before = 0.0, 0.0
            for r in range(n):
                force_after += system.force_output[j, force_index_after, k, r] * run.state[r]
                force_before += system.force_output[j, force_index_before, k, r] * run.state[r]
            for r in range(n):
                run.term[r] += (
                    system.force_input[j, force_index_after, k, r] * force_after
                    - system.force_input[j, force_index_before, k, r] * force_before
                )
        # The saltation matrix of a tangential crossing is the identity, because no force jumps.
        for i in range(perturbations.shape[0] if speed != 0.0 else 0):
            # A perturbed motion reaches the line earlier by its distance over the speed.
            time_shift = 0.0
            for r in range(n):
                time_shift += distance_rows[j, r] * perturbations[i, r]
            time_shift /= speed
            for r in range(n):
                perturbations[i, r] += run.term[r] * time_shift
    # The mesh starts on the line with a simple zero of its distance.
    run.zero_order[j] = 1
    run.contact[j] = run.contact_after[j]


@kernel_part(refcounts=False)
def sort_last_event(events, row, first_row):
    """Move the last event of the event table up among events at the same phase, by mesh index.

    The event is in `row` and moves up to `first_row` at most, the first row of the mesh period. The
    order of simultaneous events then does not depend on the order in which they were found.
    `events` has the columns of `orbit` and EVENT_MESH.
    """
    while (
        row > first_row
        and events[row - 1, orbit.EVENT_PHASE] == events[row, orbit.EVENT_PHASE]
        and events[row - 1, EVENT_MESH] > events[row, EVENT_MESH]
    ):
        for k in range(EVENT_COLUMNS):
            events[row - 1, k], events[row, k] = events[row, k], events[row - 1, k]
        row -= 1


@kernel_part(refcounts=False, merged=True)
def run_period(
    system,
    constants,
    tables,
    run,
    mesh_period,
    max_events,
    perturbations,
    is_recorded,
    summary,
    samples,
    events,
):
    """Run through one mesh period from contact event to contact event; return a status.

    The state in `run` (`RunState`) and its small perturbations `perturbations`, shape (k,
    n or more), change in place. `mesh_period` is the index of the period in the excitation period;
    it has at most `max_events` events. If `is_recorded`, three tables are filled: `summary`, with a
    row per mesh, `samples`, see `sampling.sample_motion`, and `events`, shape (k, 6), unless k = 0.
    The status COMBINATION_MISSING requests the modes of ``run.force_indices`` in `tables`
    (`ModeTables`), EVENTS_FULL a larger event table; the next call continues from there.
    """
    (m, n), phase, interval = system.drive_distance_rows.shape, 0.0, 0.0
    first_segment = system.first_segment[mesh_period]
    end_segment = system.first_segment[mesh_period + 1]
    if run.counters[SEGMENT] < 0:
        run.counters[SEGMENT], run.counters[PERIOD_EVENTS] = first_segment, 0
        run.counters[FIRST_EVENT_ROW] = run.counters[EVENT_ROWS]
        run.counters[SAMPLES_TAKEN] = 0
        run.progress[0] = constants.lengths[first_segment]
        run.progress[1] = 0.0
        if constants.sample_starts.shape[0] == 0:
            orbit.fill_sample_phases(
                samples, n + m, system.starts[end_segment] - system.starts[first_segment]
            )
    while run.counters[SEGMENT] < end_segment:
        segment, combination, remaining = run.counters[SEGMENT], -1, run.progress[0]
        while remaining > 0.0:
            if combination < 0:
                for j in range(m):
                    run.force_indices[j] = system.force_index[run.contact[j] + 1, segment, j]
                    run.stays_clear[j] = False
                slot = find_slot(tables.hash_slots, tables.keys, run.force_indices)
                combination = tables.hash_slots[slot]
                if combination < 0 and tables.series_steps[slot] < tables.mode_cost[0]:
                    combination = SERIES
                events_are_full = is_recorded and 0 < events.shape[0] < run.counters[EVENT_ROWS] + m
                if combination == -1 or events_are_full:
                    run.progress[0] = remaining
                    return COMBINATION_MISSING if combination == -1 else EVENTS_FULL
                if combination == SERIES:
                    tables.series_steps[slot] += 1 + perturbations.shape[0]
                    interval = fill_taylor_series(
                        system, constants, run.force_indices, run.state, run.series
                    )
                    fill_distance_series(system, constants, run.series, run.distance_series)
                else:
                    interval = tables.interval_lengths[combination]
                    apply_stored_matrix(tables.to_modes, combination, run.state, run.modal_state)
            mode_count, all_stay_clear = 0, True
            if combination != SERIES:
                mode_count = fill_amplitudes(tables, combination, run.modal_state, run.amplitudes)
            for j in range(m):
                if not run.stays_clear[j]:
                    run.stays_clear[j] = run.zero_order[j] == 0 and stays_clear_of_lines(
                        tables, combination, j, constants, run, mode_count
                    )
                    all_stay_clear &= run.stays_clear[j]
            step = remaining
            if combination == SERIES or not all_stay_clear:
                step = min(interval, remaining)
            instant = 2.0
            if not all_stay_clear:
                instant = find_first_events(tables, combination, constants, run, step / interval)
                for j in range(m):
                    run.zero_order[j] = 0
                if instant < 0.0:
                    return UNRESOLVED
                if instant <= 1.0:
                    step = instant * interval
            if is_recorded:
                phase = system.starts[segment] - system.starts[first_segment]
                phase += (constants.lengths[segment] - remaining) * system.tuning
                sample_motion(
                    system,
                    tables,
                    combination,
                    run,
                    segment,
                    phase,
                    step,
                    interval,
                    summary,
                    samples,
                )
            remaining -= step
            if combination == SERIES:
                sum_series(run.series, n, step / interval, run.state)
                for i in range(perturbations.shape[0]):
                    advance_by_series(
                        system, constants, run.force_indices, step, perturbations[i], run.series
                    )
                if instant > 1.0 and remaining > 0.0:
                    # After many Taylor steps, modes may cost less, so the method is chosen again.
                    combination = -1
                    continue
            else:
                length_index, factors = constants.length_index[segment], run.mode_factors
                if (
                    step == constants.lengths[segment]
                    and 0 <= length_index < tables.segment_factor_rows.shape[1]
                ):
                    factors = tables.segment_factors[
                        find_segment_factors(tables, combination, length_index, step)
                    ]
                else:
                    fill_mode_factors(tables, combination, step, factors)
                advance_modes(
                    tables, combination, factors, step, run.modal_state, run.term, run.image
                )
                y = run.mode_buffer
                for i in range(perturbations.shape[0]):
                    apply_stored_matrix(tables.to_modes, combination, perturbations[i], y)
                    advance_modes(tables, combination, factors, step, y, run.term, run.image)
                    apply_stored_matrix(tables.from_modes, combination, y, perturbations[i])
                if instant > 1.0 and remaining > 0.0:
                    continue
                apply_stored_matrix(tables.from_modes, combination, run.modal_state, run.state)
            if instant > 1.0:
                break
            rounding = 0.0
            for j in range(m):
                if run.event_instant[j] == instant:
                    rounding = max(rounding, run.instant_rounding[j])
            for j in range(m):
                tolerance = min(
                    _STATE_ROUNDING * (rounding + run.instant_rounding[j]), _MAX_SIMULTANEOUS_STEP
                )
                if run.event_instant[j] > 1.0 or run.event_instant[j] - instant > tolerance:
                    continue
                if run.contact_after[j] == BOTH:
                    return JAMMED
                contact_before = run.contact[j]
                _cross_flank_line(system, constants, run, j, segment, perturbations)
                run.counters[PERIOD_EVENTS] += 1
                if is_recorded:
                    state = run.state[: constants.drive_velocity_rows.shape[1]]
                    velocity = dot(constants.drive_velocity_rows[j], state) / system.tuning
                    contact_after = run.contact[j]
                    orbit.count_event(contact_before, contact_after, velocity, summary[j])
                    if events.shape[0] > 0:
                        # Rounding of the sum must not put the event before the previous one.
                        run.progress[1] = max(phase + step * system.tuning, run.progress[1])
                        row, instant_phase = run.counters[EVENT_ROWS], run.progress[1]
                        orbit.fill_event(
                            events[row], 0, instant_phase, contact_before, contact_after, velocity
                        )
                        events[row, EVENT_MESH] = j
                        run.counters[EVENT_ROWS] = row + 1
                        sort_last_event(events, row, run.counters[FIRST_EVENT_ROW])
            if run.counters[PERIOD_EVENTS] > max_events:
                return EVENT_LIMIT
            combination = -1
        run.counters[SEGMENT] = segment + 1
        if segment + 1 < end_segment:
            run.progress[0] = constants.lengths[segment + 1]
    run.counters[SEGMENT] = -1
    return OK
