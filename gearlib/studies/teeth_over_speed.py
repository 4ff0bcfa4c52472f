"""Compute dynamic factor and transmission error of pairs of teeth over the speed, up and down."""

import math
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import xarray as xr

from gearlib.analysis.duty_point import iso_dynamic_factor
from gearlib.data.motions import true_intervals
from gearlib.data.result import result
from gearlib.data.status import NO_START
from gearlib.runs.sweeping import WARM_STARTED, motions_agree, sweep

#: First and last speed over the resonance speed, unless the operating speed lies beyond them.
SPEED_RANGE = 0.1, 1.4
#: Values of codes at tunings that a sweep with a limit of time has not reached.
_NOT_REACHED = {"period": np.int32(0), "status": np.int8(NO_START)}


def over_speed_range(model: Any, points: int, start=None, stop=None, speed=None) -> xr.Dataset:
    """Return the dataset of `over_speed` for a range of speeds.

    `start` and `stop` are the first and the last of the `points` speeds, and `speed` is the
    operating speed, rpm.
    """
    speeds = np.linspace(*speed_range(model, speed, start, stop), points)
    return over_speed(model, speeds, speed, periods=150, record_periods=10)


def speed_range(model: Any, speed=None, start=None, stop=None) -> tuple[float, float]:
    """Return the first and the last speed in rpm; by default they include the operating speed."""
    resonance_speed = float(model.speed(1.0))
    lowest, highest = (ratio * resonance_speed for ratio in SPEED_RANGE)
    first = min(lowest, speed or math.inf) if start is None else start
    last = max(highest, speed or 0.0) if stop is None else stop
    return first, last


def over_speed(
    model: Any, speeds: np.ndarray, speed=None, directions=WARM_STARTED, **settings: Any
) -> xr.Dataset:
    """Return dynamic factor and transmission error of pairs of teeth over the speed, up and down.

    Parameters
    ----------
    model : LoadSharingPair
        Without pitch errors, since the whole cycle of the teeth is too long for each speed.
    speeds : numpy.ndarray, shape (n,)
        Speeds of the pinion in rpm, increasing.
    speed : float, optional
        Operating speed in rpm.
    directions : sequence of str, default ("up", "down")
        Directions of `gearlib.sweep`.
    **settings
        Arguments of `gearlib.sweep`, such as periods and record_periods.

    Returns
    -------
    xarray.Dataset
        Over direction and tuning: the variables of `gearlib.sweep`, such as dynamic_factor,
        contact_loss_fraction (share of the time without contact), period and status, and
        error_peak_to_peak (m). Over tuning: speed, and iso_dynamic_factor if both gears have a
        quality. Over hysteresis, an interval of speeds in which the motions going up and down
        differ: jump_up_speed and jump_down_speed (rpm), its ends, NaN where it goes on beyond the
        speeds. operating_speed (rpm), NaN if unknown, and torque of the pinion (N m).
    """
    settings = {"initial_state": "static"} | settings
    scales = [*model.scales(), *model.speed_scales(1.0)]

    def sweep_in(direction: str) -> xr.Dataset:
        """Return the sweep in a direction without its scales."""
        return sweep(model, speeds=speeds, direction=direction, **settings).drop_vars(scales)

    # The kernels release the interpreter lock, so both directions run at the same time.
    with ThreadPoolExecutor() as pool:
        curves = list(pool.map(sweep_in, directions))
    names = xr.IndexVariable("direction", list(directions))
    # Sweeps that a limit of time has stopped have other tunings.
    data = xr.concat(curves, names, join="outer", fill_value=_NOT_REACHED)
    data = data.assign(model.scales())
    speed_scales = model.speed_scales(data.tuning.values)
    data = data.assign({name: ("tuning", values) for name, values in speed_scales.items()})
    height = (data.displacement_max - data.displacement_min) * model.static_deflection
    data["error_peak_to_peak"] = height.drop_attrs()
    data["operating_speed"] = math.nan if speed is None else speed
    mesh = model.stage
    data["torque"] = torque = model.load * mesh.pinion.base_diameter / 2.0
    factors = iso_dynamic_factor(mesh, torque, data.speed.values)
    if factors is not None:
        data["iso_dynamic_factor"] = "tuning", factors
    jumps = _jumps(data) if {*WARM_STARTED} <= {*directions} else np.empty((0, 2))
    data["jump_down_speed"], data["jump_up_speed"] = (("hysteresis", ends) for ends in jumps.T)
    title = "Dynamic factor and transmission error of a gear mesh over the speed"
    if "complete" in data:
        data["complete"] = data.complete.min()
    parameters = {name: settings[name] for name in ("periods", "record_periods")}
    method = settings.get("method") or next(iter(model.propagators))
    data = result(title, model, data.drop_attrs(deep=False), method=method, **parameters)
    if any(mesh.pitch_errors):
        data.attrs["comment"] = "The pitch errors of the gears are left out."
    return data


def _jumps(data: xr.Dataset) -> np.ndarray:
    """Return the ends (rpm) of the k intervals in which motions up and down differ, (k, 2)."""
    up, down = (data.sel(direction=name) for name in WARM_STARTED)
    # Runs that failed, and two motions that have not settled, are no evidence of two motions.
    known = (up.status == 0) & (down.status == 0) & ((up.period > 0) | (down.period > 0))
    intervals = true_intervals(~motions_agree(up, down) & known.values)
    # A motion jumps between two speeds of the sweep, and perhaps beyond the first or the last.
    speeds = np.pad(data.speed.values, 1, constant_values=math.nan)
    middles = (speeds[1:] + speeds[:-1]) / 2.0
    return np.array([(middles[i], middles[j + 1]) for i, j in intervals]).reshape(-1, 2)
