"""Conversion of a train in SI units to the dimensionless `TrainSystem` of the engines.

With lengths in static deflections, forces over the load, stiffness over the mean stiffness C_s of
the reference mesh and the time theta = Omega t, where Omega is the reference natural frequency, the
equation of motion is

    M~ q'' + D~ q' + K~ q = f~ - sum_j (b_j P_j + b_j Q_j) - friction across the lines of action,

M~ = M Omega^2 / C_s, D~ = D Omega / C_s, with the forces of `gearlib.models.six_degrees` on the
drive side, P, and on the coast side, Q:

    P = k_m d' + H1 (C d + (k - k_m) d'),    Q = H2 (C (d - s) + (k - k_m) (d - s)').

Here d is the distance of the drive-side flanks, s its value where coast-side flanks touch, C the
stiffness, k the damping in contact and k_m in free flight; H1 and H2 are 1 in drive-side and
coast-side contact and 0 otherwise.
"""

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from gearlib.engines.linear.train_system import TrainSystem
from gearlib.engines.matrices import MAX_NORM
from gearlib.models import single_mesh_system
from gearlib.models.trains.waves import Segments

if TYPE_CHECKING:
    from gearlib.models.trains.train import GearTrain

#: Largest number of mesh periods until the excitation repeats, so that the engines can count them.
_MAX_REPEATS = 2**50


class _Flanks(NamedTuple):
    """Row vectors of the flanks on one side, drive or coast, of m meshes."""

    distances: np.ndarray  #: rows that map a state to the distances of the flanks, (m, state size)
    rates: np.ndarray  #: rows that map a state to the rates of these distances, (m, state size)
    lines: np.ndarray  #: rows along which the mesh forces act on the n coordinates, shape (m, n)


class DimensionlessMatrices(NamedTuple):
    """Dimensionless matrices of a train without its meshes at one tuning, n coordinates."""

    mass: np.ndarray  #: shape (n, n)
    stiffness: np.ndarray  #: shape (n, n)
    damping: np.ndarray  #: shape (n, n)
    load: np.ndarray  #: shape (n,)
    nonmodal_stiffness: np.ndarray  #: part that the natural modes leave out, shape (n, n)


def dimensionless_matrices(train: "GearTrain", tuning: float) -> DimensionlessMatrices:
    """Return the `DimensionlessMatrices` of a train without its meshes at a tuning.

    `tuning` is the mesh frequency over the natural frequency, both of the reference mesh. It sets
    the speed of the frame that rotates with the carrier, and so the gyroscopic forces. Lengths are
    in static deflections, forces over the load, and times are multiplied by the natural frequency.
    """
    structure, stiffness_scale = train.structure, train.stiffness_scale
    omega = train.reference_angular_frequency
    frame_speed = tuning * float(train.speeds.frame) if train.gyroscopic else 0.0
    coriolis = structure.coriolis * (omega**2 / stiffness_scale * frame_speed)
    centrifugal = structure.centrifugal * (omega**2 / stiffness_scale * frame_speed**2)
    circulatory = structure.circulatory * (omega / stiffness_scale * frame_speed)
    centrifugal_load = structure.centrifugal_load * (omega**2 * frame_speed**2 / train.load)
    frame_stiffness = centrifugal + circulatory
    # Journal bearings have an unsymmetric stiffness, whose skew part the natural modes leave out.
    skew_stiffness = (structure.stiffness - structure.stiffness.T) / (2.0 * stiffness_scale)
    return DimensionlessMatrices(
        mass=structure.mass * (omega**2 / stiffness_scale),
        stiffness=structure.stiffness / stiffness_scale + frame_stiffness,
        damping=structure.damping * (omega / stiffness_scale) + coriolis,
        load=structure.load / train.load + centrifugal_load,
        nonmodal_stiffness=frame_stiffness + skew_stiffness,
    )


