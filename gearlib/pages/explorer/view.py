"""From a model to the arrays that the explorer draws of it; no browser here."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from gearlib.analysis.orbits.shooting import NoOrbit, periodic_orbit
from gearlib.analysis.order_maps import orders
from gearlib.data import summary
from gearlib.data.growing import without_growth
from gearlib.runs.simulation import simulate
from gearlib.runs.sweeping import LOWEST_SHARE, sweep, sweep_down


class Lengths(NamedTuple):
    """Mesh periods of what is run."""

    periods: int  #: of every run of a characteristic
    recorded: int  #: the last ones, which are evaluated
    settle: int  #: before and with the record of the motion at the setting
    samples: int  #: of each recorded period


#: Mesh periods of a time course that is drawn.
SHOWN = 3
PAIR = Lengths(70, 10, 300, 256)


@dataclass(frozen=True)
class View:
    """What is seen at one setting."""

    model: Any  #: that moves at the setting
    up: xr.Dataset  #: of a sweep up
    down: xr.Dataset
    run: xr.Dataset  #: of `gearlib.simulate` at the setting
    multipliers: np.ndarray  #: Floquet multipliers of a pair, empty if no orbit was found
    message: str  #: what the motion is, in words
    orders: xr.Dataset | None  #: order spectrum, if there is a motion to the end
    mesh: Any = None  #: of drawn gears
    pair: Any = None  #: of these, with the rectangle of their stiffness
    error: xr.Dataset | None = None  #: of `Mesh.transmission_error` at several loads


def look(model, tuning, grid, lengths=PAIR, moving=None, **drawn):
    """Return the `View` at one tuning, the characteristic on a grid, shape (n,).

    `moving` is the model at that tuning, by default that of the characteristic.
    """

    def curve(direction):
        settings = {"periods": lengths.periods, "record_periods": lengths.recorded}
        if drawn and direction == "down":
            found, jumped = sweep_down(model, grid, LOWEST_SHARE * grid[0], threads=1, **settings)
        else:
            found, jumped = sweep(model, grid, direction=direction, threads=1, **settings), True
        return without_growth(found, model.extent), jumped

    # The kernels release the interpreter lock.
    with ThreadPoolExecutor(2) as pool:
        (up, _), (down, jumped) = pool.map(curve, ("up", "down"))
    moving = moving or model
    run = simulate(
        moving,
        tuning,
        periods=lengths.settle,
        record_periods=lengths.recorded,
        samples_per_period=lengths.samples,
        until_settled=True,
    )
    followed = (
        f" Followed for {lengths.settle} mesh periods, at each speed of the characteristic for "
        f"{lengths.periods}."
    )
    if not jumped:
        followed += f" Going down it has not jumped at {float(down.speed[0]):.0f} rpm, the lowest."
    spectrum = _orders(moving, run, lengths)
    words = summary.in_words(run) + followed
    return View(moving, up, down, run, _multipliers(moving, run), words, spectrum, **drawn)


def _orders(model, run, lengths):
    """Return the order spectrum of a run that repeats, else of the revolution that follows it."""
    if int(run.status):
        return None
    if int(run.period) and lengths.recorded % int(run.period) == 0:
        return orders(run)
    length = round(model.periods_per_revolution)
    revolution = simulate(
        model,
        float(run.tuning),
        periods=length,
        record_periods=length,
        samples_per_period=lengths.samples,
        initial_state=tuple(run.final_state.values),
    )
    return None if int(revolution.status) else orders(revolution)


def _multipliers(pair, run):
    """Return the Floquet multipliers of the orbit on which a run ends, empty if there is none."""
    period = int(run.period)
    if not period:
        return np.empty(0)
    try:
        guess = run.final_state.values
        return periodic_orbit(pair, float(run.tuning), guess=guess, period=period).multipliers
    except NoOrbit:
        return np.empty(0)
