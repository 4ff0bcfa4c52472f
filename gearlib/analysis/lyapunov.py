"""Largest Lyapunov exponent of a motion, from its variational maps.

A small deviation is carried along by the maps of `Model.propagator`, scaled back to length
one after each mesh period; the mean of the logarithms of its growth is the exponent, per mesh
period. Lengths are those of (dx, nu dx'): displacements, and velocities over the mean
eigenfrequency.
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.data import status
from gearlib.kernels.growth import carry
from gearlib.models.model import FAR
from gearlib.runs.variational import without_rotation

#: A motion this many times as large as its model grows without bound if it becomes as many times
#: as large in so many periods as are counted, again and again, up to `Model.bound`.
LARGE, GROWN = 1e2, 1.5
#: Maps held in memory at a time.
_CHUNK = 512
#: Batches of consecutive periods whose means give the uncertainty.
BATCHES = 20
#: An exponent counts when it is so many times its uncertainty.
_SIGMAS = 3.0
#: Growth exp(slack) beyond the linear growth of a quasi-periodic motion is exponential.
_SLACK = 7.0


class Exponent(NamedTuple):
    """Largest Lyapunov exponent per mesh period."""

    value: float  #: NaN: the run could not go on, or the motion grows without bound
    uncertainty: float  #: standard error of the mean over batches
    growth: float  #: logarithm of the whole growth, value times periods
    periods: int
    status: int = status.OK  #: `gearlib.data.status`; OVERFLOW: the motion grows without bound

    @property
    def positive(self):
        """Whether deviations grow exponentially.

        A quasi-periodic motion shears: deviations grow in proportion to time, by log(periods).
        """
        linear = math.log(self.periods) + _SLACK
        return self.growth > linear and self.value > _SIGMAS * self.uncertainty


def largest(pair, tuning, *, state=(0.0, 0.0), settle=1000, periods=4000, max_events=1_000_000):
    """Return the `Exponent`, the largest Lyapunov exponent, of the motion from a state at tau = 0.

    It is counted over so many periods after those to settle. The free rotation of six degrees
    of freedom, which never grows nor decays, is left out.
    """
    propagator = pair.propagator(tuning)
    z = propagator.start(state)
    size = Size(pair, tuning)
    before = size(z)
    bound = FAR * max(pair.extent, before)

    def failed(code):
        return Exponent(math.nan, math.nan, math.nan, periods, code)

    logs, weights, vector = np.empty(periods), None, None
    done = -settle
    while done < periods:
        count = min(_CHUNK, periods - done) if done >= 0 else min(_CHUNK, -done)
        first = (settle + done) % pair.repeats
        z, maps, code = propagator.maps(z, count, max_events, first)
        if code != status.OK:
            return failed(code)
        maps = without_rotation(pair, maps)
        if vector is None:
            # Any direction will do: settling turns it into the growing one.
            vector, weights = np.ones(maps.shape[1]), np.ones(maps.shape[1])
            weights[maps.shape[1] // 2 :] = tuning
        counted = logs[done : done + count] if done >= 0 else np.empty(count)
        if not carry(maps, weights, vector, counted):
            # Over-damped to nothing: no deviation is left to grow.
            return Exponent(-math.inf, 0.0, -math.inf, periods)
        done += count
        if done == 0:
            before = size(z)
    if grows(size, propagator, z, before, bound, periods, max_events):
        return failed(status.OVERFLOW)
    batches = np.array([part.mean() for part in np.array_split(logs, min(BATCHES, periods))])
    error = batches.std(ddof=1) / math.sqrt(batches.size) if batches.size > 1 else math.inf
    return Exponent(float(logs.mean()), float(error), float(logs.sum()), periods)


class Size:
    """How large the states of a model are, without free rotation, in displacements."""

    def __init__(self, pair, tuning):
        self.extent, self.cycle = pair.extent, pair.repeats
        self._reduce, _ = pair.reduction()
        self._weights = np.repeat([1.0, tuning], len(self._reduce) // 2)

    def __call__(self, states):
        """Return the size of a state, or of each of several, shape (k, n); infinite if NaN."""
        seen = np.abs(states @ self._reduce.T * self._weights).max(axis=-1)
        return np.where(np.isfinite(seen), seen, math.inf)


def grows(size, propagator, z, before, bound, periods, max_events):
    """Return whether a motion that has grown goes on to do so, beyond a bound.

    `z`, shape (n,), is where it is, `before` its size so many periods ago.
    """
    ends, codes = z[None].copy(), np.zeros(1, np.int64)
    periods += -periods % size.cycle
    after = float(size(z))
    while LARGE * size.extent < after <= bound and after > GROWN * before:
        before = after
        propagator.skip(ends.copy(), periods, max_events, ends, codes)
        if codes[0] not in (status.OK, status.OVERFLOW):
            return False
        after = math.inf if codes[0] else float(size(ends[0]))
    return after > bound
