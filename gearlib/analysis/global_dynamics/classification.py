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
from gearlib.progress import TimeLimit, with_progress_bar

#: Number of random initial states that are propagated first, in search of attractors.
_FIRST_SAMPLE_SIZE = 128
#: Number of unlabelled states in a sample, and largest number of samples.
_SAMPLE_SIZE, _MAX_SAMPLES = 8, 6
#: Cycles after which states are compared with the trapping ellipses for the first time.
_FIRST_CYCLES = 24
#: Number of chunks of states that each thread propagates between two checks of the time limit.
_CHUNKS_PER_THREAD = 16
#: Mesh periods over which Lyapunov exponents and extrema of aperiodic motions are computed.
_EXPONENT_PERIODS, _EXTREMA_PERIODS = 2000, 256
#: Mesh periods of the transient before a Lyapunov exponent is computed.
_TRANSIENT_PERIODS = 500
#: Labels of states that are not yet classified, and of states whose motions exceed their bounds.
_NO_LABEL, _UNBOUNDED_LABEL = -1, -2


def require_damped_model(model: Any) -> None:
    """Raise ValueError if a model is unsuitable for a search for attractors.

    It must have one mesh, and damping: without damping a model has no attractors.
    """
    check_one_mesh(model)
    if model.has_damping():
        return
    raise ValueError(
        "damping = 0 is not allowed: a model without any damping conserves volume in phase "
        "space and has no attractors; see gearlib.poincare_section for its motions"
    )


def classify(
    stroboscope: Stroboscope,
    states: np.ndarray,
    cycles,
    time_limit: TimeLimit,
    stop_early=True,
    seed=0,
) -> tuple[list[Attractor], np.ndarray]:
    """Find the attractors of a model and the attractor that each initial state approaches.

    `stroboscope` maps many states over whole cycles (periods of the excitation) of the model, and
    `states` are initial displacements and velocities, shape (k, 2). A run lasts `cycles` cycles,
    and as many again if it has not reached an attractor by then; with `stop_early` it ends when it
    enters a trapping ellipse, the neighbourhood of a known orbit. `seed` is for the random choice
    of states that are examined first. States without an attractor when the time limit is over are
    undecided. Return (attractors, index of the attractor of each initial state, shape (k,));
    attractors are sorted by kind, period and displacement range, and each kind except periodic
    occurs at most once.
    """
    rng = np.random.default_rng(seed)
    motions = _Motions(stroboscope, states, rng, time_limit)
    # A sample of the states is propagated first; most of the others end near the same attractors.
    sample = rng.choice(len(states), min(_FIRST_SAMPLE_SIZE, len(states)), replace=False)
    final_states, _ = motions.propagate_states(
        stroboscope.full_states(states[np.sort(sample)]), cycles
    )
    motions.add_attractors(final_states)
    motions.propagate(cycles, stop_early)
    bounds = motions.bounds[motions.remaining]
    is_unbounded, motions.current = stroboscope.propagate_growing_motions(
        motions.current, previous_sizes=0.0, bounds=bounds, periods=_EXPONENT_PERIODS
    )
    motions.set_label(is_unbounded, _UNBOUNDED_LABEL)
    motions.search_near_samples()
    chaos = motions.chaotic_attractor()
    if motions.remaining.size and not chaos:
        motions.propagate(cycles, stop_early=True)
        motions.search_near_samples()
        chaos = motions.chaotic_attractor()
    return motions.sorted_attractors(chaos)


