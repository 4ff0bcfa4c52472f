"""The law of an arc in balls: z' = A z between events, for pairs as for trains.

The state is z = (y, dy/dtheta, 1, cos, sin, ...) with y in the model's unit of length and theta the
phase over nu, so that the tuning has a part in harmonics only. Motions V that no stiffness resists
are taken out: of as many coordinates q_p as there are such motions the others are counted from,
y = q_e - V_e q_p with V_p = I. K V = 0, b V = 0 and D V = 0 are taken as exact: the numbers of a
train have them up to their rounding only.

Matrices and functionals are those of modal components, z = basis c, near to the natural modes:
there a motion is hardly more than a rotation of each pair of components, which widens boxes least.
"""

import numpy as np

from gearlib.analysis.proofs.balls import ball_of, column_of, flint, matrix_of
from gearlib.analysis.proofs.certificate_files import TrainFacts, Uncertain
from gearlib.analysis.proofs.models_in_balls import COAST, DRIVE, numbers_of
from gearlib.engines.codes import INVERSE, NORMAL

#: Of the largest entry: a free motion is free up to this, a thousand roundings of floats.
FREE_MOTION_TOLERANCE = 1e-13
_SIDES = COAST, DRIVE
#: A time with a larger radius moves a state by the mean value of its speed.
_THIN_TIME = 2.0**-30


def moved(law, columns, time):
    """Return columns of modal components after a time, exp(A t) of them.

    A wide time moves them by the mean value of their speed: A z is known better than exp(A t).
    """
    if not time.rad() > _THIN_TIME:
        return (law * time).exp() * columns
    middle = time.mid()
    columns, difference = (law * middle).exp() * columns, time - middle
    return columns + law * ((law * difference).exp() * columns) * difference


