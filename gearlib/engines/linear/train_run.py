"""Run of a gear train through mesh periods, of which the last are recorded."""

import math

import numpy as np

from gearlib.engines import orbit
from gearlib.engines.codes import COAST, DRIVE, JAMMED, NO_CONTACT, OK, OVERFLOW, UNRESOLVED
from gearlib.engines.jit import kernel, kernel_part
from gearlib.engines.linear.periods import SEGMENTS_MISSING, run_period
from gearlib.engines.linear.train_system import (
    COVERED_PERIODS,
    EVENT_ROWS,
    FIRST_EVENT_ROW,
    PERIOD,
    SEGMENT,
    ZERO_TOLERANCE,
    dot,
    is_past_coast_line,
    set_harmonics,
    system_matrix,
)

#: Largest number of derivatives of a flank distance that are computed to decide the contact of a
#: mesh that starts on the flank line.
_MAX_DERIVATIVES = 10


def _signs(distance_rows, z):
    """Return the sign of each entry of ``distance_rows @ z``, 0.0 if it is within rounding error.

    `z`, shape (n,), is a state. The sum of the magnitudes of the terms scales the rounding error.
    """
    values, magnitudes = distance_rows @ z, np.abs(distance_rows) @ np.abs(z)
    return np.sign(values) * (np.abs(values) > ZERO_TOLERANCE * magnitudes)


def set_initial_contacts(system, no_coast_side, run, segment):
    """Set the contact states of all meshes for the state at the start of a stiffness segment.

    If a mesh is on a flank line (its flanks just touch), the first nonzero derivative of its
    distance decides the contact just afterwards; up to this order the mesh exerts no force. `run`
    (`RunState`) receives the contact states, `zero_order`, the order of this derivative, and
    `start_line`, the side of the flank line (1 drive, -1 coast); off the lines both are 0. `system`
    is the `TrainSystem`, `segment` the index of the segment. `no_coast_side`, bool, (m,), marks
    meshes without a coast side.
    """
    m, n = system.drive_distance_rows.shape
    z = run.state[:n]
    drive_signs = _signs(system.drive_distance_rows, z)
    coast_signs = np.where(no_coast_side, 1.0, _signs(system.coast_distance_rows, z))
    # Nonzero distances decide directly.
    run.contact[:] = NO_CONTACT
    run.contact[drive_signs > 0.0] = DRIVE
    run.contact[(drive_signs < 0.0) & (coast_signs < 0.0)] = COAST
    run.zero_order[:] = run.start_line[:] = 0
    run.start_line[drive_signs == 0.0] = 1
    run.start_line[(drive_signs < 0.0) & (coast_signs == 0.0)] = -1
    is_undecided = run.start_line != 0
    starts_on_drive_line = (run.start_line == 1)[:, None]
    rows = np.where(starts_on_drive_line, system.drive_distance_rows, system.coast_distance_rows)
    # The derivative of an order is A^order z with the matrix A of the contacts found so far.
    derivative, derivative_order, meshes = z, 0, np.arange(m)
    for order in range(1, _MAX_DERIVATIVES):
        if not is_undecided.any():
            break
        if derivative_order == 0:
            force_indices = system.force_index[run.contact + 1, segment, meshes]
            matrix = system_matrix(system, force_indices)
        for _ in range(order - derivative_order):
            derivative = matrix @ derivative
        derivative_order = order
        signs = _signs(rows, derivative)
        is_decided = is_undecided & (signs != 0.0)
        if is_decided.any():
            run.zero_order[is_decided] = order
            touches = is_decided & (signs == run.start_line)
            run.contact[touches] = run.start_line[touches]
            is_undecided &= ~is_decided
            derivative, derivative_order = z, 0
    # A mesh that stays on a flank line counts as in contact only on the drive side.
    run.zero_order[is_undecided] = _MAX_DERIVATIVES
    run.contact[is_undecided] = np.maximum(run.start_line[is_undecided], 0)


@kernel_part(refcounts=False)
def _exceeds_range(z):
    """Return whether a component of the state z is NaN or so large that its square overflows."""
    for r in range(z.shape[0]):
        # The negated comparison is also true for NaN.
        if not abs(z[r]) < 1e150:
            return True
    return False


def start_run(system, constants, run):
    """Set the harmonics and the contact states in `run` at the start of a run; return a status.

    The status is JAMMED if a mesh is in contact on both sides, else OK. `run` is the `RunState`
    with the initial state; `constants` are the `RunConstants` of the `TrainSystem` `system`.
    """
    z = run.state[: system.drive_distance_rows.shape[1]]
    set_harmonics(system.harmonics, z, 2.0 * math.pi * system.first_period)
    # The last entry of `first_segment` is the end of the excitation period.
    mesh_period = system.first_period % (system.first_segment.shape[0] - 1)
    set_initial_contacts(system, constants.no_coast_side, run, system.first_segment[mesh_period])
    for j in np.flatnonzero(constants.may_jam):
        touches = run.contact[j] == DRIVE or run.start_line[j] == 1
        if touches and is_past_coast_line(system.coast_distance_rows[j], z):
            return JAMMED
    return OK


