"""Models built from plain values: from JSON in datasets and descriptions in configurations."""

import json
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from gearlib.data.files import canonical_json
from gearlib.models.geometry import gear_stage as geometry
from gearlib.models.geometry.from_values import gear
from gearlib.models.geometry.from_values import stage as geometry_from_dict
from gearlib.models.harmonics import Harmonics
from gearlib.models.load_sharing_pair import LoadSharingPair, default_load_sharing_pair
from gearlib.models.model import Model
from gearlib.models.one_degree_pair import OneDegreePair
from gearlib.models.pair import GearPair
from gearlib.models.profiles import profile_of
from gearlib.models.six_degrees import SixDegreePair
from gearlib.models.trains import planetary, ready_made
from gearlib.models.trains.elements import Body, HarmonicForce, Mesh, Shaft
from gearlib.models.trains.train import GearTrain
from gearlib.parameters import declared_parameters

#: Keys of a damping that are arguments of `GearPair.from_geometry`.
_PAIR_DAMPINGS = ("damping_ratio", "logarithmic_decrement", "material_damping")
_PAIR_DAMPINGS += ("backlash_damping_ratio",)
#: Force given to a mesh that carries no load, over the largest mesh force of the train.
_MIN_FORCE_RATIO = 1e-6


def model_from_json(text: str) -> Model | None:
    """Return the model that a JSON string describes, or None if it describes none.

    `text` is the string that `canonical_json(model.as_dict())` returns: the parameters of the model
    with sorted keys, as datasets store them. The result is None for any other string, and for a
    `LoadSharingPair`, which cannot be restored from JSON.
    """
    try:
        fields = _field_values(json.loads(text))
        model = _model_with(fields) if isinstance(fields, dict) else None
    except (TypeError, ValueError, KeyError):
        return None
    # The model is returned only if it gives the same string again.
    if model is None or canonical_json(model.as_dict()) != text:
        return None
    return model


def _field_values(value: Any) -> Any:
    """Convert a decoded JSON value to the types that the fields of models have, and return it.

    Lists become tuples, the strings "inf" and "-inf" become numbers, and a dict with the keys
    "cosines" and "sines" becomes `Harmonics`. Nested values are converted too.
    """
    if isinstance(value, dict):
        entries = {name: _field_values(entry) for name, entry in value.items()}
        return Harmonics(**entries) if entries.keys() == {"cosines", "sines"} else entries
    if isinstance(value, list):
        return tuple(map(_field_values, value))
    return {"inf": math.inf, "-inf": -math.inf}.get(value, value)


def _model_with(values: dict[str, Any]) -> Model | None:
    """Return the model with these field values, or None if no model class has such fields.

    `values` maps names of fields to values, and its entries may be removed. The key "bodies" occurs
    only in a `GearTrain`, "base_radii" in a `SixDegreePair` and "profile" in a `OneDegreePair`.
    Without these keys the model is a `GearPair`, if no other fields are left over.
    """
    if "bodies" in values:
        classes = {"bodies": Body, "meshes": Mesh, "shafts": Shaft, "forces": HarmonicForce}
        for name, element_class in classes.items():
            values[name] = tuple(element_class(**entry) for entry in values[name])
        return GearTrain(**values)
    if "base_radii" in values:
        return SixDegreePair(**(values | {"pair": GearPair(**values["pair"])}))
    pair_fields = declared_parameters(GearPair).keys()
    pair = GearPair(**{name: values.pop(name) for name in pair_fields if name in values})
    if "profile" in values:
        return OneDegreePair(pair=pair, profile=profile_of(**values.pop("profile")), **values)
    return None if values else pair


def pair_with_profile(profile: dict | None = None, **values: Any) -> GearPair | OneDegreePair:
    """Return the gear pair with these parameters, a `OneDegreePair` if it has a stiffness profile.

    `values` are the fields of `GearPair`. `profile` is a dict with the kind of the profile, such as
    "fourier", under the key "kind" and its parameters, or None for the rectangular stiffness of the
    pair.
    """
    pair = GearPair(**values)
    if profile is None:
        return pair
    return OneDegreePair(pair=pair, profile=profile_of(**profile))


