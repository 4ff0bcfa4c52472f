"""The fast march through periods nobody looks at.

Four shortcuts over the plain march, each with a proof that it takes the same orbit:

* A whole stretch in contact is one precomputed 2 x 2 map when no flank line can be reached: when
  the amplitude is below the equilibrium deflection, or when the velocities at both ends and the
  length of the stretch leave room for no minimum in between.
* The instant of leaving the flank is found by Newton's method from its value one period ago. A
  root within half a turn with falling displacement is the first crossing: the next way down
  starts half a turn after the first minimum at the earliest. From a start that does not fall the
  same holds within a whole turn: the first way down ends, and the second starts, later.
* The instant of landing likewise: a flight from x = 0 that cannot reach the far flank returns
  once.
* Near the instants for which they were last computed, exp, sine and cosine are not computed anew:
  a short Taylor step from there is exact to rounding. Periodic orbits live on that; it costs
  others nothing, for the step is the first of Newton's method.

Whatever none of them covers goes through the plain march.
"""

import math
from typing import NamedTuple

from gearlib.core.crossing import descent_time
from gearlib.core.elementary import cos_sin, decay
from gearlib.core.flight import climb_time, fly, lowest_time, phi
from gearlib.core.jit import inlined, kernel
from gearlib.core.march import march, within_range
from gearlib.core.mesh import BACKLASH, INVERSE, NORMAL
from gearlib.core.oscillator import UNDERDAMPED, evolve, propagators

#: Room for rounding in the amplitude bound.
MARGIN = 1.0 - 1e-12
#: Times (shares of the shortest natural time) over which `taylor_step` and `step_to_line` are exact
#: to rounding: they leave out the fourth power of it, times a small factor.
SHORT = 1e-4
MAX_NEWTON = 6
SIXTH = 1.0 / 6.0


class StretchMap(NamedTuple):
    """A whole stretch in contact as an affine map, and when it may be taken in one step."""

    x0: float  #: end displacement = x0 + xx x + xv v
    xx: float
    xv: float
    v0: float  #: end velocity = v0 + vx x + vv v
    vx: float
    vv: float
    half: bool  #: shorter than half a turn: at most one turning point lies within
    whole: bool  #: shorter than a turn: at most two
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
        lev.kind != UNDERDAMPED or lev.w * length < 2.0 * math.pi,
        lev.rest,
        lev.square,
        2.0 * lev.a,
        lev.square * lev.rest * lev.rest * MARGIN,
    )


@inlined
def stays(half, whole, v, end_x, end_v):
    """Return whether a motion in contact is proven to have no minimum below the flank line.

    `half`, `whole`: shorter than half a turn, than a turn. A minimum needs a fall before it and
    a rise after it; within a turn, a motion that rises first and falls last has a maximum only.
    """
    if not end_x >= 0.0:
        return False
    if half:
        return v >= 0.0 or end_v < 0.0
    return whole and v >= 0.0 and end_v < 0.0


@inlined
def pass_stretch(along, x, v):
    """Return (x, v, safe) at the end of a stretch; `safe` if it is proven to stay in contact."""
    end_x = along.xx * x + along.xv * v + along.x0
    end_v = along.vx * x + along.vv * v + along.v0
    if stays(along.half, along.whole, v, end_x, end_v):
        return end_x, end_v, True
    u = x - along.rest
    form = along.square * u * u + v * (v + along.twice_a * u)
    return end_x, end_v, form < along.bound


class Anchor(NamedTuple):
    """Where the propagators of a level were last computed: next to it they need no exp or sine."""

    t: float  #: negative when there is none
    c: float
    s: float


class FlightAnchor(NamedTuple):
    """The same for a flight: a time and `flight.phi` of it."""

    t: float
    decay: float
    first: float
    second: float


@inlined
def anchor(lev, t):
    """Return the `Anchor` at t >= 0; none unless it lies within a turn, under-damped."""
    if lev.kind != UNDERDAMPED or not lev.w * t <= 2.0 * math.pi:
        return Anchor(-1.0, 0.0, 0.0)
    c, s = cos_sin(lev.w * t)
    e = decay(lev.a * t)
    return Anchor(t, e * c, e * s / lev.w)


@inlined
def flight_anchor(m, t):
    """Return the `FlightAnchor` at t."""
    gone, first, second = phi(2.0 * m.drag * t)
    return FlightAnchor(t, gone, first, second)


@inlined
def step_to_line(height, speed, acceleration, jerk, rate):
    """Return (step, short): the step in time to height 0, good to rounding if `short`.

    `rate` bounds the natural rates of the motion. The series of the height is inverted up to the
    third order; for a short step what is left out is less than rounding, and the root is there:
    the speed hardly changes on the way (Newton-Kantorovich).
    """
    inverse = 1.0 / speed
    r = -height * inverse
    q = 0.5 * acceleration * inverse * r
    correction = q * (2.0 * q - 1.0) - SIXTH * jerk * inverse * r * r
    bend = abs(q) + rate * abs(r)
    return (r * (1.0 + correction) if bend < 0.2 else r), bend < SHORT


@inlined
def taylor_step(u, v, twice_a, square, step):
    """Return (u, v) after a short step of the contact oscillator."""
    acceleration = -twice_a * v - square * u
    jerk = -twice_a * acceleration - square * v
    snap = -twice_a * jerk - square * acceleration
    rise = acceleration + step * (0.5 * jerk + SIXTH * step * snap)
    return u + step * (v + step * (0.5 * acceleration + SIXTH * step * jerk)), v + step * rise


