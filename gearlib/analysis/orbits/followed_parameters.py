"""Parameters for the continuation of orbits: one of them changes, all others are constant.

The tuning and the ratios of the pair are dimensionless. All other ratios are constant, too: another
contact ratio changes neither the mean stiffness nor the damping ratios.
"""

import dataclasses
from typing import Annotated, Any, Literal

import numpy as np

from gearlib import checks, parameters
from gearlib.engines.pair.stiffness import mean_over_max
from gearlib.models.model import is_model
from gearlib.models.pair_parameters import RATIOS, ratio_fields
from gearlib.parameters import CHOICE, Backlash, NonNegative, Positive
from gearlib.runs.run_arguments import check_tuning

#: Name -> (CF units, long_name) of the parameters of every gear pair.
DIMENSIONLESS_PARAMETERS = {
    "tuning": ("1", "tuning nu, mesh frequency over mean eigenfrequency"),
    "damping": ("1", "damping ratio beta of the material in contact"),
    "backlash_damping": ("1", "damping ratio beta_m of the oil in free flight"),
    "backlash_ratio": ("1", "backlash in static deflections"),
    "contact_ratio": ("1", "contact ratio epsilon"),
    "stiffness_ratio": ("1", "stiffness ratio kappa = C_min / C_max"),
}
DimensionlessParameter = Annotated[
    Literal[
        "tuning",
        "damping",
        "backlash_damping",
        "backlash_ratio",
        "contact_ratio",
        "stiffness_ratio",
    ],
    CHOICE,
]
#: Parameter -> attribute of models with its value, if the names differ.
_ATTRIBUTE_NAMES = {
    "damping": "damping_ratio",
    "backlash_damping": "backlash_damping_ratio",
}


def continuation_parameters(model: Any) -> dict:
    """Return {name: CF attributes units and long_name} of the parameters for a continuation.

    A model with one pair of gears, the `GearPair` `model.pair`, has all dimensionless ones.
    """
    parameters = (DIMENSIONLESS_PARAMETERS if model.pair else {}) | model.parameters
    return {
        name: {"units": units, "long_name": long_name}
        for name, (units, long_name) in parameters.items()
    }


def check_parameter(model: Any, name: str) -> str:
    """Return a parameter name; raise ValueError if orbits cannot be continued in it."""
    # A model with gears has a `GearPair`, `mesh`, or the names of the meshes of a train.
    allowed = "a GearPair, a OneDegreePair, a SixDegreePair or a GearTrain"
    has_gears = is_model(model) and (model.pair or model.mesh_names)
    checks.require(has_gears, "model", type(model).__name__, allowed)
    return checks.one_of("parameter", name, continuation_parameters(model))


def start_and_goal(model: Any, tuning, name: str, goal, start_description) -> tuple:
    """Return (value of a parameter, its checked value `goal` at the end of a continuation).

    Raise ValueError if they are equal or the model does not allow the goal; `start_description` is
    the text for the first value in the message, such as "that of the orbit".
    """
    start = value_of(model, tuning, name)
    checks.require(goal != start, "to", goal, f"another {name} than {start_description}")
    with_parameter(model, tuning, name, goal)  # raises the ValueError of the model
    return start, goal


def value_of(model: Any, tuning: float, name: str) -> float:
    """Return the value of a parameter of a model, or its tuning for the name "tuning"."""
    if name == "tuning":
        return float(tuning)
    if name in model.parameters:
        return float(model.parameter(name))
    return float(getattr(model, _ATTRIBUTE_NAMES.get(name, name)))


def with_parameter(model: Any, tuning: float, name: str, value: float) -> tuple:
    """Return (model, tuning) with another value of the parameter `name`.

    Raise ValueError if the value is invalid. All other dimensionless parameters are constant.
    """
    if name == "tuning":
        return model, parameters.check(name, value, Positive)
    if name in model.parameters:
        return model.with_parameter(name, value), tuning
    if model.pair is not model:
        # The model contains a `GearPair`, which has the parameter.
        inner_pair, _ = with_parameter(model.pair, tuning, name, value)
        return dataclasses.replace(model, pair=inner_pair), tuning
    if name == "backlash_ratio":
        value = parameters.check(name, value, Backlash)
    elif name in ("damping", "backlash_damping"):
        value = parameters.check(name, value, NonNegative)
    attribute = _ATTRIBUTE_NAMES.get(name, name)
    if attribute in RATIOS:
        return model.replace(**ratio_fields(model, attribute, value)), tuning
    changed = model.replace(**{name: value})
    # The largest stiffness changes, so that the mean stiffness is constant.
    mean_ratio = mean_over_max(changed.contact_ratio, changed.stiffness_ratio)
    return changed.replace(max_stiffness=model.mean_stiffness / mean_ratio), tuning


def parameter_cases(model: Any, tuning: float | None, parameter: str, values: np.ndarray) -> list:
    """Return a list of (model, tuning), one for each value of a dimensionless parameter.

    `tuning` must be None if it is the parameter; other parameters require a `GearPair`.
    """
    if parameter == "tuning":
        checks.require(tuning is None, "tuning", tuning, "omitted if the tuning is varied")
        return [(model, check_tuning(f"values[{i}]", nu)) for i, nu in enumerate(values.tolist())]
    if tuning is None:
        raise ValueError(f"tuning = None is not allowed: {parameter} is varied at one tuning")
    if model.pair is not model:  # Only a `GearPair` is its own mesh.
        raise ValueError(
            f"parameter = {parameter!r} is not allowed for this {type(model).__name__}: it must be "
            "'tuning' unless the model is a GearPair"
        )
    return [with_parameter(model, tuning, parameter, value) for value in values.tolist()]
