"""`duty_point`: what two gears or a train do at one torque and speed, in units of machines.

A motion is followed until it repeats, as long again, and recorded over one orbit. A motion that
does not repeat is recorded over whole revolutions of the gear whose teeth count.
"""

import math
from typing import Any

import numpy as np

from gearlib import checks
from gearlib.analysis.order_spectrum import orders, transmission_error
from gearlib.data.result import result
from gearlib.models.geometry.iso_dynamic_factor import dynamic_factor
from gearlib.models.load_sharing_pair import LoadSharingPair, tooth_pairs_of
from gearlib.models.model import is_model
from gearlib.runs.run_arguments import check_speed
from gearlib.runs.simulation import simulate

#: Mesh periods that are run first; each further run is as long as all before it.
_FIRST_PERIODS = 4
#: Longest motion that is followed, in mesh periods, and of pairs of teeth in steps: half a second.
_MAX_PERIODS, _MAX_STEPS = 10_000, 400_000
#: Revolutions that are recorded of a motion that does not repeat, and most mesh periods of these.
_REVOLUTIONS, _MAX_RECORD = 10, 2000
#: Tuning below which pairs of teeth move as they do at it: inertia adds less than 1 % to the load.
SLOWEST_TUNING = 5e-4


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
        Of the pinion, N m; of drawn gears only, which need it.
    initial_state : tuple of float
        As of `gearlib.simulate`.
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
        quality; mesh_order_force and mesh_order_error, amplitudes of the first mesh orders. Over
        ``mesh`` of trains.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range; or if the motion grows without bound.
    """
    data: dict[str, Any] = {}
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
        model = tooth_pairs_of(gears, torque=torque, **options)
        if all(gear.quality is not None for gear in (gears.pinion, gears.wheel)):
            # The smaller relief is what counts at both ends of the path.
            relieved = [gear.tip_relief for gear in (gears.pinion, gears.wheel)]
            amount = min(one.amount if one else 0.0 for one in relieved)
            checks.finite_positive("speed", speed)
            data["iso_dynamic_factor"] = dynamic_factor(
                gears, torque, speed, tip_relief=amount
            ).factor
        data["torque"] = float(torque)
    if model.speed is None:
        raise ValueError(f"gears = {model!r} is not allowed: nothing turns in this model")
    tuning = check_speed(model, "speed", speed)
    slow = isinstance(model, LoadSharingPair) and tuning < SLOWEST_TUNING
    data |= of_run(settled_run(model, SLOWEST_TUNING if slow else tuning, initial_state), model)
    if slow:
        hertz = data["mesh_frequency_hertz"] * tuning / SLOWEST_TUNING
        data |= {"tuning": tuning, "speed": float(speed), "mesh_frequency_hertz": hertz}
    coords = {name: values for name, values in model.coordinates().items() if name == "mesh"}
    coords |= data.pop("coords")
    return result(
        "Duty point of a gear mesh", model, data, coords, method="settled run", speed=float(speed)
    )


def settled_run(model, tuning, initial_state=(0.0, 0.0)):
    """Return a run of `simulate` over one orbit, or over whole revolutions if there is none."""
    limit, state, length, run = _most_periods(model, tuning), initial_state, 0, None
    step = model.repeats * math.ceil(_FIRST_PERIODS / model.repeats)
    while run is None or not int(run.period) and length + step <= limit:
        run = _checked_run(model, tuning, step, state, samples_per_period=8)
        state, length = tuple(run.final_state.values), length + step
        step = length
    orbit, teeth = int(run.period), round(model.periods_per_revolution)
    record = orbit or teeth * max(1, min(_REVOLUTIONS, min(limit, _MAX_RECORD) // teeth))
    # As long again, so that what is recorded has settled to rounding.
    periods = record + (length if orbit else 0)
    return _checked_run(
        model, tuning, periods, state, record_periods=record, samples_per_period=128
    )


def _most_periods(model, tuning: float) -> int:
    """Return how many mesh periods a motion is followed at most."""
    if not isinstance(model, LoadSharingPair):
        return _MAX_PERIODS
    system = model.system(tuning)
    steps = max(len(system.force) / model.repeats, math.tau / system.longest)
    return min(_MAX_PERIODS, int(_MAX_STEPS / steps))


def _checked_run(model, tuning, periods, state, **options):
    run = simulate(model, tuning, periods=periods, initial_state=state, **options)
    if int(run.status):
        raise ValueError(f"the motion at tuning {tuning:.6g}: {run.status.attrs['message']}")
    return run


def of_run(run, model):
    """Return `in_units` of a run over whole revolutions, its first mesh orders, coordinates."""
    spectrum = orders(run)
    # Multiples of the mesh frequency; the others come of errors that turn with a shaft.
    first = spectrum.isel(order=(spectrum.mesh_order % 1 == 0) & (spectrum.mesh_order > 0))
    over = ("mesh_order", *run.displacement.dims[1:])
    data = in_units(run, model)
    data |= {"settled": np.int8(int(run.period) > 0), "period": run.period.values}
    coords = {"mesh_order": first.mesh_order.values}
    names, bearings = bearing_forces(run, model)
    if names is None:
        data["bearing_force_max"] = bearings
    else:
        dim = "body" if over[1:] else "bearing"
        data["bearing_force_max"], coords[dim] = (dim, bearings), names
    data["mesh_order_force"] = over, first.force_amplitude.values
    data["mesh_order_error"] = over, first.error_amplitude.values
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
        found = [np.hypot(run[f"bearing_force_y{i}"], run[f"bearing_force_z{i}"]) for i in (3, 2)]
        return names, [force * float(one.max()) for one in found]
    if "body_motion" not in run:
        return None, force * float(run.dynamic_force_max)
    stiffness = np.array([body.support_stiffness for body in model.bodies])
    motion = run.body_motion.values[:, :, :2]
    with np.errstate(invalid="ignore"):
        pushed = np.where(np.isfinite(stiffness), stiffness * length * motion, math.nan)
    return list(model.body_names), np.hypot(*np.moveaxis(pushed, -1, 0)).max(axis=0)
