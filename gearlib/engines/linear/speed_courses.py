"""Runs along a speed and a load course: run-ups, run-downs, steps and ramps of torque.

Between stiffness switches, the equations of motion in theta, the dimensionless time, do not depend
on the speed: a piece of constant acceleration has the same matrices as a run at constant speed, but
its switches are at other instants. With the mesh phase tau = tau_0 + nu_0 theta + a theta^2 / 2,
the time between two switches is 2 dtau / (nu_1 + nu_2) with nu^2 = nu_0^2 + 2 a (tau - tau_0). No
digits cancel, and a = 0 gives the segments of a run at constant speed. The inertia forces of the
acceleration and steps of the load change the constant term. A ramp of the load adds a state
component that grows by 1 per unit of theta.
"""

import math
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from gearlib.engines import orbit
from gearlib.engines.codes import OK
from gearlib.engines.linear import propagator
from gearlib.engines.linear.periods import EVENT_COLUMNS, EVENT_MESH
from gearlib.engines.linear.sparse_series import nonzero_fields
from gearlib.engines.linear.train_system import TrainSystem

#: Number of mesh periods for which segments are computed at a time.
_PERIODS_AT_A_TIME = 512
#: Phases that differ by less than this fraction of the final phase count as equal.
_SAME_PHASE_TOLERANCE = 1e-12
#: Golden section, a fraction of a mesh period that is far from all ratios of small integers.
_GOLDEN_SECTION = 0.3819660112501051
#: Cost of modes, in Taylor steps, that no run reaches.
_UNREACHABLE_COST = 2**62


class CoursePiece(NamedTuple):
    """Piece of a speed and load course on which both are linear in theta."""

    start: float  #: theta at the start
    length: float  #: duration in theta
    phase: float  #: mesh phase tau at the start, rad
    speed: float  #: tuning nu = dtau/dtheta at the start
    acceleration: float  #: dnu/dtheta, constant
    load: float  #: load at the start, as a fraction of the nominal load
    slope: float  #: derivative of the load by theta

    def speed_at(self, phase: float | np.ndarray) -> np.ndarray:
        """Return the tuning nu at mesh phases tau (rad) within the piece."""
        squared_speed = self.speed**2 + 2.0 * self.acceleration * (phase - self.phase)
        return np.sqrt(np.maximum(squared_speed, 0.0))

    def at_times(self, theta: float | np.ndarray) -> tuple:
        """Return (tuning nu, mesh phase tau, fraction of the nominal load) at times theta.

        The tuning is dtau/dtheta, the mesh frequency over the natural frequency; theta is the
        dimensionless time.
        """
        elapsed = theta - self.start
        speed = np.maximum(self.speed + self.acceleration * elapsed, 0.0)
        phase = self.phase + 0.5 * (self.speed + speed) * elapsed
        return speed, phase, self.load + self.slope * elapsed


class IntervalRecord(NamedTuple):
    """Record of k intervals of a run: mesh periods, split where a piece of the courses ends."""

    piece: CoursePiece
    phase: np.ndarray  #: tau at the bounds of the intervals, shape (k + 1,)
    theta: np.ndarray  #: theta at the bounds of the intervals, shape (k + 1,)
    samples: np.ndarray  #: columns of `orbit`, shape (j, m, 6)
    states: np.ndarray  #: coordinates and their derivatives by theta, shape (j, 2 N)
    summary_block: np.ndarray  #: int, number of the summary block of each interval, shape (k,)
    summary: np.ndarray  #: extrema and contact times of each block, shape (b, m, 10)
    #: theta, mesh, contact before, contact after, dx/dtheta, interval, theta in interval; (i, 7)
    events: np.ndarray
    status: int


