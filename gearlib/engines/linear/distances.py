"""Distances of meshes from their flank lines along a piece: bounds and first crossings.

The amplitudes of the modes bound a distance until a contact changes. In most cases this proves that
no line is reached. Otherwise the distance is a polynomial in Bernstein form, whose first fall
through zero is isolated without sampling. In all functions `tables` are the `Modes` of a run,
`work` is its `RunStorage`, `constants` are its `RunConstants`, and a `combination` of contacts is a
row of `tables`, or SERIES. Contact codes are DRIVE 1 (drive side), NO_CONTACT 0, COAST -1 (coast
side).
"""

import math

from gearlib.engines.codes import COAST, DRIVE
from gearlib.engines.jit import inlined_without_refcounts, kernel_without_refcounts
from gearlib.engines.linear.modal_arcs import HIGH_DEGREE, LOW_DEGREE, fill_product
from gearlib.engines.linear.sparse_series import SERIES, series_may_reach_zero
from gearlib.engines.linear.train_system import next_contact
from gearlib.engines.polynomial import BINOMIALS, first_bernstein_crossing

#: Largest rounding error of a distance, as a fraction of the sum of its terms' magnitudes.
_ROUNDING = 1e-15
#: Codes in place of an instant: there is no event, or rounding hides whether there is one.
_NO_EVENT, _HIDDEN_EVENT = 2.0, -1.0


@inlined_without_refcounts
def fill_amplitudes(tables, combination, y, amplitudes):
    """Fill `amplitudes` with the magnitudes of the modes in a modal state; return their number.

    y holds the state in modal coordinates: two entries for each oscillating pair of modes, then one
    for each real (exponentially decaying) mode. The row `combination` of the mode tables `tables`
    (`Modes`), which belongs to the present contacts of the meshes, holds the numbers of both.
    """
    pair_count = tables.pair_counts[combination]
    for k in range(pair_count):
        u, v = y[2 * k], y[2 * k + 1]
        amplitudes[k] = math.sqrt(u * u + v * v)
    for k in range(tables.real_counts[combination]):
        amplitudes[pair_count + k] = abs(y[2 * pair_count + k])
    return pair_count + tables.real_counts[combination]


@inlined_without_refcounts
def _can_reach(constants, j, contact_code, line):
    """Return whether mesh j can reach a flank line, the displacement at which its flanks touch.

    `line` is 1 for the drive-side and -1 for the coast-side line; `contact_code` is 1 or -1 in
    contact on that side and 0 without contact. A mesh in contact on one side reaches the line of
    the other side only if its backlash may vanish (`constants.may_jam`). A mesh with
    `constants.no_coast_side` has no coast-side line.
    """
    may_reach_other_side = contact_code != -line or constants.may_jam[j]
    return may_reach_other_side and not (line == -1 and constants.no_coast_side[j])


@inlined_without_refcounts
def _distance_sign(contact_code, line):
    """Return the sign, 1 or -1, of the displacement of a mesh from a flank line.

    `line` is 1 for the drive-side and -1 for the coast-side line, the displacements at which the
    flanks touch. A mesh is above the drive-side line only in drive-side contact, and below the
    coast-side line only in coast-side contact; `contact_code` is DRIVE, COAST or NO_CONTACT.
    """
    if line == 1:
        return 1.0 if contact_code == DRIVE else -1.0
    return -1.0 if contact_code == COAST else 1.0


@inlined_without_refcounts
def _dot_of_first(a, b, count):
    """Return the scalar product of the first `count` entries of the vectors a and b.

    Four partial sums do not wait for each other, so that the processor adds them in parallel.
    """
    sum_0, sum_1, sum_2, sum_3 = 0.0, 0.0, 0.0, 0.0
    k = 0
    while k + 3 < count:
        sum_0 += a[k] * b[k]
        sum_1 += a[k + 1] * b[k + 1]
        sum_2 += a[k + 2] * b[k + 2]
        sum_3 += a[k + 3] * b[k + 3]
        k += 4
    while k < count:
        sum_0 += a[k] * b[k]
        k += 1
    return (sum_0 + sum_1) + (sum_2 + sum_3)


