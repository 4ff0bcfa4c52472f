"""Measured sets beside a model: sweeps, time courses and mesh orders, and how far they agree."""

import math
import warnings

import numpy as np
import xarray as xr
from scipy.integrate import cumulative_trapezoid

from gearlib.analysis.order_maps import order_map
from gearlib.data.variables import SI_SCALES
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
#: Observables of which the first that a set has tells its jumps and peaks.
_HEIGHTS = ("orbit_height", "displacement_max", "dynamic_force_max", "displacement_min")
#: Way of the speed in a measured set -> direction of the sweep.
_DIRECTIONS = {0: "cold", 1: "up", -1: "down"}
#: Parts of a run-up whose extremes are taken at most, and least samples of each.
_MAX_PARTS, _MIN_PART_SAMPLES = 400, 20
#: Harmonics of a time course, points drawn of it, and phases of that of the model.
_HARMONICS, _POINTS, _PHASES = 5, 600, 256
#: Share of the largest singular value below which samples do not tell harmonics apart.
_MIN_SINGULAR_VALUE = 1e-7
#: Mesh orders of a run-up, most blocks of whole revolutions, and samples in a mesh period.
_ORDERS, _MAX_BLOCKS, _SAMPLES = np.arange(1, 4), 300, 128
#: Most straight lines of the course of a measured speed.
_MAX_LINES = 200
#: A jump is a step of at least this share of the range, and so many times the other steps.
_JUMP_SHARE, _JUMP_RATIO = 0.15, 2.0
#: Value and standard deviation of what is not known.
_UNKNOWN = (math.nan, math.nan)


def curve(path, resonance):
    """Return a measured set as a curve over speed and tuning, in the scales of a model.

    Speeds and scales are those of `resonance`, gathered characteristics. A run-up gives the
    extremes of its parts. ``fitted_gain`` and ``fitted_offset`` of an observable turn its values
    into those of the damping that suits best: (value - offset) / gain.
    """
    rig, resonance = read_measured(path), _with_heights(resonance)
    measured = rig if set(SWEEP_SCALES) & set(rig.data_vars) else _envelope(rig)
    rate = float(resonance.tuning[-1] / resonance.speed[-1])
    data = rig[[name for name in rig.data_vars if not rig[name].dims]].reset_coords(drop=True)
    names = [name for name in SWEEP_SCALES if name in measured]
    if "speed" in measured.coords and names:
        speed = measured.speed
        direction = measured.coords.get("direction", xr.zeros_like(speed, np.int8))
        coords = {"speed": speed, "tuning": rate * speed, "direction": direction}
        data = data.assign_coords({name: ("sample", x.values) for name, x in coords.items()})
        for name in names:
            attrs, scale = measured[name].attrs, SWEEP_SCALES[name]
            has_unit = scale and attrs.get("units") not in ("1", "count")
            factor = 1.0 / float(resonance[scale]) if has_unit else 1.0
            attrs |= {"units": "1", "noise_std": factor * attrs.get("noise_std", 0.0)}
            data[name] = "sample", factor * measured[name].values, attrs
            data[name].attrs |= _fitted_sensor(data, name, resonance)
    return data.assign_attrs(rig.attrs | {"tuning_rate": rate})


