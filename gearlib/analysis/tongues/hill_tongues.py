"""Tongues of other meshes by the numerical monodromy of the motion without loss of contact.

One degree of freedom with any periodic stiffness is Hill's equation. The trace T of its map over
one mesh period, freed of the damping, oscillates over k = 1 / nu and has exactly one extremum in
each gap, |T| >= 2, and none between: the extrema number the tongues, however narrow. Edges are
bracketed between them. T has rounding errors, so that a gap narrower than about 1e-7 of its tuning
counts as a point.

With more coordinates the tongues also belong to sums and differences of eigenfrequencies, and are
not numbered. Edges with a multiplier 1 or -1 are the zeros of det(M - I) and det(M + I), bracketed
on a grid of tunings, pairs of them between two grid points included; where a complex pair of
multipliers leaves the unit circle, the edge is bisected on the spectral radius.
"""

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from gearlib.analysis.tongues import meissner
from gearlib.analysis.tongues.meissner import Tongue, period_map
from gearlib.models.harmonics import Harmonics

#: Step of the scan over 1 / nu; the distance of tongues is about a half.
_SCAN_STEP = 1.0 / 32.0
#: Largest value of |T| / 2 - 1 that rounding may cause.
_ROUNDING = 2e-14
#: Growth per mesh period up to which motions of many coordinates count as stable: the square root
#: of rounding, by which double multipliers change.
_MIN_GROWTH = 1e-6
#: Shares of the estimated closing damping ratio at which the growth of a tongue is computed.
_SCANNED_SHARES = np.array([0.0, 0.5, 0.9, 1.1, 1.5, 3.0])
_MAX_ESTIMATED_DAMPING = 0.3


def tongues_of_one_degree(pair: Any, start: float, stop: float) -> list:
    """Return the `Tongue`s of a linear `OneDegreePair` in gaps that meet `start` to `stop`."""
    tongues = []
    for order, extrema in _trace_extrema(pair, 1.0 / start):
        tongue, (low, high) = _gap_tongue(pair, order, *extrema)
        if low > 1.0 / start:
            break
        if high >= 1.0 / stop:
            tongues.append(tongue)
    return tongues


def closing_damping(pair: Any, tongue: Tongue) -> float:
    """Return the damping ratio that closes a tongue of a linear `OneDegreePair`; 0 for a point."""
    undamped = with_damping(pair, 0.0)
    extrema = dict(_trace_extrema(undamped, 1.0 / tongue.peak))
    before, middle, after = extrema[tongue.order]
    undamped_tongue, _ = _gap_tongue(undamped, tongue.order, before, middle, after)
    if undamped_tongue.growth <= 0.0:
        return 0.0

    def growth(damping: float) -> float:
        """Return the growth of the tongue at a damping ratio."""
        # Damping lowers the frequency, so that the extrema shift.
        shift = 1.0 / math.sqrt(1.0 - damping * damping)
        damped = with_damping(pair, damping)
        low, high = shift * (before + middle) / 2.0, shift * (middle + after) / 2.0
        peak = _trace_extremum(damped, tongue.order, low, high)
        return _gap_tongue(damped, tongue.order, shift * before, peak, shift * after)[0].growth

    # The estimate neglects that damping also changes the growth without loss.
    estimate = undamped_tongue.growth * undamped_tongue.peak / (2.0 * math.pi)
    dampings = min(estimate, _MAX_ESTIMATED_DAMPING) * _SCANNED_SHARES
    return meissner.last_downward_zero(growth, dampings)


def closing_damping_of_six_degrees(pair: Any, tongue: Tongue) -> float:
    """Return the damping ratio of the mesh that closes a tongue of a `SixDegreePair`.

    The tongue is followed within its undamped width: by the determinant that is zero on its edges,
    or, with a complex pair, by its growth, to 1e-6 per mesh period. NaN: it is not closed below a
    damping ratio of 1.
    """
    sign = math.copysign(1.0, _characteristic(pair, tongue.peak, tongue.multiplier))

    def largest_margin(damping: float) -> float:
        """Return the largest margin of instability in the tongue at a damping ratio."""
        damped = with_damping(pair, damping)

        def margin(nu: float) -> float:
            """Return a number that is positive where the motion at a tuning is unstable."""
            if tongue.multiplier:
                return sign * _characteristic(damped, nu, tongue.multiplier)
            return _growth(damped, nu) - _MIN_GROWTH

        return meissner.maximum(margin, tongue.start, tongue.stop)[0]

    # The estimate neglects that damping also changes the growth without loss.
    estimate = pair.pair.damping_ratio + tongue.growth * tongue.peak / (2.0 * math.pi)
    dampings = [0.0, estimate]
    while largest_margin(dampings[-1]) > 0.0:
        dampings.append(1.25 * dampings[-1])
        if dampings[-1] > 1.0:
            return math.nan
    return meissner.last_downward_zero(largest_margin, dampings)


