"""Growth of an undamped gear train without loss of contact, exactly, at many tunings in one go.

Between switches of the stiffness q'' = -K_p q with mass-normalised coordinates, so that K_p = V
diag(w^2) V^T carries a state through a span s by cos(w s) and sin(w s): one eigenproblem for each
segment, whatever the tuning. The free rotation is left out; it is neutral.
"""

import numpy as np

from gearlib.models.trains.elastic import jacobi

#: Growth per mesh period that is rounding: double multipliers part by its root.
NEUTRAL = 1e-6


def growth(train, tunings):
    """Return the logarithm of the largest multiplier per mesh period at tunings, shape (t,).

    Damping of the train is left out; ValueError if it is gyroscopic: its stiffness is not
    symmetric.
    """
    matrices = maps(train, tunings)
    radius = np.abs(np.linalg.eigvals(matrices)).max(axis=1)
    return np.log(np.maximum(radius, 1.0)) / train.repeats


def maps(train, tunings):
    """Return the maps of modal displacements and rates over `repeats` periods, (t, 2n, 2n)."""
    if train.gyroscopic:
        raise ValueError("gyroscopic = True is not allowed here: the train must be without")
    tunings = np.asarray(tunings, float)
    squares, _ = train.linear_modes
    # Of springs with mean stiffness: roots of the strain energy by modal displacements.
    factor = train.strains * np.sqrt(squares)
    upper = np.array([mesh.max_stiffness / mesh.mean_stiffness for mesh in train.meshes])
    lower = upper * [mesh.stiffness_ratio for mesh in train.meshes]
    segments, still = train.segments, np.ones(len(factor) - upper.size)
    n = squares.size
    whole = np.broadcast_to(np.eye(2 * n), (tunings.size, 2 * n, 2 * n))
    step = np.empty(whole.shape)
    for p, span in enumerate(np.diff(segments.starts)):
        levels = np.where(segments.low[1, p], lower, upper)
        w, _, v = jacobi(np.sqrt(np.append(still, levels))[:, None] * factor)
        w = w / train.reference_angular_frequency
        angle = w * (span / tunings)[:, None]
        c, s = np.cos(angle), np.sin(angle)
        step[:, :n, :n] = step[:, n:, n:] = (v * c[:, None, :]) @ v.T
        step[:, :n, n:] = (v * (s / w)[:, None, :]) @ v.T
        step[:, n:, :n] = -(v * (s * w)[:, None, :]) @ v.T
        whole = step @ whole
    return whole


def stiffness_ratio(jump, contact_ratio):
    """Return kappa of a mesh with a jump C_max - C_min, over its mean stiffness."""
    return 1.0 - jump / (1.0 + jump * (2.0 - contact_ratio))
