"""Hill-Meissner equation of the mesh without loss of contact: tongues in closed form.

With the time t = tau / nu, small perturbations x of the orbit without loss of contact obey

    x'' + 2 beta x' + c(t) x = 0,      c = C / C_s with two levels,

and x = exp(-beta t) u eliminates the damping: u'' + q u = 0, q = c - beta^2. Let u1 (even) and
u2 (odd) be the solutions that start at the midpoint of the segment with C_max, evaluated half a
mesh period later at the midpoint of the other segment. Since the stiffness is even, the trace T of
the map of u over one period can be factorised,

    T - 2 = 4 u1' u2,      T + 2 = 4 u1 u2',

so that the ends of the gap of order n, in which |T| >= 2, are simple zeros of closed-form
expressions, at which the phase angle of u1 or u2 is n pi / 2. The gap is a point if both coincide.
Over one period, the multipliers of x are those of u times exp(-2 pi beta / nu). In the gap of order
n perturbations grow where

    |T| / 2 - 1 > 2 sinh^2(pi beta / nu).

This is the tongue of order n near nu = 2 / n, with the multiplier (-1)^n at its edges. The
logarithm of the growth is concave over 1 / nu in a gap without overdamped segment (it is a sum of
logarithms of |1 - E nu^2| with E outside the gap, minus a linear term), so that a tongue is a
single interval.

Over one mesh period without loss of contact, the state z = (x, x') is mapped to M z + b, where
det M = exp(-4 pi beta / nu) by Liouville's formula. The orbit without loss of contact is the fixed
point of this map.

Theory: Magnus, Winkler, Hill's Equation (1966), chapters 1, 2 and 7; E. Meissner, Schweizerische
Bauzeitung 72 (1918) 95-98.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from gearlib.data import status
from gearlib.engines.pair.stiffness import segment_lengths, stiffness_levels
from gearlib.runs.run_arguments import MAX_EVENTS

#: Relative tolerance of zeros, the smallest that `brentq` allows.
MACHINE_PRECISION = 4.0 * np.finfo(float).eps
#: Limit of exponents, far below the overflow of exp.
_MAX_EXPONENT = 300.0
#: Phase angle in the segment with C_min below which `phase_angle` uses the solution at its end.
_MAX_SMALL_ANGLE = 0.5
#: Damping ratios, relative to the largest one, that bracket the zeros of the largest growth.
_RELATIVE_DAMPINGS = np.concatenate([[0.0], np.geomspace(1e-5, 1.0, 40)])
#: Lower end of the search for an end of a gap, relative to order / (upper end of the search).
_SEARCH_START = 1e-3


class Meissner(NamedTuple):
    """Coefficients of u'' + q u = 0 with two segments of constant q, and the damping ratio."""

    half_stiff: float  #: half the length of the segment with C_max, mesh phase in rad
    half_soft: float  #: half the length of the segment with C_min, mesh phase in rad
    q_stiff: float  #: q in the segment with C_max
    q_soft: float  #: q in the segment with C_min
    damping: float  #: damping ratio beta


class Tongue(NamedTuple):
    """An interval of tunings in which small perturbations grow, with the largest growth."""

    order: int  #: number of half waves per mesh period (near nu = 2 / order), 0 if unknown
    multiplier: int  #: Floquet multiplier at the edges, 1 or -1; 0 if complex or unknown
    start: float  #: lowest tuning, NaN if the tongue is closed
    stop: float  #: highest tuning, NaN if the tongue is closed
    growth: float  #: largest logarithm of a Floquet multiplier, negative if the tongue is closed
    peak: float  #: tuning of the largest growth


def meissner_equation(contact_ratio: float, stiffness_ratio: float, damping: float) -> Meissner:
    """Return the `Meissner` equation u'' + q u = 0 of a gear mesh with rectangular stiffness.

    It describes small perturbations of the motion without loss of contact, after a transformation
    that eliminates the damping. The stiffness has two levels, C_max with two tooth pairs in mesh
    and C_min with one. The arguments are the contact ratio epsilon, the stiffness ratio kappa =
    C_min / C_max and the damping ratio beta. q is the stiffness relative to its mean, minus beta^2.
    """
    half_stiff, soft = segment_lengths(contact_ratio)
    q_stiff, q_soft = np.array(stiffness_levels(contact_ratio, stiffness_ratio)) - damping * damping
    return Meissner(half_stiff, 0.5 * soft, float(q_stiff), float(q_soft), damping)


def equation_of_pair(pair: Any) -> Meissner:
    """Return the `Meissner` equation of perturbations of a `GearPair` without loss of contact."""
    return meissner_equation(pair.contact_ratio, pair.stiffness_ratio, pair.damping_ratio)


def segment_solution(q: float, time: float) -> tuple:
    """Return the two fundamental solutions of u'' + q u = 0 with constant q at the time t.

    The initial values are u = 1, u' = 0 and u = 0, u' = 1. For q = w^2 > 0 return (cos(w t),
    sin(w t) / w, 0). For q = -w^2 < 0 return (cosh(w t) exp(-s), sinh(w t) / w exp(-s), s), where
    the exponent s = |w t| avoids overflow. For w t = 0 return (1, t, 0).
    """
    w = math.sqrt(abs(q))
    angle = w * time
    if q > 0.0 and angle != 0.0:
        return math.cos(angle), math.sin(angle) / w, 0.0
    if q < 0.0 and angle != 0.0:
        s = abs(angle)
        scaled_cosh = 0.5 * (1.0 + math.exp(-2.0 * s))
        scaled_sinh = math.copysign(-0.5 * math.expm1(-2.0 * s), angle)
        return scaled_cosh, scaled_sinh / w, s
    return 1.0, time, 0.0


def _half_period_solutions(equation: Meissner, k: float) -> tuple:
    """Return the even solution u1 and the odd solution u2 after half a mesh period.

    The equation u'' + q u = 0 has a different q in the segments with the stiffness C_max and C_min.
    At the start, the midpoint of the segment with C_max, u1 = u2' = 1 and u1' = u2 = 0. The tuning
    is nu = 1 / k. Return (u1, u1', u2, u2', s), where the first four are scaled by exp(-s) to avoid
    overflow.
    """
    q1, q2 = equation.q_stiff, equation.q_soft
    cosine1, sine1, exponent1 = segment_solution(q1, k * equation.half_stiff)
    cosine2, sine2, exponent2 = segment_solution(q2, k * equation.half_soft)
    return (
        cosine1 * cosine2 - q1 * sine1 * sine2,
        -q2 * sine2 * cosine1 - q1 * sine1 * cosine2,
        sine1 * cosine2 + cosine1 * sine2,
        cosine1 * cosine2 - q2 * sine2 * sine1,
        exponent1 + exponent2,
    )


def _scaled_excess(equation: Meissner, k: float, order: int) -> tuple:
    """Return the excess |T| / 2 - 1 of the trace T in or near a gap as (excess * exp(-2 s), s).

    T is the trace of the map of (u, u') over one mesh period by the equation u'' + q u = 0, at the
    tuning nu = 1 / k. A gap is an interval of k with |T| >= 2. With the even and odd solutions u1
    and u2 after half a mesh period, T - 2 = 4 u1' u2 > 0 in gaps of even order, T + 2 = 4 u1 u2' <
    0 in gaps of odd order. The factor exp(-2 s) avoids overflow.
    """
    u1, u1_rate, u2, u2_rate, exponent = _half_period_solutions(equation, k)
    excess = 2.0 * u1_rate * u2 if order % 2 == 0 else -2.0 * u1 * u2_rate
    return excess, exponent


def _growth(equation: Meissner, k: float, order: int) -> float:
    """Return the logarithm of the largest Floquet multiplier at the tuning 1 / k in a gap.

    In the gap of the given `order`, an interval of k, undamped perturbations grow.
    """
    return _log_multiplier(_scaled_excess(equation, k, order), math.pi * equation.damping * k)


def _log_multiplier(scaled_excess: tuple, decay: float) -> float:
    """Return the logarithm of the largest Floquet multiplier over a mesh period in a gap.

    In a gap the trace T of the undamped map over a mesh period satisfies |T| >= 2. `scaled_excess`
    is ((|T| / 2 - 1) exp(-2 s), s), scaled to avoid overflow. `decay` is pi beta / nu with the
    damping ratio beta and the tuning nu, half the logarithmic decrement of a mesh period.
    """
    excess, exponent = scaled_excess
    # The undamped multiplier exp(2 h) follows from |T| / 2 - 1 = 2 sinh(h)^2.
    scaled_sinh = math.sqrt(0.5 * max(excess, 0.0))
    if exponent < _MAX_EXPONENT:
        h = math.asinh(scaled_sinh * math.exp(exponent))
    elif scaled_sinh > 0.0:
        h = exponent + math.log(2.0 * scaled_sinh)
    else:
        h = 0.0
    return 2.0 * (h - decay)


def _instability_margin(scaled_excess: tuple, decay: float) -> float:
    """Return a margin that is positive if perturbations grow and negative if they decay.

    The margin |T| / 2 - 1 - 2 sinh^2(decay) is scaled by exp(-2 s) to avoid overflow, where T is
    the trace of the undamped map over a mesh period. `scaled_excess` is ((|T| / 2 - 1) exp(-2 s),
    s), and `decay` is pi beta / nu with the damping ratio beta and the tuning nu.
    """
    excess, exponent = scaled_excess
    # This is sinh(decay) exp(-s); expm1 is accurate for small damping.
    sinh = -0.5 * math.exp(decay - exponent) * math.expm1(-2.0 * decay)
    return excess - 2.0 * sinh * sinh


def phase_angle(equation: Meissner, k: float, odd: bool) -> float:
    """Return the phase (Pruefer angle) of a solution of u'' + q u = 0 after half a mesh period.

    The angle in rad is atan2(-u' / w, u) for the even solution or, with `odd`, atan2(w u, u') for
    the odd solution, where w = sqrt(q) at one of the two stiffness levels. It starts at 0 at the
    midpoint of the segment with the stiffness C_max and is unwrapped. As a function of
    k = 1 / tuning it increases through n pi / 2 once, at an end of gap n, in which undamped
    perturbations grow.
    """
    w = math.sqrt(equation.q_stiff)
    stiff_angle = w * k * equation.half_stiff
    cosine, sine = math.cos(stiff_angle), math.sin(stiff_angle)
    soft_angle = math.sqrt(max(equation.q_soft, 0.0)) * k * equation.half_soft
    if soft_angle > _MAX_SMALL_ANGLE:
        # In the segment with C_min the angle increases linearly if w is defined by q there. The
        # change of w where the segments meet changes the angle by `change`.
        ratio = math.sqrt(equation.q_stiff / equation.q_soft) ** (-1.0 if odd else 1.0)
        change = math.atan2((ratio - 1.0) * sine * cosine, cosine * cosine + ratio * sine * sine)
        return stiff_angle + change + soft_angle
    # In a short segment with C_min the angle of (x, y) changes by less than pi.
    u1, u1_rate, u2, u2_rate, _ = _half_period_solutions(equation, k)
    x, y = (u2_rate, w * u2) if odd else (u1, -u1_rate / w)
    return stiff_angle + math.atan2(cosine * y - sine * x, cosine * x + sine * y)


def _is_overdamped(equation: Meissner) -> bool:
    """Return whether motions are overdamped at all stiffness levels, so that no tongue exists.

    A level is overdamped if q, the stiffness minus the squared damping ratio, is not positive.
    """
    stiff_is_empty = equation.half_stiff == 0.0
    return equation.q_stiff <= 0.0 or (stiff_is_empty and equation.q_soft <= 0.0)


def find_gap(equation: Meissner, order: int) -> tuple | None:
    """Find the ends (low, high) of the gap of an order, an interval of k = 1 / tuning.

    In the gap the trace T of the undamped map over a mesh period satisfies |T| >= 2, so that
    undamped perturbations grow. At one end the even solution of the Meissner equation is periodic,
    at the other end the odd solution. The ends agree to rounding error if the gap is a point.
    Return None if motions are overdamped at all stiffness levels.
    """
    if _is_overdamped(equation):
        return None
    angle_at_edge = 0.5 * math.pi * order
    ends = []
    for odd in (False, True):
        # Increase the upper bound of k until it exceeds the end of the gap.
        high = float(order)
        while phase_angle(equation, high, odd) <= angle_at_edge:
            high *= 2.0

        def difference(k: float, odd: bool = odd) -> float:
            """Return the phase angle at the tuning 1 / k minus its value at the end of the gap."""
            return phase_angle(equation, k, odd) - angle_at_edge

        ends.append(find_root(difference, _SEARCH_START * order / high, high))
    return min(ends), max(ends)


def find_tongue(equation: Meissner, order: int) -> Any:
    """Find the `Tongue` of an order, or None if motions are overdamped at all stiffness levels.

    The tongue of order n is an interval of tunings near 2 / n in which small perturbations of
    steady contact grow.
    """
    ends = find_gap(equation, order)
    if ends is None:
        return None
    low, high = ends
    return find_tongue_in_gap(
        order, low, high, equation.damping, lambda k: _scaled_excess(equation, k, order)
    )


def find_tongue_in_gap(order, low_k, high_k, damping, scaled_excess: Callable) -> Tongue:
    """Find the `Tongue` of an order in the gap from `low_k` to `high_k`, values of 1 / tuning.

    In the gap the trace T of the undamped map over a mesh period satisfies |T| >= 2. In the tongue
    perturbations grow in spite of the damping ratio `damping`; without damping the tongue fills the
    gap. `scaled_excess(k)` returns ((|T| / 2 - 1) exp(-2 s), s) at the tuning 1 / k, where the
    exponent s avoids overflow.
    """

    def growth(k: float) -> float:
        """Return the logarithm of the largest Floquet multiplier at the tuning 1 / k."""
        return _log_multiplier(scaled_excess(k), math.pi * damping * k)

    def margin(k: float) -> float:
        """Return a number that is positive if the motion at the tuning 1 / k is unstable."""
        return _instability_margin(scaled_excess(k), math.pi * damping * k)

    multiplier = -1 if order % 2 else 1
    start, stop = 1.0 / high_k, 1.0 / low_k
    closed = Tongue(order, multiplier, math.nan, math.nan, growth(low_k), peak=stop)
    if high_k - low_k <= 2.0 * MACHINE_PRECISION * high_k:
        # The gap is a point, and without damping so is the tongue.
        return closed if damping else closed._replace(start=start, stop=stop, growth=0.0)
    largest_growth, peak_k = maximise(growth, low_k, high_k)
    if largest_growth <= 0.0:
        return closed._replace(growth=largest_growth, peak=1.0 / peak_k)
    if damping:
        start, stop = (
            1.0 / find_edge(margin, peak_k, high_k),
            1.0 / find_edge(margin, peak_k, low_k),
        )
    return Tongue(order, multiplier, start, stop, largest_growth, peak=1.0 / peak_k)


def maximise(function: Callable, low: float, high: float) -> tuple:
    """Maximise a function with one maximum from `low` to `high`; return (maximum, its position).

    The error of the position is about 1e-9 of this interval.
    """
    width = high - low
    optimum = minimize_scalar(
        # The interval may be narrower than the tolerance, so it is scaled to 0 ... 1.
        lambda fraction: -function(low + fraction * width),
        bounds=(0.0, 1.0),
        method="bounded",
        options={"xatol": 1e-9},
    )
    return -float(optimum.fun), low + float(optimum.x) * width


def find_edge(margin: Callable, inside: float, outside: float) -> float:
    """Find an edge of the interval in which `margin(position)` is positive.

    The edge is the zero of the margin between the positions `inside` and `outside` the interval.
    Return `outside` if the margin is not negative there, or else `inside` if the margin is not
    positive there.
    """
    if margin(outside) >= 0.0:
        return outside
    if margin(inside) <= 0.0:
        return inside
    return find_root(margin, inside, outside)


def find_root(function: Callable, low: float, high: float) -> float:
    """Find the zero of a function between two positions at which it has opposite signs."""
    return float(brentq(function, low, high, xtol=1e-300, rtol=MACHINE_PRECISION))


def orders_in_range(equation: Meissner, start: float, stop: float) -> range:
    """Return the orders of the tongues that may overlap the tunings from `start` to `stop`.

    They are the orders of the gaps, the intervals of tunings in which undamped perturbations grow;
    gap n lies near the tuning 2 / n.
    """
    if _is_overdamped(equation):
        return range(0)
    # In the gap of order n, n pi / 2 lies between the phase angles of the two solutions.
    smallest_angle = min(phase_angle(equation, 1.0 / stop, odd) for odd in (False, True))
    largest_angle = max(phase_angle(equation, 1.0 / start, odd) for odd in (False, True))
    first_order = math.ceil(2.0 / math.pi * smallest_angle)
    last_order = math.floor(2.0 / math.pi * largest_angle)
    return range(max(1, first_order), last_order + 1)


def closing_damping(contact_ratio: float, stiffness_ratio: float, order: int) -> float:
    """Return the damping ratio above which the tongue of an order is closed.

    In a closed tongue, small perturbations of steady contact do not grow at any tuning. The result
    is 0 if the tongue has no width even without damping. The stiffness ratio is the lowest divided
    by the highest mesh stiffness.
    """

    def growth(damping: float) -> float:
        """Return the largest growth in the tongue at a damping ratio.

        The growth is the logarithm of the largest Floquet multiplier of a mesh period.
        """
        equation = meissner_equation(contact_ratio, stiffness_ratio, damping)
        damped_tongue = find_tongue(equation, order)
        return -math.inf if damped_tongue is None else damped_tongue.growth

    # Both segments are overdamped at damping ratios >= sqrt(max_stiffness).
    max_stiffness, _ = stiffness_levels(contact_ratio, stiffness_ratio)
    return last_downward_zero(growth, math.sqrt(max_stiffness) * _RELATIVE_DAMPINGS)


def last_downward_zero(growth: Callable, dampings: Any) -> float:
    """Return the largest damping ratio at which the growth decreases through zero.

    `growth(damping)` returns the largest growth of perturbations in a tongue (interval of tunings),
    which is negative if all perturbations decay. The increasing damping ratios `dampings` bracket
    its zeros, and at the last one the growth is negative. Return 0 if the growth is not positive at
    any of them.
    """
    # A closed tongue may open again if the segment with C_min is almost overdamped. The search
    # therefore starts from the largest damping.
    for low, high in zip(dampings[-2::-1], dampings[:0:-1], strict=True):
        if growth(low) > 0.0:
            return float(brentq(growth, low, high, xtol=1e-300, rtol=1e-13))
    return 0.0


def growth(contact_ratio: Any, stiffness_ratio: Any, damping: Any, tuning: Any) -> np.ndarray:
    """Return the logarithm of the largest Floquet multiplier of motions without loss of contact.

    The arguments are the contact ratio epsilon, the stiffness ratio kappa (lowest / highest
    stiffness), the damping ratio beta and the tuning nu (mesh frequency / natural frequency).
    Arrays are broadcast. The result is the growth of perturbations per mesh period, positive in the
    tongues, where steady contact is unstable. It follows from the trace T of the undamped map over
    a mesh period, with complex frequencies where a stiffness level is overdamped. Where |T| < 2,
    the growth is -2 pi beta / nu because of damping.
    """
    half_stiff, soft_length = segment_lengths(np.asarray(contact_ratio, float))
    stiff_length = 2.0 * half_stiff
    stiffnesses = stiffness_levels(contact_ratio, stiffness_ratio)
    stiff, soft = (np.sqrt(c - np.square(damping) + 0j) / tuning for c in stiffnesses)
    stiff_angle, soft_angle = stiff * stiff_length, soft * soft_length
    # np.sinc evaluates sin(angle) / angle even at 0.
    sines = stiff_length * np.sinc(stiff_angle / np.pi) * soft_length * np.sinc(soft_angle / np.pi)
    cosines = np.cos(stiff_angle) * np.cos(soft_angle)
    half_trace = (cosines - 0.5 * (stiff**2 + soft**2) * sines).real
    return np.arccosh(np.maximum(np.abs(half_trace), 1.0)) - 2.0 * np.pi * damping / tuning


def coexistence_points(order: int, *, contact_ratio=None, stiffness_ratio=None) -> np.ndarray:
    """Return the points at which the undamped tongue of an order has no width, shape (j, 2).

    Exactly one of the contact ratio epsilon and the stiffness ratio kappa = C_min / C_max must be
    given; each row is (value of the other ratio, tuning). A tongue of order n is an interval of
    tunings with unstable steady contact. It has no width if two independent periodic perturbations
    coexist. Then m = 1 ... n - 1 of the n half waves per mesh period lie in the segment with C_max
    and the others in the segment with C_min, so that
    sqrt(kappa) = (epsilon - 1) (n - m) / ((2 - epsilon) m).
    """
    points = []
    for m in range(1, order):
        if stiffness_ratio is None:
            if not 1.0 < contact_ratio < 2.0:
                break  # The stiffness is constant.
            epsilon = contact_ratio
            root_of_kappa = (epsilon - 1.0) * (order - m) / ((2.0 - epsilon) * m)
            kappa = value = root_of_kappa**2
        else:
            kappa = stiffness_ratio
            weight = m * math.sqrt(kappa)
            epsilon = value = 1.0 + weight / (weight + order - m)
        if kappa < 1.0:
            stiff, _ = stiffness_levels(epsilon, kappa)
            points.append((value, 2.0 * (epsilon - 1.0) * math.sqrt(stiff) / m))
    return np.array(points).reshape(-1, 2)


def propagate_state(state: tuple, stiffness, damping, tuning: float, phase: float) -> tuple:
    """Propagate a state over a mesh phase at constant stiffness, without loss of contact.

    The state and the result are (x, dx/dtau) in units of the static deflection, with the mesh phase
    tau. The stiffness is relative to its mean, `damping` is the damping ratio, and `tuning` is the
    ratio of mesh frequency to natural frequency. `phase` is the phase difference in rad, negative
    to propagate backwards.
    """
    equilibrium = 1.0 / stiffness
    # u is the displacement from the equilibrium, v its derivative by the time t = tau / nu.
    u, v = state[0] - equilibrium, tuning * state[1]
    time = phase / tuning
    cosine, sine, exponent = segment_solution(stiffness - damping * damping, time)
    factor = math.exp(exponent - damping * time)
    cosine, sine = factor * cosine, factor * sine
    v, u = v * cosine - (damping * v + stiffness * u) * sine, u * cosine + (v + damping * u) * sine
    return equilibrium + u, v / tuning


def period_map(model: Any, tuning: float) -> tuple:
    """Return the affine map z -> M z + b of a linear mesh over one mesh period, as (M, b).

    z = (x, dx/dtau) is the state at mesh phase tau = 0, and `tuning` is the ratio of mesh frequency
    to natural frequency. M has the shape (2, 2), b the shape (2,). The backlash of the model is
    ignored. Raise RuntimeError if the simulation fails.
    """
    # b is the final state of the motion from the state 0, and M is the linearised map.
    shift, maps, code = without_backlash(model).propagator(tuning).maps(np.zeros(2), 1, MAX_EVENTS)
    if code != status.OK:
        raise RuntimeError(f"the simulation failed: {status.MESSAGES[code]}")
    return maps[0], shift


def orbit_state(pair: Any, tuning: float) -> tuple:
    """Return the state (x, dx/dtau) at mesh phase 0 of the orbit without loss of contact.

    `tuning` is the ratio of mesh frequency to natural frequency, and the backlash of the pair is
    ignored. If the orbit is not unique, as with constant stiffness at the tuning 1 / n, return the
    state nearest to the static equilibrium.
    """
    # The orbit is the fixed point of the map z -> monodromy z + shift.
    monodromy, shift = period_map(pair, tuning)
    matrix = np.eye(2) - monodromy
    try:
        state = np.linalg.solve(matrix, shift)
    except np.linalg.LinAlgError:
        static = np.array([1.0, 0.0])
        state = static + np.linalg.lstsq(matrix, shift - matrix @ static)[0]
    return tuple(map(float, state))


def without_backlash(pair: Any) -> Any:
    """Return a copy of a gear pair without backlash, whose mesh is linear.

    Without backlash one of the flanks always touches, so the damping is always that in contact.
    """
    return pair.replace(backlash=0.0, backlash_damping=pair.material_damping)
