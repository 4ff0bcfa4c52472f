"""Run of a gear train through mesh periods, of which the last periods are recorded."""

import math

import numpy as np

from gearlib.engines import orbit
from gearlib.engines.codes import COAST, DRIVE, JAMMED, NO_CONTACT, OK, OVERFLOW, UNRESOLVED
from gearlib.engines.jit import inlined_without_refcounts, kernel, kernel_without_refcounts
from gearlib.engines.linear.periods import SEGMENTS_MISSING, run_period
from gearlib.engines.linear.train_system import (
    EVENT_ROWS,
    FIRST_EVENT_ROW,
    KNOWN_PERIODS,
    PERIOD,
    SEGMENT,
    ZERO_TOLERANCE,
    dot,
    fill_system_matrix,
    is_past_coast_line,
    matrix_vector_product,
    set_harmonics,
)

#: Number of derivatives of a distance that decide the contact of a start on a flank line.
_MAX_DERIVATIVES = 10


@kernel_without_refcounts
def _sign_or_zero(row_vector, z):
    """Return the sign of the scalar product of a row vector and z, 0.0 if it is below rounding.

    Rounding is judged by the sum of the magnitudes of the terms.
    """
    value, magnitude = 0.0, 0.0
    for r in range(z.shape[0]):
        value += row_vector[r] * z[r]
        magnitude += abs(row_vector[r] * z[r])
    if abs(value) <= ZERO_TOLERANCE * magnitude:
        return 0.0
    return 1.0 if value > 0.0 else -1.0


@kernel
def set_initial_contacts(system, no_coast_side, work, segment):
    """Set the contact codes of all meshes for the state at the start of a stiffness segment.

    If a mesh is on a flank line (its flanks just touch), the first nonzero derivative of its
    distance decides the contact just after; in lower derivatives the mesh exerts no force. `work`
    (`RunStorage`) receives contact (1, 0, -1), zero_order (order of this derivative) and start_line
    (1 drive side, -1 coast side; both 0 off the lines). `system` is the `TrainSystem`, `segment`
    the index of the segment. `no_coast_side`, bool, (m,), marks meshes without a coast side.
    """
    m, n = system.drive_lines.shape
    z = work.state[:n]
    work.zero_order[:] = 0
    work.start_line[:] = 0
    # First the distances themselves decide, where they are not zero.
    is_undecided = np.zeros(m, dtype=np.bool_)
    for j in range(m):
        drive_sign = _sign_or_zero(system.drive_lines[j], z)
        coast_sign = 1.0 if no_coast_side[j] else _sign_or_zero(system.coast_lines[j], z)
        work.contact[j] = NO_CONTACT
        if drive_sign > 0.0:
            work.contact[j] = DRIVE
        elif drive_sign == 0.0:
            work.start_line[j], is_undecided[j] = 1, True
        elif coast_sign < 0.0:
            work.contact[j] = COAST
        elif coast_sign == 0.0:
            work.start_line[j], is_undecided[j] = -1, True
    # The derivative of this order is A^order z with the matrix A of the contacts found so far.
    matrix = np.empty((n, n))
    for order in range(1, _MAX_DERIVATIVES):
        if not is_undecided.any():
            break
        for j in range(m):
            work.effects[j] = system.effect[work.contact[j] + 1, segment, j]
        fill_system_matrix(system, work.effects, matrix)
        derivative = matrix_vector_product(matrix, z)
        for _ in range(order - 1):
            derivative = matrix_vector_product(matrix, derivative)
        for j in range(m):
            if not is_undecided[j]:
                continue
            lines = system.drive_lines if work.start_line[j] == 1 else system.coast_lines
            sign = _sign_or_zero(lines[j], derivative)
            if sign != 0.0:
                is_undecided[j], work.zero_order[j] = False, order
                if sign == work.start_line[j]:
                    work.contact[j] = work.start_line[j]
    for j in range(m):
        if is_undecided[j]:
            # A mesh that stays on a line counts as in contact if the line is the drive-side line.
            work.zero_order[j] = _MAX_DERIVATIVES
            work.contact[j] = max(work.start_line[j], 0)


@kernel_without_refcounts
def _exceeds_range(z):
    """Return whether a component of the state z is NaN or so large that its square overflows.

    The comparison is negated because it is False for NaN.
    """
    for r in range(z.shape[0]):
        if not abs(z[r]) < 1e150:
            return True
    return False


@kernel
def start_run(system, constants, work):
    """Set the harmonics and the contacts in `work` at the start of a run; return a status.

    The status is JAMMED if both flanks of a mesh touch, else OK. `work` is the `RunStorage` with
    the initial state, and `constants` are the `RunConstants` of the `TrainSystem` `system`.
    """
    n = system.drive_lines.shape[1]
    set_harmonics(system.harmonics, work.state[:n], 2.0 * math.pi * system.first_period)
    # The excitation repeats after as many mesh periods as have entries in `first_segment`, less the
    # end.
    mesh_period = system.first_period % (system.first_segment.shape[0] - 1)
    set_initial_contacts(system, constants.no_coast_side, work, system.first_segment[mesh_period])
    for j in range(system.drive_lines.shape[0]):
        touches = work.contact[j] == DRIVE or work.start_line[j] == 1
        overlaps = is_past_coast_line(system.coast_lines[j], work.state[:n])
        if constants.may_jam[j] and touches and overlaps:
            return JAMMED
    return OK


