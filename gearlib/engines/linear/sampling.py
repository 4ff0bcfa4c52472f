"""Summary and samples of a gear train: extrema and contact times of each mesh."""

import math

from gearlib.engines import orbit
from gearlib.engines.codes import COAST, DRIVE, NO_CONTACT
from gearlib.engines.jit import inlined_without_refcounts, kernel_without_refcounts
from gearlib.engines.linear.distances import (
    distance_amplitude,
    fill_amplitudes,
    fill_curve,
    restrict_to_start,
)
from gearlib.engines.linear.modal_arcs import advance_modes_in_time, apply_stored_matrix
from gearlib.engines.linear.sparse_series import SERIES, sum_series
from gearlib.engines.linear.train_system import SAMPLES_TAKEN
from gearlib.engines.matrices import copy
from gearlib.engines.polynomial import bernstein_maximum


@kernel_without_refcounts
def _add_extrema(curve, is_displacement, stiffness, work, row):
    """Update the extrema of displacement and force of a mesh, in `row`, by a polynomial on [0, 1].

    `curve` holds the Bernstein coefficients of the mesh's distance from a flank line. If
    `is_displacement`, this distance is the displacement of the mesh. If `stiffness` is positive,
    the distance times the stiffness is the mesh force. `work` (`RunStorage`) has the storage of the
    search.
    """
    degree = curve.shape[0] - 1
    for sign, displacement_column, force_column in (
        (1.0, orbit.X_MAX, orbit.FORCE_MAX),
        (-1.0, orbit.X_MIN, orbit.FORCE_MIN),
    ):
        # Extrema above this bound are new. Minima are treated as maxima of the negative curve.
        lower_bound = sign * row[displacement_column] if is_displacement else math.inf
        largest = -math.inf
        if stiffness > 0.0:
            lower_bound = min(lower_bound, sign * row[force_column] / stiffness)
        for k in range(degree + 1):
            work.search[0, k] = sign * curve[k]
            largest = max(largest, work.search[0, k])
        # The largest coefficient is an upper limit, which excludes new extrema in most pieces.
        if largest <= lower_bound:
            continue
        extremum = bernstein_maximum(work.search, degree, lower_bound)
        if is_displacement and not extremum <= sign * row[displacement_column]:
            row[displacement_column] = sign * extremum
        if stiffness > 0.0 and not stiffness * extremum <= sign * row[force_column]:
            row[force_column] = sign * stiffness * extremum


@inlined_without_refcounts
def _fill_distance(tables, combination, side, j, work):
    """Fill `work.curve` with the Bernstein coefficients of mesh j's distance from a flank line.

    `side` is 0 for the coast and 1 for the drive side. `combination` is the row of the mode tables
    `tables` for the present contacts, and the modal state is ``work.mode_buffer``; if it is SERIES,
    the distance is given by its Taylor series, ``work.distance_series``.
    """
    if combination == SERIES:
        fill_curve(work.to_bernstein, work.distance_series[side, j], work.curve)
    else:
        fill_curve(tables.curves[combination, side, j], work.mode_buffer, work.curve)


@inlined_without_refcounts
def _extrema_stay_within_summary(system, tables, combination, work, segment, summary, mode_count):
    """Return whether all meshes provably stay within their extrema until a contact changes.

    `summary` has a row of extrema for each mesh. The distances from the flank lines lie between
    their constant part and plus or minus the sum of the amplitudes of the modes, of which there are
    `mode_count` in `work` (`RunStorage`). `combination` is the row of the mode tables `tables` for
    the present contacts, and `segment` the index of the stiffness segment in the `TrainSystem`
    `system`.
    """
    for j in range(work.contact.shape[0]):
        row, code = summary[j], work.contact[j]
        if not tables.is_bounded[combination, 1, j] or not tables.is_bounded[combination, 0, j]:
            return False
        center = tables.constant_distance[combination, 1, j]
        amplitude = distance_amplitude(tables, combination, 1, j, work, mode_count)
        if center + amplitude > row[orbit.X_MAX] or center - amplitude < row[orbit.X_MIN]:
            return False
        if code == COAST:
            center = tables.constant_distance[combination, 0, j]
            amplitude = distance_amplitude(tables, combination, 0, j, work, mode_count)
        stiffness = system.stiffness[code + 1, segment, j] if code != NO_CONTACT else 0.0
        high, low = stiffness * (center + amplitude), stiffness * (center - amplitude)
        if high > row[orbit.FORCE_MAX] or low < row[orbit.FORCE_MIN]:
            return False
    return True