def with_damping(pair: Any, damping: float) -> Any:
    """Return a model with a damping ratio of the material, and all else as it is."""
    material = 2.0 * damping * pair.reduced_mass * pair.mean_eigenfrequency
    return pair.replace(material_damping=material)


def _half_trace(pair: Any, k: float, order: int) -> float:
    """Return (-1)^order T / 2 at the tuning 1 / k, which is above 1 in the gap of an order.

    T is the trace of the map over one mesh period, freed of the damping.
    """
    growth = math.exp(2.0 * math.pi * pair.damping_ratio * k)
    unforced = pair.replace(excitation=Harmonics(), deviation=Harmonics())
    return 0.5 * (-1.0) ** order * growth * float(np.trace(period_map(unforced, 1.0 / k)[0]))


def _trace_extremum(pair: Any, order: int, low: float, high: float) -> float:
    """Return k = 1 / nu between `low` and `high` where the trace T is extreme, in one gap."""
    return meissner.maximum(lambda k: _half_trace(pair, k, order), low, high)[1]


def _trace_extrema(pair: Any, max_k: float) -> Iterator[tuple]:
    """Yield (order, extrema) of the gaps up to `max_k`, and of one more.

    The extrema are the k = 1 / nu at which the trace T is extreme before, in and after the gap. The
    first extremum of all is k = 0, where T = 2.
    """
    if pair.damping_ratio >= 1.0:
        raise ValueError(
            f"damping_ratio = {pair.damping_ratio!r} is not allowed: it must be < 1 for a "
            "stiffness that is not rectangular"
        )
    extrema, order = [0.0], 1
    k, before, middle = 2.0 * _SCAN_STEP, 1.0, _half_trace(pair, _SCAN_STEP, 0)
    while True:
        after, sign = _half_trace(pair, k, 0), (-1) ** order
        if sign * (middle - before) > 0.0 >= sign * (after - middle):
            extrema.append(_trace_extremum(pair, order, k - 2.0 * _SCAN_STEP, k))
            if order > 1:
                yield order - 1, tuple(extrema[-3:])
                if extrema[-2] > max_k:
                    return
            order += 1
        k, before, middle = k + _SCAN_STEP, middle, after


def _gap_tongue(pair: Any, order: int, before: float, middle: float, after: float) -> tuple:
    """Return (`Tongue`, ends of its gap over k = 1 / nu) around an extremum of the trace T.

    T is extreme at `middle`; the ends lie between the neighbouring extrema `before` and `after`,
    and are equal if the gap is too narrow.
    """

    def excess(k: float) -> float:
        """Return |T| / 2 - 1 in the gap."""
        return _half_trace(pair, k, order) - 1.0

    def scaled_excess(k: float) -> tuple:
        """Return |T| / 2 - 1 in the gap with the exponent 0 of its scale."""
        return excess(k), 0.0

    ends = middle, middle
    if excess(middle) > _ROUNDING:
        ends = tuple(meissner.edge(excess, middle, k) for k in (max(before, _SCAN_STEP), after))
    return meissner.tongue_in_gap(order, *ends, pair.damping_ratio, scaled_excess), ends


def tongues_of_several_degrees(pair: Any, start: float, stop: float, step: float) -> list:
    """Return the `Tongue`s of several degrees of freedom within a range of tunings, in order.

    They are cut off at `start` and `stop`; `step` is the distance of the tunings of the scan.
    """
    grid = np.linspace(start, stop, max(3, math.ceil((stop - start) / step) + 1))
    edges = [(start, 0), *sorted(_edges(pair, grid)), (stop, 0)]
    tongues: list = []
    for (low, first), (high, last) in pairwise(edges):
        if high <= low:
            continue
        growth, peak = _largest_growth(pair, low, high, grid)
        if growth <= _MIN_GROWTH:
            continue
        if tongues and tongues[-1].stop == low:
            # The edge lies inside a tongue and does not divide it.
            previous = tongues.pop()
            low, first = previous.start, previous.multiplier
            growth, peak = max((growth, peak), (previous.growth, previous.peak))
        # At the ends of the range the multiplier is not known.
        multiplier = first if low > start else last
        if last not in (multiplier, 0):
            multiplier = 0
        tongues.append(Tongue(0, multiplier, low, high, growth, peak))
    return tongues


