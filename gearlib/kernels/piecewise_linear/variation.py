"""Variational equations of piecewise-linear systems with many coordinates.

As `gearlib.kernels.closed_form.variation`; only the moving components vary, constants and harmonics
do not.
"""

import numpy as np

from gearlib.kernels.arrays import copy_rows
from gearlib.kernels.codes import JAMMED, NORMAL, OK, OVERFLOW
from gearlib.kernels.jit import kernel
from gearlib.kernels.piecewise_linear.run import contact_at, go, jammed_at, set_harmonics, stopped
from gearlib.kernels.piecewise_linear.system import (
    ORDER,
    dot,
    exponential,
    image,
    product,
    scratch,
    tables,
)


@kernel
def _saltation(before, after, functional, z, n):
    """Return the saltation matrix of a crossing at z, leading (n, n) block."""
    matrix = np.eye(n)
    jump = image(after - before, z)
    speed = dot(functional, image(before, z))
    # A tangential crossing between equal fields varies nothing; else the jump is as small as the
    # speed, since the mesh force is zero on the line.
    if speed != 0.0:
        for r in range(n):
            for c in range(n):
                matrix[r, c] += jump[r] * functional[c] / speed
    return matrix


@kernel
def vary_linear(system, to_bernstein, z, moving, periods, limit, matrices):
    """Go through mesh periods from z at the start of one and fill the map of each.

    Parameters
    ----------
    system : System
    to_bernstein : ndarray
    z : ndarray, shape (n,)
        Changed in place to the end of the run.
    moving : int
        Components that move; the constant and the harmonics come after them.
    periods : int
    limit : int
        Most events in one mesh period.
    matrices : ndarray, shape (periods, moving, moving)

    Returns
    -------
    status : int
    """
    n = z.shape[0]
    s, table = scratch(n), tables(system)
    record = np.empty((64, 4 + (ORDER + 1) * n))
    whole = np.zeros((3, system.substeps.shape[0], moving, moving))
    known = np.zeros((3, system.substeps.shape[0]), dtype=np.bool_)
    # The lines of contact need the constants, which come with the harmonics.
    set_harmonics(system, z, 2.0 * np.pi * system.first)
    contact, on_line, at_rest = contact_at(system, z)
    if jammed_at(system, z, contact, on_line):
        return JAMMED
    previous = contact
    for i in range(periods):
        set_harmonics(system, z, 2.0 * np.pi * (system.first + i))
        contact, count, record, rows = go(
            system, table, to_bernstein, z, contact, on_line, at_rest, s, record, 0, limit
        )
        on_line, at_rest = 0, False
        if count > limit:
            return stopped(count, limit)
        if not np.abs(z).max() < 1e150:
            return OVERFLOW
        matrix = np.eye(moving)
        for j in range(rows):
            length, code, p = record[j, 1], int(record[j, 2]), int(record[j, 3])
            if code != previous:
                line = system.near if NORMAL in (code, previous) else system.far
                start = record[j, 4 : 4 + n]
                before, after = system.a[previous + 1, p], system.a[code + 1, p]
                matrix = product(_saltation(before, after, line, start, moving), matrix)
                previous = code
            step = (system.starts[p + 1] - system.starts[p]) / system.substeps[p]
            if length == step:
                if not known[code + 1, p]:
                    power = exponential(system.a[code + 1, p], moving, length)
                    copy_rows(power, whole[code + 1, p])
                    known[code + 1, p] = True
                matrix = product(whole[code + 1, p], matrix)
            else:
                matrix = product(exponential(system.a[code + 1, p], moving, length), matrix)
        copy_rows(matrix, matrices[i])
    return OK
