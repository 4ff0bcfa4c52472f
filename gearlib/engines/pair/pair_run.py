"""Runs of a gear pair: mesh periods without a record, which are faster, then recorded periods.

One call can also run many tunings or many initial states, or fill Poincare sections.
"""

import math

import numpy as np

from gearlib.engines import orbit
from gearlib.engines.codes import EVENT_LIMIT, OK, OVERFLOW
from gearlib.engines.jit import kernel, kernel_part
from gearlib.engines.matrices import copy
from gearlib.engines.orbit import is_within_range
from gearlib.engines.pair import sampling, settling
from gearlib.engines.pair.events import ARC_COLUMNS, START
from gearlib.engines.pair.motion import pair_constants_at_tuning, pair_contact_state
from gearlib.engines.pair.whole_periods import (
    FLIGHT_DURATION,
    IMPACT_SPEED,
    REMAINING,
    START_SPEED,
    STORED_PERIODS,
    advance_periods,
    prepare_run,
    prepare_workspace,
)

#: Number of rows of a new arc table.
FIRST_ARC_ROWS = 32
#: Number of mesh periods between checks whether a run has settled, doubled after a failed proof.
_CHECK_INTERVAL = 8
#: Largest distance from an orbit, relative to the state, at which only one repeat is recorded.
_ORBIT_DISTANCE = 1e-13
#: Largest distance D from the orbit for a proof of the period after the run, distance at which
#: states count as equal, and largest D of a motion without events, too small to be visible.
_END_DISTANCE, _SAME_STATE, _VISIBLE_DISTANCE = 1e-6, 1e-5, 1e-3


@kernel_part
def period_status(x, v, arc_count, max_arcs):
    """Return the status of a run after a mesh period: OK, EVENT_LIMIT or OVERFLOW.

    x and v are displacement and velocity at the end of the period. EVENT_LIMIT means that its
    number of arcs (parts of the motion between two events), `arc_count`, exceeds `max_arcs`.
    """
    if arc_count > max_arcs:
        return EVENT_LIMIT
    return OK if is_within_range(x, v) else OVERFLOW


@kernel_part(merged=True)
def run_whole_period(pair, workspace, n, contact, x, v, max_arcs, arcs):
    """Run through mesh period n and store all its arcs, the parts of the motion between two events.

    The motion starts with the contact state `contact` (1, 0, -1), displacement x and velocity v.
    The arc table `arcs`, shape (k, 6), is enlarged if needed, up to `max_arcs` rows. `pair` holds
    the `PairConstants`, and `workspace` has been prepared for them. Returns (contact state, x, v,
    number of arcs, arc table) at the end of the period.
    """
    memory, start = workspace.memory, (contact, x, v)
    # Save a free flight in progress at the start, in case the period has to be run again.
    remaining, duration = memory[REMAINING], memory[FLIGHT_DURATION]
    start_speed, impact_speed = memory[START_SPEED], memory[IMPACT_SPEED]
    contact, x, v, count = advance_periods(pair, workspace, n, contact, x, v, 1, max_arcs, arcs)
    # If the arc table was too small, run the period again from the same start.
    if arcs.shape[0] < count <= max_arcs:
        arcs = np.empty((2 * count, ARC_COLUMNS))
        memory[REMAINING], memory[FLIGHT_DURATION] = remaining, duration
        memory[START_SPEED], memory[IMPACT_SPEED] = start_speed, impact_speed
        contact, x, v, count = advance_periods(pair, workspace, n, *start, 1, max_arcs, arcs)
    return contact, x, v, count, arcs


