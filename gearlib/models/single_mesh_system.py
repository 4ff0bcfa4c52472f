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
    """Return the `TrainSystem` of one mesh for a state z of n components and p stiffness segments.

    `free`, shape (n, n), is the matrix of dz/dt in free flight, and a unit contact force adds
    `force_input`, shape (n,), to dz/dt. `flanks` maps the contact code DRIVE (drive side) and, if
    there is a coast side, COAST to a `Flank`. `below_mean`, shape (p,), marks segments below the
    mean stiffness, and `starts`, shape (p + 1,), are their boundaries in phase. `orders` are those
    of the excitation, of which z ends with a cosine and a sine each; `tuning` is its frequency.
    """
    n, p = len(free), len(below_mean)
    constant = n - 1 - 2 * len(orders)  # index of the component of z that is always 1
    drive_line = flanks[DRIVE].distance_row
    coast_line = flanks[COAST].distance_row if COAST in flanks else absent_flank(n, constant)
    force_index, forces = np.zeros((3, p, 1), np.int64), {}
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
    """Return the largest Frobenius norm of matrices, shape (k, n, n)."""
    return float(np.sqrt((matrices**2).sum(axis=(1, 2)).max()))


def state_matrix_by_phase(system, contact_codes, segment) -> np.ndarray:
    """Return the state matrix A of dz/dtau = A z with the mesh phase tau, shape (n, n).

    `contact_codes` holds the contact state of each mesh, -1, 0 or 1; `segment` is the number of
    the stiffness segment. The velocities in z are by phase, unlike those of the `TrainSystem`,
    which are by the time tau / tuning.
    """
    # Indices of the contact force of each mesh.
    effects = [system.effect[code + 1, segment, j] for j, code in enumerate(contact_codes)]
    matrix = np.empty_like(system.base_matrix)
    fill_system_matrix(system, np.array(effects, np.int64), matrix)
    half = (len(matrix) - 1 - 2 * system.harmonics.size) // 2  # number of coordinates
    scale = np.ones(len(matrix), matrix.dtype)
    scale[half : 2 * half] = system.tuning
    return matrix * scale[None, :] / scale[:, None] / system.tuning


def harmonic_oscillators(n: int, first: int, frequencies: np.ndarray) -> np.ndarray:
    """Return a state matrix (n, n) for cosines and sines of given angular frequencies.

    State component `first` is the first cosine, followed by its sine, the next cosine and so on.
    """
    matrix = np.zeros((n, n), np.asarray(frequencies).dtype)
    for j, frequency in enumerate(frequencies):
        cosine = first + 2 * j
        matrix[cosine, cosine + 1], matrix[cosine + 1, cosine] = -frequency, frequency
    return matrix


def absent_flank(n: int, constant: int) -> np.ndarray:
    """Return the row vector, (n,), that maps a state to the distance 1, for a missing flank.

    `constant` is the index of the state component that is always 1.
    """
    return np.eye(n)[constant]


def contact_monodromy(model: Any, tuning: float) -> np.ndarray:
    """Return the monodromy matrix of permanent contact over the excitation's period.

    The flanks that carry the static load are in contact. `tuning` is the excitation over the
    natural frequency. The free rotation of the model is removed from the states.
    """
    system, n, period_map = model.system(tuning), model.size, np.eye(model.size)
    contact_codes = np.atleast_1d(model.loaded_sides)
    for segment, length in enumerate(np.diff(system.starts)):
        matrix = state_matrix_by_phase(system, contact_codes, segment)[:n, :n].copy()
        # Steps no longer than `system.max_step` keep the matrix exponential accurate.
        steps = math.ceil(length / tuning / system.max_step)
        step_map = exponential(matrix, length / steps)
        period_map = np.linalg.matrix_power(step_map, steps) @ period_map
    reduce, lift = model.reduction()
    return reduce @ period_map @ lift


def contact_decay_rate(model: Any, tuning: float) -> float:
    """Return the rate by phase at which the slowest mode decays in permanent contact.

    The flanks that carry the static load are in contact, with their mean stiffness over the first
    mesh period. The free rotation counts only if damping acts on it.
    """
    system, n = model.train.system(tuning, 0, 1), model.size
    contact_codes = np.atleast_1d(model.loaded_sides)
    matrices = [
        state_matrix_by_phase(system, contact_codes, segment)[:n, :n]
        for segment in range(system.starts.size - 1)
    ]
    mean_matrix = np.average(matrices, axis=0, weights=np.diff(system.starts))
    try:
        reduce, lift = model.reduction()
    except ValueError:
        reduce = lift = np.eye(n)
    return -float(np.linalg.eigvals(reduce @ mean_matrix @ lift).real.max())
