"""`run_up`: the motion of a model while its speed and its load change."""

import math

import numpy as np

from gearlib import checks
from gearlib.data import status, summary
from gearlib.data.result import result
from gearlib.engines import orbit
from gearlib.engines.linear import courses
from gearlib.engines.linear.record import FORCE_SUM
from gearlib.models import acceleration as inertia
from gearlib.models.model import is_model
from gearlib.runs.run_arguments import MAX_EVENTS, check_memory, check_speed

#: name -> (CF units, long_name) of variables that only run-ups have in SI units.
_SI_VARIABLES = {
    "time": ("s", "time"),
    "load_ratio": ("1", "load over that of the model"),
    "displacement": ("m", "relative mesh displacement"),
    "velocity": ("m s-1", "relative mesh velocity"),
    "acceleration": ("m s-2", "relative mesh acceleration"),
    "dynamic_force": ("N", "dynamic mesh force"),
    "body_motion": ("m", "displacement of the body"),
    "event_time": ("s", "time of the crossing of a flank line"),
    "event_speed": ("min-1", "speed at the event"),
    "event_velocity": ("m s-1", "relative mesh velocity at the event"),
    "revolution": ("1", "number of the revolution of the gear whose teeth count"),
    "revolution_time": ("s", "middle of the revolution"),
    "revolution_speed": ("min-1", "mean speed in the revolution"),
    "displacement_max": ("m", "largest displacement in the revolution"),
    "displacement_min": ("m", "least displacement in the revolution"),
    "dynamic_force_max": ("N", "largest dynamic mesh force in the revolution"),
    "dynamic_force_min": ("N", "least dynamic mesh force in the revolution"),
    "mean_force": ("N", "mean of the mesh force over the revolution"),
}
#: Numbers that a mesh period of one mesh needs beside its samples, for summary and events.
_NUMBERS_PER_PERIOD = 40
#: Columns of a summary that hold maxima and minima; the others are sums.
_MAXIMUM_COLUMNS, _MINIMUM_COLUMNS = [orbit.X_MAX, orbit.FORCE_MAX], [orbit.X_MIN, orbit.FORCE_MIN]