def model(description: dict) -> Model:
    """Build and return the model that a dict describes.

    The value of its key "model" is the kind of the model, such as "pair", a key of `MODELS`. The
    other entries are keyword arguments of the function `MODELS[kind]`, which builds the model.
    """
    arguments = {name: value for name, value in description.items() if name != "model"}
    return MODELS[description["model"]](**arguments)


def with_models(value: Any) -> Any:
    """Replace descriptions of models in a value by the models, and return the new value.

    `value` has JSON types: dicts, lists, strings and numbers. A description is a dict with a string
    under the key "model". The argument is not changed.
    """
    if isinstance(value, dict):
        if isinstance(value.get("model"), str):
            return model(value)
        return {name: with_models(entry) for name, entry in value.items()}
    if isinstance(value, list):
        return [with_models(entry) for entry in value]
    return value


def pairs_of_teeth(gears: dict, damping: dict, pitch_errors: bool = True) -> LoadSharingPair:
    """Return the `LoadSharingPair` of the section `gears` of a configuration.

    `gears` is a dict with the gear geometry, the torque in N m and, optionally, the stiffness
    method ("iso" or "energy") and the dict of its options. `damping` is a dict of damping
    parameters: coefficients in N s/m such as "material_damping", or ratios such as "damping_ratio".
    `pitch_errors` says whether the pitch errors of the gears are taken into account.
    """
    stage = geometry_from_dict(gears)
    arguments = {"torque": gears["torque"], "stiffness": gears.get("stiffness")}
    if not pitch_errors:
        arguments["pitch_errors"] = (0.0,)  # one error, 0, for all pairs of teeth
    arguments |= {name: damping[name] for name in _PAIR_DAMPINGS if name in damping}
    options = gears.get("stiffness_options")
    model = default_load_sharing_pair(stage, options=options, **arguments)
    # This coefficient in N s/m is no argument of `from_geometry` and is set afterwards.
    backlash_damping = damping.get("backlash_damping")
    if backlash_damping:
        model = model.replace(backlash_damping=backlash_damping)
    return model


def six_degrees(pair: dict, **arguments: Any) -> SixDegreePair:
    """Return the `SixDegreePair`, a pair of gears on elastic bearings, with these parameters.

    `pair` is the dict that describes its `GearPair`, and `arguments` are its other parameters.
    """
    return SixDegreePair(pair=model(pair), **arguments)


def train(kind: str, arguments: dict, pair: dict | None) -> GearTrain:
    """Return the gear train that the section `train` of a configuration describes.

    `kind` is a kind of train such as "idler" or "planetary". `arguments` are the arguments of the
    function or class of that kind, with gears, bodies, meshes and shafts as dicts. `pair` is the
    dict that describes the `GearPair` of a ready-made train of equal meshes, or None for other
    trains.
    """
    if pair is not None:
        return getattr(ready_made, kind)(model(pair), **arguments)
    if kind == "planetary":
        return planetary.planetary(**arguments)
    if kind == "planetary_set":
        sun, planet, ring = (arguments[name] for name in ("sun", "planet", "ring"))
        gears = {"sun": gear(sun), "planet": gear(planet, sun)}
        gears["ring"] = gear(ring, sun, internal=True)
        stages = [_parallel_stage(values) for values in arguments.get("stages", ())]
        return planetary.planetary_set(**(arguments | gears | {"stages": stages}))
    gears = {body["name"]: gear(body["gear"]) for body in arguments["bodies"] if "gear" in body}
    elements: dict[str, list] = {
        "bodies": [_body(gears, **body) for body in arguments["bodies"]],
        "shafts": [Shaft(**shaft) for shaft in arguments["shafts"]],
        "forces": [HarmonicForce(**force) for force in arguments.get("forces", ())],
    }
    on_shafts = {name for shaft in elements["shafts"] for name in shaft.bodies}
    descriptions = arguments["meshes"]
    # A mesh needs its torque, which follows from the static forces of the train. So a first train,
    # the draft, has a simpler mesh model without a torque wherever the torque is still unknown.
    elements["meshes"] = [_mesh(gears, on_shafts, **mesh) for mesh in descriptions]
    draft = GearTrain(**(arguments | elements))
    forces = np.abs(draft.mean_forces) * draft.load
    # A mesh without a load gets a small load, at which only tip reliefs cause a transmission error.
    forces = np.maximum(forces, _MIN_FORCE_RATIO * forces.max())
    for i, (mesh, description) in enumerate(zip(draft.meshes, descriptions, strict=True)):
        if _is_draft(gears, **description):
            if forces[i] == 0.0:
                raise ValueError(
                    f"torque of mesh {mesh.name} is missing: it must be given for the model "
                    "'teeth', because the torques of the bodies do not load the train"
                )
            torque = float(forces[i]) * draft.by_name[mesh.pinion].base_radius
            elements["meshes"][i] = _mesh(gears, on_shafts, **description, torque=torque)
    return GearTrain(**(arguments | elements))


