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

    y is the modal state of a `combination` of contacts, a row of `tables` (`Modes`). Oscillating
    pairs come before real modes.
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
    """Return whether mesh j may reach a flank line, 1 for the drive and -1 for the coast side.

    `contact_code` is 1 or -1 in contact on the drive or coast side, else 0. A mesh in contact on
    one side can reach the other side only if it may jam. `constants` (`RunConstants`) says which
    meshes may jam and which have no coast side.
    """
    may_reach_other_side = contact_code != -line or constants.may_jam[j]
    return may_reach_other_side and not (line == -1 and constants.no_coast_side[j])


@inlined_without_refcounts
def _distance_sign(contact_code, line):
    """Return the sign, 1 or -1, of the displacement of a mesh from a flank line.

    `line` is 1 for the drive-side and -1 for the coast-side line; `contact_code` is DRIVE, COAST or
    NO_CONTACT. The sign is constant until the mesh crosses the line.
    """
    if line == 1:
        return 1.0 if contact_code == DRIVE else -1.0
    return -1.0 if contact_code == COAST else 1.0


@inlined_without_refcounts
def _dot_of_first(a, b, count):
    """Return the scalar product of the first `count` entries of the vectors a and b.

    The processor computes four independent partial sums in parallel.
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

    The bound holds until a contact changes. `combination` is a row of `tables` (`Modes`), `count`
    is the number of mode amplitudes in `work` (`RunStorage`), and `side` is 0 for the coast-side
    and 1 for the drive-side line.
    """
    factors = tables.mode_amplitude_factors[combination, side, j]
    amplitude = _dot_of_first(factors, work.amplitudes, count)
    return amplitude + _ROUNDING * (amplitude + abs(tables.constant_distance[combination, side, j]))


@inlined_without_refcounts
def stays_off_lines(tables, combination, j, constants, work, count):
    """Return whether mesh j provably reaches no flank line until a contact changes.

    `combination` is a row of `tables` (`Modes`); if it is SERIES, the proof holds as long as the
    Taylor series in `work` (`RunStorage`). `count` is the number of mode amplitudes in `work`;
    `constants` (`RunConstants`) say which meshes have a constant gap between both flank lines.
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
    """Fill `bernstein`, (degree + 1,), with the Bernstein coefficients of a distance over a piece.

    They are y @ curves: y, shape (n,), is the modal state at the start of the piece of time, or the
    Taylor series of the distance, and row i of `curves`, shape (n, degree + 1), is the contribution
    of entry i.
    """
    # The compiler unrolls loops of constant length.
    if bernstein.shape[0] == LOW_DEGREE + 1:
        fill_product(curves, y, bernstein, LOW_DEGREE + 1)
    else:
        fill_product(curves, y, bernstein, HIGH_DEGREE + 1)


@inlined_without_refcounts
def _fill_signed_distance(curve, offset, sign, b, count):
    """Fill b with sign * (curve + offset), of `count` entries, and return the smallest entry."""
    lowest = math.inf
    for k in range(count):
        b[k] = sign * (curve[k] + offset)
        lowest = min(lowest, b[k])
    return lowest


@kernel_without_refcounts
def distance_rounding(curves, y):
    """Return a bound on the rounding error of a distance with Bernstein coefficients y @ curves.

    y, shape (n,), is the modal state or a Taylor series, and `curves` has the shape (n, degree +
    1), see `fill_curve`.
    """
    magnitude, last = 0.0, curves.shape[1] - 1
    # In a piece of time a mode oscillates at most about once, so three coefficients suffice.
    for i in range(curves.shape[0]):
        largest = max(abs(curves[i, 0]), abs(curves[i, last]), abs(curves[i, last // 2]))
        magnitude += largest * abs(y[i])
    return _ROUNDING * magnitude


@kernel_without_refcounts
def restrict_to_start(b, fraction, n):
    """Replace the Bernstein coefficients b on [0, 1] by the coefficients on [0, fraction].

    b has n + 1 entries, of a polynomial of degree n, and changes in place.
    """
    if fraction == 1.0:
        return
    for j in range(1, n + 1):
        for i in range(n, j - 1, -1):
            b[i] = (1.0 - fraction) * b[i - 1] + fraction * b[i]


@kernel_without_refcounts
def _falls_from_rest(b, order, rounding):
    """Return whether a distance that starts at zero with zero slope decreases from there.

    The sign of its first nonzero derivative, which has this `order`, decides. b holds the Bernstein
    coefficients of the distance, and `rounding` is their rounding error.
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
