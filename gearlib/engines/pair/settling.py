"""When a run has settled, and where it then ends.

Let P be the map of p mesh periods, M its derivative at the stroboscopic state s, along the arcs of
the orbit, and d = P(s) - s. With the pattern of events fixed and

    D = sum_j |M^j| |d|    far below the distance from any grazing,

P has one fixed point within about D of s, and all later states lie within D of it. After k repeats
the state is P(s) + (M^k - I) e with e = -M (I - M)^-1 d, but for the curvature of P, which makes
D^2 over the lowest speed at an event: less than rounding. Where M does not contract well enough
(next to a fold, without damping), where an event is close to grazing, or d too large, nothing is
concluded: a run that creeps past the ghost of a fold has not settled.
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.engines.codes import BACKLASH, NORMAL
from gearlib.engines.jit import inlined, kernel
from gearlib.engines.orbit import MAX_PERIOD
from gearlib.engines.overflow import within_range
from gearlib.engines.pair.events import (
    ARC_COLUMNS,
    CONTACT,
    DISPLACEMENT,
    DURATION,
    LEVEL,
    VELOCITY,
)
from gearlib.engines.pair.maps import follow_arcs
from gearlib.engines.pair.motion import UNDERDAMPED, evolve, fly, lowest_time, turning_time
from gearlib.engines.pair.whole_periods import KEPT, advance

#: D in static deflections, in units of the state where that is larger.
NEAR = 1e-10
#: An orbit grazes no line if it stays this far from it, in static deflections, or meets it with
#: this speed, in static deflections by natural time: NEAR^2 / _QUICK is rounding. For a larger D it
#: stays ten times that far, or is so many times as fast: M then changes by far less than it takes.
_CLEAR, _QUICK, _SLOW = 1e-5, 1e-3, 1e4
#: M contracts if |M^1024| <= 1 / 2: multipliers below 0.9993.
_DOUBLINGS = 10
_MOST_ARCS = 64


class Settled(NamedTuple):
    """How a run that has settled closes in on its orbit."""

    repeat: int  #: p; 0 when the run has not settled
    x: float  #: e = P(s) - fixed point, in static deflections
    v: float  #: by phase
    matrix: tuple  #: M by rows


@kernel
def not_settled():
    """Return the `Settled` of a run of which nothing is known."""
    return Settled(0, 0.0, 0.0, (1.0, 0.0, 0.0, 1.0))


@kernel
def _size(m, x, v):
    return math.hypot(x, m.tuning * v)


@kernel
def repeat_of(m, work, n, share):
    """Return the smallest p for which the state after n periods is that of p periods before.

    The states are compared within `share` of their size, or of a static deflection if that is
    larger; 0 if there is none.
    """
    x, v = work.states[n % KEPT, 0], work.states[n % KEPT, 1]
    near = share * max(1.0, _size(m, x, v))
    for p in range(1, min(n, MAX_PERIOD) + 1):
        row = (n - p) % KEPT
        if abs(work.states[row, 0] - x) <= near and m.tuning * abs(work.states[row, 1] - v) <= near:
            return p
    return 0


@kernel
def _clear_of(line, x, speed, clear, share):
    return abs(x - line) > clear or abs(speed) > max(_QUICK, _SLOW * share)


@kernel
def clear_of_grazing(m, arcs, count, share):
    """Return whether all arcs keep clear of a tangency with a flank line, for D up to `share`.

    Looked at are the ends of the arcs and, within them, the points nearest to a line.
    """
    clearance = max(_CLEAR, 10.0 * share)
    for i in range(count):
        contact = int(arcs[i, CONTACT])
        lev = m.high if arcs[i, LEVEL] == 1.0 else m.low
        duration, x, v = arcs[i, DURATION], arcs[i, DISPLACEMENT], arcs[i, VELOCITY]
        if contact == BACKLASH:
            speed = m.tuning * v
            clear = _clear_of(0.0, x, speed, clearance, share)
            clear = clear and _clear_of(-m.gap, x, speed, clearance, share)
            if v < 0.0:
                t = lowest_time(m.drag, m.pull, v)
                if t < duration:
                    lowest, _ = fly(m.drag, m.pull, x, v, t)
                    clear = clear and lowest + m.gap > clearance
            x, v = fly(m.drag, m.pull, x, v, duration)
            clear = clear and _clear_of(-m.gap, x, m.tuning * v, clearance, share)
        else:
            line = 0.0 if contact == NORMAL else -m.gap
            shift = line + lev.equilibrium
            clear = _clear_of(line, x, m.tuning * v, clearance, share)
            t = turning_time(lev, x - shift, v)
            for _ in range(2):
                if not t < duration:
                    break
                u, _v = evolve(lev, x - shift, v, t)
                clear = clear and abs(u + shift - line) > clearance
                if lev.kind != UNDERDAMPED:
                    break
                t += math.pi / lev.w
        if not clear:
            return False
    return True


@inlined
def multiplied(a, b):
    """Return the product a b of two maps by rows."""
    return (
        a[0] * b[0] + a[1] * b[2],
        a[0] * b[1] + a[1] * b[3],
        a[2] * b[0] + a[3] * b[2],
        a[2] * b[1] + a[3] * b[3],
    )


@inlined
def _norm(m, a):
    """Return the norm (Frobenius) of a map of states in displacements."""
    across, back = a[1] / m.tuning, a[2] * m.tuning
    return math.sqrt(a[0] * a[0] + across * across + back * back + a[3] * a[3])


@kernel
def sum_of_powers(m, matrix):
    """Return a bound of 1 + |M| + |M^2| + ..., infinity where M does not contract well enough."""
    total = 1.0
    for _ in range(_DOUBLINGS):
        # The sum of twice as many powers is at most the sum times 1 + |power|.
        total *= 1.0 + _norm(m, matrix)
        matrix = multiplied(matrix, matrix)
    return 2.0 * total if _norm(m, matrix) <= 0.5 else math.inf


@kernel
def check_settled(m, work, n, contact, x, v, repeat, limit, share):
    """Go through `repeat` periods as `advance`; return (contact, x, v, count, settled).

    D may be `share` of the state.
    """
    arcs, derivative = np.empty((_MOST_ARCS, ARC_COLUMNS)), np.eye(2)
    start_x, start_v, previous = x, v, contact
    clear = True
    count = 0
    for i in range(repeat):
        contact, x, v, count = advance(m, work, n + i, contact, x, v, np.int64(1), limit, arcs)
        if count > limit or not within_range(x, v):
            return contact, x, v, count, not_settled()
        clear = clear and count <= _MOST_ARCS
        if clear:
            clear = clear_of_grazing(m, arcs, count, share)
            previous = follow_arcs(m, arcs, count, previous, derivative)
    if not clear:
        return contact, x, v, count, not_settled()
    matrix = derivative[0, 0], derivative[0, 1], derivative[1, 0], derivative[1, 1]
    dx, dv = x - start_x, v - start_v
    near = share * max(1.0, _size(m, x, v))
    if not sum_of_powers(m, matrix) * _size(m, dx, dv) <= near:
        return contact, x, v, count, not_settled()
    a, b, c, d = 1.0 - matrix[0], -matrix[1], -matrix[2], 1.0 - matrix[3]
    share = 1.0 / (a * d - b * c)
    dx, dv = share * (d * dx - b * dv), share * (a * dv - c * dx)
    ex = -(matrix[0] * dx + matrix[1] * dv)
    ev = -(matrix[2] * dx + matrix[3] * dv)
    return contact, x, v, count, Settled(repeat, ex, ev, matrix)


@kernel
def after_repeats(settled, k):
    """Return M^k e: how far a run that has settled is from its orbit after k >= 0 repeats."""
    x, v, power = settled.x, settled.v, settled.matrix
    while k > 0:
        if k % 2 == 1:
            x, v = power[0] * x + power[1] * v, power[2] * x + power[3] * v
        power = multiplied(power, power)
        k //= 2
    return x, v
