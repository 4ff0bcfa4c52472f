"""Distances of meshes from their flank lines along a piece: bounds and first crossings.

The amplitudes of the modes bound a distance while the contacts stay. Mostly this proves that no
line is reached. Otherwise the distance is a polynomial in Bernstein form, whose first fall through
zero is isolated: nothing is sampled. In all functions `tables` are the `Modes` of a run, `work` is
its `Work`, `grid` its `Grid`, and a `combination` of contacts is a row of `tables`, or SERIES.
"""

import math

from gearlib.engines.codes import INVERSE, NORMAL
from gearlib.engines.jit import inlined_uncounted, uncounted
from gearlib.engines.linear.modal_arcs import HIGH_DEGREE, LOW_DEGREE
from gearlib.engines.linear.sparse_series import SERIES, series_may_reach_zero
from gearlib.engines.linear.train_system import next_contact
from gearlib.engines.polynomial import BINOMIALS, first_fall_from

#: Largest rounding error of a distance, as a share of the sum of its terms' magnitudes.
_ROUNDING = 1e-15


@inlined_uncounted
def fill_amplitudes(tables, combination, y, amplitudes):
    """Fill `amplitudes` with the magnitudes of the modes in the modal state y; return their number.

    `tables` are `Modes`, `combination` is a row of them. Oscillating pairs come before real modes.
    """
    pair_count = tables.pair_counts[combination]
    for k in range(pair_count):
        u, v = y[2 * k], y[2 * k + 1]
        amplitudes[k] = math.sqrt(u * u + v * v)
    for k in range(tables.real_counts[combination]):
        amplitudes[pair_count + k] = abs(y[2 * pair_count + k])
    return pair_count + tables.real_counts[combination]


@inlined_uncounted
def _can_reach(grid, j, code, line):
    """Return whether mesh j with a contact `code` may reach a flank line (1 drive, -1 coast side).

    A mesh in contact on one side reaches the other side only if it may jam. `grid` is a `Grid`.
    """
    return not ((code == -line and not grid.may_jam[j]) or (line == -1 and grid.no_coast_side[j]))


@inlined_uncounted
def _distance_sign(code, line):
    """Return the sign that the displacement relative to a flank line has in a contact state.

    `code` is the contact code; `line` is 1 for the drive side and -1 for the coast side.
    """
    return -1.0 if ((code != NORMAL) if line == 1 else (code == INVERSE)) else 1.0


@inlined_uncounted
def _dot_of_first(a, b, count):
    """Return the scalar product of the first `count` entries of a and b.

    Four independent partial sums let the processor compute them in parallel.
    """
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


@inlined_uncounted
def largest_deviation(tables, combination, line, j, work, count):
    """Return the largest deviation of mesh j's distance from a flank line from its constant part.

    It holds until a contact changes, for a row `combination` of `tables` (`Modes`) and the first
    `count` mode amplitudes of `work` (`Work`). `line` is 0 for the coast and 1 for the drive side.
    """
    deviation = _dot_of_first(tables.mode_shares[combination, line, j], work.amplitudes, count)
    return deviation + _ROUNDING * (deviation + abs(tables.slow_distance[combination, line, j]))


@inlined_uncounted
def stays_off_lines(tables, combination, j, grid, work, count):
    """Return whether mesh j provably reaches no flank line until a contact changes.

    `combination` is a row of `tables` (`Modes`); if it is SERIES, the proof holds as long as the
    Taylor series in `work`. `count` is the number of mode amplitudes in `work`, a `Work`.
    """
    deviation, code = 0.0, work.contact[j]
    for line in (1, -1):
        if not _can_reach(grid, j, code, line):
            continue
        side = (line + 1) // 2
        if combination == SERIES:
            sign, degree = _distance_sign(code, line), work.to_bernstein.shape[0] - 1
            if series_may_reach_zero(work.distance_series[side, j], sign, degree):
                return False
            continue
        if not tables.bounded[combination, side, j]:
            return False
        # Distances from two lines with a constant gap have the same amplitude.
        if line == 1 or code == INVERSE or not grid.constant_gap[j]:
            deviation = _dot_of_first(
                tables.mode_shares[combination, side, j], work.amplitudes, count
            )
        level = tables.slow_distance[combination, side, j]
        if not _distance_sign(code, line) * level > deviation + _ROUNDING * abs(level):
            return False
    return True


@inlined_uncounted
def _curve(curves, y, b, points):
    """Fill b, shape (points,), with the product y @ curves; `curves` has the shape (n, points)."""
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


