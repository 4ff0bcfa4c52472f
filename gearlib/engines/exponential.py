"""Exponentials of small matrices by their power series, faster than a library."""

import numpy as np

from gearlib.engines.jit import kernel

#: Degree of the series.
ORDER = 20
#: Largest |A| times length: (1.3)^21 / 21! e^1.3 = 2e-17.
MAX_NORM = 1.3


@kernel
def exponential(matrix, length):
    """Return exp(matrix length) for a matrix, shape (n, n), and |matrix| length < MAX_NORM."""
    n = matrix.shape[0]
    total, term = np.eye(n), np.eye(n)
    for k in range(1, ORDER + 1):
        next_term = np.zeros((n, n))
        for r in range(n):
            for c in range(n):
                if matrix[r, c] != 0.0:
                    factor = matrix[r, c] * length / k
                    for j in range(n):
                        next_term[r, j] += factor * term[c, j]
        term = next_term
        total += term
    return total
