"""What a fit compares of measured sets: slow sweeps, speeds of their jumps, time courses.

Slow sweeps are compared point by point, each side of a jump on its own branch of orbits; a point
beyond the fold of the model keeps the value next to it. Jumps are compared as speeds.
"""

import math
from typing import Any

import numpy as np
import xarray as xr

from gearlib import checks
from gearlib.data import measured_names
from gearlib.runs.sweeping import sweep
from gearlib.uncertainty.course_observations import course_observations
from gearlib.uncertainty.design_quantities import RESONANCE_NAMES
from gearlib.uncertainty.observation import (
    JUMP_SHARE,
    ORDER,
    SAMPLES,
    SETTLING,
    SHARING,
    STATISTICS,
    Channel,
    Curve,
    Observation,
    Place,
    at_speed,
    pick,
    special_speeds,
)

#: A jump is so many times as large as the usual step from one point to the next.
_JUMP_RATIO = 3.0
#: Quantities that fall at a jump up, and ends of the names of those that grow.
_FALLING = ("displacement_min", "dynamic_force_min")
_GROWING = ("_max", *(f"{ORDER}_{k}" for k in range(1, 10)))


def observations_of(model: Any, data: Any) -> list[Observation]:
    """Return what of one measured set, or of several, can be compared with a model."""
    sets = data if isinstance(data, list | tuple) else [data]
    return [observation for part in sets for observation in _of_set(model, part)]


def _of_set(model: Any, data: Any) -> list[Observation]:
    """Return what of one measured set can be compared."""
    if not hasattr(data, "data_vars"):
        given = data if isinstance(data, int | float | str) else type(data).__name__
        raise checks.refusal("data", given, "datasets with a displacement over time or jump speeds")
    speeds = {name: data[name] for name in RESONANCE_NAMES if name in data}
    timed, quantities, observations = "time" in data.coords, {}, []
    if timed or "speed" in data.coords:
        known = ("displacement",) if timed else (*STATISTICS, SHARING, ORDER)
        quantities = quantities_of(model, data.data_vars, known)
    _check(data, quantities, speeds)
    if timed:
        for name, (quantity, mesh) in quantities.items():
            course = data.isel(sample=data[name].notnull().values).rename({name: quantity})
            observations += course_observations(model, course, mesh)
    elif quantities:
        points, jumps = _of_sweeps(data, quantities)
        observations, speeds = [points], jumps | speeds
    if speeds:
        observations.append(_of_speeds(speeds))
    if not observations:
        raise ValueError(
            f"data = {list(data.variables)!r} is not allowed: it must have a displacement over "
            f"time, one of {', '.join(STATISTICS)} over speed, jump_up, jump_down or "
            "onset_of_contact_loss"
        )
    return observations


def quantities_of(model: Any, names: Any, known: tuple = (*STATISTICS, SHARING, ORDER)) -> dict:
    """Return name of a variable -> (quantity, number of its mesh).

    The names of trains end with the mesh, ``load_sharing_sun_1``.
    """
    meshes, quantities = [name.replace(" ", "_") for name in model.mesh_names], {}
    for name in map(str, names):
        for j, mesh in enumerate(meshes or [""]):
            quantity = name.removesuffix(f"_{mesh}") if mesh else name
            kind, _, number = quantity.rpartition("_")
            is_order = kind == ORDER and number.isdigit() and 0 < int(number) <= SAMPLES // 2
            is_known = (ORDER if is_order else quantity) in known and quantity != ORDER
            if is_known and (quantity != name if mesh else quantity != SHARING):
                quantities[name] = quantity, j
    return quantities


def _check(data: Any, quantities: dict, speeds: dict) -> None:
    """Refuse what is compared unless it has numbers in SI units and a noise that can be."""
    if quantities:
        for name in ("time", "speed", "direction"):
            if name in data.coords:
                _check_numbers(name, data[name])
        if "direction" in data.coords:
            for way in np.unique(data.direction.values).tolist():
                checks.one_of("direction", way, (1, -1, 0))
    for name, (quantity, _) in quantities.items():
        _check_numbers(name, data[name], gaps="time" in data.coords)
        _check_sensor(name, quantity, data[name].attrs)
    for name, speed in speeds.items():
        checks.require(speed.ndim == 0, name, f"of shape {speed.shape}", "one number, in rpm")
        checks.finite_positive(name, speed.values[()])
        _check_sensor(name, name, speed.attrs)


