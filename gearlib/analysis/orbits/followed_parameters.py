"""The parameters over which orbits are followed: one number of a model changed, the rest kept.

The ratios of the pair and the tuning are changed in their dimensionless form, and all other ratios
keep their values: another contact ratio moves neither the mean stiffness nor the damping ratios.
"""

import dataclasses

from gearlib import checks
from gearlib.models.model import is_model
from gearlib.models.stiffness import mean_over_max

#: name -> (CF units, long_name) of the parameters of every model
RATIOS = {
    "tuning": ("1", "tuning nu, mesh frequency over mean eigenfrequency"),
    "damping": ("1", "damping ratio beta of the material in contact"),
    "backlash_damping": ("1", "damping ratio beta_m of the oil in the backlash"),
    "backlash": ("1", "backlash in static deflections"),
    "contact_ratio": ("1", "contact ratio epsilon"),
    "stiffness_ratio": ("1", "stiffness ratio kappa = C_min / C_max"),
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


def value_of(pair, tuning, name):
    """Return the value of a parameter at a model and a tuning."""
    if name == "tuning":
        return float(tuning)
    if name in pair.parameters:
        return float(pair.parameter(name))
    read = {
        "damping": "damping_ratio",
        "backlash_damping": "backlash_damping_ratio",
        "backlash": "backlash_ratio",
    }
    return float(getattr(pair, read.get(name, name)))


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
        return pair.replace(backlash=value * pair.static_deflection), tuning
    if name in ("damping", "backlash_damping"):
        value = checks.finite_nonnegative(name, value)
        field = "material_damping" if name == "damping" else name
        unit = 2.0 * pair.reduced_mass * pair.mean_eigenfrequency
        return pair.replace(**{field: value * unit}), tuning
    changed = pair.replace(**{name: value})
    over_max = mean_over_max(changed.contact_ratio, changed.stiffness_ratio)
    return changed.replace(max_stiffness=pair.mean_stiffness / over_max), tuning
