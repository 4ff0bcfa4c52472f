"""What is recorded of a gear train: extrema and fractions of every mesh, samples."""

import math

from gearlib.engines import orbit
from gearlib.engines.codes import BACKLASH, INVERSE, NORMAL
from gearlib.engines.copies import copy
from gearlib.engines.jit import uncounted, woven
from gearlib.engines.linear.distances import begin_of, curve_of, furthest, sizes_of
from gearlib.engines.linear.grid import TAKEN
from gearlib.engines.linear.modal_arcs import advance, multiply, turn_by
from gearlib.engines.linear.sparse_series import SERIES, sum_of
from gearlib.engines.polynomial import highest_from

#: Columns of a summary: those of `orbit` and the integral of the elastic force over the phase.
FORCE_SUM = orbit.SUMMARY_COLUMNS
SUMMARY_COLUMNS = orbit.SUMMARY_COLUMNS + 1


@uncounted
def _add_extrema(curve, displaced, stiffness, w, row):
    """Add the extrema of a distance to those of the displacement, if it is one, and of the force.

    Both are those of one curve, so that one search finds them.
    """
    degree = curve.shape[0] - 1
    for sign, shift, force in (
        (1.0, orbit.X_MAX, orbit.FORCE_MAX),
        (-1.0, orbit.X_MIN, orbit.FORCE_MIN),
    ):
        floor, largest = sign * row[shift] if displaced else math.inf, -math.inf
        if stiffness > 0.0:
            floor = min(floor, sign * row[force] / stiffness)
        for k in range(degree + 1):
            w.bernstein[0, k] = sign * curve[k]
            largest = max(largest, w.bernstein[0, k])
        # Most pieces have no new extrema, which their coefficients tell at once.
        if largest <= floor:
            continue
        best = highest_from(w.bernstein, degree, floor)
        if displaced and not best <= sign * row[shift]:
            row[shift] = sign * best
        if stiffness > 0.0 and not stiffness * best <= sign * row[force]:
            row[force] = sign * stiffness * best


@woven
def _distance(tables, c, side, j, w):
    """Fill the curve of `Work` with a distance, from the far or the near line."""
    if c == SERIES:
        curve_of(w.powers, w.distances[side, j], w.curve)
    else:
        curve_of(tables.curves[c, side, j], w.other, w.curve)


@woven
def _within(system, tables, c, w, p, summary, modes):
    """Return whether no mesh provably comes to new extrema as long as the contacts stay."""
    for j in range(w.contact.shape[0]):
        row, code = summary[j], w.contact[j]
        if not tables.steady[c, 1, j] or not tables.steady[c, 0, j]:
            return False
        level, reach = tables.level[c, 1, j], furthest(tables, c, 1, j, w, modes)
        if level + reach > row[orbit.X_MAX] or level - reach < row[orbit.X_MIN]:
            return False
        if code == INVERSE:
            level, reach = tables.level[c, 0, j], furthest(tables, c, 0, j, w, modes)
        stiffness = system.stiffness[code + 1, p, j] if code != BACKLASH else 0.0
        high, low = stiffness * (level + reach), stiffness * (level - reach)
        if high > row[orbit.FORCE_MAX] or low < row[orbit.FORCE_MIN]:
            return False
    return True


@woven
def _integral(tables, c, line, j, y, z, t):
    """Return the integral of a distance over t, in which its modes go from y to z."""
    pairs, total, rates = tables.pairs[c], tables.level[c, line, j] * t, tables.rates[c]
    # At the begin of a piece a curve is the row of the distance.
    curves = tables.curves[c, line, j]
    for k in range(pairs):
        a, b = rates[k, 0], rates[k, 1]
        u, v = z[2 * k] - y[2 * k], z[2 * k + 1] - y[2 * k + 1]
        p, q = a * u + b * v, a * v - b * u
        total += (curves[2 * k, 0] * p + curves[2 * k + 1, 0] * q) / (a * a + b * b)
    for k in range(tables.single[c]):
        i = 2 * pairs + k
        total += curves[i, 0] * (z[i] - y[i]) / rates[pairs + k, 0]
    return total


@uncounted
def record(system, grid, tables, c, w, p, phase, length, piece, summary, samples):
    """Record what begins at `phase`, with the state y of `Work`, and lasts `length` of theta.

    Curves hold over `piece`; a series lasts as long. Samples have the columns: the state, shape
    (n,), the contact codes, shape (m,), the number of the segment; there the phase stands at first
    that is wanted. Of a summary whose extrema are infinite none are looked for.
    """
    m, n = system.near.shape
    tuning, done, curve = system.tuning, 0.0, w.curve
    degree = curve.shape[0] - 1
    looked_for = summary[0, orbit.X_MAX] < math.inf
    copy(w.y, w.other)
    for j in range(m):
        orbit.add_time(
            w.contact[j], length * tuning, system.low[w.contact[j] + 1, p, j], summary[j]
        )
    while done < length:
        part = min(piece, length - done) if looked_for else length
        searched = looked_for
        if looked_for and part < length - done:
            modes = sizes_of(tables, c, w.other, w.sizes)
            if _within(system, tables, c, w, p, summary, modes):
                part, searched = length - done, False
                copy(w.other, w.sampled)
                turn_by(tables, c, part, w.factors)
                advance(tables, c, w.factors, part, w.sampled, w.term, w.image)
                for j in range(m):
                    code = w.contact[j]
                    if code != BACKLASH:
                        line = 0 if code == INVERSE else 1
                        area = _integral(tables, c, line, j, w.other, w.sampled, part)
                        area *= tuning * system.stiffness[code + 1, p, j]
                        summary[j, FORCE_SUM] += area
        for j in range(m if searched else 0):
            row, code = summary[j], w.contact[j]
            _distance(tables, c, 1, j, w)
            begin_of(curve, part / piece, degree)
            stiffness = 0.0 if code == BACKLASH else system.stiffness[code + 1, p, j]
            _add_extrema(curve, True, stiffness if code == NORMAL else 0.0, w, row)
            if code == BACKLASH:
                continue
            if code == INVERSE:
                _distance(tables, c, 0, j, w)
                begin_of(curve, part / piece, degree)
                _add_extrema(curve, False, stiffness, w, row)
            for k in range(degree + 1):
                row[FORCE_SUM] += part * tuning * stiffness * curve[k] / (degree + 1)
        at = phase + done * tuning
        end = at + part * tuning - 1e-12
        while w.place[TAKEN] < samples.shape[0]:
            taken = w.place[TAKEN]
            wanted = samples[taken, n + m]
            if wanted >= end:
                break
            t = max(wanted - at, 0.0) / tuning
            if c == SERIES:
                sum_of(w.terms, n, t / piece, w.moved)
            else:
                copy(w.other, w.sampled)
                turn_by(tables, c, t, w.factors)
                advance(tables, c, w.factors, t, w.sampled, w.term, w.image)
                multiply(tables.out, c, w.sampled, w.moved)
            copy(w.moved, samples[taken, :n])
            for j in range(m):
                samples[taken, n + j] = w.contact[j]
            samples[taken, n + m] = p
            w.place[TAKEN] = taken + 1
        done += part
        if done < length:
            turn_by(tables, c, part, w.factors)
            advance(tables, c, w.factors, part, w.other, w.term, w.image)
