"""Piecewise-linear systems with many coordinates: the fast march through periods nobody looks at.

It takes the same way as the plain march of `gearlib.core.linear`, with tables instead of series:

* Across a knot (see `gearlib.core.system`) the state goes by the precomputed exp(A h).
* A flank line is a linear functional g z; along a knot it is a polynomial whose coefficients are
  precomputed rows times the state. Most knots are far from a line, and its first terms prove it;
  else the first crossing is proved by the shape of the polynomial, or isolated in Bernstein form.
* Within a knot the state goes by a precomputed exponential and a short Taylor series.

All tables are stored column by column, their columns filled up to whole blocks of four: a product
with a state is then a sum of columns, four rows at a time in one vector register.
"""

from typing import NamedTuple

import numpy as np

from gearlib.core.jit import inlined, kernel
from gearlib.core.mesh import BACKLASH, INVERSE, NORMAL
from gearlib.core.polynomial import fall_by_shape, first_fall, lowest_of_parabola
from gearlib.core.system import ORDER, dot, exponential

#: Terms from this degree on are bounded together: (1.3)^8 / 8! = 2e-4 of the state.
_TAIL = 8
#: Rows of a functional along a knot, in whole blocks.
_ROWS = 24
#: A way within a knot goes by an exponential of so many equal parts and a short series.
_PARTS = 16
#: Pairs of terms of that series: (1.3 / 16)^13 / 13! = 1e-24, with room for unlike scales.
_PAIRS = 6


class Ways(NamedTuple):
    """Tables of a `System` of n components, w after filling up; filled on first use."""

    ready: np.ndarray  #: bool, shape (3, p)
    step: np.ndarray  #: exp(A h), shape (3, p, n, w)
    near: np.ndarray  #: rows of y along a knot, shape (3, p, n, 24)
    far: np.ndarray  #: rows of y - s
    near_tail: np.ndarray  #: sums of the magnitudes of rows 8 to ORDER, shape (3, p, n)
    far_tail: np.ndarray
    rate: np.ndarray  #: A, shape (3, p, n, w)
    fine: np.ndarray  #: exp(A h j / 16), j = 1 ... 15, shape (3 p 15, n, w), code by code
    state: np.ndarray  #: work, shape (w,)
    term: np.ndarray  #: work, shape (w,)
    image: np.ndarray  #: work, shape (w,)
    curve: np.ndarray  #: work, shape (24,)
    wide: np.ndarray  #: work, shape (24,)
    bernstein: np.ndarray  #: work of `polynomial.first_fall`


