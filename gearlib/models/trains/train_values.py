"""The numbers of a train that can be read and changed one by one, by their names.

A parameter of one element is called as the sentences of refusals call it, ``inertia of body sun``;
that of a mesh without an element is that of all meshes, which share one value, and that of a
support without an axis that of both.
"""

import dataclasses
import math

_TORSION = "N m rad-1", "N m s rad-1"
#: Fields of bodies, shafts and meshes -> (CF units, words).
FIELDS: dict = {
    "body": {
        "inertia": ("kg m2", "inertia"),
        "mass": ("kg", "mass"),
        "support_stiffness": ("N m-1", "stiffness of the support"),
        "support_damping": ("N s m-1", "damping of the support"),
        "torsional_stiffness": (_TORSION[0], "torsional stiffness of the support"),
        "torsional_damping": (_TORSION[1], "torsional damping of the support"),
        "torque": ("N m", "torque"),
        "offset": ("m", "misplaced axis"),
    },
    "shaft": {
        "stiffness": (_TORSION[0], "torsional stiffness"),
        "damping": (_TORSION[1], "torsional damping"),
        "bending_stiffness": ("N m-1", "bending stiffness"),
        "bending_damping": ("N s m-1", "bending damping"),
    },
    "mesh": {
        "max_stiffness": ("N m-1", "maximum mesh stiffness"),
        "stiffness_ratio": ("1", "stiffness ratio kappa"),
        "contact_ratio": ("1", "contact ratio epsilon"),
        "backlash": ("m", "backlash"),
        "material_damping": ("N s m-1", "damping in contact"),
        "backlash_damping": ("N s m-1", "damping in the backlash"),
        "error": ("m", "error of assembly"),
    },
}


def elements(train):
    """Return kind -> name -> element."""
    return {
        "body": train.by_name,
        "shaft": {"-".join(shaft.bodies): shaft for shaft in train.shafts},
        "mesh": {mesh.name: mesh for mesh in train.meshes},
    }


def settable(train):
    """Return name -> (CF units, words) of the finite numbers of a train's elements.

    ``load`` stands for all torques in proportion, the name of a mesh's field alone for that of all
    meshes, the name of a support's field alone for that of both axes, where they share one value.
    """
    described = {"load": ("N", "load, all torques in proportion")}
    for name, (units, words) in FIELDS["mesh"].items():
        if len({getattr(mesh, name) for mesh in train.meshes}) == 1:
            described[name] = units, f"{words} of all meshes"
    for kind, named in elements(train).items():
        for label, element in named.items():
            for name, (units, words) in FIELDS[kind].items():
                axes = _elastic(element, name)
                if axes is None:
                    continue
                values = {getattr(element, name)["xy".index(axis)] for axis in axes}
                if name != "offset" and len(values) < 2:
                    described[f"{name} of {kind} {label}"] = units, f"{words} of {kind} {label}"
                for axis in axes:
                    about = units, f"{words} of {kind} {label}, {axis}"
                    described[f"{name} of {kind} {label}, {axis}"] = about
    return described


def _elastic(element, name):
    """Return the axes that a field has, none for most; None: what it is of is rigid or absent."""
    if name == "offset":
        return "xy"
    if name == "mass":
        return None if element.mass is None else ""
    part, _, field = name.rpartition("_")
    if part not in ("support", "torsional") or field not in ("stiffness", "damping"):
        return ""
    stiffness = getattr(element, f"{part}_stiffness")
    if part == "torsional":
        return None if math.isinf(stiffness) else ""
    pairs = zip("xy", stiffness, strict=True)
    return "".join(axis for axis, one in pairs if math.isfinite(one)) or None


def value(train, name):
    """Return the value of one of `settable`."""
    if name == "load":
        return train.load
    (kind, label, field, axes), *_ = _places(train, name)
    whole = getattr(elements(train)[kind][label], field)
    return whole["xy".index(axes[0])] if axes else whole


def with_values(train, changes):
    """Return the train with some of `settable` changed and checked."""
    fields: dict = {}
    for name, new in changes.items():
        if name == "load":
            for body in train.bodies:
                torque = body.torque * (new / train.load)
                fields.setdefault(("body", body.name), {})["torque"] = torque
            continue
        for kind, label, field, axes in _places(train, name):
            element = fields.setdefault((kind, label), {})
            if axes:
                old = element.get(field, getattr(elements(train)[kind][label], field))
                pairs = zip("xy", old, strict=True)
                element[field] = tuple(new if axis in axes else entry for axis, entry in pairs)
            else:
                element[field] = new
    changed = {
        kind: tuple(
            dataclasses.replace(element, **fields[kind, label])
            if (kind, label) in fields
            else element
            for label, element in named.items()
        )
        for kind, named in elements(train).items()
    }
    return train.replace(bodies=changed["body"], shafts=changed["shaft"], meshes=changed["mesh"])


def _places(train, name):
    """Return the (kind, label, field, axes) of a parameter of elements, or of all meshes."""
    if name in FIELDS["mesh"]:
        return [("mesh", label, name, "") for label in train.mesh_names]
    field, element = name.split(" of ", 1)
    kind, label = element.split(" ", 1)
    named = elements(train)[kind]
    if label in named:
        return [(kind, label, field, _elastic(named[label], field))]
    label, axis = label.rsplit(", ", 1)
    return [(kind, label, field, axis)]
