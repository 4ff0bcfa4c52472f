"""Build models from plain values: JSON strings in datasets, and dicts from configurations."""

import json
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from gearlib.data.files import canonical_json
from gearlib.models.geometry import gear_stage as geometry
from gearlib.models.geometry.from_values import build_gear, build_stage
from gearlib.models.harmonics import Harmonics
from gearlib.models.load_sharing_pair import LoadSharingPair, default_load_sharing_pair
from gearlib.models.model import Model
from gearlib.models.one_degree_pair import OneDegreePair
from gearlib.models.pair import GearPair
from gearlib.models.profiles import create_profile
from gearlib.models.six_degrees import SixDegreePair
from gearlib.models.trains import planetary, ready_made
from gearlib.models.trains.elements import Body, HarmonicForce, Mesh, Shaft
from gearlib.models.trains.train import GearTrain
from gearlib.parameters import declared_parameters

#: Damping parameters that are arguments of `GearPair.from_geometry`.
_DAMPING_ARGUMENTS = ("damping_ratio", "logarithmic_decrement", "material_damping")
_DAMPING_ARGUMENTS += ("backlash_damping_ratio",)
#: Force assigned to a mesh without load, relative to the largest mesh force of the train.
_MIN_FORCE_RATIO = 1e-6


def model_from_json(text: str) -> Model | None:
    """Restore a model from the JSON string that a dataset stores.

    `text` is the result of `canonical_json(model.as_dict())`, the parameters of the model with
    sorted keys. Return None for any other string, and for a `LoadSharingPair`, which cannot be
    restored from JSON.
    """
    try:
        fields = _convert_json_value(json.loads(text))
        model = _model_from_fields(fields) if isinstance(fields, dict) else None
    except (TypeError, ValueError, KeyError):
        return None
    # The model is valid only if it gives the same string again.
    if model is None or canonical_json(model.as_dict()) != text:
        return None
    return model


def _convert_json_value(value: Any) -> Any:
    """Convert a decoded JSON value, including nested values, to the field types of models.

    Lists become tuples, the strings "inf" and "-inf" become floats, and a dict with the keys
    "cosines" and "sines" becomes `Harmonics`.
    """
    if isinstance(value, dict):
        entries = {name: _convert_json_value(entry) for name, entry in value.items()}
        return Harmonics(**entries) if entries.keys() == {"cosines", "sines"} else entries
    if isinstance(value, list):
        return tuple(map(_convert_json_value, value))
    return {"inf": math.inf, "-inf": -math.inf}.get(value, value)


def _model_from_fields(values: dict[str, Any]) -> Model | None:
    """Create a model from its field values, or return None if no model class has these fields.

    `values` maps field names to values; the function modifies this dict.
    """
    # Only a `GearTrain` has the field "bodies", only a `SixDegreePair` has "base_radii", and only
    # a `OneDegreePair` has "profile". A `GearPair` has none of these fields.
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
        return OneDegreePair(pair=pair, profile=create_profile(**values.pop("profile")), **values)
    return None if values else pair


def build_pair(profile: dict | None = None, **values: Any) -> GearPair | OneDegreePair:
    """Create a `GearPair`, or a `OneDegreePair` if a stiffness profile is given.

    `values` are the fields of `GearPair`. `profile` is a dict with the kind of the profile, e.g.
    "fourier", under the key "kind" and with its parameters. If it is None, the pair has its
    rectangular mesh stiffness.
    """
    pair = GearPair(**values)
    if profile is None:
        return pair
    return OneDegreePair(pair=pair, profile=create_profile(**profile))


def build_model(description: dict) -> Model:
    """Build a model from its description in a configuration.

    `description` is a dict. Its entry "model" is the kind of the model, a key of `MODELS` such as
    "pair"; the other entries are keyword arguments of the function `MODELS[kind]`.
    """
    kind = description["model"]
    arguments = {name: value for name, value in description.items() if name != "model"}
    return MODELS[kind](**arguments)


