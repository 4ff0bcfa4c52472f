"""Measured sets beside a model: sweeps in its scales, harmonics of time courses, mesh orders."""

import warnings

import numpy as np
import xarray as xr
from scipy.integrate import cumulative_trapezoid

from gearlib import checks
from gearlib.analysis.order_maps import order_map
from gearlib.models.pair import GearPair
from gearlib.runs.run_up import run_up
from gearlib.runs.simulation import simulate
from gearlib.uncertainty.course_observations import complete_blocks
from gearlib.uncertainty.measured import read_measured

#: Observable of a sweep -> its scale to SI among the variables of the characteristics.
SWEEP_SCALES = {
    "displacement_max": "static_deflection",
    "displacement_min": "static_deflection",
    "orbit_height": "static_deflection",
    "dynamic_force_max": "force_scale",
    "dynamic_force_min": "force_scale",
    "fraction_normal": None,
    "fraction_backlash": None,
    "fraction_inverse": None,
    "bounces": None,
}
#: Observable of a time course -> its scale to SI among the variables of a run.
_COURSE_SCALES = {
    "displacement": "static_deflection",
    "velocity": "velocity_scale",
    "acceleration": "acceleration_scale",
    "dynamic_force": "force_scale",
}
#: Time courses -> names of their largest and least values.
_ENVELOPES = {
    "displacement": ("displacement_max", "displacement_min"),
    "dynamic_force": ("dynamic_force_max", "dynamic_force_min"),
}
#: How the speed was reached -> the sweep of the characteristics.
_SWEEPS = {0: "cold", 1: "up", -1: "down"}
#: Largest number of stretches of a run-up whose extremes are taken, and least samples of each.
_MAX_STRETCHES, _LEAST_SAMPLES = 400, 20
#: Harmonics of the mesh period of a time course.
_HARMONICS = 5
#: Points of a measured time course that are drawn, and of that of the model.
_POINTS, _PHASES = 600, 256
#: Share of the largest singular value below which samples do not tell harmonics apart.
_LEAST_SINGULAR = 1e-7
#: Multiples of the mesh order of a run-up, blocks of whole revolutions, samples in a mesh period.
_ORDERS, _BLOCKS, _SAMPLES = 3, 300, 128
#: Means of a measured speed, and its share by which lines between some of them may be off.
_MEANS, _STRAIGHT_SHARE = 200, 2e-3


def curve(path, resonance):
    """Return a measured set by its path as a curve in the scales of a model.

    resonance: characteristics as gathered, of which the speeds and scales count.

    Over ``sample``: tuning, speed, direction, and what there is of `SWEEP_SCALES` in static
    deflections and loads; jumps and the onset of contact loss (min-1). A run-up gives the extremes
    of displacement and force of several hundred stretches. Attributes are those of `read_measured`.
    """
    rig = read_measured(path)
    measured = rig if set(SWEEP_SCALES) & set(rig.data_vars) else _envelope(rig)
    rate = float(resonance.tuning[-1] / resonance.speed[-1])
    data = rig[[name for name in rig.data_vars if rig[name].dims == ()]]
    data = data.drop_vars(list(data.coords))
    names = [name for name in SWEEP_SCALES if name in measured]
    if "speed" in measured.coords and names:
        speed = measured.speed
        direction = measured.coords.get("direction", xr.zeros_like(speed, np.int8))
        coords = {"speed": speed, "tuning": rate * speed, "direction": direction}
        data = data.assign_coords({name: ("sample", x.values) for name, x in coords.items()})
        for name in names:
            data[name] = "sample", *_scaled(measured[name], resonance, SWEEP_SCALES[name])
            _calibrate(data, name, resonance)
    return data.assign_attrs(rig.attrs | {"tuning_rate": rate})


def computed_at(measured, computed, name):
    """Return the values of one damping at the speeds of a curve and by its sweeps, NaN beyond."""
    values = np.full(measured.sizes["sample"], np.nan)
    for way, word in _SWEEPS.items():
        if word in computed.direction.values:
            there = measured.direction.values == way
            sweep = computed.sel(direction=word)
            speed = measured.speed.values[there]
            values[there] = np.interp(speed, sweep.speed, height(sweep, name), np.nan, np.nan)
    return values


def height(computed, name):
    """Return an observable of characteristics; orbit_height is made of both extremes."""
    if name == "orbit_height":
        return computed.displacement_max.values - computed.displacement_min.values
    return computed[name].values


def calibration(values, model, gain=True, offset=True):
    """Return gain and offset of the line through values over a model, NaN of fewer than four.

    One that is not wanted is 1 or 0.
    """
    finite = np.isfinite(values) & np.isfinite(model)
    values, model = values[finite], model[finite]
    if values.size < 4 or np.ptp(values) == 0.0:
        return np.nan, np.nan
    columns = [model] * gain + [np.ones(model.size)] * offset
    target = values if gain else values - model
    best = list(np.linalg.lstsq(np.stack(columns, axis=1), target, rcond=None)[0])
    return (best.pop(0) if gain else 1.0), (best.pop(0) if offset else 0.0)