@kernel_without_refcounts
def run_train(
    system,
    constants,
    tables,
    work,
    periods,
    record_periods,
    samples,
    events,
    max_events,
    summary,
    strobes,
    vectors,
    maps,
):
    """Run a gear train through `periods` mesh periods from the state in `work`; return a status.

    The statuses COMBINATION_MISSING, EVENTS_FULL and SEGMENTS_MISSING ask for a combination in the
    tables, a larger event table, or the next segments; the next call then continues from there. The
    last `record_periods` are recorded in samples and events, see `periods.run_period`, in a summary
    for each block of `constants`, and in `strobes`, shape (m, k + 1, 2): displacement and velocity
    of the meshes at the bounds of the last k periods. A period has at most `max_events` events.
    `maps`, shape (periods, 2 N, 2 N) or (0, 2 N, 2 N), is filled with the derivative of the state
    after each period with respect to the state before it; `vectors`, shape (2 N, n or more), is
    overwritten.
    """
    m, n = system.drive_lines.shape
    size, strobe_count = maps.shape[1], strobes.shape[1] - 1
    first_recorded = periods - record_periods
    samples_per_period = samples.shape[0] // max(record_periods, 1)
    for period in range(work.counters[PERIOD], periods):
        if period >= work.counters[KNOWN_PERIODS]:
            return SEGMENTS_MISSING
        if work.counters[SEGMENT] < 0:
            # The harmonics are set in each period, so that their rounding does not grow with the
            # run.
            phase = 2.0 * math.pi * (system.first_period + period)
            set_harmonics(system.harmonics, work.state[:n], phase)
            row = period - (periods - strobe_count)
            if row >= 0:
                _record_strobe(system, constants, work.state, strobes, row)
            for r in range(vectors.shape[0]):
                for k in range(vectors.shape[1]):
                    vectors[r, k] = 1.0 if r == k else 0.0
        recorded = period >= first_recorded
        number = (system.first_period + period) % (system.first_segment.shape[0] - 1)
        first_sample = max(period - first_recorded, 0) * samples_per_period
        end_sample = first_sample + samples_per_period if recorded else first_sample
        if constants.sample_starts.shape[0] > 0:
            first_sample = constants.sample_starts[number]
            end_sample = constants.sample_starts[number + 1]
        mesh_summaries = summary[constants.summary_blocks[number] * m :]
        period_samples = samples[first_sample:end_sample]
        status = run_period(
            system,
            constants,
            tables,
            work,
            number,
            max_events,
            vectors,
            recorded,
            mesh_summaries,
            period_samples,
            events,
        )
        if status < 0:
            return status
        for row in range(work.counters[FIRST_EVENT_ROW], work.counters[EVENT_ROWS]):
            events[row, orbit.EVENT_PERIOD] = period
        if status == OK and _exceeds_range(work.state):
            status = OVERFLOW
        if recorded and status == OK:
            for j in range(m):
                if orbit.has_unresolved_extremum(mesh_summaries[j]):
                    status = UNRESOLVED
        if status != OK:
            return status
        for r in range(vectors.shape[0]):
            for k in range(size):
                maps[period, k, r] = vectors[r, k]
        work.counters[PERIOD] = period + 1
    if record_periods > 0:
        _record_strobe(system, constants, work.state, strobes, strobe_count)
    return OK


@kernel
def motion_period(system, strobes, summary):
    """Return the number of mesh periods after which the motion of all meshes repeats, or 0.

    `strobes`, shape (m, k + 1, 2), has displacements and velocities of m meshes at k + 1 successive
    bounds of mesh periods. `summary`, with a row for each mesh, holds the extrema of the
    displacement, which scale the tolerance. The result is the least common multiple over the
    meshes.
    """
    period = 1
    for j in range(strobes.shape[0]):
        x_range = summary[j, orbit.X_MAX] - summary[j, orbit.X_MIN]
        mesh_period = orbit.orbit_period(strobes[j], system.tuning, x_range, system.repeats)
        period = period // math.gcd(period, mesh_period) * mesh_period if mesh_period > 0 else 0
        if period == 0:
            break
    return period


@inlined_without_refcounts
def _record_strobe(system, constants, z, strobes, row):
    """Write displacement and velocity of all meshes in the state z to ``strobes[:, row]``.

    A strobe is a state at the start of a mesh period. `constants` (`RunConstants`) hold the row
    vectors of the velocities by theta; divided by the tuning (dtau/dtheta) they are derivatives by
    mesh phase.
    """
    state = z[: system.drive_lines.shape[1]]
    for j in range(strobes.shape[0]):
        strobes[j, row, 0] = dot(system.drive_lines[j], state)
        strobes[j, row, 1] = dot(constants.drive_rates[j], state) / system.tuning
