"""Constants of a gear pair, and its motion in contact and in free flight in closed form.

In contact, between two stiffness switches, the equation of motion is

    u'' + 2 a u' + W^2 u = 0,    a = beta / nu,    W^2 = c / nu^2,

where u is the displacement from the equilibrium of the stiffness level. With p = u0' + a u0 and
q = a u0' + W^2 u0, the motion is

    u(t)  = u0  C(t) + p S(t),        C = exp(-a t) cos(w t),      S = exp(-a t) sin(w t) / w
    u'(t) = u0' C(t) - q S(t),        (cosh, sinh if overdamped; 1, t if critically damped)

with w^2 = |W^2 - a^2|. In free flight, the load and the oil drag act:

    x'' + 2 b x' = f,      b = beta_m / nu,    f = 1 / nu^2 > 0.

With z = 2 b t, phi1(z) = (1 - exp(-z)) / z and phi2(z) = (1 - phi1(z)) / z, the motion is

    x(t)  = x0 + x0' t phi1 + f t^2 phi2
    x'(t) = x0' exp(-z) + f t phi1,

which also holds for b = 0 and loses no digits for small b t. The load always acts upwards, so a
flight has at most one lowest point and always ends.

Tables that are filled at each tuning use `negative_exponential` and `cos_sin`, which consist of
arithmetic only: a call of the C library takes several times as long and prevents vectorised loops.
The error of `negative_exponential` is one unit in the last place of its result, the error of
`cos_sin` one unit in the last place of 1.
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.engines.codes import COAST, DRIVE, NO_CONTACT
from gearlib.engines.jit import kernel_part

#: 1.5 * 2^52; adding it leaves the nearest integer in the last bits of the sum.
_ROUNDING = 6755399441055744.0
_LOG2_E = 1.4426950408889634
_TWO_OVER_PI = 0.6366197723675814
# ln 2 and pi / 2 in two parts, of which the first has so few bits that its multiples are exact.
_LN2_HIGH, _LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
_QUARTER_HIGH, _QUARTER_LOW = 1.57079632673412561417, 6.07710050650619224932e-11
#: Largest exponent: exp(-700) = 1e-304 replaces all smaller values.
_MAX_EXPONENT = 700.0


@kernel_part(inlined=True)
def negative_exponential(z):
    """Return exp(-z) for z >= 0 with an error of one unit in the last place, by arithmetic only.

    Without a call of the C library, loops over tables are faster and can be vectorised.
    """
    z = z if z < _MAX_EXPONENT else _MAX_EXPONENT
    # exp(-z) = 2^k exp(r), where k is an integer and |r| <= ln 2 / 2.
    rounded = _ROUNDING - z * _LOG2_E
    k = rounded - _ROUNDING
    r = (-z - k * _LN2_HIGH) - k * _LN2_LOW
    # Taylor series up to r^13 / 13!; even and odd terms are summed in parallel.
    s = r * r
    even = s * (1.0 / 3628800.0 + s * (1.0 / 479001600.0))
    even = 0.5 + s * (1.0 / 24.0 + s * (1.0 / 720.0 + s * (1.0 / 40320.0) + s * even))
    odd = s * (1.0 / 39916800.0 + s * (1.0 / 6227020800.0))
    odd = 1.0 / 6.0 + s * (1.0 / 120.0 + s * (1.0 / 5040.0 + s * (1.0 / 362880.0) + s * odd))
    # Shifting k to the exponent bits of a double gives 2^k.
    bits = (np.float64(rounded).view(np.int64) + 1023) << 52
    return (1.0 + (r + s * (even + r * odd))) * np.int64(bits).view(np.float64)


@kernel_part(inlined=True)
def cos_sin(angle):
    """Return (cosine, sine) of an angle in rad, at most 2^20 quarter turns, by arithmetic only.

    The error is one unit in the last place of 1. The polynomials are valid for |r| <= pi / 4.
    """
    rounded = angle * _TWO_OVER_PI + _ROUNDING
    k = rounded - _ROUNDING
    r = (angle - k * _QUARTER_HIGH) - k * _QUARTER_LOW
    # The angle is k quarter turns plus r. The coefficients are from the library fdlibm.
    z = r * r
    s = 2.75573137070700676789e-06 + z * (
        -2.50507602534068634195e-08 + z * 1.58969099521155010221e-10
    )
    s = 8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + z * s)
    sine = r + r * z * (-1.66666666666666324348e-01 + z * s)
    c = -2.75573143513906633035e-07 + z * (
        2.08757232129817482790e-09 - z * 1.13596475577881948265e-11
    )
    c = -1.38888888888741095749e-03 + z * (2.48015872894767294178e-05 + z * c)
    cosine = 1.0 - (0.5 * z - z * z * (4.16666666666666019037e-02 + z * c))
    quarter = np.float64(rounded).view(np.int64)
    # An odd number of quarter turns exchanges cosine and sine; the other bit gives the signs.
    is_odd = (quarter & 1) != 0
    shifted_cosine, shifted_sine = (sine, cosine) if is_odd else (cosine, sine)
    shifted_cosine = -shifted_cosine if ((quarter + 1) & 2) != 0 else shifted_cosine
    shifted_sine = -shifted_sine if (quarter & 2) != 0 else shifted_sine
    return shifted_cosine, shifted_sine


UNDERDAMPED, CRITICAL, OVERDAMPED = 1, 0, -1


class StiffnessLevel(NamedTuple):
    """Linear oscillator of a mesh in contact at one stiffness level; the time is the mesh phase."""

    decay_rate: float  #: a
    natural_squared: float  #: W^2, square of the natural frequency
    frequency: float  #: w, damped frequency; if overdamped, half the difference of the decay rates
    damping_kind: int  #: UNDERDAMPED, CRITICAL or OVERDAMPED
    equilibrium: float  #: static deflection at this stiffness, 1 / c
    stiffness: float  #: c = C / C_s, stiffness divided by its mean


@kernel_part
def stiffness_level_at_tuning(stiffness, damping, tuning):
    """Return the `StiffnessLevel`, the oscillator of a mesh in contact, at a tuning.

    `stiffness` is c = C / C_s, relative to its mean; `damping` is the damping ratio beta; `tuning`
    is nu, the mesh frequency over the natural frequency. The time is the mesh phase, so rates are
    divided by nu.
    """
    decay_rate = damping / tuning
    natural_frequency = math.sqrt(stiffness) / tuning
    # Unlike W^2 - a^2, the product does not lose digits near critical damping.
    difference = (natural_frequency - decay_rate) * (natural_frequency + decay_rate)
    damping_kind = (
        UNDERDAMPED if difference > 0.0 else (OVERDAMPED if difference < 0.0 else CRITICAL)
    )
    return StiffnessLevel(
        decay_rate=decay_rate,
        natural_squared=natural_frequency * natural_frequency,
        frequency=math.sqrt(abs(difference)),
        damping_kind=damping_kind,
        equilibrium=1.0 / stiffness,
        stiffness=stiffness,
    )


@kernel_part(inlined=True)
def fundamental_solutions(level, t):
    """Return the two fundamental solutions C and S of a linear oscillator at the time t.

    The oscillator is a `StiffnessLevel` with the decay rate a and the damped frequency w. If it is
    underdamped, C = exp(-a t) cos(w t) and S = exp(-a t) sin(w t) / w. If it is overdamped, cosh
    and sinh replace cos and sin. If it is critically damped, 1 and t replace cos(w t) and sin(w t)
    / w.
    """
    if level.damping_kind == UNDERDAMPED:
        decay = math.exp(-level.decay_rate * t)
        w = level.frequency
        return decay * math.cos(w * t), decay * math.sin(w * t) / w
    if level.damping_kind == CRITICAL:
        decay = math.exp(-level.decay_rate * t)
        return decay, decay * t
    # Factoring out exp(-(a - w) t) avoids inf * 0 and cancellation.
    decay = 0.5 * math.exp(-level.natural_squared / (level.decay_rate + level.frequency) * t)
    difference = math.expm1(-2.0 * level.frequency * t)
    return decay * (2.0 + difference), -decay * difference / level.frequency


@kernel_part(inlined=True)
def evolve(level, u, v, t):
    """Return displacement and velocity of a motion in contact, from (u, v), after the time t.

    The motion is the motion of a linear oscillator, the `StiffnessLevel` `level`. Displacements
    count from its equilibrium. The time is the mesh phase.
    """
    c, s = fundamental_solutions(level, t)
    q = level.decay_rate * v + level.natural_squared * u
    return u * c + (v + level.decay_rate * u) * s, v * c - q * s


@kernel_part
def next_turning_time(level, u, v):
    """Return the first time t > 0 at which a motion in contact has zero velocity, or infinity.

    The motion is the motion of a linear oscillator, the `StiffnessLevel` `level`. It starts with
    displacement u from the equilibrium and velocity v. An underdamped motion turns at intervals of
    pi / w, an overdamped or critically damped one at most once.
    """
    a, w, is_underdamped = level.decay_rate, level.frequency, level.damping_kind == UNDERDAMPED
    q = a * v + level.natural_squared * u
    if v == 0.0:
        # The motion is at a turning point; the next one is half an oscillation away.
        return math.pi / w if is_underdamped and u != 0.0 else math.inf
    if is_underdamped:
        # These signs in atan2 preserve the relative accuracy of a nearby turning point.
        return math.atan2(abs(v) * w, math.copysign(1.0, v) * q) / w
    if level.damping_kind == CRITICAL:
        ratio = v / q
        return ratio if ratio > 0.0 else math.inf
    # This is artanh(w v / q) / w, written such that 1 - w v / q does not cancel.
    ratio = v / (level.natural_squared * (v / (a + w) + u))
    return math.log1p(2.0 * w * ratio) / (2.0 * w) if ratio > 0.0 else math.inf


class PairConstants(NamedTuple):
    """Dimensionless constants of a gear pair with rectangular mesh stiffness at one tuning."""

    low_level: StiffnessLevel  #: oscillator at the stiffness C_min
    high_level: StiffnessLevel  #: oscillator at the stiffness C_max
    half_high_length: float  #: phase length of half the C_max segment
    low_length: float  #: phase length of the C_min segment
    drag: float  #: b = beta_m / nu, from the damping ratio beta_m in free flight
    load: float  #: f = 1 / nu^2, acceleration by the static load
    backlash_ratio: float  #: backlash in static deflections
    tuning: float  #: nu


@kernel_part
def pair_constants_at_tuning(pair_parameters, tuning):
    """Return the `PairConstants` of a gear pair at one tuning nu (mesh / natural frequency).

    `pair_parameters`, shape (7,), are C_max / C_s, C_min / C_s, the phase lengths of half the C_max
    segment and of the C_min segment, the damping ratios beta in contact and beta_m in free flight,
    and the backlash in units of the static deflection. C_s is the mean stiffness.
    """
    damping, drag = pair_parameters[4], pair_parameters[5] / tuning
    backlash_ratio = pair_parameters[6]
    high_level = stiffness_level_at_tuning(pair_parameters[0], damping, tuning)
    low_level = stiffness_level_at_tuning(pair_parameters[1], damping, tuning)
    half_high_length, low_length = pair_parameters[2], pair_parameters[3]
    load = 1.0 / (tuning * tuning)
    return PairConstants(
        low_level, high_level, half_high_length, low_length, drag, load, backlash_ratio, tuning
    )


@kernel_part
def pair_contact_state(backlash_ratio, x, v):
    """Return the contact state of a gear pair at displacement x and velocity v.

    It is 1 in drive-side contact, x >= 0, -1 in coast-side contact, x <= -backlash_ratio, and 0
    without contact. On these flank lines the velocity decides.
    """
    return contact_state_with_lines(0.0, -backlash_ratio, x, v)


@kernel_part
def contact_state_with_lines(drive_line, coast_line, x, v):
    """Return the contact state at displacement x and velocity v for two flank lines.

    It is 1 in drive-side contact, above `drive_line`, -1 in coast-side contact, below `coast_line`,
    and 0 without contact. On a line, the velocity decides the contact just afterwards; a mesh at
    rest moves up, because the load acts upwards.
    """
    if x > drive_line or (x == drive_line and v >= 0.0):
        return DRIVE
    if x < coast_line or (x == coast_line and v < 0.0):
        return COAST
    return NO_CONTACT


#: Below this z power series are used, because the closed form of phi2 would lose two digits.
_MAX_SERIES_ARGUMENT = 0.5
#: Largest Q for which `return_flight` uses the polynomial.
_MAX_POLYNOMIAL_Q = 0.5
#: Relative length of a Newton step after which the error, its square, is below rounding.
_LAST_NEWTON_STEP = 1e-10
_MAX_NEWTON_STEPS = 60


@kernel_part(inlined=True)
def _phi_series(z):
    """Return the functions phi1, phi2 and phi3 at a small z >= 0 by Taylor series.

    phi1 = (1 - exp(-z)) / z, phi2 = (1 - phi1) / z, phi3 = (1/2 - phi2) / z. These quotients would
    lose digits at small z. The series are truncated where z^13 / 15! < 1e-16.
    """
    # Horner's scheme for the series of phi3 with the coefficients 1 / 3!, -1 / 4!, ..., 1 / 14!.
    series = 1.0 / 87178291200.0
    series = 1.0 / 6227020800.0 - z * series
    series = 1.0 / 479001600.0 - z * series
    series = 1.0 / 39916800.0 - z * series
    series = 1.0 / 3628800.0 - z * series
    series = 1.0 / 362880.0 - z * series
    series = 1.0 / 40320.0 - z * series
    series = 1.0 / 5040.0 - z * series
    series = 1.0 / 720.0 - z * series
    series = 1.0 / 120.0 - z * series
    series = 1.0 / 24.0 - z * series
    phi3 = 1.0 / 6.0 - z * series
    phi2 = 0.5 - z * phi3
    return 1.0 - z * phi2, phi2, phi3


@kernel_part(inlined=True)
def phi_functions(z):
    """Return exp(-z), phi1, phi2 and phi3 for z >= 0, without loss of digits at small z.

    phi1 = (1 - exp(-z)) / z, phi2 = (1 - phi1) / z, phi3 = (1/2 - phi2) / z. A motion with linear
    drag is a combination of these functions.
    """
    if z < _MAX_SERIES_ARGUMENT:
        phi1, phi2, phi3 = _phi_series(z)
        return 1.0 - z * phi1, phi1, phi2, phi3
    complement = -math.expm1(-z)
    phi1 = complement / z
    phi2 = (1.0 - phi1) / z
    return 1.0 - complement, phi1, phi2, (0.5 - phi2) / z


@kernel_part
def free_flight(drag, load, x, v, t):
    """Return displacement and velocity of a free flight, from (x, v), after the time t.

    The equation of motion is x'' + 2 drag x' = load. In terms of the phi functions, the closed form
    also holds without drag and loses no digits at small drag.
    """
    exponential, phi1, phi2, _ = phi_functions(2.0 * drag * t)
    return x + t * (v * phi1 + load * t * phi2), v * exponential + load * t * phi1


@kernel_part
def lowest_point_time(drag, load, v):
    """Return the time until the lowest point of a free flight with initial velocity v < 0.

    The equation of motion is x'' + 2 drag x' = load, with load > 0.
    """
    if drag == 0.0:
        return -v / load
    return math.log1p(-2.0 * drag * v / load) / (2.0 * drag)


@kernel_part
def climb_time(drag, load, depth, v):
    """Return the time in which a free flight x'' + 2 drag x' = load climbs by `depth` >= 0.

    The flight starts with velocity v >= 0. Newton's method starts from the time without drag, which
    is a lower bound. It overshoots at most once, because the height is convex or concave
    throughout.
    """
    if depth <= 0.0:
        return 0.0
    t = 2.0 * depth / (v + math.sqrt(v * v + 2.0 * load * depth))
    if drag == 0.0:
        return t
    for _ in range(_MAX_NEWTON_STEPS):
        height, speed = free_flight(drag, load, -depth, v, t)
        step = height / speed
        t -= step
        if abs(step) <= _LAST_NEWTON_STEP * t:
            break
    return t


@kernel_part
def fall_time(drag, load, depth, v):
    """Return the time in which a free flight x'' + 2 drag x' = load falls by `depth` > 0.

    The flight starts with velocity v < 0 and must fall that far. Its height is a convex function of
    time, so Newton's method approaches the root from one side and cannot overshoot.
    """
    t = 0.0
    for _ in range(_MAX_NEWTON_STEPS):
        height, speed = free_flight(drag, load, depth, v, t)
        # Rounding has carried the last step beyond the root.
        if not (height > 0.0 and speed < 0.0):
            break
        step = height / speed
        t -= step
        if abs(step) <= _LAST_NEWTON_STEP * t:
            break
    return t


@kernel_part(inlined=True)
def _scaled_flight_time(q):
    """Return -T load / v for a free flight of duration T back to its initial height.

    The flight x'' + 2 drag x' = load starts with v < 0, and q = -2 drag v / load is at most 1/2.
    The scaled time depends on q only. The polynomial is a Chebyshev series in powers of 4 q - 1
    with a remainder below 1e-17.
    """
    x = 4.0 * q - 1.0
    x2 = x * x
    x4 = x2 * x2
    low_terms = 1.8568510175152666 - 0.12319979501934847 * x
    low_terms += x2 * (0.016955815698790882 - 0.0025146009094055006 * x)
    low_terms += x4 * (0.0003989940732782814 - 6.610785443764073e-05 * x)
    low_terms += (x4 * x2) * (1.127852885014331e-05 - 1.9657782437696068e-06 * x)
    high_terms = 3.4825554480466923e-07 - 6.249390899417227e-08 * x
    high_terms += x2 * (1.1331521119792905e-08 - 2.073050795636026e-09 * x)
    high_terms += x4 * (3.818970303206023e-10 - 7.00128693778487e-11 * x)
    high_terms += (x4 * x2) * (1.3022464626380772e-11 - 2.8748860555250845e-12 * x)
    return low_terms + (x4 * x4) * (high_terms + (x4 * x4) * 5.457531285323438e-13)


@kernel_part(inlined=True)
def return_flight(drag, load, v):
    """Return (duration T, impact velocity) of a free flight from x = 0 with v < 0 back to x = 0.

    The equation of motion is x'' + 2 drag x' = load. The impulses of the drag on the way down and
    on the way up cancel, so the impact velocity is v + load T. With z = 2 drag T and Q = -2 drag v
    / load, T obeys z = (1 + Q) (1 - exp(-z)), an equation that depends on Q only.
    """
    if drag == 0.0:
        return -2.0 * v / load, -v
    q = -2.0 * drag * v / load
    if q <= _MAX_POLYNOMIAL_Q:
        t = -v / load * _scaled_flight_time(q)
        return t, v + load * t
    # With strong drag the sum v + load T would lose digits.
    t = lowest_point_time(drag, load, v)
    min_x, _ = free_flight(drag, load, 0.0, v, t)
    t += climb_time(drag, load, -min_x, 0.0)
    _, speed = free_flight(drag, load, 0.0, v, t)
    return t, speed
