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


@kernel_without_refcounts
def copy_rows(source: np.ndarray, target: np.ndarray) -> None:
    """Copy all rows of `source`, shape (k, n), to the first k rows of `target`, shape (m, n)."""
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]


@kernel
def enlarge_table(table: np.ndarray, row_count: int) -> np.ndarray:
    """Return a table with more rows, `row_count`, that begins with all rows of `table`."""
    larger_table = np.empty((row_count, table.shape[1]))
    copy_rows(table, larger_table)
    return larger_table