def _distance_rows(train: "GearTrain") -> tuple[np.ndarray, np.ndarray]:
    """Return the row vectors that map a state to the distances of (drive, coast) flanks.

    A state holds n coordinates, their n rates, the constant 1, and the cosine and sine of each of h
    excitation frequencies. So both arrays have the shape (m, 2 n + 1 + 2 h) for m meshes. Distances
    are in static deflections; flanks touch on the drive side where they are >= 0, and on the coast
    side where they are <= 0.
    """
    frequencies, amplitudes, constants = train.excitation
    per_metre = 1.0 / train.static_deflection
    m, n = train.structure.lines.shape
    drive, coast = np.zeros((2, m, 2 * n + 1 + 2 * frequencies.size))
    drive[:, :n], coast[:, :n] = train.structure.lines, train.coast_lines
    for side, rows in enumerate((coast, drive)):
        rows[:, 2 * n] = constants[side] * per_metre
        rows[:, 2 * n + 1 :] = amplitudes[side] * per_metre
    for j, mesh in enumerate(train.meshes):
        if math.isfinite(mesh.backlash):
            coast[j, 2 * n] += mesh.backlash * per_metre
        else:
            # Coast-side flanks with infinite backlash never touch.
            coast[j] = single_mesh_system.absent_flank(coast.shape[1], 2 * n)
    return drive, coast


def train_system(train: "GearTrain", tuning: float, segments: Segments) -> TrainSystem:
    """Return the `TrainSystem` of a train: its state-space matrices for the engines.

    `tuning` is the mesh frequency over the natural frequency, both of the reference mesh.
    `segments` are the `Segments` of mesh phase in which no stiffness and no sliding direction
    changes.
    """
    frequencies, lines = train.excitation[0], train.structure.lines
    matrices = dimensionless_matrices(train, tuning)
    inverse_mass, n = np.linalg.inv(matrices.mass), lines.shape[1]
    drive, coast = _distance_rows(train)
    # The state z obeys dz/dtheta = free_flight z while no flanks touch. The rows n to 2 n are the
    # accelerations.
    state_size, rates = drive.shape[1], tuning * frequencies
    free_flight = single_mesh_system.harmonic_oscillators(state_size, 2 * n + 1, rates)
    free_flight[:n, n : 2 * n] = np.eye(n)
    free_flight[n : 2 * n, :n] = -inverse_mass @ matrices.stiffness
    free_flight[n : 2 * n, n : 2 * n] = -inverse_mass @ matrices.damping
    free_flight[n : 2 * n, 2 * n] = inverse_mass @ matrices.load
    free_flight[n : 2 * n, 2 * n + 1 :] = inverse_mass @ (train.harmonic_forces / train.load)
    damping_scale = train.reference_angular_frequency / train.stiffness_scale
    # The rates of distances do not contain accelerations, so that they are complete before the
    # damping in free flight is added.
    drive_rates, coast_rates = drive @ free_flight, coast @ free_flight
    for j, mesh in enumerate(train.meshes):
        damping_force = mesh.backlash_damping * damping_scale * drive_rates[j]
        free_flight[n : 2 * n] -= np.outer(inverse_mass @ lines[j], damping_force)
    drive_flanks = _Flanks(drive, drive_rates, lines)
    coast_flanks = _Flanks(coast, coast_rates, train.coast_lines)
    contact_forces = _contact_forces(train, segments, drive_flanks, coast_flanks, inverse_mass)
    # The longest step of the engines, for which their series converge, follows from this bound.
    norm = largest_norm(train, matrices) if train.gyroscopic else train.norm_at_rest
    highest_rate = max(norm, np.abs(frequencies * tuning).max(initial=0.0))
    return TrainSystem(
        base_matrix=free_flight,
        drive_lines=drive,
        coast_lines=coast,
        **contact_forces,
        starts=segments.starts,
        first_segment=segments.first_segment,
        max_step=float(MAX_NORM / highest_rate),
        harmonics=frequencies,
        tuning=tuning,
        repeats=min(train.repeats, _MAX_REPEATS),
    )


