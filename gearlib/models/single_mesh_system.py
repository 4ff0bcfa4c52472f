"""State-space matrices of piecewise-linear models with one mesh, and maps over a mesh period."""

import math
from typing import Any, NamedTuple

import numpy as np

from gearlib.engines.codes import COAST, DRIVE
from gearlib.engines.linear.train_system import TrainSystem, fill_system_matrix
from gearlib.engines.matrices import MAX_NORM, exponential


class Flank(NamedTuple):
    """One side of the teeth of a mesh, for a state z of n components and p stiffness segments."""

    distance_row: np.ndarray  #: row vector that maps z to the distance of the flanks, shape (n,)
    stiffness: np.ndarray  #: stiffness in contact in each segment, shape (p,)
    added_damping: float  #: damping in contact minus damping in free flight


def single_mesh_system(free, force_input, flanks, below_mean, starts, orders, tuning):
    """Return the matrices of one mesh, a `TrainSystem`, for a state z of n components.

    The stiffness is constant in p segments of the phase. In free flight dz/dt = free z, with `free`
    of shape (n, n); a unit contact force adds `force_input`, shape (n,), to dz/dt. `flanks` maps
    the contact code DRIVE and, if there is a coast side, COAST to a `Flank`. `below_mean`, shape
    (p,), marks segments below the mean stiffness, and `starts`, shape (p + 1,), bound the segments.
    `orders` are those of the excitation, and `tuning` is its frequency; z ends with a cosine and a
    sine of each.
    """
    n, p = len(free), len(below_mean)
    # The component of z with this index is always 1; before it are coordinates and velocities.
    constant = n - 1 - 2 * len(orders)
    drive_line = flanks[DRIVE].distance_row
    coast_line = flanks[COAST].distance_row if COAST in flanks else absent_flank(n, constant)
    # The first axis is the contact: coast side, none, drive side. Force 0 is no contact.
    force_index = np.zeros((3, p, 1), np.int64)
    forces: dict = {}  # (contact code, stiffness, side of the mean) -> (index, row vector)
    stiffness = np.zeros((3, p, 1), free.dtype)
    stiffness[:] = flanks[DRIVE].stiffness[:, None]
    for code, (distance_row, levels, damping) in flanks.items():
        stiffness[code + 1, :, 0] = levels
        for segment, level in enumerate(levels):
            # distance_row @ free gives the rate of the distance, without accelerations.
            force_row = level * distance_row + damping * (distance_row @ free)
            # Segments with the same contact, stiffness and side of the mean share one force.
            key = (code, level, below_mean[segment])
            index, _ = forces.setdefault(key, (len(forces) + 1, force_row))
            force_index[code + 1, segment, 0] = index
    force_inputs, force_outputs = np.zeros((2, 1, len(forces) + 1, 2, n), free.dtype)
    for index, force_row in forces.values():
        force_inputs[0, index, 0], force_outputs[0, index, 0] = force_input, force_row
    # Scaling velocities by the highest frequency of all contacts makes the norm small.
    half = constant // 2
    matrices = free + np.swapaxes(force_inputs[0], 1, 2) @ force_outputs[0]
    matrices = matrices[:, :constant, :constant]
    frequency = math.sqrt(_max_norm(matrices[:, half:, :half])) or 1.0
    scale = np.array([1.0, frequency]).repeat(half)
    norm = _max_norm(matrices * scale / scale[:, None])
    return TrainSystem(
        *(free, drive_line[None], coast_line[None]),
        *(force_inputs, force_outputs, force_index, stiffness),
        below_mean=np.repeat(np.asarray(below_mean)[None, :, None], 3, axis=0),
        starts=starts.copy(),
        first_segment=np.array([0, p]),
        max_step=MAX_NORM / max(norm, np.abs(orders * tuning).max(initial=1e-300)),
        harmonics=np.asarray(orders, float),
        tuning=tuning,
        repeats=1,
    )


def _max_norm(matrices: np.ndarray) -> float:
    """Return the largest Frobenius norm of k matrices, shape (k, n, n)."""
    return float(np.sqrt((matrices**2).sum(axis=(1, 2)).max()))


