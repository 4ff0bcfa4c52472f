"""Attractors: candidates among final states, refined by shooting, with their trapping ellipses.

Every point of a stable periodic orbit lies in a *trapping ellipse* that no sampled motion leaves.
The ellipses are level lines of a quadratic form that the linearised map contracts. Nested rings
show how far from the orbit the nonlinear map also contracts it: the map takes 32 states of each
ring (with more than two coordinates, 128 states of each ellipsoid, in random directions) into the
next smaller one. If this held for all states of the rings, all states inside would converge to the
orbit, at least with two coordinates, because the map is one-to-one and continuous; between the
samples it is not proved. A run ends in a trapping ellipse, except in `gearlib.basins` with
``stop_early=False``.
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

#: Longest period of an orbit in the search, in cycles.
MAX_CYCLES = 32
#: Shooting is tried if states one period apart are closer than this, relative to the motion's size.
_GUESS_TOLERANCE = 1e-2
#: Points closer than this are equal, in static deflections (relative for larger motions).
_SAME_POINT_TOLERANCE = 1e-6
#: Orbits with multipliers closer to the unit circle than this are neither stable nor unstable.
_MIN_DECAY = 1e-6
#: Factor by which the linearised map contracts the radius of an ellipse.
_CONTRACTION = 0.5
#: Ratio of the radii of successive rings, and number of rings; the first ring is as large as the
#: orbit.
_RING_RATIO, _RING_COUNT = 0.7, 40
#: Number of sampled directions of ellipses with two coordinates, and with more.
_PLANE_DIRECTIONS, _SPACE_DIRECTIONS = 32, 128


@dataclass(frozen=True)
class TrappingEllipses:
    """Ellipses around the points of an orbit that no sampled motion leaves."""

    points: np.ndarray  #: shape (m, n), in the coordinates of `Stroboscope.reduce_and_scale`
    forms: np.ndarray  #: quadratic forms, shape (m, n, n)
    radii: np.ndarray  #: shape (m,), static deflections: (x - point)^T form (x - point) <= radius^2

    def contain(self, scaled_states: np.ndarray) -> np.ndarray:
        """Return a mask, shape (k,), of the states that lie inside any of the ellipses.

        `scaled_states`, shape (k, n), are states without rigid-body rotation, whose velocities are
        multiplied by the tuning. Ellipse j is the set of x with (x - point_j)^T form_j
        (x - point_j) <= radius_j^2.
        """
        inside = np.zeros(len(scaled_states), bool)
        for point, form, radius in zip(self.points, self.forms, self.radii, strict=True):
            difference = scaled_states - point
            squared_radii = np.einsum("ki,ij,kj->k", difference, form, difference)
            inside |= squared_radii <= radius * radius
        return inside


@dataclass(frozen=True)
class Attractor:
    """A set to which motions converge: a periodic orbit, or a class of other motions."""

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

        An unknown range (NaN), as of unbounded motions, comes last.
        """
        displacement_range = self.displacement_max - self.displacement_min
        if not np.isfinite(displacement_range):
            displacement_range = np.inf
        return self.kind, self.period, displacement_range


