"""Motions from many seeded starts: where they end, and whether rounding decides that.

Long after its start a chaotic motion depends on the last digit of it. What is said of a motion is
therefore said of a stable periodic orbit, found to rounding by Newton's method from where a run
ends, or of many starts: medians, ranges and shares.
"""

import os
import warnings
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
import xarray as xr

from gearlib.analysis.orbits.shooting import NoOrbit, periodic_orbit
from gearlib.data import status, summary
from gearlib.engines.orbit import Span
from gearlib.runs.run_arguments import MAX_EVENTS
from gearlib.runs.sweeping import DIRECTIONS

#: Flags of `settled`.
SETTLED_FLAGS = status.flags_of(("unsettled", "all_starts_on_one_stable_orbit"))
#: Variables that say how the starts share motions, and settings of the starts.
SHARES = ["settled", "settled_share", "motion_count", "largest_share", "period"]
SETTINGS = ("periods", "record_periods", "starts", "first_starts", "seed", "spread")
#: Displacement, static deflections, that is larger than rounding and below any measurement.
_TINY = 1e-9
#: Distance, static deflections, below which a motion that comes nearer to an orbit ends on it.
_NEAR = 0.3
#: Searches without an orbit after which no other is begun at a tuning.
_MAX_FAILURES = 3


def starts(model, state, settings):
    """Return the state of a model with seeded displacements added, shape (starts, size).

    `settings` hold starts, seed, and spread, the largest displacement in static deflections.
    """
    state = np.asarray(model.start_state(state) if isinstance(state, str) else state, float)
    half = state.size // 2
    states = np.tile(state, (settings["starts"], 1))
    # Of bodies: natural modes of equal frequency have no shapes of their own.
    random = np.random.default_rng(settings["seed"]).uniform(-1.0, 1.0, (len(states), half))
    states[:, :half] += settings["spread"] * random
    return states


def beside(state):
    """Return a state next to another, by more than rounding and less than any measurement."""
    return state + _TINY * np.cos(1.0 + np.arange(len(state)) ** 2.0)


def over_starts(dataset, names):
    """Return name, name_low and name_high -> median and range over the starts that could go on."""
    ranges = {}
    with warnings.catch_warnings():
        # The median of nothing is NaN, which needs no warning.
        warnings.simplefilter("ignore", RuntimeWarning)
        for name in names:
            ranges[name] = dataset[name].median("start", skipna=True)
            ranges[f"{name}_low"] = dataset[name].min("start", skipna=True)
            ranges[f"{name}_high"] = dataset[name].max("start", skipna=True)
    return ranges


class Ends(NamedTuple):
    """Ends of the motions from some starts, each over the first axis."""

    tables: np.ndarray  #: summaries as in `Model.empty_record`, of orbits where there is one
    orbits: np.ndarray  #: number of the stable orbit in the order found, -1: none
    periods: np.ndarray  #: in mesh periods, 0: none
    states: np.ndarray  #: at the end, at a multiple of the common period
    codes: np.ndarray  #: `gearlib.data.status`

    @property
    def settled(self):
        """Whether all motions end on one orbit."""
        return bool((self.orbits == 0).all())


