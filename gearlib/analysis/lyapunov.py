"""Lyapunov exponents of motions, and whether rounding decides where they go.

A small deviation is carried along by the maps of `Model.propagator`, scaled back to length one
after each mesh period; the mean of the logarithms of its growth is the largest exponent, per mesh
period. Lengths are those of (dx, nu dx'): displacements, and velocities over the mean
eigenfrequency.
"""

import math
import os
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from gearlib import checks, notebook
from gearlib.analysis.global_dynamics import grids
from gearlib.analysis.global_dynamics.stroboscope import Stroboscope
from gearlib.analysis.orbits.followed_parameters import name_parameter, varied
from gearlib.data import status
from gearlib.data.motions import floats
from gearlib.data.result import result
from gearlib.engines.growth import carry
from gearlib.integrators import choose
from gearlib.models.model import FAR
from gearlib.runs.run_arguments import MAX_EVENTS
from gearlib.runs.sweeping import CARRIED

#: Most maps that are held in memory at a time.
MAX_MAPS = 512
#: Batches of consecutive periods whose means give the uncertainty.
BATCHES = 20
#: An exponent counts when it is so many times its uncertainty.
_SIGMAS = 3.0
#: Growth exp(slack) beyond the linear growth of a quasi-periodic motion is exponential.
_SLACK = 7.0
#: Logarithm of the growth, 1e10, beyond which rounding decides where a motion goes.
LOST = 10.0 * math.log(10.0)
#: What a variable "settled" says of single motions.
SETTLED_FLAGS = status.flags_of(("unsettled", "settled"))
#: Strobes of one orbit agree to this share of its height: far more than what is left of settling.
_SAME_ORBIT = 1e-3


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


