"""Models as right-hand sides for solvers in Python: dimensionless, over the phase of the run.

A branch of a model is one segment of constant stiffness with one contact code for each of its m
meshes. Both classes offer

``starts, first, low``
    phases that bound the segments, where the mesh periods begin among them, and which segments lie
    below the mean: by contact code + 1, segment and mesh;
``repeats, gaps, closing``
    mesh periods after which the excitation repeats; of each mesh its backlash in static
    deflections, and whether both flanks might touch at once;
``start(state)``
    (z, contact codes) at phase 0, ``ends(t, z)`` what a run returns of a state;
``rate(t, z, segment, codes)``
    z' on a branch, ``field(t, z)`` the same on that of the state;
``lines(t, z)``
    distances from near and far flanks, (2, m), ``speeds(t, z)`` their rates by phase;
``observe(t, z)``
    (displacements, velocities) of the meshes;
``forces(t, z, segment, codes)``
    elastic forces of the meshes and their rates by phase;
``due(t, z, exits, distance)``
    which of the flank lines that may end a phase z is on or beyond, on its way out
``put(t, z, mesh, line, distance)``
    move z to a distance from a line;
``jammed(t, z)``
    whether both flanks touch at once;
``fill(rows, samples)``
    the sample table of rows (phase, state, segment, contact codes).
"""

import math
from bisect import bisect_right
from typing import Any

import numpy as np

from gearlib.kernels.closed_form.mesh_constants import contact_between
from gearlib.kernels.codes import BACKLASH, INVERSE, NORMAL
from gearlib.kernels.several_meshes.grid import work_of
from gearlib.kernels.several_meshes.train_run import set_contacts
from gearlib.kernels.several_meshes.train_system import matrix_of, set_harmonics
from gearlib.kernels.steps import train_steps
from gearlib.kernels.steps.equation_of_motion import SIDE
from gearlib.kernels.taylor.series import damping_of

_TURN = 2.0 * math.pi


def problem_of(model, tuning):
    """Return the right-hand side of a model at one tuning."""
    return Linear(model, tuning) if model.equation is None else OneDegree(model, tuning)


def _wave(rows, phase):
    return sum(a * math.cos(n * phase) + b * math.sin(n * phase) for n, a, b in rows)


class _Problem:
    """What both have in common."""

    _starts: list
    lines: Any
    speeds: Any
    rate: Any

    def segment(self, t):
        """Return the segment of constant stiffness just after a phase."""
        at = bisect_right(self._starts, (t + SIDE) % self._starts[-1])
        return min(at, len(self._starts) - 1) - 1

    def codes(self, t, z):
        """Return the contact codes of a state, int, shape (m,)."""
        near, far = self.lines(t, z)
        return np.where(near >= 0.0, NORMAL, np.where(far <= 0.0, INVERSE, BACKLASH))

    def field(self, t, z):
        """Return z' on the branch of a state."""
        return self.rate(t, z, self.segment(t), self.codes(t, z))

    def due(self, t, z, exits, distance):
        """Return which exit z is beyond, or before by less than a distance, going out; or None."""
        lines, speeds = self.lines(t, z).tolist(), None
        for i, leave in enumerate(exits):
            if leave.direction * lines[leave.line][leave.mesh] > -distance:
                speeds = self.speeds(t, z) if speeds is None else speeds
                if leave.direction * speeds[leave.line][leave.mesh] > 0.0:
                    return i
        return None


