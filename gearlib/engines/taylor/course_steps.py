"""Runs of one degree of freedom with excitation or deviations through a course: Taylor steps.

Their series know that the phase is quadratic in theta, the time of the model; see `courses`.
"""

import dataclasses
from types import SimpleNamespace

import numpy as np

from gearlib.engines import orbit
from gearlib.engines.codes import OK
from gearlib.engines.linear.courses import Stretch
from gearlib.engines.linear.record import SUMMARY_COLUMNS
from gearlib.engines.taylor.propagator import TO_BERNSTEIN, TOLERANCE
from gearlib.engines.taylor.series import BEND, PULL, SHARE_RATE
from gearlib.engines.taylor.taylor_run import Course, run_nonlinear

#: Phases closer than this are one.
_SAME = 1e-9


class Steps:
    """A model with one degree of freedom on its way."""

    words, long, meshes = "Taylor steps", False, 1

    def __init__(self, model):
        equation = model.equation
        self.model, self.deviation = model, equation.deviation
        bare = dataclasses.replace(equation, deviation=np.empty((0, 3)))
        self.law = bare.law(1.0, TOLERANCE)
        #: Phases that bound segments, and where mesh periods begin among these.
        mesh_periods = np.array([0, len(self.law.low)])
        self.laws = SimpleNamespace(starts=self.law.breaks, first_segment=mesh_periods)

    def start(self, state):
        """Return the state z; see `Base.start`."""
        return np.array(state, float)

    def enter(self, piece, inertia):
        """Take the loads of a piece."""
        self.ramp = np.zeros(5)
        self.ramp[BEND], self.ramp[SHARE_RATE] = 0.5 * piece.acceleration, piece.slope
        self.ramp[PULL] = inertia[0] * piece.acceleration

    def _course(self, piece, cut, length, taken):
        """Return the `Course` of a `Cut`, whose samples begin at `taken`."""
        starts, breaks = np.concatenate([[0.0], np.cumsum(length)]), self.law.breaks
        theta = cut.bounds(piece, length)[0] - piece.start + starts[:-1]
        passed = cut.phase[:-1] - breaks[-1] * cut.turn - breaks[cut.which]
        passed[np.abs(passed) < _SAME] = 0.0
        phase, speed = breaks[cut.which] + passed, cut.speeds(piece)[:-1]
        load, block = piece.load + piece.slope * theta, cut.block - cut.block[0]
        places = *cut.within(length), cut.first, block, taken, cut.which
        return Course(*places, phase, speed, load, self.ramp, self.deviation, False)

    def through(self, piece, state, cut, samples, limit):
        """Run through the intervals of a `Cut` from a state, changed in place; a `Stretch`."""
        length, count = cut.lengths(piece), len(cut.block)
        wanted, taken = samples(piece, cut, length)
        course = self._course(piece, cut, length, taken)
        table = np.zeros((len(wanted), orbit.SAMPLE_COLUMNS))
        table[:, orbit.SAMPLE_AT] = wanted
        summary = np.zeros((course.block[-1] + 1, SUMMARY_COLUMNS))
        events = np.empty((4 * count, orbit.EVENT_COLUMNS))
        spans = count, count, table, events, limit, summary
        done = run_nonlinear(self.law, TO_BERNSTEIN, course, *state, *spans)
        state[:], (events, found, code) = done[:2], done[3:6]
        record = table, events[: found if code == OK else 0], summary
        return Stretch.of_one(piece, cut, length, record, code)
