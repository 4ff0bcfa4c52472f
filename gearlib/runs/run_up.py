"""`run_up`: a model while its speed and its load change."""

import math

import numpy as np

from gearlib import checks
from gearlib.data import contact_states, status, summary
from gearlib.data.result import result
from gearlib.engines import orbit
from gearlib.engines.linear import courses
from gearlib.engines.linear.record import FORCE_SUM
from gearlib.models import acceleration as inertia
from gearlib.models.model import is_model
from gearlib.runs.run_arguments import MAX_EVENTS, check_memory, check_speed

#: name -> (CF units, long_name): a run-up is in SI units
_SAID = {
    "time": ("s", "time"),
    "speed": ("min-1", "speed of the gear whose revolutions count"),
    "load_ratio": ("1", "load over that of the model"),
    "phase": ("rad", "mesh phase, 2 pi per mesh period"),
    "displacement": ("m", "relative mesh displacement"),
    "velocity": ("m s-1", "relative mesh velocity"),
    "acceleration": ("m s-2", "relative mesh acceleration"),
    "dynamic_force": ("N", "dynamic mesh force"),
    "contact": ("1", "phase of contact"),
    "body_motion": ("m", "displacement of the body"),
    "event_time": ("s", "time of the crossing of a flank line"),
    "event_speed": ("min-1", "speed at the event"),
    "event_from": ("1", "phase of contact before the event"),
    "event_to": ("1", "phase of contact after the event"),
    "event_velocity": ("m s-1", "relative mesh velocity at the event"),
    "event_mesh": ("1", "number of the mesh in which the event is"),
    "revolution": ("1", "number of the revolution of the gear whose teeth count"),
    "revolution_time": ("s", "middle of the revolution"),
    "revolution_speed": ("min-1", "mean speed in the revolution"),
    "displacement_max": ("m", "largest displacement in the revolution"),
    "displacement_min": ("m", "least displacement in the revolution"),
    "dynamic_force_max": ("N", "largest dynamic mesh force in the revolution"),
    "dynamic_force_min": ("N", "least dynamic mesh force in the revolution"),
    "mean_force": ("N", "mean of the mesh force over the revolution"),
    "fraction_normal": ("1", "fraction of time in normal mesh"),
    "fraction_backlash": ("1", "fraction of time in the backlash"),
    "fraction_inverse": ("1", "fraction of time in inverse mesh"),
    "bounces": ("1", "losses of normal contact per mesh period"),
}
#: Memory of a mesh period beside its samples: summary and a few events, numbers for each mesh.
_PER_PERIOD = 40
#: Columns of a summary that take the largest, the least, the sum of those of the intervals.
_LARGEST, _LEAST = (orbit.X_MAX, orbit.FORCE_MAX), (orbit.X_MIN, orbit.FORCE_MIN)


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
    runner, pieces, z = courses.set_out(model, speeds, loads, state)
    meshes, end = runner.meshes, pieces[-1]
    turned = end.phase + end.length * (end.speed + 0.5 * end.acceleration * end.length)
    columns = samples * (meshes * 6 + model.size) + _PER_PERIOD * meshes
    words = f"a course of {speeds[-1, 0]:g} s with samples_per_period = {samples}"
    check_memory(words, int(turned / math.tau) + 1, columns, "mesh periods")
    found = list(
        courses.run_through(runner, pieces, z, samples, limit, push, model.periods_per_revolution)
    )
    code = found[-1].status
    if code == status.OK and summary.reach(found[-1].summary) > model.bound(1.0, state):
        code = status.OVERFLOW
    data = _statistics(model, found, omega) | _events(model, found, omega)
    if samples:
        data |= _course_of_time(model, found, omega, samples)
    if code != status.OK:
        data = {name: _nothing(*variable) for name, variable in data.items()}
    data = {name: _described(name, *variable) for name, variable in data.items()}
    own = model.coordinates()
    used = {dim for variable in data.values() for dim in variable[0]}
    coords = {name: own[name] for name in own if name in used}
    said = {"speed": speeds.tolist(), "load": loads.tolist(), "initial_state": state}
    said |= {"driver": driver, "driven_mass": driven_mass, "base_radius": base_radius}
    data["status"] = np.int8(code)
    dataset = result("Run-up of a gear mesh", model, data, coords, method=runner.words, **said)
    dataset["status"].attrs["message"] = status.MESSAGES[code]
    return dataset


