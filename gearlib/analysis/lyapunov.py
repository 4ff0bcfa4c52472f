"""Lyapunov exponents of motions, and whether rounding decides where they go.

The maps of `Model.propagator` propagate a small deviation, which is scaled back to length one after
each mesh period; the mean of the logarithms of its growth is the largest exponent, per mesh period.
Lengths are those of (dx, nu dx'): displacements, and velocities over the mean eigenfrequency.
"""

import math
import os
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np

from gearlib import checks, notebook
from gearlib.analysis.global_dynamics.stroboscope import Stroboscope, distinct_values
from gearlib.analysis.orbits.followed_parameters import set_parameter_name, varied
from gearlib.data import status
from gearlib.data.motions import float_array
from gearlib.data.result import result
from gearlib.engines.growth import propagate_deviation
from gearlib.integrators import choose
from gearlib.models.model import UNBOUNDED_FACTOR
from gearlib.runs.run_arguments import MAX_EVENTS
from gearlib.runs.sweeping import CARRIED

#: Largest number of linearised maps that are held in memory at a time.
MAX_MAPS = 512
#: Number of batches of consecutive periods; the scatter of their means gives the uncertainty.
BATCHES = 20
#: Ratio of an exponent to its uncertainty above which it is significant.
_MIN_SIGNIFICANCE = 3.0
#: Logarithm of the growth, beyond that of a quasi-periodic motion, above which it is exponential.
_MIN_EXCESS_GROWTH = 7.0
#: Logarithm of the growth, 1e10, beyond which rounding decides where a motion goes.
MAX_LOG_GROWTH = 10.0 * math.log(10.0)
#: CF flags of a variable "settled" of single motions.
SETTLED_FLAGS = status.flags_of(("unsettled", "settled"))
#: Difference of states of one orbit, relative to its height: far above the error of settling.
_SAME_ORBIT_TOLERANCE = 1e-3


class Exponent(NamedTuple):
    """Largest Lyapunov exponent per mesh period, with its uncertainty."""

    value: float  #: NaN: the run could not go on, or the motion grows without bound
    uncertainty: float  #: standard error of the mean over batches
    growth: float  #: logarithm of the growth over all periods, value times periods
    periods: int
    status: int = status.OK  #: `gearlib.data.status`; OVERFLOW: the motion grows without bound

    @property
    def exceeds_linear(self) -> bool:
        """Whether deviations have grown by more than in a quasi-periodic motion.

        There they grow in proportion to time, by log(periods).
        """
        return self.growth > math.log(self.periods) + _MIN_EXCESS_GROWTH

    @property
    def positive(self) -> bool:
        """Whether deviations grow exponentially and significantly."""
        return self.exceeds_linear and self.value > _MIN_SIGNIFICANCE * self.uncertainty


