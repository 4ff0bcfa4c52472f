"""Runs that are split at switches of stiffness and at changes of contact of any mesh.

A subclass of `Split` defines how its solver integrates one arc, which contains no switch.
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
from gearlib.integrators.run import MESH_PERIOD, Run, code_of_stall, next_contact_code, within_range


class FlankCrossing(NamedTuple):
    """A zero of a flank distance at which the contact code of a mesh changes."""

    mesh: int  #: index of the mesh
    flank: int  #: DRIVE_FLANK or COAST_FLANK
    direction: int  #: sign of the rate of the flank distance at the crossing
    code_after: int  #: contact code of the mesh after the crossing


class Branch(NamedTuple):
    """Range of phase on one stiffness segment with constant contact, for the next arc."""

    period_start: float  #: phase of the excitation at the start of the mesh period
    start: float  #: phase of the start, counted from `period_start`
    end: float  #: phase at the end of the segment, counted from `period_start`
    segment: int  #: index of the segment of constant stiffness
    contact_codes: np.ndarray  #: contact codes of the meshes, shape (m,)
    crossings: list[FlankCrossing]  #: crossings that end the arc early


class Arc(NamedTuple):
    """Solution on an arc, from its start to a flank crossing or to the end of its branch."""

    t: np.ndarray  #: phases of the k step ends, counted from the start of the mesh period, (k,)
    states: np.ndarray  #: states at the step ends, shape (k, size)
    crossing: int | None = None  #: index of the crossing that ended the arc, None if none did
    interpolate: Callable | None = None  #: returns states at phases; None if not recorded


class Stall(Exception):
    """Raised when a solver cannot continue."""


class Split(Run):
    """Run that is restarted at each switch of stiffness and at each change of contact.

    Simultaneous events of several meshes are processed one after the other.
    """

    #: Distance from the flank after a crossing, relative to the norm of the state. It is needed
    #: because an event function must not start at zero.
    RESTART_DISTANCE = 1e-14

    def __init__(self, problem: OneDegree | PiecewiseLinear, **settings):
        """Store a right-hand side and the settings of the solver, and list the stiffness segments.

        `settings` are keyword arguments of the solver, such as tolerances.
        """
        super().__init__(problem, **settings)
        #: List of (segment, start, end) for each mesh period of the excitation.
        self._segments = []
        for first, next_first in itertools.pairwise(problem.first_segment.tolist()):
            phases = problem.segment_bounds[first : next_first + 1]
            bounds = (phases - phases[0]).tolist()
            bounds[-1] = MESH_PERIOD
            segments = zip(range(first, next_first), bounds[:-1], bounds[1:], strict=True)
            self._segments.append(list(segments))

    def restart_distance(self, state: np.ndarray) -> float:
        """Return the flank distance at which a state restarts after a crossing.

        An event function must not start at zero, so that the state is moved a little beyond the
        flank.
        """
        return self.RESTART_DISTANCE * max(1.0, math.sqrt(state @ state))

    def solve(self, branch: Branch, state: np.ndarray) -> Arc:
        """Return the `Arc` from a state to a flank crossing or to the end of a branch.

        A branch is a range of phase with constant contact on one stiffness segment; an arc is the
        solution on it. If `self.is_recording`, the arc has all steps and an interpolation. If the
        solver fails, a subclass raises `Stall`.
        """
        raise NotImplementedError

    def possible_crossings(self, contact_codes: np.ndarray) -> list[FlankCrossing]:
        """Return a list of the flank crossings that would change the contact of a mesh.

        `contact_codes`, shape (m,), are the present codes of the m meshes: 1 in contact on the
        drive flank, -1 on the coast flank, 0 without contact.
        """
        crossings = []
        for mesh, code in enumerate(contact_codes.tolist()):
            backlash_ratio = self.problem.backlashes[mesh]
            if code == NO_CONTACT:
                # Contact on the drive flank begins as the distance rises, on the coast flank as it
                # falls.
                crossings.append(FlankCrossing(mesh, DRIVE_FLANK, direction=1, code_after=DRIVE))
                if backlash_ratio < math.inf:
                    crossing = FlankCrossing(mesh, COAST_FLANK, direction=-1, code_after=COAST)
                    crossings.append(crossing)
            else:
                code_after = next_contact_code(code, NO_CONTACT, backlash_ratio)
                flank, other_flank = DRIVE_FLANK, COAST_FLANK
                if code == COAST:
                    flank, other_flank = other_flank, flank
                # The contact code, 1 or -1, is the sign of the distance from the touching flank.
                crossings.append(FlankCrossing(mesh, flank, -code, code_after))
                # In some meshes the other flank may touch as well, which jams the mesh.
                if self.problem.may_jam[mesh]:
                    crossings.append(FlankCrossing(mesh, other_flank, -code, code_after=BOTH))
        return crossings

    def integrate(self, state: np.ndarray) -> tuple[np.ndarray, int]:
        """Integrate over the whole run from a state at phase 0; return (final state, status).

        The run is split at switches of stiffness, which bound segments of a mesh period, and at
        changes of contact. The status is OK, JAMMED, OVERFLOW, or the reason why a segment failed.
        """
        problem, contact_codes = self.problem, self.initial_contact_codes
        if problem.is_jammed(0.0, state):
            return state, status.JAMMED
        # A state that starts on a flank is moved off it, since an event function must not start at
        # zero.
        for crossing in self.possible_crossings(contact_codes):
            mesh, flank, direction, _ = crossing
            if problem.flank_distances(0.0, state)[flank][mesh] == 0.0:
                distance = -direction * self.restart_distance(state)
                problem.set_distance(0.0, state, mesh, flank, distance)
        for period in range(self.periods):
            if period >= self.first_strobe:
                self.add_strobes(np.array([period]), state[None])
            self.is_recording, self.arc_count = period >= self.first_recorded, 0
            for segment, start, end in self._segments[period % len(self._segments)]:
                state, contact_codes, code = self._integrate_segment(
                    period, segment, start, end, state, contact_codes
                )
                if code != status.OK:
                    return state, code
            if not within_range(state):
                return state, status.OVERFLOW
        return state, status.OK

    def _integrate_segment(self, period, segment, start, end, state, contact_codes) -> tuple:
        """Integrate over one segment of constant stiffness; return (state, contact codes, status).

        `segment` is the index of the segment, and its phases `start` and `end` count from the start
        of mesh period `period`. `contact_codes`, (m,), are 1 (drive flank), 0 or -1 (coast flank)
        for each mesh. Each turn solves one arc, up to a flank crossing or the end. A mesh period
        with more than `max_events` arcs ends the run with EVENT_LIMIT.
        """
        t, period_start = start, self._excitation_phase(period)
        crossings = self.possible_crossings(contact_codes)
        while t < end:
            self.arc_count += 1
            if self.arc_count > self.max_events:
                return state, contact_codes, status.EVENT_LIMIT
            # If the flank distance is only a rounding error, the solver may miss its sign change.
            tolerance = 0.5 * self.restart_distance(state)
            index = self.problem.reached_crossing(period_start + t, state, crossings, tolerance)
            if index is None:
                branch = Branch(period_start, t, end, segment, contact_codes, crossings)
                try:
                    arc = self.solve(branch, state)
                except Stall:
                    return state, contact_codes, code_of_stall(state)
                if self.is_recording:
                    self.record_branch(
                        period, arc.t, arc.states, arc.interpolate, segment, contact_codes
                    )
                t, state, index = arc.t[-1], arc.states[-1].copy(), arc.crossing
            if index is not None:
                contact_codes = self._cross(period, t, state, contact_codes, crossings[index])
                crossings = self.possible_crossings(contact_codes)
                if BOTH in contact_codes:
                    return state, contact_codes, status.JAMMED
        return state, contact_codes, status.OK

    def _cross(self, period: int, t: float, state, contact_codes, crossing) -> np.ndarray:
        """Move a state just beyond the flank that it crosses; return the new contact codes.

        The state changes in place, because an event function must not start at zero. The phase t is
        counted from the start of mesh period `period`. `contact_codes`, shape (m,), are the codes
        before the `FlankCrossing` `crossing`.
        """
        mesh, flank, direction, code_after = crossing
        phase = self._excitation_phase(period) + t
        distance = direction * self.restart_distance(state)
        self.problem.set_distance(phase, state, mesh, flank, distance)
        if self.is_recording:
            self.add_event(period, t, state, mesh, int(contact_codes[mesh]), code_after)
        contact_codes = contact_codes.copy()
        contact_codes[mesh] = code_after
        return contact_codes
