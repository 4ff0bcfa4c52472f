"""Models as right-hand sides for methods with steps: dimensionless, over the phase of the run.

A branch of a model is one segment of constant stiffness with one contact code for each of its m
meshes. Where t is an array, shape (k,), states have a row for each, shape (k, size), and so has
what a problem returns. Both classes have the attributes

``starts, first, low``
    phases that bound the segments, where the mesh periods begin among them, and which segments lie
    below the mean: by contact code + 1, segment and mesh;
``repeats, gaps, closing``
    mesh periods after which the excitation repeats; of each mesh its backlash in static
    deflections, and whether both flanks might touch at once.
"""

from typing import Any

import numpy as np

from gearlib.engines.codes import BACKLASH, INVERSE, NORMAL
from gearlib.engines.linear.grid import new_work
from gearlib.engines.linear.train_run import set_contacts
from gearlib.engines.linear.train_system import matrix_of, set_harmonics
from gearlib.engines.pair.motion import contact_between
from gearlib.integrators.steps import equation_of_motion
from gearlib.integrators.steps.equation_of_motion import SIDE

#: Flank lines of a mesh.
NEAR, FAR = 0, 1


def problem_of(model, tuning):
    """Return the right-hand side of a model at one tuning."""
    return Linear(model, tuning) if model.equation is None else OneDegree(model, tuning)


def codes_of(lines):
    """Return the contact codes of distances from near and far flanks, shape (..., 2, m)."""
    near, far = lines[..., NEAR, :], lines[..., FAR, :]
    return np.where(near >= 0.0, NORMAL, np.where(far <= 0.0, INVERSE, BACKLASH))


class _Problem:
    """Segments and contact of a right-hand side."""

    starts: Any
    lines: Any
    speeds: Any

    def segment(self, t):
        """Return the segment of constant stiffness just after a phase."""
        after = np.searchsorted(self.starts, (t + SIDE) % self.starts[-1], side="right")
        return np.minimum(after, len(self.starts) - 1) - 1

    def codes(self, t, z):
        """Return the contact codes of a state, int, shape (m,)."""
        return codes_of(self.lines(t, z))

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
    """One degree of freedom, any damping, stiffness and excitation; z = (x, x').

    With a `sharpness` the contact law is smoothed.
    """

    def __init__(self, model, tuning, sharpness=0.0):
        self.law = law = model.law(tuning)
        self.contact = equation_of_motion.contact_law(law, sharpness)
        self.starts, self.first = law.breaks, np.array([0, len(law.low)])
        self.low = np.repeat(law.low[None, :, None], 3, axis=0)
        self.repeats, self.gaps = 1, np.array([law.gap])
        self.closing = np.array([False])
        self._edges = np.array([law.upper, law.lower])
        self.tuning = tuning

    def start(self, state):
        """Return (z, contact codes) at phase 0."""
        return np.array(state, dtype=float), np.array([contact_between(*self._edges, *state)])

    def ends(self, t, z):
        """Return what a run returns of a state: displacement and velocity."""
        return float(z[0]), float(z[1])

    def lines(self, t, z):
        """Return the distances from near and far flanks, shape (2, m)."""
        return (z[..., :1] - self._edges)[..., None]

    def speeds(self, t, z):
        """Return the rates of `lines` by phase, the same on every branch."""
        return np.full((2, 1), z[1])

    def observe(self, t, z):
        """Return (displacements, velocities) of the meshes."""
        return z[..., :1], z[..., 1:]

    def put(self, t, z, mesh, line, distance):
        """Move z to a distance from a line."""
        z[0] += distance - (z[0] - self._edges[line])

    def jammed(self, t, z):
        """Return whether both flanks touch at once: those of one mesh stand still."""
        return False

    def rate(self, t, z, segment, codes):
        """Return z' on a branch."""
        branch = np.array([t]), z[None], np.array([segment]), codes[None]
        return np.array([z[1], self._on_branches(*branch)[2, 0]])

    def field(self, t, z):
        """Return z' on the branch of a state."""
        return np.array([z[1], equation_of_motion.rate(self.contact, self.law, t, *z)])

    def _on_branches(self, t, z, segments, codes):
        """Return stiffness, elastic deflection, acceleration, shape (3, k)."""
        # Of one layout, since kernels are compiled for each.
        rows = [np.ascontiguousarray(a) for a in (t, segments, codes[:, 0], z)]
        return equation_of_motion.on_branches(self.contact, self.law, *rows).T

    def rates_of_steps(self, start, z, end, new):
        """Return z' at the starts and ends of steps, each with the stiffness inside the step."""
        first, last = self.segment(start), self.segment(end - 2.0 * SIDE)
        ends = (start, z, first), (end, new, last)
        accelerations = [self._on_branches(t, y, p, self.codes(t, y))[2] for t, y, p in ends]
        return np.stack([[z[:, 1], new[:, 1]], accelerations], axis=-1)

    def forces(self, t, z, segments, codes):
        """Return (elastic force, 0): nobody asks one mesh for its mean force."""
        c, g, _ = self._on_branches(t, z, segments, codes)
        forces = (self.tuning**2 * c * g)[:, None]
        return forces, np.zeros_like(forces)

    def fill(self, samples, t, z, segments, codes):
        """Fill the sample table, shape (k, 6), with states on branches."""
        c, g, a = self._on_branches(t, z, segments, codes)
        c = self.tuning**2 * c
        samples[:] = np.stack([z[:, 0], z[:, 1], a, codes[:, 0], c, c * g], axis=1)


