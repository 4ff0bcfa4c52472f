"""Runs of one degree of freedom with excitation or deviations through a course: Taylor steps.

Their series know that the phase is quadratic in theta, the time of the model; see `courses`.
"""

import dataclasses
from typing import NamedTuple

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


class Segments(NamedTuple):
    """What a mesh period consists of."""

    starts: np.ndarray  #: phases that bound segments, shape (p + 1,)
    first_segment: np.ndarray  #: where mesh periods begin


class Steps:
    """A model with one degree of freedom on its way."""

    words, long, meshes = "Taylor steps", False, 1
    deviation = np.empty((0, 3))

    def __init__(self, model):
        equation = model.equation
        self.model, self.deviation = model, equation.deviation
        bare = dataclasses.replace(equation, deviation=np.empty((0, 3)))
        self.law = bare.law(1.0, TOLERANCE)
        #: What says where segments begin, and from where their phases count.
        self.laws = Segments(self.law.breaks, np.array([0, len(self.law.low)]))
        self.from_phase = self.law.breaks

    def start(self, state):
        """Return the state z; see `Base.start`."""
        return np.array(state, float)

    def enter(self, piece, inertia):
        """Take the loads of a piece."""
        self.ramp = np.zeros(5)
        self.ramp[BEND], self.ramp[SHARE_RATE] = 0.5 * piece.acceleration, piece.slope
        self.ramp[PULL] = inertia[0] * piece.acceleration

    def course(self, piece, cut, length, taken):
        """Return the `Course` of a `Cut`, whose samples begin at `taken`."""
        starts = np.concatenate([[0.0], np.cumsum(length)])
        theta = cut.bounds(piece, length)[0] - piece.start + starts[:-1]
        phase = cut.phase[:-1] - self.laws.starts[-1] * cut.turn
        passed = phase - self.laws.starts[cut.which]
        passed[np.abs(passed) < _SAME] = 0.0
        begin, end = cut.within(length)
        return Course(
            begin,
            end,
            cut.first,
            cut.block - cut.block[0],
            taken,
            cut.which,
            self.from_phase[cut.which] + passed,
            cut.speeds(piece)[:-1],
            piece.load + piece.slope * theta,
            self.ramp,
            self.deviation,
            False,
        )

    def run(self, course, state, *arguments):
        """Run through a course; return its end, events, events found and status."""
        done = run_nonlinear(self.law, TO_BERNSTEIN, course, *state, *arguments)
        return done[:2], *done[3:6]

    def through(self, piece, state, cut, samples, limit):
        """Run through the intervals of a `Cut` from a state, changed in place; a `Stretch`."""
        length, count = cut.lengths(piece), len(cut.block)
        wanted, taken = samples(piece, cut, length)
        course = self.course(piece, cut, length, taken)
        table = np.zeros((len(wanted), orbit.SAMPLE_COLUMNS))
        table[:, orbit.SAMPLE_AT] = wanted
        summary = np.zeros((course.block[-1] + 1, SUMMARY_COLUMNS))
        events = np.empty((4 * count, orbit.EVENT_COLUMNS))
        spans = count, count, table, events, limit, summary
        state[:], events, found, code = self.run(course, state, *spans)
        record = table, events[: found if code == OK else 0], summary
        return Stretch.of_one(piece, cut, length, record, code)
