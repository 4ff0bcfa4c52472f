"""Small matrices in kernels: copies of rows, matrix exponentials, growth of perturbations.

Compiling ``target[:] = source`` takes numba five seconds in every process that compiles anything,
because of its error messages, so arrays are copied entry by entry. Matrix exponentials by their
power series are faster than library calls.
"""

import math

import numpy as np

from gearlib.engines.jit import kernel, kernel_part


@kernel_part(refcounts=False)
def copy(source: np.ndarray, target: np.ndarray) -> None:
    """Fill the array `target`, shape (n,), with the first n entries of the array `source`."""
    for i in range(target.shape[0]):
        target[i] = source[i]


@kernel_part
def enlarge_table(table: np.ndarray, row_count: int) -> np.ndarray:
    """Return a copy of `table` with `row_count` rows, at least as many as before.

    The additional rows are not initialised.
    """
    larger_table = np.empty((row_count, table.shape[1]))
    for i in range(table.shape[0]):
        copy(table[i], larger_table[i])
    return larger_table


#: Degree of the power series.
_ORDER = 20
#: Largest norm of matrix * time, for a remainder below 1.3^21 / 21! e^1.3 = 2e-17.
MAX_NORM = 1.3


@kernel
def exponential(matrix: np.ndarray, time: float) -> np.ndarray:
    """Return the matrix exponential exp(matrix * time) of a matrix, shape (n, n).

    The norm of matrix * time must be at most MAX_NORM; the terms of the power series beyond the
    degree _ORDER are then below rounding.
    """
    n = matrix.shape[0]
    total, term = np.eye(n), np.eye(n)
    for k in range(1, _ORDER + 1):
        next_term = np.zeros((n, n))
        for i in range(n):
            for m in range(n):
                if matrix[i, m] != 0.0:
                    factor = matrix[i, m] * time / k
                    for j in range(n):
                        next_term[i, j] += factor * term[m, j]
        term = next_term
        total += term
    return total


@kernel
def propagate_perturbation(maps, weights, perturbation, log_growths):
    """Multiply a perturbation in place by k period maps, normalising it after each map.

    Period maps, shape (k, n, n), are the derivatives of the state after a mesh period with respect
    to the state before it. The norm is the Euclidean norm of weights * perturbation, both of shape
    (n,). Its logarithm after each map is written to `log_growths`, shape (k,), from which Lyapunov
    exponents follow. Returns False if the perturbation vanishes, otherwise True.
    """
    n = perturbation.shape[0]
    image = np.empty(n)
    for k in range(maps.shape[0]):
        squared_norm = 0.0
        for i in range(n):
            image[i] = 0.0
            for j in range(n):
                image[i] += maps[k, i, j] * perturbation[j]
            squared_norm += (weights[i] * image[i]) ** 2
        norm = math.sqrt(squared_norm)
        # The negated comparison is also true for NaN.
        if not norm > 0.0:
            return False
        for i in range(n):
            perturbation[i] = image[i] / norm
        log_growths[k] = math.log(norm)
    return True