def _calibrate(data: xr.Dataset, name: str, resonance: xr.Dataset) -> None:
    """Put the gain and the offset of a sensor into the attributes, by the damping that suits best.

    They turn its values into those of the model: (value - offset) / gain.
    """
    attrs, values = data[name].attrs, data[name].values
    unknown = [bool(attrs.get(f"unknown_{key}")) for key in ("gain", "offset")]
    attrs |= {"fitted_gain": 1.0, "fitted_offset": 0.0}
    least = np.inf
    for damping in resonance.damping.values if any(unknown) else ():
        model = computed_at(data, resonance.sel(damping=damping), name)
        gain, offset = calibration(values, model, *unknown)
        misfit = np.nanmean((gain * model + offset - values) ** 2) if np.isfinite(gain) else np.inf
        if misfit < least and gain > 0.0:
            least = misfit
            attrs |= {"fitted_gain": float(gain), "fitted_offset": float(offset)}


def _scaled(values: xr.DataArray, resonance: xr.Dataset, scale: str | None) -> tuple:
    """Return values over a scale of the model, and their attributes."""
    has_unit = values.attrs.get("units") not in ("1", "count")
    factor = 1.0 / float(resonance[scale]) if scale and has_unit else 1.0
    noise = factor * values.attrs.get("noise_std", 0.0)
    return values.values * factor, values.attrs | {"units": "1", "noise_std": noise}


