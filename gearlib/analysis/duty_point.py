"""`duty_point`: what two gears or a train do at one torque and speed, in units of machines.

A motion is followed until it repeats, as long again, and recorded over one orbit. A motion that
does not repeat is recorded over whole revolutions of the gear whose teeth count.
"""

import math
from typing import Any

import numpy as np

from gearlib import checks
from gearlib.analysis.order_maps import mesh_order_amplitudes, transmission_error
from gearlib.data.result import result
from gearlib.models.geometry.iso import dynamic_factor
from gearlib.models.geometry.mesh import torque_of
from gearlib.models.load_sharing_pair import tooth_pairs_of
from gearlib.models.model import is_model
from gearlib.runs.run_arguments import check_speed
from gearlib.runs.simulation import simulate

#: Longest motion that is followed, in mesh periods, and of pairs of teeth in steps: some 0.2 s.
_MAX_PERIODS, _MAX_STEPS = 10_000, 150_000
#: Mesh periods times sets of pairs of teeth that are tabulated at most: some 0.5 s.
_MAX_TABLES = 2500
#: Revolutions that are recorded of a motion that does not repeat, and most mesh periods of these.
_REVOLUTIONS, _MAX_RECORD = 10, 2000


def duty_point(gears, speed, *, torque=None, initial_state=(0.0, 0.0), **options):
    """Return what gears do at one torque and speed: K_v, forces, transmission error, contact.

    Parameters
    ----------
    gears : gearlib.geometry.Mesh or model
        Two drawn gears, which move as a `LoadSharingPair`, or what `gearlib.simulate` takes, of
        which gears turn. Forces of a rectangular stiffness, as that of a `GearPair`, jump where
        pairs of teeth enter, at any speed: their largest value is no K_v.
    speed : float
        In rpm, of the pinion (of the gear whose teeth count); finite, > 0.
    torque : float, optional
        Of the pinion, N m; of drawn gears only, which need it, or a power in W.
    initial_state : tuple of float
        Displacement in static deflections and dx/dtau.
    **options
        Of drawn gears: damping_ratio and the other arguments of `gearlib.GearPair.from_geometry`.
        The stiffness of a pair of teeth is by default "energy", or "iso" where a bore is too large
        for the energy method; of its options it takes the coupling.

    Returns
    -------
    xarray.Dataset
        mesh_frequency_hertz, tuning, speed, resonance_speed, torque, static_force, dynamic_factor,
        mesh_force_max and mesh_force_min (N), bearing_force_max (N, over ``bearing`` of six
        degrees, ``body`` of trains; of rigid bearings those of a shaft together),
        error_peak_to_peak and error_rms (m, without its mean), lost_share (of time without
        drive-side contact), settled and period; iso_dynamic_factor where drawn gears have a
        quality; mesh_order_force and mesh_order_error, amplitudes of the first mesh orders, nan
        where samples do not tell them. Over ``mesh`` of trains.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range; or if the motion grows without bound.
    """
    data: dict[str, Any] = {}
    cut = False
    if is_model(gears):
        if torque is not None or options:
            name = "torque" if torque is not None else next(iter(options))
            raise ValueError(
                f"{name} = {torque if name == 'torque' else options[name]!r} is not allowed: a "
                "model has its own, only drawn gears take it"
            )
        model = gears
    else:
        checks.drawn_mesh(gears, "gears", " or a model")
        torque = torque_of(torque, options.pop("power", None), speed)
        model = tooth_pairs_of(gears, torque=torque, **options)
        # Where thousands of mesh periods pass until the same teeth meet the first stand for all.
        most = _MAX_TABLES // 2 ** math.ceil(gears.total_contact_ratio)
        cut = model.repeats > most
        model = model.replace(pitch_errors=model.pitch_errors[:most]) if cut else model
        if all(gear.quality is not None for gear in (gears.pinion, gears.wheel)):
            # The smaller relief is what counts at both ends of the path.
            relieved = [gear.tip_relief for gear in (gears.pinion, gears.wheel)]
            amount = min(relief.amount if relief else 0.0 for relief in relieved)
            checks.finite_positive("speed", speed)
            data["iso_dynamic_factor"] = dynamic_factor(
                gears, torque, speed, tip_relief=amount
            ).factor
        data["torque"] = float(torque)
    if model.speed is None:
        raise ValueError(f"gears = {model!r} is not allowed: nothing turns in this model")
    tuning = check_speed(model, "speed", speed)
    slowest = model.slowest_tuning
    data |= of_run(settled_run(model, max(tuning, slowest), initial_state), model)
    if cut:
        data["settled"] = np.int8(0)
    if tuning < slowest:
        hertz = data["mesh_frequency_hertz"] * tuning / slowest
        data |= {"tuning": tuning, "mesh_frequency_hertz": hertz}
    data["speed"] = float(speed)
    coords = {name: values for name, values in model.coordinates().items() if name == "mesh"}
    coords |= data.pop("coords")
    return result(
        "Duty point of a gear mesh", model, data, coords, method="settled run", speed=float(speed)
    )