def run_up(
    model,
    start=None,
    stop=None,
    *,
    duration=None,
    acceleration=None,
    speed=None,
    load=((0.0, 1.0),),
    driver=None,
    driven_mass=0.0,
    base_radius=None,
    initial_state=(0.0, 0.0),
    samples_per_period=0,
    max_events=MAX_EVENTS,
):
    """Run a model up, down, or along any piecewise linear course of speed and load.

    While the acceleration is constant the stiffness switches at roots of a quadratic, and where it
    is constant in between the motion is that of a run at constant speed: nothing is approximated.
    Run-out and deviations go by power series, whose error is that of rounding; ``source`` says so.
    The mesh carries the inertia of the acceleration beside the load, see
    `gearlib.models.acceleration`.

    Parameters
    ----------
    model : GearPair, OneDegreePair, SixDegreePair or GearTrain
        Piecewise linear: linear damping, a stiffness that is constant between switches. Without
        gyroscopic forces.
    start, stop : float
        First and last speed in rpm of the gear whose teeth count, >= 0; and one of:
    duration : float
        Of the change, s; finite, > 0.
    acceleration : float
        Its size, rpm/s; finite, > 0.
    speed : sequence of (float, float), optional
        Instead of all of these a course: seconds from 0, rising, and rpm; linear in between.
    load : sequence of (float, float), optional
        Seconds, not falling, and loads over that of the model (of a train: all torques), finite;
        linear in between, constant before the first and behind the last; two at one time: a step.
    driver : str, optional
        Of a train: the body that brings the torque of the acceleration; by default that which
        brings most of the power.
    driven_mass, base_radius : float, optional
        Of one degree of freedom: J_2 / r_b2^2 of all that the mesh drives, kg, and the base radius
        of the gear whose teeth count, m. By default the mesh accelerates nothing.
    initial_state : tuple of float or "static", default (0, 0)
        As of `simulate`, at the first speed.
    samples_per_period : int, default 0
        Of the time course, at equal steps of time in each mesh period; 0: none.
    max_events : int
        Most phases of contact and flights in one mesh period before the run gives up.

    Returns
    -------
    xarray.Dataset
        In SI units, of trains with a dimension `mesh`. Over ``revolution``, of the gear whose teeth
        count, in whole mesh periods, the last one as far as it goes: revolution_time,
        revolution_speed; extrema of displacement and dynamic_force, mean_force, fractions of time,
        bounces. Over ``event``: event_time, event_speed, event_from, event_to, event_velocity. With
        samples over ``time``: speed, load_ratio, phase, displacement, velocity, acceleration,
        dynamic_force, contact, of trains body_motion. And status; when it is not 0, numbers are NaN
        and ``status.attrs["message"]`` says what to do.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.

    References
    ----------
    Hortel, Skuderova: Engineering Mechanics 14 (2007) 91-104, Eq. (1)-(3).
    """
    _check_model(model)
    speeds = speeds_of(start, stop, duration, acceleration, speed)
    name = "speed" if speed is not None else "stop" if stop >= start else "start"
    check_speed(model, name, float(speeds[:, 1].max()))
    loads = _course("load", load, "finite", math.isfinite, steps=True)
    state = model.check_state(initial_state)
    samples = checks.integer("samples_per_period", samples_per_period, 0)
    limit = checks.integer("max_events", max_events, 1)
    push = inertia_of(model, driver, driven_mass, base_radius)
    omega = float(model.mesh_frequency(1.0))
    runner, pieces, z = courses.start_course(model, speeds, loads, state)
    meshes, end = runner.meshes, pieces[-1]
    turned = end.phase + end.length * (end.speed + 0.5 * end.acceleration * end.length)
    columns = samples * (meshes * 6 + model.size) + _NUMBERS_PER_PERIOD * meshes
    words = f"a course of {speeds[-1, 0]:g} s with samples_per_period = {samples}"
    check_memory(words, int(turned / math.tau) + 1, columns, "mesh periods")
    stretches = list(
        courses.run_course(runner, pieces, z, samples, limit, push, model.periods_per_revolution)
    )
    code = stretches[-1].status
    if code == status.OK and summary.reach(stretches[-1].summary) > model.bound(1.0, state):
        code = status.OVERFLOW
    data = _statistics(model, stretches, omega) | _events(model, stretches, omega)
    if samples:
        data |= _time_variables(model, stretches, omega, samples)
    if code != status.OK:
        data = {name: _failed(*variable) for name, variable in data.items()}
    data = {name: _with_units(name, *variable) for name, variable in data.items()}
    coordinates = model.coordinates()
    used = {dim for variable in data.values() for dim in variable[0]}
    coords = {name: coordinates[name] for name in coordinates if name in used}
    attributes = {"speed": speeds.tolist(), "load": loads.tolist(), "initial_state": state}
    attributes |= {"driver": driver, "driven_mass": driven_mass, "base_radius": base_radius}
    data["status"] = np.int8(code)
    dataset = result(
        "Run-up of a gear mesh", model, data, coords, method=runner.description, **attributes
    )
    dataset["status"].attrs["message"] = status.MESSAGES[code]
    return dataset


def _check_model(model):
    """Raise ValueError unless a run-up of the model is possible."""
    name = type(model).__name__
    if not is_model(model):
        raise ValueError(f"model = {model!r} is not allowed: it must be one such as GearPair")
    if model.speed is None:
        raise ValueError(f"model of type {name} is not allowed: nothing turns in it")
    if not model.piecewise_linear:
        raise ValueError(
            f"model of type {name} is not allowed in a run-up, where it has Taylor steps only: it "
            "must be piecewise linear, or run at several constant speeds by gearlib.simulate"
        )
    if model.gyroscopic:
        raise ValueError(
            "gyroscopic = True is not allowed in a run-up, where its forces would change with the "
            "speed: it must be False"
        )


