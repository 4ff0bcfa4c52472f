"""Gears by their drawing: `SpurGear`, `Mesh` and what they are made of, `planetary_set`.

The code lies in `gearlib.models.geometry`; `Mesh` here is one of two drawn gears, while
`gearlib.Mesh` is one of a `GearTrain`.
"""

from typing import TYPE_CHECKING

from gearlib.models.geometry.gear import RACKS, Material, PathTable, Rack, SpurGear, TipRelief, Web
from gearlib.models.geometry.iso import DynamicFactor, IsoStiffness, dynamic_factor, iso_stiffness
from gearlib.models.geometry.mesh import Mesh
from gearlib.models.geometry.mesh_stiffness import MeshStiffness, mesh_stiffness
from gearlib.models.geometry.transmission_error import optimum_relief

if TYPE_CHECKING:
    from gearlib.models.trains.planetary import planetary_set

__all__ = [
    "RACKS",
    "DynamicFactor",
    "IsoStiffness",
    "Material",
    "Mesh",
    "MeshStiffness",
    "PathTable",
    "Rack",
    "SpurGear",
    "TipRelief",
    "Web",
    "dynamic_factor",
    "iso_stiffness",
    "mesh_stiffness",
    "optimum_relief",
    "planetary_set",
]


def __getattr__(name):
    # Drawn gears need none of the compiled code of trains, which takes half a second to load.
    if name != "planetary_set":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from gearlib.models.trains.planetary import planetary_set

    return planetary_set
