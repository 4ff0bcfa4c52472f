"""`simulate`: one gear pair at one tuning, its time course, events and orbit summary."""

import math

import numpy as np

from gearlib import checks, integrators
from gearlib.data import status, summary
from gearlib.data.result import result
from gearlib.engines import orbit
from gearlib.engines.codes import BACKLASH
from gearlib.engines.stable_repeats import settled_period
from gearlib.runs.run_arguments import (
    MAX_EVENTS,
    check_memory,
    check_run,
    tuning_of,
)


def simulate(
    pair,
    tuning=None,
    *,
    speed=None,
    periods,
    record_periods=1,
    samples_per_period=256,
    initial_state=(0.0, 0.0),
    method=None,
    options=None,
    max_events=MAX_EVENTS,
    until_settled=False,
):
    """Run a gear pair at one tuning and record the end of the run.

    For a `GearPair` the equation is x'' + (2 beta / nu) x' + (c(tau) / nu^2) g(x) = 1 / nu^2 in
    static deflections and mesh phase, with beta_m instead of beta in the backlash; tau = 0 is the
    middle of the segment of maximum stiffness. Other models have theirs, see their modules. What is
    linear between events is propagated in closed form, without a step size; the rest goes in Taylor
    steps, to rounding.

    Parameters
    ----------
    pair : GearPair, OneDegreePair, SixDegreePair or DeadZoneOscillator
    tuning : float
        nu = mesh frequency / mean eigenfrequency; finite, > 0. Or instead of it:
    speed : float
        In rpm, of the gear whose teeth count (the reference pinion of a train); finite, > 0.
    periods : int
        Mesh periods from tau = 0.
    record_periods : int, default 1
        How many of them, at the end, are recorded.
    samples_per_period : int, default 256
        Equal steps of phase per recorded period; the end of a period is the start of the next
        and is not repeated.
    initial_state : tuple of float, default (0, 0)
        Displacement in static deflections and dx/dtau at tau = 0. The default: flanks just touch.
        Of a `SixDegreePair` also all components, as of `Orbit.state`.
    method : str, optional
        A name of `gearlib.methods`; by default "exact" where it takes the model, else "taylor".
        The others, for comparison, show what a user of theirs sees: extrema over step ends and
        samples, events between step ends.
    options : dict, optional
        Options of the method, see `gearlib.methods`.
    max_events : int
        Most phases of contact and flights in one mesh period before the run gives up.
    until_settled : bool, default False
        Whether to go on behind the record while the motion has not settled, for up to twenty times
        the periods or 5000 more, until its period is proven; the record stays.

    Returns
    -------
    xarray.Dataset
        Over ``phase`` (rad, from tau = 0): displacement, velocity, acceleration, stiffness,
        modified_stiffness, dynamic_force, contact (1 normal, 0 backlash, -1 inverse); at an
        event or a stiffness switch the value just after it. Over ``event``: event_phase,
        event_from, event_to, event_velocity, all crossings of flank lines in the recorded
        periods. Scalars: final_state (component), the orbit summary described at
        `gearlib.sweep`, evaluations (of the right-hand side in the whole run), the scales to SI,
        and status. ``period`` is 0 while the motion has not settled; ``followed`` says after how
        many mesh periods that was told. When status is not 0, the run could not go on: all results
        are NaN and ``status.attrs["message"]`` says what to do.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.

    References
    ----------
    Hortel, Skuderova: Engineering Mechanics 14 (2007) 91-104, Eq. (1)-(3).
    """
    tuning = tuning_of(pair, tuning, speed)
    checked = check_run(pair, periods, record_periods, initial_state, method, options, max_events)
    checks.one_of("until_settled", until_settled, (False, True))
    record, followed_periods = _run(pair, tuning, checked, samples_per_period, True, until_settled)
    recorded = checked.span.recorded
    first = (checked.span.periods - recorded) * samples_per_period
    data = {
        **_time_course(pair, record.samples, record.status),
        **_event_table(record.events),
        **summary.variables(
            pair,
            (),
            record.summary,
            record.final,
            np.array([record.period, record.status]),
            recorded,
        ),
        **pair.scales(),
        **pair.speed_scales(tuning),
        "tuning": tuning,
        "evaluations": record.evaluations,
        "followed": np.int64(followed_periods),
    }
    coords = {
        "phase": (first + np.arange(len(record.samples))) * (2.0 * math.pi / samples_per_period),
        **pair.coordinates(),
    }
    attributes = checked.attributes() | {"tuning": tuning}
    dataset = result("Time course of a gear mesh", pair, data, coords, **attributes)
    dataset["status"].attrs["message"] = status.MESSAGES[record.status]
    return dataset


