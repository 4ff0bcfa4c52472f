"""Compute the mesh stiffness by several methods, and Harris maps of tip relief."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from gearlib.data.result import evaluate_on_grid, make_result, make_study_result
from gearlib.models.geometry import from_values as geometry
from gearlib.models.geometry.transmission_error import optimum_relief
from gearlib.models.load_sharing_pair import LoadSharingPair
from gearlib.models.profiles import Rectangular

#: Name of a variant -> method and options of `GearStage.stiffness`.
METHODS: dict[str, tuple[str, dict]] = {
    "iso": ("iso", {}),
    "energy": ("energy", {}),
    "energy_twice": ("energy", {"coupling": 0.0}),
    "energy_logarithmic": ("energy", {"hertz": "logarithmic"}),
}
#: Mean stiffnesses of other methods are compared with this method.
REFERENCE_METHOD = "energy"
#: Relative distance of samples on both sides of a jump of the stiffness.
_JUMP_WIDTH = 1e-6
_GEARS = ["pinion", "wheel"]


def mesh_stiffness(pairs: dict[str, dict], samples: int) -> xr.Dataset:
    """Compute the mesh stiffness of gear pairs over mesh phase, and its mean, by every method.

    `pairs` maps names to dicts with the data of two gears, their torque (N m) and "published", a
    dict of published mean stiffnesses (N/m) by source. `samples` is the number of mesh phases. The
    `METHODS` are the method of ISO 6336 and variants of the energy method. In the dataset,
    own_stiffness_ratio is minimum over maximum stiffness by a method, and method_uncertainty the
    relative uncertainty of the method.
    """
    meshes = {name: geometry.build_stage(gears) for name, gears in pairs.items()}
    phases = {
        name: _stiffness_sample_phases(mesh.contact_ratio, samples) for name, mesh in meshes.items()
    }

    def stiffness_data(pair: str, method: str) -> dict:
        """Compute the mesh stiffness of a pair by a method, as variable -> value."""
        name, options = METHODS[method]
        if name == "energy":  # only this method needs samples
            options = options | {"samples": samples}
        stiffness = meshes[pair].stiffness(name, torque=pairs[pair]["torque"], **options)
        return {
            "mesh_stiffness": _evaluate_stiffness(stiffness, phases[pair]),
            "mean_mesh_stiffness": stiffness.mean_stiffness,
            "own_stiffness_ratio": stiffness.stiffness_ratio,
            "method_uncertainty": stiffness.uncertainty,
        }

    published = []  # tuples (name of the pair, source, mean stiffness)
    for name, gears in pairs.items():
        published += [(name, source, value) for source, value in gears["published"].items()]
    axes = {"pair": list(pairs), "stiffness_method": list(METHODS)}
    data = evaluate_on_grid(axes, stiffness_data, "point") | {
        "stiffness_phase": (("pair", "point"), [*phases.values()]),
        "published_pair": ("published", np.array([name for name, _, _ in published], str)),
        "published_stiffness": ("published", np.array([value for *_, value in published], float)),
    }
    # The uncertainty of a method is the same for all pairs.
    _, uncertainties = data["method_uncertainty"]
    data["method_uncertainty"] = "stiffness_method", uncertainties[-1]
    coords = axes | {"published": np.array([source for _, source, _ in published], str)}
    title = "Mesh stiffness of gears by several methods"
    return make_study_result(title, data, coords, parameters={"pairs": pairs, "samples": samples})


def _stiffness_sample_phases(contact_ratio: float, samples: int) -> np.ndarray:
    """Return mesh phases from -pi to pi (rad) at which the stiffness is sampled.

    The phases are equidistant, with additional phases just before and after each jump of the
    stiffness, at the ends of double contact. Phase 0 is the middle of double contact.
    """
    end = math.pi * (contact_ratio % 1.0)
    end_points = end * np.array([1.0 - _JUMP_WIDTH, 1.0 + _JUMP_WIDTH])
    regular_points = np.linspace(-math.pi, math.pi, samples)
    return np.sort(np.concatenate([regular_points, end_points, -end_points]))


def _evaluate_stiffness(stiffness: Any, phases: np.ndarray) -> np.ndarray:
    """Evaluate a `MeshStiffness` (N/m) at mesh phases (rad), where 0 is mid double contact.

    The profile of the stiffness over the mesh phase is rectangular or tabulated.
    """
    profile = stiffness.profile
    if isinstance(profile, Rectangular):
        double_contact = np.abs(phases) <= math.pi * (stiffness.contact_ratio - 1.0)
        return stiffness.max_stiffness * np.where(double_contact, 1.0, stiffness.stiffness_ratio)
    return np.interp(phases, profile.phase, profile.stiffness, period=math.tau)


def stiffness_rows(stiffness: xr.Dataset) -> Iterator[list]:
    """Yield the rows of the table of mean stiffnesses, beginning with the column names.

    `stiffness` is a dataset from `mesh_stiffness`. Each gear pair has one row per method and one
    per published value. stiffness_ratio is minimum over maximum stiffness, and from_reference is
    the relative deviation of the mean stiffness from `REFERENCE_METHOD`.
    """
    yield ["pair", "stiffness_method", "mean_stiffness", "stiffness_ratio", "from_reference"]
    for pair in stiffness.pair.values:
        means = stiffness.sel(pair=pair).mean_mesh_stiffness
        reference_mean = float(means.sel(stiffness_method=REFERENCE_METHOD))
        ratios = stiffness.sel(pair=pair).own_stiffness_ratio
        methods = zip(stiffness.stiffness_method.values, means, ratios, strict=True)
        rows = [(name, float(mean), f"{float(ratio):.4g}") for name, mean, ratio in methods]
        published = stiffness.published_stiffness[stiffness.published_pair.values == pair]
        rows += [(f"published: {value.published.item()}", float(value), "") for value in published]
        for name, mean, ratio in rows:
            yield [pair, name, f"{mean:.4g}", ratio, f"{mean / reference_mean - 1.0:+.4f}"]


def harris_map(gears: dict, loads: Sequence[float], stiffness: str, phases: int) -> xr.Dataset:
    """Compute the static transmission error of a gear pair at several loads and tip reliefs.

    `gears` has the data of two gears and the design torque (N m); pitch errors are ignored.
    `loads` are relative to the design load. `stiffness` (name of the method) and `phases` (number
    of mesh phases) are arguments of `GearStage.transmission_error`. The variants of tip relief are

    * "none",
    * "own": the relief of `gears`, if they have any,
    * "long": the optimum long relief at the design load,
    * "short": the same amounts on half the length. Short relief is not optimized, because its
      amount has little effect at the design load.
    """
    torque = gears["torque"]
    options = {"stiffness": stiffness, "phases": phases}
    stage = geometry.build_stage(
        gears | {name: gears[name] | {"pitch_errors": ()} for name in _GEARS}
    )
    meshes = {"none": stage.with_reliefs(None, None), "own": stage}
    if meshes["none"] == stage:
        del meshes["own"]
    long_relief = optimum_relief(stage, torque, length="long", **options)
    reliefs: list = [gear.tip_relief for gear in (long_relief.pinion, long_relief.wheel)]
    short_reliefs = [replace(relief, length=relief.length / 2.0) for relief in reliefs]
    meshes |= {"short": long_relief.with_reliefs(*short_reliefs), "long": long_relief}
    errors = []
    amounts = []  # tip reliefs (m) of pinion and wheel, per variant
    for mesh in meshes.values():
        errors.append(mesh.transmission_error(torque * np.asarray(loads), **options))
        reliefs = [mesh.pinion.tip_relief, mesh.wheel.tip_relief]
        amounts.append([relief.amount if relief else 0.0 for relief in reliefs])
    variables = {"relief_amount": (("relief", "gear"), amounts), "design_torque": float(torque)}
    dataset = xr.concat(errors, "relief").assign(variables)
    dataset = dataset.assign_coords(relief=list(meshes), gear=_GEARS)
    model = LoadSharingPair.from_geometry(stage, torque=torque, stiffness=stiffness)
    title = "Harris map: static transmission error at several loads, without pitch errors"
    return make_result(title, model, dataset, method="load sharing", phases=phases)
