"""Proof that a run has settled on an orbit, and its end by the linearised map.

Let P be the map of p mesh periods, M its derivative at the stroboscopic state s, along the arcs of
the orbit, and d = P(s) - s. With the pattern of events fixed and

    D = sum_j |M^j| |d|    far below the distance from any grazing,

P has one fixed point within about D of s, and all later states lie within D of s. After k repeats
the state is P(s) + (M^k - I) e with e = -M (I - M)^-1 d, but for the curvature of P, which makes
D^2 over the lowest speed at an event: less than rounding. Where M does not contract well enough
(next to a fold, without damping), where an event is close to grazing, or where d is too large,
there is no proof: a run that creeps past the ghost of a fold has not settled.
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
from gearlib.engines.pair.whole_periods import STORED_PERIODS, advance

#: Largest D of a settled run, in static deflections, or in units of the state if that is larger.
MAX_DISTANCE = 1e-10
#: An orbit grazes no line if it stays at this distance, in static deflections, or crosses it with
#: this speed, in static deflections by natural time: MAX_DISTANCE^2 / _GRAZING_SPEED is rounding.
_GRAZING_DISTANCE, _GRAZING_SPEED = 1e-5, 1e-3
#: Smallest speed at a line over a larger D; M then hardly changes within D.
_SPEED_OVER_DISTANCE = 1e4
#: M contracts if |M^1024| <= 1 / 2, which means multipliers below 0.9993.
_DOUBLINGS = 10
#: Largest number of arcs of a mesh period in a proof.
_MAX_ARCS = 64


class Settled(NamedTuple):
    """Approach of a settled run to its orbit."""

    repeat: int  #: p, the period of the orbit; 0 if the run has not settled
    x: float  #: displacement of e = P(s) - fixed point, in static deflections
    v: float  #: velocity of e, by phase
    matrix: tuple  #: M by rows


@kernel
def not_settled():
    """Return the `Settled` of a run without a proof."""
    return Settled(0, 0.0, 0.0, (1.0, 0.0, 0.0, 1.0))


@kernel
def _size(mesh, x, v):
    """Return the norm, in static deflections, of a state with displacement x and velocity v."""
    return math.hypot(x, mesh.tuning * v)


@kernel
def repeat_of(mesh, work, n, share):
    """Return the smallest number of mesh periods after which stored states repeat, 0 if none.

    The state after n periods is compared with earlier states in `work`. The tolerance is `share`
    times the size of the state or one static deflection, whichever is larger.
    """
    x, v = work.states[n % STORED_PERIODS, 0], work.states[n % STORED_PERIODS, 1]
    tolerance = share * max(1.0, _size(mesh, x, v))
    for p in range(1, min(n, MAX_PERIOD) + 1):
        row = (n - p) % STORED_PERIODS
        if (
            abs(work.states[row, 0] - x) <= tolerance
            and mesh.tuning * abs(work.states[row, 1] - v) <= tolerance
        ):
            return p
    return 0


@kernel
def _is_off_grazing(line, x, speed, distance, share):
    """Return whether a motion at displacement x with a `speed` does not graze the flank at `line`.

    It is farther from the line than `distance`, or crosses it fast enough. `share` is the distance
    from the orbit over which the proof must hold.
    """
    return abs(x - line) > distance or abs(speed) > max(
        _GRAZING_SPEED, _SPEED_OVER_DISTANCE * share
    )


@kernel
def all_arcs_off_grazing(mesh, arcs, count, share):
    """Return whether no arc of a motion of a `Mesh` comes close to grazing a flank line.

    The ends and turning points of the first `count` rows of the arc table `arcs`, shape (n, 6), are
    checked. `share` is the distance from the orbit over which the proof must hold.
    """
    distance = max(_GRAZING_DISTANCE, 10.0 * share)
    for i in range(count):
        contact = int(arcs[i, CONTACT])
        level = mesh.high if arcs[i, LEVEL] == 1.0 else mesh.low
        duration, x, v = arcs[i, DURATION], arcs[i, DISPLACEMENT], arcs[i, VELOCITY]
        if contact == BACKLASH:
            speed = mesh.tuning * v
            is_clear = _is_off_grazing(0.0, x, speed, distance, share)
            is_clear = is_clear and _is_off_grazing(-mesh.gap, x, speed, distance, share)
            if v < 0.0:
                t = lowest_time(mesh.drag, mesh.load, v)
                if t < duration:
                    lowest, _ = fly(mesh.drag, mesh.load, x, v, t)
                    is_clear = is_clear and lowest + mesh.gap > distance
            x, v = fly(mesh.drag, mesh.load, x, v, duration)
            is_clear = is_clear and _is_off_grazing(-mesh.gap, x, mesh.tuning * v, distance, share)
        else:
            line = 0.0 if contact == NORMAL else -mesh.gap
            shift = line + level.equilibrium
            is_clear = _is_off_grazing(line, x, mesh.tuning * v, distance, share)
            t = turning_time(level, x - shift, v)
            for _ in range(2):
                if not t < duration:
                    break
                u, _v = evolve(level, x - shift, v, t)
                is_clear = is_clear and abs(u + shift - line) > distance
                if level.kind != UNDERDAMPED:
                    break
                t += math.pi / level.w
        if not is_clear:
            return False
    return True


@inlined
def product(a, b):
    """Return the product a b of two 2 x 2 matrices, given by rows as tuples."""
    return (
        a[0] * b[0] + a[1] * b[2],
        a[0] * b[1] + a[1] * b[3],
        a[2] * b[0] + a[3] * b[2],
        a[2] * b[1] + a[3] * b[3],
    )


@inlined
def _norm(mesh, a):
    """Return the Frobenius norm of a 2 x 2 map a, a tuple by rows, with scaled velocities."""
    upper, lower = a[1] / mesh.tuning, a[2] * mesh.tuning
    return math.sqrt(a[0] * a[0] + upper * upper + lower * lower + a[3] * a[3])


@kernel
def sum_of_powers(mesh, matrix):
    """Return an upper bound of 1 + |M| + |M^2| + ..., infinity if M hardly contracts.

    `matrix` is the 2 x 2 map M, a tuple by rows.
    """
    total = 1.0
    for _ in range(_DOUBLINGS):
        # The sum of twice as many powers is at most the sum times 1 + |power|.
        total *= 1.0 + _norm(mesh, matrix)
        matrix = product(matrix, matrix)
    return 2.0 * total if _norm(mesh, matrix) <= 0.5 else math.inf


@kernel
def check_settled(mesh, work, n, contact, x, v, repeat, limit, share):
    """Run through `repeat` periods and try to prove that the motion converges to an orbit.

    The motion has a contact code, displacement x and velocity v after n mesh periods; `work` is
    storage prepared for the `Mesh`, `limit` the largest number of arcs of a period. The distance
    from the orbit may be `share` of the state. Returns (contact code, x, v, number of arcs,
    `Settled`), with the state at the end of the run.
    """
    arcs, derivative = np.empty((_MAX_ARCS, ARC_COLUMNS)), np.eye(2)
    start_x, start_v, previous = x, v, contact
    clear = True
    count = 0
    for i in range(repeat):
        contact, x, v, count = advance(mesh, work, n + i, contact, x, v, np.int64(1), limit, arcs)
        if count > limit or not within_range(x, v):
            return contact, x, v, count, not_settled()
        clear = clear and count <= _MAX_ARCS
        if clear:
            clear = all_arcs_off_grazing(mesh, arcs, count, share)
            previous = follow_arcs(mesh, arcs, count, previous, derivative)
    if not clear:
        return contact, x, v, count, not_settled()
    matrix = derivative[0, 0], derivative[0, 1], derivative[1, 0], derivative[1, 1]
    dx, dv = x - start_x, v - start_v
    tolerance = share * max(1.0, _size(mesh, x, v))
    if not sum_of_powers(mesh, matrix) * _size(mesh, dx, dv) <= tolerance:
        return contact, x, v, count, not_settled()
    a, b, c, d = 1.0 - matrix[0], -matrix[1], -matrix[2], 1.0 - matrix[3]
    # The deviation d = (dx, dv) is replaced by (I - M)^-1 d, with I - M = [[a, b], [c, d]].
    factor = 1.0 / (a * d - b * c)
    dx, dv = factor * (d * dx - b * dv), factor * (a * dv - c * dx)
    ex = -(matrix[0] * dx + matrix[1] * dv)
    ev = -(matrix[2] * dx + matrix[3] * dv)
    return contact, x, v, count, Settled(repeat, ex, ev, matrix)


@kernel
def after_repeats(settled, k):
    """Return the deviation (x, v) of a `Settled` run from its orbit after k >= 0 repeats, M^k e."""
    x, v, power = settled.x, settled.v, settled.matrix
    while k > 0:
        if k % 2 == 1:
            x, v = power[0] * x + power[1] * v, power[2] * x + power[3] * v
        power = product(power, power)
        k //= 2
    return x, v
