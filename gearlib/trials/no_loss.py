"""Conservative motion that never leaves the normal flank: closed forms, orbit, growth.

x'' + c / nu^2 (x - 1 / c) = 0 on every stretch of constant stiffness c (over its mean). One mesh
period is the affine map z -> M z + b of z = (x, x'), det M = 1. Its fixed point is the orbit
without loss of contact; deviations from it grow where |trace M| > 2: the tongues of parametric
resonance, at nu near 2 / n.
"""

import math

import numpy as np

from gearlib.stiffness import levels, stretches


def rotate(state, stiffness, tuning, phase):
    """Return the state a phase later (negative: earlier) at one stiffness over its mean."""
    w, rest = math.sqrt(stiffness) / tuning, 1.0 / stiffness
    u, v = state[0] - rest, state[1]
    cosine, sine = math.cos(w * phase), math.sin(w * phase)
    return rest + u * cosine + v / w * sine, v * cosine - u * w * sine


def period_map(pair, tuning):
    """Return (M, b) of one mesh period, shapes (2, 2) and (2,), of a `GearPair`."""
    high, low = levels(pair.contact_ratio, pair.stiffness_ratio)
    half_high, whole_low = stretches(pair.contact_ratio)

    def go(state):
        for stiffness, length in ((high, half_high), (low, whole_low), (high, half_high)):
            state = rotate(state, stiffness, tuning, length)
        return np.array(state)

    shift = go((0.0, 0.0))
    return np.column_stack([go((1.0, 0.0)) - shift, go((0.0, 1.0)) - shift]), shift


def orbit(pair, tuning):
    """Return the state at phase 0 of the orbit that repeats every mesh period."""
    matrix, shift = period_map(pair, tuning)
    return tuple(map(float, np.linalg.solve(np.eye(2) - matrix, shift)))


def trace(pair, tuning):
    """Return the trace of M; deviations grow where it lies outside -2 ... 2."""
    return float(np.trace(period_map(pair, tuning)[0]))


def edge(pair, inside, outside):
    """Return the tuning at which a tongue ends, between one inside it and one outside."""
    for _ in range(60):
        middle = 0.5 * (inside + outside)
        if abs(trace(pair, middle)) > 2.0:
            inside = middle
        else:
            outside = middle
    return outside
