"""Exact runs of piecewise-linear models with one mesh, by the kernels of gear trains."""

import math

import numpy as np

from gearlib.engines import orbit
from gearlib.engines.linear.modal_frame import Frame
from gearlib.engines.linear.periods import EVENT_COLUMNS
from gearlib.engines.linear.propagator import Propagator as Train
from gearlib.engines.linear.record import SUMMARY_COLUMNS
from gearlib.engines.orbit import Record


class Propagator(Train):
    """A piecewise-linear model at one tuning."""

    description, chunk_size, turning = "closed forms", 16, False
    create_frame = Frame.of_mesh

    def __init__(self, model, tuning, other=None):
        """Build the system at a tuning; take over the tables of another propagator, if given."""
        super().__init__(model, tuning, other)
        self.pieces = 0
        # Kernels count displacements from the drive-side flank line.
        self.line = model.flank_lines[0]
        #: Deviation of the flanks and its rate by phase at the start of a mesh period, by which
        #: displacements of one degree of freedom differ from the first coordinate.
        self.shift = np.zeros(model.size)
        if model.equation is not None:
            cosines = slice(model.size + 1, None, 2)
            rate = self.system.drive_lines[0] @ self.system.base_matrix
            self.shift[0] = self.system.drive_lines[0, cosines].sum()
            self.shift[1] = rate[cosines].sum() / self.system.tuning

    def start(self, state):
        """Return the state z for the displacement and velocity of the mesh or all coordinates."""
        if len(state) == self.model.size > 2:
            return np.array(state, float)
        return self.model.initial(self.system, state)[: self.model.size]

    def fill_record(self, z, span, samples, events, summary, first):
        """Run from z and fill the tables; see `Base.fill_record`."""
        z -= self.shift
        table, raw = np.empty((1, SUMMARY_COLUMNS)), self.raw(len(samples))
        rows = np.empty((len(events), EVENT_COLUMNS))
        result = self.run_system(z, raw, rows, span.max_events, table, span[:2], first=first)
        period, rows, count, code, system = result
        summary[:] = table[0, : orbit.SUMMARY_COLUMNS]
        summary[[orbit.X_MAX, orbit.X_MIN]] += self.line
        full = np.ones(self.components)
        full[: z.size] = z * self.scale
        phase = 2.0 * math.pi * (first + span.periods) * self.system.harmonics
        full[z.size + 1 :: 2], full[z.size + 2 :: 2] = np.cos(phase), np.sin(phase)
        x = float(self.system.drive_lines[0] @ full) + self.line
        v = float(self.grid.drive_rates[0] @ full) / self.system.tuning
        if not code and len(samples):
            self.fill(raw, samples, system)
        z += self.shift
        events = rows[:count, : orbit.EVENT_COLUMNS]
        return Record(z, np.array([x, v]), period, samples, events, summary, code)

    def fill_maps(self, z, *arguments):
        """Fill the maps of mesh periods and move z to the end; return the status."""
        z -= self.shift
        code = super().fill_maps(z, *arguments)
        z += self.shift
        return code

    def fill(self, raw, samples, system):
        """Fill samples, shape (k, 6 + e), with the mesh and e outputs, from raw samples."""
        n, count = self.components, orbit.SAMPLE_COLUMNS
        self.fill_meshes(raw, samples[:, :count].reshape(-1, 1, count), system)
        samples[:, orbit.SAMPLE_X] += self.line
        state = raw[:, :n].copy()
        state[:, : self.scale.size] /= self.scale
        rows = self.model.outputs(system)[:, raw[:, n].astype(int) + 1, raw[:, -1].astype(int)]
        samples[:, count:] = np.einsum("ekn,kn->ke", rows, state)
