"""One mesh period of a gear train, from event to event of all meshes.

The modes of the present combination of contacts move the state up to the next switch of a
stiffness or the next crossing of a flank line by any mesh. Crossings of several meshes within their
rounding count as simultaneous: their saltation matrices commute, so that the order does not matter
(`docs/theory/trains.md`).
"""

from gearlib.engines import orbit
from gearlib.engines.codes import BOTH, DRIVE, EVENT_LIMIT, JAMMED, OK, UNRESOLVED
from gearlib.engines.jit import inlined_without_refcounts, kernel_without_refcounts
from gearlib.engines.linear.distances import fill_amplitudes, find_first_events, stays_off_lines
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

#: Largest time between simultaneous crossings, as a fraction of a piece. The bound is needed near
#: grazing, where the rounding of an instant has no bound.
_MAX_SIMULTANEOUS_STEP = 1e-13
#: Rounding error of the states of equal meshes, as a multiple of the rounding error of a distance.
_STATE_ROUNDING = 8.0
#: Requests to the caller in place of a status: the tables lack the modes of the combination
#: `RunStorage.effects`, the event table is full, the system has no further segments.
COMBINATION_MISSING, EVENTS_FULL, SEGMENTS_MISSING = -1, -2, -3

#: The event table has the columns of `orbit` and then the number of the mesh.
EVENT_MESH = orbit.EVENT_COLUMNS
EVENT_COLUMNS = orbit.EVENT_COLUMNS + 1


@inlined_without_refcounts
def _cross_flank_line(system, constants, work, j, segment, vectors):
    """Change the contact of mesh j, which has reached a flank line, in `work` (`RunStorage`).

    The flank line is the displacement at which the flanks touch. Small perturbations of the state,
    the rows of `vectors`, shape (k, n or more), jump: they are multiplied by the saltation matrix.
    `segment` is the index of the present segment of constant stiffness in the `TrainSystem`
    `system`; `constants` (`RunConstants`) hold the rates of the flank distances.
    """
    n = system.drive_lines.shape[1]
    # Only at the drive-side line is the contact before or after on the drive side.
    line = 1 if DRIVE in (work.contact[j], work.contact_after[j]) else -1
    work.start_line[j] = line
    if vectors.shape[0] > 0:
        line_rates = constants.drive_rates if line == 1 else constants.coast_rates
        lines = system.drive_lines if line == 1 else system.coast_lines
        speed = 0.0
        for r in range(n):
            speed += line_rates[j, r] * work.state[r]
        effect_before = system.effect[work.contact[j] + 1, segment, j]
        effect_after = system.effect[work.contact_after[j] + 1, segment, j]
        for r in range(n):
            work.term[r] = 0.0
        # The jump of dz/dtheta by both forces of the mesh, the mesh force and the friction.
        for k in range(2):
            force_after, force_before = 0.0, 0.0
            for r in range(n):
                force_after += system.force_output[j, effect_after, k, r] * work.state[r]
                force_before += system.force_output[j, effect_before, k, r] * work.state[r]
            for r in range(n):
                work.term[r] += (
                    system.force_input[j, effect_after, k, r] * force_after
                    - system.force_input[j, effect_before, k, r] * force_before
                )
        # The saltation matrix of a tangential crossing is the identity: no force jumps.
        for i in range(vectors.shape[0] if speed != 0.0 else 0):
            # A perturbed motion reaches the line earlier by the time (distance / speed).
            time_shift = 0.0
            for r in range(n):
                time_shift += lines[j, r] * vectors[i, r]
            time_shift /= speed
            for r in range(n):
                vectors[i, r] += work.term[r] * time_shift
    # The mesh starts on the line: its distance is zero, but not the derivative of the distance.
    work.zero_order[j] = 1
    work.contact[j] = work.contact_after[j]


@kernel_without_refcounts
def sort_last_event(events, row, first_row):
    """Move the last event of an event table up among events at the same phase, by mesh number.

    The event stands in `row`, and it moves at most to `first_row`, the first row of the mesh
    period. So the order of simultaneous events does not depend on the order in which they were
    found. The columns of `events` are EVENT_PHASE, EVENT_MESH and others.
    """
    while (
        row > first_row
        and events[row - 1, orbit.EVENT_PHASE] == events[row, orbit.EVENT_PHASE]
        and events[row - 1, EVENT_MESH] > events[row, EVENT_MESH]
    ):
        for k in range(EVENT_COLUMNS):
            events[row - 1, k], events[row, k] = events[row, k], events[row - 1, k]
        row -= 1