class OneDegree(_Problem):
    """One degree of freedom, any damping, stiffness and excitation; z = (x, x')."""

    def __init__(self, model, tuning):
        self.law = law = model.law(tuning)
        self.starts, self._starts = law.breaks, law.breaks.tolist()
        self.first = np.array([0, len(law.low)])
        self.low = np.repeat(law.low[None, :, None], 3, axis=0)
        self.repeats, self.gaps = 1, np.array([law.gap])
        self.closing = np.array([False])
        self._edges, self._ground = np.array([[law.upper], [law.lower]]), law.ground
        self._places = law.upper, law.lower
        near = law.pieces.tolist(), law.stiffness.tolist()
        far = law.far_pieces.tolist(), law.far_stiffness.tolist()
        self._stiffness = {NORMAL: near, BACKLASH: near, INVERSE: far}
        self._force = law.force.tolist()
        codes = (NORMAL, BACKLASH, INVERSE)
        self._damping = {code: damping_of(law, code).tolist() for code in codes}
        self._powers = law.powers.tolist()
        self.tuning, self._unit = tuning, tuning * tuning

    def start(self, state):
        """Return (z, contact codes) at phase 0."""
        (upper,), (lower,) = self._edges
        return np.array(state, dtype=float), np.array([contact_between(upper, lower, *state)])

    def ends(self, t, z):
        """Return what a run returns of a state: displacement and velocity."""
        return float(z[0]), float(z[1])

    def lines(self, t, z):
        """Return the distances from near and far flank."""
        return z[0] - self._edges

    def speeds(self, t, z):
        """Return their rates."""
        return np.array(((z[1],), (z[1],)))

    def due(self, t, z, exits, distance):
        """Return which exit z is at: in floats, since solvers ask before each phase."""
        (x, v), edges = z.tolist(), self._places
        for i, leave in enumerate(exits):
            if leave.direction * (x - edges[leave.line]) > -distance and leave.direction * v > 0.0:
                return i
        return None

    def observe(self, t, z):
        """Return (displacement, velocity)."""
        return z[:1], z[1:]

    def put(self, t, z, mesh, line, distance):
        """Move z to a distance from a line."""
        z[0] += distance - (z[0] - self._edges[line, 0])

    def jammed(self, t, z):
        """Return whether both flanks touch at once: edges stand still."""
        return False

    def _mesh(self, t, x, piece, contact):
        """Return (c, c g)."""
        lines, waves = self._stiffness[contact]
        value, slope = lines[piece]
        # From the start of the piece, also where rounding puts t just before it.
        inside = (t - self._starts[piece] + 1e-6) % _TURN - 1e-6
        c = value + slope * inside + _wave(waves, t)
        if contact == BACKLASH:
            return c, 0.0
        u = x - float(self._edges[0 if contact == NORMAL else 1, 0])
        return c, c * (u + (self._powers[0] * abs(u) + self._powers[1] * u * u) * u)

    def rate(self, t, z, segment, codes):
        """Return z' on a branch."""
        (x, v), contact = z.tolist(), int(codes[0])
        d1, d2, d3 = self._damping[contact]
        drag = (d1 + (d2 + d3 * abs(v)) * abs(v)) * v
        push = self._mesh(t, x, segment, contact)[1]
        return np.array([v, _wave(self._force, t) - drag - push - self._ground * x])

    def forces(self, t, z, segment, codes):
        """Return (force, 0): nobody asks one mesh for its mean force."""
        push = self._mesh(t, float(z[0]), segment, int(codes[0]))[1]
        return np.array([self._unit * push]), np.zeros(1)

    def fill(self, rows, samples):
        """Fill samples, shape (k, 6)."""
        for (t, z, segment, codes), sample in zip(rows, samples, strict=False):
            c, push = self._mesh(t, float(z[0]), segment, int(codes[0]))
            a = self.rate(t, z, segment, codes)[1]
            sample[:] = z[0], z[1], a, codes[0], self._unit * c, self._unit * push


