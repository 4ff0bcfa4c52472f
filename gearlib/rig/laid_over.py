"""A measured curve over resonance characteristics: in static deflections, at its tunings."""

import numpy as np
import xarray as xr

from gearlib.rig.measured import read_measured

#: Observable -> its scale to SI among the variables of the characteristics.
SCALES = {
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
#: Time courses -> what their largest and least values are.
_ENVELOPES = {
    "displacement": ("displacement_max", "displacement_min"),
    "dynamic_force": ("dynamic_force_max", "dynamic_force_min"),
}
#: Stretches of a run-up whose extremes are taken, and samples that each of them has at least.
_STRETCHES, _LEAST = 400, 20
#: How the speed was reached -> the sweep of the characteristics.
SWEEPS = {0: "cold", 1: "up", -1: "down"}


def compute(path, resonance):
    """Return a measured set by its path as a curve in the scales of a model.

    resonance: characteristics as gathered, of which the speeds and scales count.

    Over ``sample``: tuning, speed, direction, and what there is of `SCALES` in static deflections
    and loads; jumps and the onset of contact loss (min-1). A run-up gives the extremes of
    displacement and force of several hundred stretches. Attributes are those of `read_measured`.
    """
    rig = read_measured(path)
    curve = rig if set(SCALES) & set(rig.data_vars) else _envelope(rig)
    rate = float(resonance.tuning[-1] / resonance.speed[-1])
    found = rig[[name for name in rig.data_vars if rig[name].dims == ()]]
    found = found.drop_vars(list(found.coords))
    if "speed" in curve.coords and set(SCALES) & set(curve.data_vars):
        direction = curve.coords.get("direction", xr.zeros_like(curve.speed, np.int8))
        where = {"speed": curve.speed, "tuning": rate * curve.speed, "direction": direction}
        found = found.assign_coords({name: ("sample", one.values) for name, one in where.items()})
        for name in [one for one in SCALES if one in curve]:
            found[name] = "sample", *_scaled(curve[name], resonance, SCALES[name])
            _fit(found, name, resonance)
    return found.assign_attrs(rig.attrs | {"tuning_rate": rate})


def computed_at(curve, computed, name):
    """Return the values of one damping at the speeds of a curve and by its sweeps, NaN beyond."""
    found = np.full(curve.sizes["sample"], np.nan)
    for way, word in SWEEPS.items():
        if word in computed.direction.values:
            own = curve.direction.values == way
            one = computed.sel(direction=word)
            at = curve.speed.values[own]
            found[own] = np.interp(at, one.speed.values, height(one, name), np.nan, np.nan)
    return found


def height(computed, name):
    """Return an observable of characteristics; orbit_height is made of both extremes."""
    if name == "orbit_height":
        return computed.displacement_max.values - computed.displacement_min.values
    return computed[name].values


def fitted(values, model, gain=True, offset=True):
    """Return (gain, offset) of the line through values over a model, NaN of what is too few.

    What is not asked for is 1 and 0.
    """
    good = np.isfinite(values) & np.isfinite(model)
    values, model = values[good], model[good]
    if values.size < 4 or np.ptp(values) == 0.0:
        return np.nan, np.nan
    columns = ([model] if gain else []) + ([np.ones(model.size)] if offset else [])
    rest = values if gain else values - model
    found = list(np.linalg.lstsq(np.stack(columns, axis=1), rest, rcond=None)[0])
    return (found.pop(0) if gain else 1.0), (found.pop(0) if offset else 0.0)


def _fit(found, name, resonance):
    """Put the gain and the offset of a sensor into the attributes, by the damping that suits best.

    They turn its values into those of the model: (value - offset) / gain.
    """
    attrs, values = found[name].attrs, found[name].values
    unknown = [bool(attrs.get(f"unknown_{one}")) for one in ("gain", "offset")]
    attrs |= {"fitted_gain": 1.0, "fitted_offset": 0.0}
    best = np.inf
    for damping in resonance.damping.values if any(unknown) else ():
        model = computed_at(found, resonance.sel(damping=damping), name)
        gain, offset = fitted(values, model, *unknown)
        misfit = np.nanmean((gain * model + offset - values) ** 2) if np.isfinite(gain) else np.inf
        if misfit < best and gain > 0.0:
            best = misfit
            attrs |= {"fitted_gain": float(gain), "fitted_offset": float(offset)}


def _scaled(values, resonance, scale):
    """Return values over a scale of the model, and their attributes."""
    own = values.attrs.get("units") not in ("1", "count")
    factor = 1.0 / float(resonance[scale]) if scale and own else 1.0
    noise = factor * values.attrs.get("noise_std", 0.0)
    return values.values * factor, values.attrs | {"units": "1", "noise_std": noise}


def _envelope(rig):
    """Return the extremes of the time courses of a run-up over its speed."""
    if not {"time", "speed"} <= set(rig.coords) or np.ptp(rig.speed.values) == 0.0:
        return xr.Dataset()
    speed = rig.speed.values
    count = max(1, min(_STRETCHES, speed.size // _LEAST))
    starts = np.arange(count) * speed.size // count
    last = np.append(starts[1:], speed.size) - 1
    direction = np.sign(speed[last] - speed[starts]).astype(np.int8)
    if "direction" in rig.coords:
        direction = rig.direction.values[starts]
    mean = np.add.reduceat(speed, starts) / (last - starts + 1)
    found = xr.Dataset(coords={"speed": ("sample", mean), "direction": ("sample", direction)})
    for name, (most, least) in _ENVELOPES.items():
        if name in rig:
            values, attrs = rig[name].values, rig[name].attrs
            found[most] = "sample", np.fmax.reduceat(values, starts), attrs
            found[least] = "sample", np.fmin.reduceat(values, starts), attrs
    return found
