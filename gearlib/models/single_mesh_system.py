"""State-space matrices of piecewise-linear models with one mesh, and their monodromy matrices."""

import math
from typing import Any, NamedTuple

import numpy as np

from gearlib.engines.codes import COAST, DRIVE
from gearlib.engines.linear.train_system import TrainSystem, system_matrix
from gearlib.engines.matrices import MAX_NORM, exponential


class Flank(NamedTuple):
    """One flank of a mesh, drive or coast side, for n state components and p stiffness segments."""

    distance_row: np.ndarray  #: row vector that maps a state to the flank distance, shape (n,)
    stiffness: np.ndarray  #: stiffness in contact in each segment, shape (p,)
    added_damping: float  #: damping in contact minus damping in free flight


def assemble_single_mesh_system(free, force_input, flanks, below_mean, starts, orders, tuning):
    """Assemble the `TrainSystem` of a model with one mesh and n state components.

    `free` is the state matrix in free flight, shape (n, n), and `force_input`, shape (n,), is the
    change of dz/dt by a unit contact force. `flanks` maps the contact state DRIVE and, if there is
    a coast side, COAST to a `Flank`. The stiffness is constant in p segments of the phase, which
    are bounded by `starts`, shape (p + 1,); `below_mean`, shape (p,), marks segments below the mean
    stiffness. `orders` are the orders of the excitation, and `tuning` is its frequency; a state
    ends with a cosine and a sine of each order.
    """
    n, p = len(free), len(below_mean)
    # A state consists of coordinates, velocities, the constant 1, cosines and sines.
    constant = n - 1 - 2 * len(orders)
    drive_row = flanks[DRIVE].distance_row
    coast_row = flanks[COAST].distance_row if COAST in flanks else absent_flank_row(n, constant)
    # The first axis is the contact state: coast side, none, drive side. Index 0 means no force.
    force_index = np.zeros((3, p, 1), np.int64)
    forces: dict = {}  # (contact state, stiffness, whether below the mean) -> (index, row vector)
    stiffness = np.zeros((3, p, 1), free.dtype)
    stiffness[:] = flanks[DRIVE].stiffness[:, None]
    for contact_state, (distance_row, levels, damping) in flanks.items():
        stiffness[contact_state + 1, :, 0] = levels
        for segment, level in enumerate(levels):
            # distance_row @ free maps a state to the rate of change of the distance.
            force_row = level * distance_row + damping * (distance_row @ free)
            # Segments with the same key share one force.
            key = (contact_state, level, below_mean[segment])
            index, _ = forces.setdefault(key, (len(forces) + 1, force_row))
            force_index[contact_state + 1, segment, 0] = index
    force_inputs, force_outputs = np.zeros((2, 1, len(forces) + 1, 2, n), free.dtype)
    for index, force_row in forces.values():
        force_inputs[0, index, 0], force_outputs[0, index, 0] = force_input, force_row
    # Scaling the velocities by the highest frequency in contact reduces the norm.
    half = constant // 2
    matrices = free + np.swapaxes(force_inputs[0], 1, 2) @ force_outputs[0]
    matrices = matrices[:, :constant, :constant]
    frequency = math.sqrt(_max_norm(matrices[:, half:, :half])) or 1.0
    scale = np.array([1.0, frequency]).repeat(half)
    norm = _max_norm(matrices * scale / scale[:, None])
    return TrainSystem(
        *(free, drive_row[None], coast_row[None]),
        *(force_inputs, force_outputs, force_index, stiffness),
        below_mean=np.repeat(np.asarray(below_mean)[None, :, None], 3, axis=0),
        starts=starts.copy(),
        first_segment=np.array([0, p]),
        max_step=MAX_NORM / max(norm, np.abs(orders * tuning).max(initial=1e-300)),
        harmonics=np.asarray(orders, float),
        tuning=tuning,
        excitation_period=1,
    )


def _max_norm(matrices: np.ndarray) -> float:
    """Return the maximum of the Frobenius norms of k matrices, shape (k, n, n)."""
    return float(np.sqrt((matrices**2).sum(axis=(1, 2)).max()))


