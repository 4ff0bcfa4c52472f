"""Equivalent descriptions of a machine: other units, mirror image, other names or order."""

import dataclasses
import math

import pint

from gearlib import GearPair, Harmonics
from gearlib.parameters import declared_parameters

REGISTRY = pint.UnitRegistry()
#: Field -> unit of its `Harmonics`; other fields declare theirs.
HARMONICS_UNITS = dict.fromkeys(("deviation", "coast_deviation", "transmission_error"), "m")
HARMONICS_UNITS["excitation"] = "N"


def unit_factor(unit, length, mass, time):
    """Return the factor by which the number of a quantity grows in smaller base units.

    `unit` is the SI unit of the quantity; the new units of length, mass and time are smaller than
    metre, kilogram and second by the factors `length`, `mass` and `time`.
    """
    scales = {"[length]": length, "[mass]": mass, "[time]": time}
    dimensions = REGISTRY.Unit(unit).dimensionality
    return math.prod(scales[name] ** power for name, power in dimensions.items())


def in_units(value, length=1.0, mass=1.0, time=1.0):
    """Return a model (or a part of one) in base units that are smaller by the given factors.

    Every dimensional field is multiplied by its `unit_factor`, so that the machine is the same.
    """
    changes, declared = {}, declared_parameters(type(value))
    for name in declared.keys() | {"pair"} & vars(value).keys():
        field_value = getattr(value, name)
        unit = declared[name].unit if name in declared else ""
        if isinstance(field_value, Harmonics):
            unit = HARMONICS_UNITS[name]
        if unit and field_value is not None:
            changes[name] = _scale(field_value, unit_factor(unit, length, mass, time))
        elif isinstance(field_value, GearPair):
            changes[name] = in_units(field_value, length, mass, time)
        elif (
            isinstance(field_value, tuple)
            and field_value
            and dataclasses.is_dataclass(field_value[0])
        ):
            changes[name] = tuple(in_units(part, length, mass, time) for part in field_value)
    return dataclasses.replace(value, **changes)


def _scale(value, factor):
    """Return a number, sequence or `Harmonics` multiplied by a factor."""
    if isinstance(value, Harmonics):
        return Harmonics(_scale(value.cosines, factor), _scale(value.sines, factor))
    if isinstance(value, (tuple, list)):
        return tuple(number * factor for number in value)
    return value * factor


def mirror(train):
    """Return the mirror image of a train in the x axis, and a function that maps coordinates.

    The function takes a coordinate (body, axis) of the train and returns the corresponding
    coordinate of the image and its sign. The image rotates in the opposite direction.
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
            position=_negate(mesh.position),
            line_of_action=_negate(mesh.line_of_action),
            direction=-mesh.direction,
        )
        for mesh in train.meshes
    ]
    shafts = [dataclasses.replace(shaft, keying=_negate(shaft.keying)) for shaft in train.shafts]
    image = train.replace(bodies=bodies, meshes=meshes, shafts=shafts)
    return image, lambda key: (key, 1.0 if key[1] == "x" else -1.0)


def _negate(angle):
    """Return minus the angle, or None if the angle is None."""
    return None if angle is None else -angle


def rename_elements(train):
    """Return a train with new names and its elements in reverse order, and a coordinate map.

    The coordinate map is explained in `mirror`.
    """
    new_names = {body.name: f"body {len(train.bodies) - i}" for i, body in enumerate(train.bodies)}
    bodies = [
        dataclasses.replace(body, name=new_names[body.name], carrier=new_names.get(body.carrier))
        for body in reversed(train.bodies)
    ]
    meshes = [
        dataclasses.replace(
            mesh,
            name=f"mesh {mesh.name}",
            pinion=new_names[mesh.pinion],
            wheel=new_names[mesh.wheel],
            driving=new_names.get(mesh.driving),
        )
        for mesh in reversed(train.meshes)
    ]
    shafts = [
        dataclasses.replace(
            shaft,
            bodies=tuple(new_names[name] for name in reversed(shaft.bodies)),
            keying=_negate(shaft.keying),
        )
        for shaft in reversed(train.shafts)
    ]
    renamed_train = train.replace(
        bodies=bodies, meshes=meshes, shafts=shafts, reference=f"mesh {train.reference}"
    )
    return renamed_train, lambda key: ((new_names[key[0]], key[1]), 1.0)


def exchange_pinions_and_wheels(train):
    """Return a train with pinion and wheel of each external mesh exchanged, and a coordinate map.

    The coordinate map is explained in `mirror`.
    """

    def exchange_pinion_and_wheel(mesh):
        """Return an external mesh with pinion and wheel exchanged; keep an internal mesh."""
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

    reference_mesh = train.reference_mesh
    changes = {"meshes": [exchange_pinion_and_wheel(mesh) for mesh in train.meshes]}
    if train.carrier_ratio and not reference_mesh.internal:
        # The ratio refers to the speed of the reference pinion, which is now another gear.
        speeds = train.speeds.in_frame
        ratio = train.carrier_ratio * speeds[reference_mesh.pinion] / speeds[reference_mesh.wheel]
        changes["carrier_ratio"] = float(ratio)
    return train.replace(**changes), lambda key: (key, 1.0)
