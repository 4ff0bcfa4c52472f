"""`run_up`: the motion of a model while its speed and its load change."""

import math
from typing import Annotated, Any

import numpy as np
from annotated_types import MinLen

from gearlib import checks
from gearlib.data import status, summary
from gearlib.data.result import make_result
from gearlib.data.variables import DESCRIPTIONS
from gearlib.engines import orbit
from gearlib.engines.linear import speed_courses
from gearlib.engines.summary_columns import COLUMNS
from gearlib.models import acceleration as inertia
from gearlib.models.model import is_model
from gearlib.parameters import Count, Limits, NonNegative, Positive, Values, WholeNumber, checked
from gearlib.progress import TimeLimit, with_progress_bar
from gearlib.runs.run_arguments import MAX_EVENTS, MaxSeconds, check_memory, tuning_at_speed

#: Variables that have SI units in run-ups only: name -> (CF units, long_name).
_SI_VARIABLES = {
    "time": ("s", "time"),
    "load_ratio": ("1", "ratio of the load to the load of the model"),
    "displacement": ("m", "relative mesh displacement"),
    "velocity": ("m s-1", "relative mesh velocity"),
    "acceleration": ("m s-2", "relative mesh acceleration"),
    "dynamic_force": ("N", "dynamic mesh force"),
    "body_motion": ("m", "displacement of the body"),
    "event_time": ("s", "time of the crossing of a flank line"),
    "event_speed": ("min-1", "speed at the event"),
    "event_velocity": ("m s-1", "relative mesh velocity at the event"),
    "revolution": ("1", "number of the revolution of the gear to which the speed refers"),
    "revolution_time": ("s", "middle of the revolution"),
    "revolution_speed": ("min-1", "mean speed in the revolution"),
    **{
        column.name: (DESCRIPTIONS[column.scale][0], f"{column.description} in the revolution")
        for column in COLUMNS
        if column.scale
    },
}
#: A speed course has rows (time in s, speed in rpm), a load course rows (time in s, ratio of the
#: load to the load of the model).
_SpeedCourse = Annotated[
    tuple[Annotated[tuple[NonNegative, ...], Values(2)], ...], Values(), MinLen(1)
]
_LoadCourse = Annotated[tuple[Limits, ...], Values(), MinLen(1)]
#: Estimated count of numbers stored per mesh and mesh period in summaries and events.
_NUMBERS_PER_PERIOD = 40


