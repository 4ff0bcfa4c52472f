"""Signals that were sampled over time, as run-ups have them: at equal angles of the shaft.

The angle is the integral of the speed, or that of a tacho of one pulse a revolution; between
samples lie cubic splines. Blocks of `order_map` are whole revolutions, so that orders on its grid
do not leak into each other; of what lies between two of them a block sees up to 3.9 dB too little.
"""

import math

import numpy as np
import xarray as xr
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import CubicSpline

from gearlib import checks
from gearlib.data.provenance import canonical_json

#: Samples that the shortest wave must have. A cubic spline lowers it by the factor
#: 3 sinc(f)^4 / (2 + cos(2 pi f)), f = 1 / samples: with four by 1.5 %, with ten by 0.02 %.
_PER_WAVE = 4.0
#: Most samples in a revolution.
_MOST = 2**16


def is_sampled(run):
    """Return whether a dataset has no angle of its own, but samples over time."""
    names = getattr(run, "variables", ())
    return "time" in names and "phase" not in names


def at_equal_angles(data, variable, highest, *, tacho=None, teeth=1):
    """Return (signal as `gearlib.order_map` takes a run-up, its highest order, its first time).

    The speed is that of the dataset, or of a `tacho`, times of pulses (s), one a revolution. What
    cannot be is refused.
    """
    if variable not in data.variables or data[variable].shape != data["time"].shape:
        raise checks.refusal("variable", variable, "a variable of the dataset over time")
    time, values = (np.asarray(data[name].values, float) for name in ("time", variable))
    if not (time.ndim == 1 and time.size > 3 and np.isfinite(values).all()):
        raise ValueError(
            f"{variable} is not allowed: it must have four samples or more, all finite"
        )
    if not (np.isfinite(time).all() and (np.diff(time) > 0.0).all()):
        raise ValueError("time is not allowed: it must rise from sample to sample")
    if tacho is None:
        turns, course = _of_speed(data, time)
    else:
        turns, course = _of_tacho(tacho)
    inside = (time >= course[0, 0]) & (time <= course[-1, 0])
    if inside.sum() < 4:
        raise ValueError("tacho is not allowed: it must have four samples or more between pulses")
    time, values = time[inside], values[inside]
    own = turns(time)
    steps = np.diff(own)
    if not (steps > 0.0).all():
        raise ValueError("speed is not allowed: it must be > 0 at all samples")
    limit = 1.0 / (_PER_WAVE * float(steps.max()))
    if highest is not None and highest > limit:
        raise ValueError(
            f"highest = {highest!r} is not allowed: it must be at most {limit:.4g}, orders with "
            f"{_PER_WAVE:g} samples a wave at the highest speed"
        )
    count = min(2 * math.ceil(0.5 / float(steps.min())), _MOST)
    first = own[0]
    at = first + np.arange(int((own[-1] - first) * count) + 1) / count
    when = CubicSpline(own, time)(at)
    found = xr.Dataset(
        {
            "time": ("time", when),
            "speed": ("time", 60.0 / CubicSpline(own, time)(at, 1)),
            "phase": ("time", math.tau * teeth * (at - first)),
            variable: ("time", CubicSpline(own, values)(at), dict(data[variable].attrs)),
            "status": ((), 0),
            "teeth": ((), float(teeth)),
        }
    )
    found[variable].attrs.setdefault("units", "1")
    rows = course[course[:, 0] > time[0]]
    rows = np.vstack([[time[0], float(np.interp(time[0], *course.T))], rows])
    rows[:, 0] -= time[0]
    # Straight lines between these turn by nearly as much: that many blocks there are.
    turned = np.trapezoid(rows[:, 1], rows[:, 0]) / 60.0
    whole = turns(course[-1, 0]) - first
    rows[:, 1] *= float(whole) / turned
    said = {"speed": rows.tolist(), "load": [[0.0, 1.0]]}
    found.attrs["parameters"] = canonical_json(said)
    return found, limit, float(time[0])


def _of_speed(data, time):
    """Return (function of time that gives revolutions, rows of s and rpm)."""
    if "speed" not in data.variables or data["speed"].shape != time.shape:
        raise ValueError("tacho = None is not allowed for a dataset without speed")
    speed = np.asarray(data["speed"].values, float)
    if not (np.isfinite(speed).all() and (speed > 0.0).all()):
        raise ValueError("speed is not allowed: it must be > 0 at all samples")
    turned = cumulative_trapezoid(speed / 60.0, time, initial=0.0)
    return CubicSpline(time, turned), np.column_stack([time, speed])


def _of_tacho(tacho):
    pulses = np.array(checks.finite("tacho", tacho))
    if pulses.size < 4 or not (np.diff(pulses) > 0.0).all():
        raise ValueError("tacho is not allowed: it must be four times or more that rise")
    turns = CubicSpline(pulses, np.arange(pulses.size))
    return turns, np.column_stack([pulses, 60.0 * turns(pulses, 1)])
