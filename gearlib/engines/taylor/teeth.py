"""One mesh with individual pairs of teeth: Taylor steps end where a pair touches or separates.

While the pairs of one set touch, the displacement x over the phase tau follows

    x'' = (1 - a x + b) / nu^2 - d (x' - e'),

where a and b are straight lines on each segment of phase. A set of the k pairs is an integer with a
bit for each pair; set 0 is the backlash and set 2^k the contact of the coast side. If the other
pairs of a set carry the load, pair i overlaps by p x - r, and touches where this is > 0.
Displacements are in static deflections, forces over the load. The series converges to rounding on
steps below 1.18 over the natural frequency. A step ends with its segment and at the first crossing
of its polynomial, where a pair touches or separates.
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.engines import orbit
from gearlib.engines.codes import (
    BACKLASH,
    EVENT_LIMIT,
    INVERSE,
    JAMMED,
    NORMAL,
    OK,
    OVERFLOW,
    UNRESOLVED,
)
from gearlib.engines.jit import inlined_kernel, kernel
from gearlib.engines.orbit import is_within_range
from gearlib.engines.pair.maps import multiply_from_left
from gearlib.engines.polynomial import WORK_ROWS
from gearlib.engines.protocol import Base
from gearlib.engines.taylor import propagator
from gearlib.engines.taylor.perturbations import set_identity
from gearlib.engines.taylor.series import (
    DISPLACEMENT,
    MESH_FORCE,
    ORDER,
    ROWS,
    STIFFNESS,
    VELOCITY,
    state_at,
)
from gearlib.engines.taylor.taylor_run import (
    add_samples,
    add_step_to_summary,
    first_crossing,
    samples_of_period,
)

#: Columns of tables of lines factor x - offset: value at the start of a segment and slope of the
#: factor (a, p), and of the offset (b, r).
FACTOR, FACTOR_SLOPE, OFFSET, OFFSET_SLOPE = range(4)


class ToothPairSystem(NamedTuple):
    """One mesh at one tuning: k pairs of teeth, p segments of phase."""

    starts: np.ndarray  #: phases that bound the segments, shape (p + 1,)
    first_segment: np.ndarray  #: int, where each mesh period begins, shape (repeats + 1,)
    pairs_change: np.ndarray  #: bool, whether pairs change at the start of a segment, shape (p,)
    active_pairs: np.ndarray  #: int, set of the pairs on their path of contact, shape (p,)
    force_lines: np.ndarray  #: of a set, a and b, shape (p, 2^k + 1, 4)
    overlap_lines: np.ndarray  #: of a pair beside a set without it, p and r, shape (p, 2^k, k, 4)
    gap_rate: np.ndarray  #: e', rate of the gap without load, shape (p,)
    damping: np.ndarray  #: d in the backlash and in contact, over nu, shape (2,)
    coast_line: float  #: displacement of the coast side, may be -inf
    max_step: float  #: largest step in phase
    tuning: float  #: nu
    repeats: int  #: mesh periods after which the pairs of teeth repeat
    may_jam: bool  #: whether pairs of teeth and the coast side may touch at once


@inlined_kernel
def _line_value(line, t, x):
    """Return factor x - offset, both linear in the phase t since the start of a segment.

    The line is (factor, factor slope, offset, offset slope), with values at the segment start.
    """
    factor = line[FACTOR] + line[FACTOR_SLOPE] * t
    return factor * x - line[OFFSET] - line[OFFSET_SLOPE] * t


@kernel
def touching_set(overlaps, active_set, coast_line, t, x):
    """Return the set of pairs that touch at a displacement x, t after the start of a segment.

    Sets are integers with a bit for each of the k pairs; 2^k stands for the coast side, which
    touches below `coast_line`. Bits of `active_set` mark pairs on their path of contact. If the
    pairs of a set carry the load, the overlap of another pair i is factor x - offset, with the
    `_line_value` of ``overlaps[set, i]``, shape (4,), of the segment; it touches where this is > 0.
    """
    # The set of which all pairs overlap and no other pair does, or the nearest to this.
    coast_set, pair_count = overlaps.shape[0], overlaps.shape[1]
    best_set, min_violation = 0, math.inf
    for contact_set in range(coast_set):
        if contact_set & ~active_set:
            continue
        violation = 0.0
        for i in range(pair_count):
            if active_set >> i & 1:
                pair_bit = 1 << i
                value = _line_value(overlaps[contact_set & ~pair_bit, i], t, x)
                violation = max(violation, -value if contact_set & pair_bit else value)
        if violation < min_violation:
            best_set, min_violation = contact_set, violation
    return coast_set if best_set == 0 and x < coast_line else best_set


@inlined_kernel
def _fill_linear(series, quantity, line, t):
    """Fill the row `quantity` of `series` with factor x - offset, both linear in phase.

    The line is (factor, factor slope, offset, offset slope), with values at the segment start; the
    series starts at the phase t since then.
    """
    factor, factor_slope = line[FACTOR] + line[FACTOR_SLOPE] * t, line[FACTOR_SLOPE]
    series[quantity, 0] = factor * series[DISPLACEMENT, 0] - line[OFFSET] - line[OFFSET_SLOPE] * t
    series[quantity, 1] = (
        factor * series[DISPLACEMENT, 1]
        + factor_slope * series[DISPLACEMENT, 0]
        - line[OFFSET_SLOPE]
    )
    for k in range(2, ORDER + 1):
        series[quantity, k] = (
            factor * series[DISPLACEMENT, k] + factor_slope * series[DISPLACEMENT, k - 1]
        )


@inlined_kernel
def _expand_motion(line, t, damping, gap_rate, force_scale, x, v, series):
    """Fill the Taylor series of the motion through (x, v), t after the start of a segment.

    The mesh force is factor x - offset, times `force_scale`, 1 / nu^2; the line is (factor, factor
    slope, offset, offset slope). The gap without load changes at a rate by phase.
    """
    stiffness = (line[FACTOR] + line[FACTOR_SLOPE] * t) * force_scale
    stiffness_slope = line[FACTOR_SLOPE] * force_scale
    # The external force is the load and the damping force due to the rate of the gap.
    load = force_scale + damping * gap_rate
    series[DISPLACEMENT, 0], series[VELOCITY, 0] = x, v
    force = stiffness * x - (line[OFFSET] + line[OFFSET_SLOPE] * t) * force_scale
    for k in range(ORDER):
        series[MESH_FORCE, k] = force
        series[DISPLACEMENT, k + 1] = series[VELOCITY, k] / (k + 1.0)
        series[VELOCITY, k + 1] = (load - force - damping * series[VELOCITY, k]) / (k + 1.0)
        load = 0.0
        force = stiffness * series[DISPLACEMENT, k + 1] + stiffness_slope * series[DISPLACEMENT, k]
        if k == 0:
            force -= line[OFFSET_SLOPE] * force_scale
    series[MESH_FORCE, ORDER] = 0.0
    for k in range(ORDER + 1):
        series[STIFFNESS, k] = 0.0
    series[STIFFNESS, 0], series[STIFFNESS, 1] = stiffness, stiffness_slope


@kernel
def _map_step(line, t, damping, force_scale, step, map_matrix):
    """Multiply a map of perturbations, shape (2, 2), in place by the map of a Taylor step.

    The step starts t after the start of a segment, whose mesh force is factor x - offset, times
    `force_scale`; the line is (factor, factor slope, offset, offset slope).
    """
    stiffness = (line[FACTOR] + line[FACTOR_SLOPE] * t) * force_scale
    stiffness_slope = line[FACTOR_SLOPE] * force_scale
    image = np.empty((2, 2))
    for j in range(2):
        previous_term, displacement_term, velocity_term = 0.0, 1.0 - j, 1.0 * j
        displacement, velocity, power = displacement_term, velocity_term, 1.0
        for k in range(ORDER):
            new_term = velocity_term / (k + 1.0)
            velocity_term = -(
                stiffness * displacement_term
                + stiffness_slope * previous_term
                + damping * velocity_term
            ) / (k + 1.0)
            previous_term, displacement_term = displacement_term, new_term
            power *= step
            displacement += displacement_term * power
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
    step,
    x,
    series,
    to_bernstein,
    work,
):
    """Return (fraction of a step, number of the pair) of the first pair that touches or separates.

    The step, of length `step`, starts at x, t after the start of a segment with its overlaps, (2^k,
    k, 4), and its active pairs. Bits of `contact_set` mark the pairs that touch; 2^k stands for
    contact of the coast side, below `coast_line`, which has the pair number k. The fraction is 2 if
    there is no event and -1 if rounding hides whether there is one. The step starts on the line of
    `start_pair`, or on none if that is -1. If the sides `may_jam`, touches on the other side count
    as well. `series` has the motion in its first rows; rows from ROWS on receive the overlaps, and
    `to_bernstein` and `work` are those of `first_crossing`.
    """
    coast_set, pair_count = overlaps.shape[0], overlaps.shape[1]
    first_fraction, first_pair = 2.0, -1
    for i in range(pair_count):
        pair_bit = 1 << i
        if (contact_set == coast_set and not may_jam) or not active_set & pair_bit:
            continue
        touches = contact_set != coast_set and contact_set & pair_bit != 0
        other_pairs = contact_set & ~pair_bit if contact_set != coast_set else 0
        _fill_linear(series, ROWS + i, overlaps[other_pairs, i], t)
        if start_pair == i:
            series[ROWS + i, 0] = 0.0
        sign = 1.0 if touches else -1.0
        fraction = first_crossing(series, ROWS + i, 0.0, sign, step, to_bernstein, work)
        if fraction < first_fraction:
            first_fraction, first_pair = fraction, i
    if coast_line > -math.inf and (may_jam or contact_set == 0 or contact_set == coast_set):
        for j in range(ORDER + 1):
            series[ROWS + pair_count, j] = series[DISPLACEMENT, j]
        series[ROWS + pair_count, 0] = 0.0 if start_pair == pair_count else x - coast_line
        sign = 1.0 if contact_set != coast_set else -1.0
        fraction = first_crossing(series, ROWS + pair_count, 0.0, sign, step, to_bernstein, work)
        if fraction < first_fraction:
            first_fraction, first_pair = fraction, pair_count
    return first_fraction, first_pair


@inlined_kernel
def _contact_code_of(contact_set, coast_set):
    """Return the contact code of a set of touching pairs, 0 for none and `coast_set` for coast."""
    if contact_set == 0:
        return BACKLASH
    return INVERSE if contact_set == coast_set else NORMAL


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
    summary,
    period_maps,
    first_period,
):
    """Run the mesh; arguments and first returns are those of `pair.pair_run.run`.

    The period maps, shape (periods, 2, 2) or (0, 2, 2), get the derivatives of the state after each
    period by the state before. The run begins in mesh period `first_period` of the excitation.
    Returns also the number of steps.
    """
    orbit.clear_summary(summary)
    first_segment, active_set = system.first_segment, system.active_pairs
    starts, renewed = system.starts, system.pairs_change
    force, overlaps = system.force_lines, system.overlap_lines
    gap_rate, damping_levels = system.gap_rate, system.damping
    coast_line, max_step, tuning = system.coast_line, system.max_step, system.tuning
    may_jam = system.may_jam
    pair_count, coast_set = overlaps.shape[2], overlaps.shape[1]
    force_scale = 1.0 / (tuning * tuning)
    series, work = np.zeros((ROWS + pair_count + 1, ORDER + 1)), np.empty((WORK_ROWS, ORDER + 2))
    strobe_count = min(periods, orbit.strobe_periods(system.repeats))
    strobes = np.empty((strobe_count + 1, 2))
    rows, steps, contact_set, start_pair = 0, 0, 0, -1
    for period in range(periods):
        strobe = period - (periods - strobe_count)
        if strobe >= 0:
            strobes[strobe, 0], strobes[strobe, 1] = x, v
        recorded = period - (periods - record_periods)
        sample_count, event_count = 0, 0
        if period_maps.shape[0] > 0:
            set_identity(period_maps[period])
        number = (first_period + period) % system.repeats
        period_start = starts[first_segment[number]]
        period_samples = samples_of_period(samples, recorded, record_periods)
        for segment in range(first_segment[number], first_segment[number + 1]):
            is_run_start = period == 0 and segment == first_segment[number]
            segment_overlaps, active_pairs = overlaps[segment], active_set[segment]
            if is_run_start or renewed[segment]:
                code_before = _contact_code_of(contact_set, coast_set)
                contact_set = touching_set(segment_overlaps, active_pairs, coast_line, 0.0, x)
                start_pair = -1
                code_after = _contact_code_of(contact_set, coast_set)
                if code_after == NORMAL and x < coast_line:
                    return x, v, 0, events, 0, JAMMED, steps
                if recorded >= 0 and code_after != code_before and not is_run_start:
                    phase = starts[segment] - period_start
                    events, rows = orbit.count_event(
                        events, rows, period, phase, code_before, code_after, v, summary
                    )
            phase, end = starts[segment], starts[segment + 1]
            while phase < end:
                t, damping = phase - starts[segment], damping_levels[1 if contact_set else 0]
                contact_code = _contact_code_of(contact_set, coast_set)
                force_line = force[segment, contact_set]
                _expand_motion(force_line, t, damping, gap_rate[segment], force_scale, x, v, series)
                h = min(max_step, end - phase)
                if end - phase - h < 1e-13:
                    h = end - phase
                event_fraction, pair = _first_contact_event(
                    segment_overlaps,
                    active_pairs,
                    coast_line,
                    may_jam,
                    contact_set,
                    start_pair,
                    t,
                    h,
                    x,
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
                h = h if event_fraction > 1.0 else event_fraction * h
                x, v = state_at(series, h)
                steps += 1
                if not is_within_range(x, v):
                    return x, v, 0, events, 0, OVERFLOW, steps
                if period_maps.shape[0] > 0:
                    _map_step(force_line, t, damping, force_scale, h, period_maps[period])
                if recorded >= 0:
                    # The lower stiffness is that of a single pair.
                    low = contact_set < coast_set and contact_set & (contact_set - 1) == 0
                    add_step_to_summary(
                        tuning, low, to_bernstein, h, contact_code, series, work, summary
                    )
                    if orbit.has_unresolved_extremum(summary):
                        return x, v, 0, events, 0, UNRESOLVED, steps
                    step_phase = phase - period_start
                    sample_count = add_samples(
                        tuning, step_phase, h, contact_code, series, period_samples, sample_count
                    )
                phase += h
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
                    t = phase - starts[segment]
                    jump = (
                        _line_value(force[segment, contact_set], t, x)
                        - _line_value(force_line, t, x)
                    ) * force_scale
                    jump += (damping_levels[1 if contact_set else 0] - damping) * (
                        v - gap_rate[segment]
                    )
                    factor, rate = 1.0, v
                    if pair < pair_count:
                        overlap_line = segment_overlaps[contact_set & ~(1 << pair), pair]
                        factor = overlap_line[FACTOR] + overlap_line[FACTOR_SLOPE] * t
                        rate = (
                            factor * v + overlap_line[FACTOR_SLOPE] * x - overlap_line[OFFSET_SLOPE]
                        )
                    # The saltation matrix of a tangential crossing is the identity.
                    if rate != 0.0:
                        multiply_from_left(
                            1.0, 0.0, -jump * factor / rate, 1.0, period_maps[period]
                        )
                if code_after != contact_code and recorded >= 0:
                    event_phase = phase - period_start
                    events, rows = orbit.count_event(
                        events, rows, period, event_phase, contact_code, code_after, v, summary
                    )
    strobes[strobe_count, 0], strobes[strobe_count, 1] = x, v
    displacement_range = summary[orbit.X_MAX] - summary[orbit.X_MIN]
    orbit_period = orbit.orbit_period(strobes, tuning, displacement_range, system.repeats)
    return x, v, orbit_period, events, rows, OK, steps


class Propagator(propagator.Propagator):
    """A `LoadSharingPair` at one tuning."""

    at = Base.at

    def __init__(self, model, tuning: float):
        """Set the tables of the tooth pairs of a model at a tuning."""
        Base.__init__(self, model, tuning)
        self.system = model.system(tuning)

    def run_kernel(self, x, v, periods, recorded, tables, first_period):
        """Run from displacement x and velocity v; return what `run_tooth_pairs` returns.

        `tables` are its arguments from samples to period maps.
        """
        arguments = x, v, periods, recorded, *tables, first_period
        return run_tooth_pairs(self.system, propagator.TO_BERNSTEIN, *arguments)
