"""Matrices of two rotors with one gear each, computed by ROSS 2.3.0 and stored in this folder."""

import math
from pathlib import Path

import numpy as np
import xarray as xr

from gearlib import GearNode, GearTrain, Mesh

_MATRIX_NAMES = ("mass", "stiffness", "gyroscopic")
_FILES = {name: Path(__file__).with_name(f"ross_{name}.nc") for name in _MATRIX_NAMES}
#: Matrices of both rotors by name, in SI units.
ROSS_MATRICES = {name: xr.load_dataset(path)[name].values for name, path in _FILES.items()}
#: Natural frequencies of both rotors joined by ROSS's `MultiRotor`, Hz, without the three
#: rigid-body modes.
ROSS_NATURAL_FREQUENCIES = [
    156.7745,
    186.9425,
    206.6929,
    232.6162,
    680.7055,
    691.4427,
    1017.895,
    1017.895,
]
ROSS_NATURAL_FREQUENCIES += [1166.492, 1171.928, 1541.775]
_NODE_COORDINATES = ("x", "y", "axial", "tilt x", "tilt y", "turn")


def two_rotors(**changes):
    """Return a train of both rotors, with gears on node 3 of rotor a and node 2 of rotor b.

    Each rotor has seven nodes with six coordinates. `changes` replace arguments of
    `GearTrain.from_matrices`; if they have a speed, gyroscopic forces are included.
    """

    def gear(name, teeth, base_radius, node):
        """Return a gear that moves with the coordinates of a node, such as "a 3"."""
        coordinates = {"rotation": f"{node} turn", "x": f"{node} x", "y": f"{node} y"}
        return GearNode(name=name, teeth=teeth, base_radius=base_radius, **coordinates)

    gears = [gear("pinion", 27, 0.04, "a 3"), gear("wheel", 54, 0.08, "b 2")]
    mesh = Mesh(
        pinion="pinion",
        wheel="wheel",
        max_stiffness=2e8,
        stiffness_ratio=1.0,
        contact_ratio=1.5,
        backlash=1e-4,
        material_damping=2000.0,
        backlash_damping=0.0,
        pressure_angle=math.radians(20.0),
        position=-math.pi / 2.0,
    )
    coordinates = [
        f"{rotor} {node} {name}"
        for rotor in "ab"
        for node in range(7)
        for name in _NODE_COORDINATES
    ]
    arguments = {
        "mass": ROSS_MATRICES["mass"],
        "damping": np.zeros_like(ROSS_MATRICES["mass"]),
        "stiffness": ROSS_MATRICES["stiffness"],
        "meshes": [mesh],
        "gears": gears,
        "coordinates": coordinates,
        "forces": {"a 3 turn": 100.0, "b 2 turn": 200.0},
    }
    if "speed" in changes and "gyroscopic" not in changes:
        changes |= {"gyroscopic": ROSS_MATRICES["gyroscopic"]}
    return GearTrain.from_matrices(**arguments | changes)