class Linear(_Problem):
    """A piecewise-linear system; its constant and its harmonics are given, not solved.

    Rates are by phase; those of a train by theta, reference frequency times time.
    """

    def __init__(self, model, tuning):
        self.propagator = model.propagator(tuning)
        self.system, self._grid = self.propagator.whole()
        system, size = self.system, model.size
        self.starts, self._starts = system.starts, system.starts.tolist()
        self.first, self.low, self.repeats = system.first_segment, system.low, system.repeats
        lines = np.atleast_2d(np.array(model.flank_lines).reshape(2, -1))
        self.gaps, self.closing = lines[0] - lines[1], self._grid.closing
        self.tuning, self.size, self._train = tuning, size, bool(model.mesh_names)
        #: From states to those of the system, all components.
        self.unit = np.ones(len(system.free))
        if not self._train:
            self.unit[:size] = self.propagator.scale
        self._lines = self.unit * np.stack([system.near, system.far])
        self._flat = self._lines.reshape(-1, self.unit.size)
        rates = np.stack([self._grid.rate, self._grid.far_rate])
        self._rates = self.unit * rates / tuning
        self._matrices: dict = {}
        self._meshes = np.arange(len(system.near))
        # Moves of the coordinates that change the distance of one mesh only.
        self._apart = [np.linalg.pinv(rows[:, : size // 2]) for rows in self._lines]

    def full(self, t, z):
        """Return z with the constant and the harmonics at a phase."""
        whole = np.empty(self.unit.size)
        whole[: self.size] = z
        set_harmonics(self.system.harmonics, whole, t)
        return whole

    def start(self, state):
        """Return (z, contact codes) at phase 0."""
        z = self.propagator.start(state) * (self.propagator.scale / self.unit[: self.size])
        n, m = self.unit.size, self._meshes.size
        work = work_of(n, n, m)
        work.z[:] = self.unit * self.full(0.0, z)
        set_contacts(self.system, self._grid.open, work, 0)
        return z, work.contact.copy()

    def ends(self, t, z):
        """Return what a run returns of a state: that of one mesh, coordinates of a train."""
        if self._train:
            half = self.size // 2
            own = z / self.propagator.scale
            return own[:half], own[half:]
        return tuple(float(one[0]) for one in self.observe(t, z))

    def lines(self, t, z):
        """Return the distances from near and far flanks."""
        return (self._flat @ self.full(t, z)).reshape(2, -1)

    def speeds(self, t, z):
        """Return their rates by phase, the same on every branch."""
        return self._rates @ self.full(t, z)

    def observe(self, t, z):
        """Return (displacements, velocities) of the meshes."""
        full = self.full(t, z)
        return self._lines[0] @ full, self._rates[0] @ full

    def put(self, t, z, mesh, line, distance):
        """Move z to a distance from a line."""
        distance = distance - float(self._lines[line, mesh] @ self.full(t, z))
        z[: self.size // 2] += self._apart[line][:, mesh] * distance

    def jammed(self, t, z):
        """Return whether both flanks touch at once in a mesh."""
        return train_steps.jammed(self.system, self.closing, t, z * self.unit[: self.size])

    def matrix(self, segment, codes):
        """Return the matrix dz/dtau of a branch, shape (size, n)."""
        key = segment, codes.tobytes()
        if key not in self._matrices:
            whole = np.empty_like(self.system.free)
            matrix_of(self.system, self.system.effect[codes + 1, segment, self._meshes], whole)
            rows = whole[: self.size] / self.unit[: self.size, None]
            self._matrices[key] = rows * self.unit / self.tuning
        return self._matrices[key]

    def rate(self, t, z, segment, codes):
        """Return z' on a branch."""
        return self.matrix(segment, codes) @ self.full(t, z)

    def field(self, t, z):
        """Return z' on the branch of a state."""
        return train_steps.rate(self.system, t, z) if self._train else super().field(t, z)

    def forces(self, t, z, segment, codes):
        """Return (elastic forces of the meshes, their rates by phase)."""
        full = self.full(t, z)
        c = self.system.stiffness[codes + 1, segment, self._meshes] * (codes != BACKLASH)
        line = (codes != NORMAL).astype(int)
        own, rates = self._lines[line, self._meshes], self._rates[line, self._meshes]
        # Nothing is far behind a flank that is not there.
        return c * (own @ full), c * (rates @ full)

    def fill(self, rows, samples):
        """Fill the samples of the model."""
        raw = [
            np.concatenate([self.unit * self.full(t, z), codes, [segment]])
            for t, z, segment, codes in rows
        ]
        self.propagator.fill(np.array(raw), samples, self.system)
