"""The fast march through periods nobody looks at.

Three shortcuts over the plain march, each with a proof that it takes the same orbit:

* A whole stretch in contact is one precomputed 2 x 2 map when no flank line can be reached: when
  the amplitude is below the equilibrium deflection, or when the velocities at both ends and the
  length of the stretch leave room for no minimum in between.
* The instant of leaving the flank is found by Newton's method from its value one period ago. A
  root within half a turn with falling displacement is the first crossing: the next way down
  starts half a turn after the first minimum at the earliest.
* The instant of landing likewise: a flight from x = 0 that cannot reach the far flank returns
  once.

Whatever none of them covers goes through the plain march.
"""

import math
from typing import NamedTuple

from gearlib.core.crossing import descent_time
from gearlib.core.flight import climb_time, fly, lowest_time, phi
from gearlib.core.jit import inlined, kernel
from gearlib.core.march import march, within_range
from gearlib.core.mesh import BACKLASH, INVERSE, NORMAL
from gearlib.core.oscillator import UNDERDAMPED, evolve, propagators

#: Room for rounding in the amplitude bound.
_MARGIN = 1.0 - 1e-12
#: Newton steps this small (in radians of the contact oscillator, in shares of the flight) leave an
#: error of their square.
_QUADRATIC = 1e-9
_MAX_NEWTON = 6


class StretchMap(NamedTuple):
    """A whole stretch in contact as an affine map, and when it may be taken in one step."""

    x0: float  #: end displacement = x0 + xx x + xv v
    xx: float
    xv: float
    v0: float  #: end velocity = v0 + vx x + vv v
    vx: float
    vv: float
    single: bool  #: shorter than half a turn: at most one turning point lies within
    rest: float
    square: float
    twice_a: float
    bound: float  #: amplitude forms below this cannot reach the flank line


@kernel
def stretch_map(lev, length):
    """Return the `StretchMap` of a whole stretch of `length`."""
    c, s = propagators(lev, length)
    xx, xv, vx, vv = c + lev.a * s, s, -lev.square * s, c - lev.a * s
    return StretchMap(
        lev.rest - xx * lev.rest,
        xx,
        xv,
        -vx * lev.rest,
        vx,
        vv,
        lev.kind != UNDERDAMPED or lev.w * length < math.pi,
        lev.rest,
        lev.square,
        2.0 * lev.a,
        lev.square * lev.rest * lev.rest * _MARGIN,
    )


@inlined
def pass_stretch(along, x, v):
    """Return (x, v, safe) at the end of a stretch; `safe` if it is proven to stay in contact."""
    end_x = along.xx * x + along.xv * v + along.x0
    end_v = along.vx * x + along.vv * v + along.v0
    if along.single and end_x >= 0.0 and (v >= 0.0 or end_v < 0.0):
        return end_x, end_v, True
    u = x - along.rest
    form = along.square * u * u + v * (v + along.twice_a * u)
    return end_x, end_v, form < along.bound


@inlined
def warm_exit(lev, u, v, guess, horizon):
    """Return (t, speed): leaving of the normal flank near `guess`, proven first; else t = -1."""
    p = v + lev.a * u
    q = lev.a * v + lev.square * u
    t = guess
    for _ in range(_MAX_NEWTON):
        if not (0.0 < t <= horizon and lev.w * t <= math.pi):
            break
        c, s = propagators(lev, t)
        speed = v * c - q * s
        if not speed < 0.0:
            break
        height = lev.rest + u * c + p * s
        step = height / speed
        if lev.w * abs(step) < _QUADRATIC:
            root = t - step
            # The velocity follows to the corrected instant; its error is the square of the step.
            speed += step * (2.0 * lev.a * speed + lev.square * (height - lev.rest))
            if 0.0 < root <= horizon and speed < 0.0:
                return root, speed
            break
        t -= step
    return -1.0, 0.0


@inlined
def return_flight(m, v, guess):
    """Return (duration, landing speed) of a flight from x = 0 that cannot reach the far flank."""
    b, f = m.drag, m.pull
    if b == 0.0:
        return -2.0 * v / f, -v
    t = guess
    for _ in range(_MAX_NEWTON):
        decay, first, second = phi(2.0 * b * t)
        height = t * (v * first + f * t * second)
        speed = v * decay + f * t * first
        if not speed > 0.0:
            break
        step = height / speed
        if abs(step) < _QUADRATIC * t:
            return t - step, speed - step * (f - 2.0 * b * speed)
        t -= step
    t = lowest_time(b, f, v)
    lowest, _ = fly(b, f, 0.0, v, t)
    t += climb_time(b, f, -lowest, 0.0)
    _, speed = fly(b, f, 0.0, v, t)
    return t, speed


