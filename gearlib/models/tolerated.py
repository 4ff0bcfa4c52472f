"""What of a gear pair and of drawn gears may scatter, and the plain ways to say how.

No numerical stack: a start of the workflow reads this.
"""

import math
import re

from gearlib import checks, parameters
from gearlib.models.geometry.gear import SpurGear
from gearlib.models.geometry.mesh import Mesh
from gearlib.models.pair_parameters import PairParameters
from gearlib.models.parameter_values import RATIOS

#: Keys of the plain kinds; what the first one means of the next two is their value where a model
#: or drawing has it.
KINDS = (("mean", "std"), ("min", "max"), ("nominal", "upper", "lower"))
#: How to say it, for refusals.
WORDS = (
    "one of {mean, std}, {min, max}, {nominal, upper, lower} with deviations from the nominal "
    "value, or {distribution: a name of scipy.stats, and its parameters}"
)
_LEFT_OUT = ("mean", "nominal")
_PERCENT = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*%")


def _declared(kind, words, symbol):
    return parameters.Parameter(kind, words, symbol, parameters.MISSING)


#: Of the load and the damping of drawn gears.
OF_LOAD = {
    "torque": _declared(parameters.DRIVING_TORQUE, "Torque of the pinion", "T"),
    "damping_ratio": _declared(parameters.NONNEGATIVE, "Damping ratio in contact", "beta"),
    "material_damping": _declared(parameters.DAMPING, "Damping of the material in contact", "k_1"),
    "backlash_damping_ratio": _declared(
        parameters.NONNEGATIVE, "Damping ratio in the backlash", "beta_m"
    ),
}
#: First mesh harmonic of the deviation of the flanks of drawn gears.
OF_FLANKS = {
    f"deviation_{name}": _declared(
        parameters.ERROR, f"First mesh harmonic of the deviation of the flanks, its {name}", "f"
    )
    for name in ("cosine", "sine")
}


def numbers(thing):
    """Return name -> `Parameter` of the real numbers that something declares."""
    found = parameters.declared(thing)
    return {name: one for name, one in found.items() if isinstance(one.kind, parameters.Number)}


def of_pair():
    """Return name -> `Parameter` of a gear pair, its ratios too."""
    ratio = {name: _declared(parameters.NONNEGATIVE, name.replace("_", " "), "") for name in RATIOS}
    return numbers(PairParameters) | ratio


def of_drawing():
    """Return name -> `Parameter` of two drawn gears: ``pinion.shift``, ``centre_distance``."""
    found = numbers(Mesh) | OF_LOAD | OF_FLANKS
    for gear in ("pinion", "wheel"):
        found |= {f"{gear}.{name}": one for name, one in numbers(SpurGear).items()}
    return found


def complete(key, given, own=None):
    """Return the numbers of a plain kind, a dict of float.

    Parameters
    ----------
    key : str
        For refusals.
    given : mapping
        Those of one of `KINDS`. Deviations may be texts such as ``"5 %"`` of mean or nominal value.
    own : float, optional
        The value of the model or drawing, for ``mean`` and ``nominal`` where they are left out.

    Raises
    ------
    ValueError
        Naming the key, its value and the allowed range.
    """
    given = dict(given) if hasattr(given, "items") else checks.refusal(key, given, WORDS)
    if isinstance(given, ValueError):
        raise given
    kind = next((one for one in KINDS if given and {*given} <= {*one}), ())
    missing = [name for name in kind if name not in given]
    said = f", of {kind[0]} = {given[kind[0]]!r}" if kind and kind[0] in given else ""
    if not kind or any(name not in _LEFT_OUT for name in missing):
        raise checks.refusal(key, given, WORDS)
    if missing and own is None:
        raise ValueError(f"{key}.{missing[0]} is missing: the model has no value of its own")
    given |= dict.fromkeys(missing, own)
    whole: dict = {}
    for name in kind:
        value, words = given[name], "a finite number"
        if name in ("std", "upper", "lower"):
            words = "a finite number, or a share such as '5 %'"
            share = _PERCENT.fullmatch(value.strip()) if isinstance(value, str) else None
            if share:
                value = float(share[1]) / 100.0 * abs(whole[kind[0]])
        whole[name] = checks.number(f"{key}.{name}", value, words, math.isfinite)
    if "std" in whole:
        checks.require(whole["std"] > 0.0, f"{key}.std", given["std"], f"> 0{said}")
    else:
        low, high = ("min", "max") if "min" in whole else ("lower", "upper")
        words = f"> {low} = {given[low]!r}"
        words += said if "nominal" in whole else ""
        checks.require(whole[low] < whole[high], f"{key}.{high}", given[high], words)
    return whole


def extent(whole):
    """Return (centre, least, largest) of the numbers of a plain kind."""
    if "std" in whole:
        return whole["mean"], -math.inf, math.inf
    if "min" in whole:
        return (whole["min"] + whole["max"]) / 2.0, whole["min"], whole["max"]
    nominal = whole["nominal"]
    return nominal, nominal + whole["lower"], nominal + whole["upper"]


def check_range(key, given, parameter, extent):
    """Refuse what a parameter can never be; the ends of a tail are a matter of each sample."""
    kind = getattr(parameter, "kind", None)
    if isinstance(kind, parameters.Number):
        values = "least value of {}", "largest value of {}"
        names = ("{}.min", "{}.max") if "min" in given else values
        for name, end in zip(names, extent[1:], strict=True):
            if math.isfinite(end):
                kind.check(name.format(key), end)
        own = next((name for name in _LEFT_OUT if name in given), None)
        kind.check(f"{key}.{own}" if own else f"middle of {key}", extent[0])
