"""Find the orbits on which motions from many random initial states settle.

The long-term motion of a chaotic model depends on the last digit of its initial state. Results are
therefore stable periodic orbits, refined by Newton's method from the end of a run, or medians,
ranges and fractions over many initial states. `settings` has keys of the configuration: starts
(number of initial states), first_starts (if these settle on one orbit, the others are not run),
seed, spread (largest random displacement in units of the static deflection), periods and
record_periods (numbers of computed and of evaluated mesh periods).
"""

import math
import os
import warnings
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from gearlib.analysis.orbits.shooting import NoOrbit, periodic_orbit
from gearlib.data import status, summary
from gearlib.engines.orbit import Span
from gearlib.runs.run_arguments import MAX_EVENTS
from gearlib.runs.sweeping import DIRECTIONS

#: Attributes of the variable settled.
SETTLED_FLAGS = status.flag_attributes(("unsettled", "all_starts_on_one_stable_orbit"))
#: Whether all starts end on one orbit, fraction of starts that end on stable orbits, number of
#: these orbits, fraction of starts on the most frequent one, and period of the common orbit (0:
#: none).
DISTRIBUTION_VARIABLES = ["settled", "settled_share", "motion_count", "largest_share", "period"]
SETTINGS = ("periods", "record_periods", "starts", "first_starts", "seed", "spread")
#: Perturbation in static deflections, larger than rounding errors but not measurable.
_TINY_DISPLACEMENT = 1e-9
#: A motion closer to an orbit than this distance, in static deflections, may end on it.
_CAPTURE_DISTANCE = 0.3
#: Largest number of unsuccessful searches for an orbit at one tuning.
_MAX_FAILED_SEARCHES = 3


def random_initial_states(model: Any, state: ArrayLike | str, settings: dict) -> np.ndarray:
    """Return random initial states near `state`, shape (starts, state size).

    `state` is an array of coordinates and their velocities, or the name "static" or "rest".
    `settings` has the keys starts (number of states), seed, and spread (largest random displacement
    in units of the static deflection). Velocities are not changed.
    """
    if isinstance(state, str):
        state = model.start_state(state)
    state = np.asarray(state, float)
    coordinate_count = state.size // 2
    states = np.tile(state, (settings["starts"], 1))
    # Modes are not displaced, because their shapes are not unique if frequencies are equal.
    generator = np.random.default_rng(settings["seed"])
    displacements = generator.uniform(-1.0, 1.0, (len(states), coordinate_count))
    states[:, :coordinate_count] += settings["spread"] * displacements
    return states


def perturb_state(state: np.ndarray) -> np.ndarray:
    """Return a copy of a state with a perturbation that is tiny but exceeds rounding errors.

    If the motion from this state settles on another orbit, the result is not reproducible.
    """
    # The pattern of cosines has no symmetry, so that it perturbs all modes.
    return state + _TINY_DISPLACEMENT * np.cos(1.0 + np.arange(len(state)) ** 2.0)


def median_and_range(dataset: xr.Dataset, names: Sequence[str]) -> dict[str, xr.DataArray]:
    """Return the median and the range of variables over the initial states.

    `names` are variables of `dataset` with the dimension "start". The median keeps the name of the
    variable; minimum and maximum are called <name>_low and <name>_high.
    """
    ranges = {}
    with warnings.catch_warnings():
        # numpy warns if all values are NaN.
        warnings.simplefilter("ignore", RuntimeWarning)
        for name in names:
            ranges[name] = dataset[name].median("start", skipna=True)
            ranges[f"{name}_low"] = dataset[name].min("start", skipna=True)
            ranges[f"{name}_high"] = dataset[name].max("start", skipna=True)
    return ranges


class FinalMotion(NamedTuple):
    """The motion on which a run settles; for several runs, each field is an array over the runs."""

    summary: np.ndarray  #: extrema and times as in `Model.empty_record`
    orbit: int | np.ndarray  #: index of the stable orbit in the order of discovery; -1: none
    period: int | np.ndarray  #: period of the orbit in mesh periods; 0: no orbit
    state: np.ndarray  #: state at the end of a multiple of the common period
    status: int | np.ndarray  #: code of `gearlib.data.status`

    @property
    def settled(self) -> bool:
        """Return whether all motions settle on the same orbit, which has the index 0."""
        return bool(np.all(self.orbit == 0))


