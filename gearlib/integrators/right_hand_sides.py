"""Models as right-hand sides for solvers in Python: dimensionless, over the phase of the run.

A branch of a model is one piece of the stiffness with one contact code. Both classes offer

``breaks, low``
    phases that bound the pieces of one mesh period, and whether a piece lies below the mean;
``repeats``
    mesh periods after which the excitation repeats;
``closing``
    whether both flanks might touch at once;
``start(state)``
    (z, contact code) at phase 0;
``rate(t, z, piece, contact)``
    z' on a branch;
``lines(t, z)``
    displacements over the normal and the far flank;
``observe(t, z)``
    (displacement, velocity);
``sample(t, z, piece, contact)``
    a row of the sample table.
"""

import math

import numpy as np

from gearlib.kernels.closed_form.mesh_constants import contact_between
from gearlib.kernels.codes import BACKLASH, INVERSE, NORMAL
from gearlib.kernels.several_meshes.grid import work_of
from gearlib.kernels.several_meshes.train_run import set_contacts
from gearlib.kernels.several_meshes.train_system import set_harmonics
from gearlib.kernels.taylor.series import damping_of
from gearlib.models.one_mesh_system import by_phase


def problem_of(pair, tuning):
    """Return the right-hand side of a model at one tuning."""
    return Linear(pair, tuning) if pair.equation is None else OneDegree(pair, tuning)


def _wave(rows, phase):
    return sum(a * math.cos(n * phase) + b * math.sin(n * phase) for n, a, b in rows)


class OneDegree:
    """One degree of freedom, any damping, stiffness and excitation; z = (x, x')."""

    def __init__(self, pair, tuning):
        law = pair.law(tuning)
        self.breaks, self.low, self.gap = law.breaks, law.low, law.gap
        self.repeats, self.closing = 1, False
        self._upper, self._lower, self._ground = law.upper, law.lower, law.ground
        near = law.pieces.tolist(), law.stiffness.tolist()
        far = law.far_pieces.tolist(), law.far_stiffness.tolist()
        self._stiffness = {NORMAL: near, BACKLASH: near, INVERSE: far}
        self._starts, self._force = law.breaks.tolist(), law.force.tolist()
        codes = (NORMAL, BACKLASH, INVERSE)
        self._damping = {code: damping_of(law, code).tolist() for code in codes}
        self._powers = law.powers.tolist()
        self._unit = tuning * tuning

    def start(self, state):
        """Return (z, contact code) at phase 0."""
        return np.array(state, dtype=float), contact_between(self._upper, self._lower, *state)

    def lines(self, t, z):
        """Return the displacements over the normal and the far flank."""
        return z[0] - self._upper, z[0] - self._lower

    def observe(self, t, z):
        """Return (displacement, velocity)."""
        return z[0], z[1]

    def _mesh(self, t, x, piece, contact):
        """Return (c, c g)."""
        lines, waves = self._stiffness[contact]
        value, slope = lines[piece]
        # From the start of the piece, also where rounding puts t just before it.
        inside = (t - self._starts[piece] + 1e-6) % (2.0 * math.pi) - 1e-6
        c = value + slope * inside + _wave(waves, t)
        if contact == BACKLASH:
            return c, 0.0
        u = x - (self._upper if contact == NORMAL else self._lower)
        return c, c * (u + (self._powers[0] * abs(u) + self._powers[1] * u * u) * u)

    def rate(self, t, z, piece, contact):
        """Return z' on a branch."""
        x, v = z.tolist()
        d1, d2, d3 = self._damping[contact]
        drag = (d1 + (d2 + d3 * abs(v)) * abs(v)) * v
        push = self._mesh(t, x, piece, contact)[1]
        return np.array([v, _wave(self._force, t) - drag - push - self._ground * x])

    def sample(self, t, z, piece, contact):
        """Return a row of the sample table."""
        c, push = self._mesh(t, z[0], piece, contact)
        a = self.rate(t, z, piece, contact)[1]
        return z[0], z[1], a, contact, self._unit * c, self._unit * push


class Linear:
    """A piecewise-linear system z' = A z; its constant and its harmonics are given, not solved."""

    def __init__(self, pair, tuning):
        self._propagator = pair.propagator(tuning)
        self.system = self._propagator.system
        self.outputs = pair.outputs(self.system)
        self.breaks, self.low = self.system.starts, self.system.low[2, :, 0]
        self.near, self.far = self.system.near[0], self.system.far[0]
        segments = range(len(self.low))
        # By contact code + 1 and segment, with rates by phase.
        self.a = np.array([[by_phase(self.system, [c], p) for p in segments] for c in (-1, 0, 1)])
        self.gap, self.repeats = pair.backlash_ratio, pair.repeats
        self.closing = bool(self._propagator.grid.closing[0])
        self._moving = pair.size

    def _full(self, t, z):
        full = np.empty(self.near.size)
        full[: self._moving] = z
        set_harmonics(self.system.harmonics, full, t)
        return full

    def start(self, state):
        """Return (z, contact code) at phase 0."""
        z = self._propagator.start(state)
        work = work_of(self.near.size, self.near.size, 1)
        work.z[:] = self._full(0.0, z)
        work.z[: self._moving] *= self._propagator.scale
        set_contacts(self.system, self._propagator.grid.open, work, 0)
        return z, int(work.contact[0])

    def lines(self, t, z):
        """Return the displacements over the normal and the far flank."""
        full = self._full(t, z)
        return self.near @ full, self.far @ full

    def observe(self, t, z):
        """Return (displacement, velocity)."""
        full = self._full(t, z)
        # The velocity of y is the same on every branch.
        return self.near @ full, self.near @ (self.a[1, 0] @ full)

    def rate(self, t, z, piece, contact):
        """Return z' on a branch."""
        return self.a[contact + 1, piece, : self._moving] @ self._full(t, z)

    def sample(self, t, z, piece, contact):
        """Return a row of the sample table."""
        a, full = self.a[contact + 1, piece], self._full(t, z)
        rate, c = a @ full, self.system.stiffness[contact + 1, piece, 0]
        lines = {NORMAL: self.near @ full, BACKLASH: 0.0, INVERSE: self.far @ full}
        row = self.near @ full, self.near @ rate, self.near @ (a @ rate), contact, c
        return *row, c * lines[contact], *(self.outputs[:, contact + 1, piece] @ full)
