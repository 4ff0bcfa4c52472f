"""Modes of each combination of contacts, which the kernels of gear trains tabulate.

The state obeys z' = A z with z = (q, q', 1, cos, sin, ...). It is first transformed to the linear
modes of the train and its rigid-body motions. There A has a basis in which fast motions are
decoupled: each oscillates or decays on its own. The slowest motions remain coupled in a block,
whose power series the kernels sum: rigid-body motions, free flights, the constant, modes near
critical damping or an undamped resonance. The block is made as large as a well-conditioned basis
requires.
"""

import math
from fractions import Fraction
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg
from scipy.special import factorial

from gearlib.engines.linear.modal_arcs import (
    MAX_INTERVAL_RATES,
    ModeTables,
    clear_tables,
    find_slot,
)
from gearlib.engines.linear.train_system import TrainSystem, system_matrix

#: Number of terms of the series of e^z for |z| <= 3.6; the next term is 3.6^36 / 36! = 3e-22.
_TERM_COUNT = 36
#: Largest condition number of a basis.
_MAX_CONDITION = 100.0
#: Largest rate of a slow motion, relative to the reference mode and relative to the fastest rate.
_MAX_SLOW_RATE, _MAX_SLOW_FRACTION = 1e-5, 1e-9
#: Largest deflection, in units of the static deflection, for which a basis needs no refinement.
_MAX_UNREFINED_DEFLECTION = 8.0
#: Largest number of bases that a frame keeps.
_MAX_BASES = 64
#: Largest growth rate of a mode that counts as rounding.
_MAX_GROWTH = 1e-12
#: Largest influence of an unobservable motion on flank distances, relative to their coefficients.
_MAX_UNOBSERVED = 1e-9


class Basis(NamedTuple):
    """Modal basis for a combination of contacts: z = from_basis y, y = to_basis z.

    Oscillating pairs come first, then real modes, then the slow motions, with the constant last.
    """

    from_basis: np.ndarray  #: shape (n, n)
    to_basis: np.ndarray  #: shape (n, n)
    rates: np.ndarray  #: complex growth + i * angular frequency of each pair and real mode
    pair_count: int  #: number of oscillating pairs
    slow_matrix: np.ndarray  #: matrix of the slow motions, dy/dtheta = slow_matrix y
    distance_rows: np.ndarray  #: row vectors of coast and drive flank distances, (2, m, n)


