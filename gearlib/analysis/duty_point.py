"""`duty_point`: forces, vibration and contact of gears at one torque and speed, in SI units.

The simulation starts from static equilibrium and continues until the motion repeats, then for the
same time again. After that, one period of the orbit is recorded. If the same teeth meet again only
after many mesh periods, the whole cycle is recorded after the transient has decayed, or a sample of
it if it takes too long to compute. Other motions are recorded over whole revolutions of the gear.
"""

import math
from fractions import Fraction
from typing import Any

import numpy as np
import xarray as xr

from gearlib import checks
from gearlib.analysis.order_maps import mesh_order_amplitudes, recorded_periods, transmission_error
from gearlib.data.motions import largest_force
from gearlib.data.result import make_result
from gearlib.models.geometry import iso
from gearlib.models.geometry.gear_stage import GearStage, resolve_torque
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
#: Ratio of the amplitude of the slowest mode at the start of the record to its initial amplitude.
_TRANSIENT_DECAY = 1e-4
#: Number of revolutions recorded if the motion does not repeat, and their limit in mesh periods.
_RECORD_REVOLUTIONS, _MAX_RECORD_PERIODS = 10, 2000
#: Samples per mesh period, largest number of samples in a record, and smallest number per period in
#: a long record; six mesh orders need 24.
_SAMPLES_PER_PERIOD, _MAX_SAMPLES, _MIN_SAMPLES_PER_PERIOD = 128, 2**17, 24


@checked
def duty_point(
    gears, speed: Speed, *, torque: DrivingTorque | None = None, initial_state=None, **options
):
    """Compute the dynamic factor, forces and transmission error of gears at one torque and speed.

    Parameters
    ----------
    gears : gearlib.geometry.GearStage or model
        Geometry of two gears, which is modelled as a `LoadSharingPair`, or a model of rotating
        gears for `gearlib.simulate`. If the stiffness is rectangular, as in a `GearPair`, the force
        jumps when a tooth pair enters the mesh, so that its maximum does not correspond to K_v.
    speed : float
        Speed in rpm, finite, > 0, of the pinion or, for a model, of the gear that sets its mesh
        frequency.
    torque : float, optional
        Torque of the pinion in N m. Required for a `GearStage` unless `power` in W is given; not
        allowed for a model.
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
        degrees of freedom, ``body`` for trains; the sum over the rigid bearings of a shaft),
        error_peak_to_peak and error_rms (m, without the mean), contact_loss_fraction (fraction of
        time in which no flank touches), settled and period; iso_dynamic_factor if both gears of a
        `GearStage` have a quality and eps_alpha >= 1; mesh_order_force and mesh_order_error,
        amplitudes of the first mesh orders, NaN if there are too few samples. Trains have the
        dimension ``mesh``. transient_periods and record_periods are the numbers of mesh periods
        before and in the record, and the attribute ``comment`` describes the record: an orbit, or a
        whole cycle of the excitation or a sample of it. The dynamic factor is the ratio of the
        largest mesh force to the static force, in absolute values. For models with a given
        stiffness this ratio is named peak_force_ratio, because their forces may jump when teeth
        enter the mesh.

    Raises
    ------
    ValueError
        If an argument is invalid, or if the motion grows without bound.
    """
    data: dict[str, Any] = {}
    # Period of the excitation in mesh periods if it is too long to compute, else 0.
    long_cycle_periods = 0
    if is_model(gears):
        geometry_arguments = options if torque is None else {"torque": torque}
        if geometry_arguments:
            name, value = next(iter(geometry_arguments.items()))
            raise ValueError(
                f"{name} = {value!r} is not allowed for a model, which has its own value; it is "
                "only allowed for gears given by geometry"
            )
        model = gears
    else:
        checks.check_gear_stage(gears, "gears", " or a model")
        torque = resolve_torque(torque, options.pop("power", None), speed)
        model = default_load_sharing_pair(gears, torque=torque, **options)
        # Each mesh period has a stiffness table for each subset of the tooth pairs in mesh.
        max_periods = _MAX_TABLES // 2 ** math.ceil(gears.total_contact_ratio)
        if model.repeats > max_periods:
            long_cycle_periods = model.repeats
            pitch_errors = _select_pitch_errors(np.array(model.pitch_errors), max_periods)
            model = model.replace(pitch_errors=tuple(pitch_errors.tolist()))
        dynamic_factor = iso_dynamic_factor(gears, torque, speed)
        if dynamic_factor is not None:
            data["iso_dynamic_factor"] = dynamic_factor
        data["torque"] = float(torque)
    if model.speed is None:
        raise ValueError(f"gears = {model!r} is not allowed: this model has no rotating bodies")
    tuning = tuning_at_speed(model, "speed", speed)
    slowest_tuning = model.slowest_tuning
    run, transient_periods, comment = simulate_until_settled(
        model, max(tuning, slowest_tuning), initial_state
    )
    variables, coords = duty_point_variables(run, model)
    data |= variables
    data |= {
        "transient_periods": np.int32(transient_periods),
        "record_periods": np.int32(recorded_periods(run)),
    }
    if long_cycle_periods:
        data["settled"] = np.int8(0)
        comment = (
            f"a sample of {model.repeats} mesh periods about the largest step of the pitch errors; "
            f"the same teeth meet again after {long_cycle_periods}, too many to compute"
        )
    if tuning < slowest_tuning:
        # The simulation was run at the slowest tuning that the model allows.
        mesh_frequency = data["mesh_frequency_hertz"] * tuning / slowest_tuning
        data |= {"tuning": tuning, "mesh_frequency_hertz": mesh_frequency}
    data["speed"] = float(speed)
    model_coords = model.coordinates()
    if "mesh" in model_coords:
        coords = {"mesh": model_coords["mesh"]} | coords
    attributes = {"method": "settled run", "speed": float(speed)}
    dataset = make_result("Duty point of a gear mesh", model, data, coords, **attributes)
    dataset["record_periods"].attrs["long_name"] = f"mesh periods of the record, {comment}"
    return dataset.assign_attrs(comment=f"The record is {comment}.")