class Linear(_Problem):
    """A piecewise-linear system; its constant and its harmonics are given, not solved.

    Rates are by phase; those of a train by theta, reference frequency times time.
    """

    def __init__(self, model, tuning):
        self.propagator = model.propagator(tuning)
        self.system, self._grid = self.propagator.whole()
        system, size = self.system, model.size
        self.starts, self.first, self.low = system.starts, system.first_segment, system.low
        lines = np.atleast_2d(np.array(model.flank_lines).reshape(2, -1))
        self.gaps, self.closing = lines[0] - lines[1], self._grid.may_jam
        self.repeats = system.repeats
        self.tuning, self.size, self._train = tuning, size, bool(model.mesh_names)
        #: From states to those of the system, all components.
        self.unit = np.ones(len(system.base_matrix))
        if not self._train:
            self.unit[:size] = self.propagator.scale
        self.distances = self.unit * np.stack([system.drive_lines, system.coast_lines])
        self._columns = np.moveaxis(self.distances, 2, 1).copy()
        self._rates = (
            self.unit * np.stack([self._grid.drive_rates, self._grid.coast_rates]) / tuning
        )
        self._matrices: dict = {}
        self._meshes = np.arange(len(system.drive_lines))
        # Moves of the coordinates that change the distance of one mesh only.
        self._apart = [np.linalg.pinv(rows[:, : size // 2]) for rows in self.distances]

    def full(self, t, z):
        """Return z with the constant and the harmonics at a phase."""
        whole = np.empty((*np.shape(t), self.unit.size))
        whole[..., : self.size] = z
        fill = set_harmonics if whole.ndim == 1 else equation_of_motion.set_harmonics_of_rows
        fill(self.system.harmonics, whole, t)
        return whole

    def start(self, state):
        """Return (z, contact codes) at phase 0."""
        z = self.propagator.start(state) * (self.propagator.scale / self.unit[: self.size])
        n, m = self.unit.size, self._meshes.size
        work = new_work(n, n, m)
        work.state[:] = self.unit * self.full(0.0, z)
        set_contacts(self.system, self._grid.no_coast_side, work, 0)
        return z, work.contact.copy()

    def ends(self, t, z):
        """Return what a run returns of a state: that of one mesh, coordinates of a train."""
        if self._train:
            half = self.size // 2
            state = z / self.propagator.scale
            return state[:half], state[half:]
        return tuple(float(values[0]) for values in self.observe(t, z))

    def lines(self, t, z):
        """Return the distances from near and far flanks."""
        lines = self.full(t, z) @ self._columns
        return np.moveaxis(lines, 0, 1) if isinstance(t, np.ndarray) else lines

    def speeds(self, t, z):
        """Return the rates of `lines` by phase, the same on every branch."""
        return self._rates @ self.full(t, z)

    def observe(self, t, z):
        """Return (displacements, velocities) of the meshes."""
        full = self.full(t, z)
        return full @ self.distances[NEAR].T, full @ self._rates[NEAR].T

    def put(self, t, z, mesh, line, distance):
        """Move z to a distance from a line."""
        distance = distance - float(self.distances[line, mesh] @ self.full(t, z))
        z[: self.size // 2] += self._apart[line][:, mesh] * distance

    def jammed(self, t, z):
        """Return whether both flanks touch at once in a mesh."""
        return equation_of_motion.jammed(self.system, self.closing, t, z * self.unit[: self.size])

    def couplings(self):
        """Return which entries of `matrix` differ from zero on any branch, bool."""
        push, grip = (
            self.system.force_input[..., : self.size, None],
            self.system.force_output[..., None, :],
        )
        return (self.system.base_matrix[: self.size] != 0.0) | (push * grip != 0.0).any(
            axis=(0, 1, 2)
        )

    def matrix(self, segment, codes):
        """Return the matrix of a branch, from z, the constant and the harmonics to z'."""
        key = segment, codes.tobytes()
        if key not in self._matrices:
            whole = np.empty_like(self.system.base_matrix)
            matrix_of(self.system, self.system.effect[codes + 1, segment, self._meshes], whole)
            rows = whole[: self.size] / self.unit[: self.size, None]
            self._matrices[key] = rows * self.unit / self.tuning
        return self._matrices[key]

    def rate(self, t, z, segment, codes):
        """Return z' on a branch."""
        return self.matrix(segment, codes) @ self.full(t, z)

    def field(self, t, z):
        """Return z' on the branch of a state."""
        unit = self.unit[: self.size]
        return equation_of_motion.train_rate(self.system, t, z * unit) / unit

    def rates_of_steps(self, start, z, end, new):
        """Return the slope of the straight line, for the starts and ends of steps."""
        return np.stack(2 * [(new - z) / (end - start)[:, None]])

    def forces(self, t, z, segments, codes):
        """Return (elastic forces of the meshes, their rates by phase)."""
        full = self.full(t, z)
        c = self.system.stiffness[codes + 1, segments[:, None], self._meshes] * (codes != BACKLASH)
        near, far = (
            np.stack([full @ rows[line].T for rows in (self.distances, self._rates)])
            for line in (NEAR, FAR)
        )
        # Nothing is far behind a flank that is not there.
        return c * np.where(codes == NORMAL, near, far)

    def fill(self, samples, t, z, segments, codes):
        """Fill the samples of the model."""
        raw = np.concatenate([self.unit * self.full(t, z), codes, segments[:, None]], axis=1)
        self.propagator.fill(raw, samples, self.system)
