"""Attractors: candidates among final states, refined by shooting, with their trapping ellipses.

Every point of a stable periodic orbit lies in a *trapping ellipse* that no sampled motion leaves.
The ellipses are level lines of a quadratic form that the linearised map contracts; how far the
nonlinear map still does so is sampled on nested rings: it maps 32 states of each ring (with more
than two coordinates, 128 of each ellipsoid, in random directions) into the next smaller one. If
this held for the whole of each ring, all states within would lead to the orbit, for two
coordinates, as the map is one-to-one and continuous; between the samples it is not proved. A run
ends inside a trapping ellipse; `gearlib.basins` with ``stop_early=False`` goes on.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.linalg import solve_discrete_lyapunov

from gearlib.analysis.global_dynamics.stroboscope import Stroboscope
from gearlib.analysis.orbits.shooting import NoOrbit, Orbit, compose, periodic_orbit
from gearlib.engines import orbit as columns

KINDS = ("periodic", "chaotic", "unbounded", "undecided")
PERIODIC, CHAOTIC, UNBOUNDED, UNDECIDED = range(4)

#: Longest period of an orbit that is sought, in cycles.
MAX_CYCLES = 32
#: Distance of states one period apart that are a guess for shooting, relative to the motion's size.
_GUESS_TOLERANCE = 1e-2
#: Points closer than this, static deflections (relative to larger motions), count as equal.
_SAME_POINT_TOLERANCE = 1e-6
#: Distance from the unit circle below which a multiplier neither attracts nor repels.
_MIN_DECAY = 1e-6
#: Factor by which the linearised map contracts the quadratic form.
_CONTRACTION = 0.5
#: Ratio of the radii of neighbouring rings, and their number, from the size of the motion down.
_RING_RATIO, _RING_COUNT = 0.7, 40
#: Sampled directions of ellipses with two coordinates, and with more.
_PLANE_DIRECTIONS, _SPACE_DIRECTIONS = 32, 128


@dataclass(frozen=True)
class TrappingEllipses:
    """Ellipses around the points of an orbit that no sampled motion leaves."""

    points: np.ndarray  #: shape (m, n), in the coordinates of `Stroboscope.scaled`
    forms: np.ndarray  #: quadratic forms, shape (m, n, n)
    radii: np.ndarray  #: shape (m,): form of the difference <= radius^2; static deflections

    def contain(self, scaled_states: np.ndarray) -> np.ndarray:
        """Return which of the scaled states, shape (k, n), lie in one of the ellipses."""
        inside = np.zeros(len(scaled_states), bool)
        for point, form, radius in zip(self.points, self.forms, self.radii, strict=True):
            difference = scaled_states - point
            squares = np.einsum("ki,ij,kj->k", difference, form, difference)
            inside |= squares <= radius * radius
        return inside


@dataclass(frozen=True)
class Attractor:
    """A set to which motions converge: a periodic orbit, or a class of other motions."""

    kind: int  #: index in `KINDS`
    displacement_max: float = np.nan
    displacement_min: float = np.nan
    orbit: Orbit | None = None
    ellipses: TrappingEllipses | None = field(default=None, repr=False)
    points: np.ndarray | None = field(default=None, repr=False)  #: full states, shape (m, n)
    exponent: float = np.nan  #: largest Lyapunov exponent per mesh period
    uncertainty: float = np.nan  #: of the exponent

    @property
    def period(self) -> int:
        """Mesh periods; 0 unless periodic."""
        return self.orbit.period if self.orbit else 0

    @property
    def sort_key(self) -> tuple:
        """Key by which attractors are sorted: kind, period, height."""
        height = self.displacement_max - self.displacement_min
        return self.kind, self.period, height if np.isfinite(height) else np.inf


def find_attractors(strobe: Stroboscope, states: np.ndarray, known: list) -> list:
    """Return the periodic `Attractor`s near settled states (k, n) that are not yet known."""
    series = [states]
    for _ in range(2 * MAX_CYCLES):
        series.append(strobe(series[-1], 1)[0])
    # From the latest to the earliest: the latest has settled best.
    series = np.array(series[::-1])
    scaled_series, all_known = strobe.scaled(series), list(known)
    for k in range(len(states)):
        if not np.isfinite(scaled_series[:, k]).all():
            continue
        if any(attractor.ellipses.contain(scaled_series[:1, k])[0] for attractor in all_known):
            continue
        attractor = _attractor_at(strobe, series[0, k], scaled_series[:, k])
        if attractor and not any(_are_equal(attractor, other) for other in all_known):
            all_known.append(attractor)
    return all_known[len(known) :]


def _are_equal(first: Any, second: Any) -> bool:
    """Return whether two periodic attractors are the same orbit."""
    points = first.ellipses.points
    size = max(1.0, np.abs(points).max())
    distances = np.abs(second.ellipses.points - points[0]).max(axis=1)
    return bool((distances < _SAME_POINT_TOLERANCE * size).any())


def _attractor_at(
    strobe: Stroboscope, state: np.ndarray, scaled_series: np.ndarray
) -> Attractor | None:
    """Return the periodic attractor at a settled state, or None.

    `scaled_series` holds the scaled state and those of the cycles before it, the latest first.
    """
    size = max(1.0, np.ptp(scaled_series, axis=0).max())
    for n in range(1, MAX_CYCLES + 1):
        if np.abs(scaled_series[n] - scaled_series[0]).max() > _GUESS_TOLERANCE * size:
            continue
        period, max_events = n * strobe.cycle, strobe.max_events
        try:
            orbit = periodic_orbit(
                strobe.pair, strobe.tuning, guess=state, period=period, max_events=max_events
            )
        except NoOrbit:
            continue
        largest = np.abs(orbit.multipliers).max()
        if largest <= 1.0 + _MIN_DECAY:
            # Without damping in contact neither the orbit nor its neighbours attract.
            return attractor_of(strobe, orbit) if largest < 1.0 - _MIN_DECAY else None
    return None


def attractor_of(strobe: Stroboscope, orbit: Orbit) -> Attractor:
    """Return the attractor of a stable orbit, with its trapping ellipses."""
    points = [orbit.state]
    for _ in range(orbit.period // strobe.cycle - 1):
        points.append(strobe(points[-1][None], 1)[0][0])
    points = np.array(points)
    summary = strobe.propagator.record(orbit.state, orbit.period, strobe.max_events).summary
    return Attractor(
        PERIODIC,
        float(summary[columns.X_MAX]),
        float(summary[columns.X_MIN]),
        orbit,
        _trapping_ellipses(strobe, points),
        points,
        exponent=float(np.log(np.abs(orbit.multipliers).max())) / orbit.period,
        uncertainty=0.0,
    )


def _trapping_ellipses(strobe: Stroboscope, points: np.ndarray) -> TrappingEllipses:
    """Return the largest ellipses around the points (m, n) of an orbit that no sample leaves."""
    centres = strobe.scaled(points)
    size = max(1.0, np.abs(centres).max())
    count, n = centres.shape
    maps = strobe.cycle_maps(points[0], count)
    forms, factors = np.empty((count, n, n)), np.empty((count, n, n))
    spectral_radius = np.abs(np.linalg.eigvals(compose(maps))).max()
    log_radius = np.log(max(spectral_radius, 1e-12))
    turns = max(1, int(np.ceil(2.0 * np.log(_CONTRACTION) / log_radius)))
    for j in range(count):
        return_map = np.linalg.matrix_power(compose(np.roll(maps, -j, axis=0)), turns)
        # Smallest solution S of A^T S A = _CONTRACTION^2 (S - 1) with the return map A.
        forms[j] = solve_discrete_lyapunov(return_map.T / _CONTRACTION, np.eye(n))
        factors[j] = np.linalg.inv(np.linalg.cholesky(forms[j]).T)
    rings = size * _RING_RATIO ** np.arange(_RING_COUNT)
    directions = _unit_vectors(n)
    # Shape (points, rings, directions, n).
    offsets = np.einsum("jab,db->jda", factors, directions)[:, None] * rings[:, None, None]
    samples = (centres[:, None, None] + offsets).reshape(-1, n) / strobe.weights
    base = np.repeat(points, rings.size * len(directions), axis=0)
    starts = base + (samples - strobe.scaled(base) / strobe.weights) @ strobe.lift.T
    ends, _ = strobe(starts, turns * count)
    end_offsets = strobe.scaled(ends).reshape(count, rings.size, -1, n) - centres[:, None, None]
    radii = np.sqrt(np.einsum("jrda,jab,jrdb->jrd", end_offsets, forms, end_offsets)).max(axis=2)
    # A NaN, of a run that could not go on, is not inside.
    inside = radii <= _RING_RATIO * rings
    trapping_radii = np.empty(count)
    for j in range(count):
        failed = np.flatnonzero(~inside[j])
        first = failed[-1] + 1 if failed.size else 0
        # Below the smallest ring rounding dominates: there only the states of the orbit itself.
        is_ring = first < rings.size
        trapping_radii[j] = rings[first] if is_ring else _SAME_POINT_TOLERANCE * size
    return TrappingEllipses(centres, forms, trapping_radii)


def _unit_vectors(n: int) -> np.ndarray:
    """Return unit vectors, shape (k, n), spread over all directions."""
    if n == 2:
        angles = 2.0 * np.pi * np.arange(_PLANE_DIRECTIONS) / _PLANE_DIRECTIONS
        return np.stack([np.cos(angles), np.sin(angles)], axis=1)
    directions = np.random.default_rng(0).normal(size=(_SPACE_DIRECTIONS, n))
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)
