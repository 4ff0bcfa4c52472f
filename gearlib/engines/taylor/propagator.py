"""Taylor steps that end at events, for one degree of freedom with nonlinear forces.

A step ends at the end of a segment of c(tau), at the first crossing of a flank line and, if the
damping has a quadratic part, at a change of sign of x'. Crossings are roots of the polynomial of
the step, so a bounce within a step is found (`polynomial.first_downward_crossing`).
"""

import math

import numpy as np

from gearlib.engines import orbit
from gearlib.engines.codes import COAST, DRIVE, EVENT_LIMIT, NO_CONTACT, OK, OVERFLOW, UNRESOLVED
from gearlib.engines.jit import kernel, kernel_part
from gearlib.engines.orbit import Record, Span, is_within_range
from gearlib.engines.pair.motion import contact_state_with_lines
from gearlib.engines.polynomial import (
    WORKSPACE_ROWS,
    bernstein_matrix,
    first_downward_crossing,
    horner,
    parabola_minimum,
)
from gearlib.engines.protocol import Engine
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


@kernel_part(inlined=True)
def _fill_scaled_polynomial(series, quantity, reference, factor, step):
    """Fill the row SCALED of `series` with the polynomial factor * (a - reference) in t / step.

    The row `quantity` of `series` holds the power series a in the phase t. In terms of t / step,
    the step is the interval [0, 1], as required by the search for roots. Returns the sum of the
    magnitudes of all terms beyond the square term.
    """
    power, tail = factor, 0.0
    for k in range(1, ORDER + 1):
        power *= step
        series[SCALED, k] = series[quantity, k] * power
        if k > 2:
            tail += abs(series[SCALED, k])
    series[SCALED, 0] = factor * (series[quantity, 0] - reference)
    return tail


@kernel_part
def first_crossing(series, quantity, threshold, direction, step, to_bernstein, workspace):
    """Return the fraction of a step at which a quantity a(t) first crosses the value `threshold`.

    A crossing is a fall of direction * (a - threshold) through zero; the direction is 1 or -1. The
    row `quantity` of `series` holds the power series a. The fraction is 2 if there is no crossing
    and -1 if the search fails. `step` is the length of the step; `to_bernstein` is the matrix that
    converts power to Bernstein coefficients; `workspace`, shape (WORKSPACE_ROWS, ORDER + 2), is
    overwritten.
    """
    tail = _fill_scaled_polynomial(series, quantity, threshold, direction, step)
    polynomial = series[SCALED]
    # In most steps the first three terms prove that the threshold is not reached.
    if parabola_minimum(polynomial[0], polynomial[1], polynomial[2]) > tail:
        return 2.0
    return first_downward_crossing(polynomial, to_bernstein, workspace)


