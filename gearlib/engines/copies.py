"""Copies between arrays, entry by entry.

numba compiles ``target[:] = source`` with error messages that cost five seconds in every process
that compiles anything.
"""

import numpy as np

from gearlib.engines.jit import kernel, kernel_without_refcounts


@kernel_without_refcounts
def copy(source: np.ndarray, target: np.ndarray) -> None:
    """Fill the array `target`, shape (n,), with the first n entries of the array `source`."""
    for i in range(target.shape[0]):
        target[i] = source[i]


@kernel
def enlarge_table(table: np.ndarray, row_count: int) -> np.ndarray:
    """Return a table with more rows, `row_count`, that begins with all rows of `table`."""
    larger_table = np.empty((row_count, table.shape[1]))
    for i in range(table.shape[0]):
        copy(table[i], larger_table[i])
    return larger_table
