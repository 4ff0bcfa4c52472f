"""Piecewise-linear systems with many coordinates: mesh periods that are not recorded.

The solution is that of the recorded periods, `gearlib.kernels.piecewise_linear.run`, with
precomputed tables instead of series:

* A substep without an event (see `gearlib.kernels.piecewise_linear.system`) is one product with
  exp(A h).
* The distance from a flank line is a linear functional g z, and on a substep a polynomial whose
  coefficients are precomputed rows times the state. On most substeps its first terms prove that no
  flank line is reached; otherwise the first crossing is proved by the shape of the polynomial, or
  isolated in Bernstein form.
* A part of a substep is one product with a precomputed exponential and a short Taylor series.

All tables are stored in blocks of four rows, a block column by column: its product with a state is
a sum of columns of four, which the compiler keeps in one vector register.
"""

from typing import NamedTuple

import numpy as np

from gearlib.kernels.arrays import copy
from gearlib.kernels.codes import BOTH, INVERSE, NORMAL
from gearlib.kernels.jit import inlined, kernel
from gearlib.kernels.piecewise_linear.system import ORDER, dot, exponential, next_contact, product
from gearlib.kernels.polynomial import fall_by_shape, first_fall, lowest_of_parabola

#: Terms from this degree on are bounded together: (1.3)^8 / 8! = 2e-4 of the state.
_TAIL = 8
#: Rows of a functional on a substep, in whole blocks.
_ROWS = 24
#: A substep has so many equal parts with an exponential each; the remainder is a short series.
_PARTS = 32
#: Pairs of terms of that series: (1.3 / 64)^9 / 9! = 2e-21, with room for unlike scales.
_PAIRS = 4


class PeriodTables(NamedTuple):
    """Tables of a `System` of n components in b blocks; filled on first use."""

    ready: np.ndarray  #: bool, shape (3, p)
    step: np.ndarray  #: exp(A h), shape (3, p, b, n, 4)
    near: np.ndarray  #: rows of y on a substep, shape (3, p, 6, n, 4)
    far: np.ndarray  #: rows of y - s
    near_tail: np.ndarray  #: sums of the magnitudes of rows 8 to ORDER, shape (3, p, n)
    far_tail: np.ndarray
    rate: np.ndarray  #: A, shape (3, p, b, n, 4)
    fine: np.ndarray  #: exp(A h j / 32), j = 1 ... 32, shape (3, 32 p, b, n, 4), segment by segment
    state: np.ndarray  #: work, shape (b, 4)
    term: np.ndarray  #: work, shape (b, 4)
    image: np.ndarray  #: work, shape (b, 4)
    wide: np.ndarray  #: work, shape (6, 4)
    bernstein: np.ndarray  #: work of `polynomial.first_fall`


