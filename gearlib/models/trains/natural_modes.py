"""Natural modes of a train with mean mesh stiffness, and their excitation by mesh harmonics.

Planetary trains, and other trains with equal branches between common gears, have structured modes:
rotational modes (central bodies only rotate), translational modes (central bodies only translate)
and planet or satellite modes (central bodies do not move); Lin & Parker, J. Vib. Acoust. 121 (1999)
316-321. The mesh phases determine which harmonics of the mesh stiffness excite which modes; Parker,
J. Sound Vib. 236 (2000) 561-573.
"""

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from gearlib.data.variables import add_metadata
from gearlib.engines.codes import COAST
from gearlib.models.trains.statics import mesh_groups
from gearlib.models.trains.waves import stiffness_harmonic, tooth_deviation

if TYPE_CHECKING:
    from gearlib.models.trains.train import GearTrain

#: Mass-weighted motions of a body below this magnitude are treated as zero.
_MIN_MOTION = 1e-6


def modes(train: "GearTrain") -> xr.Dataset:
    """Return natural frequencies, mode shapes, strain energies and damping of a train.

    All flanks are in contact at mean stiffness. The first modes are the rigid-body modes, whose
    frequency is 0. `GearTrain.modes` describes the dataset.
    """
    squared_frequencies, shapes = train.linear_modes
    rigid_count = train.free_motions.shape[1]
    frequencies = np.concatenate([np.zeros(rigid_count), np.sqrt(squared_frequencies)]) / math.tau
    shapes = np.concatenate([train.free_motions, shapes], axis=1)
    motions = np.einsum("bkn,np->pbk", train.structure.motions, shapes)
    mesh_count, shaft_count = len(train.meshes), len(train.shafts)
    mesh_energy = np.zeros((frequencies.size, mesh_count))
    mesh_energy[rigid_count:] = train.strains[-mesh_count:].T ** 2
    # The squares of `strains` are fractions of the strain energy. The last rows belong to the
    # meshes, and the rows before them to three springs per shaft: torsion, and bending along x
    # and y.
    strains = train.strains[:-mesh_count]
    shaft_spring_energy = strains[len(strains) - 3 * shaft_count :] ** 2
    shaft_energy = np.zeros((frequencies.size, shaft_count))
    shaft_energy[rigid_count:] = (
        shaft_spring_energy.reshape(shaft_count, 3, squared_frequencies.size).sum(axis=1).T
    )
    kinds = ["rigid"] * rigid_count + _mode_kinds(train, motions[rigid_count:])
    mode_shapes = motions / _largest_motions(motions)[:, None, None]
    dataset = xr.Dataset(
        {
            **_damped_modes(train, frequencies, shapes),
            "natural_frequency": ("mode", frequencies),
            "mode_kind": ("mode", kinds),
            "mode_shape": (("mode", "body", "axis"), mode_shapes),
            "strain_energy": (("mode", "mesh"), mesh_energy),
            "shaft_energy": (("mode", "shaft"), shaft_energy),
        },
        coords={
            "mode": np.arange(frequencies.size),
            "shaft": np.array(["-".join(shaft.bodies) for shaft in train.shafts], str),
            **train.names,
        },
        attrs={"title": "Natural modes of a gear train"},
    )
    return add_metadata(dataset)


def total_damping(train: "GearTrain") -> np.ndarray | None:
    """Return the damping matrix with all flanks in contact, N s/m, shape (n, n).

    It includes supports, shafts and meshes. Returns None if the damping of a mesh is unknown.
    """
    damping = train.structure.damping.copy()
    for mesh_row, mesh in zip(train.structure.mesh_jacobian, train.meshes, strict=True):
        if mesh.material_damping is None:
            return None
        damping += mesh.material_damping * np.outer(mesh_row, mesh_row)
    return damping


def mean_stiffness_matrix(train: "GearTrain") -> np.ndarray:
    """Return the stiffness matrix with all flanks in contact at mean stiffness, N/m, (n, n)."""
    jacobian = train.structure.mesh_jacobian
    mean_stiffnesses = [mesh.mean_stiffness for mesh in train.meshes]
    return train.structure.stiffness + (jacobian.T * mean_stiffnesses) @ jacobian


