"""First zero crossing and maximum of a polynomial on [0, 1], isolated in Bernstein form.

A polynomial on [0, 1] lies between its smallest and its largest Bernstein coefficient. An interval
without a negative coefficient therefore has no crossing, and an interval whose coefficients change
sign once, from plus to minus, has exactly one. All other intervals are halved (de Casteljau). The
polynomial is not sampled: any dip below zero, however short, has a negative coefficient. The
functions report a search that needs too many halvings.
"""

import functools
import math

import numpy as np

from gearlib.engines.jit import kernel_part

#: Largest number of halvings; the interval is then as short as rounding.
MAX_DEPTH = 48
#: Largest number of Newton steps to a root. Every eighth step halves the bracket, and 60 halvings
#: suffice.
MAX_NEWTON_STEPS = 480
#: Largest number of Newton steps to a maximum, which usually needs fewer than ten.
_MAX_PEAK_STEPS = 60
#: Number of rows of the workspace of a search: intervals to be searched and three polynomials.
WORKSPACE_ROWS = MAX_DEPTH + 4
#: Largest number of intervals in a search. Ten nearly double roots take 140.
MAX_INTERVALS = 1000
#: Rounding error of a polynomial, relative to its coefficients.
_ROUNDING = 4e-16
#: Highest degree of a polynomial.
_MAX_DEGREE = 24
_DEGREES = range(_MAX_DEGREE + 1)
#: Binomial coefficients C(n, k), shape (25, 25).
BINOMIALS = np.array([[float(math.comb(n, k)) for k in _DEGREES] for n in _DEGREES])
#: Entry (i, k) is the weight C(k, i) / 2^k of coefficient i in coefficient k of the left half. The
#: right half has the same weights with columns in reverse order.
_LEFT_WEIGHTS = np.array([[math.comb(k, i) / 2.0**k for k in _DEGREES] for i in _DEGREES])
_RIGHT_WEIGHTS = np.ascontiguousarray(_LEFT_WEIGHTS[:, ::-1])
#: Tolerance of a maximum, relative to the coefficients: a hundred times their rounding error.
_VALUE_TOLERANCE = 4e-14
#: Tolerance of the location of a maximum. Its square, the error of the value, is below rounding.
_PEAK_LOCATION_TOLERANCE = 1e-9


@functools.cache
def bernstein_matrix(degree: int) -> np.ndarray:
    """Return the matrix that converts power coefficients to Bernstein coefficients on [0, 1].

    Its shape is (degree + 1, degree + 1). Row i holds the weights of power coefficient i in all
    Bernstein coefficients. Later calls return the same array, which must not be changed.
    """
    matrix = np.zeros((degree + 1, degree + 1))
    for j in range(degree + 1):
        for i in range(j + 1):
            matrix[i, j] = math.comb(j, i) / math.comb(degree, i)
    return matrix


@kernel_part
def horner(coefficients: np.ndarray, s: float) -> tuple:
    """Return (value, derivative) of a polynomial at s by Horner's scheme.

    `coefficients` are the power coefficients, constant first.
    """
    value, slope = 0.0, 0.0
    for k in range(coefficients.shape[0] - 1, -1, -1):
        slope = slope * s + value
        value = value * s + coefficients[k]
    return value, slope


@kernel_part
def _convert_to_bernstein(
    coefficients: np.ndarray, matrix: np.ndarray, bernstein: np.ndarray
) -> None:
    """Fill the first n + 1 entries of `bernstein` with the Bernstein coefficients of a polynomial.

    `coefficients` are its n + 1 power coefficients, constant first, and `matrix` is the
    `bernstein_matrix` of degree n.
    """
    bernstein[: coefficients.shape[0]] = coefficients[0]
    for i in range(1, coefficients.shape[0]):
        for j in range(i, coefficients.shape[0]):
            bernstein[j] += matrix[i, j] * coefficients[i]


