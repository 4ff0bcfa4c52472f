"""Modes of a combination of contacts, for the kernels of gear trains.

The state obeys z' = A z with z = (q, q', 1, cos, sin, ...). It is transformed to the linear modes
of the train and its rigid-body motions. There A has a basis in which fast motions are decoupled:
each oscillates or decays on its own. The slowest motions stay together in a block, and the kernels
sum its power series: rigid-body motions, free flights, the constant, modes near critical damping or
an undamped resonance. The block is as large as a well-conditioned basis needs.
"""

import math
from fractions import Fraction
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg
from scipy.special import factorial

from gearlib.engines.linear.modal_arcs import MAX_PIECE_RATES, Modes, clear_tables, find_slot
from gearlib.engines.linear.train_system import TrainSystem, fill_system_matrix

#: Number of terms of the series of e^z for |z| <= 3.6; the next term is 3.6^36 / 36! = 3e-22.
_TERM_COUNT = 36
#: Largest condition number of a basis.
_MAX_CONDITION = 100.0
#: Largest rate of a slow motion, over the rate of the reference mode and over the fastest rate.
_MAX_SLOW_RATE, _MAX_SLOW_SHARE = 1e-5, 1e-9
#: Largest deflection, in static deflections, for which a basis needs no refinement.
_MAX_UNREFINED_DEFLECTION = 8.0
#: Largest number of bases that a frame keeps.
_MAX_BASES = 64
#: Largest growth rate of a mode that counts as rounding.
_MAX_GROWTH = 1e-12
#: Largest effect of an unobservable motion on the distances, as a fraction of their coefficients.
_MAX_UNOBSERVED = 1e-9


class Basis(NamedTuple):
    """Basis of the state space for a combination of contacts: z = from_basis y, y = to_basis z.

    Oscillating pairs come first, then real modes, then the slow motions with the constant last.
    """

    from_basis: np.ndarray  #: shape (n, n)
    to_basis: np.ndarray  #: shape (n, n)
    rates: np.ndarray  #: complex, growth + i * angular frequency of pairs and real modes
    n_pairs: int  #: number of oscillating pairs
    block: np.ndarray  #: matrix of the slow motions, dy/dtheta = block y
    rows: np.ndarray  #: row vectors from y to coast-side and drive-side distances, (2, m, n)


