"""Models from plain values: from texts in datasets, and from descriptions in configurations."""

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
_PAIR_DAMPINGS = (
    *("damping_ratio", "logarithmic_decrement", "material_damping", "backlash_damping_ratio"),
)
#: Load of an unloaded mesh over the largest force of the train.
_LEAST_FORCE = 1e-6


def model_from_json(text: str) -> Model | None:
    """Return the model whose ``as_dict()`` has a canonical JSON text, or None if there is none.

    Datasets store such texts. A `LoadSharingPair` cannot be restored.
    """
    try:
        fields = _field_values(json.loads(text))
        model = _model_with(fields) if isinstance(fields, dict) else None
    except (TypeError, ValueError, KeyError):
        return None
    return model if model is not None and canonical_json(model.as_dict()) == text else None


def _field_values(value: Any) -> Any:
    """Return a decoded JSON value with tuples, infinities and `Harmonics`, as models store it."""
    if isinstance(value, dict):
        entries = {name: _field_values(entry) for name, entry in value.items()}
        return Harmonics(**entries) if entries.keys() == {"cosines", "sines"} else entries
    if isinstance(value, list):
        return tuple(map(_field_values, value))
    return {"inf": math.inf, "-inf": -math.inf}.get(value, value)


def _model_with(values: dict[str, Any]) -> Model | None:
    """Return the model with these field values, or None if no class of models has such fields.

    The names of the fields determine the class. The dict `values` is changed.
    """
    if "bodies" in values:
        elements = {"bodies": Body, "meshes": Mesh, "shafts": Shaft, "forces": HarmonicForce}
        for name, element in elements.items():
            values[name] = tuple(element(**entry) for entry in values[name])
        return GearTrain(**values)
    if "base_radii" in values:
        return SixDegreePair(**(values | {"pair": GearPair(**values["pair"])}))
    pair_fields = declared_parameters(GearPair).keys()
    pair = GearPair(**{name: values.pop(name) for name in pair_fields if name in values})
    if "profile" in values:
        return OneDegreePair(pair=pair, profile=profile_of(**values.pop("profile")), **values)
    return None if values else pair


def pair_with_profile(profile: dict | None = None, **values: Any) -> GearPair | OneDegreePair:
    """Return the gear pair with these parameters, and with a stiffness profile if one is given."""
    pair = GearPair(**values)
    if profile is None:
        return pair
    return OneDegreePair(pair=pair, profile=profile_of(**profile))


def model(description: dict) -> Model:
    """Return the model of a description, whose key "model" is a name in `MODELS`."""
    arguments = {name: value for name, value in description.items() if name != "model"}
    return MODELS[description["model"]](**arguments)


def with_models(value: Any) -> Any:
    """Return a value of JSON types in which descriptions of models are replaced by the models."""
    if isinstance(value, dict):
        if isinstance(value.get("model"), str):
            return model(value)
        return {name: with_models(entry) for name, entry in value.items()}
    return [with_models(entry) for entry in value] if isinstance(value, list) else value


def pairs_of_teeth(gears: dict, damping: dict, pitch_errors: bool = True) -> LoadSharingPair:
    """Return the `LoadSharingPair` of the section `gears` of a configuration.

    `gears` are geometry with the torque (N m), the stiffness method and its options, if given;
    `damping` has coefficients (N s/m) or ratios by their keys in the configuration. Without
    `pitch_errors` those of the gears are left out.
    """
    mesh = geometry_from_dict(gears)
    arguments = {"torque": gears["torque"], "stiffness": gears.get("stiffness")}
    arguments |= {} if pitch_errors else {"pitch_errors": (0.0,)}
    arguments |= {name: damping[name] for name in _PAIR_DAMPINGS if name in damping}
    options = gears.get("stiffness_options")
    model = default_load_sharing_pair(mesh, options=options, **arguments)
    backlash_damping = damping.get("backlash_damping")
    return model.replace(backlash_damping=backlash_damping) if backlash_damping else model


