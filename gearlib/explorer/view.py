"""From a configuration to the arrays that the explorer draws of it; no browser here."""

from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from gearlib import config
from gearlib.analysis.orbits.shooting import NoOrbit, periodic_orbit
from gearlib.analysis.order_maps import orders
from gearlib.data import motions
from gearlib.data.motions import without_growth
from gearlib.models.load_sharing_pair import default_load_sharing_pair
from gearlib.models.pair import GearPair
from gearlib.runs.simulation import simulate
from gearlib.runs.sweeping import EXTENSION_RATIO, sweep, sweep_down

#: Mesh periods of a time course that is drawn, and samples of each.
SHOWN, SAMPLES = 3, 256
#: Points of a characteristic; mesh periods of each, of which the last are evaluated.
_POINTS, _PERIODS, _RECORDED = 500, 70, 10
#: Mesh periods of the motion at the setting before its record, and the longest record of them.
_SETTLE, _LONGEST = 280, 100
#: Speeds of the characteristic of drawn gears, over that of resonance.
LOWEST, HIGHEST = 0.2, 2.2
#: Loads of the Harris map beside the chosen one, over it.
LOADS = 0.0, 0.5, 1.5, 2.0
#: Phases of a mesh period; most, where errors repeat after many mesh periods, and least of each.
_PHASES, _ALL_PHASES, _FEWEST = 256, 2048, 16


class View(NamedTuple):
    """The results of one configuration at its speed or tuning."""

    pair: GearPair  #: with a rectangle of stiffness, of which the characteristic is
    up: xr.Dataset  #: of a sweep up
    down: xr.Dataset
    run: xr.Dataset  #: of `gearlib.simulate` at the tuning; of drawn gears by pairs of teeth
    multipliers: np.ndarray  #: Floquet multipliers, empty if no orbit was found
    message: str  #: sentences about the motion
    orders: xr.Dataset | None  #: order spectrum, if there is a motion to the end
    mesh: Any = None  #: of drawn gears
    error: xr.Dataset | None = None  #: of `Mesh.transmission_error` of spur gears at several loads


def look(mapping: dict, damping: str) -> View:
    """Return the results of a configuration with the named damping, at its first tuning.

    Drawn gears are computed at their speed. ValueError if the gears are impossible.
    """
    settings = config.load(mapping)
    pair = GearPair(**settings.pair_parameters(damping))
    tuning = settings.phase_planes.tunings[0]
    if settings.gears is None:
        grid = np.linspace(settings.resonance.start, settings.resonance.stop, _POINTS)
        return _motion(pair, pair, grid, tuning)
    gears = settings.gears
    mesh, torque = gears.mesh(), gears.driving_torque()
    ratios = {name: getattr(pair, name) for name in ("damping_ratio", "backlash_damping_ratio")}
    method = {"stiffness": gears.stiffness, "options": gears.stiffness_options}
    teeth = default_load_sharing_pair(mesh, torque=torque, **ratios, **method)
    resonance = pair.speed(1.0)
    speed = float(pair.speed(tuning))
    ends = min(LOWEST * resonance, speed), max(HIGHEST * resonance, speed)
    grid = pair.tuning_at(np.linspace(*ends, _POINTS))
    # The number of mesh periods after which the same teeth meet again.
    count = len(mesh.pitch_errors)
    error = None
    if not mesh.pinion.helix_angle:
        phases = max(_FEWEST, min(_PHASES, _ALL_PHASES // count))
        torques = [*(load * torque for load in LOADS), torque]
        error = mesh.transmission_error(torques, phases=phases, stiffness=teeth.stiffness)
    view = _motion(pair, teeth, grid, float(teeth.tuning_at(speed)), count)
    return view._replace(mesh=mesh, error=error)


def _motion(pair, moving, grid: np.ndarray, tuning: float, repeats: int = 1) -> View:
    """Return the resonance curves of `pair` over `grid` and the motion of `moving` at a tuning.

    The pitch errors of `moving` repeat after `repeats` mesh periods.
    """
    settings = {"periods": _PERIODS, "record_periods": _RECORDED, "threads": 1}

    def curve(direction):
        if moving is not pair and direction == "down":
            swept, jumped = sweep_down(pair, grid, EXTENSION_RATIO * grid[0], **settings)
        else:
            swept, jumped = sweep(pair, grid, direction=direction, **settings), True
        return without_growth(swept, pair.extent), jumped

    # The kernels release the interpreter lock.
    with ThreadPoolExecutor(2) as pool:
        (up, _), (down, jumped) = pool.map(curve, ("up", "down"))
    # The record spans a revolution, or with pitch errors the periods until the same teeth meet.
    recorded = max(round(moving.periods_per_revolution), min(repeats, _LONGEST))
    periods = {"periods": _SETTLE + recorded, "record_periods": recorded}
    run = simulate(moving, tuning, **periods, samples_per_period=SAMPLES, until_settled=True)
    message = (
        f"{motions.describe(run)} Followed for {_SETTLE + recorded} mesh periods, at each speed"
    )
    message += f" of the characteristic for {_PERIODS}."
    if not jumped:
        message += f" Going down it has not jumped at {float(down.speed[0]):.0f} rpm, the lowest."
    roots = _multipliers(moving, run)
    if roots.size:
        sizes = ", ".join(f"{abs(root):.4g}" for root in roots)
        message += f" Floquet multipliers in magnitude: {sizes}."
    return View(pair, up, down, run, roots, message, None if int(run.status) else orders(run))


def _multipliers(model, run: xr.Dataset) -> np.ndarray:
    """Return the Floquet multipliers of the orbit on which a run settles, empty without orbit."""
    if not int(run.period):
        return np.empty(0)
    try:
        guess, period = run.final_state.values, int(run.period)
        return periodic_orbit(model, float(run.tuning), guess=guess, period=period).multipliers
    except NoOrbit:
        return np.empty(0)