def _check_model(model):
    """Check that a model may be on its way."""
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
    """Return the course of speed of `run_up`, rows of seconds and rpm, checked."""
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
    """Return rows of seconds and a value, checked."""
    found = []
    for i, row in enumerate(checks.many(name, rows)):
        t, value = checks.many(f"{name}[{i}]", row, 2)
        t = checks.finite_nonnegative(f"{name}[{i}][0]", t)
        value = checks.number(f"{name}[{i}][1]", value, words, accept)
        if found and (t < found[-1][0] or (t == found[-1][0] and not steps)):
            more = "not before" if steps else "after"
            raise ValueError(
                f"{name}[{i}][0] = {t!r} is not allowed: it must be {more} {found[-1][0]!r} s"
            )
        found.append((t, value))
    if not found:
        raise ValueError(f"{name} = {rows!r} is not allowed: it must have a row of s and a value")
    return np.array(found)


def inertia_of(model, driver, driven_mass, base_radius):
    """Return what `courses.run_through` takes as inertia."""
    driven_mass = checks.finite_nonnegative("driven_mass", driven_mass)
    if model.train is not None:
        if driven_mass or base_radius is not None:
            raise ValueError(
                "driven_mass and base_radius are not allowed: the inertias of the model are known"
            )
        return inertia.of_train(model.train, driver)
    if driver is not None:
        raise ValueError(f"driver = {driver!r} is not allowed: the model has no bodies")
    if not driven_mass:
        return np.zeros(1)
    return inertia.of_mesh(
        model.mesh, driven_mass, checks.finite_positive("base_radius", base_radius)
    )


def summaries(found):
    """Return the summaries of the revolutions, shape (r, m, 10)."""
    # A revolution that goes on in another stretch has a block in each of them.
    table = np.concatenate([one.summary for one in found])
    of_block = np.concatenate([np.unique(one.block) for one in found])
    block = np.flatnonzero(np.diff(of_block, prepend=-1))
    rows = np.add.reduceat(table, block)
    for extrema, reduce in ((_LARGEST, np.maximum), (_LEAST, np.minimum)):
        for column in extrema:
            rows[..., column] = reduce.reduceat(table[..., column], block)
    return rows


def _statistics(model, found, omega):
    """Return name -> (dims, values) over the revolutions."""
    passed = np.concatenate([np.diff(one.phase) for one in found])
    lasted = np.concatenate([np.diff(one.theta) for one in found])
    rows = summaries(found)
    number = np.concatenate([one.block for one in found])
    first = np.flatnonzero(np.diff(number, prepend=-1))
    time, phase = np.add.reduceat(lasted, first), np.add.reduceat(passed, first)
    begin = np.concatenate([one.theta[:-1] for one in found])[first]
    length, force = model.static_deflection, model.scales()["force_scale"]
    # The time of each mesh as its contacts count it: shares of one are 1 to the last place.
    share = rows[..., [orbit.TIME_NORMAL, orbit.TIME_BACKLASH, orbit.TIME_INVERSE]].sum(axis=-1)
    # Of a run that was stopped nothing was counted.
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


def _events(model, found, omega):
    """Return name -> (dims, values) over the events."""
    rows = np.concatenate([one.events for one in found])
    speeds = [one.piece.by(one.events[:, 0])[0] for one in found]
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


def _course_of_time(model, found, omega, samples):
    """Return name -> (dims, values) over time."""
    steps = np.arange(samples) / samples
    theta = np.concatenate(
        [(one.theta[:-1, None] + steps * np.diff(one.theta)[:, None]).ravel() for one in found]
    )
    counts = [len(one.samples) for one in found]
    pieces = [one.piece for one in found]
    parts = np.split(theta, np.cumsum(counts)[:-1])
    course = [np.array(p.by(t)) for p, t in zip(pieces, parts, strict=True)]
    speed, phase, load = np.hstack(course)
    table = np.concatenate([one.samples for one in found])
    length, force = model.static_deflection, model.scales()["force_scale"]
    of_mesh = {
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
        **{name: (over, values.reshape(shape)) for name, values in of_mesh.items()},
    }
    if model.mesh_names:
        q = np.concatenate([one.states[:, : model.size // 2] for one in found])
        moves = np.einsum("bxn,kn->kbx", model.structure.motions, q) * length
        data["body_motion"] = (("time", "body", "axis"), moves)
    return data


def _nothing(dims, values):
    """Return a variable of the same shape without numbers."""
    return dims, np.full(values.shape, np.nan) if values.dtype.kind == "f" else 0 * values


def _described(name, dims, values):
    """Return a variable with its units."""
    units, words = _SAID[name]
    flags = contact_states.FLAGS if name in ("contact", "event_from", "event_to") else {}
    return dims, values, {"units": units, "long_name": words, **flags}
