"""What the map of small deviations over mesh periods changes by, for every direction.

Between events the motion is linear, so that its map M is a product of the maps of arcs and of flank
crossings, which depend on the motion by the phases of the events alone: the rate of M follows from
the tangents of the motion, without second derivatives of it. Where a boundary of two arcs moves by
dtau, one lasts longer and the other less: with w' = A w on each, M changes by A_before M dtau
before the crossing and by -A_after M dtau after it. With the tangents of a family of orbits this is
the rate of their map, and that of its eigenvalues, the multipliers, follows.
"""

import math

import numpy as np

from gearlib.kernels.closed_form.arc_tangents import (
    DECAY,
    DRAG,
    SQUARE,
    SWITCH,
    bend,
    carry,
    enter,
    leave,
    line_rate,
    rates_of,
    switch_phase,
)
from gearlib.kernels.closed_form.damped_oscillator import propagators
from gearlib.kernels.closed_form.deviation import multiply
from gearlib.kernels.closed_form.event_by_event import (
    ARC_COLUMNS,
    CONTACT,
    DURATION,
    LEVEL,
    START,
    VELOCITY,
)
from gearlib.kernels.closed_form.flight import phis
from gearlib.kernels.closed_form.mesh_constants import contact_of
from gearlib.kernels.closed_form.pair_run import FIRST_ARCS, outcome, whole_period
from gearlib.kernels.closed_form.sensitivity import SLOWEST
from gearlib.kernels.closed_form.whole_periods import new_work, set_mesh, set_start
from gearlib.kernels.codes import BACKLASH, OK, OVERFLOW
from gearlib.kernels.jit import inlined, kernel
from gearlib.kernels.overflow import within_range


@inlined
def _add(a, b, c, d, matrix, rate):
    """rate <- rate + [[a, b], [c, d]] matrix."""
    for column in range(2):
        rate[0, column] += a * matrix[0, column] + b * matrix[1, column]
        rate[1, column] += c * matrix[0, column] + d * matrix[1, column]


@kernel
def _through_arc(m, rates, arc, matrix, changes):
    contact, which, t = int(arc[CONTACT]), int(arc[LEVEL]), arc[DURATION]
    lev = m.high if which == 1 else m.low
    if contact == BACKLASH:
        decay, first, second, _ = phis(2.0 * m.drag * t)
        a, b, c, d = 1.0, t * first, 0.0, decay
        # By b = beta_m / nu.
        a1, b1, c1, d1 = 0.0, 2.0 * t * t * (second - first), 0.0, -2.0 * t * decay
        a2, b2, c2, d2 = 0.0, 0.0, 0.0, 0.0
    else:
        cosine, sine = propagators(lev, t)
        r = bend(lev, t, cosine, sine)
        a, b = cosine + lev.a * sine, sine
        c, d = -lev.square * sine, cosine - lev.a * sine
        # By W^2 at fixed a, then by a.
        a2, b2 = -0.5 * t * sine - lev.a * r, -r
        c2, d2 = lev.square * r - sine, -0.5 * t * sine + lev.a * r
        a1 = sine - t * a - 2.0 * lev.a * a2
        b1 = -t * b - 2.0 * lev.a * b2
        c1 = -t * c - 2.0 * lev.a * lev.square * r
        d1 = -sine - t * d - 2.0 * lev.a * d2
    for j in range(rates.shape[1]):
        first = rates[DRAG, j] if contact == BACKLASH else rates[DECAY, j]
        second = rates[SQUARE + which, j]
        multiply(a, b, c, d, changes[j])
        _add(
            a1 * first + a2 * second,
            b1 * first + b2 * second,
            c1 * first + c2 * second,
            d1 * first + d2 * second,
            matrix,
            changes[j],
        )
    multiply(a, b, c, d, matrix)


