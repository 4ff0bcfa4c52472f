"""What a fit refuses of a dataset, in one sentence each; it need not come from a file."""

import json

import numpy as np

from gearlib import checks
from gearlib.data import measured_names
from gearlib.runs.run_up import speeds_of

#: What ``known.options`` may say of a run-up.
_OPTIONS = ("load", "driver", "driven_mass", "base_radius", "initial_state")


def check(data, compared, speeds):
    """Raise ValueError unless what is compared are numbers in SI of a noise that can be.

    compared: name of a variable over samples -> what it is; speeds: names of scalars.
    """
    for name in ("time", "speed", "direction"):
        if compared and name in data.coords:
            _numbers(name, data[name])
    if compared and "direction" in data.coords:
        for way in np.unique(data.direction.values).tolist():
            checks.one_of("direction", way, (1, -1, 0))
    for name, what in compared.items():
        _numbers(name, data[name], gaps="time" in data.coords)
        _sensor(name, what, data[name].attrs)
    for name in speeds:
        one = data[name]
        checks.require(one.ndim == 0, name, f"of shape {one.shape}", "one number, in rpm")
        checks.finite_positive(name, one.values[()])
        _sensor(name, name, one.attrs)


def _numbers(name, one, gaps=False):
    """Refuse values of a variable that are not one finite number for each sample, but for gaps."""
    values = one.values
    checks.require(values.dtype.kind in "iuf", name, str(values.dtype), "of real numbers")
    checks.require(one.ndim == 1, name, f"of shape {values.shape}", "over samples alone")
    checks.require(values.size > 0, name, "empty", "of one sample or more")
    finite = np.isfinite(values)
    complete = finite.any() and (finite | (gaps & np.isnan(values))).all()
    checks.require(complete, name, "NaN", "finite in each sample")


def _sensor(name, what, attrs):
    """Refuse attributes that say of a sensor what cannot be."""
    checks.finite_nonnegative(f"noise_std of {name}", attrs.get("noise_std", 0.0))
    for key in ("unknown_gain", "unknown_offset"):
        checks.integer(f"{key} of {name}", int(attrs.get(key, 0)), 0, 1)
    # The amplitudes that are compared are those of a displacement.
    wanted = measured_names.of(what)[0] or "m"
    given = attrs.get("units", wanted)
    fits = given == wanted or attrs.get("unknown_gain", 0)
    checks.require(fits, f"units of {name}", given, f"{wanted}, or of unknown gain")


def known(data):
    """Return what is known of a rig."""
    text = data.attrs.get("known", "{}")
    try:
        found = json.loads(text)
        if isinstance(found, dict):
            return found
    except (TypeError, ValueError):
        pass
    raise checks.refusal("known", text, "a mapping as a text, of json.dumps")


def course_of(found):
    """Return (rows of s and rpm, options of the run-up) of what is known of a rig."""
    if "course" not in found:
        raise ValueError(
            "known.course is missing: a run-up needs its course of speed, rows of s and rpm"
        )
    options = found.get("options", {})
    checks.require(isinstance(options, dict), "known.options", options, "a mapping")
    for name in options:
        checks.one_of("known.options", name, _OPTIONS)
    try:
        return speeds_of(speed=found["course"]).tolist(), options
    except ValueError as error:
        raise ValueError(f"known.course: {error}") from None
