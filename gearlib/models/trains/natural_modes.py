"""Natural modes of a train with mean stiffness and all flanks in contact, and what excites them.

Planetary trains, and others whose equal branches lie between common gears, have structured modes:
rotational (no axis of a central body moves), translational (no central body turns) and satellite
modes (no central body moves); Lin & Parker, J. Vib. Acoust. 121 (1999) 316-321. Which harmonics of
the mesh stiffness excite which of them is decided by the phases of the meshes; Parker, J. Sound
Vib. 236 (2000) 561-573.
"""

import math

import numpy as np
import xarray as xr

from gearlib.data.variables import describe
from gearlib.models.trains.statics import branches
from gearlib.models.trains.waves import stiffness_harmonic

#: Of a mode's mass-normalised motion: less is none.
_NONE = 1e-6


def modes(train):
    """Return the modes of a train, see `GearTrain.modes`."""
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
    return np.abs(motions).max(axis=(1, 2), initial=0.0)


def _kinds(train, motions):
    """Return the kinds of elastic modes by what moves of carriers and of gears of several meshes.

    `motions` are mass-normalised, shape (p, b, 3).
    """
    shared = {name for _, name in branches(train)} | {body.carrier for body in train.bodies}
    central = [body.name in shared for body in train.bodies]
    if not any(central):
        return ["other"] * len(motions)
    masses = [(b.mass or 0.0, b.mass or 0.0, b.inertia / b.base_radius**2) for b in train.bodies]
    moves = (np.abs(motions) * np.sqrt(masses))[:, central].max(axis=1, initial=0.0)
    kinds = {(0, 1): "rotational", (1, 0): "translational", (0, 0): "satellite", (1, 1): "other"}
    return [kinds[max(x, y) > _NONE, turn > _NONE] for x, y, turn in moves.tolist()]


def campbell(train, count=3):
    """Return critical speeds, see `GearTrain.campbell`."""
    orders = sorted({n * rate for rate in train.rates for n in range(1, count + 1)})
    # What the stiffness does not excite, deviations may.
    data = phasing(train, math.ceil(orders[-1])).reindex(
        stiffness_order=[float(order) for order in orders],
        fill_value={"modal_force": 0.0, "phase_sum": 0.0, "excites": False},
    )
    own = train.reference_angular_frequency / (2.0 * math.pi)
    tuning = data.natural_frequency / own / data.stiffness_order
    data["critical_speed"] = train.speed(tuning).transpose("stiffness_order", "mode")
    data.attrs["title"] = "Campbell diagram of a gear train"
    return describe(data)


def phasing(train, count=12):
    """Return which harmonics excite which modes, see `GearTrain.phasing`."""
    squares, shapes = train.linear_modes
    motions = np.einsum("bkn,np->pbk", train.structure.motions, shapes)
    parts: dict = {}
    for mesh, rate, stretches, deflection in zip(
        train.meshes, train.rates, train.linear_stretches, train.loaded_stretches, strict=True
    ):
        for order in range(1, count + 1):
            if mesh.varies and order * rate <= count:
                wave = stiffness_harmonic(mesh, order, train.phases[mesh.name])
                parts.setdefault(order * rate, []).append(wave * deflection * stretches)
    orders = sorted(parts)
    shape = len(orders), squares.size
    force = np.reshape([np.abs(np.sum(parts[f], axis=0)) for f in orders], shape)
    most = np.reshape([np.sum(np.abs(parts[f]), axis=0) for f in orders], shape)
    # A mode that no mesh of this frequency deforms is not excited either.
    deformed = most > 1e-9 * most.max(initial=0.0)
    share = np.where(deformed, force / np.where(deformed, most, 1.0), 0.0)
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
