"""Numbers of a gear pair and their ratios, without the numerical stack."""

from dataclasses import dataclass
from typing import Annotated

from gearlib import parameters


@dataclass(frozen=True, kw_only=True)
class PairParameters:
    """Numbers of a gear pair and its mesh, SI."""

    max_stiffness: parameters.MaxStiffness
    stiffness_ratio: parameters.StiffnessRatio
    contact_ratio: parameters.ContactRatio
    reduced_mass: Annotated[float, parameters.MASS, "Reduced mass", "m_red"]
    load: Annotated[float, parameters.LOAD, "Load, the mean force along the line of action,", "F"]
    backlash: parameters.Backlash
    material_damping: parameters.MaterialDamping = 0.0
    backlash_damping: parameters.BacklashDamping = 0.0
    teeth: Annotated[
        int, parameters.Integer(1, limit=10_000), "Teeth z: mesh periods per revolution"
    ] = 24


#: Ratios of a pair -> the field that each sets.
RATIOS = {
    "damping_ratio": "material_damping",
    "backlash_damping_ratio": "backlash_damping",
    "backlash_ratio": "backlash",
}
RATIO_NAMES = {
    "damping_ratio": "damping ratio beta",
    "backlash_damping_ratio": "damping ratio beta_m of the backlash",
    "backlash_ratio": "backlash in static deflections",
}


def ratio_fields(pair, name, value):
    """Return field -> value by which a `GearPair` has a value of one of `RATIOS`."""
    if name == "backlash_ratio":
        scale = pair.static_deflection
    else:
        scale = 2.0 * pair.reduced_mass * pair.mean_eigenfrequency
    return {RATIOS[name]: value * scale}
