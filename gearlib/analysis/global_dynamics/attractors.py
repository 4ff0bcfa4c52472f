"""Attractors: found among final states, refined by shooting, and where a motion has arrived.

Every point of a stable periodic orbit lies in a *trapping ellipse* that no sampled motion leaves.
The ellipses are level lines of a quadratic form that the linearised map contracts; how far the
nonlinear map still does so is sampled on nested rings: it maps 32 states of each ring (with more
than two coordinates, 128 of each ellipsoid, in random directions) into the next smaller one. If
this held for the whole of each ring, all states within would lead to the orbit, for two
coordinates, as the map is one-to-one and continuous; between the samples it is not proved. A run
ends inside a trapping ellipse; `gearlib.basins` with ``stop_early=False`` goes on.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import solve_discrete_lyapunov

from gearlib.analysis.orbits.shooting import NoOrbit, Orbit, periodic_orbit, product
from gearlib.engines import orbit as columns

KINDS = ("periodic", "chaotic", "unbounded", "undecided")
PERIODIC, CHAOTIC, UNBOUNDED, UNDECIDED = range(4)

#: Longest orbit that is looked for, in cycles.
MAX_CYCLES = 32
#: A guess for shooting: states that come back this close, in shares of the size of the motion.
_CLOSE_RETURN = 1e-2
#: Points closer than this, static deflections (over the size of the motion), count as equal.
_SAME_POINT = 1e-6
#: Multipliers nearer to the unit circle attract too slowly to tell.
_MIN_DECAY = 1e-6
# The linearised map shrinks the form to _SHRINK, rings are _RING apart, between rounding and the
# size of the motion.
_SHRINK, _RING, _RINGS = 0.5, 0.7, 40
#: Directions in which the ellipses of two coordinates, and of more, are sampled.
_PLANE_DIRECTIONS, _SPACE_DIRECTIONS = 32, 128


@dataclass(frozen=True)
class TrappingEllipses:
    """Ellipses around the points of an orbit, which no sampled direction leaves."""

    points: np.ndarray  #: shape (m, n), in the coordinates of `Stroboscope.seen`
    forms: np.ndarray  #: shape (m, n, n)
    radii: np.ndarray  #: shape (m,): form of the difference <= radius^2; static deflections

    def holds(self, seen):
        """Return which of the states, shape (k, n), lie in it."""
        inside = np.zeros(len(seen), bool)
        for point, form, radius in zip(self.points, self.forms, self.radii, strict=True):
            away = seen - point
            inside |= np.einsum("ki,ij,kj->k", away, form, away) <= radius * radius
        return inside


@dataclass(frozen=True)
class Attractor:
    """Where motions end."""

    kind: int  #: index in `KINDS`
    displacement_max: float = np.nan
    displacement_min: float = np.nan
    orbit: Orbit | None = None
    ellipses: TrappingEllipses | None = field(default=None, repr=False)
    points: np.ndarray | None = field(default=None, repr=False)  #: full states, shape (m, n)
    exponent: float = np.nan  #: largest Lyapunov exponent per mesh period
    uncertainty: float = np.nan  #: of the exponent

    @property
    def period(self):
        """Mesh periods; 0 unless periodic."""
        return self.orbit.period if self.orbit else 0

    @property
    def order(self):
        """Key by which attractors are sorted: kind, period, height."""
        height = self.displacement_max - self.displacement_min
        return self.kind, self.period, height if np.isfinite(height) else np.inf


def find(strobe, states, known):
    """Return the `Attractor`s, without those `known`, that settled states (k, n) are near."""
    series = [states]
    for _ in range(2 * MAX_CYCLES):
        series.append(strobe(series[-1], 1)[0])
    # From the latest to the earliest: the latest is settled best.
    series = np.array(series[::-1])
    seen, all_known = strobe.seen(series), list(known)
    for k in range(len(states)):
        if not np.isfinite(seen[:, k]).all():
            continue
        if any(attractor.ellipses.holds(seen[:1, k])[0] for attractor in all_known):
            continue
        attractor = _at(strobe, series[0, k], seen[:, k])
        if attractor and not any(_same(attractor, other) for other in all_known):
            all_known.append(attractor)
    return all_known[len(known) :]


def _same(first, second):
    """Return whether two periodic attractors are one orbit."""
    points, size = first.ellipses.points, max(1.0, np.abs(first.ellipses.points).max())
    distances = np.abs(second.ellipses.points - points[0]).max(axis=1)
    return bool((distances < _SAME_POINT * size).any())


def _at(strobe, state, seen):
    """Return the attractor at a settled state, or None; `seen`: it and the states before it."""
    size = max(1.0, np.ptp(seen, axis=0).max())
    for n in range(1, MAX_CYCLES + 1):
        if np.abs(seen[n] - seen[0]).max() > _CLOSE_RETURN * size:
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
            # Without damping in contact an orbit draws nothing on, nor do its neighbours.
            return attractor_of(strobe, orbit) if largest < 1.0 - _MIN_DECAY else None
    return None


def attractor_of(strobe, orbit):
    """Return the attractor of a stable orbit, and its trapping ellipses."""
    points = [orbit.state]
    for _ in range(orbit.period // strobe.cycle - 1):
        points.append(strobe(points[-1][None], 1)[0][0])
    points = np.array(points)
    seen = strobe.seen(points)
    size = max(1.0, np.abs(seen).max())
    summary = strobe.propagator.record(orbit.state, orbit.period, strobe.max_events).summary
    rate = float(np.log(np.abs(orbit.multipliers).max())) / orbit.period
    return Attractor(
        PERIODIC,
        float(summary[columns.X_MAX]),
        float(summary[columns.X_MIN]),
        orbit,
        _ellipses(strobe, points, seen, size),
        points,
        rate,
        0.0,
    )


def _ellipses(strobe, points, seen, size):
    """Return the largest trapping ellipses at the `points` of an orbit that no sample leaves."""
    count, n = seen.shape
    maps = strobe.cycle_maps(points[0], count)
    forms, factors = np.empty((count, n, n)), np.empty((count, n, n))
    radius = np.abs(np.linalg.eigvals(product(maps))).max()
    turns = max(1, int(np.ceil(2.0 * np.log(_SHRINK) / np.log(max(radius, 1e-12)))))
    for j in range(count):
        around = np.linalg.matrix_power(product(np.roll(maps, -j, axis=0)), turns)
        # Smallest solution of around^T S around = _SHRINK^2 (S - 1): shrunk by _SHRINK at least.
        forms[j] = solve_discrete_lyapunov(around.T / _SHRINK, np.eye(n))
        factors[j] = np.linalg.inv(np.linalg.cholesky(forms[j]).T)
    rings = size * _RING ** np.arange(_RINGS)
    directions = _directions(n)
    # Shape (points, rings, directions, n).
    away = np.einsum("jab,db->jda", factors, directions)[:, None] * rings[:, None, None]
    around = (seen[:, None, None] + away).reshape(-1, n) / strobe.weights
    base = np.repeat(points, rings.size * len(directions), axis=0)
    starts = base + (around - strobe.seen(base) / strobe.weights) @ strobe.lift.T
    ends, _ = strobe(starts, turns * count)
    back = strobe.seen(ends).reshape(count, rings.size, -1, n) - seen[:, None, None]
    size_of = np.sqrt(np.einsum("jrda,jab,jrdb->jrd", back, forms, back)).max(axis=2)
    # A NaN, of a run that could not go on, is not inside.
    inside = size_of <= _RING * rings
    radii = np.empty(count)
    for j in range(count):
        failed = np.flatnonzero(~inside[j])
        first = failed[-1] + 1 if failed.size else 0
        # Below the last ring rounding rules: there only the states of the orbit itself.
        radii[j] = rings[first] if first < rings.size else _SAME_POINT * size
    return TrappingEllipses(seen, forms, radii)


def _directions(n):
    """Return unit vectors, shape (k, n), spread over all directions."""
    if n == 2:
        angles = 2.0 * np.pi * np.arange(_PLANE_DIRECTIONS) / _PLANE_DIRECTIONS
        return np.stack([np.cos(angles), np.sin(angles)], axis=1)
    directions = np.random.default_rng(0).normal(size=(_SPACE_DIRECTIONS, n))
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)
