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
#: Logarithm of the growth, 1e10, beyond which rounding decides where a motion goes.
LOST = 10.0 * math.log(10.0)
#: What a variable "settled" says of single motions.
SETTLED_FLAGS = status.settled_flags("settled")


class Exponent(NamedTuple):
    """Largest Lyapunov exponent per mesh period."""

    value: float  #: NaN: the run could not go on, or the motion grows without bound
    uncertainty: float  #: standard error of the mean over batches
    growth: float  #: logarithm of the whole growth, value times periods
    periods: int
    status: int = status.OK  #: `gearlib.data.status`; OVERFLOW: the motion grows without bound

    @property
    def grown(self):
        """Whether deviations have grown by more than in a quasi-periodic motion.

        That shears: deviations grow in proportion to time, by log(periods).
        """
        return self.growth > math.log(self.periods) + _SLACK

    @property
    def positive(self):
        """Whether deviations grow exponentially: so much, and steadily."""
        return self.grown and self.value > _SIGMAS * self.uncertainty


def largest(model, tuning, *, state=(0.0, 0.0), settle=1000, periods=4000, max_events=1_000_000):
    """Return the `Exponent`, the largest Lyapunov exponent, of the motion from a state at tau = 0.

    It is counted over so many periods after those to settle. The free rotation of six degrees
    of freedom, which never grows nor decays, is left out.
    """
    propagator = model.propagator(tuning)
    z = propagator.start(state)
    size, carried = Size(model, tuning), _carrier(model, tuning, propagator, max_events)
    bound = FAR * max(model.extent, size(z))

    def failed(code):
        return Exponent(math.nan, math.nan, math.nan, periods, code)

    # Any direction will do: settling turns it into the growing one.
    logs, vector, first = np.empty(periods), None, 0
    for counted in (np.empty(settle), logs) if settle else (logs,):
        before = size(z)
        z, vector, code = carried(z, vector, counted, first)
        if code != status.OK:
            return failed(code)
        if vector is None:
            # Over-damped to nothing: no deviation is left to grow.
            return Exponent(-math.inf, 0.0, -math.inf, periods)
        first = settle
    if grows(size, propagator, z, before, bound, periods, max_events):
        return failed(status.OVERFLOW)
    batches = np.array([part.mean() for part in np.array_split(logs, min(BATCHES, periods))])
    error = batches.std(ddof=1) / math.sqrt(batches.size) if batches.size > 1 else math.inf
    return Exponent(float(logs.mean()), float(error), float(logs.sum()), periods)


class Growth(NamedTuple):
    """How a small deviation has grown."""

    most: float  #: logarithm of its largest growth on the way; infinite: the run could not go on
    last: float  #: of that at the end
    vector: np.ndarray | None  #: its direction at the end; None: it has vanished


def growth(model, tuning, state, periods, *, first=0, vector=None, max_events=1_000_000):
    """Return the `Growth` of a small deviation over mesh periods; other arguments as of `largest`.

    `first` is the number of the first period, where the excitation repeats after several; `vector`
    is the deviation, by default one in all coordinates.
    """
    propagator, logs = model.propagator(tuning), np.empty(periods)
    z, carried = propagator.start(state), _carrier(model, tuning, propagator, max_events)
    z, vector, code = carried(z, vector, logs, first)
    if code != status.OK:
        return Growth(math.inf, math.inf, None)
    grown = np.cumsum(logs)
    return Growth(max(float(grown.max()), 0.0), float(grown[-1]), vector)


def lost(model, tuning, state, periods):
    """Return whether rounding decides where a motion goes; arguments as of `growth`."""
    return growth(model, tuning, state, periods).most > LOST


class Carried:
    """A deviation that goes on with a motion from one run to the next.

    It is never less than rounding, nor more than the motion.
    """

    def __init__(self, model):
        self.pair, self.before, self.vector = model, 0.0, None

    def run(self, tuning, state, periods, first=0):
        """Return the `Growth` in a run, and whether rounding decides where it goes."""
        vector = self.vector if self.before else None
        found = growth(self.pair, tuning, state, periods, first=first, vector=vector)
        return found, self.before + found.most > LOST

    def go_on(self, found):
        """Go on from the end of a run."""
        self.before = min(max(self.before + found.last, 0.0), LOST)
        self.vector = found.vector


def lost_in_sweep(model, tunings, ends, start, periods):
    """Return where rounding may have led a motion carried over tunings, shape (n,), bool, (n,).

    `ends` are final states, shape (n, components), behind a NaN the motion begins anew; `periods`
    are those at each tuning.
    """
    lost = np.zeros(len(tunings), bool)
    begins = [start, *(end if np.isfinite(end).all() else start for end in ends[:-1])]
    for i, (nu, begin) in enumerate(zip(tunings, begins, strict=True)):
        if begin is start:
            deviation = Carried(model)
        found, lost[i] = deviation.run(float(nu), tuple(begin), periods, i * periods)
        deviation.go_on(found)
    return lost


def _carrier(model, tuning, propagator, max_events):
    """Return the call that carries a state and a deviation through as many periods as `logs` has.

    It fills these, with -inf from where it has vanished, and returns the state; the deviation, then
    None; and the status. None in place of a deviation is one in all coordinates.
    """

    def carried(z, vector, logs, first):
        for done in range(0, logs.size, _CHUNK):
            counted, period = logs[done : done + _CHUNK], (first + done) % model.repeats
            z, maps, code = propagator.maps(z, counted.size, max_events, period)
            if code != status.OK:
                return z, vector, code
            maps = without_rotation(model, maps)
            vector = np.ones(maps.shape[1]) if vector is None else vector
            weights = np.repeat([1.0, tuning], vector.size // 2)
            if not carry(maps, weights, vector, counted):
                logs[done:] = -math.inf
                return z, None, code
        return z, vector, status.OK

    return carried


class Size:
    """How large the states of a model are, without free rotation, in displacements."""

    def __init__(self, model, tuning):
        self.extent, self.cycle = model.extent, model.repeats
        self._reduce, _ = model.reduction()
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
