"""Bases of the motions of a combination of contacts, and the tables that are filled from them."""

import math

import numpy as np

from gearlib.kernels.copies import copy, copy_rows
from gearlib.kernels.jit import kernel, uncounted
from gearlib.kernels.several_meshes.modal_arcs import fill_curves, fill_series

#: Largest condition number of a basis, rows scaled: rounding of 1e-16 becomes 1e-10.
CONDITION = 1e6
#: Growth of a mode that is rounding.
NOTHING = 1e-12


@uncounted
def _over(x, d):
    """Return x / d, not a number where d is 0: at a resonance without damping."""
    return x * d.conjugate() * (1.0 / (d.real * d.real + d.imag * d.imag))


@uncounted
def _forced(forces, rates, pairs, singles, spin, waves):
    """Fill `waves`, of the shape of `forces`: what the constant and the harmonics force."""
    for k in range(pairs + singles):
        i, real = (2 * k, False) if k < pairs else (pairs + k, True)
        rate = rates[k]
        for j in range(spin.shape[0] + 1):
            q = max(2 * j - 1, 0)
            c = complex(forces[i, q], 0.0 if real else forces[i + 1, q])
            if j == 0:
                both, apart = _over(-c, rate), 0j
            else:
                s = complex(forces[i, q + 1], 0.0 if real else forces[i + 1, q + 1])
                more = _over(0.5 * (c - 1j * s), 1j * spin[j - 1] - rate)
                less = _over(0.5 * (c + 1j * s), -1j * spin[j - 1] - rate)
                both, apart = more + less, 1j * (more - less)
                waves[i, q + 1] = apart.real
            waves[i, q] = both.real
            if not real:
                waves[i + 1, q] = both.imag
                if j > 0:
                    waves[i + 1, q + 1] = apart.imag


@kernel
def _product(a, b):
    out = np.zeros((a.shape[0], b.shape[1]))
    for r in range(a.shape[0]):
        for i in range(a.shape[1]):
            for k in range(b.shape[1]):
                out[r, k] += a[r, i] * b[i, k]
    return out


@kernel
def _solve(a, b):
    """Turn b into the solution of a x = b, and a into what elimination leaves; columns of b."""
    n = a.shape[0]
    for c in range(n):
        best = c
        for r in range(c + 1, n):
            if abs(a[r, c]) > abs(a[best, c]):
                best = r
        if best != c:
            for k in range(n):
                a[c, k], a[best, k] = a[best, k], a[c, k]
            for k in range(b.shape[1]):
                b[c, k], b[best, k] = b[best, k], b[c, k]
        for r in range(c + 1, n):
            share = a[r, c] / a[c, c]
            if share != 0.0:
                for k in range(c + 1, n):
                    a[r, k] -= share * a[c, k]
                for k in range(b.shape[1]):
                    b[r, k] -= share * b[c, k]
    for c in range(n - 1, -1, -1):
        for k in range(b.shape[1]):
            b[c, k] /= a[c, c]
        for r in range(c):
            for k in range(b.shape[1]):
                b[r, k] -= a[r, c] * b[c, k]


