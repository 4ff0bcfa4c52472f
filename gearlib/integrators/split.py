"""Runs that are split at stiffness switches and at contact changes of any mesh.

A subclass of `SplitRun` defines how its solver integrates an arc, which contains no switch.
"""

import itertools
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gearlib.data import status
from gearlib.engines.codes import BOTH, COAST, DRIVE, NO_CONTACT
from gearlib.integrators.right_hand_sides import (
    COAST_FLANK,
    DRIVE_FLANK,
    OneDegree,
    PiecewiseLinear,
)
from gearlib.integrators.run import (
    MESH_PERIOD,
    Run,
    failure_status,
    is_state_in_range,
    next_contact_state,
)


class FlankCrossing(NamedTuple):
    """A zero of a flank distance at which the contact state of a mesh changes."""

    mesh: int  #: index of the mesh
    flank: int  #: DRIVE_FLANK or COAST_FLANK
    direction: int  #: sign of the rate of the flank distance at the crossing
    contact_after: int  #: contact state of the mesh after the crossing


class Branch(NamedTuple):
    """Interval of mesh phase with constant stiffness segment and contact, for the next arc."""

    period_start: float  #: phase of the excitation at the start of the mesh period
    start: float  #: phase of the start, counted from `period_start`
    end: float  #: phase at the end of the segment, counted from `period_start`
    segment: int  #: index of the segment of constant stiffness
    contact_states: np.ndarray  #: contact states of the meshes, shape (m,)
    crossings: list[FlankCrossing]  #: crossings that end the arc early


class Arc(NamedTuple):
    """Solution on a branch, from its start to a flank crossing or to the end of the branch."""

    t: np.ndarray  #: phases of the k step ends, counted from the start of the mesh period, (k,)
    states: np.ndarray  #: states at the step ends, shape (k, size)
    crossing: int | None = None  #: index of the crossing at the end of the arc, None without one
    interpolate: Callable | None = None  #: function that returns states at phases, if recorded


class SolverFailure(Exception):
    """Raised when a solver cannot continue."""


