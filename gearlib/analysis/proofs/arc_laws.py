"""The law of an arc in balls: z' = A z between events, for pairs as for trains.

The state is z = (y, dy/dtheta, 1, cos, sin, ...) with y in the model's unit of length and theta the
phase over nu, so that the tuning has a part in harmonics only. Free motions V are taken out of the
coordinates; K V = 0, b V = 0 and D V = 0 are taken as exact. Matrices and functionals are those of
modal components, z = basis c, which rotate in pairs: that widens boxes least.
"""

import math
from typing import Any

import numpy as np

from gearlib.analysis.proofs.balls import ball_of, column_of, flint, matrix_of
from gearlib.analysis.proofs.certificate_files import TrainFacts, Uncertain
from gearlib.analysis.proofs.models_in_balls import COAST, DRIVE, numbers_of
from gearlib.engines.codes import BACKLASH, INVERSE
from gearlib.models.trains.elastic import free_motions_and_modes

#: Largest force on a free motion, relative to the largest entry: a thousand roundings.
FREE_MOTION_TOLERANCE = 1e-13
#: Largest radius of a time for which the exponential itself is enclosed.
_MAX_TIME_RADIUS = 2.0**-30


def propagated(law: Any, columns: Any, time: Any) -> Any:
    """Return columns, states z with z' = law z, propagated by a time: exp(law time) columns.

    All are balls; a wide time is treated by the mean value theorem.
    """
    if not time.rad() > _MAX_TIME_RADIUS:
        return (law * time).exp() * columns
    middle = time.mid()
    columns, difference = (law * middle).exp() * columns, time - middle
    return columns + law * ((law * difference).exp() * columns) * difference


