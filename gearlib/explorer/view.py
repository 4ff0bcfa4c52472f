"""Compute the results that the explorer shows for a configuration."""

from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from gearlib import config
from gearlib.analysis.orbits.shooting import NoOrbit, periodic_orbit
from gearlib.analysis.order_maps import orders
from gearlib.data import motions
from gearlib.data.motions import describe_contact_loss, mask_unbounded
from gearlib.models.from_values import build_model
from gearlib.models.pair import GearPair
from gearlib.runs.simulation import simulate
from gearlib.runs.sweeping import sweep
from gearlib.studies.teeth_over_speed import SPEED_RANGE, sweep_speeds

#: Number of mesh periods in the time history, and number of samples per mesh period.
SHOWN_PERIODS, SAMPLES = 3, 256
#: Points of a resonance curve; mesh periods of each run, of which the last ones are evaluated.
_POINTS, _PERIODS, _RECORDED = 500, 70, 10
#: Number of speeds of the curves of gears given by geometry.
_SPEEDS = 301
#: Mesh periods of the run before its record, and largest number of recorded periods.
_SETTLING_PERIODS, _MAX_RECORDED = 280, 100
#: Limits of the resonance curve of gears given by geometry, relative to the resonance speed.
MIN_SPEED_RATIO, MAX_SPEED_RATIO = SPEED_RANGE
#: Torques of the Harris map relative to the chosen torque, which is also included.
TORQUE_RATIOS = 0.0, 0.5, 1.5, 2.0
#: Number of phases per mesh period; with pitch errors, largest total number of phases and smallest
#: number per mesh period.
_PHASES, _MAX_PHASES, _MIN_PHASES = 256, 2048, 16
#: Number of phases per mesh period for helical gears, whose face width is divided into slices.
_HELICAL_PHASES = 64


class View(NamedTuple):
    """Results for one configuration at its speed or tuning."""

    pair: GearPair  #: gear pair with a rectangular stiffness
    run: xr.Dataset  #: result of `gearlib.simulate` at the speed or tuning
    multipliers: np.ndarray  #: Floquet multipliers, empty if no orbit was found
    message: str  #: sentences about the motion
    orders: xr.Dataset | None  #: order spectrum, None if the run has failed
    sweep_up: Any = None  #: sweep with increasing tuning, without gear geometry
    sweep_down: Any = None  #: sweep with decreasing tuning, without gear geometry
    curves: Any = None  #: result of `sweep_speeds`, with gear geometry
    stage: Any = None  #: `GearStage`, with gear geometry
    harris_map: Any = None  #: transmission error at several torques, with gear geometry