@checked
def run_up(
    model,
    start: NonNegative | None = None,
    stop: NonNegative | None = None,
    *,
    duration: Positive | None = None,
    acceleration: Positive | None = None,
    speed: _SpeedCourse | None = None,
    load: _LoadCourse = ((0.0, 1.0),),
    driver=None,
    driven_mass: NonNegative = 0.0,
    base_radius: Positive | None = None,
    initial_state=None,
    samples_per_period: WholeNumber = 0,
    max_events: Count = MAX_EVENTS,
    max_seconds: MaxSeconds = None,
):
    """Run a model up, down, or along any piecewise linear course of speed and load.

    At constant acceleration the stiffness switches at roots of a quadratic equation, and the
    solution between these switches has a closed form, as at constant speed. With run-out,
    deviations or tooth pairs, the solution is a power series that is accurate to rounding error;
    the attribute ``source`` states which of the two was used. The mesh transmits the load and the
    inertia torque; see `gearlib.models.acceleration`.

    Parameters
    ----------
    model : GearPair, LoadSharingPair, OneDegreePair, SixDegreePair or GearTrain
        The model to run. It must be piecewise linear, with linear damping and, unless it has tooth
        pairs, a stiffness that is constant between switches, and without gyroscopic forces.
    start, stop : float
        First and last speed in rpm, >= 0, of the gear whose teeth define the mesh frequency (for a
        train, the reference pinion). Either `duration` or `acceleration` is also required.
    duration : float
        Duration of the change of speed in seconds, finite, > 0.
    acceleration : float
        Magnitude of the constant acceleration in rpm/s, finite, > 0.
    speed : sequence of (float, float), optional
        Speed course, instead of the four arguments above: pairs of time in seconds, increasing
        from 0, and speed in rpm. The speed is interpolated linearly.
    load : sequence of (float, float), optional
        Load course: pairs of time in seconds, non-decreasing, and ratio of the load to the load of
        the model (a factor on all torques of a train), finite. The load is interpolated linearly,
        and constant before the first and after the last pair; two pairs at the same time define a
        step.
    driver : str, optional
        Name of the body of a train on which the accelerating torque acts. By default the body that
        supplies most of the power.
    driven_mass, base_radius : float, optional
        For models with one degree of freedom: J_2 / r_b2^2 of the driven inertia, in kg, and the
        base radius in m of the gear to which the speed refers. By default there is no inertia.
    initial_state : tuple of float or "static", optional
        State at time 0 and the first speed, as in `simulate`. By default the static state,
        ``model.static_state``, under the first load of the course, because a run-up from (0, 0),
        where the flanks just touch, begins with a transient whose force may exceed that at
        resonances.
    samples_per_period : int, default 0
        Number of samples of the time history per mesh period, at equal time steps. With 0, no time
        history is recorded.
    max_events : int
        Largest number of arcs (intervals of contact or free flight) in a mesh period. A run that
        needs more is stopped.
    max_seconds : float, optional
        Time limit in seconds, after which the results computed so far are returned; see
        `gearlib.progress`.

    Returns
    -------
    xarray.Dataset
        Variables in SI units, with a dimension `mesh` for trains. Along ``revolution`` (of the gear
        to which the speed refers, in whole mesh periods; the last may be incomplete):
        revolution_time, revolution_speed, mean_force, and extrema, fractions of time and bounces as
        in `sweep`. Along ``event``: event_time, event_speed, event_from, event_to, event_velocity.
        With samples, along ``time``: speed, load_ratio, phase, displacement, velocity,
        acceleration, dynamic_force, contact, and body_motion for trains. If status is not 0, the
        results are NaN and ``status.attrs["message"]`` states the reason and what to do.

    Raises
    ------
    ValueError
        If an argument is invalid; the message states its name, its value and what is allowed.

    References
    ----------
    Hortel, Skuderova: Engineering Mechanics 14 (2007) 91-104, Eq. (1)-(3).
    """
    _check_model(model)
    speeds = speed_course(start, stop, duration, acceleration, speed)
    # The error message needs the name of the argument that determines the highest speed.
    if speed is not None:
        argument_name = "speed"
    else:
        argument_name = "stop" if speeds[-1, 1] >= speeds[0, 1] else "start"
    tuning_at_speed(model, argument_name, float(speeds[:, 1].max()))
    loads = _check_course("load", load, steps=True)
    if initial_state is None:
        state = model.static_state(model.tuning_at(speeds[0, 1]), float(loads[0, 1]))
    else:
        state = model.check_state(initial_state)
    inertia_accelerations = _inertia_accelerations(model, driver, driven_mass, base_radius)
    omega = float(model.mesh_frequency(1.0))  # the dimensionless time is theta = omega t
    runner, pieces, start_state = speed_courses.start_course_run(model, speeds, loads, state)
    mesh_count, last_piece = runner.meshes, pieces[-1]
    mean_speed = last_piece.speed + 0.5 * last_piece.acceleration * last_piece.length
    final_phase = last_piece.phase + last_piece.length * mean_speed
    numbers_per_sample = mesh_count * 6 + model.size
    numbers_per_period = samples_per_period * numbers_per_sample + _NUMBERS_PER_PERIOD * mesh_count
    description = f"a course of {speeds[-1, 0]:g} s with samples_per_period = {samples_per_period}"
    check_memory(description, int(final_phase / math.tau) + 1, numbers_per_period, "mesh periods")
    limit = TimeLimit(max_seconds)
    teeth = model.periods_per_revolution
    arguments = start_state, samples_per_period, max_events, inertia_accelerations, teeth
    course_run = speed_courses.run_courses(runner, pieces, *arguments)
    records = list(limit.iterate(with_progress_bar("intervals of the run-up", course_run)))
    code = records[-1].status
    displacement = summary.max_displacement(records[-1].summary)
    if code == status.OK and displacement > model.displacement_limit(1.0, state):
        code = status.OVERFLOW
    data = _revolution_variables(model, records, omega) | _event_variables(model, records, omega)
    if samples_per_period:
        data |= _time_variables(model, records, omega, samples_per_period)
    if code != status.OK:
        # The results of a failed run are NaN, or 0 for integers.
        for name, (dims, values) in data.items():
            is_float = values.dtype.kind == "f"
            data[name] = dims, np.full(values.shape, np.nan) if is_float else 0 * values
    for name in data.keys() & _SI_VARIABLES.keys():
        units, long_name = _SI_VARIABLES[name]
        data[name] = *data[name], {"units": units, "long_name": long_name}
    coordinates = model.coordinates()
    used_dims = {dim for variable in data.values() for dim in variable[0]}
    coords = {name: coordinates[name] for name in coordinates if name in used_dims}
    attributes = {"speed": speeds.tolist(), "load": loads.tolist(), "initial_state": state}
    attributes |= {"driver": driver, "driven_mass": driven_mass, "base_radius": base_radius}
    data["status"] = np.int8(code)
    dataset = make_result(
        "Run-up of a gear mesh", model, data, coords, method=runner.description, **attributes
    )
    dataset["status"].attrs["message"] = status.MESSAGES[code]
    missing_intervals = []
    if not limit.complete:
        end_time = float(records[-1].theta[-1]) / omega
        missing_intervals.append([end_time, float(speeds[-1, 0])])
    return limit.record_missing(dataset, missing_intervals)


