"""First crossing of a polynomial on an interval, isolated in Bernstein form.

A polynomial on [0, 1] lies between its smallest and its largest Bernstein coefficient. So an
interval without a negative coefficient holds no crossing, one with falling coefficients and a
negative end holds exactly one, and any other is halved (de Casteljau). Nothing is sampled: a dip
below zero, however short, makes a coefficient negative. If an answer takes too many halvings, the
functions return that there is none.
"""

import math

import numpy as np

from gearlib.engines.jit import inlined_uncounted, kernel, uncounted

#: Largest number of halvings; the interval is then as short as rounding.
MAX_DEPTH = 48
#: Largest number of Newton steps. Every eighth halves the bracket, so that 60 halvings suffice.
MAX_NEWTON = 480
#: Largest number of Newton steps to a maximum, of which fewer than ten are usual.
_MAX_PEAK_STEPS = 60
#: Number of rows of the storage of a search: intervals to be searched and three polynomials.
WORK_ROWS = MAX_DEPTH + 4
#: Largest number of intervals in a search; ten nearly double roots take 140.
MAX_INTERVALS = 1000
#: Rounding of a polynomial, as a share of its coefficients.
_ROUNDING = 4e-16
#: Highest degree of a polynomial.
_MAX_DEGREE = 24
_DEGREES = range(_MAX_DEGREE + 1)
#: Binomial coefficients C(n, k), shape (25, 25).
BINOMIALS = np.array([[float(math.comb(n, k)) for k in _DEGREES] for n in _DEGREES])
#: Share of coefficient i in coefficient k of the left half, C(k, i) / 2^k, and of the right half
#: with columns in reverse order.
_LEFT = np.array([[math.comb(k, i) / 2.0**k for k in _DEGREES] for i in _DEGREES])
_RIGHT = np.ascontiguousarray(_LEFT[:, ::-1])
#: Tolerance of a largest value, as a share of the coefficients: a hundred times their rounding.
_VALUE_TOLERANCE = 4e-14
#: Tolerance of the place of a maximum, whose square is below rounding.
_PEAK_TOLERANCE = 1e-9


def bernstein_matrix(degree):
    """Return the matrix, shape (degree + 1, degree + 1), from power to Bernstein coefficients.

    Row i holds the shares of the i-th power coefficient in the Bernstein coefficients.
    """
    matrix = np.zeros((degree + 1, degree + 1))
    for j in range(degree + 1):
        for i in range(j + 1):
            matrix[i, j] = math.comb(j, i) / math.comb(degree, i)
    return matrix


@kernel
def horner(coefficients, s):
    """Return (value, derivative) at s of the polynomial with power coefficients, constant first."""
    value, slope = 0.0, 0.0
    for k in range(coefficients.shape[0] - 1, -1, -1):
        slope = slope * s + value
        value = value * s + coefficients[k]
    return value, slope


@kernel
def _to_bernstein(coefficients, matrix, out):
    """Fill `out` with the Bernstein coefficients of a polynomial with power `coefficients`."""
    out[: coefficients.shape[0]] = coefficients[0]
    for i in range(1, coefficients.shape[0]):
        c = coefficients[i]
        for j in range(i, coefficients.shape[0]):
            out[j] += matrix[i, j] * c


@inlined_uncounted
def halve(b, left, whole, n):
    """Replace Bernstein coefficients b of degree n by those of the right half; fill `left`.

    `left` gets those of the left half; `whole` is storage. Sums of columns are faster than de
    Casteljau's scheme, because the compiler turns them into vector instructions.
    """
    for k in range(n + 1):
        whole[k] = b[k]
        left[k], b[k] = 0.0, 0.0
    # With an index sum in place of this slice the compiler would check for negative indices.
    right = _RIGHT[:, _MAX_DEGREE - n :]
    i = 0
    while i + 3 <= n:
        p, q, s, t = whole[i], whole[i + 1], whole[i + 2], whole[i + 3]
        for k in range(i, n + 1):
            left[k] += (_LEFT[i, k] * p + _LEFT[i + 1, k] * q) + (
                _LEFT[i + 2, k] * s + _LEFT[i + 3, k] * t
            )
        for k in range(i + 4):
            b[k] += (right[n - i, k] * p + right[n - i - 1, k] * q) + (
                right[n - i - 2, k] * s + right[n - i - 3, k] * t
            )
        i += 4
    while i <= n:
        p = whole[i]
        for k in range(i, n + 1):
            left[k] += _LEFT[i, k] * p
        for k in range(i + 1):
            b[k] += right[n - i, k] * p
        i += 1
    left[n] = b[0]


