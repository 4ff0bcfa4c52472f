"""Positions of the gears of a train, seen along their axes, and their speeds."""

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from gearlib.data.variables import describe
from gearlib.models.trains.structure import FLOAT_ARITHMETIC

if TYPE_CHECKING:
    from gearlib.models.trains.train import GearTrain

#: Smaller coordinates, over the largest radius, are rounding errors.
_ROUNDING = 1e-12


def layout(train: "GearTrain") -> xr.Dataset:
    """Return positions, radii and speeds of the gears as the dataset of `GearTrain.layout`."""
    radii = {}  # name of a mesh -> working pitch radii of its gears, negative for a ring gear
    for mesh in train.meshes:
        gears = train.by_name[mesh.pinion], train.by_name[mesh.wheel]
        pinion, wheel = (gear.base_radius / math.cos(mesh.pressure_angle) for gear in gears)
        radii[mesh.name] = pinion, -wheel if mesh.internal else wheel
    joints = _joints(train, radii)
    axes = _axes(train, joints)
    # Loops of meshes and shafts give an axis several positions, which should be equal.
    closure_errors = [
        math.dist(axes[end], axes[start] + vector)
        for start in joints
        for end, vector in joints[start]
    ]
    pitch_points = [
        axes[mesh.pinion] + _vector(radii[mesh.name][0], mesh.centre_line_angle)
        for mesh in train.meshes
    ]
    body_radii = {body.name: body.base_radius for body in train.bodies}
    for mesh in train.meshes:
        for name, radius in zip((mesh.pinion, mesh.wheel), radii[mesh.name], strict=True):
            body_radii[name] = max(body_radii[name], abs(radius))
    sizes = list(body_radii.values())
    # Speeds are per radian of reference mesh phase. The frame of the positions, that of the first
    # carrier, rotates in the housing, and all bodies with it.
    frame_speed = float(train.speeds.frame)
    speeds = [float(train.speeds.in_housing[name]) for name in train.body_names]
    x, y = _round_to_zero([axes[name] for name in train.body_names], sizes).T
    mesh_x, mesh_y = _round_to_zero(pitch_points, sizes).T
    data = {
        "body_x": ("body", x),
        "body_y": ("body", y),
        "body_radius": ("body", sizes),
        "body_turns": ("body", _round_to_zero(speeds, speeds)),
        "carried_by": ("body", [body.carrier or "" for body in train.bodies]),
        "shaft_line": ("body", np.array(_shaft_lines(train), np.int32)),
        "mesh_gear": (("mesh", "gear"), [(mesh.pinion, mesh.wheel) for mesh in train.meshes]),
        "pitch_radius": (("mesh", "gear"), np.array(list(radii.values()))),
        "mesh_x": ("mesh", mesh_x),
        "mesh_y": ("mesh", mesh_y),
        "frame_turns": frame_speed,
        "misfit": float(_round_to_zero(max(closure_errors, default=0.0), sizes)),
    }
    names = {name: train.names[name] for name in ("body", "mesh")}
    return describe(xr.Dataset(data, names | {"gear": ["pinion", "wheel"]}))


def _round_to_zero(values: ArrayLike, sizes: Iterable[float]) -> np.ndarray:
    """Return an array of the values, with 0 for rounding errors relative to the largest size."""
    values = np.array(values, float)
    return np.where(np.abs(values) < _ROUNDING * max(map(abs, sizes)), 0.0, values)


def _vector(length: float, angle: float) -> np.ndarray:
    """Return the x and y components of a vector with a length and an angle in rad."""
    return length * np.array(FLOAT_ARITHMETIC.cos_sin(angle))


def _joints(train: "GearTrain", radii: dict[str, tuple]) -> dict[str, list]:
    """Return the joints of each body: name -> [(joined body, vector between the axes in m), ...].

    Meshes, shafts and pins of carriers join bodies. `radii` maps a mesh name to the pitch radii of
    pinion and wheel in m.
    """
    connections: list[tuple] = [
        (mesh.pinion, mesh.wheel, _vector(sum(radii[str(mesh.name)]), mesh.centre_line_angle))
        for mesh in train.meshes
    ]
    connections += [(*shaft.bodies, np.zeros(2)) for shaft in train.shafts]
    for body in train.bodies:
        if body.carrier is not None:
            pin = _vector(train.by_name[body.carrier].base_radius, body.angle)
            connections.append((body.carrier, body.name, pin))
    joints: dict = {name: [] for name in train.body_names}
    for start, end, vector in connections:
        joints[start].append((end, vector))
        joints[end].append((start, -vector))
    return joints


def _axes(train: "GearTrain", joints: dict[str, list]) -> dict[str, np.ndarray]:
    """Return the axis of each body, name -> (x, y) in m, relative to the first carrier.

    `joints` are those of `_joints`. A body without joints lies on the first axis.
    """
    axes: dict = {}
    carriers = [body.carrier for body in train.bodies if body.carrier]
    for origin in [*carriers[:1], *joints]:
        unvisited = [] if origin in axes else [origin]
        axes.setdefault(origin, np.zeros(2))
        for start in unvisited:
            for end, vector in joints[start]:
                if end not in axes:
                    axes[end] = axes[start] + vector
                    unvisited.append(end)
    return axes


def _shaft_lines(train: "GearTrain") -> list[int]:
    """Return the number of the shaft line of each body: 1, 2, ..., or 0 without a shaft.

    Bodies that shafts join, one after the other, lie on one line.
    """
    line_of = dict.fromkeys(train.body_names, 0)
    for number, shaft in enumerate(train.shafts, 1):
        joined_lines = {line_of[name] for name in shaft.bodies} - {0}
        for name, line in line_of.items():
            if name in shaft.bodies or line in joined_lines:
                line_of[name] = number
    return list(line_of.values())