def _parallel_stage(values: dict) -> planetary.ParallelStage:
    """Return a `ParallelStage`, two gears on fixed axes that join a planetary set, from a dict.

    `values` holds the values of the gear stage, with its gears as dicts, and the other fields of
    `ParallelStage`, which may be missing if they have a default.
    """
    fields = {
        name: values[name]
        for name in ("on", "gear", "shaft_stiffness", "position")
        if name in values
    }
    return planetary.ParallelStage(stage=geometry_from_dict(values), **fields)


def _body(gears: dict, *, name: str, gear: dict | None = None, **fields: Any) -> Body:
    """Return the `Body` of a train with this name, with missing fields from its gear geometry.

    `gear` is the dict of the gear geometry, or None if the body has none. `gears` maps names of
    bodies to the `SpurGear` built from such dicts, which determines fields that are not in
    `fields`, such as mass and inertia.
    """
    if gear:
        return Body.from_gear(gears[name], name, **fields)
    return Body(name=name, **fields)


def _is_draft(gears: dict, **values: Any) -> bool:
    """Return whether a mesh is a draft: its model needs a torque, but none is given yet.

    The model "teeth", the default if both gears have a geometry and no max_stiffness is given,
    computes its transmission error at the torque. `gears` maps names of bodies to `SpurGear`, and
    `values` are the values of the mesh, such as the names of its pinion and wheel.
    """
    has_geometry = {values["pinion"], values["wheel"]} <= gears.keys()
    has_teeth = values.get("model", "teeth") == "teeth" and "max_stiffness" not in values
    return has_geometry and has_teeth and "torque" not in values


def _mesh(
    gears, on_shafts, *, stiffness=None, stiffness_options=None, centre_distance=None, **values
):
    """Return the `Mesh` of a train from its `values`, which name its pinion and wheel.

    `gears` maps names of bodies with a gear geometry to `SpurGear`. If both gears have a geometry
    and `values` has no max_stiffness, the geometry determines the missing fields. Then `stiffness`
    is the method "iso" or "energy", or None for a default, `stiffness_options` is the dict of its
    options, and `centre_distance` is in m. `on_shafts` is the set of names of bodies on shafts. A
    mesh with the model "teeth" but no torque yet gets the simpler model "rectangle".
    """
    values = {"material_damping": None} | values  # None: the damping is unknown.
    for name in {"deviation", "coast_deviation", "transmission_error"} & values.keys():
        values[name] = Harmonics(**values[name])
    pinion, wheel = (gears.get(values[name]) for name in ("pinion", "wheel"))
    if pinion is None or wheel is None or "max_stiffness" in values:
        return Mesh(**values)
    gear_stage = geometry.GearStage(pinion, wheel, centre_distance)
    if stiffness is None:
        is_rectangle = values.get("model") == "rectangle"
        stiffness = "iso" if is_rectangle else gear_stage.tooth_stiffness
    options = stiffness_options or {}
    # The twist of a body on a shaft is part of the stiffness of the shaft, not of the mesh.
    twists = [values[name] not in on_shafts for name in ("pinion", "wheel")]
    if stiffness == "energy" and not all(twists):
        options = {"twist": twists} | options
    if _is_draft(gears, **values):
        values["model"] = "rectangle"  # the only model that needs no torque
    return Mesh.from_geometry(gear_stage, stiffness=stiffness, options=options, **values)


#: Kind of a model -> function that builds it from the other values of a description.
MODELS: dict[str, Callable[..., Model]] = {
    "pair": pair_with_profile,
    "teeth": pairs_of_teeth,
    "six_degrees": six_degrees,
    "train": train,
}
