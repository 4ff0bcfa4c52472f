"""Fourier integrals over the mesh phase as sums over nodes of quadrature."""

import math

import numpy as np

from gearlib.kernels.jit import kernel

#: Orders that are summed at once: a multiple of what a vector unit takes.
FEW = 16


@kernel
def add_waves(phase, share, values, rows, step, sums, squares):
    """Add what nodes contribute to Fourier integrals and to integrals of squares.

    Parameters
    ----------
    phase, share : ndarray, shape (k,)
        Phases of the nodes in their blocks, and their weights.
    values : ndarray, shape (k, m)
        What is integrated.
    rows : ndarray of int, shape (k,)
        Block of each node, negative: of none.
    step : float
        Waves per phase of the first order.
    sums : ndarray, shape (2, r, m, a, FEW)
        Of the orders i FEW + j: integrals of f cos(order step phase) and of -f sin, added to.
    squares : ndarray, shape (r, m)
        Integrals of f^2, added to.
    """
    real, imag = np.ones(FEW), np.zeros(FEW)
    for k in range(phase.shape[0]):
        row, angle = rows[k], step * phase[k]
        if row < 0:
            continue
        c, s = math.cos(angle), -math.sin(angle)
        for j in range(1, FEW):
            real[j] = real[j - 1] * c - imag[j - 1] * s
            imag[j] = real[j - 1] * s + imag[j - 1] * c
        c, s = math.cos(FEW * angle), -math.sin(FEW * angle)
        for n in range(values.shape[1]):
            u, v = share[k] * values[k, n], 0.0
            squares[row, n] += u * values[k, n]
            for i in range(sums.shape[3]):
                own, other = sums[0, row, n, i], sums[1, row, n, i]
                for j in range(FEW):
                    own[j] += u * real[j] - v * imag[j]
                    other[j] += u * imag[j] + v * real[j]
                u, v = u * c - v * s, u * s + v * c
