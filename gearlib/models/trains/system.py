"""Conversion of a train in SI units to the dimensionless `TrainSystem` of the engines.

With lengths in static deflections, forces over the load, stiffness over C_s of the reference mesh
and the time theta = Omega t the equation of motion is

    M~ q'' + D~ q' + K~ q = f~ - sum_j (b_j P_j + b_j Q_j) - friction across the lines of action,

M~ = M Omega^2 / C_s, D~ = D Omega / C_s, with the forces of `gearlib.models.six_degrees`

    P = k_m d' + H1 (C d + (k - k_m) d'),    Q = H2 (C (d - s) + (k - k_m) (d - s)').
"""

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from gearlib.engines.exponential import MAX_NORM
from gearlib.engines.linear.train_system import TrainSystem
from gearlib.models import one_mesh_system
from gearlib.models.trains.waves import Segments

if TYPE_CHECKING:
    from gearlib.models.trains.train import GearTrain

#: Largest number of mesh periods until the excitation repeats, so that the engines can count them.
_MAX_REPEATS = 2**50


class Scaled(NamedTuple):
    """Dimensionless matrices of a train without its meshes at one tuning, n coordinates."""

    mass: np.ndarray  #: shape (n, n)
    stiffness: np.ndarray  #: shape (n, n)
    damping: np.ndarray  #: shape (n, n)
    load: np.ndarray  #: shape (n,)
    frame: np.ndarray  #: part of the stiffness that the rotating frame causes, shape (n, n)


def scaled(train: "GearTrain", tuning: float) -> Scaled:
    """Return the dimensionless matrices of a train without its meshes at a tuning."""
    matrices = train.structure
    stiffness_scale, omega = train.stiffness_scale, train.reference_angular_frequency
    pinion_speed = float(train.speeds[train.reference_pinion.name])
    frame_speed = train.carrier_ratio * tuning * pinion_speed if train.gyroscopic else 0.0
    mass = matrices.mass * (omega**2 / stiffness_scale)
    coriolis = matrices.turning * (omega**2 / stiffness_scale * frame_speed)
    centrifugal = matrices.centrifugal * (omega**2 / stiffness_scale * frame_speed**2)
    circulating = matrices.circulating * (omega / stiffness_scale * frame_speed)
    centrifugal_load = matrices.outward * (omega**2 * frame_speed**2 / train.load)
    return Scaled(
        mass,
        matrices.stiffness / stiffness_scale + (centrifugal + circulating),
        matrices.damping * (omega / stiffness_scale) + coriolis,
        matrices.load / train.load + centrifugal_load,
        centrifugal + circulating,
    )


def _distance_rows(train: "GearTrain") -> tuple[np.ndarray, np.ndarray]:
    """Return row vectors that map states to the distances of (drive, coast) flanks of m meshes.

    A state holds n coordinates, their n rates, the constant 1 and h pairs of cosine and sine, so
    that the shape is (m, 2 n + 1 + 2 h) each.
    """
    frequencies, amplitudes, constants = train.excitation
    per_metre = 1.0 / train.static_deflection
    m, n = train.structure.lines.shape
    drive, coast = np.zeros((2, m, 2 * n + 1 + 2 * frequencies.size))
    for side, rows, lines in ((1, drive, train.structure.lines), (0, coast, train.far_lines)):
        rows[:, :n] = lines
        rows[:, 2 * n] = constants[side] * per_metre
        rows[:, 2 * n + 1 :] = amplitudes[side] * per_metre
    for j, mesh in enumerate(train.meshes):
        if math.isfinite(mesh.backlash):
            coast[j, 2 * n] += mesh.backlash * per_metre
        else:
            coast[j] = one_mesh_system.absent_flank(coast.shape[1], 2 * n)
    return drive, coast


def train_system(train: "GearTrain", tuning: float, segments: Segments) -> TrainSystem:
    """Return the state-space matrices of a train at a tuning over segments of stiffness."""
    frequencies, matrices, lines = train.excitation[0], scaled(train, tuning), train.structure.lines
    inverse_mass, n = np.linalg.inv(matrices.mass), lines.shape[1]
    near, far = _distance_rows(train)
    # The matrix of dz/dtheta in the backlash of all meshes.
    free = one_mesh_system.harmonic_oscillators(near.shape[1], 2 * n + 1, tuning * frequencies)
    free[:n, n : 2 * n] = np.eye(n)
    free[n : 2 * n, :n] = -inverse_mass @ matrices.stiffness
    free[n : 2 * n, n : 2 * n] = -inverse_mass @ matrices.damping
    free[n : 2 * n, 2 * n] = inverse_mass @ matrices.load
    damping_unit = train.reference_angular_frequency / train.stiffness_scale
    # The rates of distances do not contain accelerations.
    near_rates, far_rates = near @ free, far @ free
    for j, mesh in enumerate(train.meshes):
        film_force = mesh.backlash_damping * damping_unit * near_rates[j]
        free[n : 2 * n] -= np.outer(inverse_mass @ lines[j], film_force)
    flanks = (near, near_rates, lines), (far, far_rates, train.far_lines)
    force_inputs, force_outputs, effect, stiffness, low = _contacts(
        train, segments, flanks, inverse_mass, free
    )
    norm = largest_norm(train, matrices) if train.gyroscopic else train.norm_at_rest
    highest_rate = max(norm, np.abs(frequencies * tuning).max(initial=0.0))
    return TrainSystem(
        free,
        near,
        far,
        force_inputs,
        force_outputs,
        effect,
        stiffness,
        low,
        segments.starts,
        segments.first_segment,
        float(MAX_NORM / highest_rate),
        frequencies,
        tuning,
        min(train.repeats, _MAX_REPEATS),
    )


