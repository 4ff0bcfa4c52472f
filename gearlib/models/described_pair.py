"""From the values of a configuration to the smallest model that carries a gear pair."""

from gearlib.models.geometry import described_drawing
from gearlib.models.geometry.drawn_parameters import of_tooth_pairs
from gearlib.models.load_sharing_pair import LoadSharingPair
from gearlib.models.pair import GearPair


def described(pair):
    """Return the model of the keyword arguments of a `GearPair`.

    Beside these there may be a `drawing`, as of `described_drawing.mesh`, with its torque,
    stiffness and stiffness_options: the model carries its tip relief and errors of teeth, see
    `of_drawing`, with the dampings of the pair.
    """
    plain = {name: value for name, value in pair.items() if name != "drawing"}
    if "drawing" not in pair:
        return GearPair(**plain)
    drawing = pair["drawing"]
    model = of_drawing(
        described_drawing.mesh(drawing),
        torque=drawing["torque"],
        stiffness=drawing.get("stiffness"),
        options=drawing.get("stiffness_options"),
    )
    dampings = ("material_damping", "backlash_damping")
    return model.replace(**{name: plain[name] for name in dampings if name in plain})


def of_drawing(mesh, *, stiffness=None, options=None, **load):
    """Return the smallest model that carries the teeth of a drawn mesh.

    A `GearPair` of involutes, a `LoadSharingPair` with tip relief or errors of teeth: its `at_load`
    is no smaller, by its time. Arguments as of `GearPair.from_geometry`.
    """
    stiffness = stiffness or "iso"
    if any(gear.tip_relief or gear.pitch_errors for gear in (mesh.pinion, mesh.wheel)):
        return LoadSharingPair.from_geometry(mesh, **of_tooth_pairs(stiffness, options), **load)
    return GearPair.from_geometry(mesh, stiffness=stiffness, options=options, **load)
