"""Mesh orders of measured run-ups beside those of a model on the same course of speed."""

import warnings

import numpy as np
import xarray as xr
from scipy.integrate import cumulative_trapezoid

from gearlib import checks
from gearlib.analysis.order_maps import order_map
from gearlib.models.pair import GearPair
from gearlib.rig.measured import read_measured
from gearlib.rig.measured_courses import SCALES
from gearlib.rig.order_observations import complete_blocks
from gearlib.runs.run_up import run_up

#: Multiples of the mesh order, blocks of whole revolutions.
ORDERS, BLOCKS = 3, 300
#: Samples of the model in a mesh period.
SAMPLES = 128
#: Means of the speed; its share by which lines between some of them may be off.
_MEANS, _STRAIGHT = 200, 2e-3


def compute(path, pairs):
    """Return the mesh orders z, 2 z, 3 z of the run-ups of a measured set and of a model.

    pairs: damping -> argument of `described`, of gears without relief.

    Over ``track`` (a condition with time and changing speed), ``observable``, ``order`` (multiples
    of the mesh order) and ``block`` of whole revolutions: amplitude (rms, SI), over ``damping``
    computed_amplitude, that of `gearlib.order_map` of a run-up from rest with the measured course
    of speed; over (track, block) speed (min-1). The shaft's angle is the integral of the speed.
    """
    rig = read_measured(path)
    names = [name for name in SCALES if name in rig]
    models = {name: GearPair(**arguments) for name, arguments in pairs.items()}
    teeth = int(next(iter(models.values())).teeth)
    tracks = [_track(rig.isel(sample=own), names, models, teeth) for own in _run_ups(rig)]
    most = max((speed.size for speed, *_ in tracks), default=0)
    shape = len(tracks), len(names), ORDERS, most
    speeds, amplitude = np.full((len(tracks), most), np.nan), np.full(shape, np.nan)
    model = np.full((*shape[:2], len(models), *shape[2:]), np.nan)
    for i, (speed, measured, computed) in enumerate(tracks):
        speeds[i, : speed.size] = speed
        amplitude[i, ..., : speed.size] = measured
        model[i, ..., : speed.size] = computed
    coords = {"observable": names, "damping": list(models), "order": np.arange(1, ORDERS + 1)}
    over = ("track", "observable")
    data = {
        "amplitude": ((*over, "order", "block"), amplitude),
        "computed_amplitude": ((*over, "damping", "order", "block"), model),
        "speed": (("track", "block"), speeds, {"units": "min-1"}),
    }
    units = ", ".join(f"{name} in {rig[name].attrs['units']}" for name in names)
    return xr.Dataset(data, coords, rig.attrs | {"course_units": units})


def _run_ups(rig):
    """Return the samples of each condition in which the speed changes."""
    known = rig.condition.values if "condition" in rig.coords else np.zeros(rig.sizes["sample"])
    groups = [np.flatnonzero(known == one) for one in dict.fromkeys(known.tolist())]
    return [own for own in groups if np.ptp(rig.speed.values[own]) > 0.0]


def _track(part, names, models, teeth):
    """Return (speed, measured, computed amplitudes) over the blocks of one run-up."""
    time, speed = part.time.values - part.time.values[0], part.speed.values
    turned = cumulative_trapezoid(speed / 60.0, time, initial=0.0)
    each = max(1, int(turned[-1] / BLOCKS))
    edges = np.arange(int(turned[-1] / each) + 1) * each
    measured = np.array([_orders(turned, part[name], edges, teeth) for name in names])
    knots, computed = _knots(time, speed), []
    for model in models.values():
        run = run_up(model, speed=knots, samples_per_period=SAMPLES)
        for name in names:
            own = order_map(
                run, variable=name, resolution=1.0 / each, highest=(ORDERS + 0.5) * teeth
            )
            track = own.amplitude.values[:, teeth * each * np.arange(1, ORDERS + 1)].T
            computed.append(track)
    count = min(edges.size - 1, *(one.shape[1] for one in computed))
    shape = len(models), len(names), ORDERS, count
    model = np.array([one[:, :count] for one in computed]).reshape(shape).swapaxes(0, 1)
    middle = np.interp(0.5 * (edges[1:] + edges[:-1]), turned, speed)
    return middle[:count], measured[..., :count], model


def _knots(time, speed):
    """Return a course of speed as few (s, min-1) with straight lines in between."""
    # Means, for the noise of a sensor would make accelerations.
    parts = np.array_split(np.arange(time.size), min(_MEANS, time.size // 2))
    t, n = (np.array([values[own].mean() for own in parts]) for values in (time, speed))
    # Half a part further at both ends.
    first = n[0] + (n[0] - n[1]) * t[0] / (t[1] - t[0])
    last = n[-1] + (n[-1] - n[-2]) * (time[-1] - t[-1]) / (t[-1] - t[-2])
    n = np.maximum([first, *n, last], 0.0)
    t = np.array([0.0, *t, time[-1]])
    kept, waiting = {0, t.size - 1}, [(0, t.size - 1)]
    while waiting:
        i, j = waiting.pop()
        away = np.abs(np.interp(t[i : j + 1], t[[i, j]], n[[i, j]]) - n[i : j + 1])
        if away.max() > _STRAIGHT * n.max():
            at = i + int(away.argmax())
            kept.add(at)
            waiting += [(i, at), (at, j)]
    kept = sorted(kept)
    return list(zip(t[kept].tolist(), n[kept].tolist(), strict=True))


def _orders(turned, course, edges, teeth):
    """Return the rms of the mesh orders, shape (orders, blocks), NaN in blocks with gaps."""
    good = np.isfinite(course.values)
    turned, values = turned[good], course.values[good]
    complete = complete_blocks(turned, edges, teeth)
    missing = int((~complete).sum())
    allowed = "a time course with a block of revolutions without gaps"
    checks.require(complete.any(), course.name, f"{missing} blocks with gaps", allowed)
    if missing:
        words = f"{missing} of {complete.size} blocks of revolutions are left out of {course.name}"
        warnings.warn(f"{words}: they have gaps", stacklevel=2)
    found = []
    for k in range(1, ORDERS + 1):
        wave = values * np.exp(-2j * np.pi * k * teeth * turned)
        wave = cumulative_trapezoid(wave, turned, initial=0.0)
        at = np.interp(edges, turned, wave.real) + 1j * np.interp(edges, turned, wave.imag)
        amplitude = np.sqrt(2.0) * np.abs(np.diff(at)) / np.diff(edges)
        found.append(np.where(complete, amplitude, np.nan))
    return np.array(found)