def _contacts(
    train: "GearTrain",
    segments: Segments,
    flanks: tuple,
    inverse_mass: np.ndarray,
    free: np.ndarray,
) -> tuple:
    """Return the contact forces of m meshes in p segments, as fields of a `TrainSystem`.

    They are (force_inputs, force_outputs, effect, stiffness, low). `flanks` holds for the drive and
    the coast side the row vectors (distances, their rates, lines of action) of all meshes.
    `inverse_mass`, (n, n), is dimensionless; `free` is the state matrix in the backlash.
    """
    (m, n), p, size = flanks[0][2].shape, segments.starts.size - 1, len(free)
    low = np.stack([segments.low[0], segments.low[1], segments.low[1]])
    # Segments of one kind have the same stiffness level and direction of sliding.
    segment_kinds = 2 * segments.low + (segments.sense < 0.0)
    kinds = [
        ([] if math.isinf(mesh.backlash) else mesh_kinds, mesh_kinds)
        for mesh, mesh_kinds in zip(train.meshes, segments.kinds, strict=True)
    ]
    force_count = 1 + max(len(coast) + len(drive) for coast, drive in kinds)
    force_inputs, force_outputs = np.zeros((2, m, force_count, 2, size))
    effect = np.zeros((3, p, m), dtype=np.int64)
    stiffness = np.zeros((3, p, m))
    damping_unit = train.reference_angular_frequency / train.stiffness_scale
    for j, mesh in enumerate(train.meshes):
        levels = np.array([1.0, mesh.stiffness_ratio]) * mesh.max_stiffness / train.stiffness_scale
        stiffness[:, :, j] = levels[low[:, :, j].astype(int)]
        excess_damping = (mesh.known_damping - mesh.backlash_damping) * damping_unit
        number = 0  # of a force of this mesh; 0 is no force
        for side, (distances, rates, lines) in zip((1, 0), flanks, strict=True):
            for kind in kinds[j][side]:
                number += 1
                elastic_force = levels[kind // 2] * distances[j]
                friction = mesh.friction[1 - side] * (1 - 2 * (kind % 2))
                force_inputs[j, number, 0, n : 2 * n] = -inverse_mass @ lines[j]
                force_outputs[j, number, 0] = elastic_force + excess_damping * rates[j]
                force_inputs[j, number, 1, n : 2 * n] = -inverse_mass @ train.structure.across[j]
                force_outputs[j, number, 1] = friction * elastic_force
                effect[2 * side, segment_kinds[side, :, j] == kind, j] = number
    return force_inputs, force_outputs, effect, stiffness, low


def largest_norm(train: "GearTrain", matrices: Scaled) -> float:
    """Return an upper bound of the norms of the state matrices in all contact states of a train.

    `matrices` are its dimensionless matrices without the meshes. The coordinates have unit mass and
    velocities are divided by the highest natural frequency, so that stiffness and damping are
    symmetric and largest with all meshes in contact.
    """
    structure, stiffness_scale = train.structure, train.stiffness_scale
    stiffness, damping = matrices.stiffness.copy(), matrices.damping.copy()
    friction = np.zeros_like(stiffness)
    for j, mesh in enumerate(train.meshes):
        line, mesh_stiffness = structure.lines[j], mesh.max_stiffness / stiffness_scale
        flanks = np.outer(line, line)
        if mesh.moving_backlash:
            flanks = flanks + np.outer(train.far_lines[j], train.far_lines[j])
        mesh_damping = max(mesh.known_damping, mesh.backlash_damping)
        stiffness += mesh_stiffness * flanks
        damping += mesh_damping * train.reference_angular_frequency / stiffness_scale * flanks
        across_by_line = np.abs(np.outer(structure.across[j], line))
        friction += max(mesh.friction) * mesh_stiffness * across_by_line
    root = np.linalg.inv(np.linalg.cholesky(matrices.mass))
    k, d, f = (root @ matrix @ root.T for matrix in (stiffness, damping, friction))
    frequency = math.sqrt(max(np.linalg.norm(k, 2), 1e-300))
    state_matrix = np.block([[np.zeros_like(k), frequency * np.eye(len(k))], [-k / frequency, -d]])
    return float(np.linalg.norm(state_matrix, 2) + np.linalg.norm(f, 2) / frequency)
