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

#: Number of random states from which attractors are searched for first.
_SCOUT_COUNT = 128
#: Number of states without an attractor that are examined at a time, and of such samples.
_SAMPLE_SIZE, _MAX_SAMPLES = 8, 6
#: Cycles of the first round, after which states in a trapping ellipse are classified.
_FIRST_CYCLES = 24
#: Mesh periods of exponents, and of the extrema of motions that are not periodic.
_EXPONENT_PERIODS, _EXTREMA_PERIODS = 2000, 256
#: Mesh periods that settle before an exponent is measured.
_SETTLING_PERIODS = 500
#: Labels of states that are not yet classified, and of those that grow beyond their bounds.
_NO_LABEL, _UNBOUNDED_LABEL = -1, -2


def check_model(model: Any) -> None:
    """Raise ValueError if a model has several meshes, or no damping and so no attractors."""
    check_one_mesh(model)
    if model.has_damping():
        return
    raise ValueError(
        "damping = 0 is not allowed: a model without any damping keeps phase volume and has no "
        "attractors; see gearlib.poincare_section for its motions"
    )


def classify(
    stroboscope: Stroboscope,
    states: np.ndarray,
    cycles: int,
    *,
    stop_early: bool = True,
    seed: int = 0,
) -> tuple[list[Attractor], np.ndarray]:
    """Return (attractors, index of the attractor of each initial state, shape (k,)).

    `states` are displacements and velocities, shape (k, 2). Attractors are sorted by kind, period
    and height; each kind but periodic occurs at most once. A run takes `cycles` cycles, twice as
    many if it has no attractor by then; with `stop_early` it ends in a trapping ellipse. `seed` is
    that of the random choice of the states that are examined first.
    """
    rng = np.random.default_rng(seed)
    motions = _Motions(stroboscope, states, rng)
    scouts = rng.choice(len(states), min(_SCOUT_COUNT, len(states)), replace=False)
    scout_ends, _ = stroboscope(stroboscope.start(states[np.sort(scouts)]), cycles)
    motions.add_attractors(scout_ends)
    motions.propagate(cycles, stop_early)
    bounds = motions.bounds[motions.remaining]
    is_unbounded, motions.current = stroboscope.follow_growth(
        motions.current, 0.0, bounds, _EXPONENT_PERIODS
    )
    motions.set_label(is_unbounded, _UNBOUNDED_LABEL)
    motions.examine_samples()
    chaos = motions.chaotic_attractor()
    if motions.remaining.size and not chaos:
        motions.propagate(cycles, True)
        motions.examine_samples()
        chaos = motions.chaotic_attractor()
    return motions.sorted_attractors(chaos)


