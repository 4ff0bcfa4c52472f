"""From a train in SI units to the `TrainSystem` of the kernels, at one tuning.

With lengths in static deflections, forces over the load, stiffness over C_s of the reference mesh
and theta = Omega t the equation of motion is

    M~ q'' + D~ q' + K~ q = f~ - sum_j (b_j P_j + b_j Q_j) - friction across the lines of action,

M~ = M Omega^2 / C_s, D~ = D Omega / C_s, with the forces of `gearlib.models.six_degrees`

    P = k_m d' + H1 (C d + (k - k_m) d'),    Q = H2 (C (d - s) + (k - k_m) (d - s)').
"""

import math
from typing import Any, NamedTuple

import numpy as np

from gearlib.engines.exponential import REACH
from gearlib.engines.linear.train_system import TrainSystem
from gearlib.models import one_mesh_system

#: Mesh periods after which nothing repeats, for the numbers of the kernels.
LONGEST = 2**50


class Scaled(NamedTuple):
    """A train without dimensions, at one tuning: n coordinates."""

    mass: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    load: np.ndarray
    frame: np.ndarray  #: what a turning frame adds to the stiffness of the springs


def scaled(train, tuning):
    """Return the `Scaled` matrices without the meshes."""
    s, unit, omega = train.structure, train.stiffness_scale, train.reference_angular_frequency
    turn = float(train.speeds[train.reference_pinion.name])
    frame = train.carrier_ratio * tuning * turn if train.gyroscopic else 0.0
    mass = s.mass * (omega**2 / unit)
    turning = s.turning * (omega**2 / unit * frame)
    centrifugal = s.centrifugal * (omega**2 / unit * frame**2)
    circulating = s.circulating * (omega / unit * frame)
    outward = s.outward * (omega**2 * frame**2 / train.load)
    return Scaled(
        mass,
        s.stiffness / unit + (centrifugal + circulating),
        s.damping * (omega / unit) + turning,
        s.load / train.load + outward,
        centrifugal + circulating,
    )


def _functionals(train):
    """Return the distances of (drive, coast) flanks by state, shape (m, 2 n + 1 + 2 h) each."""
    frequencies, waves, constants = train.excitation
    unit = 1.0 / train.static_deflection
    m, n = train.structure.lines.shape
    near, far = np.zeros((2, m, 2 * n + 1 + 2 * frequencies.size))
    for side, functional, lines in ((1, near, train.structure.lines), (0, far, train.far_lines)):
        functional[:, :n] = lines
        functional[:, 2 * n] = constants[side] * unit
        functional[:, 2 * n + 1 :] = waves[side] * unit
    for j, mesh in enumerate(train.meshes):
        if math.isfinite(mesh.backlash):
            far[j, 2 * n] += mesh.backlash * unit
        else:
            far[j] = one_mesh_system.missing_flank(far.shape[1], 2 * n)
    return near, far


def train_system(train, tuning, segments):
    """Return the `TrainSystem` of a `GearTrain` at one tuning over `Segments`."""
    frequencies, parts, lines = train.excitation[0], scaled(train, tuning), train.structure.lines
    inverse, n = np.linalg.inv(parts.mass), lines.shape[1]
    near, far = _functionals(train)
    free = one_mesh_system.harmonic_oscillators(near.shape[1], 2 * n + 1, tuning * frequencies)
    free[:n, n : 2 * n] = np.eye(n)
    free[n : 2 * n, :n] = -inverse @ parts.stiffness
    free[n : 2 * n, n : 2 * n] = -inverse @ parts.damping
    free[n : 2 * n, 2 * n] = inverse @ parts.load
    rate = train.reference_angular_frequency / train.stiffness_scale
    # The rates of distances: the accelerations have no part in them.
    speeds_near, speeds_far = near @ free, far @ free
    for j, mesh in enumerate(train.meshes):
        film = mesh.backlash_damping * rate * speeds_near[j]
        free[n : 2 * n] -= np.outer(inverse @ lines[j], film)
    flanks = (near, speeds_near, lines), (far, speeds_far, train.far_lines)
    push, grip, effect, stiffness, low = _contacts(train, segments, flanks, inverse, free)
    norm = largest_norm(train, parts) if train.gyroscopic else train.norm_at_rest
    fastest = max(norm, np.abs(frequencies * tuning).max(initial=0.0))
    return TrainSystem(
        free,
        near,
        far,
        push,
        grip,
        effect,
        stiffness,
        low,
        segments.starts,
        segments.first_segment,
        float(REACH / fastest),
        frequencies,
        tuning,
        min(train.repeats, LONGEST),
    )


