"""Positions and speeds of the gears of a train, seen along their axes."""

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

#: Coordinates below this fraction of the largest radius are rounding errors.
_ROUNDING = 1e-12


def layout(train: "GearTrain") -> xr.Dataset:
    """Return positions, radii and speeds of the gears of a train as a dataset.

    Its variables are described in `GearTrain.layout`: positions and radii of bodies, pitch points
    of meshes, speeds, and the largest error with which loops of meshes close.
    """
    pitch_radii = {}  # mesh name -> working pitch radii of pinion and wheel, negative for a ring
    for mesh in train.meshes:
        cosine = math.cos(mesh.pressure_angle)
        pinion_radius = train.by_name[mesh.pinion].base_radius / cosine
        wheel_radius = train.by_name[mesh.wheel].base_radius / cosine
        pitch_radii[mesh.name] = pinion_radius, -wheel_radius if mesh.internal else wheel_radius
    joints = _joints(train, pitch_radii)
    axes = _axes(train, joints)
    # An axis that is reached along several paths of meshes and shafts has several positions, which
    # should be equal.
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
    # Speeds are in radians per radian of mesh phase, which grows by 2 pi in a period of the
    # reference mesh. Positions are given in the frame of the first carrier, which rotates in the
    # housing.
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
    """Return an array of the values, with 0 in place of those that are rounding errors.

    A value counts as a rounding error if its magnitude is below 1e-12 times the largest magnitude
    of the `references`, which are numbers of the same unit.
    """
    values = np.array(values, float)
    return np.where(np.abs(values) < _ROUNDING * max(map(abs, references)), 0.0, values)


def _vector(length: float, angle: float) -> np.ndarray:
    """Return the x and y components of a vector with a length and an angle in rad."""
    return length * np.array(FLOAT_ARITHMETIC.cos_sin(angle))


def _joints(train: "GearTrain", pitch_radii: dict[str, tuple]) -> dict[str, list]:
    """Return the joints of each body: body name -> [(joined body, vector to its axis in m), ...].

    Meshes, shafts and carrier pins join bodies; the vector leads from the axis of the one body to
    that of the other. `pitch_radii` maps the name of a mesh to the working pitch radii of its
    pinion and its wheel in m; that of a ring gear is negative.
    """
    connections: list[tuple] = []  # (name of a body, name of another body, vector between them)
    for mesh in train.meshes:
        # The sum of the pitch radii is the centre distance, negative in an internal mesh.
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


def _axes(train: "GearTrain", joints: dict[str, list]) -> dict[str, np.ndarray]:
    """Return the position of the axis of each body: body name -> (x, y) in m.

    `joints` maps a body to the bodies joined to it, with the vectors to their axes (see `_joints`).
    The axis of the first carrier, or of the first body without carriers, lies at the origin. Bodies
    that no joint connects with it form a group of their own, whose first axis also lies there.
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
    """Return for each body the number of its shaft line, > 0, or 0 for a body without a shaft.

    A shaft line is a group of bodies joined by shafts, directly or through other bodies.
    """
    # Each shaft gives its number to its two bodies and to all bodies on the lines that it joins.
    line_numbers = dict.fromkeys(train.body_names, 0)
    for number, shaft in enumerate(train.shafts, 1):
        joined_lines = {line_numbers[name] for name in shaft.bodies} - {0}
        for name, line_number in line_numbers.items():
            if name in shaft.bodies or line_number in joined_lines:
                line_numbers[name] = number
    return list(line_numbers.values())
