"""Numbers of a train that can be read and changed by name.

The name of a number is e.g. ``inertia of body sun``, as in error messages. The name of a mesh
field, e.g. ``backlash``, refers to all meshes if they have the same value. The name of a support
without an axis refers to both axes.
"""

import dataclasses
import math
from typing import TYPE_CHECKING, Any

from gearlib import parameters
from gearlib.parameters import Backlash

if TYPE_CHECKING:
    from gearlib.models.trains.train import GearTrain

#: Unit of displacements of a train whose reference mesh carries no load, m.
UNLOADED_DEFLECTION = 1e-6
#: Continuation parameters of trains: name -> (CF units, long_name).
PARAMETERS = {
    "tuning": ("1", "tuning nu, reference mesh frequency over reference frequency"),
    "stiffness_ratio": ("1", "stiffness ratio kappa = C_min / C_max of all meshes"),
    "contact_ratio": ("1", "contact ratio epsilon of all meshes"),
    "backlash_ratio": ("1", "backlash of all meshes in static deflections"),
    "material_damping": ("N s m-1", "damping in contact of all meshes"),
}
#: Fields of bodies, shafts and meshes -> (CF units, description).
FIELDS: dict = {
    "body": {
        "inertia": ("kg m2", "inertia"),
        "mass": ("kg", "mass"),
        "support_stiffness": ("N m-1", "stiffness of the support"),
        "support_damping": ("N s m-1", "damping of the support"),
        "torsional_stiffness": ("N m rad-1", "torsional stiffness of the support"),
        "torsional_damping": ("N m s rad-1", "torsional damping of the support"),
        "torque": ("N m", "torque"),
        "offset": ("m", "misplaced axis"),
    },
    "shaft": {
        "stiffness": ("N m rad-1", "torsional stiffness"),
        "damping": ("N m s rad-1", "torsional damping"),
        "bending_stiffness": ("N m-1", "bending stiffness"),
        "bending_damping": ("N s m-1", "bending damping"),
    },
    "mesh": {
        "max_stiffness": ("N m-1", "maximum mesh stiffness"),
        "stiffness_ratio": ("1", "stiffness ratio kappa"),
        "contact_ratio": ("1", "contact ratio epsilon"),
        "backlash": ("m", "backlash"),
        "material_damping": ("N s m-1", "damping in contact"),
        "backlash_damping": ("N s m-1", "damping in free flight"),
        "error": ("m", "error of assembly"),
    },
}


def shared_value(train: "GearTrain", name: str) -> float:
    """Return the common value of a continuation parameter of all meshes of a train.

    `name` is a key of `PARAMETERS`, e.g. "contact_ratio". The parameter backlash_ratio is the
    backlash in units of the static deflection. Raises ValueError if the meshes have different
    values.
    """
    field = "backlash" if name == "backlash_ratio" else name
    values = {getattr(mesh, field) for mesh in train.meshes}
    if len(values) > 1:
        raise ValueError(
            f"parameter = {name!r} is not allowed for this train: all meshes must have the same "
            f"value, not {', '.join(map(repr, sorted(values)))}"
        )
    value = values.pop()
    return value / train.static_deflection if name == "backlash_ratio" else value


def with_shared_value(train: "GearTrain", name: str, value: float) -> "GearTrain":
    """Return a copy of a train with a new value of a continuation parameter in all meshes.

    `name` is a key of `PARAMETERS`, e.g. "contact_ratio". The maximum stiffness is adjusted so that
    the mean stiffness, the natural frequencies and the static deflection do not change.
    """
    if name == "backlash_ratio":
        value = parameters.check(name, value, Backlash) * train.static_deflection
        name = "backlash"
    meshes = []
    for mesh in train.meshes:
        changed_mesh = dataclasses.replace(mesh, **{name: value})
        ratio = mesh.mean_stiffness / changed_mesh.mean_stiffness
        if not math.isclose(ratio, 1.0):
            max_stiffness = changed_mesh.max_stiffness * ratio
            changed_mesh = dataclasses.replace(changed_mesh, max_stiffness=max_stiffness)
        meshes.append(changed_mesh)
    return dataclasses.replace(train, meshes=tuple(meshes))


def _elements(train: "GearTrain") -> dict[tuple, Any]:
    """Return the elements of a train as a dict (kind, name) -> `Body`, `Shaft` or `Mesh`.

    The kind is "body", "shaft" or "mesh". The bodies of a train given by matrices are omitted,
    because the matrices contain their masses and stiffnesses.
    """
    bodies = () if train.matrices is not None else train.bodies
    return (
        {("body", body.name): body for body in bodies}
        | {("shaft", "-".join(shaft.bodies)): shaft for shaft in train.shafts}
        | {("mesh", mesh.name): mesh for mesh in train.meshes}
    )


