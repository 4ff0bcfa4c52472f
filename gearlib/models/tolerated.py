"""Parameters of gear pairs and drawn gears that can scatter, and plain descriptions of scatter."""

import math
import re

from gearlib import checks, parameters
from gearlib.models.geometry.gear import SpurGear
from gearlib.models.geometry.mesh import Mesh
from gearlib.models.pair_parameters import RATIOS, PairParameters
from gearlib.parameters import Parameter, numbers

#: Keys of the plain descriptions of a scattering value.
KINDS = (("mean", "std"), ("min", "max"), ("nominal", "upper", "lower"))
#: Allowed descriptions, for error messages.
WORDS = (
    "one of {mean, std}, {min, max}, {nominal, upper, lower} with deviations from the nominal "
    "value, or {distribution: a name of scipy.stats, and its parameters}"
)
_LEFT_OUT = ("mean", "nominal")
_PERCENT = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*%")


#: Parameters of the load and the damping of drawn gears.
OF_LOAD = {
    "torque": Parameter(parameters.DRIVING_TORQUE, "Torque of the pinion", "T"),
    "damping_ratio": Parameter(parameters.NONNEGATIVE, "Damping ratio in contact", "beta"),
    "material_damping": Parameter(parameters.DAMPING, "Damping of the material in contact", "k_1"),
    "backlash_damping_ratio": Parameter(
        parameters.NONNEGATIVE, "Damping ratio in the backlash", "beta_m"
    ),
}
#: Parameters of the first mesh harmonic of the flank deviation of drawn gears.
OF_FLANKS = {
    f"deviation_{name}": Parameter(
        parameters.ERROR, f"First mesh harmonic of the deviation of the flanks, its {name}", "f"
    )
    for name in ("cosine", "sine")
}


def of_pair():
    """Return the parameters and ratios of a gear pair that can scatter, name -> `Parameter`."""
    ratios = {name: Parameter(parameters.NONNEGATIVE, name.replace("_", " ")) for name in RATIOS}
    return numbers(PairParameters) | ratios


def of_drawing():
    """Return the parameters of drawn gears that can scatter, such as ``pinion.shift``."""
    parameters_of_both = numbers(Mesh) | OF_LOAD | OF_FLANKS
    for gear in ("pinion", "wheel"):
        parameters_of_both |= {f"{gear}.{name}": x for name, x in numbers(SpurGear).items()}
    return parameters_of_both


def complete(key, law, model_value=None):
    """Return a plain description of scatter with all its numbers, a dict of float.

    Deviations may be texts such as ``"5 %"`` of the mean or nominal value. `model_value` is the
    default of ``mean`` and ``nominal``. Raises ValueError with the name `key` if `law` is not one
    of `KINDS`.
    """
    checks.require(hasattr(law, "items"), key, law, WORDS)
    law = dict(law)
    names: tuple = next((kind for kind in KINDS if law and {*law} <= {*kind}), ())
    missing = [name for name in names if name not in law]
    checks.require(names and {*missing} <= {*_LEFT_OUT}, key, law, WORDS)
    centre = names[0]
    suffix = "" if missing else f", of {centre} = {law[centre]!r}"
    if missing and model_value is None:
        raise ValueError(f"{key}.{centre} is missing: the model has no value of its own")
    law |= dict.fromkeys(missing, model_value)
    values: dict = {}
    for name in names:
        value, allowed = law[name], "a finite number"
        if name in ("std", "upper", "lower"):
            allowed = "a finite number, or a share such as '5 %'"
            percentage = _PERCENT.fullmatch(value.strip()) if isinstance(value, str) else None
            if percentage:
                value = float(percentage[1]) / 100.0 * abs(values[centre])
        values[name] = checks.number(f"{key}.{name}", value, allowed, math.isfinite)
    if "std" in values:
        checks.require(values["std"] > 0.0, f"{key}.std", law["std"], f"> 0{suffix}")
    else:
        low, high = ("min", "max") if "min" in values else ("lower", "upper")
        allowed = f"> {low} = {law[low]!r}" + (suffix if "nominal" in values else "")
        checks.require(values[low] < values[high], f"{key}.{high}", law[high], allowed)
    return values


def extent(values):
    """Return (centre, smallest value, largest value) of a completed plain description."""
    if "std" in values:
        return values["mean"], -math.inf, math.inf
    if "min" in values:
        return (values["min"] + values["max"]) / 2.0, values["min"], values["max"]
    nominal = values["nominal"]
    return nominal, nominal + values["lower"], nominal + values["upper"]


def check_range(key, law, parameter, extent):
    """Raise ValueError if the centre or a finite end of a scatter is not possible."""
    kind = getattr(parameter, "kind", None)
    if not isinstance(kind, parameters.Number):
        return
    values = "least value of {}", "largest value of {}"
    names = ("{}.min", "{}.max") if "min" in law else values
    for name, end in zip(names, extent[1:], strict=True):
        if math.isfinite(end):
            kind.check(name.format(key), end)
    centre = next((name for name in _LEFT_OUT if name in law), None)
    kind.check(f"{key}.{centre}" if centre else f"middle of {key}", extent[0])
