"""Gears given by geometry: `SpurGear`, `GearStage`, their parts and stiffness, and `planetary_set`.

A `GearStage` is two gears at a centre distance, while a `gearlib.Mesh` is part of a `GearTrain`.
"""

from typing import TYPE_CHECKING

from gearlib.models.geometry.gear import RACKS, Material, PathTable, Rack, SpurGear, TipRelief, Web
from gearlib.models.geometry.gear_stage import GearStage
from gearlib.models.geometry.iso import DynamicFactor, IsoStiffness, dynamic_factor, iso_stiffness
from gearlib.models.geometry.mesh_stiffness import MeshStiffness, mesh_stiffness
from gearlib.models.geometry.transmission_error import optimum_relief

if TYPE_CHECKING:
    from gearlib.models.trains.planetary import ParallelStage, planetary_set

__all__ = [
    "RACKS",
    "DynamicFactor",
    "IsoStiffness",
    "GearStage",
    "Material",
    "MeshStiffness",
    "PathTable",
    "Rack",
    "SpurGear",
    "TipRelief",
    "Web",
    "dynamic_factor",
    "iso_stiffness",
    "mesh_stiffness",
    "ParallelStage",
    "optimum_relief",
    "planetary_set",
]


def __getattr__(name):
    """Import `ParallelStage` or `planetary_set` on first use; their compiled code loads slowly."""
    if name not in ("ParallelStage", "planetary_set"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from gearlib.models.trains import planetary

    return getattr(planetary, name)


def __dir__():
    return __all__
