"""How far measured curves and a model agree, first by what needs no calibration: a table."""

import math

import numpy as np
import xarray as xr

from gearlib.rig.laid_over import SCALES, computed_at, fitted, height

COLUMNS = [
    "set", "quantity", "calibration", "damping", "measured", "standard_deviation", "computed",
    "difference", "deviations", "words",
]  # fmt: skip
#: Of which the height of a resonance is taken, the first that a set has.
_HEIGHTS = ("orbit_height", "displacement_max", "dynamic_force_max", "displacement_min")
#: A jump is a step between neighbouring speeds of so much of the range, and so many times as large
#: as the largest that is not beside it.
_SHARE, _ABOVE = 0.15, 2.0
_NONE = (math.nan, math.nan)


def rows(curves, resonance, courses=(), orders=()):
    """Yield the names of the columns, then a row for each quantity, damping and measured set.

    curves: as of `laid_over.compute`; resonance: characteristics as gathered; courses: as of
    `measured_courses.compute`; orders: as of `measured_orders.compute`. Numbers that are not known
    are empty.
    """
    yield COLUMNS
    for curve in curves:
        for damping in resonance.damping.values:
            own = resonance.sel(damping=damping)
            for found in _of_curve(curve, own):
                yield _row(curve.attrs["title"], str(damping), *found)
    for course in courses:
        for damping in resonance.damping.values:
            for found in _of_course(course.sel(damping=damping)):
                yield _row(course.attrs["title"], str(damping), *found)
    for track in orders:
        for damping in resonance.damping.values:
            for found in _of_orders(track.sel(damping=damping)):
                yield _row(track.attrs["title"], str(damping), *found)


def _row(title, damping, quantity, unit, calibration, measured, computed):
    """Return a row; measured, computed: (value, standard deviation)."""
    (value, std), (model, resolution) = measured, computed
    difference = model - value
    spread = math.hypot(std, resolution if math.isfinite(resolution) else 0.0)
    away = difference / spread if std > 0 else math.nan
    if not math.isfinite(value):
        words = f"{quantity}: {model:.3g}" + (f", noise {std:.3g}" if std > 0 else "")
    elif not math.isfinite(model):
        words = f"{quantity}: measured {value:.4g}{unit}, none computed"
    else:
        words = f"{quantity}: measured {value:.4g}{unit}, computed {model:.4g}{unit}"
        if math.isfinite(away):
            words += f", {abs(away):.1f} standard deviations {'more' if away > 0 else 'less'}"
    numbers = [value, std, model, difference, away]
    shown = ["" if not math.isfinite(one) else float(f"{one:.6g}") for one in numbers]
    return [title, quantity + unit, calibration, damping, *shown, f"{words} ({damping})"]


def _of_curve(curve, computed):
    """Yield (quantity, unit, calibration, measured, computed) of one damping."""
    name = next((one for one in _HEIGHTS if one in curve), None)
    jumps = {}
    for way, word in ((1, "up"), (-1, "down")):
        measured = speed_of(curve, f"jump_{word}")
        if not math.isfinite(measured[0]) and name and "direction" in curve.coords:
            part = curve.isel(sample=np.flatnonzero(curve.direction.values == way))
            measured = jump(part.speed.values, part[name].values)
        if not math.isfinite(measured[0]):
            continue
        model = _NONE
        if word in computed.direction.values:
            one = computed.sel(direction=word)
            model = jump(one.speed.values, height(one, name or "orbit_height"))
        jumps[word] = measured, model
    if len(jumps) == 2:
        yield (
            "jump down over jump up",
            "",
            "none",
            *(_ratio(jumps["down"][i], jumps["up"][i]) for i in (0, 1)),
        )
    peaks = _peaks(curve, computed, name) if name and "direction" in curve.coords else None
    if peaks:
        yield f"highest {name} down over up", "", "none", *peaks
    for name in [one for one in SCALES if one in curve]:
        yield from _misfit(curve, computed, name)
    for word, found in jumps.items():
        yield f"jump {word}", " min-1", "speed", *found
    onset = speed_of(curve, "onset_of_contact_loss")
    if math.isfinite(onset[0]):
        yield "onset of contact loss", " min-1", "speed", onset, _onset(computed)


def speed_of(curve, name):
    """Return (speed, standard deviation) of what was measured as a speed, NaN where it was not."""
    if name not in curve:
        return _NONE
    return float(curve[name]), curve[name].attrs.get("noise_std", 0.0) or math.nan


def jump(speed, height):
    """Return (speed, standard deviation) of the jump of a curve, NaN where it has none."""
    good = np.isfinite(height)
    order = np.argsort(speed[good], kind="stable")
    speed, height = speed[good][order], height[good][order]
    if speed.size < 4:
        return _NONE
    steps = np.abs(np.diff(height))
    at = int(steps.argmax())
    others = np.delete(steps, [i for i in (at - 1, at, at + 1) if 0 <= i < steps.size])
    most = others.max(initial=0.0)
    if steps[at] <= _SHARE * np.ptp(height) or steps[at] < _ABOVE * most:
        return _NONE
    width = speed[at + 1] - speed[at]
    return 0.5 * (speed[at] + speed[at + 1]), max(width, 1e-300) / math.sqrt(12.0)