@kernel
def lowest_of_parabola(a, b, c):
    """Return the smallest value of a + b s + c s^2 on [0, 1]."""
    lowest = min(a, a + b + c)
    if c > 0.0 and 0.0 < -b < 2.0 * c:
        lowest = a - 0.25 * b * b / c
    return lowest


@uncounted
def _root(b, n, s, p, q):
    """Return (root s, slope at s) of a polynomial with one sign change from plus to minus.

    b has the Bernstein coefficients of degree n, s the estimate of the root; p and q are storage.
    """
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
        # Both sums lack powers of the scale; the value lacks one more.
        new = s - value * scale / (n * rate) if rate < 0.0 else -1.0
        newton = low <= new <= high and step % 8 < 7
        if not newton:
            new = 0.5 * (low + high)
        moved = abs(new - s)
        s = new
        # Newton's method converges quadratically: the next step is estimated from the last two.
        if moved <= 2e-16 * high or (newton and moved * moved * moved < 1e-17 * high * last * last):
            break
        last = moved if newton else 0.0
    return s, n * rate * scale ** (n - 1)


@uncounted
def _sign_changes(b, n, noise):
    """Return (number of sign changes of Bernstein coefficients, estimate of the last root).

    The number is a bound of the number of roots. Coefficients within `noise` of zero are left out,
    except the first.
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
def first_fall_from(work, zeros, end, noise):
    """Return (first s in [0, end] where a polynomial falls through zero, its rounding).

    s is 2 if there is none, and -1 if the search takes too many intervals. The first row of `work`,
    shape (WORK_ROWS, n + 2), begins with the Bernstein coefficients; the first `zeros` power
    coefficients are zero: 1 on the line, 2 at rest on it. A dip below zero by `noise` counts as
    rounding. A polynomial has at most as many roots as its Bernstein coefficients have sign
    changes, and lies between the smallest and the largest. Intervals in which neither decides are
    halved.
    """
    last, b, rounding = work.shape[1] - 1, work[0], noise
    n = last - 1
    if not noise < math.inf:
        # The coefficients overflow; the status of the period will tell.
        return 2.0, 0.0
    # Factors s are divided out, so that the roots next to 0 stay above rounding.
    for _ in range(min(zeros, n - 2)):
        for i in range(n):
            b[i] = b[i + 1] * n / (i + 1)
        noise *= n
        n -= 1
    slope = n * (b[1] - b[0])
    if zeros == 0 and b[0] <= 0.0 and slope < -noise:
        return 0.0, 0.0
    if zeros > 0 and abs(b[0]) <= noise and slope < -noise:
        # The root is closer to 0 than rounding.
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
        changes, place = _sign_changes(b, n, noise)
        if changes == 1 and b[0] > 0.0:
            s, slope = _root(b, n, place, p, q)
            root = low + width * s
            if root > end:
                return 2.0, 0.0
            slope *= root**zeros / width
            return root, rounding / abs(slope) if slope != 0.0 else 0.0
        if (largest < 0.0 and b[n] >= b[0]) or (changes == 1 and b[n] > noise):
            # The polynomial starts below zero and rises.
            low += width
            depth -= 1
        elif depth == MAX_DEPTH:
            if b[n] < -noise and b[n] < b[0]:
                # It falls within this interval, which is as short as rounding.
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


@kernel
def first_fall(coefficients, to_bernstein, work):
    """Return the first s in [0, 1] where a polynomial falls through zero, 2 if there is none.

    s is -1 if the search takes too many intervals. `coefficients`, shape (n + 1,), are those of
    powers, constant first. A polynomial that starts at zero, or below it by rounding, falls at once
    if its slope is negative; otherwise it has to rise above zero first. `to_bernstein` is
    `bernstein_matrix` of degree n; `work` is storage of shape (WORK_ROWS, n + 2).
    """
    noise, other_slopes, end = 0.0, 0.0, 0.0
    for k in range(coefficients.shape[0]):
        end += coefficients[k]
        noise += abs(coefficients[k])
        other_slopes += k * abs(coefficients[k])
    noise *= _ROUNDING
    slope = coefficients[1]
    if coefficients[0] <= 0.0 and slope < -noise:
        return 0.0
    # It is monotonic and does not reach zero.
    other_slopes -= abs(slope)
    if slope > other_slopes or (slope < -other_slopes and end > noise):
        return 2.0
    zeros = 0
    while zeros < 2 and coefficients[zeros] == 0.0:
        zeros += 1
    if zeros > 0 and coefficients[zeros] < -noise:
        return 0.0
    _to_bernstein(coefficients, to_bernstein, work[0])
    return first_fall_from(work, zeros, 1.0, noise)[0]


@kernel
def highest(coefficients, to_bernstein, work, floor):
    """Return the largest value of a polynomial on [0, 1], or `floor` if that is larger.

    It is NaN if the search takes too many intervals. `coefficients` are those of powers, constant
    first; `to_bernstein` and `work` are as in `first_fall`.
    """
    variation = 0.0
    for k in range(1, coefficients.shape[0]):
        variation += abs(coefficients[k])
    if coefficients[0] + variation <= floor:
        return floor
    _to_bernstein(coefficients, to_bernstein, work[0])
    return highest_from(work, coefficients.shape[0] - 1, floor)


@uncounted
def _one_peak(b, n):
    """Return whether Bernstein coefficients rise, then fall: the polynomial has one maximum."""
    k = 1
    while k <= n and b[k] >= b[k - 1]:
        k += 1
    while k <= n and b[k] <= b[k - 1]:
        k += 1
    return k > n


@uncounted
def _peak(b, n):
    """Return the largest value on [0, 1] of a polynomial with one maximum, degree n >= 2."""
    s, low, high = 0.5, 0.0, 1.0
    for _ in range(_MAX_PEAK_STEPS):
        slope, bend, power, complement = 0.0, 0.0, 1.0, 1.0 - s
        for k in range(n - 1):
            rise, next_rise = b[k + 1] - b[k], b[k + 2] - b[k + 1]
            slope = slope * complement + power * (BINOMIALS[n - 1, k] * rise)
            bend = bend * complement + power * (BINOMIALS[n - 2, k] * (next_rise - rise))
            power *= s
        slope = slope * complement + power * (b[n] - b[n - 1])
        if slope > 0.0:
            low = s
        else:
            high = s
        new = s - slope / ((n - 1) * bend) if bend < 0.0 else -1.0
        if not low <= new <= high:
            new = 0.5 * (low + high)
        moved = abs(new - s)
        s = new
        if moved <= _PEAK_TOLERANCE:
            break
    value, power = 0.0, 1.0
    for k in range(n + 1):
        value = value * (1.0 - s) + power * (BINOMIALS[n, k] * b[k])
        power *= s
    return value


@uncounted
def highest_from(work, n, floor):
    """Return the largest value of a polynomial on [0, 1], or `floor` if that is larger.

    The first row of `work` begins with its Bernstein coefficients of degree n. Branch and bound: an
    interval is dropped if no coefficient exceeds the largest value so far.
    """
    size = 0.0
    for k in range(n + 1):
        size = max(size, abs(work[0, k]))
    noise, depth = _VALUE_TOLERANCE * size, 0
    for _ in range(MAX_INTERVALS):
        if depth < 0:
            return floor
        b = work[depth]
        floor = max(floor, b[0], b[n])
        bound = b[0]
        for j in range(1, n + 1):
            bound = max(bound, b[j])
        if bound <= floor + noise or depth == MAX_DEPTH:
            depth -= 1
            continue
        if n > 1 and _one_peak(b, n):
            floor = max(floor, _peak(b, n))
            depth -= 1
            continue
        halve(b, work[depth + 1], work[MAX_DEPTH + 1], n)
        depth += 1
    return floor if depth < 0 else math.nan