@kernel_part(refcounts=False, inlined=True)
def split_in_half(b: np.ndarray, left: np.ndarray, storage: np.ndarray, n: int) -> None:
    """Split a polynomial in Bernstein form at the middle of its interval.

    b holds the n + 1 Bernstein coefficients on the whole interval; they are replaced by the
    coefficients on the right half, and `left` is filled with the coefficients on the left half.
    `storage` is overwritten. Weighted sums are faster than de Casteljau's algorithm, because the
    compiler turns them into vector instructions.
    """
    for k in range(n + 1):
        storage[k] = b[k]
        left[k], b[k] = 0.0, 0.0
    # This slice avoids index sums, for which the compiler would check for negative indices.
    right_weights = _RIGHT_WEIGHTS[:, _MAX_DEGREE - n :]
    i = 0
    # Add four coefficients at a time, then the remaining ones.
    while i + 3 <= n:
        b0, b1, b2, b3 = storage[i], storage[i + 1], storage[i + 2], storage[i + 3]
        for k in range(i, n + 1):
            left[k] += (_LEFT_WEIGHTS[i, k] * b0 + _LEFT_WEIGHTS[i + 1, k] * b1) + (
                _LEFT_WEIGHTS[i + 2, k] * b2 + _LEFT_WEIGHTS[i + 3, k] * b3
            )
        for k in range(i + 4):
            b[k] += (right_weights[n - i, k] * b0 + right_weights[n - i - 1, k] * b1) + (
                right_weights[n - i - 2, k] * b2 + right_weights[n - i - 3, k] * b3
            )
        i += 4
    while i <= n:
        for k in range(i, n + 1):
            left[k] += _LEFT_WEIGHTS[i, k] * storage[i]
        for k in range(i + 1):
            b[k] += right_weights[n - i, k] * storage[i]
        i += 1
    left[n] = b[0]


@kernel_part
def parabola_minimum(a: float, b: float, c: float) -> float:
    """Return the smallest value of the parabola a + b s + c s^2 for s in [0, 1]."""
    min_value = min(a, a + b + c)
    # The vertex, at s = -b / (2 c), lies inside the interval.
    if c > 0.0 and 0.0 < -b < 2.0 * c:
        min_value = a - 0.25 * b * b / c
    return min_value


@kernel_part(refcounts=False)
def _find_root(b, n, s, value_terms, slope_terms):
    """Return (root s, slope at s) of a polynomial that falls through zero once on [0, 1].

    b holds its Bernstein coefficients of degree n, and the argument s is an estimate of the root.
    Newton's method is safeguarded by bisection. `value_terms` and `slope_terms`, shape (n + 1,) or
    longer, are overwritten with the Bernstein coefficients of the polynomial and of its derivative,
    multiplied by binomial coefficients.
    """
    for i in range(n + 1):
        value_terms[i] = BINOMIALS[n, i] * b[i]
    for i in range(n):
        slope_terms[i] = BINOMIALS[n - 1, i] * (b[i + 1] - b[i])
    lower, upper, derivative, scale, last_step = 0.0, 1.0, 0.0, 1.0, 0.0
    for step_count in range(MAX_NEWTON_STEPS):
        derivative = 0.0
        # Horner's scheme in s / (1 - s) or its inverse, whichever is at most 1.
        if s <= 0.5:
            ratio, scale = s / (1.0 - s), 1.0 - s
            value = value_terms[n]
            for i in range(n - 1, -1, -1):
                value = value * ratio + value_terms[i]
                derivative = derivative * ratio + slope_terms[i]
        else:
            ratio, scale = (1.0 - s) / s, s
            value = value_terms[0]
            for i in range(1, n + 1):
                value = value * ratio + value_terms[i]
                derivative = derivative * ratio + slope_terms[i - 1]
        if value > 0.0:
            lower = s
        else:
            upper = s
        # The sums are the value / scale^n and the derivative / (n scale^(n - 1)).
        new_s = s - value * scale / (n * derivative) if derivative < 0.0 else -1.0
        # Every eighth step bisects the bracket, so the method always ends.
        is_newton = lower <= new_s <= upper and step_count % 8 < 7
        if not is_newton:
            new_s = 0.5 * (lower + upper)
        step = abs(new_s - s)
        s = new_s
        # Newton's method converges quadratically, so two steps predict the next one.
        if step <= 2e-16 * upper:
            break
        if is_newton and step * step * step < 1e-17 * upper * last_step * last_step:
            break
        last_step = step if is_newton else 0.0
    return s, n * derivative * scale ** (n - 1)


@kernel_part(refcounts=False)
def _count_sign_changes(b, n, tolerance):
    """Return (number of sign changes of Bernstein coefficients, estimate of the last root).

    b holds the coefficients of degree n. The polynomial has at most as many roots in [0, 1] as
    there are sign changes. Coefficients within `tolerance` of zero are ignored, except the first
    one. The estimate is the zero of the linear interpolation between two coefficients.
    """
    count, root_estimate = 0, 0.0
    last_value, last_index = b[0], 0
    for i in range(1, n + 1):
        if abs(b[i]) > tolerance:
            if last_value * b[i] < 0.0:
                count += 1
                offset = (i - last_index) * last_value / (last_value - b[i])
                root_estimate = (last_index + offset) / n
            last_value, last_index = b[i], i
    return count, root_estimate


