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
from gearlib.engines.polynomial import BINOMIALS, MAX_DEPTH, MAX_INTERVALS, MAX_NEWTON, halve

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
def _root(b, n, s, p, q):
    """Return (s, slope at s) where Bernstein coefficients of degree n pass zero, near s."""
    for i in range(n + 1):
        p[i] = BINOMIALS[n, i] * b[i]
    for i in range(n):
        q[i] = BINOMIALS[n - 1, i] * (b[i + 1] - b[i])
    low, high, rate, scale, last = 0.0, 1.0, 0.0, 1.0, 0.0
    for step in range(MAX_NEWTON):
        rate = 0.0
        if s <= 0.5:
            ratio, scale = s / (1.0 - s), 1.0 - s
            value = p[n]
            for i in range(n - 1, -1, -1):
                value = value * ratio + p[i]
                rate = rate * ratio + q[i]
        else:
            ratio, scale = (1.0 - s) / s, s
            value = p[0]
            for i in range(1, n + 1):
                value = value * ratio + p[i]
                rate = rate * ratio + q[i - 1]
        if value > 0.0:
            low = s
        else:
            high = s
        # Both sums lack powers of the scale, the value one more.
        new = s - value * scale / (n * rate) if rate < 0.0 else -1.0
        newton = low <= new <= high and step % 8 < 7
        if not newton:
            new = 0.5 * (low + high)
        moved = abs(new - s)
        s = new
        # What a step of Newton's method leaves goes with its square, as from the last step to it.
        if moved <= 2e-16 * high or (newton and moved * moved * moved < 1e-17 * high * last * last):
            break
        last = moved if newton else 0.0
    return s, n * rate * scale ** (n - 1)


@uncounted
def _changes(b, n, noise):
    """Return (sign changes of Bernstein coefficients, place of the last): no more roots are there.

    Coefficients that cannot be told from zero do not count, unless they are first.
    """
    changes, place, before = 0, 0.0, b[0]
    last = 0
    for i in range(1, n + 1):
        if abs(b[i]) > noise:
            if before * b[i] < 0.0:
                changes += 1
                place = (last + (i - last) * before / (before - b[i])) / n
            before, last = b[i], i
    return changes, place


@uncounted
def first_fall(work, zeros, end, noise):
    """Return (first s in [0, end] where a polynomial falls through zero, its rounding).

    2: there is none; -1: the budget of intervals does not suffice to tell. A polynomial in
    Bernstein form has no more roots than its coefficients change signs, and lies between the
    smallest and the largest: what neither settles is halved. `work`, shape (MAX_DEPTH + 4, degree +
    2), begins with its coefficients on [0, 1] and changes; so many `zeros` of them, from the
    constant on, are zero: 1 on the line, 2 at rest on it. A dip below zero within `noise` is
    rounding.
    """
    last, b, rounding = work.shape[1] - 1, work[0], noise
    n = last - 1
    if not noise < math.inf:
        # Beyond the range of numbers: so is the end of the period, whose status says so.
        return 2.0, 0.0
    # Factors s are divided out: beside such a root the next one could not be told from rounding.
    for _ in range(min(zeros, n - 2)):
        for i in range(n):
            b[i] = b[i + 1] * n / (i + 1)
        noise *= n
        n -= 1
    slope = n * (b[1] - b[0])
    if zeros == 0 and b[0] <= 0.0 and slope < -noise:
        return 0.0, 0.0
    if zeros > 0 and abs(b[0]) <= noise and slope < -noise:
        # Its root is closer than rounding can place it.
        return max(-b[0] / slope, 0.0), 0.0
    p, q = work[MAX_DEPTH + 2], work[MAX_DEPTH + 3]
    depth, low = 0, 0.0
    b[last] = 1.0
    for _ in range(MAX_INTERVALS):
        if depth < 0 or low > end:
            return 2.0, 0.0
        b = work[depth]
        width = b[last]
        smallest, largest = b[0], b[0]
        for j in range(1, n + 1):
            smallest, largest = min(smallest, b[j]), max(largest, b[j])
        if smallest >= -noise:
            low += width
            depth -= 1
            continue
        changes, place = _changes(b, n, noise)
        if changes == 1 and b[0] > 0.0:
            s, slope = _root(b, n, place, p, q)
            found = low + width * s
            if found > end:
                return 2.0, 0.0
            slope *= found**zeros / width
            return found, rounding / abs(slope) if slope != 0.0 else 0.0
        if (largest < 0.0 and b[n] >= b[0]) or (changes == 1 and b[n] > noise):
            # Below from the start, and coming up.
            low += width
            depth -= 1
        elif depth == MAX_DEPTH:
            if b[n] < -noise and b[n] < b[0]:
                # Rounding hides how it falls, not that it does.
                return low, 0.0
            low += width
            depth -= 1
        else:
            # The right half stays in this row, the left half goes on top.
            left = work[depth + 1]
            halve(b, left, work[MAX_DEPTH + 1], n)
            b[last] = 0.5 * width
            left[last] = 0.5 * width
            depth += 1
    return (2.0 if depth < 0 else -1.0), 0.0


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
                found, spread = first_fall(w.bernstein, zeros, end, noise)
            if found < 0.0:
                return -1.0
            if found < w.share[j]:
                w.share[j], w.spread[j] = found, spread
                w.target[j] = next_contact(code, line)
        best = min(best, w.share[j])
    return best
