"""Natural modes of a train with mean mesh stiffness, and their excitation by mesh harmonics.

Planetary trains, and other trains with equal branches between common gears, have structured modes:
rotational modes (no axis of a central body moves), translational modes (no central body turns) and
satellite modes (no central body moves); Lin & Parker, J. Vib. Acoust. 121 (1999) 316-321. The
phases of the meshes determine which harmonics of the mesh stiffness excite which modes; Parker, J.
Sound Vib. 236 (2000) 561-573.
"""

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from gearlib.data.variables import describe
from gearlib.engines.codes import COAST
from gearlib.models.trains.statics import mesh_groups
from gearlib.models.trains.waves import deviation_of_teeth, stiffness_harmonic

if TYPE_CHECKING:
    from gearlib.models.trains.train import GearTrain

#: Smaller mass-normalised motions of a body count as zero.
_MIN_MOTION = 1e-6


def modes(train: "GearTrain") -> xr.Dataset:
    """Return the natural modes of a train as the dataset of `GearTrain.modes`."""
    squares, shapes = train.linear_modes
    free = train.free_motions
    frequency = np.concatenate([np.zeros(free.shape[1]), np.sqrt(squares)]) / math.tau
    shapes = np.concatenate([free, shapes], axis=1)
    motions = np.einsum("bkn,np->pbk", train.structure.motions, shapes)
    energy = np.zeros((frequency.size, len(train.meshes)))
    energy[free.shape[1] :] = train.strains[-len(train.meshes) :].T ** 2
    # Before the meshes come the springs of shafts: in torsion, and in bending along x and y.
    springs = train.strains[: -len(train.meshes)]
    of_shafts = springs[len(springs) - 3 * len(train.shafts) :] ** 2
    shaft_energy = np.zeros((frequency.size, len(train.shafts)))
    shaft_energy[free.shape[1] :] = (
        of_shafts.reshape(len(train.shafts), 3, squares.size).sum(axis=1).T
    )
    kinds = ["rigid"] * free.shape[1] + _mode_kinds(train, motions[free.shape[1] :])
    dataset = xr.Dataset(
        {
            "natural_frequency": ("mode", frequency),
            "mode_kind": ("mode", kinds),
            "mode_shape": (
                ("mode", "body", "axis"),
                motions / _largest_motions(motions)[:, None, None],
            ),
            "strain_energy": (("mode", "mesh"), energy),
            "shaft_energy": (("mode", "shaft"), shaft_energy),
        },
        coords={
            "mode": np.arange(frequency.size),
            "shaft": np.array(["-".join(shaft.bodies) for shaft in train.shafts], str),
            **train.names,
        },
        attrs={"title": "Natural modes of a gear train"},
    )
    return describe(dataset)


def _largest_motions(motions: np.ndarray) -> np.ndarray:
    """Return the largest of the motions of bodies, (p, bodies, 3), in each of p modes, (p,)."""
    return np.abs(motions).max(axis=(1, 2), initial=0.0)


def _mode_kinds(train: "GearTrain", motions: np.ndarray) -> list[str]:
    """Return the kind of each elastic mode by the motions of the central bodies of a train.

    Central bodies are carriers and gears with several meshes. In a planet mode, called "satellite"
    here, they do not move. `motions` are the mass-normalised motions of b bodies along x, y and in
    rotation in p modes, shape (p, b, 3).
    """
    central_names = {body.carrier for body in train.bodies}
    central_names |= {name for _, name in mesh_groups(train)}
    central = [body.name in central_names for body in train.bodies]
    if not any(central):
        return ["other"] * len(motions)
    masses = [(b.mass or 0.0, b.mass or 0.0, b.inertia / b.base_radius**2) for b in train.bodies]
    largest = (np.abs(motions) * np.sqrt(masses))[:, central].max(axis=1, initial=0.0)
    kinds = []
    for x, y, rotation in largest.tolist():
        axis_moves, body_turns = max(x, y) > _MIN_MOTION, rotation > _MIN_MOTION
        if axis_moves:
            kinds.append("other" if body_turns else "translational")
        else:
            kinds.append("rotational" if body_turns else "satellite")
    return kinds


