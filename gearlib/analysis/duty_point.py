"""`duty_point`: forces, vibration and contact of gears at one torque and speed, in SI units.

A motion is followed until it repeats, as long again, and recorded over one orbit. A motion that
does not repeat is recorded over whole revolutions of the gear whose teeth count.
"""

import math
from typing import Any

import numpy as np
import xarray as xr

from gearlib import checks
from gearlib.analysis.order_maps import mesh_order_amplitudes, transmission_error
from gearlib.data.result import result
from gearlib.models.geometry.iso import dynamic_factor
from gearlib.models.geometry.mesh import torque_of
from gearlib.models.load_sharing_pair import default_load_sharing_pair
from gearlib.models.model import is_model
from gearlib.runs.run_arguments import check_speed
from gearlib.runs.simulation import simulate

#: Longest motion that is followed, in mesh periods and in integration steps, which pairs of teeth
#: take: some 0.2 s.
_MAX_PERIODS, _MAX_STEPS = 10_000, 150_000
#: Largest product of mesh periods and sets of pairs of teeth that are tabulated: some 0.5 s.
_MAX_TABLES = 2500
#: Revolutions of the record of a motion that does not repeat, and its largest mesh periods.
_RECORD_REVOLUTIONS, _MAX_RECORD_PERIODS = 10, 2000


def duty_point(gears, speed, *, torque=None, initial_state=(0.0, 0.0), **options):
    """Compute dynamic factor, forces and transmission error of gears at one torque and speed.

    Parameters
    ----------
    gears : gearlib.geometry.Mesh or model
        Two drawn gears, which move as a `LoadSharingPair`, or a model for `gearlib.simulate` in
        which gears turn. With a rectangular stiffness, for instance that of a `GearPair`, forces
        jump where pairs of teeth enter, at any speed: their largest value is no K_v.
    speed : float
        Speed of the pinion (of the gear whose teeth count), rpm; finite, > 0.
    torque : float, optional
        Torque of the pinion, N m; needed for drawn gears only, or `power` in W.
    initial_state : tuple of float
        Displacement in static deflections and dx/dtau.
    **options
        For drawn gears: damping_ratio and other arguments of `gearlib.GearPair.from_geometry`. The
        stiffness of a pair of teeth is by default "energy", or "iso" where a bore is too large
        for the energy method; the only option of the stiffness is the coupling.

    Returns
    -------
    xarray.Dataset
        mesh_frequency_hertz, tuning, speed, resonance_speed, torque, static_force, dynamic_factor,
        mesh_force_max and mesh_force_min (N), bearing_force_max (N, over ``bearing`` for six
        degrees, ``body`` for trains; for rigid bearings those of a shaft together),
        error_peak_to_peak and error_rms (m, without its mean), lost_share (of time without
        drive-side contact), settled and period; iso_dynamic_factor where drawn gears have a
        quality; mesh_order_force and mesh_order_error, amplitudes of the first mesh orders, nan
        where the samples are too few. For trains over ``mesh``.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range; or if the motion grows without bound.
    """
    data: dict[str, Any] = {}
    is_truncated = False
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
        model, is_truncated = _model_of_drawn_gears(gears, torque, options)
        data = _iso_dynamic_factor(gears, torque, speed) | {"torque": float(torque)}
    if model.speed is None:
        raise ValueError(f"gears = {model!r} is not allowed: nothing turns in this model")
    tuning = check_speed(model, "speed", speed)
    slowest = model.slowest_tuning
    run = settled_run(model, max(tuning, slowest), initial_state)
    variables, coords = variables_of_run(run, model)
    data |= variables
    if is_truncated:
        data["settled"] = np.int8(0)
    if tuning < slowest:
        hertz = data["mesh_frequency_hertz"] * tuning / slowest
        data |= {"tuning": tuning, "mesh_frequency_hertz": hertz}
    data["speed"] = float(speed)
    meshes = {name: values for name, values in model.coordinates().items() if name == "mesh"}
    return result(
        "Duty point of a gear mesh",
        model,
        data,
        meshes | coords,
        method="settled run",
        speed=float(speed),
    )


def _model_of_drawn_gears(mesh: Any, torque: float, options: dict) -> tuple:
    """Return (`LoadSharingPair` of drawn gears, whether its pitch errors were truncated).

    `torque` is that of the pinion in N m, `options` are those of `duty_point`. If thousands of mesh
    periods pass until the same teeth meet again, only the first are modelled.
    """
    model = default_load_sharing_pair(mesh, torque=torque, **options)
    max_repeats = _MAX_TABLES // 2 ** math.ceil(mesh.total_contact_ratio)
    if model.repeats <= max_repeats:
        return model, False
    return model.replace(pitch_errors=model.pitch_errors[:max_repeats]), True


def _iso_dynamic_factor(mesh: Any, torque: float, speed: float) -> dict:
    """Return {"iso_dynamic_factor": dynamic factor by ISO 6336}, empty without gear qualities.

    `mesh` is one of drawn gears; torque in N m and speed in rpm are those of the pinion.
    """
    gears = mesh.pinion, mesh.wheel
    if any(gear.quality is None for gear in gears):
        return {}
    # The smaller tip relief of both gears counts.
    amount = min(gear.tip_relief.amount if gear.tip_relief else 0.0 for gear in gears)
    checks.finite_positive("speed", speed)
    return {"iso_dynamic_factor": dynamic_factor(mesh, torque, speed, tip_relief=amount).factor}


