"""Equations of motion z' = A z between events in ball arithmetic, for pairs and trains.

The state is z = (y, dy/dtheta, 1, cos, sin, ...) with y in the model's unit of length and theta the
phase over nu, so that only harmonics depend on the tuning. Free motions V are eliminated from the
coordinates; K V = 0, b V = 0 and D V = 0 are assumed to be exact. Matrices and functionals refer to
modal components, z = basis c, which rotate in pairs: boxes of them grow least.
"""

import math
from typing import Any

import numpy as np

from gearlib.analysis.proofs.balls import ball_of, column_of, flint, matrix_of
from gearlib.analysis.proofs.certificate_files import ProofFailed, TrainDescription
from gearlib.analysis.proofs.models_in_balls import COAST, DRIVE, ball_model
from gearlib.engines.codes import BACKLASH, INVERSE
from gearlib.models.trains.elastic import free_motions_and_modes

#: Largest force on a free motion, relative to the largest entry: a thousand rounding errors.
FREE_MOTION_TOLERANCE = 1e-13
#: Largest radius of a time for which the matrix exponential is evaluated directly.
_MAX_TIME_RADIUS = 2.0**-30


def propagated(matrix: Any, columns: Any, time: Any) -> Any:
    """Return columns, states with z' = matrix z, propagated by a time: exp(matrix time) columns.

    All are balls. If that of the time is wide, the mean value theorem is used.
    """
    if not time.rad() > _MAX_TIME_RADIUS:
        return (matrix * time).exp() * columns
    middle = time.mid()
    columns, difference = (matrix * middle).exp() * columns, time - middle
    return columns + matrix * ((matrix * difference).exp() * columns) * difference


