"""`simulate`: time history, contact events and summary of a model at one tuning."""

import math

import numpy as np

from gearlib import integrators
from gearlib.data import status, summary
from gearlib.data.result import make_result
from gearlib.engines import orbit
from gearlib.engines.codes import NO_CONTACT
from gearlib.engines.stable_repeats import find_settled_period
from gearlib.parameters import Boolean, Count, Speed, checked
from gearlib.runs.run_arguments import (
    MAX_EVENTS,
    Tuning,
    check_memory,
    check_run_arguments,
    tuning_of,
)


@checked
def simulate(
    model,
    tuning: Tuning | None = None,
    *,
    speed: Speed | None = None,
    periods: Count,
    record_periods: Count = 1,
    samples_per_period: Count = 256,
    initial_state=(0.0, 0.0),
    method=None,
    options=None,
    max_events: Count = MAX_EVENTS,
    until_settled: Boolean = False,
):
    """Run a model at one tuning and record the last mesh periods of the run.

    For a `GearPair` the equation is x'' + (2 beta / nu) x' + (c(tau) / nu^2) g(x) = 1 / nu^2, with
    x in units of the static deflection and the mesh phase tau, and beta_m instead of beta during
    contact loss; tau = 0 is the midpoint of the segment with maximum stiffness. The equations of
    other models are documented in their modules. Piecewise linear models are solved in closed form
    between switches, without a step size, and other models by Taylor steps to rounding error.

    Parameters
    ----------
    model : GearPair, OneDegreePair, SixDegreePair, DeadZoneOscillator or GearTrain
        The model to run.
    tuning : float
        nu = mesh frequency / mean eigenfrequency, finite, > 0. Give either `tuning` or `speed`.
    speed : float
        Speed in rpm, finite, > 0, of the gear whose teeth define the mesh frequency (for a train,
        the reference pinion).
    periods : int
        Number of mesh periods of the run, from tau = 0.
    record_periods : int, default 1
        Number of mesh periods that are recorded at the end of the run.
    samples_per_period : int, default 256
        Number of samples per recorded mesh period, at equal phase steps. The first sample lies at
        the start of the period, the last one a step before its end.
    initial_state : tuple of float, default (0, 0)
        Displacement in units of the static deflection and velocity dx/dtau at tau = 0. By default
        the flanks just touch. A `SixDegreePair` also accepts all components, as in `Orbit.state`.
    method : str, optional
        A name of `gearlib.methods`. By default "exact" if that method can run the model, otherwise
        "taylor". The other methods are for comparison: they evaluate extrema only at step ends and
        samples, and locate events between step ends.
    options : dict, optional
        Options of the method, see `gearlib.methods`.
    max_events : int
        Largest number of arcs (intervals of contact or free flight) in a mesh period. A run that
        needs more is stopped.
    until_settled : bool, default False
        Whether the run continues after the recorded periods until the period of the motion is
        proven, for up to twenty times `periods` or 5000 more periods. The record does not change.

    Returns
    -------
    xarray.Dataset
        Along ``phase`` (rad, from tau = 0): displacement, velocity, acceleration, stiffness,
        modified_stiffness, dynamic_force, contact (1 drive side, 0 contact loss, -1 coast side);
        samples at a switch have the value just after it. Along ``event``, for all contact events in
        the recorded periods: event_phase, event_from, event_to, event_velocity. Scalars:
        final_state (component), the summary described in `gearlib.sweep`, evaluations (of the
        right-hand side in the whole run), the scales to SI, and status. ``period`` is 0 if the
        motion has not settled; ``followed`` is the number of mesh periods of the run, including the
        additional periods of `until_settled`. If status is not 0, the run failed: all results are
        NaN, and ``status.attrs["message"]`` states the reason and what to do.

    Raises
    ------
    ValueError
        If an argument is invalid; the message states its name, its value and what is allowed.

    References
    ----------
    Hortel, Skuderova: Engineering Mechanics 14 (2007) 91-104, Eq. (1)-(3).
    """
    tuning = tuning_of(model, tuning, speed)
    arguments = check_run_arguments(
        model, periods, record_periods, initial_state, method, options, max_events
    )
    record, followed_periods = _run_and_verify(
        model, tuning, arguments, samples_per_period, True, until_settled
    )
    first_sample = (periods - record_periods) * samples_per_period
    sample_numbers = first_sample + np.arange(len(record.samples))
    codes = np.array([record.period, record.status])
    data = {
        **_time_history(model, record.samples, record.status),
        **_event_variables(record.events),
        **summary.summary_variables(model, (), record.summary, record.final, codes, record_periods),
        **model.scales(),
        **model.speed_scales(tuning),
        "tuning": tuning,
        "evaluations": record.evaluations,
        "followed": np.int64(followed_periods),
    }
    coords = {"phase": sample_numbers * (2.0 * math.pi / samples_per_period), **model.coordinates()}
    attributes = arguments.attributes() | {"tuning": tuning}
    dataset = make_result("Time course of a gear mesh", model, data, coords, **attributes)
    dataset["status"].attrs["message"] = status.MESSAGES[record.status]
    return dataset


