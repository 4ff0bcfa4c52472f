"""The Dormand-Prince pair of order 4(5) with step control, without event location.

Coefficients, first step, error norm and step control follow MATLAB's ode45 (Shampine and Reichelt:
The MATLAB ODE suite, SIAM J. Sci. Comput. 18 (1997) 1-22).
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.engines.codes import EVENT_LIMIT, OK, OVERFLOW, STALLED
from gearlib.engines.jit import kernel, kernel_part
from gearlib.engines.orbit import is_within_range
from gearlib.integrators.steps.equation_of_motion import acceleration_at

_NODES = np.array([0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0, 1.0])
_STAGE_WEIGHTS = np.array(
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
_ERROR_WEIGHTS = np.array(
    [71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40]
)
#: Weights of the dense output, with a row for each stage and columns for the powers 1 to 4 of the
#: fraction of the step.
DENSE_WEIGHTS = np.array(
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


class StepControl(NamedTuple):
    """Tolerances and longest step of the step control."""

    rtol: float  #: relative tolerance of a step
    atol: float  #: absolute tolerance of a step, for x in static deflections and for dx/dtau
    max_step: float  #: longest step, rad of mesh phase


@kernel_part(inlined=True)
def _take_step(excitation, contact_law, t, h, x, v, stages) -> tuple:
    """Return (x, v) after a Runge-Kutta step of length h from displacement x and velocity v.

    The step starts at the mesh phase t. `stages`, shape (7, 2), holds the derivatives (x', x'') at
    the stages: the first row is an input, the others are filled. `excitation` is (segment bounds,
    stiffness lines, stiffness harmonics, force harmonics), which describe mesh stiffness and
    external force.
    """
    segment_bounds, stiffness_segments, stiffness_harmonics, force_harmonics = excitation
    new_x, new_v = x, v
    for i in range(1, 7):
        dx, dv = 0.0, 0.0
        for j in range(i):
            dx += _STAGE_WEIGHTS[i, j] * stages[j, 0]
            dv += _STAGE_WEIGHTS[i, j] * stages[j, 1]
        new_x, new_v = x + h * dx, v + h * dv
        stages[i, 0] = new_v
        stages[i, 1] = acceleration_at(
            segment_bounds,
            stiffness_segments,
            stiffness_harmonics,
            force_harmonics,
            contact_law,
            t + _NODES[i] * h,
            new_x,
            new_v,
        )
    # The last stage is the state at the end of the step.
    return new_x, new_v


@kernel_part(inlined=True)
def _step_error(control, h, x, v, new_x, new_v, stages) -> float:
    """Return the relative error of a step of length h, to be compared with rtol.

    The step leads from (x, v) to (new_x, new_v). `stages`, shape (7, 2), contains the derivatives
    (x', x'') at the stages, and `control` is the `StepControl`. The error is the difference between
    the results of order 5 and 4.
    """
    # For components below this threshold the absolute tolerance applies.
    threshold = control.atol / control.rtol
    x_error, v_error = 0.0, 0.0
    for j in range(7):
        x_error += _ERROR_WEIGHTS[j] * stages[j, 0]
        v_error += _ERROR_WEIGHTS[j] * stages[j, 1]
    x_error = abs(x_error) / max(abs(x), abs(new_x), threshold)
    v_error = abs(v_error) / max(abs(v), abs(new_v), threshold)
    return h * max(x_error, v_error)


@kernel_part(inlined=True)
def _first_step(control: StepControl, end: float, x: float, v: float, a: float) -> float:
    """Return the length of the first step, chosen as in MATLAB's ode45.

    The run starts at phase 0 with displacement x, velocity v and acceleration a, and ends at the
    phase `end`. The step is the shorter, the faster the state changes relative to its magnitude.
    """
    threshold, rtol = control.atol / control.rtol, control.rtol
    inverse_step = max(abs(v) / max(abs(x), threshold), abs(a) / max(abs(v), threshold))
    inverse_step /= 0.8 * rtol**0.2
    h = min(control.max_step, end)
    return 1.0 / inverse_step if h * inverse_step > 1.0 else h


@kernel
def take_embedded_steps(equation, record_start, end, max_attempts, progress, times, states, stages):
    """Take up to k steps, up to the phase `end`; return (stored steps, status, evaluations).

    The first entries of `times`, (k + 1,), and `states`, (k + 1, 2), are initial values. The other
    entries and the derivatives (x', x'') at the stages, `stages`, (k, 7, 2), are filled. Steps that
    end before `record_start` are overwritten. `equation` is (`NonlinearMesh`, `ContactLaw`,
    `StepControl`). `progress`, (3,), contains the length of the next step (0 at the start), the
    index of the current mesh period, and the number of steps attempted in it, which must not exceed
    `max_attempts`.
    """
    mesh, contact_law, control = equation
    # Each attribute access changes reference counts, so the loop uses local names.
    bounds, segments = mesh.segment_bounds, mesh.stiffness_segments
    excitation = bounds, segments, mesh.stiffness_harmonics, mesh.force_harmonics
    rtol, mesh_period = control.rtol, 2.0 * math.pi
    t, x, v, evaluations = times[0], states[0, 0], states[0, 1], 0
    a = acceleration_at(*excitation, contact_law, t, x, v)
    if progress[0] == 0.0:
        progress[0], evaluations = _first_step(control, end, x, v, a), 1
    h = progress[0]
    i = 0
    while i < stages.shape[0]:
        rates = stages[i]
        rates[0, 0], rates[0, 1] = v, a
        min_step = 16.0 * np.spacing(t)
        h = min(control.max_step, max(min_step, h))
        # The last step may be stretched by a tenth, to avoid a tiny final step.
        is_last = 1.1 * h >= end - t
        h = end - t if is_last else h
        has_failed = False
        while True:
            if progress[2] >= max_attempts:
                return i, EVENT_LIMIT, evaluations
            progress[2] += 1
            new_x, new_v = _take_step(excitation, contact_law, t, h, x, v, rates)
            evaluations += 6
            error = _step_error(control, h, x, v, new_x, new_v, rates)
            if not error > rtol:
                break
            if h <= min_step:
                return i, STALLED, evaluations
            reduction = 0.5 if has_failed else max(0.1, 0.8 * (rtol / error) ** 0.2)
            h = max(min_step, h * reduction)
            has_failed, is_last = True, False
        if int(t / mesh_period) > progress[1]:
            progress[1], progress[2] = int(t / mesh_period), 0
        t, x, v, a = end if is_last else t + h, new_x, new_v, rates[6, 1]
        if t > record_start:
            i += 1
        times[i], states[i, 0], states[i, 1] = t, x, v
        if not is_within_range(x, v):
            return i, OVERFLOW, evaluations
        if is_last:
            return i, OK, evaluations
        if not has_failed:
            growth = 1.25 * (error / rtol) ** 0.2
            h = h / growth if growth > 0.2 else 5.0 * h
        progress[0] = h
    return i, OK, evaluations
