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
#: Load given to an unloaded mesh, over the largest mesh force of the train.
_MIN_FORCE_RATIO = 1e-6


def model_from_json(text: str) -> Model | None:
    """Return the model whose ``as_dict()`` is the canonical JSON `text`, or None if there is none.

    Datasets store such texts. A `LoadSharingPair` cannot be restored.
    """
    try:
        fields = _field_values(json.loads(text))
        model = _model_with(fields) if isinstance(fields, dict) else None
    except (TypeError, ValueError, KeyError):
        return None
    if model is None or canonical_json(model.as_dict()) != text:
        return None
    return model


def _field_values(value: Any) -> Any:
    """Return a decoded JSON value in the types of the fields of models.

    Lists become tuples, "inf" and "-inf" become numbers, and a dict of cosines and sines becomes
    `Harmonics`.
    """
    if isinstance(value, dict):
        entries = {name: _field_values(entry) for name, entry in value.items()}
        return Harmonics(**entries) if entries.keys() == {"cosines", "sines"} else entries
    if isinstance(value, list):
        return tuple(map(_field_values, value))
    return {"inf": math.inf, "-inf": -math.inf}.get(value, value)


def _model_with(values: dict[str, Any]) -> Model | None:
    """Return the model with these field values, or None if no model class has such fields.

    The names of the fields determine the class. The dict `values` is modified.
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
    """Return the gear pair with these parameters, a `OneDegreePair` if it has a profile.

    `profile` is a dict with the kind of the stiffness profile and its parameters, or None.
    """
    pair = GearPair(**values)
    if profile is None:
        return pair
    return OneDegreePair(pair=pair, profile=profile_of(**profile))


def model(description: dict) -> Model:
    """Return the model that a dict describes.

    The value of its key "model" is the kind of the model, a key of `MODELS`. Its other values are
    the arguments of the function that builds models of this kind.
    """
    arguments = {name: value for name, value in description.items() if name != "model"}
    return MODELS[description["model"]](**arguments)


def with_models(value: Any) -> Any:
    """Replace the descriptions of models in a value of JSON types by the models, and return it.

    A description is a dict with a text under the key "model". The argument is not changed.
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
    method and its options. `damping` holds damping coefficients in N s/m or ratios by their
    configuration keys. `pitch_errors` is whether the pitch errors of the gears count.
    """
    stage = geometry_from_dict(gears)
    arguments = {"torque": gears["torque"], "stiffness": gears.get("stiffness")}
    if not pitch_errors:
        arguments["pitch_errors"] = (0.0,)
    arguments |= {name: damping[name] for name in _PAIR_DAMPINGS if name in damping}
    options = gears.get("stiffness_options")
    model = default_load_sharing_pair(stage, options=options, **arguments)
    backlash_damping = damping.get("backlash_damping")
    if backlash_damping:
        model = model.replace(backlash_damping=backlash_damping)
    return model


def six_degrees(pair: dict, **arguments: Any) -> SixDegreePair:
    """Return the `SixDegreePair` of a gear pair; `pair` is the description of its `GearPair`.

    The other arguments are parameters of `SixDegreePair`.
    """
    return SixDegreePair(pair=model(pair), **arguments)


def train(kind: str, arguments: dict, pair: dict | None) -> GearTrain:
    """Return the gear train that the section `train` of a configuration describes.

    `kind` is a kind of train such as "idler" or "planetary". `arguments` are the arguments of the
    function or class of that kind, with gears, bodies, meshes and shafts as dicts. `pair` describes
    the `GearPair` that some kinds need, or is None.
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
    # Meshes without a torque are drafts in this train, which suffice to compute its static forces.
    elements["meshes"] = [_mesh(gears, on_shafts, **mesh) for mesh in descriptions]
    draft = GearTrain(**(arguments | elements))
    forces = np.abs(draft.mean_forces) * draft.load
    # An unloaded mesh gets a small load, at which only reliefs cause a transmission error.
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
    """Return the parallel stage of a planetary set from a dict of plain values.

    `values` holds the values of the gear stage, with its gears as dicts, and the other fields of
    `ParallelStage`, some of which are optional.
    """
    fields = {
        name: values[name]
        for name in ("on", "gear", "shaft_stiffness", "position")
        if name in values
    }
    return planetary.ParallelStage(stage=geometry_from_dict(values), **fields)


def _body(gears: dict, *, name: str, gear: dict | None = None, **fields: Any) -> Body:
    """Return the `Body` with this name and these fields; a gear geometry provides missing fields.

    `gears` maps names of bodies to `SpurGear`. `gear` is the dict of the gear geometry, from which
    the entry of `gears` was built, or None if the body has no gear geometry.
    """
    if gear:
        return Body.from_gear(gears[name], name, **fields)
    return Body(name=name, **fields)


def _is_draft(gears: dict, **values: Any) -> bool:
    """Return whether a mesh needs a torque for its transmission error, but has none yet.

    Only the model "teeth" of two gears with geometry needs a torque. `gears` maps names of bodies
    to `SpurGear`, and `values` are the values of the mesh.
    """
    has_geometry = {values["pinion"], values["wheel"]} <= gears.keys()
    has_teeth = values.get("model", "teeth") == "teeth" and "max_stiffness" not in values
    return has_geometry and has_teeth and "torque" not in values


def _mesh(
    gears, on_shafts, *, stiffness=None, stiffness_options=None, centre_distance=None, **values
):
    """Return the `Mesh` with the fields `values`, which name its pinion and wheel.

    `gears` maps names of bodies with a gear geometry to `SpurGear`. If both gears have a geometry
    and `values` has no max_stiffness, the geometry determines the missing fields; then `stiffness`
    is the method "iso" or "energy", with the dict `stiffness_options`, and `centre_distance` is in
    m. `on_shafts` is the set of bodies on shafts, whose twist is not part of the mesh stiffness. A
    mesh of teeth without a torque gets the model "rectangle" as a draft.
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
    twists = [values[name] not in on_shafts for name in ("pinion", "wheel")]
    if stiffness == "energy" and not all(twists):
        options = {"twist": twists} | options
    if _is_draft(gears, **values):
        values["model"] = "rectangle"
    return Mesh.from_geometry(gear_stage, stiffness=stiffness, options=options, **values)


#: Kind of a model -> function that builds it from the other values of a description.
MODELS: dict[str, Callable[..., Model]] = {
    "pair": pair_with_profile,
    "teeth": pairs_of_teeth,
    "six_degrees": six_degrees,
    "train": train,
}