def _number_locations(train: "GearTrain") -> dict[str, list[tuple]]:
    """Return where the numbers of a train are stored, a dict name -> [(element, field, axes)].

    The name is e.g. "inertia of body sun". The element is a pair (kind, name), e.g. ("body",
    "sun"). `axes` is "x", "y" or "xy" for a field with values along x and y, and "" for other
    fields. Missing values and springs with infinite stiffness are omitted.
    """
    locations: dict = {}
    for element_key, element in _elements(train).items():
        for field in FIELDS[element_key[0]]:
            value, name = getattr(element, field), f"{field} of {' '.join(element_key)}"
            # For example, the spring of support_damping is "support".
            spring = field.removesuffix("_stiffness").removesuffix("_damping")
            stiffness = None
            if spring != field:
                stiffness = getattr(element, f"{spring}_stiffness", None)
            if not isinstance(value, tuple):
                is_rigid = spring == "torsional" and math.isinf(stiffness)
                if value is not None and not is_rigid:
                    locations[name] = [(element_key, field, "")]
                continue
            stiffness_xy = stiffness or (0.0, 0.0)  # The offset is a pair without a stiffness.
            axes = [axis for axis, k in zip("xy", stiffness_xy, strict=True) if math.isfinite(k)]
            values = {value["xy".index(axis)] for axis in axes}
            # Equal values along x and y also have a common name, except for the offset vector.
            if field != "offset" and len(values) == 1:
                locations[name] = [(element_key, field, "".join(axes))]
            for axis in axes:
                locations[f"{name}, {axis}"] = [(element_key, field, axis)]
    return locations


def _shared_locations(train: "GearTrain") -> dict[str, list[tuple]]:
    """Return where the mesh fields are stored that have the same value in all meshes.

    The result maps a field to [(element, field, ""), ...] with one entry per mesh, where the
    element is ("mesh", name of the mesh).
    """
    return {
        field: [(("mesh", mesh.name), field, "") for mesh in train.meshes]
        for field in FIELDS["mesh"]
        if len({getattr(mesh, field) for mesh in train.meshes}) == 1
    }


def settable(train: "GearTrain") -> dict[str, tuple[str, str]]:
    """Return the numbers of a train that can be changed, a dict name -> (CF units, description).

    A name is e.g. "inertia of body sun". The name of a mesh field refers to all meshes, and
    ``load`` scales all torques.
    """
    descriptions = {"load": ("N", "load, all torques in proportion")}
    for field in _shared_locations(train):
        units, description = FIELDS["mesh"][field]
        descriptions[field] = units, f"{description} of all meshes"
    for name, [((kind, _), field, _)] in _number_locations(train).items():
        units, description = FIELDS[kind][field]
        descriptions[name] = units, description + name.removeprefix(field)
    return descriptions


def value(train: "GearTrain", name: str) -> float:
    """Return a number of a train by its name, a key of `settable`, e.g. "inertia of body sun"."""
    if name == "load":
        return train.load
    locations = _shared_locations(train) | _number_locations(train)
    element_key, field, axes = locations[name][0]  # All values with the same name are equal.
    entry = getattr(_elements(train)[element_key], field)
    return entry["xy".index(axes[0])] if axes else entry


def with_values(train: "GearTrain", new_values: dict[str, float]) -> "GearTrain":
    """Return a copy of a train with new values of some of its numbers.

    `new_values` maps keys of `settable`, e.g. "inertia of body sun", to values. The number "load"
    scales all torques, or the constant forces of given matrices.
    """
    locations = _shared_locations(train) | _number_locations(train)
    elements = _elements(train)
    new_fields: dict = {element_key: {} for element_key in elements}  # element -> field -> value
    for name, new_value in new_values.items():
        if name == "load" and train.matrices is not None:
            load = train.matrices.load * (new_value / train.load)
            train = train.replace(matrices=dataclasses.replace(train.matrices, load=load))
            continue
        if name == "load":
            for body in train.bodies:
                new_fields["body", body.name]["torque"] = body.torque * (new_value / train.load)
            continue
        for element_key, field, axes in locations[name]:
            new_entry: Any = new_value
            if axes:
                x, y = new_fields[element_key].get(field, getattr(elements[element_key], field))
                if "x" in axes:
                    x = new_value
                if "y" in axes:
                    y = new_value
                new_entry = x, y
            new_fields[element_key][field] = new_entry
    new_elements: dict = {"body": (), "shaft": (), "mesh": ()}
    for element_key, element in elements.items():
        if new_fields[element_key]:
            element = dataclasses.replace(element, **new_fields[element_key])
        new_elements[element_key[0]] += (element,)
    bodies = new_elements["body"] or train.bodies
    return train.replace(bodies=bodies, shafts=new_elements["shaft"], meshes=new_elements["mesh"])