class SplitRun(Run):
    """Run that is restarted at each stiffness switch and at each change of contact.

    Simultaneous events of several meshes are processed one after the other.
    """

    #: Distance from the flank after a crossing, relative to the norm of the state. It must not be
    #: zero, because an event function must not start at zero.
    RESTART_DISTANCE = 1e-14

    def __init__(self, problem: OneDegree | PiecewiseLinear, **solver_options):
        """Store a right-hand side and the solver options, and list the stiffness segments.

        `solver_options` are keyword arguments of the solver, such as tolerances.
        """
        super().__init__(problem, **solver_options)
        #: For each mesh period of the excitation, a list of (segment, start phase, end phase).
        self._segments = []
        for first, next_first in itertools.pairwise(problem.first_segment.tolist()):
            phases = problem.segment_bounds[first : next_first + 1]
            bounds = (phases - phases[0]).tolist()
            bounds[-1] = MESH_PERIOD
            segments = zip(range(first, next_first), bounds[:-1], bounds[1:], strict=True)
            self._segments.append(list(segments))

    def restart_distance(self, state: np.ndarray) -> float:
        """Return the flank distance at which a state restarts after a crossing.

        The state is moved slightly beyond the flank, because an event function must not start at
        zero.
        """
        return self.RESTART_DISTANCE * max(1.0, math.sqrt(state @ state))

    def solve(self, branch: Branch, state: np.ndarray) -> Arc:
        """Return the `Arc` from a state to a flank crossing or to the end of a branch.

        A branch is an interval of phase with constant contact on one stiffness segment, and an arc
        is the solution on it. If `self.is_recording`, the arc has all steps and an interpolation.
        Raise `SolverFailure` if the solver fails.
        """
        raise NotImplementedError

    def possible_crossings(self, contact_states: np.ndarray) -> list[FlankCrossing]:
        """Return a list of the flank crossings that would change the contact of a mesh.

        `contact_states`, shape (m,), are the current contact states of the m meshes: 1 for contact
        on the drive flank, -1 on the coast flank, 0 for no contact.
        """
        crossings = []
        for mesh, contact in enumerate(contact_states.tolist()):
            backlash_ratio = self.problem.backlashes[mesh]
            if contact == NO_CONTACT:
                # Contact begins on the drive flank when the distance increases through zero, on the
                # coast flank when it decreases through zero.
                crossings.append(FlankCrossing(mesh, DRIVE_FLANK, direction=1, contact_after=DRIVE))
                if backlash_ratio < math.inf:
                    crossing = FlankCrossing(mesh, COAST_FLANK, direction=-1, contact_after=COAST)
                    crossings.append(crossing)
            else:
                contact_after = next_contact_state(contact, NO_CONTACT, backlash_ratio)
                flank, other_flank = DRIVE_FLANK, COAST_FLANK
                if contact == COAST:
                    flank, other_flank = other_flank, flank
                # The contact state, 1 or -1, is the sign of the distance from the touching flank.
                crossings.append(FlankCrossing(mesh, flank, -contact, contact_after))
                # In some meshes the other flank may touch as well, which jams the mesh.
                if self.problem.may_jam[mesh]:
                    crossings.append(FlankCrossing(mesh, other_flank, -contact, contact_after=BOTH))
        return crossings

    def integrate(self, state: np.ndarray) -> tuple[np.ndarray, int]:
        """Integrate over the whole run from a state at phase 0; return (final state, status).

        The run is split at stiffness switches, i.e. at the bounds of the segments of a mesh period,
        and at contact changes. The status is OK, JAMMED, OVERFLOW, or the failure of a segment.
        """
        problem, contact_states = self.problem, self.initial_contact_states
        if problem.is_jammed(0.0, state):
            return state, status.JAMMED
        # A state that lies on a flank is moved away from it, because an event function must not
        # start at zero.
        for crossing in self.possible_crossings(contact_states):
            mesh, flank, direction, _ = crossing
            if problem.flank_distances(0.0, state)[flank][mesh] == 0.0:
                distance = -direction * self.restart_distance(state)
                problem.set_distance(0.0, state, mesh, flank, distance)
        for period in range(self.periods):
            if period >= self.first_strobe:
                self.add_strobes(np.array([period]), state[None])
            self.is_recording, self.arc_count = period >= self.first_recorded, 0
            for segment, start, end in self._segments[period % len(self._segments)]:
                state, contact_states, status_code = self._integrate_segment(
                    period, segment, start, end, state, contact_states
                )
                if status_code != status.OK:
                    return state, status_code
            if not is_state_in_range(state):
                return state, status.OVERFLOW
        return state, status.OK

    def _integrate_segment(self, period, segment, start, end, state, contact_states) -> tuple:
        """Integrate over one segment of constant stiffness; return (state, contact states, status).

        `segment` is the index of the segment, and its phases `start` and `end` count from the start
        of mesh period number `period`. `contact_states`, (m,), are 1 (drive flank), 0 (no contact)
        or -1 (coast flank) for each mesh. Each iteration solves one arc, up to a flank crossing or
        the end of the segment. The status is EVENT_LIMIT if a mesh period has more than
        `max_events` arcs.
        """
        t, period_start = start, self._excitation_phase(period)
        crossings = self.possible_crossings(contact_states)
        while t < end:
            self.arc_count += 1
            if self.arc_count > self.max_events:
                return state, contact_states, status.EVENT_LIMIT
            # The solver may miss a sign change if the flank distance is only a rounding error.
            tolerance = 0.5 * self.restart_distance(state)
            index = self.problem.reached_crossing(period_start + t, state, crossings, tolerance)
            if index is None:
                branch = Branch(period_start, t, end, segment, contact_states, crossings)
                try:
                    arc = self.solve(branch, state)
                except SolverFailure:
                    return state, contact_states, failure_status(state)
                if self.is_recording:
                    self.record_branch(
                        period, arc.t, arc.states, arc.interpolate, segment, contact_states
                    )
                t, state, index = arc.t[-1], arc.states[-1].copy(), arc.crossing
            if index is not None:
                contact_states = self._apply_crossing(
                    period, t, state, contact_states, crossings[index]
                )
                crossings = self.possible_crossings(contact_states)
                if BOTH in contact_states:
                    return state, contact_states, status.JAMMED
        return state, contact_states, status.OK

    def _apply_crossing(self, period: int, t: float, state, contact_states, crossing) -> np.ndarray:
        """Move a state slightly beyond the flank that it crosses; return the new contact states.

        The state is modified in place, because an event function must not start at zero. The phase
        t is counted from the start of mesh period number `period`. `contact_states`, shape (m,),
        are the contact states before the `FlankCrossing` `crossing`.
        """
        mesh, flank, direction, contact_after = crossing
        phase = self._excitation_phase(period) + t
        distance = direction * self.restart_distance(state)
        self.problem.set_distance(phase, state, mesh, flank, distance)
        if self.is_recording:
            self.add_event(period, t, state, mesh, int(contact_states[mesh]), contact_after)
        contact_states = contact_states.copy()
        contact_states[mesh] = contact_after
        return contact_states