@inlined_without_refcounts
def distance_amplitude(tables, combination, side, j, work, count):
    """Return a bound on the oscillation of mesh j's distance from a flank line about its mean.

    The flank line is the displacement at which the flanks touch; `side` is 0 for the coast and 1
    for the drive side. Each mode adds its magnitude, one of the first `count` entries of
    ``work.amplitudes``, times its share in the distance. The shares stand in the mode tables
    `tables`, whose row `combination` belongs to the present contacts. The bound includes rounding.
    """
    factors = tables.mode_amplitude_factors[combination, side, j]
    amplitude = _dot_of_first(factors, work.amplitudes, count)
    return amplitude + _ROUNDING * (amplitude + abs(tables.constant_distance[combination, side, j]))


@inlined_without_refcounts
def stays_off_lines(tables, combination, j, constants, work, count):
    """Return whether mesh j provably reaches no flank line until a contact changes.

    A flank line is the displacement at which the flanks touch. The mesh stays off it if the
    constant part of its distance exceeds the sum of the oscillations of all modes, whose magnitudes
    are the first `count` entries of ``work.amplitudes``. `combination` is the row of the mode
    tables `tables` for the present contacts. If it is SERIES, there are no modes; then the Taylor
    series of the distance in `work` is bounded, which holds for one step. `constants`
    (`RunConstants`) have flags of the meshes.
    """
    amplitude, code = 0.0, work.contact[j]
    for line in (1, -1):
        if not _can_reach(constants, j, code, line):
            continue
        side = (line + 1) // 2
        if combination == SERIES:
            sign, degree = _distance_sign(code, line), work.to_bernstein.shape[0] - 1
            if series_may_reach_zero(work.distance_series[side, j], sign, degree):
                return False
            continue
        if not tables.is_bounded[combination, side, j]:
            return False
        # With a constant gap both distances have the same amplitude, which is then known from the
        # drive side unless the loop has skipped that, with the coast side in contact.
        if line == 1 or code == COAST or not constants.constant_gap[j]:
            factors = tables.mode_amplitude_factors[combination, side, j]
            amplitude = _dot_of_first(factors, work.amplitudes, count)
        center = tables.constant_distance[combination, side, j]
        if not _distance_sign(code, line) * center > amplitude + _ROUNDING * abs(center):
            return False
    return True


@inlined_without_refcounts
def fill_curve(curves, y, bernstein):
    """Fill `bernstein`, (degree + 1,), with the Bernstein coefficients of a mesh's flank distance.

    The distance of a mesh from its flank line is a polynomial of time over a short step, with the
    coefficients y @ curves. y, shape (n,), is the state in modal coordinates at the start of the
    step, or the Taylor series of the distance. Row i of `curves`, (n, degree + 1), is the part due
    to y[i].
    """
    # Only two degrees occur. Written as constants, they let the compiler unroll the loops.
    if bernstein.shape[0] == LOW_DEGREE + 1:
        fill_product(curves, y, bernstein, LOW_DEGREE + 1)
    else:
        fill_product(curves, y, bernstein, HIGH_DEGREE + 1)


@inlined_without_refcounts
def _fill_signed_distance(curve, offset, sign, b, count):
    """Fill b with `count` entries of sign * (curve + offset) and return the smallest of them.

    `curve` holds the Bernstein coefficients of a flank distance. If all signed coefficients are
    positive, the distance has no zero.
    """
    lowest = math.inf
    for k in range(count):
        b[k] = sign * (curve[k] + offset)
        lowest = min(lowest, b[k])
    return lowest


