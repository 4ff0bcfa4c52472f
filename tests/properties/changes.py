"""The same machine described otherwise: in other units, mirrored, renamed, a period later."""

import dataclasses
import math

import pint

from gearlib import GearPair, Harmonics
from gearlib.parameters import declared_parameters

REGISTRY = pint.UnitRegistry()
#: Field -> unit of its `Harmonics`; other fields declare theirs.
HARMONICS = dict.fromkeys(("deviation", "coast_deviation", "transmission_error"), "m")
HARMONICS["excitation"] = "N"


def unit_factor(unit, length, mass, time):
    """Return the number of a unit whose length, mass and time are smaller by these factors."""
    scales = {"[length]": length, "[mass]": mass, "[time]": time}
    dimensions = REGISTRY.Unit(unit).dimensionality
    return math.prod(scales[name] ** power for name, power in dimensions.items())


def in_units(value, length=1.0, mass=1.0, time=1.0):
    """Return a model whose numbers are those of smaller units, by these factors."""
    changes, declared = {}, declared_parameters(type(value))
    for name in declared.keys() | {"pair"} & vars(value).keys():
        own = getattr(value, name)
        unit = declared[name].unit if name in declared else ""
        if isinstance(own, Harmonics):
            unit = HARMONICS[name]
        if unit and own is not None:
            changes[name] = _times(own, unit_factor(unit, length, mass, time))
        elif isinstance(own, GearPair):
            changes[name] = in_units(own, length, mass, time)
        elif isinstance(own, tuple) and own and dataclasses.is_dataclass(own[0]):
            changes[name] = tuple(in_units(part, length, mass, time) for part in own)
    return dataclasses.replace(value, **changes)


def _times(value, factor):
    if isinstance(value, Harmonics):
        return Harmonics(_times(value.cosines, factor), _times(value.sines, factor))
    if isinstance(value, (tuple, list)):
        return tuple(number * factor for number in value)
    return value * factor


def mirrored(train):
    """Return the image of a train in a mirror along x, which turns the other way round.

    Like the other changes of trains below, return with it the function that maps a coordinate
    (body, axis) of the train to (coordinate of the image, sign).
    """
    bodies = [
        dataclasses.replace(
            body,
            torque=-body.torque,
            angle=-body.angle,
            eccentricity_phase=-body.eccentricity_phase,
            offset=(body.offset[0], -body.offset[1]),
        )
        for body in train.bodies
    ]
    meshes = [
        dataclasses.replace(
            mesh,
            position=_negative(mesh.position),
            line_of_action=_negative(mesh.line_of_action),
            direction=-mesh.direction,
        )
        for mesh in train.meshes
    ]
    shafts = [dataclasses.replace(shaft, keying=_negative(shaft.keying)) for shaft in train.shafts]
    image = train.replace(bodies=bodies, meshes=meshes, shafts=shafts)
    return image, lambda key: (key, 1.0 if key[1] == "x" else -1.0)


def _negative(angle):
    return None if angle is None else -angle


def renamed(train):
    """Return a train with other names, its elements in the opposite order."""
    new = {body.name: f"body {len(train.bodies) - i}" for i, body in enumerate(train.bodies)}
    bodies = [
        dataclasses.replace(body, name=new[body.name], carrier=new.get(body.carrier))
        for body in reversed(train.bodies)
    ]
    meshes = [
        dataclasses.replace(
            mesh,
            name=f"mesh {mesh.name}",
            pinion=new[mesh.pinion],
            wheel=new[mesh.wheel],
            driving=new.get(mesh.driving),
        )
        for mesh in reversed(train.meshes)
    ]
    shafts = [
        dataclasses.replace(
            shaft,
            bodies=tuple(new[name] for name in reversed(shaft.bodies)),
            keying=_negative(shaft.keying),
        )
        for shaft in reversed(train.shafts)
    ]
    other = train.replace(
        bodies=bodies, meshes=meshes, shafts=shafts, reference=f"mesh {train.reference}"
    )
    return other, lambda key: ((new[key[0]], key[1]), 1.0)


def exchanged(train):
    """Return a train with the pinion of each external mesh called its wheel, and the reverse."""

    def exchange_pinion_and_wheel(mesh):
        """Return the mesh as it is when its pinion is called wheel, and its wheel pinion."""
        if mesh.internal:
            return mesh
        assert mesh.line_of_action is None
        driven_by_default = mesh.name == train.reference and not mesh.driving
        return dataclasses.replace(
            mesh,
            pinion=mesh.wheel,
            wheel=mesh.pinion,
            position=(mesh.position or 0.0) + math.pi,
            # By default the pinion of the reference mesh drives.
            driving=mesh.pinion if driven_by_default else mesh.driving,
            pitch_phase=-mesh.pitch_phase,
            tooth_thickness=mesh.tooth_thickness and mesh.tooth_thickness[::-1],
        )

    first = train.reference_mesh
    changes = {"meshes": [exchange_pinion_and_wheel(mesh) for mesh in train.meshes]}
    if train.carrier_ratio and not first.internal:
        # The ratio is counted in the speed of the reference pinion, which is another gear now.
        speeds = train.speeds.in_frame
        ratio = train.carrier_ratio * speeds[first.pinion] / speeds[first.wheel]
        changes["carrier_ratio"] = float(ratio)
    return train.replace(**changes), lambda key: (key, 1.0)