def _check_model(model):
    """Raise ValueError unless `run_up` supports the model.

    The model must have rotating bodies and be piecewise linear. It must not have gyroscopic forces
    or harmonic forces, which are defined at constant speed only.
    """
    type_name = type(model).__name__
    checks.require(is_model(model), "model", model, "a model such as GearPair")
    if model.speed is None:
        raise ValueError(f"model of type {type_name} is not allowed: it has no rotating bodies")
    if model.speed_course_propagator is None:
        raise ValueError(
            f"model of type {type_name} is not allowed in a run-up: it must be piecewise linear; "
            "gearlib.simulate runs it at constant speeds"
        )
    if model.gyroscopic:
        raise ValueError(
            f"gyroscopic = True is not allowed in a run-up of {model.title_noun}, because the "
            "gyroscopic forces change with the speed: it must be False"
        )
    if getattr(model, "forces", ()):
        raise ValueError(
            f"forces are not allowed in a run-up of {model.title_noun}: harmonic forces are only "
            "defined at constant speed, in gearlib.simulate and gearlib.sweep"
        )


@checked
def speed_course(
    start: NonNegative | None = None,
    stop: NonNegative | None = None,
    duration: Positive | None = None,
    acceleration: Positive | None = None,
    speed: _SpeedCourse | None = None,
):
    """Return a speed course as rows (time in s, speed in rpm), shape (n, 2).

    The course is given either by these rows as `speed`, or by the speeds `start` and `stop` in rpm
    with a `duration` in s or an `acceleration` in rpm/s. Raise ValueError if an argument is
    invalid.
    """
    if speed is not None:
        if any(value is not None for value in (start, stop, duration, acceleration)):
            raise ValueError(
                "speed is not allowed together with start, stop, duration and acceleration"
            )
        course = _check_course("speed", speed)
    else:
        if start is None or stop is None:
            name = "start" if start is None else "stop"
            raise checks.InputError(name, None, "a finite number >= 0, rpm")
        checks.require_exactly_one("duration", duration, "acceleration", acceleration)
        if acceleration is not None:
            duration = abs(stop - start) / acceleration
            allowed = "a duration |stop - start| / acceleration > 0 s"
            checks.require(0.0 < duration < math.inf, "duration", duration, allowed)
        course = np.array([[0.0, start], [duration, stop]])
    is_valid = len(course) > 1 and course[0, 0] == 0.0
    checks.require(is_valid, "speed", speed, "a course of at least two rows, the first at 0 s")
    if not course[:, 1].any():
        raise ValueError("speed = 0 rpm at all times is not allowed: it must be > 0 at some time")
    return course


