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

which holds for b = 0 as well and loses no digits for small b t. The load always acts upwards: a
flight has at most one lowest point, and always ends.
"""

import math
from typing import NamedTuple

from gearlib.engines.codes import BACKLASH, INVERSE, NORMAL
from gearlib.engines.jit import inlined, kernel

UNDERDAMPED, CRITICAL, OVERDAMPED = 1, 0, -1


class Level(NamedTuple):
    """Oscillator of one stiffness level, and its equilibrium."""

    a: float  #: decay rate
    square: float  #: W^2
    w: float  #: damped frequency, or half the difference of the two rates when over-damped
    kind: int  #: UNDERDAMPED, CRITICAL or OVERDAMPED
    equilibrium: float  #: static deflection at this stiffness, 1 / c
    stiffness: float  #: c = C / C_s


@kernel
def level_at_tuning(stiffness, damping, tuning):
    """Return the constants of motion at a stiffness level, a `Level`.

    `stiffness` is c = C / C_s, `damping` the damping ratio beta, and `tuning` nu.
    """
    a = damping / tuning
    natural = math.sqrt(stiffness) / tuning
    # The product does not lose digits near critical damping, as W^2 - a^2 would.
    difference = (natural - a) * (natural + a)
    kind = UNDERDAMPED if difference > 0.0 else (OVERDAMPED if difference < 0.0 else CRITICAL)
    return Level(a, natural * natural, math.sqrt(abs(difference)), kind, 1.0 / stiffness, stiffness)


@inlined
def propagators(level, t):
    """Return the free motions C and S of a stiffness `Level` after the time t.

    Under-damped they are C = exp(-a t) cos(w t) and S = exp(-a t) sin(w t) / w.
    """
    if level.kind == UNDERDAMPED:
        decay = math.exp(-level.a * t)
        return decay * math.cos(level.w * t), decay * math.sin(level.w * t) / level.w
    if level.kind == CRITICAL:
        decay = math.exp(-level.a * t)
        return decay, decay * t
    # The form exp(-(a - w) t) times bounded factors never gives inf * 0 and does not cancel.
    decay = 0.5 * math.exp(-level.square / (level.a + level.w) * t)
    difference = math.expm1(-2.0 * level.w * t)
    return decay * (2.0 + difference), -decay * difference / level.w


@inlined
def evolve(level, u, v, t):
    """Return the displacement and velocity of a motion in contact after the time t.

    It starts with displacement u and velocity v; displacements count from the equilibrium of the
    stiffness `Level`.
    """
    c, s = propagators(level, t)
    return u * c + (v + level.a * u) * s, v * c - (level.a * v + level.square * u) * s


@kernel
def turning_time(level, u, v):
    """Return the first time t > 0 at which a motion in contact has zero velocity, or infinity.

    It starts with displacement u from the equilibrium of the stiffness `Level` and velocity v. An
    under-damped motion turns at intervals pi / w, an over-damped or critical one at most once.
    """
    q = level.a * v + level.square * u
    if v == 0.0:
        # The motion is at a turning point; the next one is half a turn away.
        return math.pi / level.w if level.kind == UNDERDAMPED and u != 0.0 else math.inf
    if level.kind == UNDERDAMPED:
        # With the signs in atan2 a turning point close by keeps its relative accuracy.
        return math.atan2(abs(v) * level.w, math.copysign(1.0, v) * q) / level.w
    if level.kind == CRITICAL:
        ratio = v / q
        return ratio if ratio > 0.0 else math.inf
    # This is artanh(w v / q) / w, written such that 1 - w v / q does not cancel.
    ratio = v / (level.square * (v / (level.a + level.w) + u))
    return math.log1p(2.0 * level.w * ratio) / (2.0 * level.w) if ratio > 0.0 else math.inf


class Mesh(NamedTuple):
    """Dimensionless constants of the rectangular mesh at one tuning."""

    low: Level  #: C_min
    high: Level  #: C_max
    half_high: float  #: phase length of half the C_max segment
    whole_low: float  #: phase length of the C_min segment
    drag: float  #: b = beta_m / nu
    load: float  #: f = 1 / nu^2
    gap: float  #: backlash in static deflections
    tuning: float  #: nu


@kernel
def mesh_at_tuning(ratios, tuning):
    """Return the constants of a gear pair at one tuning nu, a `Mesh`.

    `ratios`, shape (7,), are C_max / C_s, C_min / C_s, the phase lengths of half the C_max segment
    and of the C_min segment, damping ratios beta in contact and beta_m in flight, and the backlash
    in static deflections.
    """
    return Mesh(
        level_at_tuning(ratios[1], ratios[4], tuning),
        level_at_tuning(ratios[0], ratios[4], tuning),
        ratios[2],
        ratios[3],
        ratios[5] / tuning,
        1.0 / (tuning * tuning),
        ratios[6],
        tuning,
    )


@kernel
def contact_of(gap, x, v):
    """Return the contact code (1 drive side, 0 loss, -1 back side) at displacement x, velocity v.

    `gap` is the backlash. On a flank line the code is valid just after; the load acts upwards, so
    that a mesh at rest moves up.
    """
    return contact_between(0.0, -gap, x, v)


@kernel
def contact_between(upper, lower, x, v):
    """Return the contact code (1 drive side, 0 loss, -1 back side) at displacement x, velocity v.

    The drive-side flanks touch at x = `upper`, the back-side flanks at x = `lower`.
    """
    if x > upper or (x == upper and v >= 0.0):
        return NORMAL
    if x < lower or (x == lower and v < 0.0):
        return INVERSE
    return BACKLASH


#: Below this z the power series of phi2 is used: the closed form would lose two digits there.
_SERIES_BELOW = 0.5
#: Largest Q for which `return_flight` uses the polynomial.
_MAX_POLYNOMIAL_Q = 0.5
#: Relative step of Newton's method after which its squared error is below rounding.
_LAST_NEWTON_STEP = 1e-10
_MAX_ITERATIONS = 60


@inlined
def _phi_series(z):
    """Return phi1, phi2 and phi3 at a small z >= 0 by Taylor series, cut where z^13 / 15! < 1e-16.

    phi1 = (1 - exp(-z)) / z, phi2 = (1 - phi1) / z, phi3 = (1/2 - phi2) / z.
    """
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
    """Return exp(-z), phi1 = (1 - exp(-z)) / z and phi2 = (1 - phi1) / z for z >= 0."""
    decay, first, second, _ = phis(z)
    return decay, first, second


@inlined
def phis(z):
    """Return exp(-z), phi1, phi2 and phi3 for z >= 0, without loss of digits at small z.

    phi1 = (1 - exp(-z)) / z, phi2 = (1 - phi1) / z, phi3 = (1/2 - phi2) / z.
    """
    if z < _SERIES_BELOW:
        first, second, third = _phi_series(z)
        return 1.0 - z * first, first, second, third
    decayed = -math.expm1(-z)
    first = decayed / z
    second = (1.0 - first) / z
    return 1.0 - decayed, first, second, (0.5 - second) / z


@kernel
def fly(drag, load, x, v, t):
    """Return the displacement and velocity of a flight after the time t.

    The flight x'' + 2 drag x' = load starts with displacement x and velocity v.
    """
    decay, first, second = phi(2.0 * drag * t)
    return x + t * (v * first + load * t * second), v * decay + load * t * first


@kernel
def lowest_time(drag, load, v):
    """Return the time of the lowest point of x'' + 2 drag x' = load with initial velocity v < 0."""
    if drag == 0.0:
        return -v / load
    return math.log1p(-2.0 * drag * v / load) / (2.0 * drag)


