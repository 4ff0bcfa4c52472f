"""How far an orbit's turning points lie from the flank lines: zero where it grazes.

A turning point is read off samples of displacement, velocity and acceleration by the polynomial of
fifth degree through two neighbours. Close to a flank line the mesh force and the damping force
that would switch there vanish, so that events do not disturb the polynomial, and its error, the
sixth power of the distance of the samples, is below rounding.
"""

import math

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval

from gearlib.analysis.orbits.tracing import Lost
from gearlib.kernels import orbit as columns

_SAMPLES = 512
#: From the secant through neighbouring velocities two corrections lead to rounding.
_CORRECTIONS = 2
#: Phases this close to a rim of the orbit lie on it: far above rounding, far below a bounce.
_RIM = 1e-9


def turning_points(model, tuning, state, period, max_events):
    """Return (phases, displacements), each of shape (k,), of the turning points of a motion.

    Arguments as of `Propagator.record`. One mesh period more than `period` is gone through, so
    that no turning point of an orbit lies on a rim.
    """
    _, _, samples = model.propagator(tuning).record(state, period + 1, max_events, _SAMPLES)
    x, v, a = (
        samples[:, column] for column in (columns.SAMPLE_X, columns.SAMPLE_V, columns.SAMPLE_A)
    )
    at = np.flatnonzero((v[:-1] < 0.0) != (v[1:] < 0.0))
    h = 2.0 * math.pi / _SAMPLES
    ends = [(q[at], q[at + 1]) for q in (x, v * h, a * h * h)]
    power = _polynomial(*ends)
    slope, bend = polyder(power), polyder(power, 2)
    t = ends[1][0] / (ends[1][0] - ends[1][1])
    with np.errstate(divide="ignore", invalid="ignore"):
        for _ in range(_CORRECTIONS):
            step = polyval(t, slope, tensor=False) / polyval(t, bend, tensor=False)
            t = np.clip(t - step, 0.0, 1.0)
    return (at + t) * h, polyval(t, power, tensor=False)


def _polynomial(x, v, a):
    """Return the coefficients, lowest first, shape (6, k), for values at 0 and 1."""
    c0, c1, c2 = x[0], v[0], 0.5 * a[0]
    dx = x[1] - c0 - c1 - c2
    dv = v[1] - c1 - 2.0 * c2
    da = a[1] - 2.0 * c2
    c3, c4 = 10.0 * dx - 4.0 * dv + 0.5 * da, -15.0 * dx + 7.0 * dv - da
    return np.array([c0, c1, c2, c3, c4, 6.0 * dx - 3.0 * dv + 0.5 * da])


def lines(model):
    """Return the displacements of the flank lines."""
    return [0.0, *([-model.backlash_ratio] if math.isfinite(model.backlash_ratio) else [])]


def nearest_touch(model, tuning, state, period, max_events):
    """Return (phase, number of the line in `lines`) of the turning point nearest to a line."""
    phases, heights = turning_points(model, tuning, state, period, max_events)
    # Half a period off both rims the same turning point is found at neighbouring orbits too; one
    # on the rims, where that of a symmetric orbit lies, may not fall off both by rounding.
    start, end = math.pi, math.pi + 2.0 * math.pi * period
    inside = (phases > start - _RIM) & (phases < end + _RIM)
    phases, heights = phases[inside], heights[inside]
    if not phases.size:
        raise Lost("the orbit has no turning point")
    gaps = np.array([np.abs(heights - line) for line in lines(model)])
    which, at = np.unravel_index(np.argmin(gaps), gaps.shape)
    return float(phases[at]), int(which)


def distance(model, tuning, state, period, max_events, phase, which):
    """Return (distance from a flank line, phase) of the turning point nearest to a phase.

    `which` is the number of the line in `lines`.
    """
    phases, heights = turning_points(model, tuning, state, period, max_events)
    if not phases.size:
        raise Lost("the orbit has no turning point")
    at = np.argmin(np.abs(phases - phase))
    return float(heights[at] - lines(model)[which]), float(phases[at])
