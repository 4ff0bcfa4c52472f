"""Constants of a mesh, and its motion in contact and in flight in closed form.

In contact, between two stiffness switches, the flanks touch as

    u'' + 2 a u' + W^2 u = 0,    a = beta / nu,    W^2 = c / nu^2,

u the displacement from the equilibrium of the present stiffness level. With p = u0' + a u0 and
q = a u0' + W^2 u0 the motion is

    u(t)  = u0  C(t) + p S(t),        C = exp(-a t) cos(w t),      S = exp(-a t) sin(w t) / w
    u'(t) = u0' C(t) - q S(t),        (cosh, sinh when over-damped; 1, t when critical)

with w^2 = |W^2 - a^2|. In the backlash it flies freely under load and oil drag:

    x'' + 2 b x' = f,      b = beta_m / nu,    f = 1 / nu^2 > 0.

With z = 2 b t and phi1(z) = (1 - exp(-z)) / z, phi2(z) = (1 - phi1(z)) / z

    x(t)  = x0 + x0' t phi1 + f t^2 phi2
    x'(t) = x0' exp(-z) + f t phi1,

which holds for b = 0 as well and loses no digits for small b t. The load always pulls up: a
flight has one lowest point at most, and always ends.
"""

import math
from typing import NamedTuple

from gearlib.engines.codes import BACKLASH, INVERSE, NORMAL
from gearlib.engines.jit import inlined, kernel

UNDERDAMPED, CRITICAL, OVERDAMPED = 1, 0, -1


class Level(NamedTuple):
    """One stiffness level: its oscillator and where it comes to rest."""

    a: float  #: decay rate
    square: float  #: W^2
    w: float  #: damped frequency, or half the difference of the two rates when over-damped
    kind: int  #: UNDERDAMPED, CRITICAL or OVERDAMPED
    equilibrium: float  #: equilibrium of the deflection, 1 / c
    stiffness: float  #: c = C / C_s


@kernel
def level(stiffness, damping, tuning):
    """Return the `Level` of stiffness c = C / C_s, damping ratio beta and tuning nu."""
    a = damping / tuning
    natural = math.sqrt(stiffness) / tuning
    # The product keeps the digits that W^2 - a^2 would lose next to critical damping.
    difference = (natural - a) * (natural + a)
    kind = UNDERDAMPED if difference > 0.0 else (OVERDAMPED if difference < 0.0 else CRITICAL)
    return Level(a, natural * natural, math.sqrt(abs(difference)), kind, 1.0 / stiffness, stiffness)


@inlined
def propagators(lev, t):
    """Return (C(t), S(t))."""
    if lev.kind == UNDERDAMPED:
        decay = math.exp(-lev.a * t)
        return decay * math.cos(lev.w * t), decay * math.sin(lev.w * t) / lev.w
    if lev.kind == CRITICAL:
        decay = math.exp(-lev.a * t)
        return decay, decay * t
    # exp(-(a - w) t) times bounded factors: never inf * 0, and a - w without cancellation.
    decay = 0.5 * math.exp(-lev.square / (lev.a + lev.w) * t)
    fast = math.expm1(-2.0 * lev.w * t)
    return decay * (2.0 + fast), -decay * fast / lev.w


@inlined
def evolve(lev, u, v, t):
    """Return (u(t), u'(t)) from (u, v) at 0."""
    c, s = propagators(lev, t)
    return u * c + (v + lev.a * u) * s, v * c - (lev.a * v + lev.square * u) * s


@kernel
def turning_time(lev, u, v):
    """Return the first t > 0 with u'(t) = 0, infinity if there is none.

    Turning points of an under-damped motion follow each other at pi / w; an over-damped or
    critical motion has one at most.
    """
    q = lev.a * v + lev.square * u
    if v == 0.0:
        # At rest on a turning point: the next one is half a turn away.
        return math.pi / lev.w if lev.kind == UNDERDAMPED and u != 0.0 else math.inf
    if lev.kind == UNDERDAMPED:
        # The signs go into atan2 so that a turning point close by keeps its relative accuracy.
        return math.atan2(abs(v) * lev.w, math.copysign(1.0, v) * q) / lev.w
    if lev.kind == CRITICAL:
        ratio = v / q
        return ratio if ratio > 0.0 else math.inf
    # artanh(w v / q) with 1 - w v / q in closed form, which heavy damping would round to zero.
    ratio = v / (lev.square * (v / (lev.a + lev.w) + u))
    return math.log1p(2.0 * lev.w * ratio) / (2.0 * lev.w) if ratio > 0.0 else math.inf


class Mesh(NamedTuple):
    """Dimensionless constants of the rectangular mesh at one tuning."""

    low: Level  #: C_min
    high: Level  #: C_max
    half_high: float  #: phase length of half the C_max segment
    whole_low: float  #: phase length of the C_min segment
    drag: float  #: b = beta_m / nu
    pull: float  #: f = 1 / nu^2
    gap: float  #: backlash in static deflections
    tuning: float  #: nu


@kernel
def mesh(ratios, tuning):
    """Return the `Mesh` at one tuning.

    `ratios`, shape (7,): C_max / C_s, C_min / C_s, half the C_max segment, the C_min segment,
    beta, beta_m, backlash in static deflections.
    """
    return Mesh(
        level(ratios[1], ratios[4], tuning),
        level(ratios[0], ratios[4], tuning),
        ratios[2],
        ratios[3],
        ratios[5] / tuning,
        1.0 / (tuning * tuning),
        ratios[6],
        tuning,
    )


@kernel
def contact_of(gap, x, v):
    """Return the contact code of a state; on a flank line, that of the motion just after.

    The load pulls up, so a state at rest on a flank line moves up.
    """
    return contact_between(0.0, -gap, x, v)