@kernel
def transit(m, contact, x, v, stretches, limit, no_arcs):
    """Go through `stretches` stretches from the start of a C_min stretch.

    Parameters
    ----------
    m : Mesh
    contact, x, v : int, float, float
        State at the start.
    stretches : int
        Number of stretches, C_min and whole C_max in turn.
    limit : int
        Most arcs in one stretch.
    no_arcs : ndarray, shape (0, 6)
        Arc table of the plain march, which is to write nothing.

    Returns
    -------
    contact, x, v : int, float, float
        State at the end.
    done : int
        Stretches gone through: `stretches`, or fewer when the state left the range of floating
        point numbers.
    count : int
        limit + 1 when `limit` did not suffice, else at most limit.
    """
    low_map = stretch_map(m.low, m.whole_low)
    high_map = stretch_map(m.high, 2.0 * m.half_high)
    exit_low, exit_high, airtime = -1.0, -1.0, 0.0
    escape = 2.0 * m.pull * m.gap * _MARGIN
    k = 0
    while k < stretches:
        high = k & 1 == 1
        if high:
            lev, length, along = m.high, 2.0 * m.half_high, high_map
            if not within_range(x, v):
                return contact, x, v, k, 0
        else:
            lev, length, along = m.low, m.whole_low, low_map
        if contact != NORMAL:
            contact, x, v, count = march(
                m, 1 if high else 0, 0.0, length, contact, x, v, no_arcs, 0, limit
            )
            if count > limit:
                return contact, x, v, k, count
            k += 1
            continue

        if not high:
            # Periods without a bounce, two maps each, in a loop of their own.
            while k + 1 < stretches:
                mid_x, mid_v, safe = pass_stretch(low_map, x, v)
                if not safe:
                    break
                end_x, end_v, safe = pass_stretch(high_map, mid_x, mid_v)
                if not safe:
                    break
                x, v = end_x, end_v
                k += 2
            if k == stretches:
                break
        end_x, end_v, safe = pass_stretch(along, x, v)
        if safe:
            x, v = end_x, end_v
            k += 1
            continue

        # Contact, flight, landing, contact ... until a stretch ends in contact.
        t = 0.0
        count = 0
        while True:
            count += 1
            if count > limit:
                return contact, x, v, k, count
            u = x - lev.rest
            rest_of_stretch = length - t
            if t > 0.0:
                end_x, end_v = evolve(lev, u, v, rest_of_stretch)
                end_x += lev.rest
                single = lev.kind != UNDERDAMPED or lev.w * rest_of_stretch < math.pi
                if single and end_x >= 0.0 and (v >= 0.0 or end_v < 0.0):
                    x, v = end_x, end_v
                    k += 1
                    break
            last = exit_high if high else exit_low
            leave, speed = warm_exit(lev, u, v, last - t, rest_of_stretch)
            if leave < 0.0:
                leave = descent_time(lev, u, v, -lev.rest, rest_of_stretch)
                if leave <= rest_of_stretch:
                    _, speed = evolve(lev, u, v, leave)
                if not (leave <= rest_of_stretch and speed < 0.0):
                    x, v = evolve(lev, u, v, rest_of_stretch)
                    x += lev.rest
                    k += 1
                    break
            if high:
                exit_high = t + leave
            else:
                exit_low = t + leave
            if speed * speed >= escape:
                # The far flank may be met: the plain march takes the rest of the stretch.
                flying = BACKLASH if m.gap > 0.0 else INVERSE
                contact, x, v, count = march(
                    m,
                    1 if high else 0,
                    0.0,
                    rest_of_stretch - leave,
                    flying,
                    0.0,
                    speed,
                    no_arcs,
                    0,
                    limit,
                )
                if count > limit:
                    return contact, x, v, k, count
                k += 1
                break
            airtime, landing_speed = return_flight(m, speed, airtime)
            t += leave + airtime
            while t >= length and k < stretches:
                t -= length
                k += 1
                high = not high
                if high:
                    lev, length = m.high, 2.0 * m.half_high
                else:
                    lev, length = m.low, m.whole_low
            if k == stretches:
                # Still in the air at the very end (or just landed: t = 0).
                if t > 0.0:
                    x, v = fly(m.drag, m.pull, 0.0, speed, airtime - t)
                    return BACKLASH, x, v, k, count
                return NORMAL, 0.0, landing_speed, k, count
            x, v = 0.0, landing_speed
    return contact, x, v, k, 0