class _Search:
    """Search for the stable orbits of a model at one tuning on which motions end."""

    def __init__(self, model, tuning, settings):
        self.model, self.tuning = model, tuning
        self.propagator = model.propagator(tuning)
        self.recorded, self.near = settings["record_periods"], 2.0 * settings["spread"]
        #: Mesh periods of either half of a run; at their ends all orbits are in one phase.
        twice = 2 * model.repeats
        self.half = -(-max(settings["periods"], 2 * self.recorded) // (2 * twice)) * twice
        #: Period, states at its cycles, and summary of each orbit.
        self.orbits: list = []
        self.failures = 0
        try:
            reduce, lift = model.reduction()
            self.without_rotation = lift @ reduce
        except ValueError:
            # The free rotation is damped: it comes to rest as all other motions.
            self.without_rotation = np.eye(model.size)

    def run(self, state, periods, recorded):
        return self.propagator.run(state, Span(periods, recorded, MAX_EVENTS), keep_events=False)

    def end(self, start):
        """Return (summary, orbit, period, state, status) of the motion from a start."""
        middle = end = self.run(np.array(start, float), self.half, 1)
        if middle.status == status.OK:
            end = self.run(middle.state, self.half, self.recorded)
        if end.status != status.OK:
            return np.full_like(end.summary, np.nan), -1, 0, np.full(len(start), np.nan), end.status
        number = self.nearest(middle.state, end.state)
        steady = end.period or self.distance(middle.state, end.state) < _NEAR
        if number < 0 and steady and self.failures < _MAX_FAILURES:
            number = self.find(middle.state, end)
            self.failures += number < 0
        if number < 0:
            return end.summary, -1, 0, end.state, end.status
        period, states, table = self.orbits[number]
        return table, number, period, states[0], end.status

    def distance(self, state, other):
        return np.abs(self.without_rotation @ (state - other)).max()

    def nearest(self, middle, end):
        """Return the number of the orbit that a motion comes nearer to, -1 if there is none."""
        for number, (_, states, _) in enumerate(self.orbits):
            now, before = (min(self.distance(z, state) for state in states) for z in (end, middle))
            if now < _NEAR and (now < before or now < self.near):
                return number
        return -1

    def find(self, middle, end):
        """Return the number of a new orbit on which a motion ends, -1 if there is none."""
        cycle = self.model.repeats
        repeated = end.period and end.period % cycle == 0
        for period in [end.period] if repeated else [cycle, 2 * cycle]:
            try:
                orbit = periodic_orbit(self.model, self.tuning, guess=end.state, period=period)
                stable, state, period = orbit.stable, orbit.state, orbit.period
            except NoOrbit:
                continue
            except ValueError:
                # Newton's method refuses a damped free rotation: only the run tells.
                stable, state = bool(repeated), end.state
            if not stable:
                continue
            states = [state]
            while len(states) < period // cycle:
                states.append(self.run(states[-1], cycle, 1).state)
            table = self.run(state, self.recorded, self.recorded).summary
            self.orbits.append((period, states, table))
            if self.nearest(middle, end.state) == len(self.orbits) - 1:
                return len(self.orbits) - 1
            self.orbits.pop()
        return -1


def ends(model, tuning, states, settings):
    """Return the `Ends` of the motions from some states, shape (k, size), at one tuning.

    Where the first_starts of `settings` end on one orbit, the others are taken to end there too.
    """
    search, first = _Search(model, tuning, settings), settings["first_starts"]
    rows = [search.end(state) for state in states[:first]]
    if all(number == 0 for _, number, *_ in rows):
        rows += rows[:1] * len(states[first:])
    else:
        rows += [search.end(state) for state in states[first:]]
    if len(search.orbits) > 1:
        # A motion whose end a tiny change of its start decides ends on no orbit.
        for i, state in enumerate(states):
            table, number, _, end, code = rows[i]
            if search.end(beside(state))[1] != number:
                rows[i] = table, -1, 0, end, code
    return Ends(*map(np.array, zip(*rows, strict=True)))


def from_equilibrium(model, tunings, settings):
    """Return the `Ends` of the motions from all starts beside static equilibrium, by tuning."""
    states = starts(model, "static", settings)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(lambda nu: ends(model, float(nu), states, settings), tunings))


def carried(model, tunings, settings, direction):
    """Return the `Ends` of one start that carries its motion up or down, by tuning.

    A run begins beside the end of the one before, by the displacements of the first start; behind a
    motion that did not settle it begins beside static equilibrium.
    """
    first = starts(model, "static", settings | {"starts": 1})
    displacement = first - model.start_state("static")
    order, begin = np.argsort(tunings), first
    motion_ends = [None] * len(order)
    for i in order if direction == "up" else order[::-1]:
        motion_ends[i] = ends(model, float(tunings[i]), begin, settings)
        begin = motion_ends[i].states + displacement if motion_ends[i].settled else first
    return motion_ends


def summarise(model, motion_ends, settings, names):
    """Return summaries over start, tuning and mesh, and the `SHARES` of the starts over tuning.

    `motion_ends` are the `Ends` at each tuning, `names` summaries of `gearlib.sweep`.
    """
    columns = (np.stack(column, axis=1) for column in zip(*motion_ends, strict=True))
    tables, orbits, periods, states, codes = columns
    facts = np.stack([periods, codes], axis=-1)
    dims, recorded = ("start", "tuning"), settings["record_periods"]
    variables = summary.variables(model, dims, tables, states, facts, recorded)
    counts = [np.unique(row[row >= 0], return_counts=True)[1] for row in orbits.T]
    settled = np.array([end.settled for end in motion_ends])
    shares = {
        "settled": settled.astype(np.int8),
        "settled_share": (orbits >= 0).mean(axis=0),
        "motion_count": np.array([len(count) for count in counts], np.int32),
        "largest_share": np.array([max(count, default=0) for count in counts]) / len(orbits),
        "period": np.where(settled, periods[0], 0).astype(np.int32),
    }
    dataset = xr.Dataset(
        {name: variables[name] for name in names}
        | {name: ("tuning", values) for name, values in shares.items()}
    )
    dataset["settled"].attrs |= SETTLED_FLAGS
    return dataset


def over_directions(model, tunings, settings, names):
    """Return medians, ranges and shares of the motions over direction, tuning and mesh.

    Cold motions begin at all starts, those up and down carry the first one and are NaN where it
    does not settle. Return also the summaries of the single starts for each direction.
    """
    single_starts, parts = [], []
    for direction in DIRECTIONS:
        cold = direction == "cold"
        motion_ends = (
            from_equilibrium(model, tunings, settings)
            if cold
            else carried(model, tunings, settings, direction)
        )
        single = summarise(model, motion_ends, settings, (*names, "fraction_inverse"))
        ranges = over_starts(single, names)
        if not cold:
            ranges = {name: values.where(single.settled == 1) for name, values in ranges.items()}
        single_starts.append(single)
        parts.append(single[SHARES].assign(ranges))
    directions = xr.DataArray(list(DIRECTIONS), dims="direction", name="direction")
    return xr.concat(parts, directions, combine_attrs="override"), single_starts