def iso_dynamic_factor(stage: GearStage, torque: float, speed: Any) -> Any:
    """Return the dynamic factor K_v of ISO 6336-1, method B, or None if it is not defined.

    `torque` is the torque of the pinion in N m, and `speed` is its speed in rpm. If `speed` is an
    array, an array of factors is returned. K_v is defined only if both gears of the `stage` have a
    quality (flank tolerance class) and the contact ratio is at least 1.
    """
    gears = stage.pinion, stage.wheel
    if any(gear.quality is None for gear in gears) or stage.contact_ratio < 1.0:
        return None
    # ISO 6336 uses the smaller of the two tip reliefs.
    tip_relief = min(gear.tip_relief.amount if gear.tip_relief else 0.0 for gear in gears)
    return iso.dynamic_factor(stage, torque, speed, tip_relief=tip_relief).factor


def _select_pitch_errors(pitch_errors: np.ndarray, count: int) -> np.ndarray:
    """Select `count` consecutive pitch errors centred on the largest step between two of them.

    `pitch_errors`, shape (n,) with n >= `count`, are the errors of all tooth pairs in the order in
    which they mesh. They are periodic, because the same teeth meet again after n mesh periods.
    """
    error_steps = np.diff(pitch_errors, append=pitch_errors[0])
    # The selection contains the largest step, because it excites the mesh most.
    largest_step_index = int(np.abs(error_steps).argmax())
    return np.roll(pitch_errors, count // 2 - largest_step_index)[:count]


def simulate_until_settled(model: Any, tuning: float, initial_state: Any = None) -> tuple:
    """Simulate a model until its motion has settled, and record the settled motion.

    Return (run, transient periods, comment): the dataset of `simulate` that contains the record,
    the number of mesh periods before the record, and a phrase that describes the record. The
    simulation starts from `initial_state`, or from static equilibrium if that is None, and its
    length is doubled until the motion repeats or `_MAX_PERIODS` or `_MAX_STEPS` is reached. If the
    motion repeats, one period of the orbit is recorded. Otherwise a whole cycle of the excitation
    or whole revolutions are recorded, after the slowest mode of the system with all teeth in
    contact has decayed to `_TRANSIENT_DECAY`.
    """
    excitation_periods = model.repeats  # mesh periods after which the excitation repeats
    steps_per_period = model.steps_per_period(tuning)
    max_periods = min(_MAX_PERIODS, int(_MAX_STEPS / steps_per_period))
    state = model.static_state(tuning) if initial_state is None else initial_state
    simulated_periods, orbit_periods = 0, 0
    new_periods = 2 * excitation_periods
    while not orbit_periods and simulated_periods + new_periods <= max_periods:
        run = _simulate_or_raise(model, tuning, new_periods, state, samples_per_period=8)
        state, orbit_periods = tuple(run.final_state.values), int(run.period)
        simulated_periods += new_periods
        new_periods = simulated_periods
    if orbit_periods:
        # An additional transient lets the motion settle to rounding error before the record.
        record_periods = orbit_periods
        transient_periods = simulated_periods if excitation_periods == 1 else excitation_periods
        plural = "s" if orbit_periods > 1 else ""
        comment = f"one period of the orbit, {orbit_periods} mesh period{plural}"
    else:
        decay_periods = math.ceil(min(_decay_periods(model, tuning), 1e9))
        max_cycle_periods = min(_MAX_CYCLE_PERIODS, int(_MAX_CYCLE_STEPS / steps_per_period))
        # In a planetary train with a rotating carrier, the number of mesh periods per revolution
        # may be a fraction; the denominator is the number of revolutions with whole mesh periods.
        ratio = Fraction(model.periods_per_revolution).limit_denominator(10_000)
        max_record_periods = min(max_periods, _MAX_RECORD_PERIODS)

        multiples = min(
            _RECORD_REVOLUTIONS // ratio.denominator, max_record_periods // ratio.numerator
        )
        record_periods = ratio.numerator * max(1, multiples)
        comment = f"{record_periods} mesh periods, whole revolutions"
        if excitation_periods > max_cycle_periods:
            comment = (
                f"a sample of {record_periods} mesh periods; the excitation repeats after "
                f"{excitation_periods}, too many to compute"
            )
        elif simulated_periods <= 2 * excitation_periods:
            # Two cycles may be too few to detect that the motion repeats.
            record_periods = excitation_periods
            comment = f"a whole cycle of the excitation, {excitation_periods} mesh periods"
        # The periods that were already simulated are part of the transient.
        transient_periods = min(max(decay_periods - simulated_periods, 0), max_cycle_periods)
        skipped_periods = simulated_periods + transient_periods
        if skipped_periods < decay_periods:
            decay = _TRANSIENT_DECAY ** (skipped_periods / decay_periods)
            comment += (
                f", after a transient limited to {skipped_periods} mesh periods, in which the "
                f"slowest mode has decayed to {decay:.2g} of its initial amplitude"
            )
        if record_periods == excitation_periods:
            # A longer transient and a second cycle show more accurately whether the motion repeats.
            transient_periods = min(2 * transient_periods, max_cycle_periods) + excitation_periods
    samples = max(min(_SAMPLES_PER_PERIOD, _MAX_SAMPLES // record_periods), _MIN_SAMPLES_PER_PERIOD)
    options = {"record_periods": record_periods, "samples_per_period": samples}
    run = _simulate_or_raise(model, tuning, transient_periods + record_periods, state, **options)
    if not int(run.period):
        comment += "; the motion has not settled"
    return run, simulated_periods + transient_periods, comment


def _decay_periods(model: Any, tuning: float) -> float:
    """Return the number of mesh periods in which the slowest mode decays to 1e-4.

    `tuning` is the ratio of mesh frequency to natural frequency. The modes are those of the linear
    system in which all meshes stay in contact. The result is infinite if the mode does not decay.
    The limit, 1e-4 of the initial amplitude, is `_TRANSIENT_DECAY`.
    """
    if model.train is None:
        # A model with one degree of freedom.
        damping_ratio = model.damping_ratio
        # This is the slowest decay rate per radian of the mesh phase tau of
        # x'' + 2 damping_ratio / tuning x' + x / tuning^2 = 0.
        discriminant = max(damping_ratio * damping_ratio - 1.0, 0.0)
        rate = (damping_ratio - math.sqrt(discriminant)) / tuning
    else:
        rate = contact_decay_rate(model, tuning)
    if rate > 1e-12:
        return -math.log(_TRANSIENT_DECAY) / (math.tau * rate)
    return math.inf  # A slower decay cannot be distinguished from rounding errors.


def _simulate_or_raise(
    model: Any, tuning: float, periods: int, state: tuple, **options
) -> xr.Dataset:
    """Simulate a model over a number of mesh periods; raise ValueError if the simulation fails.

    `tuning` is the ratio of mesh frequency to natural frequency, `state` the initial state of the
    model, and `options` are further arguments of `simulate`. Return the dataset of `simulate`.
    """
    run = simulate(model, tuning, periods=periods, initial_state=state, **options)
    if int(run.status):
        message = run.status.attrs["message"]
        raise ValueError(f"the simulation at tuning {tuning:.6g} failed: {message}")
    return run


def duty_point_variables(run: xr.Dataset, model: Any) -> tuple:
    """Return the variables and coordinates that `duty_point` derives from a run of `simulate`.

    Both are dictionaries by name. A variable is given as values or (dimensions, values) in SI
    units. The variables describe speeds, mesh and bearing forces, and the transmission error.
    """
    mesh_orders, order_forces, order_errors = mesh_order_amplitudes(run)
    dims = ("mesh_order", *run.displacement.dims[1:])  # "mesh" is a dimension of trains only
    data = si_variables(run, model)
    data |= {"settled": np.int8(int(run.period) > 0), "period": run.period.values}
    coords: dict[str, Any] = {"mesh_order": mesh_orders}
    force_scale, static_deflection = float(run.force_scale), float(run.static_deflection)
    if "bearing_force_y3" in run:
        # In the model with six degrees of freedom, gear 3 is the pinion, as in the paper.
        max_forces = []
        for i in (3, 2):
            forces = np.hypot(run[f"bearing_force_y{i}"], run[f"bearing_force_z{i}"])
            max_forces.append(force_scale * float(forces.max()))
        data["bearing_force_max"] = "bearing", max_forces
        coords["bearing"] = ["gear 3", "gear 2"]
    elif "body_motion" in run:
        # Models with several coordinates, such as trains.
        max_forces = [
            static_deflection * _normalised_bearing_forces(run, body).max() for body in model.bodies
        ]
        dim = "body" if len(dims) > 1 else "bearing"
        data["bearing_force_max"] = dim, max_forces
        coords[dim] = list(model.body_names)
    else:
        # With rigid bearings each shaft carries the mesh force.
        data["bearing_force_max"] = force_scale * float(largest_force(run))
    data["mesh_order_force"] = dims, order_forces
    data["mesh_order_error"] = dims, order_errors
    return data, coords


def _normalised_bearing_forces(run: xr.Dataset, body: Any) -> np.ndarray:
    """Return the bearing force on a body, divided by the static deflection, at each sample.

    `run` is a dataset of `simulate`, in which body motions are in units of the static deflection.
    The result is in N/m. It is NaN for a rigid bearing, whose force does not follow from its
    deflection.
    """
    # The body has two displacements and a rotation, which the bearing does not resist.
    x, y, _ = run.body_motion.sel(body=body.name).values.T
    if body.carrier:
        # The bearing of a planet sits on a pin of the carrier and has radial and tangential
        # stiffness. The rotation of the carrier is given as the tangential displacement of the pin.
        carrier_x, carrier_y, rotation = run.body_motion.sel(body=body.carrier).values.T
        cosine, sine = math.cos(body.angle), math.sin(body.angle)
        x, y = x - carrier_x, y - carrier_y
        x, y = cosine * x + sine * y, cosine * y - sine * x - rotation
    stiffness_x, stiffness_y = np.where(
        np.isfinite(body.support_stiffness), body.support_stiffness, math.nan
    )
    return np.hypot(stiffness_x * x, stiffness_y * y)


def si_variables(run: xr.Dataset, model: Any) -> dict:
    """Return the speeds, mesh forces and transmission errors of a run in N, m, Hz and rpm.

    `run` is a dataset of `simulate`, and `model` is the simulated model. The result is a dictionary
    by variable name of values or (dimensions, values). Variables that differ between the meshes of
    a gear train have the dimension ``mesh``.
    """
    force_scale, static_deflection = float(run.force_scale), float(run.static_deflection)
    # The error is in units of the static deflection, shape (samples,) or (samples, meshes).
    error = transmission_error(run)
    # Without profile deviation the transmission error is the displacement, whose extrema are known
    # exactly; otherwise the extrema of the samples are used.
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