@inlined
def _move(lev, drag, contact, sign, moved, matrix, changes):
    """Add what an arc changes that ends (sign 1) or begins (-1) so much later."""
    square, loss = (0.0, drag) if contact == BACKLASH else (lev.square, lev.a)
    for j in range(moved.shape[0]):
        step = sign * moved[j]
        _add(0.0, step, -square * step, -2.0 * loss * step, matrix, changes[j])


@kernel
def _cross(m, rates, lev, flank, sign, v, tangents, moved, matrix, changes):
    """Take map and rates over a flank line, where a flank is left (sign 1) or met (-1)."""
    before, after = (flank, BACKLASH) if sign > 0.0 else (BACKLASH, flank)
    slow = not abs(v) * m.tuning > SLOWEST
    for j in range(moved.shape[0]):
        moved[j] = math.nan if slow else (line_rate(rates, j, flank) - tangents[0, j]) / v
    loss = 2.0 * sign * (lev.a - m.drag)
    _move(lev, m.drag, before, 1.0, moved, matrix, changes)
    for j in range(moved.shape[0]):
        rate = 2.0 * sign * (rates[DECAY, j] - rates[DRAG, j])
        multiply(1.0, 0.0, loss, 1.0, changes[j])
        _add(0.0, 0.0, rate, 0.0, matrix, changes[j])
    multiply(1.0, 0.0, loss, 1.0, matrix)
    _move(lev, m.drag, after, -1.0, moved, matrix, changes)


@inlined
def _switch(m, rates, switch, contact, matrix, changes):
    if contact != BACKLASH:
        step = m.high.square - m.low.square if switch == 1 else m.low.square - m.high.square
        for j in range(rates.shape[1]):
            _add(0.0, 0.0, step * rates[SWITCH + switch, j], 0.0, matrix, changes[j])


@kernel
def vary_along(m, slopes, x, v, tangents, periods, limit, matrix, changes):
    """Go through mesh periods from (x, v) at tau = 0 with the map and its rates.

    `slopes`, shape (k, 8), and `tangents`, shape (2, k), as of `differentiate`. Fills `matrix`,
    shape (2, 2), with the map of all periods and `changes`, shape (k, 2, 2), with what it changes
    by, NaN where the motion grazes a flank line. Returns (x, v, status).
    """
    if not within_range(x, v):
        return x, v, OVERFLOW
    rates, work = rates_of(m, slopes), new_work()
    set_mesh(work, m)
    set_start(work, x, v)
    contact = before = contact_of(m.gap, x, v)
    arcs, moved = np.empty((FIRST_ARCS, ARC_COLUMNS)), np.empty(rates.shape[1])
    changes[:] = 0.0
    matrix[0, 0] = matrix[1, 1] = 1.0
    matrix[0, 1] = matrix[1, 0] = 0.0
    for n in range(periods):
        contact, x, v, count, arcs = whole_period(m, work, n, contact, x, v, limit, arcs)
        status = outcome(x, v, count, limit)
        if status != OK:
            return x, v, status
        switch = 0
        for i in range(count):
            arc = arcs[i]
            after, speed = int(arc[CONTACT]), arc[VELOCITY]
            passed = switch
            while passed < 2 and arc[START] >= switch_phase(m, passed):
                _switch(m, rates, passed, before, matrix, changes)
                passed += 1
            if after != before:
                lev = m.high if arc[LEVEL] == 1.0 else m.low
                if before != BACKLASH:
                    _cross(m, rates, lev, before, 1.0, speed, tangents, moved, matrix, changes)
                if after != BACKLASH:
                    _cross(m, rates, lev, after, -1.0, speed, tangents, moved, matrix, changes)
            switch = enter(m, rates, arc, before, switch, tangents)
            _through_arc(m, rates, arc, matrix, changes)
            carry(m, rates, arc, arc[DURATION], tangents, tangents)
            before = after
        for passed in range(switch, 2):
            _switch(m, rates, passed, contact, matrix, changes)
        leave(m, rates, contact, x, switch, tangents)
    return x, v, OK
