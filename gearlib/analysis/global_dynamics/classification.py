"""Classification of initial states by the attractor to which their motions converge."""

from typing import Any

import numpy as np

from gearlib.analysis import lyapunov
from gearlib.analysis.global_dynamics import attractors
from gearlib.analysis.global_dynamics.attractors import Attractor
from gearlib.analysis.global_dynamics.stroboscope import Stroboscope, check_one_mesh
from gearlib.data import status
from gearlib.engines import orbit as columns
from gearlib.models.model import UNBOUNDED_FACTOR

#: Random states whose motions are computed first, to find the attractors.
_SCOUT_COUNT = 128
#: States without an attractor that are examined at a time, and how often.
_SAMPLE_SIZE, _MAX_SAMPLES = 8, 6
#: Cycles of the first round, after which states in a trapping ellipse are classified.
_FIRST_CYCLES = 24
#: Mesh periods of exponents, and of the extrema of motions that are not periodic.
_EXPONENT_PERIODS, _EXTREMA_PERIODS = 2000, 256
#: Mesh periods before those of an exponent.
_SETTLING_PERIODS = 500
#: Labels of states that are not yet classified, and of those that grow beyond their bounds.
_NO_LABEL, _UNBOUNDED_LABEL = -1, -2


def check_model(model: Any) -> None:
    """Raise ValueError if a model has several meshes, or no damping and so no attractors."""
    check_one_mesh(model)
    if model.damped():
        return
    raise ValueError(
        "damping = 0 is not allowed: a model without any damping keeps phase volume and has no "
        "attractors; see gearlib.poincare_section for its motions"
    )


def classify(
    strobe: Stroboscope, states: np.ndarray, cycles: int, *, stop_early: bool = True, seed: int = 0
) -> tuple:
    """Return (attractors, index of the attractor of each initial state, shape (k,)).

    Attractors are sorted by kind, period and height; each kind but periodic occurs at most once.
    A run takes `cycles` cycles, twice as many if it has no attractor by then; with `stop_early` it
    ends in a trapping ellipse. `seed` chooses the states that are examined first.
    """
    rng = np.random.default_rng(seed)
    motions = _Motions(strobe, states, rng)
    scouts = rng.choice(len(states), min(_SCOUT_COUNT, len(states)), replace=False)
    motions.add_attractors(strobe(strobe.start(states[np.sort(scouts)]), cycles)[0])
    motions.propagate(cycles, stop_early)
    bounds = motions.bounds[motions.remaining]
    grown, motions.current = strobe.unbounded(motions.current, 0.0, bounds, _EXPONENT_PERIODS)
    motions.set_label(grown, _UNBOUNDED_LABEL)
    motions.examine_samples()
    chaos = motions.chaotic_attractor()
    if motions.remaining.size and not chaos:
        motions.propagate(cycles, True)
        motions.examine_samples()
        chaos = motions.chaotic_attractor()
    return motions.sorted_attractors(chaos)


