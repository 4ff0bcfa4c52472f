"""Parameters of gear pairs and gear geometries that can scatter, and checks of their scatter."""

import math
import re
from typing import Annotated, Any

from gearlib import checks
from gearlib.models.geometry.gear import SpurGear
from gearlib.models.geometry.gear_stage import GearStage
from gearlib.models.pair_parameters import RATIOS, PairParameters
from gearlib.parameters import (
    Allowed,
    BacklashDampingRatio,
    DrivingTorque,
    Error,
    Finite,
    MaterialDamping,
    NonNegative,
    Parameter,
    check,
    described,
    numeric_parameters,
)

#: Sets of configuration keys that describe the scatter of a parameter.
SCATTER_KEYS = (("mean", "std"), ("min", "max"), ("nominal", "upper", "lower"))
#: The allowed descriptions of scatter, for error messages.
ALLOWED_SCATTER = (
    "one of {mean, std}, {min, max}, {nominal, upper, lower} with deviations from the nominal "
    "value, or {distribution: a name of scipy.stats, and its parameters}"
)
_Deviation = Annotated[Finite, Allowed("a finite number, or a percentage such as '5 %'")]
_OPTIONAL_KEYS = ("mean", "nominal")
_PERCENT = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*%")


#: Parameters of the load and the damping of gear geometries.
LOAD_PARAMETERS = {
    "torque": Parameter(Annotated[DrivingTorque, described("Torque of the pinion", "T")]),
    "damping_ratio": Parameter(Annotated[NonNegative, described("Damping ratio in contact")]),
    "material_damping": Parameter(MaterialDamping),
    "backlash_damping_ratio": Parameter(BacklashDampingRatio),
}
#: Parameters of the first mesh harmonic of the flank deviation of gear geometries.
FLANK_PARAMETERS = {
    f"deviation_{name}": Parameter(
        Annotated[
            Error, described(f"First mesh harmonic of the deviation of the flanks, its {name}", "f")
        ]
    )
    for name in ("cosine", "sine")
}


def pair_parameters() -> dict[str, Parameter]:
    """Return the parameters of a gear pair that can scatter, as a dict name -> `Parameter`.

    Each `Parameter` has a type, a unit and a description. Ratios such as ``damping_ratio`` are
    included.
    """
    ratios = {
        name: Parameter(Annotated[NonNegative, described(name.replace("_", " "))])
        for name in RATIOS
    }
    return numeric_parameters(PairParameters) | ratios


def geometry_parameters() -> dict[str, Any]:
    """Return the parameters of a gear geometry that can scatter, as a dict name -> `Parameter`.

    Each `Parameter` has a type, a unit and a description. The dict contains the parameters of the
    stage, of its load and damping, and of both gears; the latter have a prefix as in
    ``pinion.shift``.
    """
    parameters = numeric_parameters(GearStage) | LOAD_PARAMETERS | FLANK_PARAMETERS
    for gear_name in ("pinion", "wheel"):
        for name, parameter in numeric_parameters(SpurGear).items():
            parameters[f"{gear_name}.{name}"] = parameter
    return parameters


def complete_scatter(parameter_name, scatter, model_value=None) -> dict[str, float]:
    """Check the description of a parameter's scatter, and return it as numbers with all keys.

    `scatter` is a dict with the keys of one of `SCATTER_KEYS`, e.g. mean and std. The values of
    std, upper and lower may be strings such as ``"5 %"``, a percentage of the mean or nominal
    value. `model_value` is the default of ``mean`` and ``nominal``, or None. Raises ValueError with
    the parameter name if the dict is invalid.
    """
    checks.require(hasattr(scatter, "items"), parameter_name, scatter, ALLOWED_SCATTER)
    scatter = dict(scatter)
    keys: tuple = ()  # The first set in SCATTER_KEYS that includes all keys of `scatter`.
    if scatter:
        keys = next((keys for keys in SCATTER_KEYS if {*scatter} <= {*keys}), ())
    missing_keys = [key for key in keys if key not in scatter]
    is_complete = keys and {*missing_keys} <= {*_OPTIONAL_KEYS}
    checks.require(is_complete, parameter_name, scatter, ALLOWED_SCATTER)
    centre = keys[0]
    suffix = "" if missing_keys else f", of {centre} = {scatter[centre]!r}"
    if missing_keys and model_value is None:
        raise ValueError(
            f"{parameter_name}.{centre} is missing: the model has no value of this parameter"
        )
    scatter |= dict.fromkeys(missing_keys, model_value)  # Only the centre may be missing.
    values: dict = {}
    for key in keys:
        value, value_type = scatter[key], Finite
        if key in ("std", "upper", "lower"):
            # A deviation may be a percentage of the centre, which is checked first.
            value_type = _Deviation
            percentage = _PERCENT.fullmatch(value.strip()) if isinstance(value, str) else None
            if percentage:
                value = float(percentage[1]) / 100.0 * abs(values[centre])
        values[key] = check(f"{parameter_name}.{key}", value, value_type)
    if "std" in values:
        checks.require(values["std"] > 0.0, f"{parameter_name}.std", scatter["std"], f"> 0{suffix}")
    else:
        low, high = ("min", "max") if "min" in values else ("lower", "upper")
        allowed = f"> {low} = {scatter[low]!r}"
        if "nominal" in values:
            allowed += suffix
        checks.require(
            values[low] < values[high], f"{parameter_name}.{high}", scatter[high], allowed
        )
    return values


def centre_and_limits(values: dict[str, float]) -> tuple[float, float, float]:
    """Return (centre, minimum, maximum) of a parameter that scatters.

    `values` is a result of `complete_scatter` with the keys {mean, std}, {min, max} or {nominal,
    upper, lower}, where upper and lower are deviations from the nominal value. The limits are
    infinite if the scatter is given by a standard deviation.
    """
    if "std" in values:
        return values["mean"], -math.inf, math.inf
    if "min" in values:
        return (values["min"] + values["max"]) / 2.0, values["min"], values["max"]
    nominal = values["nominal"]
    return nominal, nominal + values["lower"], nominal + values["upper"]


def check_range(parameter_name, scatter, parameter, values) -> None:
    """Raise ValueError if the centre or a finite limit of the scatter is no allowed value.

    `values` are (centre, minimum, maximum). `parameter` is the `Parameter` that checks a value, or
    None for no check. `scatter` is the dict of the user, whose keys, such as "min", identify the
    wrong value in the message.
    """
    if parameter is None or parameter.numeric_unit is None:
        return
    centre, *limits = values
    if "min" in scatter:
        limit_names = f"{parameter_name}.min", f"{parameter_name}.max"
    else:
        limit_names = f"minimum of {parameter_name}", f"maximum of {parameter_name}"
    for limit_name, limit in zip(limit_names, limits, strict=True):
        if math.isfinite(limit):
            parameter.check(limit_name, limit)
    centre_name = f"centre of {parameter_name}"
    for key in _OPTIONAL_KEYS:
        if key in scatter:
            centre_name = f"{parameter_name}.{key}"
            break
    parameter.check(centre_name, centre)