@cache
def _bernstein_of_powers(degree):
    """Return Bernstein coefficients of the powers x^k on [-1, 1], shape (_TERM_COUNT, degree + 1).

    Powers above `degree` are replaced by polynomials of this degree: their Chebyshev series, cut
    off after the degree. Fractions keep all steps exact.
    """
    chebyshev = []  # Bernstein coefficients of T_0, T_1, ... on [-1, 1]
    for n in range(degree + 1):
        coefficients = [
            Fraction((-1) ** (n - j) * math.comb(2 * n, 2 * j), math.comb(n, j))
            for j in range(n + 1)
        ]
        for d in range(n, degree):  # Elevate the degree of the Bernstein form from d to d + 1.
            coefficients = [
                (Fraction(j, d + 1) * coefficients[j - 1] if j else Fraction(0))
                + (Fraction(d + 1 - j, d + 1) * coefficients[j] if j <= d else Fraction(0))
                for j in range(d + 2)
            ]
        chebyshev.append(coefficients)
    power_rows = []
    for k in range(_TERM_COUNT):
        power_coefficients = [Fraction(0)] * (degree + 1)
        for n in range(k % 2, min(k, degree) + 1, 2):
            # x^k is a sum of the Chebyshev polynomials T_n whose n is even or odd like k.
            weight = Fraction(math.comb(k, (k - n) // 2), 2 ** (k - 1 if n else k))  # of T_n in x^k
            power_coefficients = [
                value + weight * coefficients
                for value, coefficients in zip(power_coefficients, chebyshev[n], strict=True)
            ]
        power_rows.append([float(value) for value in power_coefficients])
    return np.array(power_rows)


class ModalFrame:
    """Coordinates in which bases are computed: linear modes of a train, then rigid-body motions.

    The modes belong to the mean stiffness of all meshes and are scaled by their frequencies. They
    separate springs of very different stiffness, so that slow modes stay accurate beside shafts a
    million times as stiff as a mesh. `from_frame` and `to_frame`, shape (2 N, 2 N), transform
    states; `base_matrix` is the matrix A in these coordinates while no flanks touch.
    """

    def __init__(self, frequencies, shapes, rigid, mass):
        """Set up the transformation between the coordinates of a train and its natural modes.

        The columns of `shapes`, (n, r), are the shapes of elastic modes, normalised by the mass
        matrix `mass`, (n, n); `frequencies`, (r,), are their angular frequencies over a reference
        frequency. The columns of `rigid`, (n, n - r), are rigid-body motions. A state of the frame
        has four parts: modal displacements times their frequencies, modal velocities, displacements
        and velocities of the rigid-body motions.
        """
        (n, r), rigid_count = shapes.shape, rigid.shape[1]
        #: Number of state components of the elastic modes, which come first.
        self.elastic_size = 2 * r
        velocities, angles = slice(r, 2 * r), slice(2 * r, 2 * r + rigid_count)
        rigid_velocities = slice(2 * r + rigid_count, None)
        self._known_bases: dict[bytes, Basis] = {}
        #: Mode tables that no run is using, see `propagator.Propagator`.
        self.unused_tables: list[tuple] = []
        self.from_frame, self.to_frame, self.base_matrix = np.zeros((3, 2 * n, 2 * n))
        self.from_frame[:n, :r], self.from_frame[n:, velocities] = shapes / frequencies, shapes
        self.from_frame[:n, angles], self.from_frame[n:, rigid_velocities] = rigid, rigid
        # The modes are orthonormal with respect to the mass matrix, so that this is the inverse.
        self.to_frame[:r, :n] = frequencies[:, None] * (shapes.T @ mass)
        self.to_frame[velocities, n:] = shapes.T @ mass
        self.to_frame[angles, :n] = self.to_frame[rigid_velocities, n:] = rigid.T @ mass
        self.base_matrix[:r, velocities] = np.diag(frequencies)
        self.base_matrix[angles, rigid_velocities] = np.eye(rigid_count)

    def __getstate__(self):
        """Return the attributes to be pickled, without the tables and bases, which are large."""
        return vars(self) | {"_known_bases": {}, "unused_tables": []}

    @classmethod
    def for_mesh(cls, model: Any, system: TrainSystem) -> "ModalFrame":
        """Return the frame (modal coordinates) of a model with one mesh and the system `system`.

        The modes are those of permanent contact. The base matrix of the frame is the matrix A of
        the equation of motion z' = A z without contact, in these coordinates.
        """
        frame = cls(*model.contact_modes(system))
        size, elastic_size = len(frame.from_frame), frame.elastic_size
        mode_count = elastic_size // 2
        # A state has displacements and velocities of the modes, then of the rigid-body motions.
        rigid_velocities = range(elastic_size + size // 2 - mode_count, size)
        velocities = [*range(mode_count, elastic_size), *rigid_velocities]
        # The displacements of rigid-body motions cause no forces.
        entries = np.ix_(velocities, [*range(elastic_size), *rigid_velocities])
        matrix = frame.to_frame @ system.base_matrix[:size, :size] @ frame.from_frame
        frame.base_matrix[entries] = matrix[entries]
        return frame

    @classmethod
    def for_train(cls, train: Any, system: TrainSystem) -> "ModalFrame":
        """Return the frame (modal coordinates) of a `GearTrain` with the linear system `system`.

        The modes are those of permanent contact with mean mesh stiffness. The base matrix of the
        frame is the matrix A of z' = A z while no flanks touch, in these coordinates.
        """
        stiffness_scale = train.stiffness_scale
        matrices = train.dimensionless_matrices(system.tuning)
        squared_frequencies, shapes = train.linear_modes
        reference_frequency = train.reference_angular_frequency
        # Shapes that are normalised by the mass in kg become normalised by the dimensionless mass.
        shape_scale = math.sqrt(stiffness_scale) / reference_frequency
        shapes, rigid = shapes * shape_scale, train.free_motions * shape_scale
        frequencies = np.sqrt(squared_frequencies) / reference_frequency
        frame = cls(frequencies, shapes, rigid, matrices.mass)
        (n, r), rigid_count, elastic_size = shapes.shape, rigid.shape[1], frame.elastic_size
        # The modes contain the mean mesh stiffness, which is subtracted here; the structure has a
        # row for each mesh that gives its displacement.
        mesh_shapes = train.structure.lines @ shapes
        mean_stiffness = np.array([mesh.mean_stiffness for mesh in train.meshes]) / stiffness_scale
        frame.base_matrix[r:elastic_size, :r] = (
            mesh_shapes.T * mean_stiffness
        ) @ mesh_shapes / frequencies - np.diag(frequencies)
        motions = np.hstack([shapes, rigid])
        velocities = [*range(r, elastic_size), *range(elastic_size + rigid_count, 2 * n)]
        displacements = [*range(r), *range(elastic_size, elastic_size + rigid_count)]
        scales = np.concatenate([1.0 / frequencies, np.ones(rigid_count)])
        # Terms of a rotating frame of reference, and a skew-symmetric part of the stiffness.
        nonmodal_stiffness = (motions.T @ matrices.nonmodal_stiffness @ motions) * scales
        frame.base_matrix[np.ix_(velocities, displacements)] -= nonmodal_stiffness
        velocity_matrix = matrices.mass @ system.base_matrix[n : 2 * n, n : 2 * n]
        frame.base_matrix[np.ix_(velocities, velocities)] += motions.T @ velocity_matrix @ motions
        return frame

    def system_matrix(self, system: TrainSystem, effects: np.ndarray) -> np.ndarray:
        """Return the matrix A of the equation of motion z' = A z, (2 N, 2 N), in modal coordinates.

        `effects`, int, shape (m,), has a number for the contact and stiffness level of each mesh, 0
        without contact. A mesh in contact adds to A the products of the force vectors in `system`,
        a `TrainSystem`.
        """
        matrix, size = self.base_matrix.copy(), len(self.base_matrix)
        rigid_angles = slice(self.elastic_size, (self.elastic_size + size) // 2)
        for j, effect in enumerate(effects):
            if effect:
                force_output = system.force_output[j, effect, :, :size] @ self.from_frame
                # The displacements of rigid-body motions cause no forces.
                force_output[:, rigid_angles] = 0.0
                matrix += (self.to_frame @ system.force_input[j, effect, :, :size].T) @ force_output
        return matrix

    def basis_of(self, system: TrainSystem, effects: np.ndarray) -> Basis:
        """Return the `Basis`, the modes of the motion, for a combination of contacts of all meshes.

        `effects`, int, shape (m,), has a number for the contact and stiffness level of each mesh.
        Combinations with equal matrices z' = A z share a basis. The frame keeps bases of earlier
        calls and forgets all of them when there are too many.
        """
        matrix = np.empty_like(system.base_matrix)
        fill_system_matrix(system, effects, matrix)
        matrix_bytes = matrix.tobytes()
        basis = self._known_bases.get(matrix_bytes)
        if basis is None:
            basis = self._new_basis(system, effects, matrix)
            if len(self._known_bases) >= _MAX_BASES:
                self._known_bases.clear()
            self._known_bases[matrix_bytes] = basis
        return basis

    def _new_basis(self, system, effects, state_matrix):
        """Compute the `Basis`, the modes of the motion, for a combination of contacts.

        `effects`, int, (m,), has a number for the contact and stiffness level of each mesh, and
        `state_matrix`, (n, n), is the matrix A of z' = A z. A state z has 2 N displacements and
        velocities, which the frame transforms, other driven components, the constant 1, cosine and
        sine of each harmonic. In the basis, fast modes come first and are decoupled; slow motions
        follow in a block.
        """
        n, n_moving, mode_count = len(state_matrix), len(self.from_frame), self.elastic_size // 2
        matrix, from_basis, to_basis = np.zeros((n, n)), np.eye(n), np.eye(n)
        matrix[:n_moving, :n_moving] = self.system_matrix(system, effects)
        matrix[:n_moving, n_moving:] = self.to_frame @ state_matrix[:n_moving, n_moving:]
        matrix[n_moving:, n_moving:] = state_matrix[n_moving:, n_moving:]
        # The constant and the harmonics are scaled by the largest modal force over frequency that
        # they cause, so that all components have a similar size.
        frequencies = self.base_matrix[range(mode_count), range(mode_count, 2 * mode_count)]
        forces = matrix[mode_count : 2 * mode_count, n_moving:] / frequencies[:, None]
        deflections = self.from_frame[: n_moving // 2, :mode_count] @ forces
        scale = np.ones(n)
        scale[n_moving:] /= np.abs(forces).max(initial=1.0)
        from_basis[:n_moving, :n_moving] = self.from_frame
        to_basis[:n_moving, :n_moving] = self.to_frame
        matrix = matrix * scale / scale[:, None]
        rates, n_pairs, p, p_inverse = _separate_modes(matrix)
        n_fast, constant = n_pairs + rates.size, n - 1 - 2 * system.harmonics.size
        from_basis, to_basis = from_basis * scale @ p, p_inverse @ (to_basis / scale[:, None])
        block = p_inverse[n_fast:] @ matrix @ p[:, n_fast:]
        distances = np.stack([system.coast_lines, system.drive_lines])
        rows = (distances @ from_basis).reshape(-1, n)
        # Among the slow motions the constant comes last, after those that affect no flank distance.
        rotation, unobserved_count = _slow_coordinates(
            rows[:, n_fast:], block, from_basis[constant, n_fast:], np.abs(rows).max()
        )
        rotation_inverse = np.linalg.inv(rotation)
        from_basis[:, n_fast:] = from_basis[:, n_fast:] @ rotation
        to_basis[n_fast:] = rotation_inverse @ to_basis[n_fast:]
        block = rotation_inverse @ block
        block, observed_end = block @ rotation, n - 1 - unobserved_count
        # Large deflections amplify the rounding errors of the basis.
        if np.abs(deflections).max(initial=0.0) > _MAX_UNREFINED_DEFLECTION:
            from_basis, to_basis, rates, block = _refined_basis(
                state_matrix, from_basis, to_basis, rates, n_pairs, block
            )
        rows = distances @ from_basis
        # Entries that are zero but for rounding are set to zero: the constant must not move, and
        # the unobservable motions before it act neither on distances nor on other slow motions.
        block[-1], to_basis[-1] = 0.0, 0.0
        to_basis[-1, constant] = 1.0
        rows[..., observed_end : n - 1] = 0.0
        block[: observed_end - n_fast, observed_end - n_fast : -1] = 0.0
        return Basis(from_basis, to_basis, rates, n_pairs, block, rows)


def _separate_modes(matrix):
    """Return (eigenvalues, number of oscillating pairs, P, inverse of P) of a matrix, (n, n).

    The columns of P block-diagonalise the matrix: real and negative imaginary part of each
    oscillating pair of eigenvectors, then real eigenvectors, then a basis of the slow motions,
    which remain coupled. The modes with the smallest rates, and modes near critical damping, make P
    ill-conditioned, so that the slowest modes become slow motions one by one until it is
    well-conditioned. There is one eigenvalue for each pair and for each real mode.
    """
    rates, left, right = scipy.linalg.eig(matrix, left=True, right=True)
    n, order = len(matrix), np.argsort(np.abs(rates), kind="stable")
    max_slow_rate = _MAX_SLOW_RATE + _MAX_SLOW_SHARE * np.abs(rates).max()
    for slow_count in range(max(int((np.abs(rates) < max_slow_rate).sum()), 1), n + 1):
        fast = order[slow_count:]
        if rates[fast].imag.sum() != 0.0:
            continue  # The two modes of a pair stay together.
        pairs, real = fast[rates[fast].imag > 0.0], fast[rates[fast].imag == 0.0]
        left_modes = np.hstack([left[:, pairs].real, left[:, pairs].imag, left[:, real].real])
        # The slow motions are orthogonal to the left eigenvectors of the fast modes.
        slow_motions = (
            scipy.linalg.null_space(left_modes.T, rcond=1e-13) if fast.size else np.eye(n)
        )
        fast_modes = np.concatenate([pairs, real])
        modes = right[:, fast_modes] - slow_motions @ _slow_components(
            matrix, rates[fast_modes], right[:, fast_modes], slow_motions
        )
        p = np.stack([modes[:, : pairs.size].real, -modes[:, : pairs.size].imag], axis=2)
        p = np.hstack([p.reshape(n, -1), modes[:, pairs.size :].real, slow_motions])
        if p.shape[1] == n and (np.linalg.cond(p) < _MAX_CONDITION or not fast.size):
            break
    return rates[fast_modes], pairs.size, p, np.linalg.inv(p)


def _slow_components(matrix, rates, modes, slow_motions):
    """Return the parts of slow motions that rounding has left in computed eigenvectors, (s, k).

    The columns of `modes`, (n, k), are eigenvectors of `matrix`, (n, n), with the complex
    eigenvalues `rates`, (k,). The orthonormal columns of `slow_motions`, (n, s), span the other
    motions. An exact eigenvector leaves no residual there; the parts to be subtracted follow from
    the residual.
    """
    block = slow_motions.T @ matrix @ slow_motions
    residuals = (slow_motions.T @ (matrix @ modes - modes * rates)).T[..., None]
    difference = block - rates[:, None, None] * np.eye(len(block))
    try:
        return np.linalg.solve(difference, residuals)[..., 0].T
    except np.linalg.LinAlgError:
        # A mode with the same rate as a slow motion makes the equations singular. In the subspace
        # that both span no correction is needed, and the pseudo-inverse leaves it out.
        return (np.linalg.pinv(difference, 1e-6) @ residuals)[..., 0].T


def _refined_basis(matrix, from_basis, to_basis, rates, n_pairs, block):
    """Return (from_basis, to_basis, rates, block) after a Newton step in long double precision.

    The arguments describe a `Basis` of `matrix`, A, shape (n, n): `from_basis`, P, has modes as
    columns, `to_basis` is its inverse, `rates` has an eigenvalue for each of the `n_pairs`
    oscillating pairs and for each real mode, and `block`, (s, s), is the matrix of the slow
    motions. M is the block-diagonal matrix of these eigenvalues and this block. With the residual R
    = P^-1 A P - M the new basis is P + P X, where X M - M X = R off the diagonal blocks.
    """
    n, n_fast = len(matrix), n_pairs + rates.size
    a, p, p_inverse = (x.astype(np.longdouble) for x in (matrix, from_basis, to_basis))
    # In complex coordinates a pair is an eigenvector and its complex conjugate.
    to_complex = np.eye(n, dtype=complex)
    order = np.concatenate([np.arange(0, 2 * n_pairs, 2), np.arange(2 * n_pairs, n_fast)])
    eigenvalues = np.zeros(n_fast, complex)
    eigenvalues[order], eigenvalues[1 : 2 * n_pairs : 2] = rates, rates[:n_pairs].conj()
    for i in range(0, 2 * n_pairs, 2):
        to_complex[i : i + 2, i : i + 2] = (1.0, 1.0j), (1.0, -1.0j)
    from_complex = np.linalg.inv(to_complex)
    diagonal = np.zeros((n, n), complex)
    diagonal[range(n_fast), range(n_fast)] = eigenvalues
    motion = (from_complex @ diagonal @ to_complex).real
    motion[n_fast:, n_fast:] = block
    gram = p_inverse @ p
    residual = (p_inverse @ (a @ p) - gram @ motion.astype(np.longdouble)).astype(float)
    inverse_error = (gram - np.eye(n)).astype(float)
    residual = to_complex @ residual @ from_complex
    step, differences = np.zeros((n, n), complex), eigenvalues[None] - eigenvalues[:, None]
    # Equal eigenvalues need no correction: any vectors of their subspace are valid.
    is_equal = np.abs(differences) <= 1e-6 * np.abs(eigenvalues).max(initial=0.0)
    step[:n_fast, :n_fast] = np.where(
        is_equal, 0.0, residual[:n_fast, :n_fast] / np.where(is_equal, 1.0, differences)
    )
    for i, eigenvalue in enumerate(eigenvalues):
        shifted = block - eigenvalue * np.eye(n - n_fast)
        step[i, n_fast:] = np.linalg.solve(shifted.T, residual[i, n_fast:])
        step[n_fast:, i] = -np.linalg.solve(shifted, residual[n_fast:, i])
    step = (from_complex @ step @ to_complex).real
    return (
        (p + from_basis @ step).astype(float),
        (p_inverse - (step + inverse_error) @ to_basis).astype(float),
        rates + residual.diagonal()[order],
        block + residual[n_fast:, n_fast:].real,
    )


def _slow_coordinates(rows, block, constant_row, distance_scale):
    """Return new coordinates of s slow motions: (motions as columns, (s, s), unobservable motions).

    The last column is the constant motion, whose product with `constant_row`, (s,), is 1. Before it
    come the unobservable motions, whose number is returned: they never influence a flank distance
    of a mesh. The k distances are `rows`, (k, s), times the slow motions, and the derivative of the
    motions is `block`, (s, s), times the motions. `distance_scale`, the largest coefficient of a
    distance, scales the tolerance.
    """
    constant_norm = np.linalg.norm(constant_row)
    complement = scipy.linalg.null_space(constant_row[None])
    inner_block = complement.T @ block @ complement
    unobserved, observations = np.eye(len(inner_block)), rows @ complement
    threshold = _MAX_UNOBSERVED * distance_scale
    # Motions that act on a distance are removed first, then motions that act on a removed motion.
    # Powers of the block cannot show this, because the powers of a slow harmonic vanish.
    while unobserved.shape[1]:
        _, singular_values, right_vectors = np.linalg.svd(observations)
        observed_count = int((singular_values > threshold).sum())
        if observed_count == 0:
            break
        unobserved = unobserved @ right_vectors[observed_count:].T
        image = inner_block @ unobserved
        observations = image - unobserved @ (unobserved.T @ image)
        threshold = _MAX_UNOBSERVED * np.linalg.norm(inner_block, 2)
    observed = (
        scipy.linalg.null_space(unobserved.T) if unobserved.size else np.eye(len(inner_block))
    )
    basis = np.hstack([complement @ observed, complement @ unobserved])
    basis = np.hstack([basis, constant_row[:, None] / constant_norm**2])
    return basis, unobserved.shape[1]


def add_modes(tables: Modes, system: TrainSystem, frame: ModalFrame, effects: np.ndarray) -> int:
    """Add the modes of a combination of contacts to the mode tables and return their row.

    `effects`, int, shape (m,), has a number for the contact and stiffness level of each mesh in the
    `TrainSystem` `system`; `frame` gives modal coordinates. If the tables are full, they are
    emptied first.
    """
    if tables.combination_count[0] == len(tables.keys):
        clear_tables(tables)
    combination, n = tables.combination_count[0], len(system.base_matrix)
    basis = frame.basis_of(system, effects)
    _fill_distance_tables(tables, combination, basis.rates, basis.n_pairs, basis.block, basis.rows)
    tables.from_modes[combination], tables.to_modes[combination] = 0.0, 0.0
    tables.from_modes[combination, :, :n] = basis.from_basis.T
    tables.to_modes[combination, :, :n] = basis.to_basis.T
    tables.hash_slots[find_slot(tables.hash_slots, tables.keys, effects)] = combination
    tables.keys[combination] = effects
    tables.combination_count[0] = combination + 1
    return combination


def _fill_distance_tables(tables, combination, rates, n_pairs, block, rows):
    """Fill a row of the mode tables with polynomials and bounds of all flank distances.

    `combination` is the row of `tables` (`Modes`). `rates` has a complex eigenvalue for each of the
    `n_pairs` oscillating pairs and for each real mode. After these, the s slow motions obey y' =
    `block` y, shape (s, s), with the constant 1 last. `rows`, (2, m, n), are row vectors: a product
    with the modal state y is the distance of a mesh from its coast-side (0) or drive-side (1) line.
    """
    pair_components, n_fast = 2 * n_pairs, n_pairs + rates.size
    degree = tables.curves.shape[4] - 1
    # The 16th root of the norm of the 16th power estimates the largest rate; unlike the norm of the
    # block it hardly depends on the scales of components.
    slow_rate = np.linalg.norm(np.linalg.matrix_power(block, 16)) ** (1.0 / 16.0)
    # The polynomials hold for a time in which the fastest motion changes little enough. The 1.0
    # limits this time to about a period of the reference mode.
    fastest_rate = max(np.abs(rates).max(initial=0.0), slow_rate, 1.0)
    half_length = 0.5 * MAX_PIECE_RATES[degree] / fastest_rate
    power_curves = _bernstein_of_powers(degree)
    orders = np.arange(len(power_curves))
    exponents = half_length * rates[:, None]
    terms = np.exp(exponents) * exponents**orders / factorial(orders)
    mode_rows = np.concatenate(
        [
            rows[..., 0:pair_components:2] - 1j * rows[..., 1:pair_components:2],
            rows[..., pair_components:n_fast],
        ],
        axis=-1,
    )
    mode_curves = mode_rows[..., None] * (terms @ power_curves)
    curves = tables.curves[combination]
    curves[:, :, 0:pair_components:2] = mode_curves[:, :, :n_pairs].real
    curves[:, :, 1:pair_components:2] = -mode_curves[:, :, :n_pairs].imag
    curves[:, :, pair_components:n_fast] = mode_curves[:, :, n_pairs:].real
    curves[:, :, n_fast:] = 0.0
    slow_rows = rows[..., n_fast:] @ scipy.linalg.expm(half_length * block)
    for i, power in enumerate(power_curves):
        curves[:, :, n_fast:] += slow_rows[..., None] * power
        slow_rows = slow_rows @ block * (half_length / (i + 1))
    tables.pair_counts[combination] = n_pairs
    tables.real_counts[combination] = rates.size - n_pairs
    tables.piece_lengths[combination] = 2.0 * half_length
    tables.rates[combination, : rates.size] = np.stack([rates.real, rates.imag], axis=1)
    tables.slow_matrix[combination, : len(block), : len(block)] = block
    tables.slow_rate[combination] = slow_rate
    tables.mode_amplitude_factors[combination, :, :, : rates.size] = np.abs(mode_rows)
    tables.constant_distance[combination] = rows[..., -1]
    tables.is_bounded[combination] = (rates.real <= _MAX_GROWTH).all() & ~rows[..., n_fast:-1].any(
        axis=-1
    )
