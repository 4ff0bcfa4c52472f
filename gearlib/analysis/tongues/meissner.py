"""Hill-Meissner equation of the mesh that never loses contact: tongues in closed form.

In the time t = tau / nu deviations from the orbit without loss of contact obey

    x'' + 2 beta x' + c(t) x = 0,      c = C / C_s in two levels,

and with x = exp(-beta t) u there is no damping left: u'' + q u = 0, q = c - beta^2. Let u1 (even)
and u2 (odd) be the solutions that start in the middle of the segment of C_max, taken half a mesh
period on, to the middle of the other. Since the stiffness is even, the trace T of u over one period
factorises,

    T - 2 = 4 u1' u2,      T + 2 = 4 u1 u2',

so that the edges of the gap of order n, where |T| >= 2, are zeros of single closed forms, all of
them simple: the phase angles of u1 and u2 are n pi / 2 there. The gap is a point where both
coincide. Over one period x has the multipliers exp(-2 pi beta / nu) times those of u: in the gap of
order n deviations grow where

    |T| / 2 - 1 > 2 sinh^2(pi beta / nu),

the tongue of order n, near nu = 2 / n; on its edges the multiplier is (-1)^n. The logarithm of the
growth is concave over 1 / nu in a gap without over-damped segment (it is a sum of logarithms of
|1 - E nu^2| with E outside of the gap, less a linear term), so that a tongue is one interval.

One mesh period of the motion without loss of contact is the affine map z -> M z + b of z = (x, x'),
with Liouville's det M = exp(-4 pi beta / nu). Its fixed point is the orbit without loss of contact.

Theory: Magnus, Winkler, Hill's Equation (1966), chapters 1, 2 and 7; E. Meissner, Schweizerische
Bauzeitung 72 (1918) 95-98.
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from gearlib.data import status
from gearlib.engines.pair.stiffness import levels, segment_lengths
from gearlib.runs.run_arguments import MAX_EVENTS

#: Relative tolerance of roots, the smallest that the solver takes.
MACHINE_PRECISION = 4.0 * np.finfo(float).eps
#: Beyond this exponent exp is taken apart, so that nothing overflows.
_MAX_EXPONENT = 300.0
#: Phase of the segment of C_min below which its angle is taken from the ends, not from its speed.
_SMALL_ANGLE = 0.5
#: Dampings at which the growth of a tongue is looked at to bracket the one that closes it.
_SCANNED_DAMPINGS = 40


class Meissner(NamedTuple):
    """The equation of u: lengths of the half segments, q on them, and the damping ratio."""

    half_high: float
    half_low: float
    high: float
    low: float
    damping: float


class Tongue(NamedTuple):
    """A tongue: where deviations grow, and by how much."""

    order: int  #: half waves per mesh period, near nu = 2 / order; 0: not counted
    multiplier: int  #: on the edges: 1 or -1; 0: a complex pair
    start: float  #: first tuning; NaN: the tongue is closed
    stop: float  #: last tuning
    growth: float  #: largest logarithm of the growth per mesh period; below 0: closed
    peak: float  #: its tuning


def equation(contact_ratio, stiffness_ratio, damping):
    """Return the `Meissner` equation of contact ratio, stiffness ratio and damping ratio."""
    half_high, whole_low = segment_lengths(contact_ratio)
    high, low = np.array(levels(contact_ratio, stiffness_ratio)) - damping * damping
    return Meissner(half_high, 0.5 * whole_low, float(high), float(low), damping)


def equation_of(pair):
    """Return the `Meissner` equation of a `GearPair`."""
    return equation(pair.contact_ratio, pair.stiffness_ratio, pair.damping_ratio)


def pass_segment(q, time):
    """Return (cos(w t), sin(w t) / w, s) of w^2 = q; for q < 0 both times exp(-s), s = |w t|."""
    w = math.sqrt(abs(q))
    angle = w * time
    if q > 0.0 and angle != 0.0:
        return math.cos(angle), math.sin(angle) / w, 0.0
    if q < 0.0 and angle != 0.0:
        size = abs(angle)
        decay = math.exp(-2.0 * size)
        return 0.5 * (1.0 + decay), math.copysign(-0.5 * math.expm1(-2.0 * size), angle) / w, size
    return 1.0, time, 0.0


def _halfway(m, k):
    """Return (u1, u1', u2, u2', s) half a period on, all four times exp(-s); k = 1 / nu."""
    c1, s1, e1 = pass_segment(m.high, k * m.half_high)
    c2, s2, e2 = pass_segment(m.low, k * m.half_low)
    return (
        c1 * c2 - m.high * s1 * s2,
        -m.low * s2 * c1 - m.high * s1 * c2,
        s1 * c2 + c1 * s2,
        c1 * c2 - m.low * s2 * s1,
        e1 + e2,
    )


def _excess(m, k, order):
    """Return ((|T| / 2 - 1) exp(-2 s), s) near the gap of an order."""
    even, even_rate, odd, odd_rate, scale = _halfway(m, k)
    product = 2.0 * even_rate * odd if order % 2 == 0 else -2.0 * even * odd_rate
    return product, scale


def _growth(m, k, order):
    """Return the logarithm of the largest multiplier in the gap of an order."""
    return _log_multiplier(_excess(m, k, order), math.pi * m.damping * k)


def _log_multiplier(scaled_excess, loss):
    """Return the logarithm of the largest multiplier from a result of `_excess`."""
    excess, scale = scaled_excess
    root = math.sqrt(0.5 * max(excess, 0.0))
    if scale < _MAX_EXPONENT:
        half = math.asinh(root * math.exp(scale))
    else:
        half = scale + math.log(2.0 * root) if root > 0.0 else 0.0
    return 2.0 * (half - loss)


def _margin(scaled_excess, loss):
    """Return |T| / 2 - 1 - 2 sinh^2(loss), scaled: > 0 where deviations grow."""
    excess, scale = scaled_excess
    sine = -0.5 * math.exp(loss - scale) * math.expm1(-2.0 * loss)
    return excess - 2.0 * sine * sine


def angle(m, k, odd):
    """Return the phase angle of u1 (or u2, odd) half a period on, continuous in k.

    It passes n pi / 2 once, upwards, at an edge of the gap of order n.
    """
    w = math.sqrt(m.high)
    a = w * k * m.half_high
    cosine, sine = math.cos(a), math.sin(a)
    b = math.sqrt(max(m.low, 0.0)) * k * m.half_low
    if b > _SMALL_ANGLE:
        # On the segment of C_min the angle turns evenly once it is measured with its own speed.
        ratio = math.sqrt(m.high / m.low) ** (-1.0 if odd else 1.0)
        turn = math.atan2((ratio - 1.0) * sine * cosine, cosine * cosine + ratio * sine * sine)
        return a + turn + b
    even, even_rate, other, other_rate, _ = _halfway(m, k)
    x, y = (other_rate, w * other) if odd else (even, -even_rate / w)
    return a + math.atan2(cosine * y - sine * x, cosine * x + sine * y)


def _over_damped(m):
    """Return whether all segments are over-damped, so that there is no gap."""
    return m.high <= 0.0 or (m.half_high == 0.0 and m.low <= 0.0)


def gap(m, order):
    """Return (k, k), the ends of the gap of an order over k = 1 / nu, in rising order.

    None where all is over-damped. Equal up to rounding: the gap is a point.
    """
    if _over_damped(m):
        return None
    level = 0.5 * math.pi * order
    ends = []
    for odd in (False, True):
        high = float(order)
        while angle(m, high, odd) <= level:
            high *= 2.0
        miss = lambda k, odd=odd: angle(m, k, odd) - level  # noqa: E731
        ends.append(root(miss, 1e-3 * order / high, high))
    return min(ends), max(ends)


def tongue(m, order):
    """Return the `Tongue` of an order, None where all is over-damped."""
    ends = gap(m, order)
    if ends is None:
        return None
    low, high = ends
    return within_gap(order, low, high, m.damping, lambda k: _excess(m, k, order))


def within_gap(order, low, high, damping, excess):
    """Return the `Tongue` within a gap, `low` to `high` over k = 1 / nu.

    `excess` returns |T| / 2 - 1 at k as `_excess` does. Without damping the tongue is the gap.
    """

    def growth(k):
        return _log_multiplier(excess(k), math.pi * damping * k)

    def margin(k):
        return _margin(excess(k), math.pi * damping * k)

    sign = -1 if order % 2 else 1
    closed = Tongue(order, sign, math.nan, math.nan, growth(low), 1.0 / low)
    if high - low <= 2.0 * MACHINE_PRECISION * high:
        # A gap of width zero: without damping both edges lie there.
        return closed if damping else closed._replace(start=1.0 / high, stop=1.0 / low, growth=0.0)
    largest, peak = strongest(growth, low, high)
    if largest <= 0.0:
        return closed._replace(growth=largest, peak=1.0 / peak)
    if damping:
        low, high = edge(margin, peak, low), edge(margin, peak, high)
    return Tongue(order, sign, 1.0 / high, 1.0 / low, largest, 1.0 / peak)


def strongest(growth, low, high):
    """Return (largest value, its place) of a function that has one maximum in an interval."""
    width = high - low
    maximum = minimize_scalar(
        # Shares of the interval: gaps may be narrower than the solver's own tolerance.
        lambda share: -growth(low + share * width),
        bounds=(0.0, 1.0),
        method="bounded",
        options={"xatol": 1e-9},
    )
    return -float(maximum.fun), low + float(maximum.x) * width


def edge(margin, inside, outside):
    """Return where a margin > 0 is lost between two places; `outside` if it is not.

    `inside` where only rounding tells the tongue from a closed one.
    """
    if margin(outside) >= 0.0:
        return outside
    if margin(inside) <= 0.0:
        return inside
    return root(margin, inside, outside)


def root(function, low, high):
    """Return a zero between two places of opposite signs, to the last place."""
    return float(brentq(function, low, high, xtol=1e-300, rtol=MACHINE_PRECISION))


def orders(m, start, stop):
    """Return the orders of the gaps that meet the tunings from `start` to `stop`, a range."""
    if _over_damped(m):
        return range(0)
    first = 2.0 / math.pi * min(angle(m, 1.0 / stop, odd) for odd in (False, True))
    last = 2.0 / math.pi * max(angle(m, 1.0 / start, odd) for odd in (False, True))
    return range(max(1, math.ceil(first)), math.floor(last) + 1)


def closing_damping(contact_ratio, stiffness_ratio, order):
    """Return the damping ratio from which the tongue of an order stays closed; 0: it is a point."""

    def growth(damping):
        widest = tongue(equation(contact_ratio, stiffness_ratio, damping), order)
        return -math.inf if widest is None else widest.growth

    most = math.sqrt(levels(contact_ratio, stiffness_ratio)[0])
    return closing(
        growth, most * np.concatenate([[0.0], np.geomspace(1e-5, 1.0, _SCANNED_DAMPINGS)])
    )


def closing(growth, dampings):
    """Return the largest damping ratio at which a growth passes 0 downwards; 0: none.

    `growth` is the largest growth of a tongue by the damping ratio, `dampings` are where it is
    looked at; rising, the last one closes the tongue.
    """
    # Damping also changes q: a segment of C_min close to over-damping may open a closed tongue
    # again. So the last damping that leaves it open is bracketed.
    for low, high in zip(dampings[-2::-1], dampings[:0:-1], strict=True):
        if growth(low) > 0.0:
            return float(brentq(growth, low, high, xtol=1e-300, rtol=1e-13))
    return 0.0


def growth(contact_ratio, stiffness_ratio, damping, tuning):
    """Return the logarithm of the largest multiplier per mesh period; arrays are broadcast.

    From the discriminant T, with complex speeds: under-damped, critical and over-damped segments
    alike. Stable motion decays by it; between the tongues it is -2 pi beta / nu.
    """
    half_high, low_length = segment_lengths(np.asarray(contact_ratio, float))
    high_length = 2.0 * half_high
    stiffnesses = levels(contact_ratio, stiffness_ratio)
    high, low = (np.sqrt(c - np.square(damping) + 0j) / tuning for c in stiffnesses)
    a, b = high * high_length, low * low_length
    # sin(a) / a by numpy's sinc, which knows its limit.
    sines = high_length * np.sinc(a / np.pi) * low_length * np.sinc(b / np.pi)
    half = (np.cos(a) * np.cos(b) - 0.5 * (high**2 + low**2) * sines).real
    return np.arccosh(np.maximum(np.abs(half), 1.0)) - 2.0 * np.pi * damping / tuning


def coexistence(order, *, contact_ratio=None, stiffness_ratio=None):
    """Return (value, tuning) where the tongue of an order is a point without damping, shape (j, 2).

    The value is that of the stiffness ratio for a given contact ratio, or the other way round. At
    such a point the segment of C_max holds m half waves, m = 1 ... n - 1, the softer one the
    others: sqrt(kappa) = (epsilon - 1) (n - m) / ((2 - epsilon) m).
    """
    points = []
    for m in range(1, order):
        if stiffness_ratio is None:
            if not 1.0 < contact_ratio < 2.0:
                break
            share, value = contact_ratio, (contact_ratio - 1.0) * (order - m)
            kappa = value = (value / ((2.0 - contact_ratio) * m)) ** 2
        else:
            kappa, root = stiffness_ratio, m * math.sqrt(stiffness_ratio)
            share = value = 1.0 + root / (root + order - m)
        if kappa < 1.0:
            high, _ = levels(share, kappa)
            points.append((value, 2.0 * (share - 1.0) * math.sqrt(high) / m))
    return np.array(points).reshape(-1, 2)


def go(state, stiffness, damping, tuning, phase):
    """Return the state a phase later (negative: earlier) on a segment of constant stiffness.

    (x, dx/dtau) in static deflections; stiffness over its mean, damping ratio beta.
    """
    equilibrium = 1.0 / stiffness
    u, v = state[0] - equilibrium, tuning * state[1]
    time = phase / tuning
    cosine, sine, scale = pass_segment(stiffness - damping * damping, time)
    factor = math.exp(scale - damping * time)
    cosine, sine = factor * cosine, factor * sine
    v, u = v * cosine - (damping * v + stiffness * u) * sine, u * cosine + (v + damping * u) * sine
    return equilibrium + u, v / tuning


def period_map(model, tuning):
    """Return (M, b), shapes (2, 2) and (2,), of one mesh period without loss of contact."""
    shift, maps, code = linear_pair(model).propagator(tuning).maps(np.zeros(2), 1, MAX_EVENTS)
    if code != status.OK:
        raise RuntimeError(f"the motion could not go on: {status.MESSAGES[code]}")
    return maps[0], shift


def orbit(pair, tuning):
    """Return the state at phase 0 of the orbit that repeats every mesh period.

    Where many do, as with constant stiffness at nu = 1 / n, that next to static deflection.
    """
    matrix, shift = period_map(pair, tuning)
    matrix = np.eye(2) - matrix
    try:
        state = np.linalg.solve(matrix, shift)
    except np.linalg.LinAlgError:
        static = np.array([1.0, 0.0])
        state = static + np.linalg.lstsq(matrix, shift - matrix @ static)[0]
    return tuple(map(float, state))


def linear_pair(pair):
    """Return a pair as the linear mesh: no backlash, the damping of contact everywhere."""
    return pair.replace(backlash=0.0, backlash_damping=pair.material_damping)