@kernel
def contact_between(upper, lower, x, v):
    """Return the contact code of a state between two contact lines, as `contact_of`."""
    if x > upper or (x == upper and v >= 0.0):
        return NORMAL
    if x < lower or (x == lower and v < 0.0):
        return INVERSE
    return BACKLASH


#: Below this z the power series of phi2 is used: the closed form would lose two digits there.
_SERIES_BELOW = 0.5
#: Up to this Q the polynomial of `return_flight` is used.
_MOST_DRAG = 0.5
#: Newton's method squares its error: a relative step this small leaves none behind.
_QUADRATIC = 1e-10
_MAX_ITERATIONS = 60


@inlined
def _phi_series(z):
    # Taylor series of phi2, (-z)^k / (k + 2)!, cut where z^13 / 15! < 1e-16.
    r = 1.0 / 87178291200.0
    r = 1.0 / 6227020800.0 - z * r
    r = 1.0 / 479001600.0 - z * r
    r = 1.0 / 39916800.0 - z * r
    r = 1.0 / 3628800.0 - z * r
    r = 1.0 / 362880.0 - z * r
    r = 1.0 / 40320.0 - z * r
    r = 1.0 / 5040.0 - z * r
    r = 1.0 / 720.0 - z * r
    r = 1.0 / 120.0 - z * r
    r = 1.0 / 24.0 - z * r
    third = 1.0 / 6.0 - z * r
    second = 0.5 - z * third
    return 1.0 - z * second, second, third


@kernel
def phi(z):
    """Return (exp(-z), phi1(z), phi2(z)) for z >= 0."""
    decay, first, second, _ = phis(z)
    return decay, first, second


@inlined
def phis(z):
    """Return those of `phi` and phi3(z) = (1/2 - phi2(z)) / z."""
    if z < _SERIES_BELOW:
        first, second, third = _phi_series(z)
        return 1.0 - z * first, first, second, third
    gone = -math.expm1(-z)
    first = gone / z
    second = (1.0 - first) / z
    return 1.0 - gone, first, second, (0.5 - second) / z


@kernel
def fly(b, f, x, v, t):
    """Return (x(t), x'(t)) from (x, v) at 0."""
    decay, first, second = phi(2.0 * b * t)
    return x + t * (v * first + f * t * second), v * decay + f * t * first


@kernel
def lowest_time(b, f, v):
    """Return the time of the lowest point of a flight that starts downwards (v < 0)."""
    if b == 0.0:
        return -v / f
    return math.log1p(-2.0 * b * v / f) / (2.0 * b)


@kernel
def climb_time(b, f, depth, v):
    """Return the time to climb `depth` >= 0 from velocity v >= 0.

    Drag delays: the undamped time is a lower bound, from which Newton's method meets the root
    after one overshoot at most, the height being convex or concave throughout.
    """
    if depth <= 0.0:
        return 0.0
    t = 2.0 * depth / (v + math.sqrt(v * v + 2.0 * f * depth))
    if b == 0.0:
        return t
    for _ in range(_MAX_ITERATIONS):
        height, speed = fly(b, f, -depth, v, t)
        step = height / speed
        t -= step
        if abs(step) <= _QUADRATIC * t:
            break
    return t


@kernel
def fall_time(b, f, depth, v):
    """Return the time to fall `depth` > 0 from velocity v < 0, given that the flight gets there.

    The height is convex on the way down and the start lies above the level, so Newton's method
    comes from one side and cannot overshoot into the climb.
    """
    t = 0.0
    for _ in range(_MAX_ITERATIONS):
        height, speed = fly(b, f, depth, v, t)
        if not (height > 0.0 and speed < 0.0):
            break
        step = height / speed
        t -= step
        if abs(step) <= _QUADRATIC * t:
            break
    return t


@inlined
def _flight_share(q):
    # T f / -v as a function of Q = -2 b v / f <= 1/2: its Chebyshev series, in powers of 4 Q - 1.
    # What it leaves out is below 1e-17; the nearest singularity lies at Q = -1.
    t = 4.0 * q - 1.0
    s = t * t
    r = s * s
    low = 1.8568510175152666 - 0.12319979501934847 * t
    low += s * (0.016955815698790882 - 0.0025146009094055006 * t)
    low += r * (0.0003989940732782814 - 6.610785443764073e-05 * t)
    low += (r * s) * (1.127852885014331e-05 - 1.9657782437696068e-06 * t)
    high = 3.4825554480466923e-07 - 6.249390899417227e-08 * t
    high += s * (1.1331521119792905e-08 - 2.073050795636026e-09 * t)
    high += r * (3.818970303206023e-10 - 7.00128693778487e-11 * t)
    high += (r * s) * (1.3022464626380772e-11 - 2.8748860555250845e-12 * t)
    return low + (r * r) * (high + (r * r) * 5.457531285323438e-13)


@inlined
def return_flight(b, f, v):
    """Return (duration, landing speed) of a flight from x = 0 with v < 0 back to it.

    The impulse of the load is the change of the velocity, since the drag of a way down is that of
    the way back: the landing speed is v + f T. With z = 2 b T and Q = -2 b v / f the duration obeys
    z = (1 + Q) (1 - exp(-z)), one function of Q for all flights.
    """
    if b == 0.0:
        return -2.0 * v / f, -v
    q = -2.0 * b * v / f
    if q <= _MOST_DRAG:
        t = -v / f * _flight_share(q)
        return t, v + f * t
    # The sum would lose digits.
    t = lowest_time(b, f, v)
    lowest, _ = fly(b, f, 0.0, v, t)
    t += climb_time(b, f, -lowest, 0.0)
    _, speed = fly(b, f, 0.0, v, t)
    return t, speed