def run(pair, tuning, samples_per_period, **settings):
    """Run a gear pair at one tuning as `simulate` does, and return its `Record`.

    `settings` are arguments of `gearlib.runs.run_arguments.check_run`. If the status is not 0,
    numbers are NaN and there are no events.
    """
    return _run(pair, tuning, check_run(pair, **settings), samples_per_period)[0]


def _run(pair, tuning, checked, samples_per_period, prove=False, until_settled=False):
    """Return the `Record` of a run, and the number of mesh periods that determined its period.

    `checked` are `RunArguments`. With `prove` the period is proven; with `until_settled` the motion
    is continued after the recorded periods for this proof.
    """
    samples_per_period = checks.integer("samples_per_period", samples_per_period, 1)
    recorded = checked.span.recorded
    argument = f"samples_per_period = {samples_per_period} with record_periods = {recorded}"
    columns = pair.empty_record()[0].shape[1]
    check_memory(argument, recorded * samples_per_period, columns, "samples in all")
    arguments = checked.state, checked.span, samples_per_period
    record = checked.module.run(pair, tuning, *arguments, **checked.options)
    if record.status == status.OK:
        if summary.reach(record.summary) > pair.bound(tuning, checked.state):
            record = record._replace(status=status.OVERFLOW)
    if record.status != status.OK:
        for table in (record.samples, record.summary, record.final):
            table[...] = math.nan
        record = record._replace(events=record.events[:0])
    periods = checked.span.periods
    if prove and checked.method in integrators.AUTOMATIC and record.status == status.OK:
        engine = pair.propagator(tuning, checked.method, **checked.options)
        period, periods = settled_period(engine, record, checked.span, until_settled)
        record = record._replace(period=period)
    return record, periods


def _time_course(pair, samples, code):
    """Return the variables over ``phase`` from the sample table of `Model.empty_record`."""
    dims, table = ("phase",), samples[:, : orbit.SAMPLE_COLUMNS]
    if pair.mesh_names:
        dims, meshes = ("phase", "mesh"), len(pair.mesh_names)
        table = samples[:, : meshes * orbit.SAMPLE_COLUMNS]
        table = table.reshape(-1, meshes, orbit.SAMPLE_COLUMNS)
    contact_codes = np.zeros(table.shape[:-1], np.int8)
    if code == status.OK:
        contact_codes[:] = table[..., orbit.SAMPLE_CONTACT]
    stiffness = table[..., orbit.SAMPLE_STIFFNESS]
    columns = {
        "displacement": table[..., orbit.SAMPLE_X],
        "velocity": table[..., orbit.SAMPLE_V],
        "acceleration": table[..., orbit.SAMPLE_A],
        "stiffness": stiffness,
        "modified_stiffness": np.where(contact_codes == BACKLASH, 0.0 * stiffness, stiffness),
        "dynamic_force": table[..., orbit.SAMPLE_FORCE],
        "contact": contact_codes,
    }
    variables = {name: (dims, values) for name, values in columns.items()}
    return variables | pair.extra_sample_variables(samples)


def _event_table(events):
    """Return the variables over ``event`` from the event table of `Model.empty_record`."""
    phase = 2.0 * math.pi * events[:, orbit.EVENT_PERIOD] + events[:, orbit.EVENT_PHASE]
    # The sum may round below the phase of the event before.
    phase = np.maximum.accumulate(phase)
    columns = {
        "event_phase": phase,
        "event_from": events[:, orbit.EVENT_FROM].astype(np.int8),
        "event_to": events[:, orbit.EVENT_TO].astype(np.int8),
        "event_velocity": events[:, orbit.EVENT_VELOCITY].copy(),
    }
    if events.shape[1] > orbit.EVENT_COLUMNS:
        columns["event_mesh"] = events[:, orbit.EVENT_COLUMNS].astype(np.int16)
    return {name: (("event",), values) for name, values in columns.items()}
