"""Instability tongues from the numerical monodromy matrix of the motion without loss of contact.

With one degree of freedom and any periodic stiffness, perturbations obey Hill's equation. The trace
T of the undamped map over one mesh period oscillates with k = 1 / nu. It has exactly one extremum
in each gap (interval of k with |T| >= 2), and none between gaps. Therefore the extrema determine
the orders of all tongues, however narrow, and bracket their edges. Because of rounding errors of T,
a gap narrower than about 1e-7 of its tuning is treated as a point.

With more coordinates there are also tongues at sums and differences of eigenfrequencies, which have
no order. If M is the monodromy matrix, edges with a multiplier 1 or -1 are zeros of det(M - I) or
det(M + I). They are bracketed on a grid of tunings, including pairs of zeros between two grid
points. Where a complex pair of multipliers leaves the unit circle, the edge is a zero of the
spectral radius minus 1.
"""

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from gearlib import checks
from gearlib.analysis.tongues import meissner
from gearlib.analysis.tongues.meissner import Tongue, period_map
from gearlib.models.harmonics import Harmonics

#: Step of the scan over 1 / nu; tongues are about 0.5 apart.
_SCAN_STEP = 1.0 / 32.0
#: Largest rounding error of |T| / 2 - 1.
_ROUNDING_ERROR = 2e-14
#: Motions with several coordinates are considered stable up to this logarithm of the largest
#: multiplier, because the error of double multipliers is the square root of machine precision.
_MIN_GROWTH = 1e-6
#: Damping ratios, relative to the estimated closing damping, at which the growth is computed.
_RELATIVE_DAMPINGS = np.array([0.0, 0.5, 0.9, 1.1, 1.5, 3.0])
_MAX_ESTIMATED_DAMPING = 0.3
#: Factor between successive damping ratios in the search for one that closes a tongue.
_DAMPING_RATIO_STEP = 1.25


def find_tongues_of_one_degree(model: Any, start: float, stop: float) -> list:
    """Return the `Tongue`s of a linear `OneDegreePair` for tunings from `start` to `stop`.

    A tongue is an interval of tunings (mesh frequency / natural frequency) in which steady contact
    is unstable. It is included if its gap overlaps the range. The gap is the interval of
    k = 1 / tuning in which the trace T of the undamped map over a mesh period satisfies |T| >= 2.
    """
    tongues = []
    for order, extrema in _trace_extrema(model, 1.0 / start):
        tongue, (low_k, high_k) = _find_tongue_in_gap(model, order, *extrema)
        # Gaps are found in order of increasing k, i.e. decreasing tuning.
        if low_k > 1.0 / start:
            break
        if high_k >= 1.0 / stop:
            tongues.append(tongue)
    return tongues


def closing_damping(model: Any, tongue: Tongue) -> float:
    """Return the damping ratio above which a tongue of a `OneDegreePair` is closed.

    A tongue is an interval of tunings in which steady contact is unstable; above this damping ratio
    there is no such interval. The result is 0 if the tongue has no width even without damping.
    """
    undamped = replace_damping(model, 0.0)
    extrema = dict(_trace_extrema(undamped, 1.0 / tongue.peak))
    # Positions k = 1 / tuning of the extrema of the trace before, in and after the gap.
    before, middle, after = extrema[tongue.order]
    undamped_tongue, _ = _find_tongue_in_gap(undamped, tongue.order, before, middle, after)
    if undamped_tongue.growth <= 0.0:
        return 0.0

    def growth(damping: float) -> float:
        """Return the largest growth in the tongue at a damping ratio.

        The growth is the logarithm of the largest Floquet multiplier over a mesh period.
        """
        # Damping lowers the eigenfrequency, so that the extrema move to larger k.
        shift = 1.0 / math.sqrt(1.0 - damping * damping)
        damped = replace_damping(model, damping)
        low, high = shift * (before + middle) / 2.0, shift * (middle + after) / 2.0
        peak = _trace_extremum(damped, tongue.order, low, high)
        return _find_tongue_in_gap(damped, tongue.order, shift * before, peak, shift * after)[
            0
        ].growth

    # The estimate neglects that damping also changes the trace.
    estimate = undamped_tongue.growth * undamped_tongue.peak / (2.0 * math.pi)
    dampings = min(estimate, _MAX_ESTIMATED_DAMPING) * _RELATIVE_DAMPINGS
    return meissner.last_downward_zero(growth, dampings)


