"""The Dormand-Prince pair of order 4(5) under step control, without event location.

Coefficients, first step, error norm and step control are those of MATLAB's ode45 (Shampine and
Reichelt: The MATLAB ODE suite, SIAM J. Sci. Comput. 18 (1997) 1-22). One run over the whole
span: what happens at period ends is read off the dense output.
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.kernels import orbit
from gearlib.kernels.codes import EVENT_LIMIT, OK, OVERFLOW, STALLED
from gearlib.kernels.jit import inlined, kernel
from gearlib.kernels.overflow import within_range
from gearlib.kernels.steps.equation_of_motion import (
    SIDE,
    acceleration,
    contact_law,
    stiffness_at,
    waves_at,
)
from gearlib.kernels.steps.recording import DENSE, Step, record_step, value_at

#: ode45 shows the solution at four points of every step by default ("Refine").
REFINE = 4

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
_DENSE = np.array(
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
def _rate(breaks, lines, waves, force, m, t, x, v):
    phase = t - 2.0 * math.pi * math.floor(t * (0.5 / math.pi))
    c = stiffness_at(breaks, lines, waves, phase, SIDE)
    return acceleration(m, c, waves_at(force, phase), x, v)


@inlined
def take_step(breaks, lines, waves, force, m, t, h, x, v, stages):
    """Fill stages 2 to 7, rows (x', x''), from the first; return the state at the end."""
    new_x, new_v = x, v
    for i in range(1, 7):
        dx, dv = 0.0, 0.0
        for j in range(i):
            dx += _WEIGHTS[i, j] * stages[j, 0]
            dv += _WEIGHTS[i, j] * stages[j, 1]
        new_x, new_v = x + h * dx, v + h * dv
        stages[i, 0] = new_v
        stages[i, 1] = _rate(breaks, lines, waves, force, m, t + _NODES[i] * h, new_x, new_v)
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


@kernel
def fill_dense(dense, h, x, v, stages):
    """Fill the dense output, shape (2, 5), of a step from its stages."""
    for i, start in enumerate((x, v)):
        dense[i, 0] = start
        for k in range(4):
            total = 0.0
            for j in range(7):
                total += _DENSE[j, k] * stages[j, i]
            dense[i, k + 1] = h * total


@kernel
def run_embedded(
    law, sharpness, control, x, v, periods, record_periods, samples, events, limit, summary
):
    """Run under step control; arguments as of `gearlib.kernels.closed_form.pair_run.run`.

    Returns in addition the number of evaluations of the right-hand side, those for the record
    not counted. `limit`: most steps, rejected ones included, in one mesh period.
    """
    orbit.clear_summary(summary)
    m = contact_law(law, sharpness)
    # Local names: every attribute access counts references.
    breaks, lines, waves, force = law.breaks, law.pieces, law.stiffness, law.force
    kept = min(periods, orbit.STROBE_PERIODS)
    strobes = np.empty((kept + 1, 2))
    per_period = samples.shape[0] // record_periods
    first = periods - record_periods
    dense, stages = np.empty((2, DENSE)), np.empty((7, 2))
    found, taken, evaluations = 0, 0, 1
    turn = 2.0 * math.pi
    end, t = turn * periods, 0.0
    if not within_range(x, v):
        return x, v, 0, events, 0, OVERFLOW, 0
    stages[0, 0], stages[0, 1] = v, _rate(breaks, lines, waves, force, m, 0.0, x, v)
    threshold, rtol = control.atol / control.rtol, control.rtol
    speed = max(
        abs(stages[0, 0]) / max(abs(x), threshold), abs(stages[0, 1]) / max(abs(v), threshold)
    ) / (0.8 * rtol**0.2)
    h = min(control.max_step, end)
    if h * speed > 1.0:
        h = 1.0 / speed
    counted, current, strobe = 0, 0, periods - kept
    if strobe == 0:
        strobes[0, 0], strobes[0, 1] = x, v
        strobe = 1
    done = False
    while not done:
        shortest = 16.0 * np.spacing(t)
        h = min(control.max_step, max(shortest, h))
        if 1.1 * h >= end - t:
            # The last step is stretched by a tenth rather than followed by a tiny one.
            h, done = end - t, True
        failed = False
        while True:
            if counted >= limit:
                return x, v, 0, events, 0, EVENT_LIMIT, evaluations
            counted += 1
            new_x, new_v = take_step(breaks, lines, waves, force, m, t, h, x, v, stages)
            evaluations += 6
            error = _error(control, h, x, v, new_x, new_v, stages)
            if not error > rtol:
                break
            if h <= shortest:
                return x, v, 0, events, 0, STALLED, evaluations
            h = max(shortest, h * (0.5 if failed else max(0.1, 0.8 * (rtol / error) ** 0.2)))
            failed, done = True, False
        if not within_range(new_x, new_v):
            return new_x, new_v, 0, events, 0, OVERFLOW, evaluations
        new_t = end if done else t + h
        if turn * strobe <= new_t or turn * first < new_t:
            fill_dense(dense, h, x, v, stages)
        while strobe < periods and turn * strobe <= new_t:
            share = (turn * strobe - t) / h
            row = strobe - (periods - kept)
            strobes[row, 0] = value_at(dense[0], share)
            strobes[row, 1] = value_at(dense[1], share)
            strobe += 1
        n = int(t / turn)
        if n > current:
            current, counted = n, 0
        if turn * first < new_t:
            step = Step(n, t - turn * n, h, x, v, new_x, new_v)
            taken, events, found = record_step(
                law,
                m,
                step,
                dense,
                REFINE,
                first,
                per_period,
                samples,
                taken,
                events,
                found,
                summary,
            )
        t, x, v = new_t, new_x, new_v
        stages[0, 0], stages[0, 1] = stages[6, 0], stages[6, 1]
        if not failed:
            growth = 1.25 * (error / rtol) ** 0.2
            h = h / growth if growth > 0.2 else 5.0 * h
    strobes[kept, 0], strobes[kept, 1] = x, v
    height = summary[orbit.X_MAX] - summary[orbit.X_MIN]
    period = orbit.orbit_period(strobes, law.tuning, height)
    return x, v, period, events, found, OK, evaluations
