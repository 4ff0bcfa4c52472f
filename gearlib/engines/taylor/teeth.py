"""One mesh with individual pairs of teeth: Taylor steps end where a pair touches or separates.

While the same set of pairs touches, the displacement x as a function of time follows

    x'' = s (L - a x + b) - d (x' - e'),

where a and b are parabolas in the mesh phase tau on each segment, and L is the load. At constant
speed the time is the phase and s = 1 / nu^2. In a run-up it is theta, s = 1, L is linear in theta,
and the phase is quadratic in theta, so that a and b have the degree 4. A set of the k pairs is an
integer with a bit for each pair; set 0 is no contact and set 2^k the contact of the coast side.
If the other pairs of a set carry the load, pair i overlaps by p x - r, and touches where this is
> 0. Displacements are in static deflections, forces over the load. The series converges to rounding
on steps below 1.18 over the natural frequency. A step ends with its segment and at the first
crossing of its polynomial, where a pair touches or separates.
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
from gearlib.engines.jit import inlined_kernel, kernel
from gearlib.engines.orbit import is_within_range
from gearlib.engines.pair.maps import multiply_from_left
from gearlib.engines.polynomial import WORK_ROWS, parabola_minimum
from gearlib.engines.protocol import Base
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

#: Columns of tables of laws factor * x - offset: coefficients of the powers 0 to 2 of the phase
#: since the start of a segment, first of the factor (a or p), then of the offset (b or r).
FACTOR, FACTOR_SLOPE, FACTOR_SQUARE, OFFSET, OFFSET_SLOPE, OFFSET_SQUARE = range(6)
#: Degree of the factor and the offset of a law in time, and the higher coefficients of a constant.
_DEGREE, _ZEROS = 4, (0.0, 0.0, 0.0, 0.0)
#: A series is truncated after this many consecutive terms below this fraction of x, because each
#: term follows from the five terms before it.
_SMALL_TERMS, _SMALL_TERM = 5, 1e-17


class ToothPairSystem(NamedTuple):
    """One mesh along p segments of time: k pairs of teeth with parabolas on m intervals of phase.

    At constant speed segments and intervals are the same, and the time is the mesh phase.
    """

    starts: np.ndarray  #: phases that bound the intervals, shape (m + 1,)
    times: np.ndarray  #: time from the start of its mesh period to a segment, shape (p,)
    lengths: np.ndarray  #: durations of the segments, shape (p,)
    first_segment: np.ndarray  #: int, first segment of each mesh period, shape (repeats + 1,)
    summary_blocks: np.ndarray  #: int, row of the summary of each mesh period, shape (repeats,)
    intervals: np.ndarray  #: int, the interval of phase of each segment, shape (p,)
    start_phases: np.ndarray  #: phase from the start of the interval to the segment, shape (p,)
    speeds: np.ndarray  #: rate of the phase by time at the starts of segments, shape (p,)
    acceleration: float  #: rate of the speed
    loads: np.ndarray  #: at the starts of segments, over the load of the model, shape (p,)
    load_rate: float  #: rate of the load
    pairs_change: np.ndarray  #: bool, whether pairs change at the start of an interval, shape (m,)
    active_pairs: np.ndarray  #: int, set of the pairs on their path of contact, shape (m,)
    force_laws: np.ndarray  #: a and b of a set of pairs, shape (m, 2^k + 1, 6)
    overlap_laws: np.ndarray  #: p and r of a pair if other pairs carry the load, (m, 2^k, k, 6)
    gap_rate: np.ndarray  #: e', derivative of the unloaded gap by phase, shape (m,)
    damping: np.ndarray  #: d in free flight and in contact, shape (2,)
    coast_line: float  #: displacement of the coast side, may be -inf
    max_step: float  #: largest step in time
    tuning: float  #: nu at constant speed, otherwise 1
    repeats: int  #: mesh periods after which the segments repeat
    may_jam: bool  #: whether pairs of teeth and the coast side may touch at once


@inlined_kernel
def _law_value(law, t, x):
    """Return factor * x - offset of a law at the displacement x and the phase t.

    A law is a force or an overlap that is linear in x. `law`, shape (6,), has the three
    coefficients of the factor and then of the offset, both parabolas in t, which counts from the
    start of a segment.
    """
    factor = law[FACTOR] + t * (law[FACTOR_SLOPE] + t * law[FACTOR_SQUARE])
    return factor * x - law[OFFSET] - t * (law[OFFSET_SLOPE] + t * law[OFFSET_SQUARE])


@kernel
def touching_set(overlaps, active_set, coast_line, t, x):
    """Return the set of tooth pairs that touch at a displacement x and a phase t of a segment.

    Sets are integers with a bit for each of the k pairs; 2^k stands for the coast side, which
    touches below `coast_line`. Bits of `active_set` mark pairs on their path of contact. If the
    pairs of a set carry the load, another pair i overlaps by factor * x - offset of the law
    ``overlaps[set, i]``, shape (6,), and touches where this is positive.
    """
    # All pairs of the wanted set overlap and no other pair does; rounding may leave a violation.
    coast_set, pair_count = overlaps.shape[0], overlaps.shape[1]
    best_set, min_violation = 0, math.inf
    for contact_set in range(coast_set):
        if contact_set & ~active_set:
            continue
        violation = 0.0
        for i in range(pair_count):
            if active_set >> i & 1:
                pair_bit = 1 << i
                value = _law_value(overlaps[contact_set & ~pair_bit, i], t, x)
                violation = max(violation, -value if contact_set & pair_bit else value)
        if violation < min_violation:
            best_set, min_violation = contact_set, violation
    return coast_set if best_set == 0 and x < coast_line else best_set


@inlined_kernel
def _expand_parabola(value, slope, square, t, speed, acceleration):
    """Return the five Taylor coefficients in time of a parabola in the mesh phase.

    The parabola is value + slope * phase + square * phase^2. At time 0 the phase is t, its rate is
    `speed`, and this rate grows by `acceleration` per unit of time.
    """
    phase_slope, half_acceleration = slope + 2.0 * square * t, 0.5 * acceleration
    return (
        value + t * (slope + t * square),
        phase_slope * speed,
        phase_slope * half_acceleration + square * speed * speed,
        2.0 * square * speed * half_acceleration,
        square * half_acceleration * half_acceleration,
    )


@inlined_kernel
def _expand_law(law, t, speed, acceleration):
    """Return the Taylor coefficients in time of the factor and of the offset of a law, five each.

    A law is factor * x - offset; `law`, shape (6,), has the coefficients of both by powers of the
    mesh phase. At time 0 the phase is t, its rate is `speed`, and the derivative of this rate is
    `acceleration`.
    """
    factors = law[FACTOR], law[FACTOR_SLOPE], law[FACTOR_SQUARE]
    offsets = law[OFFSET], law[OFFSET_SLOPE], law[OFFSET_SQUARE]
    return (
        _expand_parabola(*factors, t, speed, acceleration),
        _expand_parabola(*offsets, t, speed, acceleration),
    )


@inlined_kernel
def _fill_product(series, quantity, law):
    """Fill the row `quantity` of `series` with the Taylor series in time of factor * x - offset.

    `law` is a pair: five Taylor coefficients of the factor, and five of the offset. The row
    DISPLACEMENT of `series` holds x.
    """
    factors, offsets = law
    for k in range(ORDER + 1):
        value = factors[0] * series[DISPLACEMENT, k]
        for j in range(1, min(k, _DEGREE) + 1):
            value += factors[j] * series[DISPLACEMENT, k - j]
        series[quantity, k] = value - offsets[k] if k <= _DEGREE else value


@inlined_kernel
def _expand_motion(law, load, load_rate, damping, force_scale, x, v, step, max_step, series):
    """Fill the Taylor series of the motion that starts from (x, v), as far as a step needs it.

    The equation is x'' = load - damping * x' - force_scale * (factor * x - offset). `law` has the
    Taylor coefficients of factor and offset. `load`, with the derivative `load_rate`, includes the
    damping force due to the gap. `step` is the length of the step, at most `max_step`. Returns the
    changes of x and v in the step, and the sum of the magnitudes of the terms of x beyond the
    square term.
    """
    (a0, a1, a2, a3, a4), (b0, b1, b2, b3, b4) = law
    a0, a1, a2, b0 = force_scale * a0, force_scale * a1, force_scale * a2, force_scale * b0
    a3, a4, b1, b2 = force_scale * a3, force_scale * a4, force_scale * b1, force_scale * b2
    b3, b4 = force_scale * b3, force_scale * b4
    series[DISPLACEMENT, 0], series[VELOCITY, 0] = x, v
    x_change, v_change, tail, power, small_terms = 0.0, 0.0, 0.0, 1.0, 0
    # Coefficients k to k - 4 of x and k of v.
    x_k, x_1, x_2, x_3, x_4, v_k = x, 0.0, 0.0, 0.0, 0.0, v
    small_term = _SMALL_TERM * max(1.0, abs(x)) / max_step
    count = ORDER
    for k in range(ORDER):
        force = a0 * x_k + (a1 * x_1 + a2 * x_2 + a3 * x_3 + a4 * x_4 - b0)
        series[MESH_FORCE, k] = force
        x_4, x_3, x_2, x_1, x_k = x_3, x_2, x_1, x_k, v_k * INVERSE_INTEGERS[k]
        # Most of the time goes into the recursion of v, so its chain of operations is kept short.
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


@inlined_kernel
def _keeps_sign(law, sign, step, tail, series):
    """Return whether bounds prove that sign * (factor * x - offset) stays positive in a step.

    The terms up to the square one form a parabola, whose minimum must exceed a bound of all others.
    `law` has the Taylor coefficients of factor and offset, and `series` holds the Taylor series of
    x. `step` is the length of the step, and `tail` is the sum of the magnitudes of the terms of x
    beyond the square term.
    """
    (a0, a1, a2, a3, a4), (b0, b1, b2, b3, b4) = law
    square_step = step * step
    a1, a2, a3 = a1 * step, a2 * square_step, a3 * step * square_step
    a4, b1, b2 = a4 * square_step * square_step, b1 * step, b2 * square_step
    x_0, x_1 = series[DISPLACEMENT, 0], series[DISPLACEMENT, 1] * step
    x_2 = series[DISPLACEMENT, 2] * square_step
    constant, slope = a0 * x_0 - b0, a0 * x_1 + a1 * x_0 - b1
    square = a0 * x_2 + a1 * x_1 + a2 * x_0 - b2
    high_terms = abs(a3) + abs(a4)
    # Bound of all products of terms whose powers add up to 3 or more.
    remainder = (abs(a0) + abs(a1) + abs(a2) + high_terms) * tail + high_terms * (
        abs(x_0) + abs(x_1) + abs(x_2)
    )
    remainder += (abs(a1) + abs(a2)) * abs(x_2) + abs(a2 * x_1)
    remainder += (abs(b3) + abs(b4) * step) * step * square_step
    return parabola_minimum(sign * constant, sign * slope, sign * square) > remainder


@kernel
def _map_step(law, t, damping, force_scale, step, map_matrix):
    """Multiply a map of perturbations, shape (2, 2), from the left by the map of a Taylor step.

    The map of the step is the derivative of (x, x') at its end with respect to its start. The step
    has the length `step` and starts at the phase t since the start of a segment. The mesh force is
    `force_scale` * (factor * x - offset), with the coefficients in `law`, shape (6,).
    """
    stiffness = (law[FACTOR] + t * (law[FACTOR_SLOPE] + t * law[FACTOR_SQUARE])) * force_scale
    slope = (law[FACTOR_SLOPE] + 2.0 * law[FACTOR_SQUARE] * t) * force_scale
    square = law[FACTOR_SQUARE] * force_scale
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


@inlined_kernel
def _first_contact_event(
    overlaps,
    active_set,
    coast_line,
    may_jam,
    contact_set,
    start_pair,
    t,
    speed,
    acceleration,
    step,
    tail,
    series,
    to_bernstein,
    work,
):
    """Return (fraction of a step, number of the pair) of the first pair that touches or separates.

    The step, of length `step`, starts at the phase t of an interval of phase, which has the laws
    `overlaps`, (2^k, k, 6), and the active pairs `active_set`; the phase grows with `speed` and
    `acceleration`. Bits of `contact_set` mark the pairs that touch; 2^k stands for contact of the
    coast side, below `coast_line`, which has the pair number k. The fraction is 2 if there is no
    event and -1 if rounding hides whether there is one. At the start of the step `start_pair` has
    zero overlap; it is -1 if no pair has. If the mesh `may_jam`, contact on the other side counts
    as well. The first rows of `series` hold the motion, and its row ROWS receives the overlaps;
    `tail` is the sum of the magnitudes of the terms of x beyond the square term. `to_bernstein`
    converts power to Bernstein coefficients, and `work` is overwritten.
    """
    coast_set, pair_count = overlaps.shape[0], overlaps.shape[1]
    first_fraction, first_pair = 2.0, -1
    for i in range(pair_count + 1):
        is_coast = i == pair_count
        if is_coast:
            if coast_line == -math.inf or not (
                may_jam or contact_set == 0 or contact_set == coast_set
            ):
                continue
            law, touches = ((1.0, *_ZEROS), (coast_line, *_ZEROS)), contact_set == coast_set
            sign = -1.0 if touches else 1.0
        else:
            pair_bit = 1 << i
            if (contact_set == coast_set and not may_jam) or not active_set & pair_bit:
                continue
            touches = contact_set != coast_set and contact_set & pair_bit != 0
            other_pairs = contact_set & ~pair_bit if contact_set != coast_set else 0
            law = _expand_law(overlaps[other_pairs, i], t, speed, acceleration)
            sign = 1.0 if touches else -1.0
        if start_pair != i and _keeps_sign(law, sign, step, tail, series):
            continue
        _fill_product(series, ROWS, law)
        if start_pair == i:
            series[ROWS, 0] = 0.0
        fraction = first_crossing(series, ROWS, 0.0, sign, step, to_bernstein, work)
        if fraction < first_fraction:
            first_fraction, first_pair = fraction, i
    return first_fraction, first_pair


@inlined_kernel
def _contact_code_of(contact_set, coast_set):
    """Return the contact code (drive 1, none 0, coast -1) for a set of touching tooth pairs.

    Sets are integers with a bit for each pair of drive-side teeth: 0 means no contact, and
    `coast_set` means contact of the coast side.
    """
    if contact_set == 0:
        return NO_CONTACT
    return COAST if contact_set == coast_set else DRIVE


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
    a row for each of its `summary_blocks`. The period maps, shape (periods, 2, 2) or (0, 2, 2),
    receive the derivatives of the state after each period with respect to the state before it, at
    constant speed only. The run begins in mesh period `first_period` of the excitation. The last
    result is the number of Taylor steps.
    """
    for block in range(summaries.shape[0]):
        orbit.clear_summary(summaries[block])
    first_segment, active_set = system.first_segment, system.active_pairs
    blocks, intervals, start_phases = system.summary_blocks, system.intervals, system.start_phases
    speeds, acceleration = system.speeds, system.acceleration
    loads, load_rate = system.loads, system.load_rate
    times, lengths, pairs_change = system.times, system.lengths, system.pairs_change
    force, overlaps = system.force_laws, system.overlap_laws
    gap_rate, damping_levels = system.gap_rate, system.damping
    coast_line, max_step, tuning = system.coast_line, system.max_step, system.tuning
    may_jam = system.may_jam
    pair_count, coast_set = overlaps.shape[2], overlaps.shape[1]
    force_scale = 1.0 / (tuning * tuning)
    series, work = np.zeros((ROWS + 1, ORDER + 1)), np.empty((WORK_ROWS, ORDER + 2))
    strobe_count = min(periods, orbit.strobe_periods(system.repeats))
    strobes = np.empty((strobe_count + 1, 2))
    event_rows, steps, contact_set, start_pair = 0, 0, 0, -1
    for period in range(periods):
        strobe = period - (periods - strobe_count)
        if strobe >= 0:
            strobes[strobe, 0], strobes[strobe, 1] = x, v
        recorded = period - (periods - record_periods)
        sample_count, event_count = 0, 0
        if period_maps.shape[0] > 0:
            set_identity(period_maps[period])
        number = (first_period + period) % system.repeats
        summary, last_segment = summaries[blocks[number]], first_segment[number + 1] - 1
        duration = times[last_segment] + lengths[last_segment]
        period_samples = samples_of_period(samples, recorded, record_periods, duration)
        for segment in range(first_segment[number], first_segment[number + 1]):
            is_run_start = period == 0 and segment == first_segment[number]
            interval = intervals[segment]
            segment_overlaps, active_pairs = overlaps[interval], active_set[interval]
            if is_run_start or pairs_change[interval]:
                code_before = _contact_code_of(contact_set, coast_set)
                contact_set = touching_set(
                    segment_overlaps, active_pairs, coast_line, start_phases[segment], x
                )
                start_pair = -1
                code_after = _contact_code_of(contact_set, coast_set)
                if code_after == DRIVE and x < coast_line:
                    return x, v, 0, events, 0, JAMMED, steps
                if recorded >= 0 and code_after != code_before and not is_run_start:
                    events, event_rows = orbit.record_event(
                        events,
                        event_rows,
                        period,
                        times[segment],
                        code_before,
                        code_after,
                        v,
                        summary,
                    )
            time, length = 0.0, lengths[segment]
            while time < length:
                damping = damping_levels[1 if contact_set else 0]
                speed = speeds[segment] + acceleration * time
                t = start_phases[segment] + 0.5 * (speeds[segment] + speed) * time
                contact_code = _contact_code_of(contact_set, coast_set)
                force_law = force[interval, contact_set]
                h = min(max_step, length - time)
                if length - time - h < 1e-13:
                    h = length - time
                gap_force = damping * gap_rate[interval]
                x_change, v_change, tail = _expand_motion(
                    _expand_law(force_law, t, speed, acceleration),
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
                    contact_set,
                    start_pair,
                    t,
                    speed,
                    acceleration,
                    h,
                    tail,
                    series,
                    to_bernstein,
                    work,
                )
                if event_fraction < 0.0:
                    return x, v, 0, events, 0, UNRESOLVED, steps
                if event_fraction <= 1.0 and (
                    contact_set != 0 and pair == pair_count
                    if contact_set != coast_set
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
                    _map_step(force_law, t, damping, force_scale, h, period_maps[period])
                if recorded >= 0:
                    # A single pair of teeth has the lower stiffness.
                    low = contact_set < coast_set and contact_set & (contact_set - 1) == 0
                    add_step_to_summary(
                        tuning, low, to_bernstein, h, contact_code, series, work, summary
                    )
                    if orbit.has_unresolved_extremum(summary):
                        return x, v, 0, events, 0, UNRESOLVED, steps
                    step_start = times[segment] + time
                    sample_count = add_samples(
                        tuning, step_start, h, contact_code, series, period_samples, sample_count
                    )
                time += h
                if event_fraction > 1.0:
                    start_pair = -1
                    continue
                event_count += 1
                if event_count > max_events:
                    return x, v, 0, events, 0, EVENT_LIMIT, steps
                start_pair = pair
                contact_set = (
                    (coast_set if contact_set == 0 else 0)
                    if pair == pair_count
                    else contact_set ^ (1 << pair)
                )
                code_after = _contact_code_of(contact_set, coast_set)
                if period_maps.shape[0] > 0:
                    jump = (
                        _law_value(force[interval, contact_set], time, x)
                        - _law_value(force_law, time, x)
                    ) * force_scale
                    jump += (damping_levels[1 if contact_set else 0] - damping) * (
                        v - gap_rate[interval]
                    )
                    factor, rate = 1.0, v
                    if pair < pair_count:
                        law = segment_overlaps[contact_set & ~(1 << pair), pair]
                        factor, factor_slope, _, _, _ = _expand_parabola(
                            law[FACTOR], law[FACTOR_SLOPE], law[FACTOR_SQUARE], time, 1.0, 0.0
                        )
                        offset_slope = law[OFFSET_SLOPE] + 2.0 * law[OFFSET_SQUARE] * time
                        rate = factor * v + factor_slope * x - offset_slope
                    # The saltation matrix of a tangential crossing is the identity.
                    if rate != 0.0:
                        multiply_from_left(
                            1.0, 0.0, -jump * factor / rate, 1.0, period_maps[period]
                        )
                if code_after != contact_code and recorded >= 0:
                    event_time = times[segment] + time
                    events, event_rows = orbit.record_event(
                        events, event_rows, period, event_time, contact_code, code_after, v, summary
                    )
    strobes[strobe_count, 0], strobes[strobe_count, 1] = x, v
    displacement_range = summaries[0, orbit.X_MAX] - summaries[0, orbit.X_MIN]
    orbit_period = orbit.orbit_period(strobes, tuning, displacement_range, system.repeats)
    return x, v, orbit_period, events, event_rows, OK, steps


class Propagator(propagator.Propagator):
    """Engine of a `LoadSharingPair` at one tuning, by Taylor steps."""

    at = Base.at

    def __init__(self, model, tuning: float):
        """Tabulate the pairs of teeth of a model at a tuning."""
        Base.__init__(self, model, tuning)
        self.system = model.system(tuning)

    def run_kernel(self, x, v, periods, recorded, tables, first_period):
        """Run from displacement x and velocity v by `run_tooth_pairs`, and return its result.

        `recorded` is the number of the last `periods` that are recorded. `tables` are (samples,
        events, largest number of events in a period, summary, period maps); the run begins in mesh
        period `first_period` of the excitation.
        """
        samples, events, max_events, summary, maps = tables
        tables = samples, events, max_events, summary.reshape(1, -1), maps
        arguments = x, v, periods, recorded, *tables, first_period
        return run_tooth_pairs(self.system, propagator.TO_BERNSTEIN, *arguments)
