"""Runs of a `GearPair` through a course of speed and load: scalar closed forms.

A constant load that presses the flanks together is a unit of length: what the pair does under it is
what it does under its own, with another backlash. Ramps of the load, and loads that part the
flanks, go by the matrices of `courses`.
"""

import numpy as np

from gearlib.kernels import orbit
from gearlib.kernels.closed_form.mesh_constants import mesh
from gearlib.kernels.closed_form.pair_course import run_course
from gearlib.kernels.codes import OK
from gearlib.kernels.several_meshes.record import SUMMARY_COLUMNS
from gearlib.models.propagators.closed_form import ratios
from gearlib.models.propagators.courses import CoursePair, Stretch

#: What counts in units of length: of the samples, and of a summary.
_SAMPLES = [orbit.SAMPLE_X, orbit.SAMPLE_V, orbit.SAMPLE_A, orbit.SAMPLE_FORCE]
_SUMMARY = [orbit.X_MAX, orbit.X_MIN, orbit.FORCE_MAX, orbit.FORCE_MIN, orbit.SUMMARY_COLUMNS]


class PairArcs(CoursePair):
    """A `GearPair` on its way."""

    def enter(self, piece, inertia):
        """Take the loads of a piece."""
        super().enter(piece, inertia)
        self.force = piece.load + inertia[0] * piece.acceleration
        self.plain = piece.slope == 0.0 and self.force > 0.0
        if self.plain:
            numbers = ratios(self.model)
            numbers[-1] /= self.force
            self.mesh = mesh(numbers, 1.0)

    def through(self, piece, state, cut, samples, limit):
        """Run through the intervals of a `Cut` from a state, changed in place; a `Stretch`."""
        if not self.plain:
            return super().through(piece, state, cut, samples, limit)
        length, count = cut.lengths(piece), len(cut.block)
        level, block = 1 - cut.source.low[1, cut.which, 0], cut.block - cut.block[0]
        wanted, taken = samples(piece, cut, length)
        table = np.zeros((len(wanted), orbit.SAMPLE_COLUMNS))
        table[:, orbit.SAMPLE_AT] = wanted
        events = np.empty((4 * count, orbit.EVENT_COLUMNS))
        summary = np.zeros((block[-1] + 1, SUMMARY_COLUMNS))
        where = cut.within(length)[0], length, level, cut.first, block, taken
        rest = *(state / self.force), table, events, limit, summary
        *z, events, found, code = run_course(self.mesh, *where, *rest)
        events = events[: found if code == OK else 0]
        events[:, orbit.EVENT_VELOCITY] *= self.force
        table[:, _SAMPLES] *= self.force
        summary[:, _SUMMARY] *= self.force
        state[:] = np.array(z) * self.force
        return Stretch.of_one(piece, cut, length, (table, events, summary), code)