def _check_numbers(name: str, variable: Any, gaps: bool = False) -> None:
    """Refuse a variable that has not one finite number for each sample, but for gaps."""
    values = variable.values
    checks.require(values.dtype.kind in "iuf", name, str(values.dtype), "of real numbers")
    checks.require(variable.ndim == 1, name, f"of shape {values.shape}", "over samples alone")
    checks.require(values.size > 0, name, "empty", "of one sample or more")
    finite = np.isfinite(values)
    complete = finite.any() and (finite | (gaps & np.isnan(values))).all()
    checks.require(complete, name, "NaN", "finite in each sample")


def _check_sensor(name: str, quantity: str, attrs: dict) -> None:
    """Refuse attributes that say of a sensor what cannot be."""
    checks.finite_nonnegative(f"noise_std of {name}", attrs.get("noise_std", 0.0))
    for key in ("unknown_gain", "unknown_offset"):
        checks.integer(f"{key} of {name}", int(attrs.get(key, 0)), 0, 1)
    # The amplitudes that are compared are those of a displacement.
    wanted = measured_names.of(quantity)[0] or "m"
    units = attrs.get("units", wanted)
    fits = units == wanted or attrs.get("unknown_gain", 0)
    checks.require(fits, f"units of {name}", units, f"{wanted}, or of unknown gain")


def _of_speeds(speeds: dict) -> Observation:
    """Return the observation of measured speeds of jumps and of the onset of contact loss."""
    measured = {name: float(speed) for name, speed in speeds.items()}
    noise = np.array([speed.attrs.get("noise_std", 0.0) for speed in speeds.values()], float)
    values = np.array([*measured.values()])
    deviations = np.where(noise > 0.0, noise, 1e-3 * values)

    def predict(model: Any) -> tuple:
        predicted = special_speeds(model, measured)
        return [np.array([predicted.get(name, math.nan) for name in measured])], 0.0

    def draw(sensed: list) -> list:
        names = [name.replace("_", " ") for name in measured]
        return list(map(Place, names, values, deviations, sensed[0]))

    channel = Channel("speeds", values, deviations, bool((noise > 0.0).all()))
    return Observation("speeds", [channel], predict, draw)


def _of_sweeps(data: Any, quantities: dict) -> tuple[Observation, dict]:
    """Return the observation of statistics over speed, and the measured speeds of its jumps."""
    speeds = np.asarray(data.speed.values, float)
    checks.require((speeds > 0.0).all(), "speed", float(speeds.min()), "> 0 in each sample")
    ways = data.direction.values if "direction" in data.coords else np.zeros(len(speeds))
    branches, jumps = _branches(data, quantities, speeds, ways)
    order = np.concatenate(branches)[None]
    channels = [_sweep_channel(data, name, order) for name in quantities]
    samples = SAMPLES if any(ORDER in quantity for quantity, _ in quantities.values()) else 1

    def predict(model: Any) -> tuple:
        points = np.empty(len(speeds), object)
        for branch in branches:
            points[branch] = _followed(model, speeds[branch], samples)
        rows = [
            np.array([pick(point, *which) for point in points]) for which in quantities.values()
        ]
        return rows, max(0.0, *(-point["displacement_min"].min() for point in points))

    def draw(sensed: list) -> list:
        curves = []
        for channel, fitted in zip(channels, sensed, strict=True):
            name, units = channel.name, data[channel.name].attrs.get("units", "")
            heights = channel.values, fitted
            curve = Curve(name.replace("_", " "), units, "speed", speeds, heights, ways < 0)
            curves.append(curve)
        return curves

    return Observation("branches", channels, predict, draw), jumps