class _Orbit(NamedTuple):
    """A stable periodic orbit on which motions settle."""

    period: int  #: in mesh periods
    states: list[np.ndarray]  #: states at the start of each common period of the meshes
    summary: np.ndarray  #: extrema and times as in `Model.empty_record`


class _OrbitSearch:
    """A search for the stable orbits of a model at one tuning on which motions settle."""

    def __init__(self, model: Any, tuning: float, settings: dict) -> None:
        """Prepare runs of a model at a tuning (mesh frequency over natural frequency).

        `settings` has the keys periods and record_periods (numbers of computed and of evaluated
        mesh periods) and spread (largest random displacement of an initial state, in units of the
        static deflection).
        """
        self.model, self.tuning = model, tuning
        self.propagator = model.propagator(tuning)
        self.record_periods = settings["record_periods"]
        self.max_start_distance = 2.0 * settings["spread"]  # between two initial states
        # Each half of a run lasts a multiple of twice the common period of the meshes, so that
        # orbits of one or two common periods have the same state at both ends.
        double_period = 2 * model.repeats  # mesh periods
        periods = max(settings["periods"], 2 * self.record_periods)
        self.half_periods = math.ceil(periods / (2 * double_period)) * double_period
        self.orbits: list[_Orbit] = []
        self.failed_searches = 0
        try:
            reduce, lift = model.reduction()
            self.rotation_filter = lift @ reduce  # removes rigid-body rotation from a state
        except ValueError:
            # A damped rigid-body rotation decays, so it is treated like other coordinates.
            self.rotation_filter = np.eye(model.size)

    def run(self, state: np.ndarray, periods: int, record_periods: int) -> Any:
        """Run the model from a state over a number of mesh periods.

        The summary of the result covers the last `record_periods` mesh periods.
        """
        span = Span(periods, record_periods, MAX_EVENTS)
        return self.propagator.run(state, span, keep_events=False)

    def final_motion(self, start: np.ndarray) -> FinalMotion:
        """Return the motion on which the run from the initial state `start` settles.

        The run has two halves. If it approaches a known orbit, this orbit is returned. If it seems
        to be periodic, an orbit is searched near its end. In all other cases the last mesh periods
        of the run itself are returned with the orbit index -1.
        """
        middle = end = self.run(np.array(start, float), self.half_periods, 1)
        if middle.status == status.OK:
            end = self.run(middle.state, self.half_periods, self.record_periods)
        # If the run stopped early, there is no motion.
        if end.status != status.OK:
            missing = np.full_like(end.summary, np.nan)
            return FinalMotion(missing, -1, 0, np.full(len(start), np.nan), end.status)
        index = self.index_of_approached_orbit(middle.state, end.state)
        is_steady = end.period or self.distance(middle.state, end.state) < _CAPTURE_DISTANCE
        if index < 0 and is_steady and self.failed_searches < _MAX_FAILED_SEARCHES:
            index = self.add_orbit(middle.state, end)
            self.failed_searches += index < 0
        if index < 0:
            return FinalMotion(end.summary, -1, 0, end.state, end.status)
        orbit = self.orbits[index]
        return FinalMotion(orbit.summary, index, orbit.period, orbit.states[0], end.status)

    def distance(self, state: np.ndarray, other: np.ndarray) -> float:
        """Return the largest difference between two states, ignoring rigid-body rotation.

        A rigid-body rotation does not deform any mesh, so it may differ on the same orbit.
        """
        return np.abs(self.rotation_filter @ (state - other)).max()

    def index_of_approached_orbit(self, middle: np.ndarray, end: np.ndarray) -> int:
        """Return the index of the known orbit that a motion approaches, or -1 if there is none.

        `middle` and `end` are the states after the first and the second half of the run. The motion
        must end within `_CAPTURE_DISTANCE` of the orbit. It must also either have come closer in
        the second half or end within the largest distance between initial states.
        """
        for index, orbit in enumerate(self.orbits):
            end_distance = min(self.distance(end, state) for state in orbit.states)
            middle_distance = min(self.distance(middle, state) for state in orbit.states)
            approaches = end_distance < middle_distance or end_distance < self.max_start_distance
            if approaches and end_distance < _CAPTURE_DISTANCE:
                return index
        return -1

    def add_orbit(self, middle: np.ndarray, end: Any) -> int:
        """Find and store the stable orbit on which a run settles; return its index, or -1.

        `middle` is the state after the first half of the run, and `end` the result of the second
        half. Newton's method starts from the final state. Orbits that the run does not approach are
        discarded.
        """
        common_period = self.model.repeats  # common period of all meshes, in mesh periods
        is_periodic = end.period and end.period % common_period == 0
        periods = [end.period] if is_periodic else [common_period, 2 * common_period]
        for period in periods:
            try:
                orbit = periodic_orbit(self.model, self.tuning, guess=end.state, period=period)
                is_stable, state, period = orbit.stable, orbit.state, orbit.period
            except NoOrbit:
                continue
            except ValueError:
                # Newton's method fails if rigid-body rotation is damped. A periodic run is then
                # regarded as a stable orbit.
                is_stable, state = bool(is_periodic), end.state
            if not is_stable:
                continue
            # Compute the states of the orbit at the start of each common period.
            states = [state]
            while len(states) < period // common_period:
                states.append(self.run(states[-1], common_period, 1).state)
            record = self.run(state, self.record_periods, self.record_periods)
            self.orbits.append(_Orbit(period, states, record.summary))
            if self.index_of_approached_orbit(middle, end.state) == len(self.orbits) - 1:
                return len(self.orbits) - 1
            self.orbits.pop()
        return -1