@kernel_part(inlined=True)
def take_step(
    constants,
    harmonics,
    to_bernstein,
    segment,
    phase,
    remaining,
    contact_state,
    velocity_sign,
    x,
    v,
    series,
    workspace,
):
    """Take one Taylor step from (x, v) at a phase, at most `remaining` long; fill its `series`.

    Returns (length of the step, contact state during the step, then contact state, velocity sign, x
    and v at its end). The length is negative if rounding decides whether the step ends at a flank
    line. On a flank line x is exact, and at a turning point v is exact. `constants` and `harmonics`
    are results of `tabulate_mesh`.
    """
    drive_line, coast_line = constants[0, 0, DRIVE_LINE], constants[0, 0, COAST_LINE]
    if v == 0.0:
        # The acceleration decides in which direction a motion at rest starts.
        expand_motion(constants, harmonics, segment, phase, contact_state, 0.0, x, v, series, 1)
        velocity_sign = math.copysign(1.0, series[VELOCITY, 1])
        contact_state = contact_state_with_lines(drive_line, coast_line, x, velocity_sign)
    step_contact = contact_state
    expand_motion(
        constants, harmonics, segment, phase, contact_state, velocity_sign, x, v, series, ORDER
    )
    h = step_length(constants, series, remaining)
    # Include a remaining phase below rounding in the step.
    if remaining - h < 1e-13:
        h = remaining
    event_fraction, end_reason = 2.0, _NO_EVENT
    if contact_state != COAST:
        direction = 1.0 if contact_state == DRIVE else -1.0
        event_fraction = first_crossing(
            series, DISPLACEMENT, drive_line, direction, h, to_bernstein, workspace
        )
        end_reason = _DRIVE_FLANK
    if contact_state != DRIVE and coast_line > -math.inf:
        direction = 1.0 if contact_state == NO_CONTACT else -1.0
        coast_fraction = first_crossing(
            series, DISPLACEMENT, coast_line, direction, h, to_bernstein, workspace
        )
        if coast_fraction < event_fraction:
            event_fraction, end_reason = coast_fraction, _COAST_FLANK
    if constants[contact_state + 1, segment, D2] != 0.0:
        turning_fraction = first_crossing(
            series, VELOCITY, 0.0, velocity_sign, h, to_bernstein, workspace
        )
        if turning_fraction < event_fraction:
            event_fraction, end_reason = turning_fraction, _TURNING_POINT
    t = h if event_fraction > 1.0 else event_fraction * h
    x, v = state_at(series, t)
    if event_fraction > 1.0:
        return t, step_contact, contact_state, velocity_sign, x, v
    if event_fraction < 0.0:
        return -1.0, step_contact, contact_state, velocity_sign, x, v
    if end_reason == _TURNING_POINT:
        return t, step_contact, contact_state, -velocity_sign, x, 0.0
    x = drive_line if end_reason == _DRIVE_FLANK else coast_line
    if contact_state == NO_CONTACT:
        contact_state = DRIVE if end_reason == _DRIVE_FLANK else COAST
        v = max(v, 0.0) if end_reason == _DRIVE_FLANK else min(v, 0.0)
    else:
        v = min(v, 0.0) if contact_state == DRIVE else max(v, 0.0)
        leaves_flank = v < 0.0 if contact_state == DRIVE else v > 0.0
        if leaves_flank:
            contact_state = NO_CONTACT if drive_line > coast_line else -contact_state
    return t, step_contact, contact_state, math.copysign(1.0, v), x, v


@kernel_part
def add_step_to_summary(
    tuning, below_mean, to_bernstein, step, contact_state, series, workspace, summary
):
    """Add the extrema and contact times of a Taylor step to the summary of a motion.

    `step` is the length of the step in phase, `contact_state` is drive 1, none 0 or coast -1, and
    `below_mean` tells whether the stiffness is below its mean. The rows of `series` hold the Taylor
    series of displacement and mesh force; its row SCALED is overwritten. `to_bernstein` converts
    power to Bernstein coefficients, and `workspace` is overwritten.
    """
    polynomial = series[SCALED]
    _fill_scaled_polynomial(series, DISPLACEMENT, 0.0, 1.0, step)
    orbit.add_polynomial_extrema(
        polynomial, to_bernstein, workspace, summary, orbit.X_MAX, orbit.X_MIN
    )
    orbit.add_contact_time(contact_state, step, below_mean, summary)
    if contact_state != NO_CONTACT:
        # The factor tuning^2 converts forces from the equation by phase.
        _fill_scaled_polynomial(series, MESH_FORCE, 0.0, tuning * tuning, step)
        integral = 0.0
        for k in range(ORDER + 1):
            integral += polynomial[k] * INVERSE_INTEGERS[k]
        summary[orbit.FORCE_SUM] += step * integral
        orbit.add_polynomial_extrema(
            polynomial, to_bernstein, workspace, summary, orbit.FORCE_MAX, orbit.FORCE_MIN
        )