def _sweep_channel(data: Any, name: str, order: np.ndarray) -> Channel:
    """Return the channel of a variable over the speed."""
    values, attrs = np.asarray(data[name].values, float), data[name].attrs
    noise = float(attrs.get("noise_std", 0.0))
    allowed = "more than one value, or each with a known noise"
    checks.require(np.ptp(values) > 0.0 or noise, name, values[0], allowed)
    deviations = np.full(values.size, noise or np.ptp(values))
    of_samples = data.get(f"{name}_noise_std")
    if of_samples is not None and (of_samples.values > 0.0).all():
        deviations = of_samples.values.astype(float)
    gain, offset = (bool(attrs.get(f"unknown_{key}", 0)) for key in ("gain", "offset"))
    return Channel(name, values, deviations, bool(noise), gain, offset, order)


def _branches(data: Any, quantities: dict, speeds: np.ndarray, ways: np.ndarray) -> tuple:
    """Return numbers of the points of each branch, in order, and the speeds of the jumps.

    Of a sweep that jumps the points before the jump are followed from its first speed, those
    behind it from its last one, back.
    """
    names = {name: quantity for name, (quantity, _) in quantities.items()}
    growing = {n: q for n, q in names.items() if q in _FALLING or q.endswith(_GROWING)}
    signs = {n: -1.0 if q in _FALLING else 1.0 for n, q in (growing or names).items()}
    table = np.array([sign * data[n].values.astype(float) for n, sign in signs.items()])
    least = np.array([3.0 * float(data[name].attrs.get("noise_std", 0.0)) for name in signs])
    branches, jumps = [], {}
    for way in np.unique(ways):
        points = np.flatnonzero(ways == way)
        if not way:
            branches += [points[i : i + 1] for i in range(len(points))]
            continue
        points = points[np.argsort(way * speeds[points], kind="stable")]
        i = _jump(table[:, points], least, way if growing else 0)
        if i is None:
            branches.append(points)
            continue
        branches += [points[:i], points[i:][::-1]]
        a, b = speeds[points[i - 1]], speeds[points[i]]
        # Anywhere between two points: a rectangle's standard deviation.
        attrs = {"units": "min-1", "noise_std": abs(b - a) / math.sqrt(12.0)}
        jumps["jump_up" if way > 0 else "jump_down"] = xr.DataArray(0.5 * (a + b), attrs=attrs)
    return branches, jumps


def _jump(table: np.ndarray, least: Any, way: int) -> int | None:
    """Return the first point behind the largest jump of rows of values, None without one.

    `way`: 1 of jumps up alone, -1 of jumps down, 0 of both; `least`: size of jumps of each row.
    """
    if table.shape[1] < 2:
        return None
    changes = np.diff(table, axis=1)
    steps = np.abs(changes)
    sizes = np.maximum(np.abs(table).max(axis=1), 1e-300)[:, None]
    usual = np.median(steps, axis=1)[:, None]
    jumps = (steps > JUMP_SHARE * sizes) & (steps > _JUMP_RATIO * usual)
    jumps &= (steps > np.reshape(least, (-1, 1))) & ((changes * way > 0.0) | (way == 0))
    if not jumps.any():
        return None
    return int(np.where(jumps, steps / sizes, 0.0).max(axis=0).argmax()) + 1


def _followed(model: Any, speeds: np.ndarray, samples: int) -> list[dict]:
    """Return the orbits of one branch from its first speed on.

    It ends where a motion jumps up while the speed rises, down while it falls; the other way a
    motion comes to a branch that leads on, as where it begins to strike the far flank.
    """
    rising = len(speeds) < 2 or speeds[-1] > speeds[0]
    # At a speed that comes twice the motion is the same.
    tunings, order = np.unique(speeds / float(model.speed(1.0)), return_inverse=True)
    run = sweep(model, tunings, direction="up" if rising else "down", **SETTLING)
    states = run.final_state.values[order]
    heights = run.displacement_max.values[order].reshape(len(speeds), -1).T
    end = _jump(heights, 0.0, 1 if rising else -1)
    count = len(speeds) if end is None else end
    points = [at_speed(model, speeds[i], states[i], samples) for i in range(count)]
    return points + [points[-1]] * (len(speeds) - count)
