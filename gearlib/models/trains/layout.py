"""Where the gears of a train lie, seen along their axes, and how they turn."""

import math

import numpy as np
import xarray as xr

from gearlib.data.variables import describe
from gearlib.models.trains.structure import FLOATS

#: Of the largest radius.
_ROUNDING = 1e-12


def layout(train):
    """Return `GearTrain.layout`."""
    radii = {mesh.name: _pitch_radii(train, mesh) for mesh in train.meshes}
    ways = _ways(train, radii)
    axes = _axes(train, ways)
    misfits = [
        math.dist(axes[end], axes[start] + way) for start in ways for end, way in ways[start]
    ]
    points = [
        axes[mesh.pinion] + _vector(radii[mesh.name][0], mesh.centres) for mesh in train.meshes
    ]
    sizes = {body.name: body.base_radius for body in train.bodies}
    for mesh in train.meshes:
        for name, radius in zip((mesh.pinion, mesh.wheel), radii[mesh.name], strict=True):
            sizes[name] = max(sizes[name], abs(radius))
    # In the housing all turn with the frame in which the positions are given.
    frame = train.carrier_ratio * float(train.speeds[train.reference_mesh.pinion])
    turns = [frame + float(train.speeds[name]) for name in train.body_names]
    x, y = _without_rounding([axes[name] for name in train.body_names], sizes.values()).T
    mesh_x, mesh_y = _without_rounding(points, sizes.values()).T
    data = {
        "body_x": ("body", x),
        "body_y": ("body", y),
        "body_radius": ("body", list(sizes.values())),
        "body_turns": ("body", _without_rounding(turns, turns)),
        "carried_by": ("body", [body.carrier or "" for body in train.bodies]),
        "shaft_line": ("body", np.array(_shaft_lines(train), np.int32)),
        "mesh_gear": (("mesh", "gear"), [(mesh.pinion, mesh.wheel) for mesh in train.meshes]),
        "pitch_radius": (("mesh", "gear"), np.array(list(radii.values()))),
        "mesh_x": ("mesh", mesh_x),
        "mesh_y": ("mesh", mesh_y),
        "frame_turns": frame,
        "misfit": float(_without_rounding(max(misfits, default=0.0), sizes.values())),
    }
    names = {name: train.names[name] for name in ("body", "mesh")}
    return describe(xr.Dataset(data, names | {"gear": ["pinion", "wheel"]}))


def _without_rounding(values, scale):
    """Return values as an array, with 0 for those that are rounding beside a scale."""
    values = np.array(values, float)
    return np.where(np.abs(values) < _ROUNDING * max(map(abs, scale)), 0.0, values)


def _vector(length, angle):
    """Return the vector of a length at an angle."""
    return length * np.array(FLOATS.cos_sin(angle))


def _pitch_radii(train, mesh):
    """Return the working pitch radii of pinion and wheel, m, that of a ring gear negative."""
    pinion, wheel = (
        train.by_name[name].base_radius / math.cos(mesh.pressure_angle)
        for name in (mesh.pinion, mesh.wheel)
    )
    return pinion, -wheel if mesh.internal else wheel


def _ways(train, radii):
    """Return name of a body -> [(another body, way from axis to axis, m, shape (2,)), ...]."""
    # Pitch circles touch; what they leave open follows from shafts and pins.
    joints = [
        (mesh.pinion, mesh.wheel, _vector(sum(radii[mesh.name]), mesh.centres))
        for mesh in train.meshes
    ]
    joints += [(*shaft.bodies, np.zeros(2)) for shaft in train.shafts]
    for body in train.bodies:
        if body.carrier is not None:
            way = _vector(train.by_name[body.carrier].base_radius, body.angle)
            joints.append((body.carrier, body.name, way))
    ways: dict = {name: [] for name in train.body_names}
    for start, end, way in joints:
        ways[start].append((end, way))
        ways[end].append((start, -way))
    return ways


def _axes(train, ways):
    """Return name of a body -> its axis, m, shape (2,), counted from the first carrier."""
    axes: dict = {}
    carriers = [body.carrier for body in train.bodies if body.carrier]
    for origin in [*carriers[:1], *ways]:
        # What nothing joins to the others lies on the first axis.
        waiting = [] if origin in axes else [origin]
        axes.setdefault(origin, np.zeros(2))
        for start in waiting:
            for end, way in ways[start]:
                if end not in axes:
                    axes[end] = axes[start] + way
                    waiting.append(end)
    return axes


def _shaft_lines(train):
    """Return the number of the line of shafts on which each body sits, 0 for none."""
    lines = dict.fromkeys(train.body_names, 0)
    for number, shaft in enumerate(train.shafts, 1):
        joined = {lines[name] for name in shaft.bodies} - {0}
        lines |= {name: number for name in lines if name in shaft.bodies or lines[name] in joined}
    return list(lines.values())
