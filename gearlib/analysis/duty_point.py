"""`duty_point`: forces, vibration and contact of gears at one torque and speed, in SI units.

A motion is simulated until it repeats, then for the same time again, and recorded over one period
of its orbit. A motion that does not repeat is recorded over whole revolutions of the gear.
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
from gearlib.runs.run_arguments import tuning_at_speed
from gearlib.runs.simulation import simulate

#: Longest simulated motion, in mesh periods and in integration steps (about 0.2 s of computing).
_MAX_PERIODS, _MAX_STEPS = 10_000, 150_000
#: Largest number of stiffness tables, one for each mesh period and combination of tooth pairs.
_MAX_TABLES = 2500
#: Length of the record of a motion that does not repeat, and its limit in mesh periods.
_RECORD_REVOLUTIONS, _MAX_RECORD_PERIODS = 10, 2000
#: Transient before the record if even the shortest run for an orbit exceeds the limits.
_MIN_TRANSIENT_PERIODS = 2


def duty_point(gears, speed, *, torque=None, initial_state=(0.0, 0.0), **options):
    """Compute dynamic factor, forces and transmission error of gears at one torque and speed.

    Parameters
    ----------
    gears : gearlib.geometry.Mesh or model
        Geometry of two gears, which is modelled as a `LoadSharingPair`, or a model of rotating
        gears for `gearlib.simulate`. With a rectangular stiffness, such as that of a `GearPair`,
        the force jumps when a pair of teeth enters the mesh, so its maximum is not a K_v.
    speed : float
        Speed in rpm, finite, > 0, of the pinion (of the gear that sets the mesh frequency).
    torque : float, optional
        Torque of the pinion in N m. Give it, or `power` in W, with a `Mesh` only.
    initial_state : tuple of float
        Displacement in static deflections and dx/dtau.
    **options
        With a `Mesh`: damping_ratio and other arguments of `gearlib.GearPair.from_geometry`. The
        tooth pair stiffness is "energy" by default, or "iso" if a bore is too large for the energy
        method; its only option is the coupling.

    Returns
    -------
    xarray.Dataset
        mesh_frequency_hertz, tuning, speed, resonance_speed, torque, static_force, dynamic_factor,
        mesh_force_max and mesh_force_min (N), bearing_force_max (N, over ``bearing`` for six
        degrees of freedom, ``body`` for trains; rigid bearings of a shaft are added up),
        error_peak_to_peak and error_rms (m, without the mean), lost_share (fraction of time without
        drive-side contact), settled and period; iso_dynamic_factor if both gears of a `Mesh` have
        a quality and the transverse contact ratio is at least 1; mesh_order_force and
        mesh_order_error, amplitudes of the first mesh orders, NaN if there are too few samples.
        Trains have the dimension ``mesh``.

    Raises
    ------
    ValueError
        If an argument is wrong, or if the motion grows without bound.
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
        checks.gear_mesh(gears, "gears", " or a model")
        torque = torque_of(torque, options.pop("power", None), speed)
        model = default_load_sharing_pair(gears, torque=torque, **options)
        # Each mesh period has a stiffness table for each subset of the tooth pairs in mesh. The
        # pitch errors are truncated if too many periods pass until the same teeth meet again.
        max_periods = _MAX_TABLES // 2 ** math.ceil(gears.total_contact_ratio)
        is_truncated = model.repeats > max_periods
        if is_truncated:
            model = model.replace(pitch_errors=model.pitch_errors[:max_periods])
        has_quality = gears.pinion.quality is not None and gears.wheel.quality is not None
        if has_quality and gears.contact_ratio >= 1.0:
            checks.finite_positive("speed", speed)
            # ISO 6336 takes the smaller tip relief of the two gears.
            reliefs = gears.pinion.tip_relief, gears.wheel.tip_relief
            tip_relief = min(relief.amount if relief else 0.0 for relief in reliefs)
            factor = dynamic_factor(gears, torque, speed, tip_relief=tip_relief).factor
            data["iso_dynamic_factor"] = factor
        data["torque"] = float(torque)
    if model.speed is None:
        raise ValueError(f"gears = {model!r} is not allowed: nothing turns in this model")
    tuning = tuning_at_speed(model, "speed", speed)
    slowest_tuning = model.slowest_tuning
    run = settled_run(model, max(tuning, slowest_tuning), initial_state)
    variables, coords = variables_of_run(run, model)
    data |= variables
    if is_truncated:
        data["settled"] = np.int8(0)
    if tuning < slowest_tuning:
        hertz = data["mesh_frequency_hertz"] * tuning / slowest_tuning
        data |= {"tuning": tuning, "mesh_frequency_hertz": hertz}
    data["speed"] = float(speed)
    meshes = {name: values for name, values in model.coordinates().items() if name == "mesh"}
    options = {"method": "settled run", "speed": float(speed)}
    return result("Duty point of a gear mesh", model, data, meshes | coords, **options)


