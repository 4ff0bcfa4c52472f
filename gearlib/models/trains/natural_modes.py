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
from gearlib.models.trains.structure import AXES
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
    kinds = ["rigid"] * free.shape[1]
    kinds += [_kind(train, motion) for motion in motions[free.shape[1] :]]
    dataset = xr.Dataset(
        {
            "natural_frequency": ("mode", frequency),
            "mode_kind": ("mode", kinds),
            "mode_shape": (("mode", "body", "axis"), motions / _largest(motions)[:, None, None]),
            "strain_energy": (("mode", "mesh"), energy),
        },
        coords={
            "mode": np.arange(frequency.size),
            "mesh": list(train.mesh_names),
            "body": list(train.body_names),
            "axis": list(AXES),
        },
        attrs={"title": "Natural modes of a gear train"},
    )
    return describe(dataset)


def _largest(motions):
    return np.abs(motions).max(axis=(1, 2), initial=0.0)


def central(train):
    """Return the indices of carriers and of gears that several alike meshes share."""
    shared = {name for _, name in branches(train)} | {body.carrier for body in train.bodies}
    return [i for i, name in enumerate(train.body_names) if name in shared]


def _kind(train, motion):
    own = central(train)
    if not own:
        return "other"
    masses = np.array(
        [[b.mass or 0.0, b.mass or 0.0, b.inertia / b.base_radius**2] for b in train.bodies]
    )
    moves = (np.abs(motion) * np.sqrt(masses))[own]
    shifts, turns = moves[:, :2].max() > _NONE, moves[:, 2].max() > _NONE
    return {
        (False, True): "rotational",
        (True, False): "translational",
        (False, False): "satellite",
    }.get((bool(shifts), bool(turns)), "other")


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
    along = train.linear_stretches
    deflection = train.loaded_stretches
    parts = {}
    for j, mesh in enumerate(train.meshes):
        for order in range(1, count + 1):
            frequency = order * train.rates[j]
            if not mesh.varies or frequency > count:
                continue
            wave = stiffness_harmonic(mesh, order, train.phases[mesh.name])
            force = wave * deflection[j] * along[j]
            parts.setdefault(frequency, []).append(force)
    orders = sorted(parts)
    force = np.array([np.abs(np.sum(parts[f], axis=0)) for f in orders])
    most = np.array([np.sum(np.abs(parts[f]), axis=0) for f in orders])
    force, most = (values.reshape(len(orders), squares.size) for values in (force, most))
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
