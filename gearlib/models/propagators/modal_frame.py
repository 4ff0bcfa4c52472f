"""Modes of a combination of contacts, for the kernels of gear trains.

The state obeys z' = A z with z = (q, q', 1, cos, sin, ...). Free rotations of the whole train come
out first, with its linear modes. Of the rest the slow motions, whose eigenvalues may form Jordan
blocks where meshes are apart, are split off by the real Schur form and stay a block; what is left
is diagonalised. The constant and the harmonics add forced motions. Where the basis is badly
conditioned, as it is close to a critical damping or to an undamped resonance, all stays one block,
whose series the kernels sum: matrix exponentials.

Threads share a frame. What it has made is finished when it is put there, and never written to
again: all take the first that was there.
"""

import math
from fractions import Fraction
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.linalg import lapack

from gearlib.kernels import exponential
from gearlib.kernels.polynomial import bernstein_matrix
from gearlib.kernels.several_meshes.filling import (
    NOTHING,
    fill_basis,
    fill_distances,
    fill_modes,
)
from gearlib.kernels.several_meshes.modal_arcs import BLOCKS, REACHES, forget, slot_of
from gearlib.kernels.several_meshes.train_system import matrix_of

#: Terms of the series of e^z, |z| <= 3.6: the next is 3.6^36 / 36! = 3e-22.
_TERMS = 36
#: Slow eigenvalues lie below the widest gap between these, over that of the reference mode; real
#: ones, as of flights against damping, whose forced motion is far off, between the others.
_SLOW, _SLOW_REAL = (1e-3, 3e-2), (0.3, 3.0)
#: Decay of a single slow mode whose forced motion is not far off.
_LEAST_CREEP = 1e-5
#: Bases that are kept at most.
_MOST = 64
#: Static deflections beyond which the rounding of a basis, which every change of contact adds once
#: more in the same direction, is taken out of it.
_FAR = 8.0


class Basis(NamedTuple):
    """A basis of the moving components: z = out y, y = into z, f fast components before s slow.

    Its arrays are not to be written to.
    """

    out: np.ndarray  #: shape (2 N, 2 N)
    into: np.ndarray
    pairs: np.ndarray  #: complex eigenvalues, positive imaginary parts
    single: np.ndarray  #: real eigenvalues
    block: np.ndarray  #: matrix of the slow ones, shape (s, s)
    hidden: int  #: last slow components on which no distance depends


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


