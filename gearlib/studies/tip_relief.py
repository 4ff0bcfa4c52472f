"""What tip relief does: Harris maps of drawn gears, and the motion by two models.

The smaller model has stiffness and deviation at its load; the larger one keeps a flank line for
each pair of teeth. The small one suffices at a load where its largest dynamic force, sweeping up
and down, is that of the larger one within a tolerance at all tunings.
"""

import math
from dataclasses import replace

import numpy as np
import xarray as xr

from gearlib.data import provenance
from gearlib.data.lost_contact import lost_share
from gearlib.data.result import result, stacked
from gearlib.data.variables import describe
from gearlib.models.geometry import described_drawing
from gearlib.models.geometry.transmission_error import optimum_relief
from gearlib.models.load_sharing_pair import LoadSharingPair
from gearlib.runs.sweeping import CARRIED, sweep

#: The long one is the optimum for the design load, the short one has its amounts on half of it.
RELIEFS = ("none", "short", "long")
MODELS = ("stiffness_at_load", "pairs_of_teeth")


def harris_map(gears, loads, stiffness, phases):
    """Return the static transmission error at several loads, with the reliefs of `RELIEFS`.

    gears (as of `gearlib.models.geometry.described_drawing.mesh`, without relief; torque, the
    design load of the pinion, N m); loads: over the design load, >= 0; stiffness, phases: as of
    `gearlib.geometry.Mesh.transmission_error`.

    What that returns, over relief too; design_torque; relief_amount over relief and gear.
    """
    bare, torque = described_drawing.mesh(gears), gears["torque"]
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
    dataset.attrs = provenance.attributes(title, model, method="load sharing", phases=phases)
    return describe(dataset)


def _half_as_long(mesh):
    reliefs = (gear.tip_relief for gear in (mesh.pinion, mesh.wheel))
    return mesh.with_reliefs(*(replace(one, length=one.length / 2.0) for one in reliefs))


def dynamics(gears, stiffness, tunings, settings):
    """Return the largest dynamic force by both models over speed and load.

    gears, stiffness (as of `harris_map`; the relief is the long one); tunings: of the pairs of
    teeth; settings (loads over the design load, > 0; damping_ratio, backlash_damping_ratio;
    periods, record_periods; tolerance of the dynamic force).

    Differences are the largest where neither model, or one, loses contact.
    """
    torque = gears["torque"]
    mesh = optimum_relief(described_drawing.mesh(gears), torque, length="long", stiffness=stiffness)
    tunings = np.asarray(tunings, float)
    run = {name: settings[name] for name in ("periods", "record_periods")}
    dampings = {name: settings[name] for name in ("damping_ratio", "backlash_damping_ratio")}
    loads = {"load_ratio": np.asarray(settings["loads"], float)}
    larger = [
        LoadSharingPair.from_geometry(mesh, torque=load * torque, stiffness=stiffness, **dampings)
        for load in settings["loads"]
    ]
    large = dict(zip(loads["load_ratio"], larger, strict=True))

    def statics(load):
        static = mesh.transmission_error(load * torque, stiffness=stiffness)
        return {
            "effective_contact_ratio": static.effective_contact_ratio.item(),
            "error_over_deflection": static.peak_to_peak_error.item()
            / large[load].static_deflection,
            "speed": large[load].speed(tunings),
        }

    def curve(load, name, direction):
        model = large[load].at_load() if name == MODELS[0] else large[load]
        unit = model.mean_eigenfrequency / large[load].mean_eigenfrequency
        # From near the rest under the load: from far off other motions may be reached.
        found = sweep(model, tunings / unit, direction=direction, initial_state=(1.0, 0.0), **run)
        return {name: found[name].values for name in ("dynamic_force_max", "fraction_normal")}

    axes = loads | {"model": list(MODELS), "direction": list(CARRIED)}
    data = stacked(loads, statics, "tuning") | stacked(axes, curve, "tuning")
    force, normal = data["dynamic_force_max"][1], data["fraction_normal"][1]
    difference = np.abs(force[:, 0] / force[:, 1] - 1.0)
    lost = (lost_share(normal) > 0.0).any(axis=1)
    within, over = difference <= settings["tolerance"], (1, 2)
    data |= {
        "difference_in_contact": ("load_ratio", _largest(difference, ~lost)),
        "difference_with_loss": ("load_ratio", _largest(difference, lost)),
        "mean_difference": ("load_ratio", difference.mean(axis=over)),
        "suffices": ("load_ratio", within.all(axis=over).astype(np.int8)),
        "tolerance": float(settings["tolerance"]),
    }
    title = "Tip relief: stiffness at the load beside pairs of teeth"
    coords = axes | {"tuning": tunings}
    return result(title, larger[-1], data, coords, method="exact", **run)


def _largest(difference, where):
    """Return the largest difference at each load, NaN where there is none."""
    values = np.where(where, difference, -math.inf).max(axis=(1, 2))
    return np.where(np.isfinite(values), values, math.nan)
