"""Computation of the results of a configuration that the explorer draws."""

from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from gearlib import config
from gearlib.analysis.orbits.shooting import NoOrbit, periodic_orbit
from gearlib.analysis.order_maps import orders
from gearlib.data import motions
from gearlib.data.motions import mask_unbounded
from gearlib.models.load_sharing_pair import default_load_sharing_pair
from gearlib.models.pair import GearPair
from gearlib.runs.simulation import simulate
from gearlib.runs.sweeping import EXTENSION_RATIO, sweep, sweep_down

#: Mesh periods of the time history that is drawn, and samples of each.
SHOWN_PERIODS, SAMPLES = 3, 256
#: Points of a resonance curve; mesh periods of each, of which the last are evaluated.
_POINTS, _PERIODS, _RECORDED = 500, 70, 10
#: Mesh periods of the motion at the setting before its record, and the longest record of them.
_SETTLING_PERIODS, _MAX_RECORDED = 280, 100
#: Ends of the resonance curve of drawn gears, over the resonance speed.
MIN_SPEED_RATIO, MAX_SPEED_RATIO = 0.2, 2.2
#: Torques of the Harris map besides the given one, over it.
TORQUE_RATIOS = 0.0, 0.5, 1.5, 2.0
#: Phases of a mesh period; largest number of all phases with pitch errors, smallest of a period.
_PHASES, _MAX_PHASES, _MIN_PHASES = 256, 2048, 16
#: Phases of a mesh period of helical gears, whose face is divided into slices.
_HELICAL_PHASES = 64


class View(NamedTuple):
    """The results of one configuration at its speed or tuning."""

    pair: GearPair  #: with the rectangular stiffness of the resonance curve
    up: xr.Dataset  #: of a sweep up
    down: xr.Dataset  #: of a sweep down
    run: xr.Dataset  #: of `gearlib.simulate` at the tuning; of drawn gears with load sharing
    multipliers: np.ndarray  #: Floquet multipliers, empty if no orbit was found
    message: str  #: sentences about the motion
    orders: xr.Dataset | None  #: order spectrum, if the run did not fail
    mesh: Any = None  #: of drawn gears
    error: Any = None  #: `Mesh.transmission_error` of drawn gears at torques


def compute_view(mapping: dict, damping: str) -> View:
    """Return the results of a configuration with the named damping at its speed or first tuning.

    Raise ValueError if the gears are impossible.
    """
    settings = config.load(mapping)
    pair = GearPair(**settings.pair_parameters(damping))
    tuning = settings.phase_planes.tunings[0]
    if settings.gears is None:
        tunings = np.linspace(settings.resonance.start, settings.resonance.stop, _POINTS)
        return _compute_motions(pair, pair, tunings, tuning)
    gears = settings.gears
    mesh, torque = gears.mesh(), gears.driving_torque()
    ratios = {name: getattr(pair, name) for name in ("damping_ratio", "backlash_damping_ratio")}
    method = {"stiffness": gears.stiffness, "options": gears.stiffness_options}
    model = default_load_sharing_pair(mesh, torque=torque, **ratios, **method)
    resonance_speed, speed = pair.speed(1.0), float(pair.speed(tuning))
    min_speed = min(MIN_SPEED_RATIO * resonance_speed, speed)
    max_speed = max(MAX_SPEED_RATIO * resonance_speed, speed)
    tunings = pair.tuning_at(np.linspace(min_speed, max_speed, _POINTS))
    # The same teeth meet again after as many mesh periods as there are pitch errors.
    repeat_periods = len(mesh.pitch_errors)
    most_phases = _HELICAL_PHASES if mesh.overlap_ratio else _PHASES
    phases = max(_MIN_PHASES, min(most_phases, _MAX_PHASES // repeat_periods))
    torques = [*(ratio * torque for ratio in TORQUE_RATIOS), torque]
    options = {name: getattr(model, name) for name in ("stiffness", "coupling", "twist")}
    error = mesh.transmission_error(torques, phases=phases, **options)
    tuning = float(model.tuning_at(speed))
    view = _compute_motions(pair, model, tunings, tuning, repeat_periods)
    return view._replace(mesh=mesh, error=error)


def _compute_motions(pair, model, tunings: np.ndarray, tuning: float, repeat_periods: int = 1):
    """Return the `View` of the resonance curves of `pair` and the motion of `model` at a tuning.

    The model is `pair` itself, or has load sharing if the gears are drawn; its pitch errors repeat
    after `repeat_periods` mesh periods. `tunings` are those of the curves.
    """
    settings = {"periods": _PERIODS, "record_periods": _RECORDED, "threads": 1}

    def resonance_curve(direction):
        """Return (dataset of a sweep "up" or "down", False if it ends before the jump down)."""
        # Only the sweep of drawn gears is extended down to the jump.
        if model is not pair and direction == "down":
            curve, jumped = sweep_down(pair, tunings, EXTENSION_RATIO * tunings[0], **settings)
        else:
            curve, jumped = sweep(pair, tunings, direction=direction, **settings), True
        # Motions far beyond the larger of backlash and static deflection count as unbounded.
        return mask_unbounded(curve, pair.extent), jumped

    # The kernels release the interpreter lock.
    with ThreadPoolExecutor(2) as pool:
        (up, _), (down, jumped) = pool.map(resonance_curve, ("up", "down"))
    # The record spans a revolution, or with pitch errors the periods until the same teeth meet.
    recorded = max(round(model.periods_per_revolution), min(repeat_periods, _MAX_RECORDED))
    periods = {"periods": _SETTLING_PERIODS + recorded, "record_periods": recorded}
    run = simulate(model, tuning, **periods, samples_per_period=SAMPLES, until_settled=True)
    message = f"{motions.describe(run)} Followed for {periods['periods']} mesh periods, at each "
    message += f"speed of the characteristic for {_PERIODS}."
    if not jumped:
        message += f" Going down it has not jumped at {float(down.speed[0]):.0f} rpm, the lowest."
    multipliers = _floquet_multipliers(model, run)
    if multipliers.size:
        magnitudes = ", ".join(f"{abs(multiplier):.4g}" for multiplier in multipliers)
        message += f" Floquet multipliers in magnitude: {magnitudes}."
    spectrum = None if int(run.status) else orders(run)
    return View(pair, up, down, run, multipliers, message, spectrum)


def _floquet_multipliers(model, run: xr.Dataset) -> np.ndarray:
    """Return the Floquet multipliers of the orbit of a settled run, or an empty array."""
    if not int(run.period):
        return np.empty(0)
    try:
        guess, period = run.final_state.values, int(run.period)
        return periodic_orbit(model, float(run.tuning), guess=guess, period=period).multipliers
    except NoOrbit:
        return np.empty(0)