def find_final_motions(
    model: Any, tuning: float, states: np.ndarray, settings: dict
) -> FinalMotion:
    """Find the motions on which the runs from several initial states settle.

    `states` has the shape (starts, state size); `tuning` is mesh frequency over natural frequency.
    `settings` has the keys periods and record_periods (numbers of computed and of evaluated mesh
    periods), spread (largest random displacement of the states) and first_starts. If the runs from
    the first states, whose number is first_starts, settle on one orbit, the other runs are skipped
    and assumed to settle on it, too. Orbits are numbered in the order of discovery; -1 means none.
    """
    search = _OrbitSearch(model, tuning, settings)
    first_starts = settings["first_starts"]
    motions = [search.final_motion(state) for state in states[:first_starts]]
    if all(motion.orbit == 0 for motion in motions):
        motions += motions[:1] * len(states[first_starts:])
    else:
        motions += [search.final_motion(state) for state in states[first_starts:]]
    if len(search.orbits) > 1:
        # A motion is regarded as unsettled if a tiny perturbation leads to another orbit.
        for i, state in enumerate(states):
            if search.final_motion(perturb_state(state)).orbit != motions[i].orbit:
                motions[i] = motions[i]._replace(orbit=-1, period=0)
    return FinalMotion(*(np.array(column) for column in zip(*motions, strict=True)))


def find_motions_from_equilibrium(
    model, tunings: Sequence[float], settings: dict
) -> list[FinalMotion]:
    """Find the motions from random states around static equilibrium at each tuning.

    The tuning is mesh frequency over natural frequency. `settings` has the keys starts (number of
    random states), first_starts (if these settle on one orbit, the others are not run), seed,
    spread (largest random displacement), periods and record_periods (numbers of computed and of
    evaluated mesh periods).
    """
    states = random_initial_states(model, "static", settings)

    def motions_at(tuning: float) -> FinalMotion:
        """Find the motions from all initial states at one tuning."""
        return find_final_motions(model, float(tuning), states, settings)

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(motions_at, tunings))