@kernel
def period_tables(system):
    """Return empty `PeriodTables`."""
    contacts, p, n, _ = system.a.shape
    blocks = (n + 3) // 4
    return PeriodTables(
        np.zeros((contacts, p), dtype=np.bool_),
        np.zeros((contacts, p, blocks, n, 4)),
        np.zeros((contacts, p, _ROWS // 4, n, 4)),
        np.zeros((contacts, p, _ROWS // 4, n, 4)),
        np.zeros((contacts, p, n)),
        np.zeros((contacts, p, n)),
        np.zeros((contacts, p, blocks, n, 4)),
        np.zeros((contacts, p * _PARTS, blocks, n, 4)),
        np.zeros((blocks, 4)),
        np.zeros((blocks, 4)),
        np.zeros((blocks, 4)),
        np.zeros((_ROWS // 4, 4)),
        np.empty((50, ORDER + 2)),
    )


@kernel
def _into_blocks(matrix, blocks):
    """Fill blocks, shape (b, n, 4), from a matrix of n columns."""
    for r in range(matrix.shape[0]):
        for c in range(matrix.shape[1]):
            blocks[r // 4, c, r % 4] = matrix[r, c]


@kernel
def _fill_rows(functional, a, h, blocks, tail):
    """Fill the blocks of the rows g (A h)^k / k!, and the sums of their magnitudes."""
    n = functional.shape[0]
    rows = np.zeros((ORDER + 1, n))
    copy(functional, rows[0])
    for k in range(1, ORDER + 1):
        for r in range(n):
            if rows[k - 1, r] != 0.0:
                for c in range(n):
                    rows[k, c] += rows[k - 1, r] * (h / k) * a[r, c]
        if k >= _TAIL:
            tail += np.abs(rows[k])
    _into_blocks(rows, blocks)


@kernel
def _prepare(system, table, i, p):
    """Fill the tables of contact code i - 1 on segment p."""
    n = system.near.shape[0]
    h = (system.starts[p + 1] - system.starts[p]) / system.substeps[p]
    a = system.a[i, p]
    _into_blocks(a, table.rate[i, p])
    _into_blocks(exponential(a, n, h), table.step[i, p])
    _fill_rows(system.near, a, h, table.near[i, p], table.near_tail[i, p])
    _fill_rows(system.far, a, h, table.far[i, p], table.far_tail[i, p])
    part = exponential(a, n, h / _PARTS)
    power = part
    for j in range(_PARTS):
        _into_blocks(power, table.fine[i, p * _PARTS + j])
        power = product(part, power)
    table.ready[i, p] = True


@inlined
def _apply(matrix, i, p, first, last, z, out):
    """out = matrix z, blocks `first` to `last` of it; z of shape (n,) or longer."""
    for q in range(first, last):
        a, b, c, d = 0.0, 0.0, 0.0, 0.0
        for j in range(matrix.shape[3]):
            value = z[j]
            a += matrix[i, p, q, j, 0] * value
            b += matrix[i, p, q, j, 1] * value
            c += matrix[i, p, q, j, 2] * value
            d += matrix[i, p, q, j, 3] * value
        out[q, 0], out[q, 1], out[q, 2], out[q, 3] = a, b, c, d


@inlined
def _add_term(rate, i, p, factor, old, new, z):
    """new = factor A old, z += new: one term of the Taylor series; old of shape (n,) or longer."""
    for q in range(rate.shape[2]):
        a, b, c, d = 0.0, 0.0, 0.0, 0.0
        for j in range(rate.shape[3]):
            value = old[j]
            a += rate[i, p, q, j, 0] * value
            b += rate[i, p, q, j, 1] * value
            c += rate[i, p, q, j, 2] * value
            d += rate[i, p, q, j, 3] * value
        a, b, c, d = a * factor, b * factor, c * factor, d * factor
        new[q, 0], new[q, 1], new[q, 2], new[q, 3] = a, b, c, d
        z[q, 0], z[q, 1], z[q, 2], z[q, 3] = z[q, 0] + a, z[q, 1] + b, z[q, 2] + c, z[q, 3] + d


@kernel
def _advance(fine, rate, i, p, h, t, z, term, image):
    """Take z by t on a substep of length h; arrays are fields of `PeriodTables`."""
    flat_term, flat_image = term.reshape(term.size), image.reshape(image.size)
    part = int(_PARTS * t / h + 0.5)
    if part > 0:
        at = p * _PARTS + part - 1
        _apply(fine, i, at, 0, fine.shape[2], z.reshape(z.size), term)
        t -= part * (h / _PARTS)
        for q in range(z.shape[0]):
            z[q, 0], z[q, 1], z[q, 2], z[q, 3] = term[q, 0], term[q, 1], term[q, 2], term[q, 3]
    else:
        for q in range(z.shape[0]):
            term[q, 0], term[q, 1], term[q, 2], term[q, 3] = z[q, 0], z[q, 1], z[q, 2], z[q, 3]
    for k in range(1, 2 * _PAIRS, 2):
        _add_term(rate, i, p, t / k, flat_term, image, z)
        _add_term(rate, i, p, t / (k + 1), flat_image, term, z)


@inlined
def _stays_above(rows, tail, i, p, side, z, wide):
    """Return whether side times a functional provably stays above zero on a whole substep.

    Its parabola does, by more than all the higher terms can make: those below _TAIL one by one, the
    rest by the magnitudes of their rows. Leaves the lower terms in `wide`.
    """
    _apply(rows, i, p, 0, _TAIL // 4, z, wide)
    reach = 0.0
    for j in range(rows.shape[3]):
        reach += tail[i, p, j] * abs(z[j])
    reach += abs(wide[0, 3])
    reach += (abs(wide[1, 0]) + abs(wide[1, 1])) + (abs(wide[1, 2]) + abs(wide[1, 3]))
    return lowest_of_parabola(side * wide[0, 0], side * wide[0, 1], side * wide[0, 2]) > reach


@kernel
def _fall(rows, tail, i, p, side, share, on_line, at_rest, z, wide, to_bernstein, work):
    """Return where side times a functional first falls through zero, as a part of `share` substeps.

    2 and -1 as of `first_fall`. `on_line`, `at_rest`: whether it starts at zero, and at rest;
    rows, tail: fields of `PeriodTables`.
    """
    if _stays_above(rows, tail, i, p, side, z, wide) and not on_line:
        return 2.0
    _apply(rows, i, p, _TAIL // 4, _ROWS // 4, z, wide)
    curve = wide.reshape(wide.size)[: ORDER + 1]
    factor = side
    for k in range(ORDER + 1):
        curve[k] *= factor
        factor *= share
    if on_line:
        curve[0] = 0.0
        if at_rest:
            curve[1] = 0.0
    if not at_rest:
        found = fall_by_shape(curve, 1 if on_line else 0)
        if found >= 0.0:
            return found
    return first_fall(curve, to_bernstein, work)


@kernel
def pass_period(system, table, to_bernstein, z, contact, on_line, at_rest, limit):
    """Go through one mesh period from its start; z is changed in place.

    Parameters
    ----------
    system, table, to_bernstein : System, PeriodTables, ndarray
    z : ndarray, shape (n,)
    contact : int
    on_line, at_rest : int, bool
        As of `gearlib.kernels.piecewise_linear.run.go`.
    limit : int
        Most events.

    Returns
    -------
    contact : int
    events : int
        Number of events, or more than `limit` as of `gearlib.kernels.piecewise_linear.run.go`.
    """
    # Arrays instead of `PeriodTables`: every look into a tuple counts references, which would cost
    # more than the sums.
    ready, step, near, far, near_tail, far_tail, rate, fine = table[:8]
    state, term, image, wide, work = table[8:]
    flat, n = state.reshape(state.size), z.shape[0]
    copy(z, flat[:n])
    events, closing = 0, system.closing
    for p in range(system.substeps.shape[0]):
        h = (system.starts[p + 1] - system.starts[p]) / system.substeps[p]
        for _ in range(system.substeps[p]):
            t = 0.0
            while t < h:
                i, left = contact + 1, h - t
                if not ready[i, p]:
                    _prepare(system, table, i, p)
                best, target = 2.0, contact
                for line in (NORMAL, INVERSE):
                    if contact == -line and not closing:
                        continue
                    rows, tail = (near, near_tail) if line == NORMAL else (far, far_tail)
                    on, side = on_line == line, float(line if contact == line else -line)
                    rest = on and at_rest
                    share = _fall(
                        rows, tail, i, p, side, left / h, on, rest, flat, wide, to_bernstein, work
                    )
                    if share < best:
                        best, target = share, next_contact(contact, line)
                at_rest, on_line = False, 0
                if best > 1.0:
                    if t == 0.0:
                        _apply(step, i, p, 0, step.shape[2], flat, term)
                        for q in range(state.shape[0]):
                            for r in range(4):
                                state[q, r] = term[q, r]
                    else:
                        _advance(fine, rate, i, p, h, left, state, term, image)
                    break
                if best < 0.0:
                    return contact, limit + 3
                if target == BOTH:
                    return contact, limit + 2
                length = best * left
                _advance(fine, rate, i, p, h, length, state, term, image)
                events += 1
                if events > limit:
                    return contact, events
                t += length
                on_line = 1 if NORMAL in (contact, target) else -1
                functional = system.near if on_line == 1 else system.far
                flat[system.fix] -= dot(functional, flat[:n]) / functional[system.fix]
                contact = target
    copy(flat, z)
    return contact, events