class _Motions:
    """The motions from all initial states, with the attractors that are known so far."""

    def __init__(self, strobe: Stroboscope, states: np.ndarray, rng: np.random.Generator):
        self.strobe, self.states, self.rng = strobe, states, rng
        self.attractors: list = []
        self.labels = np.full(len(states), _NO_LABEL)
        #: Indices of the states without a label, and their current full states.
        self.remaining, self.current = np.arange(len(states)), strobe.start(states)
        #: Sizes beyond which a motion is unbounded, as in `Model.bound`.
        self.bounds = UNBOUNDED_FACTOR * np.maximum(strobe.pair.extent, strobe.size(self.current))

    def add_attractors(self, ends: np.ndarray) -> bool:
        """Add the attractors near final states; return whether there is a new one."""
        count_before = len(self.attractors)
        ends = ends[np.isfinite(ends).all(axis=1)]
        while len(ends):
            # A few at a time: most of the others are then in a trapping ellipse.
            sample, ends = ends[:_SAMPLE_SIZE], ends[_SAMPLE_SIZE:]
            self.attractors += attractors.find_attractors(self.strobe, sample, self.attractors)
            for attractor in self.attractors:
                ends = ends[~attractor.ellipses.contain(self.strobe.scaled(ends))]
        return len(self.attractors) > count_before

    def set_label(self, mask: np.ndarray, label: int) -> None:
        """Give a label to the remaining states that a mask selects."""
        self.labels[self.remaining[mask]] = label
        self.remaining, self.current = self.remaining[~mask], self.current[~mask]

    def label_classified(self) -> None:
        """Label the states that are in a trapping ellipse or beyond their bounds."""
        sizes = self.strobe.size(self.current)
        self.set_label(sizes > self.bounds[self.remaining], _UNBOUNDED_LABEL)
        for i, attractor in enumerate(self.attractors):
            scaled_states = self.strobe.scaled(self.current)
            self.set_label(attractor.ellipses.contain(scaled_states), i)

    def propagate(self, cycles: int, stop_early: bool) -> None:
        """Propagate the remaining states over cycles, or until they are in a trapping ellipse."""
        done, step = 0, _FIRST_CYCLES if stop_early else cycles
        while done < cycles and self.remaining.size:
            step = min(step, cycles - done)
            self.current, codes = self.strobe(self.current, step)
            stopped = codes[(codes != status.OK) & (codes != status.OVERFLOW)]
            if stopped.size:
                raise RuntimeError(status.MESSAGES[int(stopped[0])])
            self.label_classified()
            done += step
            step = done

    def sample(self) -> np.ndarray:
        """Return positions of a few random states in `remaining`."""
        count = min(_SAMPLE_SIZE, self.remaining.size)
        return np.sort(self.rng.choice(self.remaining.size, count, replace=False))

    def examine_samples(self) -> None:
        """Search for further attractors near samples of the remaining states."""
        for _ in range(_MAX_SAMPLES):
            if not self.remaining.size or not self.add_attractors(self.current[self.sample()]):
                return
            self.label_classified()

    def chaotic_attractor(self) -> Attractor | None:
        """Return the chaotic attractor of the remaining states, or None.

        Deviations must grow exponentially in each sample, and the mean exponent must be positive
        beyond its error.
        """
        strobe, exponents = self.strobe, []
        if not self.remaining.size:
            return None
        for i in self.remaining[self.sample()]:
            exponent = lyapunov.largest(
                strobe.pair,
                strobe.tuning,
                state=tuple(self.states[i]),
                settle=_SETTLING_PERIODS,
                periods=_EXPONENT_PERIODS,
                max_events=strobe.max_events,
            )
            if not exponent.growth > 0.0:
                return None
            exponents.append(exponent)
        value, uncertainty, growth, periods, _ = np.array(exponents).T
        # The exponent of one weakly chaotic motion may not be significant.
        error = float(np.sqrt((uncertainty**2).sum()) / len(exponents))
        mean = lyapunov.Exponent(float(value.mean()), error, growth.sum(), int(periods.sum()))
        if not mean.positive:
            return None
        return self.aperiodic_attractor(attractors.CHAOTIC, exponent=mean.value, uncertainty=error)

    def aperiodic_attractor(self, kind: int, **exponent: float) -> Attractor:
        """Return an attractor that is not periodic, with the extrema of sampled motions."""
        strobe = self.strobe
        summaries = np.array(
            [
                strobe.propagator.record(state, _EXTREMA_PERIODS, strobe.max_events).summary
                for state in self.current[self.sample()]
            ]
        )
        highest, lowest = summaries[:, columns.X_MAX].max(), summaries[:, columns.X_MIN].min()
        return Attractor(kind, float(highest), float(lowest), **exponent)

    def sorted_attractors(self, chaos: Attractor | None) -> tuple:
        """Return (attractors, labels of the initial states), sorted by kind, period and height.

        States without a periodic attractor belong to the chaotic one, or are undecided.
        """
        unsorted = list(self.attractors)
        if self.remaining.size:
            self.labels[self.remaining] = len(unsorted)
            unsorted.append(chaos or self.aperiodic_attractor(attractors.UNDECIDED))
        unbounded = self.labels == _UNBOUNDED_LABEL
        if unbounded.any():
            self.labels[unbounded] = len(unsorted)
            unsorted.append(Attractor(attractors.UNBOUNDED))
        order = sorted(range(len(unsorted)), key=lambda i: unsorted[i].sort_key)
        return [unsorted[i] for i in order], np.argsort(order)[self.labels]