def find_attractors(stroboscope, states, known_attractors: list, time_limit: TimeLimit) -> list:
    """Return the periodic attractors near given states that are not yet known.

    `states`, shape (k, n), are all coordinates and velocities after a transient. `stroboscope` maps
    them over whole cycles, the periods of the excitation. Each state is propagated over 64 more
    cycles; if it nearly repeats, shooting refines the orbit. `known_attractors` are those found
    before; the search ends when the time limit is over.
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
        # The motion ends at an attractor that is already known.
        if any(attractor.ellipses.contain(scaled_series[:1, k])[0] for attractor in attractors):
            continue
        candidate = _find_attractor_near(stroboscope, series[0, k], scaled_series[:, k])
        if candidate and not any(_are_same_orbit(candidate, other) for other in attractors):
            attractors.append(candidate)
    return attractors[len(known_attractors) :]


def _are_same_orbit(attractor: Any, other_attractor: Any) -> bool:
    """Return whether two periodic attractors are the same orbit, whichever point comes first.

    They are if one point of the other_attractor agrees with the attractor point of the attractor to
    1e-6.
    """
    points = attractor.ellipses.points
    size = max(1.0, np.abs(points).max())
    distances = np.abs(other_attractor.ellipses.points - points[0]).max(axis=1)
    return bool((distances < _SAME_POINT_TOLERANCE * size).any())


def _find_attractor_near(
    stroboscope, state: np.ndarray, scaled_series: np.ndarray
) -> Attractor | None:
    """Return the periodic attractor near the `state` of a motion after its transient, or None.

    `scaled_series`, shape (cycles, n), are earlier states of this motion one cycle (period of the
    excitation) apart, latest first, with velocities scaled to displacements. If two states n cycles
    apart nearly agree, shooting searches for an orbit of n cycles, which must be stable.
    """
    size = max(1.0, np.ptp(scaled_series, axis=0).max())
    for n in range(1, MAX_CYCLES + 1):
        if np.abs(scaled_series[n] - scaled_series[0]).max() > _GUESS_TOLERANCE * size:
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
            # Without damping in contact neither this orbit nor neighbouring ones are attractors.
            return None
    return None


def _create_attractor(stroboscope: Stroboscope, orbit: Orbit) -> Attractor:
    """Return a stable periodic orbit as an `Attractor`, with its extrema and trapping ellipses.

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
    """Return the largest ellipses around the points of an orbit that no sampled motion leaves.

    `stroboscope` maps states over whole cycles (periods of the excitation), and `points` are the
    states of the orbit one cycle apart, shape (m, n), with all coordinates and velocities. Around
    each point lie nested rings, level lines of a quadratic form. The trapping ellipse is the
    largest ring from which all sampled motions end inside the next smaller ring, as they do from
    all rings inside it.
    """
    centres = stroboscope.reduce_and_scale(points)
    size = max(1.0, np.abs(centres).max())
    forms, return_cycles = _lyapunov_functions(stroboscope.cycle_jacobians(points[0], len(points)))
    radii = size * _RING_RATIO ** np.arange(_RING_COUNT)  # in decreasing order
    count, n = centres.shape
    directions = _unit_vectors(n)
    # Matrices that map the unit sphere to the ellipse of radius 1.
    ellipse_matrices = np.array([np.linalg.inv(np.linalg.cholesky(form).T) for form in forms])
    # Shape (points, rings, directions, n).
    offsets = np.einsum("jab,db->jda", ellipse_matrices, directions)[:, None] * radii[:, None, None]
    # The weights scale velocities to displacements; `lift` is the matrix from states without
    # rigid-body rotation to states with all coordinates.
    samples = (centres[:, None, None] + offsets).reshape(-1, n) / stroboscope.weights
    orbit_states = np.repeat(points, radii.size * len(directions), axis=0)
    perturbations = samples - stroboscope.reduce_and_scale(orbit_states) / stroboscope.weights
    final_states, _ = stroboscope(orbit_states + perturbations @ stroboscope.lift.T, return_cycles)
    scaled_states = stroboscope.reduce_and_scale(final_states).reshape(count, radii.size, -1, n)
    final_offsets = scaled_states - centres[:, None, None]
    # Indices: point j, ring r, direction d, coordinates a and b.
    squared_radii = np.einsum("jrda,jab,jrdb->jrd", final_offsets, forms, final_offsets)
    # The NaN of a failed run is not inside.
    is_inside = np.sqrt(squared_radii).max(axis=2) <= _RING_RATIO * radii
    trapping_radii = np.empty(count)
    for j in range(count):
        failed_rings = np.flatnonzero(~is_inside[j])
        largest_trapping = failed_rings[-1] + 1 if failed_rings.size else 0
        if largest_trapping < radii.size:
            trapping_radii[j] = radii[largest_trapping]
        else:
            # Inside the smallest ring rounding errors dominate: only the orbit itself remains.
            trapping_radii[j] = _SAME_POINT_TOLERANCE * size
    return TrappingEllipses(centres, forms, trapping_radii)


def _lyapunov_functions(cycle_maps: np.ndarray) -> tuple[np.ndarray, int]:
    """Return (quadratic Lyapunov functions at the points of a stable orbit, number of cycles).

    `cycle_maps`, shape (m, n, n), are the Jacobian matrices of the map over each of the m cycles of
    the orbit. The functions x^T S x are given by symmetric matrices S, shape (m, n, n). After the
    returned number of cycles, they are at most `_CONTRACTION`^2 = 1/4 of their initial values for
    all small perturbations x.
    """
    count, n = cycle_maps.shape[:2]
    spectral_radius = np.abs(np.linalg.eigvals(compose(cycle_maps))).max()
    log_radius = np.log(max(spectral_radius, 1e-12))
    # Repeat the orbit until its map contracts at least by `_CONTRACTION`, with a margin.
    orbit_repeats = max(1, int(np.ceil(2.0 * np.log(_CONTRACTION) / log_radius)))
    forms = np.empty((count, n, n))
    for j in range(count):
        # The map over one period that starts at point j.
        orbit_map = compose(np.roll(cycle_maps, -j, axis=0))
        return_map = np.linalg.matrix_power(orbit_map, orbit_repeats)
        # Solution S of A^T S A = _CONTRACTION^2 (S - I) with the return map A.
        forms[j] = solve_discrete_lyapunov(return_map.T / _CONTRACTION, np.eye(n))
    return forms, orbit_repeats * count


def _unit_vectors(n: int) -> np.ndarray:
    """Return unit vectors of n coordinates as rows.

    For n = 2 they are 32 vectors at equal angles, otherwise 128 in random directions (fixed seed).
    """
    if n == 2:
        angles = 2.0 * np.pi * np.arange(_PLANE_DIRECTIONS) / _PLANE_DIRECTIONS
        return np.stack([np.cos(angles), np.sin(angles)], axis=1)
    directions = np.random.default_rng(0).normal(size=(_SPACE_DIRECTIONS, n))
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)