def split_into_pieces(model: Any, speeds: np.ndarray, loads: np.ndarray) -> list[CoursePiece]:
    """Split a speed and a load course of a model into pieces on which both are linear.

    `speeds`, shape (j, 2), has the columns time in s and speed in rpm; `loads`, shape (k, 2), has
    the columns time in s and fraction of the nominal load. Two loads at the same time form a step.
    The last load lasts until the end of `speeds`. Returns a list of `CoursePiece` in dimensionless
    time theta.
    """
    # Convert the times in the first columns to theta.
    scales = np.array([float(model.mesh_frequency(1.0)), 1.0])
    speeds, loads = speeds * scales, loads * scales
    speeds[:, 1] = [model.tuning_at(rpm) if rpm else 0.0 for rpm in speeds[:, 1]]
    times = np.union1d(speeds[:, 0], loads[:, 0])
    times = times[(times >= speeds[0, 0]) & (times <= speeds[-1, 0])]
    pieces, phase = [], 0.0
    for start, end in zip(times[:-1].tolist(), times[1:].tolist(), strict=True):
        speed, acceleration = _value_and_slope(speeds, start)
        load, slope = _value_and_slope(loads, start)
        piece = CoursePiece(start, end - start, phase, speed, acceleration, load, slope)
        pieces.append(piece)
        phase += piece.length * (speed + 0.5 * acceleration * piece.length)
    return pieces