def speeds_of(start=None, stop=None, duration=None, acceleration=None, speed=None):
    """Return the course of speed, rows of seconds and rpm, from the arguments of `run_up`."""
    words, given = "a finite number >= 0", (start, stop, duration, acceleration)
    if speed is not None:
        if any(value is not None for value in given):
            raise ValueError(
                "speed is not allowed together with start, stop, duration and acceleration"
            )
        rows = _course("speed", speed, words, lambda v: 0.0 <= v < math.inf)
    else:
        first, last = (
            checks.number(name, value, f"{words}, rpm", lambda v: 0.0 <= v < math.inf)
            for name, value in (("start", start), ("stop", stop))
        )
        if (duration is None) == (acceleration is None):
            raise ValueError(
                f"duration = {duration!r} with acceleration = {acceleration!r} is not allowed: it "
                "must be one of the two"
            )
        if duration is None:
            rate = checks.finite_positive("acceleration", acceleration)
            duration = abs(last - first) / rate
        words = "a finite number of seconds > 0"
        if acceleration is not None:
            words += ", the difference of start and stop over the acceleration"
        duration = checks.number("duration", duration, words, lambda v: 0.0 < v < math.inf)
        rows = np.array([[0.0, first], [duration, last]])
    if len(rows) < 2 or rows[0, 0] != 0.0:
        raise ValueError(
            f"speed = {speed!r} is not allowed: it must have two rows or more, the first at 0 s"
        )
    if not rows[:, 1].any():
        raise ValueError("speed is not allowed to be 0 rpm all along: something must turn")
    return rows


def _course(name, rows, words, accept, steps=False):
    """Return a checked course, rows of seconds and a value; `steps` allows equal times."""
    course = []
    for i, row in enumerate(checks.many(name, rows)):
        t, value = checks.many(f"{name}[{i}]", row, 2)
        t = checks.finite_nonnegative(f"{name}[{i}][0]", t)
        value = checks.number(f"{name}[{i}][1]", value, words, accept)
        if course and (t < course[-1][0] or (t == course[-1][0] and not steps)):
            relation = "not before" if steps else "after"
            raise ValueError(
                f"{name}[{i}][0] = {t!r} is not allowed: it must be {relation} {course[-1][0]!r} s"
            )
        course.append((t, value))
    if not course:
        raise ValueError(f"{name} = {rows!r} is not allowed: it must have a row of s and a value")
    return np.array(course)


def inertia_of(model, driver, driven_mass, base_radius):
    """Return the inertia forces of the meshes per acceleration, for `courses.run_course`."""
    driven_mass = checks.finite_nonnegative("driven_mass", driven_mass)
    if model.train is not None:
        if driven_mass or base_radius is not None:
            raise ValueError(
                "driven_mass and base_radius are not allowed: the inertias of the model are known"
            )
        return inertia.train_accelerations(model.train, driver)
    if driver is not None:
        raise ValueError(f"driver = {driver!r} is not allowed: the model has no bodies")
    if not driven_mass:
        return np.zeros(1)
    return inertia.mesh_acceleration(
        model.mesh, driven_mass, checks.finite_positive("base_radius", base_radius)
    )


def _statistics(model, stretches, omega):
    """Return the variables over revolutions, name -> (dims, values)."""
    phase, time, begin, number = (
        np.concatenate(parts)
        for parts in zip(
            *(
                (np.diff(stretch.phase), np.diff(stretch.theta), stretch.theta[:-1], stretch.block)
                for stretch in stretches
            ),
            strict=True,
        )
    )
    first = np.flatnonzero(np.diff(number, prepend=-1))
    time, phase = np.add.reduceat(time, first), np.add.reduceat(phase, first)
    begin = begin[first]
    # A revolution that spans several stretches has a summary in each of them.
    table = np.concatenate([stretch.summary for stretch in stretches])
    summary_blocks = np.concatenate([np.unique(stretch.block) for stretch in stretches])
    block = np.flatnonzero(np.diff(summary_blocks, prepend=-1))
    rows = np.add.reduceat(table, block)
    rows[..., _MAXIMUM_COLUMNS] = np.maximum.reduceat(table[..., _MAXIMUM_COLUMNS], block)
    rows[..., _MINIMUM_COLUMNS] = np.minimum.reduceat(table[..., _MINIMUM_COLUMNS], block)
    length, force = model.static_deflection, model.scales()["force_scale"]
    # The total time is the sum of the times at each contact, so that the fractions sum up to 1.
    share = rows[..., [orbit.TIME_NORMAL, orbit.TIME_BACKLASH, orbit.TIME_INVERSE]].sum(axis=-1)
    # No time is counted after a run has stopped.
    share[share == 0.0] = np.nan
    columns = {
        "displacement_max": rows[..., orbit.X_MAX] * length,
        "displacement_min": rows[..., orbit.X_MIN] * length,
        "dynamic_force_max": rows[..., orbit.FORCE_MAX] * force,
        "dynamic_force_min": rows[..., orbit.FORCE_MIN] * force,
        "mean_force": rows[..., FORCE_SUM] * force / share,
        "fraction_normal": rows[..., orbit.TIME_NORMAL] / share,
        "fraction_backlash": rows[..., orbit.TIME_BACKLASH] / share,
        "fraction_inverse": rows[..., orbit.TIME_INVERSE] / share,
        "bounces": rows[..., orbit.BOUNCES] * math.tau / np.maximum(phase, 1e-300)[:, None],
    }
    over = ("revolution", "mesh") if model.mesh_names else ("revolution",)
    named = {
        "revolution": (("revolution",), number[first]),
        "revolution_time": (("revolution",), (begin + 0.5 * time) / omega),
        "revolution_speed": (("revolution",), np.asarray(model.speed(phase / time))),
    }
    shape = (first.size, -1) if model.mesh_names else (first.size,)
    return named | {name: (over, values.reshape(shape)) for name, values in columns.items()}