@inlined_uncounted
def fill_curve(curves, y, b):
    """Fill b, shape (degree + 1,), with the Bernstein coefficients of a distance over a piece.

    They are the sum over the components of the modal state y, shape (n,), times the rows of
    `curves`, shape (n, degree + 1).
    """
    # The compiler unrolls loops of constant length.
    if b.shape[0] == LOW_DEGREE + 1:
        _curve(curves, y, b, LOW_DEGREE + 1)
    else:
        _curve(curves, y, b, HIGH_DEGREE + 1)


@inlined_uncounted
def _fill_signed_distance(curve, shift, sign, b, points):
    """Fill b with the first `points` values of sign * (curve + shift); return the smallest."""
    lowest = math.inf
    for k in range(points):
        b[k] = sign * (curve[k] + shift)
        lowest = min(lowest, b[k])
    return lowest


@uncounted
def distance_rounding(curves, y):
    """Return the largest rounding error of a distance with Bernstein coefficients y @ curves."""
    magnitude, last = 0.0, curves.shape[1] - 1
    for i in range(curves.shape[0]):
        largest = max(abs(curves[i, 0]), abs(curves[i, last]), abs(curves[i, last // 2]))
        magnitude += largest * abs(y[i])
    return _ROUNDING * magnitude


@uncounted
def restrict_to_start(b, share, n):
    """Change Bernstein coefficients b, degree n, from [0, 1] to those on [0, share], in place."""
    if share == 1.0:
        return
    for j in range(1, n + 1):
        for i in range(n, j - 1, -1):
            b[i] = (1.0 - share) * b[i - 1] + share * b[i]


@uncounted
def _falls_from_rest(b, zeros, noise):
    """Return whether a distance that starts at zero with zero slope decreases from there.

    The sign of its derivative of order `zeros`, the first that is not zero, decides. b has its
    Bernstein coefficients, and `noise` is their rounding error.
    """
    derivative, weight_sum = 0.0, 0.0
    for i in range(zeros + 1):
        weight = BINOMIALS[zeros, i]
        derivative += weight * b[i] if (zeros - i) % 2 == 0 else -weight * b[i]
        weight_sum += weight
    return derivative < -noise * weight_sum


@inlined_uncounted
def find_first_events(tables, combination, grid, work, end):
    """Find the first crossing of a flank line by each mesh; return the instant of the earliest.

    Instants are shares of the piece of time over which the polynomials of the distances hold; the
    search ends at the share `end`. The result is 2 if there is no crossing and -1 if rounding
    hides whether there is one. `combination` is a row of `tables` (`Modes`) or SERIES. The fields
    event_share, contact_after and share_rounding of `work` are filled.
    """
    first_share, curve, b = 2.0, work.curve, work.search[0]
    for j in range(work.contact.shape[0]):
        work.event_share[j], code = 2.0, work.contact[j]
        if work.stays_off[j] and work.zero_order[j] == 0:
            continue
        curve_is_filled = False
        for line in (1, -1):
            if not _can_reach(grid, j, code, line):
                continue
            curves, y, shift, noise = work.to_bernstein, work.distance_series[0, 0], 0.0, 0.0
            if combination == SERIES:
                y = work.distance_series[(line + 1) // 2, j]
                noise = _ROUNDING * y[curves.shape[0]]
            else:
                curves, y = tables.curves[combination, (line + 1) // 2, j], work.modal_state
            if curve_is_filled and grid.constant_gap[j] and combination != SERIES:
                shift = (
                    tables.slow_distance[combination, 0, j]
                    - tables.slow_distance[combination, 1, j]
                )
            else:
                fill_curve(curves, y, curve)
            curve_is_filled = True
            sign = _distance_sign(code, line)
            if curve.shape[0] == LOW_DEGREE + 1:
                lowest = _fill_signed_distance(curve, shift, sign, b, LOW_DEGREE + 1)
            else:
                lowest = _fill_signed_distance(curve, shift, sign, b, HIGH_DEGREE + 1)
            zeros = work.zero_order[j] if work.start_line[j] == line else 0
            if lowest > 0.0 and zeros == 0:
                continue
            noise += distance_rounding(curves, y)
            if (
                zeros == 0
                and work.zero_order[j] > 1
                and not grid.has_backlash[j]
                and _falls_from_rest(b, work.zero_order[j], noise)
            ):
                share, rounding = 0.0, 0.0
            else:
                share, rounding = first_fall_from(work.search, zeros, end, noise)
            if share < 0.0:
                return -1.0
            if share < work.event_share[j]:
                work.event_share[j], work.share_rounding[j] = share, rounding
                work.contact_after[j] = next_contact(code, line)
        first_share = min(first_share, work.event_share[j])
    return first_share
