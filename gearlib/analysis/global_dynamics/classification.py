"""Classification of initial states by the attractors to which their motions converge."""

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

#: Number of random initial states that are propagated first to find attractors.
_FIRST_SAMPLE_SIZE = 128
#: Number of unclassified states in a sample, and largest number of samples.
_SAMPLE_SIZE, _MAX_SAMPLES = 8, 6
#: Number of cycles after which states are first compared with the trapping ellipses.
_FIRST_CYCLES = 24
#: Number of chunks of states that each thread propagates between two checks of the time limit.
_CHUNKS_PER_THREAD = 16
#: Numbers of mesh periods for Lyapunov exponents and for extrema of aperiodic motions.
_EXPONENT_PERIODS, _EXTREMA_PERIODS = 2000, 256
#: Number of mesh periods of the transient before a Lyapunov exponent is computed.
_TRANSIENT_PERIODS = 500
#: Labels of states that are not yet classified, and of states whose motions exceed their bounds.
_NO_LABEL, _UNBOUNDED_LABEL = -1, -2


def require_damped_model(model: Any) -> None:
    """Raise ValueError unless a model has one mesh and damping.

    Models without damping have no attractors.
    """
    check_one_mesh(model)
    if model.has_damping():
        return
    raise ValueError(
        "damping = 0 is not allowed: a model without any damping conserves phase-space volume and "
        "has no attractors; use gearlib.poincare_section to show its motions"
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

    `stroboscope` maps states over whole cycles (periods of the excitation), and `states` are
    initial displacements and velocities, shape (k, 2). Each motion is propagated over `cycles`
    cycles, or twice as many if it has not reached an attractor by then. With `stop_early` it stops
    in a trapping ellipse, the neighbourhood of a known orbit. `seed` determines the random sample
    of states that is examined first. States that are not classified within the time limit are
    undecided. Return (attractors, index of the attractor of each initial state, shape (k,)).
    Attractors are sorted by kind, period and displacement range, and each kind except periodic
    occurs at most once.
    """
    rng = np.random.default_rng(seed)
    motions = _Motions(stroboscope, states, rng, time_limit)
    # A sample of the states is propagated first; most other states approach the same attractors.
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
    """Motions from all initial states, and the attractors found so far.

    The label of an initial state is the index of its attractor, `_NO_LABEL` or `_UNBOUNDED_LABEL`.
    """

    def __init__(self, stroboscope, states: np.ndarray, rng: np.random.Generator, time_limit):
        """Start a motion at each of the initial `states` (displacement, velocity), shape (k, 2).

        `stroboscope` is the `Stroboscope` that propagates the states, `rng` selects random samples
        of the motions, and `time_limit` limits the computing time.
        """
        self.stroboscope, self.states = stroboscope, states
        self.rng, self.time_limit = rng, time_limit
        self.attractors: list = []
        self.labels = np.full(len(states), _NO_LABEL)
        #: Indices of the initial states without a label, and their current full states.
        self.remaining, self.current = np.arange(len(states)), stroboscope.full_states(states)
        #: Size of each motion above which it is unbounded, as in `Model.bound`.
        sizes = stroboscope.state_sizes(self.current)
        self.bounds = UNBOUNDED_FACTOR * np.maximum(stroboscope.model.extent, sizes)

    def add_attractors(self, states: np.ndarray) -> bool:
        """Search for periodic attractors near given states and return whether any were found.

        `states`, shape (m, n), are full states after a transient. New attractors are appended to
        the list `attractors`.
        """
        count_before = len(self.attractors)
        states = states[np.isfinite(states).all(axis=1)]
        while len(states) and not self.time_limit.is_over():
            sample, states = states[:_SAMPLE_SIZE], states[_SAMPLE_SIZE:]
            arguments = sample, self.attractors, self.time_limit
            self.attractors += attractors.find_attractors(self.stroboscope, *arguments)
            # States in the trapping ellipses of known attractors need not be examined.
            for attractor in self.attractors:
                states = states[
                    ~attractor.ellipses.contain(self.stroboscope.reduce_and_scale(states))
                ]
        return len(self.attractors) > count_before

    def set_label(self, mask: np.ndarray, label: int) -> None:
        """Label the remaining motions selected by `mask` and remove them from the remaining ones.

        `label` is the index of their attractor or `_UNBOUNDED_LABEL`.
        """
        self.labels[self.remaining[mask]] = label
        self.remaining, self.current = self.remaining[~mask], self.current[~mask]

    def label_converged(self) -> None:
        """Label the remaining motions that have reached an attractor or exceed their bounds.

        A motion has reached an attractor if its state lies in a trapping ellipse, a neighbourhood
        of the orbit that no sampled motion leaves.
        """
        sizes = self.stroboscope.state_sizes(self.current)
        self.set_label(sizes > self.bounds[self.remaining], _UNBOUNDED_LABEL)
        for i, attractor in enumerate(self.attractors):
            scaled_states = self.stroboscope.reduce_and_scale(self.current)
            self.set_label(attractor.ellipses.contain(scaled_states), i)

    def propagate(self, cycles: int, stop_early: bool) -> None:
        """Propagate the remaining motions over a number of cycles, then label them.

        A cycle is the period of the excitation. With `stop_early`, motions that have reached an
        attractor are already labelled, and no longer propagated, after 24, 48, 96, ... cycles.
        Raise RuntimeError if a run fails for a reason other than unbounded growth.
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
        """Propagate full states, shape (m, n), over a number of cycles.

        Return (states, status codes). The states are propagated in groups. After the time limit the
        remaining groups are unchanged and have the status code 0.
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
        """Choose at most 8 of the remaining motions at random.

        Return their sorted indices in the arrays `remaining` and `current`.
        """
        count = min(_SAMPLE_SIZE, self.remaining.size)
        return np.sort(self.rng.choice(self.remaining.size, count, replace=False))

    def search_near_samples(self) -> None:
        """Search for attractors near random samples of the remaining motions; label the motions.

        Stop after `_MAX_SAMPLES` (6) samples of 8 motions, or after the first sample without a new
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

        They are chaotic if perturbations grow in each motion of a random sample of up to eight
        motions, and if the mean of their largest Lyapunov exponents is significantly positive.
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
        """Return an aperiodic attractor with the displacement extrema of a sample of motions.

        `kind` is CHAOTIC or UNDECIDED. `exponent` is the largest Lyapunov exponent per mesh period
        and `uncertainty` its standard error, NaN if unknown. The extrema are computed for up to
        eight remaining motions over 256 mesh periods.
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

        The remaining motions belong to the chaotic attractor `chaos` or, if that is None, are
        undecided. Attractors are sorted by kind, period and displacement range.
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
        # The argsort of the order is the new index of each attractor.
        return [unsorted[i] for i in order], np.argsort(order)[self.labels]