def _ratio(one, other):
    """Return the ratio of two numbers with standard deviations."""
    ratio = one[0] / other[0]
    return ratio, abs(ratio) * math.hypot(one[1] / one[0], other[1] / other[0])


def _peaks(curve, computed, name):
    """Return the ratio of the highest values downwards and upwards, measured and computed.

    Where the zero of the sensor means nothing, they are counted from the median of both sweeps.
    """
    attrs = curve[name].attrs
    sign = -1.0 if name == "displacement_min" else 1.0
    measured, model = [], []
    for way, word in ((-1, "down"), (1, "up")):
        own = np.flatnonzero(curve.direction.values == way)
        if not own.size or word not in computed.direction.values:
            return None
        speed = curve.speed.values[own]
        measured.append(sign * curve[name].values[own])
        one = computed.sel(direction=word)
        # At the speeds measured: where a sweep was not run it has no peak.
        model.append(sign * np.interp(speed, one.speed.values, height(one, name)))
    std, found = attrs["noise_std"] or math.nan, []
    for values, noise in ((measured, std), (model, 0.0)):
        zero = np.nanmedian(np.concatenate(values)) if attrs.get("unknown_offset") else 0.0
        if not all(np.isfinite(one).any() for one in values):
            found.append(_NONE)
            continue
        found.append(_ratio(*((float(np.nanmax(one)) - zero, noise) for one in values)))
    return found


def _misfit(curve, computed, name):
    """Yield how far a curve is from the model, rms over its range, by free gain and offset."""
    values, model = curve[name].values, computed_at(curve, computed, name)
    gain, offset = fitted(values, model)
    if not math.isfinite(gain):
        return
    attrs, spread = curve[name].attrs, float(np.nanmax(values) - np.nanmin(values))
    noise = attrs["noise_std"] / spread
    ways = [("free gain and offset", "none", gain * model + offset)]
    if not attrs.get("unknown_gain") and not attrs.get("unknown_offset"):
        ways.append(("as calibrated", "sensor", model))
    for words, calibration, there in ways:
        rms = float(np.sqrt(np.nanmean((values - there) ** 2))) / spread
        quantity = f"misfit of {name} over its range, {words}"
        yield quantity, "", calibration, (math.nan, noise or math.nan), (rms, math.nan)


def _onset(computed):
    """Return the lowest speed at which the sweep up begins to lose contact, and its resolution."""
    if "up" not in computed.direction.values:
        return _NONE
    one = computed.sel(direction="up").sortby("speed")
    lost = one.fraction_normal.values < 1.0 - 1e-9
    begins = np.flatnonzero(lost[1:] & ~lost[:-1])
    if not begins.size:
        return _NONE
    low, high = one.speed.values[begins[0] : begins[0] + 2]
    return 0.5 * (low + high), (high - low) / math.sqrt(12.0)


def _of_orders(track):
    """Yield (quantity, unit, calibration, measured, computed) of the orders of one damping."""
    for place in np.ndindex(track.sizes["track"], track.sizes["observable"]):
        one = track.isel(track=place[0], observable=place[1])
        name, both = str(one.observable.values), (one.amplitude, one.computed_amplitude)
        most = [np.nanmax(values.values, axis=1) for values in both]
        for k in range(1, one.sizes["order"]):
            ratios = [(float(own[k] / own[0]), math.nan) for own in most]
            yield f"largest order {k + 1}z of {name} over order z", "", "none", *ratios
        at = [float(one.speed[int(np.nanargmax(values.values[0]))]) for values in both]
        yield f"largest order z of {name}", " min-1", "speed", *((x, math.nan) for x in at)


def _of_course(course):
    """Yield (quantity, unit, calibration, measured, computed) of the harmonics of one damping."""
    for place in np.ndindex(course.sizes["course"], course.sizes["observable"]):
        one = course.isel(course=place[0], observable=place[1])
        name, speed = str(one.observable.values), float(one.speed)
        if not math.isfinite(float(one.amplitude[0])):
            continue
        known = one.amplitude, one.amplitude_std
        model = one.computed_amplitude, xr.zeros_like(one.computed_amplitude)
        for k in range(1, one.sizes["harmonic"]):
            at = f"of {name} at {speed:.4g} min-1"
            ratios = [
                _ratio((float(a[k]), float(std[k])), (float(a[0]), float(std[0])))
                for a, std in (known, model)
            ]
            yield f"harmonic {k + 1} over the first {at}", "", "none", *ratios
            lag = float(one.shape_phase[k]), float(one.shape_phase_std[k])
            near = float(one.computed_shape_phase[k])
            near += 360.0 * round((lag[0] - near) / 360.0)
            quantity = f"phase of harmonic {k + 1} less {k + 1} times that of the first {at}"
            yield quantity, " deg", "none", lag, (near, math.nan)
