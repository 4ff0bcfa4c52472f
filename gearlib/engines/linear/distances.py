"""How the distances of meshes from their flank lines go along a piece: proofs and first events.

The amplitudes of the modes bound a distance as long as nothing happens: mostly this proves that no
line is reached. Otherwise the distance is a polynomial in Bernstein form, whose first fall through
zero is isolated: nothing is sampled.
"""

import math

from gearlib.engines.codes import INVERSE, NORMAL
from gearlib.engines.jit import uncounted, woven
from gearlib.engines.linear.modal_arcs import DEGREE, LEAST
from gearlib.engines.linear.sparse_series import SERIES, may_reach
from gearlib.engines.linear.train_system import next_contact
from gearlib.engines.polynomial import BINOMIALS, first_fall_from

#: Rounding of a distance, as a share of its parts.
_ROUNDING = 1e-15


@woven
def sizes_of(tables, c, y, sizes):
    """Fill `sizes` with the amplitudes of pairs and real modes; return how many there are."""
    pairs = tables.pairs[c]
    for k in range(pairs):
        u, v = y[2 * k], y[2 * k + 1]
        sizes[k] = math.sqrt(u * u + v * v)
    for k in range(tables.single[c]):
        sizes[pairs + k] = abs(y[2 * pairs + k])
    return pairs + tables.single[c]


@woven
def _counts(grid, j, code, line):
    """Return whether mesh j may come to a line: in contact, to the other one only if `closing`."""
    return not ((code == -line and not grid.closing[j]) or (line == -1 and grid.open[j]))


@woven
def _side(code, line):
    """Return the sign of the distance from a line: above that of the contact it lies on."""
    return -1.0 if ((code != NORMAL) if line == 1 else (code == INVERSE)) else 1.0


@woven
def _sum_of(a, b, count):
    """Return the sum of the first products, in four sums that do not wait for one another."""
    p, q, s, t = 0.0, 0.0, 0.0, 0.0
    k = 0
    while k + 3 < count:
        p += a[k] * b[k]
        q += a[k + 1] * b[k + 1]
        s += a[k + 2] * b[k + 2]
        t += a[k + 3] * b[k + 3]
        k += 4
    while k < count:
        p += a[k] * b[k]
        k += 1
    return (p + q) + (s + t)


@woven
def furthest(tables, c, line, j, w, count):
    """Return how far a steady distance provably goes from its level while the contacts stay."""
    reach = _sum_of(tables.swing[c, line, j], w.sizes, count)
    return reach + _ROUNDING * (reach + abs(tables.level[c, line, j]))


@woven
def keeps_off(tables, c, j, grid, w, count):
    """Return whether mesh j provably stays off its flank lines as long as the contacts stay.

    By a series: as long as it lasts.
    """
    reach, code = 0.0, w.contact[j]
    for line in (1, -1):
        if not _counts(grid, j, code, line):
            continue
        side = (line + 1) // 2
        if c == SERIES:
            if may_reach(w.distances[side, j], _side(code, line), w.powers.shape[0] - 1):
                return False
            continue
        if not tables.steady[c, side, j]:
            return False
        # Lines that are a constant apart swing alike.
        if line == 1 or code == INVERSE or not grid.plain[j]:
            reach = _sum_of(tables.swing[c, side, j], w.sizes, count)
        level = tables.level[c, side, j]
        if not _side(code, line) * level > reach + _ROUNDING * abs(level):
            return False
    return True


@woven
def _curve(curves, y, b, points):
    i, n = 0, curves.shape[0]
    for r in range(points):
        b[r] = 0.0
    while i + 3 < n:
        p, q, s, t = y[i], y[i + 1], y[i + 2], y[i + 3]
        for r in range(points):
            b[r] += (curves[i, r] * p + curves[i + 1, r] * q) + (
                curves[i + 2, r] * s + curves[i + 3, r] * t
            )
        i += 4
    while i < n:
        p = y[i]
        for r in range(points):
            b[r] += curves[i, r] * p
        i += 1


@woven
def curve_of(curves, y, b):
    """Fill b, shape (degree + 1,), with the Bernstein coefficients: curves, (n, degree + 1)."""
    # Loops of a known length take no time to begin and to end.
    if b.shape[0] == LEAST + 1:
        _curve(curves, y, b, LEAST + 1)
    else:
        _curve(curves, y, b, DEGREE + 1)


@woven
def _seen(curve, shift, sign, b, points):
    """Fill b with a distance from the side where a mesh is; return its smallest coefficient."""
    lowest = math.inf
    for k in range(points):
        b[k] = sign * (curve[k] + shift)
        lowest = min(lowest, b[k])
    return lowest


@uncounted
def rounding_of(curves, y):
    """Return the rounding of a distance: of the largest coefficients that its parts have."""
    size, last = 0.0, curves.shape[1] - 1
    for i in range(curves.shape[0]):
        size += max(abs(curves[i, 0]), abs(curves[i, last]), abs(curves[i, last // 2])) * abs(y[i])
    return _ROUNDING * size


@uncounted
def begin_of(b, share, n):
    """Turn Bernstein coefficients of degree n into those on [0, share]."""
    if share == 1.0:
        return
    for j in range(1, n + 1):
        for i in range(n, j - 1, -1):
            b[i] = (1.0 - share) * b[i - 1] + share * b[i]


@uncounted
def _falls(b, zeros, noise):
    """Return whether a distance that starts at rest on its line, as on the other one, falls."""
    lead, size = 0.0, 0.0
    for i in range(zeros + 1):
        share = BINOMIALS[zeros, i]
        lead += share * b[i] if (zeros - i) % 2 == 0 else -share * b[i]
        size += share
    return lead < -noise * size


@woven
def first_events(tables, c, grid, w, end):
    """Find when each mesh crosses a flank line first; fill share, target and spread of `Work`.

    Returns the smallest share of the piece, at most `end`, 2 if there is none, -1 if rounding hides
    whether there is one.
    """
    best, curve, b = 2.0, w.curve, w.bernstein[0]
    for j in range(w.contact.shape[0]):
        w.share[j], code = 2.0, w.contact[j]
        if w.clear[j] and w.rest[j] == 0:
            continue
        known = False
        for line in (1, -1):
            if not _counts(grid, j, code, line):
                continue
            curves, y, shift, noise = w.powers, w.distances[0, 0], 0.0, 0.0
            if c == SERIES:
                y = w.distances[(line + 1) // 2, j]
                noise = _ROUNDING * y[curves.shape[0]]
            else:
                curves, y = tables.curves[c, (line + 1) // 2, j], w.y
            if known and grid.plain[j] and c != SERIES:
                shift = tables.level[c, 0, j] - tables.level[c, 1, j]
            else:
                curve_of(curves, y, curve)
            known = True
            sign = _side(code, line)
            if curve.shape[0] == LEAST + 1:
                lowest = _seen(curve, shift, sign, b, LEAST + 1)
            else:
                lowest = _seen(curve, shift, sign, b, DEGREE + 1)
            zeros = w.rest[j] if w.line[j] == line else 0
            if lowest > 0.0 and zeros == 0:
                continue
            noise += rounding_of(curves, y)
            if zeros == 0 and w.rest[j] > 1 and not grid.gap[j] and _falls(b, w.rest[j], noise):
                found, spread = 0.0, 0.0
            else:
                found, spread = first_fall_from(w.bernstein, zeros, end, noise)
            if found < 0.0:
                return -1.0
            if found < w.share[j]:
                w.share[j], w.spread[j] = found, spread
                w.target[j] = next_contact(code, line)
        best = min(best, w.share[j])
    return best
