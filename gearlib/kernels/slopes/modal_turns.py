"""Coordinates of tangents along an arc: each block of nearly equal eigenvalues by itself."""

import math

import numpy as np

from gearlib.kernels.jit import kernel

#: Norm of a block times the length of a step of its series, and the last term that counts.
_REACH, _NOTHING = 1.0, 1e-19


@kernel
def multiplied(a, z, columns, out):
    """out <- a z, the first columns."""
    for r in range(out.shape[0]):
        row = out[r]
        for c in range(columns):
            row[c] = 0.0
        for i in range(z.shape[0]):
            factor = a[r, i]
            if factor != 0.0:
                other = z[i]
                for c in range(columns):
                    row[c] += factor * other[c]


@kernel
def _block(t, d, start, size, length, q, k, columns, y, out, terms):
    """Carry the coordinates of one block of nearly equal eigenvalues: a series of its rest."""
    half = y.shape[0] // 2
    mean = 0.0j
    for i in range(start, start + size):
        mean += t[i, i] / size
    norm = 0.0
    for i in range(start, start + size):
        total = abs(t[i, i] - mean)
        for j in range(i + 1, start + size):
            total += abs(t[i, j])
        norm = max(norm, total)
    count = max(int(math.ceil(norm * length / _REACH)), 1)
    h = length / count
    factor = np.exp(mean * h)
    term, new = terms[0], terms[1]
    for i in range(size):
        for c in range(columns):
            out[start + i, c], out[half + start + i, c] = (
                y[start + i, c],
                y[half + start + i, c],
            )
    for _ in range(count):
        for i in range(size):
            for c in range(columns):
                term[i, c] = complex(out[start + i, c], out[half + start + i, c])
        share, j = 1.0, 0
        while share > _NOTHING or j < 3:
            j += 1
            share *= norm * h / max(j - 2, 1)
            for i in range(size):
                for c in range(columns):
                    total = (t[start + i, start + i] - mean) * term[i, c]
                    for other in range(i + 1, size):
                        total += t[start + i, start + other] * term[other, c]
                    new[i, c] = total
                if columns > q:
                    for other in range(size):
                        for source in range((columns - q) // k):
                            value, first = term[other, source], q + source * k
                            for one in range(k):
                                new[i, first + one] += d[start + i, start + other, one] * value
            for i in range(size):
                for c in range(columns):
                    value = new[i, c] * (h / j)
                    term[i, c] = value
                    out[start + i, c] += value.real
                    out[half + start + i, c] += value.imag
        for i in range(size):
            for c in range(columns):
                value = factor * complex(out[start + i, c], out[half + start + i, c])
                out[start + i, c], out[half + start + i, c] = value.real, value.imag


@kernel
def turn(bases, c, length, q, k, columns, y, out, terms):
    """Fill `out` with the coordinates y, first columns, a length later."""
    half, blocks, t, d = y.shape[0] // 2, bases.blocks[c], bases.matrix[c], bases.slopes[c]
    b = 0
    while True:
        start, end = blocks[b], blocks[b + 1]
        if end <= start:
            break
        if end == start + 1:
            factor = np.exp(t[start, start] * length)
            real, imaginary = factor.real, factor.imag
            for col in range(columns):
                x, v = y[start, col], y[half + start, col]
                if col >= q:
                    source, one = (col - q) // k, (col - q) % k
                    slope = d[start, start, one] * length
                    sx, sv = y[start, source], y[half + start, source]
                    x += slope.real * sx - slope.imag * sv
                    v += slope.real * sv + slope.imag * sx
                out[start, col] = real * x - imaginary * v
                out[half + start, col] = real * v + imaginary * x
        else:
            _block(t, d, start, end - start, length, q, k, columns, y, out, terms)
        b += 1