@kernel_part
def add_samples(tuning, phase, step, contact_state, series, samples, sample):
    """Fill the samples that lie in a Taylor step; return the index of the next sample.

    The step starts at a `phase` of the mesh period and has the length `step`, a constant contact
    state (drive 1, none 0, coast -1) and the Taylor series in the rows of `series`. `sample` is the
    index of the first row of `samples` that is not filled yet.
    """
    # This factor converts forces and stiffnesses from the equation by phase.
    force_scale = tuning * tuning
    while sample < samples.shape[0]:
        t = samples[sample, orbit.SAMPLE_PHASE] - phase
        if t >= step:
            break
        samples[sample, orbit.SAMPLE_X], _ = horner(series[DISPLACEMENT], t)
        samples[sample, orbit.SAMPLE_V], samples[sample, orbit.SAMPLE_A] = horner(
            series[VELOCITY], t
        )
        samples[sample, orbit.SAMPLE_CONTACT] = contact_state
        stiffness, _ = horner(series[STIFFNESS], t)
        samples[sample, orbit.SAMPLE_STIFFNESS] = force_scale * stiffness
        force = 0.0
        if contact_state != NO_CONTACT:
            force, _ = horner(series[MESH_FORCE], t)
        samples[sample, orbit.SAMPLE_FORCE] = force_scale * force
        sample += 1
    return sample


@kernel_part(inlined=True)
def samples_of_period(samples, recorded_period, record_periods, duration):
    """Return the rows of the sample table of one recorded mesh period, with their phases filled in.

    `samples` has the same number of rows for each of the `record_periods`. `recorded_period` counts
    these from 0; it is negative before the record starts, and the result is empty. `duration` is
    the length of the period in phase or time.
    """
    count = samples.shape[0] // max(record_periods, 1)
    period_samples = samples[max(recorded_period, 0) * count : (recorded_period + 1) * count]
    orbit.fill_sample_phases(period_samples, orbit.SAMPLE_PHASE, duration)
    return period_samples


@kernel
def run_nonlinear(
    mesh, to_bernstein, x, v, periods, recorded, samples, events, max_steps, summary, period_maps
):
    """Run a nonlinear mesh by Taylor steps, as `pair.pair_run.run` runs a gear pair.

    Arguments and results have the same meaning. A period has at most `max_steps` steps.
    `period_maps`, shape (periods, 2, 2) or (0, 2, 2), is filled with the derivatives of the state
    after each period with respect to the state before it. The last result is the number of Taylor
    steps.
    """
    orbit.clear_summary(summary)
    constants, harmonics = tabulate_mesh(mesh)
    series, workspace = np.zeros((ROWS, ORDER + 1)), np.empty((WORKSPACE_ROWS, ORDER + 2))
    perturbation, max_stiffness = np.zeros((6, ORDER + 1)), stiffness_bound(mesh)
    # Local names avoid the reference counting of named tuples in the loop.
    segment_bounds, below_mean, tuning = mesh.segment_bounds, mesh.below_mean, mesh.tuning
    has_maps = period_maps.shape[0] > 0
    strobe_count = min(periods, orbit.STROBE_PERIODS) if recorded else 0
    strobe_states = np.empty((strobe_count + 1, 2))
    event_count, steps = 0, 0
    contact_state = contact_state_with_lines(mesh.drive_line, mesh.coast_line, x, v)
    velocity_sign = math.copysign(1.0, v)
    if not is_within_range(x, v):
        return x, v, 0, events, 0, OVERFLOW, steps
    for period in range(periods):
        strobe = period - (periods - strobe_count)
        if strobe >= 0:
            strobe_states[strobe, 0], strobe_states[strobe, 1] = x, v
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
                contact_before, step_sign = contact_state, velocity_sign
                starts_at_rest, remaining = v == 0.0, end - phase
                if has_maps:
                    step_constants = constants[contact_state + 1, segment]
                    max_step = max_perturbation_step(
                        step_constants, max_stiffness, contact_state, x, v
                    )
                    remaining = min(remaining, max_step)
                h, step_contact, contact_state, velocity_sign, x, v = take_step(
                    constants,
                    harmonics,
                    to_bernstein,
                    segment,
                    phase,
                    remaining,
                    contact_state,
                    velocity_sign,
                    x,
                    v,
                    series,
                    workspace,
                )
                steps += 1
                if h < 0.0:
                    return x, v, 0, events, 0, UNRESOLVED, steps
                if has_maps:
                    step_constants = constants[step_contact + 1, segment]
                    period_map = period_maps[period]
                    if starts_at_rest:
                        step_sign = math.copysign(1.0, series[VELOCITY, 1])
                    map_crossing(constants, segment, contact_before, step_contact, 0.0, period_map)
                    map_step(
                        step_constants, step_contact, step_sign, h, series, perturbation, period_map
                    )
                    map_crossing(constants, segment, step_contact, contact_state, v, period_map)
                if not is_within_range(x, v):
                    return x, v, 0, events, 0, OVERFLOW, steps
                if recorded_period >= 0:
                    is_below_mean = below_mean[segment]
                    add_step_to_summary(
                        tuning,
                        is_below_mean,
                        to_bernstein,
                        h,
                        step_contact,
                        series,
                        workspace,
                        summary,
                    )
                    if orbit.has_unresolved_extremum(summary):
                        return x, v, 0, events, 0, UNRESOLVED, steps
                    sample_count = add_samples(
                        tuning, phase, h, step_contact, series, period_samples, sample_count
                    )
                    if step_contact != contact_before:
                        # The motion leaves a flank line from rest at the start of the step.
                        events, event_count = orbit.record_event(
                            events,
                            event_count,
                            period,
                            phase,
                            contact_before,
                            step_contact,
                            0.0,
                            summary,
                        )
                    if contact_state != step_contact:
                        events, event_count = orbit.record_event(
                            events,
                            event_count,
                            period,
                            phase + h,
                            step_contact,
                            contact_state,
                            v,
                            summary,
                        )
                phase += h
    strobe_states[strobe_count, 0], strobe_states[strobe_count, 1] = x, v
    displacement_range = summary[orbit.X_MAX] - summary[orbit.X_MIN]
    period = orbit.orbit_period(strobe_states, tuning, displacement_range)
    return x, v, period, events, event_count, OK, steps


