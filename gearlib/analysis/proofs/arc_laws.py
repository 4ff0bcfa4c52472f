"""Equations of motion z' = A z between events in ball arithmetic, for pairs and trains.

The state is z = (y, dy/dtheta, 1, cos, sin, ...) with the displacements y in the model's unit of
length and theta = tau / nu, the mesh phase over the tuning, so that only harmonics depend on the
tuning. Rigid-body motions V are eliminated from the coordinates; K V = 0, b V = 0 and D V = 0 are
assumed to be exact. Matrices and linear functionals refer to modal components c with z = basis c,
because boxes in modal components grow least.
"""

import math
from typing import Any

import numpy as np

from gearlib.analysis.proofs.balls import flint, to_ball, to_column, to_matrix
from gearlib.analysis.proofs.certificate_files import ProofFailed, TrainDescription
from gearlib.analysis.proofs.models_in_balls import COAST_SIDE, DRIVE_SIDE, ball_model_builder
from gearlib.engines.codes import COAST, NO_CONTACT
from gearlib.models.trains.elastic import free_motions_and_modes

#: Largest force on a rigid-body motion, relative to the largest entry: a thousand rounding errors.
RIGID_BODY_TOLERANCE = 1e-13
#: Largest radius of a time at which the matrix exponential is evaluated directly.
_MAX_TIME_RADIUS = 2.0**-30


def propagate(matrix: Any, columns: Any, time: Any) -> Any:
    """Return exp(matrix time) columns: solutions of z' = matrix z after a time, as columns.

    The columns are initial states. All entries are balls (intervals with error bounds). If the ball
    `time` is wide, the mean value theorem gives a narrower enclosure than the exponential of a wide
    matrix.
    """
    if not time.rad() > _MAX_TIME_RADIUS:
        return (matrix * time).exp() * columns
    midpoint = time.mid()
    columns, difference = (matrix * midpoint).exp() * columns, time - midpoint
    return columns + matrix * ((matrix * difference).exp() * columns) * difference


