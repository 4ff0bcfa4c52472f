"""The Dormand-Prince pair of order 4(5) under step control, without event location.

Coefficients, first step, error norm and step control are those of MATLAB's ode45 (Shampine and
Reichelt: The MATLAB ODE suite, SIAM J. Sci. Comput. 18 (1997) 1-22).
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.engines.codes import EVENT_LIMIT, OK, OVERFLOW, STALLED
from gearlib.engines.jit import inlined, kernel
from gearlib.engines.overflow import within_range
from gearlib.integrators.steps.equation_of_motion import rate_at

_NODES = np.array([0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0, 1.0])
_WEIGHTS = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [1 / 5, 0.0, 0.0, 0.0, 0.0, 0.0],
        [3 / 40, 9 / 40, 0.0, 0.0, 0.0, 0.0],
        [44 / 45, -56 / 15, 32 / 9, 0.0, 0.0, 0.0],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0.0, 0.0],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0.0],
        [35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    ]
)
_ERROR = np.array([71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])
#: Dense output: rows of stages, columns of powers 1 to 4 of the share of the step.
DENSE = np.array(
    [
        [1.0, -183 / 64, 37 / 12, -145 / 128],
        [0.0, 0.0, 0.0, 0.0],
        [0.0, 1500 / 371, -1000 / 159, 1000 / 371],
        [0.0, -125 / 32, 125 / 12, -375 / 64],
        [0.0, 9477 / 3392, -729 / 106, 25515 / 6784],
        [0.0, -11 / 7, 11 / 3, -55 / 28],
        [0.0, 3 / 2, -4.0, 5 / 2],
    ]
)


class Control(NamedTuple):
    """Step control."""

    rtol: float
    atol: float  #: static deflections, and dx/dtau
    max_step: float  #: phase


@inlined
def _take_step(breaks, lines, waves, force, m, t, h, x, v, stages):
    """Fill stages 2 to 7, rows (x', x''), from the first; return the state at the end."""
    new_x, new_v = x, v
    for i in range(1, 7):
        dx, dv = 0.0, 0.0
        for j in range(i):
            dx += _WEIGHTS[i, j] * stages[j, 0]
            dv += _WEIGHTS[i, j] * stages[j, 1]
        new_x, new_v = x + h * dx, v + h * dv
        stages[i, 0] = new_v
        stages[i, 1] = rate_at(breaks, lines, waves, force, m, t + _NODES[i] * h, new_x, new_v)
    return new_x, new_v


@inlined
def _error(control, h, x, v, new_x, new_v, stages):
    """Return the estimated error over what the tolerances allow, times rtol."""
    threshold = control.atol / control.rtol
    ex, ev = 0.0, 0.0
    for j in range(7):
        ex += _ERROR[j] * stages[j, 0]
        ev += _ERROR[j] * stages[j, 1]
    ex = abs(ex) / max(abs(x), abs(new_x), threshold)
    ev = abs(ev) / max(abs(v), abs(new_v), threshold)
    return h * max(ex, ev)


@inlined
def _first_step(control, end, x, v, a):
    """Return the length of the first step, as ode45 chooses it."""
    threshold, rtol = control.atol / control.rtol, control.rtol
    speed = max(abs(v) / max(abs(x), threshold), abs(a) / max(abs(v), threshold))
    speed /= 0.8 * rtol**0.2
    h = min(control.max_step, end)
    return 1.0 / speed if h * speed > 1.0 else h


@kernel
def take_embedded_steps(law, m, control, wanted, end, limit, place, times, states, stages):
    """Take steps until arrays are full or the end is reached; return (steps, status, evaluations).

    Fills `times`, shape (k + 1,), and `states`, shape (k + 1, 2), from the first, and `stages`,
    shape (k, 7, 2), with the rates (x', x''); steps before the phase `wanted` need not be kept.
    `place`, shape (3,), has the length of the next step, 0 at the start of the run, the number of
    the mesh period and its steps so far, rejected ones included, of which there are `limit` at
    most.
    """
    # Local names: every attribute access counts references.
    breaks, lines, waves, force = law.breaks, law.pieces, law.stiffness, law.force
    rtol, turn = control.rtol, 2.0 * math.pi
    t, x, v, evaluations = times[0], states[0, 0], states[0, 1], 0
    a = rate_at(breaks, lines, waves, force, m, t, x, v)
    if place[0] == 0.0:
        place[0], evaluations = _first_step(control, end, x, v, a), 1
    h = place[0]
    i = 0
    while i < stages.shape[0]:
        rates = stages[i]
        rates[0, 0], rates[0, 1] = v, a
        shortest = 16.0 * np.spacing(t)
        h = min(control.max_step, max(shortest, h))
        # The last step is stretched by a tenth rather than followed by a tiny one.
        last = 1.1 * h >= end - t
        h = end - t if last else h
        failed = False
        while True:
            if place[2] >= limit:
                return i, EVENT_LIMIT, evaluations
            place[2] += 1
            new_x, new_v = _take_step(breaks, lines, waves, force, m, t, h, x, v, rates)
            evaluations += 6
            error = _error(control, h, x, v, new_x, new_v, rates)
            if not error > rtol:
                break
            if h <= shortest:
                return i, STALLED, evaluations
            h = max(shortest, h * (0.5 if failed else max(0.1, 0.8 * (rtol / error) ** 0.2)))
            failed, last = True, False
        if int(t / turn) > place[1]:
            place[1], place[2] = int(t / turn), 0
        t, x, v, a = end if last else t + h, new_x, new_v, rates[6, 1]
        if t > wanted:
            i += 1
        times[i], states[i, 0], states[i, 1] = t, x, v
        if not within_range(x, v):
            return i, OVERFLOW, evaluations
        if last:
            return i, OK, evaluations
        if not failed:
            growth = 1.25 * (error / rtol) ** 0.2
            h = h / growth if growth > 0.2 else 5.0 * h
        place[0] = h
    return i, OK, evaluations
