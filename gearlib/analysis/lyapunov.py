"""Lyapunov exponents of motions, and the growth of rounding errors along a motion.

The linearised maps of `Model.propagator` propagate a small perturbation, which is normalised after
each mesh period. The mean logarithm of its growth is the largest Lyapunov exponent per mesh period.
The norm of a perturbation is the length of the vector (dx, nu dx') with the tuning nu, i.e.
velocities are divided by the mean eigenfrequency.
"""

import math
import os
from concurrent.futures import ThreadPoolExecutor
from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Ge

from gearlib import checks
from gearlib.analysis.global_dynamics.stroboscope import Stroboscope, check_distinct_values
from gearlib.analysis.orbits.tracing import DimensionlessParameter, parameter_cases
from gearlib.data import status
from gearlib.data.motions import as_float_array
from gearlib.data.result import make_result
from gearlib.engines.matrices import propagate_perturbation
from gearlib.integrators import choose_method
from gearlib.models.model import UNBOUNDED_FACTOR
from gearlib.parameters import INTEGER, Count, WholeNumber, checked
from gearlib.progress import TimeLimit, with_progress_bar
from gearlib.runs.run_arguments import MAX_EVENTS, MaxSeconds, Threads, Tuning
from gearlib.runs.sweeping import WARM_STARTED

#: Largest number of linearised maps that are held in memory at a time.
MAX_MAPS = 512
#: Number of batches of consecutive periods; the scatter of the batch means gives the uncertainty.
BATCHES = 20
ExponentPeriods = Annotated[int, Ge(BATCHES), INTEGER]
#: Ratio of an exponent to its uncertainty above which it is significant.
_MIN_SIGNIFICANCE = 3.0
#: Growth is exponential if its logarithm exceeds that of linear growth by more than this.
_MIN_EXCESS_LOG_GROWTH = 7.0
#: Logarithm of the growth (1e10) above which rounding errors become visible in a motion.
MAX_LOG_GROWTH = 10.0 * math.log(10.0)
#: CF flag attributes of the variable "settled" of individual motions.
SETTLED_FLAGS = status.flag_attributes(("unsettled", "settled"))
#: Largest difference between states on the same orbit, relative to its displacement range.
_SAME_ORBIT_TOLERANCE = 1e-3


class Exponent(NamedTuple):
    """Largest Lyapunov exponent of a motion per mesh period, with its uncertainty."""

    value: float  #: NaN if the run failed or the motion grows without bound
    uncertainty: float  #: standard error of the mean over batches
    log_growth: float  #: logarithm of the growth over all periods, value times periods
    periods: int
    status: int = status.OK  #: `gearlib.data.status`; OVERFLOW: the motion grows without bound

    @property
    def grows_faster_than_linearly(self) -> bool:
        """Whether perturbations have grown faster than linearly with the number of mesh periods.

        In quasi-periodic motions, whose exponent is zero, they grow linearly. `log_growth` must
        exceed ln(periods) by more than a margin of 7.
        """
        return self.log_growth > math.log(self.periods) + _MIN_EXCESS_LOG_GROWTH

    @property
    def positive(self) -> bool:
        """Whether perturbations grow exponentially and the exponent is significantly > 0."""
        return self.grows_faster_than_linearly and self.value > _MIN_SIGNIFICANCE * self.uncertainty