def closing_damping_of_six_degrees(model: Any, tongue: Tongue) -> float:
    """Return the damping ratio of the mesh above which a tongue of a `SixDegreePair` is closed.

    A tongue is an interval of tunings, and is open while steady contact is unstable at some of
    them. If the monodromy matrix M has a multiplier 1 or -1 at the edges of the tongue, steady
    contact is unstable where det(M - multiplier I) has the same sign as inside the tongue of the
    given model. If it has a complex pair of multipliers there, steady contact is unstable where
    perturbations grow by more than `_MIN_GROWTH` per mesh period. Return NaN if no damping ratio
    below 1 closes the tongue.
    """
    sign_inside = math.copysign(
        1.0, _characteristic_determinant(model, tongue.peak, tongue.multiplier)
    )

    def largest_margin(damping: float) -> float:
        """Return the largest instability margin in the tongue, positive while it is open."""
        damped = replace_damping(model, damping)

        def margin(tuning: float) -> float:
            """Return a number that is positive where steady contact is unstable, 0 at an edge."""
            if tongue.multiplier:
                return sign_inside * _characteristic_determinant(damped, tuning, tongue.multiplier)
            return _growth(damped, tuning) - _MIN_GROWTH

        return meissner.maximise(margin, tongue.start, tongue.stop)[0]

    # The estimate neglects that damping also changes the trace.
    estimate = model.pair.damping_ratio + tongue.growth * tongue.peak / (2.0 * math.pi)
    dampings = [0.0, estimate]
    while largest_margin(dampings[-1]) > 0.0:
        dampings.append(_DAMPING_RATIO_STEP * dampings[-1])
        if dampings[-1] > 1.0:
            return math.nan
    return meissner.last_downward_zero(largest_margin, dampings)


def replace_damping(model: Any, damping: float) -> Any:
    """Return a copy of a model with another damping ratio of the mesh in contact.

    The corresponding damping coefficient in N s/m is the parameter material_damping.
    """
    material_damping = 2.0 * damping * model.reduced_mass * model.mean_eigenfrequency
    return model.replace(material_damping=material_damping)


def _signed_half_trace(model: Any, k: float, order: int) -> float:
    """Return (-1)^order T / 2 at the tuning 1 / k, which exceeds 1 in the gap of this order.

    T is the trace of the linear map of (displacement, velocity) over one mesh period without loss
    of contact, divided by the decay due to damping. A gap is an interval of k with |T| >= 2.
    """
    inverse_decay = math.exp(2.0 * math.pi * model.damping_ratio * k)
    # The excitation is omitted, because it does not affect the matrix of the map.
    unforced = model.replace(excitation=Harmonics(), deviation=Harmonics())
    trace = float(np.trace(period_map(unforced, 1.0 / k)[0]))
    return 0.5 * (-1.0) ** order * inverse_decay * trace


def _trace_extremum(model: Any, order: int, low: float, high: float) -> float:
    """Return the value of k = 1 / tuning, from `low` to `high`, at which the trace T is extremal.

    T is the trace of the undamped map over one mesh period. Between the two values there is a
    single extremum, in the gap (|T| >= 2) of the given `order`.
    """
    return meissner.maximise(lambda k: _signed_half_trace(model, k, order), low, high)[1]


def _trace_extrema(model: Any, max_k: float) -> Iterator[tuple]:
    """Yield (order, extrema) of each gap up to k = `max_k` and of the next gap.

    A gap is an interval of k = 1 / tuning in which the trace T of the undamped map over a mesh
    period satisfies |T| >= 2. T has exactly one extremum in each gap. `extrema` are the values of k
    at the extrema in the previous gap, in this gap and in the next gap. For the first gap the
    previous value is k = 0, where T = 2. The extrema are found by a scan over k.
    """
    allowed = "a number < 1 for a stiffness that is not rectangular"
    checks.require(model.damping_ratio < 1.0, "damping_ratio", model.damping_ratio, allowed)
    extrema, order = [0.0], 1
    # The values are T / 2 at three successive steps of the scan, which starts at k = 0. With
    # order = 0 the sign of T / 2 is unchanged.
    value1, value2 = 1.0, _signed_half_trace(model, _SCAN_STEP, order=0)
    k = 2.0 * _SCAN_STEP
    while True:
        value3, sign = _signed_half_trace(model, k, order=0), (-1) ** order
        # Maxima and minima of T alternate: in gap n, (-1)^n T has a maximum.
        if sign * (value2 - value1) > 0.0 >= sign * (value3 - value2):
            extrema.append(_trace_extremum(model, order, k - 2.0 * _SCAN_STEP, k))
            if order > 1:
                yield order - 1, tuple(extrema[-3:])
                if extrema[-2] > max_k:
                    return
            order += 1
        k, value1, value2 = k + _SCAN_STEP, value2, value3


