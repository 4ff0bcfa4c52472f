"""How far measured curves and a model agree, first by what needs no calibration: a table."""

import math
from collections.abc import Iterator

import numpy as np
import xarray as xr

from gearlib.studies.measured_comparison import SWEEP_SCALES, calibration, computed_at, height

COLUMNS = [
    "set", "quantity", "calibration", "damping", "measured", "standard_deviation", "computed",
    "difference", "deviations", "words",
]  # fmt: skip
#: Observables whose height is that of a resonance; the first that a set has counts.
_HEIGHTS = ("orbit_height", "displacement_max", "dynamic_force_max", "displacement_min")
#: A jump is a step between neighbouring speeds of so much of the range, and so many times as large
#: as the largest that is not beside it.
_JUMP_SHARE, _JUMP_RATIO = 0.15, 2.0
_UNKNOWN = (math.nan, math.nan)


def rows(curves, resonance, courses=(), orders=()):
    """Yield the names of the columns, then a row for each quantity, damping and measured set.

    curves, courses, orders: datasets of `gearlib.studies.measured_comparison`; resonance:
    characteristics as gathered. Numbers that are not known are empty.
    """
    yield COLUMNS
    for data in (*curves, *courses, *orders):
        for damping in resonance.damping.values:
            if "track" in data.dims:
                scores = _of_orders(data.sel(damping=damping))
            elif "course" in data.dims:
                scores = _of_courses(data.sel(damping=damping))
            else:
                scores = _of_curve(data, resonance.sel(damping=damping))
            for score in scores:
                yield _row(data.attrs["title"], str(damping), *score)


def _row(title: str, damping: str, quantity: str, unit: str, sensor: str, *pairs: tuple) -> list:
    """Return a row; `pairs` are (value, standard deviation), measured and computed."""
    (value, deviation), (model, resolution) = pairs
    difference = model - value
    total = math.hypot(deviation, resolution if math.isfinite(resolution) else 0.0)
    ratio = difference / total if deviation > 0 else math.nan
    if not math.isfinite(value):
        words = f"{quantity}: {model:.3g}" + (f", noise {deviation:.3g}" if deviation > 0 else "")
    elif not math.isfinite(model):
        words = f"{quantity}: measured {value:.4g}{unit}, none computed"
    else:
        words = f"{quantity}: measured {value:.4g}{unit}, computed {model:.4g}{unit}"
        if math.isfinite(ratio):
            words += f", {abs(ratio):.1f} standard deviations {'more' if ratio > 0 else 'less'}"
    numbers = [value, deviation, model, difference, ratio]
    cells = ["" if not math.isfinite(number) else float(f"{number:.6g}") for number in numbers]
    return [title, quantity + unit, sensor, damping, *cells, f"{words} ({damping})"]


def _of_curve(curve: xr.Dataset, computed: xr.Dataset) -> Iterator[tuple]:
    """Yield (quantity, unit, calibration, measured, computed) of one damping."""
    name = next((name for name in _HEIGHTS if name in curve), None)
    jumps = {}
    for way, word in ((1, "up"), (-1, "down")):
        measured = _speed_of(curve, f"jump_{word}")
        if not math.isfinite(measured[0]) and name and "direction" in curve.coords:
            part = curve.isel(sample=np.flatnonzero(curve.direction.values == way))
            measured = jump(part.speed.values, part[name].values)
        if math.isfinite(measured[0]):
            model = _UNKNOWN
            if word in computed.direction.values:
                sweep = computed.sel(direction=word)
                model = jump(sweep.speed.values, height(sweep, name or "orbit_height"))
            jumps[word] = measured, model
    if len(jumps) == 2:
        ratios = map(_ratio, jumps["down"], jumps["up"])
        yield "jump down over jump up", "", "none", *ratios
    if name and "direction" in curve.coords and (peaks := _peaks(curve, computed, name)):
        yield f"highest {name} down over up", "", "none", *peaks
    for observable in SWEEP_SCALES:
        if observable in curve:
            yield from _misfit(curve, computed, observable)
    for word, pair in jumps.items():
        yield f"jump {word}", " min-1", "speed", *pair
    onset = _speed_of(curve, "onset_of_contact_loss")
    if math.isfinite(onset[0]):
        yield "onset of contact loss", " min-1", "speed", onset, _onset(computed)


def _speed_of(curve: xr.Dataset, name: str) -> tuple:
    """Return a measured speed and its standard deviation, NaN where they are not known."""
    if name not in curve:
        return _UNKNOWN
    return float(curve[name]), curve[name].attrs.get("noise_std", 0.0) or math.nan