@kernel
def fill_basis(a, growth, speed, vectors, slow, block, out, into):
    """Turn the matrices of a frame into those of a basis: z = out y, y = into z.

    Parameters
    ----------
    a : ndarray, shape (2 N, 2 N)
        The matrix in the coordinates of the frame; behind the first e, free rotations.
    growth, speed : ndarray, shape (f,)
        Fast eigenvalues of the first e, as of LAPACK: the upper one of a pair comes first.
    vectors : ndarray, shape (e, f)
        Theirs: real and imaginary part of a pair.
    slow, block : ndarray, shapes (e, e - f), (e - f, e - f)
        A basis of the slow motions, and its matrix.
    out, into : ndarray, shape (2 N, 2 N)
        Changed in place.

    Returns
    -------
    pairs, singles : ndarray
        Eigenvalues with a positive imaginary part, and real ones.
    blocks : ndarray, shape (s, s)
        The matrix of the slow motions with the free rotations behind them.
    sound : bool
        Whether the basis is well conditioned.
    """
    size, (e, f) = a.shape[0], vectors.shape
    free, count = size - e, 0
    for i in range(f):
        count += speed[i] > 0.0
    pairs, singles = np.empty(count, np.complex128), np.empty(f - 2 * count)
    p, back, k, q = np.zeros((size, size)), np.eye(size), 0, 2 * count
    moved, unlike = np.empty((free, 1), np.complex128), np.empty((free, free), np.complex128)
    for i in range(f):
        if speed[i] < 0.0:
            continue
        pair = speed[i] > 0.0
        for r in range(e):
            p[r, k if pair else q] = vectors[r, i]
            if pair:
                p[r, k + 1] = -vectors[r, i + 1]
        rate = complex(growth[i], speed[i])
        # Free rotations follow.
        for r in range(free):
            moved[r, 0] = 0.0
            for j in range(e):
                moved[r, 0] += a[e + r, j] * complex(
                    vectors[j, i], vectors[j, i + 1] if pair else 0.0
                )
            for j in range(free):
                unlike[r, j] = (rate if r == j else 0.0) - a[e + r, e + j]
        _solve(unlike, moved)
        for r in range(free):
            p[e + r, k if pair else q] = moved[r, 0].real
            if pair:
                p[e + r, k + 1] = -moved[r, 0].imag
        if pair:
            pairs[k // 2] = rate
            k += 2
        else:
            singles[q - 2 * count] = growth[i]
            q += 1
    copy_rows(slow, p[:, f:])
    for r in range(e, size):
        p[r, r] = 1.0
    blocks = np.zeros((size - f, size - f))
    own = e - f
    copy_rows(block, blocks)
    copy_rows(_product(a[e:, :e], slow), blocks[own:])
    copy_rows(a[e:, e:], blocks[own:, own:])
    spare = np.empty((size, size))
    copy_rows(p, spare)
    _solve(spare, back)
    sound = True
    for r in range(size):
        total = 0.0
        for j in range(size):
            for i in range(size):
                total += abs(p[r, j] * back[j, i])
        sound &= total < CONDITION
    copy_rows(_product(out, p), out)
    copy_rows(_product(back, into), into)
    return pairs, singles, blocks, sound


@kernel
def _piece_of(block, degree, reach):
    """Return a length on which the series of a block, its norm up to `reach`, ends."""
    # The root of so high a power hides the scales of the components.
    square = _product(block, block)
    eighth = _product(_product(square, square), _product(square, square))
    power = eighth
    for _ in range((degree + 1) // 8 - 1):
        power = _product(power, eighth)
    total = 0.0
    for r in range(power.shape[0]):
        for i in range(power.shape[1]):
            total += power[r, i] * power[r, i]
    size = math.sqrt(total) ** (1.0 / (degree + 1))
    return reach / size if size > 0.0 else math.inf


@kernel
def fill_modes(tables, c, lines, a, basis, behind, spin, reaches, exponentials, powers):
    """Fill all tables of combination c; return whether its forced motions are well conditioned.

    Parameters
    ----------
    tables : Modes
    c : int
    lines : ndarray, shape (2, m, n)
        Functionals of the distances, far and near.
    a : ndarray, shape (n, n)
        The matrix.
    basis : gearlib.models.propagators.modal_frame.Basis
    behind : ndarray, shape (s, 2 h)
        Responses of its slow components to the harmonics.
    spin : ndarray, shape (h,)
        Frequencies of the harmonics by theta.
    reaches : tuple of float
        Of rates and of blocks, times a piece.
    exponentials, powers : ndarray
        As of `fill_curves`.
    """
    n, h, moving = a.shape[0], spin.shape[0], basis.out.shape[0]
    pairs, singles = basis.pairs.shape[0], basis.single.shape[0]
    first, f = 2 * pairs, 2 * pairs + singles
    forces = _product(basis.into, a[:moving, moving:])
    waves = np.zeros((moving, 1 + 2 * h))
    rates = np.empty(pairs + singles, np.complex128)
    copy(basis.pairs, rates[:pairs])
    copy(basis.single, rates[pairs:])
    _forced(forces, rates, pairs, singles, spin, waves)
    copy_rows(behind, waves[f:, 1:])
    shift = _product(basis.out, waves)
    # Of forced motions that nearly cancel: in static deflections.
    for r in range(moving):
        total = 0.0
        for j in range(1 + 2 * h):
            total += abs(shift[r, j])
            for i in range(moving):
                total += abs(basis.out[r, i] * waves[i, j])
        if not total < CONDITION:
            return False
    # By columns; the order is: pairs, harmonics, real modes, the block, the constant.
    into, out = tables.into[c], tables.out[c]
    into[:] = 0.0
    out[:] = 0.0
    for i in range(moving):
        place = i if i < first else i + 2 * h
        for r in range(moving):
            out[place, r], into[r, place] = basis.out[r, i], basis.into[i, r]
        for j in range(1 + 2 * h):
            into[moving + j, place] = -waves[i, j]
    for j in range(1 + 2 * h):
        place = first + j - 1 if j else n - 1
        out[place, moving + j] = into[moving + j, place] = 1.0
        for r in range(moving):
            out[place, r] = shift[r, j]
    size = moving - f
    block = np.zeros((size + 1, size + 1))
    copy_rows(basis.block, block)
    for i in range(size):
        block[i, size] = forces[f + i, 0]
    both = np.empty(pairs + h + singles, np.complex128)
    copy(basis.pairs, both[:pairs])
    for i in range(h):
        both[pairs + i] = complex(0.0, spin[i])
    copy(basis.single, both[pairs + h :])
    # Of slow motions too a piece is no longer than some period of the reference mode.
    piece = reaches[0]
    for k in range(both.size):
        piece = min(piece, reaches[0] / abs(both[k]))
    if size > 0:
        piece = min(piece, _piece_of(block, powers.shape[0] - 1, reaches[1]))
    fill_distances(
        tables, c, lines, both, pairs + h, block, piece, basis.hidden, exponentials, powers
    )
    return True


@kernel
def fill_distances(tables, c, lines, rates, pairs, block, piece, hidden, exponentials, powers):
    """Fill what is left of the tables of combination c, which have `into` and `out`."""
    n, m, size, singles = lines.shape[2], lines.shape[1], len(block), rates.size - pairs
    tables.pairs[c], tables.single[c], tables.piece[c] = pairs, singles, piece
    growing = False
    for k in range(rates.size):
        tables.rates[c, k, 0], tables.rates[c, k, 1] = rates[k].real, rates[k].imag
        growing |= not rates[k].real <= NOTHING
    copy_rows(block, tables.block[c])
    tables.filled[c] = fill_series(block, piece, tables.series[c])
    rows = np.zeros((2, m, n))
    for line in range(2):
        for j in range(m):
            row, swing = rows[line, j], tables.swing[c, line, j]
            for q in range(n):
                # Free rotations of the whole train move no mesh.
                if not n - 1 - hidden <= q < n - 1:
                    for r in range(n):
                        row[q] += lines[line, j, r] * tables.out[c, q, r]
            for k in range(pairs):
                swing[k] = math.hypot(row[2 * k], row[2 * k + 1])
            for k in range(singles):
                swing[pairs + k] = abs(row[2 * pairs + k])
            tables.level[c, line, j] = row[n - 1]
            tables.steady[c, line, j] = not growing and not row[n - size : n - 1].any()
    fill_curves(tables, c, rows, exponentials, powers)
