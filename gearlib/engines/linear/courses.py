"""Runs along a speed and a load profile: run-ups, run-downs, steps and ramps of torque.

Between switches of stiffness the equations of motion in theta, the time of the model, do not depend
on the speed: a piece of constant acceleration has the matrices of a run at constant speed and
switches at other instants. With the mesh phase tau = tau_0 + nu_0 theta + a theta^2 / 2 the time
between two switches is 2 dtau / (nu_1 + nu_2), nu^2 = nu_0^2 + 2 a (tau - tau_0): no digits cancel,
and a = 0 gives the segments of a run at constant speed. The inertia of the acceleration and steps
of the load change the constant of the state; a ramp of the load adds a component that grows by 1 in
a unit of theta.
"""

import math
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from gearlib.engines import orbit
from gearlib.engines.codes import OK
from gearlib.engines.linear import one_mesh, propagator
from gearlib.engines.linear.periods import EVENT_COLUMNS
from gearlib.engines.linear.record import SUMMARY_COLUMNS
from gearlib.engines.linear.sparse_series import sparse_fields
from gearlib.engines.linear.train_system import TrainSystem

#: Number of mesh periods for which segments are computed at a time.
_PERIODS_AT_A_TIME = 512
#: Phases closer than this share of the whole phase count as equal.
_SAME_PHASE_TOLERANCE = 1e-12
#: Share of a mesh period far from all ratios of small integers: the golden section.
_GOLDEN_SECTION = 0.3819660112501051
#: Cost of modes, in steps of the series, that no run reaches.
_UNREACHABLE_COST = 2**62


class Piece(NamedTuple):
    """An interval of a speed and load profile in which both are linear in theta."""

    start: float  #: theta at its start
    length: float  #: its duration in theta
    phase: float  #: mesh phase tau at its start, rad
    speed: float  #: tuning nu at its start
    acceleration: float  #: dnu/dtheta, constant
    load: float  #: load at its start, as a share of the nominal load
    slope: float  #: derivative of the load by theta

    def speed_at(self, phase: float | np.ndarray) -> np.ndarray:
        """Return the tuning nu at mesh phases tau (rad) within the piece."""
        squared_speed = self.speed**2 + 2.0 * self.acceleration * (phase - self.phase)
        return np.sqrt(np.maximum(squared_speed, 0.0))

    def by(self, theta: float | np.ndarray) -> tuple:
        """Return (tuning nu, mesh phase tau, share of the nominal load) at times theta."""
        elapsed = theta - self.start
        speed = np.maximum(self.speed + self.acceleration * elapsed, 0.0)
        phase = self.phase + 0.5 * (self.speed + speed) * elapsed
        return speed, phase, self.load + self.slope * elapsed


class Stretch(NamedTuple):
    """Record of k intervals of a run: mesh periods, cut where pieces of the profiles end."""

    piece: Piece
    phase: np.ndarray  #: tau at the bounds of the intervals, shape (k + 1,)
    theta: np.ndarray  #: theta at the bounds of the intervals, shape (k + 1,)
    samples: np.ndarray  #: columns of `orbit`, shape (j, m, 6)
    states: np.ndarray  #: coordinates and their rates by theta, shape (j, 2 N)
    block: np.ndarray  #: int, number of the block of each interval, shape (k,)
    summary: np.ndarray  #: extrema and contact times of each block, shape (b, m, 10)
    #: (theta, mesh, from, to, velocity by theta, interval, theta in it), shape (i, 7)
    events: np.ndarray
    status: int


def pieces_of(model: Any, speeds: np.ndarray, loads: np.ndarray) -> list[Piece]:
    """Split a speed and a load profile of a model into pieces on which both are linear.

    `speeds`, shape (j, 2), has the columns time in s and speed in rpm; `loads`, shape (k, 2), time
    in s and share of the nominal load. Two loads at one time are a step; the last load holds to
    the end of the speeds.
    """
    scales = np.array([float(model.mesh_frequency(1.0)), 1.0])  # theta for one second, and 1
    speeds, loads = speeds * scales, loads * scales
    speeds[:, 1] = [model.tuning_at(rpm) if rpm else 0.0 for rpm in speeds[:, 1]]
    times = np.union1d(speeds[:, 0], loads[:, 0])
    times = times[(times >= speeds[0, 0]) & (times <= speeds[-1, 0])]
    pieces, phase = [], 0.0
    for start, end in zip(times[:-1].tolist(), times[1:].tolist(), strict=True):
        speed, acceleration = _value_and_slope(speeds, start)
        load, slope = _value_and_slope(loads, start)
        piece = Piece(start, end - start, phase, speed, acceleration, load, slope)
        pieces.append(piece)
        phase += piece.length * (speed + 0.5 * acceleration * piece.length)
    return pieces