@cache
def _powers(degree):
    return bernstein_matrix(degree)


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
        self.elastic, self.far_off = (e := 2 * r), False
        self._known: dict[bytes, Basis | None] = {}
        #: Tables between two runs, see `several_meshes.Propagator`.
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

    def loaded(self, system):
        """Note whether the loads of a system deflect it far; return the frame."""
        r, size = self.elastic // 2, len(self.out)
        load = self.into[r : 2 * r, size // 2 :] @ system.free[size // 2 : size, size]
        # Coordinates of modes are over their frequencies, once in the columns, once more here.
        deflections = self.out[: size // 2, :r] @ (load / self.free[:r, r : 2 * r].diagonal())
        self.far_off = bool(np.abs(deflections).max(initial=0.0) > _FAR)
        return self

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
        return frame.loaded(system)

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

    def basis_of(self, system, effects):
        """Return the `Basis` of a combination of effects, which tunings and flanks may share."""
        a = self.matrix(system, effects)
        key = a.tobytes()
        if key in (known := self._known):
            return known[key]
        found = self.basis(a)
        if found is not None:
            if self.far_off:
                found = refined(found, system, effects)
            for one in found[:-1]:
                one.setflags(write=False)
        if len(known) >= _MOST:
            # Those that read the old ones go on with them.
            self._known = known = {}
        return known.setdefault(key, found)

    def basis(self, a):
        """Return the `Basis` of such a matrix; None where it is badly conditioned."""
        e = self.elastic
        # Dampers against the ground hold free rotations too.
        if np.abs(a[:e, e:]).max(initial=0.0) > NOTHING * np.abs(a).max():
            e = len(a)
        out, into = self.out.copy(), self.into.copy()
        # Of one layout: the kernel is compiled once.
        parts = [np.ascontiguousarray(part) for part in _split(a[:e, :e])]
        pairs, single, block, sound = fill_basis(a, *parts, out, into)
        return Basis(out, into, pairs, single, block, len(a) - e) if sound else None


def refined(basis, system, effects):
    """Return a `Basis` of a combination of effects without the rounding of its computation.

    One step of Newton's method with the residuals in long numbers; the block stays as it is.
    """
    size, long = len(basis.out), np.longdouble
    out, into = basis.out.astype(long), basis.into.astype(long)
    a = system.free[:size, :size].astype(long)
    for j, effect in enumerate(effects):
        if effect:
            push, grip = (x[j, effect, :, :size].astype(long) for x in (system.push, system.grip))
            a = a + push.T @ grip
    k, f = 2 * basis.pairs.size, 2 * basis.pairs.size + basis.single.size
    # Pairs as two complex amplitudes, that of w and that of its conjugate.
    turn, rates = np.eye(size, dtype=complex), np.zeros(size, complex)
    for i in range(0, k, 2):
        turn[i : i + 2, i : i + 2] = (1.0, 1.0j), (1.0, -1.0j)
    rates[:k:2], rates[1:k:2], rates[k:f] = basis.pairs, basis.pairs.conj(), basis.single
    own = np.zeros((size, size), np.longdouble)
    own[range(f), range(f)] = rates.real[:f]
    own[range(0, k, 2), range(1, k, 2)] = -rates.imag[:k:2]
    own[range(1, k, 2), range(0, k, 2)] = rates.imag[:k:2]
    own[f:, f:] = basis.block
    gram = into @ out
    residual = turn @ (into @ (a @ out) - gram @ own).astype(float) @ np.linalg.inv(turn)
    error, more = (gram - np.eye(size)).astype(float), np.zeros((size, size), complex)
    apart = rates[None, :f] - rates[:f, None]
    # Equal ones stay as they are: any vectors of them will do.
    alike = np.abs(apart) <= 1e-6 * np.abs(rates[:f]).max(initial=0.0)
    more[:f, :f] = np.where(alike, 0.0, residual[:f, :f] / np.where(alike, 1.0, apart))
    for i in range(f if f < size else 0):
        unlike = basis.block - rates[i] * np.eye(size - f)
        more[i, f:] = np.linalg.solve(unlike.T, residual[i, f:])
        more[f:, i] = -np.linalg.solve(unlike, residual[f:, i])
    step, change = (np.linalg.inv(turn) @ more @ turn).real, residual.diagonal()
    return basis._replace(
        out=(out + basis.out @ step).astype(float),
        into=(into - (step + error) @ basis.into).astype(float),
        pairs=basis.pairs + change[:k:2],
        single=basis.single + change[k:f].real,
    )


def _gap(sizes, bounds):
    """Return the middle of the widest gap between sizes, in the logarithm, between two bounds."""
    edges = np.sort([*bounds, *sizes[(sizes > bounds[0]) & (sizes < bounds[1])]])
    k = int(np.argmax(np.diff(np.log(edges))))
    return math.sqrt(edges[k] * edges[k + 1])


def _split(a):
    """Return (real and imaginary parts of fast eigenvalues, vectors, slow basis, its block).

    Vectors, shape (e, f), as of LAPACK: real and imaginary part of a pair.
    """
    n = len(a)
    growth, speed, vectors = _eigen(a)
    sizes, real = np.hypot(growth, speed), speed == 0.0
    if sizes.min(initial=math.inf) >= _SLOW[1] and not (real & (sizes < _SLOW_REAL[1])).any():
        return growth, speed, vectors, np.zeros((n, 0)), np.zeros((0, 0))
    if real.all() and sizes.max() < _SLOW_REAL[0]:
        # As most flights of one coordinate: no gap need be sought.
        chosen = real
    else:
        slow, damped = _gap(sizes, _SLOW), _gap(sizes[real], _SLOW_REAL)
        chosen = (sizes < slow) | (real & (sizes < damped))
    # A single mode that creeps, as of a mesh with much damping, is a mode like the others.
    creeps = chosen.sum() == 1 and real[chosen].all() and sizes[chosen].min() > _LEAST_CREEP
    if creeps or not chosen.any():
        return growth, speed, vectors, np.zeros((n, 0)), np.zeros((0, 0))
    if chosen.all():
        return np.zeros(0), np.zeros(0), np.zeros((n, 0)), np.eye(n), a
    # As `scipy.linalg.schur` and `solve_sylvester` do, without their checks and second forms.
    t, s, *_, q, _, code = lapack.dgees(
        lambda x, y: math.hypot(x, y) < (slow if y else damped), a, sort_t=1
    )
    if code:
        raise np.linalg.LinAlgError(f"the real Schur form was not found (info = {code})")
    own, scale, _ = lapack.dtrsyl(t[:s, :s], t[s:, s:], -t[:s, s:], isgn=-1)
    growth, speed, vectors = _eigen(t[s:, s:])
    return growth, speed, (q[:, s:] + q[:, :s] @ (scale * own)) @ vectors, q[:, :s], t[:s, :s]


def _eigen(a):
    """Return the eigenvalues' real and imaginary parts and the vectors, as of LAPACK."""
    if not a.size:
        return np.zeros(0), np.zeros(0), np.zeros((0, 0))
    growth, speed, _, vectors, code = lapack.dgeev(a, compute_vl=0)
    if code:
        raise np.linalg.LinAlgError(f"eigenvalues were not found (info = {code})")
    return growth, speed, vectors


def _slow_waves(basis, inputs, frequencies):
    """Return the responses of the slow components to the harmonics, shape (s, 2 h)."""
    s = len(basis.block)
    forces = (basis.into[len(basis.into) - s :] @ inputs).T.reshape(-1, 2, s)
    unlike = 1j * frequencies[:, None, None] * np.eye(s) - basis.block
    found = np.linalg.solve(unlike, (forces[:, 0] - 1j * forces[:, 1])[..., None])[..., 0]
    return np.stack([found.real, -found.imag], axis=1).reshape(-1, s).T.copy()


def add(tables, system, grid, frame, effects):
    """Add a combination of effects, int, shape (m,), to the tables; those that are full forget."""
    n, h = len(system.free), system.harmonics.size
    if tables.known[0] == len(tables.keys):
        forget(tables)
    c, a, moving = tables.known[0], np.empty((n, n)), n - 1 - 2 * h
    matrix_of(system, effects, a)
    # A load that grows is no mode: matrix exponentials.
    basis = frame.basis_of(system, effects) if moving == len(frame.out) else None
    lines = np.stack([system.far, system.near])
    degree = tables.curves.shape[4] - 1
    reaches = REACHES[degree], BLOCKS[degree]
    curves = _exponentials(degree), _powers(degree)
    if basis is not None:
        slow = np.zeros((len(basis.block), 2 * h))
        if slow.size:
            try:
                slow = _slow_waves(basis, a[:moving, moving + 1 :], grid.spin)
            except np.linalg.LinAlgError:
                slow[:] = np.nan
        if not fill_modes(tables, c, lines, a, basis, slow, grid.spin, reaches, *curves):
            basis = None
    if basis is None:
        tables.into[c] = tables.out[c] = np.eye(n, tables.out.shape[2])
        piece = BLOCKS[degree] * system.longest / exponential.REACH
        fill_distances(tables, c, lines, np.zeros(0, complex), 0, a, piece, 0, *curves)
    tables.slots[slot_of(tables.slots, tables.keys, effects)] = c
    tables.keys[c] = effects
    tables.known[0] = c + 1
    return c
