"""Piecewise-linear models with one mesh: modes of their contacts, as of gear trains."""

import math

import numpy as np

from gearlib.kernels import orbit
from gearlib.kernels.several_meshes.periods import EVENT_COLUMNS
from gearlib.kernels.several_meshes.record import SUMMARY_COLUMNS
from gearlib.models.derivatives import START, STEP
from gearlib.models.propagators.base import Base
from gearlib.models.propagators.matrix_slopes import MatrixSlopes
from gearlib.models.propagators.modal_frame import Frame
from gearlib.models.propagators.several_meshes import Propagator as Train


class Propagator(Train):
    """A piecewise-linear model at one tuning."""

    words, chunk, turning = Base.words, Base.chunk, False
    new_frame = Frame.of_mesh

    def __init__(self, model, tuning, other=None):
        super().__init__(model, tuning, other)
        self.pieces = 0
        # Displacements are counted from where they are 0, distances from the flank line.
        self.line = model.flank_lines[0]

    def start(self, state):
        """Return the state z; see `Base.start`."""
        if len(state) == self.model.size > 2:
            return np.array(state, float)
        return self.model.initial(self.system, state)[: self.model.size]

    def run(self, z, periods, record_periods, samples, events, limit, summary, first=0):
        """Run from z; see `Base.run`."""
        table, raw = np.empty((1, SUMMARY_COLUMNS)), self.raw(len(samples))
        rows = np.empty((len(events), EVENT_COLUMNS))
        spans = periods, record_periods
        done = self.go(z, raw, rows, limit, table, spans, first=first)
        period, rows, found, code, system = done
        summary[:] = table[0, : orbit.SUMMARY_COLUMNS]
        summary[[orbit.X_MAX, orbit.X_MIN]] += self.line
        full = np.ones(self.components)
        full[: z.size] = z * self.scale
        phase = 2.0 * math.pi * (first + periods) * self.system.harmonics
        full[z.size + 1 :: 2], full[z.size + 2 :: 2] = np.cos(phase), np.sin(phase)
        x = float(self.system.near[0] @ full) + self.line
        v = float(self.grid.rate[0] @ full) / self.system.tuning
        if not code and len(samples):
            self.fill(raw, samples, system)
        return x, v, period, rows[:, : orbit.EVENT_COLUMNS], found, code, 0

    def watched(self, *arguments, **named):
        """Return what maps and a run tell, of one run; see `Base.watched`."""
        *found, summary = super().watched(*arguments, **named)
        summary[:, [orbit.X_MAX, orbit.X_MIN]] += self.line
        return *found, summary

    def fill(self, raw, samples, system):
        """Fill samples, shape (k, 6 + e), from states, contact codes and segments."""
        n, count = self.components, orbit.SAMPLE_COLUMNS
        self.fill_meshes(raw, samples[:, :count].reshape(-1, 1, count), system)
        samples[:, orbit.SAMPLE_X] += self.line
        state = raw[:, :n].copy()
        state[:, : self.scale.size] /= self.scale
        rows = self.model.outputs(system)[:, raw[:, n].astype(int) + 1, raw[:, -1].astype(int)]
        samples[:, count:] = np.einsum("ekn,kn->ke", rows, state)

    def slopes_along(self, along):
        """Return what the system changes by; see `Matrices`."""
        model, tuning, systems = self.model, self.system.tuning, [self.system]
        self.twins, outputs = [], [model.outputs(self.system)]
        for slopes in along:
            fields = {name: one for name, one in slopes.items() if name not in ("tuning", *START)}
            twin = model.complex_step(fields)
            system = twin.system(tuning + 1j * STEP * slopes.get("tuning", 0.0))
            self.twins.append((twin, system))
            systems.append(system)
            outputs.append(twin.outputs(system))
        switches = math.pi * np.array([[slopes.get("contact_ratio", 0.0) for slopes in along]])
        near = np.array([one.near for one in systems]) + 0j
        # Of a displacement, not a distance.
        near[:, 0, model.size] += [self.line, *(twin.flank_lines[0] for twin, _ in self.twins)]
        return MatrixSlopes(systems, model.size, switches, outputs, near)

    def start_tangents(self, state, along):
        """Return what the start changes by, shape (size, k); see `Matrices.start_tangents`."""
        if len(state) > 2:
            if any(name in slopes for slopes in along for name in START):
                raise ValueError(
                    f"sensitivities = {' and '.join(map(repr, START))} is not allowed with all "
                    f"{len(state)} components of initial_state: it must have two"
                )
            return np.zeros((len(state), len(along)))
        self.slopes(along)
        columns = []
        for (twin, system), slopes in zip(self.twins, along, strict=True):
            moved = [
                x + 1j * STEP * slopes.get(name, 0.0) for x, name in zip(state, START, strict=True)
            ]
            columns.append(twin.initial(system, moved)[: self.model.size].imag / STEP)
        return np.array(columns).T

    def final(self, walk):
        """Return the derivatives of displacement and velocity; see `Matrices.final`."""
        rows, slopes = walk.slopes.rows(walk.codes, walk.segments)
        return rows[:2] @ walk.block[walk.q :].T + (slopes[:, :2] @ walk.block[0]).T

    def switches(self, mesh):
        """Return the phases of switches, rising, 2 pi the last; see `Base.differentiate`."""
        return self.system.starts
