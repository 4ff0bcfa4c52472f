"""Modes of a combination of contacts, for the kernels of gear trains.

The state obeys z' = A z with z = (q, q', 1, cos, sin, ...). In coordinates of the linear modes of
the train, with its free rotations behind them, A has a basis in which fast motions turn or shrink
one by one. The slowest motions stay together in a block whose power series the kernels sum: free
rotations, flights, the constant, modes near a critical damping or an undamped resonance. The block
is as large as a well-conditioned basis needs.
"""

import math
from fractions import Fraction
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg
from scipy.special import factorial

from gearlib.engines.linear.modal_arcs import MAX_PIECE_RATES, Modes, clear_tables, find_slot
from gearlib.engines.linear.train_system import TrainSystem, matrix_of

#: Number of terms of the series of e^z, |z| <= 3.6: the next is 3.6^36 / 36! = 3e-22.
_TERM_COUNT = 36
#: Largest condition number of a basis.
_MAX_CONDITION = 100.0
#: Largest rate of a slow motion, over that of the reference mode, and over the fastest rate.
_MAX_SLOW_RATE, _MAX_SLOW_SHARE = 1e-5, 1e-9
#: Largest deflection, in static deflections, for which the rounding of a basis does not matter.
_MAX_UNREFINED_DEFLECTION = 8.0
#: Largest number of bases in memory.
_MAX_BASES = 64
#: Largest growth rate of a mode that counts as rounding.
_MAX_GROWTH = 1e-12


class Basis(NamedTuple):
    """A basis of a combination of contacts: z = out y, y = into z, n components.

    Oscillating pairs come first, then real modes, then the slow motions with the constant last.
    """

    out: np.ndarray  #: shape (n, n)
    into: np.ndarray  #: shape (n, n)
    rates: np.ndarray  #: complex, of pairs and real modes, (growth + i angular frequency)
    pairs: int  #: number of oscillating pairs
    block: np.ndarray  #: matrix of the slow motions, dy/dtheta = block y
    rows: np.ndarray  #: row vectors of coast-side and drive-side distances in y, (2, m, n)