def jump(speed, heights):
    """Return (speed, standard deviation) of the jump of a curve, NaN where it has none."""
    finite = np.isfinite(heights)
    order = np.argsort(speed[finite], kind="stable")
    speed, heights = speed[finite][order], heights[finite][order]
    if speed.size < 4:
        return _UNKNOWN
    steps = np.abs(np.diff(heights))
    i = int(steps.argmax())
    others = np.concatenate([steps[: max(i - 1, 0)], steps[i + 2 :]])
    least = _JUMP_SHARE * np.ptp(heights)
    if steps[i] <= least or steps[i] < _JUMP_RATIO * others.max(initial=0.0):
        return _UNKNOWN
    width = speed[i + 1] - speed[i]
    return 0.5 * (speed[i] + speed[i + 1]), max(width, 1e-300) / math.sqrt(12.0)


def _ratio(numerator: tuple, denominator: tuple) -> tuple:
    """Return the ratio of two numbers with standard deviations."""
    ratio = numerator[0] / denominator[0]
    shares = (deviation / value for value, deviation in (numerator, denominator))
    return ratio, abs(ratio) * math.hypot(*shares)


def _peaks(curve: xr.Dataset, computed: xr.Dataset, name: str) -> list | None:
    """Return the ratio of the highest values downwards and upwards, measured and computed.

    Where the zero of the sensor means nothing, they are counted from the median of both sweeps.
    """
    attrs = curve[name].attrs
    sign = -1.0 if name == "displacement_min" else 1.0
    # At the speeds measured: where a sweep was not run it has no peak.
    model = sign * computed_at(curve, computed, name)
    parts = [curve.direction.values == way for way in (-1, 1)]
    if not all(part.any() for part in parts) or not {"up", "down"} <= {*computed.direction.values}:
        return None
    peaks = []
    noise = attrs["noise_std"] or math.nan
    for values, deviation in ((sign * curve[name].values, noise), (model, 0.0)):
        sweeps = [values[part] for part in parts]
        if not all(np.isfinite(sweep).any() for sweep in sweeps):
            peaks.append(_UNKNOWN)
            continue
        zero = np.nanmedian(np.concatenate(sweeps)) if attrs.get("unknown_offset") else 0.0
        peaks.append(_ratio(*((float(np.nanmax(sweep)) - zero, deviation) for sweep in sweeps)))
    return peaks


def _misfit(curve: xr.Dataset, computed: xr.Dataset, name: str) -> Iterator[tuple]:
    """Yield how far a curve is from the model, rms over its range, by free gain and offset."""
    values, model = curve[name].values, computed_at(curve, computed, name)
    gain, offset = calibration(values, model)
    if not math.isfinite(gain):
        return
    attrs, span = curve[name].attrs, float(np.nanmax(values) - np.nanmin(values))
    noise = attrs["noise_std"] / span
    calibrations = [("free gain and offset", "none", gain * model + offset)]
    if not attrs.get("unknown_gain") and not attrs.get("unknown_offset"):
        calibrations.append(("as calibrated", "sensor", model))
    for words, sensor, fitted in calibrations:
        rms = float(np.sqrt(np.nanmean((values - fitted) ** 2))) / span
        quantity = f"misfit of {name} over its range, {words}"
        yield quantity, "", sensor, (math.nan, noise or math.nan), (rms, math.nan)


def _onset(computed: xr.Dataset) -> tuple:
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


def _of_orders(tracks: xr.Dataset) -> Iterator[tuple]:
    """Yield (quantity, unit, calibration, measured, computed) of the orders of one damping."""
    for i, j in np.ndindex(tracks.sizes["track"], tracks.sizes["observable"]):
        track = tracks.isel(track=i, observable=j)
        name, both = str(track.observable.values), (track.amplitude, track.computed_amplitude)
        largest = [np.nanmax(values.values, axis=1) for values in both]
        for k in range(1, track.sizes["order"]):
            ratios = [(float(peaks[k] / peaks[0]), math.nan) for peaks in largest]
            yield f"largest order {k + 1}z of {name} over order z", "", "none", *ratios
        speeds = [float(track.speed[int(np.nanargmax(values.values[0]))]) for values in both]
        yield f"largest order z of {name}", " min-1", "speed", *((n, math.nan) for n in speeds)


def _of_courses(courses: xr.Dataset) -> Iterator[tuple]:
    """Yield (quantity, unit, calibration, measured, computed) of the harmonics of one damping."""
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
