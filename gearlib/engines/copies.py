"""Copies between arrays, number by number.

What numba makes of ``target[:] = source`` brings along the texts of its errors, which take five
seconds to compile in every process that compiles anything.
"""

import numpy as np

from gearlib.engines.jit import kernel, uncounted


@uncounted
def copy(source, target):
    """Fill `target`, shape (n,), with the first n numbers of `source`."""
    for i in range(target.shape[0]):
        target[i] = source[i]


@uncounted
def copy_rows(source, target):
    """Fill the first rows of `target`, shape (m, n), with those of `source`, shape (k, n)."""
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]


@kernel
def enlarged(table, rows):
    """Return a table with room for so many rows that begins with those of `table`."""
    larger = np.empty((rows, table.shape[1]))
    copy_rows(table, larger)
    return larger
