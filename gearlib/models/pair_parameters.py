"""What a `GearPair` is given, declared without the numerical stack: a start reads it."""

from dataclasses import dataclass
from typing import Annotated

from gearlib.parameters import (
    LOAD,
    MASS,
    Backlash,
    BacklashDamping,
    ContactRatio,
    Integer,
    MaterialDamping,
    MaxStiffness,
    StiffnessRatio,
)


@dataclass(frozen=True, kw_only=True)
class PairParameters:
    """Numbers of a gear pair and its mesh, SI."""

    max_stiffness: MaxStiffness
    stiffness_ratio: StiffnessRatio
    contact_ratio: ContactRatio
    reduced_mass: Annotated[float, MASS, "Reduced mass", "m_red"]
    load: Annotated[float, LOAD, "Load, the mean force along the line of action,", "F"]
    backlash: Backlash
    material_damping: MaterialDamping = 0.0
    backlash_damping: BacklashDamping = 0.0
    teeth: Annotated[int, Integer(1, limit=10_000), "Teeth z: mesh periods per revolution"] = 24
