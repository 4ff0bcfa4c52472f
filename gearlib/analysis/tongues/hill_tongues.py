"""Tongues of other meshes by the numerical monodromy of the motion without loss of contact.

One degree of freedom with any periodic stiffness is Hill's equation. The trace of its map over one
mesh period, freed of the damping, oscillates over k = 1 / nu and has exactly one extremum in each
gap, |T| >= 2, and none between: the extrema number the tongues, however narrow. Edges are bracketed
between them. T rounds, so that a gap narrower than about 1e-7 of its tuning is taken for a point.

With more coordinates the tongues also belong to sums and differences of eigenfrequencies, and are
not numbered. Edges with a multiplier 1 or -1 are the zeros of det(M - I) and det(M + I), bracketed
on a grid of tunings, pairs of them between two grid points included; where a complex pair of
multipliers leaves the unit circle, the edge is bisected on the spectral radius.
"""

import math
from itertools import pairwise

import numpy as np
from scipy.optimize import minimize_scalar

from gearlib.analysis.tongues import meissner
from gearlib.analysis.tongues.meissner import Tongue, period_map
from gearlib.models.harmonics import Harmonics

#: Steps of the scan over 1 / nu; a tongue comes about every half.
_SCAN_STEP = 1.0 / 32.0
#: |T| / 2 - 1 that counts as rounding.
_ROUNDING = 2e-14
#: Growth per mesh period that counts as none with many coordinates: of a double multiplier, whose
#: places move by the square root of rounding.
_NO_GROWTH = 1e-6


def one_degree(pair, start, stop):
    """Return the `Tongue`s of a linear `OneDegreePair` whose gaps meet a range of tunings."""
    tongues = []
    for order, places in _extrema(pair, 1.0 / start):
        tongue, (low, high) = _gap_tongue(pair, order, *places)
        if low > 1.0 / start:
            break
        if high >= 1.0 / stop:
            tongues.append(tongue)
    return tongues


def closing_damping(pair, tongue):
    """Return the damping ratio that closes a tongue of a linear `OneDegreePair`; 0: a point."""
    free = with_damping(pair, 0.0)
    near = {order: places for order, places in _extrema(free, 1.0 / tongue.peak)}
    before, here, after = near[tongue.order]
    undamped, _ = _gap_tongue(free, tongue.order, before, here, after)
    if undamped.growth <= 0.0:
        return 0.0

    def growth(damping):
        # Damping lowers the frequency of all.
        shift = 1.0 / math.sqrt(1.0 - damping * damping)
        damped = with_damping(pair, damping)
        low, high = shift * (before + here) / 2.0, shift * (here + after) / 2.0
        peak = _extremum(damped, tongue.order, low, high)
        return _gap_tongue(damped, tongue.order, shift * before, peak, shift * after)[0].growth

    # Growth less loss, as if damping changed nothing else.
    about = min(undamped.growth * undamped.peak / (2.0 * math.pi), 0.3)
    return meissner.closing(growth, about * np.array([0.0, 0.5, 0.9, 1.1, 1.5, 3.0]))


def closing_six(pair, tongue):
    """Return the damping ratio of the mesh that closes a tongue of a `SixDegreePair`.

    The tongue is followed within its own width: by the determinant that is zero on its edges, or,
    with a complex pair, by its growth, to 1e-6 per mesh period. NaN: not closed below a damping
    ratio of 1.
    """
    inside = math.copysign(1.0, _miss(pair, tongue.peak, tongue.multiplier))

    def largest(damping):
        damped = with_damping(pair, damping)
        if tongue.multiplier:
            over = lambda nu: inside * _miss(damped, nu, tongue.multiplier)  # noqa: E731
        else:
            over = lambda nu: _growth(damped, nu) - _NO_GROWTH  # noqa: E731
        return meissner.strongest(over, tongue.start, tongue.stop)[0]

    # Growth less loss, as if damping changed nothing else.
    dampings = [0.0, pair.pair.damping_ratio + tongue.growth * tongue.peak / (2.0 * math.pi)]
    while largest(dampings[-1]) > 0.0:
        dampings.append(1.25 * dampings[-1])
        if dampings[-1] > 1.0:
            return math.nan
    return meissner.closing(largest, dampings)


def with_damping(pair, damping):
    """Return a model with another damping ratio of the material."""
    material = 2.0 * damping * pair.reduced_mass * pair.mean_eigenfrequency
    return pair.replace(material_damping=material)


def _half_trace(pair, k, order):
    """Return T / 2 of the map freed of the damping, > 1 in the gap of an order."""
    free = math.exp(2.0 * math.pi * pair.damping_ratio * k)
    unforced = pair.replace(excitation=Harmonics(), deviation=Harmonics())
    return 0.5 * (-1.0) ** order * free * float(np.trace(period_map(unforced, 1.0 / k)[0]))


def _extremum(pair, order, low, high):
    """Return where T has its extremum in a gap."""
    return meissner.strongest(lambda k: _half_trace(pair, k, order), low, high)[1]


