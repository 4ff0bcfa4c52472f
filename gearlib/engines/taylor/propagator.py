"""Taylor steps that end at events, for one degree of freedom with nonlinear forces.

A step ends at the end of a segment of c(tau), at the first crossing of a flank line and, if the
damping has a quadratic part, at a change of sign of x'. Crossings are roots of the polynomial of
the step, so that a bounce inside a step is found (`polynomial.first_downward_crossing`).
"""

import math

import numpy as np

from gearlib.engines import orbit
from gearlib.engines.codes import COAST, DRIVE, EVENT_LIMIT, NO_CONTACT, OK, OVERFLOW, UNRESOLVED
from gearlib.engines.jit import inlined_kernel, kernel
from gearlib.engines.orbit import Record, Span, is_within_range
from gearlib.engines.pair.motion import contact_between
from gearlib.engines.polynomial import (
    WORK_ROWS,
    bernstein_matrix,
    first_downward_crossing,
    horner,
    parabola_minimum,
)
from gearlib.engines.protocol import Base
from gearlib.engines.taylor.perturbations import (
    map_crossing,
    map_step,
    max_perturbation_step,
    set_identity,
    stiffness_bound,
)
from gearlib.engines.taylor.series import (
    COAST_LINE,
    D2,
    DISPLACEMENT,
    DRIVE_LINE,
    INVERSE_INTEGERS,
    MESH_FORCE,
    ORDER,
    ROWS,
    SCALED,
    STIFFNESS,
    VELOCITY,
    expand_motion,
    state_at,
    step_length,
    tabulate_mesh,
)

#: Reasons for the end of a step.
_NO_EVENT, _DRIVE_FLANK, _COAST_FLANK, _TURNING_POINT = range(4)


@inlined_kernel
def _fill_scaled_polynomial(series, quantity, reference, factor, step):
    """Fill the row SCALED of `series` with the polynomial factor * (a - reference) in t / step.

    The row `quantity` of `series` holds the power series a in the phase t. In t / step the step is
    the interval [0, 1], as the search for roots needs. Returns the sum of the magnitudes of all
    terms beyond the square term.
    """
    power, tail = factor, 0.0
    for k in range(1, ORDER + 1):
        power *= step
        series[SCALED, k] = series[quantity, k] * power
        if k > 2:
            tail += abs(series[SCALED, k])
    series[SCALED, 0] = factor * (series[quantity, 0] - reference)
    return tail


@kernel
def first_crossing(series, quantity, line, direction, step, to_bernstein, work):
    """Return the fraction of a step at which a quantity a(t) first crosses a value, the line.

    A crossing is a fall of direction * (a - line) through zero; the direction is 1 or -1. The row
    `quantity` of `series` holds the power series of a. The fraction is 2 if there is no crossing
    and -1 if the search fails. `step` is the length of the step; `to_bernstein` is the matrix that
    converts power to Bernstein coefficients; `work`, shape (WORK_ROWS, ORDER + 2), is overwritten.
    """
    tail = _fill_scaled_polynomial(series, quantity, line, direction, step)
    polynomial = series[SCALED]
    # In most steps the first three terms prove that the curve does not reach the line.
    if parabola_minimum(polynomial[0], polynomial[1], polynomial[2]) > tail:
        return 2.0
    return first_downward_crossing(polynomial, to_bernstein, work)


