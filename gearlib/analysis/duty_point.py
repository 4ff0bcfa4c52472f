"""`duty_point`: forces, vibration and contact of gears at one torque and speed, in SI units.

A motion starts from static equilibrium. It is simulated until it repeats, then for the same time
again, and recorded over one period of its orbit. If the same teeth meet again only after many mesh
periods, the record is that whole cycle, after the start has decayed; a cycle that takes too long is
sampled. Other motions are recorded over whole revolutions of the gear.
"""

import math
from fractions import Fraction
from typing import Any

import numpy as np
import xarray as xr

from gearlib import checks
from gearlib.analysis.order_maps import mesh_order_amplitudes, recorded_periods, transmission_error
from gearlib.data.motions import largest_force
from gearlib.data.result import result
from gearlib.models.geometry import iso
from gearlib.models.geometry.gear_stage import GearStage, torque_of
from gearlib.models.load_sharing_pair import default_load_sharing_pair
from gearlib.models.model import is_model
from gearlib.models.single_mesh_system import contact_decay_rate
from gearlib.parameters import DrivingTorque, Speed, checked
from gearlib.runs.run_arguments import tuning_at_speed
from gearlib.runs.simulation import simulate

#: Longest search for an orbit, in mesh periods and in integration steps (about 0.2 s of computing).
_MAX_PERIODS, _MAX_STEPS = 10_000, 150_000
#: Longest cycle of the excitation that is recorded as a whole, with a transient of the same length
#: (at most 2 s of computing).
_MAX_CYCLE_PERIODS, _MAX_CYCLE_STEPS = 10_000, 500_000
#: Largest number of stiffness tables, one for each mesh period and combination of tooth pairs.
_MAX_TABLES = 8000
#: Factor by which the slowest mode has decayed before the record.
_DECAY = 1e-4
#: Length of the record of a motion that does not repeat, and its limit in mesh periods.
_RECORD_REVOLUTIONS, _MAX_RECORD_PERIODS = 10, 2000
#: Samples of a mesh period, fewer in long records; six mesh orders need 24.
_SAMPLES_PER_PERIOD, _MAX_SAMPLES, _MIN_SAMPLES_PER_PERIOD = 128, 2**17, 24


@checked
def duty_point(
    gears, speed: Speed, *, torque: DrivingTorque | None = None, initial_state=None, **options
):
    """Compute dynamic factor, forces and transmission error of gears at one torque and speed.

    Parameters
    ----------
    gears : gearlib.geometry.GearStage or model
        Geometry of two gears, which is modelled as a `LoadSharingPair`, or a model of rotating
        gears for `gearlib.simulate`. With a rectangular stiffness, such as that of a `GearPair`,
        the force jumps when a pair of teeth enters the mesh, so its maximum is not a K_v.
    speed : float
        Speed in rpm, finite, > 0, of the pinion (of the gear that sets the mesh frequency).
    torque : float, optional
        Torque of the pinion in N m. Give it, or `power` in W, with a `GearStage` only.
    initial_state : tuple of float, optional
        State at phase 0, as in `gearlib.simulate`; by default the static equilibrium.
    **options
        With a `GearStage`: damping_ratio and other arguments of `gearlib.GearPair.from_geometry`.
        The tooth pair stiffness is "energy" by default, or "iso" if a bore is too large for the
        energy method; options of the energy method are coupling and twist.

    Returns
    -------
    xarray.Dataset
        mesh_frequency_hertz, tuning, speed, resonance_speed, torque, static_force, dynamic_factor,
        mesh_force_max and mesh_force_min (N), bearing_force_max (N, over ``bearing`` for six
        degrees of freedom, ``body`` for trains; rigid bearings of a shaft are added up),
        error_peak_to_peak and error_rms (m, without the mean), contact_loss_fraction (fraction of
        time in which no flank touches), settled and period; iso_dynamic_factor if both gears of a
        `GearStage` have a quality and eps_alpha >= 1; mesh_order_force and mesh_order_error,
        amplitudes of the first mesh orders, NaN if there are too few samples. Trains have the
        dimension ``mesh``. transient_periods and record_periods are the mesh periods before and in
        the record, and the attribute ``comment`` says what the record is: an orbit, a whole cycle
        of the excitation, or a sample. The dynamic factor is the largest mesh force over the static
        force, both without signs. Models with a given stiffness have the same ratio as
        peak_force_ratio, since their forces may jump where teeth enter.

    Raises
    ------
    ValueError
        If an argument is wrong, or if the motion grows without bound.
    """
    data: dict[str, Any] = {}
    cycle_periods = 0
    if is_model(gears):
        if torque is not None or options:
            name = "torque" if torque is not None else next(iter(options))
            raise ValueError(
                f"{name} = {torque if name == 'torque' else options[name]!r} is not allowed: a "
                "model has its own, only gears given by geometry take it"
            )
        model = gears
    else:
        checks.gear_stage(gears, "gears", " or a model")
        torque = torque_of(torque, options.pop("power", None), speed)
        model = default_load_sharing_pair(gears, torque=torque, **options)
        # Each mesh period has a stiffness table for each subset of the tooth pairs in mesh.
        max_periods = _MAX_TABLES // 2 ** math.ceil(gears.total_contact_ratio)
        if model.repeats > max_periods:
            cycle_periods = model.repeats
            errors = _worst_stretch(np.array(model.pitch_errors), max_periods)
            model = model.replace(pitch_errors=tuple(errors.tolist()))
        factor = iso_dynamic_factor(gears, torque, speed)
        if factor is not None:
            data["iso_dynamic_factor"] = factor
        data["torque"] = float(torque)
    if model.speed is None:
        raise ValueError(f"gears = {model!r} is not allowed: nothing turns in this model")
    tuning = tuning_at_speed(model, "speed", speed)
    slowest_tuning = model.slowest_tuning
    run, transient_periods, comment = settled_run(model, max(tuning, slowest_tuning), initial_state)
    variables, coords = variables_of_run(run, model)
    data |= variables
    data |= {
        "transient_periods": np.int32(transient_periods),
        "record_periods": np.int32(recorded_periods(run)),
    }
    if cycle_periods:
        data["settled"] = np.int8(0)
        comment = (
            f"a sample of {model.repeats} mesh periods about the largest step of the pitch errors; "
            f"the same teeth meet again after {cycle_periods}, too many to compute"
        )
    if tuning < slowest_tuning:
        hertz = data["mesh_frequency_hertz"] * tuning / slowest_tuning
        data |= {"tuning": tuning, "mesh_frequency_hertz": hertz}
    data["speed"] = float(speed)
    meshes = {name: values for name, values in model.coordinates().items() if name == "mesh"}
    options = {"method": "settled run", "speed": float(speed)}
    dataset = result("Duty point of a gear mesh", model, data, meshes | coords, **options)
    dataset["record_periods"].attrs["long_name"] = f"mesh periods of the record, {comment}"
    return dataset.assign_attrs(comment=f"The record is {comment}.")