def compute_view(mapping: dict, damping: str) -> View:
    """Compute the results that the explorer shows for a configuration at its first tuning.

    The tuning is the mesh frequency over the natural frequency. `mapping` is the content of the
    configuration file, and `damping` the name of one of its damping combinations. Raise ValueError
    if the gears are impossible.
    """
    configuration = config.load(mapping)
    pair = build_model(configuration.pair_description(damping))
    tuning = configuration.phase_planes.tunings[0]
    if configuration.gears is None:
        tunings = np.linspace(configuration.resonance.start, configuration.resonance.stop, _POINTS)

        def resonance_curve(direction):
            """Return the sweep of the gear pair in the given direction, "up" or "down"."""
            return _resonance_curve(pair, tunings, direction)

        # Threads run in parallel, because the kernels release the global interpreter lock.
        with ThreadPoolExecutor(2) as pool:
            up, down = pool.map(resonance_curve, ("up", "down"))
        return _simulate_view(pair, tuning)._replace(sweep_up=up, sweep_down=down)
    gears = configuration.gears
    stage, torque = gears.gear_stage(), gears.driving_torque()
    pairs_of_teeth = build_model(configuration.model_description(damping, pitch_errors=True))
    resonance_speed, speed = float(pairs_of_teeth.speed(1.0)), float(pair.speed(tuning))
    min_speed = min(MIN_SPEED_RATIO * resonance_speed, speed)
    max_speed = max(MAX_SPEED_RATIO * resonance_speed, speed)
    # A full cycle of pitch errors would take too long at each speed.
    without_errors = pairs_of_teeth.replace(pitch_errors=(0.0,))
    periods = {"periods": _PERIODS, "record_periods": _RECORDED}
    speeds = np.linspace(min_speed, max_speed, _SPEEDS)
    curves = sweep_speeds(without_errors, speeds, speed, **periods)
    # The same teeth meet again after as many mesh periods as there are pitch errors.
    repeat_periods = len(stage.pitch_errors)
    max_phases = _HELICAL_PHASES if stage.overlap_ratio else _PHASES
    phases = max(_MIN_PHASES, min(max_phases, _MAX_PHASES // repeat_periods))
    torques = [*(ratio * torque for ratio in TORQUE_RATIOS), torque]
    options = {name: getattr(pairs_of_teeth, name) for name in ("stiffness", "coupling", "twist")}
    harris_map = stage.transmission_error(torques, phases=phases, **options)
    view = _simulate_view(pairs_of_teeth, float(pairs_of_teeth.tuning_at(speed)), repeat_periods)
    message = f"{view.message} {describe_contact_loss(curves)}"
    jumps = zip(curves.jump_up_speed.values, curves.jump_down_speed.values, strict=True)
    for up, down in jumps:
        if up > down:  # Otherwise, the directions differ only at a single speed.
            message += f" They jump at {up:.0f} rpm (rising speed) and {down:.0f} rpm (falling)."
    if repeat_periods > 1:
        message += " The curves over the speed neglect the pitch errors."
    return view._replace(curves=curves, stage=stage, harris_map=harris_map, message=message)


def _resonance_curve(pair: GearPair, tunings: np.ndarray, direction: str) -> xr.Dataset:
    """Return a sweep of a gear pair over tunings, with NaN where the motion is unbounded.

    The tuning is the mesh frequency over the natural frequency; it increases if `direction` is "up"
    and decreases if it is "down".
    """
    run_options = {"periods": _PERIODS, "record_periods": _RECORDED, "threads": 1}
    curve = sweep(pair, tunings, direction=direction, **run_options)
    # Motions much larger than backlash and static deflection are considered unbounded.
    return mask_unbounded(curve, pair.extent)


def _simulate_view(model: Any, tuning: float, repeat_periods: int = 1) -> View:
    """Simulate a model at one tuning and return the `View` without curves over the speed.

    The tuning is the mesh frequency over the natural frequency. Models with tooth pairs start from
    static equilibrium, a plain gear pair starts from rest. Pitch errors repeat after
    `repeat_periods` mesh periods.
    """
    # The record spans a revolution or, with pitch errors, the periods until the same teeth meet.
    recorded = max(round(model.periods_per_revolution), min(repeat_periods, _MAX_RECORDED))
    periods = {"periods": _SETTLING_PERIODS + recorded, "record_periods": recorded}
    start, initial_state = "rest", (0.0, 0.0)
    # For a gear pair, `model.pair` is the model itself; a model with tooth pairs contains one.
    if model.pair is not model:
        start, initial_state = "static equilibrium", "static"
    run = simulate(
        model,
        tuning,
        **periods,
        initial_state=initial_state,
        samples_per_period=SAMPLES,
        until_settled=True,
    )
    message = f"{motions.describe_motion(run, start)} Simulated for {periods['periods']} mesh "
    message += f"periods, and for {_PERIODS} at each speed of the characteristic."
    multipliers = _floquet_multipliers(model, run)
    if multipliers.size:
        magnitudes = ", ".join(f"{abs(multiplier):.4g}" for multiplier in multipliers)
        message += f" Magnitudes of the Floquet multipliers: {magnitudes}."
    spectrum = None if int(run.status) else orders(run)
    return View(model.pair, run, multipliers, message, spectrum)


def _floquet_multipliers(model, run: xr.Dataset) -> np.ndarray:
    """Return the Floquet multipliers of the periodic orbit on which a run has settled.

    They are the factors by which small perturbations grow per period. Return an empty array if the
    run has not settled (period 0) or if no orbit is found.
    """
    if not int(run.period):
        return np.empty(0)
    try:
        guess, period = run.final_state.values, int(run.period)
        return periodic_orbit(model, float(run.tuning), guess=guess, period=period).multipliers
    except NoOrbit:
        return np.empty(0)
