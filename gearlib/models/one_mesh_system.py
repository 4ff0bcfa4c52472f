"""State-space matrices of piecewise-linear models with one mesh, and maps over a mesh period."""

import math

import numpy as np

from gearlib.engines.codes import NORMAL
from gearlib.engines.exponential import MAX_NORM, exponential
from gearlib.engines.linear.train_system import TrainSystem, matrix_of


def one_mesh(free, force_input, flanks, low, starts, orders, tuning):
    """Return the `TrainSystem` of one mesh for a state of n components and p stiffness segments.

    `free`, shape (n, n), is the matrix of dz/dtheta in the backlash; `force_input`, shape (n,), is
    the change of dz/dtheta by a unit contact force. `flanks` maps NORMAL and, if there is a coast
    flank, INVERSE to (row of the distance, shape (n,), stiffness, shape (p,), damping minus that of
    the backlash). `low` marks segments below the mean stiffness, `starts`, shape (p + 1,), are
    their boundaries in phase, and `orders` the orders of the excitation.
    """
    (n, p), constant = (len(free), len(low)), len(free) - 1 - 2 * len(orders)
    near = flanks[NORMAL][0]
    far = flanks[-NORMAL][0] if -NORMAL in flanks else missing_flank(n, constant)
    effect, effects = np.zeros((3, p, 1), np.int64), {}
    stiffness = np.zeros((3, p, 1), free.dtype)
    stiffness[:] = flanks[NORMAL][1][:, None]
    for code, (distance, levels, damping) in flanks.items():
        stiffness[code + 1, :, 0] = levels
        for segment, level in enumerate(levels):
            # distance @ free is the rate of a distance, which does not contain accelerations.
            force = level * distance + damping * (distance @ free)
            entry = (len(effects) + 1, force)
            effect[code + 1, segment, 0], _ = effects.setdefault((code, level, low[segment]), entry)
    force_inputs, force_outputs = np.zeros((2, 1, len(effects) + 1, 2, n), free.dtype)
    for number, force in effects.values():
        force_inputs[0, number, 0], force_outputs[0, number, 0] = force_input, force
    # Scaling velocities by the highest frequency of all contacts makes the norm small.
    half = constant // 2
    matrices = (free + np.swapaxes(force_inputs[0], 1, 2) @ force_outputs[0])[
        :, :constant, :constant
    ]
    frequency = math.sqrt(_largest_norm(matrices[:, half:, :half])) or 1.0
    scale = np.array([1.0, frequency]).repeat(half)
    norm = _largest_norm(matrices * scale / scale[:, None])
    return TrainSystem(
        *(free, near[None], far[None], force_inputs, force_outputs, effect, stiffness),
        low=np.repeat(np.asarray(low)[None, :, None], 3, axis=0),
        starts=starts.copy(),
        first_segment=np.array([0, p]),
        longest=MAX_NORM / max(norm, np.abs(orders * tuning).max(initial=1e-300)),
        harmonics=np.asarray(orders, float),
        tuning=tuning,
        repeats=1,
    )


def _largest_norm(matrices):
    """Return the largest Frobenius norm of matrices, shape (k, n, n)."""
    return float(np.sqrt((matrices**2).sum(axis=(1, 2)).max()))


def by_phase(system, codes, segment):
    """Return the state matrix by phase, dz/dtau, of contact codes in a stiffness segment."""
    effects = [system.effect[code + 1, segment, j] for j, code in enumerate(codes)]
    matrix = np.empty_like(system.base_matrix)
    matrix_of(system, np.array(effects, np.int64), matrix)
    half = (len(matrix) - 1 - 2 * system.harmonics.size) // 2
    scale = np.ones(len(matrix), matrix.dtype)
    scale[half : 2 * half] = system.tuning
    return matrix * scale[None, :] / scale[:, None] / system.tuning


def harmonic_oscillators(n, first, frequencies):
    """Return a state matrix (n, n) whose components from `first` on are pairs cosine, sine."""
    matrix = np.zeros((n, n), np.asarray(frequencies).dtype)
    for j, frequency in enumerate(frequencies):
        cosine = first + 2 * j
        matrix[cosine, cosine + 1], matrix[cosine + 1, cosine] = -frequency, frequency
    return matrix


def missing_flank(n, constant):
    """Return the distance row (n,) of a flank that never touches: always the constant 1."""
    return np.eye(n)[constant]


def contact_map(model, tuning):
    """Return the monodromy matrix of permanent contact over all periods of the excitation."""
    system, n, period_map = model.system(tuning), model.size, np.eye(model.size)
    codes = [NORMAL] * len(system.drive_lines)
    for segment, length in enumerate(np.diff(system.starts)):
        matrix = by_phase(system, codes, segment)[:n, :n].copy()
        steps = math.ceil(length / tuning / system.longest)
        step_map = exponential(matrix, length / steps)
        period_map = np.linalg.matrix_power(step_map, steps) @ period_map
    reduce, lift = model.reduction()
    return reduce @ period_map @ lift
