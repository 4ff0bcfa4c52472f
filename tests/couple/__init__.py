"""Two rotors of ROSS 2.3.0 with a gear each, whose matrices are stored here."""

import math
from pathlib import Path

import numpy as np
import xarray as xr

from gearlib import GearNode, GearTrain, Mesh

_NAMES = ("mass", "stiffness", "gyroscopic")
_FILES = {name: Path(__file__).with_name(f"ross_{name}.nc") for name in _NAMES}
#: Matrices of both rotors by name, SI units.
ROSS = {name: xr.load_dataset(path)[name].values for name, path in _FILES.items()}
#: Natural frequencies in Hz of both rotors joined by ROSS's `MultiRotor`, above three free motions.
OF_ROSS = [156.7745, 186.9425, 206.6929, 232.6162, 680.7055, 691.4427, 1017.895, 1017.895]
OF_ROSS += [1166.492, 1171.928, 1541.775]
_MOTIONS = ("x", "y", "axial", "tilt x", "tilt y", "turn")


def two_rotors(**changes):
    """Return a train of both rotors, with gears on node 3 of rotor a and node 2 of rotor b."""

    def gear(name, teeth, radius, node):
        """Return a gear on a node, whose coordinates it moves."""
        coordinates = {"rotation": f"{node} turn", "x": f"{node} x", "y": f"{node} y"}
        return GearNode(name=name, teeth=teeth, base_radius=radius, **coordinates)

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
    values = {
        "mass": ROSS["mass"],
        "damping": np.zeros((84, 84)),
        "stiffness": ROSS["stiffness"],
        "meshes": [mesh],
        "gears": gears,
        "coordinates": [f"{rotor} {i} {x}" for rotor in "ab" for i in range(7) for x in _MOTIONS],
        "forces": {"a 3 turn": 100.0, "b 2 turn": 200.0},
    }
    if "speed" in changes and "gyroscopic" not in changes:
        changes |= {"gyroscopic": ROSS["gyroscopic"]}
    return GearTrain.from_matrices(**values | changes)