def _edges(pair: Any, grid: np.ndarray) -> list:
    """Return a list of (tuning, multiplier) where stability may change, between grid tunings.

    The multiplier is 1 or -1, 0 for a complex pair.
    """
    maps = np.array([pair.contact_map(nu) for nu in grid])
    edges = [(nu, sign) for sign in (1, -1) for nu in _zeros(pair, sign, grid, maps)]
    unstable = [_log_spectral_radius(matrix) > _MIN_GROWTH for matrix in maps]

    def margin(nu: float) -> float:
        """Return a number that is positive where the motion at a tuning is unstable."""
        return _growth(pair, nu) - _MIN_GROWTH

    for i, (low, high) in enumerate(pairwise(grid)):
        if unstable[i] != unstable[i + 1] and not any(low <= nu <= high for nu, _ in edges):
            edges.append((meissner.root(margin, low, high), 0))
    return edges


def _largest_growth(pair: Any, low: float, high: float, grid: np.ndarray) -> tuple:
    """Return (largest growth, its tuning) between two edges `low` and `high`.

    The largest growth at the tunings of the grid is refined if the motion is unstable there.
    """
    tunings = [low, *grid[(grid > low) & (grid < high)], high]
    inner = tunings[1:-1] or [0.5 * (low + high)]
    growths = [_growth(pair, nu) for nu in inner]
    best = int(np.argmax(growths))
    if growths[best] <= _MIN_GROWTH:
        return growths[best], inner[best]
    bracket = tunings if len(tunings) > 2 else [low, inner[0], high]
    return meissner.maximum(lambda nu: _growth(pair, nu), bracket[best], bracket[best + 2])


def _characteristic(pair: Any, nu: float, sign: int) -> float:
    """Return det(M - sign I), which is zero at tunings where a Floquet multiplier is `sign`.

    M is the monodromy matrix at the tuning `nu`; `sign` is 1 or -1.
    """
    matrix = pair.contact_map(nu)
    return float(np.linalg.det(matrix - sign * np.eye(len(matrix))))


def _growth(pair: Any, nu: float) -> float:
    """Return the logarithm of the largest Floquet multiplier of the motion in contact."""
    return _log_spectral_radius(pair.contact_map(nu))


def _log_spectral_radius(matrix: np.ndarray) -> float:
    """Return the logarithm of the largest absolute eigenvalue of a matrix."""
    return math.log(np.abs(np.linalg.eigvals(matrix)).max())


def _zeros(pair: Any, sign: int, grid: np.ndarray, maps: np.ndarray) -> list:
    """Return the tunings at which a Floquet multiplier is `sign`, 1 or -1.

    `grid` are rising tunings, `maps` the monodromy matrices at these, shape (m, n, n).
    """
    values = np.linalg.det(maps - sign * np.eye(maps.shape[1]))

    def characteristic(nu: float) -> float:
        """Return the determinant at a tuning."""
        return _characteristic(pair, nu, sign)

    zeros = []
    for i, (low, high) in enumerate(pairwise(grid)):
        if values[i] * values[i + 1] < 0.0:
            zeros.append(meissner.root(characteristic, low, high))
        elif 0 < i and _has_minimum(values[i - 1 : i + 2]):
            # A narrow tongue may lie between two grid points where the value comes close to zero.
            side = math.copysign(1.0, values[i])
            minimum = minimize_scalar(
                lambda nu, side=side: side * characteristic(nu),
                bounds=(grid[i - 1], high),
                method="bounded",
                options={"xatol": 1e-10},
            )
            if minimum.fun < 0.0:
                for end in (grid[i - 1], high):
                    zeros.append(meissner.root(characteristic, *sorted((minimum.x, end))))
    return zeros


def _has_minimum(values: np.ndarray) -> bool:
    """Return whether three values have one sign and the smallest magnitude in the middle."""
    first, middle, last = np.abs(values)
    have_one_sign = values[0] * values[1] > 0.0 and values[1] * values[2] > 0.0
    return bool(have_one_sign and middle <= first and middle <= last)
