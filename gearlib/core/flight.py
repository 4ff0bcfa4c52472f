"""Backlash: closed form of the free flight under load and oil drag.

    x'' + 2 b x' = f,      b = beta_m / nu,    f = 1 / nu^2 > 0.

With z = 2 b t and phi1(z) = (1 - exp(-z)) / z, phi2(z) = (1 - phi1(z)) / z

    x(t)  = x0 + x0' t phi1 + f t^2 phi2
    x'(t) = x0' exp(-z) + f t phi1,

which holds for b = 0 as well and loses no digits for small b t. The load always pulls up: a
flight has one lowest point at most, and always ends.
"""

import math

from gearlib.core.jit import inlined, kernel

#: Below this z the power series of phi2 is used: the closed form would lose two digits there.
_SERIES_BELOW = 0.5
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
    r = 1.0 / 6.0 - z * r
    second = 0.5 - z * r
    return 1.0 - z * second, second


@kernel
def phi(z):
    """Return (exp(-z), phi1(z), phi2(z)) for z >= 0."""
    if z < _SERIES_BELOW:
        first, second = _phi_series(z)
        return 1.0 - z * first, first, second
    gone = -math.expm1(-z)
    first = gone / z
    return 1.0 - gone, first, (1.0 - first) / z


@inlined
def phi_below_two(z):
    """Return `phi` for 0 <= z < 2, without a branch: for loops over lanes."""
    h = 0.25 * z
    first, second = _phi_series(h)
    # Twice from h to 2 h: sums of positive terms.
    second, first = 0.5 * second + 0.25 * first * first, first - 0.5 * h * first * first
    second, first = 0.5 * second + 0.25 * first * first, first - h * first * first
    return 1.0 - z * first, first, second


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
