"""Pairs of teeth along a speed and a load course, by Taylor steps in the dimensionless time theta.

At constant acceleration, the mesh phase is quadratic in theta. Stiffness and gaps, parabolas in the
phase, are then polynomials in theta, so that the series of `teeth` also hold from standstill.
"""

import numpy as np

from gearlib.engines import orbit
from gearlib.engines.codes import OK
from gearlib.engines.linear.speed_courses import CoursePiece, IntervalRecord, PieceIntervals
from gearlib.engines.taylor import teeth
from gearlib.engines.taylor.propagator import TO_BERNSTEIN

#: Number of rows of a new event table.
_FIRST_EVENT_ROWS = 64


class CoursePropagator(teeth.Propagator):
    """Engine of a `LoadSharingPair` along a speed and load course."""

    meshes, has_long_excitation_period = 1, False
    #: Inertia force due to the acceleration of the present piece, in units of the load.
    inertia_load = 0.0

    @property
    def base_system(self) -> teeth.ToothPairSystem:
        """The `ToothPairSystem` of the model at tuning 1."""
        return self.system

    def set_piece(self, piece: CoursePiece, base_acceleration: np.ndarray) -> None:
        """Set the inertia force due to the constant acceleration of a `CoursePiece`.

        `base_acceleration`, shape (1,), is the acceleration of x due to d2tau/dtheta2 = 1 (mesh
        phase tau, dimensionless time theta).
        """
        self.inertia_load = float(base_acceleration[0]) * piece.acceleration

    def _build_system(
        self, piece: CoursePiece, intervals: PieceIntervals, lengths: np.ndarray, theta: np.ndarray
    ) -> teeth.ToothPairSystem:
        """Return the `ToothPairSystem` for k intervals of a `CoursePiece` with p segments.

        In a `CoursePiece`, the acceleration and the slope of the load are constant. `lengths`,
        shape (p,), are the durations of the segments in theta, the dimensionless time; `theta`,
        shape (k + 1,), has the bounds of the intervals.
        """
        base_system, times = self.system, intervals.end_times(lengths) - lengths
        # The piece may start inside an interval of phase, one or more excitation periods later.
        start_phases, cycle = np.zeros(lengths.size), base_system.starts[-1]
        start_phase = intervals.phase[0] - base_system.starts[intervals.segments[0]]
        start_phases[0] = max(start_phase - cycle * round(start_phase / cycle), 0.0)
        segment_counts = np.diff(intervals.first_segments)
        load_times = np.repeat(theta[:-1] - piece.start, segment_counts) + times
        return base_system._replace(
            times=times,
            lengths=lengths,
            first_segment=intervals.first_segments,
            summary_blocks=intervals.summary_block - intervals.summary_block[0],
            intervals=intervals.segments,
            start_phases=start_phases,
            speeds=intervals.speeds(piece)[:-1],
            acceleration=piece.acceleration,
            loads=piece.load + self.inertia_load + piece.slope * load_times,
            load_rate=piece.slope,
            excitation_period=len(intervals.summary_block),
        )

    def run_intervals(self, piece, state, intervals, samples_per_period, max_events):
        """Run through the `intervals` of a `CoursePiece` and return an `IntervalRecord`.

        In the piece, the acceleration and the slope of the load are constant. `state`, shape (2,),
        holds displacement and velocity by theta, the dimensionless time; it becomes the final
        state. Each of the `intervals` (a `PieceIntervals`) has `samples_per_period` samples and at
        most `max_events` contact events.
        """
        lengths, periods = intervals.lengths(piece), len(intervals.summary_block)
        theta = intervals.bounds(piece, lengths)
        system = self._build_system(piece, intervals, lengths, theta)
        samples = np.zeros((periods * samples_per_period, orbit.SAMPLE_COLUMNS))
        summaries = np.empty((system.summary_blocks[-1] + 1, orbit.SUMMARY_COLUMNS))
        events = np.empty((_FIRST_EVENT_ROWS, orbit.EVENT_COLUMNS))
        no_period_maps, first_period, record_periods = np.empty((0, 2, 2)), 0, periods
        x, v = state
        x, v, _, events, event_count, status, _ = teeth.run_tooth_pairs(
            system,
            TO_BERNSTEIN,
            x,
            v,
            periods,
            record_periods,
            samples,
            events,
            max_events,
            summaries,
            no_period_maps,
            first_period,
        )
        state[:] = x, v
        events = events[: event_count if status == OK else 0]
        interval, time = events[:, orbit.EVENT_PERIOD].astype(int), events[:, orbit.EVENT_PHASE]
        changes = events[:, orbit.EVENT_FROM :]
        mesh_numbers = np.zeros(len(events))
        event_rows = np.column_stack(
            [theta[interval] + time, mesh_numbers, changes, interval, time]
        )
        phases = intervals.offset + intervals.phase[intervals.first_segments]
        states = samples[:, [orbit.SAMPLE_X, orbit.SAMPLE_V]]
        record = samples[:, None], states, intervals.summary_block, summaries[:, None], event_rows
        return IntervalRecord(piece, phases, theta, *record, status)


def create_course_propagator(model) -> CoursePropagator:
    """Return the engine of a model along speed and load courses, with the time theta."""
    return CoursePropagator(model, 1.0)