class ArcLaws:
    """All laws of a model at a tuning.

    ``retained``, ``fixed``    numbers of the coordinates y, and of those that they are counted from
    ``state_count``, ``size``  components of (y, dy/dtheta), and of z
    ``basis``, ``basis_inverse``  of the modal components, shape (size, size)
    ``distances``              functionals of modal components over the flanks of every mesh, a row
                               (1, size) each: (coast side or None, drive side)
    ``common_period``          mesh periods after which the excitation repeats
    """

    def __init__(self, model, tuning):
        self.numbers, self.tuning = numbers_of(model, tuning), flint().arb(tuning)
        self.one_degree, self.common_period = model.equation is not None, model.repeats
        self.mesh_names = tuple(mesh.name for mesh in self.numbers.meshes)
        self._laws: dict = {}
        modes = self.numbers.modes()
        self._take_out_free_motions(modes.free)
        waves = [self.numbers.force_waves, *(mesh.waves for mesh in self.numbers.meshes)]
        self.frequencies = sorted({frequency for entries in waves for frequency in entries})
        self.state_count = 2 * len(self.retained)
        self.size = self.state_count + 1 + 2 * len(self.frequencies)
        self._set_basis(modes)
        self._set_laws()

    def _take_out_free_motions(self, free):
        """Set which coordinates are retained, and what takes all coordinates to them."""
        numbers, n = self.numbers, len(self.numbers.coordinates)
        self.fixed = _fixed_coordinates(free)
        self.retained = [i for i in range(n) if i not in self.fixed]
        reduction = np.eye(n, dtype=int).astype(object)[self.retained]
        if self.fixed:
            total = numbers.stiffness_in_contact()
            inner, outer = (
                matrix_of(total[np.ix_(self.retained, columns)])
                for columns in (self.retained, self.fixed)
            )
            reduction[:, self.fixed] = inner.solve(outer).tolist()
            motions = np.eye(n, dtype=int).astype(object)[:, self.fixed]
            motions[self.retained] = -reduction[:, self.fixed]
            self._check_free_motions(matrix_of(motions))
        self.reduction = matrix_of(reduction)
        #: Accelerations of the retained coordinates by forces on all.
        self._mobility = self.reduction * matrix_of(numbers.mass).inv()

    def _check_free_motions(self, motions):
        """Refuse a train whose free motion is none, or is damped."""
        numbers, n = self.numbers, len(self.numbers.coordinates)
        mesh_rows = np.array([row for mesh in numbers.meshes for row in mesh.rows])
        for rows in (numbers.stiffness, numbers.damping, mesh_rows):
            largest = max(float(abs(value).upper()) for value in rows.flat)
            for value in (matrix_of(rows) * motions).entries():
                if not abs(value) <= FREE_MOTION_TOLERANCE * largest * n:
                    raise Uncertain(
                        "model", "no proof is written for a train whose free rotation is damped"
                    )

    def _set_basis(self, modes):
        """Set the modal basis; an exact matrix of floats, its inverse in balls."""
        e, basis = len(self.retained), np.eye(self.size)
        shapes = np.array(self.reduction.tolist(), float) @ modes.shapes
        # Of like size, so that all components are.
        shapes = shapes / np.abs(shapes).max(axis=0)
        basis[:e, :e] = shapes
        basis[e : 2 * e, e : 2 * e] = shapes * (
            np.sqrt(modes.squares) / float(self.numbers.frequency)
        )
        self.basis = matrix_of(basis)
        self.basis_inverse = self.basis.inv()

    def _wave_columns(self):
        """Return (column of the cosine, frequency) of all harmonics."""
        first = self.state_count + 1
        return [(first + 2 * j, frequency) for j, frequency in enumerate(self.frequencies)]

    def _distance(self, mesh, side):
        """Return the distance over the flanks of a side, a row over z, shape (1, size)."""
        if mesh.constants[side] is None:
            return None
        row, length = np.zeros(self.size, object), self.numbers.length
        row[: len(self.retained)] = [mesh.rows[side][i] for i in self.retained]
        row[self.state_count] = mesh.constants[side] / length
        for column, frequency in self._wave_columns():
            if frequency in mesh.waves:
                row[column : column + 2] = [x / length for x in mesh.waves[frequency][side]]
        return matrix_of(row[None])

    def _accelerations(self, forces):
        """Return those of the retained coordinates by forces, arrays of balls (e, k), (n, k)."""
        return np.array((self._mobility * matrix_of(forces)).tolist())

    def _push(self, row):
        """Return the rate of modal components by a force against a functional, (size, 1)."""
        e, column = len(self.retained), np.zeros((self.size, 1), object)
        column[e : 2 * e] = self._accelerations(-np.array(row)[:, None])
        return self.basis_inverse * matrix_of(column)

    def _set_laws(self):
        """Set the law without meshes, distances, and what the force of every mesh does."""
        numbers, e, omega = self.numbers, len(self.retained), self.numbers.frequency
        unit, meshes = omega**2 * numbers.length, numbers.meshes
        law = np.zeros((self.size, self.size), object)
        law[:e, e : 2 * e] = np.eye(e, dtype=int)
        law[e : 2 * e, :e] = self._accelerations(-numbers.stiffness[:, self.retained]) / omega**2
        law[e : 2 * e, e : 2 * e] = self._accelerations(-numbers.damping[:, self.retained]) / omega
        law[e : 2 * e, [2 * e]] = self._accelerations(numbers.load[:, None]) / unit
        for column, frequency in self._wave_columns():
            turning_rate = ball_of(frequency) * self.tuning
            law[column, column + 1], law[column + 1, column] = -turning_rate, turning_rate
            if frequency in numbers.force_waves:
                waves = np.transpose(numbers.force_waves[frequency])
                law[e : 2 * e, column : column + 2] = self._accelerations(waves) / unit
        self._without_meshes = self.basis_inverse * matrix_of(law) * self.basis
        self.distances = [
            [_times(self._distance(mesh, side), self.basis) for side in _SIDES] for mesh in meshes
        ]
        #: Rates of the distances: the accelerations have no part in them.
        self._rates = [
            [_times(row, self._without_meshes) for row in rows] for rows in self.distances
        ]
        self._pushes = [[self._push(row) for row in mesh.rows] for mesh in meshes]

    def law(self, codes, segment):
        """Return the matrix A for the contact codes of all meshes on a segment."""
        states = []
        for code, sides in zip(codes, self.numbers.segments[segment].conditions, strict=True):
            states.append((code, *sides[COAST if code == INVERSE else DRIVE]) if code else ())
        key = tuple(states)
        if key not in self._laws:
            matrix = self._without_meshes * 1
            for j, state in enumerate(states):
                matrix += self._contact(j, *state) if state else self._oil_film(j)
            self._laws[key] = matrix
        return self._laws[key]

    def _oil_film(self, j):
        """Return by what a mesh without contact changes the law, shape (size, size)."""
        damping = self.numbers.meshes[j].backlash_damping / self.numbers.frequency
        return self._pushes[j][DRIVE] * (self._rates[j][DRIVE] * damping)

    def _contact(self, j, code, level, sliding_sign):
        """Return by what a mesh in contact changes the law, shape (size, size)."""
        mesh, omega = self.numbers.meshes[j], self.numbers.frequency
        side = DRIVE if code == NORMAL else COAST
        elastic = self.distances[j][side] * (mesh.stiffness[side][level] / omega**2)
        # Where the rates of both sides are the same, what is not damped is so exactly.
        has_film = side == COAST and mesh.clearance_varies
        damping = mesh.damping[side] - (mesh.backlash_damping if has_film else 0)
        change = self._pushes[j][side] * (elastic + self._rates[j][side] * (damping / omega))
        if has_film:
            change += self._oil_film(j)
        if mesh.sliding_row is not None:
            friction = elastic * (mesh.friction[side] * sliding_sign)
            change += self._push(mesh.sliding_row) * friction
        return change

    def initial_state(self, state):
        """Return (y, dy/dtheta) of a state (q, dq/dtau) in floats, a list of balls."""
        values = np.array(state, float).reshape(2, -1)
        y, rates = ((self.reduction * column_of(half)).entries() for half in values.tolist())
        return [*y, *(rate * self.tuning for rate in rates)]

    def all_coordinates(self, state, scale):
        """Return displacements and dq/dtau of all coordinates, 0 of the fixed; scale is 1 / nu."""
        values = np.full((2, len(self.numbers.coordinates)), flint().arb(0))
        values[:, self.retained] = np.array(state[: self.state_count]).reshape(2, -1)
        return values[0].tolist(), (values[1] * scale).tolist()

    def train_facts(self, codes):
        """Return the `TrainFacts` of a train; None: of one degree of freedom."""
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


def _times(row, matrix):
    """Return the product; None where a side of a mesh is none."""
    return None if row is None else row * matrix


def _fixed_coordinates(motions):
    """Return as many coordinates as there are free motions, which tell these apart."""
    coordinates, remaining = [], np.array(motions)
    while remaining.shape[1]:
        size = np.abs(remaining).max(axis=1)
        # The first that is large enough, not the largest: rounding decides nothing.
        row = int(np.flatnonzero(size >= 0.5 * size.max())[0])
        column = int(np.abs(remaining[row]).argmax())
        remaining = remaining - np.outer(
            remaining[:, column] / remaining[row, column], remaining[row]
        )
        remaining = np.delete(remaining, column, axis=1)
        coordinates.append(row)
    return sorted(coordinates)