def _find_tongue_in_gap(
    model: Any, order: int, before: float, middle: float, after: float
) -> tuple:
    """Find the tongue of an order; return (`Tongue`, (low end, high end) of its gap).

    `model` is a `OneDegreePair`, and T is the trace of its undamped map over a mesh period. The gap
    is the interval of k = 1 / tuning with |T| >= 2 around the extremum `middle` of T, between the
    neighbouring extrema `before` and `after`. Its ends are equal if it is too narrow to be resolved
    with the rounding errors of T. The tongue is the interval of tunings in the gap in which
    perturbations grow in spite of damping.
    """

    def excess(k: float) -> float:
        """Return |T| / 2 - 1 in the gap at the tuning 1 / k."""
        return _signed_half_trace(model, k, order) - 1.0

    def scaled_excess(k: float) -> tuple:
        """Return (excess, s), where the excess is scaled by exp(-2 s), with s = 0."""
        return excess(k), 0.0

    low_end, high_end = middle, middle
    if excess(middle) > _ROUNDING_ERROR:
        low_end = meissner.find_edge(excess, middle, max(before, _SCAN_STEP))
        high_end = meissner.find_edge(excess, middle, after)
    ends = low_end, high_end
    return meissner.find_tongue_in_gap(order, *ends, model.damping_ratio, scaled_excess), ends


def find_tongues_of_several_degrees(model: Any, start: float, stop: float, step: float) -> list:
    """Return the `Tongue`s of a model with several degrees of freedom, by increasing tuning.

    A tongue is an interval of tunings (mesh frequency / natural frequency) in which steady contact
    is unstable. The tunings from `start` to `stop` are scanned in steps of `step`, and tongues are
    truncated at both ends of this range.
    """
    grid = np.linspace(start, stop, max(3, math.ceil((stop - start) / step) + 1))
    # Between two successive edges (tuning, multiplier) the motion is either stable or unstable.
    edges = [(start, 0), *sorted(_find_edges(model, grid)), (stop, 0)]
    tongues: list = []
    for (low, low_multiplier), (high, high_multiplier) in pairwise(edges):
        if high <= low:
            continue
        growth, peak = _find_largest_growth(model, low, high, grid)
        if growth <= _MIN_GROWTH:
            continue
        if tongues and tongues[-1].stop == low:
            # The motion is unstable on both sides of this edge, so the two intervals are merged.
            previous = tongues.pop()
            low, low_multiplier = previous.start, previous.multiplier
            growth, peak = max((growth, peak), (previous.growth, previous.peak))
        # At the ends of the range the multiplier is unknown and has the code 0.
        multiplier = low_multiplier if low > start else high_multiplier
        if high_multiplier not in (multiplier, 0):
            multiplier = 0  # the two edges have different multipliers
        unknown_order = 0
        tongues.append(Tongue(unknown_order, multiplier, low, high, growth, peak))
    return tongues


def _find_edges(model: Any, grid: np.ndarray) -> list:
    """Return the tunings at which the stability may change, as a list of (tuning, multiplier).

    `grid` contains increasing tunings (mesh frequency / natural frequency). The multiplier on the
    unit circle is 1 or -1, or has the code 0 for a complex pair.
    """
    maps = np.array([model.contact_monodromy(nu) for nu in grid])
    edges = [
        (nu, value)
        for value in (1, -1)
        for nu in _find_multiplier_tunings(model, value, grid, maps)
    ]
    is_unstable = [_log_spectral_radius(matrix) > _MIN_GROWTH for matrix in maps]
    # A change of stability without a multiplier 1 or -1 is due to a complex pair.
    for i, (low, high) in enumerate(pairwise(grid)):
        has_edge = any(low <= nu <= high for nu, _ in edges)
        if is_unstable[i] != is_unstable[i + 1] and not has_edge:
            edges.append(
                (meissner.find_root(lambda nu: _growth(model, nu) - _MIN_GROWTH, low, high), 0)
            )
    return edges


