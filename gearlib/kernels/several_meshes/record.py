"""What is recorded of a gear train: extrema and fractions of every mesh, samples."""

import math

from gearlib.kernels import orbit
from gearlib.kernels.arrays import copy
from gearlib.kernels.codes import BACKLASH, INVERSE
from gearlib.kernels.jit import kernel
from gearlib.kernels.piecewise_linear.system import ORDER
from gearlib.kernels.several_meshes.substeps import advance, polynomial, to_far

#: Columns of a summary: those of `orbit` and the integral of the elastic force over the phase.
FORCE_SUM = orbit.SUMMARY_COLUMNS
SUMMARY_COLUMNS = orbit.SUMMARY_COLUMNS + 1


@kernel
def summarise(system, grid, tables, c, w, p, length, summary, to_bernstein):
    """Add a substep, or a part of one, to the summaries of all meshes."""
    m, n = system.near.shape
    scale, curve, phase = length / system.longest, w.curve, length * system.tuning
    constants = w.z[n - 1 - 2 * grid.spin.shape[0] : n]
    for j in range(m):
        polynomial(w.look, tables.behind, m * c + j, w.behind, w.z, j, scale, curve)
        row, code = summary[j], w.contact[j]
        copy(curve, w.scaled)
        orbit.add_curve(w.scaled, to_bernstein, w.bernstein, row, orbit.X_MAX, orbit.X_MIN)
        orbit.add_time(code, phase, system.low[code + 1, p, j], row)
        if code == BACKLASH:
            continue
        if code == INVERSE:
            to_far(grid.apart, j, scale, constants, curve)
        for k in range(ORDER + 1):
            curve[k] *= system.stiffness[code + 1, p, j]
            row[FORCE_SUM] += phase * curve[k] / (k + 1)
        orbit.add_curve(curve, to_bernstein, w.bernstein, row, orbit.FORCE_MAX, orbit.FORCE_MIN)


@kernel
def sample(system, grid, tables, c, w, p, phase, length, samples, taken):
    """Fill the samples within a piece that begins at `phase`; return how many are taken.

    Columns: the state, shape (n,), the contact codes, shape (m,), the number of the segment.
    """
    m, n = system.near.shape
    end = phase + length * system.tuning - 1e-12
    while taken < samples.shape[0]:
        at = 2.0 * math.pi * taken / samples.shape[0]
        if at >= end:
            break
        copy(w.z, w.other)
        t = max(at - phase, 0.0) / system.tuning
        advance(tables.rate, c, grid.spin, system.longest, t, w.other, w.term, w.image)
        copy(w.other, samples[taken, :n])
        for j in range(m):
            samples[taken, n + j] = w.contact[j]
        samples[taken, n + m] = p
        taken += 1
    return taken