class Deviation:
    """A small deviation from a motion, which is propagated along it from one run to the next."""

    def __init__(self, model: Any, max_events: int = MAX_EVENTS):
        """Start with an arbitrary deviation; runs stop at more contact events in a mesh period."""
        self.model, self.max_events = model, max_events
        #: Direction of the deviation, shape (n,), or None before the first run.
        self.vector: np.ndarray | None = None
        #: Logarithm of the length of the deviation, 0 for a deviation as small as rounding.
        self.log_length = 0.0

    def propagate(self, propagator: Any, state: np.ndarray, periods: int, first: int = 0) -> tuple:
        """Propagate the deviation along the motion from a full state, over mesh periods.

        Return (final state, logarithm of the growth in each mesh period, status code); a logarithm
        is -inf where the deviation has vanished. `first` is the number of the first mesh period.
        """
        logs = np.full(periods, -math.inf)
        reduction, lift = self.model.reduction()
        vector = np.ones(len(reduction)) if self.vector is None else self.vector.copy()
        weights, self.vector = np.repeat([1.0, propagator.tuning], vector.size // 2), None
        for done in range(0, periods, MAX_MAPS):
            logs_of_batch = logs[done : done + MAX_MAPS]
            period = (first + done) % self.model.repeats
            state, maps, code = propagator.maps(state, logs_of_batch.size, self.max_events, period)
            if code != status.OK:
                return state, logs, code
            # The free rotation of a model is left out: it neither grows nor decays.
            if not propagate_deviation(reduction @ maps @ lift, weights, vector, logs_of_batch):
                logs[done:] = -math.inf
                return state, logs, status.OK
        self.vector = vector
        return state, logs, status.OK

    def exceeds_limit(self, tuning: float, state: Any, periods: int, first: int = 0) -> bool:
        """Return whether rounding decides where the motion from a state goes, over mesh periods.

        The deviation goes on from the last run. `first` is the number of the first mesh period.
        """
        propagator = self.model.propagator(tuning)
        self.vector = self.vector if self.log_length else None
        _, logs, code = self.propagate(propagator, propagator.start(state), periods, first)
        growth = np.cumsum(logs) if code == status.OK else np.full(periods, math.inf)
        exceeds = self.log_length + max(float(growth.max()), 0.0) > MAX_LOG_GROWTH
        self.log_length = min(max(self.log_length + float(growth[-1]), 0.0), MAX_LOG_GROWTH)
        return exceeds


def largest(
    model: Any,
    tuning: float,
    *,
    state: Any = (0.0, 0.0),
    settle: int = 1000,
    periods: int = 4000,
    max_events: int = MAX_EVENTS,
) -> Exponent:
    """Return the largest Lyapunov exponent of the motion from a state at tau = 0.

    It is averaged over `periods` mesh periods after `settle` others. The run stops at more than
    `max_events` contact events in a mesh period.
    """
    strobe = Stroboscope(model, tuning, max_events=max_events)
    deviation, current = Deviation(model, max_events), strobe.propagator.start(state)
    bound = UNBOUNDED_FACTOR * np.maximum(model.extent, strobe.size(current[None]))
    # The settling periods turn any direction into the growing one.
    for first, count in ((0, settle), (settle, periods)) if settle else ((0, periods),):
        size_before = strobe.size(current[None])
        current, logs, code = deviation.propagate(strobe.propagator, current, count, first)
        if code != status.OK:
            return Exponent(math.nan, math.nan, math.nan, periods, code)
        if deviation.vector is None:
            # Strong damping has reduced the deviation to zero.
            return Exponent(-math.inf, 0.0, -math.inf, periods)
    if strobe.follow_growth(current[None], size_before, bound, periods)[0].any():
        return Exponent(math.nan, math.nan, math.nan, periods, status.OVERFLOW)
    batches = np.array([batch.mean() for batch in np.array_split(logs, min(BATCHES, periods))])
    error = batches.std(ddof=1) / math.sqrt(batches.size) if batches.size > 1 else math.inf
    return Exponent(float(logs.mean()), float(error), float(logs.sum()), periods)


def rounding_decides(
    model: Any, tunings: Any, start: tuple, periods: int, final_states: Any = None
) -> np.ndarray:
    """Return a mask, shape (n,), of the tunings at which rounding decides where the motion goes.

    A run over `periods` mesh periods begins at the state `start` at each tuning. If the final
    states of a sweep are given, shape (n, components), each run begins where the last one ended,
    or at `start` after a NaN.
    """
    deviation, decided = Deviation(model), np.zeros(len(tunings), bool)
    for i, tuning in enumerate(tunings):
        state, first = start, 0 if final_states is None else i * periods
        if i and final_states is not None and np.isfinite(final_states[i - 1]).all():
            state = final_states[i - 1]
        else:
            deviation = Deviation(model)
        decided[i] = deviation.exceeds_limit(float(tuning), tuple(state), periods, first)
    return decided


def settled(model: Any, diagrams: list, directions: list, starts: list) -> np.ndarray:
    """Return a mask, shape (diagram, tuning), of periodic motions that rounding does not choose.

    `diagrams` are results of `gearlib.bifurcation_diagram` over the same tunings, `directions` and
    `starts` are the direction and initial state of each. After chaos the orbit of a warm-started
    sweep depends on rounding, until all other motions reach the same orbit.
    """
    periods = np.array([diagram.period.values for diagram in diagrams])
    states = np.array([diagram.displacement.values for diagram in diagrams])
    is_sweep = np.isin(directions, CARRIED)
    decided_by_rounding = np.zeros(periods.shape, bool)
    rising = np.argsort(diagrams[0].tuning.values)
    orders = [rising[::-1] if direction == "down" else rising for direction in directions]
    for k, (diagram, order) in enumerate(zip(diagrams, orders, strict=True)):
        ends = diagram.final_state.values[order] if is_sweep[k] else None
        run_periods = int(diagram.strobe.values[-1]) + 1
        tunings = diagram.tuning.values[order]
        decided_by_rounding[k, order] = rounding_decides(
            model, tunings, starts[k], run_periods, ends
        )
    is_settled = (periods > 0) & ~decided_by_rounding
    others_settled = np.all(is_settled[~is_sweep], axis=0) & np.any(~is_sweep)
    for k in np.flatnonzero(is_sweep):
        after_chaos = False
        compared_diagrams = ~is_sweep | (np.arange(len(diagrams)) == k)
        for i in orders[k]:
            compared = np.sort(states[compared_diagrams, i], axis=1)
            spread = np.ptp(compared, axis=0).max()
            is_same_orbit = spread <= _SAME_ORBIT_TOLERANCE * max(1.0, np.ptp(compared))
            after_chaos = after_chaos or decided_by_rounding[k, i]
            if others_settled[i] and is_same_orbit:
                after_chaos = False
            is_settled[k, i] = periods[k, i] > 0 and not after_chaos
    return is_settled


def lyapunov_exponents(
    pair,
    values,
    *,
    parameter="tuning",
    tuning=None,
    states=(0.0, 0.0),
    settle=500,
    periods=2000,
    max_events=MAX_EVENTS,
    threads=None,
):
    """Return the largest Lyapunov exponents of motions over a parameter, with their errors.

    Small deviations follow the exact maps of `Model.propagator`, with saltation at the flank lines.
    On a periodic attractor the exponent is ln|multiplier| / period; without damping a motion with a
    positive exponent is chaotic, one with exponent zero regular.

    Parameters
    ----------
    pair, values, parameter, tuning, max_events
        The same arguments as those of `gearlib.bifurcation_diagram`.
    states : array_like of float, shape (2,) or (n, 2)
        Displacement in static deflections and dx/dtau at tau = 0, for all or for each value: the
        final states of a diagram follow its branch.
    settle, periods : int
        Mesh periods before the count, and counted (at least 20).
    threads : int, optional
        Number of processors; all by default. The result does not depend on it.

    Returns
    -------
    xarray.Dataset
        Over the parameter under its name: exponent, per mesh period, and uncertainty, the
        standard error of its mean over 20 batches; status, where it is not 0 both are NaN: the
        run could not go on, the motion grows without bound, or its start has no numbers.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    """
    choose(pair, None, None)
    values = distinct_values("values", values)
    settle = checks.integer("settle", settle, 0)
    periods = checks.integer("periods", periods, BATCHES)
    max_events = checks.integer("max_events", max_events, 1)
    threads = os.cpu_count() if threads is None else checks.integer("threads", threads, 1)
    cases = varied(pair, tuning, parameter, values)
    if isinstance(states, str):
        pair.check_state(states)
        states = cases[0][0].start_state(states)
    starts, sizes = float_array(states), {2, len(pair.components)}
    if starts.shape not in {shape for n in sizes for shape in ((n,), (values.size, n))}:
        raise ValueError(
            f"states = {states!r} is not allowed: it must be "
            f"{' or '.join(map(str, sorted(sizes)))} numbers, or as many for each of the "
            f"{values.size} values"
        )
    starts = np.broadcast_to(starts, (values.size, starts.shape[-1]))
    settings = {"settle": settle, "periods": periods, "max_events": max_events}

    def value_error_status(i: int) -> tuple:
        """Return (exponent, standard error, status code) of the motion at the value of index i."""
        model, nu = cases[i]
        if not np.isfinite(starts[i]).all():
            return np.nan, np.nan, status.NO_START
        exponent = largest(model, nu, state=tuple(starts[i]), **settings)
        return exponent.value, exponent.uncertainty, exponent.status

    with ThreadPoolExecutor(threads) as pool:
        results = pool.map(value_error_status, range(values.size))
        table = np.array(list(notebook.counted("values", results, values.size)))
    data = {
        "exponent": (parameter, table[:, 0]),
        "uncertainty": (parameter, table[:, 1]),
        "status": (parameter, table[:, 2].astype(np.int8)),
    }
    dataset = result(
        "Largest Lyapunov exponents of a gear mesh",
        pair,
        data,
        {parameter: values},
        method="variational maps",
        parameter=parameter,
        tuning=tuning,
        settle=settle,
        periods=periods,
    )
    return set_parameter_name(dataset, parameter)
