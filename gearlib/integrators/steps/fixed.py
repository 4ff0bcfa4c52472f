"""Fixed steps over switches and contact: classical Runge-Kutta, generalised-alpha, Newmark.

Every mesh period is cut into the same steps, so stiffness and force at their nodes are tabulated
once. Where a switch of stiffness falls on a step end, the step before it takes the stiffness
before it and the step after it that after it: the methods keep their order there. Switches and
contact inside a step are met by nothing.
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.engines.codes import JAMMED, NOT_CONVERGED, OK, OVERFLOW
from gearlib.engines.jit import inlined, kernel
from gearlib.engines.overflow import within_range
from gearlib.integrators.steps.equation_of_motion import (
    SIDE,
    acceleration,
    branch_of,
    damping_force,
    forces_at,
    jammed,
    side_of,
    stiffness_at,
    train_rate,
    waves_at,
)

#: Most iterations on the contact force in one step: a linear contact takes 2 or 3.
MAX_ITERATIONS = 50
#: A residual of this share of its terms is rounding.
_ROUNDING = 1e-14


class Scheme(NamedTuple):
    """Which fixed-step method, and its constants."""

    runge_kutta: bool  #: else generalised-alpha with the constants below
    iterated: bool = False  #: contact at the step end, by iteration; else that of the step start
    alpha_m: float = 0.0
    alpha_f: float = 0.0
    beta: float = 0.0
    gamma: float = 0.0


@kernel
def nodes(law, steps, share):
    """Return stiffness, force, shape (steps, 3), and jumps, shape (steps,), of one mesh period.

    Columns: start of the step, `share` of it, end. `jumps`: whether the stiffness jumps at the
    start of the step.
    """
    c, f = np.empty((steps, 3)), np.empty((steps, 3))
    for k in range(steps):
        for j, part in enumerate((0.0, share, 1.0)):
            phase = 2.0 * math.pi * ((k + part) / steps)
            side = -SIDE if part == 1.0 else SIDE
            c[k, j] = stiffness_at(law.breaks, law.pieces, law.stiffness, phase, side)
            f[k, j] = waves_at(law.force, phase)
    # The profile is periodic.
    jumps = np.abs(c[:, 0] - np.roll(c[:, 2], 1)) > 1e-9 * c[:, 0]
    return c, f, jumps


@inlined
def runge_kutta_step(m, h, c, f, k, x, v):
    """Return (x, v) after step k of the classical Runge-Kutta method."""
    half = 0.5 * h
    k1 = acceleration(m, c[k, 0], f[k, 0], x, v)
    v2 = v + half * k1
    k2 = acceleration(m, c[k, 1], f[k, 1], x + half * v, v2)
    v3 = v + half * k2
    k3 = acceleration(m, c[k, 1], f[k, 1], x + half * v2, v3)
    v4 = v + h * k3
    k4 = acceleration(m, c[k, 2], f[k, 2], x + h * v3, v4)
    sixth = h / 6.0
    return x + sixth * (v + 2.0 * (v2 + v3) + v4), v + sixth * (k1 + 2.0 * (k2 + k3) + k4)


@inlined
def alpha_step(m, scheme, h, c, f, x0, v0, a0):
    """Take one step of the generalised-alpha method; c and f at share 1 - alpha_f of it.

    Returns (x, v, a, evaluations, converged) at the end; a is the method's own acceleration.
    """
    am, af = scheme.alpha_m, scheme.alpha_f
    p2, p3 = m.powers
    # The middle state is x_p + bx a, v_p + bv a with the acceleration a at the step end.
    bx, bv = (1.0 - af) * scheme.beta * h * h, (1.0 - af) * scheme.gamma * h
    vp = v0 + (1.0 - af) * h * (1.0 - scheme.gamma) * a0
    xp = x0 + (1.0 - af) * h * (v0 + h * (0.5 - scheme.beta) * a0)
    evaluations, converged = 1, True
    if not scheme.iterated:
        touching, line, d = branch_of(m, side_of(m, x0))
        size, speed = abs(x0 - line), abs(v0)
        stiffness = c * touching * (1.0 + (p2 + p3 * size) * size)
        damping = d[0] + (d[1] + d[2] * speed) * speed
        force = f - am * a0 - damping * vp - stiffness * (xp - line)
        a = force / (1.0 - am + damping * bv + stiffness * bx)
    else:
        a, converged, evaluations = a0, False, 0
        while evaluations < MAX_ITERATIONS:
            x, v = xp + bx * a, vp + bv * a
            code = side_of(m, x)
            g, drag = forces_at(m, code, x, v)
            residual = (1.0 - am) * a + am * a0 + drag + c * g - f
            touching, line, d = branch_of(m, code)
            u, speed = touching * abs(x - line), abs(v)
            stiffness = c * touching * (1.0 + (2.0 * p2 + 3.0 * p3 * u) * u)
            damping = d[0] + (2.0 * d[1] + 3.0 * d[2] * speed) * speed
            evaluations += 1
            size = abs(a) + abs(am * a0) + abs(f) + abs(drag)
            size += stiffness * (abs(x) + u + abs(x0) + h * abs(v0))
            if abs(residual) <= _ROUNDING * size:
                converged = True
                break
            a -= residual / (1.0 - am + damping * bv + stiffness * bx)
        if not converged:
            # Where the damping jumps with contact, the residual may jump over zero: then the
            # state lies on the line, with a damping between the two.
            for line in (m.upper, m.lower):
                if abs(line) < math.inf and not converged:
                    at = (line - xp) / bx
                    v = vp + bv * at
                    residual = (1.0 - am) * at + am * a0 - f
                    inside = residual + damping_force(m.normal_damping, v)
                    outside = residual + damping_force(m.backlash_damping, v)
                    evaluations += 1
                    if inside * outside <= 0.0:
                        a, converged = at, True
    x = x0 + h * (v0 + h * ((0.5 - scheme.beta) * a0 + scheme.beta * a))
    v = v0 + h * ((1.0 - scheme.gamma) * a0 + scheme.gamma * a)
    return x, v, a, evaluations, converged


@kernel
def take_steps(m, scheme, tables, a, states):
    """Fill states, shape (k + 1, 2), from the first, at the start of a mesh period.

    `tables` are those of `nodes`; `a` is the acceleration of generalised-alpha at the first state,
    NaN if it is that of the equation of motion.

    Returns (status, evaluations, a at the last state).
    """
    c, f, jumps = tables
    steps = c.shape[0]
    h = 2.0 * math.pi / steps
    x, v, evaluations, converged = states[0, 0], states[0, 1], 0, True
    for i in range(states.shape[0] - 1):
        k = i % steps
        if scheme.runge_kutta:
            x, v = runge_kutta_step(m, h, c, f, k, x, v)
            evaluations += 4
        else:
            if jumps[k] or math.isnan(a):
                # The acceleration jumps with the stiffness.
                a = acceleration(m, c[k, 0], f[k, 0], x, v)
                evaluations += 1
            x, v, a, count, converged = alpha_step(m, scheme, h, c[k, 1], f[k, 1], x, v, a)
            evaluations += count
        states[i + 1, 0], states[i + 1, 1] = x, v
        if not within_range(x, v):
            return OVERFLOW, evaluations, a
        if not converged:
            return NOT_CONVERGED, evaluations, a
    return OK, evaluations, a


@kernel
def take_train_steps(system, closing, period, steps, states, largest):
    """Fill states, shape (k + 1, size), from the first, at the start of a mesh period.

    Returns (status, evaluations): the run ends where a state leaves `largest`, or is NaN, and
    where flanks are `jammed`.
    """
    h = 2.0 * math.pi / steps
    for i in range(states.shape[0] - 1):
        t, z = 2.0 * math.pi * (period + i // steps) + (i % steps) * h, states[i]
        k1 = train_rate(system, t, z)
        k2 = train_rate(system, t + h / 2.0, z + h / 2.0 * k1)
        k3 = train_rate(system, t + h / 2.0, z + h / 2.0 * k2)
        k4 = train_rate(system, t + h, z + h * k3)
        states[i + 1] = z + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        if jammed(system, closing, t + h, states[i + 1]):
            return JAMMED, 4 * (i + 1)
        if not np.abs(states[i + 1]).max() < largest:
            return OVERFLOW, 4 * (i + 1)
    return OK, 4 * (states.shape[0] - 1)