def state_matrix_by_phase(system, contact_states, segment) -> np.ndarray:
    """Return the state matrix A of dz/dtau = A z, where tau is the mesh phase, shape (n, n).

    `system` is a `TrainSystem`, `contact_states` are the contact states of the meshes (-1 coast
    side, 0 none, 1 drive side), and `segment` is the index of a segment of constant stiffness.
    """
    force_indices = [
        system.force_index[contact_state + 1, segment, j]
        for j, contact_state in enumerate(contact_states)
    ]
    matrix = system_matrix(system, force_indices)
    # `TrainSystem` uses the time tau / tuning, so that velocities must be rescaled. A state
    # consists of coordinates, velocities, the constant 1, and a cosine and a sine of each harmonic.
    coordinate_count = (len(matrix) - 1 - 2 * system.harmonics.size) // 2
    scale = np.ones(len(matrix), matrix.dtype)
    scale[coordinate_count : 2 * coordinate_count] = system.tuning
    return matrix * scale[None, :] / scale[:, None] / system.tuning


def oscillator_matrix(n: int, start: int, frequencies: np.ndarray) -> np.ndarray:
    """Return a state matrix (n, n) that generates cosines and sines with the given frequencies.

    `frequencies` are angular frequencies. The state component `start` is the first cosine, followed
    by its sine, the next cosine and so on. All other entries of the matrix are 0.
    """
    matrix = np.zeros((n, n), np.asarray(frequencies).dtype)
    for j, frequency in enumerate(frequencies):
        cosine = start + 2 * j
        matrix[cosine, cosine + 1] = -frequency
        matrix[cosine + 1, cosine] = frequency
    return matrix


def absent_flank_row(n: int, constant: int) -> np.ndarray:
    """Return the distance row of a nonexistent coast-side flank, which never touches.

    A distance row maps a state of `n` components to the flank distance. Here the distance is the
    state component `constant`, which is always 1; contact would require a negative distance.
    """
    return np.eye(n)[constant]


def contact_monodromy(model: Any, tuning: float) -> np.ndarray:
    """Return the monodromy matrix of a model whose statically loaded flanks always touch.

    The matrix maps a state without rigid-body rotation over one period of the excitation. `tuning`
    is the frequency of the excitation over the natural frequency.
    """
    system, n = model.system(tuning), model.size
    monodromy = np.eye(n)
    contact_states = np.atleast_1d(model.loaded_sides)
    for segment, length in enumerate(np.diff(system.starts)):
        # The first n components are coordinates and velocities; the excitation is not needed.
        matrix = state_matrix_by_phase(system, contact_states, segment)[:n, :n].copy()
        # The matrix exponential is accurate for steps no longer than `system.max_step`.
        steps = math.ceil(length / tuning / system.max_step)
        transition_matrix = exponential(matrix, length / steps)
        monodromy = np.linalg.matrix_power(transition_matrix, steps) @ monodromy
    reduce, lift = model.reduction()
    return reduce @ monodromy @ lift


def contact_decay_rate(model: Any, tuning: float) -> float:
    """Return the decay rate of the slowest mode in permanent contact, per radian of phase.

    The statically loaded flanks touch with their mean stiffness over the first mesh period. `model`
    has a gear train, and `tuning` is the mesh frequency over the natural frequency. Rigid-body
    rotation is included only if damping acts on it.
    """
    system, n = model.train.system(tuning, first=0, count=1), model.size
    contact_states = np.atleast_1d(model.loaded_sides)
    matrices = [
        state_matrix_by_phase(system, contact_states, segment)[:n, :n]
        for segment in range(system.starts.size - 1)
    ]
    mean_matrix = np.average(matrices, axis=0, weights=np.diff(system.starts))
    try:
        reduce, lift = model.reduction()
    except ValueError:
        # Damping or another force acts on the rotation, which is therefore kept.
        reduce = lift = np.eye(n)
    return -float(np.linalg.eigvals(reduce @ mean_matrix @ lift).real.max())
