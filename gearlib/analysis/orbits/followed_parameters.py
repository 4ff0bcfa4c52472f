"""The parameters over which orbits are followed: one number of a model changed, the rest kept.

The ratios of the pair and the tuning are changed in their dimensionless form, and all other ratios
keep their values: another contact ratio moves neither the mean stiffness nor the damping ratios.
"""

import dataclasses

from gearlib import checks
from gearlib.engines.pair.stiffness import mean_over_max
from gearlib.models.model import is_model
from gearlib.models.pair_parameters import ratio_fields
from gearlib.runs.run_arguments import check_tuning

#: name -> (CF units, long_name) of the parameters of every model
RATIOS = {
    "tuning": ("1", "tuning nu, mesh frequency over mean eigenfrequency"),
    "damping": ("1", "damping ratio beta of the material in contact"),
    "backlash_damping": ("1", "damping ratio beta_m of the oil in the backlash"),
    "backlash": ("1", "backlash in static deflections"),
    "contact_ratio": ("1", "contact ratio epsilon"),
    "stiffness_ratio": ("1", "stiffness ratio kappa = C_min / C_max"),
}
#: Names of those that models know by another name.
_FIELDS = {
    "damping": "damping_ratio",
    "backlash_damping": "backlash_damping_ratio",
    "backlash": "backlash_ratio",
}


def known(pair):
    """Return the parameters of a model as a dict name -> (CF units, long_name)."""
    return (RATIOS if pair.mesh else {}) | pair.parameters


def attributes(pair, name):
    """Return the attributes of a variable that holds a parameter."""
    return dict(zip(("units", "long_name"), known(pair)[name], strict=True))


def check_parameter(pair, name):
    """Return the name of a parameter over which orbits of a model are followed, else ValueError."""
    if not (is_model(pair) and (pair.mesh or pair.mesh_names)):
        raise ValueError(
            f"pair = {type(pair).__name__} is not allowed: it must be a GearPair, a OneDegreePair, "
            "a SixDegreePair or a GearTrain"
        )
    return checks.one_of("parameter", name, known(pair))


def check_goal(pair, tuning, name, to, whose):
    """Return (value of a parameter, other value to which it goes), else ValueError."""
    start = value_of(pair, tuning, name)
    to = checks.number("to", to, f"another {name} than {whose}", lambda v: v != start)
    with_parameter(pair, tuning, name, to)
    return start, to


def value_of(pair, tuning, name):
    """Return the value of a parameter at a model and a tuning."""
    if name == "tuning":
        return float(tuning)
    if name in pair.parameters:
        return float(pair.parameter(name))
    return float(getattr(pair, _FIELDS.get(name, name)))


def with_parameter(pair, tuning, name, value):
    """Return (pair, tuning) with one parameter set, else ValueError."""
    if name == "tuning":
        return pair, checks.finite_positive(name, value)
    if name in pair.parameters:
        return pair.with_parameter(name, value), tuning
    if pair.mesh is not pair:
        inner, _ = with_parameter(pair.mesh, tuning, name, value)
        return dataclasses.replace(pair, pair=inner), tuning
    if name == "backlash":
        value = checks.number(name, value, "a number >= 0, inf included", lambda v: v >= 0.0)
    elif name in ("damping", "backlash_damping"):
        value = checks.finite_nonnegative(name, value)
    if name in _FIELDS:
        return pair.replace(**ratio_fields(pair, _FIELDS[name], value)), tuning
    changed = pair.replace(**{name: value})
    over_max = mean_over_max(changed.contact_ratio, changed.stiffness_ratio)
    return changed.replace(max_stiffness=pair.mean_stiffness / over_max), tuning


def varied(model, tuning, parameter, values):
    """Return (model, tuning) for each value, shape (n,), of one of `RATIOS`, else ValueError.

    The given tuning is taken where another parameter is varied; ratios other than the tuning are
    varied of a `GearPair` only.
    """
    checks.one_of("parameter", parameter, RATIOS)
    if parameter == "tuning":
        checks.require(tuning is None, "tuning", tuning, "left out where it is varied")
        return [(model, check_tuning(f"values[{i}]", nu)) for i, nu in enumerate(values.tolist())]
    if tuning is None:
        raise ValueError(f"tuning = None is not allowed: {parameter} is varied at one tuning")
    if model.mesh is not model:
        raise ValueError(
            f"parameter = {parameter!r} is not allowed for this {type(model).__name__}: it must be "
            "'tuning', or the pair a GearPair"
        )
    tuning = check_tuning("tuning", tuning)
    return [with_parameter(model, tuning, parameter, value) for value in values.tolist()]


def name_parameter(dataset, parameter):
    """Give a varied backlash its name: as a course, the word means the line of Eq. (4)."""
    if parameter == "backlash":
        dataset[parameter].attrs["long_name"] = "backlash in static deflections"
    return dataset
