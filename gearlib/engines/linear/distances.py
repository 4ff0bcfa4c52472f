"""Distances of meshes from their flank lines over an interval of time: bounds and first crossings.

A flank line is the displacement at which the flanks of a mesh just touch. The amplitudes of the
modes bound a distance until a contact changes, which in most cases proves that no flank line is
reached. Otherwise the distance is a polynomial in Bernstein form, whose first downward zero
crossing is isolated without sampling. In all functions `tables` are the `ModeTables` of a run,
`run` is its `RunState`, `constants` are its `RunConstants`, and `combination` is the row
of `tables` for the present contacts, or SERIES. Contact states are DRIVE 1, NO_CONTACT 0 and COAST
-1.
"""

import math

from gearlib.engines.codes import COAST, DRIVE
from gearlib.engines.jit import kernel_part
from gearlib.engines.linear.modal_arcs import HIGH_DEGREE, LOW_DEGREE, fill_product
from gearlib.engines.linear.sparse_series import SERIES, series_may_reach_zero
from gearlib.engines.linear.train_system import next_contact
from gearlib.engines.polynomial import BINOMIALS, first_bernstein_crossing

#: Largest rounding error of a distance, as a fraction of the sum of its terms' magnitudes.
_ROUNDING = 1e-15
#: Values in place of an instant: there is no event, or rounding decides whether there is one.
_NO_EVENT, _UNCERTAIN_EVENT = 2.0, -1.0


@kernel_part(refcounts=False, inlined=True)
def fill_amplitudes(tables, combination, y, amplitudes):
    """Fill `amplitudes` with the magnitudes of the modes in a modal state; return their number.

    y is the state in modal coordinates: two entries per oscillating pair of modes, then one per
    real (exponentially decaying) mode. `combination` is the row of the mode tables `tables`
    (`ModeTables`) for the present contacts.
    """
    pair_count = tables.pair_counts[combination]
    for k in range(pair_count):
        u, v = y[2 * k], y[2 * k + 1]
        amplitudes[k] = math.sqrt(u * u + v * v)
    for k in range(tables.real_counts[combination]):
        amplitudes[pair_count + k] = abs(y[2 * pair_count + k])
    return pair_count + tables.real_counts[combination]


@kernel_part(refcounts=False, inlined=True)
def _can_reach(constants, j, contact_state, line):
    """Return whether mesh j can reach a flank line, the displacement at which its flanks touch.

    `line` is DRIVE (1) or COAST (-1), the side of the flank line; `contact_state` is the contact
    state of the mesh. A mesh in contact on one side can reach the line of the other side only if
    its backlash may vanish (``constants.may_jam``). A mesh without a coast side
    (``constants.no_coast_side``) has no coast-side line.
    """
    may_reach_other_side = contact_state != -line or constants.may_jam[j]
    return may_reach_other_side and not (line == -1 and constants.no_coast_side[j])


@kernel_part(refcounts=False, inlined=True)
def _distance_sign(contact_state, line):
    """Return the sign, 1 or -1, of the displacement of a mesh relative to a flank line.

    `line` is DRIVE (1) or COAST (-1), the side of the flank line, where the flanks just touch. The
    mesh is above the drive-side line only in drive-side contact and below the coast-side line only
    in coast-side contact; `contact_state` is DRIVE, COAST or NO_CONTACT.
    """
    if line == 1:
        return 1.0 if contact_state == DRIVE else -1.0
    return -1.0 if contact_state == COAST else 1.0


