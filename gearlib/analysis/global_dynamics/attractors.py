"""Periodic attractors, found from final states by shooting, and their trapping ellipses.

Every point of a stable periodic orbit lies in a *trapping ellipse* that no sampled motion leaves.
The ellipses are level lines of a quadratic form that the linearised map contracts. Nested rings
show how far from the orbit the nonlinear map also contracts it: the map takes 32 states of each
ring (128 states of each ellipsoid in random directions, if there are more than two coordinates)
into the next smaller ring. If this held for all states of the rings, all states inside would
converge to the orbit, at least with two coordinates, because the map is one-to-one and continuous;
between the samples this is not proved. A run stops in a trapping ellipse, except in
`gearlib.basins` with ``stop_early=False``.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.linalg import solve_discrete_lyapunov

from gearlib.analysis.global_dynamics.stroboscope import Stroboscope
from gearlib.analysis.orbits.shooting import NoOrbit, Orbit, compose, periodic_orbit
from gearlib.engines import orbit as columns
from gearlib.progress import TimeLimit

KINDS = ("periodic", "chaotic", "unbounded", "undecided")
PERIODIC, CHAOTIC, UNBOUNDED, UNDECIDED = range(4)

#: Longest period of the orbits that are searched for, in cycles.
MAX_CYCLES = 32
#: Shooting is tried if states one period apart differ by less than this, relative to the motion.
_GUESS_TOLERANCE = 1e-2
#: Points that differ by less than this are equal, in units of the static deflection (relative to
#: larger motions).
_SAME_POINT_TOLERANCE = 1e-6
#: Orbits with multipliers closer to the unit circle than this are neither stable nor unstable.
_MIN_DECAY = 1e-6
#: Factor by which the linearised map contracts the radius of an ellipse.
_CONTRACTION = 0.5
#: Ratio of the radii of successive rings, and number of rings; the first ring is as large as the
#: orbit.
_RING_RATIO, _RING_COUNT = 0.7, 40
#: Number of sampled directions with two coordinates, and with more.
_PLANE_DIRECTIONS, _SPACE_DIRECTIONS = 32, 128


@dataclass(frozen=True)
class TrappingEllipses:
    """Ellipses around the points of an orbit, which no sampled motion leaves."""

    points: np.ndarray  #: shape (m, n), in the coordinates of `Stroboscope.reduce_and_scale`
    forms: np.ndarray  #: quadratic forms, shape (m, n, n)
    radii: np.ndarray  #: shape (m,), static deflections: (x - point)^T form (x - point) <= radius^2

    def contain(self, scaled_states: np.ndarray) -> np.ndarray:
        """Return a mask, shape (k,), of the states that lie inside any of the ellipses.

        `scaled_states`, shape (k, n), are results of `Stroboscope.reduce_and_scale`. Ellipse j is
        the set of states x with (x - point_j)^T form_j (x - point_j) <= radius_j^2.
        """
        inside = np.zeros(len(scaled_states), bool)
        for point, form, radius in zip(self.points, self.forms, self.radii, strict=True):
            difference = scaled_states - point
            squared_radii = np.einsum("ki,ij,kj->k", difference, form, difference)
            inside |= squared_radii <= radius * radius
        return inside


@dataclass(frozen=True)
class Attractor:
    """A periodic orbit to which motions converge, or a class of aperiodic motions."""

    kind: int  #: index in `KINDS`
    displacement_max: float = np.nan
    displacement_min: float = np.nan
    orbit: Orbit | None = None  #: None unless periodic
    ellipses: TrappingEllipses | None = field(default=None, repr=False)
    #: Full states of the orbit one cycle apart, shape (m, n); None unless periodic.
    points: np.ndarray | None = field(default=None, repr=False)
    exponent: float = np.nan  #: largest Lyapunov exponent per mesh period
    uncertainty: float = np.nan  #: standard error of the exponent

    @property
    def period(self) -> int:
        """Period of the orbit in mesh periods; 0 unless periodic."""
        return self.orbit.period if self.orbit else 0

    @property
    def sort_key(self) -> tuple:
        """Key that sorts attractors by kind, period and displacement range.

        An unknown range (NaN), e.g. of unbounded motions, is sorted last.
        """
        displacement_range = self.displacement_max - self.displacement_min
        if not np.isfinite(displacement_range):
            displacement_range = np.inf
        return self.kind, self.period, displacement_range


def find_attractors(stroboscope, states, known_attractors: list, time_limit: TimeLimit) -> list:
    """Find the periodic attractors near given states and return those that are not yet known.

    `states`, shape (k, n), are full states after a transient. The `stroboscope` propagates each
    state over 64 more cycles (periods of the excitation); if it nearly repeats, shooting refines
    the orbit. `known_attractors` were found before. The search stops at the time limit.
    """
    series = [states]
    for _ in range(2 * MAX_CYCLES):
        series.append(stroboscope(series[-1], 1)[0])
    # The latest states come first, because they are nearest to the attractor.
    series = np.array(series[::-1])
    scaled_series = stroboscope.reduce_and_scale(series)
    attractors = list(known_attractors)
    for k in time_limit.iterate(range(len(states))):
        if not np.isfinite(scaled_series[:, k]).all():
            continue
        # Skip a motion that has reached a known attractor.
        if any(attractor.ellipses.contain(scaled_series[:1, k])[0] for attractor in attractors):
            continue
        candidate = _find_attractor_near(stroboscope, series[0, k], scaled_series[:, k])
        if candidate and not any(_are_same_orbit(candidate, known) for known in attractors):
            attractors.append(candidate)
    return attractors[len(known_attractors) :]


def _are_same_orbit(attractor: Any, other_attractor: Any) -> bool:
    """Return whether two periodic attractors are the same orbit.

    Their points may start anywhere on the orbit, so the first point of one attractor is compared
    with all points of the other attractor.
    """
    points = attractor.ellipses.points
    scale = max(1.0, np.abs(points).max())
    distances = np.abs(other_attractor.ellipses.points - points[0]).max(axis=1)
    return bool((distances < _SAME_POINT_TOLERANCE * scale).any())


def _find_attractor_near(
    stroboscope, state: np.ndarray, scaled_series: np.ndarray
) -> Attractor | None:
    """Find the periodic attractor near the `state` of a motion after its transient, or None.

    `scaled_series`, shape (cycles, n), are the scaled states of this motion one cycle (period of
    the excitation) apart, latest first. If two states n cycles apart nearly agree, shooting
    searches for an orbit of n cycles, which is returned if it is stable.
    """
    scale = max(1.0, np.ptp(scaled_series, axis=0).max())
    for n in range(1, MAX_CYCLES + 1):
        if np.abs(scaled_series[n] - scaled_series[0]).max() > _GUESS_TOLERANCE * scale:
            continue
        try:
            orbit = periodic_orbit(
                stroboscope.model,
                stroboscope.tuning,
                guess=state,
                period=n * stroboscope.mesh_periods_per_cycle,
                max_events=stroboscope.max_events,
            )
        except NoOrbit:
            continue
        largest_multiplier = np.abs(orbit.multipliers).max()
        if largest_multiplier < 1.0 - _MIN_DECAY:
            return _create_attractor(stroboscope, orbit)
        if largest_multiplier <= 1.0 + _MIN_DECAY:
            # Without damping in contact, neither this orbit nor its neighbours are attractors.
            return None
    return None


def _create_attractor(stroboscope: Stroboscope, orbit: Orbit) -> Attractor:
    """Create the `Attractor` of a stable periodic orbit, with its extrema and trapping ellipses.

    `stroboscope` maps states over whole cycles of the excitation. A trapping ellipse is a region
    around a point of the orbit that no sampled motion leaves.
    """
    points = [orbit.state]
    for _ in range(orbit.period // stroboscope.mesh_periods_per_cycle - 1):
        next_states, _ = stroboscope(points[-1][None], 1)
        points.append(next_states[0])
    points = np.array(points)
    propagator = stroboscope.propagator
    summary = propagator.record(orbit.state, orbit.period, stroboscope.max_events).summary
    return Attractor(
        PERIODIC,
        displacement_max=float(summary[columns.X_MAX]),
        displacement_min=float(summary[columns.X_MIN]),
        orbit=orbit,
        ellipses=_find_trapping_ellipses(stroboscope, points),
        points=points,
        exponent=float(np.log(np.abs(orbit.multipliers).max())) / orbit.period,
        uncertainty=0.0,
    )


def _find_trapping_ellipses(stroboscope: Stroboscope, points: np.ndarray) -> TrappingEllipses:
    """Find the largest ellipses around the points of an orbit that no sampled motion leaves.

    `stroboscope` maps states over whole cycles (periods of the excitation), and `points`, shape
    (m, n), are full states of the orbit one cycle apart. Each point is surrounded by nested rings,
    level lines of a quadratic form. The trapping ellipse is the largest ring for which all sampled
    motions that start on it, or on any smaller ring, return inside the next smaller ring.
    """
    centres = stroboscope.reduce_and_scale(points)
    scale = max(1.0, np.abs(centres).max())
    forms, return_cycles = _lyapunov_functions(stroboscope.cycle_jacobians(points[0], len(points)))
    radii = scale * _RING_RATIO ** np.arange(_RING_COUNT)  # in decreasing order
    point_count, n = centres.shape
    directions = _unit_vectors(n)
    # These matrices map the unit sphere to the ellipse of radius 1.
    ellipse_matrices = np.array([np.linalg.inv(np.linalg.cholesky(form).T) for form in forms])
    # The offsets have the shape (points, rings, directions, n).
    offsets = np.einsum("jab,db->jda", ellipse_matrices, directions)[:, None] * radii[:, None, None]
    # Remove the scaling of velocities; `lift` then maps the perturbations to full states.
    samples = (centres[:, None, None] + offsets).reshape(-1, n) / stroboscope.weights
    orbit_states = np.repeat(points, radii.size * len(directions), axis=0)
    perturbations = samples - stroboscope.reduce_and_scale(orbit_states) / stroboscope.weights
    final_states, _ = stroboscope(orbit_states + perturbations @ stroboscope.lift.T, return_cycles)
    scaled_states = stroboscope.reduce_and_scale(final_states).reshape(
        point_count, radii.size, -1, n
    )
    final_offsets = scaled_states - centres[:, None, None]
    # The indices are point j, ring r, direction d, coordinates a and b.
    squared_radii = np.einsum("jrda,jab,jrdb->jrd", final_offsets, forms, final_offsets)
    # A failed run gives NaN, which does not count as inside.
    is_inside = np.sqrt(squared_radii).max(axis=2) <= _RING_RATIO * radii
    trapping_radii = np.empty(point_count)
    for j in range(point_count):
        failed_rings = np.flatnonzero(~is_inside[j])
        largest_trapping = failed_rings[-1] + 1 if failed_rings.size else 0
        if largest_trapping < radii.size:
            trapping_radii[j] = radii[largest_trapping]
        else:
            # Even the smallest ring fails, so the ellipse only contains the point itself.
            trapping_radii[j] = _SAME_POINT_TOLERANCE * scale
    return TrappingEllipses(centres, forms, trapping_radii)


def _lyapunov_functions(cycle_maps: np.ndarray) -> tuple[np.ndarray, int]:
    """Compute quadratic Lyapunov functions x^T S x at the m points of a stable orbit.

    `cycle_maps`, shape (m, n, n), are the Jacobian matrices of the map over each of the m cycles of
    the orbit. Return (symmetric matrices S, shape (m, n, n), number of cycles). After this number
    of cycles, the functions have decreased to at most `_CONTRACTION`^2 = 1/4 of their initial
    values for all small perturbations x.
    """
    count, n = cycle_maps.shape[:2]
    spectral_radius = np.abs(np.linalg.eigvals(compose(cycle_maps))).max()
    log_radius = np.log(max(spectral_radius, 1e-12))
    # The orbit is repeated until the spectral radius of its map is at most _CONTRACTION^2.
    orbit_repeats = max(1, int(np.ceil(2.0 * np.log(_CONTRACTION) / log_radius)))
    forms = np.empty((count, n, n))
    for j in range(count):
        # This is the map over one period of the orbit from point j.
        orbit_map = compose(np.roll(cycle_maps, -j, axis=0))
        return_map = np.linalg.matrix_power(orbit_map, orbit_repeats)
        # S solves A^T S A = _CONTRACTION^2 (S - I) with the return map A.
        forms[j] = solve_discrete_lyapunov(return_map.T / _CONTRACTION, np.eye(n))
    return forms, orbit_repeats * count


def _unit_vectors(n: int) -> np.ndarray:
    """Return unit vectors with n components as the rows of an array.

    For n = 2 they are 32 vectors at equal angles, otherwise 128 in random directions (fixed seed).
    """
    if n == 2:
        angles = 2.0 * np.pi * np.arange(_PLANE_DIRECTIONS) / _PLANE_DIRECTIONS
        return np.stack([np.cos(angles), np.sin(angles)], axis=1)
    directions = np.random.default_rng(0).normal(size=(_SPACE_DIRECTIONS, n))
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)