def build_models(value: Any) -> Any:
    """Return a copy of a nested value in which models replace their descriptions.

    `value` consists of JSON types: dicts, lists, strings and numbers. A dict with a string under
    the key "model" is the description of a model.
    """
    if isinstance(value, dict):
        if isinstance(value.get("model"), str):
            return build_model(value)
        return {name: build_models(entry) for name, entry in value.items()}
    if isinstance(value, list):
        return [build_models(entry) for entry in value]
    return value


def build_load_sharing_pair(
    gears: dict, damping: dict, pitch_errors: bool = True
) -> LoadSharingPair:
    """Build the `LoadSharingPair` that the section `gears` of a configuration describes.

    `gears` is a dict with the gear geometry, the torque in N m and, optionally, the stiffness
    method ("iso" or "energy") with its options. `damping` is a dict of damping parameters, either
    coefficients in N s/m such as "material_damping" or ratios such as "damping_ratio". If
    `pitch_errors` is False, the pitch errors of the gears are ignored.
    """
    stage = build_stage(gears)
    arguments = {"torque": gears["torque"], "stiffness": gears.get("stiffness")}
    if not pitch_errors:
        arguments["pitch_errors"] = (0.0,)  # the same error, 0, for all pairs of teeth
    arguments |= {name: damping[name] for name in _DAMPING_ARGUMENTS if name in damping}
    options = gears.get("stiffness_options")
    model = default_load_sharing_pair(stage, options=options, **arguments)
    # `from_geometry` does not accept this coefficient in N s/m, so it is set afterwards.
    backlash_damping = damping.get("backlash_damping")
    if backlash_damping:
        model = model.replace(backlash_damping=backlash_damping)
    return model


def build_six_degree_pair(pair: dict, **arguments: Any) -> SixDegreePair:
    """Build a `SixDegreePair`, a gear pair on elastic bearings.

    `pair` is the description of its `GearPair`, and `arguments` are its other fields.
    """
    return SixDegreePair(pair=build_model(pair), **arguments)


def build_train(kind: str, arguments: dict, pair: dict | None) -> GearTrain:
    """Build the gear train that the section `train` of a configuration describes.

    `kind` is the kind of train, e.g. "idler" or "planetary". `arguments` are the arguments of the
    function or class of that kind, with gears, bodies, meshes and shafts as dicts. `pair` describes
    the `GearPair` of a ready-made train with equal meshes; it is None for other trains.
    """
    if pair is not None:
        return getattr(ready_made, kind)(build_model(pair), **arguments)
    if kind == "planetary":
        return planetary.planetary(**arguments)
    if kind == "planetary_set":
        sun, planet, ring = (arguments[name] for name in ("sun", "planet", "ring"))
        gears = {"sun": build_gear(sun), "planet": build_gear(planet, sun)}
        gears["ring"] = build_gear(ring, sun, internal=True)
        stages = [_build_parallel_stage(values) for values in arguments.get("stages", ())]
        return planetary.planetary_set(**(arguments | gears | {"stages": stages}))
    gears = {
        body["name"]: build_gear(body["gear"]) for body in arguments["bodies"] if "gear" in body
    }
    elements: dict[str, list] = {
        "bodies": [_build_body(gears, **body) for body in arguments["bodies"]],
        "shafts": [Shaft(**shaft) for shaft in arguments["shafts"]],
        "forces": [HarmonicForce(**force) for force in arguments.get("forces", ())],
    }
    shaft_bodies = {name for shaft in elements["shafts"] for name in shaft.bodies}
    descriptions = arguments["meshes"]
    # Mesh torques follow from the static forces of the train. So a preliminary train is built
    # first, in which meshes with unknown torque have a mesh model that needs no torque.
    elements["meshes"] = [_build_mesh(gears, shaft_bodies, **mesh) for mesh in descriptions]
    preliminary_train = GearTrain(**(arguments | elements))
    forces = np.abs(preliminary_train.mean_forces) * preliminary_train.load
    # Under this small force, an unloaded mesh has a transmission error only from its tip reliefs.
    forces = np.maximum(forces, _MIN_FORCE_RATIO * forces.max())
    meshes = zip(preliminary_train.meshes, descriptions, strict=True)
    for i, (mesh, description) in enumerate(meshes):
        if _lacks_torque(gears, **description):
            if forces[i] == 0.0:
                raise ValueError(
                    f"torque of mesh {mesh.name} is missing: it must be given for the model "
                    "'teeth', because the torques of the bodies do not load the train"
                )
            torque = float(forces[i]) * preliminary_train.by_name[mesh.pinion].base_radius
            elements["meshes"][i] = _build_mesh(gears, shaft_bodies, **description, torque=torque)
    return GearTrain(**(arguments | elements))