class Perturbation:
    """A small perturbation of a motion that is propagated along the motion from run to run."""

    def __init__(self, model: Any, max_events: int = MAX_EVENTS):
        """Create a perturbation of the size of a rounding error with an arbitrary direction.

        `model` is any gear model that can be linearised along a motion. A run fails if it has more
        than `max_events` contact events in a mesh period.
        """
        self.model, self.max_events = model, max_events
        #: Unit vector of the perturbation, shape (n,); None for an arbitrary direction.
        self.vector: np.ndarray | None = None
        #: Logarithm of the length of the perturbation in units of a rounding error.
        self.log_length = 0.0

    def propagate(self, propagator, state: np.ndarray, periods: int, first_period=0) -> tuple:
        """Propagate the perturbation along a motion over a number of mesh periods.

        `propagator` is a `Model.propagator`, which integrates the equations of motion at one tuning
        (mesh frequency / natural frequency). `state` is the initial state with all coordinates
        and velocities, and `first_period` the number of the first mesh period, which sets the phase
        of a run-out. Return (final state, logarithm of the growth in each mesh period, status
        code). After the perturbation has vanished or the run has failed, the logarithms are -inf
        and the attribute `vector`, the direction of the perturbation, is None.
        """
        log_growths = np.full(periods, -math.inf)
        reduction, lift = self.model.reduction()
        vector = np.ones(len(reduction)) if self.vector is None else self.vector.copy()
        self.vector = None
        # Velocities are multiplied by the tuning, which makes them comparable with displacements.
        weights = np.repeat([1.0, propagator.tuning], vector.size // 2)
        for i in range(0, periods, MAX_MAPS):
            batch_growths = log_growths[i : i + MAX_MAPS]  # a view that is filled below
            period = (first_period + i) % self.model.repeats
            state, maps, code = propagator.maps(state, batch_growths.size, self.max_events, period)
            if code != status.OK:
                return state, log_growths, code
            # The rigid-body rotation is removed, because it neither grows nor decays.
            reduced_maps = reduction @ maps @ lift
            if not propagate_perturbation(reduced_maps, weights, vector, batch_growths):
                log_growths[i:] = -math.inf
                return state, log_growths, status.OK
        self.vector = vector
        return state, log_growths, status.OK

    def becomes_visible(self, tuning: float, state: Any, periods: int, first_period: int) -> bool:
        """Propagate the perturbation along the next run and return whether it becomes visible.

        The run is made at a `tuning` (mesh frequency / natural frequency), from `state` at the
        start of mesh period number `first_period`, over `periods` mesh periods. The perturbation is
        visible if it exceeds exp(`MAX_LOG_GROWTH`) = 1e10 times a rounding error, or if the run
        fails. Its final length, limited to this range, is the initial length in the next run.
        """
        propagator = self.model.propagator(tuning)
        if self.log_length == 0.0:
            # The perturbation has decayed to a rounding error, whose direction is arbitrary.
            self.vector = None
        full_state = propagator.initial_state(state)
        _, log_growths, code = self.propagate(propagator, full_state, periods, first_period)
        # Logarithms of the growth since the start of the run, infinite if the run has failed.
        growths = np.cumsum(log_growths) if code == status.OK else np.full(periods, math.inf)
        exceeds = self.log_length + max(float(growths.max()), 0.0) > MAX_LOG_GROWTH
        self.log_length = min(max(self.log_length + float(growths[-1]), 0.0), MAX_LOG_GROWTH)
        return exceeds


def largest_exponent(
    model, tuning: float, *, state=(0.0, 0.0), settle=1000, periods=4000, max_events=MAX_EVENTS
) -> Exponent:
    """Compute the largest Lyapunov exponent, per mesh period, of a motion of a model.

    `tuning` is the ratio of mesh frequency to natural frequency, and `state` the initial
    (displacement in static deflections, velocity by phase) at mesh phase 0. The exponent is
    averaged over `periods` mesh periods after a transient of `settle` mesh periods. The run fails
    if a mesh period has more than `max_events` contact events. The value is NaN if the run fails or
    the motion grows without bound, and -inf if the perturbation vanishes.
    """
    stroboscope = Stroboscope(model, tuning, max_events=max_events)
    propagator = stroboscope.propagator
    perturbation = Perturbation(model, max_events)
    state = propagator.initial_state(state)
    # Motions larger than this, relative to the backlash or the initial state, are unbounded.
    bound = UNBOUNDED_FACTOR * np.maximum(model.extent, stroboscope.state_sizes(state[None]))
    # Transient and average, each with its first mesh period and its number of mesh periods. During
    # the transient any perturbation turns towards the direction of fastest growth.
    stages = ((0, settle), (settle, periods)) if settle else ((0, periods),)
    for first_period, count in stages:
        previous_size = stroboscope.state_sizes(state[None])
        state, log_growths, code = perturbation.propagate(propagator, state, count, first_period)
        if code != status.OK:
            return Exponent(math.nan, math.nan, math.nan, periods, code)
        if perturbation.vector is None:
            # Strong damping has reduced the perturbation to zero.
            return Exponent(-math.inf, 0.0, -math.inf, periods)
    if stroboscope.propagate_growing_motions(state[None], previous_size, bound, periods)[0].any():
        return Exponent(math.nan, math.nan, math.nan, periods, status.OVERFLOW)
    # Successive periods are correlated, so the standard error is estimated from batch means.
    batches = np.array_split(log_growths, min(BATCHES, periods))
    batch_means = np.array([batch.mean() for batch in batches])
    count = batch_means.size
    error = float(batch_means.std(ddof=1) / math.sqrt(count)) if count > 1 else math.inf
    return Exponent(float(log_growths.mean()), error, float(log_growths.sum()), periods)


def are_sensitive_to_rounding(
    model, tunings, initial_state: tuple, periods: int, final_states=None
) -> np.ndarray:
    """Return a mask of the tunings, shape (n,), at which rounding errors grow to a visible size.

    Tunings are ratios of mesh frequency to natural frequency, in the order of the runs of a sweep,
    and each run has `periods` mesh periods. For a warm-started sweep, `final_states` are the final
    states of the runs, shape (n, components), NaN for failed runs: each run starts from the final
    state of the previous one, or from `initial_state` if that run failed. If `final_states` is
    None, all runs start from `initial_state`.
    """
    is_sensitive = np.zeros(len(tunings), bool)
    for i, tuning in enumerate(tunings):
        # In a warm-started sweep the phase of the run-out continues from run to run.
        first_period = 0 if final_states is None else i * periods
        if i and final_states is not None and np.isfinite(final_states[i - 1]).all():
            state = tuple(final_states[i - 1])
        else:
            # A new motion needs a new perturbation.
            state = tuple(initial_state)
            perturbation = Perturbation(model)
        is_sensitive[i] = perturbation.becomes_visible(float(tuning), state, periods, first_period)
    return is_sensitive


def reproducible_orbits(
    model: Any, diagrams: list, directions: list, initial_states: list
) -> np.ndarray:
    """Return a mask, shape (diagrams, tunings), of orbits that do not depend on rounding errors.

    `diagrams` are results of `gearlib.bifurcation_diagram` at the same tunings (ratios of mesh
    frequency to natural frequency). Each has an entry in `directions` ("cold": all runs from the
    initial state; "up" or "down": each from the final state of the previous run) and in
    `initial_states`. After a warm-started sweep has passed through chaos, its orbit depends on
    rounding errors, until it reaches a tuning at which all cold runs are reproducible and settle on
    the same orbit.
    """
    periods = np.array([diagram.period.values for diagram in diagrams])
    displacements = np.array([diagram.displacement.values for diagram in diagrams])
    is_warm_started = np.isin(directions, WARM_STARTED)
    is_sensitive = np.zeros(periods.shape, bool)
    ascending = np.argsort(diagrams[0].tuning.values)
    # The indices of the tunings in the order in which each sweep has run them.
    orders = [ascending[::-1] if direction == "down" else ascending for direction in directions]
    for k, (diagram, order) in enumerate(zip(diagrams, orders, strict=True)):
        final_states = diagram.final_state.values[order] if is_warm_started[k] else None
        # The coordinate `strobe` counts the mesh periods of a run, including its transient, from 0.
        run_periods = int(diagram.strobe.values[-1]) + 1
        tunings = diagram.tuning.values[order]
        is_sensitive[k, order] = are_sensitive_to_rounding(
            model, tunings, initial_states[k], run_periods, final_states
        )
    is_reproducible = (periods > 0) & ~is_sensitive
    # A warm-started sweep can only become reproducible again by comparison with cold runs.
    cold_reproducible = np.all(is_reproducible[~is_warm_started], axis=0) & ~is_warm_started.all()
    for k in np.flatnonzero(is_warm_started):
        after_chaos = False  # whether the sweep depends on rounding errors of an earlier run
        # The sweep is compared with all diagrams of cold runs.
        compared_diagrams = ~is_warm_started | (np.arange(len(diagrams)) == k)
        for i in orders[k]:
            # Equal orbits may have their stroboscopic points in a different order, so sort them.
            points = np.sort(displacements[compared_diagrams, i], axis=1)
            spread = np.ptp(points, axis=0).max()
            is_same_orbit = spread <= _SAME_ORBIT_TOLERANCE * max(1.0, np.ptp(points))
            after_chaos = after_chaos or is_sensitive[k, i]
            if cold_reproducible[i] and is_same_orbit:
                after_chaos = False
            is_reproducible[k, i] = periods[k, i] > 0 and not after_chaos
    return is_reproducible


@checked
def lyapunov_exponents(
    model,
    values,
    *,
    parameter: DimensionlessParameter = "tuning",
    tuning: Tuning | None = None,
    states=(0.0, 0.0),
    settle: WholeNumber = 500,
    periods: ExponentPeriods = 2000,
    max_events: Count = MAX_EVENTS,
    threads: Threads = None,
    max_seconds: MaxSeconds = None,
):
    """Compute the largest Lyapunov exponents of motions, with standard errors, over a parameter.

    Perturbations are propagated by the exact linearised maps of the motion, with saltation matrices
    at contact events. On a periodic attractor the exponent is ln|multiplier| / period. Without
    damping, a motion with a positive exponent is chaotic, and one with a zero exponent is regular.

    Parameters
    ----------
    model, values, parameter, tuning, max_events
        As in `gearlib.bifurcation_diagram`.
    states : array_like of float, shape (2,) or (n, 2)
        Displacement in units of the static deflection and dx/dtau at tau = 0, one state for all
        values or one per value. With the final states of a bifurcation diagram, the exponents
        follow its branch.
    settle, periods : int
        Numbers of mesh periods of the transient and of the average (at least 20).
    threads : int, optional
        Number of threads; by default one per processor. The result does not depend on it.
    max_seconds : float, optional
        Time limit in seconds, after which the results computed so far are returned; see
        `gearlib.progress`.

    Returns
    -------
    xarray.Dataset
        Over a dimension with the name of the parameter: exponent, per mesh period; uncertainty, its
        standard error from the means of 20 batches; status. If status is not 0, the others are NaN,
        because the run failed, the motion grows without bound, or the initial state is not finite.

    Raises
    ------
    ValueError
        If an argument is invalid; the message states its name, its value and what is allowed.
    """
    choose_method(model, None, None)
    values = check_distinct_values("values", values)
    cases = parameter_cases(model, tuning, parameter, values)
    limit = TimeLimit(max_seconds)
    if isinstance(states, str):
        model.check_state(states)
        states = cases[0][0].start_state(states)
    initial_states = as_float_array(states)
    state_sizes = sorted({2, len(model.components)})
    counts = " or ".join(map(str, state_sizes))
    allowed = f"{counts} numbers, or {counts} numbers for each of the {values.size} values"
    is_valid = initial_states.ndim > 0 and initial_states.shape[-1] in state_sizes
    is_valid = is_valid and initial_states.shape[:-1] in ((), (values.size,))
    checks.require(is_valid, "states", states, allowed)
    initial_states = np.broadcast_to(initial_states, (values.size, initial_states.shape[-1]))

    def exponent_row(i: int) -> tuple:
        """Return (exponent, uncertainty, status code) at the parameter value with index i.

        The status code is -1 if the time limit has passed.
        """
        case_model, case_tuning = cases[i]
        if limit.is_over():
            return np.nan, np.nan, -1
        if not np.isfinite(initial_states[i]).all():
            return np.nan, np.nan, status.NO_START
        exponent_options = {"settle": settle, "periods": periods, "max_events": max_events}
        state = tuple(initial_states[i])
        exponent = largest_exponent(case_model, case_tuning, state=state, **exponent_options)
        return exponent.value, exponent.uncertainty, exponent.status

    with ThreadPoolExecutor(threads or os.cpu_count()) as pool:
        rows = pool.map(exponent_row, range(values.size))
        table = np.array(list(with_progress_bar("values", rows, values.size)))
    data = {
        "exponent": (parameter, table[:, 0]),
        "uncertainty": (parameter, table[:, 1]),
        "status": (parameter, table[:, 2].astype(np.int8)),
    }
    attributes = {"parameter": parameter, "tuning": tuning, "settle": settle, "periods": periods}
    title, coords = "Largest Lyapunov exponents of a gear mesh", {parameter: values}
    dataset = make_result(title, model, data, coords, method="variational maps", **attributes)
    return limit.record_missing(dataset, **{parameter: table[:, 2] >= 0})