@kernel
def climb_time(drag, load, depth, v):
    """Return the time in which the flight x'' + 2 drag x' = load climbs by `depth` >= 0.

    It starts with velocity v >= 0. Newton's method starts from the undamped time, a lower bound,
    and overshoots at most once, since the height is convex or concave throughout.
    """
    if depth <= 0.0:
        return 0.0
    t = 2.0 * depth / (v + math.sqrt(v * v + 2.0 * load * depth))
    if drag == 0.0:
        return t
    for _ in range(_MAX_ITERATIONS):
        height, speed = fly(drag, load, -depth, v, t)
        step = height / speed
        t -= step
        if abs(step) <= _LAST_NEWTON_STEP * t:
            break
    return t


@kernel
def fall_time(drag, load, depth, v):
    """Return the time in which the flight x'' + 2 drag x' = load falls by `depth` > 0.

    It starts with velocity v < 0 and must fall that far. The height is convex on the way down, so
    that Newton's method approaches the root from one side and cannot overshoot.
    """
    t = 0.0
    for _ in range(_MAX_ITERATIONS):
        height, speed = fly(drag, load, depth, v, t)
        if not (height > 0.0 and speed < 0.0):
            break
        step = height / speed
        t -= step
        if abs(step) <= _LAST_NEWTON_STEP * t:
            break
    return t


@inlined
def _scaled_flight_time(q):
    """Return the duration T of a flight back to its starting height, scaled as -T load / v.

    The flight x'' + 2 drag x' = load starts with v < 0; q = -2 drag v / load is at most 1/2. The
    polynomial is a Chebyshev series in powers of 4 q - 1 with a remainder below 1e-17.
    """
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
def return_flight(drag, load, v):
    """Return (duration T, landing velocity) of a flight from x = 0 with v < 0 back to x = 0.

    The equation of motion is x'' + 2 drag x' = load. The drag impulses of the way down and up
    cancel, so that the landing velocity is v + load T. With z = 2 drag T and Q = -2 drag v / load,
    T obeys z = (1 + Q) (1 - exp(-z)), one function of Q for all flights.
    """
    if drag == 0.0:
        return -2.0 * v / load, -v
    q = -2.0 * drag * v / load
    if q <= _MAX_POLYNOMIAL_Q:
        t = -v / load * _scaled_flight_time(q)
        return t, v + load * t
    # For strong drag the sum v + load T would lose digits.
    t = lowest_time(drag, load, v)
    lowest, _ = fly(drag, load, 0.0, v, t)
    t += climb_time(drag, load, -lowest, 0.0)
    _, speed = fly(drag, load, 0.0, v, t)
    return t, speed
