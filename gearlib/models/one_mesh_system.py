"""Systems of one mesh, and what all piecewise-linear models do with their `TrainSystem`."""

import math

import numpy as np

from gearlib.engines.codes import NORMAL
from gearlib.engines.exponential import REACH, exponential
from gearlib.engines.linear.train_system import TrainSystem, matrix_of


def one_mesh(free, push, flanks, low, starts, orders, tuning):
    """Return the `TrainSystem` of one mesh of n components and p segments of constant stiffness.

    `free`, shape (n, n), is dz/dtheta in the backlash, `push`, shape (n,), that by a unit of the
    contact force. `flanks` maps NORMAL and, if there is a far flank, INVERSE to (functional of the
    distance, shape (n,), stiffness, shape (p,), damping in excess of that of the backlash). `low`
    says which segments lie below the mean stiffness, `starts`, shape (p + 1,), are the phases that
    bound them, and `orders` the frequencies of the excitation by phase.
    """
    (n, p), constant = (len(free), len(low)), len(free) - 1 - 2 * len(orders)
    near = flanks[NORMAL][0]
    lines = {code: line for code, (line, _, _) in flanks.items()}
    far = lines.get(-NORMAL, never(n, constant))
    effect, effects = np.zeros((3, p, 1), np.int64), {}
    stiffness = np.zeros((3, p, 1), free.dtype)
    stiffness[:] = flanks[NORMAL][1][:, None]
    for code, (line, levels, damping) in flanks.items():
        stiffness[code + 1, :, 0] = levels
        for q, level in enumerate(levels):
            # line @ free is the rate of a distance: the accelerations have no part in it.
            force = level * line + damping * (line @ free)
            number = len(effects) + 1
            effect[code + 1, q, 0], _ = effects.setdefault((code, level, low[q]), (number, force))
    pushes, grips = np.zeros((2, 1, len(effects) + 1, 2, n), free.dtype)
    for number, force in effects.values():
        pushes[0, number, 0], grips[0, number, 0] = push, force
    # Velocities are scaled by the highest frequency of all contacts.
    half = constant // 2
    moving = (free + np.swapaxes(pushes[0], 1, 2) @ grips[0])[:, :constant, :constant]
    highest = math.sqrt(_largest_norm(moving[:, half:, :half])) or 1.0
    scale = np.array([1.0, highest]).repeat(half)
    norm = _largest_norm(moving * scale / scale[:, None])
    return TrainSystem(
        *(free, near[None], far[None], pushes, grips, effect, stiffness),
        low=np.repeat(np.asarray(low)[None, :, None], 3, axis=0),
        starts=starts.copy(),
        first_segment=np.array([0, p]),
        longest=REACH / max(norm, np.abs(orders * tuning).max(initial=1e-300)),
        harmonics=np.asarray(orders, float),
        tuning=tuning,
        repeats=1,
    )


def _largest_norm(matrices):
    """Return a norm that none of the matrices, shape (k, n, n), exceeds."""
    return float(np.sqrt((matrices**2).sum(axis=(1, 2)).max()))


def by_phase(system, codes, segment):
    """Return the matrix dz/dtau of contact codes in a segment, with rates by phase."""
    effects = [system.effect[code + 1, segment, j] for j, code in enumerate(codes)]
    matrix = np.empty_like(system.free)
    matrix_of(system, np.array(effects, np.int64), matrix)
    half = (len(matrix) - 1 - 2 * system.harmonics.size) // 2
    scale = np.ones(len(matrix), matrix.dtype)
    scale[half : 2 * half] = system.tuning
    return matrix * scale[None, :] / scale[:, None] / system.tuning


def waves(n, first, frequencies):
    """Return the matrix, shape (n, n), that turns cosine-sine pairs from component `first` on."""
    matrix = np.zeros((n, n), np.asarray(frequencies).dtype)
    for j, frequency in enumerate(frequencies):
        c = first + 2 * j
        matrix[c, c + 1], matrix[c + 1, c] = -frequency, frequency
    return matrix


def never(n, constant):
    """Return the functional of a flank that is not there: the component of the constant 1."""
    return np.eye(n)[constant]


def contact_map(model, tuning):
    """Return the map of deviations over all periods of the excitation, always in normal mesh."""
    system, n, period_map = model.system(tuning), model.size, np.eye(model.size)
    codes = [NORMAL] * len(system.near)
    for segment, length in enumerate(np.diff(system.starts)):
        matrix = by_phase(system, codes, segment)[:n, :n].copy()
        steps = math.ceil(length / tuning / system.longest)
        step_map = exponential(matrix, length / steps)
        period_map = np.linalg.matrix_power(step_map, steps) @ period_map
    reduce, lift = model.reduction()
    return reduce @ period_map @ lift
