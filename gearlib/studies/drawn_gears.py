"""Drawn gears: their mesh stiffness by every method, and Harris maps of tip relief."""

import math
from dataclasses import replace

import numpy as np
import xarray as xr

from gearlib.data.result import result, result_of_many, stacked
from gearlib.models.geometry import drawings
from gearlib.models.geometry.transmission_error import optimum_relief
from gearlib.models.load_sharing_pair import LoadSharingPair
from gearlib.models.profiles import Rectangular

#: Name -> method and options of `Mesh.stiffness`.
METHODS: dict[str, tuple[str, dict]] = {
    "iso": ("iso", {}),
    "energy": ("energy", {}),
    "energy_twice": ("energy", {"coupling": 0.0}),
    "energy_logarithmic": ("energy", {"hertz": "logarithmic"}),
}
#: Method from which the means of the others are counted.
REFERENCE = "energy"
#: Share of a segment by which points stand beside its end, where the stiffness steps.
_BESIDE = 1e-6
#: The long relief is the optimum for the design load, the short one has its amounts on half of it.
RELIEFS = ("none", "short", "long")


def mesh_stiffness(pairs, samples):
    """Return courses and means of the mesh stiffness of drawn pairs by every method.

    `pairs` are drawings by name, with torque and published, source -> mean stiffness; `samples` is
    the number of phases of a course.
    """
    meshes = {name: drawings.mesh(pair) for name, pair in pairs.items()}
    phases = {name: _phases(mesh.contact_ratio, samples) for name, mesh in meshes.items()}

    def facts(pair, method):
        kind, options = METHODS[method]
        options = options | ({"samples": samples} if kind == "energy" else {})
        stiffness = meshes[pair].stiffness(kind, torque=pairs[pair]["torque"], **options)
        return {
            "mesh_stiffness": _course(stiffness, phases[pair]),
            "mean_mesh_stiffness": stiffness.mean_stiffness,
            "own_stiffness_ratio": stiffness.stiffness_ratio,
            "method_uncertainty": stiffness.uncertainty,
        }

    published = [
        (name, source, value)
        for name, pair in pairs.items()
        for source, value in pair["published"].items()
    ]
    names, sources, values = zip(*published, strict=True) if published else ((), (), ())
    axes = {"pair": list(pairs), "stiffness_method": list(METHODS)}
    data = stacked(axes, facts, "point") | {
        "stiffness_phase": (("pair", "point"), [*phases.values()]),
        "published_pair": ("published", np.array(names, str)),
        "published_stiffness": ("published", np.array(values, float)),
    }
    data["method_uncertainty"] = "stiffness_method", data["method_uncertainty"][1][-1]
    coords = axes | {"published": np.array(sources, str)}
    title = "Mesh stiffness of drawn gears by several methods"
    return result_of_many(title, data, coords, parameters={"pairs": pairs, "samples": samples})


def _phases(contact_ratio, samples):
    """Return mesh phases from -pi to pi, with the ends of double contact from both sides."""
    end = math.pi * (contact_ratio % 1.0)
    beside = [s * end * (1.0 + t * _BESIDE) for s in (-1.0, 1.0) for t in (-1.0, 1.0)]
    return np.sort([*np.linspace(-math.pi, math.pi, samples), *beside])


def _course(stiffness, phase):
    """Return the stiffness (N/m) of a `MeshStiffness` at mesh phases."""
    profile = stiffness.profile
    if isinstance(profile, Rectangular):
        inside = np.abs(phase) <= math.pi * (stiffness.contact_ratio - 1.0)
        return stiffness.max_stiffness * np.where(inside, 1.0, stiffness.stiffness_ratio)
    return np.interp(phase, profile.phase, profile.stiffness, period=math.tau)


def stiffness_rows(stiffness):
    """Yield the table of the means: a head and a row for each pair and method or publication."""
    yield ["pair", "stiffness_method", "mean_stiffness", "stiffness_ratio", "from_reference"]
    for pair in stiffness.pair.values:
        means = stiffness.sel(pair=pair).mean_mesh_stiffness
        reference = float(means.sel(stiffness_method=REFERENCE))
        ratios = stiffness.sel(pair=pair).own_stiffness_ratio
        names = stiffness.stiffness_method.values
        rows = [(name, float(means[i]), f"{float(ratios[i]):.4g}") for i, name in enumerate(names)]
        published = stiffness.published_stiffness[stiffness.published_pair.values == pair]
        rows += [(f"published: {x.published.item()}", float(x), "") for x in published]
        for name, mean, ratio in rows:
            yield [pair, name, f"{mean:.4g}", ratio, f"{mean / reference - 1.0:+.4f}"]


def harris_map(gears, loads, stiffness, phases):
    """Return the static transmission error of a drawing at several loads, with each of `RELIEFS`.

    `gears` is a drawing without relief, with the design torque (N m); `loads` are over the design
    load; stiffness and phases are those of `gearlib.geometry.Mesh.transmission_error`.
    """
    bare, torque = drawings.mesh(gears), gears["torque"]
    options = {"stiffness": stiffness, "phases": phases}
    long = optimum_relief(bare, torque, length="long", **options)
    reliefs = [gear.tip_relief for gear in (long.pinion, long.wheel)]
    short = long.with_reliefs(*(replace(relief, length=relief.length / 2.0) for relief in reliefs))
    errors, amounts = [], []
    for mesh in (bare, short, long):
        errors.append(mesh.transmission_error(torque * np.asarray(loads), **options))
        reliefs = (mesh.pinion.tip_relief, mesh.wheel.tip_relief)
        amounts.append([relief.amount if relief else 0.0 for relief in reliefs])
    dataset = xr.concat(errors, "relief").assign(
        relief_amount=(("relief", "gear"), amounts), design_torque=float(torque)
    )
    dataset = dataset.assign_coords(relief=list(RELIEFS), gear=["pinion", "wheel"])
    model = LoadSharingPair.from_geometry(long, torque=torque, stiffness=stiffness)
    title = "Harris map: static transmission error at several loads"
    return result(title, model, dataset, method="load sharing", phases=phases)