class Deviation:
    """A small deviation, carried along with a motion from one run to the next."""

    def __init__(self, model, max_events=MAX_EVENTS):
        self.model, self.max_events = model, max_events
        #: Direction, shape (n,); None: any.
        self.vector: np.ndarray | None = None
        #: Logarithm of its length, from that of rounding up to that of the motion.
        self.length = 0.0

    def carry(self, propagator, z, periods, first=0):
        """Carry it through mesh periods; return (end, logarithms of its growth in each, status).

        They are -inf where it has vanished. `first` is the number of the first period, where the
        excitation repeats after several.
        """
        logs = np.full(periods, -math.inf)
        reduce, lift = self.model.reduction()
        vector = np.ones(len(reduce)) if self.vector is None else self.vector.copy()
        weights, self.vector = np.repeat([1.0, propagator.tuning], vector.size // 2), None
        for done in range(0, periods, MAX_MAPS):
            counted, period = logs[done : done + MAX_MAPS], (first + done) % self.model.repeats
            z, maps, code = propagator.maps(z, counted.size, self.max_events, period)
            if code != status.OK:
                return z, logs, code
            # The free rotation of six degrees of freedom never grows nor decays.
            if not carry(reduce @ maps @ lift, weights, vector, counted):
                logs[done:] = -math.inf
                return z, logs, status.OK
        self.vector = vector
        return z, logs, status.OK

    def lost(self, tuning, state, periods, first=0):
        """Return whether rounding decides where a motion goes in a run, and go on from its end."""
        propagator = self.model.propagator(tuning)
        self.vector = self.vector if self.length else None
        _, logs, code = self.carry(propagator, propagator.start(state), periods, first)
        growth = np.cumsum(logs) if code == status.OK else np.full(periods, math.inf)
        decided = self.length + max(float(growth.max()), 0.0) > LOST
        self.length = min(max(self.length + float(growth[-1]), 0.0), LOST)
        return decided


def largest(model, tuning, *, state=(0.0, 0.0), settle=1000, periods=4000, max_events=MAX_EVENTS):
    """Return the `Exponent`, the largest Lyapunov exponent, of the motion from a state at tau = 0.

    It is counted over so many periods after those to settle.
    """
    strobe = Stroboscope(model, tuning, max_events=max_events)
    deviation, z = Deviation(model, max_events), strobe.propagator.start(state)
    bound = FAR * np.maximum(model.extent, strobe.size(z[None]))
    # Any direction will do: settling turns it into the growing one.
    for first, count in ((0, settle), (settle, periods)) if settle else ((0, periods),):
        before = strobe.size(z[None])
        z, logs, code = deviation.carry(strobe.propagator, z, count, first)
        if code != status.OK:
            return Exponent(math.nan, math.nan, math.nan, periods, code)
        if deviation.vector is None:
            # Over-damped to nothing: no deviation is left to grow.
            return Exponent(-math.inf, 0.0, -math.inf, periods)
    if strobe.unbounded(z[None], before, bound, periods)[0].any():
        return Exponent(math.nan, math.nan, math.nan, periods, status.OVERFLOW)
    batches = np.array([part.mean() for part in np.array_split(logs, min(BATCHES, periods))])
    error = batches.std(ddof=1) / math.sqrt(batches.size) if batches.size > 1 else math.inf
    return Exponent(float(logs.mean()), float(error), float(logs.sum()), periods)


def rounding_decides(model, tunings, start, periods, ends=None):
    """Return where rounding decides which way a motion goes, over tunings, bool, shape (n,).

    The motion begins at `start` at each tuning. With `ends`, its final states, shape (n,
    components), it is carried from tuning to tuning, and begins anew behind a NaN.
    """
    deviation, decided = Deviation(model), np.zeros(len(tunings), bool)
    for i, tuning in enumerate(tunings):
        state, first = start, 0 if ends is None else i * periods
        if i and ends is not None and np.isfinite(ends[i - 1]).all():
            state = ends[i - 1]
        else:
            deviation = Deviation(model)
        decided[i] = deviation.lost(float(tuning), tuple(state), periods, first)
    return decided


def settled(model, diagrams, directions, starts):
    """Return where motions are periodic, and not on orbits that rounding has chosen.

    Bool, shape (diagram, tuning). `diagrams` are of `gearlib.bifurcation_diagram` over the same
    tunings, `directions` and `starts` the way and initial state of each. Behind chaos a carried
    motion is where rounding has led it, until all others have come to one orbit, and it too.
    """
    periods = np.array([diagram.period.values for diagram in diagrams])
    strobes = np.array([diagram.displacement.values for diagram in diagrams])
    carried, lost = np.isin(directions, CARRIED), np.zeros(periods.shape, bool)
    rising = np.argsort(diagrams[0].tuning.values)
    orders = [rising[::-1] if direction == "down" else rising for direction in directions]
    for k, (diagram, order) in enumerate(zip(diagrams, orders, strict=True)):
        ends = diagram.final_state.values[order] if carried[k] else None
        length = int(diagram.strobe.values[-1]) + 1
        tunings = diagram.tuning.values[order]
        lost[k, order] = rounding_decides(model, tunings, starts[k], length, ends)
    known = (periods > 0) & ~lost
    others_known = np.all(known[~carried], axis=0) & np.any(~carried)
    for k in np.flatnonzero(carried):
        behind = False
        for i in orders[k]:
            sets = np.sort(strobes[~carried | (np.arange(len(lost)) == k), i], axis=1)
            together = np.ptp(sets, axis=0).max() <= _SAME_ORBIT * max(1.0, np.ptp(sets))
            behind = (behind or lost[k, i]) and not (others_known[i] and together)
            known[k, i] = periods[k, i] > 0 and not behind
    return known


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
    """Return the largest Lyapunov exponent of motions over a parameter.

    Deviations are carried along by the exact maps of `Model.propagator`, with saltation at
    the flank lines: on a periodic attractor the exponent is ln|multiplier| / period, and without
    damping a positive one is chaos, a motion of zero exponent regular.

    Parameters
    ----------
    pair, values, parameter, tuning, max_events
        As of `gearlib.bifurcation_diagram`.
    states : array_like of float, shape (2,) or (n, 2)
        Displacement in static deflections and dx/dtau at tau = 0, for all or for each value: the
        final states of a diagram follow its branch.
    settle, periods : int
        Mesh periods before the count, and counted (at least 20).
    threads : int, optional
        All processors by default. The result does not depend on it.

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
    values = grids.values("values", values)
    settle = checks.integer("settle", settle, 0)
    periods = checks.integer("periods", periods, BATCHES)
    max_events = checks.integer("max_events", max_events, 1)
    threads = os.cpu_count() if threads is None else checks.integer("threads", threads, 1)
    cases = varied(pair, tuning, parameter, values)
    if isinstance(states, str):
        pair.check_state(states)
        states = cases[0][0].start_state(states)
    rows, sizes = floats(states), {2, len(pair.components)}
    if rows.shape not in {shape for n in sizes for shape in ((n,), (values.size, n))}:
        raise ValueError(
            f"states = {states!r} is not allowed: it must be "
            f"{' or '.join(map(str, sorted(sizes)))} numbers, or as many for each of the "
            f"{values.size} values"
        )
    rows = np.broadcast_to(rows, (values.size, rows.shape[-1]))

    def exponent(i):
        model, nu = cases[i]
        if not np.isfinite(rows[i]).all():
            return np.nan, np.nan, status.NO_START
        settings = {"settle": settle, "periods": periods, "max_events": max_events}
        rate = largest(model, nu, state=tuple(rows[i]), **settings)
        return rate.value, rate.uncertainty, rate.status

    with ThreadPoolExecutor(threads) as pool:
        running = pool.map(exponent, range(values.size))
        rates = np.array(list(notebook.counted("values", running, values.size)))
    data = {
        "exponent": (parameter, rates[:, 0]),
        "uncertainty": (parameter, rates[:, 1]),
        "status": (parameter, rates[:, 2].astype(np.int8)),
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
    return name_parameter(dataset, parameter)