def _contacts(train: Any, segments: Any, flanks: tuple, inverse: np.ndarray, free: np.ndarray):
    """Return (push, grip, effect, stiffness, low) of a `TrainSystem`.

    `flanks` are (distances, their rates, lines of action) of drive and coast side.
    """
    (m, n), p, size = flanks[0][2].shape, segments.starts.size - 1, len(free)
    low = np.stack([segments.low[0], segments.low[1], segments.low[1]])
    # Flanks are alike in segments of one level and direction of sliding; (coast, drive) of meshes.
    alike = 2 * segments.low + (segments.sense < 0.0)
    kinds = [
        ([] if math.isinf(mesh.backlash) else of_mesh, of_mesh)
        for mesh, of_mesh in zip(train.meshes, segments.kinds, strict=True)
    ]
    highest = 1 + max(len(coast) + len(drive) for coast, drive in kinds)
    push, grip = np.zeros((2, m, highest, 2, size))
    effect = np.zeros((3, p, m), dtype=np.int64)
    stiffness = np.zeros((3, p, m))
    rate = train.reference_angular_frequency / train.stiffness_scale
    for j, mesh in enumerate(train.meshes):
        levels = np.array([1.0, mesh.stiffness_ratio]) * mesh.max_stiffness / train.stiffness_scale
        stiffness[:, :, j] = levels[low[:, :, j].astype(int)]
        more = (mesh.known_damping - mesh.backlash_damping) * rate
        d = 0
        for side, (distances, speeds, lines) in zip((1, 0), flanks, strict=True):
            for kind in kinds[j][side]:
                d += 1
                elastic = levels[kind // 2] * distances[j]
                push[j, d, 0, n : 2 * n] = -inverse @ lines[j]
                grip[j, d, 0] = elastic + more * speeds[j]
                push[j, d, 1, n : 2 * n] = -inverse @ train.structure.across[j]
                grip[j, d, 1] = mesh.friction[1 - side] * (1 - 2 * (kind % 2)) * elastic
                effect[2 * side, alike[side, :, j] == kind, j] = d
    return push, grip, effect, stiffness, low


def largest_norm(train, parts):
    """Return a norm that no matrix of the train exceeds.

    It is that of coordinates in which the mass is 1, with velocities over the highest natural
    frequency: there stiffness and damping are symmetric, and all meshes in contact have the most.
    """
    structure, unit = train.structure, train.stiffness_scale
    stiffness, damping = parts.stiffness.copy(), parts.damping.copy()
    rubbing = np.zeros_like(stiffness)
    for j, mesh in enumerate(train.meshes):
        line, upper = structure.lines[j], mesh.max_stiffness / unit
        flanks = np.outer(line, line)
        if mesh.moving_backlash:
            flanks = flanks + np.outer(train.far_lines[j], train.far_lines[j])
        most = max(mesh.known_damping, mesh.backlash_damping)
        stiffness += upper * flanks
        damping += most * train.reference_angular_frequency / unit * flanks
        rubbing += max(mesh.friction) * upper * np.abs(np.outer(structure.across[j], line))
    root = np.linalg.inv(np.linalg.cholesky(parts.mass))
    k, d, f = (root @ a @ root.T for a in (stiffness, damping, rubbing))
    highest = math.sqrt(max(np.linalg.norm(k, 2), 1e-300))
    a = np.block([[np.zeros_like(k), highest * np.eye(len(k))], [-k / highest, -d]])
    return float(np.linalg.norm(a, 2) + np.linalg.norm(f, 2) / highest)
