"""Positions and speeds of the gears of a train in the plane normal to their axes."""

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from gearlib.data.variables import add_metadata
from gearlib.models.trains.structure import FLOAT_ARITHMETIC

if TYPE_CHECKING:
    from gearlib.models.trains.train import GearTrain

#: Values below this fraction of a reference value are rounding errors.
_ROUNDING_TOLERANCE = 1e-12


def layout(train: "GearTrain") -> xr.Dataset:
    """Return positions, radii and speeds of the gears of a train as a dataset.

    `GearTrain.layout` describes its variables.
    """
    pitch_radii = {}  # mesh name -> working pitch radii of pinion and wheel, negative for a ring
    for mesh in train.meshes:
        cosine = math.cos(mesh.pressure_angle)
        pinion_radius = train.by_name[mesh.pinion].base_radius / cosine
        wheel_radius = train.by_name[mesh.wheel].base_radius / cosine
        pitch_radii[mesh.name] = pinion_radius, -wheel_radius if mesh.internal else wheel_radius
    joints = _find_joints(train, pitch_radii)
    axes = _axis_positions(train, joints)
    # In a loop of meshes and shafts, different paths to an axis should give the same position.
    closure_errors = [
        math.dist(axes[end], axes[start] + vector)
        for start in joints
        for end, vector in joints[start]
    ]
    pitch_points = [
        axes[mesh.pinion] + _vector(pitch_radii[mesh.name][0], mesh.centre_line_angle)
        for mesh in train.meshes
    ]
    body_radii = {body.name: body.base_radius for body in train.bodies}
    for mesh in train.meshes:
        for name, radius in zip((mesh.pinion, mesh.wheel), pitch_radii[mesh.name], strict=True):
            body_radii[name] = max(body_radii[name], abs(radius))
    radii = list(body_radii.values())
    # Speeds are in radians per radian of reference mesh phase.
    frame_speed = float(train.speeds.frame)
    speeds = [float(train.speeds.in_housing[name]) for name in train.body_names]
    x, y = _round_to_zero([axes[name] for name in train.body_names], radii).T
    mesh_x, mesh_y = _round_to_zero(pitch_points, radii).T
    data = {
        "body_x": ("body", x),
        "body_y": ("body", y),
        "body_radius": ("body", radii),
        "body_turns": ("body", _round_to_zero(speeds, speeds)),
        "carried_by": ("body", [body.carrier or "" for body in train.bodies]),
        "shaft_line": ("body", np.array(_shaft_lines(train), np.int32)),
        "mesh_gear": (("mesh", "gear"), [(mesh.pinion, mesh.wheel) for mesh in train.meshes]),
        "pitch_radius": (("mesh", "gear"), np.array(list(pitch_radii.values()))),
        "mesh_x": ("mesh", mesh_x),
        "mesh_y": ("mesh", mesh_y),
        "frame_turns": frame_speed,
        "misfit": float(_round_to_zero(max(closure_errors, default=0.0), radii)),
    }
    names = {name: train.names[name] for name in ("body", "mesh")}
    return add_metadata(xr.Dataset(data, names | {"gear": ["pinion", "wheel"]}))


def _round_to_zero(values: ArrayLike, references: Iterable[float]) -> np.ndarray:
    """Return the values as an array, with rounding errors replaced by 0.

    A value is a rounding error if its magnitude is below 1e-12 times the largest magnitude of
    `references`, which have the same unit.
    """
    values = np.array(values, float)
    return np.where(np.abs(values) < _ROUNDING_TOLERANCE * max(map(abs, references)), 0.0, values)


def _vector(length: float, angle: float) -> np.ndarray:
    """Return the x and y components of a vector with the given length and angle in rad."""
    return length * np.array(FLOAT_ARITHMETIC.cos_sin(angle))


def _find_joints(train: "GearTrain", pitch_radii: dict[str, tuple]) -> dict[str, list]:
    """Return the joints of each body as a dict body name -> [(joined body, vector), ...].

    Bodies are joined by meshes, shafts and carrier pins. The vector, in m, leads from the axis of
    the body to the axis of the joined body. `pitch_radii` maps mesh names to the working pitch
    radii of pinion and wheel in m; the radius of a ring gear is negative.
    """
    connections: list[tuple] = []  # (body, joined body, vector between their axes)
    for mesh in train.meshes:
        # The sum of the pitch radii is the centre distance; it is negative in an internal mesh.
        vector = _vector(sum(pitch_radii[str(mesh.name)]), mesh.centre_line_angle)
        connections.append((mesh.pinion, mesh.wheel, vector))
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


def _axis_positions(train: "GearTrain", joints: dict[str, list]) -> dict[str, np.ndarray]:
    """Return the positions of the body axes as a dict body name -> (x, y) in m.

    `joints` is the result of `_find_joints`. The origin is the axis of the first carrier or, if
    there are no carriers, of the first body. If a group of bodies is not joined to it, the origin
    is also the axis of the first body of this group.
    """
    axes: dict = {}
    carriers = [body.carrier for body in train.bodies if body.carrier]
    for origin in [*carriers[:1], *joints]:
        if origin in axes:
            continue
        axes[origin] = np.zeros(2)
        to_visit = [origin]
        for start in to_visit:
            for end, vector in joints[start]:
                if end not in axes:
                    axes[end] = axes[start] + vector
                    to_visit.append(end)
    return axes


def _shaft_lines(train: "GearTrain") -> list[int]:
    """Return the number of the shaft line of each body, or 0 for bodies without a shaft.

    A shaft line is a group of bodies that are joined by shafts, directly or through other bodies.
    """
    # Each shaft assigns its number to its two bodies and to all bodies on the lines that it joins.
    line_numbers = dict.fromkeys(train.body_names, 0)
    for number, shaft in enumerate(train.shafts, 1):
        joined_lines = {line_numbers[name] for name in shaft.bodies} - {0}
        for name, line_number in line_numbers.items():
            if name in shaft.bodies or line_number in joined_lines:
                line_numbers[name] = number
    return list(line_numbers.values())
