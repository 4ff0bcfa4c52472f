"""The run of a nonlinear mesh: Taylor steps that end where the law of motion changes.

A step ends at the end of a piece of c(tau), at the first crossing of a flank line and, where the
damping has a quadratic part, at a change of sign of x'. Crossings are those of the step's own
polynomial: a bounce inside a step is found (`polynomial.first_fall`).
"""

import math

import numpy as np

from gearlib.engines import orbit
from gearlib.engines.codes import BACKLASH, EVENT_LIMIT, INVERSE, NORMAL, OK, OVERFLOW, UNRESOLVED
from gearlib.engines.jit import inlined, kernel
from gearlib.engines.overflow import within_range
from gearlib.engines.pair.motion import contact_between
from gearlib.engines.polynomial import WORK_ROWS, first_fall, horner, min_of_parabola
from gearlib.engines.taylor.deviations import (
    longest_deviation_step,
    map_crossing,
    map_step,
    max_stiffness,
    set_identity,
)
from gearlib.engines.taylor.series import (
    D2,
    LOWER,
    MESH_FORCE,
    ORDER,
    ROWS,
    SCALED,
    UPPER,
    C,
    V,
    X,
    expand,
    state_at,
    step_length,
    tables,
)

#: Reasons for the end of a step.
_SMOOTH, _NORMAL_FLANK, _FAR_FLANK, _TURN = range(4)


@inlined
def _fill_scaled(series, row, line, factor, h):
    """Fill the row SCALED of `series` with factor (series - line) as a polynomial of t / h.

    `row` is the row that is scaled. Returns the sum of the magnitudes of the terms beyond the
    square.
    """
    power, tail = factor, 0.0
    for k in range(1, ORDER + 1):
        power *= h
        series[SCALED, k] = series[row, k] * power
        if k > 2:
            tail += abs(series[SCALED, k])
    series[SCALED, 0] = factor * (series[row, 0] - line)
    return tail


@kernel
def first_crossing(series, row, line, side, h, to_bernstein, work):
    """Return where side (series - line) first falls through zero, as a share of h, 2 if nowhere.

    `row` is that of the series; the share is -1 if the search fails. `work` is storage.
    """
    tail, curve = _fill_scaled(series, row, line, side, h), series[SCALED]
    # Most steps are far from the line, as their parabola and the other terms show.
    if min_of_parabola(curve[0], curve[1], curve[2]) > tail:
        return 2.0
    return first_fall(curve, to_bernstein, work)


@inlined
def take_step(
    constants, harmonics, to_bernstein, piece, phase, remaining, contact, sign, x, v, series, work
):
    """Take one Taylor step from `phase`, at most `remaining` long; its series stay in `series`.

    Returns (h, during, contact, sign, x, v): the length of the step, negative if rounding hides
    whether it ends at a flank line; the contact code during the step; contact code, sign of x' and
    state at its end, which is exact on a flank line and at a turning point.
    """
    upper, lower = constants[0, 0, UPPER], constants[0, 0, LOWER]
    if v == 0.0:
        # The acceleration decides the direction of a motion at rest, also on a flank line.
        expand(constants, harmonics, piece, phase, contact, 0.0, x, v, series, 1)
        sign = math.copysign(1.0, series[V, 1])
        contact = contact_between(upper, lower, x, sign)
    during = contact
    expand(constants, harmonics, piece, phase, contact, sign, x, v, series, ORDER)
    h = step_length(constants, series, remaining)
    # A remainder below rounding is added to the step.
    if remaining - h < 1e-13:
        h = remaining
    event_share, reason = 2.0, _SMOOTH
    if contact != INVERSE:
        side = 1.0 if contact == NORMAL else -1.0
        event_share = first_crossing(series, X, upper, side, h, to_bernstein, work)
        reason = _NORMAL_FLANK
    if contact != NORMAL and lower > -math.inf:
        side = 1.0 if contact == BACKLASH else -1.0
        far = first_crossing(series, X, lower, side, h, to_bernstein, work)
        if far < event_share:
            event_share, reason = far, _FAR_FLANK
    if constants[contact + 1, piece, D2] != 0.0:
        turn = first_crossing(series, V, 0.0, sign, h, to_bernstein, work)
        if turn < event_share:
            event_share, reason = turn, _TURN
    t = h if event_share > 1.0 else event_share * h
    x, v = state_at(series, t)
    if event_share > 1.0:
        return t, during, contact, sign, x, v
    if event_share < 0.0:
        return -1.0, during, contact, sign, x, v
    if reason == _TURN:
        return t, during, contact, -sign, x, 0.0
    x = upper if reason == _NORMAL_FLANK else lower
    if contact == BACKLASH:
        contact = NORMAL if reason == _NORMAL_FLANK else INVERSE
        v = max(v, 0.0) if reason == _NORMAL_FLANK else min(v, 0.0)
    else:
        v = min(v, 0.0) if contact == NORMAL else max(v, 0.0)
        leaves = v < 0.0 if contact == NORMAL else v > 0.0
        if leaves:
            contact = BACKLASH if upper > lower else -contact
    return t, during, contact, math.copysign(1.0, v), x, v


@kernel
def add_step(tuning, low, to_bernstein, h, contact, series, work, summary):
    """Add a Taylor step of length h to the summary; `low`: the stiffness is below its mean."""
    curve = series[SCALED]
    _fill_scaled(series, X, 0.0, 1.0, h)
    orbit.add_curve(curve, to_bernstein, work, summary, orbit.X_MAX, orbit.X_MIN)
    orbit.add_time(contact, h, low, summary)
    if contact != BACKLASH:
        _fill_scaled(series, MESH_FORCE, 0.0, tuning * tuning, h)
        if summary.shape[0] > orbit.SUMMARY_COLUMNS:
            for k in range(ORDER + 1):
                summary[orbit.SUMMARY_COLUMNS] += h * curve[k] / (k + 1.0)
        orbit.add_curve(curve, to_bernstein, work, summary, orbit.FORCE_MAX, orbit.FORCE_MIN)