@inlined_without_refcounts
def _distance_integral(tables, combination, side, j, start, end, t):
    """Return the integral over the time t of mesh j's distance from a flank line.

    `side` is 0 for the coast and 1 for the drive side. `start` and `end` are the states in modal
    coordinates at the ends of this time; `combination` is the row of the mode tables `tables` for
    the present contacts. Each mode is exponential, so that its integral is its change over its
    rate.
    """
    pair_count = tables.pair_counts[combination]
    total = tables.constant_distance[combination, side, j] * t
    rates = tables.rates[combination]
    # The first coefficient of a curve is the component of a mode in the distance.
    curves = tables.curves[combination, side, j]
    for k in range(pair_count):
        # The pair u + i v is divided by its complex rate, growth + i frequency.
        growth, frequency = rates[k, 0], rates[k, 1]
        u, v = end[2 * k] - start[2 * k], end[2 * k + 1] - start[2 * k + 1]
        p, q = growth * u + frequency * v, growth * v - frequency * u
        total += (curves[2 * k, 0] * p + curves[2 * k + 1, 0] * q) / (
            growth * growth + frequency * frequency
        )
    for k in range(tables.real_counts[combination]):
        i = 2 * pair_count + k
        total += curves[i, 0] * (end[i] - start[i]) / rates[pair_count + k, 0]
    return total


@kernel_without_refcounts
def sample_motion(
    system, tables, combination, work, segment, phase, length, piece_length, summary, samples
):
    """Record a motion without contact changes in the summary and the samples of all meshes.

    The motion begins at `phase`, in a segment, with the modal state in `work` and lasts `length` in
    theta; polynomials of distances hold over `piece_length`. `combination` is a row of `tables` or
    SERIES. The summary has a row for each mesh. Samples have the columns: state, shape (n,),
    contact codes, shape (m,), segment; the last column has the phase of a sample until it is
    filled. After a failed search for the largest displacement of the first mesh, which is then NaN,
    there are no further searches.
    """
    m, n = system.drive_lines.shape
    tuning, elapsed, curve = system.tuning, 0.0, work.curve
    degree = curve.shape[0] - 1
    records_extrema = summary[0, orbit.X_MAX] < math.inf
    copy(work.modal_state, work.mode_buffer)
    for j in range(m):
        orbit.add_contact_time(
            work.contact[j],
            length * tuning,
            system.below_mean[work.contact[j] + 1, segment, j],
            summary[j],
        )
    while elapsed < length:
        step = min(piece_length, length - elapsed) if records_extrema else length
        searches_extrema = records_extrema
        if records_extrema and step < length - elapsed:
            mode_count = fill_amplitudes(tables, combination, work.mode_buffer, work.amplitudes)
            if _extrema_stay_within_summary(
                system, tables, combination, work, segment, summary, mode_count
            ):
                step, searches_extrema = length - elapsed, False
                copy(work.mode_buffer, work.sampled_modes)
                advance_modes_in_time(tables, combination, work, step, work.sampled_modes)
                for j in range(m):
                    code = work.contact[j]
                    if code != NO_CONTACT:
                        side = 0 if code == COAST else 1
                        impulse = _distance_integral(
                            tables, combination, side, j, work.mode_buffer, work.sampled_modes, step
                        )
                        impulse *= tuning * system.stiffness[code + 1, segment, j]
                        summary[j, orbit.FORCE_SUM] += impulse
        for j in range(m if searches_extrema else 0):
            row, code = summary[j], work.contact[j]
            _fill_distance(tables, combination, 1, j, work)
            restrict_to_start(curve, step / piece_length, degree)
            stiffness = 0.0 if code == NO_CONTACT else system.stiffness[code + 1, segment, j]
            _add_extrema(curve, True, stiffness if code == DRIVE else 0.0, work, row)
            if code == NO_CONTACT:
                continue
            if code == COAST:
                _fill_distance(tables, combination, 0, j, work)
                restrict_to_start(curve, step / piece_length, degree)
                _add_extrema(curve, False, stiffness, work, row)
            for k in range(degree + 1):
                row[orbit.FORCE_SUM] += step * tuning * stiffness * curve[k] / (degree + 1)
        step_start = phase + elapsed * tuning
        step_end = step_start + step * tuning - 1e-12
        while work.counters[SAMPLES_TAKEN] < samples.shape[0]:
            sample = work.counters[SAMPLES_TAKEN]
            sample_phase = samples[sample, n + m]
            if sample_phase >= step_end:
                break
            t = max(sample_phase - step_start, 0.0) / tuning
            if combination == SERIES:
                sum_series(work.series, n, t / piece_length, work.sampled_state)
            else:
                copy(work.mode_buffer, work.sampled_modes)
                advance_modes_in_time(tables, combination, work, t, work.sampled_modes)
                apply_stored_matrix(
                    tables.from_modes, combination, work.sampled_modes, work.sampled_state
                )
            copy(work.sampled_state, samples[sample, :n])
            for j in range(m):
                samples[sample, n + j] = work.contact[j]
            samples[sample, n + m] = segment
            work.counters[SAMPLES_TAKEN] = sample + 1
        elapsed += step
        if elapsed < length:
            advance_modes_in_time(tables, combination, work, step, work.mode_buffer)