def start_course(model, speeds, loads, state):
    """Return (propagator, list of `Piece`, state z) at the start of a speed and load profile.

    `speeds` and `loads` are those of `pieces_of`; the velocities in `state`, by phase, become
    velocities by theta in z.
    """
    runner, pieces = propagator_of(model), pieces_of(model, speeds, loads)
    z = np.array(runner.start(state), float)
    z[z.size // 2 :] *= pieces[0].speed
    return runner, pieces, z


def _value_and_slope(profile: np.ndarray, time: float) -> tuple[float, float]:
    """Return value and slope, just after `time`, of a piecewise linear profile of (time, value)."""
    i = int(np.searchsorted(profile[:, 0], time, side="right")) - 1
    if i < 0:
        return float(profile[0, 1]), 0.0
    if i == len(profile) - 1:
        return float(profile[-1, 1]), 0.0
    (start, value), (end, end_value) = profile[i : i + 2].tolist()
    slope = (end_value - value) / (end - start)
    return value + slope * (time - start), slope


def run_course(runner, pieces, state, samples, limit, inertia, teeth):
    """Run the propagator `runner` through a list of `Piece`; yield `Stretch`es up to a failure.

    `state`, shape (2 N,), has velocities by theta and changes in place. Each mesh period has
    `samples` samples at equal steps of time and at most `limit` contact events. `inertia`, shape
    (N,), is the acceleration by theta that d2tau/dtheta2 = 1 causes. A summary is made for every
    `teeth` mesh periods.
    """
    for piece in pieces:
        runner.enter(piece, inertia)
        for cut in _cuts(runner, piece, teeth):
            stretch = runner.through(piece, state, cut, samples, limit)
            yield stretch
            if stretch.status != OK:
                return


class Cut(NamedTuple):
    """Intervals of a piece: mesh periods, of which the first and last end with the piece."""

    phase: np.ndarray  #: tau - offset at the bounds of segments, shape (p + 1,)
    offset: float  #: tau from which `phase` counts
    first: np.ndarray  #: int, first segment of each interval, shape (k + 1,)
    segments: np.ndarray  #: int, numbers of the segments in `source`, shape (p,)
    source: Any  #: the `TrainSystem` that has their stiffness
    turn: np.ndarray  #: int, number of repeats of `source` before each segment, shape (p,)
    block: np.ndarray  #: int, numbers of the blocks of the intervals, shape (k,)
    begins: bool  #: whether the first interval begins with the piece
    ends: bool  #: whether the last interval ends with the piece

    def speeds(self, piece: Piece) -> np.ndarray:
        """Return the tuning nu at the bounds of the p segments in a `Piece`, shape (p + 1,)."""
        speeds = piece.speed_at(self.offset + self.phase)
        # Near standstill the root of a difference loses half of its digits, so that the speeds at
        # the ends of the piece are computed without it.
        if self.begins:
            speeds[0] = piece.speed
        if self.ends:
            speeds[-1] = max(piece.speed + piece.acceleration * piece.length, 0.0)
        return speeds

    def lengths(self, piece: Piece) -> np.ndarray:
        """Return the durations in theta of the p segments in a `Piece`, shape (p,)."""
        speeds = self.speeds(piece)
        speed_sums = speeds[:-1] + speeds[1:]
        if speed_sums.any():
            return 2.0 * np.diff(self.phase) / speed_sums
        return np.array([piece.length])

    def within(self, length: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return (starts, ends) of all segments in theta since the start of their interval.

        `length`, shape (p,), has the durations of the segments. Each interval is summed on its own,
        so that rounding does not grow with the run.
        """
        position = np.arange(length.size) - np.repeat(self.first[:-1], np.diff(self.first))
        end = length.copy()
        for k in range(1, position.max() + 1):
            later = np.flatnonzero(position == k)
            end[later] += end[later - 1]
        return np.where(position > 0, np.roll(end, 1), 0.0), end

    def bounds(self, piece: Piece, length: np.ndarray) -> np.ndarray:
        """Return theta at the bounds of the k intervals, from the segments' `length`s, (k + 1,)."""
        start = piece.start
        if not self.begins:
            phase = self.offset + self.phase[0]
            start += 2.0 * (phase - piece.phase) / (piece.speed + float(piece.speed_at(phase)))
        return start + np.concatenate([[0.0], np.cumsum(length)])[self.first]


def _cuts(runner, piece, teeth):
    """Yield the intervals of a `Piece` as `Cut`s, a limited number of mesh periods at a time.

    `runner` is the propagator; `teeth` is the number of mesh periods of a summary block.
    """
    base, long = runner.laws, runner.long
    end = piece.phase + piece.length * (piece.speed + 0.5 * piece.acceleration * piece.length)
    tau, repeats = 2.0 * math.pi, len(base.first_segment) - 1  # tau: one mesh period in rad
    tolerance = _SAME_PHASE_TOLERANCE * max(end, 1.0)
    count = _PERIODS_AT_A_TIME if long else max(_PERIODS_AT_A_TIME // repeats, 1) * repeats
    first, is_first = int((piece.phase + tolerance) / tau) // count * count, True
    while True:
        source = runner.model.system(1.0, first, count) if long else base
        times, size = 1 if long else count // repeats, source.starts.size - 1
        segment_numbers, repeat = np.tile(np.arange(size), times), np.arange(times)
        bounds = np.append(
            (repeat[:, None] * source.starts[-1] + source.starts[:-1]).ravel(), tau * count
        )
        period_starts = (repeat[:, None] * size + source.first_segment[:-1]).ravel()
        start_phase, end_phase = piece.phase - tau * first, end - tau * first
        # The piece consists of the segments i to j - 1.
        i = max(int(np.searchsorted(bounds, start_phase + tolerance, side="right")) - 1, 0)
        j = min(int(np.searchsorted(bounds, end_phase - tolerance)), segment_numbers.size)
        j = max(j, i + 1)
        phase = bounds[i : j + 1].copy()
        phase[0], last_phase = max(phase[0], start_phase), min(phase[-1], end_phase)
        phase[-1] = max(last_phase, start_phase)
        period_starts = np.array(
            [0, *(period_starts[(period_starts > i) & (period_starts < j)] - i), j - i]
        )
        middles = (phase[period_starts[:-1]] + phase[period_starts[1:]]) / 2.0 + tau * first
        # A mesh period belongs to the block that contains its phase at the golden section, where no
        # block begins for any ratio of tooth numbers, so that rounding does not decide.
        block = ((np.floor(middles / tau) + _GOLDEN_SECTION) / teeth).astype(int)
        turns = np.arange(i, j) // size
        is_last = tau * (first + count) >= end - tolerance
        intervals = period_starts, segment_numbers[i:j], source, turns, block
        yield Cut(phase, tau * first, *intervals, is_first, is_last)
        first, is_first = first + count, False
        if is_last:
            return


class _Course:
    """Mixin that lets a propagator run through the pieces of a speed and load profile."""

    system: Any
    grid: Any
    model: Any
    long: Any
    description: Any = "closed forms"
    raw: Any
    fill_record: Any
    fill_meshes: Any

    @property
    def meshes(self):
        """Number of meshes of the model."""
        return len(self.laws.drive_lines)

    def ahead(self, first, done, spans):
        """Return (system, grid, number of periods) of the present `Cut`; see `Propagator.ahead`."""
        return self.system, self.grid, spans[0]

    def enter(self, piece: Piece, inertia: np.ndarray) -> None:
        """Set the loads and the acceleration of a `Piece`; `inertia` is as in `run_course`."""
        self.loaded = _loaded(self.bare, piece, inertia)
        if self.laws.harmonics.size:
            self.loaded.base_matrix[self.model.size, -1] = piece.acceleration
        # The old tables may have another number of state components.
        self.spare, self.large = [], []

    @cached_property
    def laws(self):
        """`TrainSystem` of the model before loads and segments of the profiles are set."""
        return self.system

    @cached_property
    def bare(self):
        """`laws`; its harmonics, if any, follow a phase that is quadratic in theta."""
        if not self.laws.harmonics.size:
            return self.laws
        first = (0, self.laws.first_segment.size - 1) if self.long else ()
        return _chirped(self.laws, self.model.system(2.0, *first), self.model.size)

    def taken(self):
        """Return mode tables for one run; while harmonics change speed, only series apply."""
        tables = super().taken()  # type: ignore[misc]
        if self.laws.harmonics.size:
            tables.mode_cost[0] = _UNREACHABLE_COST
        return tables

    def _driven_components(self, piece: Piece, cut: Cut, theta: float) -> list[float]:
        """Return the state components between velocities and constant at the start of a `Cut`.

        These are the speed and the harmonics, if there are any, and the change of the load since
        the start of the `Piece`, if it has a slope; `theta` is the time there.
        """
        mesh_period = round(cut.offset / math.tau) % self.model.repeats
        values, phase = [], cut.phase[0] + math.tau * mesh_period
        if self.laws.harmonics.size:
            nu = float(cut.speeds(piece)[0])
            values.append(nu)
            for w in self.laws.harmonics:
                c, s = math.cos(w * phase), math.sin(w * phase)
                values += [c, s, -w * nu * s, w * nu * c]
        if piece.slope:
            values.append(piece.slope * (theta - piece.start))
        return values

    def _set_segments(self, cut: Cut, length: np.ndarray, sample_starts: np.ndarray) -> None:
        """Set system and grid to the p segments of a `Cut`, whose durations `length` are in theta.

        `sample_starts` has the index of the first sample of each interval.
        """
        system, starts = self.loaded, np.concatenate([[0.0], np.cumsum(length)])
        tables = {
            name: np.ascontiguousarray(getattr(cut.source, name)[:, cut.segments])
            for name in ("effect", "stiffness", "low")
        }
        segments = {"starts": starts, "first_segment": cut.first, "repeats": len(cut.first) - 1}
        self.system = system._replace(**segments, **tables)
        self.grid = self.grid._replace(
            lengths=length,
            length_index=np.full(length.size, -1),
            drive_rates=system.drive_lines @ system.base_matrix,
            coast_rates=system.coast_lines @ system.base_matrix,
            summary_blocks=cut.block - cut.block[0],
            sample_starts=sample_starts,
            chirp_frequencies=self.laws.harmonics,
            speed_component=self.model.size,
            **sparse_fields(system, self.laws.harmonics.size > 0),
        )
        self.components = len(system.base_matrix)

    def _add_chirps(self, raw, piece, columns):
        """Add the harmonics to accelerations in `columns`, (k, m, 6), from `raw` states."""
        speed_index, rate = self.model.size, self.grid.drive_rates
        for j, w in enumerate(self.laws.harmonics):
            i = speed_index + 1 + 4 * j
            # Cosine, sine and their derivatives by theta.
            c, s, c_rate, s_rate = raw[:, i : i + 4].T
            cosine_term = -w * (piece.acceleration * s + raw[:, speed_index] * s_rate)
            columns[..., orbit.SAMPLE_A] += cosine_term[:, None] * rate[:, i + 2]
            sine_term = w * (piece.acceleration * c + raw[:, speed_index] * c_rate)
            columns[..., orbit.SAMPLE_A] += sine_term[:, None] * rate[:, i + 3]

    def through(self, piece, state, cut, samples, limit):
        """Run through the intervals of a `Cut` of a `Piece`; return their record, a `Stretch`.

        `state` changes in place; `samples` and `limit` are those of `run_course`.
        """
        length, count = cut.lengths(piece), len(cut.block)
        interval_lengths = cut.within(length)[1][cut.first[1:] - 1]
        sample_times = (interval_lengths[:, None] * np.arange(samples) / max(samples, 1)).ravel()
        self._set_segments(cut, length, samples * np.arange(count + 1))
        bounds, system, half = cut.bounds(piece, length), self.system, state.size // 2
        m = len(system.drive_lines)
        raw = self.raw(len(sample_times))
        raw[:, -1] = sample_times
        summary = np.empty(((self.grid.summary_blocks[-1] + 1) * m, SUMMARY_COLUMNS))
        events, spans = np.empty((4 * count * m, EVENT_COLUMNS)), (count, count)
        all_components = np.append(state, self._driven_components(piece, cut, bounds[0]))
        self.scale = np.ones(all_components.size)
        _, events, event_count, code, _ = self.run_system(
            all_components, raw, events, limit, summary, spans
        )
        state[:] = all_components[: state.size]
        events, columns = events[: event_count if code == OK else 0], np.zeros((len(raw), m, 6))
        if code == OK:
            self.fill_meshes(raw, columns, system)
            self._add_chirps(raw, piece, columns)
        event_rows = events[:, [1, -1, 2, 3, 4, 0, 1]]
        event_rows[:, 0] += bounds[events[:, 0].astype(int)]
        summary = summary.reshape(-1, m, SUMMARY_COLUMNS)
        record = columns, raw[:, : 2 * half], cut.block, summary, event_rows
        return Stretch(piece, cut.offset + cut.phase[cut.first], bounds, *record, code)


class _Train(_Course, propagator.Propagator):
    """A gear train along a speed and load profile."""


class CoursePair(_Course, one_mesh.Propagator):
    """A model with one mesh along a speed and load profile."""

    def start(self, state):
        """Return the state z for a `state` (see `Base.start`), less the flank deviations."""
        return super().start(state) - self.shift


def propagator_of(model: Any) -> Any:
    """Return the propagator, with time theta, of a model along speed and load profiles."""
    runner = (_Train if model.mesh_names else CoursePair)(model, 1.0)
    runner.description = "Taylor steps" if runner.system.harmonics.size else "closed forms"
    return runner


def _loaded(system: TrainSystem, piece: Piece, inertia: np.ndarray) -> TrainSystem:
    """Return a `TrainSystem` with the load and the acceleration of a `Piece`.

    A changing load adds one component to the state. `inertia`, shape (N,), is the acceleration by
    theta that d2tau/dtheta2 = 1 causes.
    """
    n, half = len(system.base_matrix), inertia.size
    constant, rows = n - 1, slice(half, 2 * half)
    matrix = system.base_matrix.copy()
    load = matrix[rows, constant].copy()
    matrix[rows, constant] = load * piece.load + inertia * piece.acceleration
    if piece.slope == 0.0:
        return system._replace(base_matrix=matrix)

    def with_zero_column(array):
        return np.insert(array, constant, 0.0, axis=-1)

    matrix = np.insert(with_zero_column(matrix), constant, 0.0, axis=0)
    matrix[constant, constant + 1], matrix[rows, constant] = piece.slope, load
    names = "drive_lines", "coast_lines", "force_input", "force_output"
    wide = {name: with_zero_column(getattr(system, name)) for name in names}
    return system._replace(base_matrix=matrix, **wide)


def _chirped(system: TrainSystem, twice: TrainSystem, size: int) -> TrainSystem:
    """Return a `TrainSystem` whose harmonics have a phase that is quadratic in theta.

    Behind `size` displacements and velocities come dtau/dtheta and, for each harmonic, cosine, sine
    and their derivatives by theta, on which damping acts. The coefficients of these derivatives are
    the difference between `twice`, the system at tuning 2, and `system`, at tuning 1.
    `sparse_series` computes the derivatives of the new components.
    """
    h = system.harmonics.size
    size_after = size + 2 + 4 * h  # speed, four components a harmonic, constant
    first_columns = [size + 1 + 4 * j for j in range(h)]

    def with_chirps(array, array_at_2):
        result = np.zeros((*array.shape[:-1], size_after))
        result[..., :size], result[..., -1] = array[..., :size], array[..., size]
        for j, (i, w) in enumerate(zip(first_columns, system.harmonics, strict=True)):
            cosine, sine = (size + 1 + 2 * j + k for k in range(2))
            rate = array_at_2 - array
            result[..., i] = array[..., cosine] - rate[..., cosine]
            result[..., i + 1] = array[..., sine] - rate[..., sine]
            result[..., i + 2], result[..., i + 3] = -rate[..., sine] / w, rate[..., cosine] / w
        return result

    names = "drive_lines", "coast_lines", "force_input", "force_output"
    lines = {name: with_chirps(getattr(system, name), getattr(twice, name)) for name in names}
    matrix = np.zeros((size_after, size_after))
    matrix[:size] = with_chirps(system.base_matrix[:size], twice.base_matrix[:size])
    for i in first_columns:
        matrix[i, i + 2] = matrix[i + 1, i + 3] = 1.0
    return system._replace(base_matrix=matrix, harmonics=np.empty(0), **lines)