def _envelope(rig):
    """Return the extremes of displacement and force over the speed of a run-up."""
    if not {"time", "speed"} <= set(rig.coords) or np.ptp(rig.speed.values) == 0.0:
        return xr.Dataset()
    speed = rig.speed.values
    count = max(1, min(_MAX_PARTS, speed.size // _MIN_PART_SAMPLES))
    starts = np.arange(count) * speed.size // count
    ends = np.append(starts[1:], speed.size) - 1
    direction = np.sign(speed[ends] - speed[starts]).astype(np.int8)
    if "direction" in rig.coords:
        direction = rig.direction.values[starts]
    mean = np.add.reduceat(speed, starts) / (ends - starts + 1)
    data = xr.Dataset(coords={"speed": ("sample", mean), "direction": ("sample", direction)})
    for name in ("displacement", "dynamic_force"):
        if name in rig:
            for end, extreme in (("max", np.fmax), ("min", np.fmin)):
                values = extreme.reduceat(rig[name].values, starts)
                data[f"{name}_{end}"] = "sample", values, rig[name].attrs
    return data


def _fitted_sensor(data, name, resonance):
    """Return the unknown gain and offset of a sensor by the damping that suits best."""
    values = data[name].values
    unknown = [bool(data[name].attrs.get(f"unknown_{key}")) for key in ("gain", "offset")]
    fits = [(math.inf, 1.0, 0.0)]
    for damping in resonance.damping.values if any(unknown) else ():
        model = _computed(data, resonance.sel(damping=damping), name)
        gain, offset = _line(values, model, *unknown)
        if gain > 0.0:
            fits.append((np.nanmean((gain * model + offset - values) ** 2), gain, offset))
    _, gain, offset = min(fits)
    return {"fitted_gain": float(gain), "fitted_offset": float(offset)}


def _line(values, model, gain=True, offset=True):
    """Return gain and offset of the line through values over a model, NaN of fewer than four."""
    known = np.isfinite(values) & np.isfinite(model)
    values, model = values[known], model[known]
    if values.size < 4:
        return _UNKNOWN
    columns = np.stack([model] * gain + [np.ones(model.size)] * offset, axis=1)
    best = np.linalg.lstsq(columns, values if gain else values - model, rcond=None)[0]
    return best[0] if gain else 1.0, best[-1] if offset else 0.0


def _computed(measured, computed, name):
    """Return an observable of the characteristics of one damping at the samples of a curve."""
    values = np.full(measured.sizes["sample"], np.nan)
    for way, direction in _DIRECTIONS.items():
        if direction in computed.direction.values:
            samples = measured.direction.values == way
            sweep = computed.sel(direction=direction)
            speeds = measured.speed.values[samples]
            values[samples] = np.interp(speeds, sweep.speed, sweep[name], np.nan, np.nan)
    return values


def _with_heights(resonance):
    """Return characteristics with the heights of their orbits."""
    return resonance.assign(orbit_height=resonance.displacement_max - resonance.displacement_min)


def courses(path, pairs, run):
    """Return harmonics and courses of a measured set beside those of settled motions from rest.

    `pairs` has the parameters of the model by damping, `run` the arguments of `simulate`. Over
    course (a condition with its speed), observable, harmonic of the mesh period, and damping. The
    shape_phase (deg) of the harmonic k is its phase less k times that of the first, which no
    unknown phase of the shaft changes.
    """
    rig, models = read_measured(path), _models(pairs)
    parts = []
    for part in _parts(rig, steady=True):
        speed = float(part.speed[0])
        if speed > 0.0:
            motions = [simulate(model, speed=speed, **run) for model in models]
            rate = math.pi / 30.0 * speed * models[0].teeth
            observables = [
                xr.concat([_computed_course(motion, name, run) for motion in motions], "damping")
                .merge(_measured_course(part, name, rate))
                .assign_coords(observable=name)
                for name in _observables(rig)
            ]
            parts.append(xr.concat(observables, "observable").assign_coords(speed=speed))
    data = xr.concat(parts, "course").assign_coords(damping=[*pairs])
    data = data.assign_coords(harmonic=np.arange(1, _HARMONICS + 1))
    data["speed"].attrs["units"] = "min-1"
    return data.assign_attrs(rig.attrs | {"course_units": _units(rig)})


def _models(pairs):
    return [GearPair(**parameters) for parameters in pairs.values()]


def _observables(rig):
    return [name for name in SI_SCALES if name in rig]


def _units(rig):
    return ", ".join(f"{name} in {rig[name].attrs['units']}" for name in _observables(rig))


def _parts(rig, steady):
    """Return the conditions of a set whose speed is constant, or those in which it changes."""
    names = rig.condition.values if "condition" in rig.coords else np.zeros(rig.sizes["sample"])
    parts = [rig.isel(sample=names == name) for name in dict.fromkeys(names.tolist())]
    return [part for part in parts if (np.ptp(part.speed.values) == 0.0) == steady]


def _computed_course(motion, name, run):
    """Return the harmonics of a run, and its course from the peak of the first of them."""
    periods, samples = int(run["record_periods"]), int(run["samples_per_period"])
    values = float(motion[SI_SCALES[name]]) * motion[name].values[: periods * samples]
    wave = np.fft.rfft(values)[periods::periods][:_HARMONICS] / (0.5 * values.size)
    phase = np.linspace(0.0, math.tau, samples, endpoint=False)
    drawn = np.linspace(0.0, math.tau, _PHASES)
    shifted = np.interp(drawn - np.angle(wave[0]), phase, values[:samples], period=math.tau)
    data = {
        "computed_amplitude": ("harmonic", np.abs(wave)),
        "computed_shape_phase": ("harmonic", _shape_phases(wave)),
        "computed": ("phase", shifted),
    }
    return xr.Dataset(data, {"phase": drawn})


def _shape_phases(wave):
    """Return the phase of each harmonic less so many times that of the first, degrees."""
    number = np.arange(1, wave.size + 1)
    return np.degrees(np.angle(wave * np.exp(-1j * number * np.angle(wave[0]))))


def _measured_course(part, name, rate):
    """Return the harmonics of a measured course and points of it, NaN if it has too few samples."""
    finite = np.isfinite(part[name].values)
    time, values = part.time.values[finite], part[name].values[finite]
    number = np.arange(1, _HARMONICS + 1)
    wave, deviation = np.full(_HARMONICS, complex(np.nan)), math.nan
    drawn = np.linspace(0, time.size - 1, _POINTS).astype(int)
    if values.size > 2 * _HARMONICS + 1:
        turned = np.exp(1j * np.outer(rate * (time - time[0]), number))
        basis = np.hstack([np.ones((time.size, 1)), turned.real, turned.imag])
        best, _, rank, _ = np.linalg.lstsq(basis, values, rcond=_MIN_SINGULAR_VALUE)
        if rank == basis.shape[1]:
            # The conjugate of the coefficient of exp, so that phases are those of cosines.
            wave = best[1 : _HARMONICS + 1] - 1j * best[_HARMONICS + 1 :]
            noise = part[name].attrs.get("noise_std") or np.std(values - basis @ best)
            deviation = noise * math.sqrt(2.0 / time.size)
    angle = deviation / np.abs(wave)
    points = np.where(np.isfinite(deviation), values[drawn], np.nan)
    phases = rate * (time[drawn] - time[0]) + np.angle(wave[0])
    return xr.Dataset(
        {
            "amplitude": ("harmonic", np.abs(wave)),
            "amplitude_std": ("harmonic", np.full(_HARMONICS, deviation)),
            "shape_phase": ("harmonic", _shape_phases(wave)),
            "shape_phase_std": ("harmonic", np.degrees(np.hypot(angle, number * angle[0]))),
            "point_phase": ("number", np.mod(phases, math.tau)),
            "point": ("number", points),
        }
    )


def orders(path, pairs):
    """Return the mesh orders z, 2 z, 3 z of the run-ups of a measured set and of a model.

    `pairs` has the parameters of the model by damping. Over track (a condition with changing
    speed), observable, order (multiples of the mesh order) and block of whole revolutions: speed,
    amplitude (rms, SI), and over damping computed_amplitude of a run-up from rest with the measured
    course of speed.
    """
    rig, models = read_measured(path), _models(pairs)
    names, teeth, tracks = _observables(rig), models[0].teeth, []
    for part in _parts(rig, steady=False):
        speed = part.speed.values
        turned = cumulative_trapezoid(speed / 60.0, part.time.values, initial=0.0)
        size = max(1, int(turned[-1] / _MAX_BLOCKS))
        edges = np.arange(int(turned[-1] / size) + 1) * size
        measured = [_mesh_orders(turned, part[name], edges, teeth) for name in names]
        dims = ("observable", "order", "block")
        track = xr.Dataset(
            {
                "speed": ("block", np.interp(0.5 * (edges[1:] + edges[:-1]), turned, speed)),
                "amplitude": (dims, np.array(measured)),
            },
            {"block": np.arange(edges.size - 1)},
        )
        computed = []
        for model in models:
            run = run_up(model, speed=_lines(part), samples_per_period=_SAMPLES)
            options = {"resolution": 1.0 / size, "orders": teeth * _ORDERS}
            maps = [order_map(run, variable=name, **options).amplitude.values.T for name in names]
            blocks = np.arange(maps[0].shape[-1])
            computed.append(xr.DataArray(np.array(maps), {"block": blocks}, dims))
        together = xr.concat(computed, "damping", join="outer")
        tracks.append(track.assign(computed_amplitude=together.reindex_like(track)))
    data = xr.concat(tracks, "track", join="outer")
    data = data.assign_coords(observable=names, damping=[*pairs], order=_ORDERS)
    data = data.transpose(..., "order", "block")
    data["speed"].attrs["units"] = "min-1"
    return data.assign_attrs(rig.attrs | {"course_units": _units(rig)})


def _mesh_orders(turned, course, edges, teeth):
    """Return the rms of the mesh orders, shape (orders, blocks), NaN in blocks with gaps."""
    finite = np.isfinite(course.values)
    turned, values = turned[finite], course.values[finite]
    complete = complete_blocks(turned, edges, teeth)
    if missing := int((~complete).sum()):
        words = f"{missing} of {complete.size} blocks of revolutions are left out of {course.name}"
        warnings.warn(f"{words}: they have gaps", stacklevel=2)
    waves = values * np.exp(-2j * np.pi * teeth * _ORDERS[:, None] * turned)
    sums = cumulative_trapezoid(waves, turned, initial=0.0)
    at_edges = np.array([np.interp(edges, turned, row) for row in sums])
    amplitude = math.sqrt(2.0) * np.abs(np.diff(at_edges)) / np.diff(edges)
    return np.where(complete, amplitude, np.nan)


def _lines(part):
    """Return a measured course of speed as few straight lines, rows of s and min-1.

    They go through means of samples: the noise of a sensor would make accelerations.
    """
    time, speed = part.time.values - part.time.values[0], part.speed.values
    groups = np.array_split(np.arange(time.size), min(_MAX_LINES, time.size // 2))
    rows = [(float(time[group].mean()), float(speed[group].mean())) for group in groups]
    return [(0.0, rows[0][1]), *rows, (float(time[-1]), rows[-1][1])]


def rows(curves, resonance, courses=(), orders=()):
    """Yield the table of measured and computed numbers, first those that need no calibration.

    A head, then a row for each quantity, damping and measured set; `curves`, `courses` and `orders`
    are datasets of the functions of these names, `resonance` the gathered characteristics.
    """
    head = ["set", "quantity", "calibration", "damping", "measured", "standard_deviation"]
    yield [*head, "computed", "difference", "deviations"]
    resonance = _with_heights(resonance)
    for data in (*curves, *courses, *orders):
        for damping in resonance.damping.values:
            if "track" in data.dims:
                scores = _scores_of_orders(data.sel(damping=damping))
            elif "course" in data.dims:
                scores = _scores_of_courses(data.sel(damping=damping))
            else:
                scores = _scores_of_curve(data, resonance.sel(damping=damping))
            for score in scores:
                yield _row(data.attrs["title"], str(damping), *score)


def _row(title, damping, quantity, unit, calibration, measured, computed):
    """Return a row of the table; measured and computed are values with standard deviations."""
    (value, deviation), (model, resolution) = measured, computed
    difference = model - value
    total = math.hypot(deviation, resolution if math.isfinite(resolution) else 0.0)
    ratio = difference / total if deviation > 0 else math.nan
    numbers = [value, deviation, model, difference, ratio]
    cells = [float(f"{number:.6g}") if math.isfinite(number) else "" for number in numbers]
    return [title, quantity + unit, calibration, damping, *cells]


def _scores_of_curve(curve, computed):
    """Yield (quantity, unit, calibration, measured, computed) of a curve and one damping."""
    name = next((name for name in _HEIGHTS if name in curve), None)
    jumps = {}
    for way, direction in ((1, "up"), (-1, "down")):
        measured = _speed(curve, f"jump_{direction}")
        if name and "direction" in curve.coords and not math.isfinite(measured[0]):
            sweep = curve.isel(sample=curve.direction.values == way)
            measured = jump(sweep.speed.values, sweep[name].values)
        if math.isfinite(measured[0]):
            model = _UNKNOWN
            if direction in computed.direction.values:
                sweep = computed.sel(direction=direction)
                model = jump(sweep.speed.values, sweep[name or "orbit_height"].values)
            jumps[direction] = measured, model
    if len(jumps) == 2:
        ratios = map(_ratio, jumps["down"], jumps["up"])
        yield "jump down over jump up", "", "none", *ratios
    if name and "direction" in curve.coords:
        values, model = curve[name].values, _computed(curve, computed, name)
        sign = -1.0 if name == "displacement_min" else 1.0
        noise = curve[name].attrs["noise_std"] or math.nan
        peaks = [_peak_ratio(sign * values, curve, noise), _peak_ratio(sign * model, curve, 0.0)]
        if math.isfinite(peaks[0][0]):
            yield f"highest {name} down over up", "", "none", *peaks
    for observable in filter(curve.__contains__, SWEEP_SCALES):
        yield from _misfits(curve, computed, observable)
    for direction, pair in jumps.items():
        yield f"jump {direction}", " min-1", "speed", *pair
    onset = _speed(curve, "onset_of_contact_loss")
    if math.isfinite(onset[0]):
        yield "onset of contact loss", " min-1", "speed", onset, _onset(computed)


def _speed(curve, name):
    """Return a measured speed and its standard deviation, NaN where they are not known."""
    if name not in curve:
        return _UNKNOWN
    return float(curve[name]), curve[name].attrs.get("noise_std", 0.0) or math.nan


def jump(speed, heights):
    """Return the speed at which a curve jumps and its standard deviation, NaN without a jump."""
    finite = np.isfinite(heights)
    order = np.argsort(speed[finite], kind="stable")
    speed, heights = speed[finite][order], heights[finite][order]
    if speed.size < 4:
        return _UNKNOWN
    steps = np.abs(np.diff(heights))
    i = int(steps.argmax())
    others = np.concatenate([steps[: max(i - 1, 0)], steps[i + 2 :]])
    if steps[i] <= max(_JUMP_SHARE * np.ptp(heights), _JUMP_RATIO * others.max(initial=0.0)):
        return _UNKNOWN
    return speed[i : i + 2].mean(), max(speed[i + 1] - speed[i], 1e-300) / math.sqrt(12.0)


def _ratio(numerator, denominator):
    """Return the ratio of two numbers with standard deviations."""
    ratio = numerator[0] / denominator[0]
    shares = (deviation / value for value, deviation in (numerator, denominator))
    return ratio, abs(ratio) * math.hypot(*shares)


def _peak_ratio(values, curve, deviation):
    """Return the ratio of the highest values down and up, over the median of both sweeps."""
    sweeps = [values[curve.direction.values == way] for way in (-1, 1)]
    if not all(np.isfinite(sweep).any() for sweep in sweeps):
        return _UNKNOWN
    zero = np.nanmedian(np.concatenate(sweeps))
    return _ratio(*((float(np.nanmax(sweep)) - zero, deviation) for sweep in sweeps))


def _misfits(curve, computed, name):
    """Yield the rms distance of a curve from the model over its range, by calibration."""
    values, model = curve[name].values, _computed(curve, computed, name)
    gain, offset = _line(values, model)
    if not math.isfinite(gain):
        return
    attrs, span = curve[name].attrs, float(np.nanmax(values) - np.nanmin(values))
    fits = [("free gain and offset", "none", gain * model + offset)]
    if not attrs.get("unknown_gain") and not attrs.get("unknown_offset"):
        fits.append(("as calibrated", "sensor", model))
    for words, calibration, fitted in fits:
        rms = float(np.sqrt(np.nanmean((values - fitted) ** 2))) / span
        measured = math.nan, attrs["noise_std"] / span or math.nan
        quantity = f"misfit of {name} over its range, {words}"
        yield quantity, "", calibration, measured, (rms, math.nan)


def _onset(computed):
    """Return the lowest speed at which the sweep up begins to lose contact, and its resolution."""
    if "up" not in computed.direction.values:
        return _UNKNOWN
    sweep = computed.sel(direction="up").sortby("speed")
    lost = sweep.fraction_normal.values < 1.0 - 1e-9
    begins = np.flatnonzero(lost[1:] & ~lost[:-1])
    if not begins.size:
        return _UNKNOWN
    low, high = sweep.speed.values[begins[0] : begins[0] + 2]
    return 0.5 * (low + high), (high - low) / math.sqrt(12.0)


def _scores_of_orders(tracks):
    """Yield (quantity, unit, calibration, measured, computed) of run-ups and one damping."""
    for i, j in np.ndindex(tracks.sizes["track"], tracks.sizes["observable"]):
        track = tracks.isel(track=i, observable=j)
        name, both = str(track.observable.values), (track.amplitude, track.computed_amplitude)
        peaks = [values.max("block").values for values in both]
        for k in range(1, track.sizes["order"]):
            ratios = [(float(largest[k] / largest[0]), math.nan) for largest in peaks]
            yield f"largest order {k + 1}z of {name} over order z", "", "none", *ratios
        speeds = [float(track.speed[int(np.nanargmax(values.values[0]))]) for values in both]
        yield f"largest order z of {name}", " min-1", "speed", *((n, math.nan) for n in speeds)


def _scores_of_courses(courses):
    """Yield (quantity, unit, calibration, measured, computed) of time courses and one damping."""
    for i, j in np.ndindex(courses.sizes["course"], courses.sizes["observable"]):
        course = courses.isel(course=i, observable=j)
        if not math.isfinite(float(course.amplitude[0])):
            continue
        where = f"of {course.observable.values} at {float(course.speed):.4g} min-1"
        measured = [*zip(course.amplitude.values, course.amplitude_std.values, strict=True)]
        model = [(value, 0.0) for value in course.computed_amplitude.values]
        for k in range(1, course.sizes["harmonic"]):
            ratios = (_ratio(amplitudes[k], amplitudes[0]) for amplitudes in (measured, model))
            yield f"harmonic {k + 1} over the first {where}", "", "none", *ratios
            lag = float(course.shape_phase[k]), float(course.shape_phase_std[k])
            near = float(course.computed_shape_phase[k])
            near += 360.0 * round((lag[0] - near) / 360.0)
            quantity = f"phase of harmonic {k + 1} less {k + 1} times that of the first {where}"
            yield quantity, " deg", "none", lag, (near, math.nan)