@kernel
def ways(system):
    """Return empty `Ways`."""
    contacts, p, n, _ = system.a.shape
    w = 4 * ((n + 3) // 4)
    return Ways(
        np.zeros((contacts, p), dtype=np.bool_),
        np.zeros((contacts, p, n, w)),
        np.zeros((contacts, p, n, _ROWS)),
        np.zeros((contacts, p, n, _ROWS)),
        np.zeros((contacts, p, n)),
        np.zeros((contacts, p, n)),
        np.zeros((contacts, p, n, w)),
        np.zeros((contacts * p * (_PARTS - 1), n, w)),
        np.zeros(w),
        np.zeros(w),
        np.zeros(w),
        np.zeros(_ROWS),
        np.zeros(_ROWS),
        np.empty((50, ORDER + 2)),
    )


@kernel
def _fill_rows(functional, a, h, columns, tail):
    """Fill the columns of the rows g (A h)^k / k!, and the sums of their magnitudes."""
    n = functional.shape[0]
    row, new = functional.copy(), np.empty(n)
    columns[:, 0] = row
    for k in range(1, ORDER + 1):
        new[:] = 0.0
        for r in range(n):
            if row[r] != 0.0:
                for c in range(n):
                    new[c] += row[r] * (h / k) * a[r, c]
        row[:] = new
        columns[:, k] = row
        if k >= _TAIL:
            tail += np.abs(row)


@kernel
def _prepare(system, table, i, p):
    """Fill the tables of contact code i - 1 on stretch p."""
    n = system.near.shape[0]
    h = (system.starts[p + 1] - system.starts[p]) / system.knots[p]
    a = system.a[i, p]
    table.rate[i, p, :, :n] = a.T
    table.step[i, p, :, :n] = exponential(a, n, h).T
    _fill_rows(system.near, a, h, table.near[i, p], table.near_tail[i, p])
    _fill_rows(system.far, a, h, table.far[i, p], table.far_tail[i, p])
    part = exponential(a, n, h / _PARTS)
    power, new = part.copy(), np.empty((n, n))
    first = (i * system.knots.shape[0] + p) * (_PARTS - 1)
    for j in range(_PARTS - 1):
        table.fine[first + j, :, :n] = power.T
        for r in range(n):
            new[r] = 0.0
            for c in range(n):
                new[r] += part[r, c] * power[c]
        power[:] = new
    table.ready[i, p] = True


@inlined
def _apply(matrix, i, p, z, out):
    """out = matrix z, four rows at a time."""
    for r in range(0, matrix.shape[3], 4):
        a, b, c, d = 0.0, 0.0, 0.0, 0.0
        for j in range(matrix.shape[2]):
            value = z[j]
            a += matrix[i, p, j, r] * value
            b += matrix[i, p, j, r + 1] * value
            c += matrix[i, p, j, r + 2] * value
            d += matrix[i, p, j, r + 3] * value
        out[r], out[r + 1], out[r + 2], out[r + 3] = a, b, c, d


@inlined
def _add_term(rate, i, p, factor, old, new, z):
    """new = factor A old, z += new: one term of the Taylor series."""
    for r in range(0, rate.shape[3], 4):
        a, b, c, d = 0.0, 0.0, 0.0, 0.0
        for j in range(rate.shape[2]):
            value = old[j]
            a += rate[i, p, j, r] * value
            b += rate[i, p, j, r + 1] * value
            c += rate[i, p, j, r + 2] * value
            d += rate[i, p, j, r + 3] * value
        a, b, c, d = a * factor, b * factor, c * factor, d * factor
        new[r], new[r + 1], new[r + 2], new[r + 3] = a, b, c, d
        z[r] += a
        z[r + 1] += b
        z[r + 2] += c
        z[r + 3] += d


@kernel
def _advance(fine, rate, i, p, h, t, z, term, image):
    """Take z by t along a knot of length h; arrays are fields of `Ways`."""
    part = min(int(_PARTS * t / h), _PARTS - 1)
    if part > 0:
        at = (i * rate.shape[1] + p) * (_PARTS - 1) + part - 1
        for r in range(0, fine.shape[2], 4):
            a, b, c, d = 0.0, 0.0, 0.0, 0.0
            for j in range(fine.shape[1]):
                value = z[j]
                a += fine[at, j, r] * value
                b += fine[at, j, r + 1] * value
                c += fine[at, j, r + 2] * value
                d += fine[at, j, r + 3] * value
            term[r], term[r + 1], term[r + 2], term[r + 3] = a, b, c, d
        t -= part * (h / _PARTS)
        for r in range(z.shape[0]):
            z[r] = term[r]
    else:
        for r in range(z.shape[0]):
            term[r] = z[r]
    for k in range(1, 2 * _PAIRS, 2):
        _add_term(rate, i, p, t / k, term, image, z)
        _add_term(rate, i, p, t / (k + 1), image, term, z)


@inlined
def _stays_above(rows, tail, i, p, side, z):
    """Return whether side times a functional provably stays above zero along a whole knot.

    Its parabola does, by more than all the higher terms can make: those below _TAIL one by one, the
    rest by the magnitudes of their rows.
    """
    c0, c1, c2, c3, c4, c5, c6, c7 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    reach = 0.0
    for j in range(rows.shape[2]):
        value = z[j]
        c0 += rows[i, p, j, 0] * value
        c1 += rows[i, p, j, 1] * value
        c2 += rows[i, p, j, 2] * value
        c3 += rows[i, p, j, 3] * value
        c4 += rows[i, p, j, 4] * value
        c5 += rows[i, p, j, 5] * value
        c6 += rows[i, p, j, 6] * value
        c7 += rows[i, p, j, 7] * value
        reach += tail[i, p, j] * abs(value)
    reach += (abs(c3) + abs(c4)) + (abs(c5) + abs(c6)) + abs(c7)
    return lowest_of_parabola(side * c0, side * c1, side * c2) > reach


@kernel
def _fall(rows, i, p, side, share, on_line, at_rest, z, wide, curve, to_bernstein, work):
    """Return where side times a functional first falls through zero, as a part of `share` knots."""
    _apply(rows, i, p, z, wide)
    factor = side
    for k in range(ORDER + 1):
        curve[k] = wide[k] * factor
        factor *= share
    if on_line:
        curve[0] = 0.0
        if at_rest:
            curve[1] = 0.0
    if not at_rest:
        found = fall_by_shape(curve[: ORDER + 1], 1 if on_line else 0)
        if found >= 0.0:
            return found
    return first_fall(curve[: ORDER + 1], to_bernstein, work)


@kernel
def pass_period(system, table, to_bernstein, z, contact, on_line, at_rest, limit):
    """Go through one mesh period from its start; z is changed in place.

    Parameters
    ----------
    on_line, at_rest : int, bool
        As of `gearlib.core.linear.go`.
    limit : int
        Most events.

    Returns
    -------
    contact : int
    events : int
        Number of events, limit + 1 when there were more.
    """
    # Arrays instead of `Ways`: every look into a tuple counts references, which would cost more
    # than the sums.
    ready, step, near, far, near_tail, far_tail, rate, fine = table[:8]
    state, term, image, curve, wide, work = table[8:]
    n = z.shape[0]
    state[:n] = z
    events = 0
    for p in range(system.knots.shape[0]):
        h = (system.starts[p + 1] - system.starts[p]) / system.knots[p]
        for _ in range(system.knots[p]):
            t = 0.0
            while t < h:
                i = contact + 1
                left = h - t
                if not ready[i, p]:
                    _prepare(system, table, i, p)
                best, target = 2.0, contact
                if contact != INVERSE:
                    side = 1.0 if contact == NORMAL else -1.0
                    if on_line == 1 or not _stays_above(near, near_tail, i, p, side, state):
                        best = _fall(
                            near,
                            i,
                            p,
                            side,
                            left / h,
                            on_line == 1,
                            on_line == 1 and at_rest,
                            state,
                            wide,
                            curve,
                            to_bernstein,
                            work,
                        )
                    target = BACKLASH if contact == NORMAL else NORMAL
                if contact != NORMAL:
                    side = -1.0 if contact == INVERSE else 1.0
                    if on_line == -1 or not _stays_above(far, far_tail, i, p, side, state):
                        other = _fall(
                            far,
                            i,
                            p,
                            side,
                            left / h,
                            on_line == -1,
                            on_line == -1 and at_rest,
                            state,
                            wide,
                            curve,
                            to_bernstein,
                            work,
                        )
                        if other < best:
                            best, target = other, (BACKLASH if contact == INVERSE else INVERSE)
                at_rest, on_line = False, 0
                if best > 1.0:
                    if t == 0.0:
                        _apply(step, i, p, state, term)
                        for r in range(state.shape[0]):
                            state[r] = term[r]
                    else:
                        _advance(fine, rate, i, p, h, left, state, term, image)
                    break
                length = best * left
                _advance(fine, rate, i, p, h, length, state, term, image)
                events += 1
                if events > limit:
                    return contact, events
                t += length
                on_line = 1 if NORMAL in (contact, target) else -1
                functional = system.near if on_line == 1 else system.far
                state[system.fix] -= dot(functional, state[:n]) / functional[system.fix]
                contact = target
    z[:] = state[:n]
    return contact, events
