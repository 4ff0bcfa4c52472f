"""Models from plain values: those in the text of a dataset, and trains of a configuration."""

import json
import math

from gearlib.data.files import canonical_json
from gearlib.models import profiles
from gearlib.models.geometry import mesh as geometry
from gearlib.models.geometry.drawings import gear
from gearlib.models.harmonics import Harmonics
from gearlib.models.one_degree import OneDegreePair
from gearlib.models.pair import GearPair
from gearlib.models.six_degrees import SixDegreePair
from gearlib.models.trains import planetary, ready_made
from gearlib.models.trains.elements import Body, Mesh, Shaft
from gearlib.models.trains.train import GearTrain
from gearlib.parameters import declared

_PROFILES = {
    profile.__name__.lower(): profile
    for profile in (profiles.Rectangular, profiles.Fourier, profiles.Tabulated)
}
#: Kinds of trains whose meshes all have the values of one `GearPair`.
_TRAINS_OF_PAIRS = ("split_power_reducer", "idler", "two_stage")


def model_of(text):
    """Return the model that a dataset describes in a text, or None if that is not possible.

    The text is `canonical_json` of ``model.as_dict()``, and the model must reproduce it exactly. A
    `LoadSharingPair` cannot be restored.
    """
    try:
        values = _plain(json.loads(text))
        model = _model(values) if isinstance(values, dict) else None
    except (TypeError, ValueError, KeyError):
        return None
    return model if model is not None and canonical_json(model.as_dict()) == text else None


def _plain(value):
    """Return a decoded JSON value with tuples, infinities and `Harmonics` as models use them."""
    if isinstance(value, dict):
        entries = {name: _plain(entry) for name, entry in value.items()}
        return Harmonics(**entries) if entries.keys() == {"cosines", "sines"} else entries
    if isinstance(value, list):
        return tuple(map(_plain, value))
    return {"inf": math.inf, "-inf": -math.inf}.get(value, value)


def _model(values):
    """Return the model with the fields in a dict, or None if no class has these fields."""
    if "bodies" in values:
        for name, element in {"bodies": Body, "meshes": Mesh, "shafts": Shaft}.items():
            values[name] = tuple(element(**entry) for entry in values[name])
        return GearTrain(**values)
    if "base_radii" in values:
        return SixDegreePair(**(values | {"pair": GearPair(**values["pair"])}))
    names = declared(GearPair).keys()
    pair = GearPair(**{name: values.pop(name) for name in names if name in values})
    if "profile" in values:
        entries = values.pop("profile")
        profile = _PROFILES[entries.pop("kind")](**entries)
        return OneDegreePair(pair=pair, profile=profile, **values)
    return None if values else pair


def described(kind, arguments, pair):
    """Return the train of a kind in the section `train` of a configuration.

    `arguments` are those of the function or class of that kind, with gears, bodies, meshes and
    shafts as dicts; `pair` holds the arguments of the `GearPair` that some kinds need, or None.
    """
    if kind in _TRAINS_OF_PAIRS:
        return getattr(ready_made, kind)(GearPair(**pair), **arguments)
    if kind == "planetary":
        return planetary.planetary(**arguments)
    if kind == "planetary_set":
        sun, planet, ring = (arguments[name] for name in ("sun", "planet", "ring"))
        gears = {"sun": gear(sun), "planet": gear(planet, sun)}
        gears["ring"] = gear(ring, sun, internal=True)
        return planetary.planetary_set(**(arguments | gears))
    gears = {body["name"]: gear(body["gear"]) for body in arguments["bodies"] if "gear" in body}
    elements = {
        "bodies": [_body(gears, **body) for body in arguments["bodies"]],
        "shafts": [Shaft(**shaft) for shaft in arguments["shafts"]],
        "meshes": [_mesh(gears, **mesh) for mesh in arguments["meshes"]],
    }
    return GearTrain(**(arguments | elements))


def _body(gears, *, name, gear=None, **values):
    """Return the `Body` of a drawn gear or, without a drawing, of values."""
    return Body.from_gear(gears[name], name, **values) if gear else Body(name=name, **values)


def _mesh(gears, *, stiffness="iso", stiffness_options=None, centre_distance=None, **values):
    """Return the `Mesh` of two drawn gears or, with a given stiffness, of values."""
    values = {"material_damping": None} | values
    for key in {"deviation", "inverse_deviation"} & values.keys():
        values[key] = Harmonics(**values[key])
    pinion, wheel = (gears.get(values[key]) for key in ("pinion", "wheel"))
    if pinion is None or wheel is None or "max_stiffness" in values:
        return Mesh(**values)
    mesh = geometry.Mesh(pinion, wheel, centre_distance)
    return Mesh.from_geometry(mesh, stiffness=stiffness, options=stiffness_options, **values)