def _envelope(rig: xr.Dataset) -> xr.Dataset:
    """Return the extremes of the time courses of a run-up over its speed."""
    if not {"time", "speed"} <= set(rig.coords) or np.ptp(rig.speed.values) == 0.0:
        return xr.Dataset()
    speed = rig.speed.values
    count = max(1, min(_MAX_STRETCHES, speed.size // _LEAST_SAMPLES))
    starts = np.arange(count) * speed.size // count
    last = np.append(starts[1:], speed.size) - 1
    direction = np.sign(speed[last] - speed[starts]).astype(np.int8)
    if "direction" in rig.coords:
        direction = rig.direction.values[starts]
    mean = np.add.reduceat(speed, starts) / (last - starts + 1)
    data = xr.Dataset(coords={"speed": ("sample", mean), "direction": ("sample", direction)})
    for name, (largest, least) in _ENVELOPES.items():
        if name in rig:
            values, attrs = rig[name].values, rig[name].attrs
            data[largest] = "sample", np.fmax.reduceat(values, starts), attrs
            data[least] = "sample", np.fmin.reduceat(values, starts), attrs
    return data


def _parts(rig: xr.Dataset, steady: bool) -> list[xr.Dataset]:
    """Return the conditions of a set whose speed is constant, or those in which it changes."""
    names = rig.condition.values if "condition" in rig.coords else np.zeros(rig.sizes["sample"])
    groups = [np.flatnonzero(names == name) for name in dict.fromkeys(names.tolist())]
    parts = [rig.isel(sample=group) for group in groups]
    return [part for part in parts if (np.ptp(part.speed.values) == 0.0) == steady]


def _observables(rig: xr.Dataset) -> tuple[list[str], dict]:
    """Return the names of the time courses of a set, and the attribute with their units."""
    names = [name for name in _COURSE_SCALES if name in rig]
    units = ", ".join(f"{name} in {rig[name].attrs['units']}" for name in names)
    return names, {"course_units": units}


def courses(path, pairs, run):
    """Return the time courses of a measured set beside the settled motions of a model.

    pairs: damping -> arguments of `GearPair`; run: arguments of `simulate`, samples_per_period
    among them, of whole revolutions.

    Over ``course`` (a condition with its speed), ``observable`` and ``harmonic`` of the mesh
    period: amplitude (SI), shape_phase (deg): that of the harmonic k less k times that of the
    first, which no unknown phase of the shaft, gain or offset changes; over ``damping`` the same
    of the model, from rest. For pictures the courses over the phase from the peak of the first
    harmonic.
    """
    rig = read_measured(path)
    names, attrs = _observables(rig)
    models = {name: GearPair(**arguments) for name, arguments in pairs.items()}
    parts = [part for part in _parts(rig, steady=True) if part.speed[0] > 0.0]
    speeds = [float(part.speed[0]) for part in parts]
    over = {"course": len(parts), "observable": len(names)}
    both = over | {"damping": len(models)}
    data: dict = {
        name: ((*dims, last), np.full((*dims.values(), size), np.nan))
        for dims, last, size, variables in (
            (over, "harmonic", _HARMONICS, ("amplitude", "amplitude_std")),
            (over, "harmonic", _HARMONICS, ("shape_phase", "shape_phase_std")),
            (over, "number", _POINTS, ("point_phase", "point")),
            (both, "harmonic", _HARMONICS, ("computed_amplitude", "computed_shape_phase")),
            (both, "phase", _PHASES, ("computed",)),
        )
        for name in variables
    }
    for i, (speed, part) in enumerate(zip(speeds, parts, strict=True)):
        motions = [simulate(model, speed=speed, **run) for model in models.values()]
        for j, name in enumerate(names):
            rate = np.pi * speed / 30.0 * int(next(iter(models.values())).teeth)
            measured = _measured_harmonics(part.time.values, part[name], rate)
            for key, values in measured.items():
                data[key][1][i, j, : values.size] = values
            for d, motion in enumerate(motions):
                for key, values in _computed_harmonics(motion, name, run).items():
                    data[key][1][i, j, d] = values
    coords = {
        "observable": names,
        "damping": list(models),
        "harmonic": np.arange(1, _HARMONICS + 1),
        "phase": np.linspace(0.0, 2.0 * np.pi, _PHASES),
        "speed": ("course", speeds, {"units": "min-1"}),
    }
    return xr.Dataset(data, coords, rig.attrs | attrs)


def _computed_harmonics(motion: xr.Dataset, name: str, run: dict) -> dict:
    """Return the harmonics of a run, and its course from the peak of the first of them."""
    periods, samples = int(run["record_periods"]), int(run["samples_per_period"])
    values = float(motion[_COURSE_SCALES[name]]) * motion[name].values[: periods * samples]
    wave = np.fft.rfft(values)[periods::periods][:_HARMONICS] / (0.5 * values.size)
    phase = np.linspace(0.0, 2.0 * np.pi, samples, endpoint=False)
    shifted = np.linspace(0.0, 2.0 * np.pi, _PHASES) - np.angle(wave[0])
    return {
        "computed_amplitude": np.abs(wave),
        "computed_shape_phase": _shape(wave),
        "computed": np.interp(shifted, phase, values[:samples], period=2.0 * np.pi),
    }


def _shape(wave: np.ndarray) -> np.ndarray:
    """Return the phase of each harmonic less so many times that of the first, degrees."""
    number = np.arange(1, wave.size + 1)
    return np.degrees(np.angle(wave * np.exp(-1j * number * np.angle(wave[0]))))


def _measured_harmonics(time: np.ndarray, course: xr.DataArray, rate: float) -> dict:
    """Return the harmonics of a measured course and some of its points, nothing of too few."""
    values = course.values
    finite = np.isfinite(values)
    time, values = time[finite], values[finite]
    number, columns = np.arange(1, _HARMONICS + 1), 2 * _HARMONICS + 1
    if values.size <= columns:
        return {}

    turned = np.exp(1j * np.outer(rate * (time - time[0]), number))
    basis = np.hstack([np.ones((time.size, 1)), turned.real, turned.imag])
    best, _, rank, _ = np.linalg.lstsq(basis, values, rcond=_LEAST_SINGULAR)
    if rank < columns:
        return {}
    # y = sum of A cos(k w t + phase): the conjugate of the coefficient of exp.
    wave = best[1 : _HARMONICS + 1] - 1j * best[_HARMONICS + 1 :]
    few = np.unique(np.linspace(0, time.size - 1, _POINTS).astype(int))
    left = float(np.std(values[few] - basis[few] @ best))
    deviation = (course.attrs.get("noise_std", 0.0) or left) * np.sqrt(2.0 / time.size)
    angle = deviation / np.abs(wave)
    return {
        "amplitude": np.abs(wave),
        "amplitude_std": np.full(_HARMONICS, deviation),
        "shape_phase": _shape(wave),
        "shape_phase_std": np.degrees(np.hypot(angle, number * angle[0])),
        "point_phase": np.mod(rate * (time[few] - time[0]) + np.angle(wave[0]), 2.0 * np.pi),
        "point": values[few],
    }


def orders(path, pairs):
    """Return the mesh orders z, 2 z, 3 z of the run-ups of a measured set and of a model.

    pairs: damping -> arguments of `GearPair`, of gears without relief.

    Over ``track`` (a condition with time and changing speed), ``observable``, ``order`` (multiples
    of the mesh order) and ``block`` of whole revolutions: amplitude (rms, SI), over ``damping``
    computed_amplitude, that of `gearlib.order_map` of a run-up from rest with the measured course
    of speed; over (track, block) speed (min-1). The shaft's angle is the integral of the speed.
    """
    rig = read_measured(path)
    names, attrs = _observables(rig)
    models = {name: GearPair(**arguments) for name, arguments in pairs.items()}
    tracks = [_track(part, names, models) for part in _parts(rig, steady=False)]
    blocks = max((speed.size for speed, *_ in tracks), default=0)
    over, last = (
        {"track": len(tracks), "observable": len(names)},
        {"order": _ORDERS, "block": blocks},
    )
    data: dict = {
        name: (tuple(dims), np.full(tuple(dims.values()), np.nan))
        for name, dims in (
            ("speed", {"track": len(tracks), "block": blocks}),
            ("amplitude", over | last),
            ("computed_amplitude", over | {"damping": len(models)} | last),
        )
    }
    for i, track in enumerate(tracks):
        for (_, values), row in zip(data.values(), track, strict=True):
            values[i, ..., : row.shape[-1]] = row
    data["speed"] = *data["speed"], {"units": "min-1"}
    coords = {"observable": names, "damping": list(models), "order": np.arange(1, _ORDERS + 1)}
    return xr.Dataset(data, coords, rig.attrs | attrs)


def _track(part: xr.Dataset, names: list[str], models: dict) -> tuple:
    """Return speed, measured and computed amplitudes over the blocks of one run-up."""
    teeth = int(next(iter(models.values())).teeth)
    time, speed = part.time.values - part.time.values[0], part.speed.values
    turned = cumulative_trapezoid(speed / 60.0, time, initial=0.0)
    size = max(1, int(turned[-1] / _BLOCKS))
    edges = np.arange(int(turned[-1] / size) + 1) * size
    measured = np.array([_mesh_orders(turned, part[name], edges, teeth) for name in names])
    knots, computed = _knots(time, speed), []
    for model in models.values():
        run = run_up(model, speed=knots, samples_per_period=_SAMPLES)
        for name in names:
            highest = (_ORDERS + 0.5) * teeth
            table = order_map(run, variable=name, resolution=1.0 / size, highest=highest)
            computed.append(table.amplitude.values[:, teeth * size * np.arange(1, _ORDERS + 1)].T)
    count = min(edges.size - 1, *(rows.shape[1] for rows in computed))
    shape = len(models), len(names), _ORDERS, count
    model = np.array([rows[:, :count] for rows in computed]).reshape(shape).swapaxes(0, 1)
    middle = np.interp(0.5 * (edges[1:] + edges[:-1]), turned, speed)
    return middle[:count], measured[..., :count], model


def _knots(time: np.ndarray, speed: np.ndarray) -> list[tuple]:
    """Return a course of speed as few (s, min-1) with straight lines in between."""
    # Means, for the noise of a sensor would make accelerations.
    parts = np.array_split(np.arange(time.size), min(_MEANS, time.size // 2))
    t, n = (np.array([values[part].mean() for part in parts]) for values in (time, speed))
    # Half a part further at both ends.
    first = n[0] + (n[0] - n[1]) * t[0] / (t[1] - t[0])
    last = n[-1] + (n[-1] - n[-2]) * (time[-1] - t[-1]) / (t[-1] - t[-2])
    n = np.maximum([first, *n, last], 0.0)
    t = np.array([0.0, *t, time[-1]])
    kept, waiting = {0, t.size - 1}, [(0, t.size - 1)]
    while waiting:
        i, j = waiting.pop()
        away = np.abs(np.interp(t[i : j + 1], t[[i, j]], n[[i, j]]) - n[i : j + 1])
        if away.max() > _STRAIGHT_SHARE * n.max():
            at = i + int(away.argmax())
            kept.add(at)
            waiting += [(i, at), (at, j)]
    return [(float(t[i]), float(n[i])) for i in sorted(kept)]


def _mesh_orders(
    turned: np.ndarray, course: xr.DataArray, edges: np.ndarray, teeth: int
) -> np.ndarray:
    """Return the rms of the mesh orders, shape (orders, blocks), NaN in blocks with gaps."""
    finite = np.isfinite(course.values)
    turned, values = turned[finite], course.values[finite]
    complete = complete_blocks(turned, edges, teeth)
    missing = int((~complete).sum())
    allowed = "a time course with a block of revolutions without gaps"
    checks.require(complete.any(), course.name, f"{missing} blocks with gaps", allowed)
    if missing:
        words = f"{missing} of {complete.size} blocks of revolutions are left out of {course.name}"
        warnings.warn(f"{words}: they have gaps", stacklevel=2)
    numbers = teeth * np.arange(1, _ORDERS + 1)[:, None]
    waves = values * np.exp(-2j * np.pi * numbers * turned)
    sums = cumulative_trapezoid(waves, turned, initial=0.0)
    at = np.array([np.interp(edges, turned, row) for row in sums])
    amplitude = np.sqrt(2.0) * np.abs(np.diff(at)) / np.diff(edges)
    return np.where(complete, amplitude, np.nan)
