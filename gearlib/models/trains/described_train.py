"""From the values of a configuration to a `GearTrain`."""

from gearlib.models.geometry import mesh as geometry
from gearlib.models.geometry.drawings import gear
from gearlib.models.harmonics import Harmonics
from gearlib.models.pair import GearPair
from gearlib.models.trains import ready_made
from gearlib.models.trains.elements import Body, Mesh, Shaft
from gearlib.models.trains.reducer_train import split_power_reducer
from gearlib.models.trains.train import GearTrain
from gearlib.models.trains.train_from_drawings import planetary_set

_OF_PAIRS = {
    "split_power_reducer": split_power_reducer,
    "idler": ready_made.idler,
    "two_stage": ready_made.two_stage,
}


def described(kind, arguments, pair):
    """Return the train of a `kind` of the section `train`, with the arguments of what makes it.

    Gears, bodies, meshes and shafts are dicts; `pair` are the arguments of the `GearPair` of which
    some kinds are made, or None.
    """
    if kind in _OF_PAIRS:
        return _OF_PAIRS[kind](GearPair(**pair), **arguments)
    if kind == "planetary":
        return ready_made.planetary(**arguments)
    if kind == "planetary_set":
        like = arguments["sun"]
        gears = {
            "sun": gear(like),
            "planet": gear(arguments["planet"], like),
            "ring": gear(arguments["ring"], like, internal=True),
        }
        return planetary_set(**(arguments | gears))
    drawn = {body["name"]: gear(body["gear"]) for body in arguments["bodies"] if "gear" in body}
    parts = {
        "bodies": [_body(drawn, **one) for one in arguments["bodies"]],
        "shafts": [Shaft(**one) for one in arguments["shafts"]],
        "meshes": [_mesh(drawn, **one) for one in arguments["meshes"]],
    }
    return GearTrain(**(arguments | parts))


def _body(drawn, *, gear=None, **values):
    name = values.pop("name")
    return (
        Body(name=name, **values) if gear is None else Body.from_gear(drawn[name], name, **values)
    )


def _mesh(drawn, *, stiffness="iso", stiffness_options=None, centre_distance=None, **values):
    values = {"material_damping": None} | values
    for key in ("deviation", "inverse_deviation"):
        if key in values:
            values[key] = Harmonics(**values[key])
    pinion, wheel = (drawn.get(values[key]) for key in ("pinion", "wheel"))
    if pinion is None or wheel is None or "max_stiffness" in values:
        return Mesh(**values)
    mesh = geometry.Mesh(pinion, wheel, centre_distance)
    return Mesh.from_geometry(mesh, stiffness=stiffness, options=stiffness_options, **values)