@kernel_part(refcounts=False, inlined=True)
def _partial_dot(a, b, count):
    """Return the scalar product of the first `count` entries of a and b.

    The four partial sums are independent of each other, so that the processor computes them in
    parallel.
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


@kernel_part(refcounts=False, inlined=True)
def distance_amplitude(tables, combination, side, j, run, count):
    """Return a bound on the deviation of mesh j's flank distance from its constant part.

    The flank distance is the distance from the flank line on a `side`, 0 for the coast side and 1
    for the drive side. Each mode contributes its magnitude, one of the first `count` entries of
    ``run.amplitudes``, times its factor in row `combination` of the mode tables `tables`. The
    bound includes rounding.
    """
    factors = tables.mode_amplitude_factors[combination, side, j]
    amplitude = _partial_dot(factors, run.amplitudes, count)
    return amplitude + _ROUNDING * (amplitude + abs(tables.constant_distance[combination, side, j]))


@kernel_part(refcounts=False, inlined=True)
def stays_clear_of_lines(tables, combination, j, constants, run, count):
    """Return whether mesh j provably reaches no flank line before the next change of contact.

    A flank line is the displacement at which the flanks just touch. The mesh stays clear of it if
    the constant part of its distance exceeds the sum of the contributions of all modes, whose
    magnitudes are the first `count` entries of ``run.amplitudes``. `combination` is the row
    of the mode tables `tables` for the present contacts. If it is SERIES, the Taylor series of the
    distance is bounded instead, and the result holds for one step. `constants` (`RunConstants`) has
    the flags of the meshes.
    """
    amplitude, contact = 0.0, run.contact[j]
    for line in (1, -1):
        if not _can_reach(constants, j, contact, line):
            continue
        side = (line + 1) // 2
        if combination == SERIES:
            sign, degree = _distance_sign(contact, line), run.to_bernstein.shape[0] - 1
            if series_may_reach_zero(run.distance_series[side, j], sign, degree):
                return False
            continue
        if not tables.is_bounded[combination, side, j]:
            return False
        # If the gap is constant, both distances have the same amplitude. It is already computed
        # unless coast-side contact has made the loop skip the drive side.
        if line == 1 or contact == COAST or not constants.constant_gap[j]:
            factors = tables.mode_amplitude_factors[combination, side, j]
            amplitude = _partial_dot(factors, run.amplitudes, count)
        center = tables.constant_distance[combination, side, j]
        if not _distance_sign(contact, line) * center > amplitude + _ROUNDING * abs(center):
            return False
    return True


@kernel_part(refcounts=False, inlined=True)
def fill_distance_polynomial(polynomials, y, polynomial):
    """Fill `polynomial`, (degree + 1,), with the Bernstein coefficients of a flank distance.

    Over a short interval of time, the distance of a mesh from its flank line is a polynomial with
    the coefficients y @ polynomials. y, shape (n,), is the modal state at the start of the interval
    or the Taylor series of the distance. Row i of `polynomials`, (n, degree + 1), is the
    contribution of a unit of y[i].
    """
    # Constant degrees let the compiler unroll the loops; only two degrees occur.
    if polynomial.shape[0] == LOW_DEGREE + 1:
        fill_product(polynomials, y, polynomial, LOW_DEGREE + 1)
    else:
        fill_product(polynomials, y, polynomial, HIGH_DEGREE + 1)


@kernel_part(refcounts=False, inlined=True)
def _fill_signed_distance(polynomial, offset, sign, b, count):
    """Fill b with `count` entries of sign * (polynomial + offset) and return the smallest entry.

    `polynomial` holds the Bernstein coefficients of a flank distance. If all entries of b are
    positive, the distance has no zero.
    """
    smallest = math.inf
    for k in range(count):
        b[k] = sign * (polynomial[k] + offset)
        smallest = min(smallest, b[k])
    return smallest


@kernel_part(refcounts=False)
def distance_rounding(polynomials, y):
    """Return a bound on the rounding error of a flank distance with coefficients y @ polynomials.

    y, shape (n,), is the modal state or the Taylor series of the distance. Row i of `polynomials`,
    (n, degree + 1), holds the Bernstein coefficients due to a unit of y[i]. The bound is a small
    fraction of the sum of the magnitudes of all contributions.
    """
    magnitude, degree = 0.0, polynomials.shape[1] - 1
    # A polynomial covers at most about one oscillation of a mode, so its first, middle and last
    # coefficients show how large it is.
    for i in range(polynomials.shape[0]):
        largest = max(
            abs(polynomials[i, 0]), abs(polynomials[i, degree]), abs(polynomials[i, degree // 2])
        )
        magnitude += largest * abs(y[i])
    return _ROUNDING * magnitude


@kernel_part(refcounts=False)
def restrict_to_start(b, fraction, n):
    """Replace Bernstein coefficients b on [0, 1] by the coefficients on [0, fraction], in place.

    b has n + 1 entries for a polynomial of degree n. De Casteljau's algorithm replaces neighbouring
    coefficients by their weighted means, n times.
    """
    if fraction == 1.0:
        return
    for j in range(1, n + 1):
        for i in range(n, j - 1, -1):
            b[i] = (1.0 - fraction) * b[i - 1] + fraction * b[i]


@kernel_part(refcounts=False)
def _falls_from_rest(b, order, rounding):
    """Return whether a distance that starts at zero with zero slope decreases at first.

    All derivatives below `order` are zero at the start, so the sign of the derivative of this order
    decides. Up to a positive factor, it is an alternating sum of the Bernstein coefficients b of
    the distance with binomial weights. `rounding` is the rounding error of a coefficient.
    """
    derivative, weight_sum = 0.0, 0.0
    for i in range(order + 1):
        weight = BINOMIALS[order, i]
        derivative += weight * b[i] if (order - i) % 2 == 0 else -weight * b[i]
        weight_sum += weight
    return derivative < -rounding * weight_sum


@kernel_part(refcounts=False, inlined=True)
def find_first_events(tables, combination, constants, run, end):
    """Find the first crossing of a flank line by each mesh; return the instant of the earliest one.

    Instants are fractions of the interval over which the distance polynomials hold; the search ends
    at `end`. The result is 2 if there is no crossing and -1 if rounding decides whether there is
    one. `combination` is the row of `tables` (`ModeTables`) for the present contacts, or SERIES.
    The arrays event_instant, contact_after and instant_rounding of `run` (`RunState`) are
    filled. Its array zero_order is k > 0 if a mesh starts on the flank line `start_line` and the
    distance has a zero of order k there; stays_clear tells whether a mesh provably reaches no flank
    line.
    """
    earliest, polynomial, b = _NO_EVENT, run.polynomial, run.search[0]
    for j in range(run.contact.shape[0]):
        run.event_instant[j], contact = _NO_EVENT, run.contact[j]
        if run.stays_clear[j] and run.zero_order[j] == 0:
            continue
        is_filled = False
        for line in (1, -1):
            if not _can_reach(constants, j, contact, line):
                continue
            polynomials, y = run.to_bernstein, run.distance_series[0, 0]
            offset, rounding = 0.0, 0.0
            if combination == SERIES:
                y = run.distance_series[(line + 1) // 2, j]
                # The entry after the coefficients scales the rounding error, see
                # `fill_distance_series`.
                rounding = _ROUNDING * y[polynomials.shape[0]]
            else:
                polynomials = tables.distance_polynomials[combination, (line + 1) // 2, j]
                y = run.modal_state
            if is_filled and constants.constant_gap[j] and combination != SERIES:
                offset = (
                    tables.constant_distance[combination, 0, j]
                    - tables.constant_distance[combination, 1, j]
                )
            else:
                fill_distance_polynomial(polynomials, y, polynomial)
            is_filled = True
            sign = _distance_sign(contact, line)
            if polynomial.shape[0] == LOW_DEGREE + 1:
                smallest = _fill_signed_distance(polynomial, offset, sign, b, LOW_DEGREE + 1)
            else:
                smallest = _fill_signed_distance(polynomial, offset, sign, b, HIGH_DEGREE + 1)
            zero_count = run.zero_order[j] if run.start_line[j] == line else 0
            if smallest > 0.0 and zero_count == 0:
                continue
            rounding += distance_rounding(polynomials, y)
            if (
                zero_count == 0
                and run.zero_order[j] > 1
                and not constants.has_backlash[j]
                and _falls_from_rest(b, run.zero_order[j], rounding)
            ):
                instant, instant_rounding = 0.0, 0.0
            else:
                instant, instant_rounding = first_bernstein_crossing(
                    run.search, zero_count, end, rounding
                )
            if instant < 0.0:
                return _UNCERTAIN_EVENT
            if instant < run.event_instant[j]:
                run.event_instant[j] = instant
                run.instant_rounding[j] = instant_rounding
                run.contact_after[j] = next_contact(contact, line)
        earliest = min(earliest, run.event_instant[j])
    return earliest