def campbell(train: "GearTrain", count: int = 3) -> xr.Dataset:
    """Return the critical speeds of a train as the dataset of `GearTrain.campbell`.

    `count` is the number of harmonics of each mesh frequency.
    """
    # Frequencies of the harmonics over that of the reference mesh.
    orders = sorted({n * ratio for ratio in train.frequency_ratios for n in range(1, count + 1)})
    # Orders that the stiffness does not excite may be excited by deviations.
    data = phasing(train, math.ceil(orders[-1])).reindex(
        stiffness_order=[float(order) for order in orders],
        fill_value={"modal_force": 0.0, "phase_sum": 0.0, "excites": False},
    )
    reference_frequency = train.reference_angular_frequency / (2.0 * math.pi)
    # Reference mesh frequencies, over the reference frequency, at which an order meets a mode.
    tuning = data.natural_frequency / reference_frequency / data.stiffness_order
    data["critical_speed"] = train.speed(tuning).transpose("stiffness_order", "mode")
    data.attrs["title"] = "Campbell diagram of a gear train"
    return describe(data)


def phasing(train: "GearTrain", count: int = 12) -> xr.Dataset:
    """Return the modal forces of the teeth as the dataset of `GearTrain.phasing`.

    `count` is the highest order of the harmonics.
    """
    squares, shapes = train.linear_modes
    motions = np.einsum("bkn,np->pbk", train.structure.motions, shapes)
    mesh_forces: dict = {}  # order -> complex modal forces of the meshes, each of shape (p,)
    displacements = train.modal_mesh_displacements, train.static_mesh_displacements
    for mesh, ratio, side, modal, static in zip(
        train.meshes, train.frequency_ratios, train.loaded_sides, *displacements, strict=True
    ):
        # The flanks that carry the load vary the stiffness, or deviate by the transmission error.
        phase, table = deviation_of_teeth(train, mesh, 0 if side == COAST else 1)
        for order in range(1, math.floor(count / ratio) + 1):
            if mesh.varies or order <= len(table):
                force: Any = stiffness_harmonic(mesh, order, phase) * static if mesh.varies else 0.0
                if order <= len(table):
                    amplitude = complex(table[order - 1, 1], -table[order - 1, 2])
                    rotation = np.exp(-2.0j * np.pi * order * phase)
                    force += mesh.mean_stiffness * amplitude * rotation
                mesh_forces.setdefault(order * ratio, []).append(force * modal)
    orders = sorted(mesh_forces)
    shape = len(orders), squares.size
    force = np.reshape([np.abs(np.sum(mesh_forces[order], axis=0)) for order in orders], shape)
    # The sum if all meshes acted in phase.
    in_phase = np.reshape([np.sum(np.abs(mesh_forces[order]), axis=0) for order in orders], shape)
    # A mode without deflection in the meshes of an order is not excited.
    deformed = in_phase > 1e-9 * in_phase.max(initial=0.0)
    phase_sum = np.where(deformed, force / np.where(deformed, in_phase, 1.0), 0.0)
    data = modes(train).isel(mode=slice(train.free_motions.shape[1], None))
    dataset = xr.Dataset(
        {
            "modal_force": (
                ("stiffness_order", "mode"),
                np.where(deformed, force, 0.0) / _largest_motions(motions),
            ),
            "phase_sum": (("stiffness_order", "mode"), phase_sum),
            "excites": (("stiffness_order", "mode"), phase_sum > 1e-9),
            "natural_frequency": data.natural_frequency,
            "mode_kind": data.mode_kind,
        },
        coords={"stiffness_order": [float(order) for order in orders]},
        attrs={"title": "Modes of a gear train and the harmonics that excite them"},
    )
    return describe(dataset)
