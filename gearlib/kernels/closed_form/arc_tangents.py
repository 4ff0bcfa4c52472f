"""How the derivatives of a motion by parameters and start go along its arcs.

A *tangent* w = (dx/dp, dx'/dp), at fixed phase, belongs to one direction p: a parameter, or a
component of the start. Along an arc x(t) = X(x0, x0', t; p) has a closed form, and so has w, with
all that p changes at once. At an event the arc ends at a phase that moves by dtau:

    w_after = w_before + (f_before - f_after) dtau,    f = (x', x'').

A switch of the stiffness happens at a given phase, dtau is that of p, and f jumps by the mesh force
alone. A flank line at x = line(p) is met at dtau = (line' - w_x) / x', and f jumps by the damping
alone, which is proportional to x': the velocity cancels, and w is finite even at a grazing. There
the phase of the event, and it alone, moves like a square root.
"""

import math

import numpy as np

from gearlib.kernels.closed_form.damped_oscillator import propagators
from gearlib.kernels.closed_form.event_by_event import (
    CONTACT,
    DISPLACEMENT,
    LEVEL,
    START,
    VELOCITY,
)
from gearlib.kernels.closed_form.flight import phis
from gearlib.kernels.codes import BACKLASH, INVERSE
from gearlib.kernels.jit import inlined, kernel

# What the constants of a mesh change by, columns of `rates`; for two levels or switches, two.
DECAY, SQUARE, EQUILIBRIUM, DRAG, PULL, GAP, SWITCH, STIFFNESS = 0, 1, 3, 5, 6, 7, 8, 10
RATES = 12
#: Below this (w t)^2 a power series is used: the closed form would lose digits there.
_SERIES_BELOW = 1.0


@inlined
def line_of(m, contact):
    """Return the flank line that is touched: where the mesh force vanishes."""
    return -m.gap if contact == INVERSE else 0.0


@inlined
def bend(lev, t, c, s):
    """Return -dS/d(w^2) = (S - t C) / (2 w^2) for the propagators C, S at t."""
    square = lev.kind * lev.w * lev.w
    y = square * t * t
    if abs(y) >= _SERIES_BELOW:
        return (s - t * c) / (2.0 * square)
    # (sin - y cos) / y^3 in powers of y^2, cut where the next term is below 1e-18.
    r = 1.0 / 22230464256000.0 - y / 6758061133824000.0
    r = 1.0 / 93405312000.0 - y * r
    r = 1.0 / 518918400.0 - y * r
    r = 1.0 / 3991680.0 - y * r
    r = 1.0 / 45360.0 - y * r
    r = 1.0 / 840.0 - y * r
    r = 1.0 / 30.0 - y * r
    return 0.5 * math.exp(-lev.a * t) * t * t * t * (1.0 / 3.0 - y * r)


@inlined
def carry(m, rates, arc, t, tangents, ahead):
    """Take `tangents`, shape (2, k), from the start of `arc`, a row of the table, to t after it.

    `rates`, shape (12, k): what the constants of the mesh change by, for each direction. Fills
    `ahead`, which may be `tangents`; returns the state (x, v) at t.
    """
    contact, which = int(arc[CONTACT]), int(arc[LEVEL])
    x, v = arc[DISPLACEMENT], arc[VELOCITY]
    if contact == BACKLASH:
        f = m.pull * t
        decay, first, second, third = phis(2.0 * m.drag * t)
        reach = t * first
        # phi1' = phi2 - phi1 and phi2' = 2 phi3 - phi2, which lose no digits.
        by_drag = 2.0 * t * t * (v * (second - first) + f * (2.0 * third - second))
        speed_by_drag = 2.0 * t * (f * (second - first) - v * decay)
        by_pull = t * t * second
        for j in range(tangents.shape[1]):
            along, rate = tangents[0, j], tangents[1, j]
            drag, pull = rates[DRAG, j], rates[PULL, j]
            ahead[0, j] = along + reach * rate + by_drag * drag + by_pull * pull
            ahead[1, j] = decay * rate + speed_by_drag * drag + reach * pull
        return x + t * (v * first + f * second), v * decay + f * first
    lev = m.high if which == 1 else m.low
    equilibrium = line_of(m, contact) + lev.equilibrium
    u = x - equilibrium
    c, s = propagators(lev, t)
    p, q, r = v + lev.a * u, lev.a * v + lev.square * u, bend(lev, t, c, s)
    end, end_v = u * c + p * s, v * c - q * s
    # By w^2 = W^2 - a^2 at fixed a; then by a and W^2, of which it depends.
    by_w, speed_by_w = -0.5 * t * s * u - p * r, -0.5 * t * s * v + q * r
    by_decay = s * u - t * end - 2.0 * lev.a * by_w
    speed_by_decay = -s * v - t * end_v - 2.0 * lev.a * speed_by_w
    speed_by_square = speed_by_w - s * u
    a, b, d, e = c + lev.a * s, s, -lev.square * s, c - lev.a * s
    far = 1.0 if contact == INVERSE else 0.0
    for j in range(tangents.shape[1]):
        shift = rates[EQUILIBRIUM + which, j] - far * rates[GAP, j]
        along, rate = tangents[0, j] - shift, tangents[1, j]
        decay, square = rates[DECAY, j], rates[SQUARE + which, j]
        ahead[0, j] = shift + a * along + b * rate + by_decay * decay + by_w * square
        ahead[1, j] = d * along + e * rate + speed_by_decay * decay + speed_by_square * square
    return end + equilibrium, end_v


