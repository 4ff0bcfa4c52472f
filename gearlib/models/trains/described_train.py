"""From the values of a configuration to a `GearTrain`."""

from gearlib.models.geometry import mesh as geometry
from gearlib.models.geometry.drawings import gear
from gearlib.models.harmonics import Harmonics
from gearlib.models.pair import GearPair
from gearlib.models.trains import planetary, ready_made
from gearlib.models.trains.elements import Body, Mesh, Shaft
from gearlib.models.trains.train import GearTrain

_OF_PAIRS = ("split_power_reducer", "idler", "two_stage")


def described(kind, arguments, pair):
    """Return the train of a `kind` of the section `train`, with the arguments of what makes it.

    Gears, bodies, meshes and shafts are dicts; `pair` are the arguments of the `GearPair` of which
    some kinds are made, or None.
    """
    if kind in _OF_PAIRS:
        return getattr(ready_made, kind)(GearPair(**pair), **arguments)
    if kind == "planetary":
        return planetary.planetary(**arguments)
    if kind == "planetary_set":
        sun, planet, ring = (arguments[name] for name in ("sun", "planet", "ring"))
        gears = {"sun": gear(sun), "planet": gear(planet, sun)}
        gears["ring"] = gear(ring, sun, internal=True)
        return planetary.planetary_set(**(arguments | gears))
    gears = {body["name"]: gear(body["gear"]) for body in arguments["bodies"] if "gear" in body}
    parts = {
        "bodies": [_body(gears, **body) for body in arguments["bodies"]],
        "shafts": [Shaft(**shaft) for shaft in arguments["shafts"]],
        "meshes": [_mesh(gears, **mesh) for mesh in arguments["meshes"]],
    }
    return GearTrain(**(arguments | parts))


def _body(gears, *, name, gear=None, **values):
    """Return a `Body`, of one of the drawn `gears` where it has a drawing."""
    return Body.from_gear(gears[name], name, **values) if gear else Body(name=name, **values)


def _mesh(gears, *, stiffness="iso", stiffness_options=None, centre_distance=None, **values):
    """Return a `Mesh`, of two of the drawn `gears` unless its stiffness is a number."""
    values = {"material_damping": None} | values
    for key in {"deviation", "inverse_deviation"} & values.keys():
        values[key] = Harmonics(**values[key])
    pinion, wheel = (gears.get(values[key]) for key in ("pinion", "wheel"))
    if pinion is None or wheel is None or "max_stiffness" in values:
        return Mesh(**values)
    mesh = geometry.Mesh(pinion, wheel, centre_distance)
    return Mesh.from_geometry(mesh, stiffness=stiffness, options=stiffness_options, **values)