def start_course_run(model, speeds, loads, state):
    """Return (engine, list of `CoursePiece`, state z) at the start of a speed and load course.

    `speeds`, shape (j, 2), has the columns time in s and speed in rpm; `loads`, (k, 2), has the
    columns time in s and fraction of the nominal load. Velocities are derivatives by mesh phase in
    `state` and by dimensionless time in z.
    """
    engine, pieces = model.speed_course_propagator(model), split_into_pieces(model, speeds, loads)
    z = np.array(engine.initial_state(state), float)
    # Convert velocities from derivatives by mesh phase to derivatives by theta.
    z[z.size // 2 :] *= pieces[0].speed
    return engine, pieces, z


def _value_and_slope(course: np.ndarray, time: float) -> tuple[float, float]:
    """Return (value, slope) of a piecewise linear course just after a given time.

    `course`, shape (k, 2), has the columns time and value. The value is constant before the first
    and after the last time.
    """
    i = int(np.searchsorted(course[:, 0], time, side="right")) - 1
    if i < 0:
        return float(course[0, 1]), 0.0
    if i == len(course) - 1:
        return float(course[-1, 1]), 0.0
    (start, value), (end, end_value) = course[i : i + 2].tolist()
    slope = (end_value - value) / (end - start)
    return value + slope * (time - start), slope


def run_courses(
    engine, pieces, state, samples_per_period, max_events, base_acceleration, periods_per_block
):
    """Run through the pieces of a speed and load course; yield an `IntervalRecord` for each part.

    `engine` is the propagator, and `pieces` is a list of `CoursePiece`, on which speed and load are
    linear in time. `state`, (2 N,), has velocities by theta (dimensionless time) and changes in
    place. Each mesh period has `samples_per_period` samples at equal time steps and at most
    `max_events` contact events. `base_acceleration`, (N,), is the acceleration of the coordinates
    by theta due to d2tau/dtheta2 = 1. A record has one summary per block of `periods_per_block`
    mesh periods. The run ends after a failure.
    """
    for piece in pieces:
        engine.set_piece(piece, base_acceleration)
        for intervals in _piece_intervals(engine, piece, periods_per_block):
            record = engine.run_intervals(piece, state, intervals, samples_per_period, max_events)
            yield record
            if record.status != OK:
                return


class PieceIntervals(NamedTuple):
    """Intervals of a piece: its mesh periods, the first and the last of which may be incomplete."""

    phase: np.ndarray  #: tau - offset at the bounds of the segments, shape (p + 1,)
    offset: float  #: tau at which `phase` is zero
    first_segments: np.ndarray  #: int, first segment of each interval, shape (k + 1,)
    segments: np.ndarray  #: int, indices of the segments in `source`, shape (p,)
    source: Any  #: `TrainSystem` with the stiffness of the segments
    summary_block: np.ndarray  #: int, number of the summary block of each interval, shape (k,)
    has_piece_start: bool  #: whether the first interval starts with the piece
    has_piece_end: bool  #: whether the last interval ends with the piece

    def speeds(self, piece: CoursePiece) -> np.ndarray:
        """Return the tuning nu (mesh / natural frequency) at the bounds of p segments, (p + 1,).

        The segments are the ranges of constant stiffness in a `CoursePiece` of constant
        acceleration.
        """
        speeds = piece.speed_at(self.offset + self.phase)
        # Near standstill the square root of a difference loses half of its digits, so the speeds at
        # both ends of the piece are set directly.
        if self.has_piece_start:
            speeds[0] = piece.speed
        if self.has_piece_end:
            speeds[-1] = max(piece.speed + piece.acceleration * piece.length, 0.0)
        return speeds

    def lengths(self, piece: CoursePiece) -> np.ndarray:
        """Return the durations in theta of the p stiffness segments in a `CoursePiece`, shape (p,).

        A duration is the change of mesh phase divided by the mean speed, because the acceleration
        is constant.
        """
        speeds = self.speeds(piece)
        speed_sums = speeds[:-1] + speeds[1:]
        if speed_sums.any():
            return 2.0 * np.diff(self.phase) / speed_sums
        # A piece at standstill is a single segment.
        return np.array([piece.length])

    def end_times(self, lengths: np.ndarray) -> np.ndarray:
        """Return the end times of p stiffness segments, (p,), since the start of their interval.

        `lengths`, shape (p,), has the durations of the segments in theta. The durations of each
        interval (mesh period) are summed separately, so that rounding errors do not grow during the
        run.
        """
        segment_counts = np.diff(self.first_segments)
        # Sum over the rows of a table with a row per interval, padded with zeros.
        interval = np.repeat(np.arange(segment_counts.size), segment_counts)
        position = np.arange(lengths.size) - self.first_segments[interval]
        padded_lengths = np.zeros((segment_counts.size, segment_counts.max()))
        padded_lengths[interval, position] = lengths
        return np.cumsum(padded_lengths, axis=1)[interval, position]

    def bounds(self, piece: CoursePiece, lengths: np.ndarray) -> np.ndarray:
        """Return the times theta at the bounds of k intervals (mesh periods), shape (k + 1,).

        `lengths`, shape (p,), has the durations of the p stiffness segments in theta.
        """
        start = piece.start
        # The time since the start of the piece is the change of mesh phase over the mean speed.
        if not self.has_piece_start:
            phase = self.offset + self.phase[0]
            start += 2.0 * (phase - piece.phase) / (piece.speed + float(piece.speed_at(phase)))
        return start + np.concatenate([[0.0], np.cumsum(lengths)])[self.first_segments]


def _piece_intervals(engine, piece, periods_per_block):
    """Yield the `PieceIntervals` of a `CoursePiece` for a limited number of mesh periods at a time.

    `engine` is the propagator; a summary of extrema covers a block of `periods_per_block` mesh
    periods.
    """
    base, is_long = engine.base_system, engine.has_long_excitation_period
    mean_speed = piece.speed + 0.5 * piece.acceleration * piece.length
    final_phase = piece.phase + piece.length * mean_speed
    excitation_period = len(base.first_segment) - 1
    tolerance = _SAME_PHASE_TOLERANCE * max(final_phase, 1.0)
    period_count = _PERIODS_AT_A_TIME
    if not is_long:
        period_count = max(_PERIODS_AT_A_TIME // excitation_period, 1) * excitation_period
    first_period = int((piece.phase + tolerance) / math.tau) // period_count * period_count
    is_first = True
    while True:
        # The segments of the next mesh periods are copies of the segments of `source`.
        source = engine.model.system(1.0, first_period, period_count) if is_long else base
        copy_count = 1 if is_long else period_count // excitation_period
        segment_count = source.starts.size - 1
        segment_indices = np.tile(np.arange(segment_count), copy_count)
        copies, offset = np.arange(copy_count)[:, None], math.tau * first_period
        bounds = (copies * source.starts[-1] + source.starts[:-1]).ravel()
        bounds = np.append(bounds, math.tau * period_count)
        period_starts = (copies * segment_count + source.first_segment[:-1]).ravel()
        start_phase, end_phase = piece.phase - offset, final_phase - offset
        # The piece covers the segments `first_segment` to `end_segment` - 1, the first and the last
        # of them only in part.
        first_segment = max(
            int(np.searchsorted(bounds, start_phase + tolerance, side="right")) - 1, 0
        )
        end_segment = min(int(np.searchsorted(bounds, end_phase - tolerance)), segment_indices.size)
        end_segment = max(end_segment, first_segment + 1)
        phase = bounds[first_segment : end_segment + 1].copy()
        phase[0], last_phase = max(phase[0], start_phase), min(phase[-1], end_phase)
        phase[-1] = max(last_phase, start_phase)
        # An interval starts with the piece and with each mesh period in it.
        is_inside = (period_starts > first_segment) & (period_starts < end_segment)
        first_segments = np.array(
            [0, *(period_starts[is_inside] - first_segment), end_segment - first_segment]
        )
        mid_phases = (phase[first_segments[:-1]] + phase[first_segments[1:]]) / 2.0 + offset
        # A mesh period belongs to the block that contains its phase at the golden section. No block
        # starts there for any ratio of tooth numbers, so rounding does not decide.
        period_numbers = np.floor(mid_phases / math.tau)
        summary_block = ((period_numbers + _GOLDEN_SECTION) / periods_per_block).astype(int)
        is_last = math.tau * (first_period + period_count) >= final_phase - tolerance
        segments = segment_indices[first_segment:end_segment]
        yield PieceIntervals(
            phase, offset, first_segments, segments, source, summary_block, is_first, is_last
        )
        first_period, is_first = first_period + period_count, False
        if is_last:
            return


class _CourseRunMixin:
    """Mixin with which a propagator runs through the pieces of a speed and load course."""

    system: Any
    constants: Any
    model: Any
    has_long_excitation_period: Any
    description: Any = "closed forms"
    fill_record: Any
    fill_mesh_samples: Any

    @property
    def meshes(self):
        """Number of meshes of the model."""
        return len(self.base_system.drive_distance_rows)

    def next_segments(self, first_period, periods_done, period_counts):
        """Return (system, constants, number of periods) of the present `PieceIntervals`."""
        return self.system, self.constants, period_counts[0]

    def set_piece(self, piece: CoursePiece, base_acceleration: np.ndarray) -> None:
        """Set the load and the acceleration of the system for a `CoursePiece` of the courses.

        `base_acceleration`, shape (N,), is the acceleration of the coordinates by theta
        (dimensionless time) due to d2tau/dtheta2 = 1.
        """
        self.loaded_system = _system_with_load(self.unloaded_system, piece, base_acceleration)
        if self.base_system.harmonics.size:
            # The speed follows the displacements and velocities; its derivative is constant.
            speed, constant = self.model.size, -1
            self.loaded_system.base_matrix[speed, constant] = piece.acceleration
        # Discard earlier tables, which may have another number of state components.
        self.unused_tables, self.unused_large_tables = [], []

    @cached_property
    def base_system(self):
        """The `TrainSystem` of the model, without the loads and segments of the courses."""
        return self.system

    @cached_property
    def unloaded_system(self):
        """The system of the model at variable speed, before a variable load is added.

        Each harmonic of `self.base_system`, the system at constant speed, becomes a chirp: its
        phase is a quadratic function of the dimensionless time theta.
        """
        if not self.base_system.harmonics.size:
            return self.base_system
        # By default, the system covers all mesh periods of the excitation, which may be too many.
        period_range = (
            (0, self.base_system.first_segment.size - 1) if self.has_long_excitation_period else ()
        )
        # The terms of the harmonics do not depend on the tuning, and the terms of their derivatives
        # are proportional to it. Systems at tunings 1 and 2 therefore separate them.
        system_at_tuning_2 = self.model.system(2.0, *period_range)
        return _system_with_chirps(self.base_system, system_at_tuning_2, self.model.size)

    def acquire_tables(self):
        """Return mode tables for a run; with harmonics, their modes are never used.

        At variable speed, harmonics can only be integrated by Taylor series. A prohibitive cost of
        modes enforces this.
        """
        tables = super().acquire_tables()  # type: ignore[misc]
        if self.base_system.harmonics.size:
            tables.mode_cost[0] = _UNREACHABLE_COST
        return tables

    def _prescribed_components(self, piece, intervals, theta) -> list[float]:
        """Return the prescribed state components at the time `theta`, the start of `intervals`.

        They lie between the velocities and the constant. If there are harmonics, they are the speed
        and, for each harmonic, cosine, sine and their derivatives. If the load of the `CoursePiece`
        `piece` has a slope, they include the change of the load since the start of the piece.
        """
        mesh_period = round(intervals.offset / math.tau) % self.model.repeats
        values, phase = [], intervals.phase[0] + math.tau * mesh_period
        if self.base_system.harmonics.size:
            nu = float(intervals.speeds(piece)[0])
            values.append(nu)
            for w in self.base_system.harmonics:
                c, s = math.cos(w * phase), math.sin(w * phase)
                values += [c, s, -w * nu * s, w * nu * c]
        if piece.slope:
            values.append(piece.slope * (theta - piece.start))
        return values

    def _set_segments(self, intervals, lengths, sample_starts) -> None:
        """Set `system` and `constants` for the p stiffness segments of `PieceIntervals`.

        `lengths`, shape (p,), are the durations of the segments in units of the dimensionless time
        theta. `sample_starts`, shape (k + 1,), has the index of the first sample of each of the k
        mesh periods, followed by the number of samples. At variable speed, each harmonic of the
        excitation is a chirp, whose frequency is a multiple of the speed.
        """
        system, starts = self.loaded_system, np.concatenate([[0.0], np.cumsum(lengths)])
        tables = {
            name: np.ascontiguousarray(getattr(intervals.source, name)[:, intervals.segments])
            for name in ("force_index", "stiffness", "below_mean")
        }
        segments = intervals.first_segments
        tables |= {
            "starts": starts,
            "first_segment": segments,
            "excitation_period": len(segments) - 1,
        }
        self.system = system._replace(**tables)
        self.constants = self.constants._replace(
            lengths=lengths,
            length_index=np.full(lengths.size, -1),  # Mode factors are not stored.
            drive_velocity_rows=system.drive_distance_rows @ system.base_matrix,
            coast_velocity_rows=system.coast_distance_rows @ system.base_matrix,
            summary_blocks=intervals.summary_block - intervals.summary_block[0],
            sample_starts=sample_starts,
            chirp_frequencies=self.base_system.harmonics,
            speed_component=self.model.size,
            **nonzero_fields(system, self.base_system.harmonics.size > 0),
        )
        self.components = len(system.base_matrix)

    def _add_chirp_accelerations(self, raw_samples, piece, columns):
        """Add the accelerations due to harmonics to the mesh samples `columns`, shape (k, m, 6).

        The base matrix excludes the second derivatives of the harmonics, c'' = -w (nu' s + nu s')
        and s'' = w (nu' c + nu c'), which are nonlinear in the state. `raw_samples` holds the
        states of the samples, and nu' is the acceleration of the `CoursePiece` `piece`.
        """
        speed_index, velocity_rows = self.model.size, self.constants.drive_velocity_rows
        for j, w in enumerate(self.base_system.harmonics):
            i = speed_index + 1 + 4 * j
            # Cosine, sine and their derivatives by theta.
            c, s, c_rate, s_rate = raw_samples[:, i : i + 4].T
            cosine_term = -w * (piece.acceleration * s + raw_samples[:, speed_index] * s_rate)
            columns[..., orbit.SAMPLE_A] += cosine_term[:, None] * velocity_rows[:, i + 2]
            sine_term = w * (piece.acceleration * c + raw_samples[:, speed_index] * c_rate)
            columns[..., orbit.SAMPLE_A] += sine_term[:, None] * velocity_rows[:, i + 3]

    def run_intervals(self, piece, state, intervals, samples_per_period, max_events):
        """Run through the `PieceIntervals` of a `CoursePiece` and return an `IntervalRecord`.

        The intervals are mesh periods, split at the ends of the piece. `state`, (2 N,), holds
        displacements and velocities by theta; it becomes the final state. Each interval has
        `samples_per_period` samples at equal time steps and at most `max_events` contact events.
        """
        lengths, count = intervals.lengths(piece), len(intervals.summary_block)
        interval_lengths = intervals.end_times(lengths)[intervals.first_segments[1:] - 1]
        sample_times = interval_lengths[:, None] * np.arange(samples_per_period)
        sample_times = (sample_times / max(samples_per_period, 1)).ravel()
        self._set_segments(intervals, lengths, samples_per_period * np.arange(count + 1))
        bounds, system = intervals.bounds(piece, lengths), self.system
        coordinate_count = state.size // 2
        m = len(system.drive_distance_rows)
        raw_samples = self.empty_raw_samples(len(sample_times))
        # Until a sample is filled, its last column holds its time since the start of the interval.
        raw_samples[:, -1] = sample_times
        summary = np.empty(((self.constants.summary_blocks[-1] + 1) * m, orbit.SUMMARY_COLUMNS))
        # The run enlarges the event table if it needs more than four rows per mesh and interval.
        events, period_counts = np.empty((4 * count * m, EVENT_COLUMNS)), (count, count)
        all_components = np.append(state, self._prescribed_components(piece, intervals, bounds[0]))
        self.scale = np.ones(all_components.size)
        _, events, event_count, status, _ = self.run_system(
            all_components, raw_samples, events, max_events, summary, period_counts
        )
        state[:] = all_components[: state.size]
        events = events[: event_count if status == OK else 0]
        columns = np.zeros((len(raw_samples), m, 6))
        if status == OK:
            self.fill_mesh_samples(raw_samples, columns, system)
            self._add_chirp_accelerations(raw_samples, piece, columns)
        changes = [EVENT_MESH, orbit.EVENT_FROM, orbit.EVENT_TO, orbit.EVENT_VELOCITY]
        columns_of_record = [orbit.EVENT_PHASE, *changes, orbit.EVENT_PERIOD, orbit.EVENT_PHASE]
        event_rows = events[:, columns_of_record]
        # At tuning 1 phases equal times. Count the first column from the start of the course.
        event_rows[:, 0] += bounds[events[:, orbit.EVENT_PERIOD].astype(int)]
        summary = summary.reshape(-1, m, orbit.SUMMARY_COLUMNS)
        states = raw_samples[:, : 2 * coordinate_count]
        record = columns, states, intervals.summary_block, summary, event_rows
        phases = intervals.offset + intervals.phase[intervals.first_segments]
        return IntervalRecord(piece, phases, bounds, *record, status)


class _CourseTrain(_CourseRunMixin, propagator.Propagator):
    """Engine of a gear train along a speed and load course."""


class CourseMesh(_CourseRunMixin, propagator.SingleMeshPropagator):
    """Engine of a model with one mesh along a speed and load course."""

    def initial_state(self, state):
        """Return the state z for a `state` of the mesh, minus the deviation of its flanks."""
        return super().initial_state(state) - self.flank_deviation


def create_course_propagator(model: Any) -> Any:
    """Return the engine that runs a model along speed and load courses.

    The engine is at tuning 1, so that phases equal times theta; the speed is part of the course.
    """
    engine = (_CourseTrain if model.mesh_names else CourseMesh)(model, 1.0)
    engine.description = "Taylor steps" if engine.system.harmonics.size else "closed forms"
    return engine


def _system_with_load(
    system: TrainSystem, piece: CoursePiece, base_acceleration: np.ndarray
) -> TrainSystem:
    """Return a copy of a `TrainSystem` with the load and the acceleration of a `CoursePiece`.

    A load that varies with time adds a component to the state, which grows by the slope per unit of
    theta. `base_acceleration`, shape (N,), is the acceleration of the coordinates by theta due to
    d2tau/dtheta2 = 1.
    """
    n, coordinate_count = len(system.base_matrix), base_acceleration.size
    constant, velocities = n - 1, slice(coordinate_count, 2 * coordinate_count)
    matrix = system.base_matrix.copy()
    # The column of the constant 1 holds the accelerations due to the nominal load.
    load = matrix[velocities, constant].copy()
    matrix[velocities, constant] = load * piece.load + base_acceleration * piece.acceleration
    if piece.slope == 0.0:
        return system._replace(base_matrix=matrix)

    def with_zero_column(array):
        """Return row vectors with an entry 0 inserted for the new component."""
        return np.insert(array, constant, 0.0, axis=-1)

    matrix = np.insert(with_zero_column(matrix), constant, 0.0, axis=0)
    matrix[constant, constant + 1], matrix[velocities, constant] = piece.slope, load
    names = "drive_distance_rows", "coast_distance_rows", "force_input", "force_output"
    extended_rows = {name: with_zero_column(getattr(system, name)) for name in names}
    return system._replace(base_matrix=matrix, **extended_rows)


def _system_with_chirps(
    system: TrainSystem, system_at_tuning_2: TrainSystem, size: int
) -> TrainSystem:
    """Return a `TrainSystem` whose harmonics have a phase that is quadratic in time (chirps).

    After `size` displacements and velocities, the state holds dtau/dtheta and, for each harmonic,
    cosine, sine and their derivatives by theta, on which damping forces depend. The coefficients of
    the derivatives follow from the difference between `system_at_tuning_2` and `system`, which is
    at tuning 1. Module `sparse_series` computes the derivatives of the new components.
    """
    h = system.harmonics.size
    size_after = size + 2 + 4 * h  # speed, four components per harmonic, constant
    # Each harmonic has four columns: cosine, sine, and their derivatives.
    first_columns = [size + 1 + 4 * j for j in range(h)]

    def with_chirps(array, array_at_tuning_2):
        """Convert row vectors, (..., size + 1 + 2 h), to the state with chirps.

        The derivative of a harmonic is the tuning times its frequency w times the other harmonic.
        The difference between the arrays at tunings 2 and 1 is therefore due to the derivatives.
        """
        result = np.zeros((*array.shape[:-1], size_after))
        result[..., :size], result[..., -1] = array[..., :size], array[..., size]
        for j, (i, w) in enumerate(zip(first_columns, system.harmonics, strict=True)):
            cosine, sine = (size + 1 + 2 * j + k for k in range(2))
            derivative_part = array_at_tuning_2 - array
            result[..., i] = array[..., cosine] - derivative_part[..., cosine]
            result[..., i + 1] = array[..., sine] - derivative_part[..., sine]
            result[..., i + 2] = -derivative_part[..., sine] / w
            result[..., i + 3] = derivative_part[..., cosine] / w
        return result

    names = "drive_distance_rows", "coast_distance_rows", "force_input", "force_output"
    arrays = [(getattr(system, name), getattr(system_at_tuning_2, name)) for name in names]
    extended_rows = {name: with_chirps(*pair) for name, pair in zip(names, arrays, strict=True)}
    matrix = np.zeros((size_after, size_after))
    matrix[:size] = with_chirps(system.base_matrix[:size], system_at_tuning_2.base_matrix[:size])
    for i in first_columns:
        matrix[i, i + 2] = matrix[i + 1, i + 3] = 1.0
    return system._replace(base_matrix=matrix, harmonics=np.empty(0), **extended_rows)