class ArcDynamics:
    """System matrices A of a model at a tuning, for all contact codes and segments.

    ``retained``, ``fixed``    indices of the coordinates y, and of the eliminated coordinates
    ``state_count``, ``size``  number of components of (y, dy/dtheta), and of z
    ``wave_columns``           frequency of a harmonic -> index of its cosine in z
    ``basis``, ``basis_inverse``  of the modal components, shape (size, size)
    ``distances``              flank distances of each mesh as functionals of modal components, rows
                               (1, size): (coast side or None, drive side)
    ``common_period``          period of the excitation in mesh periods
    """

    def __init__(self, model, tuning: float):
        """Compute modal basis and matrices of a model at a tuning in ball arithmetic."""
        self.model, self.tuning = ball_model(model, tuning), flint().arb(tuning)
        self.one_degree, self.common_period = model.equation is not None, model.repeats
        self.mesh_names = tuple(mesh.name for mesh in self.model.meshes)
        self._system_matrices: dict = {}
        free_motions, natural_frequencies, shapes = _modes(model, self.model)
        self._eliminate_free_motions(free_motions)
        self.state_count = 2 * len(self.retained)
        waves = [self.model.force_waves, *(mesh.waves for mesh in self.model.meshes)]
        frequencies = sorted({frequency for entries in waves for frequency in entries})
        self.size = self.state_count + 1 + 2 * len(frequencies)
        columns = range(self.state_count + 1, self.size, 2)
        self.wave_columns = dict(zip(frequencies, columns, strict=True))
        self._set_basis(shapes, natural_frequencies)
        self._without_meshes = self._matrix_without_meshes()
        self.distances = [
            [self._distance(mesh, side) for side in (COAST, DRIVE)] for mesh in self.model.meshes
        ]

    def _eliminate_free_motions(self, free_motions: np.ndarray) -> None:
        """Set the retained coordinates and the matrix from all n coordinates to them.

        `free_motions` are the rigid-body motions without any force, columns of shape (n, k).
        """
        model, n = self.model, len(self.model.coordinates)
        self.fixed = _fixed_coordinates(free_motions)
        self.retained = [i for i in range(n) if i not in self.fixed]
        unit = np.eye(n, dtype=int).astype(object)
        reduction = unit[self.retained]
        # The combinations of retained and fixed coordinates vanish for free motions.
        if self.fixed:
            total = model.stiffness.copy()
            for mesh in model.meshes:
                row = mesh.rows[DRIVE]
                total += mesh.stiffness[DRIVE][0] * np.outer(row, row)
            retained_rows = total[self.retained]
            inner, outer = retained_rows[:, self.retained], retained_rows[:, self.fixed]
            reduction[:, self.fixed] = matrix_of(inner).solve(matrix_of(outer)).tolist()
            motions = unit[:, self.fixed]
            motions[self.retained] = -reduction[:, self.fixed]
            self._check_free_motions(matrix_of(motions))
        self.reduction = matrix_of(reduction)
        #: Matrix from forces on all coordinates to accelerations of the retained ones.
        self._mobility = self.reduction * matrix_of(model.mass).inv()

    def _check_free_motions(self, motions: Any) -> None:
        """Raise `ProofFailed` if stiffness or damping act on the free motions, columns (n, k)."""
        model, n = self.model, len(self.model.coordinates)
        mesh_rows = np.array([row for mesh in model.meshes for row in mesh.rows])
        for rows in (model.stiffness, model.damping, mesh_rows):
            largest = max(float(abs(value).upper()) for value in rows.flat)
            residuals = (matrix_of(rows) * motions).entries()
            if not all(abs(x) <= FREE_MOTION_TOLERANCE * largest * n for x in residuals):
                text = "no proof is written for a train whose free rotation is damped"
                raise ProofFailed("model", text)

    def _set_basis(self, shapes: np.ndarray, frequencies: np.ndarray) -> None:
        """Set the modal basis, exact floats, and its inverse.

        The columns of `shapes` are mode shapes; the frequencies are in units of the tuning.
        """
        e, basis = len(self.retained), np.eye(self.size)
        shapes = np.array(self.reduction.tolist(), float) @ shapes
        # The normalisation of the shapes makes all modal components comparable.
        shapes = shapes / np.abs(shapes).max(axis=0)
        basis[:e, :e], basis[e : 2 * e, e : 2 * e] = shapes, shapes * frequencies
        self.basis = matrix_of(basis)
        self.basis_inverse = self.basis.inv()

    def _distance(self, mesh: Any, side: int) -> Any:
        """Return the flank distance of a mesh as a functional of modal components, (1, size).

        The side is COAST or DRIVE; the result is None if the mesh has no contact on this side.
        """
        if mesh.constants[side] is None:
            return None
        row, length = np.zeros(self.size, object), self.model.length
        row[: len(self.retained)] = [mesh.rows[side][i] for i in self.retained]
        row[self.state_count] = mesh.constants[side] / length
        for frequency, waves in mesh.waves.items():
            column = self.wave_columns[frequency]
            row[column : column + 2] = [value / length for value in waves[side]]
        return matrix_of(row[None]) * self.basis

    def _accelerations(self, forces: np.ndarray) -> np.ndarray:
        """Return accelerations (e, k) of the e retained coordinates for forces (n, k) on all n."""
        return np.array((self._mobility * matrix_of(forces)).tolist())

    def _matrix_without_meshes(self) -> Any:
        """Return the system matrix A without mesh forces."""
        model, e, omega = self.model, len(self.retained), self.model.frequency
        unit, matrix = omega**2 * model.length, np.zeros((self.size, self.size), object)
        matrix[:e, e : 2 * e] = np.eye(e, dtype=int)
        matrix[e : 2 * e, :e] = self._accelerations(-model.stiffness[:, self.retained]) / omega**2
        matrix[e : 2 * e, e : 2 * e] = self._accelerations(-model.damping[:, self.retained]) / omega
        matrix[e : 2 * e, [2 * e]] = self._accelerations(model.load[:, None]) / unit
        for frequency, column in self.wave_columns.items():
            rate = ball_of(frequency) * self.tuning
            matrix[column, column + 1], matrix[column + 1, column] = -rate, rate
            if frequency in model.force_waves:
                waves = np.transpose(model.force_waves[frequency])
                matrix[e : 2 * e, column : column + 2] = self._accelerations(waves) / unit
        return self.basis_inverse * matrix_of(matrix) * self.basis

    def system_matrix(self, codes: list, segment: int) -> Any:
        """Return the matrix A of z' = A z for the contact codes of all meshes on a segment."""
        conditions = self.model.segments[segment].conditions
        mesh_states = []
        for code, sides in zip(codes, conditions, strict=True):
            level_and_sliding = sides[COAST if code == INVERSE else DRIVE] if code else ()
            mesh_states.append((code, *level_and_sliding))
        states = tuple(mesh_states)
        if states not in self._system_matrices:
            terms = (self._mesh_matrix(j, *state) for j, state in enumerate(states))
            self._system_matrices[states] = sum(terms, self._without_meshes)
        return self._system_matrices[states]

    def _mesh_matrix(self, j: int, code: int, level: int = 0, sliding_sign: int = 0) -> Any:
        """Return the contribution of mesh j to the matrix A, (size, size), for a contact code.

        The stiffness level is 0 or 1, the sliding sign that of friction. Without contact there is
        only the damping in the backlash.
        """
        mesh, omega = self.model.meshes[j], self.model.frequency
        side = COAST if code == INVERSE else DRIVE
        rate = self.distances[j][side] * self._without_meshes
        if not code:
            return self._force_matrix(mesh.rows[DRIVE], rate * (mesh.backlash_damping / omega))
        # Only with a varying clearance do the rates of both sides differ; otherwise the damping is
        # not split, so that undamped motions are exactly undamped.
        has_film = side == COAST and mesh.clearance_varies
        damping = mesh.damping[side] - (mesh.backlash_damping if has_film else 0)
        elastic = self.distances[j][side] * (mesh.stiffness[side][level] / omega**2)
        contribution = self._force_matrix(mesh.rows[side], elastic + rate * (damping / omega))
        if has_film:
            contribution += self._mesh_matrix(j, BACKLASH)
        if mesh.sliding_row is not None:
            friction = elastic * (mesh.friction[side] * sliding_sign)
            contribution += self._force_matrix(mesh.sliding_row, friction)
        return contribution

    def _force_matrix(self, direction: np.ndarray, force: Any) -> Any:
        """Return the contribution to the matrix A of a force against a direction, shape (n,).

        The force is a functional of modal components, shape (1, size).
        """
        e, column = len(self.retained), np.zeros((self.size, 1), object)
        column[e : 2 * e] = self._accelerations(-np.array(direction)[:, None])
        return self.basis_inverse * matrix_of(column) * force

    def initial_state(self, state: np.ndarray) -> list:
        """Return (y, dy/dtheta) of the retained coordinates in balls for a state (q, dq/dtau)."""
        values = np.array(state, float).reshape(2, -1)
        y, rates = ((self.reduction * column_of(half)).entries() for half in values.tolist())
        return [*y, *(rate * self.tuning for rate in rates)]

    def all_coordinates(self, state: list, scale: Any) -> tuple[list, list]:
        """Return displacements and dq/dtau of all coordinates, 0 for the fixed ones.

        `state` is (y, dy/dtheta) of the retained coordinates, `scale` is 1 / nu, all in balls.
        """
        values = np.full((2, len(self.model.coordinates)), flint().arb(0))
        values[:, self.retained] = np.array(state[: self.state_count]).reshape(2, -1)
        return values[0].tolist(), (values[1] * scale).tolist()

    def train_description(self, codes: tuple) -> TrainDescription | None:
        """Return names and initial contact codes of a train, None for one degree of freedom."""
        if self.one_degree:
            return None
        names = self.model.coordinates
        return TrainDescription(
            meshes=self.mesh_names,
            contacts=tuple(codes),
            coordinates=names,
            fixed=tuple(names[i] for i in self.fixed),
            derived=self.model.derived,
        )