class ArcDynamics:
    """System matrices A of z' = A z of a model at a tuning, for all contact states and segments.

    The state is z = (y, dy/dtheta, 1, cosine and sine of each harmonic).

    ``retained``, ``fixed``    indices of the coordinates y and of the eliminated coordinates
    ``state_count``, ``size``  number of components of (y, dy/dtheta) and of z
    ``harmonic_columns``       frequency of a harmonic -> index of its cosine in z
    ``basis``, ``basis_inverse``  matrix from modal components to z, shape (size, size), and inverse
    ``distance_rows``          flank distances (coast side or None, drive side) of each mesh, as row
                               vectors (1, size) for modal components
    ``excitation_period``      period of the excitation in mesh periods
    """

    def __init__(self, model, tuning: float):
        """Compute the modal basis and the constant parts of the system matrices in ball arithmetic.

        Balls are intervals with error bounds. `tuning` is mesh frequency over natural frequency.
        The attributes are described in the class.
        """
        build_model = ball_model_builder(model)
        self.model = build_model(model, tuning)
        self.tuning = flint().arb(tuning)
        self.has_one_degree_of_freedom = model.equation is not None
        self.excitation_period = model.repeats
        self.mesh_names = tuple(mesh.name for mesh in self.model.meshes)
        self._system_matrices: dict = {}
        free_motions, natural_frequencies, shapes = _modes(model, self.model)
        self._eliminate_free_motions(free_motions)
        self.state_count = 2 * len(self.retained)
        harmonics = [self.model.force_harmonics, *(mesh.harmonics for mesh in self.model.meshes)]
        frequencies = sorted({frequency for entries in harmonics for frequency in entries})
        # The state z is (y, dy/dtheta, 1, and cosine and sine of each frequency).
        self.size = self.state_count + 1 + 2 * len(frequencies)
        columns = range(self.state_count + 1, self.size, 2)
        self.harmonic_columns = dict(zip(frequencies, columns, strict=True))
        # The normalisation of the mode shapes makes all modal components comparable.
        shapes = np.array(self.reduction.tolist(), float) @ shapes
        shapes = shapes / np.abs(shapes).max(axis=0)
        n = len(self.retained)
        basis = np.eye(self.size)
        basis[:n, :n], basis[n : 2 * n, n : 2 * n] = shapes, shapes * natural_frequencies
        self.basis = to_matrix(basis)
        self.basis_inverse = self.basis.inv()
        # The contributions of the meshes depend on their contact states and are added later.
        self._without_meshes = self._matrix_without_meshes()
        self.distance_rows = [
            [self._distance_row(mesh, side) for side in (COAST_SIDE, DRIVE_SIDE)]
            for mesh in self.model.meshes
        ]

    def _eliminate_free_motions(self, free_motions: np.ndarray) -> None:
        """Choose the retained coordinates and compute the matrix from all n coordinates to them.

        `free_motions`, shape (n, k), has k rigid-body motions, which no spring opposes, as columns.
        They are eliminated by fixing k coordinates and measuring the others relative to these.
        Raise `ProofFailed` if stiffness or damping acts on the rigid-body motions.
        """
        model, n = self.model, len(self.model.coordinates)
        self.fixed = _fixed_coordinates(free_motions)
        self.retained = [i for i in range(n) if i not in self.fixed]
        unit = np.eye(n, dtype=int).astype(object)
        reduction = unit[self.retained]
        if self.fixed:
            # The stiffness matrix includes drive-side contact in all meshes. Its product with a
            # rigid-body motion is zero, and would also be zero with coast-side contact.
            stiffness = model.stiffness.copy()
            for mesh in model.meshes:
                row = mesh.rows[DRIVE_SIDE]
                stiffness += mesh.stiffness[DRIVE_SIDE][0] * np.outer(row, row)
            retained_rows = stiffness[self.retained]
            retained_block = to_matrix(retained_rows[:, self.retained])
            fixed_block = to_matrix(retained_rows[:, self.fixed])
            reduction[:, self.fixed] = retained_block.solve(fixed_block).tolist()
            # Rigid-body motions in balls, each with a unit displacement of one fixed coordinate.
            motions = unit[:, self.fixed]
            motions[self.retained] = -reduction[:, self.fixed]
            mesh_rows = np.array([row for mesh in model.meshes for row in mesh.rows])
            for rows in (model.stiffness, model.damping, mesh_rows):
                largest = max(float(abs(value).upper()) for value in rows.flat)
                residuals = (to_matrix(rows) * to_matrix(motions)).entries()
                tolerance = RIGID_BODY_TOLERANCE * largest * n
                if not all(abs(residual) <= tolerance for residual in residuals):
                    message = "trains with springs or dampers against rotation are not supported"
                    raise ProofFailed("model", message)
        self.reduction = to_matrix(reduction)
        #: Matrix from forces on all coordinates to accelerations of the retained coordinates.
        self._accelerance = self.reduction * to_matrix(model.mass).inv()

    def _distance_row(self, mesh: Any, side: int) -> Any:
        """Return the row (1, size) whose product with the modal components is a flank distance.

        The flank distance is zero where the flanks touch. `mesh` is a `BallMesh`, and `side` is
        COAST_SIDE or DRIVE_SIDE. Return None for the coast side if the backlash is infinite.
        """
        if mesh.constants[side] is None:
            return None
        row = np.zeros(self.size, object)
        length = self.model.length
        row[: len(self.retained)] = [mesh.rows[side][i] for i in self.retained]
        # This state component is always 1.
        row[self.state_count] = mesh.constants[side] / length
        for frequency, amplitudes in mesh.harmonics.items():
            cosine, sine = amplitudes[side]
            column = self.harmonic_columns[frequency]
            row[column : column + 2] = cosine / length, sine / length
        return to_matrix(row[None]) * self.basis

    def _accelerations(self, forces: np.ndarray) -> np.ndarray:
        """Return the accelerations of the retained coordinates due to forces on all n coordinates.

        `forces` has the shape (n, k), with a column for each load case; the accelerations have the
        shape (number of retained coordinates, k). All entries are balls (intervals).
        """
        return np.array((self._accelerance * to_matrix(forces)).tolist())

    def _matrix_without_meshes(self) -> Any:
        """Return the system matrix A of z' = A z without mesh forces, shape (size, size).

        The state z is (y, dy/dtheta, 1, cosine and sine of each harmonic), where theta is time
        times the reference frequency. The matrix is transformed to modal components.
        """
        model, n = self.model, len(self.retained)
        omega = model.frequency  # unit of frequencies, rad/s
        acceleration_unit = omega**2 * model.length
        displacements, velocities = slice(n), slice(n, 2 * n)
        matrix = np.zeros((self.size, self.size), object)
        matrix[displacements, velocities] = np.eye(n, dtype=int)
        stiffness, damping = model.stiffness[:, self.retained], model.damping[:, self.retained]
        matrix[velocities, displacements] = self._accelerations(-stiffness) / omega**2
        matrix[velocities, velocities] = self._accelerations(-damping) / omega
        matrix[velocities, [2 * n]] = self._accelerations(model.load[:, None]) / acceleration_unit
        for frequency, column in self.harmonic_columns.items():
            # Cosine and sine of the phase rotate: cos' = -rate sin, sin' = rate cos.
            rate = to_ball(frequency) * self.tuning
            matrix[column, column + 1], matrix[column + 1, column] = -rate, rate
            if frequency in model.force_harmonics:
                accelerations = self._accelerations(np.transpose(model.force_harmonics[frequency]))
                matrix[velocities, column : column + 2] = accelerations / acceleration_unit
        return self.basis_inverse * to_matrix(matrix) * self.basis

    def system_matrix(self, contact_states: list, segment: int) -> Any:
        """Return the system matrix A of z' = A z for the contact states of the meshes on a segment.

        `contact_states` has 1 (drive side), 0 (no contact) or -1 (coast side) for each mesh.
        `segment` is the index of a `Segment`, an interval of the excitation period with constant
        stiffness. Matrices are cached, because many arcs share them.
        """
        conditions = self.model.segments[segment].conditions
        mesh_states = []
        for contact, sides in zip(contact_states, conditions, strict=True):
            if contact == NO_CONTACT:
                mesh_states.append((contact,))
            else:
                # Index of the mesh stiffness and direction of sliding (1 or -1) for friction.
                side = COAST_SIDE if contact == COAST else DRIVE_SIDE
                stiffness_level, sliding_sign = sides[side]
                mesh_states.append((contact, stiffness_level, sliding_sign))
        key = tuple(mesh_states)
        if key not in self._system_matrices:
            terms = (self._mesh_matrix(j, *state) for j, state in enumerate(mesh_states))
            self._system_matrices[key] = sum(terms, self._without_meshes)
        return self._system_matrices[key]

    def _mesh_matrix(self, j: int, contact: int, level: int = 0, sliding_sign: int = 0) -> Any:
        """Return the contribution of mesh j to the system matrix A of z' = A z.

        `contact` is its contact state: 1 drive side, 0 no contact, -1 coast side. `level` is the
        index of the stiffness (0 upper, 1 lower), and `sliding_sign`, 1 or -1, is the sliding
        direction, which friction opposes; neither is used without contact.
        """
        mesh = self.model.meshes[j]
        omega = self.model.frequency  # unit of frequencies, rad/s
        side = COAST_SIDE if contact == COAST else DRIVE_SIDE
        distance = self.distance_rows[j][side]
        # The rate of the flank distance does not depend on accelerations, so mesh forces do not
        # affect it.
        rate = distance * self._without_meshes
        if contact == NO_CONTACT:
            return self._force_matrix(mesh.rows[DRIVE_SIDE], rate * (mesh.backlash_damping / omega))
        # In coast-side contact the backlash damping acts on the drive-side rate and the remaining
        # damping on the coast-side rate. If the clearance is constant, both rates are equal, and
        # the damping is not split, so that undamped motions are exactly undamped.
        is_split = side == COAST_SIDE and mesh.clearance_varies
        damping = mesh.damping[side] - (mesh.backlash_damping if is_split else 0)
        elastic = distance * (mesh.stiffness[side][level] / omega**2)
        contribution = self._force_matrix(mesh.rows[side], elastic + rate * (damping / omega))
        if is_split:
            contribution += self._mesh_matrix(j, NO_CONTACT)
        if mesh.sliding_row is not None:
            friction = elastic * (mesh.friction[side] * sliding_sign)
            contribution += self._force_matrix(mesh.sliding_row, friction)
        return contribution

    def _force_matrix(self, direction: np.ndarray, force: Any) -> Any:
        """Return the contribution of a force, such as a mesh force, to the system matrix A.

        `force` is the row (1, size) whose product with the modal components of the state z is the
        force. `direction`, shape (n,), has the components of the force on the coordinates; the
        force acts in the negative direction, as a spring opposes its elongation.
        """
        n, column = len(self.retained), np.zeros((self.size, 1), object)
        column[n : 2 * n] = self._accelerations(-np.array(direction)[:, None])
        return self.basis_inverse * to_matrix(column) * force

    def initial_state(self, state: np.ndarray) -> list:
        """Convert a state (q, dq/dtau) to balls (y, dy/dtheta) of the retained coordinates.

        `state`, shape (2 n,), has all n coordinates q and their derivatives with respect to the
        mesh phase tau. Since theta = tau / nu, derivatives with respect to theta are larger by the
        tuning nu.
        """
        q, q_rates = np.array(state, float).reshape(2, -1).tolist()
        y = (self.reduction * to_column(q)).entries()
        y_rates = (self.reduction * to_column(q_rates)).entries()
        return [*y, *(rate * self.tuning for rate in y_rates)]

    def train_description(self, contact_states: tuple) -> TrainDescription | None:
        """Return the description of a train for its certificate; None with one degree of freedom.

        `contact_states` has the state of each mesh at tau = 0: 1 drive side, 0 no contact, -1 coast
        side.
        """
        if self.has_one_degree_of_freedom:
            return None
        names = self.model.coordinates
        return TrainDescription(
            meshes=self.mesh_names,
            contacts=tuple(contact_states),
            coordinates=names,
            fixed=tuple(names[i] for i in self.fixed),
            derived=self.model.derived,
        )