def state_matrix(train: "GearTrain", damping: np.ndarray) -> np.ndarray:
    """Return the state matrix A of x' = A x, with all flanks in contact at mean stiffness.

    The state x consists of the n coordinates in m and their rates in m/s; A has the shape
    (2 n, 2 n). `damping`, shape (n, n), is the result of `total_damping` in N s/m.
    """
    inverse_mass, n = np.linalg.inv(train.structure.mass), len(damping)
    matrix = np.zeros((2 * n, 2 * n))
    matrix[:n, n:] = np.eye(n)
    matrix[n:, :n] = -inverse_mass @ mean_stiffness_matrix(train)
    matrix[n:, n:] = -inverse_mass @ damping
    return matrix


def _damped_modes(train: "GearTrain", frequencies: np.ndarray, shapes: np.ndarray) -> dict:
    """Return modal damping ratios and complex modes as dataset variables, name -> (dims, values).

    The complex modes are eigenvectors of the damped train. `frequencies`, shape (p,), are the
    undamped natural frequencies in Hz, and `shapes`, shape (n, p), are the mass-normalised mode
    shapes. The dict is empty if the train has no damping, or if the damping of a mesh is unknown.
    """
    damping = total_damping(train)
    if damping is None or not damping.any():
        return {}
    omega = math.tau * frequencies
    modal_damping = np.einsum("np,nk,kp->p", shapes, damping, shapes)
    # The damping ratio of rigid-body modes (frequency 0) is undefined.
    ratios = np.full(omega.size, np.nan)
    np.divide(modal_damping, 2.0 * omega, out=ratios, where=omega > 0.0)
    values, vectors = np.linalg.eig(state_matrix(train, damping))
    # Keep one eigenvalue of each complex conjugate pair, in the order of the frequencies.
    order = [i for i in np.argsort(np.abs(values)) if values[i].imag > 1e-9 * abs(values[i])]
    coordinates = vectors[: len(damping), order]
    motions = np.einsum("bkn,np->pbk", train.structure.motions, coordinates)
    if order:
        # Normalise each mode so that its largest motion is 1 and real.
        flat_motions = motions.reshape(len(order), -1)
        largest_indices = np.abs(flat_motions).argmax(axis=1)
        largest = flat_motions[np.arange(len(order)), largest_indices]
        motions = motions / np.where(largest == 0.0, 1.0, largest).reshape(-1, 1, 1)
    dims = "complex_mode", "body", "axis"
    return {
        "modal_damping_ratio": ("mode", ratios),
        "decay_rate": ("complex_mode", -values[order].real),
        "damped_frequency": ("complex_mode", values[order].imag / math.tau),
        "mode_shape_real": (dims, motions.real),
        "mode_shape_imag": (dims, motions.imag),
    }


def _largest_motions(motions: np.ndarray) -> np.ndarray:
    """Return the largest magnitude of the body motions in each of p modes, shape (p,).

    `motions`, shape (p, bodies, 3), are the motions of the bodies along x, along y and in rotation.
    To avoid divisions by 0, the result is 1 for modes that move no body, which exist in trains
    given by matrices.
    """
    largest = np.abs(motions).max(axis=(1, 2), initial=0.0)
    return np.where(largest > 0.0, largest, 1.0)


def _mode_kinds(train: "GearTrain", motions: np.ndarray) -> list[str]:
    """Classify the elastic modes of a train by the motions of its central bodies.

    Central bodies are carriers and gears with several meshes. A mode is "rotational" if they only
    rotate, "translational" if they only translate, "satellite" (a planet mode) if they do not move,
    and "other" if they do both or if there are none. `motions`, shape (p, b, 3), are the motions of
    b bodies along x, along y and in rotation in p mass-normalised modes.
    """
    central_names = {body.carrier for body in train.bodies}
    central_names |= {name for _, name in mesh_groups(train)}
    is_central = [body.name in central_names for body in train.bodies]
    if not any(is_central):
        return ["other"] * len(motions)
    masses = []
    for body in train.bodies:
        mass = body.mass or 0.0
        masses.append((mass, mass, body.inertia / body.base_radius**2))
    # Motions are weighted by mass, so that one threshold suits all trains.
    largest = (np.abs(motions) * np.sqrt(masses))[:, is_central].max(axis=1, initial=0.0)
    kinds = []
    for x, y, rotation in largest.tolist():
        axis_moves = max(x, y) > _MIN_MOTION
        body_turns = rotation > _MIN_MOTION
        if axis_moves:
            kinds.append("other" if body_turns else "translational")
        else:
            kinds.append("rotational" if body_turns else "satellite")
    return kinds


