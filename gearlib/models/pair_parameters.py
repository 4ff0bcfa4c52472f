"""What a `GearPair` is given, declared without the numerical stack: a start reads it."""

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