def _events(model, stretches, omega):
    """Return the variables over events, name -> (dims, values)."""
    rows = np.concatenate([stretch.events for stretch in stretches])
    speeds = [stretch.piece.by(stretch.events[:, 0])[0] for stretch in stretches]
    columns = {
        "event_time": rows[:, 0] / omega,
        "event_speed": np.asarray(model.speed(np.concatenate(speeds))),
        "event_from": rows[:, 2].astype(np.int8),
        "event_to": rows[:, 3].astype(np.int8),
        "event_velocity": rows[:, 4] * (model.static_deflection * omega),
    }
    if model.mesh_names:
        columns["event_mesh"] = rows[:, 1].astype(np.int16)
    return {name: (("event",), values) for name, values in columns.items()}


def _time_variables(model, stretches, omega, samples):
    """Return the variables over time, name -> (dims, values)."""
    steps = np.arange(samples) / samples
    theta = np.concatenate(
        [
            (stretch.theta[:-1, None] + steps * np.diff(stretch.theta)[:, None]).ravel()
            for stretch in stretches
        ]
    )
    counts = [len(stretch.samples) for stretch in stretches]
    pieces = [stretch.piece for stretch in stretches]
    parts = np.split(theta, np.cumsum(counts)[:-1])
    course = [np.array(p.by(t)) for p, t in zip(pieces, parts, strict=True)]
    speed, phase, load = np.hstack(course)
    table = np.concatenate([stretch.samples for stretch in stretches])
    length, force = model.static_deflection, model.scales()["force_scale"]
    mesh_columns = {
        "displacement": table[..., orbit.SAMPLE_X] * length,
        "velocity": table[..., orbit.SAMPLE_V] * (length * omega),
        "acceleration": table[..., orbit.SAMPLE_A] * (length * omega**2),
        "dynamic_force": table[..., orbit.SAMPLE_FORCE] * force,
        "contact": table[..., orbit.SAMPLE_CONTACT].astype(np.int8),
    }
    over = ("time", "mesh") if model.mesh_names else ("time",)
    shape = (theta.size, -1) if model.mesh_names else (theta.size,)
    data = {
        "time": (("time",), theta / omega),
        "speed": (("time",), np.asarray(model.speed(speed))),
        "load_ratio": (("time",), load),
        "phase": (("time",), phase),
        **{name: (over, values.reshape(shape)) for name, values in mesh_columns.items()},
    }
    if model.mesh_names:
        q = np.concatenate([stretch.states[:, : model.size // 2] for stretch in stretches])
        moves = np.einsum("bxn,kn->kbx", model.structure.motions, q) * length
        data["body_motion"] = (("time", "body", "axis"), moves)
    return data


def _failed(dims, values):
    """Return a variable of the same shape with NaN, or with 0 if it holds integers."""
    return dims, np.full(values.shape, np.nan) if values.dtype.kind == "f" else 0 * values


def _with_units(name, dims, values):
    """Return a variable with its SI units and description if only run-ups have them."""
    units, long_name = _SI_VARIABLES.get(name, (None, None))
    return (dims, values, {"units": units, "long_name": long_name} if units else {})