def _check_course(name: str, rows: Any, steps: bool = False) -> np.ndarray:
    """Check a course with rows (time in s, value) and return it as an array, shape (n, 2).

    Raise ValueError if a time is negative or not later than the time in the previous row. With
    `steps`, two rows with the same time define a step. `name` is the name of the argument in the
    error message.
    """
    previous_time = 0.0
    for i, (time, _) in enumerate(rows):
        may_be_equal = steps or i == 0
        is_later = time > previous_time or (time == previous_time and may_be_equal)
        relation = "not before" if may_be_equal else "after"
        checks.require(is_later, f"{name}[{i}][0]", time, f"{relation} {previous_time!r} s")
        previous_time = time
    return np.array(rows)


def _inertia_accelerations(model, driver, driven_mass, base_radius) -> np.ndarray:
    """Return the accelerations of the coordinates of a model due to inertia forces in a run-up.

    Inertia forces act because displacements are measured relative to the accelerating rigid-body
    rotation. The dimensionless accelerations, shape (n,), or (1,) for a model with one mesh, are
    per unit of d2tau/dtheta2, with the mesh phase tau and the dimensionless time theta. For a
    train, `driver` is the name of the body on which the accelerating torque acts, or None. For a
    model with one mesh, `driven_mass` is J / r_b^2 of the driven gear in kg, and `base_radius` is
    the base radius of the other gear in m, or None if the driven mass is 0.
    """
    allowed = "a finite number > 0 if driven_mass is not 0"
    checks.require(base_radius or not driven_mass, "base_radius", base_radius, allowed)
    if model.train is not None:
        if driven_mass or base_radius is not None:
            raise ValueError(
                "driven_mass and base_radius are not allowed: the model has its own inertias"
            )
        return inertia.train_accelerations(model.train, driver)
    if driver is not None:
        raise ValueError(f"driver = {driver!r} is not allowed: the model has no bodies")
    if not driven_mass:
        return np.zeros(1)
    return inertia.pair_acceleration(model.pair, driven_mass, base_radius)


def _revolution_variables(model, records: list, omega: float) -> dict:
    """Return the variables along ``revolution`` of a run-up as {name: (dims, values)}.

    `records` are the `IntervalRecord`s of the run-up in chronological order. They contain the
    revolution of each mesh period (`block`), the mesh phase in rad, and the dimensionless time
    theta = omega t with `omega` in rad/s. The variables are time, mean speed and, from the
    summaries of the records, extrema and fractions of time.
    """
    # This is the number of the revolution to which each mesh period belongs.
    revolutions = np.concatenate([record.summary_block for record in records])
    first_periods = np.flatnonzero(np.diff(revolutions, prepend=-1))
    start_theta = np.concatenate([record.theta[:-1] for record in records])[first_periods]
    # Durations and phase differences of mesh periods are summed over each revolution.
    theta_steps = np.concatenate([np.diff(record.theta) for record in records])
    phase_steps = np.concatenate([np.diff(record.phase) for record in records])
    duration = np.add.reduceat(theta_steps, first_periods)
    phase_change = np.add.reduceat(phase_steps, first_periods)
    # A revolution that extends over several records has a summary in each of them.
    table = np.concatenate([record.summary for record in records])
    summary_revolutions = np.concatenate([np.unique(record.summary_block) for record in records])
    first_rows = np.flatnonzero(np.diff(summary_revolutions, prepend=-1))
    summaries = summary.combine_records(table, first_rows)
    # The total time is the sum of the times in each contact state, so that the fractions sum to 1.
    times = summaries[..., [orbit.TIME_DRIVE, orbit.TIME_NO_CONTACT, orbit.TIME_COAST]]
    total_time = times.sum(axis=-1)
    # Revolutions after the failure of a run have zero duration.
    total_time[total_time == 0.0] = np.nan
    # The lower bound prevents division by zero after a failure.
    periods = np.maximum(phase_change, 1e-300)[:, None] / math.tau
    columns = summary.normalize_columns(summaries, total_time, periods)
    # The time at the lower stiffness is of interest at constant speed only.
    columns.pop("fraction_min_stiffness")
    scales = model.scales()
    for column in COLUMNS:
        if column.scale:
            columns[column.name] *= scales[column.scale]
    dims = ("revolution", "mesh") if model.mesh_names else ("revolution",)
    variables = {
        "revolution": (("revolution",), revolutions[first_periods]),
        "revolution_time": (("revolution",), (start_theta + 0.5 * duration) / omega),
        "revolution_speed": (("revolution",), np.asarray(model.speed(phase_change / duration))),
    }
    shape = (first_periods.size, -1) if model.mesh_names else (first_periods.size,)
    return variables | {name: (dims, values.reshape(shape)) for name, values in columns.items()}