def run(model, tuning: float, samples_per_period: int, **run_options):
    """Run a model at one tuning without verifying the period; return the `Record`.

    The tuning is the ratio of mesh frequency to natural frequency. `run_options` are arguments of
    `simulate` such as periods, record_periods, initial_state and method. The record has samples,
    events, a summary and the final state; if its status is not 0, the run has failed, its numbers
    are NaN and it has no events.
    """
    record, _ = _run_and_verify(
        model, tuning, check_run_arguments(model, **run_options), samples_per_period
    )
    return record


def _run_and_verify(
    model, tuning, arguments, samples_per_period, verify_period=False, until_settled=False
):
    """Run a model at one tuning; return (`Record`, total number of simulated mesh periods).

    The tuning is the ratio of mesh frequency to natural frequency. `arguments` are the
    `RunArguments`: initial state, mesh periods of the run and of its record, integration method.
    With `verify_period` the period of the motion is verified by the Floquet multipliers of the
    orbit and its distance from grazing; with `until_settled` the run continues after the recorded
    periods until this succeeds. If the run fails, or the motion grows without bound, the numbers of
    the record are NaN.
    """
    record_periods = arguments.span.recorded
    argument = f"samples_per_period = {samples_per_period} with record_periods = {record_periods}"
    sample_table, _, _ = model.empty_record()
    numbers_per_sample = sample_table.shape[1]
    sample_count = record_periods * samples_per_period
    check_memory(argument, sample_count, numbers_per_sample, "samples in all")
    # Each integration method has a module with a function `run`.
    record = arguments.module.run(
        model, tuning, arguments.state, arguments.span, samples_per_period, **arguments.options
    )
    if record.status == status.OK:
        displacement_limit = model.displacement_limit(tuning, arguments.state)
        if summary.max_displacement(record.summary) > displacement_limit:
            record = record._replace(status=status.OVERFLOW)
    if record.status != status.OK:
        for table in (record.samples, record.summary, record.final):
            table[...] = math.nan
        record = record._replace(events=record.events[:0])
    periods = arguments.span.periods
    if verify_period and arguments.method in integrators.AUTOMATIC and record.status == status.OK:
        propagator = model.propagator(tuning, arguments.method, **arguments.options)
        period, periods = find_settled_period(propagator, record, arguments.span, until_settled)
        record = record._replace(period=period)
    return record, periods


def _time_history(model, samples: np.ndarray, status_code: int) -> dict:
    """Return the time history of a run along ``phase`` as {variable name: (dims, values)}.

    `samples`, shape (n, columns), is the table of samples of the run. For each mesh it has the
    columns SAMPLE_X (displacement), SAMPLE_V (velocity) and so on of `engines.orbit`; further
    columns depend on the model. The samples are NaN if `status_code` is not 0, for a failed run.
    """
    dims: tuple = ("phase",)
    table = samples[:, : orbit.SAMPLE_COLUMNS]
    if model.mesh_names:
        dims, mesh_count = ("phase", "mesh"), len(model.mesh_names)
        table = samples[:, : mesh_count * orbit.SAMPLE_COLUMNS]
        table = table.reshape(-1, mesh_count, orbit.SAMPLE_COLUMNS)
    # Contact states are integers, which cannot be NaN, so they are 0 after a failure.
    contact_states = np.zeros(table.shape[:-1], np.int8)
    if status_code == status.OK:
        contact_states[:] = table[..., orbit.SAMPLE_CONTACT]
    stiffness = table[..., orbit.SAMPLE_STIFFNESS]
    no_stiffness = 0.0 * stiffness  # NaN for a failed run
    columns = {
        "displacement": table[..., orbit.SAMPLE_X],
        "velocity": table[..., orbit.SAMPLE_V],
        "acceleration": table[..., orbit.SAMPLE_A],
        "stiffness": stiffness,
        # Effective stiffness: zero without contact.
        "modified_stiffness": np.where(contact_states == NO_CONTACT, no_stiffness, stiffness),
        "dynamic_force": table[..., orbit.SAMPLE_FORCE],
        "contact": contact_states,
    }
    variables = {name: (dims, values) for name, values in columns.items()}
    return variables | model.extra_sample_variables(samples)


def _event_variables(events: np.ndarray) -> dict:
    """Return the contact events of a run along ``event`` as {variable name: (dims, values)}.

    `events`, shape (n, columns), is the table of contact events of the run. Its columns, given by
    constants of `engines.orbit`, are the mesh period, the mesh phase in it, the contact states
    before and after (1 drive side, 0 no contact, -1 coast side) and the velocity.
    """
    phase = 2.0 * math.pi * events[:, orbit.EVENT_PERIOD] + events[:, orbit.EVENT_PHASE]
    # Rounding of the sum must not change the order of the events.
    phase = np.maximum.accumulate(phase)
    columns = {
        "event_phase": phase,
        "event_from": events[:, orbit.EVENT_FROM].astype(np.int8),
        "event_to": events[:, orbit.EVENT_TO].astype(np.int8),
        "event_velocity": events[:, orbit.EVENT_VELOCITY].copy(),
    }
    if events.shape[1] > orbit.EVENT_COLUMNS:
        # With several meshes, the last column is the index of the mesh.
        mesh_column = orbit.EVENT_COLUMNS
        columns["event_mesh"] = events[:, mesh_column].astype(np.int16)
    return {name: (("event",), values) for name, values in columns.items()}
