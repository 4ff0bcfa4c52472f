"""Fourier integrals over the mesh phase of a motion along a course of speed, arc by arc.

While stiffness and contact stay, the motion is a closed form in theta and the phase a quadratic in
it: their product has no elementary integral, but is analytic. Gauss's rule takes each arc with as
many nodes as its waves ask for; nothing is sampled across a jump.
"""

import math

import numpy as np

from gearlib.kernels.closed_form.arc_tangents import line_of
from gearlib.kernels.closed_form.damped_oscillator import evolve
from gearlib.kernels.closed_form.flight import fly
from gearlib.kernels.codes import BACKLASH
from gearlib.kernels.jit import inlined, kernel

DISPLACEMENT, VELOCITY, ACCELERATION, FORCE = range(4)
#: Columns of a break: theta, phase, whether its state is known, x, dx/dtheta, contact, stiffness.
THETA, PHASE, KNOWN, X, V, CONTACT, LEVEL, BREAK_COLUMNS = range(8)
#: Nodes of Gauss's rules, from which they begin; most of them, and waves that these resolve.
LEAST_NODES, MOST_NODES, WAVES = 8, 48, 40.0


@inlined
def later(m, contact, level, x, v, t):
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
def _acceleration(m, contact, level, x, v):
    if contact == BACKLASH:
        return m.pull - 2.0 * m.drag * v
    lev = m.high if level == 1.0 else m.low
    return m.pull - 2.0 * lev.a * v - force_of(m, contact, level, x)


@kernel
def add_waves(m, course, breaks, rows, what, step, rules, sums, squares):
    """Add the Fourier integrals of one variable over a piece of a course.

    Parameters
    ----------
    m : Mesh
        By theta, with the load of the piece.
    course : tuple
        Speed at the first break, acceleration, natural frequency: by theta.
    breaks : ndarray, shape (k + 1, 7)
        Where arcs begin, and the end; states that are not known follow from the arc before.
    rows : ndarray, shape (k,)
        Row of `sums` of each arc, negative: of none.
    what : int
        `DISPLACEMENT`, ...
    step : float
        Waves per mesh phase of the first order.
    rules : ndarray, shape (MOST_NODES + 1, 2, MOST_NODES)
        Nodes in (0, 1) and weights of Gauss's rules.
    sums : ndarray, shape (r, 2, n)
        Integrals of f cos(j step phase) and of -f sin(j step phase) over the phase, added to.
    squares : ndarray, shape (r,)
        Integrals of f^2, added to.

    Returns
    -------
    ndarray, shape (2,)
        The state at the end.
    """
    (speed, acceleration, natural), count = course, sums.shape[2]
    node = np.empty((6, MOST_NODES))
    x, v = breaks[0, X], breaks[0, V]
    origin = breaks[0, THETA]
    for i in range(rows.shape[0]):
        one = breaks[i]
        if one[KNOWN]:
            x, v = one[X], one[V]
        contact, level = int(one[CONTACT]), one[LEVEL]
        length = breaks[i + 1, THETA] - one[THETA]
        if not length > 0.0:
            continue
        fast = speed + acceleration * (one[THETA] - origin)
        top = max(fast, fast + acceleration * length)
        waves = length * (count * step * top + 2.0 * natural)
        parts = int(waves / WAVES) + 1
        size = min(MOST_NODES, LEAST_NODES + int(0.75 * waves / parts))
        for part in range(parts if rows[i] >= 0 else 0):
            row = rows[i]
            for q in range(size):
                t = length * (part + rules[size, 0, q]) / parts
                here, rate = later(m, contact, level, x, v, t)
                if what == VELOCITY:
                    value = rate
                elif what == ACCELERATION:
                    value = _acceleration(m, contact, level, here, rate)
                elif what == FORCE:
                    value = force_of(m, contact, level, here)
                else:
                    value = here
                now = fast + acceleration * t
                share = rules[size, 1, q] * length / parts * now
                angle = step * (one[PHASE] + 0.5 * (fast + now) * t)
                squares[row] += share * value * value
                node[0, q], node[1, q] = share * value, 0.0
                node[2, q], node[3, q] = math.cos(angle), -math.sin(angle)
            for j in range(count):
                real, imag = 0.0, 0.0
                for q in range(size):
                    a, b = node[0, q], node[1, q]
                    real += a
                    imag += b
                    node[0, q] = a * node[2, q] - b * node[3, q]
                    node[1, q] = a * node[3, q] + b * node[2, q]
                sums[row, 0, j] += real
                sums[row, 1, j] += imag
        x, v = later(m, contact, level, x, v, length)
    return np.array([x, v])
