"""Where motions from many starts end: on which stable orbit, or on none.

What rounding decides is no result. So every motion begins at seeded starts of physical size, and
what is said of it is said of a stable periodic orbit, found to rounding by Newton's method from
where the run came to. Starts that end on one such orbit share one motion. Motions that end on none,
slow ones and chaos, are told by their range over all starts; so are motions of which the start
alone, moved by less than anything that can be measured, decides where they end.
"""

from typing import NamedTuple

import numpy as np
import xarray as xr

from gearlib.analysis.orbits.shooting import NoOrbit, periodic_orbit
from gearlib.data import status, summary
from gearlib.engines.orbit import Span
from gearlib.runs.run_arguments import MAX_EVENTS
from gearlib.studies.many_starts import beside, in_parallel, over_starts, starts

#: What `settled` says.
SETTLED_FLAGS = status.flags_of(("unsettled", "all_starts_on_one_stable_orbit"))
#: Names of what `summarise` says of the motions, and of the settings.
SHARES = ["settled", "settled_share", "motion_count", "largest_share", "period"]
SETTINGS = ("periods", "record_periods", "starts", "first_starts", "seed", "spread")
#: A run that ends so near to a stable orbit, and came nearer, settles on it; one that changes by
#: more over its record is near none. Static deflections.
_NEAR = 0.3
#: Multiples of the common period of all meshes that an orbit is looked for with.
_MULTIPLES = (1, 2)
#: Searches without an orbit after which no other is begun at a tuning.
_SEARCHES = 3


class Ends(NamedTuple):
    """Where the motions from some starts end, each over the first axis."""

    tables: np.ndarray  #: summaries as in `Model.empty_record`, of orbits where there is one
    orbits: np.ndarray  #: number of the stable orbit in the order found, -1: none
    periods: np.ndarray  #: in mesh periods, 0: none
    states: np.ndarray  #: at the end, at a multiple of the common period
    codes: np.ndarray  #: `gearlib.data.status`

    @property
    def settled(self):
        """Whether all of them end on one orbit."""
        return bool((self.orbits == 0).all())


