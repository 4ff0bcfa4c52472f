"""Modes of a combination of contacts, for the kernels of gear trains.

The state obeys z' = A z with z = (q, q', 1, cos, sin, ...). In coordinates of the linear modes of
the train, with its free rotations behind them, A has a basis in which fast motions turn or shrink
one by one. The slowest motions, as many as it takes for a well-conditioned basis, stay together in
a block whose series the kernels sum: free rotations, flights, the constant, modes near a critical
damping or an undamped resonance.
"""

import math
from fractions import Fraction
from functools import cache
from typing import NamedTuple

import numpy as np
import scipy.linalg
from scipy.special import factorial

from gearlib.engines.linear.modal_arcs import REACHES, forget, slot_of
from gearlib.engines.linear.train_system import matrix_of

#: Terms of the series of e^z, |z| <= 3.6: the next is 3.6^36 / 36! = 3e-22.
_TERMS = 36
#: Largest condition number of a basis.
_CONDITION = 100.0
#: Rates, over that of the reference mode, and over the fastest, below which motions are slow.
_SLOW, _SLOW_SHARE = 1e-5, 1e-9
#: Static deflections beyond which the rounding of a basis, which changes of contact add up, counts.
_FAR = 8.0
#: Bases that are kept.
_MAX_BASES = 64
#: Growth of a mode that is rounding.
_ROUNDING = 1e-12


class Basis(NamedTuple):
    """A basis of a combination of contacts: z = out y, y = into z, n components.

    Oscillating pairs come first, then real modes, then the slow motions with the constant last.
    """

    out: np.ndarray  #: shape (n, n)
    into: np.ndarray  #: shape (n, n)
    rates: np.ndarray  #: complex, of pairs and real modes
    pairs: int
    block: np.ndarray  #: matrix of the slow motions
    rows: np.ndarray  #: distances from the far and near lines as functionals of y, (2, m, n)


