"""The mesh stiffness of drawn pairs by every method: courses over the mesh period, means."""

import math

import numpy as np

from gearlib.data.result import result_of_many, stacked
from gearlib.models.geometry import drawings
from gearlib.models.profiles import Rectangular

#: name -> (method, options of `mesh_stiffness`); the second is the reference of the others.
METHODS: dict[str, tuple[str, dict]] = {
    "iso": ("iso", {}),
    "energy": ("energy", {}),
    "energy_twice": ("energy", {"coupling": 0.0}),
    "energy_logarithmic": ("energy", {"hertz": "logarithmic"}),
}
REFERENCE = "energy"

#: Share of a segment by which points stand beside its end, where the stiffness steps.
_BESIDE = 1e-6


def by_method(mesh, torque, samples):
    """Return name -> `MeshStiffness`, the names of `METHODS`."""
    found = {}
    for name, (method, options) in METHODS.items():
        options = options | ({"samples": samples} if method == "energy" else {})
        found[name] = mesh.stiffness(method, torque=torque, **options)
    return found


def course(found, phase):
    """Return the stiffness of a `MeshStiffness` at mesh phases, N/m."""
    profile = found.profile
    if isinstance(profile, Rectangular):
        inside = np.abs(phase) <= math.pi * (found.contact_ratio - 1.0)
        return found.max_stiffness * np.where(inside, 1.0, found.stiffness_ratio)
    return np.interp(phase, profile.phase, profile.stiffness, period=math.tau)


def _phases(contact_ratio, samples):
    """Return mesh phases from -pi to pi, with the ends of double contact from both sides."""
    end = math.pi * (contact_ratio % 1.0)
    beside = [s * end * (1.0 + t * _BESIDE) for s in (-1.0, 1.0) for t in (-1.0, 1.0)]
    return np.sort([*np.linspace(-math.pi, math.pi, samples), *beside])


def compute(pairs, samples):
    """Return the mesh stiffness of drawn pairs by every method.

    pairs (as in `gearlib.models.geometry.drawings.mesh`, and torque, published: name ->
    mean stiffness); samples: phases of the courses.
    """
    meshes = {name: drawings.mesh(pair) for name, pair in pairs.items()}
    phases = {name: _phases(mesh.contact_ratio, samples) for name, mesh in meshes.items()}
    found = {name: by_method(mesh, pairs[name]["torque"], samples) for name, mesh in meshes.items()}

    def facts(pair, method):
        one = found[pair][method]
        return {
            "mesh_stiffness": course(one, phases[pair]),
            "mean_mesh_stiffness": one.mean_stiffness,
            "own_stiffness_ratio": one.stiffness_ratio,
        }

    uncertainties = [one.uncertainty for one in found[[*pairs][-1]].values()]
    published = [
        (name, words, value)
        for name, pair in pairs.items()
        for words, value in pair["published"].items()
    ]
    axes = {"pair": list(pairs), "stiffness_method": list(METHODS)}
    data = stacked(axes, facts, "point") | {
        "stiffness_phase": (("pair", "point"), [*phases.values()]),
        "method_uncertainty": ("stiffness_method", uncertainties),
        "published_pair": ("published", np.array([row[0] for row in published], str)),
        "published_stiffness": ("published", np.array([row[2] for row in published], float)),
    }
    coords = axes | {"published": np.array([row[1] for row in published], str)}
    title = "Mesh stiffness of drawn gears by several methods"
    return result_of_many(title, data, coords, parameters={"pairs": pairs, "samples": samples})


def rows(stiffness):
    """Yield the means as a table, a row for each pair and method, then what is published."""
    yield ["pair", "stiffness_method", "mean_stiffness", "stiffness_ratio", "from_reference"]
    for pair in stiffness.pair.values:
        own = stiffness.sel(pair=pair)
        reference = float(own.mean_mesh_stiffness.sel(stiffness_method=REFERENCE))
        found = [
            (
                name,
                float(own.mean_mesh_stiffness[j]),
                f"{float(own.own_stiffness_ratio[j]):.4g}",
            )
            for j, name in enumerate(own.stiffness_method.values)
        ]
        there = stiffness.isel(published=stiffness.published_pair.values == pair)
        found += [
            (f"published: {name}", float(value), "")
            for name, value in zip(
                there.published.values, there.published_stiffness.values, strict=True
            )
        ]
        for name, mean, ratio in found:
            yield [pair, name, f"{mean:.4g}", ratio, f"{mean / reference - 1.0:+.4f}"]