def _contact_forces(train, segments, drive_flanks, coast_flanks, inverse_mass) -> dict[str, Any]:
    """Return the fields of a `TrainSystem` that describe contact forces, name -> array.

    For m meshes and p segments they are the input and output vectors of the forces, the index of
    the force in each contact state and segment, the stiffness, and whether it is at the lower
    level. `drive_flanks` and `coast_flanks` are `_Flanks`; `inverse_mass`, shape (n, n), is the
    inverse of the dimensionless mass matrix.
    """
    m, n = drive_flanks.lines.shape
    p = segments.starts.size - 1
    # The first axis is the contact state: coast side, no contact, drive side.
    low = np.stack([segments.low[0], segments.low[1], segments.low[1]])
    # The kind of a segment is 2 at the lower stiffness level, else 0, plus 1 if the sliding is
    # negative. Segments of one kind have the same force.
    segment_kinds = 2 * segments.low + (segments.sliding_signs < 0.0)
    kinds = []  # for each mesh, the kinds on the (coast, drive) side
    for mesh, mesh_kinds in zip(train.meshes, segments.kinds, strict=True):
        kinds.append(([] if math.isinf(mesh.backlash) else mesh_kinds, mesh_kinds))
    force_count = 1 + max(len(coast) + len(drive) for coast, drive in kinds)
    state_size = drive_flanks.distances.shape[1]
    force_inputs, force_outputs = np.zeros((2, m, force_count, 2, state_size))
    force_indices = np.zeros((3, p, m), dtype=np.int64)
    stiffness = np.zeros((3, p, m))
    damping_scale = train.reference_angular_frequency / train.stiffness_scale
    for j, mesh in enumerate(train.meshes):
        levels = np.array([1.0, mesh.stiffness_ratio]) * mesh.max_stiffness / train.stiffness_scale
        stiffness[:, :, j] = levels[low[:, :, j].astype(int)]
        added_damping = (mesh.known_damping - mesh.backlash_damping) * damping_scale
        index = 0  # Index 0 means that no force acts.
        # Sides are 0, coast, and 1, drive, but friction coefficients are in the order drive, coast.
        for side, flanks in ((1, drive_flanks), (0, coast_flanks)):
            for kind in kinds[j][side]:
                level, slides_negatively = divmod(kind, 2)
                sliding_sign = 1 - 2 * slides_negatively
                index += 1
                elastic_force = levels[level] * flanks.distances[j]
                friction = mesh.friction[1 - side] * sliding_sign
                # Entry 0 acts along the line of action, and entry 1, the friction, across it.
                force_inputs[j, index, 0, n : 2 * n] = -inverse_mass @ flanks.lines[j]
                force_outputs[j, index, 0] = elastic_force + added_damping * flanks.rates[j]
                force_inputs[j, index, 1, n : 2 * n] = -inverse_mass @ train.structure.sliding[j]
                force_outputs[j, index, 1] = friction * elastic_force
                force_indices[2 * side, segment_kinds[side, :, j] == kind, j] = index
    return {
        "force_input": force_inputs,
        "force_output": force_outputs,
        "effect": force_indices,
        "stiffness": stiffness,
        "below_mean": low,
    }


def largest_norm(train: "GearTrain", matrices: DimensionlessMatrices) -> float:
    """Return an upper bound of the norms of the state matrices of a train, whatever flanks touch.

    `matrices` are the dimensionless matrices without the meshes. Coordinates are scaled to unit
    mass, and velocities are divided by the highest natural frequency. Then stiffness and damping
    are symmetric, and largest with all meshes in contact; friction and unsymmetric parts are added.
    """
    structure, stiffness_scale = train.structure, train.stiffness_scale
    stiffness, damping = matrices.stiffness.copy(), matrices.damping.copy()
    friction = np.zeros_like(stiffness)
    for j, mesh in enumerate(train.meshes):
        line, mesh_stiffness = structure.lines[j], mesh.max_stiffness / stiffness_scale
        flanks = np.outer(line, line)
        if mesh.moving_backlash:
            flanks = flanks + np.outer(train.coast_lines[j], train.coast_lines[j])
        mesh_damping = max(mesh.known_damping, mesh.backlash_damping)
        stiffness += mesh_stiffness * flanks
        damping += mesh_damping * train.reference_angular_frequency / stiffness_scale * flanks
        sliding_by_line = np.abs(np.outer(structure.sliding[j], line))
        friction += max(mesh.friction) * mesh_stiffness * sliding_by_line
    root = np.linalg.inv(np.linalg.cholesky(matrices.mass))
    k = root @ stiffness @ root.T
    d = root @ damping @ root.T
    scaled_friction = root @ friction @ root.T
    frequency = math.sqrt(max(np.linalg.norm(k, 2), 1e-300))
    state_matrix = np.block([[np.zeros_like(k), frequency * np.eye(len(k))], [-k / frequency, -d]])
    # An unsymmetric stiffness could be larger without a contact than with it.
    skew = (k - k.T) / 2.0
    added_norm = (np.linalg.norm(scaled_friction, 2) + np.linalg.norm(skew, 2)) / frequency
    return float(np.linalg.norm(state_matrix, 2) + added_norm)
