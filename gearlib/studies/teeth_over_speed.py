"""Compute dynamic factor and transmission error of load-sharing pairs over speed."""

import math
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import xarray as xr

from gearlib.analysis.duty_point import iso_dynamic_factor
from gearlib.data.motions import true_intervals
from gearlib.data.result import make_result
from gearlib.data.status import NO_START
from gearlib.runs.sweeping import WARM_STARTED, motions_agree, sweep

#: Lowest and highest speed relative to the resonance speed; extended by the operating speed.
SPEED_RANGE = 0.1, 1.4
#: Fill values of codes at tunings that a sweep has not reached within its time limit.
_NOT_REACHED = {"period": np.int32(0), "status": np.int8(NO_START)}


def sweep_speed_range(model: Any, points: int, start=None, stop=None, speed=None) -> xr.Dataset:
    """Compute dynamic factor and transmission error of a load-sharing pair over a range of speeds.

    There are `points` speeds from `start` to `stop` (rpm; see `speed_range` for the defaults), and
    `speed` is the operating speed (rpm) or None. Each run has 150 mesh periods, of which the last
    10 are evaluated. The dataset is described in `sweep_speeds`.
    """
    speeds = np.linspace(*speed_range(model, speed, start, stop), points)
    return sweep_speeds(model, speeds, speed, periods=150, record_periods=10)


def speed_range(model: Any, speed=None, start=None, stop=None) -> tuple[float, float]:
    """Return the lowest and the highest speed of a study, in rpm.

    These are `start` and `stop` if given. The defaults are multiples (`SPEED_RANGE`) of the
    resonance speed of `model`, extended to include the operating speed `speed` (rpm or None).
    """
    resonance_speed = float(model.speed(1.0))  # the tuning 1 is resonance
    if start is None:
        start = min(SPEED_RANGE[0] * resonance_speed, speed or math.inf)
    if stop is None:
        stop = max(SPEED_RANGE[1] * resonance_speed, speed or 0.0)
    return start, stop


def sweep_speeds(
    model: Any, speeds: np.ndarray, speed=None, directions=WARM_STARTED, **settings: Any
) -> xr.Dataset:
    """Compute dynamic factor and transmission error of a load-sharing pair over speed.

    Parameters
    ----------
    model : LoadSharingPair
        Without pitch errors, whose cycle is too long to be simulated at each speed.
    speeds : numpy.ndarray, shape (n,)
        Speeds of the pinion in rpm, increasing.
    speed : float, optional
        Operating speed in rpm.
    directions : sequence of str, default ("up", "down")
        Directions of the sweeps, as in `gearlib.sweep`.
    **settings
        Arguments of `gearlib.sweep`, such as periods and record_periods.

    Returns
    -------
    xarray.Dataset
        Over direction and tuning: the variables of `gearlib.sweep`, such as dynamic_factor,
        contact_loss_fraction (fraction of time without contact), period and status, and
        error_peak_to_peak (m). Over tuning: speed, and iso_dynamic_factor if both gears have a
        quality. Over hysteresis, an interval of speeds in which the motions of the sweeps up and
        down differ: jump_up_speed and jump_down_speed (rpm), the ends of the interval, NaN where it
        continues beyond the speeds. Scalars: operating_speed (rpm), NaN if unknown, and torque of
        the pinion (N m).
    """
    settings = {"initial_state": "static"} | settings
    scales = [*model.scales(), *model.speed_scales(1.0)]

    def sweep_in(direction: str) -> xr.Dataset:
        """Sweep in the direction "up" or "down"; return the sweep without scales to SI units."""
        return sweep(model, speeds=speeds, direction=direction, **settings).drop_vars(scales)

    # The kernels release the interpreter lock, so both directions run in parallel.
    with ThreadPoolExecutor() as pool:
        curves = list(pool.map(sweep_in, directions))
    names = xr.IndexVariable("direction", list(directions))
    # Sweeps that were stopped by a time limit have fewer tunings.
    data = xr.concat(curves, names, join="outer", fill_value=_NOT_REACHED)
    data = data.assign(model.scales())
    speed_scales = model.speed_scales(data.tuning.values)
    data = data.assign({name: ("tuning", values) for name, values in speed_scales.items()})
    height = (data.displacement_max - data.displacement_min) * model.static_deflection
    data["error_peak_to_peak"] = height.drop_attrs()
    data["operating_speed"] = math.nan if speed is None else speed
    stage = model.stage
    torque = model.load * stage.pinion.base_diameter / 2.0
    data["torque"] = torque
    factors = iso_dynamic_factor(stage, torque, data.speed.values)
    if factors is not None:
        data["iso_dynamic_factor"] = "tuning", factors
    jumps = _find_jump_speeds(data) if {*WARM_STARTED} <= {*directions} else np.empty((0, 2))
    data["jump_down_speed"] = "hysteresis", jumps[:, 0]
    data["jump_up_speed"] = "hysteresis", jumps[:, 1]
    title = "Dynamic factor and transmission error of a gear mesh over the speed"
    if "complete" in data:
        data["complete"] = data.complete.min()
    parameters = {name: settings[name] for name in ("periods", "record_periods")}
    method = settings.get("method") or next(iter(model.propagators))
    data = make_result(title, model, data.drop_attrs(deep=False), method=method, **parameters)
    if any(stage.pitch_errors):
        data.attrs["comment"] = "The pitch errors of the gears are neglected."
    return data


def _find_jump_speeds(data: xr.Dataset) -> np.ndarray:
    """Find the intervals of speed in which the sweeps up and down differ, shape (k, 2), in rpm.

    `data` has both sweeps along the dimension "direction". An end of an interval is NaN if the
    interval extends beyond the speeds of the sweeps.
    """
    up, down = (data.sel(direction=name) for name in WARM_STARTED)
    # Failed runs (status other than 0) and two unsettled motions (period 0) are no evidence of
    # hysteresis.
    known = (up.status == 0) & (down.status == 0) & ((up.period > 0) | (down.period > 0))
    intervals = true_intervals(~motions_agree(up, down) & known.values)
    # A motion jumps midway between two speeds, or at an unknown speed beyond the range.
    speeds = np.pad(data.speed.values, 1, constant_values=math.nan)
    middles = (speeds[1:] + speeds[:-1]) / 2.0
    return np.array([(middles[i], middles[j + 1]) for i, j in intervals]).reshape(-1, 2)