@cache
def _bernstein_of_powers(degree):
    """Return the Bernstein coefficients of x^k on [-1, 1], shape (_TERM_COUNT, degree + 1).

    Powers above `degree` are replaced by their Chebyshev series, truncated to this degree.
    Fractions keep all steps exact.
    """
    chebyshev = []  # Bernstein coefficients of the Chebyshev polynomials T_0, T_1, ... on [-1, 1]
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
            # x^k is a sum of the Chebyshev polynomials T_n with n of the same parity as k.
            weight = Fraction(math.comb(k, (k - n) // 2), 2 ** (k - 1 if n else k))
            power_coefficients = [
                value + weight * coefficients
                for value, coefficients in zip(power_coefficients, chebyshev[n], strict=True)
            ]
        power_rows.append([float(value) for value in power_coefficients])
    return np.array(power_rows)


class ModalFrame:
    """Coordinates in which bases are computed: linear modes of a train, then rigid-body motions.

    The modes are the modes for the mean stiffness of all meshes, scaled by their frequencies. They
    separate springs of very different stiffness, so that slow modes stay accurate even with shafts
    a million times as stiff as a mesh. `from_frame` and `to_frame`, shape (2 N, 2 N), transform
    states; `base_matrix` is the matrix A without contact in these coordinates.
    """

    def __init__(self, frequencies, shapes, rigid, mass):
        """Set up the transformation between the coordinates of a train and its natural modes.

        The columns of `shapes`, (n, r), are the shapes of the elastic modes, normalised with the
        mass matrix `mass`, (n, n). `frequencies`, (r,), are their angular frequencies divided by a
        reference frequency. The columns of `rigid`, (n, n - r), are the rigid-body motions. A state
        of the frame has four parts: modal displacements times frequencies, modal velocities, and
        displacements and velocities of the rigid-body motions.
        """
        (n, r), rigid_count = shapes.shape, rigid.shape[1]
        #: Number of state components of the elastic modes, which come first.
        self.elastic_size = 2 * r
        velocities, angles = slice(r, 2 * r), slice(2 * r, 2 * r + rigid_count)
        rigid_velocities = slice(2 * r + rigid_count, None)
        self._bases_by_matrix: dict[bytes, Basis] = {}
        #: Mode tables that are not in use by a run, see `propagator.Propagator`.
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
        """Return the attributes to be pickled, without the large tables and bases."""
        return vars(self) | {"_bases_by_matrix": {}, "unused_tables": []}

    @classmethod
    def for_mesh(cls, model: Any, system: TrainSystem) -> "ModalFrame":
        """Return the frame (modal coordinates) of a model with one mesh and its `TrainSystem`.

        Its modes are the modes in permanent contact. Its base matrix is the state matrix A of z' =
        A z without contact, in modal coordinates.
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
        """Return the frame (modal coordinates) of a `GearTrain` with the `TrainSystem` `system`.

        Its modes are the modes in permanent contact at the mean mesh stiffness. Its base matrix is
        the state matrix A of z' = A z without contact, in modal coordinates.
        """
        stiffness_scale = train.stiffness_scale
        matrices = train.dimensionless_matrices(system.tuning)
        squared_frequencies, shapes = train.linear_modes
        reference_frequency = train.reference_angular_frequency
        # Normalise the shapes by the dimensionless mass instead of the mass in kg.
        shape_scale = math.sqrt(stiffness_scale) / reference_frequency
        shapes, rigid = shapes * shape_scale, train.free_motions * shape_scale
        frequencies = np.sqrt(squared_frequencies) / reference_frequency
        frame = cls(frequencies, shapes, rigid, matrices.mass)
        (n, r), rigid_count, elastic_size = shapes.shape, rigid.shape[1], frame.elastic_size
        # The modes include the mean mesh stiffness, which is subtracted here.
        mesh_shapes = train.structure.mesh_jacobian @ shapes
        mean_stiffness = np.array([mesh.mean_stiffness for mesh in train.meshes]) / stiffness_scale
        frame.base_matrix[r:elastic_size, :r] = (
            mesh_shapes.T * mean_stiffness
        ) @ mesh_shapes / frequencies - np.diag(frequencies)
        motions = np.hstack([shapes, rigid])
        velocities = [*range(r, elastic_size), *range(elastic_size + rigid_count, 2 * n)]
        displacements = [*range(r), *range(elastic_size, elastic_size + rigid_count)]
        scales = np.concatenate([1.0 / frequencies, np.ones(rigid_count)])
        # Add the terms of a rotating frame of reference and skew-symmetric parts of the stiffness.
        nonmodal_stiffness = (motions.T @ matrices.nonmodal_stiffness @ motions) * scales
        frame.base_matrix[np.ix_(velocities, displacements)] -= nonmodal_stiffness
        velocity_matrix = matrices.mass @ system.base_matrix[n : 2 * n, n : 2 * n]
        frame.base_matrix[np.ix_(velocities, velocities)] += motions.T @ velocity_matrix @ motions
        return frame

    def system_matrix(self, system: TrainSystem, force_indices: np.ndarray) -> np.ndarray:
        """Return the state matrix A of z' = A z in modal coordinates, shape (2 N, 2 N).

        `force_indices`, int, shape (m,), holds the force index of each mesh, 0 without contact. A
        mesh in contact adds the outer products of its force vectors in the `TrainSystem` `system`.
        """
        matrix, size = self.base_matrix.copy(), len(self.base_matrix)
        rigid_angles = slice(self.elastic_size, (self.elastic_size + size) // 2)
        for j, force_index in enumerate(force_indices):
            if force_index:
                force_output = system.force_output[j, force_index, :, :size] @ self.from_frame
                # The displacements of rigid-body motions cause no forces.
                force_output[:, rigid_angles] = 0.0
                matrix += (
                    self.to_frame @ system.force_input[j, force_index, :, :size].T
                ) @ force_output
        return matrix

    def find_basis(self, system: TrainSystem, force_indices: np.ndarray) -> Basis:
        """Return the `Basis`, the modes of the motion, for a combination of contacts of all meshes.

        `force_indices`, int, shape (m,), holds the force index of each mesh. Combinations with
        equal state matrices share a basis. The frame stores the bases and discards all of them when
        there are too many.
        """
        matrix = system_matrix(system, force_indices)
        matrix_bytes = matrix.tobytes()
        basis = self._bases_by_matrix.get(matrix_bytes)
        if basis is None:
            basis = self._compute_basis(system, force_indices, matrix)
            if len(self._bases_by_matrix) >= _MAX_BASES:
                self._bases_by_matrix.clear()
            self._bases_by_matrix[matrix_bytes] = basis
        return basis

    def _compute_basis(self, system, force_indices, state_matrix):
        """Compute the `Basis`, the modes of the motion, for a combination of contacts.

        `force_indices`, int, (m,), holds the force index of each mesh, and `state_matrix`, (n, n),
        is the matrix A of z' = A z. A state z has 2 N displacements and velocities, which the frame
        transforms, other prescribed components, the constant 1, and the cosine and sine of each
        harmonic. In the basis, fast modes come first and are decoupled; slow motions follow and are
        coupled by the slow matrix.
        """
        n, frame_size, mode_count = len(state_matrix), len(self.from_frame), self.elastic_size // 2
        matrix, from_basis, to_basis = np.zeros((n, n)), np.eye(n), np.eye(n)
        matrix[:frame_size, :frame_size] = self.system_matrix(system, force_indices)
        matrix[:frame_size, frame_size:] = self.to_frame @ state_matrix[:frame_size, frame_size:]
        matrix[frame_size:, frame_size:] = state_matrix[frame_size:, frame_size:]
        # Scale the constant and the harmonics by the largest modal deflection that they cause, so
        # that all components are of similar size.
        frequencies = self.base_matrix[range(mode_count), range(mode_count, 2 * mode_count)]
        forces = matrix[mode_count : 2 * mode_count, frame_size:] / frequencies[:, None]
        deflections = self.from_frame[: frame_size // 2, :mode_count] @ forces
        scale = np.ones(n)
        scale[frame_size:] /= np.abs(forces).max(initial=1.0)
        from_basis[:frame_size, :frame_size] = self.from_frame
        to_basis[:frame_size, :frame_size] = self.to_frame
        matrix = matrix * scale / scale[:, None]
        rates, pair_count, p, p_inverse = _separate_modes(matrix)
        fast_count, constant = pair_count + rates.size, n - 1 - 2 * system.harmonics.size
        from_basis, to_basis = from_basis * scale @ p, p_inverse @ (to_basis / scale[:, None])
        slow_matrix = p_inverse[fast_count:] @ matrix @ p[:, fast_count:]
        distances = np.stack([system.coast_distance_rows, system.drive_distance_rows])
        distance_rows = (distances @ from_basis).reshape(-1, n)
        # Order the slow motions: the constant last, preceded by motions that affect no distance.
        rotation, unobserved_count = _slow_coordinates(
            distance_rows[:, fast_count:],
            slow_matrix,
            from_basis[constant, fast_count:],
            np.abs(distance_rows).max(),
        )
        rotation_inverse = np.linalg.inv(rotation)
        from_basis[:, fast_count:] = from_basis[:, fast_count:] @ rotation
        to_basis[fast_count:] = rotation_inverse @ to_basis[fast_count:]
        slow_matrix = rotation_inverse @ slow_matrix
        slow_matrix, observed_end = slow_matrix @ rotation, n - 1 - unobserved_count
        # Large deflections amplify the rounding errors of the basis.
        if np.abs(deflections).max(initial=0.0) > _MAX_UNREFINED_DEFLECTION:
            from_basis, to_basis, rates, slow_matrix = _refine_basis(
                state_matrix, from_basis, to_basis, rates, pair_count, slow_matrix
            )
        distance_rows = distances @ from_basis
        # Remove rounding errors: the constant does not change, and the unobservable motions before
        # it act neither on the distances nor on the other slow motions.
        slow_matrix[-1], to_basis[-1] = 0.0, 0.0
        to_basis[-1, constant] = 1.0
        distance_rows[..., observed_end : n - 1] = 0.0
        slow_matrix[: observed_end - fast_count, observed_end - fast_count : -1] = 0.0
        return Basis(from_basis, to_basis, rates, pair_count, slow_matrix, distance_rows)


def _separate_modes(matrix):
    """Return (eigenvalues, number of oscillating pairs, P, inverse of P) of a matrix, (n, n).

    The columns of P block-diagonalise the matrix: the real and the negative imaginary part of each
    oscillating pair of eigenvectors, then the real eigenvectors, then a basis of the slow motions,
    which remain coupled. Modes with small rates and modes near critical damping make P
    ill-conditioned. The slowest modes are therefore moved to the slow motions, one by one, until P
    is well-conditioned. There is one eigenvalue per pair and per real mode.
    """
    rates, left, right = scipy.linalg.eig(matrix, left=True, right=True)
    n, order = len(matrix), np.argsort(np.abs(rates), kind="stable")
    max_slow_rate = _MAX_SLOW_RATE + _MAX_SLOW_FRACTION * np.abs(rates).max()
    for slow_count in range(max(int((np.abs(rates) < max_slow_rate).sum()), 1), n + 1):
        fast = order[slow_count:]
        if rates[fast].imag.sum() != 0.0:
            continue  # The two modes of a pair must stay together.
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
    eigenvalues `rates`, (k,). The orthonormal columns of `slow_motions`, (n, s), span the remaining
    motions. An exact eigenvector has no residual in that space; the parts to be subtracted follow
    from the residual.
    """
    slow_matrix = slow_motions.T @ matrix @ slow_motions
    residuals = (slow_motions.T @ (matrix @ modes - modes * rates)).T[..., None]
    difference = slow_matrix - rates[:, None, None] * np.eye(len(slow_matrix))
    try:
        return np.linalg.solve(difference, residuals)[..., 0].T
    except np.linalg.LinAlgError:
        # If a mode has the same rate as a slow motion, the equations are singular. The subspace
        # that both span needs no correction, which the pseudo-inverse leaves out.
        return (np.linalg.pinv(difference, 1e-6) @ residuals)[..., 0].T


def _refine_basis(matrix, from_basis, to_basis, rates, pair_count, slow_matrix):
    """Refine a modal basis by a Newton step in long double precision.

    The arguments describe a `Basis` of `matrix`, A, shape (n, n): `from_basis`, P, has the modes as
    columns, `to_basis` is its inverse, `rates` has one eigenvalue for each of the `pair_count`
    oscillating pairs and for each real mode, and `slow_matrix`, (s, s), is the matrix of the slow
    motions. M is the block-diagonal matrix of these eigenvalues and the slow matrix. With the
    residual R = P^-1 A P - M, the new basis is P + P X, where X M - M X = R off the diagonal
    blocks. Returns (from_basis, to_basis, rates, slow_matrix).
    """
    n, fast_count = len(matrix), pair_count + rates.size
    a, p, p_inverse = (x.astype(np.longdouble) for x in (matrix, from_basis, to_basis))
    # In complex coordinates a pair is an eigenvector and its complex conjugate.
    to_complex = np.eye(n, dtype=complex)
    order = np.concatenate([np.arange(0, 2 * pair_count, 2), np.arange(2 * pair_count, fast_count)])
    eigenvalues = np.zeros(fast_count, complex)
    eigenvalues[order], eigenvalues[1 : 2 * pair_count : 2] = rates, rates[:pair_count].conj()
    for i in range(0, 2 * pair_count, 2):
        to_complex[i : i + 2, i : i + 2] = (1.0, 1.0j), (1.0, -1.0j)
    from_complex = np.linalg.inv(to_complex)
    diagonal = np.zeros((n, n), complex)
    diagonal[range(fast_count), range(fast_count)] = eigenvalues
    motion = (from_complex @ diagonal @ to_complex).real
    motion[fast_count:, fast_count:] = slow_matrix
    gram = p_inverse @ p
    residual = (p_inverse @ (a @ p) - gram @ motion.astype(np.longdouble)).astype(float)
    inverse_error = (gram - np.eye(n)).astype(float)
    residual = to_complex @ residual @ from_complex
    step, differences = np.zeros((n, n), complex), eigenvalues[None] - eigenvalues[:, None]
    # Equal eigenvalues need no correction: any vectors of their subspace are valid.
    is_equal = np.abs(differences) <= 1e-6 * np.abs(eigenvalues).max(initial=0.0)
    step[:fast_count, :fast_count] = np.where(
        is_equal, 0.0, residual[:fast_count, :fast_count] / np.where(is_equal, 1.0, differences)
    )
    for i, eigenvalue in enumerate(eigenvalues):
        shifted = slow_matrix - eigenvalue * np.eye(n - fast_count)
        step[i, fast_count:] = np.linalg.solve(shifted.T, residual[i, fast_count:])
        step[fast_count:, i] = -np.linalg.solve(shifted, residual[fast_count:, i])
    step = (from_complex @ step @ to_complex).real
    return (
        (p + from_basis @ step).astype(float),
        (p_inverse - (step + inverse_error) @ to_basis).astype(float),
        rates + residual.diagonal()[order],
        slow_matrix + residual[fast_count:, fast_count:].real,
    )


def _slow_coordinates(distance_rows, slow_matrix, constant_row, distance_scale):
    """Return new coordinates of s slow motions: (motions as columns, (s, s), unobservable motions).

    The last column is the constant motion, whose product with `constant_row`, (s,), is 1. It is
    preceded by the unobservable motions, which never influence a flank distance; their number is
    the second result. `distance_rows`, (k, s), maps slow motions to k flank distances, and
    `slow_matrix`, (s, s), maps them to their derivatives. `distance_scale`, the largest coefficient
    of a distance, scales the tolerance.
    """
    constant_norm = np.linalg.norm(constant_row)
    complement = scipy.linalg.null_space(constant_row[None])
    inner_block = complement.T @ slow_matrix @ complement
    unobserved, observations = np.eye(len(inner_block)), distance_rows @ complement
    threshold = _MAX_UNOBSERVED * distance_scale
    # Remove the motions that act on a distance first, then motions that act on a removed motion.
    # Powers of the slow matrix cannot show this, because the powers of a slow harmonic vanish.
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


def add_modes(
    tables: ModeTables, system: TrainSystem, frame: ModalFrame, force_indices: np.ndarray
) -> int:
    """Add the modes of a combination of contacts to the mode tables and return their row.

    `force_indices`, int, shape (m,), holds the force index of each mesh in the `TrainSystem`
    `system`; `frame` provides modal coordinates. Full tables are cleared first.
    """
    if tables.combination_count[0] == len(tables.keys):
        clear_tables(tables)
    combination, n = tables.combination_count[0], len(system.base_matrix)
    basis = frame.find_basis(system, force_indices)
    _fill_distance_tables(tables, combination, basis)
    tables.from_modes[combination], tables.to_modes[combination] = 0.0, 0.0
    tables.from_modes[combination, :, :n] = basis.from_basis.T
    tables.to_modes[combination, :, :n] = basis.to_basis.T
    tables.hash_slots[find_slot(tables.hash_slots, tables.keys, force_indices)] = combination
    tables.keys[combination] = force_indices
    tables.combination_count[0] = combination + 1
    return combination


def _fill_distance_tables(tables, combination, basis):
    """Fill a row of the mode tables with the polynomials and bounds of all flank distances.

    `combination` is the row of `tables` (`ModeTables`), and `basis` holds the modes. The product of
    a distance row and the modal state y is the distance of a mesh from its coast-side or drive-side
    flank line.
    """
    _, _, rates, pair_count, slow_matrix, distance_rows = basis
    pair_components, fast_count = 2 * pair_count, pair_count + rates.size
    degree = tables.distance_polynomials.shape[4] - 1
    # The 16th root of the norm of the 16th power estimates the largest rate; unlike the norm of the
    # matrix, it hardly depends on the scales of the components.
    slow_rate = np.linalg.norm(np.linalg.matrix_power(slow_matrix, 16)) ** (1.0 / 16.0)
    # The fastest motion limits the interval over which the polynomials hold; the 1.0 limits it to
    # about a period of the reference mode.
    fastest_rate = max(np.abs(rates).max(initial=0.0), slow_rate, 1.0)
    half_length = 0.5 * MAX_INTERVAL_RATES[degree] / fastest_rate
    power_polynomials = _bernstein_of_powers(degree)
    orders = np.arange(len(power_polynomials))
    exponents = half_length * rates[:, None]
    terms = np.exp(exponents) * exponents**orders / factorial(orders)
    mode_rows = np.concatenate(
        [
            distance_rows[..., 0:pair_components:2] - 1j * distance_rows[..., 1:pair_components:2],
            distance_rows[..., pair_components:fast_count],
        ],
        axis=-1,
    )
    mode_polynomials = mode_rows[..., None] * (terms @ power_polynomials)
    polynomials = tables.distance_polynomials[combination]
    polynomials[:, :, 0:pair_components:2] = mode_polynomials[:, :, :pair_count].real
    polynomials[:, :, 1:pair_components:2] = -mode_polynomials[:, :, :pair_count].imag
    polynomials[:, :, pair_components:fast_count] = mode_polynomials[:, :, pair_count:].real
    polynomials[:, :, fast_count:] = 0.0
    slow_rows = distance_rows[..., fast_count:] @ scipy.linalg.expm(half_length * slow_matrix)
    for i, power in enumerate(power_polynomials):
        polynomials[:, :, fast_count:] += slow_rows[..., None] * power
        slow_rows = slow_rows @ slow_matrix * (half_length / (i + 1))
    tables.pair_counts[combination] = pair_count
    tables.real_counts[combination] = rates.size - pair_count
    tables.interval_lengths[combination] = 2.0 * half_length
    tables.rates[combination, : rates.size] = np.stack([rates.real, rates.imag], axis=1)
    tables.slow_matrix[combination, : len(slow_matrix), : len(slow_matrix)] = slow_matrix
    tables.slow_rate[combination] = slow_rate
    tables.mode_amplitude_factors[combination, :, :, : rates.size] = np.abs(mode_rows)
    tables.constant_distance[combination] = distance_rows[..., -1]
    tables.is_bounded[combination] = (rates.real <= _MAX_GROWTH).all() & ~distance_rows[
        ..., fast_count:-1
    ].any(axis=-1)
