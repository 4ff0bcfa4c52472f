"""Matrices of a gear train in SI units, as constants of the C source of its FMU."""

import math
from typing import Any

import numpy as np

from gearlib import checks
from gearlib.models import acceleration
from gearlib.models.trains import waves

#: Components of a motion below this fraction are rounding errors.
_ROUNDING = 1e-9


def check_fmu_train(train: Any, prescribed_speed: bool) -> None:
    """Raise ValueError if a `GearTrain` cannot be written as an FMU.

    `prescribed_speed` is True if the speed is an input of the FMU. Friction is not allowed, every
    mesh requires damping, and without a prescribed speed the train must be able to rotate freely.
    """
    for mesh in train.meshes:
        owner = f"mesh {mesh.name}"
        checks.require(not any(mesh.friction), "friction", mesh.friction, "0 in an FMU", owner)
        checks.require_damping(mesh.material_damping, f" of {owner}")
    frame_rotates = train.gyroscopic and train.speeds.frame != 0
    allowed = "False in an FMU whose speed is not prescribed, because its forces change with it"
    checks.require(prescribed_speed or not frame_rotates, "gyroscopic", True, allowed)
    if not prescribed_speed:
        allowed = "True, because the train has no rigid-body rotation that torques could drive"
        checks.require(_can_rotate_freely(train), "prescribed_speed", False, allowed)


def _can_rotate_freely(train: Any) -> bool:
    """Return whether no spring resists the rigid-body rotation of a train.

    The rotation must be a combination of the free motions, which no spring resists. If there are
    several free motions, the angles of all bodies must follow the rotation; if there is only one,
    bodies on torsional supports may be at rest.
    """
    free_motions, names = train.free_motions, train.names["body"]
    if free_motions.shape[1] == 0:
        return False
    motion, speeds = acceleration.rigid_motion(train, names)
    # Subtract the projection of the rotation on the mass-normalised free motions.
    remainder = motion - free_motions @ (free_motions.T @ (train.structure.mass @ motion))
    largest_motion = np.abs(motion).max()
    is_free = largest_motion > 0.0 and np.abs(remainder).max() <= _ROUNDING * largest_motion
    if free_motions.shape[1] == 1:
        return is_free
    radii = np.array([body.base_radius for body in train.bodies])
    rates = train.structure.motions[:, 2] @ motion / radii
    return is_free and np.abs(rates - speeds).max() <= _ROUNDING * np.abs(speeds).max()


def train_constants(train: Any, prescribed_speed: bool, speed: float) -> dict[str, Any]:
    """Return the constants of the C template as {name in C: array, float or int}.

    `prescribed_speed` is True if the speed is an input of the FMU. `speed` is the initial speed of
    the reference pinion in rpm, >= 0.
    """
    structure, names = train.structure, train.names["body"]
    inverse_mass = np.linalg.inv(structure.mass)
    mesh_jacobians = np.stack([train.coast_lines, structure.mesh_jacobian])
    radii = np.array([body.base_radius for body in train.bodies])
    rotations = structure.motions[:, 2] / radii[:, None]
    pinion_rate = float(train.speeds.in_housing[train.reference_pinion.name])
    frequencies, amplitudes, constants = train.excitation
    padded_amplitudes = np.zeros((2, len(train.meshes), 2 * max(frequencies.size, 1)))
    padded_amplitudes[..., : 2 * frequencies.size] = amplitudes
    forces = np.zeros((len(inverse_mass), padded_amplitudes.shape[2]))
    forces[:, : 2 * frequencies.size] = inverse_mass @ train.harmonic_forces
    jacobian_varies = (mesh_jacobians[0] != mesh_jacobians[1]).any(axis=1)
    gap_varies = jacobian_varies | (padded_amplitudes[0] != padded_amplitudes[1]).any(axis=1)
    backlashes = np.array([mesh.backlash for mesh in train.meshes])
    backlash_damping = np.array([mesh.backlash_damping for mesh in train.meshes])
    damping = np.array([mesh.known_damping for mesh in train.meshes])
    has_coast = np.isfinite(backlashes)
    n, state = len(structure.coordinates), np.array(train.static_state(1.0))
    start = state[:n] if state.size == 2 * n else np.zeros(n)
    frame_rate = float(train.speeds.frame) if train.gyroscopic else 0.0
    frame = np.stack([structure.circulatory, structure.centrifugal])
    return {
        "N": n,
        "M": len(train.meshes),
        "B": len(names),
        "H": frequencies.size,
        "H1": max(frequencies.size, 1),
        "PRESCRIBED": int(prescribed_speed),
        "GYROSCOPIC": int(frame_rate != 0.0),
        "PINION_RATE": pinion_rate,
        "FRAME_RATE": frame_rate,
        "START_RATE": speed * math.pi / 30.0 / abs(pinion_rate),
        "HIGHEST_HARMONIC": float(frequencies.max(initial=0.0)),
        "NORM": _rate_bound(train),
        "RATIO": np.array([float(ratio) for ratio in train.frequency_ratios]),
        "STIFFNESS": inverse_mass @ structure.stiffness,
        "DAMPING": inverse_mass @ structure.damping,
        "FRAME_STIFFNESS": inverse_mass @ frame,
        "FRAME_DAMPING": inverse_mass @ structure.coriolis,
        "LOAD": inverse_mass @ (np.zeros(n) if train.matrices is None else train.matrices.load),
        "FRAME_LOAD": inverse_mass @ structure.centrifugal_load,
        "LINE": mesh_jacobians,
        "LINE_INPUT": mesh_jacobians @ inverse_mass,
        "OIL_DAMPING": backlash_damping,
        "ADDED_DAMPING": damping - backlash_damping,
        "HARMONIC": np.append(frequencies, [] if frequencies.size else [0.0]),
        "AMPLITUDE": padded_amplitudes,
        "FORCE": forces,
        "CONSTANT": constants,
        "HAS_COAST": has_coast.astype(int),
        "CONSTANT_GAP": (~gap_varies).astype(int),
        "GAP": constants[0] - constants[1],
        "TORQUE": rotations @ inverse_mass,
        "ROTATION": rotations,
        "START_Q": start * train.static_deflection,
        "START_TORQUE": np.array([body.torque for body in train.bodies]),
        "START_BACKLASH": np.where(has_coast, backlashes, 0.0),
        **_rotation_constants(train, rotations, prescribed_speed),
        **_stiffness_level_constants(train),
    }


