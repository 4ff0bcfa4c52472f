"""Motion that never leaves the normal flank: closed form of one mesh period, its orbit.

x'' + (2 beta / nu) x' + c / nu^2 (x - 1 / c) = 0 on every segment of constant stiffness c (over
its mean). One mesh period is the affine map z -> M z + b of z = (x, x'), with Liouville's
det M = exp(-4 pi beta / nu). Its fixed point is the orbit without loss of contact; M takes
deviations from it through one period.
"""

import math

import numpy as np

from gearlib.analysis.tongues.meissner import pass_segment
from gearlib.models.stiffness import levels, segment_lengths


def go(state, stiffness, damping, tuning, phase):
    """Return the state a phase later (negative: earlier) on a segment of constant stiffness.

    (x, dx/dtau) in static deflections; stiffness over its mean, damping ratio beta.
    """
    rest = 1.0 / stiffness
    u, v = state[0] - rest, tuning * state[1]
    time = phase / tuning
    cosine, sine, scale = pass_segment(stiffness - damping * damping, time)
    factor = math.exp(scale - damping * time)
    cosine, sine = factor * cosine, factor * sine
    v, u = v * cosine - (damping * v + stiffness * u) * sine, u * cosine + (v + damping * u) * sine
    return rest + u, v / tuning


def period_map(pair, tuning):
    """Return (M, b) of one mesh period, shapes (2, 2) and (2,), of a `GearPair`."""
    high, low = levels(pair.contact_ratio, pair.stiffness_ratio)
    half_high, whole_low = segment_lengths(pair.contact_ratio)

    def whole(state):
        for stiffness, length in ((high, half_high), (low, whole_low), (high, half_high)):
            state = go(state, stiffness, pair.damping_ratio, tuning, length)
        return np.array(state)

    shift = whole((0.0, 0.0))
    return np.column_stack([whole((1.0, 0.0)) - shift, whole((0.0, 1.0)) - shift]), shift


def orbit(pair, tuning):
    """Return the state at phase 0 of the orbit that repeats every mesh period.

    Where many do, as with constant stiffness at nu = 1 / n, that next to static deflection.
    """
    matrix, shift = period_map(pair, tuning)
    matrix = np.eye(2) - matrix
    try:
        state = np.linalg.solve(matrix, shift)
    except np.linalg.LinAlgError:
        static = np.array([1.0, 0.0])
        state = static + np.linalg.lstsq(matrix, shift - matrix @ static)[0]
    return tuple(map(float, state))


def trace(pair, tuning):
    """Return the trace of M; without damping deviations grow where it lies outside -2 ... 2."""
    return float(np.trace(period_map(pair, tuning)[0]))


def linear_pair(pair):
    """Return a `GearPair` as the linear mesh: no backlash, the damping of contact everywhere."""
    return pair.replace(backlash=0.0, backlash_damping=pair.material_damping)