def settled_run(model: Any, tuning: float, initial_state: tuple = (0.0, 0.0)) -> xr.Dataset:
    """Return a run of `simulate` that records one period of an orbit, or else whole revolutions.

    Its length is doubled until the motion repeats, within `_MAX_PERIODS` and `_MAX_STEPS`.
    """
    max_periods = min(_MAX_PERIODS, int(_MAX_STEPS / model.steps_per_period(tuning)))
    excitation_periods = model.repeats  # mesh periods after which the excitation repeats
    state, simulated_periods, orbit_periods = initial_state, 0, 0
    new_periods = 2 * excitation_periods
    while not orbit_periods and simulated_periods + new_periods <= max_periods:
        run = _checked_run(model, tuning, new_periods, state, samples_per_period=8)
        state, orbit_periods = tuple(run.final_state.values), int(run.period)
        simulated_periods += new_periods
        new_periods = simulated_periods
    if orbit_periods:
        # A further transient lets the motion settle to rounding error before the record.
        record_periods = orbit_periods
        transient_periods = simulated_periods if excitation_periods == 1 else excitation_periods
    else:
        teeth = round(model.periods_per_revolution)
        max_record = min(max_periods, _MAX_RECORD_PERIODS)
        record_periods = teeth * max(1, min(_RECORD_REVOLUTIONS, max_record // teeth))
        transient_periods = 0 if simulated_periods else _MIN_TRANSIENT_PERIODS
    options = {"record_periods": record_periods, "samples_per_period": 128}
    return _checked_run(model, tuning, transient_periods + record_periods, state, **options)


def _checked_run(model: Any, tuning: float, periods: int, state: tuple, **options) -> xr.Dataset:
    """Return a run of `simulate` over a number of mesh periods; raise ValueError if it failed."""
    run = simulate(model, tuning, periods=periods, initial_state=state, **options)
    if int(run.status):
        raise ValueError(f"the motion at tuning {tuning:.6g}: {run.status.attrs['message']}")
    return run


def variables_of_run(run: xr.Dataset, model: Any) -> tuple:
    """Return (variables, coordinates) of the dataset of `duty_point` for a run, in SI units."""
    mesh_orders, order_forces, order_errors = mesh_order_amplitudes(run)
    dims = ("mesh_order", *run.displacement.dims[1:])  # "mesh" is a dimension of trains only
    data = si_variables(run, model)
    data |= {"settled": np.int8(int(run.period) > 0), "period": run.period.values}
    coords: dict[str, Any] = {"mesh_order": mesh_orders}
    force_scale, static_deflection = float(run.force_scale), float(run.static_deflection)
    if "bearing_force_y3" in run:
        # Six degrees of freedom: gear 3 is the pinion, with the indices of the paper.
        forces = [np.hypot(run[f"bearing_force_y{i}"], run[f"bearing_force_z{i}"]) for i in (3, 2)]
        max_forces = [force_scale * float(time_history.max()) for time_history in forces]
        data["bearing_force_max"], coords["bearing"] = ("bearing", max_forces), ["gear 3", "gear 2"]
    elif "body_motion" in run:
        stiffness = np.array([body.support_stiffness for body in model.bodies])
        # The displacement of a rigid bearing is zero and does not give its force.
        stiffness[~np.isfinite(stiffness)] = math.nan
        # Forces along x and y, without the moment.
        components = stiffness * static_deflection * run.body_motion.values[:, :, :2]
        max_forces = np.hypot(components[..., 0], components[..., 1]).max(axis=0)
        dim = "body" if len(dims) > 1 else "bearing"
        data["bearing_force_max"], coords[dim] = (dim, max_forces), list(model.body_names)
    else:
        data["bearing_force_max"] = force_scale * float(run.dynamic_force_max)
    data |= {"mesh_order_force": (dims, order_forces), "mesh_order_error": (dims, order_errors)}
    return data, coords


def si_variables(run: xr.Dataset, model: Any) -> dict:
    """Return {variable name: values} of a run of `simulate` in N, m, Hz and rpm.

    The variables are speeds, mesh forces, transmission error and contact loss; for gear trains they
    have the dimension ``mesh`` if they differ between the meshes.
    """
    force_scale, static_deflection = float(run.force_scale), float(run.static_deflection)
    error = transmission_error(run)
    # Fraction of time without drive-side contact: without contact, or with coast-side contact.
    contact_loss_fraction = run.fraction_backlash + run.fraction_inverse
    # Without a profile deviation the exact extrema of the run are used, else those of the samples.
    if np.array_equal(error, run.displacement.values):
        peak_to_peak = run.displacement_max.values - run.displacement_min.values
    else:
        peak_to_peak = np.ptp(error, axis=0)
    dims = run.displacement.dims[1:]
    # Forces of a single pair are relative to its static force, and so are dynamic factors.
    factor = run.dynamic_factor if "dynamic_factor" in run else run.dynamic_force_max
    return {
        "speed": run.speed.values,
        "tuning": run.tuning.values,
        "mesh_frequency_hertz": float(run.mesh_frequency) / math.tau,
        "resonance_speed": model.speed(1.0),
        "static_force": (dims, model.mean_forces * force_scale) if dims else force_scale,
        "dynamic_factor": (dims, factor.values),
        "mesh_force_max": (dims, force_scale * run.dynamic_force_max.values),
        "mesh_force_min": (dims, force_scale * run.dynamic_force_min.values),
        "error_peak_to_peak": (dims, static_deflection * peak_to_peak),
        "error_rms": (dims, static_deflection * error.std(axis=0)),
        "lost_share": (dims, contact_loss_fraction.values),
    }
