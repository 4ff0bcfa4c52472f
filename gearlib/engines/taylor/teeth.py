"""One mesh with individual pairs of teeth: Taylor steps that end where a pair touches or parts.

While the pairs of one set touch, the displacement x over the phase tau follows

    x'' = (1 - a x + b) / nu^2 - d (x' - e'),

a and b being straight lines on each segment of phase. A set of the k pairs is an integer with a bit
for each; set 0 is the backlash and set 2^k the contact of the coast side. If the other pairs of a
set carry the load, pair i overlaps by p x - r, and touches where this is > 0. Displacements are in
static deflections, forces over the load. The series converges to rounding on steps below 1.18 over
the natural frequency. A step ends with its segment and at the first crossing of its polynomial,
where a pair touches or parts.
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
from gearlib.engines.jit import inlined, kernel
from gearlib.engines.overflow import within_range
from gearlib.engines.pair.maps import multiply
from gearlib.engines.polynomial import WORK_ROWS
from gearlib.engines.protocol import Base
from gearlib.engines.taylor import propagator
from gearlib.engines.taylor.deviations import set_identity
from gearlib.engines.taylor.series import MESH_FORCE, ORDER, ROWS, C, V, X, state_at
from gearlib.engines.taylor.taylor_run import add_samples, add_step, first_crossing, samples_of

#: Columns of the tables: value at the start of a segment and slope of the factor of x (a, p), and
#: of the offset that is subtracted (b, r).
FACTOR, FACTOR_SLOPE, OFFSET, OFFSET_SLOPE = range(4)


class ToothPairSystem(NamedTuple):
    """One mesh at one tuning: k pairs of teeth, p segments of phase."""

    starts: np.ndarray  #: phases that bound the segments, shape (p + 1,)
    first_segment: np.ndarray  #: int, where each mesh period begins, shape (repeats + 1,)
    renewed: np.ndarray  #: bool, whether pairs come or go at the start of a segment, shape (p,)
    inside: np.ndarray  #: int, set of the pairs on their path of contact, shape (p,)
    force: np.ndarray  #: of a set, a and b, shape (p, 2^k + 1, 4)
    overlap: np.ndarray  #: of a pair beside a set without it, p and r, shape (p, 2^k, k, 4)
    slip: np.ndarray  #: e', rate of the gap without load, shape (p,)
    damping: np.ndarray  #: d in the backlash and in contact, over nu, shape (2,)
    lower: float  #: displacement of the coast side, may be -inf
    longest: float  #: phase of the longest step
    tuning: float  #: nu
    repeats: int  #: mesh periods after which the pairs of teeth repeat
    closing: bool  #: whether pairs of teeth and the coast side may touch at once


@inlined
def _value(row, t, x):
    """Return factor x - offset, both linear in the phase t since the start of a segment."""
    factor = row[FACTOR] + row[FACTOR_SLOPE] * t
    return factor * x - row[OFFSET] - row[OFFSET_SLOPE] * t


@kernel
def touching(overlap, inside, lower, t, x):
    """Return the set of pairs that touch at a displacement x, t after the start of a segment.

    `overlap`, shape (2^k, k, 4), is that of the segment; `inside` is the set of pairs on their path
    of contact, `lower` the displacement of the coast side.
    """
    sets, k = overlap.shape[0], overlap.shape[1]
    touching_set, min_violation = 0, math.inf
    for s in range(sets):
        if s & ~inside:
            continue
        violation = 0.0
        for i in range(k):
            if inside >> i & 1:
                bit = 1 << i
                value = _value(overlap[s & ~bit, i], t, x)
                violation = max(violation, -value if s & bit else value)
        if violation < min_violation:
            touching_set, min_violation = s, violation
    return sets if touching_set == 0 and x < lower else touching_set


@inlined
def _fill_linear(series, target, row, t):
    """Fill the row `target` of `series` with factor x - offset, linear in phase.

    `row` has the columns FACTOR to OFFSET_SLOPE, t is the phase since the start of the segment.
    """
    level, slope = row[FACTOR] + row[FACTOR_SLOPE] * t, row[FACTOR_SLOPE]
    series[target, 0] = level * series[X, 0] - row[OFFSET] - row[OFFSET_SLOPE] * t
    series[target, 1] = level * series[X, 1] + slope * series[X, 0] - row[OFFSET_SLOPE]
    for k in range(2, ORDER + 1):
        series[target, k] = level * series[X, k] + slope * series[X, k - 1]


@inlined
def _expand(row, t, drag, slip, unit, x, v, series):
    """Fill the Taylor series of the motion through (x, v), t after the start of a segment.

    `row` has the mesh force of the set, `slip` the rate of the gap without load by phase, and
    `unit` is 1 / nu^2.
    """
    level, slope = (row[FACTOR] + row[FACTOR_SLOPE] * t) * unit, row[FACTOR_SLOPE] * unit
    # The load and the damping force due to the rate of the gap.
    load = unit + drag * slip
    series[X, 0], series[V, 0] = x, v
    force = level * x - (row[OFFSET] + row[OFFSET_SLOPE] * t) * unit
    for k in range(ORDER):
        series[MESH_FORCE, k] = force
        series[X, k + 1] = series[V, k] / (k + 1.0)
        series[V, k + 1] = (load - force - drag * series[V, k]) / (k + 1.0)
        load = 0.0
        force = level * series[X, k + 1] + slope * series[X, k]
        if k == 0:
            force -= row[OFFSET_SLOPE] * unit
    series[MESH_FORCE, ORDER] = 0.0
    for k in range(ORDER + 1):
        series[C, k] = 0.0
    series[C, 0], series[C, 1] = level, slope


@kernel
def _map_step(row, t, drag, unit, h, matrix):
    """Multiply `matrix`, shape (2, 2), by the map of small deviations over a step of length h."""
    level, slope = (row[FACTOR] + row[FACTOR_SLOPE] * t) * unit, row[FACTOR_SLOPE] * unit
    image = np.empty((2, 2))
    for j in range(2):
        previous, a, b = 0.0, 1.0 - j, 1.0 * j
        first, second, power = a, b, 1.0
        for k in range(ORDER):
            new = b / (k + 1.0)
            b = -(level * a + slope * previous + drag * b) / (k + 1.0)
            previous, a = a, new
            power *= h
            first += a * power
            second += b * power
        image[0, j], image[1, j] = first, second
    multiply(image[0, 0], image[0, 1], image[1, 0], image[1, 1], matrix)


@inlined
def _first_event(overlap, inside, lower, closing, s, line, t, h, x, series, to_bernstein, work):
    """Return (share of a step, number of the pair) of the first touch or loss of contact.

    The step, of length h, starts at x, t after the start of the segment, with the set s of pairs in
    contact and the Taylor series `series`. The share is 2 if there is no event and -1 if rounding
    hides whether there is one; the number after the last pair is the coast side. `overlap` and
    `inside` are those of the segment, `line` is the pair on whose line the step starts, -1 for
    none. If `closing`, touches on the side without contact count as well.
    """
    coast, k = overlap.shape[0], overlap.shape[1]
    first_share, first_pair = 2.0, -1
    for i in range(k):
        bit = 1 << i
        if (s == coast and not closing) or not inside & bit:
            continue
        touches = s != coast and s & bit != 0
        _fill_linear(series, ROWS + i, overlap[s & ~bit if s != coast else 0, i], t)
        if line == i:
            series[ROWS + i, 0] = 0.0
        side = 1.0 if touches else -1.0
        share = first_crossing(series, ROWS + i, 0.0, side, h, to_bernstein, work)
        if share < first_share:
            first_share, first_pair = share, i
    if lower > -math.inf and (closing or s == 0 or s == coast):
        for j in range(ORDER + 1):
            series[ROWS + k, j] = series[X, j]
        series[ROWS + k, 0] = 0.0 if line == k else x - lower
        side = 1.0 if s != coast else -1.0
        share = first_crossing(series, ROWS + k, 0.0, side, h, to_bernstein, work)
        if share < first_share:
            first_share, first_pair = share, k
    return first_share, first_pair


@inlined
def _contact_of(s, coast):
    """Return the contact code of a set of pairs; `coast` is the set of the coast side."""
    if s == 0:
        return BACKLASH
    return INVERSE if s == coast else NORMAL


@kernel
def run_pairs(
    system,
    to_bernstein,
    x,
    v,
    periods,
    record_periods,
    samples,
    events,
    limit,
    summary,
    maps,
    first,
):
    """Run the mesh; arguments and first returns are those of `pair.pair_run.run`.

    `maps`, shape (periods, 2, 2) or (0, 2, 2), gets the derivative of the state after each period
    by that before; `first` is the mesh period in which the run begins. Returns also the number of
    steps.
    """
    orbit.clear_summary(summary)
    first_segment, inside = system.first_segment, system.inside
    starts, renewed = system.starts, system.renewed
    force, overlap, slip, damping = system.force, system.overlap, system.slip, system.damping
    lower, longest, tuning = system.lower, system.longest, system.tuning
    closing = system.closing
    k, coast, unit = overlap.shape[2], overlap.shape[1], 1.0 / (tuning * tuning)
    series, work = np.zeros((ROWS + k + 1, ORDER + 1)), np.empty((WORK_ROWS, ORDER + 2))
    strobe_count = min(periods, orbit.strobe_periods(system.repeats))
    strobes = np.empty((strobe_count + 1, 2))
    event_rows, steps, s, line = 0, 0, 0, -1
    for period in range(periods):
        row = period - (periods - strobe_count)
        if row >= 0:
            strobes[row, 0], strobes[row, 1] = x, v
        recorded = period - (periods - record_periods)
        sample, event_count = 0, 0
        if maps.shape[0] > 0:
            set_identity(maps[period])
        number = (first + period) % system.repeats
        begin = starts[first_segment[number]]
        rows = samples_of(samples, recorded, record_periods)
        for p in range(first_segment[number], first_segment[number + 1]):
            is_start = period == 0 and p == first_segment[number]
            flanks, pairs = overlap[p], inside[p]
            if is_start or renewed[p]:
                contact_before = _contact_of(s, coast)
                s = touching(flanks, pairs, lower, 0.0, x)
                line = -1
                contact_after = _contact_of(s, coast)
                if contact_after == NORMAL and x < lower:
                    return x, v, 0, events, 0, JAMMED, steps
                if recorded >= 0 and contact_after != contact_before and not is_start:
                    events, event_rows = orbit.count_event(
                        events,
                        event_rows,
                        period,
                        starts[p] - begin,
                        contact_before,
                        contact_after,
                        v,
                        summary,
                    )
            phase, end = starts[p], starts[p + 1]
            while phase < end:
                t, drag = phase - starts[p], damping[1 if s else 0]
                contact = _contact_of(s, coast)
                force_row = force[p, s]
                _expand(force_row, t, drag, slip[p], unit, x, v, series)
                h = min(longest, end - phase)
                if end - phase - h < 1e-13:
                    h = end - phase
                event_share, pair = _first_event(
                    flanks, pairs, lower, closing, s, line, t, h, x, series, to_bernstein, work
                )
                if event_share < 0.0:
                    return x, v, 0, events, 0, UNRESOLVED, steps
                if event_share <= 1.0 and (s != 0 and pair == k if s != coast else pair < k):
                    return x, v, 0, events, 0, JAMMED, steps
                h = h if event_share > 1.0 else event_share * h
                x, v = state_at(series, h)
                steps += 1
                if not within_range(x, v):
                    return x, v, 0, events, 0, OVERFLOW, steps
                if maps.shape[0] > 0:
                    _map_step(force_row, t, drag, unit, h, maps[period])
                if recorded >= 0:
                    # The lower stiffness is that of a single pair.
                    low = s < coast and s & (s - 1) == 0
                    add_step(tuning, low, to_bernstein, h, contact, series, work, summary)
                    if orbit.unresolved(summary):
                        return x, v, 0, events, 0, UNRESOLVED, steps
                    sample = add_samples(tuning, phase - begin, h, contact, series, rows, sample)
                phase += h
                if event_share > 1.0:
                    line = -1
                    continue
                event_count += 1
                if event_count > limit:
                    return x, v, 0, events, 0, EVENT_LIMIT, steps
                line = pair
                s = (coast if s == 0 else 0) if pair == k else s ^ (1 << pair)
                contact_after = _contact_of(s, coast)
                if maps.shape[0] > 0:
                    t = phase - starts[p]
                    jump = (_value(force[p, s], t, x) - _value(force_row, t, x)) * unit
                    jump += (damping[1 if s else 0] - drag) * (v - slip[p])
                    factor, rate = 1.0, v
                    if pair < k:
                        row_of = flanks[s & ~(1 << pair), pair]
                        factor = row_of[FACTOR] + row_of[FACTOR_SLOPE] * t
                        rate = factor * v + row_of[FACTOR_SLOPE] * x - row_of[OFFSET_SLOPE]
                    # The saltation matrix of a tangential crossing is the identity.
                    if rate != 0.0:
                        multiply(1.0, 0.0, -jump * factor / rate, 1.0, maps[period])
                if contact_after != contact and recorded >= 0:
                    events, event_rows = orbit.count_event(
                        events,
                        event_rows,
                        period,
                        phase - begin,
                        contact,
                        contact_after,
                        v,
                        summary,
                    )
    strobes[strobe_count, 0], strobes[strobe_count, 1] = x, v
    height = summary[orbit.X_MAX] - summary[orbit.X_MIN]
    orbit_period = orbit.orbit_period(strobes, tuning, height, system.repeats)
    return x, v, orbit_period, events, event_rows, OK, steps


class Propagator(propagator.Propagator):
    """A `LoadSharingPair` at one tuning."""

    at = Base.at

    def __init__(self, model, tuning):
        Base.__init__(self, model, tuning)
        self.system = model.system(tuning)

    def integrate(self, *arguments):
        """Call `run_pairs` with the arguments and returns of that function."""
        return run_pairs(self.system, propagator.TO_BERNSTEIN, *arguments)