@cache
def _exponentials(degree):
    """Return the matrix, (_TERMS, degree + 1), from x^k to Bernstein coefficients on [-1, 1].

    Powers are cut behind the Chebyshev polynomial of that degree.
    """
    chebyshev = []
    for n in range(degree + 1):
        b = [
            Fraction((-1) ** (n - j) * math.comb(2 * n, 2 * j), math.comb(n, j))
            for j in range(n + 1)
        ]
        for d in range(n, degree):
            b = [
                (Fraction(j, d + 1) * b[j - 1] if j else Fraction(0))
                + (Fraction(d + 1 - j, d + 1) * b[j] if j <= d else Fraction(0))
                for j in range(d + 2)
            ]
        chebyshev.append(b)
    rows = []
    for k in range(_TERMS):
        row = [Fraction(0)] * (degree + 1)
        for n in range(k % 2, min(k, degree) + 1, 2):
            share = Fraction(math.comb(k, (k - n) // 2), 2 ** (k - 1 if n else k))
            row = [value + share * b for value, b in zip(row, chebyshev[n], strict=True)]
        rows.append([float(value) for value in row])
    return np.array(rows)


class Frame:
    """Coordinates in which bases are sought: linear modes of a train, free rotations behind them.

    In those of all meshes at their mean stiffness, scaled by their frequencies, springs of very
    different stiffness lie apart: slow modes keep their digits beside shafts a million times as
    stiff as a mesh.
    """

    def __init__(self, frequencies, shapes, rigid, mass):
        """Take r frequencies by theta, modes, (n, r), free rotations, (n, k), and the mass."""
        (n, r), k, w = shapes.shape, rigid.shape[1], frequencies
        self.elastic = e = 2 * r
        self._known: dict[bytes, Basis] = {}
        #: Tables between two runs, see `propagator.Propagator`.
        self.spare: list[tuple] = []
        self.out, self.into, self.free = np.zeros((3, 2 * n, 2 * n))
        self.out[:n, :r], self.out[n:, r:e] = shapes / w, shapes
        self.out[:n, e : e + k], self.out[n:, e + k :] = rigid, rigid
        momenta, turns = shapes.T @ mass, rigid.T @ mass
        self.into[:r, :n], self.into[r:e, n:] = w[:, None] * momenta, momenta
        self.into[e : e + k, :n], self.into[e + k :, n:] = turns, turns
        self.free[:r, r:e], self.free[e : e + k, e + k :] = np.diag(w), np.eye(k)

    def __getstate__(self):
        # Another process makes its own.
        return vars(self) | {"_known": {}, "spare": []}

    @classmethod
    def of_mesh(cls, model, system):
        """Return the frame of a model with one mesh."""
        frame = cls(*model.linear(system))
        size, e = len(frame.out), frame.elastic
        r = e // 2
        rows = np.r_[r:e, e + size // 2 - r : size]
        known = [*range(e), *rows[r:]]
        whole = frame.into @ system.free[:size, :size] @ frame.out
        # Positions of free rotations move nothing.
        frame.free[np.ix_(rows, known)] = whole[np.ix_(rows, known)]
        return frame

    @classmethod
    def of_train(cls, train, system):
        """Return the frame of a train."""
        parts, unit = train.scaled(system.tuning), train.stiffness_scale
        squares, shapes = train.linear_modes
        omega = train.reference_angular_frequency
        shapes, rigid = (x * (math.sqrt(unit) / omega) for x in (shapes, train.free_motions))
        w = np.sqrt(squares) / omega
        frame = cls(w, shapes, rigid, parts.mass)
        (n, r), k, e = shapes.shape, rigid.shape[1], frame.elastic
        # The springs alone, without the meshes at their mean stiffness.
        beta = train.structure.lines @ shapes
        mean = np.array([mesh.mean_stiffness for mesh in train.meshes]) / unit
        frame.free[r:e, :r] = (beta.T * mean) @ beta / w - np.diag(w)
        both = np.hstack([shapes, rigid])
        rows = np.concatenate([np.arange(r, e), np.arange(e + k, 2 * n)])
        places = np.concatenate([np.arange(r), e + np.arange(k)])
        scales = np.concatenate([1.0 / w, np.ones(k)])
        frame.free[np.ix_(rows, places)] -= (both.T @ parts.frame @ both) * scales
        speeds = parts.mass @ system.free[n : 2 * n, n : 2 * n]
        frame.free[np.ix_(rows, rows)] += both.T @ speeds @ both
        return frame

    def matrix(self, system, effects):
        """Return the matrix of a combination of effects in these coordinates, shape (2 N, 2 N)."""
        a, size = self.free.copy(), len(self.free)
        for j, effect in enumerate(effects):
            if effect:
                grip = system.grip[j, effect, :, :size] @ self.out
                grip[:, self.elastic : self.elastic + (size - self.elastic) // 2] = 0.0
                a += (self.into @ system.push[j, effect, :, :size].T) @ grip
        return a

    def basis_of(self, system, effects):
        """Return the `Basis` of a combination of effects, computed once for each matrix."""
        whole = np.empty_like(system.free)
        matrix_of(system, effects, whole)
        key = whole.tobytes()
        basis = self._known.get(key)
        if basis is None:
            basis = self._new_basis(system, effects, whole)
            if len(self._known) >= _MAX_BASES:
                self._known.clear()
            self._known[key] = basis
        return basis

    def _new_basis(self, system, effects, whole):
        """Return the `Basis` of a combination of effects and its matrix dz/dtheta = whole z."""
        n, moving, r = len(whole), len(self.out), self.elastic // 2
        a, out, into = np.zeros((n, n)), np.eye(n), np.eye(n)
        a[:moving, :moving] = self.matrix(system, effects)
        a[:moving, moving:] = self.into @ whole[:moving, moving:]
        a[moving:, moving:] = whole[moving:, moving:]
        # The constant and the harmonics are scaled by the deflections that they cause.
        frequencies = self.free[range(r), range(r, 2 * r)]
        forces = a[r : 2 * r, moving:] / frequencies[:, None]
        deflection = np.abs(self.out[: moving // 2, :r] @ forces).max(initial=0.0)
        scale = np.ones(n)
        scale[moving:] /= np.abs(forces).max(initial=1.0)
        out[:moving, :moving], into[:moving, :moving] = self.out, self.into
        out, into, a = out * scale, into / scale[:, None], a * scale / scale[:, None]
        rates, pairs, p, inverse = _split(a)
        fast, one = pairs + rates.size, n - 1 - 2 * system.harmonics.size
        out, into, block = out @ p, inverse @ into, inverse[fast:] @ a @ p[:, fast:]
        lines = np.stack([system.far, system.near])
        rows = (lines @ out).reshape(-1, n)
        turn, hidden = _turned(rows[:, fast:], block, out[one, fast:], np.abs(rows).max())
        back = np.linalg.inv(turn)
        out[:, fast:], into[fast:], block = out[:, fast:] @ turn, back @ into[fast:], back @ block
        block, seen = block @ turn, n - 1 - hidden
        if deflection > _FAR:
            out, into, rates, block = _refined(whole, out, into, rates, pairs, block)
        rows = lines @ out
        # What is zero but for rounding would make the constant move.
        block[-1], into[-1] = 0.0, 0.0
        into[-1, one] = 1.0
        rows[..., seen : n - 1], block[: seen - fast, seen - fast : -1] = 0.0, 0.0
        return Basis(out, into, rates, pairs, block, rows)


def _split(a):
    """Return (rates of pairs and real modes, number of pairs, P, inverse of P) of a matrix.

    Columns of P: real and negative imaginary part of each pair, real modes, slow motions. The
    latter are what all left eigenvectors of fast modes annihilate. The slowest mode joins them
    until P is well conditioned, so that they take in what has no eigenvectors of its own.
    """
    rates, left, right = scipy.linalg.eig(a, left=True, right=True)
    size, order = len(a), np.argsort(np.abs(rates), kind="stable")
    limit = _SLOW + _SLOW_SHARE * np.abs(rates).max()
    for slow in range(max(int((np.abs(rates) < limit).sum()), 1), size + 1):
        fast = order[slow:]
        if rates[fast].imag.sum() != 0.0:
            continue  # a pair stays together
        pairs, real = fast[rates[fast].imag > 0.0], fast[rates[fast].imag == 0.0]
        dual = np.hstack([left[:, pairs].real, left[:, pairs].imag, left[:, real].real])
        rest = scipy.linalg.null_space(dual.T, rcond=1e-13) if fast.size else np.eye(size)
        kept = np.concatenate([pairs, real])
        modes = right[:, kept] - rest @ _slow_parts(a, rates[kept], right[:, kept], rest)
        p = np.stack([modes[:, : pairs.size].real, -modes[:, : pairs.size].imag], axis=2)
        p = np.hstack([p.reshape(size, -1), modes[:, pairs.size :].real, rest])
        if p.shape[1] == size and (np.linalg.cond(p) < _CONDITION or not fast.size):
            break
    return rates[kept], pairs.size, p, np.linalg.inv(p)


def _slow_parts(a, rates, modes, rest):
    """Return the slow motions, in columns of `rest`, that rounding has left in fast modes."""
    block = rest.T @ a @ rest
    residuals = (rest.T @ (a @ modes - modes * rates)).T[..., None]
    apart = block - rates[:, None, None] * np.eye(len(block))
    try:
        return np.linalg.solve(apart, residuals)[..., 0].T
    except np.linalg.LinAlgError:
        # Equal rates stay as they are: any vectors of them will do.
        return (np.linalg.pinv(apart, 1e-6) @ residuals)[..., 0].T


def _refined(matrix, out, into, rates, pairs, block):
    """Return (out, into, rates, block) after a step of Newton's method with long residuals."""
    n, fast = len(matrix), pairs + rates.size
    long = [x.astype(np.longdouble) for x in (matrix, out, into)]
    # Amplitudes of pairs as two complex numbers, that of w and that of its conjugate.
    turn = np.eye(n, dtype=complex)
    order = np.concatenate([np.arange(0, 2 * pairs, 2), np.arange(2 * pairs, fast)])
    eigenvalues = np.zeros(fast, complex)
    eigenvalues[order], eigenvalues[1 : 2 * pairs : 2] = rates, rates[:pairs].conj()
    for i in range(0, 2 * pairs, 2):
        turn[i : i + 2, i : i + 2] = (1.0, 1.0j), (1.0, -1.0j)
    back = np.linalg.inv(turn)
    diagonal = np.zeros((n, n), complex)
    diagonal[range(fast), range(fast)] = eigenvalues
    motion = (back @ diagonal @ turn).real
    motion[fast:, fast:] = block
    gram = long[2] @ long[1]
    residual = (long[2] @ (long[0] @ long[1]) - gram @ motion.astype(np.longdouble)).astype(float)
    error, residual = (gram - np.eye(n)).astype(float), turn @ residual @ back
    step, apart = np.zeros((n, n), complex), eigenvalues[None] - eigenvalues[:, None]
    # Equal ones stay as they are: any vectors of them will do.
    alike = np.abs(apart) <= 1e-6 * np.abs(eigenvalues).max(initial=0.0)
    step[:fast, :fast] = np.where(alike, 0.0, residual[:fast, :fast] / np.where(alike, 1.0, apart))
    for i, eigenvalue in enumerate(eigenvalues):
        unlike = block - eigenvalue * np.eye(n - fast)
        step[i, fast:] = np.linalg.solve(unlike.T, residual[i, fast:])
        step[fast:, i] = -np.linalg.solve(unlike, residual[fast:, i])
    step = (back @ step @ turn).real
    return (
        (long[1] + out @ step).astype(float),
        (long[2] - (step + error) @ into).astype(float),
        rates + residual.diagonal()[order],
        block + residual[fast:, fast:].real,
    )


def _turned(rows, block, constant, scale):
    """Return (matrix, motions that no distance depends on) that turns the slow motions.

    The constant, to which a functional of theirs is turned, comes last, before it those motions,
    whose share in the distances is small beside their `scale`.
    """
    size = np.linalg.norm(constant)
    others = scipy.linalg.null_space(constant[None])
    observed = [rows @ others]
    for _ in range(len(block) - 2):
        observed.append(observed[-1] @ (others.T @ block @ others))
    _, sizes, turn = np.linalg.svd(np.vstack(observed))
    hidden = others.shape[1] - int((sizes > 1e-9 * scale).sum())
    return np.hstack([others @ turn.T, constant[:, None] / size**2]), hidden


def add(tables, system, frame, effects):
    """Add a combination of effects, int, shape (m,), to the tables; those that are full forget."""
    if tables.known[0] == len(tables.keys):
        forget(tables)
    c, n, basis = tables.known[0], len(system.free), frame.basis_of(system, effects)
    _fill(tables, c, basis.rates, basis.pairs, basis.block, basis.rows)
    tables.out[c], tables.into[c] = 0.0, 0.0
    tables.out[c, :, :n], tables.into[c, :, :n] = basis.out.T, basis.into.T
    tables.slots[slot_of(tables.slots, tables.keys, effects)] = c
    tables.keys[c] = effects
    tables.known[0] = c + 1
    return c


def _fill(tables, c, rates, pairs, block, rows):
    """Fill what tells the distances of combination c from its rates, slow block and rows."""
    size, k = 2 * pairs, pairs + rates.size
    degree = tables.curves.shape[4] - 1
    # A high power hides the scales of the components of a block.
    pace = np.linalg.norm(np.linalg.matrix_power(block, 16)) ** (1.0 / 16.0)
    # Of slow motions too a piece is no longer than some period of the reference mode.
    half = 0.5 * REACHES[degree] / max(np.abs(rates).max(initial=0.0), pace, 1.0)
    exponentials = _exponentials(degree)
    order = np.arange(len(exponentials))
    terms = np.exp(half * rates)[:, None] * (half * rates[:, None]) ** order / factorial(order)
    sizes = np.concatenate(
        [rows[..., 0:size:2] - 1j * rows[..., 1:size:2], rows[..., size:k]], axis=-1
    )
    waves = sizes[..., None] * (terms @ exponentials)
    curves = tables.curves[c]
    curves[:, :, 0:size:2] = waves[:, :, :pairs].real
    curves[:, :, 1:size:2] = -waves[:, :, :pairs].imag
    curves[:, :, size:k] = waves[:, :, pairs:].real
    curves[:, :, k:] = 0.0
    slow = rows[..., k:] @ scipy.linalg.expm(half * block)
    for i, power in enumerate(exponentials):
        curves[:, :, k:] += slow[..., None] * power
        slow = slow @ block * (half / (i + 1))
    tables.pairs[c], tables.single[c], tables.piece[c] = pairs, rates.size - pairs, 2.0 * half
    tables.rates[c, : rates.size] = np.stack([rates.real, rates.imag], axis=1)
    tables.block[c, : len(block), : len(block)], tables.pace[c] = block, pace
    tables.swing[c, :, :, : rates.size], tables.level[c] = np.abs(sizes), rows[..., -1]
    tables.steady[c] = (rates.real <= _ROUNDING).all() & ~rows[..., k:-1].any(axis=-1)