@inlined_without_refcounts
def run_period(
    system, constants, tables, work, number, max_events, vectors, recorded, summary, samples, events
):
    """Run through one mesh period from contact event to contact event; return a status.

    The state in `work` (`RunStorage`), and small perturbations of it, `vectors`, shape (k, n or
    more), change in place. `number` is the index of the mesh period in the excitation, `max_events`
    the largest number of its events. If `recorded`, the `summary` with a row for each mesh, the
    `samples`, see `sampling.sample_motion`, and the `events`, shape (k, 6), are filled; an event
    table without rows stays empty. The status COMBINATION_MISSING asks for the modes of
    ``work.effects`` in `tables` (`Modes`), EVENTS_FULL for a larger event table; the next call
    continues from there.
    """
    (m, n), phase, piece = system.drive_lines.shape, 0.0, 0.0
    first_segment, end_segment = system.first_segment[number], system.first_segment[number + 1]
    if work.counters[SEGMENT] < 0:
        work.counters[SEGMENT], work.counters[PERIOD_EVENTS] = first_segment, 0
        work.counters[FIRST_EVENT_ROW] = work.counters[EVENT_ROWS]
        work.counters[SAMPLES_TAKEN] = 0
        work.progress[0] = constants.lengths[first_segment]
        work.progress[1] = 0.0
        if constants.sample_starts.shape[0] == 0:
            orbit.fill_sample_phases(
                samples, n + m, system.starts[end_segment] - system.starts[first_segment]
            )
    while work.counters[SEGMENT] < end_segment:
        segment, combination, remaining = work.counters[SEGMENT], -1, work.progress[0]
        while remaining > 0.0:
            if combination < 0:
                for j in range(m):
                    work.effects[j] = system.effect[work.contact[j] + 1, segment, j]
                    work.stays_off[j] = False
                slot = find_slot(tables.hash_slots, tables.keys, work.effects)
                combination = tables.hash_slots[slot]
                if combination < 0 and tables.series_steps[slot] < tables.mode_cost[0]:
                    combination = SERIES
                events_are_full = recorded and 0 < events.shape[0] < work.counters[EVENT_ROWS] + m
                if combination == -1 or events_are_full:
                    work.progress[0] = remaining
                    return COMBINATION_MISSING if combination == -1 else EVENTS_FULL
                if combination == SERIES:
                    tables.series_steps[slot] += 1 + vectors.shape[0]
                    piece = fill_taylor_series(
                        system, constants, work.effects, work.state, work.series
                    )
                    fill_distance_series(system, constants, work.series, work.distance_series)
                else:
                    piece = tables.piece_lengths[combination]
                    apply_stored_matrix(tables.to_modes, combination, work.state, work.modal_state)
            mode_count, all_stay_off = 0, True
            if combination != SERIES:
                mode_count = fill_amplitudes(tables, combination, work.modal_state, work.amplitudes)
            for j in range(m):
                if not work.stays_off[j]:
                    work.stays_off[j] = work.zero_order[j] == 0 and stays_off_lines(
                        tables, combination, j, constants, work, mode_count
                    )
                    all_stay_off &= work.stays_off[j]
            step = min(piece, remaining) if combination == SERIES or not all_stay_off else remaining
            instant = 2.0
            if not all_stay_off:
                instant = find_first_events(tables, combination, constants, work, step / piece)
                for j in range(m):
                    work.zero_order[j] = 0
                if instant < 0.0:
                    return UNRESOLVED
                if instant <= 1.0:
                    step = instant * piece
            if recorded:
                phase = system.starts[segment] - system.starts[first_segment]
                phase += (constants.lengths[segment] - remaining) * system.tuning
                sample_motion(
                    system, tables, combination, work, segment, phase, step, piece, summary, samples
                )
            remaining -= step
            if combination == SERIES:
                sum_series(work.series, n, step / piece, work.state)
                for i in range(vectors.shape[0]):
                    advance_by_series(
                        system, constants, work.effects, step, vectors[i], work.series
                    )
                if instant > 1.0 and remaining > 0.0:
                    # After many Taylor steps modes may cost less, so the method is chosen again.
                    combination = -1
                    continue
            else:
                length_index, factors = constants.length_index[segment], work.mode_factors
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
                    tables, combination, factors, step, work.modal_state, work.term, work.image
                )
                y = work.mode_buffer
                for i in range(vectors.shape[0]):
                    apply_stored_matrix(tables.to_modes, combination, vectors[i], y)
                    advance_modes(tables, combination, factors, step, y, work.term, work.image)
                    apply_stored_matrix(tables.from_modes, combination, y, vectors[i])
                if instant > 1.0 and remaining > 0.0:
                    continue
                apply_stored_matrix(tables.from_modes, combination, work.modal_state, work.state)
            if instant > 1.0:
                break
            rounding = 0.0
            for j in range(m):
                if work.event_instant[j] == instant:
                    rounding = max(rounding, work.instant_rounding[j])
            for j in range(m):
                tolerance = min(
                    _STATE_ROUNDING * (rounding + work.instant_rounding[j]),
                    _MAX_SIMULTANEOUS_STEP,
                )
                if work.event_instant[j] > 1.0 or work.event_instant[j] - instant > tolerance:
                    continue
                if work.contact_after[j] == BOTH:
                    return JAMMED
                contact_before = work.contact[j]
                _cross_flank_line(system, constants, work, j, segment, vectors)
                work.counters[PERIOD_EVENTS] += 1
                if recorded:
                    state = work.state[: constants.drive_rates.shape[1]]
                    velocity = dot(constants.drive_rates[j], state) / system.tuning
                    code_after = work.contact[j]
                    orbit.count_event(contact_before, code_after, velocity, summary[j])
                    if events.shape[0] > 0:
                        # Rounding of the sum must not put the event before the previous one.
                        work.progress[1] = max(phase + step * system.tuning, work.progress[1])
                        row, instant_phase = work.counters[EVENT_ROWS], work.progress[1]
                        orbit.fill_event(
                            events[row], 0, instant_phase, contact_before, code_after, velocity
                        )
                        events[row, EVENT_MESH] = j
                        work.counters[EVENT_ROWS] = row + 1
                        sort_last_event(events, row, work.counters[FIRST_EVENT_ROW])
            if work.counters[PERIOD_EVENTS] > max_events:
                return EVENT_LIMIT
            combination = -1
        work.counters[SEGMENT] = segment + 1
        if segment + 1 < end_segment:
            work.progress[0] = constants.lengths[segment + 1]
    work.counters[SEGMENT] = -1
    return OK