#: Truncation error of a step in static deflections, as small as rounding errors.
TOLERANCE = 1e-16
TO_BERNSTEIN = bernstein_matrix(ORDER)


class Propagator(Engine):
    """Engine of a model with one degree of freedom at one tuning, by Taylor steps."""

    description = "Taylor steps"

    def __init__(self, model, tuning: float, tolerance: float = TOLERANCE):
        """Compute the constants of a model at a tuning, mesh frequency over natural frequency.

        `tolerance` is the truncation error of each Taylor step in units of the static deflection.
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
        columns of `Record`. The run starts in mesh period `first_period` of the excitation period.
        """
        tables = samples, events, summary, np.empty((0, 2, 2))
        return self._run_and_fill(z, span, *tables, first_period)

    def fill_maps(self, z, periods, max_events, maps, first_period):
        """Fill the Jacobian matrices of all period maps of a run from the state z; return a status.

        `maps`, shape (periods, 2, 2), are the derivatives of the state after each mesh period with
        respect to the state before it. z becomes the final state. A period has at most `max_events`
        steps or events; the run starts in mesh period `first_period` of the excitation period.
        """
        span, tables = Span(periods, 0, max_events), self.model.empty_record(events=0)
        return self._run_and_fill(z, span, *tables, maps, first_period).status

    def _run_and_fill(self, z, span, samples, events, summary, maps, first_period) -> Record:
        """Run from the state z, fill the tables and the period maps, and return the `Record`.

        z becomes the final state. `maps`, the derivatives of the state over each period, has the
        shape (periods, 2, 2) or, if they are not needed, (0, 2, 2). The run starts in mesh period
        `first_period` of the excitation period.
        """
        tables = samples, events, span.max_events, summary, maps
        result = self.run_kernel(*z, span.periods, span.recorded, tables, first_period)
        *z[:], period, events, event_count, status, steps = result
        # A coefficient of the series costs about as much as an evaluation of the right-hand side.
        return Record(z, z, period, samples, events[:event_count], summary, status, steps * ORDER)

    def run_kernel(self, x, v, periods, recorded, tables, first_period):
        """Run from displacement x and velocity v with `run_nonlinear` and return its result.

        `recorded` is the number of recorded periods at the end of the run. `tables` are (samples,
        events, largest number of steps per period, summary, period maps). `first_period` has no
        effect, because the excitation of a nonlinear mesh repeats in each period.
        """
        return run_nonlinear(self.mesh, TO_BERNSTEIN, x, v, periods, recorded, *tables)