class _Motions:
    """The motions from all initial states, with the attractors that are known so far."""

    def __init__(self, stroboscope: Stroboscope, states: np.ndarray, rng: np.random.Generator):
        """Start a motion at each of the displacements and velocities `states`, shape (k, 2)."""
        self.stroboscope, self.states, self.rng = stroboscope, states, rng
        self.attractors: list = []
        self.labels = np.full(len(states), _NO_LABEL)
        #: Indices of the states without a label, and their current full states.
        self.remaining, self.current = np.arange(len(states)), stroboscope.start(states)
        #: Sizes beyond which a motion is unbounded, as in `Model.bound`.
        sizes = stroboscope.size(self.current)
        self.bounds = UNBOUNDED_FACTOR * np.maximum(stroboscope.model.extent, sizes)

    def add_attractors(self, ends: np.ndarray) -> bool:
        """Add the attractors near full states, shape (m, n); return whether one of them is new."""
        count_before = len(self.attractors)
        ends = ends[np.isfinite(ends).all(axis=1)]
        while len(ends):
            # After a few states, most of the others lie in the ellipses of known attractors.
            sample, ends = ends[:_SAMPLE_SIZE], ends[_SAMPLE_SIZE:]
            self.attractors += attractors.find_attractors(self.stroboscope, sample, self.attractors)
            for attractor in self.attractors:
                ends = ends[~attractor.ellipses.contain(self.stroboscope.scaled(ends))]
        return len(self.attractors) > count_before

    def set_label(self, mask: np.ndarray, label: int) -> None:
        """Give a label, the index of an attractor, to the remaining states under a mask."""
        self.labels[self.remaining[mask]] = label
        self.remaining, self.current = self.remaining[~mask], self.current[~mask]

    def label_classified(self) -> None:
        """Label the states that are in a trapping ellipse or beyond their bounds."""
        sizes = self.stroboscope.size(self.current)
        self.set_label(sizes > self.bounds[self.remaining], _UNBOUNDED_LABEL)
        for i, attractor in enumerate(self.attractors):
            scaled_states = self.stroboscope.scaled(self.current)
            self.set_label(attractor.ellipses.contain(scaled_states), i)

    def propagate(self, cycles: int, stop_early: bool) -> None:
        """Propagate the states without a label over cycles, and label them where they end.

        With `stop_early` they are labelled after 24, 48, 96 ... cycles, too.
        """
        done, step = 0, _FIRST_CYCLES if stop_early else cycles
        while done < cycles and self.remaining.size:
            step = min(step, cycles - done)
            self.current, codes = self.stroboscope(self.current, step)
            errors = codes[(codes != status.OK) & (codes != status.OVERFLOW)]
            if errors.size:
                raise RuntimeError(status.MESSAGES[int(errors[0])])
            self.label_classified()
            done += step
            step = done

    def sample(self) -> np.ndarray:
        """Return sorted random indices of at most 8 of the remaining states."""
        count = min(_SAMPLE_SIZE, self.remaining.size)
        return np.sort(self.rng.choice(self.remaining.size, count, replace=False))

    def examine_samples(self) -> None:
        """Search for attractors near samples of the remaining states until none is new."""
        for _ in range(_MAX_SAMPLES):
            if not self.remaining.size or not self.add_attractors(self.current[self.sample()]):
                return
            self.label_classified()

    def chaotic_attractor(self) -> Attractor | None:
        """Return the chaotic attractor of the remaining states, or None.

        Deviations must grow exponentially in each sample, and the mean exponent must be positive
        beyond its error.
        """
        stroboscope, exponents = self.stroboscope, []
        if not self.remaining.size:
            return None
        for i in self.remaining[self.sample()]:
            exponent = lyapunov.largest_exponent(
                stroboscope.model,
                stroboscope.tuning,
                state=tuple(self.states[i]),
                settle=_SETTLING_PERIODS,
                periods=_EXPONENT_PERIODS,
                max_events=stroboscope.max_events,
            )
            if not exponent.growth > 0.0:
                return None
            exponents.append(exponent)
        values, uncertainties, growths, periods, _ = np.array(exponents).T
        # The exponents are averaged, because that of one weakly chaotic motion may not be
        # significant.
        error = float(np.sqrt((uncertainties**2).sum()) / len(exponents))
        mean = lyapunov.Exponent(float(values.mean()), error, growths.sum(), int(periods.sum()))
        if not mean.positive:
            return None
        return self.aperiodic_attractor(attractors.CHAOTIC, exponent=mean.value, uncertainty=error)

    def aperiodic_attractor(self, kind: int, **exponent: float) -> Attractor:
        """Return an attractor of a kind other than periodic, with the extrema of sampled motions.

        `exponent` may give its fields exponent and uncertainty.
        """
        record, max_events = self.stroboscope.propagator.record, self.stroboscope.max_events
        samples = self.current[self.sample()]
        summaries = np.array(
            [record(state, _EXTREMA_PERIODS, max_events).summary for state in samples]
        )
        highest, lowest = summaries[:, columns.X_MAX].max(), summaries[:, columns.X_MIN].min()
        return Attractor(kind, float(highest), float(lowest), **exponent)

    def sorted_attractors(self, chaos: Attractor | None) -> tuple[list[Attractor], np.ndarray]:
        """Return (attractors, labels of the initial states), sorted by kind, period and height.

        The remaining states belong to the chaotic attractor `chaos`; without one, they are
        undecided.
        """
        unsorted = list(self.attractors)
        if self.remaining.size:
            self.labels[self.remaining] = len(unsorted)
            unsorted.append(chaos or self.aperiodic_attractor(attractors.UNDECIDED))
        is_unbounded = self.labels == _UNBOUNDED_LABEL
        if is_unbounded.any():
            self.labels[is_unbounded] = len(unsorted)
            unsorted.append(Attractor(attractors.UNBOUNDED))
        order = sorted(range(len(unsorted)), key=lambda i: unsorted[i].sort_key)
        return [unsorted[i] for i in order], np.argsort(order)[self.labels]