@inlined
def switch_phase(m, switch):
    """Return the phase, from the start of a mesh period, of its first or second switch."""
    return m.half_high if switch == 0 else m.half_high + m.whole_low


@inlined
def switch_stiffness(m, rates, switch, contact, x, tangents):
    """Change tangents at the first (0) or second (1) switch of the stiffness of a period."""
    if contact == BACKLASH:
        return
    step = m.high.square - m.low.square if switch == 1 else m.low.square - m.high.square
    jump = step * (x - line_of(m, contact))
    for j in range(tangents.shape[1]):
        tangents[1, j] += jump * rates[SWITCH + switch, j]


@inlined
def flank_of(before, after):
    """Return the contact code of the flank that is left or met; between two flanks, that left."""
    return after if before == BACKLASH else before


@inlined
def line_rate(rates, j, flank):
    """Return what the line of a flank changes by."""
    return -rates[GAP, j] if flank == INVERSE else 0.0


@inlined
def cross_line(m, rates, lev, flank, sign, tangents):
    """Change tangents where a flank is left (sign 1) or met (-1)."""
    loss = 2.0 * sign * (lev.a - m.drag)
    for j in range(tangents.shape[1]):
        tangents[1, j] += loss * (tangents[0, j] - line_rate(rates, j, flank))


@kernel
def enter(m, rates, arc, before, switch, tangents):
    """Take tangents into an arc: over a switch of the stiffness, a flank line, or both.

    `before` is the contact code of the arc before it, `switch` the number of the next switch.
    Returns that behind it. On the flank line both may come at once: there is no mesh force.
    """
    contact = int(arc[CONTACT])
    while switch < 2 and arc[START] >= switch_phase(m, switch):
        switch_stiffness(m, rates, switch, before, arc[DISPLACEMENT], tangents)
        switch += 1
    if contact != before:
        lev = m.high if arc[LEVEL] == 1.0 else m.low
        # Without a way between the flanks one is left and the other met at once.
        if before != BACKLASH:
            cross_line(m, rates, lev, before, 1.0, tangents)
        if contact != BACKLASH:
            cross_line(m, rates, lev, contact, -1.0, tangents)
    return switch


@kernel
def leave(m, rates, contact, x, switch, tangents):
    """Take tangents over the switches at the end of a period: of contact ratio 1."""
    while switch < 2:
        switch_stiffness(m, rates, switch, contact, x, tangents)
        switch += 1


@kernel
def rates_of(m, slopes):
    """Return the `rates`, shape (12, k), of directions.

    `slopes`, shape (k, 8): what the ratios of `mesh` and the tuning change by.
    """
    nu = m.tuning
    rates = np.empty((RATES, slopes.shape[0]))
    for j in range(slopes.shape[0]):
        share = slopes[j, 7] / nu
        rates[DECAY, j] = slopes[j, 4] / nu - m.low.a * share
        rates[SQUARE, j] = slopes[j, 1] / (nu * nu) - 2.0 * m.low.square * share
        rates[SQUARE + 1, j] = slopes[j, 0] / (nu * nu) - 2.0 * m.high.square * share
        rates[EQUILIBRIUM, j] = -slopes[j, 1] * m.low.equilibrium * m.low.equilibrium
        rates[EQUILIBRIUM + 1, j] = -slopes[j, 0] * m.high.equilibrium * m.high.equilibrium
        rates[DRAG, j] = slopes[j, 5] / nu - m.drag * share
        rates[PULL, j] = -2.0 * m.pull * share
        rates[GAP, j] = slopes[j, 6]
        rates[SWITCH, j] = slopes[j, 2]
        rates[SWITCH + 1, j] = slopes[j, 2] + slopes[j, 3]
        rates[STIFFNESS, j], rates[STIFFNESS + 1, j] = slopes[j, 1], slopes[j, 0]
    return rates
