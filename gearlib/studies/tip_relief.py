"""Harris maps of drawn gears: their static transmission error at several loads."""

from dataclasses import replace

import numpy as np
import xarray as xr

from gearlib.data.result import result
from gearlib.models.geometry import drawings
from gearlib.models.geometry.transmission_error import optimum_relief
from gearlib.models.load_sharing_pair import LoadSharingPair

#: The long one is the optimum for the design load, the short one has its amounts on half of it.
RELIEFS = ("none", "short", "long")


def harris_map(gears, loads, stiffness, phases):
    """Return the static transmission error at several loads, with the reliefs of `RELIEFS`.

    gears (as in `gearlib.models.geometry.drawings.mesh`, without relief; torque, the
    design load of the pinion, N m); loads: over the design load, >= 0; stiffness, phases: as of
    `gearlib.geometry.Mesh.transmission_error`.

    What that returns, over relief too; design_torque; relief_amount over relief and gear.
    """
    bare, torque = drawings.mesh(gears), gears["torque"]
    options = {"stiffness": stiffness, "phases": phases}
    relieved = optimum_relief(bare, torque, length="long", **options)
    found, amounts = [], []
    for mesh in (bare, _half_as_long(relieved), relieved):
        found.append(mesh.transmission_error(torque * np.asarray(loads), **options))
        reliefs = (mesh.pinion.tip_relief, mesh.wheel.tip_relief)
        amounts.append([relief.amount if relief else 0.0 for relief in reliefs])
    dataset = xr.concat(found, "relief").assign_coords(relief=list(RELIEFS))
    dataset["relief_amount"] = ("relief", "gear"), amounts
    dataset["design_torque"] = float(torque)
    dataset = dataset.assign_coords(gear=["pinion", "wheel"])
    model = LoadSharingPair.from_geometry(relieved, torque=torque, stiffness=stiffness)
    title = "Harris map: static transmission error at several loads"
    return result(title, model, dataset, method="load sharing", phases=phases)


def _half_as_long(mesh):
    reliefs = (gear.tip_relief for gear in (mesh.pinion, mesh.wheel))
    return mesh.with_reliefs(*(replace(one, length=one.length / 2.0) for one in reliefs))
