"""The matrices of a gear train that its FMU needs, in SI units, by their names in C."""

import math
from typing import Any

import numpy as np

from gearlib import checks
from gearlib.models import acceleration
from gearlib.models.trains import waves

#: Smaller fractions of a motion are rounding errors.
_ROUNDING = 1e-9


def check_train(train: Any, prescribed_speed: bool) -> None:
    """Raise ValueError for a `GearTrain` that an FMU cannot be."""
    for mesh in train.meshes:
        owner = f"mesh {mesh.name}"
        checks.require(not any(mesh.friction), "friction", mesh.friction, "0 in an FMU", owner)
        checks.require_damping(mesh.material_damping, f" of {owner}")
    turns = train.gyroscopic and train.speeds.frame != 0
    allowed = "False in an FMU whose speed is not prescribed, because its forces change with it"
    checks.require(prescribed_speed or not turns, "gyroscopic", True, allowed)
    if not prescribed_speed:
        allowed = "True, because the train has no free rotation that torques could turn"
        checks.require(_rotates_freely(train), "prescribed_speed", False, allowed)


def _rotates_freely(train: Any) -> bool:
    """Return whether no spring resists the rigid rotation of a train.

    A single free motion is the rotation, even if bodies on torsional supports stand still in it.
    """
    free, names = train.free_motions, train.names["body"]
    if free.shape[1] == 0:
        return False
    motion, speeds = acceleration.rigid_motion(train, names)
    remainder = motion - free @ (free.T @ (train.structure.mass @ motion))
    turns = np.abs(remainder).max() <= _ROUNDING * np.abs(motion).max() > 0.0
    if free.shape[1] == 1:
        return turns
    radii = np.array([body.base_radius for body in train.bodies])
    rates = train.structure.motions[:, 2] @ motion / radii
    return turns and np.abs(rates - speeds).max() <= _ROUNDING * np.abs(speeds).max()


def model_data(train: Any, prescribed_speed: bool, speed: float) -> dict[str, Any]:
    """Return the constants of the template, name in C -> array, float or int.

    `speed` is that of the reference pinion at the start, in rpm.
    """
    structure, names = train.structure, train.names["body"]
    inverse_mass = np.linalg.inv(structure.mass)
    lines = np.stack([train.coast_lines, structure.lines])
    radii = np.array([body.base_radius for body in train.bodies])
    rotations = structure.motions[:, 2] / radii[:, None]
    pinion_rate = float(train.speeds.in_housing[train.reference_pinion.name])
    frequencies, amplitudes, constants = train.excitation
    padded = np.zeros((2, len(train.meshes), 2 * max(frequencies.size, 1)))
    padded[..., : 2 * frequencies.size] = amplitudes
    forces = np.zeros((len(inverse_mass), padded.shape[2]))
    forces[:, : 2 * frequencies.size] = inverse_mass @ train.harmonic_forces
    gap_varies = (lines[0] != lines[1]).any(axis=1) | (padded[0] != padded[1]).any(axis=1)
    backlashes = np.array([mesh.backlash for mesh in train.meshes])
    oil_damping = np.array([mesh.backlash_damping for mesh in train.meshes])
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
        "NORM": _norms(train),
        "RATIO": np.array([float(ratio) for ratio in train.frequency_ratios]),
        "STIFFNESS": inverse_mass @ structure.stiffness,
        "DAMPING": inverse_mass @ structure.damping,
        "FRAME_STIFFNESS": inverse_mass @ frame,
        "FRAME_DAMPING": inverse_mass @ structure.coriolis,
        "LOAD": inverse_mass @ (np.zeros(n) if train.matrices is None else train.matrices.load),
        "FRAME_LOAD": inverse_mass @ structure.centrifugal_load,
        "LINE": lines,
        "LINE_INPUT": lines @ inverse_mass,
        "OIL_DAMPING": oil_damping,
        "ADDED_DAMPING": damping - oil_damping,
        "HARMONIC": np.append(frequencies, [] if frequencies.size else [0.0]),
        "AMPLITUDE": padded,
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
        **_rotation(train, rotations, prescribed_speed),
        **_levels(train),
    }


def _norms(train: Any) -> np.ndarray:
    """Return bounds of the rates of all motions, rad/s, and their growth with the frame speed.

    They are the coefficients of a polynomial of the speed of the turning frame, rad/s, shape (3,).
    """
    structure = train.structure
    omega = train.reference_angular_frequency
    at_rest = (train.replace(gyroscopic=False) if train.gyroscopic else train).norm_at_rest
    root = np.linalg.inv(np.linalg.cholesky(structure.mass))
    stiffness = structure.stiffness.copy()
    for mesh, line in zip(train.meshes, structure.lines, strict=True):
        stiffness += mesh.max_stiffness * np.outer(line, line)
    skew = root @ (stiffness - stiffness.T) @ root.T / 2.0
    size = np.linalg.norm(root @ stiffness @ root.T, 2) + np.linalg.norm(skew, 2)
    frequency = math.sqrt(size)
    coriolis, circulatory, centrifugal = (
        float(np.linalg.norm(root @ matrix @ root.T, 2))
        for matrix in (structure.coriolis, structure.circulatory, structure.centrifugal)
    )
    growth = coriolis + circulatory / frequency
    return np.array([at_rest * omega, growth, centrifugal / frequency])