@kernel_without_refcounts
def distance_rounding(curves, y):
    """Return a bound on the rounding error of a flank distance, of coefficients y @ curves.

    y, shape (n,), is the state in modal coordinates or the Taylor series of the distance, and row i
    of `curves`, (n, degree + 1), is the part of the coefficients due to y[i]. The bound is a small
    fraction of the sum of the magnitudes of these parts.
    """
    magnitude, last = 0.0, curves.shape[1] - 1
    # A polynomial covers at most about one oscillation of a mode, so its first, middle and last
    # coefficients show how large it is.
    for i in range(curves.shape[0]):
        largest = max(abs(curves[i, 0]), abs(curves[i, last]), abs(curves[i, last // 2]))
        magnitude += largest * abs(y[i])
    return _ROUNDING * magnitude


@kernel_without_refcounts
def restrict_to_start(b, fraction, n):
    """Replace the Bernstein coefficients b on [0, 1] by the coefficients on [0, fraction].

    b has n + 1 entries, of a polynomial of degree n, and changes in place. This is de Casteljau's
    scheme: weighted means of neighbouring coefficients, n times.
    """
    if fraction == 1.0:
        return
    for j in range(1, n + 1):
        for i in range(n, j - 1, -1):
            b[i] = (1.0 - fraction) * b[i - 1] + fraction * b[i]


@kernel_without_refcounts
def _falls_from_rest(b, order, rounding):
    """Return whether a distance that starts at zero with zero slope decreases from there.

    At the start all derivatives of lower order than `order` are zero, so that the sign of the
    derivative of this order decides. Up to a positive factor it is an alternating sum of the
    distance's Bernstein coefficients b with binomial weights. `rounding` is the rounding error of a
    coefficient.
    """
    derivative, weight_sum = 0.0, 0.0
    for i in range(order + 1):
        weight = BINOMIALS[order, i]
        derivative += weight * b[i] if (order - i) % 2 == 0 else -weight * b[i]
        weight_sum += weight
    return derivative < -rounding * weight_sum


@inlined_without_refcounts
def find_first_events(tables, combination, constants, work, end):
    """Find the first crossing of a flank line by each mesh; return the instant of the earliest.

    Instants are fractions of the piece of time over which the polynomials of the distances hold;
    the search stops at `end`. The result is 2 if there is no crossing and -1 if rounding hides
    whether there is one. `combination` is a row of `tables` (`Modes`), or SERIES. The fields
    event_instant, contact_after and instant_rounding of `work` (`RunStorage`) are filled. There,
    zero_order is k > 0 if a mesh starts on the line start_line with k zero derivatives of its
    distance, counting the distance itself, and stays_off whether it provably reaches no line.
    """
    earliest, curve, b = _NO_EVENT, work.curve, work.search[0]
    for j in range(work.contact.shape[0]):
        work.event_instant[j], code = _NO_EVENT, work.contact[j]
        if work.stays_off[j] and work.zero_order[j] == 0:
            continue
        curve_is_filled = False
        for line in (1, -1):
            if not _can_reach(constants, j, code, line):
                continue
            curves, y, offset, rounding = work.to_bernstein, work.distance_series[0, 0], 0.0, 0.0
            if combination == SERIES:
                y = work.distance_series[(line + 1) // 2, j]
                # The entry after the coefficients scales the rounding error, see
                # `fill_distance_series`.
                rounding = _ROUNDING * y[curves.shape[0]]
            else:
                curves, y = tables.curves[combination, (line + 1) // 2, j], work.modal_state
            if curve_is_filled and constants.constant_gap[j] and combination != SERIES:
                offset = (
                    tables.constant_distance[combination, 0, j]
                    - tables.constant_distance[combination, 1, j]
                )
            else:
                fill_curve(curves, y, curve)
            curve_is_filled = True
            sign = _distance_sign(code, line)
            if curve.shape[0] == LOW_DEGREE + 1:
                lowest = _fill_signed_distance(curve, offset, sign, b, LOW_DEGREE + 1)
            else:
                lowest = _fill_signed_distance(curve, offset, sign, b, HIGH_DEGREE + 1)
            zero_count = work.zero_order[j] if work.start_line[j] == line else 0
            if lowest > 0.0 and zero_count == 0:
                continue
            rounding += distance_rounding(curves, y)
            if (
                zero_count == 0
                and work.zero_order[j] > 1
                and not constants.has_backlash[j]
                and _falls_from_rest(b, work.zero_order[j], rounding)
            ):
                instant, instant_rounding = 0.0, 0.0
            else:
                instant, instant_rounding = first_bernstein_crossing(
                    work.search, zero_count, end, rounding
                )
            if instant < 0.0:
                return _HIDDEN_EVENT
            if instant < work.event_instant[j]:
                work.event_instant[j], work.instant_rounding[j] = instant, instant_rounding
                work.contact_after[j] = next_contact(code, line)
        earliest = min(earliest, work.event_instant[j])
    return earliest
