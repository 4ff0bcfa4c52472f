"""A model as plain values, such as JSON has: from its public attributes, by no code of the library.

`describe` writes what the model was made of; of a train also where the stiffness of its meshes
begins, which the teeth decide (`tests/geometry/test_phases_by_teeth.py`). Numbers of elements that
follow each other by default stand in each. `moved` changes a description by a parameter.
"""

import copy
import dataclasses
import math


def describe(model):
    """Return a model as dicts, lists and numbers; ``kind`` is the name of its class."""
    found = _plain(model)
    if found["kind"] == "GearTrain":
        for name in ("phases", "inverse_phases"):
            found[name] = dict(getattr(model, name))
    return found


def _plain(value):
    if dataclasses.is_dataclass(value):
        fields = {one.name: _plain(getattr(value, one.name)) for one in dataclasses.fields(value)}
        return {"kind": type(value).__name__, **fields}
    if isinstance(value, (tuple, list)):
        return [_plain(one) for one in value]
    return value


def places(model, name):
    """Return what a parameter of the library moves: path in the description -> by what.

    Paths are tuples of keys; that of the tuning and of the start are their names alone.
    """
    kind = model["kind"]
    if kind == "GearTrain":
        return _places_of_train(model, name)
    if kind == "DeadZoneOscillator":
        follow = {
            "upper_stiffness": ["lower_stiffness"],
            "damping": ["upper_damping", "lower_damping"],
        }
        own = [one for one in follow.get(name, ()) if model[one] == model[name]]
        return dict.fromkeys([(name,), *((one,) for one in own)], 1.0)
    if "[" in name:
        field, index = name[:-1].split("[")
        return {(field, int(index)): 1.0}
    root = ("pair",) if "pair" in model else ()
    pair = model["pair"] if root else model
    mean = mean_stiffness(pair)
    damping = 2.0 * math.sqrt(mean * pair["reduced_mass"])
    ratios = {
        "damping_ratio": ("material_damping", damping),
        "backlash_damping_ratio": ("backlash_damping", damping),
        "backlash_ratio": ("backlash", pair["load"] / mean),
    }
    field, slope = ratios.get(name, (name, 1.0))
    if field not in pair:
        return {(name,): 1.0}
    found = {(*root, field): slope}
    if name == "load" and kind == "SixDegreePair":
        found |= {("torques", i): r for i, r in enumerate(model["base_radii"])}
    return found


def _places_of_train(model, name):
    if " of " not in name:
        if name in model["meshes"][0]:
            return {("meshes", j, name): 1.0 for j in range(len(model["meshes"]))}
        return {(name,): 1.0}
    field, rest = name.split(" of ", 1)
    if field == "initial_state":
        return {(name,): 1.0}
    kind, label = rest.split(" ", 1)
    label, _, axis = label.partition(", ")
    group = {"body": "bodies", "mesh": "meshes", "shaft": "shafts"}[kind]
    names = [one.get("name") or "-".join(one["bodies"]) for one in model[group]]
    place = (group, names.index(label), field)
    if field.startswith("support"):
        return {(*place, i): 1.0 for i in range(2) if axis in ("", "xy"[i])}
    return {place: 1.0}


def size_of(model, tuning, name):
    """Return a size of a parameter by which it can be moved: its value, 0 where it has none."""
    if name == "tuning":
        return tuning
    if name.startswith("initial"):
        return 0.0
    if name.endswith("_ratio") and name not in ("contact_ratio", "stiffness_ratio"):
        return 0.0
    if name == "load" and model["kind"] == "GearTrain":
        return 0.0
    for key in next(iter(places(model, name))):
        model = model[key]
    return model


def mean_stiffness(mesh):
    """Return C_s, Eq. (2), of a pair or mesh."""
    kappa = mesh["stiffness_ratio"]
    return mesh["max_stiffness"] * (kappa + (1 - kappa) * (mesh["contact_ratio"] - 1))


def moved(model, changes):
    """Return a description in which values at paths have grown by something."""
    other = copy.deepcopy(model)
    for path, change in changes.items():
        inner = other
        for key in path[:-1]:
            inner = inner[key]
        inner[path[-1]] = change + inner[path[-1]]
    return other
