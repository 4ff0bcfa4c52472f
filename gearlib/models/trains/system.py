"""Conversion of a train in SI units to the dimensionless `TrainSystem` of the engines.

The units are the static deflection for lengths, the load for forces, the mean stiffness C_s of the
reference mesh for stiffnesses, and 1 / Omega for times, where Omega is the reference natural
frequency. The equation of motion is then

    M~ q'' + D~ q' + K~ q = f~ - sum_j (b_j P_j + b_j Q_j) - friction across the lines of action,

with M~ = M Omega^2 / C_s, D~ = D Omega / C_s, and the same forces P on the drive side and Q on the
coast side as in `gearlib.models.six_degrees`:

    P = k_m d' + H1 (C d + (k - k_m) d'),    Q = H2 (C (d - s) + (k - k_m) (d - s)').

Here d is the distance of the drive-side flanks, s is the distance d at which coast-side flanks
touch, C is the stiffness, k is the damping in contact, and k_m is the damping in free flight. H1 is
1 in drive-side contact and H2 is 1 in coast-side contact; otherwise they are 0.
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

#: Upper limit of the number of mesh periods after which the excitation repeats, for the engines.
_MAX_REPEATS = 2**50


class _Flanks(NamedTuple):
    """Row vectors of the flanks of m meshes on one side, drive or coast."""

    distance_rows: np.ndarray  #: rows that map states to flank distances, (m, state size)
    rate_rows: np.ndarray  #: rows that map states to rates of flank distances, (m, state size)
    jacobian: np.ndarray  #: derivatives of the distances by the n coordinates, shape (m, n)


class DimensionlessMatrices(NamedTuple):
    """Dimensionless matrices of a train with n coordinates, without its meshes, at a tuning."""

    mass: np.ndarray  #: shape (n, n)
    stiffness: np.ndarray  #: shape (n, n)
    damping: np.ndarray  #: shape (n, n)
    load: np.ndarray  #: shape (n,)
    nonmodal_stiffness: np.ndarray  #: terms that are not in the natural modes, shape (n, n)


def dimensionless_matrices(train: "GearTrain", tuning: float) -> DimensionlessMatrices:
    """Return the `DimensionlessMatrices` of a train without its meshes at a tuning.

    `tuning` is the mesh frequency over the natural frequency, both of the reference mesh. It
    determines the speed of the frame that rotates with the carrier, and thus the gyroscopic forces.
    The units are the static deflection, the load and the inverse natural frequency.
    """
    structure, stiffness_scale = train.structure, train.stiffness_scale
    omega = train.reference_angular_frequency
    frame_speed = tuning * float(train.speeds.frame) if train.gyroscopic else 0.0
    coriolis = structure.coriolis * (omega**2 / stiffness_scale * frame_speed)
    centrifugal = structure.centrifugal * (omega**2 / stiffness_scale * frame_speed**2)
    circulatory = structure.circulatory * (omega / stiffness_scale * frame_speed)
    centrifugal_load = structure.centrifugal_load * (omega**2 * frame_speed**2 / train.load)
    frame_stiffness = centrifugal + circulatory
    # The natural modes neglect the skew-symmetric stiffness, e.g. of journal bearings.
    skew_stiffness = (structure.stiffness - structure.stiffness.T) / (2.0 * stiffness_scale)
    return DimensionlessMatrices(
        mass=structure.mass * (omega**2 / stiffness_scale),
        stiffness=structure.stiffness / stiffness_scale + frame_stiffness,
        damping=structure.damping * (omega / stiffness_scale) + coriolis,
        load=structure.load / train.load + centrifugal_load,
        nonmodal_stiffness=frame_stiffness + skew_stiffness,
    )


def _distance_rows(train: "GearTrain") -> tuple[np.ndarray, np.ndarray]:
    """Return the row vectors that map a state to the (drive, coast) flank distances of m meshes.

    A state consists of n coordinates, n rates, the constant 1, and the cosine and sine of each of h
    excitation frequencies, so that both arrays have the shape (m, 2 n + 1 + 2 h). Distances are in
    units of the static deflection. Drive-side flanks touch if their distance is >= 0, and
    coast-side flanks if it is <= 0.
    """
    frequencies, amplitudes, constants = train.excitation
    per_metre = 1.0 / train.static_deflection
    m, n = train.structure.mesh_jacobian.shape
    drive, coast = np.zeros((2, m, 2 * n + 1 + 2 * frequencies.size))
    drive[:, :n], coast[:, :n] = train.structure.mesh_jacobian, train.coast_lines
    for side, rows in enumerate((coast, drive)):
        rows[:, 2 * n] = constants[side] * per_metre
        rows[:, 2 * n + 1 :] = amplitudes[side] * per_metre
    for j, mesh in enumerate(train.meshes):
        if math.isfinite(mesh.backlash):
            coast[j, 2 * n] += mesh.backlash * per_metre
        else:
            # With infinite backlash there are no coast-side flanks.
            coast[j] = single_mesh_system.absent_flank_row(coast.shape[1], 2 * n)
    return drive, coast


def train_system(train: "GearTrain", tuning: float, segments: Segments) -> TrainSystem:
    """Assemble the `TrainSystem` of a train, its state-space matrices for the engines.

    `tuning` is the mesh frequency over the natural frequency, both of the reference mesh.
    `segments` are the `Segments` of mesh phase with constant stiffness and sliding directions.
    """
    frequencies, jacobian = train.excitation[0], train.structure.mesh_jacobian
    matrices = dimensionless_matrices(train, tuning)
    inverse_mass, n = np.linalg.inv(matrices.mass), jacobian.shape[1]
    drive, coast = _distance_rows(train)
    # The state matrix without contact forces; the rows n to 2 n are the accelerations.
    state_size, rates = drive.shape[1], tuning * frequencies
    free_flight = single_mesh_system.oscillator_matrix(state_size, 2 * n + 1, rates)
    free_flight[:n, n : 2 * n] = np.eye(n)
    free_flight[n : 2 * n, :n] = -inverse_mass @ matrices.stiffness
    free_flight[n : 2 * n, n : 2 * n] = -inverse_mass @ matrices.damping
    free_flight[n : 2 * n, 2 * n] = inverse_mass @ matrices.load
    free_flight[n : 2 * n, 2 * n + 1 :] = inverse_mass @ (train.harmonic_forces / train.load)
    damping_scale = train.reference_angular_frequency / train.stiffness_scale
    # Rates of distances do not depend on accelerations, and so not on the damping added below.
    drive_rates, coast_rates = drive @ free_flight, coast @ free_flight
    for j, mesh in enumerate(train.meshes):
        damping_force = mesh.backlash_damping * damping_scale * drive_rates[j]
        free_flight[n : 2 * n] -= np.outer(inverse_mass @ jacobian[j], damping_force)
    drive_flanks = _Flanks(drive, drive_rates, jacobian)
    coast_flanks = _Flanks(coast, coast_rates, train.coast_lines)
    contact_forces = _contact_forces(train, segments, drive_flanks, coast_flanks, inverse_mass)
    # The series of the engines converge for steps up to MAX_NORM divided by this bound.
    norm = largest_norm(train, matrices) if train.gyroscopic else train.norm_at_rest
    highest_rate = max(norm, np.abs(frequencies * tuning).max(initial=0.0))
    return TrainSystem(
        base_matrix=free_flight,
        drive_distance_rows=drive,
        coast_distance_rows=coast,
        **contact_forces,
        starts=segments.starts,
        first_segment=segments.first_segment,
        max_step=float(MAX_NORM / highest_rate),
        harmonics=frequencies,
        tuning=tuning,
        excitation_period=min(train.repeats, _MAX_REPEATS),
    )


def _contact_forces(train, segments, drive_flanks, coast_flanks, inverse_mass) -> dict[str, Any]:
    """Return the fields of a `TrainSystem` that describe contact forces, as a dict name -> array.

    These are the input and output vectors of the forces, the index of the force for each contact
    state, segment and mesh, the stiffness, and whether it is at the lower level. `drive_flanks` and
    `coast_flanks` are `_Flanks`; `inverse_mass`, shape (n, n), is the inverse of the dimensionless
    mass matrix.
    """
    m, n = drive_flanks.jacobian.shape
    p = segments.starts.size - 1
    coast_is_low, drive_is_low = segments.is_low
    # The first axis is the contact state: coast side, no contact, drive side.
    is_low = np.stack([coast_is_low, drive_is_low, drive_is_low])
    # Segments with the same kind have the same force.
    segment_kinds = 2 * segments.is_low + (segments.sliding_signs < 0.0)
    kinds = []  # for each mesh, the kinds on the (coast, drive) side
    for mesh, mesh_kinds in zip(train.meshes, segments.force_kinds, strict=True):
        coast_kinds = [] if math.isinf(mesh.backlash) else mesh_kinds
        kinds.append((coast_kinds, mesh_kinds))
    force_count = 1 + max(len(coast) + len(drive) for coast, drive in kinds)
    state_size = drive_flanks.distance_rows.shape[1]
    force_inputs, force_outputs = np.zeros((2, m, force_count, 2, state_size))
    force_indices = np.zeros((3, p, m), dtype=np.int64)
    stiffness = np.zeros((3, p, m))
    damping_scale = train.reference_angular_frequency / train.stiffness_scale
    for j, mesh in enumerate(train.meshes):
        levels = np.array([1.0, mesh.stiffness_ratio]) * mesh.max_stiffness / train.stiffness_scale
        stiffness[:, :, j] = levels[is_low[:, :, j].astype(int)]
        added_damping = (mesh.known_damping - mesh.backlash_damping) * damping_scale
        index = 0  # Index 0 means that no force acts.
        # The sides are 0 (coast) and 1 (drive), but the order of friction coefficients is (drive,
        # coast).
        for side, flanks in ((1, drive_flanks), (0, coast_flanks)):
            for kind in kinds[j][side]:
                level, is_negative = divmod(kind, 2)
                sliding_sign = 1 - 2 * is_negative
                index += 1
                elastic_force = levels[level] * flanks.distance_rows[j]
                friction = mesh.friction[1 - side] * sliding_sign
                # Force 0 acts along the line of action, and force 1 is the friction across it.
                force_inputs[j, index, 0, n : 2 * n] = -inverse_mass @ flanks.jacobian[j]
                force_outputs[j, index, 0] = elastic_force + added_damping * flanks.rate_rows[j]
                force_inputs[j, index, 1, n : 2 * n] = (
                    -inverse_mass @ train.structure.sliding_jacobian[j]
                )
                force_outputs[j, index, 1] = friction * elastic_force
                force_indices[2 * side, segment_kinds[side, :, j] == kind, j] = index
    return {
        "force_input": force_inputs,
        "force_output": force_outputs,
        "force_index": force_indices,
        "stiffness": stiffness,
        "below_mean": is_low,
    }


def largest_norm(train: "GearTrain", matrices: DimensionlessMatrices) -> float:
    """Return an upper bound of the norms of the state matrices of a train for all contact states.

    `matrices` are the dimensionless matrices without the meshes. Coordinates are scaled to unit
    mass, and velocities are divided by the highest natural frequency. The norms of symmetric
    stiffness and damping are largest with all meshes in contact; friction and skew-symmetric parts
    are added.
    """
    structure, stiffness_scale = train.structure, train.stiffness_scale
    stiffness, damping = matrices.stiffness.copy(), matrices.damping.copy()
    friction = np.zeros_like(stiffness)
    for j, mesh in enumerate(train.meshes):
        mesh_row, mesh_stiffness = structure.mesh_jacobian[j], mesh.max_stiffness / stiffness_scale
        flanks = np.outer(mesh_row, mesh_row)
        if mesh.moving_backlash:
            coast_row = train.coast_lines[j]
            flanks = flanks + np.outer(coast_row, coast_row)
        mesh_damping = max(mesh.known_damping, mesh.backlash_damping)
        stiffness += mesh_stiffness * flanks
        damping += mesh_damping * train.reference_angular_frequency / stiffness_scale * flanks
        friction_matrix = np.abs(np.outer(structure.sliding_jacobian[j], mesh_row))
        friction += max(mesh.friction) * mesh_stiffness * friction_matrix
    root = np.linalg.inv(np.linalg.cholesky(matrices.mass))
    k = root @ stiffness @ root.T
    d = root @ damping @ root.T
    scaled_friction = root @ friction @ root.T
    frequency = math.sqrt(max(np.linalg.norm(k, 2), 1e-300))
    state_matrix = np.block([[np.zeros_like(k), frequency * np.eye(len(k))], [-k / frequency, -d]])
    # The skew-symmetric part is added, because contact could reduce the norm.
    skew = (k - k.T) / 2.0
    added_norm = (np.linalg.norm(scaled_friction, 2) + np.linalg.norm(skew, 2)) / frequency
    return float(np.linalg.norm(state_matrix, 2) + added_norm)