@kernel_part(refcounts=False)
def first_bernstein_crossing(workspace, zero_count, end, value_error):
    """Return (first s in [0, end] where a polynomial falls through zero, rounding error of s).

    s is 2 if there is no such s, and -1 if the search needs too many intervals. The first row of
    `workspace`, shape (WORKSPACE_ROWS, n + 2), starts with the Bernstein coefficients. The first
    `zero_count` power coefficients are exactly 0: one if the motion starts on a flank line, two if
    it rests there. A dip below zero by `value_error` counts as rounding. Intervals are halved until
    the signs or sign changes of their Bernstein coefficients are decisive.
    """
    last, b, tolerance = workspace.shape[1] - 1, workspace[0], value_error
    n = last - 1
    if not tolerance < math.inf:
        # The status of the run reports this overflow later.
        return 2.0, 0.0
    # Divide out factors s, so that roots near 0 stay above rounding.
    for _ in range(min(zero_count, n - 2)):
        for i in range(n):
            b[i] = b[i + 1] * n / (i + 1)
        tolerance *= n
        n -= 1
    slope = n * (b[1] - b[0])
    if zero_count == 0 and b[0] <= 0.0 and slope < -tolerance:
        return 0.0, 0.0
    if zero_count > 0 and abs(b[0]) <= tolerance and slope < -tolerance:
        # The root differs from 0 by less than rounding.
        return max(-b[0] / slope, 0.0), 0.0
    value_terms, slope_terms = workspace[MAX_DEPTH + 2], workspace[MAX_DEPTH + 3]
    depth, start = 0, 0.0
    b[last] = 1.0
    for _ in range(MAX_INTERVALS):
        if depth < 0 or start > end:
            return 2.0, 0.0
        b = workspace[depth]
        width = b[last]
        smallest, largest = b[0], b[0]
        for j in range(1, n + 1):
            smallest, largest = min(smallest, b[j]), max(largest, b[j])
        if smallest >= -tolerance:
            start += width
            depth -= 1
            continue
        changes, estimate = _count_sign_changes(b, n, tolerance)
        if changes == 1 and b[0] > 0.0:
            s, slope = _find_root(b, n, estimate, value_terms, slope_terms)
            root = start + width * s
            if root > end:
                return 2.0, 0.0
            slope *= root**zero_count / width
            return root, value_error / abs(slope) if slope != 0.0 else 0.0
        if (largest < 0.0 and b[n] >= b[0]) or (changes == 1 and b[n] > tolerance):
            # The polynomial starts below zero and rises.
            start += width
            depth -= 1
        elif depth == MAX_DEPTH:
            if b[n] < -tolerance and b[n] < b[0]:
                # The polynomial falls within this interval, which is as short as rounding.
                return start, 0.0
            start += width
            depth -= 1
        else:
            # This row keeps the right half. The left half in the next row is searched first.
            left = workspace[depth + 1]
            split_in_half(b, left, workspace[MAX_DEPTH + 1], n)
            b[last] = 0.5 * width
            left[last] = 0.5 * width
            depth += 1
    return (2.0 if depth < 0 else -1.0), 0.0


@kernel_part(merged=True)
def first_downward_crossing(
    coefficients: np.ndarray, to_bernstein: np.ndarray, workspace: np.ndarray
) -> float:
    """Return the first s in [0, 1] where a polynomial falls through zero, or 2 if there is none.

    s is -1 if the search needs too many intervals. `coefficients` are n + 1 power coefficients,
    constant first. If the polynomial starts at zero, or below it by rounding, it falls at once if
    its slope is negative; otherwise it has to rise above zero first. `to_bernstein` is the
    `bernstein_matrix` of degree n; `workspace`, shape (WORKSPACE_ROWS, n + 2), is overwritten.
    """
    value_error, other_slopes, end = 0.0, 0.0, 0.0
    for k in range(coefficients.shape[0]):
        end += coefficients[k]
        value_error += abs(coefficients[k])
        other_slopes += k * abs(coefficients[k])
    value_error *= _ROUNDING
    slope = coefficients[1]
    if coefficients[0] <= 0.0 and slope < -value_error:
        return 0.0
    # If the linear term dominates, the polynomial is monotonic, and its end decides.
    other_slopes -= abs(slope)
    if slope > other_slopes or (slope < -other_slopes and end > value_error):
        return 2.0
    zero_count = 0
    while zero_count < 2 and coefficients[zero_count] == 0.0:
        zero_count += 1
    if zero_count > 0 and coefficients[zero_count] < -value_error:
        return 0.0
    _convert_to_bernstein(coefficients, to_bernstein, workspace[0])
    return first_bernstein_crossing(workspace, zero_count, 1.0, value_error)[0]