def campbell(train: "GearTrain", count: int = 3) -> xr.Dataset:
    """Return the critical speeds, at which a mesh harmonic coincides with a natural frequency.

    `count` is the number of harmonics of each mesh frequency. `GearTrain.campbell` describes the
    dataset.
    """
    # An order is the frequency of a harmonic divided by the frequency of the reference mesh.
    orders = sorted({n * ratio for ratio in train.frequency_ratios for n in range(1, count + 1)})
    # Include orders that the stiffness does not excite, because deviations may excite them.
    data = phasing(train, math.ceil(orders[-1])).reindex(
        stiffness_order=[float(order) for order in orders],
        fill_value={"modal_force": 0.0, "phase_sum": 0.0, "excites": False},
    )
    reference_frequency = train.reference_angular_frequency / (2.0 * math.pi)
    # The tuning is the mesh frequency over the reference natural frequency.
    critical_tuning = data.natural_frequency / reference_frequency / data.stiffness_order
    data["critical_speed"] = train.speed(critical_tuning).transpose("stiffness_order", "mode")
    data.attrs["title"] = "Campbell diagram of a gear train"
    return add_metadata(data)


def phasing(train: "GearTrain", count: int = 12) -> xr.Dataset:
    """Return the modal forces by which harmonics of the mesh frequencies excite the modes.

    The mesh phases determine whether the forces of the meshes add up or cancel. `count` is the
    highest order of the harmonics, relative to the frequency of the reference mesh.
    `GearTrain.phasing` describes the dataset.
    """
    squared_frequencies, shapes = train.linear_modes
    motions = np.einsum("bkn,np->pbk", train.structure.motions, shapes)
    mesh_forces: dict = {}  # order -> list of complex modal forces of the meshes, shape (p,)
    displacements = train.modal_mesh_displacements, train.static_mesh_displacements
    for mesh, ratio, side, modal_displacements, static_displacement in zip(
        train.meshes, train.frequency_ratios, train.loaded_sides, *displacements, strict=True
    ):
        # The teeth on the loaded side, 0 (coast) or 1 (drive), excite the modes by their varying
        # stiffness and by their transmission error, with rows (order, cosine, sine) in `table`.
        phase, table = tooth_deviation(train, mesh, 0 if side == COAST else 1)
        for order in range(1, math.floor(count / ratio) + 1):
            has_deviation = order <= len(table)
            if not mesh.varies and not has_deviation:
                continue
            force: Any = 0.0
            if mesh.varies:
                force = stiffness_harmonic(mesh, order, phase) * static_displacement
            if has_deviation:
                amplitude = complex(table[order - 1, 1], -table[order - 1, 2])
                rotation = np.exp(-2.0j * np.pi * order * phase)
                force += mesh.mean_stiffness * amplitude * rotation
            mesh_forces.setdefault(order * ratio, []).append(force * modal_displacements)
    orders = sorted(mesh_forces)
    shape = len(orders), squared_frequencies.size
    forces = np.reshape([np.abs(np.sum(mesh_forces[order], axis=0)) for order in orders], shape)
    # These would be the modal forces if all meshes acted in phase.
    max_forces = np.reshape([np.sum(np.abs(mesh_forces[order]), axis=0) for order in orders], shape)
    # Modes without mesh deflections are not excited.
    is_deflected = max_forces > 1e-9 * max_forces.max(initial=0.0)
    phase_sum = np.where(is_deflected, forces / np.where(is_deflected, max_forces, 1.0), 0.0)
    modal_force = np.where(is_deflected, forces, 0.0) / _largest_motions(motions)
    elastic_modes = modes(train).isel(mode=slice(train.free_motions.shape[1], None))
    dims = "stiffness_order", "mode"
    dataset = xr.Dataset(
        {
            "modal_force": (dims, modal_force),
            "phase_sum": (dims, phase_sum),
            "excites": (dims, phase_sum > 1e-9),
            "natural_frequency": elastic_modes.natural_frequency,
            "mode_kind": elastic_modes.mode_kind,
        },
        coords={"stiffness_order": [float(order) for order in orders]},
        attrs={"title": "Modes of a gear train and the harmonics that excite them"},
    )
    return add_metadata(dataset)
