"""Runs of step-by-step methods, and their records: samples, extrema, contact times and events."""

import math
from typing import Any

import numpy as np

from gearlib.data import status
from gearlib.engines import orbit
from gearlib.engines.codes import COAST, DRIVE, NO_CONTACT
from gearlib.engines.orbit import Record, Span
from gearlib.integrators.right_hand_sides import (
    COAST_FLANK,
    DRIVE_FLANK,
    OneDegree,
    PiecewiseLinear,
    contact_states_at,
)
from gearlib.integrators.steps.equation_of_motion import SAME_PHASE_TOLERANCE

#: Mesh phase of one mesh period, rad.
MESH_PERIOD = 2.0 * math.pi
#: Largest component of a state; the squares of larger components would soon overflow.
MAX_STATE = 1e150
#: A failure of the solver at a state with a larger component is classified as an overflow.
_HUGE_STATE = 1e-20 * MAX_STATE
#: A mesh period that starts less than this phase in rad before a step is treated as starting with
#: the step. The tolerance covers the rounding of phases in long runs.
_PERIOD_START_TOLERANCE = 1e-9
#: Contact state -> column of a summary with the time in this state.
_TIME_COLUMNS = {
    DRIVE: orbit.TIME_DRIVE,
    NO_CONTACT: orbit.TIME_NO_CONTACT,
    COAST: orbit.TIME_COAST,
}


def is_state_in_range(state: np.ndarray) -> bool:
    """Return whether a state is finite and its squares do not overflow."""
    return bool(np.abs(state).max() < MAX_STATE)


def failure_status(state: np.ndarray) -> int:
    """Return the status code of a run whose solver fails at a state.

    It is OVERFLOW if the state is so large that intermediate results may overflow, else STALLED.
    """
    return status.STALLED if np.abs(state).max() < _HUGE_STATE else status.OVERFLOW


def next_contact_state(contact: int, final_contact: int, backlash_ratio: float) -> int:
    """Return the next contact state of a mesh on its way from `contact` to `final_contact`.

    Contact states are 1 (contact on the drive flank), 0 (no contact) and -1 (coast flank). With
    backlash, a mesh loses contact on one flank before it touches on the other flank. Without
    backlash, loss of contact on one flank is contact on the other flank.
    """
    if contact == NO_CONTACT:
        return int(final_contact)
    return NO_CONTACT if backlash_ratio > 0.0 else -contact


