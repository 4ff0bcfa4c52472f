"""Coordinates of tangents along an arc: each block of nearly equal eigenvalues by itself."""

import math

import numpy as np

from gearlib.kernels.jit import kernel

#: Norm of a block times the length of a step of its series, and the last term that counts.
_REACH, _NOTHING = 1.0, 1e-19


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
def _block(bases, c, start, size, length, q, k, rows, y, out, terms):
    """Carry the coordinates of one block: the mean eigenvalue by itself, a series for the rest."""
    t, d = bases.matrix[c], bases.slopes[c]
    half, mean, norm = y.shape[1] // 2, 0.0j, 0.0
    for i in range(start, start + size):
        mean += t[i, i] / size
    for i in range(start, start + size):
        total = abs(t[i, i] - mean)
        for j in range(i + 1, start + size):
            total += abs(t[i, j])
        norm = max(norm, total)
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
        share, j = 1.0, 0
        # A slope has one factor less of the norm in each term.
        while share > _NOTHING or j < 3:
            j += 1
            share *= norm * h / max(j - 2, 1)
            for row in range(rows):
                for i in range(size):
                    total = (t[start + i, start + i] - mean) * term[row, i]
                    for other in range(i + 1, size):
                        total += t[start + i, start + other] * term[row, other]
                    if row >= q:
                        source, one = (row - q) // k, (row - q) % k
                        for other in range(size):
                            total += d[one, start + i, start + other] * term[source, other]
                    new[row, i] = total * (h / j)
            for row in range(rows):
                for i in range(size):
                    value = new[row, i]
                    term[row, i] = value
                    out[row, start + i] += value.real
                    out[row, half + start + i] += value.imag
        for row in range(rows):
            for i in range(start, start + size):
                value = factor * complex(out[row, i], out[row, half + i])
                out[row, i], out[row, half + i] = value.real, value.imag


@kernel
def turn(bases, c, length, q, k, rows, y, out, terms):
    """Fill `out` with the coordinates y, first rows, a length later; see `Bases`.

    `rows` are the state and free tangents, q of them, then k slopes of each.
    """
    half, single = y.shape[1] // 2, bases.blocks[c, 0]
    factors = terms[0, 0]
    for i in range(single):
        factors[i] = np.exp(bases.matrix[c, i, i] * length)
    for row in range(rows):
        own, target = y[row], out[row]
        if row < q:
            for i in range(single):
                a, b, x, v = factors[i].real, factors[i].imag, own[i], own[half + i]
                target[i] = a * x - b * v
                target[half + i] = a * v + b * x
        else:
            source, slope = y[(row - q) // k], bases.single_slopes[c, (row - q) % k]
            for i in range(single):
                a, b, u, w = slope[i] * length, slope[half + i] * length, source[i], source[half + i]
                x, v = own[i] + a * u - b * w, own[half + i] + a * w + b * u
                a, b = factors[i].real, factors[i].imag
                target[i] = a * x - b * v
                target[half + i] = a * v + b * x
    b = 0
    while bases.blocks[c, b + 1] > bases.blocks[c, b]:
        start = bases.blocks[c, b]
        size = bases.blocks[c, b + 1] - start
        _block(bases, c, start, size, length, q, k, rows, y, out, terms)
        b += 1