class ArcLaws:
    """The matrices A of a model at a tuning, for all contact codes and segments.

    ``retained``, ``fixed``    indices of the coordinates y, and of their references
    ``state_count``, ``size``  components of (y, dy/dtheta), and of z
    ``wave_columns``           frequency of a harmonic -> component of z that is its cosine
    ``basis``, ``basis_inverse``  of the modal components, shape (size, size)
    ``distances``              functionals of modal components over the flanks of every mesh, a row
                               (1, size) each: (coast side or None, drive side)
    ``common_period``          mesh periods after which the excitation repeats
    """

    def __init__(self, model, tuning: float):
        """Set the laws of the arcs of a model at a tuning in balls, in a modal basis."""
        self.numbers, self.tuning = numbers_of(model, tuning), flint().arb(tuning)
        self.one_degree, self.common_period = model.equation is not None, model.repeats
        self.mesh_names = tuple(mesh.name for mesh in self.numbers.meshes)
        self._laws: dict = {}
        free, natural, shapes = _modes(model, self.numbers)
        self._take_out_free_motions(free)
        self.state_count = 2 * len(self.retained)
        waves = [self.numbers.force_waves, *(mesh.waves for mesh in self.numbers.meshes)]
        frequencies = sorted({frequency for entries in waves for frequency in entries})
        self.size = self.state_count + 1 + 2 * len(frequencies)
        columns = range(self.state_count + 1, self.size, 2)
        self.wave_columns = dict(zip(frequencies, columns, strict=True))
        self._set_basis(shapes, natural)
        self._without_meshes = self._law_without_meshes()
        self.distances = [
            [self._distance(mesh, side) for side in (COAST, DRIVE)] for mesh in self.numbers.meshes
        ]

    def _take_out_free_motions(self, free_motions: np.ndarray) -> None:
        """Set the retained coordinates and the matrix from all n coordinates to them.

        Free motions, without any force, are the columns of an array of shape (n, k).
        """
        numbers, n = self.numbers, len(self.numbers.coordinates)
        self.fixed = _fixed_coordinates(free_motions)
        self.retained = [i for i in range(n) if i not in self.fixed]
        unit = np.eye(n, dtype=int).astype(object)
        reduction = unit[self.retained]
        if self.fixed:
            total = numbers.stiffness.copy()
            for mesh in numbers.meshes:
                row = mesh.rows[DRIVE]
                total += mesh.stiffness[DRIVE][0] * np.outer(row, row)
            inner, outer = (
                total[self.retained][:, self.retained],
                total[self.retained][:, self.fixed],
            )
            reduction[:, self.fixed] = matrix_of(inner).solve(matrix_of(outer)).tolist()
            motions = unit[:, self.fixed]
            motions[self.retained] = -reduction[:, self.fixed]
            self._check_free_motions(matrix_of(motions))
        self.reduction = matrix_of(reduction)
        #: Accelerations of the retained coordinates by forces on all.
        self._mobility = self.reduction * matrix_of(numbers.mass).inv()

    def _check_free_motions(self, motions: Any) -> None:
        """Raise `Uncertain` if a stiffness or a damping acts on a free motion, a column (n,)."""
        numbers, n = self.numbers, len(self.numbers.coordinates)
        mesh_rows = np.array([row for mesh in numbers.meshes for row in mesh.rows])
        for rows in (numbers.stiffness, numbers.damping, mesh_rows):
            largest = max(float(abs(value).upper()) for value in rows.flat)
            residuals = (matrix_of(rows) * motions).entries()
            if not all(abs(x) <= FREE_MOTION_TOLERANCE * largest * n for x in residuals):
                text = "no proof is written for a train whose free rotation is damped"
                raise Uncertain("model", text)

    def _set_basis(self, shapes: np.ndarray, frequencies: np.ndarray) -> None:
        """Set the modal basis, exact floats, and its inverse.

        Mode shapes are columns, frequencies are in units of the tuning.
        """
        e, basis = len(self.retained), np.eye(self.size)
        shapes = np.array(self.reduction.tolist(), float) @ shapes
        # Shapes are scaled to the same size, so that all components are of the same size.
        shapes = shapes / np.abs(shapes).max(axis=0)
        basis[:e, :e], basis[e : 2 * e, e : 2 * e] = shapes, shapes * frequencies
        self.basis = matrix_of(basis)
        self.basis_inverse = self.basis.inv()

    def _distance(self, mesh: Any, side: int) -> Any:
        """Return the distance of the flanks of a mesh as a functional of the state, (1, size).

        It is None for a side, COAST or DRIVE, without flanks.
        """
        if mesh.constants[side] is None:
            return None
        row, length = np.zeros(self.size, object), self.numbers.length
        row[: len(self.retained)] = [mesh.rows[side][i] for i in self.retained]
        row[self.state_count] = mesh.constants[side] / length
        for frequency, waves in mesh.waves.items():
            column = self.wave_columns[frequency]
            row[column : column + 2] = [value / length for value in waves[side]]
        return matrix_of(row[None]) * self.basis

    def _accelerations(self, forces: np.ndarray) -> np.ndarray:
        """Return accelerations (e, k) of the e retained coordinates by forces (n, k) on all n."""
        return np.array((self._mobility * matrix_of(forces)).tolist())

    def _law_without_meshes(self) -> Any:
        """Return the matrix A without the forces of the meshes."""
        numbers, e, omega = self.numbers, len(self.retained), self.numbers.frequency
        unit, law = omega**2 * numbers.length, np.zeros((self.size, self.size), object)
        law[:e, e : 2 * e] = np.eye(e, dtype=int)
        law[e : 2 * e, :e] = self._accelerations(-numbers.stiffness[:, self.retained]) / omega**2
        law[e : 2 * e, e : 2 * e] = self._accelerations(-numbers.damping[:, self.retained]) / omega
        law[e : 2 * e, [2 * e]] = self._accelerations(numbers.load[:, None]) / unit
        for frequency, column in self.wave_columns.items():
            turning_rate = ball_of(frequency) * self.tuning
            law[column, column + 1], law[column + 1, column] = -turning_rate, turning_rate
            if frequency in numbers.force_waves:
                waves = np.transpose(numbers.force_waves[frequency])
                law[e : 2 * e, column : column + 2] = self._accelerations(waves) / unit
        return self.basis_inverse * matrix_of(law) * self.basis

    def law(self, codes: list, segment: int) -> Any:
        """Return the matrix A of z' = A z for the contact codes of all meshes on a segment."""
        conditions = self.numbers.segments[segment].conditions
        mesh_states = []
        for code, sides in zip(codes, conditions, strict=True):
            level_and_sliding = sides[COAST if code == INVERSE else DRIVE] if code else ()
            mesh_states.append((code, *level_and_sliding))
        states = tuple(mesh_states)
        if states not in self._laws:
            changes = (self._law_of_mesh(j, *state) for j, state in enumerate(states))
            self._laws[states] = sum(changes, self._without_meshes)
        return self._laws[states]

    def _law_of_mesh(self, j: int, code: int, level: int = 0, sliding_sign: int = 0) -> Any:
        """Return the contribution of mesh j to the matrix A, (size, size), at a contact code.

        The stiffness level is 0 or 1, the sliding sign that of friction. Without contact only the
        damping in the backlash acts.
        """
        mesh, omega = self.numbers.meshes[j], self.numbers.frequency
        side = COAST if code == INVERSE else DRIVE
        rate = self.distances[j][side] * self._without_meshes
        if not code:
            return self._law_of_force(mesh.rows[DRIVE], rate * (mesh.backlash_damping / omega))
        # If the rates of both sides are equal, undamped motions stay exactly undamped.
        has_film = side == COAST and mesh.clearance_varies
        damping = mesh.damping[side] - (mesh.backlash_damping if has_film else 0)
        elastic = self.distances[j][side] * (mesh.stiffness[side][level] / omega**2)
        change = self._law_of_force(mesh.rows[side], elastic + rate * (damping / omega))
        if has_film:
            change += self._law_of_mesh(j, BACKLASH)
        if mesh.sliding_row is not None:
            friction = elastic * (mesh.friction[side] * sliding_sign)
            change += self._law_of_force(mesh.sliding_row, friction)
        return change

    def _law_of_force(self, mesh_vector: np.ndarray, force: Any) -> Any:
        """Return the contribution to the matrix A of a force against a mesh vector, shape (n,).

        The force is a functional of the state, shape (1, size).
        """
        e, column = len(self.retained), np.zeros((self.size, 1), object)
        column[e : 2 * e] = self._accelerations(-np.array(mesh_vector)[:, None])
        return self.basis_inverse * matrix_of(column) * force

    def initial_state(self, state: np.ndarray) -> list:
        """Return (y, dy/dtheta) of the retained coordinates, balls, from a state (q, dq/dtau)."""
        values = np.array(state, float).reshape(2, -1)
        y, rates = ((self.reduction * column_of(half)).entries() for half in values.tolist())
        return [*y, *(rate * self.tuning for rate in rates)]

    def all_coordinates(self, state: list, scale: Any) -> tuple[list, list]:
        """Return displacements and dq/dtau of all coordinates, 0 for the fixed ones.

        The state is (y, dy/dtheta) of the retained coordinates, the scale 1 / nu, all balls.
        """
        values = np.full((2, len(self.numbers.coordinates)), flint().arb(0))
        values[:, self.retained] = np.array(state[: self.state_count]).reshape(2, -1)
        return values[0].tolist(), (values[1] * scale).tolist()

    def train_facts(self, codes: tuple) -> TrainFacts | None:
        """Return names and start contact codes of a train, None for one degree of freedom."""
        if self.one_degree:
            return None
        names = self.numbers.coordinates
        return TrainFacts(
            meshes=self.mesh_names,
            contacts=tuple(codes),
            coordinates=names,
            fixed=tuple(names[i] for i in self.fixed),
            derived=self.numbers.derived,
        )