def find_warm_started_motions(model, tunings, settings: dict, direction: str) -> list[FinalMotion]:
    """Find the motion at each tuning of a sweep in the `direction` "up" or "down".

    The tuning is mesh frequency over natural frequency. Each run starts near the end of the
    previous run or, if that run has not settled on an orbit, near static equilibrium. `settings`
    has the keys of `find_motions_from_equilibrium`; starts is not used.
    """
    start = random_initial_states(model, "static", settings | {"starts": 1})
    # The same random displacement is added to the initial state of each run.
    displacement = start - model.start_state("static")
    indices = np.argsort(tunings)
    if direction == "down":
        indices = indices[::-1]
    motions: list[Any] = [None] * len(indices)
    states = start
    for i in indices:
        motions[i] = find_final_motions(model, float(tunings[i]), states, settings)
        states = motions[i].state + displacement if motions[i].settled else start
    return motions


def build_motion_dataset(
    model: Any, motions: Sequence[FinalMotion], settings: dict, names: Sequence[str]
) -> xr.Dataset:
    """Return a dataset of motions over start, tuning and mesh, and their distribution over orbits.

    `motions` has one `FinalMotion` per tuning, with arrays over the initial states ("starts").
    `names` are variables of `gearlib.sweep`. `settings` has the key record_periods (number of
    evaluated mesh periods). In the dataset, settled_share is the fraction of starts that settle on
    stable orbits, motion_count the number of these orbits, and largest_share the fraction of starts
    on the most frequent orbit.
    """
    # The arrays have the shape (starts, tunings, ...).
    summaries = np.stack([motion.summary for motion in motions], axis=1)
    orbits = np.stack([motion.orbit for motion in motions], axis=1)
    periods = np.stack([motion.period for motion in motions], axis=1)
    states = np.stack([motion.state for motion in motions], axis=1)
    codes = np.stack([motion.status for motion in motions], axis=1)
    periods_and_codes = np.stack([periods, codes], axis=-1)
    variables = summary.summary_variables(
        model, ("start", "tuning"), summaries, states, periods_and_codes, settings["record_periods"]
    )
    # Count the starts on each orbit at each tuning; the index -1 means no orbit.
    start_counts = []
    for indices in orbits.T:
        _, counts = np.unique(indices[indices >= 0], return_counts=True)
        start_counts.append(counts)
    settled = np.array([motion.settled for motion in motions])
    distribution = {
        "settled": settled.astype(np.int8),
        "settled_share": (orbits >= 0).mean(axis=0),
        "motion_count": np.array([len(counts) for counts in start_counts], np.int32),
        "largest_share": np.array([max(counts, default=0) for counts in start_counts])
        / len(orbits),
        # All starts have the same period where the motion settles.
        "period": np.where(settled, periods[0], 0).astype(np.int32),
    }
    by_tuning = {name: ("tuning", values) for name, values in distribution.items()}
    dataset = xr.Dataset({name: variables[name] for name in names} | by_tuning)
    dataset["settled"].attrs |= SETTLED_FLAGS
    return dataset


def sweep_random_starts(
    model: Any, tunings: Sequence[float], settings: dict, names: Sequence[str]
) -> tuple[xr.Dataset, list[xr.Dataset]]:
    """Compute a sweep with medians, ranges and fractions over random initial states.

    `tunings` are mesh frequencies over the natural frequency, and `names` are variables of
    `gearlib.sweep`. In the direction "cold" the runs start from random states around static
    equilibrium. In the directions "up" and "down" a single run starts from the end of the previous
    one, and values are NaN where the motion does not settle. `settings` has the keys of
    `find_motions_from_equilibrium`. Return the sweep over direction, tuning and mesh, and a list
    with one result of `build_motion_dataset` per direction, which has the data of all states.
    """
    motions_by_direction = []
    directions = []
    for direction in DIRECTIONS:
        if direction == "cold":
            motions = find_motions_from_equilibrium(model, tunings, settings)
        else:
            motions = find_warm_started_motions(model, tunings, settings, direction)
        final_data = build_motion_dataset(model, motions, settings, (*names, "fraction_coast"))
        ranges = median_and_range(final_data, names)
        if direction != "cold":
            is_settled = final_data.settled == 1
            ranges = {name: values.where(is_settled) for name, values in ranges.items()}
        motions_by_direction.append(final_data)
        directions.append(final_data[DISTRIBUTION_VARIABLES].assign(ranges))
    axis = xr.DataArray(list(DIRECTIONS), dims="direction", name="direction")
    return xr.concat(directions, axis, combine_attrs="override"), motions_by_direction