@inlined_kernel
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

    Returns (length of the step, contact code during the step, then contact code, velocity sign, x
    and v at its end). The length is negative if rounding hides whether the step ends at a flank
    line. On a flank line x is exact, and at a turning point v is exact. `constants` and `harmonics`
    come from `tabulate_mesh`.
    """
    drive_line, coast_line = constants[0, 0, DRIVE_LINE], constants[0, 0, COAST_LINE]
    if v == 0.0:
        # The acceleration decides the direction of a motion at rest, also on a flank line.
        expand_motion(constants, harmonics, segment, phase, contact_code, 0.0, x, v, series, 1)
        velocity_sign = math.copysign(1.0, series[VELOCITY, 1])
        contact_code = contact_between(drive_line, coast_line, x, velocity_sign)
    step_code = contact_code
    expand_motion(
        constants, harmonics, segment, phase, contact_code, velocity_sign, x, v, series, ORDER
    )
    h = step_length(constants, series, remaining)
    # A remaining phase below rounding is added to the step.
    if remaining - h < 1e-13:
        h = remaining
    event_fraction, end_reason = 2.0, _NO_EVENT
    if contact_code != COAST:
        direction = 1.0 if contact_code == DRIVE else -1.0
        event_fraction = first_crossing(
            series, DISPLACEMENT, drive_line, direction, h, to_bernstein, work
        )
        end_reason = _DRIVE_FLANK
    if contact_code != DRIVE and coast_line > -math.inf:
        direction = 1.0 if contact_code == NO_CONTACT else -1.0
        coast_fraction = first_crossing(
            series, DISPLACEMENT, coast_line, direction, h, to_bernstein, work
        )
        if coast_fraction < event_fraction:
            event_fraction, end_reason = coast_fraction, _COAST_FLANK
    if constants[contact_code + 1, segment, D2] != 0.0:
        turning_fraction = first_crossing(
            series, VELOCITY, 0.0, velocity_sign, h, to_bernstein, work
        )
        if turning_fraction < event_fraction:
            event_fraction, end_reason = turning_fraction, _TURNING_POINT
    t = h if event_fraction > 1.0 else event_fraction * h
    x, v = state_at(series, t)
    if event_fraction > 1.0:
        return t, step_code, contact_code, velocity_sign, x, v
    if event_fraction < 0.0:
        return -1.0, step_code, contact_code, velocity_sign, x, v
    if end_reason == _TURNING_POINT:
        return t, step_code, contact_code, -velocity_sign, x, 0.0
    x = drive_line if end_reason == _DRIVE_FLANK else coast_line
    if contact_code == NO_CONTACT:
        contact_code = DRIVE if end_reason == _DRIVE_FLANK else COAST
        v = max(v, 0.0) if end_reason == _DRIVE_FLANK else min(v, 0.0)
    else:
        v = min(v, 0.0) if contact_code == DRIVE else max(v, 0.0)
        leaves_flank = v < 0.0 if contact_code == DRIVE else v > 0.0
        if leaves_flank:
            contact_code = NO_CONTACT if drive_line > coast_line else -contact_code
    return t, step_code, contact_code, math.copysign(1.0, v), x, v


@kernel
def add_step_to_summary(
    tuning, below_mean, to_bernstein, step, contact_code, series, work, summary
):
    """Add the extrema and contact times of a Taylor step to the summary of a motion.

    `step` is the length of the step in phase, `contact_code` is drive 1, none 0 or coast -1, and
    `below_mean` says whether the stiffness is below its mean. The rows of `series` hold the Taylor
    series of displacement and mesh force; its row SCALED is overwritten. `to_bernstein` converts
    power to Bernstein coefficients, and `work` is overwritten.
    """
    polynomial = series[SCALED]
    _fill_scaled_polynomial(series, DISPLACEMENT, 0.0, 1.0, step)
    orbit.add_polynomial_extrema(polynomial, to_bernstein, work, summary, orbit.X_MAX, orbit.X_MIN)
    orbit.add_contact_time(contact_code, step, below_mean, summary)
    if contact_code != NO_CONTACT:
        # Forces in the equation by phase lack the factor tuning^2.
        _fill_scaled_polynomial(series, MESH_FORCE, 0.0, tuning * tuning, step)
        integral = 0.0
        for k in range(ORDER + 1):
            integral += polynomial[k] * INVERSE_INTEGERS[k]
        summary[orbit.FORCE_SUM] += step * integral
        orbit.add_polynomial_extrema(
            polynomial, to_bernstein, work, summary, orbit.FORCE_MAX, orbit.FORCE_MIN
        )


@kernel
def add_samples(tuning, phase, step, contact_code, series, samples, sample):
    """Fill the samples of a mesh period that lie in a Taylor step; return the next sample's index.

    The step starts at a `phase` of the period and has the length `step`, a constant contact code
    (drive 1, none 0, coast -1) and the Taylor series in the rows of `series`. `sample` is the index
    of the first row of `samples` that is not filled yet.
    """
    # Forces and stiffnesses in the equation by phase lack this factor.
    force_scale = tuning * tuning
    while sample < samples.shape[0]:
        t = samples[sample, orbit.SAMPLE_PHASE] - phase
        if t >= step:
            break
        samples[sample, orbit.SAMPLE_X], _ = horner(series[DISPLACEMENT], t)
        samples[sample, orbit.SAMPLE_V], samples[sample, orbit.SAMPLE_A] = horner(
            series[VELOCITY], t
        )
        samples[sample, orbit.SAMPLE_CONTACT] = contact_code
        stiffness, _ = horner(series[STIFFNESS], t)
        samples[sample, orbit.SAMPLE_STIFFNESS] = force_scale * stiffness
        force = 0.0
        if contact_code != NO_CONTACT:
            force, _ = horner(series[MESH_FORCE], t)
        samples[sample, orbit.SAMPLE_FORCE] = force_scale * force
        sample += 1
    return sample


@inlined_kernel
def samples_of_period(samples, recorded_period, record_periods, duration):
    """Return the part of the sample table for one recorded mesh period, with its phases filled.

    `samples` has equally many rows for each of the `record_periods`. `recorded_period` counts them
    from 0; before the record it is negative, and the part is empty. `duration` is the length of the
    period in phase or time.
    """
    count = samples.shape[0] // max(record_periods, 1)
    period_samples = samples[max(recorded_period, 0) * count : (recorded_period + 1) * count]
    orbit.fill_sample_phases(period_samples, orbit.SAMPLE_PHASE, duration)
    return period_samples


@kernel
def run_nonlinear(
    mesh, to_bernstein, x, v, periods, recorded, samples, events, max_steps, summary, period_maps
):
    """Run the nonlinear mesh as `pair.pair_run.run` runs a gear pair, but by Taylor steps.

    Arguments and results have the same meaning. A period has at most `max_steps` steps. The period
    maps, shape (periods, 2, 2) or (0, 2, 2), receive the derivatives of the state after each period
    with respect to the state before it. The last result is the number of Taylor steps.
    """
    orbit.clear_summary(summary)
    constants, harmonics = tabulate_mesh(mesh)
    series, work = np.zeros((ROWS, ORDER + 1)), np.empty((WORK_ROWS, ORDER + 2))
    perturbation, max_stiffness = np.zeros((6, ORDER + 1)), stiffness_bound(mesh)
    # Each access to a named tuple counts references, so the loop uses local names.
    segment_bounds, below_mean, tuning = mesh.segment_bounds, mesh.below_mean, mesh.tuning
    has_maps = period_maps.shape[0] > 0
    strobe_count = min(periods, orbit.STROBE_PERIODS) if recorded else 0
    strobes = np.empty((strobe_count + 1, 2))
    event_count, steps = 0, 0
    contact_code = contact_between(mesh.drive_line, mesh.coast_line, x, v)
    velocity_sign = math.copysign(1.0, v)
    if not is_within_range(x, v):
        return x, v, 0, events, 0, OVERFLOW, steps
    for period in range(periods):
        strobe = period - (periods - strobe_count)
        if strobe >= 0:
            strobes[strobe, 0], strobes[strobe, 1] = x, v
        if has_maps:
            set_identity(period_maps[period])
        recorded_period = period - (periods - recorded)
        sample_count, steps_before = 0, steps
        period_samples = samples_of_period(samples, recorded_period, recorded, 2.0 * math.pi)
        for segment in range(below_mean.shape[0]):
            phase, end = segment_bounds[segment], segment_bounds[segment + 1]
            while phase < end:
                if steps - steps_before >= max_steps:
                    return x, v, 0, events, 0, EVENT_LIMIT, steps
                code_before, step_sign = contact_code, velocity_sign
                starts_at_rest, remaining = v == 0.0, end - phase
                if has_maps:
                    branch_constants = constants[contact_code + 1, segment]
                    max_step = max_perturbation_step(
                        branch_constants, max_stiffness, contact_code, x, v
                    )
                    remaining = min(remaining, max_step)
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
                    branch_constants = constants[step_code + 1, segment]
                    period_map = period_maps[period]
                    if starts_at_rest:
                        step_sign = math.copysign(1.0, series[VELOCITY, 1])
                    map_crossing(constants, segment, code_before, step_code, 0.0, period_map)
                    map_step(
                        branch_constants, step_code, step_sign, h, series, perturbation, period_map
                    )
                    map_crossing(constants, segment, step_code, contact_code, v, period_map)
                if not is_within_range(x, v):
                    return x, v, 0, events, 0, OVERFLOW, steps
                if recorded_period >= 0:
                    is_below_mean = below_mean[segment]
                    add_step_to_summary(
                        tuning, is_below_mean, to_bernstein, h, step_code, series, work, summary
                    )
                    if orbit.has_unresolved_extremum(summary):
                        return x, v, 0, events, 0, UNRESOLVED, steps
                    sample_count = add_samples(
                        tuning, phase, h, step_code, series, period_samples, sample_count
                    )
                    if step_code != code_before:
                        # The motion leaves a flank line from rest at the start of the step.
                        events, event_count = orbit.record_event(
                            events, event_count, period, phase, code_before, step_code, 0.0, summary
                        )
                    if contact_code != step_code:
                        events, event_count = orbit.record_event(
                            events,
                            event_count,
                            period,
                            phase + h,
                            step_code,
                            contact_code,
                            v,
                            summary,
                        )
                phase += h
    strobes[strobe_count, 0], strobes[strobe_count, 1] = x, v
    displacement_range = summary[orbit.X_MAX] - summary[orbit.X_MIN]
    period = orbit.orbit_period(strobes, tuning, displacement_range)
    return x, v, period, events, event_count, OK, steps


#: Truncation error of a step, in static deflections. It is as large as rounding.
TOLERANCE = 1e-16
TO_BERNSTEIN = bernstein_matrix(ORDER)


class Propagator(Base):
    """Engine of a model with one degree of freedom at one tuning, by Taylor steps."""

    description = "Taylor steps"

    def __init__(self, model, tuning: float, tolerance: float = TOLERANCE):
        """Compute the constants of a model at a tuning, mesh frequency over natural frequency.

        `tolerance` is the truncation error of each Taylor step, in static deflections.
        """
        super().__init__(model, tuning)
        self.tolerance = tolerance
        self.mesh = model.nonlinear_mesh(tuning, tolerance)

    def at(self, tuning: float) -> "Propagator":
        """Return the propagator of the same model at another tuning."""
        return type(self)(self.model, tuning, self.tolerance)

    def fill_record(self, z, span, samples, events, summary, first_period):
        """Run from the state z over a `Span`, fill the tables and return the `Record`.

        z becomes the final state. `samples`, `events` and `summary` are empty tables with the
        columns of `Record`. The excitation starts with its mesh period `first_period`.
        """
        tables = samples, events, summary, np.empty((0, 2, 2))
        return self._integrate_from(z, span, *tables, first_period)

    def fill_maps(self, z, periods, max_events, maps, first_period):
        """Fill the period maps of a run from the state z, and return the status of the run.

        Period maps, shape (periods, 2, 2), are the derivatives of the state after each mesh period
        with respect to the state before it. z becomes the final state. A period has at most
        `max_events` steps or events; the excitation starts with its mesh period `first_period`.
        """
        span, tables = Span(periods, 0, max_events), self.model.empty_record(events=0)
        return self._integrate_from(z, span, *tables, maps, first_period).status

    def _integrate_from(self, z, span, samples, events, summary, maps, first_period) -> Record:
        """Run from the state z, fill the tables and the period maps, and return the `Record`.

        z becomes the final state. `span` is the `Span` of mesh periods. `maps`, the derivatives of
        the state over each period, has the shape (periods, 2, 2) or, if they are not needed, (0, 2,
        2). The excitation starts with its mesh period `first_period`.
        """
        tables = samples, events, span.max_events, summary, maps
        result = self.run_kernel(*z, span.periods, span.recorded, tables, first_period)
        *z[:], period, events, event_count, status, steps = result
        # A coefficient of the series costs about one evaluation of the right-hand side.
        return Record(z, z, period, samples, events[:event_count], summary, status, steps * ORDER)

    def run_kernel(self, x, v, periods, recorded, tables, first_period):
        """Run from displacement x and velocity v by `run_nonlinear`, and return its result.

        `recorded` is the number of the last `periods` that are recorded. `tables` are (samples,
        events, largest number of steps in a period, summary, period maps). `first_period` has no
        effect, because the excitation of a nonlinear mesh repeats after each period.
        """
        return run_nonlinear(self.mesh, TO_BERNSTEIN, x, v, periods, recorded, *tables)
