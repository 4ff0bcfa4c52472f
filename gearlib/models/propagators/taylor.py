"""Taylor steps that end at events: one degree of freedom, any damping, stiffness and excitation."""

import numpy as np

from gearlib.kernels.codes import BACKLASH
from gearlib.kernels.polynomial import bernstein_matrix
from gearlib.kernels.taylor.series import COLUMNS, LINE, ORDER, Law, damping_of, tables
from gearlib.kernels.taylor.taylor_maps import vary_nonlinear
from gearlib.kernels.taylor.taylor_record import new_record
from gearlib.kernels.taylor.taylor_run import run_nonlinear, steady_course
from gearlib.kernels.taylor.taylor_tangents import Slopes
from gearlib.models.derivatives import START, STEP
from gearlib.models.propagators.base import Base

#: Truncation error of a step, static deflections: that of rounding.
TOLERANCE = 1e-16
TO_BERNSTEIN = bernstein_matrix(ORDER)


def _no_record(k):
    """Return a `Record` of nothing, for k directions."""
    empty = np.empty((0, 4, k)), np.empty((0, 2, k)), np.empty((4, k)), np.empty((4, k))
    return new_record(*empty)


class Propagator(Base):
    """A model with one degree of freedom at one tuning."""

    words = "Taylor steps"
    _last: tuple = (None, None)

    def __init__(self, model, tuning, tolerance=TOLERANCE):
        super().__init__(model, tuning)
        self.tuning, self.tolerance = tuning, tolerance
        self.law = model.law(tuning, tolerance)

    def run(self, z, *arguments, first=0):
        """Run from z; see `Base.run`."""
        *rest, summary = arguments
        course = steady_course(self.law)
        done = run_nonlinear(self.law, TO_BERNSTEIN, course, *z, *rest, summary[None])
        *z[:], period, events, found, code, steps = done
        # Each coefficient of the series takes what an evaluation of the right-hand side takes.
        return *z, period, events, found, code, steps * ORDER

    @staticmethod
    def along_branch(model, names):
        """Return directions; numbers that a model adds to its pair are among them."""
        own = [name for name in names if name in model.parameters]
        found = [{name: 1.0} if name in own else model.along_branch(name) for name in names]
        return None if None in found else found

    def slopes(self, along):
        """Return the `Slopes` of directions; those of the last ones are kept."""
        if self._last[0] is not along:
            self._last = along, self._slopes(along)
        return self._last[1]

    def _slopes(self, along):
        waves = max(len(rows) for rows in (self.law.stiffness, self.law.far_stiffness))
        waves = 1 + max(waves, len(self.law.force))
        k, pieces = len(along), len(self.law.pieces)
        constants, harmonics = np.zeros((3, pieces, COLUMNS, k)), np.zeros((4, waves, 2, k))
        breaks, tuning = np.zeros((pieces + 1, k)), np.zeros(k)
        for j, slopes in enumerate(along):
            fields = {name: one for name, one in slopes.items() if name not in ("tuning", *START)}
            tuning[j] = slopes.get("tuning", 0.0)
            if not fields and not tuning[j]:
                continue
            law = self.model.complex_step(fields).law(self.tuning + 1j * STEP * tuning[j], 0.0)
            law = Law(*(one if name == "low" else one + 0j for name, one in law._asdict().items()))
            rows, table = tables(law._replace(tolerance=self.tolerance))
            constants[..., j] = rows.imag / STEP
            harmonics[..., j] = table[:, :, 1:3].imag / STEP
            breaks[:, j] = law.breaks.imag / STEP
        return Slopes(constants, harmonics, breaks, tuning)

    def _vary(self, z, along, w, periods, limit, maps=None, recorded=0, record=None):
        """Take columns w through mesh periods; return the kernel's other returns."""
        whole = maps is None
        return vary_nonlinear(
            self.law,
            TO_BERNSTEIN,
            *z,
            periods,
            limit,
            np.empty((0, 2, 2)) if whole else maps,
            self.slopes(along),
            w,
            whole,
            recorded,
            record or _no_record(len(along)),
        )

    def vary(self, z, periods, limit, maps, first):
        """Fill the maps; see `Base.vary`."""
        *z[:], code, _, _ = self._vary(z, (), np.eye(2), periods, limit, maps)
        return code

    def start_tangents(self, state, along):
        """Return what the start changes by, shape (2, k); see `Base.differentiate`."""
        return np.array([[slopes.get(name, 0.0) for slopes in along] for name in START])

    def switches(self, mesh):
        """Return the phases of switches, rising, 2 pi the last; see `Base.differentiate`."""
        law = self.law
        kept = np.zeros(len(law.breaks), bool)
        kept[[0, -1]] = True
        for lines in (law.pieces, law.far_pieces):
            ends = lines[:-1, 0] + lines[:-1, 1] * np.diff(law.breaks)[:-1]
            size = np.abs(lines).max() * 1e-12
            kept[1:-1] |= np.abs(ends - lines[1:, 0]) > size
            kept[1:-1] |= np.abs(np.diff(lines[:, 1])) > size
        return law.breaks[kept]

    def _one_sided(self, z, along, tangents):
        """Return whether a start on a flank line where the damping jumps moves off it."""
        law = self.law
        for contact, line in ((1, law.upper), (-1, law.lower)):
            lines = self.slopes(along).constants[contact + 1, 0, LINE]
            if z[0] == line and (tangents[0] != lines).any():
                return bool((damping_of(law, contact) != damping_of(law, BACKLASH)).any())
        return False

    def tangents(self, z, along, tangents, periods, limit):
        """Take tangents through mesh periods; see `Base.differentiate`."""
        w = np.hstack([np.eye(2), tangents])
        *_, code, _, _ = self._vary(z, along, w, periods, limit)
        tangents[:] = w[:, 2:]
        return code

    def map_slopes(self, z, along, periods, limit):
        """Return (map, derivatives of its end, status); see `Base.differentiate`."""
        w = np.hstack([np.eye(2), np.zeros((2, len(along)))])
        *_, code, _, _ = self._vary(z, along, w, periods, limit)
        return w[:, :2], w[:, 2:], code

    def map_rates(self, z, along, tangents, periods, limit):
        """Return (map of all periods, its rates, status); see `Base.differentiate`."""
        k = len(along)
        w = np.hstack([np.eye(2), tangents, np.zeros((2, 2 * k))])
        *_, code, _, _ = self._vary(z, along, w, periods, limit)
        return w[:, :2], w[:, 2 + k :].reshape(2, k, 2).swapaxes(0, 1), code

    def differentiate(self, z, along, tangents, span, record):
        """Differentiate a run from z; see `Base.differentiate`."""
        periods, recorded, limit = span
        one_sided = self._one_sided(z, along, tangents)
        w = np.hstack([np.eye(2), tangents])
        record = new_record(*record)
        *_, code, found, grazing = self._vary(
            z, along, w, periods, limit, recorded=recorded, record=record
        )
        return found, code, grazing, one_sided, w[:, 2:]