class _Tuning:
    """A model at one tuning, and the stable orbits that were found there."""

    def __init__(self, model, tuning, settings):
        self.model, self.tuning = model, tuning
        self.propagator = model.propagator(tuning)
        #: Takes free rotations out of a state.
        self.bend, self.neutral = np.eye(model.size), True
        try:
            reduce, lift = model.reduction()
            self.bend = lift @ reduce
        except ValueError:
            # Its free rotation is not neutral: Newton's method does not take such a train.
            self.neutral = False
        self.recorded, cycles = settings["record_periods"], _MULTIPLES[-1] * model.repeats
        #: Orbits of all multiples are in one phase in the middle and at the end of a run.
        half = -(-max(settings["periods"], 2 * self.recorded) // (2 * cycles)) * cycles
        self.marks = half, 2 * half - self.recorded, 2 * half
        self.orbits: list = []
        self.searches = 0
        #: Deviations of this size stay small beside a stable orbit.
        self.near = 2.0 * settings["spread"]

    def _run(self, z, periods, recorded, first):
        span, first = Span(periods, recorded, MAX_EVENTS), first % self.model.repeats
        return self.propagator.run(z, span, first=first, keep_events=False)

    def course(self, start):
        """Return (table, period, middle, end, status) of a motion: two states on its way."""
        z, first, states = np.array(start, float), 0, np.full((3, np.size(start)), np.nan)
        for i, until in enumerate(self.marks):
            periods = until - first
            if periods:
                record = self._run(z, periods, periods, first)
                if record.status != status.OK:
                    nothing = np.full_like(record.summary, np.nan)
                    return nothing, 0, states[0], states[-1], record.status
                z = record.state
            states[i], first = z, until
        return record.summary, record.period, states[0], states[-1], record.status

    def end(self, start):
        """Return (table, orbit, period, state, status) of the motion from a start."""
        table, period, half, z, code = self.course(start)
        if code != status.OK:
            return table, -1, 0, z, code
        number = self._known(half, z)
        near = period or self.apart(half, z) < _NEAR
        if number < 0 and near and self.searches < _SEARCHES:
            number = self._new(period, half, z)
            self.searches += number < 0
        if number >= 0:
            found, points, own = self.orbits[number]
            return own, number, found, points[0], code
        return table, -1, 0, z, code

    def apart(self, one, other):
        return np.abs((one - other) @ self.bend.T).max()

    def _known(self, half, end):
        """Return the number of the orbit that a motion comes nearer to, -1 if there is none."""
        for number, (_, points, _) in enumerate(self.orbits):
            now, then = (min(self.apart(z, point) for point in points) for z in (end, half))
            if now < _NEAR and (now < then or now < self.near):
                return number
        return -1

    def _new(self, period, half, end):
        """Return the number of a new orbit from where a motion has come to, -1: there is none."""
        cycle = self.model.repeats
        wanted = (
            [period]
            if period and not period % cycle
            else [cycle * multiple for multiple in _MULTIPLES]
        )
        # Without Newton's method only a run that repeats has an orbit.
        wanted = wanted if period or self.neutral else []
        for one in wanted:
            state, one = self._orbit(one, end)
            if state is None:
                continue
            z, points = state, []
            for _ in range(one // cycle):
                points.append(z)
                z = self._run(z, cycle, 1, 0).state
            own = self._run(state, self.recorded, self.recorded, 0).summary
            self.orbits.append((one, points, own))
            if self._known(half, end) == len(self.orbits) - 1:
                return len(self.orbits) - 1
            self.orbits.pop()
        return -1

    def _orbit(self, period, end):
        """Return (state at tau = 0 or None, period) of the stable orbit next to a state."""
        if not self.neutral:
            return end.copy(), period
        try:
            orbit = periodic_orbit(self.model, self.tuning, guess=end, period=period)
        except NoOrbit:
            return None, period
        return orbit.state if orbit.stable else None, orbit.period


def ends(model, tuning, states, settings):
    """Return where the motions from these states end at one tuning.

    states: shape (k, size); settings (periods, record_periods: of every run, in mesh periods,
    rounded up to whole repeats; first_starts: where so many of the states end on one stable orbit,
    the others are taken to end there too).
    """
    here, found = _Tuning(model, tuning, settings), []
    for i, state in enumerate(states):
        if i == settings["first_starts"] and all(row[1] == 0 for row in found):
            found += found[:1] * (len(states) - i)
            break
        found.append(here.end(state))
    if len(here.orbits) > 1:
        for i, state in enumerate(states):
            if found[i][1] != here.end(beside(state))[1]:
                found[i] = (found[i][0], -1, 0, *found[i][3:])
    return Ends(*(np.array(column) for column in zip(*found, strict=True)))


def from_rest(model, tunings, settings, state="static"):
    """Return where the motions from all starts end, tuning by tuning: a list of `Ends`.

    tunings: shape (t,); settings: as in `starts` and `ends`; state: beside which the starts lie.
    """
    begin = starts(model, state, settings)
    return in_parallel(lambda nu: ends(model, float(nu), begin, settings), tunings)


def carried(model, tunings, settings, direction, state="static"):
    """Return the same for one start that carries its motion from tuning to tuning.

    Every run begins where the one before ended, with the displacements of the first start of
    `starts` added; behind a motion that did not settle it begins from rest.

    model, tunings, settings, state: as in `from_rest`; direction: {"up", "down"}.
    """
    first = starts(model, state, settings | {"starts": 1})
    away = first - (model.start_state(state) if isinstance(state, str) else state)
    order, begin = np.argsort(tunings), first
    found = [None] * len(order)
    for i in order if direction == "up" else order[::-1]:
        here = found[i] = ends(model, float(tunings[i]), begin, settings)
        begin = here.states + away if here.settled else first
    return found


def summarise(model, found, settings, names):
    """Return the medians and ranges of summaries over all starts, and the shares of motions.

    found: of each tuning, with equal numbers of starts; settings: record_periods; names: summaries
    as in `gearlib.sweep`.

    Over (start, tuning) and mesh: the summaries. Over (tuning,): settled; settled_share, of the
    starts that end on a stable orbit; motion_count, of different ones; largest_share, of the one on
    which most starts end; period, 0 unless settled.
    """
    tables, orbits, periods, states, codes = (
        np.stack(column, axis=1) for column in zip(*found, strict=True)
    )
    both = np.stack([periods, codes], axis=-1)
    every = summary.variables(
        model, ("start", "tuning"), tables, states, both, settings["record_periods"]
    )
    counts = [np.unique(row[row >= 0], return_counts=True)[1] for row in orbits.T]
    settled = np.array([one.settled for one in found])
    shares = {
        "settled": settled.astype(np.int8),
        "settled_share": (orbits >= 0).mean(axis=0),
        "motion_count": np.array([len(one) for one in counts], np.int32),
        "largest_share": np.array([max(one, default=0) for one in counts]) / len(orbits),
        "period": np.where(settled, periods[0], 0).astype(np.int32),
    }
    dataset = xr.Dataset(
        {name: every[name] for name in names}
        | {name: ("tuning", values) for name, values in shares.items()}
    )
    dataset["settled"].attrs |= SETTLED_FLAGS
    return dataset


def over_directions(model, tunings, settings, names, directions):
    """Return medians, ranges and shares over direction, tuning and mesh, and all starts of each.

    tunings: shape (t,); settings: as in `starts` and `ends`; names: summaries as of
    `gearlib.sweep`; directions ({"cold", "up", "down"}, "cold": beside static equilibrium, from all
    starts; the others carry the first).

    The summaries with their _low and _high, and the shares of `summarise`; what that gives,
    direction by direction, with fraction_inverse. Where a carried motion did not settle its numbers
    are NaN.
    """
    every, own = [], []
    for direction in directions:
        if direction == "cold":
            found = from_rest(model, tunings, settings)
        else:
            found = carried(model, tunings, settings, direction)
        one = summarise(model, found, settings, (*names, "fraction_inverse"))
        values = over_starts(one, names)
        if direction != "cold":
            values = {name: kept.where(one.settled == 1) for name, kept in values.items()}
        every.append(one)
        own.append(one[SHARES].assign(values))
    coordinate = xr.DataArray(list(directions), dims="direction", name="direction")
    return xr.concat(own, coordinate, combine_attrs="override"), every
