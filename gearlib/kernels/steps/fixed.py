"""Fixed steps over switches and contact: classical Runge-Kutta, generalised-alpha, Newmark.

Every mesh period is cut into the same steps, so stiffness and force at their nodes are tabulated
once. Where a switch of stiffness falls on a step end, the step before it takes the stiffness
before it and the step after it that after it: the methods keep their order there. Switches and
contact inside a step are met by nothing.
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.kernels import orbit
from gearlib.kernels.codes import NOT_CONVERGED, OK, OVERFLOW
from gearlib.kernels.jit import inlined, kernel
from gearlib.kernels.overflow import within_range
from gearlib.kernels.steps.equation_of_motion import (
    SIDE,
    acceleration,
    contact_law,
    drag,
    spring,
    stiffness_at,
    waves_at,
)
from gearlib.kernels.steps.recording import DENSE, Step, fill_hermite, record_step

#: Most iterations on the contact force in one step: a linear contact takes 2 or 3.
MAX_ITERATIONS = 50
#: A residual of this share of its terms is rounding.
_REST = 1e-14


class Scheme(NamedTuple):
    """Which fixed-step method, and its constants."""

    runge_kutta: bool  #: else generalised-alpha with the constants below
    iterated: bool  #: contact at the step end, by iteration; else that of the step start
    alpha_m: float
    alpha_f: float
    beta: float
    gamma: float


@kernel
def nodes(law, steps, share):
    """Return stiffness, force, shape (steps, 3), and jumps, shape (steps,), of one mesh period.

    Columns: start of the step, `share` of it, end. `jumps`: whether the stiffness jumps at the
    start of the step.
    """
    c, f = np.empty((steps, 3)), np.empty((steps, 3))
    jumps = np.zeros(steps, dtype=np.bool_)
    for k in range(steps):
        for j, part in enumerate((0.0, share, 1.0)):
            phase = 2.0 * math.pi * ((k + part) / steps)
            side = -SIDE if part == 1.0 else SIDE
            c[k, j] = stiffness_at(law.breaks, law.pieces, law.stiffness, phase, side)
            f[k, j] = waves_at(law.force, phase)
    for k in range(steps):
        # Index -1 is the last step: the profile is periodic.
        jumps[k] = abs(c[k, 0] - c[k - 1, 2]) > 1e-9 * c[k, 0]
    return c, f, jumps


@inlined
def runge_kutta_step(m, h, c0, c1, c2, f0, f1, f2, x, v):
    """Return (x, v) after one classical Runge-Kutta step; nodes at its start, middle and end."""
    half = 0.5 * h
    k1 = acceleration(m, c0, f0, x, v)
    v2 = v + half * k1
    k2 = acceleration(m, c1, f1, x + half * v, v2)
    v3 = v + half * k2
    k3 = acceleration(m, c1, f1, x + half * v2, v3)
    v4 = v + h * k3
    k4 = acceleration(m, c2, f2, x + h * v3, v4)
    sixth = h / 6.0
    return x + sixth * (v + 2.0 * (v2 + v3) + v4), v + sixth * (k1 + 2.0 * (k2 + k3) + k4)


@inlined
def _tangents(m, x, v):
    """Return the derivatives of spring and drag on their branch, and u in g(u)."""
    touches = x >= 0.0 or x <= -m.gap
    u = 0.0
    if touches:
        u = x if x >= 0.0 else x + m.gap
    speed = abs(v)
    if touches:
        stiff = 1.0 + (2.0 * m.p2 + 3.0 * m.p3 * abs(u)) * abs(u)
        return stiff, m.d1 + (2.0 * m.d2 + 3.0 * m.d3 * speed) * speed, u
    return 0.0, m.e1 + (2.0 * m.e2 + 3.0 * m.e3 * speed) * speed, u


@inlined
def _frozen(m, x, v):
    """Return (stiffness share, offset, damping) of the step start: g = share (x + offset)."""
    speed = abs(v)
    if x >= 0.0:
        share, offset = 1.0 + (m.p2 + m.p3 * x) * x, 0.0
    elif x <= -m.gap:
        u = abs(x + m.gap)
        share, offset = 1.0 + (m.p2 + m.p3 * u) * u, m.gap
    else:
        return 0.0, 0.0, m.e1 + (m.e2 + m.e3 * speed) * speed
    return share, offset, m.d1 + (m.d2 + m.d3 * speed) * speed


@inlined
def alpha_step(m, scheme, h, c, f, x0, v0, a0):
    """Take one step of the generalised-alpha method; c and f at share 1 - alpha_f of it.

    Returns
    -------
    x, v, a : float
        At the end; a is the method's own acceleration.
    evaluations : int
    converged : bool
    """
    am, af = scheme.alpha_m, scheme.alpha_f
    # The middle state is x_p + bx a, v_p + bv a with the acceleration a at the step end.
    bx, bv = (1.0 - af) * scheme.beta * h * h, (1.0 - af) * scheme.gamma * h
    vp = v0 + (1.0 - af) * h * (1.0 - scheme.gamma) * a0
    xp = x0 + (1.0 - af) * h * (v0 + h * (0.5 - scheme.beta) * a0)
    evaluations, converged = 1, True
    if not scheme.iterated:
        share, offset, damping = _frozen(m, x0, v0)
        force = f - am * a0 - damping * vp - c * share * (xp + offset)
        a = force / (1.0 - am + damping * bv + c * share * bx)
    else:
        a, converged, evaluations = a0, False, 0
        while evaluations < MAX_ITERATIONS:
            x, v = xp + bx * a, vp + bv * a
            pull, push = drag(m, x, v), c * spring(m, x)
            residual = (1.0 - am) * a + am * a0 + pull + push - f
            stiff, damping, u = _tangents(m, x, v)
            evaluations += 1
            size = abs(a) + abs(am * a0) + abs(f) + abs(pull) + stiff * c * (abs(x) + abs(u))
            size += stiff * c * (abs(x0) + h * abs(v0))
            if abs(residual) <= _REST * size:
                converged = True
                break
            a -= residual / (1.0 - am + damping * bv + stiff * c * bx)
        if not converged:
            # Where the damping jumps with contact, the residual may jump over zero: then the
            # state lies on the line, with a damping between the two.
            for line in (0.0, -m.gap):
                if abs(line) < math.inf and not converged:
                    at = (line - xp) / bx
                    v = vp + bv * at
                    rest = (1.0 - am) * at + am * a0 - f
                    material = rest + (m.d1 + (m.d2 + m.d3 * abs(v)) * abs(v)) * v
                    oil = rest + (m.e1 + (m.e2 + m.e3 * abs(v)) * abs(v)) * v
                    evaluations += 1
                    if material * oil <= 0.0:
                        a, converged = at, True
    x = x0 + h * (v0 + h * ((0.5 - scheme.beta) * a0 + scheme.beta * a))
    v = v0 + h * ((1.0 - scheme.gamma) * a0 + scheme.gamma * a)
    return x, v, a, evaluations, converged


@kernel
def run_steps(law, scheme, steps, x, v, periods, record_periods, samples, events, limit, summary):
    """Run with `steps` fixed steps per mesh period.

    Arguments as of `gearlib.kernels.closed_form.pair_run.run`.

    Returns in addition the number of evaluations of the right-hand side, those for the record
    not counted. `limit` is not used: the steps are given.
    """
    orbit.clear_summary(summary)
    m = contact_law(law, 0.0)
    c, f, jumps = nodes(law, steps, 0.5 if scheme.runge_kutta else 1.0 - scheme.alpha_f)
    kept = min(periods, orbit.STROBE_PERIODS)
    strobes = np.empty((kept + 1, 2))
    per_period = samples.shape[0] // record_periods
    first = periods - record_periods
    dense = np.empty((2, DENSE))
    h = 2.0 * math.pi / steps
    a, converged, found, taken, evaluations = math.nan, True, 0, 0, 0
    if not within_range(x, v):
        return x, v, 0, events, 0, OVERFLOW, evaluations
    for n in range(periods):
        row = n - (periods - kept)
        if row >= 0:
            strobes[row, 0], strobes[row, 1] = x, v
        for k in range(steps):
            x0, v0 = x, v
            if scheme.runge_kutta:
                x, v = runge_kutta_step(
                    m, h, c[k, 0], c[k, 1], c[k, 2], f[k, 0], f[k, 1], f[k, 2], x, v
                )
                evaluations += 4
            else:
                if jumps[k] or (n == 0 and k == 0):
                    # The acceleration jumps with the stiffness.
                    a = acceleration(m, c[k, 0], f[k, 0], x, v)
                    evaluations += 1
                x, v, a, count, converged = alpha_step(m, scheme, h, c[k, 1], f[k, 1], x, v, a)
                evaluations += count
            if not within_range(x, v):
                return x, v, 0, events, 0, OVERFLOW, evaluations
            if not converged:
                return x, v, 0, events, 0, NOT_CONVERGED, evaluations
            if n >= first:
                a0 = acceleration(m, c[k, 0], f[k, 0], x0, v0)
                a1 = acceleration(m, c[k, 2], f[k, 2], x, v)
                fill_hermite(dense[0], h, x0, v0, x, v)
                fill_hermite(dense[1], h, v0, a0, v, a1)
                step = Step(n, k * h, h, x0, v0, x, v)
                taken, events, found = record_step(
                    law,
                    m,
                    step,
                    dense,
                    1,
                    first,
                    per_period,
                    samples,
                    taken,
                    events,
                    found,
                    summary,
                )
    strobes[kept, 0], strobes[kept, 1] = x, v
    height = summary[orbit.X_MAX] - summary[orbit.X_MIN]
    period = orbit.orbit_period(strobes, law.tuning, height)
    return x, v, period, events, found, OK, evaluations