@kernel(refcounts=False)
def run_train(
    system,
    constants,
    tables,
    run,
    periods,
    record_periods,
    samples,
    events,
    max_events,
    summary,
    strobe_states,
    perturbations,
    maps,
):
    """Run a gear train through `periods` mesh periods from the state in `run`; return a status.

    The statuses COMBINATION_MISSING, EVENTS_FULL and SEGMENTS_MISSING request a combination in the
    mode tables, a larger event table or the next segments; the next call continues from there. The
    last `record_periods` are recorded in samples and events, see `periods.run_period`, in one
    summary per block of `constants`, and in `strobe_states`, shape (m, k + 1, 2): the displacements
    and velocities of the meshes at the bounds of the last k periods. A period has at most
    `max_events` events. `maps`, shape (periods, 2 N, 2 N) or (0, 2 N, 2 N), is filled with the
    Jacobian matrices of the period maps; `perturbations`, shape (2 N, n or more), is overwritten.
    """
    m, n = system.drive_distance_rows.shape
    size, strobe_count = maps.shape[1], strobe_states.shape[1] - 1
    first_recorded = periods - record_periods
    samples_per_period = samples.shape[0] // max(record_periods, 1)
    for period in range(run.counters[PERIOD], periods):
        if period >= run.counters[COVERED_PERIODS]:
            return SEGMENTS_MISSING
        if run.counters[SEGMENT] < 0:
            # Setting the harmonics in each period keeps their rounding error from growing.
            phase = 2.0 * math.pi * (system.first_period + period)
            set_harmonics(system.harmonics, run.state[:n], phase)
            row = period - (periods - strobe_count)
            if row >= 0:
                _record_strobe(system, constants, run.state, strobe_states, row)
            for r in range(perturbations.shape[0]):
                for k in range(perturbations.shape[1]):
                    perturbations[r, k] = 1.0 if r == k else 0.0
        is_recorded = period >= first_recorded
        mesh_period = (system.first_period + period) % (system.first_segment.shape[0] - 1)
        first_sample = max(period - first_recorded, 0) * samples_per_period
        end_sample = first_sample + samples_per_period if is_recorded else first_sample
        if constants.sample_starts.shape[0] > 0:
            first_sample = constants.sample_starts[mesh_period]
            end_sample = constants.sample_starts[mesh_period + 1]
        mesh_summaries = summary[constants.summary_blocks[mesh_period] * m :]
        period_samples = samples[first_sample:end_sample]
        status = run_period(
            system,
            constants,
            tables,
            run,
            mesh_period,
            max_events,
            perturbations,
            is_recorded,
            mesh_summaries,
            period_samples,
            events,
        )
        if status < 0:
            return status
        for row in range(run.counters[FIRST_EVENT_ROW], run.counters[EVENT_ROWS]):
            events[row, orbit.EVENT_PERIOD] = period
        if status == OK and _exceeds_range(run.state):
            status = OVERFLOW
        if is_recorded and status == OK:
            for j in range(m):
                if orbit.has_unresolved_extremum(mesh_summaries[j]):
                    status = UNRESOLVED
        if status != OK:
            return status
        for r in range(perturbations.shape[0]):
            for k in range(size):
                maps[period, k, r] = perturbations[r, k]
        run.counters[PERIOD] = period + 1
    if record_periods > 0:
        _record_strobe(system, constants, run.state, strobe_states, strobe_count)
    return OK


def motion_period(system, strobe_states, summary):
    """Return the number of mesh periods after which the motion of all meshes repeats, or 0.

    `strobe_states`, shape (m, k + 1, 2), holds the displacements and velocities of m meshes at k +
    1 successive bounds of mesh periods. `summary` has a row per mesh, whose extrema of the
    displacement scale the tolerance. The result is the least common multiple of the periods of all
    meshes.
    """
    period = 1
    for j in range(strobe_states.shape[0]):
        x_range = summary[j, orbit.X_MAX] - summary[j, orbit.X_MIN]
        mesh_period = orbit.orbit_period(
            strobe_states[j], system.tuning, x_range, system.excitation_period
        )
        period = period // math.gcd(period, mesh_period) * mesh_period if mesh_period > 0 else 0
        if period == 0:
            break
    return period


@kernel_part(refcounts=False, inlined=True)
def _record_strobe(system, constants, z, strobe_states, row):
    """Write displacement and velocity of all meshes in the state z to ``strobe_states[:, row]``.

    The state belongs to the start of a mesh period. `constants` (`RunConstants`) holds the row
    vectors of the velocities by theta, which are divided by the tuning (dtau/dtheta) to obtain
    derivatives by mesh phase.
    """
    state = z[: system.drive_distance_rows.shape[1]]
    for j in range(strobe_states.shape[0]):
        strobe_states[j, row, 0] = dot(system.drive_distance_rows[j], state)
        strobe_states[j, row, 1] = dot(constants.drive_velocity_rows[j], state) / system.tuning
