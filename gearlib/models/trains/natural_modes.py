"""Natural modes of a train with mean mesh stiffness, and their excitation by mesh harmonics.

Planetary trains, and other trains with equal branches between common gears, have structured modes:
rotational modes (no axis of a central body moves), translational modes (no central body turns) and
satellite modes (no central body moves); Lin & Parker, J. Vib. Acoust. 121 (1999) 316-321. The
phases of the meshes determine which harmonics of the mesh stiffness excite which modes; Parker, J.
Sound Vib. 236 (2000) 561-573.
"""

import math

import numpy as np
import xarray as xr

from gearlib.data.variables import describe
from gearlib.models.trains.statics import branches
from gearlib.models.trains.waves import stiffness_harmonic

#: Smaller mass-normalised motions of a body count as zero.
_MIN_MOTION = 1e-6


def modes(train):
    """Return the natural modes of a train as a dataset, as `GearTrain.modes` describes it."""
    squares, shapes = train.linear_modes
    free = train.free_motions
    frequency = np.concatenate([np.zeros(free.shape[1]), np.sqrt(squares)]) / (2.0 * math.pi)
    shapes = np.concatenate([free, shapes], axis=1)
    motions = np.einsum("bkn,np->pbk", train.structure.motions, shapes)
    energy = np.zeros((frequency.size, len(train.meshes)))
    energy[free.shape[1] :] = train.strains[-len(train.meshes) :].T ** 2
    kinds = ["rigid"] * free.shape[1] + _kinds(train, motions[free.shape[1] :])
    dataset = xr.Dataset(
        {
            "natural_frequency": ("mode", frequency),
            "mode_kind": ("mode", kinds),
            "mode_shape": (("mode", "body", "axis"), motions / _largest(motions)[:, None, None]),
            "strain_energy": (("mode", "mesh"), energy),
        },
        coords={"mode": np.arange(frequency.size)} | train.names,
        attrs={"title": "Natural modes of a gear train"},
    )
    return describe(dataset)


def _largest(motions):
    """Return the largest motion of a body in each mode, shape (p,), from motions (p, b, 3)."""
    return np.abs(motions).max(axis=(1, 2), initial=0.0)


def _kinds(train, motions):
    """Return the kind of each elastic mode by the motions of the central bodies of a train.

    Central bodies are carriers and gears with several meshes. `motions` are mass-normalised, shape
    (p, b, 3).
    """
    central_names = {name for _, name in branches(train)} | {body.carrier for body in train.bodies}
    central = [body.name in central_names for body in train.bodies]
    if not any(central):
        return ["other"] * len(motions)
    masses = [(b.mass or 0.0, b.mass or 0.0, b.inertia / b.base_radius**2) for b in train.bodies]
    moves = (np.abs(motions) * np.sqrt(masses))[:, central].max(axis=1, initial=0.0)
    # (whether a central axis moves, whether a central body turns) -> kind
    kinds = {(0, 1): "rotational", (1, 0): "translational", (0, 0): "satellite", (1, 1): "other"}
    return [kinds[max(x, y) > _MIN_MOTION, u > _MIN_MOTION] for x, y, u in moves.tolist()]


def campbell(train, count=3):
    """Return the critical speeds of a train as a dataset, as `GearTrain.campbell` describes it."""
    orders = sorted({n * rate for rate in train.rates for n in range(1, count + 1)})
    # Orders that the stiffness does not excite may be excited by deviations.
    data = phasing(train, math.ceil(orders[-1])).reindex(
        stiffness_order=[float(order) for order in orders],
        fill_value={"modal_force": 0.0, "phase_sum": 0.0, "excites": False},
    )
    reference_frequency = train.reference_angular_frequency / (2.0 * math.pi)
    tuning = data.natural_frequency / reference_frequency / data.stiffness_order
    data["critical_speed"] = train.speed(tuning).transpose("stiffness_order", "mode")
    data.attrs["title"] = "Campbell diagram of a gear train"
    return describe(data)


def phasing(train, count=12):
    """Return the modal forces of the stiffness harmonics, as `GearTrain.phasing` describes them."""
    squares, shapes = train.linear_modes
    motions = np.einsum("bkn,np->pbk", train.structure.motions, shapes)
    mesh_terms: dict = {}  # order -> modal forces of the meshes, each of shape (p,)
    for mesh, rate, stretches, deflection in zip(
        train.meshes, train.rates, train.linear_stretches, train.loaded_stretches, strict=True
    ):
        for order in range(1, count + 1):
            if mesh.varies and order * rate <= count:
                harmonic = stiffness_harmonic(mesh, order, train.phases[mesh.name])
                terms = mesh_terms.setdefault(order * rate, [])
                terms.append(harmonic * deflection * stretches)
    orders = sorted(mesh_terms)
    shape = len(orders), squares.size
    force = np.reshape([np.abs(np.sum(mesh_terms[f], axis=0)) for f in orders], shape)
    in_phase = np.reshape([np.sum(np.abs(mesh_terms[f]), axis=0) for f in orders], shape)
    # A mode without deflection in the meshes of an order is not excited.
    deformed = in_phase > 1e-9 * in_phase.max(initial=0.0)
    share = np.where(deformed, force / np.where(deformed, in_phase, 1.0), 0.0)
    data = modes(train).isel(mode=slice(train.free_motions.shape[1], None))
    dataset = xr.Dataset(
        {
            "modal_force": (
                ("stiffness_order", "mode"),
                np.where(deformed, force, 0.0) / _largest(motions),
            ),
            "phase_sum": (("stiffness_order", "mode"), share),
            "excites": (("stiffness_order", "mode"), share > 1e-9),
            "natural_frequency": data.natural_frequency,
            "mode_kind": data.mode_kind,
        },
        coords={"stiffness_order": [float(f) for f in orders]},
        attrs={"title": "Modes of a gear train and the harmonics that excite them"},
    )
    return describe(dataset)