@inlined
def warm_exit(lev, u, v, near, horizon):
    """Return (t, speed, anchor): leaving of the normal flank, proven first; else t = -1.

    Newton's method from the anchor `near`, which the returned one replaces.
    """
    p = v + lev.a * u
    q = lev.a * v + lev.square * u
    rate = 2.0 * lev.a + math.sqrt(lev.square)
    turn = 2.0 * math.pi if v >= 0.0 else math.pi
    for _ in range(MAX_NEWTON):
        if not 0.0 < near.t <= horizon:
            break
        above = u * near.c + p * near.s
        speed = v * near.c - q * near.s
        if not speed < 0.0:
            break
        acceleration = -2.0 * lev.a * speed - lev.square * above
        jerk = -2.0 * lev.a * acceleration - lev.square * speed
        step, short = step_to_line(lev.rest + above, speed, acceleration, jerk, rate)
        root = near.t + step
        if short:
            _, speed = taylor_step(above, speed, 2.0 * lev.a, lev.square, step)
            if 0.0 < root <= horizon and lev.w * root <= turn and speed < 0.0:
                return root, speed, near
            break
        near = anchor(lev, root)
    return -1.0, 0.0, near


@inlined
def speed_in_flight(b, speed, acceleration, step):
    """Return the speed of a flight a short step later."""
    return speed + step * acceleration * (1.0 - b * step * (1.0 - 2.0 / 3.0 * b * step))


@inlined
def return_flight(m, v, near):
    """Return (duration, landing speed, anchor): a flight from x = 0 clear of the far flank."""
    b, f = m.drag, m.pull
    if b == 0.0:
        return -2.0 * v / f, -v, near
    for _ in range(MAX_NEWTON):
        if not near.t > 0.0:
            break
        height = near.t * (v * near.first + f * near.t * near.second)
        speed = v * near.decay + f * near.t * near.first
        if not speed > 0.0:
            break
        acceleration = f - 2.0 * b * speed
        step, short = step_to_line(height, speed, acceleration, -2.0 * b * acceleration, 2.0 * b)
        if short:
            speed = speed_in_flight(b, speed, acceleration, step)
            return near.t + step, speed, near
        near = flight_anchor(m, near.t + step)
    t = lowest_time(b, f, v)
    lowest, _ = fly(b, f, 0.0, v, t)
    t += climb_time(b, f, -lowest, 0.0)
    _, speed = fly(b, f, 0.0, v, t)
    return t, speed, flight_anchor(m, t)


@inlined
def to_the_end(lev, u, v, t, near):
    """Return (u, v, anchor, known): the state after t in contact, by the anchor `near`.

    Not known when an anchor within a turn is not to be had.
    """
    d = t - near.t
    if not (near.t >= 0.0 and abs(d) * (2.0 * lev.a + math.sqrt(lev.square)) < SHORT):
        near = anchor(lev, t)
        d = 0.0
    end_u = u * near.c + (v + lev.a * u) * near.s
    end_v = v * near.c - (lev.a * v + lev.square * u) * near.s
    end_u, end_v = taylor_step(end_u, end_v, 2.0 * lev.a, lev.square, d)
    return end_u, end_v, near, near.t >= 0.0


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
    bounces, cold : int
        Flights from flank to flank by the shortcuts, and how often these did not suffice.
    """
    low_map = stretch_map(m.low, m.whole_low)
    high_map = stretch_map(m.high, 2.0 * m.half_high)
    exit_low = exit_high = end_low = end_high = Anchor(-1.0, 0.0, 0.0)
    flight = FlightAnchor(-1.0, 0.0, 0.0, 0.0)
    escape = 2.0 * m.pull * m.gap * MARGIN
    k = bounces = cold = 0
    while k < stretches:
        high = k & 1 == 1
        if high:
            lev, length, along = m.high, 2.0 * m.half_high, high_map
            if not within_range(x, v):
                return contact, x, v, k, 0, bounces, cold
        else:
            lev, length, along = m.low, m.whole_low, low_map
        if contact != NORMAL:
            cold += 1
            contact, x, v, count = march(
                m, 1 if high else 0, 0.0, length, contact, x, v, no_arcs, 0, limit
            )
            if count > limit:
                return contact, x, v, k, count, bounces, cold
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
                return contact, x, v, k, count, bounces, cold
            u = x - lev.rest
            rest_of_stretch = length - t
            if t > 0.0:
                last = end_high if high else end_low
                end_u, end_v, last, known = to_the_end(lev, u, v, rest_of_stretch, last)
                if high:
                    end_high = last
                else:
                    end_low = last
                end_x = end_u + lev.rest
                half = lev.w * rest_of_stretch < math.pi
                if known and stays(half, True, v, end_x, end_v):
                    x, v = end_x, end_v
                    k += 1
                    break
            last = exit_high if high else exit_low
            leave, speed, last = warm_exit(lev, u, v, last, rest_of_stretch)
            if leave < 0.0:
                cold += 1
                leave = descent_time(lev, u, v, -lev.rest, rest_of_stretch)
                if leave <= rest_of_stretch:
                    _, speed = evolve(lev, u, v, leave)
                if not (leave <= rest_of_stretch and speed < 0.0):
                    x, v = evolve(lev, u, v, rest_of_stretch)
                    x += lev.rest
                    k += 1
                    break
                last = anchor(lev, leave)
            if high:
                exit_high = last
            else:
                exit_low = last
            if speed * speed >= escape:
                # The far flank may be met: the plain march takes the rest of the stretch.
                cold += 1
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
                    return contact, x, v, k, count, bounces, cold
                k += 1
                break
            airtime, landing_speed, flight = return_flight(m, speed, flight)
            t += leave + airtime
            bounces += 1
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
                    return BACKLASH, x, v, k, count, bounces, cold
                return NORMAL, 0.0, landing_speed, k, count, bounces, cold
            x, v = 0.0, landing_speed
    return contact, x, v, k, 0, bounces, cold