def _build_parallel_stage(values: dict) -> planetary.ParallelStage:
    """Build a `ParallelStage`, a gear pair on fixed axes that is coupled to a planetary set.

    `values` contains the values of the gear stage, with its gears as dicts, and the other fields
    of `ParallelStage`. Fields with a default may be omitted.
    """
    names = "on", "gear", "shaft_stiffness", "position"
    fields = {name: values[name] for name in names if name in values}
    return planetary.ParallelStage(stage=build_stage(values), **fields)


def _build_body(gears: dict, *, name: str, gear: dict | None = None, **fields: Any) -> Body:
    """Create the `Body` called `name`, with defaults from its gear geometry if it has one.

    `gear` is the dict of the gear geometry, or None. `gears` maps body names to the `SpurGear`
    built from these dicts, which provides fields that are missing in `fields`, e.g. the mass.
    """
    if gear:
        return Body.from_gear(gears[name], name, **fields)
    return Body(name=name, **fields)


def _lacks_torque(gears: dict, **values: Any) -> bool:
    """Return whether the model of a mesh needs a torque that is not given.

    Only the model "teeth" needs a torque, at which it computes the transmission error. It is the
    default for a mesh without max_stiffness whose gears both have a geometry. `gears` maps body
    names to `SpurGear`, and `values` are the values of the mesh, which name its pinion and wheel.
    """
    has_geometry = {values["pinion"], values["wheel"]} <= gears.keys()
    is_teeth_model = values.get("model", "teeth") == "teeth" and "max_stiffness" not in values
    return has_geometry and is_teeth_model and "torque" not in values


def _build_mesh(
    gears, shaft_bodies, *, stiffness=None, stiffness_options=None, centre_distance=None, **values
):
    """Create a `Mesh` from its `values`, which name its pinion and wheel.

    If both gears have a geometry and `values` has no max_stiffness, the geometry provides the
    missing fields. Then `stiffness` is the method "iso" or "energy", or None for the default,
    `stiffness_options` are its options, and `centre_distance` is in m. `gears` maps body names to
    `SpurGear`, and `shaft_bodies` is the set of names of bodies on shafts. If the model
    "teeth" lacks its torque, it is replaced by the model "rectangle".
    """
    values = {"material_damping": None} | values  # None means that the damping is unknown.
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
    # The stiffness of a shaft already includes the twist of the gear bodies on it.
    body_twists = [values[name] not in shaft_bodies for name in ("pinion", "wheel")]
    if stiffness == "energy" and not all(body_twists):
        options = {"twist": body_twists} | options
    if _lacks_torque(gears, **values):
        values["model"] = "rectangle"  # the only model that needs no torque
    return Mesh.from_geometry(gear_stage, stiffness=stiffness, options=options, **values)


#: Kind of model -> function that builds it from the other entries of a description.
MODELS: dict[str, Callable[..., Model]] = {
    "pair": build_pair,
    "teeth": build_load_sharing_pair,
    "six_degrees": build_six_degree_pair,
    "train": build_train,
}