def six_degrees(pair: dict, **arguments: Any) -> SixDegreePair:
    """Return the `SixDegreePair` of a described pair with these further arguments."""
    return SixDegreePair(pair=model(pair), **arguments)


def train(kind: str, arguments: dict, pair: dict | None) -> GearTrain:
    """Return the gear train that the section `train` of a configuration describes.

    `kind` is a kind of trains such as "idler" or "planetary"; `arguments` are those of the function
    or class of that kind, with gears, bodies, meshes and shafts as dicts; `pair` describes the
    `GearPair` that some kinds need, or is None.
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
    # Without a torque this train has drafts of its meshes, which suffice for its static forces.
    elements["meshes"] = [_mesh(gears, on_shafts, **mesh) for mesh in descriptions]
    draft = GearTrain(**(arguments | elements))
    forces = np.abs(draft.mean_forces) * draft.load
    # An unloaded mesh gets a small load, whose transmission error is that of its reliefs.
    forces = np.maximum(forces, _LEAST_FORCE * forces.max())
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
    """Return a parallel stage of a planetary set with its gears as dicts."""
    fields = {
        name: values[name]
        for name in ("on", "gear", "shaft_stiffness", "position")
        if name in values
    }
    return planetary.ParallelStage(stage=geometry_from_dict(values), **fields)


def _body(gears: dict, *, name: str, gear: dict | None = None, **fields: Any) -> Body:
    """Return the `Body` with this name and these fields; a gear geometry provides missing fields.

    `gears` maps names of bodies to `SpurGear`; `gear` is None if the body has no gear geometry.
    """
    if gear:
        return Body.from_gear(gears[name], name, **fields)
    return Body(name=name, **fields)


def _is_draft(gears: dict, **values: Any) -> bool:
    """Return whether a mesh of gears given by geometry has teeth whose torque is not known yet."""
    by_geometry = {values["pinion"], values["wheel"]} <= gears.keys()
    has_teeth = values.get("model", "teeth") == "teeth" and "max_stiffness" not in values
    return by_geometry and has_teeth and "torque" not in values


def _mesh(
    gears, on_shafts, *, stiffness=None, stiffness_options=None, centre_distance=None, **values
):
    """Return the `Mesh` with the fields in the dict `values`, which names its pinion and wheel.

    `gears` maps names of bodies with a gear geometry to `SpurGear`. If both gears of the mesh have
    one and `values` have no stiffness, the stiffness follows by a method, "iso" or "energy", with a
    dict of its options, and the other missing fields from the geometry. `centre_distance` is in m.
    The twist of the bodies in the set `on_shafts` is not part of the stiffness. A mesh of teeth
    without a torque gets the rectangle as a draft.
    """
    values = {"material_damping": None} | values  # None: the damping is unknown.
    for name in {"deviation", "coast_deviation", "transmission_error"} & values.keys():
        values[name] = Harmonics(**values[name])
    pinion, wheel = (gears.get(values[name]) for name in ("pinion", "wheel"))
    if pinion is None or wheel is None or "max_stiffness" in values:
        return Mesh(**values)
    mesh = geometry.GearStage(pinion, wheel, centre_distance)
    if stiffness is None:
        is_rectangle = values.get("model") == "rectangle"
        stiffness = "iso" if is_rectangle else mesh.tooth_stiffness
    options = stiffness_options or {}
    twists = [values[name] not in on_shafts for name in ("pinion", "wheel")]
    if stiffness == "energy" and not all(twists):
        options = {"twist": twists} | options
    if _is_draft(gears, **values):
        values["model"] = "rectangle"
    return Mesh.from_geometry(mesh, stiffness=stiffness, options=options, **values)


#: Name of a kind of models -> function of the other values of a description.
MODELS: dict[str, Callable[..., Model]] = {
    "pair": pair_with_profile,
    "teeth": pairs_of_teeth,
    "six_degrees": six_degrees,
    "train": train,
}
