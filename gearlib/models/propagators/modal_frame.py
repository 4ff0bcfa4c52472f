"""Modes of a combination of contacts, for the kernels of gear trains.

The state obeys z' = A z with z = (q, q', 1, cos, sin, ...). Free rotations of the whole train come
out first, with its linear modes. Of the rest the slow motions, whose eigenvalues may form Jordan
blocks where meshes are apart, are split off by the real Schur form and stay a block; what is left
is diagonalised. The constant and the harmonics add forced motions. Where the basis is badly
conditioned, as it is close to a critical damping or to an undamped resonance, all stays one block,
whose series the kernels sum: matrix exponentials.
"""

import math
from fractions import Fraction
from functools import cache
from typing import NamedTuple

import numpy as np
import scipy.linalg

from gearlib.kernels import exponential
from gearlib.kernels.polynomial import bernstein_matrix
from gearlib.kernels.several_meshes.modal_arcs import (
    DEGREE,
    REACH,
    fill_curves,
    forget,
    key_of,
    slot_of,
)

#: Terms of the series of e^z, |z| <= REACH / 2: the next is 3.6^36 / 36! = 3e-22.
_TERMS = 36
#: Largest condition number of a basis, rows scaled: rounding of 1e-16 becomes 1e-10.
_CONDITION = 1e6
#: Slow eigenvalues lie below the widest gap between these, over that of the reference mode; real
#: ones, as of flights against damping, whose forced motion is far off, between the others.
_SLOW, _SLOW_REAL = (1e-3, 3e-2), (0.3, 3.0)
#: Coupling of a free rotation, and growth of a mode, that is rounding.
_NOTHING = 1e-12
#: Norm of a block times its piece: 2^24 / 24! = 3e-17.
_BLOCK = 2.0


class Basis(NamedTuple):
    """A basis of the moving components: z = out y, y = into z, f fast components before s slow."""

    out: np.ndarray  #: shape (2 N, 2 N)
    into: np.ndarray
    pairs: np.ndarray  #: complex eigenvalues, positive imaginary parts
    single: np.ndarray  #: real eigenvalues
    block: np.ndarray  #: matrix of the slow ones, shape (s, s)
    hidden: int  #: last slow components on which no distance depends


