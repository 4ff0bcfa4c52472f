"""Summary and samples of the motion of a gear train: extrema and contact times of each mesh."""

import math

from gearlib.engines import orbit
from gearlib.engines.codes import COAST, DRIVE, NO_CONTACT
from gearlib.engines.jit import kernel_part
from gearlib.engines.linear.distances import (
    distance_amplitude,
    fill_amplitudes,
    fill_distance_polynomial,
    restrict_to_start,
)
from gearlib.engines.linear.modal_arcs import advance_modes_in_time, apply_stored_matrix
from gearlib.engines.linear.sparse_series import SERIES, sum_series
from gearlib.engines.linear.train_system import SAMPLES_TAKEN
from gearlib.engines.matrices import copy
from gearlib.engines.polynomial import bernstein_maximum


@kernel_part(refcounts=False)
def _update_extrema(polynomial, is_displacement, stiffness, run, mesh_summary):
    """Update the extrema of displacement and mesh force in a row of the summary.

    `polynomial` holds the Bernstein coefficients, on [0, 1], of the distance of a mesh from one of
    its flank lines. If `is_displacement`, this distance is the displacement of the mesh. If
    `stiffness` > 0, the distance times `stiffness` is the mesh force. `mesh_summary` is the row of
    the mesh; `run` is overwritten.
    """
    degree = polynomial.shape[0] - 1
    for sign, displacement_column, force_column in (
        (1.0, orbit.X_MAX, orbit.FORCE_MAX),
        (-1.0, orbit.X_MIN, orbit.FORCE_MIN),
    ):
        # Only values above this bound are new extrema. A minimum is a maximum of the negative
        # polynomial.
        lower_bound = sign * mesh_summary[displacement_column] if is_displacement else math.inf
        largest = -math.inf
        if stiffness > 0.0:
            lower_bound = min(lower_bound, sign * mesh_summary[force_column] / stiffness)
        for k in range(degree + 1):
            run.search[0, k] = sign * polynomial[k]
            largest = max(largest, run.search[0, k])
        # The largest coefficient is an upper bound, which excludes new extrema in most intervals.
        if largest <= lower_bound:
            continue
        extremum = bernstein_maximum(run.search, degree, lower_bound)
        if is_displacement and not extremum <= sign * mesh_summary[displacement_column]:
            mesh_summary[displacement_column] = sign * extremum
        if stiffness > 0.0 and not stiffness * extremum <= sign * mesh_summary[force_column]:
            mesh_summary[force_column] = sign * stiffness * extremum


@kernel_part(refcounts=False, inlined=True)
def _fill_distance(tables, combination, side, j, run):
    """Fill ``run.polynomial`` with the distance of mesh j from a flank line.

    The polynomial is in Bernstein form. `side` is 0 for the coast side and 1 for the drive side.
    `combination` is the row of the mode tables `tables` for the present contacts; the modal state
    is ``run.mode_buffer``. If `combination` is SERIES, the distance follows from its Taylor
    series, ``run.distance_series``.
    """
    if combination == SERIES:
        fill_distance_polynomial(run.to_bernstein, run.distance_series[side, j], run.polynomial)
    else:
        fill_distance_polynomial(
            tables.distance_polynomials[combination, side, j], run.mode_buffer, run.polynomial
        )


@kernel_part(refcounts=False, inlined=True)
def _motion_stays_within_extrema(system, tables, combination, run, segment, summary, mode_count):
    """Return whether no mesh can exceed its recorded extrema before the next change of contact.

    `summary` has a row of extrema per mesh. Each distance from a flank line lies within its
    constant part plus or minus the sum of the amplitudes of the `mode_count` modes in `run`.
    `combination` is the row of the mode tables `tables` for the present contacts, and `segment` is
    the index of the stiffness segment in the `TrainSystem` `system`.
    """
    for j in range(run.contact.shape[0]):
        mesh_summary, contact = summary[j], run.contact[j]
        if not tables.is_bounded[combination, 1, j] or not tables.is_bounded[combination, 0, j]:
            return False
        center = tables.constant_distance[combination, 1, j]
        amplitude = distance_amplitude(tables, combination, 1, j, run, mode_count)
        if (
            center + amplitude > mesh_summary[orbit.X_MAX]
            or center - amplitude < mesh_summary[orbit.X_MIN]
        ):
            return False
        if contact == COAST:
            center = tables.constant_distance[combination, 0, j]
            amplitude = distance_amplitude(tables, combination, 0, j, run, mode_count)
        stiffness = system.stiffness[contact + 1, segment, j] if contact != NO_CONTACT else 0.0
        max_force, min_force = stiffness * (center + amplitude), stiffness * (center - amplitude)
        if max_force > mesh_summary[orbit.FORCE_MAX] or min_force < mesh_summary[orbit.FORCE_MIN]:
            return False
    return True


