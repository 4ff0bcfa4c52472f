"""What Fourier integrals over the mesh phase change by, arc by arc of a course of speed.

At a fixed phase: where the speed has a factor, the time at which a phase is reached moves. What is
continuous has integrals over the arcs alone; what jumps, and does so at a phase that moves, adds
the jump.
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.kernels.closed_form.arc_tangents import line_of
from gearlib.kernels.closed_form.damped_oscillator import evolve
from gearlib.kernels.closed_form.event_by_event import (
    CONTACT,
    DISPLACEMENT,
    DURATION,
    LEVEL,
    VELOCITY,
)
from gearlib.kernels.closed_form.flight import fly
from gearlib.kernels.closed_form.sensitivity import sample
from gearlib.kernels.codes import BACKLASH
from gearlib.kernels.jit import inlined, kernel

OF_DISPLACEMENT, OF_VELOCITY, OF_ACCELERATION, OF_FORCE = range(4)
#: Nodes of Gauss's rules, from which they begin; most of them, and waves that these resolve.
LEAST_NODES, MOST_NODES, WAVES = 8, 48, 80.0


class Waves(NamedTuple):
    """Fourier integrals over the mesh phase whose derivatives are wanted: b blocks, n orders."""

    what: int  #: `OF_DISPLACEMENT`, ...
    span: float  #: phase of a block
    step: float  #: waves per mesh phase of the first order
    natural: float  #: highest natural frequency, by theta
    rules: np.ndarray  #: nodes in (0, 1) and weights, shape (MOST_NODES + 1, 2, MOST_NODES)
    sums: np.ndarray  #: of cosines and minus sines, added to, shape (b, 2, n, k)


@inlined
def _later(m, contact, level, x, v, t):
    """Return the state a time t later."""
    if contact == BACKLASH:
        return fly(m.drag, m.pull, x, v, t)
    lev = m.high if level == 1.0 else m.low
    rest = line_of(m, contact) + lev.equilibrium
    u, v = evolve(lev, x - rest, v, t)
    return u + rest, v


@inlined
def force_of(m, contact, level, x):
    """Return the elastic force of a mesh over its unit."""
    lev = m.high if level == 1.0 else m.low
    return 0.0 if contact == BACKLASH else lev.stiffness * (x - line_of(m, contact))


@inlined
def _rate_of(m, what, contact, level, x, v):
    """Return by what a variable grows in a unit of theta."""
    if what == OF_DISPLACEMENT:
        return v
    lev = m.high if level == 1.0 else m.low
    loss = m.drag if contact == BACKLASH else lev.a
    stiffness = 0.0 if contact == BACKLASH else lev.stiffness
    growth = m.pull - 2.0 * loss * v - force_of(m, contact, level, x)
    if what == OF_VELOCITY:
        return growth
    return stiffness * v if what == OF_FORCE else -2.0 * loss * growth - stiffness * v


@kernel
def add_waves(m, rates, moves, arc, phase, fast, acceleration, tangents, scratch, waves):
    """Add what the Fourier integrals of an arc change by, at fixed phases, by Gauss's rule.

    With nodes as of `gearlib.analysis.course_orders`; `phase` and the speed `fast` are those at
    the start of the arc.
    """
    length, sums, k = arc[DURATION], waves.sums, tangents.shape[1]
    end = fast + acceleration * length
    row = int((phase + 0.25 * (fast + end) * length) / waves.span)
    if row >= sums.shape[0] or not fast + end > 0.0:
        return
    contact, count = int(arc[CONTACT]), sums.shape[2]
    total = length * (count * waves.step * max(fast, end) + 2.0 * waves.natural)
    parts = int(total / WAVES) + 1
    size = min(MOST_NODES, LEAST_NODES + int(0.75 * total / parts))
    values, four = np.empty((size, k)), np.empty((4, k))
    now, turned = np.empty((2, size)), np.empty((2, size))
    for part in range(parts):
        for q in range(size):
            t = length * (part + waves.rules[size, 0, q]) / parts
            sample(m, rates, arc, t, tangents, scratch, four)
            x, v = _later(m, contact, arc[LEVEL], arc[DISPLACEMENT], arc[VELOCITY], t)
            rate, speed = (
                _rate_of(m, waves.what, contact, arc[LEVEL], x, v),
                fast + acceleration * t,
            )
            at = phase + 0.5 * (fast + speed) * t
            share = waves.rules[size, 1, q] * length / parts
            for j in range(k):
                values[q, j] = share * (speed * four[waves.what, j] - rate * at * moves[1, j])
            angle = waves.step * (at - row * waves.span)
            now[0, q], now[1, q] = 1.0, 0.0
            turned[0, q], turned[1, q] = math.cos(angle), -math.sin(angle)
        for n in range(count):
            for q in range(size):
                a, b = now[0, q], now[1, q]
                for j in range(k):
                    sums[row, 0, n, j] += a * values[q, j]
                    sums[row, 1, n, j] += b * values[q, j]
                now[0, q] = a * turned[0, q] - b * turned[1, q]
                now[1, q] = a * turned[1, q] + b * turned[0, q]


@kernel
def add_jump(phase, jump, waves):
    """Add what a variable that falls at a phase that moves adds, fall times move: `jump`, (k,)."""
    row, sums = int(phase / waves.span), waves.sums
    if row >= sums.shape[0]:
        return
    angle = waves.step * (phase - row * waves.span)
    for n in range(sums.shape[2]):
        for j in range(jump.shape[0]):
            sums[row, 0, n, j] += math.cos(n * angle) * jump[j]
            sums[row, 1, n, j] -= math.sin(n * angle) * jump[j]
