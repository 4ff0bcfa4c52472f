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
_SAMPLED, _MAX_LOOKS = 8, 6
#: Cycles of the first rounds after which states in a trapping ellipse leave.
_FIRST_CYCLES = 24
#: Mesh periods of exponents, and of the extrema of motions that are not periodic.
_EXPONENT_PERIODS, _EXTREMA_PERIODS = 2000, 256
#: Labels of states without an attractor: none yet, and those that have left all bounds.
_NO_LABEL, _UNBOUNDED_LABEL = -1, -2


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
    motions = _Motions(strobe, states, rng)
    scouts = rng.choice(len(states), min(_SCOUTS, len(states)), replace=False)
    motions.learn(strobe(strobe.start(states[np.sort(scouts)]), cycles)[0])
    motions.advance(cycles, stop_early)
    bounds = motions.bounds[motions.left]
    gone, motions.at = strobe.unbounded(motions.at, 0.0, bounds, _EXPONENT_PERIODS)
    motions.leave(gone, _UNBOUNDED_LABEL)
    motions.look_closer()
    chaos = motions.chaos()
    if motions.left.size and not chaos:
        motions.advance(cycles, True)
        motions.look_closer()
        chaos = motions.chaos()
    return motions.sorted(chaos)


class _Motions:
    """The motions of one classification, on their way."""

    def __init__(self, strobe, states, rng):
        self.strobe, self.states, self.rng = strobe, states, rng
        self.known = []
        self.labels = np.full(len(states), _NO_LABEL)
        #: States without a label: their numbers, where they are.
        self.left, self.at = np.arange(len(states)), strobe.start(states)
        #: Sizes beyond which each has left all bounds, as of `Model.bound`.
        self.bounds = FAR * np.maximum(strobe.pair.extent, strobe.size(self.at))

    def learn(self, ends):
        """Add the attractors near `ends`; return whether there is a new one."""
        before = len(self.known)
        ends = ends[np.isfinite(ends).all(axis=1)]
        while len(ends):
            # A few at a time: most of the others are then in a trapping ellipse.
            few, ends = ends[:_SAMPLED], ends[_SAMPLED:]
            self.known += attractors.find(self.strobe, few, self.known)
            for attractor in self.known:
                ends = ends[~attractor.ellipses.holds(self.strobe.seen(ends))]
        return len(self.known) > before

    def leave(self, chosen, label):
        """Give the chosen ones of the states that are left, a mask, a label."""
        self.labels[self.left[chosen]] = label
        self.left, self.at = self.left[~chosen], self.at[~chosen]

    def catch(self):
        """Label the states that are in a trapping ellipse, and those that have left all bounds."""
        self.leave(self.strobe.size(self.at) > self.bounds[self.left], _UNBOUNDED_LABEL)
        for i, attractor in enumerate(self.known):
            self.leave(attractor.ellipses.holds(self.strobe.seen(self.at)), i)

    def advance(self, cycles, stop_early):
        """Take the states on, for `cycles` cycles or to a trapping ellipse."""
        done, step = 0, _FIRST_CYCLES if stop_early else cycles
        while done < cycles and self.left.size:
            step = min(step, cycles - done)
            self.at, codes = self.strobe(self.at, step)
            stopped = codes[(codes != status.OK) & (codes != status.OVERFLOW)]
            if stopped.size:
                raise RuntimeError(status.MESSAGES[int(stopped[0])])
            self.catch()
            done += step
            step = done

    def sample(self):
        """Return places in `left` of a few states."""
        count = min(_SAMPLED, self.left.size)
        return np.sort(self.rng.choice(self.left.size, count, replace=False))

    def look_closer(self):
        """Look for attractors that the scouts have missed."""
        for _ in range(_MAX_LOOKS):
            if not self.left.size or not self.learn(self.at[self.sample()]):
                return
            self.catch()

    def chaos(self):
        """Return the chaotic attractor of the states that are left, else None.

        Deviations must grow exponentially in each of a few, and the mean of their rates be
        positive beyond its error.
        """
        strobe, rates = self.strobe, []
        if not self.left.size:
            return None
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
                return None
            rates.append(rate)
        value, uncertainty, growth, periods, _ = np.array(rates).T
        # Of weak chaos one motion alone may not suffice to tell.
        error = float(np.sqrt((uncertainty**2).sum()) / len(rates))
        mean = lyapunov.Exponent(float(value.mean()), error, growth.sum(), int(periods.sum()))
        if not mean.positive:
            return None
        return self.extent(attractors.CHAOTIC, exponent=mean.value, uncertainty=error)

    def extent(self, kind, **rate):
        """Return an attractor that is not periodic, with the extrema of a few of its motions."""
        strobe = self.strobe
        summaries = np.array(
            [
                strobe.propagator.record(state, _EXTREMA_PERIODS, strobe.max_events).summary
                for state in self.at[self.sample()]
            ]
        )
        high, low = summaries[:, columns.X_MAX].max(), summaries[:, columns.X_MIN].min()
        return attractors.Attractor(kind, float(high), float(low), **rate)

    def sorted(self, chaos):
        """Return (attractors, labels) in the order of `Attractor.order`.

        States without a periodic attractor belong to the chaotic one, or are undecided.
        """
        known = list(self.known)
        if self.left.size:
            self.labels[self.left] = len(known)
            known.append(chaos or self.extent(attractors.UNDECIDED))
        unbounded = self.labels == _UNBOUNDED_LABEL
        if unbounded.any():
            self.labels[unbounded] = len(known)
            known.append(attractors.Attractor(attractors.UNBOUNDED))
        order = sorted(range(len(known)), key=lambda i: known[i].order)
        return [known[i] for i in order], np.argsort(order)[self.labels]