def _event_variables(model, records: list, omega: float) -> dict:
    """Return the variables along ``event`` of a run-up as {name: (dims, values)}.

    `records` are the `IntervalRecord`s of the parts of the run-up. Each row of their `events`
    starts with (dimensionless time omega t, index of the mesh, contact state before, code after,
    velocity), where `omega` is in rad/s. Contact states are 1 for the drive side, 0 for loss of
    contact and -1 for the coast side.
    """
    events = np.concatenate([record.events for record in records])
    times, mesh_indices, codes_before, codes_after, velocities, *_ = events.T
    # The speed at each event follows from the tuning (mesh frequency / natural frequency).
    tunings = []
    for record in records:
        tuning, _phase, _load = record.piece.at_times(record.events[:, 0])
        tunings.append(tuning)
    columns = {
        "event_time": times / omega,
        "event_speed": np.asarray(model.speed(np.concatenate(tunings))),
        "event_from": codes_before.astype(np.int8),
        "event_to": codes_after.astype(np.int8),
        "event_velocity": velocities * (model.static_deflection * omega),
    }
    if model.mesh_names:
        columns["event_mesh"] = mesh_indices.astype(np.int16)
    return {name: (("event",), values) for name, values in columns.items()}


def _time_variables(model, records: list, omega: float, samples_per_period: int) -> dict:
    """Return the time history of a run-up as {variable name: (dims, values)}.

    `records` are the `IntervalRecord`s of the run-up in chronological order, with
    `samples_per_period` samples per mesh period at equal time steps. Their dimensionless time is
    theta = omega t with `omega` in rad/s. The variables are in SI units.
    """
    fractions = np.arange(samples_per_period) / samples_per_period
    thetas, excitations = [], []
    for record in records:
        steps = fractions * np.diff(record.theta)[:, None]
        thetas.append((record.theta[:-1, None] + steps).ravel())
        # Each entry is (tuning, mesh phase, load / load of the model) at the samples.
        excitations.append(record.piece.at_times(thetas[-1]))
    theta = np.concatenate(thetas)
    tuning, phase, load_ratio = np.hstack(excitations)
    table = np.concatenate([record.samples for record in records])
    length_scale, force_scale = model.static_deflection, model.scales()["force_scale"]
    mesh_columns = {
        "displacement": table[..., orbit.SAMPLE_X] * length_scale,
        "velocity": table[..., orbit.SAMPLE_V] * (length_scale * omega),
        "acceleration": table[..., orbit.SAMPLE_A] * (length_scale * omega**2),
        "dynamic_force": table[..., orbit.SAMPLE_FORCE] * force_scale,
        "contact": table[..., orbit.SAMPLE_CONTACT].astype(np.int8),
    }
    dims = ("time", "mesh") if model.mesh_names else ("time",)
    shape = (theta.size, -1) if model.mesh_names else (theta.size,)
    data = {
        "time": (("time",), theta / omega),
        "speed": (("time",), np.asarray(model.speed(tuning))),
        "load_ratio": (("time",), load_ratio),
        "phase": (("time",), phase),
        **{name: (dims, values.reshape(shape)) for name, values in mesh_columns.items()},
    }
    if model.mesh_names:
        # The first half of a state are the coordinates q, which determine the motions of the
        # bodies.
        q = np.concatenate([record.states[:, : model.size // 2] for record in records])
        body_motions = np.einsum("bxn,kn->kbx", model.structure.motions, q) * length_scale
        data["body_motion"] = (("time", "body", "axis"), body_motions)
    return data