def _modes(model, balls: Any) -> tuple:
    """Return (free motions, natural frequencies as tunings, mode shapes) in contact, as floats.

    `balls` is the `BallModel` of the model; motions and shapes are columns.
    """
    if model.train is None:
        (mesh,), ground = balls.meshes, balls.stiffness[0, 0]
        stiffness = float(ground) + max(map(float, mesh.stiffness[DRIVE]))
        frequency = math.sqrt(stiffness / float(balls.mass[0, 0])) / float(balls.frequency)
        return np.zeros((1, 0)), frequency, np.eye(1)
    structure, meshes = model.train.structure, model.train.meshes
    directions, stiffness = structure.springs
    levels = [mesh.max_stiffness for mesh in meshes]
    springs = np.vstack([directions, structure.lines]), np.append(stiffness, levels)
    modes = free_motions_and_modes(springs, structure.masses)
    return modes.free, np.sqrt(modes.squares) / float(balls.frequency), modes.shapes


def _fixed_coordinates(motions: np.ndarray) -> list[int]:
    """Return the sorted indices of k coordinates that determine k free motions, columns (n, k)."""
    coordinates, remaining = [], np.array(motions)
    while remaining.shape[1]:
        sizes = np.abs(remaining).max(axis=1)
        # The first large entry is used: the index of the largest may depend on rounding errors.
        row = int(np.argmax(sizes >= 0.5 * sizes.max()))
        column = int(np.abs(remaining[row]).argmax())
        factors = remaining[row] / remaining[row, column]
        remaining = np.delete(remaining - np.outer(remaining[:, column], factors), column, axis=1)
        coordinates.append(row)
    return sorted(coordinates)
