"""Coordinates of tangents along an arc: each block of nearly equal eigenvalues by itself."""

import math

import numpy as np

from gearlib.kernels.jit import kernel

#: Norm of a block times the length of a step of its series, the last term that counts, and how many
#: there are at most.
_REACH, _NOTHING, _TERMS = 1.0, 1e-19, 40
#: Share of a term behind which a bound of a series is safe by so much, and the terms at most.
_SMALL, _LARGER, _MOST = 1e-3, 1.01, 60
_INVERSE = 1.0 / np.arange(1.0, 16.0)


@kernel
def add_product(z, a, out):
    """out <- out + z a, shapes (l, i), (i, j), (l, j)."""
    for r in range(z.shape[0]):
        row = out[r]
        for i in range(z.shape[1]):
            factor, other = z[r, i], a[i]
            if factor != 0.0:
                for j in range(row.shape[0]):
                    row[j] += factor * other[j]


@kernel
def _block(t, d, norm, start, size, length, q, k, rows, y, out, terms):
    """Carry the coordinates of one block: the mean eigenvalue by itself, a series for the rest."""
    half, mean, sources = y.shape[1] // 2, 0.0j, (rows - q) // k if rows > q else 0
    for i in range(start, start + size):
        mean += t[i, i] / size
    count = max(int(math.ceil(norm * length / _REACH)), 1)
    h = length / count
    factor = np.exp(mean * h)
    term, new = terms[0], terms[1]
    for row in range(rows):
        for i in range(start, start + size):
            out[row, i], out[row, half + i] = y[row, i], y[row, half + i]
    for _ in range(count):
        for row in range(rows):
            for i in range(size):
                term[row, i] = complex(out[row, start + i], out[row, half + start + i])
        j, moving = 0, True
        # Free motions have few terms; a slope has one more.
        while j < size + 2 or (moving and j < _TERMS):
            j += 1
            step = h / j
            for i in range(size):
                rest = t[start + i, start + i] - mean
                for row in range(rows):
                    new[row, i] = rest * term[row, i]
                for other in range(i + 1, size):
                    rest = t[start + i, start + other]
                    for row in range(rows):
                        new[row, i] += rest * term[row, other]
                for source in range(sources):
                    first = q + source * k
                    for other in range(size):
                        value = term[source, other]
                        for one in range(k):
                            new[first + one, i] += d[one, start + i, start + other] * value
            moving = False
            for row in range(rows):
                for i in range(size):
                    value = step * new[row, i]
                    term[row, i] = value
                    a, b = out[row, start + i] + value.real, out[row, half + start + i] + value.imag
                    least = _NOTHING * (abs(a) + abs(b))
                    moving = moving or abs(value.real) + abs(value.imag) > least
                    out[row, start + i], out[row, half + start + i] = a, b
        for row in range(rows):
            for i in range(start, start + size):
                value = factor * complex(out[row, i], out[row, half + i])
                out[row, i], out[row, half + i] = value.real, value.imag


@kernel
def _mean_power(x):
    """Return (e^x - 1) / x."""
    if abs(x) > 0.5:
        return (np.exp(x) - 1.0) / x
    total = 1.0 + 0.0j
    for j in range(13, 0, -1):
        total = 1.0 + total * (x * _INVERSE[j])
    return total


@kernel
def turn(bases, c, length, q, k, rows, y, out, terms):
    """Fill `out` with the coordinates y, first rows, a length later; see `Bases`.

    `rows` are the state and free tangents, q of them, then k slopes of each.
    """
    # Looked up once: each look into a tuple of arrays counts references.
    blocks, t, d = bases.blocks[c], bases.matrix[c], bases.slopes[c]
    half, single, factors = y.shape[1] // 2, blocks[0], terms[0, 0]
    for i in range(single):
        size, angle = np.exp(t[i, i].real * length), t[i, i].imag * length
        factors[i] = complex(size * np.cos(angle), size * np.sin(angle))
    for row in range(min(rows, q)):
        own, target = y[row], out[row]
        for i in range(single):
            a, b, x, v = factors[i].real, factors[i].imag, own[i], own[half + i]
            target[i] = a * x - b * v
            target[half + i] = a * v + b * x
    if rows > q:
        diagonal, pairs = bases.diagonal[c], bases.pairs[c]
        for first in range(q, rows, k):
            source = (first - q) // k
            from_ = y[source]
            for one in range(k):
                own, target, slope = y[first + one], out[first + one], diagonal[one]
                for i in range(single):
                    a, b, u, w = slope[i], slope[half + i], from_[i], from_[half + i]
                    x = own[i] + length * (a * u - b * w)
                    v = own[half + i] + length * (a * w + b * u)
                    a, b = factors[i].real, factors[i].imag
                    target[i] = a * x - b * v
                    target[half + i] = a * v + b * x
            i = 0
            while pairs[i, 0] >= 0:
                r, j = pairs[i, 0], pairs[i, 1]
                factor = factors[j] * length * _mean_power((t[r, r] - t[j, j]) * length)
                factor *= complex(from_[j], from_[half + j])
                for one in range(k):
                    value = factor * d[one, r, j]
                    out[first + one, r] += value.real
                    out[first + one, half + r] += value.imag
                i += 1
    b = 0
    while blocks[b + 1] > blocks[b]:
        start = blocks[b]
        _block(
            t, d, bases.norms[c, b], start, blocks[b + 1] - start, length, q, k, rows, y, out, terms
        )
        b += 1


@kernel
def block_reach(bases, c, length, state, terms):
    """Return the largest sizes of coordinates over a length, shape (M,), those of single modes now.

    They bound a block by its series in absolute values.
    """
    blocks, t, half, b = bases.blocks[c], bases.matrix[c], state.shape[0] // 2, 0
    most, term, new = np.empty(half), np.empty(half), np.empty(half)
    for i in range(half):
        most[i] = term[i] = np.hypot(state[i], state[half + i])
    while blocks[b + 1] > blocks[b]:
        first, last, mean, j, size = blocks[b], blocks[b + 1], 0.0j, 0, math.inf
        for i in range(first, last):
            mean += t[i, i] / (last - first)
        while j < last - first or (size > _SMALL and j < _MOST):
            j += 1
            size = 0.0
            for i in range(first, last):
                new[i] = abs(t[i, i] - mean) * term[i]
                for other in range(i + 1, last):
                    new[i] += abs(t[i, other]) * term[other]
                new[i] *= length / j
            for i in range(first, last):
                term[i] = new[i]
                most[i] += term[i]
                size = max(size, term[i] / most[i] if most[i] > 0.0 else 0.0)
        for i in range(first, last):
            most[i] *= np.exp(max(mean.real * length, 0.0)) * (_LARGER if size <= _SMALL else 1e99)
        b += 1
    return most