def iso_dynamic_factor(mesh: GearStage, torque: float, speed: Any) -> Any:
    """Return K_v of ISO 6336-1, method B, at a torque in N m and speeds in rpm of the pinion.

    It is None if a gear has no quality or eps_alpha < 1.
    """
    gears = mesh.pinion, mesh.wheel
    if any(gear.quality is None for gear in gears) or mesh.contact_ratio < 1.0:
        return None
    # ISO 6336 takes the smaller tip relief of the two gears.
    tip_relief = min(gear.tip_relief.amount if gear.tip_relief else 0.0 for gear in gears)
    return iso.dynamic_factor(mesh, torque, speed, tip_relief=tip_relief).factor


def _worst_stretch(pitch_errors: np.ndarray, count: int) -> np.ndarray:
    """Return `count` successive pitch errors of a cycle about its largest change between two."""
    largest_step = int(np.abs(np.diff(pitch_errors, append=pitch_errors[0])).argmax())
    return np.roll(pitch_errors, count // 2 - largest_step)[:count]


def settled_run(model: Any, tuning: float, initial_state: Any = None) -> tuple:
    """Return (a run of `simulate` that records settled motion, mesh periods before, what it is).

    The length of the run is doubled until the motion repeats, within `_MAX_PERIODS` and
    `_MAX_STEPS`; then its record is one period of the orbit. Otherwise it is a whole cycle of the
    excitation, or whole revolutions, after the slowest mode of contact has decayed to `_DECAY`.
    """
    cycle = model.repeats  # mesh periods after which the excitation repeats
    steps = model.steps_per_period(tuning)
    max_periods = min(_MAX_PERIODS, int(_MAX_STEPS / steps))
    state = model.static_state(tuning) if initial_state is None else initial_state
    simulated_periods, orbit_periods, new_periods = 0, 0, 2 * cycle
    while not orbit_periods and simulated_periods + new_periods <= max_periods:
        run = _checked_run(model, tuning, new_periods, state, samples_per_period=8)
        state, orbit_periods = tuple(run.final_state.values), int(run.period)
        simulated_periods += new_periods
        new_periods = simulated_periods
    if orbit_periods:
        # A further transient lets the motion settle to rounding error before the record.
        record_periods = orbit_periods
        transient_periods = simulated_periods if cycle == 1 else cycle
        plural = "s" if orbit_periods > 1 else ""
        comment = f"one period of the orbit, {orbit_periods} mesh period{plural}"
    else:
        decay_periods = math.ceil(min(_decay_periods(model, tuning), 1e9))
        max_cycle = min(_MAX_CYCLE_PERIODS, int(_MAX_CYCLE_STEPS / steps))
        # In a turning planetary train several revolutions have a whole number of mesh periods.
        ratio = Fraction(model.periods_per_revolution).limit_denominator(10_000)
        max_record = min(max_periods, _MAX_RECORD_PERIODS)
        revolutions = max(
            1, min(_RECORD_REVOLUTIONS // ratio.denominator, max_record // ratio.numerator)
        )
        record_periods = ratio.numerator * revolutions
        comment = f"{record_periods} mesh periods, whole revolutions"
        if cycle > max_cycle:
            comment = (
                f"a sample of {record_periods} mesh periods; the excitation repeats after {cycle}, "
                "too many to compute"
            )
        elif simulated_periods <= 2 * cycle:
            # Two cycles may be too few to see whether the motion repeats.
            record_periods = cycle
            comment = f"a whole cycle of the excitation, {cycle} mesh periods"
        # The periods that were already simulated are part of the transient.
        transient_periods = min(max(decay_periods - simulated_periods, 0), max_cycle)
        left_out = simulated_periods + transient_periods
        if left_out < decay_periods:
            reached = _DECAY ** (left_out / decay_periods)
            comment += (
                f", after a transient limited to {left_out} mesh periods, in which the slowest "
                f"mode has decayed to {reached:.2g} of its start"
            )
        if record_periods == cycle:
            # Whether it repeats is seen after another cycle, to more digits.
            transient_periods = min(2 * transient_periods, max_cycle) + cycle
    samples = max(min(_SAMPLES_PER_PERIOD, _MAX_SAMPLES // record_periods), _MIN_SAMPLES_PER_PERIOD)
    options = {"record_periods": record_periods, "samples_per_period": samples}
    run = _checked_run(model, tuning, transient_periods + record_periods, state, **options)
    if not int(run.period):
        comment += "; the motion has not settled"
    return run, simulated_periods + transient_periods, comment


def _decay_periods(model: Any, tuning: float) -> float:
    """Return the mesh periods until the slowest mode of contact has decayed to `_DECAY`."""
    if model.train is None:
        ratio = model.damping_ratio
        # Rates of decay by phase of x'' + 2 ratio / tuning x' + x / tuning^2 = 0.
        rate = (ratio - math.sqrt(max(ratio * ratio - 1.0, 0.0))) / tuning
    else:
        rate = contact_decay_rate(model, tuning)
    # Growth and decay slower than rounding errors never end.
    return -math.log(_DECAY) / (math.tau * rate) if rate > 1e-12 else math.inf


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
        max_forces = [static_deflection * _support_forces(run, body).max() for body in model.bodies]
        dim = "body" if len(dims) > 1 else "bearing"
        data["bearing_force_max"], coords[dim] = (dim, max_forces), list(model.body_names)
    else:
        data["bearing_force_max"] = force_scale * float(largest_force(run))
    data |= {"mesh_order_force": (dims, order_forces), "mesh_order_error": (dims, order_errors)}
    return data, coords


def _support_forces(run: xr.Dataset, body: Any) -> np.ndarray:
    """Return the forces, without the moments, of the support of a body over static deflections.

    The forces of rigid supports are NaN: their deflection is zero and does not give the force.
    """
    x, y, _ = run.body_motion.sel(body=body.name).values.T
    if body.carrier:
        # The pin moves with the carrier, whose rotation is an arc through the pins.
        carrier_x, carrier_y, rotation = run.body_motion.sel(body=body.carrier).values.T
        cosine, sine = math.cos(body.angle), math.sin(body.angle)
        x, y = x - carrier_x, y - carrier_y
        x, y = cosine * x + sine * y, cosine * y - sine * x - rotation
    stiffness_x, stiffness_y = np.where(
        np.isfinite(body.support_stiffness), body.support_stiffness, math.nan
    )
    return np.hypot(stiffness_x * x, stiffness_y * y)


def si_variables(run: xr.Dataset, model: Any) -> dict:
    """Return {variable name: values} of a run of `simulate` in N, m, Hz and rpm.

    The variables are speeds, mesh forces, transmission error and contact loss; for gear trains they
    have the dimension ``mesh`` if they differ between the meshes.
    """
    force_scale, static_deflection = float(run.force_scale), float(run.static_deflection)
    error = transmission_error(run)
    # Without a profile deviation the exact extrema of the run are used, else those of the samples.
    if np.array_equal(error, run.displacement.values):
        peak_to_peak = run.displacement_max.values - run.displacement_min.values
    else:
        peak_to_peak = np.ptp(error, axis=0)
    dims = run.displacement.dims[1:]
    return {
        "speed": run.speed.values,
        "tuning": run.tuning.values,
        "mesh_frequency_hertz": float(run.mesh_frequency) / math.tau,
        "resonance_speed": model.speed(1.0),
        "static_force": (dims, model.mean_forces * force_scale),
        model.force_ratio_name: (dims, model.force_ratios(largest_force(run)).values),
        "mesh_force_max": (dims, force_scale * run.dynamic_force_max.values),
        "mesh_force_min": (dims, force_scale * run.dynamic_force_min.values),
        "error_peak_to_peak": (dims, static_deflection * peak_to_peak),
        "error_rms": (dims, static_deflection * error.std(axis=0)),
        "contact_loss_fraction": (dims, run.contact_loss_fraction.values),
    }
