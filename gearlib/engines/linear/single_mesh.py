"""Exact runs of piecewise-linear models with one mesh, by the kernels of gear trains."""

import math

import numpy as np

from gearlib.engines import orbit
from gearlib.engines.linear.modal_frame import ModalFrame
from gearlib.engines.linear.periods import EVENT_COLUMNS
from gearlib.engines.linear.propagator import Propagator as Train
from gearlib.engines.orbit import Record


class Propagator(Train):
    """Run a piecewise-linear model with one mesh at one tuning."""

    description, chunk_size, depends_on_tuning = "closed forms", 16, False
    create_frame = ModalFrame.for_mesh

    def __init__(self, model, tuning, other=None):
        """Build the system of a model at a tuning; reuse tables of the propagator `other`."""
        super().__init__(model, tuning, other)
        self.pieces = 0
        # Kernels count displacements from the drive-side flank line.
        self.drive_line = model.flank_lines[0]
        #: Displacement and dx/dtau of the mesh less those of the coordinate, both at the start of a
        #: mesh period: the deviation of the flanks from the involute there.
        self.flank_deviation = np.zeros(model.size)
        # In a model that is given by an equation, a state z is that of the mesh.
        if model.equation is not None:
            # At the start of a mesh period all cosines of the state are 1 and all sines are 0.
            cosines = slice(model.size + 1, None, 2)
            rate = self.system.drive_lines[0] @ self.system.base_matrix
            self.flank_deviation[0] = self.system.drive_lines[0, cosines].sum()
            self.flank_deviation[1] = rate[cosines].sum() / self.system.tuning

    def initial_state(self, state):
        """Return the state z for a state of the mesh, (2,), or of all coordinates, (2 N,)."""
        if len(state) == self.model.size > 2:
            return np.array(state, float)
        return self.model.full_state(self.system, state)[: self.model.size]

    def fill_record(self, z, span, samples, events, summary, first_period):
        """Run from the state z, shape (2 N,), and fill the tables; see `Base.fill_record`."""
        z -= self.flank_deviation
        raw = self.empty_raw_samples(len(samples))
        event_rows = np.empty((len(events), EVENT_COLUMNS))
        period, event_rows, event_count, status, system = self.run_system(
            z, raw, event_rows, span.max_events, summary[None], span[:2], first_period=first_period
        )
        summary[[orbit.X_MAX, orbit.X_MIN]] += self.drive_line
        state = np.ones(self.components)
        state[: z.size] = z * self.scale
        phase = 2.0 * math.pi * (first_period + span.periods) * self.system.harmonics
        state[z.size + 1 :: 2], state[z.size + 2 :: 2] = np.cos(phase), np.sin(phase)
        x = float(self.system.drive_lines[0] @ state) + self.drive_line
        v = float(self.constants.drive_rates[0] @ state) / self.system.tuning
        if not status and len(samples):
            self.fill_samples(raw, samples, system)
        z += self.flank_deviation
        events = event_rows[:event_count, : orbit.EVENT_COLUMNS]
        return Record(z, np.array([x, v]), period, samples, events, summary, status)

    def fill_maps(self, z, *arguments):
        """Fill the derivatives of period maps and move z to the end; see `Base.fill_maps`."""
        z -= self.flank_deviation
        status = super().fill_maps(z, *arguments)
        z += self.flank_deviation
        return status

    def fill_samples(self, raw, samples, system):
        """Fill samples, (k, 6 + e), with the mesh and e model outputs, from `raw` samples."""
        n, count = self.components, orbit.SAMPLE_COLUMNS
        self.fill_mesh_samples(raw, samples[:, :count].reshape(-1, 1, count), system)
        samples[:, orbit.SAMPLE_X] += self.drive_line
        state = raw[:, :n].copy()
        state[:, : self.scale.size] /= self.scale
        contact, segment = raw[:, n].astype(int), raw[:, -1].astype(int)
        output_vectors = self.model.output_rows(system)[:, contact + 1, segment]
        samples[:, count:] = np.einsum("ekn,kn->ke", output_vectors, state)