@cache
def _bernstein_of_powers(degree):
    """Return the Bernstein coefficients of the powers x^k on [-1, 1], (_TERM_COUNT, degree + 1).

    Powers above `degree` are replaced by their Chebyshev expansion, cut behind that degree.
    """
    chebyshev = []  # Bernstein coefficients of T_0, T_1, ... on [-1, 1]
    for n in range(degree + 1):
        coefficients = [
            Fraction((-1) ** (n - j) * math.comb(2 * n, 2 * j), math.comb(n, j))
            for j in range(n + 1)
        ]
        for d in range(n, degree):  # Raise the degree of the Bernstein form from d to d + 1.
            coefficients = [
                (Fraction(j, d + 1) * coefficients[j - 1] if j else Fraction(0))
                + (Fraction(d + 1 - j, d + 1) * coefficients[j] if j <= d else Fraction(0))
                for j in range(d + 2)
            ]
        chebyshev.append(coefficients)
    rows = []
    for k in range(_TERM_COUNT):
        row = [Fraction(0)] * (degree + 1)
        for n in range(k % 2, min(k, degree) + 1, 2):
            weight = Fraction(math.comb(k, (k - n) // 2), 2 ** (k - 1 if n else k))  # of T_n in x^k
            row = [
                value + weight * coefficients
                for value, coefficients in zip(row, chebyshev[n], strict=True)
            ]
        rows.append([float(value) for value in row])
    return np.array(rows)


class Frame:
    """Coordinates in which bases are computed: linear modes of a train, then free rotations.

    The modes are those with all meshes at their mean stiffness, scaled by their frequencies. They
    separate springs of very different stiffness, so that slow modes stay accurate beside shafts a
    million times as stiff as a mesh. `from_frame` and `to_frame`, shape (2 N, 2 N), transform
    states; `base_matrix` is the matrix of the motion while all meshes are in their backlash.
    """

    def __init__(self, frequencies, shapes, rigid, mass):
        """Set up the transformation between coordinates of the train and of its modes.

        `frequencies`, shape (r,), by theta, and `shapes`, (n, r), are those of r elastic modes;
        `rigid`, (n, k), are free rotations and `mass`, (n, n), is the mass matrix.
        """
        (n, r), k, omega = shapes.shape, rigid.shape[1], frequencies
        self.elastic = e = 2 * r
        self._known_bases: dict[bytes, Basis] = {}
        #: Tables between two runs, see `propagator.Propagator`.
        self.spare: list[tuple] = []
        self.from_frame, self.to_frame, self.base_matrix = np.zeros((3, 2 * n, 2 * n))
        self.from_frame[:n, :r], self.from_frame[n:, r:e] = shapes / omega, shapes
        self.from_frame[:n, e : e + k], self.from_frame[n:, e + k :] = rigid, rigid
        momenta, rigid_momenta = shapes.T @ mass, rigid.T @ mass
        self.to_frame[:r, :n], self.to_frame[r:e, n:] = omega[:, None] * momenta, momenta
        self.to_frame[e : e + k, :n], self.to_frame[e + k :, n:] = rigid_momenta, rigid_momenta
        self.base_matrix[:r, r:e], self.base_matrix[e : e + k, e + k :] = np.diag(omega), np.eye(k)

    def __getstate__(self):
        # Tables and bases are large, and another process computes its own.
        return vars(self) | {"_known_bases": {}, "spare": []}

    @classmethod
    def of_mesh(cls, model: Any, system: TrainSystem) -> "Frame":
        """Return the frame of a model with one mesh and its `TrainSystem`."""
        frame = cls(*model.contact_modes(system))
        size, e = len(frame.from_frame), frame.elastic
        r = e // 2
        velocity_rows = np.r_[r:e, e + size // 2 - r : size]
        # The angles of free rotations cause no forces.
        columns = [*range(e), *velocity_rows[r:]]
        entries = np.ix_(velocity_rows, columns)
        matrix = frame.to_frame @ system.base_matrix[:size, :size] @ frame.from_frame
        frame.base_matrix[entries] = matrix[entries]
        return frame

    @classmethod
    def of_train(cls, train: Any, system: TrainSystem) -> "Frame":
        """Return the frame of a gear train and its `TrainSystem`."""
        stiffness_scale = train.stiffness_scale
        matrices = train.dimensionless_matrices(system.tuning)
        squared_frequencies, shapes = train.linear_modes
        omega = train.reference_angular_frequency
        shapes, rigid = (
            x * (math.sqrt(stiffness_scale) / omega) for x in (shapes, train.free_motions)
        )
        w = np.sqrt(squared_frequencies) / omega
        frame = cls(w, shapes, rigid, matrices.mass)
        (n, r), k, e = shapes.shape, rigid.shape[1], frame.elastic
        # The linear modes contain the mean mesh stiffness, which is subtracted here.
        beta = train.structure.lines @ shapes
        mean = np.array([mesh.mean_stiffness for mesh in train.meshes]) / stiffness_scale
        frame.base_matrix[r:e, :r] = (beta.T * mean) @ beta / w - np.diag(w)
        motions = np.hstack([shapes, rigid])
        velocities = np.concatenate([np.arange(r, e), np.arange(e + k, 2 * n)])
        displacements = np.concatenate([np.arange(r), e + np.arange(k)])
        scales = np.concatenate([1.0 / w, np.ones(k)])
        frame_stiffness = (motions.T @ matrices.frame_stiffness @ motions) * scales
        frame.base_matrix[np.ix_(velocities, displacements)] -= frame_stiffness
        velocity_matrix = matrices.mass @ system.base_matrix[n : 2 * n, n : 2 * n]
        frame.base_matrix[np.ix_(velocities, velocities)] += motions.T @ velocity_matrix @ motions
        return frame

    def matrix(self, system: TrainSystem, effects: np.ndarray) -> np.ndarray:
        """Return the matrix A, (2 N, 2 N), of a `TrainSystem` in the coordinates of the frame.

        `effects`, int, shape (m,), has the number of the contact effect of each mesh.
        """
        matrix, size = self.base_matrix.copy(), len(self.base_matrix)
        for j, effect in enumerate(effects):
            if effect:
                force_output = system.force_output[j, effect, :, :size] @ self.from_frame
                # The angles of free rotations cause no forces.
                force_output[:, self.elastic : self.elastic + (size - self.elastic) // 2] = 0.0
                matrix += (self.to_frame @ system.force_input[j, effect, :, :size].T) @ force_output
        return matrix

    def basis_of(self, system: TrainSystem, effects: np.ndarray) -> Basis:
        """Return the `Basis` for the meshes' `effects`, int, (m,); equal matrices share one."""
        matrix = np.empty_like(system.base_matrix)
        matrix_of(system, effects, matrix)
        matrix_bytes = matrix.tobytes()
        basis = self._known_bases.get(matrix_bytes)
        if basis is None:
            basis = self._new_basis(system, effects, matrix)
            if len(self._known_bases) >= _MAX_BASES:
                self._known_bases.clear()
            self._known_bases[matrix_bytes] = basis
        return basis

    def _new_basis(self, system, effects, state_matrix):
        """Return the `Basis` of `state_matrix`, (n, n), the matrix A of the meshes' `effects`."""
        n, moving, mode_count = len(state_matrix), len(self.from_frame), self.elastic // 2
        matrix, out, into = np.zeros((n, n)), np.eye(n), np.eye(n)
        matrix[:moving, :moving] = self.matrix(system, effects)
        matrix[:moving, moving:] = self.to_frame @ state_matrix[:moving, moving:]
        matrix[moving:, moving:] = state_matrix[moving:, moving:]
        # The constant and the harmonics are scaled by the deflections that they cause.
        frequencies = self.base_matrix[range(mode_count), range(mode_count, 2 * mode_count)]
        forces = matrix[mode_count : 2 * mode_count, moving:] / frequencies[:, None]
        deflection = np.abs(self.from_frame[: moving // 2, :mode_count] @ forces).max(initial=0.0)
        scale = np.ones(n)
        scale[moving:] /= np.abs(forces).max(initial=1.0)
        out[:moving, :moving], into[:moving, :moving] = self.from_frame, self.to_frame
        out, into, matrix = out * scale, into / scale[:, None], matrix * scale / scale[:, None]
        rates, pairs, p, inverse = _separate_modes(matrix)
        fast, constant = pairs + rates.size, n - 1 - 2 * system.harmonics.size
        out, into, block = out @ p, inverse @ into, inverse[fast:] @ matrix @ p[:, fast:]
        distances = np.stack([system.coast_lines, system.drive_lines])
        rows = (distances @ out).reshape(-1, n)
        rotation, unobserved = _slow_coordinates(
            rows[:, fast:], block, out[constant, fast:], np.abs(rows).max()
        )
        back = np.linalg.inv(rotation)
        out[:, fast:] = out[:, fast:] @ rotation
        into[fast:] = back @ into[fast:]
        block = back @ block
        block, observed = block @ rotation, n - 1 - unobserved
        if deflection > _MAX_UNREFINED_DEFLECTION:
            out, into, rates, block = _refined_basis(state_matrix, out, into, rates, pairs, block)
        rows = distances @ out
        # Entries that are zero but for rounding are set to zero: the constant must not move.
        block[-1], into[-1] = 0.0, 0.0
        into[-1, constant] = 1.0
        rows[..., observed : n - 1], block[: observed - fast, observed - fast : -1] = 0.0, 0.0
        return Basis(out, into, rates, pairs, block, rows)


def _separate_modes(matrix):
    """Return (eigenvalues, number of oscillating pairs, P, inverse of P) of a matrix, (n, n).

    P block-diagonalizes the matrix. Its columns are the real and the negative imaginary part of
    each pair, real modes, and a basis of the slow motions, orthogonal to the left eigenvectors of
    the fast modes. The slowest modes, and so defective ones, join the slow motions until P is well
    conditioned. The eigenvalues are those of pairs and real modes.
    """
    rates, left, right = scipy.linalg.eig(matrix, left=True, right=True)
    size, order = len(matrix), np.argsort(np.abs(rates), kind="stable")
    limit = _MAX_SLOW_RATE + _MAX_SLOW_SHARE * np.abs(rates).max()
    for slow_count in range(max(int((np.abs(rates) < limit).sum()), 1), size + 1):
        fast = order[slow_count:]
        if rates[fast].imag.sum() != 0.0:
            continue  # The two modes of a pair stay together.
        pairs, real = fast[rates[fast].imag > 0.0], fast[rates[fast].imag == 0.0]
        left_modes = np.hstack([left[:, pairs].real, left[:, pairs].imag, left[:, real].real])
        slow_motions = (
            scipy.linalg.null_space(left_modes.T, rcond=1e-13) if fast.size else np.eye(size)
        )
        fast_modes = np.concatenate([pairs, real])
        modes = right[:, fast_modes] - slow_motions @ _slow_components(
            matrix, rates[fast_modes], right[:, fast_modes], slow_motions
        )
        p = np.stack([modes[:, : pairs.size].real, -modes[:, : pairs.size].imag], axis=2)
        p = np.hstack([p.reshape(size, -1), modes[:, pairs.size :].real, slow_motions])
        if p.shape[1] == size and (np.linalg.cond(p) < _MAX_CONDITION or not fast.size):
            break
    return rates[fast_modes], pairs.size, p, np.linalg.inv(p)


def _slow_components(matrix, rates, modes, slow):
    """Return the components of slow motions that rounding has left in the eigenvectors `modes`.

    `slow` has the slow motions of `matrix` as columns; `modes`, with complex eigenvalues `rates`,
    the fast ones.
    """
    block = slow.T @ matrix @ slow
    residuals = (slow.T @ (matrix @ modes - modes * rates)).T[..., None]
    difference = block - rates[:, None, None] * np.eye(len(block))
    try:
        return np.linalg.solve(difference, residuals)[..., 0].T
    except np.linalg.LinAlgError:
        # Modes of equal rates need no correction: any vectors of their subspace are valid.
        return (np.linalg.pinv(difference, 1e-6) @ residuals)[..., 0].T


def _refined_basis(matrix, out, into, rates, pairs, block):
    """Return (out, into, rates, block) after a Newton step with residuals in long double.

    `out`, `into`, `rates`, `pairs` and `block` are the fields of a `Basis` of `matrix`, (n, n).
    """
    n, fast = len(matrix), pairs + rates.size
    long = [x.astype(np.longdouble) for x in (matrix, out, into)]
    # In complex coordinates a pair is an eigenvector and its conjugate.
    to_complex = np.eye(n, dtype=complex)
    order = np.concatenate([np.arange(0, 2 * pairs, 2), np.arange(2 * pairs, fast)])
    eigenvalues = np.zeros(fast, complex)
    eigenvalues[order], eigenvalues[1 : 2 * pairs : 2] = rates, rates[:pairs].conj()
    for i in range(0, 2 * pairs, 2):
        to_complex[i : i + 2, i : i + 2] = (1.0, 1.0j), (1.0, -1.0j)
    from_complex = np.linalg.inv(to_complex)
    diagonal = np.zeros((n, n), complex)
    diagonal[range(fast), range(fast)] = eigenvalues
    motion = (from_complex @ diagonal @ to_complex).real
    motion[fast:, fast:] = block
    gram = long[2] @ long[1]
    residual = (long[2] @ (long[0] @ long[1]) - gram @ motion.astype(np.longdouble)).astype(float)
    error, residual = (gram - np.eye(n)).astype(float), to_complex @ residual @ from_complex
    step, differences = np.zeros((n, n), complex), eigenvalues[None] - eigenvalues[:, None]
    # Equal eigenvalues need no correction: any vectors of their subspace are valid.
    equal = np.abs(differences) <= 1e-6 * np.abs(eigenvalues).max(initial=0.0)
    step[:fast, :fast] = np.where(
        equal, 0.0, residual[:fast, :fast] / np.where(equal, 1.0, differences)
    )
    for i, eigenvalue in enumerate(eigenvalues):
        shifted = block - eigenvalue * np.eye(n - fast)
        step[i, fast:] = np.linalg.solve(shifted.T, residual[i, fast:])
        step[fast:, i] = -np.linalg.solve(shifted, residual[fast:, i])
    step = (from_complex @ step @ to_complex).real
    return (
        (long[1] + out @ step).astype(float),
        (long[2] - (step + error) @ into).astype(float),
        rates + residual.diagonal()[order],
        block + residual[fast:, fast:].real,
    )


def _slow_coordinates(rows, block, constant, scale):
    """Return (new basis of the slow motions as columns, number of them that no distance contains).

    The last column is the constant component of the state, which the row vector `constant` maps to
    1. Before it come motions with a share in the distances below rounding. `rows` maps slow motions
    to distances, `scale` is its scale and `block` the matrix of the slow motions.
    """
    length = np.linalg.norm(constant)
    complement = scipy.linalg.null_space(constant[None])
    observed = [rows @ complement]
    for _ in range(len(block) - 2):
        observed.append(observed[-1] @ (complement.T @ block @ complement))
    _, singular_values, right_vectors = np.linalg.svd(np.vstack(observed))
    unobserved_count = complement.shape[1] - int((singular_values > 1e-9 * scale).sum())
    basis = np.hstack([complement @ right_vectors.T, constant[:, None] / length**2])
    return basis, unobserved_count


def add(tables: Modes, system: TrainSystem, frame: Frame, effects: np.ndarray) -> int:
    """Add the modes of a combination of mesh effects to the `Modes` in `tables`; return its row.

    `system` is the `TrainSystem`, `frame` its `Frame` and `effects`, int, shape (m,), the effect of
    each mesh. Full tables are emptied first.
    """
    if tables.used[0] == len(tables.keys):
        clear_tables(tables)
    combination, n, basis = tables.used[0], len(system.base_matrix), frame.basis_of(system, effects)
    _fill_distance_tables(tables, combination, basis.rates, basis.pairs, basis.block, basis.rows)
    tables.from_modes[combination], tables.to_modes[combination] = 0.0, 0.0
    tables.from_modes[combination, :, :n] = basis.out.T
    tables.to_modes[combination, :, :n] = basis.into.T
    tables.hash_slots[find_slot(tables.hash_slots, tables.keys, effects)] = combination
    tables.keys[combination] = effects
    tables.used[0] = combination + 1
    return combination


def _fill_distance_tables(tables, combination, rates, pairs, block, rows):
    """Fill a row of the `Modes` in `tables` with the polynomials and limits of the distances.

    `combination` is the row; `rates`, `pairs`, `block` and `rows` are the fields of a `Basis`.
    """
    size, fast = 2 * pairs, pairs + rates.size
    degree = tables.curves.shape[4] - 1
    # The 16th root of the norm of the 16th power does not depend on the scales of components.
    slow_rate = np.linalg.norm(np.linalg.matrix_power(block, 16)) ** (1.0 / 16.0)
    # The 1.0 limits pieces of slow motions to about a period of the reference mode.
    fastest_rate = max(np.abs(rates).max(initial=0.0), slow_rate, 1.0)
    half_length = 0.5 * MAX_PIECE_RATES[degree] / fastest_rate
    power_curves = _bernstein_of_powers(degree)
    order = np.arange(len(power_curves))
    exponents = half_length * rates[:, None]
    terms = np.exp(exponents) * exponents**order / factorial(order)
    mode_rows = np.concatenate(
        [rows[..., 0:size:2] - 1j * rows[..., 1:size:2], rows[..., size:fast]], axis=-1
    )
    mode_curves = mode_rows[..., None] * (terms @ power_curves)
    curves = tables.curves[combination]
    curves[:, :, 0:size:2] = mode_curves[:, :, :pairs].real
    curves[:, :, 1:size:2] = -mode_curves[:, :, :pairs].imag
    curves[:, :, size:fast] = mode_curves[:, :, pairs:].real
    curves[:, :, fast:] = 0.0
    slow_rows = rows[..., fast:] @ scipy.linalg.expm(half_length * block)
    for i, power in enumerate(power_curves):
        curves[:, :, fast:] += slow_rows[..., None] * power
        slow_rows = slow_rows @ block * (half_length / (i + 1))
    tables.pair_counts[combination] = pairs
    tables.real_counts[combination] = rates.size - pairs
    tables.piece_lengths[combination] = 2.0 * half_length
    tables.rates[combination, : rates.size] = np.stack([rates.real, rates.imag], axis=1)
    tables.slow_matrix[combination, : len(block), : len(block)] = block
    tables.slow_rate[combination] = slow_rate
    tables.mode_shares[combination, :, :, : rates.size] = np.abs(mode_rows)
    tables.slow_distance[combination] = rows[..., -1]
    tables.bounded[combination] = (rates.real <= _MAX_GROWTH).all() & ~rows[..., fast:-1].any(
        axis=-1
    )
