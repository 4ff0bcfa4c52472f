"""The run of a nonlinear mesh: Taylor steps that end where the law of motion changes.

A step ends at the end of a segment of c(tau), at the first crossing of a flank line and, if the
damping has a quadratic part, at a change of sign of x'. Crossings are roots of the polynomial of
the step, so that a bounce inside a step is found (`polynomial.first_fall`).
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
    set_identity,
    stiffness_bound,
)
from gearlib.engines.taylor.series import (
    COAST_LINE,
    D2,
    DISPLACEMENT,
    DRIVE_LINE,
    MESH_FORCE,
    ORDER,
    ROWS,
    SCALED,
    STIFFNESS,
    VELOCITY,
    expand,
    state_at,
    step_length,
    tabulate_law,
)

#: Reasons for the end of a step.
_NO_EVENT, _DRIVE_FLANK, _COAST_FLANK, _TURNING_POINT = range(4)


@inlined
def _fill_scaled(series, quantity, reference, factor, h):
    """Fill the row SCALED of `series` with factor (a - reference) as a polynomial of t / h.

    The row `quantity` holds the series a. Returns the sum of magnitudes of the terms beyond the
    square.
    """
    power, tail = factor, 0.0
    for k in range(1, ORDER + 1):
        power *= h
        series[SCALED, k] = series[quantity, k] * power
        if k > 2:
            tail += abs(series[SCALED, k])
    series[SCALED, 0] = factor * (series[quantity, 0] - reference)
    return tail


@kernel
def first_crossing(series, quantity, line, direction, h, to_bernstein, work):
    """Return where direction (a - line) first falls through zero, as a share of the step h.

    The row `quantity` of `series` holds the series a; the direction is 1 or -1. The share is 2 if
    there is no crossing and -1 if the search fails. `to_bernstein` is the matrix from power to
    Bernstein coefficients, `work` storage, shape (WORK_ROWS, ORDER + 2).
    """
    tail, curve = _fill_scaled(series, quantity, line, direction, h), series[SCALED]
    # In most steps the first three terms prove that the curve does not reach the line.
    if min_of_parabola(curve[0], curve[1], curve[2]) > tail:
        return 2.0
    return first_fall(curve, to_bernstein, work)


@inlined
def take_step(
    constants,
    harmonics,
    to_bernstein,
    segment,
    phase,
    remaining,
    contact_code,
    velocity_sign,
    x,
    v,
    series,
    work,
):
    """Take one Taylor step from (x, v) at a phase, at most `remaining` long; fill its `series`.

    Returns (length of the step, contact code during the step, contact code, velocity sign, x and v
    at its end). The length is negative if rounding hides whether the step ends at a flank line. The
    end is exact on a flank line and at a turning point. Tables come from `tabulate_law`.
    """
    drive_line, coast_line = constants[0, 0, DRIVE_LINE], constants[0, 0, COAST_LINE]
    if v == 0.0:
        # The acceleration decides the direction of a motion at rest, also on a flank line.
        expand(constants, harmonics, segment, phase, contact_code, 0.0, x, v, series, 1)
        velocity_sign = math.copysign(1.0, series[VELOCITY, 1])
        contact_code = contact_between(drive_line, coast_line, x, velocity_sign)
    step_code = contact_code
    expand(constants, harmonics, segment, phase, contact_code, velocity_sign, x, v, series, ORDER)
    h = step_length(constants, series, remaining)
    # A remaining phase below rounding is added to the step.
    if remaining - h < 1e-13:
        h = remaining
    event_share, reason = 2.0, _NO_EVENT
    if contact_code != INVERSE:
        direction = 1.0 if contact_code == NORMAL else -1.0
        event_share = first_crossing(
            series, DISPLACEMENT, drive_line, direction, h, to_bernstein, work
        )
        reason = _DRIVE_FLANK
    if contact_code != NORMAL and coast_line > -math.inf:
        direction = 1.0 if contact_code == BACKLASH else -1.0
        coast_share = first_crossing(
            series, DISPLACEMENT, coast_line, direction, h, to_bernstein, work
        )
        if coast_share < event_share:
            event_share, reason = coast_share, _COAST_FLANK
    if constants[contact_code + 1, segment, D2] != 0.0:
        turning_share = first_crossing(series, VELOCITY, 0.0, velocity_sign, h, to_bernstein, work)
        if turning_share < event_share:
            event_share, reason = turning_share, _TURNING_POINT
    t = h if event_share > 1.0 else event_share * h
    x, v = state_at(series, t)
    if event_share > 1.0:
        return t, step_code, contact_code, velocity_sign, x, v
    if event_share < 0.0:
        return -1.0, step_code, contact_code, velocity_sign, x, v
    if reason == _TURNING_POINT:
        return t, step_code, contact_code, -velocity_sign, x, 0.0
    x = drive_line if reason == _DRIVE_FLANK else coast_line
    if contact_code == BACKLASH:
        contact_code = NORMAL if reason == _DRIVE_FLANK else INVERSE
        v = max(v, 0.0) if reason == _DRIVE_FLANK else min(v, 0.0)
    else:
        v = min(v, 0.0) if contact_code == NORMAL else max(v, 0.0)
        leaves_flank = v < 0.0 if contact_code == NORMAL else v > 0.0
        if leaves_flank:
            contact_code = BACKLASH if drive_line > coast_line else -contact_code
    return t, step_code, contact_code, math.copysign(1.0, v), x, v


@kernel
def add_step(tuning, below_mean, to_bernstein, h, contact_code, series, work, summary):
    """Add the extrema and contact times of a Taylor step of length h to the summary of a motion.

    `below_mean` tells whether the stiffness is below its mean. `to_bernstein` is the matrix from
    power to Bernstein coefficients, `work` is storage.
    """
    curve = series[SCALED]
    _fill_scaled(series, DISPLACEMENT, 0.0, 1.0, h)
    orbit.add_curve(curve, to_bernstein, work, summary, orbit.X_MAX, orbit.X_MIN)
    orbit.add_time(contact_code, h, below_mean, summary)
    if contact_code != BACKLASH:
        _fill_scaled(series, MESH_FORCE, 0.0, tuning * tuning, h)
        if summary.shape[0] > orbit.SUMMARY_COLUMNS:
            for k in range(ORDER + 1):
                summary[orbit.SUMMARY_COLUMNS] += h * curve[k] / (k + 1.0)
        orbit.add_curve(curve, to_bernstein, work, summary, orbit.FORCE_MAX, orbit.FORCE_MIN)


@kernel
def add_samples(tuning, phase, h, contact_code, series, samples, sample):
    """Fill the samples of a mesh period that lie in a step of length h; return the next sample.

    The step starts at a phase of the period and has the Taylor series `series`; `sample` is the
    index of the first sample that is not filled yet.
    """
    force_scale = tuning * tuning
    while sample < samples.shape[0]:
        t = samples[sample, orbit.SAMPLE_PHASE] - phase
        if t >= h:
            break
        samples[sample, orbit.SAMPLE_X], _ = horner(series[DISPLACEMENT], t)
        samples[sample, orbit.SAMPLE_V], samples[sample, orbit.SAMPLE_A] = horner(
            series[VELOCITY], t
        )
        samples[sample, orbit.SAMPLE_CONTACT] = contact_code
        stiffness, _ = horner(series[STIFFNESS], t)
        samples[sample, orbit.SAMPLE_STIFFNESS] = force_scale * stiffness
        force = 0.0
        if contact_code != BACKLASH:
            force, _ = horner(series[MESH_FORCE], t)
        samples[sample, orbit.SAMPLE_FORCE] = force_scale * force
        sample += 1
    return sample


@inlined
def samples_of_period(samples, recorded_period, record_periods):
    """Return the samples of one recorded mesh period, with their phases filled in.

    `samples` has equally many samples for each recorded period; the period is given by its number.
    """
    count = samples.shape[0] // max(record_periods, 1)
    period_samples = samples[max(recorded_period, 0) * count : (recorded_period + 1) * count]
    orbit.fill_sample_phases(period_samples, orbit.SAMPLE_PHASE, 2.0 * math.pi)
    return period_samples


@kernel
def run_nonlinear(
    law,
    to_bernstein,
    x,
    v,
    periods,
    record_periods,
    samples,
    events,
    max_steps,
    summary,
    period_maps,
):
    """Run the nonlinear mesh; arguments and first returns are those of `pair.pair_run.run`.

    The period maps, shape (periods, 2, 2) or (0, 2, 2), get the derivatives of the state after each
    period by the state before. Returns also the number of Taylor steps, a measure of cost.
    """
    orbit.clear_summary(summary)
    constants, harmonics = tabulate_law(law)
    series, work = np.zeros((ROWS, ORDER + 1)), np.empty((WORK_ROWS, ORDER + 2))
    deviation, max_stiffness = np.zeros((6, ORDER + 1)), stiffness_bound(law)
    # Each access to a named tuple counts references, so the loop uses local names.
    segment_bounds, below_mean, tuning = law.segment_bounds, law.below_mean, law.tuning
    has_maps = period_maps.shape[0] > 0
    strobe_count = min(periods, orbit.STROBE_PERIODS) if record_periods else 0
    strobes = np.empty((strobe_count + 1, 2))
    event_rows, steps = 0, 0
    contact_code, velocity_sign = (
        contact_between(law.drive_line, law.coast_line, x, v),
        math.copysign(1.0, v),
    )
    if not within_range(x, v):
        return x, v, 0, events, 0, OVERFLOW, steps
    for period in range(periods):
        strobe = period - (periods - strobe_count)
        if strobe >= 0:
            strobes[strobe, 0], strobes[strobe, 1] = x, v
        if has_maps:
            set_identity(period_maps[period])
        recorded = period - (periods - record_periods)
        sample_count, steps_before = 0, steps
        period_samples = samples_of_period(samples, recorded, record_periods)
        for segment in range(below_mean.shape[0]):
            phase, end = segment_bounds[segment], segment_bounds[segment + 1]
            while phase < end:
                if steps - steps_before >= max_steps:
                    return x, v, 0, events, 0, EVENT_LIMIT, steps
                code_before, step_sign = contact_code, velocity_sign
                starts_at_rest, remaining = v == 0.0, end - phase
                if has_maps:
                    remaining = min(
                        remaining,
                        longest_deviation_step(
                            constants[contact_code + 1, segment], max_stiffness, contact_code, x, v
                        ),
                    )
                h, step_code, contact_code, velocity_sign, x, v = take_step(
                    constants,
                    harmonics,
                    to_bernstein,
                    segment,
                    phase,
                    remaining,
                    contact_code,
                    velocity_sign,
                    x,
                    v,
                    series,
                    work,
                )
                steps += 1
                if h < 0.0:
                    return x, v, 0, events, 0, UNRESOLVED, steps
                if has_maps:
                    # A step from rest has the sign of its acceleration.
                    step_sign = (
                        math.copysign(1.0, series[VELOCITY, 1]) if starts_at_rest else step_sign
                    )
                    map_crossing(
                        constants, segment, code_before, step_code, 0.0, period_maps[period]
                    )
                    map_step(
                        constants[step_code + 1, segment],
                        step_code,
                        step_sign,
                        h,
                        series,
                        deviation,
                        period_maps[period],
                    )
                    map_crossing(
                        constants, segment, step_code, contact_code, v, period_maps[period]
                    )
                if not within_range(x, v):
                    return x, v, 0, events, 0, OVERFLOW, steps
                if recorded >= 0:
                    add_step(
                        tuning,
                        below_mean[segment],
                        to_bernstein,
                        h,
                        step_code,
                        series,
                        work,
                        summary,
                    )
                    if orbit.unresolved(summary):
                        return x, v, 0, events, 0, UNRESOLVED, steps
                    sample_count = add_samples(
                        tuning, phase, h, step_code, series, period_samples, sample_count
                    )
                    if step_code != code_before:
                        # The motion leaves a flank line from rest at the start of the step.
                        events, event_rows = orbit.count_event(
                            events, event_rows, period, phase, code_before, step_code, 0.0, summary
                        )
                    if contact_code != step_code:
                        events, event_rows = orbit.count_event(
                            events,
                            event_rows,
                            period,
                            phase + h,
                            step_code,
                            contact_code,
                            v,
                            summary,
                        )
                phase += h
    strobes[strobe_count, 0], strobes[strobe_count, 1] = x, v
    height = summary[orbit.X_MAX] - summary[orbit.X_MIN]
    return x, v, orbit.orbit_period(strobes, tuning, height), events, event_rows, OK, steps