@kernel_part(merged=True)
def polynomial_maximum(coefficients, to_bernstein, workspace, lower_bound):
    """Return the largest value of a polynomial on [0, 1], or `lower_bound` if that is larger.

    The result is NaN if the search needs too many intervals. `coefficients` are n + 1 power
    coefficients, constant first. `to_bernstein` is the `bernstein_matrix` of degree n; `workspace`,
    shape (WORKSPACE_ROWS, n + 2), is overwritten.
    """
    variation = 0.0
    for k in range(1, coefficients.shape[0]):
        variation += abs(coefficients[k])
    if coefficients[0] + variation <= lower_bound:
        return lower_bound
    _convert_to_bernstein(coefficients, to_bernstein, workspace[0])
    return bernstein_maximum(workspace, coefficients.shape[0] - 1, lower_bound)


@kernel_part(refcounts=False)
def _has_one_peak(b: np.ndarray, n: int) -> bool:
    """Return whether a polynomial provably has at most one local maximum inside [0, 1].

    This is the case if its Bernstein coefficients b, of degree n, first rise and then fall, because
    the polynomial does not oscillate more than its coefficients.
    """
    k = 1
    while k <= n and b[k] >= b[k - 1]:
        k += 1
    while k <= n and b[k] <= b[k - 1]:
        k += 1
    return k > n


@kernel_part(refcounts=False)
def _peak_value(b: np.ndarray, n: int) -> float:
    """Return the maximum on [0, 1] of a polynomial with a single local maximum.

    b holds its Bernstein coefficients of degree n >= 2. Newton's method, safeguarded by bisection,
    searches for the zero of the derivative.
    """
    s, lower, upper = 0.5, 0.0, 1.0
    for _ in range(_MAX_PEAK_STEPS):
        slope, curvature, power, complement = 0.0, 0.0, 1.0, 1.0 - s
        for k in range(n - 1):
            rise, next_rise = b[k + 1] - b[k], b[k + 2] - b[k + 1]
            slope = slope * complement + power * (BINOMIALS[n - 1, k] * rise)
            curvature = curvature * complement + power * (BINOMIALS[n - 2, k] * (next_rise - rise))
            power *= s
        slope = slope * complement + power * (b[n] - b[n - 1])
        if slope > 0.0:
            lower = s
        else:
            upper = s
        new_s = s - slope / ((n - 1) * curvature) if curvature < 0.0 else -1.0
        if not lower <= new_s <= upper:
            new_s = 0.5 * (lower + upper)
        step = abs(new_s - s)
        s = new_s
        if step <= _PEAK_LOCATION_TOLERANCE:
            break
    value, power = 0.0, 1.0
    for k in range(n + 1):
        value = value * (1.0 - s) + power * (BINOMIALS[n, k] * b[k])
        power *= s
    return value


@kernel_part(refcounts=False)
def bernstein_maximum(workspace: np.ndarray, n: int, lower_bound: float) -> float:
    """Return the largest value of a polynomial on [0, 1], or `lower_bound` if that is larger.

    The first row of `workspace`, shape (WORKSPACE_ROWS, n + 2), starts with the Bernstein
    coefficients of degree n; the other rows are overwritten. Intervals are halved and dropped if no
    coefficient, hence no value, exceeds the largest value found so far (branch and bound). The
    result is NaN if the search needs too many intervals.
    """
    largest_magnitude = 0.0
    for k in range(n + 1):
        largest_magnitude = max(largest_magnitude, abs(workspace[0, k]))
    tolerance, depth = _VALUE_TOLERANCE * largest_magnitude, 0
    for _ in range(MAX_INTERVALS):
        if depth < 0:
            return lower_bound
        b = workspace[depth]
        lower_bound = max(lower_bound, b[0], b[n])
        upper_bound = b[0]
        for j in range(1, n + 1):
            upper_bound = max(upper_bound, b[j])
        if upper_bound <= lower_bound + tolerance or depth == MAX_DEPTH:
            depth -= 1
            continue
        if n > 1 and _has_one_peak(b, n):
            lower_bound = max(lower_bound, _peak_value(b, n))
            depth -= 1
            continue
        split_in_half(b, workspace[depth + 1], workspace[MAX_DEPTH + 1], n)
        depth += 1
    return lower_bound if depth < 0 else math.nan