class Run:
    """Run of a right-hand side, and its record; subclasses define `integrate`.

    Phases are counted from the start of a mesh period, so that rounding errors do not grow.
    """

    def __init__(self, problem: OneDegree | PiecewiseLinear, **solver_options):
        """Store a right-hand side and the solver options, e.g. tolerances.

        The time during which the stiffness is below its mean is tabulated for the summary.
        """
        self.problem, self.solver_options, self.evaluations = problem, solver_options, 0
        self.meshes = range(len(problem.backlashes))
        # Time below the mean stiffness since phase 0, by contact state + 1, segment bound and mesh.
        times = np.diff(problem.segment_bounds)[:, None] * problem.below_mean
        self._time_below_mean = np.pad(np.cumsum(times, axis=1), ((0, 0), (1, 0), (0, 0)))

    def integrate(self, state: np.ndarray) -> tuple[np.ndarray, int]:
        """Integrate over the whole span from a state at phase 0; return (final state, status)."""
        raise NotImplementedError

    def run(self, state, span: Span, samples, events, summary) -> Record:
        """Integrate from a state over a `Span` of mesh periods and return the `Record`.

        `samples`, shape (n, columns), has equally many rows for each recorded period. Events are
        kept if `events` has rows; the columns are mesh period, phase in it, contact states before
        and after, velocity and, for a train, mesh. `summary` has the columns of
        `gearlib.engines.orbit` (extrema, contact times), and for a train a row for each mesh.
        """
        problem, periods = self.problem, span.periods
        self.periods, self.max_events = periods, span.max_events
        self.first_recorded = periods - span.recorded
        self.samples, self.sample_count = samples, 0
        self.samples_per_period = len(samples) // span.recorded
        self.keep_events, self.events = len(events) > 0, []
        self.summary = summary.reshape(len(self.meshes), -1)
        for mesh_summary in self.summary:
            orbit.clear_summary(mesh_summary)
        # The strobes, states at the starts of the last mesh periods, determine the orbit's period.
        strobe_periods = min(periods, orbit.stored_state_count(problem.excitation_period))
        self.first_strobe = periods - strobe_periods
        self.strobes = np.empty((len(self.meshes), strobe_periods + 1, 2))
        state, self.initial_contact_states = problem.initial_state(state)
        run_status, period = status.OVERFLOW, 0
        if is_state_in_range(state):
            # The status reports overflow, so NumPy need not warn.
            with np.errstate(all="ignore"):
                state, run_status = self.integrate(state)
        if run_status == status.OK:
            self.add_strobes(np.array([periods]), state[None])
            period = self._orbit_period()
        if self.events:
            # Within a step, events are added mesh by mesh, so sort them by period, phase and mesh.
            sorted_events = sorted(self.events, key=lambda event: (*event[:2], event[-1]))
            # The tables of models with one mesh do not have the last column, the mesh.
            events = np.array(sorted_events)[:, : events.shape[1]]
        events = events[: len(self.events) if run_status == status.OK else 0]
        final = np.ravel(problem.final_state(MESH_PERIOD * periods, state))
        return Record(state, final, period, samples, events, summary, run_status, self.evaluations)

    def _orbit_period(self) -> int:
        """Return the number of mesh periods after which the motion of all meshes repeats, or 0.

        It is the least common multiple of the periods of all meshes, which are determined from
        `self.strobes`, their states at the starts of the last mesh periods.
        """
        displacement_ranges = self.summary[:, orbit.X_MAX] - self.summary[:, orbit.X_MIN]
        # The tuning times dx/dtau is the velocity divided by the natural frequency.
        tuning, excitation_period = self.problem.tuning, self.problem.excitation_period
        periods = [
            orbit.orbit_period(strobes, tuning, displacement_range, excitation_period)
            for strobes, displacement_range in zip(self.strobes, displacement_ranges, strict=True)
        ]
        return 0 if 0 in periods else math.lcm(*periods)

    def _excitation_phase(self, period: Any) -> Any:
        """Return the phase of the excitation at the start of a mesh period.

        `period`, the number of the mesh period, may be an array. The phase returns to 0 when the
        excitation repeats, so that it remains exact in long runs.
        """
        return MESH_PERIOD * (period % self.problem.excitation_period)

    def add_strobes(self, periods: np.ndarray, states: np.ndarray) -> None:
        """Store the mesh motion of states, shape (k, size), at the starts of k mesh periods."""
        motion = self.problem.mesh_motion(self._excitation_phase(periods), states)
        self.strobes[:, periods - self.first_strobe] = np.transpose(motion, (2, 1, 0))

    def record_steps(self, period: int, t, states, interpolate, refined_phases: Any = ()) -> None:
        """Record k steps, within which stiffness and contact may change.

        The mesh phases t of the step ends, shape (k + 1,), are counted from the start of mesh
        period `period`; `states` has the shape (k + 1, size). ``interpolate(phases)`` returns
        states between step ends. Extrema are also evaluated at `refined_phases` within the steps.
        Contact events are located by linear interpolation.
        """
        problem, start_phase = self.problem, self._excitation_phase(period)
        # Strobes are the states at the starts of the last mesh periods.
        strobe_periods = np.arange(max(self.first_strobe, period), self.periods)
        strobe_phases = MESH_PERIOD * (strobe_periods - period)
        is_inside = (strobe_phases > t[0] - _PERIOD_START_TOLERANCE) & (strobe_phases < t[-1])
        strobe_periods = strobe_periods[is_inside]
        if strobe_periods.size:
            strobe_states = interpolate(MESH_PERIOD * (strobe_periods - period))
            self.add_strobes(strobe_periods, strobe_states)
        record_start = MESH_PERIOD * (self.first_recorded - period)
        if t[-1] <= record_start:
            return
        skipped = max(int(np.searchsorted(t, record_start, side="right")) - 1, 0)
        t, states = t[skipped:], states[skipped:]
        recorded_t, recorded_states = t.copy(), states.copy()
        # The record may begin inside the first step.
        if t[0] < record_start:
            recorded_t[0] = record_start
            recorded_states[0] = interpolate(np.array([record_start]))[0]
        self._add_samples(period, t[-1], interpolate)
        # Segments just before and just after the step ends; no step follows the last step end.
        before = problem.segment_before(start_phase + t[1:])
        after = np.append(problem.segment_after(start_phase + recorded_t[:-1]), before[-1])
        contact_states = problem.contact_states(start_phase + recorded_t, recorded_states)
        self._add_steps(start_phase + recorded_t, recorded_states, before, after, contact_states)
        if len(refined_phases):
            refined_phases = refined_phases[refined_phases > recorded_t[0]]
            phases, refined_states = start_phase + refined_phases, interpolate(refined_phases)
            refined_contact_states = problem.contact_states(phases, refined_states)
            self._add_states(
                phases, refined_states, problem.segment_before(phases), refined_contact_states
            )
        distances = problem.flank_distances(start_phase + t, states)
        for mesh in self.meshes:
            self._add_contact_times(period, mesh, recorded_t[:-1], t, states, distances)

    def record_branch(self, period: int, t, states, interpolate, segment: int, contact_states):
        """Record k steps on a branch, i.e. one stiffness segment without a change of contact.

        The mesh phases t of the step ends, shape (k + 1,), are counted from the start of mesh
        period `period`; `states` has the shape (k + 1, size). ``interpolate(phases)`` returns
        states between step ends. `segment` is the index of the segment, and `contact_states`, (m,),
        are 1 (drive flank), 0 or -1 (coast flank) for each mesh.
        """
        phases = self._excitation_phase(period) + t
        segments = np.full(len(t), segment)

        def interpolate_inside(sample_phases: np.ndarray) -> np.ndarray:
            """Return states at phases that may lie just outside the steps because of rounding."""
            return interpolate(np.clip(sample_phases, t[0], t[-1]))

        self._add_samples(period, t[-1], interpolate_inside, segment, contact_states)
        step_contact_states = np.tile(contact_states, (len(t), 1))
        self._add_steps(phases, states, segments[1:], segments, step_contact_states)
        for mesh in self.meshes:
            self._add_times(mesh, phases[:1], phases[-1:], contact_states[mesh : mesh + 1])

    def _add_samples(self, period: int, end, interpolate, segment=None, contact_states=None):
        """Fill the samples before the phase `end`, counted from the start of mesh period `period`.

        ``interpolate(phases)`` returns states at mesh phases. All samples have the stiffness
        `segment` and the `contact_states`, (m,), of the meshes; if these are None, they follow from
        phases and states.
        """
        problem = self.problem
        # Index of the first sample of the record, counted from the start of this mesh period, so
        # that it is negative if the record began in an earlier period.
        first_sample = (self.first_recorded - period) * self.samples_per_period
        # This bound may be slightly too high; phases beyond the end are removed below.
        stop = int(end / MESH_PERIOD * self.samples_per_period) - first_sample + 2
        indices = np.arange(self.sample_count, min(len(self.samples), stop))
        phases = MESH_PERIOD * (indices + first_sample) / max(self.samples_per_period, 1)
        phases = phases[phases < end - SAME_PHASE_TOLERANCE]
        count = len(phases)
        if not count:
            return
        t, states = self._excitation_phase(period) + phases, interpolate(phases)
        segments = problem.segment_after(t) if segment is None else np.full(count, segment)
        if contact_states is None:
            contacts = problem.contact_states(t, states)
        else:
            contacts = np.tile(contact_states, (count, 1))
        self._add_states(t, states, segments, contacts)
        new_samples = self.samples[self.sample_count : self.sample_count + count]
        problem.fill_samples(new_samples, t, states, segments, contacts)
        self.sample_count += count

    def _add_states(self, t, states, segments, contact_states) -> tuple[np.ndarray, np.ndarray]:
        """Update the extrema with k states; return (mesh forces, their derivatives by phase).

        The mesh phases t and the indices of stiffness `segments` have shape (k,), `states` (k,
        size), and `contact_states` (1, 0, -1) and both results (k, m) for m meshes.
        """
        forces, force_rates = self.problem.mesh_forces(t, states, segments, contact_states)
        displacements = self.problem.mesh_motion(t, states)[0]
        for values, max_column, min_column in (
            (displacements, orbit.X_MAX, orbit.X_MIN),
            (forces, orbit.FORCE_MAX, orbit.FORCE_MIN),
        ):
            max_values = values.max(axis=0, initial=-math.inf)
            min_values = values.min(axis=0, initial=math.inf)
            maxima, minima = self.summary[:, max_column], self.summary[:, min_column]
            self.summary[:, max_column] = np.maximum(maxima, max_values)
            self.summary[:, min_column] = np.minimum(minima, min_values)
        return forces, force_rates

    def _add_steps(self, t, states, segments_before, segments_after, contact_states) -> None:
        """Add k steps to the extrema and, by Hermite quadrature, to the mean mesh force.

        The phases t of the step ends have shape (k + 1,), `states` (k + 1, size), and
        `contact_states` (k + 1, m). `segments_before`, (k,), are indices of the stiffness segments
        just before the ends of the steps, and `segments_after`, (k + 1,), just after all step ends;
        they differ where the stiffness jumps.
        """
        h = np.diff(t)[:, None]
        forces, rates = self._add_states(t, states, segments_after, contact_states)
        end_forces, end_rates = forces[1:].copy(), rates[1:].copy()
        # Where the stiffness jumps, the force at the end of a step is recomputed before the jump.
        i = np.flatnonzero(segments_before != segments_after[1:])
        if i.size:
            end_forces[i], end_rates[i] = self._add_states(
                t[i + 1], states[i + 1], segments_before[i], contact_states[i + 1]
            )
        # This is the integral of the cubic polynomial with these forces and rates at both ends.
        areas = h / 2.0 * (forces[:-1] + end_forces) + h * h / 12.0 * (rates[:-1] - end_rates)
        self.summary[:, orbit.FORCE_SUM] += areas.sum(axis=0)

    def _add_contact_times(self, period: int, mesh: int, recorded_starts, t, states, distances):
        """Add the times at each contact state and the changes of contact of one mesh in k steps.

        The steps end at the mesh phases t, (k + 1,), and each is recorded from its phase in
        `recorded_starts`, (k,), on. Phases count from the start of mesh period `period`. `states`
        has the shape (k + 1, size), and `distances`, (k + 1, 2, m), are the distances of all m
        meshes from their drive and coast flanks.
        """
        start_phase = self._excitation_phase(period)
        contacts = contact_states_at(distances[:, :, mesh : mesh + 1])[:, 0]
        is_unchanged = contacts[:-1] == contacts[1:]
        # A step without contact change is one interval; a step with contact changes is split.
        intervals = []
        for i in np.flatnonzero(~is_unchanged).tolist():
            start = float(recorded_starts[i])
            ends = slice(i, i + 2)
            step = t[ends], states[ends], distances[ends, :, mesh]
            intervals += self._add_changes(period, mesh, start, *step)
        changed_starts, changed_ends, changed_contacts = np.array(intervals).reshape(-1, 3).T
        starts = np.append(recorded_starts[is_unchanged], changed_starts)
        ends = np.append(t[1:][is_unchanged], changed_ends)
        interval_contacts = np.append(contacts[1:][is_unchanged], changed_contacts)
        self._add_times(mesh, start_phase + starts, start_phase + ends, interval_contacts)

    def _add_times(self, mesh: int, starts, ends, contact_states) -> None:
        """Add intervals of mesh phase to the contact times in the summary of a mesh.

        `starts`, `ends` and `contact_states` (1, 0, -1) have one entry for each interval.
        """
        for contact, column in _TIME_COLUMNS.items():
            start, end = starts[contact_states == contact], ends[contact_states == contact]
            self.summary[mesh, column] += (end - start).sum()
            if contact != NO_CONTACT:
                end_time = self._time_below_mean_until(mesh, contact, end)
                low_time = end_time - self._time_below_mean_until(mesh, contact, start)
                self.summary[mesh, orbit.TIME_LOW] += low_time.sum()

    def _time_below_mean_until(self, mesh: int, contact_state: int, t: np.ndarray) -> np.ndarray:
        """Return the time from mesh phase 0 to t during which the stiffness is below its mean.

        The stiffness of a mesh depends on its contact state. t is an array of phases.
        """
        bounds = self.problem.segment_bounds
        time_until_bounds = self._time_below_mean[contact_state + 1, :, mesh]
        # The excitation repeats after the last segment bound.
        repetitions, phase = np.divmod(t, bounds[-1])
        return repetitions * time_until_bounds[-1] + np.interp(phase, bounds, time_until_bounds)

    def _add_changes(self, period: int, mesh: int, recorded_start, t, states, distances) -> list:
        """Add the changes of contact of a mesh in one step; return the intervals between them.

        The phases t, (2,), `states`, (2, size), and `distances` from drive and coast flank, (2, 2),
        are values at the start and the end of the step, which is recorded from the phase
        `recorded_start` on. Each interval is (start, end, contact state). Events lie where linearly
        interpolated distances vanish.
        """
        contact, final_contact = contact_states_at(distances[:, :, None])[:, 0].tolist()
        start, end = t.tolist()
        intervals = []
        while contact != final_contact:
            # With backlash, contact is lost on one flank before the other flank touches.
            next_contact = next_contact_state(contact, final_contact, self.problem.backlashes[mesh])
            flank = DRIVE_FLANK if DRIVE in (contact, next_contact) else COAST_FLANK
            start_distance, end_distance = distances[:, flank].tolist()
            fraction = 0.0
            if start_distance != end_distance:
                fraction = start_distance / (start_distance - end_distance)
            event_phase = start + fraction * (end - start)
            if event_phase > recorded_start:
                state = states[0] + fraction * (states[1] - states[0])
                self.add_event(period, event_phase, state, mesh, contact, next_contact)
                intervals.append((recorded_start, event_phase, contact))
                recorded_start = event_phase
            contact = next_contact
        return [*intervals, (recorded_start, end, contact)]

    def add_event(
        self, period: int, t: float, state, mesh: int, contact_before: int, contact_after: int
    ):
        """Add a contact change of a mesh to its summary and to the events.

        The contact state (1, 0, -1) changes from `contact_before` to `contact_after` in a `state`
        of the model at the mesh phase t, counted from the start of mesh period `period`. t may lie
        in a later period.
        """
        _, velocities = self.problem.mesh_motion(self._excitation_phase(period) + t, state)
        velocity = float(velocities[mesh])
        orbit.count_event(contact_before, contact_after, velocity, self.summary[mesh])
        if self.keep_events:
            passed_periods = int(t // MESH_PERIOD)
            phase = t - passed_periods * MESH_PERIOD
            event = (period + passed_periods, phase, contact_before, contact_after, velocity, mesh)
            self.events.append(event)