def _rate_bound(train: Any) -> np.ndarray:
    """Return an upper bound of the rates of all motions in rad/s, a polynomial in the frame speed.

    The result, shape (3,), contains the coefficients of the powers 0, 1 and 2 of the speed in rad/s
    of the frame that rotates with the carrier. The bound limits the step length of the FMU.
    """
    structure = train.structure
    omega = train.reference_angular_frequency
    at_rest = (train.replace(gyroscopic=False) if train.gyroscopic else train).norm_at_rest
    root = np.linalg.inv(np.linalg.cholesky(structure.mass))
    stiffness = structure.stiffness.copy()
    for mesh, line in zip(train.meshes, structure.mesh_jacobian, strict=True):
        stiffness += mesh.max_stiffness * np.outer(line, line)
    skew = root @ (stiffness - stiffness.T) @ root.T / 2.0
    stiffness_norm = np.linalg.norm(root @ stiffness @ root.T, 2) + np.linalg.norm(skew, 2)
    frequency = math.sqrt(stiffness_norm)
    coriolis_norm = float(np.linalg.norm(root @ structure.coriolis @ root.T, 2))
    circulatory_norm = float(np.linalg.norm(root @ structure.circulatory @ root.T, 2))
    centrifugal_norm = float(np.linalg.norm(root @ structure.centrifugal @ root.T, 2))
    # Coriolis forces act like damping. The other forces of the rotating frame act like a stiffness,
    # whose contribution is divided by the highest natural frequency.
    linear = coriolis_norm + circulatory_norm / frequency
    return np.array([at_rest * omega, linear, centrifugal_norm / frequency])


def _rotation_constants(
    train: Any, rotations: np.ndarray, prescribed_speed: bool
) -> dict[str, Any]:
    """Return the constants of the rigid-body rotation as {name in C: value}.

    The driver is the index of the body whose torque maintains a prescribed speed, or -1 if there is
    none. Its torque is a weighted sum of all other torques; the weights are the shares.
    `rotations`, shape (b, n), maps the n coordinates to the angles of b bodies in rad.
    """
    names = train.names["body"]
    motion, speeds = acceleration.rigid_motion(train, names)
    mass = train.structure.mass
    rates = rotations @ motion
    driver, shares = -1, np.zeros(len(names))
    candidate = names.index(acceleration.default_driver(train, speeds))
    has_driver = prescribed_speed and train.free_motions.size > 0
    if has_driver and abs(rates[candidate]) > _ROUNDING * np.abs(rates).max():
        # The torque of the driver is such that the total power in the rotation is zero.
        driver, shares = candidate, -rates / rates[candidate]
    body_rates = rates if _can_rotate_freely(train) else np.array(speeds)
    return {
        "RIGID": motion,
        "TORQUE_RATE": rates / (motion @ mass @ motion),
        "DRIVER": driver,
        "DRIVER_SHARE": shares,
        "BODY_RATE": body_rates,
    }