def state_matrix_by_phase(system, contact_codes, segment) -> np.ndarray:
    """Return the state matrix A of dz/dtau = A z, with the mesh phase tau, shape (n, n).

    `system` is a `TrainSystem`; `contact_codes` holds the contact of each mesh (-1 coast side, 0
    none, 1 drive side), and `segment` is the index of a segment of constant stiffness. The
    `TrainSystem` uses the time tau / tuning, so that velocities, here derivatives by phase, are
    rescaled.
    """
    # `effect` has the index of the contact force of each mesh, in a contact and a segment.
    force_indices = [system.effect[code + 1, segment, j] for j, code in enumerate(contact_codes)]
    matrix = np.empty_like(system.base_matrix)
    fill_system_matrix(system, np.array(force_indices, np.int64), matrix)
    # z holds coordinates, velocities, the constant 1, and a cosine and a sine of each harmonic.
    coordinate_count = (len(matrix) - 1 - 2 * system.harmonics.size) // 2
    scale = np.ones(len(matrix), matrix.dtype)
    scale[coordinate_count : 2 * coordinate_count] = system.tuning
    return matrix * scale[None, :] / scale[:, None] / system.tuning


def harmonic_oscillators(n: int, start: int, frequencies: np.ndarray) -> np.ndarray:
    """Return a state matrix (n, n) whose states contain cosines and sines of time.

    They have the angular `frequencies`. The state component with the index `start` is the first
    cosine, followed by its sine, the next cosine and so on. The other entries of the matrix are 0.
    """
    matrix = np.zeros((n, n), np.asarray(frequencies).dtype)
    for j, frequency in enumerate(frequencies):
        cosine = start + 2 * j
        matrix[cosine, cosine + 1] = -frequency
        matrix[cosine + 1, cosine] = frequency
    return matrix


def absent_flank(n: int, constant: int) -> np.ndarray:
    """Return the distance row of a flank that does not exist, so that it never touches.

    A distance row maps a state of `n` components to the distance of the flanks. This one returns
    the component with the index `constant`, which is always 1.
    """
    return np.eye(n)[constant]


def contact_monodromy(model: Any, tuning: float) -> np.ndarray:
    """Return the monodromy matrix of a model in permanent contact.

    The matrix maps the state, without rigid-body rotation, over one period of the excitation. The
    flanks that carry the static load touch. `tuning` is the frequency of the excitation over the
    natural frequency.
    """
    system, n = model.system(tuning), model.size
    period_map = np.eye(n)
    contact_codes = np.atleast_1d(model.loaded_sides)
    for segment, length in enumerate(np.diff(system.starts)):
        # The first n components are coordinates and velocities, without the excitation.
        matrix = state_matrix_by_phase(system, contact_codes, segment)[:n, :n].copy()
        # The matrix exponential is accurate for steps no longer than `system.max_step`.
        steps = math.ceil(length / tuning / system.max_step)
        step_map = exponential(matrix, length / steps)
        period_map = np.linalg.matrix_power(step_map, steps) @ period_map
    reduce, lift = model.reduction()
    return reduce @ period_map @ lift


def contact_decay_rate(model: Any, tuning: float) -> float:
    """Return the decay rate of the slowest mode in permanent contact, per radian of phase.

    `model` has a gear train, and `tuning` is the mesh frequency over the natural frequency. The
    flanks that carry the static load touch, with their mean stiffness over the first mesh period.
    Rigid-body rotation counts only if damping acts on it.
    """
    system, n = model.train.system(tuning, 0, 1), model.size  # one period, from period 0 on
    contact_codes = np.atleast_1d(model.loaded_sides)
    matrices = [
        state_matrix_by_phase(system, contact_codes, segment)[:n, :n]
        for segment in range(system.starts.size - 1)
    ]
    # The matrices of the segments are weighted by the lengths of the segments.
    mean_matrix = np.average(matrices, axis=0, weights=np.diff(system.starts))
    try:
        reduce, lift = model.reduction()
    except ValueError:
        # Damping or another force acts on the rotation, so that it is part of the motion.
        reduce = lift = np.eye(n)
    return -float(np.linalg.eigvals(reduce @ mean_matrix @ lift).real.max())
