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
from gearlib.runs.variational import without_rotation

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

    value: float  #: NaN: the run could not go on
    uncertainty: float  #: standard error of the mean over batches
    growth: float  #: logarithm of the whole growth, value times periods
    periods: int

    @property
    def positive(self):
        """Whether deviations grow exponentially.

        A quasi-periodic motion shears: deviations grow in proportion to time, by log(periods).
        """
        linear = math.log(self.periods) + _SLACK
        return self.growth > linear and self.value > _SIGMAS * self.uncertainty


def largest(pair, tuning, *, state=(0.0, 0.0), settle=1000, periods=4000, max_events=1_000_000):
    """Return the largest Lyapunov exponent of the motion from a state.

    Parameters
    ----------
    pair : GearPair, OneDegreePair, SixDegreePair or DeadZoneOscillator
        The free rotation of six degrees of freedom, which never grows nor decays, is left out.
    tuning : float
    state : tuple of float
        Displacement in static deflections and dx/dtau at tau = 0.
    settle, periods : int
        Mesh periods before the count, and counted.
    max_events : int
        As of `gearlib.simulate`.

    Returns
    -------
    Exponent
    """
    propagator = pair.propagator(tuning)
    z = propagator.start(state)
    logs, weights, vector = np.empty(periods), None, None
    done = -settle
    while done < periods:
        count = min(_CHUNK, periods - done) if done >= 0 else min(_CHUNK, -done)
        first = (settle + done) % pair.repeats
        z, maps, code = propagator.maps(z, count, max_events, first)
        if code != status.OK:
            return Exponent(math.nan, math.nan, math.nan, periods)
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
    batches = np.array([part.mean() for part in np.array_split(logs, min(BATCHES, periods))])
    error = batches.std(ddof=1) / math.sqrt(batches.size) if batches.size > 1 else math.inf
    return Exponent(float(logs.mean()), float(error), float(logs.sum()), periods)