def _rotation(train: Any, rotations: np.ndarray, prescribed_speed: bool) -> dict[str, Any]:
    """Return the constants of the rigid rotation; `rotations` are rows of body angles, (b, n)."""
    names = train.names["body"]
    motion, speeds = acceleration.rigid_motion(train, names)
    mass, has_driver = train.structure.mass, prescribed_speed and train.free_motions.size > 0
    rates = rotations @ motion
    driver, shares = -1, np.zeros(len(names))
    number = names.index(acceleration.default_driver(train, speeds))
    if has_driver and abs(rates[number]) > _ROUNDING * np.abs(rates).max():
        driver, shares = number, -rates / rates[number]
    body_rates = rates if _rotates_freely(train) else np.array(speeds)
    return {
        "RIGID": motion,
        "TORQUE_RATE": rates / (motion @ mass @ motion),
        "DRIVER": driver,
        "DRIVER_SHARE": shares,
        "BODY_RATE": body_rates,
    }


def _levels(train: Any) -> dict[str, np.ndarray]:
    """Return the stiffness levels of coast and drive side: their number, phases and values."""
    counts = np.ones((2, len(train.meshes)), dtype=int)
    phases, values = np.zeros((2, 2, len(train.meshes), 2))
    for j, mesh in enumerate(train.meshes):
        middles = train.coast_phases[mesh.name], train.phases[mesh.name]
        stiffness = mesh.max_stiffness * np.array([1.0, mesh.stiffness_ratio])
        for side, middle in enumerate(middles):
            if not mesh.varies:
                values[side, j] = stiffness[int(waves.at_lower_level(mesh, middles, [0.0])[0, 0])]
                continue
            half_length = (mesh.contact_ratio - 1.0) / 2.0
            starts = np.mod([middle - half_length, middle + half_length], 1.0)
            order = np.argsort(starts)
            counts[side, j], phases[side, j], values[side, j] = 2, starts[order], stiffness[order]
    return {"L": 2, "LEVELS": counts, "LEVEL_PHASE": phases, "LEVEL_VALUE": values}


def bearings(train: Any) -> tuple[list[tuple[str, str]], np.ndarray]:
    """Return names (body, axis) and rows of the forces of the bodies on their bearings.

    Rows, shape (r, 3 n + m + 1), are factors of coordinates, rates, accelerations, m mesh forces
    and the acceleration of the phase. The force in a rigid bearing balances the others.
    """
    structure, (m, n) = train.structure, train.structure.lines.shape
    if train.matrices is not None:  # Their bearings are parts of the matrices.
        return [], np.zeros((0, 3 * n + m + 1))
    motions = dict(zip(train.names["body"], structure.motions, strict=True))
    rigid = acceleration.rigid_motion(train, train.names["body"])[0]
    names, rows = [], []
    for body in train.bodies:
        turn = np.eye(2)
        deflections = motions[body.name][:2]
        if body.carrier:
            c, s = math.cos(body.angle), math.sin(body.angle)
            turn = np.array([[c, s], [-s, c]])  # to the radial and tangential axis
            pin = motions[body.carrier]
            deflections = turn @ (deflections - pin[:2]) - [np.zeros(n), pin[2]]
        others = np.zeros((2, 3 * n + m + 1))
        inertia = (body.mass or 0.0) * motions[body.name][:2]
        others[:, 2 * n : 3 * n], others[:, -1] = -inertia, -inertia @ rigid
        for j, mesh in enumerate(train.meshes):
            gears = (mesh.pinion, mesh.wheel)
            if body.name in gears:
                index = gears.index(body.name)
                others[:, 3 * n + j] = -structure.line_vectors[j, index]
        for shaft in train.shafts:
            if body.name in shaft.bodies:
                other = shaft.bodies[1 - shaft.bodies.index(body.name)]
                bending = motions[body.name][:2] - motions[other][:2]
                others[:, :n] -= shaft.bending_stiffness * bending
                others[:, n : 2 * n] -= shaft.bending_damping * bending
        others = turn @ others
        supports = zip(body.support_stiffness, body.support_damping, strict=True)
        for axis, (stiffness, damping) in enumerate(supports):
            row = others[axis]
            if math.isfinite(stiffness):
                row = np.zeros(row.size)
                row[:n], row[n : 2 * n] = stiffness * deflections[axis], damping * deflections[axis]
            if row.any():
                names.append(
                    (body.name, ("radial", "tangential")[axis] if body.carrier else "xy"[axis])
                )
                rows.append(row)
    return names, np.array(rows).reshape(len(rows), 3 * n + m + 1)