@kernel_part
def run_unrecorded(pair, workspace, contact, x, v, periods, max_arcs):
    """Run through a number of mesh `periods` from mesh phase 0 without a record.

    The motion starts with the contact state `contact` (1, 0, -1), displacement x and velocity v; a
    period has at most `max_arcs` arcs (parts between two events). Once the motion has provably
    settled on a periodic orbit, the linearised map replaces the remaining periods. `pair` holds the
    `PairConstants`, and `workspace` has been prepared for them. Returns (contact state, x, v,
    status, settled_period, is_on_orbit): `settled_period` is the period of the settled orbit or 0,
    and `is_on_orbit` tells whether the distance from the orbit is below rounding.
    """
    n, next_check, check_interval = 0, 2 * _CHECK_INTERVAL, _CHECK_INTERVAL
    settled, is_on_orbit = settling.no_settled_orbit(), False
    no_arcs = np.empty((0, ARC_COLUMNS))
    while n < periods:
        step = min(_CHECK_INTERVAL - n % _CHECK_INTERVAL, periods - n)
        contact, x, v, count = advance_periods(
            pair, workspace, n, contact, x, v, step, max_arcs, no_arcs
        )
        n += step
        status = period_status(x, v, count, max_arcs)
        if status != OK:
            return contact, x, v, status, 0, False
        if settled.period > 0 or n < next_check:
            continue
        # If stored states repeat, try a proof, which takes `orbit_period` mesh periods.
        orbit_period = settling.repeat_period(pair, workspace, n, settling.MAX_DISTANCE)
        if orbit_period == 0 or periods - n < orbit_period:
            continue
        contact, x, v, count, settled = settling.prove_settled(
            pair, workspace, n, contact, x, v, orbit_period, max_arcs, settling.MAX_DISTANCE
        )
        n += orbit_period
        status = period_status(x, v, count, max_arcs)
        if status != OK:
            return contact, x, v, status, 0, False
        # Proofs cost time, so the interval between them grows.
        next_check, check_interval = n + check_interval, 2 * check_interval
        if settled.period > 0:
            # Skip all but the last repeat with the linearised map.
            k = max(0, (periods - n) // orbit_period - 1)
            offset_x, offset_v = settling.offset_after_repeats(settled, k)
            if k > 0:
                x, v = x - settled.x + offset_x, v - settled.v + offset_v
                contact = pair_contact_state(pair.backlash_ratio, x, v)
                workspace.memory[REMAINING] = -1.0
                n += k * orbit_period
            state_size = max(1.0, abs(x), pair.tuning * abs(v))
            distance = max(abs(offset_x), pair.tuning * abs(offset_v))
            is_on_orbit = distance <= _ORBIT_DISTANCE * state_size
    return contact, x, v, OK, settled.period, is_on_orbit


@kernel
def run(pair, workspace, x, v, periods, record_periods, samples, events, max_arcs, summary):
    """Run a gear pair from displacement x and velocity v at mesh phase 0; record its last periods.

    x is in units of the static deflection, v is its derivative by mesh phase, and `pair` holds the
    `PairConstants`. `workspace` is a `Workspace` of any earlier run or a new one. Of the mesh
    `periods`, the last `record_periods` are recorded: `samples`, shape (record_periods * n, 6), is
    filled with n samples per period, where n may be 0; the event table `events`, shape (k, 5), is
    enlarged as needed unless k = 0; `summary` is filled with extrema and contact times. A period
    has at most `max_arcs` arcs, parts of the motion between two events.

    Returns (x, v, period, computed periods, events, event count, status): the final state, the
    proven period of the orbit in mesh periods or 0, the number of recorded periods whose samples
    and events are in the tables and repeat in the others, the event table with its number of
    events, and the status OK, EVENT_LIMIT or OVERFLOW.
    """
    if not is_within_range(x, v):
        return x, v, 0, 0, events, 0, OVERFLOW
    contact = pair_contact_state(pair.backlash_ratio, x, v)
    prepare_workspace(workspace, pair)
    prepare_run(workspace, x, v)
    first_recorded = periods - record_periods
    contact, x, v, status, settled_period, is_on_orbit = run_unrecorded(
        pair, workspace, contact, x, v, first_recorded, max_arcs
    )
    if status != OK:
        return x, v, 0, 0, events, 0, status
    orbit.clear_summary(summary)
    samples_per_period = samples.shape[0] // record_periods
    # On a settled orbit, compute and record one period of the orbit only.
    computed_periods = (
        settled_period if is_on_orbit and record_periods % settled_period == 0 else record_periods
    )
    event_rows = 0
    arcs = np.empty((FIRST_ARC_ROWS, ARC_COLUMNS))
    previous_contact = contact
    for i in range(computed_periods):
        n = first_recorded + i
        contact, x, v, arc_count, arcs = run_whole_period(
            pair, workspace, n, contact, x, v, max_arcs, arcs
        )
        status = period_status(x, v, arc_count, max_arcs)
        if status != OK:
            return x, v, 0, 0, events, 0, status
        sampling.add_arcs_to_summary(pair, arcs, arc_count, summary)
        events, event_rows, previous_contact = sampling.record_events(
            arcs, arc_count, previous_contact, n, events, event_rows, summary
        )
        if samples_per_period > 0:
            period_samples = samples[i * samples_per_period : (i + 1) * samples_per_period]
            orbit.fill_sample_phases(period_samples, orbit.SAMPLE_PHASE, 2.0 * math.pi)
            sampling.sample_arcs(pair, arcs, arc_count, period_samples)
    for k in orbit.SUMS:
        summary[k] *= record_periods / computed_periods
    last_stored = first_recorded + computed_periods
    period = _period_of_stored_states(
        pair, workspace, periods, first_recorded, last_stored, settled_period, summary
    )
    if settled_period == 0:
        period = _prove_period(pair, workspace, periods, contact, x, v, max_arcs, summary)
    return x, v, period, computed_periods, events, event_rows, OK


@kernel_part(merged=True)
def _prove_period(pair, workspace, n, contact, x, v, max_arcs, summary):
    """Return the proven period of the orbit to which a motion converges, or 0 without a proof.

    After n mesh periods the motion has the contact state `contact` (1, 0, -1), displacement x and
    velocity v. The states in `workspace` may also repeat during a transient, so a proof is needed.
    `pair` holds the `PairConstants`, `max_arcs` is the largest number of arcs (parts between two
    events) per period, and `summary` holds the extrema and contact times of the recorded periods.
    """
    period, tolerance = settling.repeat_period(pair, workspace, n, _SAME_STATE), _END_DISTANCE
    if summary[orbit.TIME_NO_CONTACT] == 0.0 and summary[orbit.TIME_COAST] == 0.0:
        # Without contact loss, the map of a period is linear and has a single orbit. Any distance
        # that cannot cause a loss of contact is then allowed. Within a period, deviations grow by
        # less than a factor of 10.
        largest_change = 0.1 * summary[orbit.X_MIN]
        period = 1
        tolerance = max(
            tolerance,
            min(_VISIBLE_DISTANCE, largest_change) / max(1.0, abs(x), pair.tuning * abs(v)),
        )
    if period == 0:
        return 0
    _, _, _, _, settled = settling.prove_settled(
        pair, workspace, n, contact, x, v, period, max_arcs, tolerance
    )
    return settled.period


@kernel_part(merged=True)
def _period_of_stored_states(
    pair, workspace, periods, first_stored, last_stored, settled_period, summary
):
    """Return the period of an orbit from a comparison of its states after each mesh period, or 0.

    `workspace` stores the states after the mesh periods `first_stored` to `last_stored` of a run of
    `periods`. If the run has settled on an orbit, `settled_period` is its period, else 0; states
    that were not computed then equal stored states. `summary` has the displacement range of the
    orbit, which scales the tolerance; `pair` holds the tuning.
    """
    strobe_count = min(periods, orbit.STROBE_PERIODS)
    strobe_states = np.empty((strobe_count + 1, 2))
    for i in range(strobe_count + 1):
        n = periods - strobe_count + i
        # Shift period n by whole orbit periods into the stored range.
        if settled_period > 0 and n <= first_stored - settled_period:
            n += (first_stored - n) // settled_period * settled_period
        if n > last_stored:
            n -= (n - last_stored + settled_period - 1) // settled_period * settled_period
        copy(workspace.states[n % STORED_PERIODS], strobe_states[i])
    displacement_range = summary[orbit.X_MAX] - summary[orbit.X_MIN]
    return orbit.orbit_period(strobe_states, pair.tuning, displacement_range)


@kernel
def run_many(
    parameters,
    workspace,
    tunings,
    order,
    state,
    warm_start,
    span,
    max_x,
    summaries,
    final_states,
    outcomes,
):
    """Run a gear pair at the tunings ``tunings[order]`` and fill a row of each table per tuning.

    A tuning is the mesh frequency over the natural frequency; `pair_constants_at_tuning` takes it
    with the seven `parameters`. All runs use one `Workspace`. A run lasts a `Span` of mesh periods
    and starts from `state`, shape (2,), or, with `warm_start`, from the end of the previous run
    unless that failed. A displacement beyond `max_x` gives the status OVERFLOW. The tables have one
    row per tuning: `summaries`, `final_states`, (n, 2), and `outcomes`, int, (n, 2), with period
    and status. A failed run leaves NaN in `summaries` and `final_states`.
    """
    samples = np.empty((0, orbit.SAMPLE_COLUMNS))
    events = np.empty((0, orbit.EVENT_COLUMNS))
    x, v = state[0], state[1]
    for i in order:
        pair = pair_constants_at_tuning(parameters, tunings[i])
        arguments = samples, events, span.max_events, summaries[i]
        x, v, period, _, _, _, status = run(
            pair, workspace, x, v, span.periods, span.recorded, *arguments
        )
        if status == OK and max(summaries[i, orbit.X_MAX], -summaries[i, orbit.X_MIN]) > max_x:
            status = OVERFLOW
        if status != OK:
            summaries[i, :] = math.nan
            final_states[i, :] = math.nan
        else:
            final_states[i, 0], final_states[i, 1] = x, v
        if status != OK or not warm_start:
            x, v = state[0], state[1]
        outcomes[i, 0], outcomes[i, 1] = period, status


@kernel
def run_many_states(pair, workspace, states, periods, max_arcs, final_states, statuses):
    """Run a gear pair through a number of mesh `periods` from each of many `states`, shape (k, 2).

    A state is displacement and velocity at mesh phase 0; `pair` holds the `PairConstants`. All runs
    use one `Workspace`.
    `final_states`, shape (k, 2), and `statuses`, shape (k,), are filled. A period with more than
    `max_arcs` arcs, parts of the motion between two events, ends a run.
    """
    prepare_workspace(workspace, pair)
    for i in range(states.shape[0]):
        x, v = states[i, 0], states[i, 1]
        status = OVERFLOW
        if is_within_range(x, v):
            prepare_run(workspace, x, v)
            contact = pair_contact_state(pair.backlash_ratio, x, v)
            _, x, v, status, _, _ = run_unrecorded(
                pair, workspace, contact, x, v, periods, max_arcs
            )
        final_states[i, 0], final_states[i, 1], statuses[i] = x, v, status


@kernel
def fill_sections(
    pair, workspace, states, settle_periods, phase, max_arcs, table, final_states, statuses
):
    """Fill `table` with the states (x, v) of n motions at one phase of each mesh period.

    `table` has the shape (n, periods, 2), and `pair` holds the `PairConstants`. All motions use one
    `Workspace`. The motions start
    from `states`, shape (n, 2), at mesh phase 0, and `settle_periods` mesh periods pass before the
    first entry. `phase` lies in [0, 2 pi). `final_states`, shape (n, 2), and `statuses`, shape
    (n,), are also filled. A period with more than `max_arcs` arcs (parts between two events) ends a
    motion, whose later entries remain unchanged.
    """
    arcs = np.empty((16, ARC_COLUMNS))
    prepare_workspace(workspace, pair)
    for j in range(states.shape[0]):
        x, v, status = states[j, 0], states[j, 1], OVERFLOW
        if is_within_range(x, v):
            prepare_run(workspace, x, v)
            contact = pair_contact_state(pair.backlash_ratio, x, v)
            contact, x, v, status, _, _ = run_unrecorded(
                pair, workspace, contact, x, v, settle_periods, max_arcs
            )
            for period in range(table.shape[1]):
                if status != OK:
                    break
                contact, x, v, arc_count, arcs = run_whole_period(
                    pair, workspace, settle_periods + period, contact, x, v, max_arcs, arcs
                )
                status = period_status(x, v, arc_count, max_arcs)
                if status == EVENT_LIMIT:
                    break
                # The phase lies in the last arc that starts at or before it.
                i = 0
                while i + 1 < arc_count and arcs[i + 1, START] <= phase:
                    i += 1
                table[j, period, 0], table[j, period, 1], _, _ = sampling.state_in_arc(
                    pair, arcs[i], phase
                )
        final_states[j, 0], final_states[j, 1], statuses[j] = x, v, status
