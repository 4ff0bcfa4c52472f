"""Compute dynamic factor and transmission error of pairs of teeth over the speed, up and down."""

import math
from typing import Any

import numpy as np
import xarray as xr

from gearlib.analysis.duty_point import iso_dynamic_factor
from gearlib.data.motions import true_intervals
from gearlib.data.result import result
from gearlib.data.status import NO_START
from gearlib.models.from_values import pairs_of_teeth
from gearlib.runs.sweeping import WARM_STARTED, sweep

#: First and last speed over the resonance speed, unless the operating speed lies beyond them.
SPEED_RANGE = 0.1, 1.4
#: Variables of sweeps that are kept.
_VARIABLES = ("dynamic_factor", "fraction_backlash", "period", "status", "complete")
#: Dynamic factors of two directions that differ by less, relative to the largest, are equal.
_SAME_FACTOR = 1e-3


def of_gears(gears: dict, damping: dict, points: int, start=None, stop=None, speed=None):
    """Return the dataset of `over_speed` for the section `gears` of a configuration.

    `gears` and `damping` are arguments of `pairs_of_teeth`; `start` and `stop` are the first and
    the last of the `points` speeds, and `speed` is the operating speed, rpm.
    """
    model = pairs_of_teeth(gears, damping, pitch_errors=False)
    speeds = np.linspace(*speed_range(model, speed, start, stop), points)
    return over_speed(model, speeds, speed, periods=150, record_periods=10)


def speed_range(model: Any, speed=None, start=None, stop=None) -> tuple[float, float]:
    """Return the first and the last speed in rpm; by default they include the operating speed."""
    resonance_speed = float(model.speed(1.0))
    lowest, highest = (ratio * resonance_speed for ratio in SPEED_RANGE)
    first = min(lowest, speed or math.inf) if start is None else start
    last = max(highest, speed or 0.0) if stop is None else stop
    return first, last


def over_speed(model: Any, speeds: np.ndarray, speed=None, **settings: Any) -> xr.Dataset:
    """Return dynamic factor and transmission error of pairs of teeth over the speed, up and down.

    Parameters
    ----------
    model : LoadSharingPair
        Without pitch errors, since the whole cycle of the teeth is too long for each speed.
    speeds : numpy.ndarray, shape (n,)
        Speeds of the pinion in rpm, increasing.
    speed : float, optional
        Operating speed in rpm.
    **settings
        Arguments of `gearlib.sweep`, such as periods and record_periods.

    Returns
    -------
    xarray.Dataset
        Over direction and tuning: dynamic_factor, error_peak_to_peak (m), fraction_backlash (share
        of the time without contact), period, status. Over tuning: speed, and iso_dynamic_factor if
        both gears have a quality. Over hysteresis, an interval of speeds in which the directions
        differ: jump_up_speed and jump_down_speed (rpm). operating_speed (rpm), NaN if unknown.
    """
    settings = {"initial_state": "static"} | settings
    curves = []
    for direction in WARM_STARTED:
        curve = sweep(model, speeds=speeds, direction=direction, **settings)
        height = (curve.displacement_max - curve.displacement_min) * model.static_deflection
        kept = curve[[name for name in _VARIABLES if name in curve]]
        curves.append(kept.assign(error_peak_to_peak=height.drop_attrs()))
    directions = xr.IndexVariable("direction", list(WARM_STARTED))
    # Sweeps that a limit of time has stopped have other tunings.
    fill_values = {"period": np.int32(0), "status": np.int8(NO_START)}
    data = xr.concat(curves, directions, join="outer", fill_value=fill_values)
    speeds = np.asarray(model.speed(data.tuning.values))
    data["speed"] = "tuning", speeds
    data["operating_speed"] = math.nan if speed is None else speed
    mesh, torque = model.drawing, model.load * model.drawing.pinion.base_diameter / 2.0
    if iso_dynamic_factor(mesh, torque, float(speeds[0])) is not None:
        factors = [iso_dynamic_factor(mesh, torque, rpm) for rpm in speeds.tolist()]
        data["iso_dynamic_factor"] = "tuning", factors
    up, down = data.dynamic_factor.values
    differ = np.abs(up - down) > _SAME_FACTOR * np.nanmax(data.dynamic_factor)
    intervals = true_intervals(differ)
    data["jump_down_speed"] = "hysteresis", np.array([speeds[i] for i, _ in intervals], float)
    data["jump_up_speed"] = "hysteresis", np.array([speeds[j] for _, j in intervals], float)
    title = "Dynamic factor and transmission error of a gear mesh over the speed"
    if "complete" in curve:
        data["complete"] = min(curve.complete for curve in curves)
    parameters = {name: settings[name] for name in ("periods", "record_periods")}
    method = settings.get("method") or next(iter(model.propagators))
    return result(title, model, data.drop_attrs(deep=False), method=method, **parameters)