def _modes(model, ball_model: Any) -> tuple:
    """Return (rigid-body motions, natural frequencies, mode shapes) with all teeth in contact.

    They are floats, because they only define a basis. `ball_model` is the `BallModel` of `model`.
    Motions and shapes are columns over the coordinates; frequencies are relative to the reference
    frequency of the tuning.
    """
    if model.train is None:
        (mesh,) = ball_model.meshes
        ground_stiffness, mass = ball_model.stiffness[0, 0], ball_model.mass[0, 0]
        stiffness = float(ground_stiffness) + max(map(float, mesh.stiffness[DRIVE_SIDE]))
        frequency = math.sqrt(stiffness / float(mass)) / float(ball_model.frequency)
        # The mesh supports the only degree of freedom, so there is no rigid-body motion.
        return np.zeros((1, 0)), frequency, np.eye(1)
    structure = model.train.structure
    mesh_rows = structure.mesh_jacobian
    spring_rows, spring_stiffnesses = structure.springs
    # Meshes act as additional springs.
    mesh_stiffnesses = [mesh.max_stiffness for mesh in model.train.meshes]
    rows = np.vstack([spring_rows, mesh_rows])
    stiffnesses = np.append(spring_stiffnesses, mesh_stiffnesses)
    modes = free_motions_and_modes((rows, stiffnesses), structure.masses)
    frequencies = np.sqrt(modes.squared_frequencies) / float(ball_model.frequency)
    return modes.free_motions, frequencies, modes.shapes


def _fixed_coordinates(motions: np.ndarray) -> list[int]:
    """Return the sorted indices of k coordinates that determine k rigid-body motions.

    `motions`, shape (n, k), has a rigid-body motion of all n coordinates in each column. Fixing the
    returned coordinates prevents all rigid-body motions.
    """
    coordinates, remaining = [], np.array(motions)
    # Each elimination step fixes one coordinate and removes one motion.
    while remaining.shape[1]:
        max_entries = np.abs(remaining).max(axis=1)
        # The first large entry is the pivot, because the index of the largest may depend on
        # rounding errors.
        row = int(np.argmax(max_entries >= 0.5 * max_entries.max()))
        column = int(np.abs(remaining[row]).argmax())
        factors = remaining[row] / remaining[row, column]
        remaining = np.delete(remaining - np.outer(remaining[:, column], factors), column, axis=1)
        coordinates.append(row)
    return sorted(coordinates)
