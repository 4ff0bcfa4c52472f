"""One mesh whose pairs of teeth touch one by one: Taylor steps that end at events.

While the pairs of one set touch, the displacement x over the phase tau follows

    x'' = (1 - a x + b) / nu^2 - d (x' - e'),

a and b straight lines on each segment of phase. A set of the k pairs is an integer with a bit for
each; set 0 is the backlash and set 2^k contact of the coast side. Pair i overlaps by p x - r beside
the other pairs of a set: it touches where that is > 0. Displacements are in static deflections,
forces over the load. The series has all its digits on steps below 1.18 over the natural frequency.
A step ends with its segment and at the first crossing of its polynomial, where a pair touches or
parts.
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
from gearlib.engines.taylor.series import ORDER, PUSH, ROWS, C, V, X, state_at
from gearlib.engines.taylor.taylor_run import add_samples, add_step, first_crossing, samples_of

#: Columns of the tables: value at the start of a segment and slope, of the factor of x (a, p) and
#: of what is taken off (b, r).
FACTOR, FACTOR_SLOPE, OFFSET, OFFSET_SLOPE = range(4)


class ToothPairSystem(NamedTuple):
    """One mesh at one tuning: k pairs of teeth, p segments of phase."""

    starts: np.ndarray  #: phases that bound the segments, shape (p + 1,)
    first_segment: np.ndarray  #: int, where each mesh period begins, shape (repeats + 1,)
    renewed: np.ndarray  #: bool, whether pairs come or go where a segment starts, shape (p,)
    inside: np.ndarray  #: int, set of the pairs on their path of contact, shape (p,)
    force: np.ndarray  #: of a set, a and b, shape (p, 2^k + 1, 4)
    overlap: np.ndarray  #: of a pair beside a set without it, p and r, shape (p, 2^k, k, 4)
    slip: np.ndarray  #: e', rate of the gap without load, shape (p,)
    damping: np.ndarray  #: d in the backlash and in contact, over nu, shape (2,)
    lower: float  #: displacement of the coast side, may be -inf
    longest: float  #: phase of the longest step
    tuning: float  #: nu
    repeats: int  #: mesh periods after which the pairs of teeth repeat
    closing: bool  #: whether pairs of teeth and the coast side might touch at once


@inlined
def _value(row, t, x):
    """Return factor times x less offset, t after the start of a segment."""
    factor = row[FACTOR] + row[FACTOR_SLOPE] * t
    return factor * x - row[OFFSET] - row[OFFSET_SLOPE] * t


@kernel
def touching(overlap, inside, lower, t, x):
    """Return the set of pairs that touch at a displacement, t after the start of a segment.

    overlap: that of the segment; inside, lower: as of `ToothPairSystem`.
    """
    sets, k = overlap.shape[0], overlap.shape[1]
    best, least = 0, math.inf
    for s in range(sets):
        if s & ~inside:
            continue
        worst = 0.0
        for i in range(k):
            if inside >> i & 1:
                bit = 1 << i
                value = _value(overlap[s & ~bit, i], t, x)
                worst = max(worst, -value if s & bit else value)
        if worst < least:
            best, least = s, worst
    return sets if best == 0 and x < lower else best


@inlined
def _fill(series, target, row, t):
    """Fill a row of the series with factor times x less offset."""
    level, slope = row[FACTOR] + row[FACTOR_SLOPE] * t, row[FACTOR_SLOPE]
    series[target, 0] = level * series[X, 0] - row[OFFSET] - row[OFFSET_SLOPE] * t
    series[target, 1] = level * series[X, 1] + slope * series[X, 0] - row[OFFSET_SLOPE]
    for k in range(2, ORDER + 1):
        series[target, k] = level * series[X, k] + slope * series[X, k - 1]


@inlined
def _expand(row, t, drag, slip, unit, x, v, series):
    """Fill the series of the motion; `slip`: rate of the gap without load by phase."""
    level, slope = (row[FACTOR] + row[FACTOR_SLOPE] * t) * unit, row[FACTOR_SLOPE] * unit
    # What acts beside the mesh force.
    push = unit + drag * slip
    series[X, 0], series[V, 0] = x, v
    force = level * x - (row[OFFSET] + row[OFFSET_SLOPE] * t) * unit
    for k in range(ORDER):
        series[PUSH, k] = force
        series[X, k + 1] = series[V, k] / (k + 1.0)
        series[V, k + 1] = (push - force - drag * series[V, k]) / (k + 1.0)
        push = 0.0
        force = level * series[X, k + 1] + slope * series[X, k]
        if k == 0:
            force -= row[OFFSET_SLOPE] * unit
    series[PUSH, ORDER] = 0.0
    for k in range(ORDER + 1):
        series[C, k] = 0.0
    series[C, 0], series[C, 1] = level, slope


@kernel
def _follow(row, t, drag, unit, h, matrix):
    """Multiply `matrix` by the map of small deviations over a step."""
    level, slope = (row[FACTOR] + row[FACTOR_SLOPE] * t) * unit, row[FACTOR_SLOPE] * unit
    image = np.empty((2, 2))
    for j in range(2):
        before, a, b = 0.0, 1.0 - j, 1.0 * j
        first, second, power = a, b, 1.0
        for k in range(ORDER):
            new = b / (k + 1.0)
            b = -(level * a + slope * before + drag * b) / (k + 1.0)
            before, a = a, new
            power *= h
            first += a * power
            second += b * power
        image[0, j], image[1, j] = first, second
    multiply(image[0, 0], image[0, 1], image[1, 0], image[1, 1], matrix)


@inlined
def _first_event(overlap, inside, lower, closing, s, line, t, h, x, series, to_bernstein, work):
    """Return (share of a step of length h, number of the pair) of the first touch or parting.

    Share 2: none; -1: rounding hides whether there is one. The number after the last pair is the
    coast side. `overlap`, `inside`: of the segment; `line`: on which the step starts, -1 on none;
    `closing`: whether what touches on the other side has to be looked at too.
    """
    coast, k = overlap.shape[0], overlap.shape[1]
    best, which = 2.0, -1
    for i in range(k):
        bit = 1 << i
        if (s == coast and not closing) or not inside & bit:
            continue
        touches = s != coast and s & bit != 0
        _fill(series, ROWS + i, overlap[s & ~bit if s != coast else 0, i], t)
        if line == i:
            series[ROWS + i, 0] = 0.0
        side = 1.0 if touches else -1.0
        share = first_crossing(series, ROWS + i, 0.0, side, h, to_bernstein, work)
        if share < best:
            best, which = share, i
    if lower > -math.inf and (closing or s == 0 or s == coast):
        for j in range(ORDER + 1):
            series[ROWS + k, j] = series[X, j]
        series[ROWS + k, 0] = 0.0 if line == k else x - lower
        side = 1.0 if s != coast else -1.0
        share = first_crossing(series, ROWS + k, 0.0, side, h, to_bernstein, work)
        if share < best:
            best, which = share, k
    return best, which


@inlined
def _contact_of(s, coast):
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
    """Run the mesh; arguments and returns as of `gearlib.engines.pair.pair_run.run`.

    `maps`, shape (periods, 2, 2) or (0, 2, 2), is filled with the maps of small deviations; `first`
    is the mesh period in which the run begins. Returns in addition the number of steps.
    """
    orbit.clear_summary(summary)
    first_segment, inside = system.first_segment, system.inside
    starts, renewed = system.starts, system.renewed
    force, overlap, slip, damping = system.force, system.overlap, system.slip, system.damping
    lower, longest, tuning = system.lower, system.longest, system.tuning
    closing = system.closing
    k, coast, unit = overlap.shape[2], overlap.shape[1], 1.0 / (tuning * tuning)
    series, work = np.zeros((ROWS + k + 1, ORDER + 1)), np.empty((WORK_ROWS, ORDER + 2))
    kept = min(periods, orbit.strobe_periods(system.repeats))
    strobes = np.empty((kept + 1, 2))
    found, steps, s, line = 0, 0, 0, -1
    for n in range(periods):
        row = n - (periods - kept)
        if row >= 0:
            strobes[row, 0], strobes[row, 1] = x, v
        recorded = n - (periods - record_periods)
        taken, count = 0, 0
        if maps.shape[0] > 0:
            set_identity(maps[n])
        number = (first + n) % system.repeats
        begin = starts[first_segment[number]]
        rows = samples_of(samples, recorded, record_periods)
        for p in range(first_segment[number], first_segment[number + 1]):
            start = n == 0 and p == first_segment[number]
            flanks, pairs = overlap[p], inside[p]
            if start or renewed[p]:
                before = _contact_of(s, coast)
                s = touching(flanks, pairs, lower, 0.0, x)
                line = -1
                after = _contact_of(s, coast)
                if after == NORMAL and x < lower:
                    return x, v, 0, events, 0, JAMMED, steps
                if recorded >= 0 and after != before and not start:
                    events, found = orbit.note(
                        events, found, n, starts[p] - begin, before, after, v, summary
                    )
            phase, end = starts[p], starts[p + 1]
            while phase < end:
                t, drag = phase - starts[p], damping[1 if s else 0]
                during = _contact_of(s, coast)
                law = force[p, s]
                _expand(law, t, drag, slip[p], unit, x, v, series)
                h = min(longest, end - phase)
                if end - phase - h < 1e-13:
                    h = end - phase
                best, which = _first_event(
                    flanks,
                    pairs,
                    lower,
                    closing,
                    s,
                    line,
                    t,
                    h,
                    x,
                    series,
                    to_bernstein,
                    work,
                )
                if best < 0.0:
                    return x, v, 0, events, 0, UNRESOLVED, steps
                if best <= 1.0 and (s != 0 and which == k if s != coast else which < k):
                    return x, v, 0, events, 0, JAMMED, steps
                h = h if best > 1.0 else best * h
                x, v = state_at(series, h)
                steps += 1
                if not within_range(x, v):
                    return x, v, 0, events, 0, OVERFLOW, steps
                if maps.shape[0] > 0:
                    _follow(law, t, drag, unit, h, maps[n])
                if recorded >= 0:
                    # "At the lower stiffness": while one pair carries alone.
                    low = s < coast and s & (s - 1) == 0
                    add_step(tuning, low, to_bernstein, h, during, series, work, summary)
                    if orbit.unresolved(summary):
                        return x, v, 0, events, 0, UNRESOLVED, steps
                    taken = add_samples(tuning, phase - begin, h, during, series, rows, taken)
                phase += h
                if best > 1.0:
                    line = -1
                    continue
                count += 1
                if count > limit:
                    return x, v, 0, events, 0, EVENT_LIMIT, steps
                line = which
                s = (coast if s == 0 else 0) if which == k else s ^ (1 << which)
                after = _contact_of(s, coast)
                if maps.shape[0] > 0:
                    t = phase - starts[p]
                    jump = (_value(force[p, s], t, x) - _value(law, t, x)) * unit
                    jump += (damping[1 if s else 0] - drag) * (v - slip[p])
                    factor, rate = 1.0, v
                    if which < k:
                        row_of = flanks[s & ~(1 << which), which]
                        factor = row_of[FACTOR] + row_of[FACTOR_SLOPE] * t
                        rate = factor * v + row_of[FACTOR_SLOPE] * x - row_of[OFFSET_SLOPE]
                    # A tangential crossing varies nothing.
                    if rate != 0.0:
                        multiply(1.0, 0.0, -jump * factor / rate, 1.0, maps[n])
                if after != during and recorded >= 0:
                    events, found = orbit.note(
                        events, found, n, phase - begin, during, after, v, summary
                    )
    strobes[kept, 0], strobes[kept, 1] = x, v
    height = summary[orbit.X_MAX] - summary[orbit.X_MIN]
    period = orbit.orbit_period(strobes, tuning, height, system.repeats)
    return x, v, period, events, found, OK, steps


class Propagator(propagator.Propagator):
    """A `LoadSharingPair` at one tuning."""

    at = Base.at

    def __init__(self, model, tuning):
        Base.__init__(self, model, tuning)
        self.system = model.system(tuning)

    def integrate(self, *arguments):
        """Call the kernel; arguments and returns are those of `run_pairs`."""
        return run_pairs(self.system, propagator.TO_BERNSTEIN, *arguments)
