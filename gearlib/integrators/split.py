"""Runs that are split at switches of stiffness and at contact of any mesh.

A subclass of `Split` says how its solver takes one phase, which no event interrupts.
"""

import itertools
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gearlib.data import status
from gearlib.engines.codes import BACKLASH, BOTH, INVERSE, NORMAL
from gearlib.integrators.recording import TURN, Run, next_code, within_range
from gearlib.integrators.right_hand_sides import FAR, NEAR


class Exit(NamedTuple):
    """A flank line whose crossing ends the present contact of a mesh."""

    mesh: int
    line: int  #: NEAR or FAR
    direction: int  #: sign of the rate of its distance at the crossing
    after: int  #: contact code of the mesh after the crossing


class Phase(NamedTuple):
    """The solution between two events."""

    t: np.ndarray  #: mesh phases of the step ends, counted from the start of the mesh period
    z: np.ndarray  #: states at the step ends
    hit: int | None = None  #: index of the exit that ended it; None: it reached the end
    dense: Callable | None = None  #: ``dense(phases)`` returns states; None: it is not recorded


class Stall(Exception):
    """The error that a solver could not continue."""


class Split(Run):
    """A run that is restarted at each switch of stiffness and at each change of contact.

    Simultaneous events of several meshes are treated one after the other.
    """

    #: Distance from the flank line after a crossing, as a share of the norm of the state. An event
    #: function must not start at zero.
    OFF = 1e-14

    def __init__(self, problem, **settings):
        super().__init__(problem, **settings)
        starts, first = problem.starts, problem.first.tolist()
        #: Of each mesh period: rows (segment, its start, its end).
        self._pieces = []
        for a, b in itertools.pairwise(first):
            bounds = (starts[a : b + 1] - starts[a]).tolist()
            bounds[-1] = TURN
            self._pieces.append(list(zip(range(a, b), bounds, bounds[1:], strict=False)))

    def away(self, z):
        """Return the distance from the flank line after a crossing at state z."""
        return self.OFF * max(1.0, math.sqrt(z @ z))

    def solve(self, turn, start, end, z, segment, codes, exits):
        """Return the `Phase` from state z at `start` to an exit or to `end`, or raise `Stall`.

        `start` and `end` are mesh phases counted from `turn`, the start of the mesh period. All
        steps and the dense output are returned if `self.keep` is true.
        """
        raise NotImplementedError

    def exits(self, codes):
        """Return the `Exit`s that are possible at the contact codes of the meshes."""
        exits = []
        for j, code in enumerate(codes.tolist()):
            gap = self.problem.gaps[j]
            if code == BACKLASH:
                exits.append(Exit(j, NEAR, 1, NORMAL))
                if gap < math.inf:
                    exits.append(Exit(j, FAR, -1, INVERSE))
            else:
                after, line = next_code(code, BACKLASH, gap), NEAR if code == NORMAL else FAR
                exits.append(Exit(j, line, -code, after))
                if self.problem.closing[j]:
                    exits.append(Exit(j, FAR - line, -code, BOTH))
        return exits

    def go(self, z, codes):
        """Integrate over the whole span from state z; return the final state and the status."""
        problem = self.problem
        if problem.jammed(0.0, z):
            return z, status.JAMMED
        exits = self.exits(codes)
        for leave in exits:
            if problem.lines(0.0, z)[leave.line][leave.mesh] == 0.0:
                problem.put(0.0, z, *leave[:2], -leave.direction * self.away(z))
        for n in range(self.periods):
            turn = TURN * (n % problem.repeats)
            if n >= self.strobe:
                self.add_strobes(np.array([n]), z[None])
            self.keep, runs = n >= self.first, 0
            for segment, t, end in self._pieces[n % len(self._pieces)]:
                while t < end:
                    runs += 1
                    if runs > self.limit:
                        return z, status.EVENT_LIMIT
                    # On a flank within rounding: the solver may see no change of sign.
                    hit = problem.due(turn + t, z, exits, 0.5 * self.away(z))
                    if hit is None:
                        try:
                            phase = self.solve(turn, t, end, z, segment, codes, exits)
                        except Stall:
                            return z, status.STALLED if within_range(z) else status.OVERFLOW
                        if self.keep:
                            self.record_phase(n, phase.t, phase.z, phase.dense, segment, codes)
                        t, z, hit = phase.t[-1], phase.z[-1].copy(), phase.hit
                    if hit is not None:
                        codes = self._change(n, t, z, codes, exits[hit])
                        exits = self.exits(codes)
                        if BOTH in codes:
                            return z, status.JAMMED
            if not within_range(z):
                return z, status.OVERFLOW
        return z, status.OK

    def _change(self, n, t, z, codes, leave):
        """Move state z just beyond the flank line that was crossed; return the contact codes."""
        turn = TURN * (n % self.problem.repeats)
        self.problem.put(turn + t, z, *leave[:2], leave.direction * self.away(z))
        if self.keep:
            self.add_event(n, t, z, leave.mesh, int(codes[leave.mesh]), leave.after)
        codes = codes.copy()
        codes[leave.mesh] = leave.after
        return codes
