"""What the piecewise-linear models share: systems of one mesh, harmonics as components, maps.

See `gearlib.engines.linear.train_system` for the form of these models.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from gearlib.engines.codes import INVERSE, NORMAL
from gearlib.engines.exponential import REACH, exponential
from gearlib.engines.linear.train_system import TrainSystem, matrix_of


class Side(NamedTuple):
    """What one pair of flanks does while in contact, of n components and p segments."""

    line: np.ndarray  #: distance from its line, shape (n,)
    stiffness: np.ndarray  #: shape (p,)
    damping: Any  #: what it has more than the backlash, by theta
    push: np.ndarray  #: dz/dtheta by a unit of its force, shape (n,)
    across: np.ndarray  #: and of its friction
    friction: Any = 0.0  #: coefficient


class Pieces(NamedTuple):
    """Segments of the mesh period in which no stiffness and no sliding changes."""

    starts: np.ndarray  #: phases that bound them, shape (p + 1,)
    low: np.ndarray  #: bool, whether one is at the lower level, shape (p,)
    sense: np.ndarray  #: of the sliding, 1 or -1, shape (p,)


def one_mesh(free, sides, pieces, frequencies, tuning, repeats=1):
    """Return the `TrainSystem` of one mesh.

    `free`, shape (n, n), is dz/dtheta in the backlash; `sides` has a `Side` for NORMAL and, unless
    there is none, for INVERSE; `frequencies` of the harmonics are by phase.
    """
    near, (n, p) = sides[NORMAL], (len(free), len(pieces.low))
    one = n - 1 - 2 * len(frequencies)
    far = sides[INVERSE].line if INVERSE in sides else never(n, one)
    effect, kinds = np.zeros((3, p, 1), np.int64), {}
    for code, side in sides.items():
        for q in range(p):
            # Segments of one level but another derivative are not alike.
            what = code, side.stiffness[q], bool(pieces.low[q]), pieces.sense[q]
            effect[code + 1, q, 0], *_ = kinds.setdefault(what, (len(kinds) + 1, side, q))
    push, grip = np.zeros((2, 1, len(kinds) + 1, 2, n), free.dtype)
    for d, side, q in kinds.values():
        elastic = side.stiffness[q] * side.line
        push[0, d] = side.push, side.across
        # line @ free is the rate of a distance: the accelerations have no part in it.
        grip[0, d, 0] = elastic + side.damping * (side.line @ free)
        grip[0, d, 1] = side.friction * pieces.sense[q] * elastic
    stiffness = np.repeat(near.stiffness[None], 3, axis=0).astype(free.dtype)
    if INVERSE in sides:
        stiffness[0] = sides[INVERSE].stiffness
    system = TrainSystem(
        free,
        near.line[None],
        far[None],
        push,
        grip,
        effect,
        stiffness[:, :, None],
        np.repeat(np.asarray(pieces.low)[None, :, None], 3, axis=0),
        pieces.starts.copy(),
        np.array([0, p]),
        1.0,
        np.asarray(frequencies, float),
        tuning,
        repeats,
    )
    # Velocities over the highest frequency of all combinations.
    half, moving = one // 2, (free + np.swapaxes(push[0], 1, 2) @ grip[0])[:, :one, :one]
    highest = math.sqrt(_sizes(moving[:, half:, :half])) or 1.0
    scale = np.array([1.0, highest]).repeat(half)
    waves = np.abs(system.harmonics * tuning).max(initial=1e-300)
    return system._replace(longest=REACH / max(_sizes(moving * scale / scale[:, None]), waves))


def _sizes(matrices):
    """Return a norm that none of the matrices exceeds."""
    return float(np.sqrt((matrices**2).sum(axis=(1, 2)).max()))


def matrix(system, effects):
    """Return the matrix dz/dtheta of a combination of effects, shape (n, n)."""
    a = np.empty_like(system.free)
    matrix_of(system, np.array(effects, np.int64), a)
    return a


def by_phase(system, codes, segment):
    """Return the matrix dz/dtau of contact codes in a segment, with rates by phase."""
    effects = [int(system.effect[code + 1, segment, j]) for j, code in enumerate(codes)]
    half = (len(system.free) - 1 - 2 * system.harmonics.size) // 2
    scale = np.ones(len(system.free), system.free.dtype)
    scale[half : 2 * half] = system.tuning
    return matrix(system, effects) * scale[None, :] / scale[:, None] / system.tuning


def waves(n, first, frequencies):
    """Return the matrix, shape (n, n), that turns cosine-sine pairs from component `first` on."""
    a = np.zeros((n, n), np.asarray(frequencies).dtype)
    for j, frequency in enumerate(frequencies):
        c = first + 2 * j
        a[c, c + 1], a[c + 1, c] = -frequency, frequency
    return a


def never(n, one):
    """Return the functional of a flank that is not there: the constant 1, component `one`."""
    functional = np.zeros(n)
    functional[one] = 1.0
    return functional


def contact_map(model, tuning):
    """Return the map of deviations over all periods of the excitation, always in normal mesh.

    See `Model.reduction`.
    """
    system, n, whole = model.system(tuning), model.size, np.eye(model.size)
    codes = [NORMAL] * len(system.near)
    for segment, length in enumerate(np.diff(system.starts)):
        a = by_phase(system, codes, segment)[:n, :n].copy()
        steps = math.ceil(length / tuning / system.longest)
        whole = np.linalg.matrix_power(exponential(a, length / steps), steps) @ whole
    reduce, lift = model.reduction()
    return reduce @ whole @ lift