class _Motions:
    """Motions from all initial states, with the attractors that are known so far.

    The label of an initial state is the index of its attractor, or _NO_LABEL, _UNBOUNDED_LABEL.
    """

    def __init__(self, stroboscope, states: np.ndarray, rng: np.random.Generator, time_limit):
        """Start a motion at each of the initial `states` (displacement, velocity), shape (k, 2).

        `stroboscope` is the `Stroboscope` that propagates them, `rng` chooses random samples of the
        motions, and `time_limit` is a `TimeLimit` of the computing time.
        """
        self.stroboscope, self.states = stroboscope, states
        self.rng, self.time_limit = rng, time_limit
        self.attractors: list = []
        self.labels = np.full(len(states), _NO_LABEL)
        #: Indices of the initial states without a label, and the current full states of these.
        self.remaining, self.current = np.arange(len(states)), stroboscope.full_states(states)
        #: Size of each motion above which it is unbounded, as in `Model.bound`.
        sizes = stroboscope.state_sizes(self.current)
        self.bounds = UNBOUNDED_FACTOR * np.maximum(stroboscope.model.extent, sizes)

    def add_attractors(self, states: np.ndarray) -> bool:
        """Search for periodic attractors near given states, and return whether any is new.

        `states`, shape (m, n), have all coordinates and velocities, and have passed the transient.
        New attractors are appended to the list `attractors`.
        """
        count_before = len(self.attractors)
        states = states[np.isfinite(states).all(axis=1)]
        while len(states) and not self.time_limit.is_over():
            # Examine eight states at a time.
            sample, states = states[:_SAMPLE_SIZE], states[_SAMPLE_SIZE:]
            arguments = sample, self.attractors, self.time_limit
            self.attractors += attractors.find_attractors(self.stroboscope, *arguments)
            # Most of the other states lie in the trapping ellipses of the attractors found so far.
            for attractor in self.attractors:
                states = states[
                    ~attractor.ellipses.contain(self.stroboscope.reduce_and_scale(states))
                ]
        return len(self.attractors) > count_before

    def set_label(self, mask: np.ndarray, label: int) -> None:
        """Give a label to some of the remaining motions and remove these from the remaining ones.

        `mask` selects them among the remaining motions; `label` is the index of their attractor, or
        _UNBOUNDED_LABEL.
        """
        self.labels[self.remaining[mask]] = label
        self.remaining, self.current = self.remaining[~mask], self.current[~mask]

    def label_converged(self) -> None:
        """Label the remaining motions that have reached an attractor or exceed their bounds.

        A motion has reached an attractor if it is in a trapping ellipse, the neighbourhood of an
        orbit that no sampled motion leaves.
        """
        sizes = self.stroboscope.state_sizes(self.current)
        self.set_label(sizes > self.bounds[self.remaining], _UNBOUNDED_LABEL)
        for i, attractor in enumerate(self.attractors):
            scaled_states = self.stroboscope.reduce_and_scale(self.current)
            self.set_label(attractor.ellipses.contain(scaled_states), i)

    def propagate(self, cycles: int, stop_early: bool) -> None:
        """Propagate the remaining motions over a number of cycles, then label them.

        A cycle is the period of the excitation. With `stop_early`, motions that have reached an
        attractor are also labelled, and thereby end, after 24, 48, 96, ... cycles. Raise
        RuntimeError if a run fails for another reason than unbounded growth.
        """
        cycles_done = 0
        step = _FIRST_CYCLES if stop_early else cycles
        while cycles_done < cycles and self.remaining.size and not self.time_limit.is_over():
            step = min(step, cycles - cycles_done)
            self.current, status_codes = self.propagate_states(self.current, step)
            error_codes = status_codes[
                (status_codes != status.OK) & (status_codes != status.OVERFLOW)
            ]
            if error_codes.size:
                raise RuntimeError(status.MESSAGES[int(error_codes[0])])
            self.label_converged()
            cycles_done += step
            step = cycles_done  # doubles the number of cycles

    def propagate_states(self, states: np.ndarray, cycles: int) -> tuple:
        """Propagate states, shape (m, n), over a number of cycles; return (states, status codes).

        The states have all coordinates and velocities. They are propagated in parts; after the time
        limit the parts that are left remain unchanged, with the status code 0.
        """
        states, status_codes = states.copy(), np.zeros(len(states), np.int64)
        chunk_size = 1 if self.time_limit.is_set else self.stroboscope.propagator.chunk_size
        group_size = _CHUNKS_PER_THREAD * self.stroboscope.threads * chunk_size
        chunk_starts = range(0, len(states), group_size)
        for i in self.time_limit.iterate(
            with_progress_bar("parts of the states", chunk_starts, len(chunk_starts))
        ):
            chunk = slice(i, i + group_size)
            states[chunk], status_codes[chunk] = self.stroboscope(states[chunk], cycles)
        return states, status_codes

    def choose_sample(self) -> np.ndarray:
        """Return the positions of at most 8 randomly chosen remaining motions, sorted.

        They are positions in the arrays `remaining` and `current`.
        """
        count = min(_SAMPLE_SIZE, self.remaining.size)
        return np.sort(self.rng.choice(self.remaining.size, count, replace=False))

    def search_near_samples(self) -> None:
        """Search for attractors near random samples of the remaining motions, and label these.

        Stop after _MAX_SAMPLES (6) samples of 8 motions, or after the first sample without a new
        attractor.
        """
        for _ in range(_MAX_SAMPLES):
            if not self.remaining.size or not self.add_attractors(
                self.current[self.choose_sample()]
            ):
                return
            self.label_converged()

    def chaotic_attractor(self) -> Attractor | None:
        """Return the chaotic attractor of the remaining motions, or None if they are not chaotic.

        They are chaotic if perturbations grow in each of at most eight motions chosen at random,
        and the mean of the largest Lyapunov exponents of these is significantly positive.
        """
        stroboscope, exponents = self.stroboscope, []
        if not self.remaining.size or self.time_limit.is_over():
            return None
        for i in self.remaining[self.choose_sample()]:
            exponent = lyapunov.largest_exponent(
                stroboscope.model,
                stroboscope.tuning,
                state=tuple(self.states[i]),
                settle=_TRANSIENT_PERIODS,
                periods=_EXPONENT_PERIODS,
                max_events=stroboscope.max_events,
            )
            if not exponent.log_growth > 0.0:
                return None
            exponents.append(exponent)
        values, uncertainties, growths, periods, _ = np.array(exponents).T
        # The exponent of a single weakly chaotic motion may not be significant.
        error = float(np.sqrt((uncertainties**2).sum()) / len(exponents))
        mean = lyapunov.Exponent(float(values.mean()), error, growths.sum(), int(periods.sum()))
        if not mean.positive:
            return None
        return self.aperiodic_attractor(attractors.CHAOTIC, exponent=mean.value, uncertainty=error)

    def aperiodic_attractor(self, kind: int, exponent=np.nan, uncertainty=np.nan) -> Attractor:
        """Return an attractor of an aperiodic kind, with the extrema of some remaining motions.

        `kind` is CHAOTIC, UNBOUNDED or UNDECIDED. `exponent` is the largest Lyapunov exponent per
        mesh period and `uncertainty` its standard error, NaN if unknown. The extrema of the
        displacement are those of eight motions over 256 mesh periods.
        """
        record, max_events = self.stroboscope.propagator.record, self.stroboscope.max_events
        samples = self.current[self.choose_sample()]
        summaries = np.array(
            [record(state, _EXTREMA_PERIODS, max_events).summary for state in samples]
        )
        return Attractor(
            kind,
            displacement_max=float(summaries[:, columns.X_MAX].max()),
            displacement_min=float(summaries[:, columns.X_MIN].min()),
            exponent=exponent,
            uncertainty=uncertainty,
        )

    def sorted_attractors(self, chaos: Attractor | None) -> tuple[list[Attractor], np.ndarray]:
        """Return (sorted attractors, index of the attractor of each initial state).

        Motions that still remain belong to the chaotic attractor `chaos`, or are undecided if that
        is None. Attractors are sorted by kind, period and displacement range.
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
        # argsort of the order gives the new index of each attractor.
        return [unsorted[i] for i in order], np.argsort(order)[self.labels]
