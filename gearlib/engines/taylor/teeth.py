"""One mesh with individual pairs of teeth: Taylor steps end where a pair touches or separates.

While the same pairs are in contact, the displacement x as a function of time follows

    x'' = s (L - a x + b) - d (x' - e'),

where a and b are parabolas in the mesh phase tau in each segment, and L is the load. At constant
speed the time is the phase, and s = 1 / nu^2. In a run-up the time is theta, s = 1, L is linear in
theta, and the phase is quadratic in theta, so that a and b have degree 4. The contact mask is an
integer with one bit for each of the k pairs; 0 means no contact, and 2^k contact of the coast side.
If the other pairs in the mask carry the load, pair i has the overlap p x - r, and it is in contact
if this is > 0. Displacements are in units of the static deflection, forces in units of the load.
The series converges to rounding in steps below 1.18 over the natural frequency. A step ends at the
end of its segment or at the first crossing at which a pair touches or separates.
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.engines import orbit
from gearlib.engines.codes import (
    COAST,
    DRIVE,
    EVENT_LIMIT,
    JAMMED,
    NO_CONTACT,
    OK,
    OVERFLOW,
    UNRESOLVED,
)
from gearlib.engines.jit import kernel, kernel_part
from gearlib.engines.orbit import is_within_range
from gearlib.engines.pair.maps import multiply_from_left
from gearlib.engines.polynomial import WORKSPACE_ROWS, parabola_minimum
from gearlib.engines.protocol import Engine
from gearlib.engines.taylor import propagator
from gearlib.engines.taylor.perturbations import set_identity
from gearlib.engines.taylor.propagator import (
    add_samples,
    add_step_to_summary,
    first_crossing,
    samples_of_period,
)
from gearlib.engines.taylor.series import (
    DISPLACEMENT,
    INVERSE_INTEGERS,
    MESH_FORCE,
    ORDER,
    ROWS,
    STIFFNESS,
    VELOCITY,
    state_at,
)

#: Coefficients of a linear form factor * x - offset by powers 0 to 2 of the phase since the start
#: of a segment, first of the factor (a or p), then of the offset (b or r).
FACTOR, FACTOR_SLOPE, FACTOR_SQUARE, OFFSET, OFFSET_SLOPE, OFFSET_SQUARE = range(6)
#: Degree of factor and offset as polynomials in time, and the higher coefficients of a constant.
_DEGREE, _ZEROS = 4, (0.0, 0.0, 0.0, 0.0)
#: A series is truncated after this many consecutive terms below this fraction of x, because each
#: term depends on the five terms before it.
_SMALL_TERMS, _SMALL_TERM = 5, 1e-17


class ToothPairSystem(NamedTuple):
    """One mesh in p segments of time: k pairs of teeth with parabolas in m intervals of phase.

    At constant speed, segments and intervals are the same, and the time is the mesh phase.
    """

    starts: np.ndarray  #: phases that bound the intervals, shape (m + 1,)
    times: np.ndarray  #: start times of the segments in their mesh period, shape (p,)
    lengths: np.ndarray  #: durations of the segments, shape (p,)
    first_segment: np.ndarray  #: int, first segment of each mesh period, (excitation_period + 1,)
    summary_blocks: np.ndarray  #: int, summary of each mesh period, shape (excitation_period,)
    intervals: np.ndarray  #: int, interval of phase of each segment, shape (p,)
    start_phases: np.ndarray  #: phase from the start of the interval to the segment, shape (p,)
    speeds: np.ndarray  #: dtau/dt at the starts of the segments, shape (p,)
    acceleration: float  #: derivative of the speed by time
    loads: np.ndarray  #: L at the starts of the segments, shape (p,)
    load_rate: float  #: derivative of L by time
    pairs_change: np.ndarray  #: bool, whether pairs change at the start of an interval, shape (m,)
    active_pairs: np.ndarray  #: int, mask of the pairs on their path of contact, shape (m,)
    force_coefficients: np.ndarray  #: a and b by contact mask, shape (m, 2^k + 1, 6)
    overlap_coefficients: np.ndarray  #: p and r by mask of the other pairs, (m, 2^k, k, 6)
    gap_rate: np.ndarray  #: e', derivative of the unloaded gap by phase, shape (m,)
    damping: np.ndarray  #: d in free flight and in contact, shape (2,)
    coast_line: float  #: displacement at which the coast side touches, may be -inf
    max_step: float  #: largest step in time
    tuning: float  #: nu at constant speed, otherwise 1
    excitation_period: int  #: mesh periods after which the segments repeat
    may_jam: bool  #: whether pairs of teeth and the coast side may touch at once


@kernel_part(inlined=True)
def _evaluate_linear_form(form, t, x):
    """Return factor * x - offset, a force or an overlap, at the displacement x and the phase t.

    `form`, shape (6,), has the three coefficients of the factor and then of the offset, both
    parabolas in t, which counts from the start of a segment.
    """
    factor = form[FACTOR] + t * (form[FACTOR_SLOPE] + t * form[FACTOR_SQUARE])
    return factor * x - form[OFFSET] - t * (form[OFFSET_SLOPE] + t * form[OFFSET_SQUARE])


@kernel_part
def find_contact_mask(overlaps, active_mask, coast_line, t, x):
    """Return the mask of the tooth pairs that are in contact at a displacement x and a phase t.

    A mask is an integer with one bit for each of the k pairs; 2^k is contact of the coast side,
    which touches below `coast_line`. Bits of `active_mask` mark pairs on their path of contact. If
    the pairs of a mask carry the load, another pair i has the overlap factor * x - offset with the
    coefficients ``overlaps[mask, i]``, shape (6,), and it is in contact if this is positive.
    """
    # All pairs of the wanted mask overlap and no other pair does, up to rounding.
    coast_mask, pair_count = overlaps.shape[0], overlaps.shape[1]
    best_mask, min_violation = 0, math.inf
    for contact_mask in range(coast_mask):
        if contact_mask & ~active_mask:
            continue
        violation = 0.0
        for i in range(pair_count):
            if active_mask >> i & 1:
                pair_bit = 1 << i
                value = _evaluate_linear_form(overlaps[contact_mask & ~pair_bit, i], t, x)
                violation = max(violation, -value if contact_mask & pair_bit else value)
        if violation < min_violation:
            best_mask, min_violation = contact_mask, violation
    return coast_mask if best_mask == 0 and x < coast_line else best_mask


@kernel_part(inlined=True)
def _expand_parabola(value, slope, square, t, speed, acceleration):
    """Return the five Taylor coefficients in time of a parabola in the mesh phase.

    The parabola is value + slope * phase + square * phase^2. At time 0 the phase is t and its rate
    is `speed`, which grows by `acceleration` per unit of time.
    """
    phase_slope, half_acceleration = slope + 2.0 * square * t, 0.5 * acceleration
    return (
        value + t * (slope + t * square),
        phase_slope * speed,
        phase_slope * half_acceleration + square * speed * speed,
        2.0 * square * speed * half_acceleration,
        square * half_acceleration * half_acceleration,
    )


@kernel_part(inlined=True)
def _expand_linear_form(form, t, speed, acceleration):
    """Return the Taylor coefficients in time of the factor and of the offset, five each.

    `form`, shape (6,), has the coefficients of the linear form factor * x - offset in powers of the
    mesh phase. At time 0 the phase is t, its rate is `speed`, and the derivative of this rate is
    `acceleration`.
    """
    factors = form[FACTOR], form[FACTOR_SLOPE], form[FACTOR_SQUARE]
    offsets = form[OFFSET], form[OFFSET_SLOPE], form[OFFSET_SQUARE]
    return (
        _expand_parabola(*factors, t, speed, acceleration),
        _expand_parabola(*offsets, t, speed, acceleration),
    )


@kernel_part(inlined=True)
def _fill_linear_form(series, quantity, expansion):
    """Fill the row `quantity` of `series` with the Taylor series in time of factor * x - offset.

    `expansion` has five Taylor coefficients of the factor and five of the offset. The row
    DISPLACEMENT of `series` holds x.
    """
    factors, offsets = expansion
    for k in range(ORDER + 1):
        value = factors[0] * series[DISPLACEMENT, k]
        for j in range(1, min(k, _DEGREE) + 1):
            value += factors[j] * series[DISPLACEMENT, k - j]
        series[quantity, k] = value - offsets[k] if k <= _DEGREE else value


@kernel_part(inlined=True)
def _expand_motion(expansion, load, load_rate, damping, force_scale, x, v, step, max_step, series):
    """Fill the Taylor series of the motion that starts from (x, v), as far as a step needs it.

    The equation is x'' = load - damping * x' - force_scale * (factor * x - offset). `expansion` has
    the Taylor coefficients of factor and offset. `load`, with the derivative `load_rate`, includes
    the damping force due to the gap. `step` is the length of the step, at most `max_step`. Returns
    the changes of x and v in the step, and the sum of the magnitudes of the terms of x beyond the
    square term.
    """
    (a0, a1, a2, a3, a4), (b0, b1, b2, b3, b4) = expansion
    a0, a1, a2, b0 = force_scale * a0, force_scale * a1, force_scale * a2, force_scale * b0
    a3, a4, b1, b2 = force_scale * a3, force_scale * a4, force_scale * b1, force_scale * b2
    b3, b4 = force_scale * b3, force_scale * b4
    series[DISPLACEMENT, 0], series[VELOCITY, 0] = x, v
    x_change, v_change, tail, power, small_terms = 0.0, 0.0, 0.0, 1.0, 0
    # Coefficients k to k - 4 of x, and coefficient k of v.
    x_k, x_1, x_2, x_3, x_4, v_k = x, 0.0, 0.0, 0.0, 0.0, v
    small_term = _SMALL_TERM * max(1.0, abs(x)) / max_step
    count = ORDER
    for k in range(ORDER):
        force = a0 * x_k + (a1 * x_1 + a2 * x_2 + a3 * x_3 + a4 * x_4 - b0)
        series[MESH_FORCE, k] = force
        x_4, x_3, x_2, x_1, x_k = x_3, x_2, x_1, x_k, v_k * INVERSE_INTEGERS[k]
        # The recursion of v takes most of the time, so its chain of operations is kept short.
        v_k = (load - force) * INVERSE_INTEGERS[k] - (damping * INVERSE_INTEGERS[k]) * v_k
        series[DISPLACEMENT, k + 1], series[VELOCITY, k + 1] = x_k, v_k
        load, load_rate, b0, b1, b2, b3, b4 = load_rate, 0.0, b1, b2, b3, b4, 0.0
        power *= step
        term, v_term = x_k * power, v_k * power
        x_change += term
        v_change += v_term
        if k >= 2:
            tail += abs(term)
            small_terms = small_terms + 1 if abs(v_term) < small_term else 0
            if small_terms == _SMALL_TERMS:
                count = k + 1
                break
    series[MESH_FORCE, count] = 0.0
    for k in range(count + 1, ORDER + 1):
        series[DISPLACEMENT, k] = series[VELOCITY, k] = series[MESH_FORCE, k] = 0.0
    series[STIFFNESS, 0], series[STIFFNESS, 1], series[STIFFNESS, 2] = a0, a1, a2
    series[STIFFNESS, 3], series[STIFFNESS, 4] = a3, a4
    return x_change, v_change, tail


@kernel_part(inlined=True)
def _keeps_sign(expansion, sign, step, tail, series):
    """Return whether bounds prove that sign * (factor * x - offset) stays positive in a step.

    The terms up to the square term form a parabola, whose minimum must exceed a bound of all other
    terms. `expansion` has the Taylor coefficients of factor and offset, and `series` holds the
    Taylor series of x. `step` is the length of the step, and `tail` is the sum of the magnitudes of
    the terms of x beyond the square term.
    """
    (a0, a1, a2, a3, a4), (b0, b1, b2, b3, b4) = expansion
    square_step = step * step
    a1, a2, a3 = a1 * step, a2 * square_step, a3 * step * square_step
    a4, b1, b2 = a4 * square_step * square_step, b1 * step, b2 * square_step
    x_0, x_1 = series[DISPLACEMENT, 0], series[DISPLACEMENT, 1] * step
    x_2 = series[DISPLACEMENT, 2] * square_step
    constant, slope = a0 * x_0 - b0, a0 * x_1 + a1 * x_0 - b1
    square = a0 * x_2 + a1 * x_1 + a2 * x_0 - b2
    high_terms = abs(a3) + abs(a4)
    # Bound of all products of terms whose total degree is 3 or more.
    remainder = (abs(a0) + abs(a1) + abs(a2) + high_terms) * tail + high_terms * (
        abs(x_0) + abs(x_1) + abs(x_2)
    )
    remainder += (abs(a1) + abs(a2)) * abs(x_2) + abs(a2 * x_1)
    remainder += (abs(b3) + abs(b4) * step) * step * square_step
    return parabola_minimum(sign * constant, sign * slope, sign * square) > remainder


@kernel_part
def _map_step(form, t, damping, force_scale, step, map_matrix):
    """Multiply a map of perturbations, shape (2, 2), from the left by the map of a Taylor step.

    The map of the step is the derivative of (x, x') at its end with respect to its start. The step
    has the length `step` and starts at the phase t since the start of a segment. The mesh force is
    `force_scale` * (factor * x - offset) with the coefficients `form`, shape (6,).
    """
    stiffness = (form[FACTOR] + t * (form[FACTOR_SLOPE] + t * form[FACTOR_SQUARE])) * force_scale
    slope = (form[FACTOR_SLOPE] + 2.0 * form[FACTOR_SQUARE] * t) * force_scale
    square = form[FACTOR_SQUARE] * force_scale
    image = np.empty((2, 2))
    # Column j is the motion of a perturbation that starts as (1, 0) or (0, 1).
    for j in range(2):
        older_term, previous_term, term, velocity_term = 0.0, 0.0, 1.0 - j, 1.0 * j
        displacement, velocity, power = term, velocity_term, 1.0
        for k in range(ORDER):
            force = stiffness * term + slope * previous_term + square * older_term
            older_term, previous_term, term = previous_term, term, velocity_term / (k + 1.0)
            velocity_term = -(force + damping * velocity_term) / (k + 1.0)
            power *= step
            displacement += term * power
            velocity += velocity_term * power
        image[0, j], image[1, j] = displacement, velocity
    multiply_from_left(image[0, 0], image[0, 1], image[1, 0], image[1, 1], map_matrix)


@kernel_part(inlined=True)
def _first_contact_event(
    overlaps,
    active_mask,
    coast_line,
    may_jam,
    contact_mask,
    start_pair,
    t,
    speed,
    acceleration,
    step,
    tail,
    series,
    to_bernstein,
    workspace,
):
    """Return (fraction of a step, pair index) of the first pair that touches or separates.

    The step, of length `step`, starts at the phase t of an interval of phase, which has the overlap
    coefficients `overlaps`, (2^k, k, 6), and the active pairs `active_mask`; the phase grows with
    `speed` and `acceleration`. `contact_mask` is the mask of the pairs in contact, or 2^k for
    contact of the coast side, below `coast_line`, which has the pair index k. The fraction is 2 if
    there is no event and -1 if rounding decides whether there is one. At the start of the step,
    pair `start_pair` has zero overlap (-1: no pair). If the mesh `may_jam`, contact on the other
    side is also an event. The first rows of `series` hold the motion, and the row ROWS is
    overwritten; `tail` is the sum of the magnitudes of the terms of x beyond the square term.
    `to_bernstein` converts power to Bernstein coefficients, and `workspace` is overwritten.
    """
    coast_mask, pair_count = overlaps.shape[0], overlaps.shape[1]
    first_fraction, first_pair = 2.0, -1
    for i in range(pair_count + 1):
        is_coast = i == pair_count
        if is_coast:
            if coast_line == -math.inf or not (
                may_jam or contact_mask == 0 or contact_mask == coast_mask
            ):
                continue
            expansion, touches = ((1.0, *_ZEROS), (coast_line, *_ZEROS)), contact_mask == coast_mask
            sign = -1.0 if touches else 1.0
        else:
            pair_bit = 1 << i
            if (contact_mask == coast_mask and not may_jam) or not active_mask & pair_bit:
                continue
            touches = contact_mask != coast_mask and contact_mask & pair_bit != 0
            other_pairs = contact_mask & ~pair_bit if contact_mask != coast_mask else 0
            expansion = _expand_linear_form(overlaps[other_pairs, i], t, speed, acceleration)
            sign = 1.0 if touches else -1.0
        if start_pair != i and _keeps_sign(expansion, sign, step, tail, series):
            continue
        _fill_linear_form(series, ROWS, expansion)
        if start_pair == i:
            series[ROWS, 0] = 0.0
        fraction = first_crossing(series, ROWS, 0.0, sign, step, to_bernstein, workspace)
        if fraction < first_fraction:
            first_fraction, first_pair = fraction, i
    return first_fraction, first_pair


@kernel_part(inlined=True)
def _contact_state_of_mask(contact_mask, coast_mask):
    """Return the contact state (drive 1, none 0, coast -1) for a contact mask.

    A mask has one bit per pair of drive-side teeth; 0 means no contact, and `coast_mask` contact of
    the coast side.
    """
    if contact_mask == 0:
        return NO_CONTACT
    return COAST if contact_mask == coast_mask else DRIVE


@kernel
def run_tooth_pairs(
    system,
    to_bernstein,
    x,
    v,
    periods,
    record_periods,
    samples,
    events,
    max_events,
    summaries,
    period_maps,
    first_period,
):
    """Run a mesh with individual pairs of teeth, as `pair.pair_run.run` runs a gear pair.

    Arguments and results have the same meaning. `system` is the `ToothPairSystem`; `summaries` has
    a row for each of its `summary_blocks`. `period_maps`, shape (periods, 2, 2) or (0, 2, 2), is
    filled with the derivatives of the state after each period with respect to the state before it,
    at constant speed only. The run starts in mesh period `first_period` of the excitation period.
    The last result is the number of Taylor steps.
    """
    for block in range(summaries.shape[0]):
        orbit.clear_summary(summaries[block])
    first_segment, active_mask = system.first_segment, system.active_pairs
    blocks, intervals, start_phases = system.summary_blocks, system.intervals, system.start_phases
    speeds, acceleration = system.speeds, system.acceleration
    loads, load_rate = system.loads, system.load_rate
    times, lengths, pairs_change = system.times, system.lengths, system.pairs_change
    forces, overlaps = system.force_coefficients, system.overlap_coefficients
    gap_rate, damping_levels = system.gap_rate, system.damping
    coast_line, max_step, tuning = system.coast_line, system.max_step, system.tuning
    may_jam = system.may_jam
    pair_count, coast_mask = overlaps.shape[2], overlaps.shape[1]
    force_scale = 1.0 / (tuning * tuning)
    series, workspace = np.zeros((ROWS + 1, ORDER + 1)), np.empty((WORKSPACE_ROWS, ORDER + 2))
    strobe_count = min(periods, orbit.stored_state_count(system.excitation_period))
    strobe_states = np.empty((strobe_count + 1, 2))
    event_rows, steps, contact_mask, start_pair = 0, 0, 0, -1
    for period in range(periods):
        strobe = period - (periods - strobe_count)
        if strobe >= 0:
            strobe_states[strobe, 0], strobe_states[strobe, 1] = x, v
        recorded_period = period - (periods - record_periods)
        sample_count, event_count = 0, 0
        if period_maps.shape[0] > 0:
            set_identity(period_maps[period])
        mesh_period = (first_period + period) % system.excitation_period
        summary, last_segment = summaries[blocks[mesh_period]], first_segment[mesh_period + 1] - 1
        duration = times[last_segment] + lengths[last_segment]
        period_samples = samples_of_period(samples, recorded_period, record_periods, duration)
        for segment in range(first_segment[mesh_period], first_segment[mesh_period + 1]):
            is_run_start = period == 0 and segment == first_segment[mesh_period]
            interval = intervals[segment]
            segment_overlaps, active_pairs = overlaps[interval], active_mask[interval]
            if is_run_start or pairs_change[interval]:
                contact_before = _contact_state_of_mask(contact_mask, coast_mask)
                contact_mask = find_contact_mask(
                    segment_overlaps, active_pairs, coast_line, start_phases[segment], x
                )
                start_pair = -1
                contact_after = _contact_state_of_mask(contact_mask, coast_mask)
                if contact_after == DRIVE and x < coast_line:
                    return x, v, 0, events, 0, JAMMED, steps
                if recorded_period >= 0 and contact_after != contact_before and not is_run_start:
                    events, event_rows = orbit.record_event(
                        events,
                        event_rows,
                        period,
                        times[segment],
                        contact_before,
                        contact_after,
                        v,
                        summary,
                    )
            time, length = 0.0, lengths[segment]
            while time < length:
                damping = damping_levels[1 if contact_mask else 0]
                speed = speeds[segment] + acceleration * time
                t = start_phases[segment] + 0.5 * (speeds[segment] + speed) * time
                contact_state = _contact_state_of_mask(contact_mask, coast_mask)
                force_form = forces[interval, contact_mask]
                h = min(max_step, length - time)
                if length - time - h < 1e-13:
                    h = length - time
                gap_force = damping * gap_rate[interval]
                x_change, v_change, tail = _expand_motion(
                    _expand_linear_form(force_form, t, speed, acceleration),
                    force_scale * (loads[segment] + load_rate * time) + gap_force * speed,
                    force_scale * load_rate + gap_force * acceleration,
                    damping,
                    force_scale,
                    x,
                    v,
                    h,
                    max_step,
                    series,
                )
                event_fraction, pair = _first_contact_event(
                    segment_overlaps,
                    active_pairs,
                    coast_line,
                    may_jam,
                    contact_mask,
                    start_pair,
                    t,
                    speed,
                    acceleration,
                    h,
                    tail,
                    series,
                    to_bernstein,
                    workspace,
                )
                if event_fraction < 0.0:
                    return x, v, 0, events, 0, UNRESOLVED, steps
                if event_fraction <= 1.0 and (
                    contact_mask != 0 and pair == pair_count
                    if contact_mask != coast_mask
                    else pair < pair_count
                ):
                    return x, v, 0, events, 0, JAMMED, steps
                if event_fraction > 1.0:
                    x, v = x + x_change, v + v_change
                else:
                    h *= event_fraction
                    x, v = state_at(series, h)
                steps += 1
                if not is_within_range(x, v):
                    return x, v, 0, events, 0, OVERFLOW, steps
                if period_maps.shape[0] > 0:
                    _map_step(force_form, t, damping, force_scale, h, period_maps[period])
                if recorded_period >= 0:
                    # A single pair of teeth has the lower stiffness.
                    is_low = contact_mask < coast_mask and contact_mask & (contact_mask - 1) == 0
                    add_step_to_summary(
                        tuning, is_low, to_bernstein, h, contact_state, series, workspace, summary
                    )
                    if orbit.has_unresolved_extremum(summary):
                        return x, v, 0, events, 0, UNRESOLVED, steps
                    step_start = times[segment] + time
                    sample_count = add_samples(
                        tuning, step_start, h, contact_state, series, period_samples, sample_count
                    )
                time += h
                if event_fraction > 1.0:
                    start_pair = -1
                    continue
                event_count += 1
                if event_count > max_events:
                    return x, v, 0, events, 0, EVENT_LIMIT, steps
                start_pair = pair
                contact_mask = (
                    (coast_mask if contact_mask == 0 else 0)
                    if pair == pair_count
                    else contact_mask ^ (1 << pair)
                )
                contact_after = _contact_state_of_mask(contact_mask, coast_mask)
                if period_maps.shape[0] > 0:
                    jump = (
                        _evaluate_linear_form(forces[interval, contact_mask], time, x)
                        - _evaluate_linear_form(force_form, time, x)
                    ) * force_scale
                    jump += (damping_levels[1 if contact_mask else 0] - damping) * (
                        v - gap_rate[interval]
                    )
                    factor, rate = 1.0, v
                    if pair < pair_count:
                        form = segment_overlaps[contact_mask & ~(1 << pair), pair]
                        factor, factor_slope, _, _, _ = _expand_parabola(
                            form[FACTOR], form[FACTOR_SLOPE], form[FACTOR_SQUARE], time, 1.0, 0.0
                        )
                        offset_slope = form[OFFSET_SLOPE] + 2.0 * form[OFFSET_SQUARE] * time
                        rate = factor * v + factor_slope * x - offset_slope
                    # The saltation matrix of a tangential crossing is the identity.
                    if rate != 0.0:
                        multiply_from_left(
                            1.0, 0.0, -jump * factor / rate, 1.0, period_maps[period]
                        )
                if contact_after != contact_state and recorded_period >= 0:
                    event_time = times[segment] + time
                    events, event_rows = orbit.record_event(
                        events,
                        event_rows,
                        period,
                        event_time,
                        contact_state,
                        contact_after,
                        v,
                        summary,
                    )
    strobe_states[strobe_count, 0], strobe_states[strobe_count, 1] = x, v
    displacement_range = summaries[0, orbit.X_MAX] - summaries[0, orbit.X_MIN]
    orbit_period = orbit.orbit_period(
        strobe_states, tuning, displacement_range, system.excitation_period
    )
    return x, v, orbit_period, events, event_rows, OK, steps


class Propagator(propagator.Propagator):
    """Engine of a `LoadSharingPair` at one tuning, by Taylor steps."""

    at = Engine.at

    def __init__(self, model, tuning: float):
        """Tabulate the pairs of teeth of a model at a tuning."""
        Engine.__init__(self, model, tuning)
        self.system = model.system(tuning)

    def run_kernel(self, x, v, periods, recorded, tables, first_period):
        """Run from displacement x and velocity v with `run_tooth_pairs` and return its result.

        `recorded` is the number of recorded periods at the end of the run. `tables` are (samples,
        events, largest number of events per period, summary, period maps); the run starts in mesh
        period `first_period` of the excitation period.
        """
        samples, events, max_events, summary, maps = tables
        tables = samples, events, max_events, summary.reshape(1, -1), maps
        arguments = x, v, periods, recorded, *tables, first_period
        return run_tooth_pairs(self.system, propagator.TO_BERNSTEIN, *arguments)