def _stiffness_level_constants(train: Any) -> dict[str, np.ndarray]:
    """Return the stiffness levels of the meshes as {name in C: array}.

    The arrays contain, for each side (coast, drive) and mesh, the number of levels (1 or 2), the
    phases in mesh periods at which the levels start, in ascending order, and the stiffnesses in
    N/m.
    """
    counts = np.ones((2, len(train.meshes)), dtype=int)
    phases, values = np.zeros((2, 2, len(train.meshes), 2))
    for j, mesh in enumerate(train.meshes):
        # Phases of the midpoints of the upper level, whose length is the contact ratio minus 1.
        middles = train.coast_phases[mesh.name], train.phases[mesh.name]
        stiffness = mesh.max_stiffness * np.array([1.0, mesh.stiffness_ratio])
        for side, middle in enumerate(middles):
            if not mesh.varies:
                values[side, j] = stiffness[
                    int(waves.is_at_lower_level(mesh, middles, [0.0])[0, 0])
                ]
                continue
            half_length = (mesh.contact_ratio - 1.0) / 2.0
            starts = np.mod([middle - half_length, middle + half_length], 1.0)
            order = np.argsort(starts)
            counts[side, j] = 2
            phases[side, j] = starts[order]
            values[side, j] = stiffness[order]
    return {"L": 2, "LEVELS": counts, "LEVEL_PHASE": phases, "LEVEL_VALUE": values}


def bearing_force_rows(train: Any) -> tuple[list[tuple[str, str]], np.ndarray]:
    """Return the rows of the matrix that computes the forces of the bodies on their bearings.

    Return (names, rows). A name is (name of the body, direction "x", "y", "radial" or
    "tangential"). The product of a row, of length 3 n + m + 1, with the vector of n coordinates, n
    velocities, n accelerations, m mesh forces and the acceleration of the mesh phase is a force in
    N. The force of an elastic bearing follows from its deflection, and a rigid bearing balances all
    other forces. Forces that are always 0 are omitted.
    """
    structure = train.structure
    m, n = structure.mesh_jacobian.shape
    if train.matrices is not None:  # the matrices include the bearings
        return [], np.zeros((0, 3 * n + m + 1))
    motions = dict(zip(train.names["body"], structure.motions, strict=True))
    rigid_motion = acceleration.rigid_motion(train, train.names["body"])[0]
    names, rows = [], []
    for body in train.bodies:
        axes, rotation = ("x", "y"), np.eye(2)
        deflections = motions[body.name][:2]
        if body.carrier:
            cosine, sine = math.cos(body.angle), math.sin(body.angle)
            axes, rotation = ("radial", "tangential"), np.array([[cosine, sine], [-sine, cosine]])
            pin = motions[body.carrier]
            deflections = rotation @ (deflections - pin[:2]) - [np.zeros(n), pin[2]]
        # Sum of all other forces on the body in x and y, including its inertia forces.
        forces = np.zeros((2, 3 * n + m + 1))
        inertia = (body.mass or 0.0) * motions[body.name][:2]
        forces[:, 2 * n : 3 * n], forces[:, -1] = -inertia, -inertia @ rigid_motion
        for j, mesh in enumerate(train.meshes):
            gears = (mesh.pinion, mesh.wheel)
            if body.name in gears:
                forces[:, 3 * n + j] = -structure.line_vectors[j, gears.index(body.name)]
        for shaft in train.shafts:
            if body.name in shaft.bodies:
                other_name = shaft.bodies[1 - shaft.bodies.index(body.name)]
                bending = motions[body.name][:2] - motions[other_name][:2]
                forces[:, :n] -= shaft.bending_stiffness * bending
                forces[:, n : 2 * n] -= shaft.bending_damping * bending
        forces = rotation @ forces
        for i, axis in enumerate(axes):
            row = forces[i]
            if math.isfinite(body.support_stiffness[i]):
                row = np.zeros(row.size)
                row[:n] = body.support_stiffness[i] * deflections[i]
                row[n : 2 * n] = body.support_damping[i] * deflections[i]
            if row.any():
                names.append((body.name, axis))
                rows.append(row)
    return names, np.array(rows).reshape(len(rows), 3 * n + m + 1)