def _extrema(pair, most):
    """Yield (order, places of the extrema of T before, at and after it), the last beyond `most`.

    Before the first is k = 0, where T = 2.
    """
    if pair.damping_ratio >= 1.0:
        raise ValueError(
            f"damping_ratio = {pair.damping_ratio!r} is not allowed: it must be < 1 for a "
            "stiffness that is not rectangular"
        )
    places, order = [0.0], 1
    k, before, here = 2.0 * _SCAN_STEP, 1.0, _half_trace(pair, _SCAN_STEP, 0)
    while True:
        after, sign = _half_trace(pair, k, 0), (-1) ** order
        if sign * (here - before) > 0.0 >= sign * (after - here):
            places.append(_extremum(pair, order, k - 2.0 * _SCAN_STEP, k))
            if order > 1:
                yield order - 1, tuple(places[-3:])
                if places[-2] > most:
                    return
            order += 1
        k, before, here = k + _SCAN_STEP, here, after


def _gap_tongue(pair, order, before, here, after):
    """Return the `Tongue` in the gap around an extremum of T, its ends (k, k) between the others.

    The ends are equal if the gap is too narrow to resolve.
    """

    def excess(k):
        return _half_trace(pair, k, order) - 1.0

    ends = here, here
    if excess(here) > _ROUNDING:
        ends = tuple(meissner.edge(excess, here, k) for k in (max(before, _SCAN_STEP), after))
    damping = pair.damping_ratio
    return meissner.within_gap(order, *ends, damping, lambda k: (excess(k), 0.0)), ends


def several_degrees(pair, start, stop, step):
    """Return the `Tongue`s of several degrees of freedom within a range of tunings, in order.

    They are cut off at `start` and `stop`; `step` is the distance of the tunings of the scan.
    """
    grid = np.linspace(start, stop, max(3, math.ceil((stop - start) / step) + 1))
    maps = np.array([pair.contact_map(nu) for nu in grid])
    edges = [(nu, sign) for sign in (1, -1) for nu in _zeros(pair, sign, grid, maps)]
    unstable = [_log_radius(matrix) > _NO_GROWTH for matrix in maps]

    def over(nu):
        return _growth(pair, nu) - _NO_GROWTH

    for i, (low, high) in enumerate(pairwise(grid)):
        if unstable[i] != unstable[i + 1] and not any(low <= nu <= high for nu, _ in edges):
            # A complex pair leaves the unit circle.
            edges.append((meissner.root(over, low, high), 0))
    edges = [(start, 0), *sorted(edges), (stop, 0)]
    tongues = []
    for (low, first), (high, last) in pairwise(edges):
        if high <= low:
            continue
        growth, peak = _strongest(pair, low, high, grid)
        if growth <= _NO_GROWTH:
            continue
        if tongues and tongues[-1].stop == low:
            before = tongues.pop()
            low, first = before.start, before.multiplier
            growth, peak = max((growth, peak), (before.growth, before.peak))
        # A cut edge says nothing.
        sign = first if low > start else last
        tongues.append(Tongue(0, sign if last in (sign, 0) else 0, low, high, growth, peak))
    return tongues


def _strongest(pair, low, high, grid):
    """Return (growth, its tuning) between two edges: from grid points, refined about the best."""
    places = [low, *grid[(grid > low) & (grid < high)], high]
    inner = places[1:-1] or [0.5 * (low + high)]
    growths = [_growth(pair, nu) for nu in inner]
    best = int(np.argmax(growths))
    if growths[best] <= _NO_GROWTH:
        return growths[best], inner[best]
    around = places if len(places) > 2 else [low, inner[0], high]
    return meissner.strongest(lambda nu: _growth(pair, nu), around[best], around[best + 2])


def _miss(pair, nu, sign):
    """Return det(M - sign I), zero where a multiplier is `sign`."""
    matrix = pair.contact_map(nu)
    return float(np.linalg.det(matrix - sign * np.eye(len(matrix))))


def _growth(pair, nu):
    """Return the logarithm of the largest multiplier of the motion in contact."""
    return _log_radius(pair.contact_map(nu))


def _log_radius(matrix):
    return math.log(np.abs(np.linalg.eigvals(matrix)).max())


def _zeros(pair, sign, grid, maps):
    """Return the tunings where a multiplier is `sign`: zeros of det(M - sign I) over a grid."""
    values = np.linalg.det(maps - sign * np.eye(maps.shape[1]))

    def miss(nu):
        return _miss(pair, nu, sign)

    zeros = []
    for i, (low, high) in enumerate(pairwise(grid)):
        if values[i] * values[i + 1] < 0.0:
            zeros.append(meissner.root(miss, low, high))
        elif 0 < i and _turns(values[i - 1 : i + 2]):
            # Towards zero and back: a narrow tongue may hide here.
            side = math.copysign(1.0, values[i])
            turn = minimize_scalar(
                lambda nu, side=side: side * miss(nu),
                bounds=(grid[i - 1], high),
                method="bounded",
                options={"xatol": 1e-10},
            )
            if turn.fun < 0.0:
                for end in (grid[i - 1], high):
                    zeros.append(meissner.root(miss, *sorted((turn.x, end))))
    return zeros


def _turns(three):
    """Return whether |values| have a minimum in the middle, all of one sign."""
    a, b, c = np.abs(three)
    return three[0] * three[1] > 0.0 < three[1] * three[2] and b <= a and b <= c