def settled_run(model: Any, tuning: float, initial_state: tuple = (0.0, 0.0)) -> xr.Dataset:
    """Return a run of `simulate` that records one orbit, or whole revolutions if there is none.

    The motion starts at the initial state (displacement, velocity), and the time until it repeats
    is doubled step by step.
    """
    max_periods = min(_MAX_PERIODS, int(_MAX_STEPS / model.steps_per_period(tuning)))
    repeats = model.repeats
    state, followed_periods, orbit_periods = initial_state, 0, 0
    step = 2 * repeats
    while not orbit_periods and followed_periods + step <= max_periods:
        run = _checked_run(model, tuning, step, state, samples_per_period=8)
        state, orbit_periods = tuple(run.final_state.values), int(run.period)
        followed_periods += step
        step = followed_periods
    if orbit_periods:
        # The motion is followed as long again, so that the record has settled to rounding.
        record = orbit_periods
        settling = followed_periods if repeats == 1 else repeats
    else:
        teeth = round(model.periods_per_revolution)
        max_record = min(max_periods, _MAX_RECORD_PERIODS)
        record = teeth * max(1, min(_RECORD_REVOLUTIONS, max_record // teeth))
        settling = 0 if followed_periods else 2
    return _checked_run(
        model, tuning, settling + record, state, record_periods=record, samples_per_period=128
    )


def _checked_run(model: Any, tuning: float, periods: int, state: tuple, **options) -> xr.Dataset:
    """Return a run of `simulate` over mesh periods from a state, with its further options.

    Raise ValueError if the run could not go on.
    """
    run = simulate(model, tuning, periods=periods, initial_state=state, **options)
    if int(run.status):
        raise ValueError(f"the motion at tuning {tuning:.6g}: {run.status.attrs['message']}")
    return run


def variables_of_run(run: xr.Dataset, model: Any) -> tuple:
    """Return (variables, coordinates) of `duty_point` of a run, in SI units.

    These are the variables of `in_units`, the period, bearing forces and the first mesh orders.
    """
    mesh_orders, forces, errors = mesh_order_amplitudes(run)
    dims = ("mesh_order", *run.displacement.dims[1:])
    data = in_units(run, model)
    data |= {"settled": np.int8(int(run.period) > 0), "period": run.period.values}
    coords = {"mesh_order": mesh_orders}
    names, bearings = bearing_forces(run, model)
    if names is None:
        data["bearing_force_max"] = bearings
    else:
        dim = "body" if len(dims) > 1 else "bearing"
        data["bearing_force_max"], coords[dim] = (dim, bearings), names
    data |= {"mesh_order_force": (dims, forces), "mesh_order_error": (dims, errors)}
    return data, coords


def in_units(run: xr.Dataset, model: Any) -> dict:
    """Return variables of a run of `simulate` in N, m, Hz and rpm: name -> values.

    They are speeds, mesh forces, transmission error and contact loss, over ``mesh`` for trains.
    """
    force, length = float(run.force_scale), float(run.static_deflection)
    error = transmission_error(run)
    if np.array_equal(error, run.displacement.values):
        peak_to_peak = run.displacement_max.values - run.displacement_min.values
    else:
        peak_to_peak = np.ptp(error, axis=0)
    dims = run.displacement.dims[1:]
    factor = run.dynamic_factor if "dynamic_factor" in run else run.dynamic_force_max
    return {
        "speed": run.speed.values,
        "tuning": run.tuning.values,
        "mesh_frequency_hertz": float(run.mesh_frequency) / math.tau,
        "resonance_speed": model.speed(1.0),
        "static_force": (dims, model.mean_forces * force) if dims else force,
        "dynamic_factor": (dims, factor.values),
        "mesh_force_max": (dims, force * run.dynamic_force_max.values),
        "mesh_force_min": (dims, force * run.dynamic_force_min.values),
        "error_peak_to_peak": (dims, length * peak_to_peak),
        "error_rms": (dims, length * error.std(axis=0)),
        "lost_share": (dims, (run.fraction_backlash + run.fraction_inverse).values),
    }


def bearing_forces(run: xr.Dataset, model: Any) -> tuple:
    """Return (names of the bearings, largest force of each in N) in a run of `simulate`.

    Rigid bearings carry the mesh force together: the result is (None, largest mesh force).
    """
    force, length = float(run.force_scale), float(run.static_deflection)
    if "bearing_force_y3" in run:
        names = ["gear 3", "gear 2"]
        forces = [np.hypot(run[f"bearing_force_y{i}"], run[f"bearing_force_z{i}"]) for i in (3, 2)]
        return names, [force * float(time_history.max()) for time_history in forces]
    if "body_motion" not in run:
        return None, force * float(run.dynamic_force_max)
    stiffness = np.array([body.support_stiffness for body in model.bodies])
    motion = run.body_motion.values[:, :, :2]
    with np.errstate(invalid="ignore"):
        components = np.where(np.isfinite(stiffness), stiffness * length * motion, math.nan)
    sizes = np.hypot(components[..., 0], components[..., 1])
    return list(model.body_names), sizes.max(axis=0)
