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
    steps = _steps(train)
    at = _places(train, steps)
    gaps = [math.dist(at[other], at[name] + step) for name in steps for other, step in steps[name]]
    radii = {mesh.name: _radii(train, mesh) for mesh in train.meshes}
    ahead = {mesh.name: _along(1.0, mesh.centres) for mesh in train.meshes}
    points = [at[mesh.pinion] + radii[mesh.name][0] * ahead[mesh.name] for mesh in train.meshes]
    sizes = {body.name: body.base_radius for body in train.bodies}
    for mesh in train.meshes:
        for name, radius in zip((mesh.pinion, mesh.wheel), radii[mesh.name], strict=True):
            sizes[name] = max(sizes[name], abs(radius))
    # In the housing all turn with the frame in which the positions are given.
    frame = train.carrier_ratio * float(train.speeds[train.reference_mesh.pinion])
    lines, names = _shafts(train), train.body_names
    x, y = _clean([at[name] for name in names], sizes.values()).T
    mesh_x, mesh_y = _clean(points, sizes.values()).T
    turns = [frame + float(train.speeds[name]) for name in names]
    data = {
        "body_x": ("body", x),
        "body_y": ("body", y),
        "body_radius": ("body", [sizes[name] for name in names]),
        "body_turns": ("body", _clean(turns, turns)),
        "carried_by": ("body", [body.carrier or "" for body in train.bodies]),
        "shaft_line": ("body", np.array([lines[name] for name in names], np.int32)),
        "mesh_gear": (("mesh", "gear"), [(mesh.pinion, mesh.wheel) for mesh in train.meshes]),
        "pitch_radius": (("mesh", "gear"), np.array([radii[name] for name in train.mesh_names])),
        "mesh_x": ("mesh", mesh_x),
        "mesh_y": ("mesh", mesh_y),
        "frame_turns": frame,
        "misfit": float(_clean(max(gaps, default=0.0), sizes.values())),
    }
    coords = {
        "body": list(names),
        "mesh": list(train.mesh_names),
        "gear": ["pinion", "wheel"],
    }
    return describe(xr.Dataset(data, coords))


def _clean(values, scale):
    """Return values of which those are 0 that are rounding beside a scale."""
    values = np.array(values, float)
    return np.where(np.abs(values) < _ROUNDING * max(map(abs, scale)), 0.0, values)


def _along(length, angle):
    return length * np.array(FLOATS.cos_sin(angle))


def _radii(train, mesh):
    """Return the working pitch radii of pinion and wheel, m, that of a ring gear negative."""
    own, other = (
        train.by_name[name].base_radius / math.cos(mesh.pressure_angle)
        for name in (mesh.pinion, mesh.wheel)
    )
    return own, -other if mesh.internal else other


def _steps(train):
    """Return name of a body -> (another one, the way from axis to axis, m, shape (2,)), ..."""
    steps: dict = {name: [] for name in train.body_names}

    def join(first, second, way):
        steps[first].append((second, way))
        steps[second].append((first, -way))

    # Pitch circles touch; what they leave open follows from pins and shafts.
    for mesh in train.meshes:
        join(mesh.pinion, mesh.wheel, _along(sum(_radii(train, mesh)), mesh.centres))
    for shaft in train.shafts:
        first, second = shaft.bodies
        join(first, second, np.zeros(2))
    for body in train.bodies:
        if body.carrier is not None:
            pins = train.by_name[body.carrier].base_radius
            join(body.carrier, body.name, _along(pins, body.angle))
    return steps


def _places(train, steps):
    """Return name of a body -> its axis, m, shape (2,), counted from the first carrier."""
    found: dict = {}
    carriers = [body.carrier for body in train.bodies if body.carrier]
    for start in [*carriers[:1], *steps]:
        if start in found:
            continue
        # What nothing joins to the others lies on the first axis.
        found[start] = np.zeros(2)
        waiting = [start]
        while waiting:
            name = waiting.pop(0)
            for other, way in steps[name]:
                if other not in found:
                    found[other] = found[name] + way
                    waiting.append(other)
    return found


def _shafts(train):
    """Return name of a body -> number of the line of shafts that it sits on, 0 where on none."""
    lines = dict.fromkeys(train.body_names, 0)
    for number, shaft in enumerate(train.shafts, 1):
        old = {lines[name] for name in shaft.bodies} - {0}
        lines |= {name: number for name in lines if name in shaft.bodies or lines[name] in old}
    return lines