def _modes(model, numbers: Any) -> tuple:
    """Return (free motions, eigenfrequencies as tunings, shapes) of a model in contact, in floats.

    `numbers` are its `ModelNumbers`; motions and shapes are columns.
    """
    if model.train is None:
        (mesh,), ground = numbers.meshes, numbers.stiffness[0, 0]
        stiffness = float(ground) + max(map(float, mesh.stiffness[DRIVE]))
        natural = math.sqrt(stiffness / float(numbers.mass[0, 0])) / float(numbers.frequency)
        return np.zeros((1, 0)), natural, np.eye(1)
    structure, meshes = model.train.structure, model.train.meshes
    directions, stiffness = structure.springs
    levels = [mesh.max_stiffness for mesh in meshes]
    springs = np.vstack([directions, structure.lines]), np.append(stiffness, levels)
    modes = free_motions_and_modes(springs, structure.masses)
    return modes.free, np.sqrt(modes.squares) / float(numbers.frequency), modes.shapes


def _fixed_coordinates(motions: np.ndarray) -> list[int]:
    """Return indices of coordinates that determine k free motions, columns of shape (n, k)."""
    coordinates, remaining = [], np.array(motions)
    while remaining.shape[1]:
        size = np.abs(remaining).max(axis=1)
        # The largest entry would depend on rounding, so the first large one is taken.
        row = int(np.argmax(size >= 0.5 * size.max()))
        column = int(np.abs(remaining[row]).argmax())
        shares = remaining[row] / remaining[row, column]
        remaining = np.delete(remaining - np.outer(remaining[:, column], shares), column, axis=1)
        coordinates.append(row)
    return sorted(coordinates)