@kernel
def add_samples(tuning, phase, h, contact, series, samples, sample):
    """Fill the samples of one period before phase + h; return the number of samples filled."""
    unit = tuning * tuning
    while sample < samples.shape[0]:
        t = samples[sample, orbit.SAMPLE_PHASE] - phase
        if t >= h:
            break
        samples[sample, orbit.SAMPLE_X], _ = horner(series[X], t)
        samples[sample, orbit.SAMPLE_V], samples[sample, orbit.SAMPLE_A] = horner(series[V], t)
        samples[sample, orbit.SAMPLE_CONTACT] = contact
        stiffness, _ = horner(series[C], t)
        samples[sample, orbit.SAMPLE_STIFFNESS] = unit * stiffness
        force = 0.0
        if contact != BACKLASH:
            force, _ = horner(series[MESH_FORCE], t)
        samples[sample, orbit.SAMPLE_FORCE] = unit * force
        sample += 1
    return sample


@inlined
def samples_of(samples, recorded_period, record_periods):
    """Return the rows of samples of a recorded mesh period, with the phases to be sampled."""
    count = samples.shape[0] // max(record_periods, 1)
    rows = samples[max(recorded_period, 0) * count : (recorded_period + 1) * count]
    orbit.fill_sample_phases(rows, orbit.SAMPLE_PHASE, 2.0 * math.pi)
    return rows


@kernel
def run_nonlinear(
    law, to_bernstein, x, v, periods, record_periods, samples, events, limit, summary, maps
):
    """Run the nonlinear mesh; arguments and first returns are those of `pair.pair_run.run`.

    `maps`, shape (periods, 2, 2) or (0, 2, 2), gets the derivative of the state after each period
    by that before. Returns also the number of Taylor steps, a deterministic measure of cost.
    """
    orbit.clear_summary(summary)
    constants, harmonics = tables(law)
    series, work = np.zeros((ROWS, ORDER + 1)), np.empty((WORK_ROWS, ORDER + 2))
    deviation, stiffest = np.zeros((6, ORDER + 1)), max_stiffness(law)
    # Fields are read once, because each access to a named tuple counts references.
    breaks, low, tuning, with_maps = (
        law.segment_bounds,
        law.below_mean,
        law.tuning,
        maps.shape[0] > 0,
    )
    strobe_count = min(periods, orbit.STROBE_PERIODS) if record_periods else 0
    strobes = np.empty((strobe_count + 1, 2))
    event_rows, steps = 0, 0
    contact, sign = contact_between(law.drive_line, law.coast_line, x, v), math.copysign(1.0, v)
    if not within_range(x, v):
        return x, v, 0, events, 0, OVERFLOW, steps
    for period in range(periods):
        row = period - (periods - strobe_count)
        if row >= 0:
            strobes[row, 0], strobes[row, 1] = x, v
        if with_maps:
            set_identity(maps[period])
        recorded = period - (periods - record_periods)
        taken, steps_before = 0, steps
        rows = samples_of(samples, recorded, record_periods)
        for piece in range(low.shape[0]):
            phase, end = breaks[piece], breaks[piece + 1]
            while phase < end:
                if steps - steps_before >= limit:
                    return x, v, 0, events, 0, EVENT_LIMIT, steps
                contact_before, step_sign = contact, sign
                at_rest, remaining = v == 0.0, end - phase
                if with_maps:
                    remaining = min(
                        remaining,
                        longest_deviation_step(
                            constants[contact + 1, piece], stiffest, contact, x, v
                        ),
                    )
                h, during, contact, sign, x, v = take_step(
                    constants,
                    harmonics,
                    to_bernstein,
                    piece,
                    phase,
                    remaining,
                    contact,
                    sign,
                    x,
                    v,
                    series,
                    work,
                )
                steps += 1
                if h < 0.0:
                    return x, v, 0, events, 0, UNRESOLVED, steps
                if with_maps:
                    # A step from rest has the sign of its acceleration.
                    step_sign = math.copysign(1.0, series[V, 1]) if at_rest else step_sign
                    map_crossing(constants, piece, contact_before, during, 0.0, maps[period])
                    map_step(
                        constants[during + 1, piece],
                        during,
                        step_sign,
                        h,
                        series,
                        deviation,
                        maps[period],
                    )
                    map_crossing(constants, piece, during, contact, v, maps[period])
                if not within_range(x, v):
                    return x, v, 0, events, 0, OVERFLOW, steps
                if recorded >= 0:
                    add_step(tuning, low[piece], to_bernstein, h, during, series, work, summary)
                    if orbit.unresolved(summary):
                        return x, v, 0, events, 0, UNRESOLVED, steps
                    taken = add_samples(tuning, phase, h, during, series, rows, taken)
                    if during != contact_before:
                        # The motion leaves a flank line from rest at the start of the step.
                        events, event_rows = orbit.count_event(
                            events, event_rows, period, phase, contact_before, during, 0.0, summary
                        )
                    if contact != during:
                        events, event_rows = orbit.count_event(
                            events, event_rows, period, phase + h, during, contact, v, summary
                        )
                phase += h
    strobes[strobe_count, 0], strobes[strobe_count, 1] = x, v
    height = summary[orbit.X_MAX] - summary[orbit.X_MIN]
    return x, v, orbit.orbit_period(strobes, tuning, height), events, event_rows, OK, steps