@kernel_part(refcounts=False, inlined=True)
def _integrate_distance(tables, combination, side, j, start, end, t):
    """Return the time integral of the distance of mesh j from a flank line over a duration t.

    `side` is 0 for the coast side and 1 for the drive side. `start` and `end` are the modal states
    at both ends of the interval, and `combination` is the row of the mode tables `tables` for the
    present contacts. Each mode is an exponential, so its integral is its change divided by its
    rate.
    """
    pair_count = tables.pair_counts[combination]
    total = tables.constant_distance[combination, side, j] * t
    rates = tables.rates[combination]
    # The first Bernstein coefficient is the distance due to a unit of the mode.
    polynomials = tables.distance_polynomials[combination, side, j]
    for k in range(pair_count):
        # Divide the change u + i v of the pair by its complex rate, growth + i frequency.
        growth, frequency = rates[k, 0], rates[k, 1]
        u, v = end[2 * k] - start[2 * k], end[2 * k + 1] - start[2 * k + 1]
        p, q = growth * u + frequency * v, growth * v - frequency * u
        total += (polynomials[2 * k, 0] * p + polynomials[2 * k + 1, 0] * q) / (
            growth * growth + frequency * frequency
        )
    for k in range(tables.real_counts[combination]):
        i = 2 * pair_count + k
        total += polynomials[i, 0] * (end[i] - start[i]) / rates[pair_count + k, 0]
    return total


@kernel_part(refcounts=False)
def sample_motion(
    system, tables, combination, run, segment, phase, length, interval_length, summary, samples
):
    """Record a motion without contact changes in the summary and the samples of all meshes.

    The motion starts at `phase` in a stiffness segment with the modal state in `run` and
    lasts `length` in theta. The polynomials of the distances hold over `interval_length`.
    `combination` is the row of the mode tables `tables` for the present contacts, or SERIES.
    `summary` has one row per mesh. The columns of `samples` are: state (n), contact states (m),
    segment. Until a sample is filled, its last column holds its phase. If a search for the largest
    displacement of the first mesh fails, this extremum becomes NaN and ends all searches.
    """
    m, n = system.drive_distance_rows.shape
    tuning, elapsed, polynomial = system.tuning, 0.0, run.polynomial
    degree = polynomial.shape[0] - 1
    records_extrema = summary[0, orbit.X_MAX] < math.inf
    copy(run.modal_state, run.mode_buffer)
    for j in range(m):
        orbit.add_contact_time(
            run.contact[j],
            length * tuning,
            system.below_mean[run.contact[j] + 1, segment, j],
            summary[j],
        )
    while elapsed < length:
        step = min(interval_length, length - elapsed) if records_extrema else length
        searches_extrema = records_extrema
        if records_extrema and step < length - elapsed:
            mode_count = fill_amplitudes(tables, combination, run.mode_buffer, run.amplitudes)
            if _motion_stays_within_extrema(
                system, tables, combination, run, segment, summary, mode_count
            ):
                step, searches_extrema = length - elapsed, False
                copy(run.mode_buffer, run.sampled_modes)
                advance_modes_in_time(tables, combination, run, step, run.sampled_modes)
                for j in range(m):
                    contact = run.contact[j]
                    if contact != NO_CONTACT:
                        side = 0 if contact == COAST else 1
                        impulse = _integrate_distance(
                            tables, combination, side, j, run.mode_buffer, run.sampled_modes, step
                        )
                        impulse *= tuning * system.stiffness[contact + 1, segment, j]
                        summary[j, orbit.FORCE_SUM] += impulse
        for j in range(m if searches_extrema else 0):
            mesh_summary, contact = summary[j], run.contact[j]
            _fill_distance(tables, combination, 1, j, run)
            restrict_to_start(polynomial, step / interval_length, degree)
            stiffness = 0.0 if contact == NO_CONTACT else system.stiffness[contact + 1, segment, j]
            _update_extrema(
                polynomial, True, stiffness if contact == DRIVE else 0.0, run, mesh_summary
            )
            if contact == NO_CONTACT:
                continue
            if contact == COAST:
                _fill_distance(tables, combination, 0, j, run)
                restrict_to_start(polynomial, step / interval_length, degree)
                _update_extrema(polynomial, False, stiffness, run, mesh_summary)
            for k in range(degree + 1):
                mesh_summary[orbit.FORCE_SUM] += (
                    step * tuning * stiffness * polynomial[k] / (degree + 1)
                )
        step_start = phase + elapsed * tuning
        step_end = step_start + step * tuning - 1e-12
        while run.counters[SAMPLES_TAKEN] < samples.shape[0]:
            sample = run.counters[SAMPLES_TAKEN]
            sample_phase = samples[sample, n + m]
            if sample_phase >= step_end:
                break
            t = max(sample_phase - step_start, 0.0) / tuning
            if combination == SERIES:
                sum_series(run.series, n, t / interval_length, run.sampled_state)
            else:
                copy(run.mode_buffer, run.sampled_modes)
                advance_modes_in_time(tables, combination, run, t, run.sampled_modes)
                apply_stored_matrix(
                    tables.from_modes, combination, run.sampled_modes, run.sampled_state
                )
            copy(run.sampled_state, samples[sample, :n])
            for j in range(m):
                samples[sample, n + j] = run.contact[j]
            samples[sample, n + m] = segment
            run.counters[SAMPLES_TAKEN] = sample + 1
        elapsed += step
        if elapsed < length:
            advance_modes_in_time(tables, combination, run, step, run.mode_buffer)