@cache
def _exponentials():
    """Return the matrix, (_TERMS, DEGREE + 1), from x^k to Bernstein coefficients on [-1, 1].

    Powers are cut behind the Chebyshev polynomial of degree DEGREE.
    """
    chebyshev = []
    for n in range(DEGREE + 1):
        b = [
            Fraction((-1) ** (n - j) * math.comb(2 * n, 2 * j), math.comb(n, j))
            for j in range(n + 1)
        ]
        for d in range(n, DEGREE):
            b = [
                (Fraction(j, d + 1) * b[j - 1] if j else Fraction(0))
                + (Fraction(d + 1 - j, d + 1) * b[j] if j <= d else Fraction(0))
                for j in range(d + 2)
            ]
        chebyshev.append(b)
    rows = []
    for k in range(_TERMS):
        row = [Fraction(0)] * (DEGREE + 1)
        for n in range(k % 2, min(k, DEGREE) + 1, 2):
            share = Fraction(math.comb(k, (k - n) // 2), 2 ** (k - 1 if n else k))
            row = [value + share * b for value, b in zip(row, chebyshev[n], strict=True)]
        rows.append([float(value) for value in row])
    return np.array(rows)


@cache
def _powers():
    return bernstein_matrix(DEGREE)


class Frame:
    """Coordinates in which bases are sought: linear modes of a train, free rotations behind them.

    In those of all meshes at their mean stiffness, scaled by their frequencies, springs of very
    different stiffness lie apart: slow modes keep their digits beside shafts a million times as
    stiff as a mesh.

    Parameters
    ----------
    frequencies : ndarray, shape (r,)
        Of the linear modes, by theta.
    shapes, rigid : ndarray, shapes (n, r), (n, k)
        Modes and free rotations.
    mass : ndarray, shape (n, n)
        With which they are normalised.
    """

    def __init__(self, frequencies, shapes, rigid, mass):
        (n, r), k, w = shapes.shape, rigid.shape[1], frequencies
        self.elastic = e = 2 * r
        self.out, self.into, self.free = np.zeros((3, 2 * n, 2 * n))
        self.out[:n, :r], self.out[n:, r:e] = shapes / w, shapes
        self.out[:n, e : e + k], self.out[n:, e + k :] = rigid, rigid
        momenta, turns = shapes.T @ mass, rigid.T @ mass
        self.into[:r, :n], self.into[r:e, n:] = w[:, None] * momenta, momenta
        self.into[e : e + k, :n], self.into[e + k :, n:] = turns, turns
        self.free[:r, r:e], self.free[e : e + k, e + k :] = np.diag(w), np.eye(k)

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
        from gearlib.models.trains.system import scaled

        parts, unit = scaled(train, system.tuning), train.stiffness_scale
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

    def basis(self, a):
        """Return the `Basis` of such a matrix; None where it is badly conditioned."""
        e, size = self.elastic, len(a)
        # Dampers against the ground hold free rotations too.
        if np.abs(a[:e, e:]).max(initial=0.0) > _NOTHING * np.abs(a).max():
            e = size
        values, vectors, slow, block = _split(a[:e, :e])
        rigid, drive = a[e:, e:], a[e:, :e]
        one, fast, chosen = np.eye(size - e), vectors, values.imag > 0.0
        if size > e:
            unlike = values[:, None, None] * one - rigid
            moved = np.linalg.solve(unlike, (drive @ vectors).T[..., None])[..., 0].T
            fast = np.vstack([vectors, moved])
        pairs, single = values[chosen], values[values.imag == 0.0].real
        s = slow.shape[1] + size - e
        p = np.zeros((size, size))
        turning = fast[:, chosen]
        if 2 * pairs.size + single.size + s != size:
            return None
        p[:, : 2 * pairs.size : 2], p[:, 1 : 2 * pairs.size : 2] = turning.real, -turning.imag
        p[:, 2 * pairs.size : size - s] = fast[:, values.imag == 0.0].real
        p[:e, size - s : size - len(one)] = slow
        p[e:, size - len(one) :] = one
        blocks = np.zeros((s, s))
        blocks[: slow.shape[1], : slow.shape[1]] = block
        blocks[slow.shape[1] :, : slow.shape[1]] = drive @ slow
        blocks[slow.shape[1] :, slow.shape[1] :] = rigid
        try:
            back = np.linalg.inv(p)
        except np.linalg.LinAlgError:
            return None
        if not (np.abs(p) @ np.abs(back)).sum(axis=1).max() < _CONDITION:
            return None
        return Basis(self.out @ p, back @ self.into, pairs, single, blocks, len(one))


def _gap(sizes, bounds):
    """Return the middle of the widest gap between sizes, in the logarithm, between two bounds."""
    edges = np.sort([*bounds, *sizes[(sizes > bounds[0]) & (sizes < bounds[1])]])
    k = int(np.argmax(np.diff(np.log(edges))))
    return math.sqrt(edges[k] * edges[k + 1])


def _split(a):
    """Return (fast eigenvalues, their vectors, basis of the slow part, its block)."""
    values, vectors = np.linalg.eig(a)
    sizes, real = np.abs(values), values.imag == 0.0
    if sizes.min(initial=math.inf) >= _SLOW[1] and not (real & (sizes < _SLOW_REAL[1])).any():
        return values + 0j, vectors, np.zeros((len(a), 0)), np.zeros((0, 0))
    slow, damped = _gap(sizes, _SLOW), _gap(sizes[real], _SLOW_REAL)
    if not ((sizes < slow) | (real & (sizes < damped))).any():
        return values + 0j, vectors, np.zeros((len(a), 0)), np.zeros((0, 0))
    t, q, s = scipy.linalg.schur(
        a, output="real", sort=lambda x, y: math.hypot(x, y) < (slow if y else damped)
    )
    own = scipy.linalg.solve_sylvester(t[:s, :s], -t[s:, s:], -t[:s, s:])
    values, vectors = np.linalg.eig(t[s:, s:])
    return values + 0j, (q[:, s:] + q[:, :s] @ own) @ vectors, q[:, :s], t[:s, :s]


def _forced(basis, inputs, frequencies):
    """Return the responses of y to the harmonics, shape (2 N, 2 h); inputs of the same shape."""
    forces = basis.into @ inputs
    out, k = np.zeros_like(forces), 2 * basis.pairs.size
    f = k + basis.single.size
    for j, w in enumerate(frequencies):
        cosine, sine = forces[:, 2 * j], forces[:, 2 * j + 1]
        c, s = (part[:k:2] + 1j * part[1:k:2] for part in (cosine, sine))
        more = 0.5 * (c - 1j * s) / (1j * w - basis.pairs)
        less = 0.5 * (c + 1j * s) / (-1j * w - basis.pairs)
        both, apart = more + less, 1j * (more - less)
        out[:k:2, 2 * j], out[1:k:2, 2 * j] = both.real, both.imag
        out[:k:2, 2 * j + 1], out[1:k:2, 2 * j + 1] = apart.real, apart.imag
        behind = np.concatenate(
            [
                (cosine[k:f] - 1j * sine[k:f]) / (1j * w - basis.single),
                np.linalg.solve(
                    1j * w * np.eye(len(basis.block)) - basis.block, cosine[f:] - 1j * sine[f:]
                ),
            ]
        )
        out[k:, 2 * j], out[k:, 2 * j + 1] = behind.real, -behind.imag
    return out


def _whole(basis, a, frequencies):
    """Return (out, into, rates of pairs, of real modes, block) of all components of z."""
    n, moving = len(a), len(basis.block) + 2 * basis.pairs.size + basis.single.size
    h, k = frequencies.size, 2 * basis.pairs.size
    f = k + basis.single.size
    waves = _forced(basis, a[:moving, moving + 1 :], frequencies)
    push = basis.into @ a[:moving, moving]
    rest = np.zeros(moving)
    still = -(push[:k:2] + 1j * push[1:k:2]) / basis.pairs
    rest[:k:2], rest[1:k:2], rest[k:f] = still.real, still.imag, -push[k:f] / basis.single
    # Pairs, harmonics, real modes, the block, the constant.
    order = np.concatenate([np.arange(k), moving + np.arange(2 * h), np.arange(k, moving), [n - 1]])
    out, into = np.zeros((n, n)), np.zeros((n, n))
    out[:moving, :moving], into[:moving, :moving] = basis.out, basis.into
    out[:moving, moving : n - 1], out[:moving, n - 1] = basis.out @ waves, basis.out @ rest
    into[:moving, moving], into[:moving, moving + 1 :] = -rest, -waves
    out[moving, n - 1] = into[n - 1, moving] = 1.0
    out[moving + 1 :, moving : n - 1] = into[moving : n - 1, moving + 1 :] = np.eye(2 * h)
    s = moving - f
    block = np.zeros((s + 1, s + 1))
    block[:s, :s], block[:s, s] = basis.block, push[f:]
    pairs = np.concatenate([basis.pairs, 1j * frequencies])
    return out[:, order], into[order], pairs, basis.single, block


def _piece_of(block):
    """Return a length on which the series of a block ends behind DEGREE."""
    # The root of so high a power hides the scales of the components.
    size = np.linalg.norm(np.linalg.matrix_power(block, DEGREE + 1)) ** (1.0 / (DEGREE + 1))
    return _BLOCK / size if size > 0.0 else math.inf


def add(tables, system, grid, frame, effects):
    """Add a combination of effects, int, shape (m,), to the tables; those that are full forget."""
    n, h = len(system.free), system.harmonics.size
    if tables.known[0] == tables.keys.size:
        forget(tables)
    c = tables.known[0]
    a = system.free.copy()
    for j, effect in enumerate(effects):
        if effect:
            push, grip = system.push[j, effect], system.grip[j, effect]
            # Number by number: a library's sums may hang on where in memory they lie.
            a += push[0][:, None] * grip[0] + push[1][:, None] * grip[1]
    moving = n - 1 - 2 * h
    basis = frame.basis(frame.matrix(system, effects))
    out, into, pairs, single, block = np.eye(n), np.eye(n), np.zeros(0), np.zeros(0), a
    # Of slow motions too a piece is no longer than some period of the reference mode.
    hidden, piece = 0, REACH
    if basis is not None:
        # At a resonance without damping nothing is finite.
        with np.errstate(divide="ignore", invalid="ignore"):
            found = _whole(basis, a, grid.spin)
            # Of forced motions that nearly cancel: in static deflections.
            sizes = (np.abs(found[0]) @ np.abs(found[1][:, moving:]))[:moving]
        if not sizes.max() < _CONDITION:
            basis = None
        else:
            (out, into, pairs, single, block), hidden = found, basis.hidden
    k, f = 2 * pairs.size, 2 * pairs.size + single.size
    rates = np.concatenate([pairs, single])
    if rates.size:
        piece = min(piece, REACH / np.abs(rates).max())
    if basis is None:
        piece = _BLOCK * system.longest / exponential.REACH
    elif len(block) > 1:
        piece = min(piece, _piece_of(block))
    tables.pairs[c], tables.single[c], tables.piece[c] = pairs.size, single.size, piece
    tables.rates[c, : rates.size, 0], tables.rates[c, : rates.size, 1] = rates.real, rates.imag
    tables.block[c, : n - f, : n - f] = block
    tables.into[c, :, :n], tables.out[c, :, :n] = into.T, out.T
    rows = np.stack([system.far, system.near]) @ out
    # Free rotations of the whole train move no mesh.
    rows[:, :, n - 1 - hidden : n - 1] = 0.0
    fill_curves(tables, c, rows, _exponentials(), _powers())
    tables.swing[c, :, :, : pairs.size] = np.hypot(rows[:, :, :k:2], rows[:, :, 1:k:2])
    tables.swing[c, :, :, pairs.size : rates.size] = np.abs(rows[:, :, k:f])
    tables.level[c] = rows[:, :, n - 1]
    tables.steady[c] = ~rows[:, :, f : n - 1].any(axis=2) & (rates.real <= _NOTHING).all()
    key = key_of(effects, system.push.shape[1])
    tables.slots[slot_of(tables.slots, tables.keys, key)] = c
    tables.keys[c] = key
    tables.known[0] = c + 1
    return c