def _find_largest_growth(model: Any, low: float, high: float, grid: np.ndarray) -> tuple:
    """Return (largest growth, its tuning) for tunings between two edges `low` and `high`.

    The growth is the logarithm of the largest Floquet multiplier over a mesh period, positive if
    steady contact is unstable. Its maximum over the increasing tunings `grid` is refined if it
    exceeds rounding errors.
    """
    tunings = [low, *grid[(grid > low) & (grid < high)], high]
    inner = tunings[1:-1] or [0.5 * (low + high)]
    growths = [_growth(model, nu) for nu in inner]
    best = int(np.argmax(growths))
    if growths[best] <= _MIN_GROWTH:
        return growths[best], inner[best]
    bracket = tunings if len(tunings) > 2 else [low, inner[0], high]
    return meissner.maximise(lambda nu: _growth(model, nu), bracket[best], bracket[best + 2])


def _characteristic_determinant(model: Any, tuning: float, multiplier: int) -> float:
    """Return det(M - multiplier I) of the monodromy matrix M of the motion without contact loss.

    M maps small perturbations over one mesh period, and `tuning` is the ratio of mesh frequency to
    natural frequency. The determinant is zero if `multiplier`, 1 or -1, is a Floquet multiplier.
    """
    monodromy = model.contact_monodromy(tuning)
    return float(np.linalg.det(monodromy - multiplier * np.eye(len(monodromy))))


def _growth(model: Any, tuning: float) -> float:
    """Return the logarithm of the largest Floquet multiplier of the motion without contact loss."""
    return _log_spectral_radius(model.contact_monodromy(tuning))


def _log_spectral_radius(matrix: np.ndarray) -> float:
    """Return the logarithm of the largest absolute eigenvalue of a matrix."""
    return math.log(np.abs(np.linalg.eigvals(matrix)).max())


def _find_multiplier_tunings(
    model: Any, multiplier: int, grid: np.ndarray, maps: np.ndarray
) -> list:
    """Find the tunings at which `multiplier`, 1 or -1, is a Floquet multiplier.

    The tunings (mesh frequency / natural frequency) are zeros of det(M - multiplier I) with the
    monodromy matrix M. They are bracketed on the increasing tunings `grid`, shape (m,), at which
    `maps`, shape (m, n, n), are the matrices M.
    """
    values = np.linalg.det(maps - multiplier * np.eye(maps.shape[1]))

    def characteristic(tuning: float) -> float:
        """Return det(M - multiplier I) at a tuning."""
        return _characteristic_determinant(model, tuning, multiplier)

    zeros = []
    for i, (low, high) in enumerate(pairwise(grid)):
        if values[i] * values[i + 1] < 0.0:
            zeros.append(meissner.find_root(characteristic, low, high))
        elif 0 < i and _may_hide_zeros(values[i - 1 : i + 2]):
            # At a minimum of the magnitude there may be a narrow tongue between two zeros.
            sign = math.copysign(1.0, values[i])
            minimum = minimize_scalar(
                lambda nu, sign=sign: sign * characteristic(nu),
                bounds=(grid[i - 1], high),
                method="bounded",
                options={"xatol": 1e-10},
            )
            # If the sign changes, there is a zero on both sides of the minimum.
            if minimum.fun < 0.0:
                for end in (grid[i - 1], high):
                    zeros.append(meissner.find_root(characteristic, *sorted((minimum.x, end))))
    return zeros


def _may_hide_zeros(values: np.ndarray) -> bool:
    """Return whether a function may have two zeros between three successive values.

    This is the case if the values have the same sign and the middle value is nearest to zero.
    """
    left, middle, right = np.abs(values)
    have_same_sign = values[0] * values[1] > 0.0 and values[1] * values[2] > 0.0
    return bool(have_same_sign and middle <= left and middle <= right)