def settled_run(model, tuning, initial_state=(0.0, 0.0)):
    """Return a run of `simulate` over one orbit, or over whole revolutions if there is none."""
    limit = min(_MAX_PERIODS, int(_MAX_STEPS / model.steps_per_period(tuning)))
    repeats = model.repeats
    state, length, orbit = initial_state, 0, 0
    step = 2 * repeats
    while not orbit and length + step <= limit:
        run = _checked_run(model, tuning, step, state, samples_per_period=8)
        state, length, orbit = tuple(run.final_state.values), length + step, int(run.period)
        step = length
    if orbit:
        # As long again, so that what is recorded has settled to rounding.
        record, before = orbit, length if repeats == 1 else repeats
    else:
        teeth = round(model.periods_per_revolution)
        record = teeth * max(1, min(_REVOLUTIONS, min(limit, _MAX_RECORD) // teeth))
        before = 0 if length else 2
    return _checked_run(
        model, tuning, before + record, state, record_periods=record, samples_per_period=128
    )


def _checked_run(model, tuning, periods, state, **options):
    """Return a run of `simulate`; ValueError if it could not go on."""
    run = simulate(model, tuning, periods=periods, initial_state=state, **options)
    if int(run.status):
        raise ValueError(f"the motion at tuning {tuning:.6g}: {run.status.attrs['message']}")
    return run


def of_run(run, model):
    """Return `in_units` of a run over whole revolutions, its first mesh orders, coordinates."""
    mesh_orders, forces, errors = mesh_order_amplitudes(run)
    over = ("mesh_order", *run.displacement.dims[1:])
    data = in_units(run, model)
    data |= {"settled": np.int8(int(run.period) > 0), "period": run.period.values}
    coords = {"mesh_order": mesh_orders}
    names, bearings = bearing_forces(run, model)
    if names is None:
        data["bearing_force_max"] = bearings
    else:
        dim = "body" if over[1:] else "bearing"
        data["bearing_force_max"], coords[dim] = (dim, bearings), names
    data["mesh_order_force"] = over, forces
    data["mesh_order_error"] = over, errors
    return data | {"coords": coords}


def in_units(run, model):
    """Return name -> values of a run of `simulate`, in N, m, Hz, rpm."""
    force, length = float(run.force_scale), float(run.static_deflection)
    error = transmission_error(run)
    if np.array_equal(error, run.displacement.values):
        span = run.displacement_max.values - run.displacement_min.values
    else:
        span = np.ptp(error, axis=0)
    over = run.displacement.dims[1:]
    factor = run.dynamic_factor if "dynamic_factor" in run else run.dynamic_force_max
    return {
        "speed": run.speed.values,
        "tuning": run.tuning.values,
        "mesh_frequency_hertz": float(run.mesh_frequency) / math.tau,
        "resonance_speed": model.speed(1.0),
        "static_force": (over, model.mean_forces * force) if over else force,
        "dynamic_factor": (over, factor.values),
        "mesh_force_max": (over, force * run.dynamic_force_max.values),
        "mesh_force_min": (over, force * run.dynamic_force_min.values),
        "error_peak_to_peak": (over, length * span),
        "error_rms": (over, length * error.std(axis=0)),
        "lost_share": (over, (run.fraction_backlash + run.fraction_inverse).values),
    }


def bearing_forces(run, model):
    """Return (names, largest forces in N) of bearings; rigid ones together carry the mesh force."""
    force, length = float(run.force_scale), float(run.static_deflection)
    if "bearing_force_y3" in run:
        names = ["gear 3", "gear 2"]
        forces = [np.hypot(run[f"bearing_force_y{i}"], run[f"bearing_force_z{i}"]) for i in (3, 2)]
        return names, [force * float(course.max()) for course in forces]
    if "body_motion" not in run:
        return None, force * float(run.dynamic_force_max)
    stiffness = np.array([body.support_stiffness for body in model.bodies])
    motion = run.body_motion.values[:, :, :2]
    with np.errstate(invalid="ignore"):
        pushed = np.where(np.isfinite(stiffness), stiffness * length * motion, math.nan)
    return list(model.body_names), np.hypot(*np.moveaxis(pushed, -1, 0)).max(axis=0)
