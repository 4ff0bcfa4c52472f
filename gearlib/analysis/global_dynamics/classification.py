"""To which attractor each of many initial states comes."""

import numpy as np

from gearlib.analysis import lyapunov
from gearlib.analysis.global_dynamics import attractors
from gearlib.analysis.global_dynamics.grids import check_one_mesh
from gearlib.data import status
from gearlib.engines import orbit as columns
from gearlib.models.model import FAR

#: Random states that run first, to find the attractors.
_SCOUTS = 128
#: States without an attractor that are looked at more closely, at a time, and how often.
_CLOSER, _LOOKS = 8, 6
#: Cycles of the first rounds after which states that are caught leave.
_ROUND = 24
_EXPONENT_PERIODS = 2000
_RECORD = 256


def check_model(model):
    """Refuse a model with several meshes, or without any damping: it has no attractors."""
    check_one_mesh(model)
    if model.damped():
        return
    raise ValueError(
        "damping = 0 is not allowed: a model without any damping keeps phase volume and has no "
        "attractors; see gearlib.poincare_section for its motions"
    )


def classify(strobe, states, cycles, *, stop_early=True, seed=0):
    """Return the attractors, and of each initial state, shape (k, 2), the index of its own.

    Attractors come by kind, period and height; kinds other than periodic once at most. A run
    has so many `cycles`, without an attractor by then as many again, and with `stop_early` it
    ends in a trapping ellipse. `seed` chooses the states that are looked at first.
    """
    rng = np.random.default_rng(seed)
    run = _Run(strobe, states, rng)
    scouts = rng.choice(len(states), min(_SCOUTS, len(states)), replace=False)
    run.learn(strobe(strobe.start(states[np.sort(scouts)]), cycles)[0])
    run.advance(cycles, stop_early)
    run.let_grow()
    run.look_closer()
    if run.left.size and not run.all_chaotic():
        run.advance(cycles, True)
        run.look_closer()
    run.name_the_rest()
    return run.sorted()


class _Run:
    """The states of one classification, on their way."""

    def __init__(self, strobe, states, rng):
        self.strobe, self.states, self.rng = strobe, states, rng
        self.known = []
        self.labels = np.full(len(states), -1)
        self.unbounded = np.zeros(len(states), bool)
        #: Sizes beyond which each has left all bounds, as of `Model.bound`.
        self.bounds = FAR * np.maximum(strobe.pair.extent, strobe.size(strobe.start(states)))
        #: States without a label: their numbers, where they are.
        self.left, self.at = np.arange(len(states)), strobe.start(states)
        self.others = {}

    def learn(self, ends):
        """Add the attractors near `ends`; return whether there is a new one."""
        before = len(self.known)
        ends = ends[np.isfinite(ends).all(axis=1)]
        while len(ends):
            # A few at a time: most of the others are then in a trapping ellipse.
            few, ends = ends[:_CLOSER], ends[_CLOSER:]
            self.known += attractors.find(self.strobe, few, self.known)
            for attractor in self.known:
                ends = ends[~attractor.ellipses.holds(self.strobe.seen(ends))]
        return len(self.known) > before

    def catch(self):
        """Label the states that are in a trapping ellipse, and those that have left all bounds."""
        seen = self.strobe.seen(self.at)
        gone = self.strobe.size(self.at) > self.bounds[self.left]
        self.unbounded[self.left[gone]] = True
        caught = gone.copy()
        for i, attractor in enumerate(self.known):
            inside = attractor.ellipses.holds(seen) & ~caught
            self.labels[self.left[inside]] = i
            caught |= inside
        self.left, self.at = self.left[~caught], self.at[~caught]

    def advance(self, cycles, stop_early):
        """Take the states on, for `cycles` cycles or to a trapping ellipse."""
        done, step = 0, _ROUND if stop_early else cycles
        while done < cycles and self.left.size:
            step = min(step, cycles - done)
            self.at, codes = self.strobe(self.at, step)
            stopped = (codes != status.OK) & (codes != status.OVERFLOW)
            if stopped.any():
                raise RuntimeError(status.MESSAGES[int(codes[stopped][0])])
            self.catch()
            done += step
            step = done

    def let_grow(self):
        """Follow what is far out for as long as it grows; label what leaves all bounds."""
        bounds = self.bounds[self.left]
        gone, self.at = self.strobe.unbounded(self.at, 0.0, bounds, _EXPONENT_PERIODS)
        self.unbounded[self.left[gone]] = True
        self.left, self.at = self.left[~gone], self.at[~gone]

    def sample(self):
        """Return places in `left` of a few states."""
        count = min(_CLOSER, self.left.size)
        return np.sort(self.rng.choice(self.left.size, count, replace=False))

    def look_closer(self):
        """Look for attractors that the scouts have missed."""
        for _ in range(_LOOKS):
            if not self.left.size or not self.learn(self.at[self.sample()]):
                return
            self.catch()

    def all_chaotic(self):
        """Return whether deviations grow exponentially in a few states; note the rate.

        All must grow, and the mean of their rates be positive beyond its error.
        """
        strobe, rates = self.strobe, []
        for i in self.left[self.sample()]:
            rate = lyapunov.largest(
                strobe.pair,
                strobe.tuning,
                state=tuple(self.states[i]),
                settle=500,
                periods=_EXPONENT_PERIODS,
                max_events=strobe.max_events,
            )
            if not rate.growth > 0.0:
                return False
            rates.append(rate)
        value, uncertainty, growth, periods, _ = np.array(rates).T
        # Of weak chaos one motion alone may not suffice to tell.
        error = np.sqrt((uncertainty**2).sum()) / len(rates)
        mean = lyapunov.Exponent(value.mean(), error, growth.sum(), int(periods.sum()))
        if mean.positive:
            self.others[attractors.CHAOTIC] = self._extent(
                attractors.CHAOTIC, float(mean.value), float(error)
            )
        return bool(mean.positive)

    def _extent(self, kind, exponent=np.nan, uncertainty=np.nan):
        """Return an attractor that is not periodic, with the extrema of a few of its motions."""
        high, low = -np.inf, np.inf
        for state in self.at[self.sample()]:
            strobe = self.strobe
            summary = strobe.propagator.record(state, _RECORD, strobe.max_events).summary
            high = max(high, float(summary[columns.X_MAX]))
            low = min(low, float(summary[columns.X_MIN]))
        return attractors.Attractor(kind, high, low, exponent=exponent, uncertainty=uncertainty)

    def name_the_rest(self):
        """Label what has no periodic attractor."""
        if self.left.size:
            if attractors.CHAOTIC not in self.others and not self.all_chaotic():
                self.others[attractors.UNDECIDED] = self._extent(attractors.UNDECIDED)
            kind = attractors.CHAOTIC if attractors.CHAOTIC in self.others else attractors.UNDECIDED
            self.labels[self.left] = len(self.known)
            self.known.append(self.others[kind])
        if self.unbounded.any():
            self.labels[self.unbounded] = len(self.known)
            self.known.append(attractors.Attractor(attractors.UNBOUNDED))

    def sorted(self):
        """Return (attractors, labels) in the order of `Attractor.order`."""
        order = sorted(range(len(self.known)), key=lambda i: self.known[i].order)
        places = np.empty(len(order), np.int64)
        places[order] = np.arange(len(order))
        return [self.known[i] for i in order], places[self.labels]
