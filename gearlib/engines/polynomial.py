"""First crossing of a polynomial on an interval, isolated in Bernstein form.

A polynomial on [0, 1] lies between its smallest and its largest Bernstein coefficient. So an
interval without a negative coefficient holds no crossing, one with falling coefficients and a
negative end holds exactly one, and any other is halved (de Casteljau). Nothing is sampled: a dip
below zero, however short, makes a coefficient negative. What would take too many halvings is not
guessed: the answer is then that there is none.
"""

import math

import numpy as np

from gearlib.engines.jit import inlined, kernel, uncounted, woven

#: Halvings after which an interval is as short as rounding.
MAX_DEPTH = 48
#: Steps of Newton's method, of which every eighth halves the bracket: 60 halvings leave nothing.
MAX_NEWTON = 480
#: Steps from a start so close that none has ever needed ten.
_FEW_NEWTON = 60
#: Intervals looked at; polynomials with up to ten nearly double roots take 140.
MAX_INTERVALS = 1000
#: A dip smaller than this share of the coefficients cannot be told from their rounding.
_ROUNDING = 4e-16
#: Highest degree, and what coefficient i adds to coefficient k of the left half, C(k, i) / 2^k, and
#: of the right half, counted from the end, whose columns go backwards.
_MOST = 24
#: Binomials of all degrees up to it.
BINOMIALS = np.array([[float(math.comb(n, k)) for k in range(_MOST + 1)] for n in range(_MOST + 1)])
_LEFT = np.array([[math.comb(k, i) / 2.0**k for k in range(_MOST + 1)] for i in range(_MOST + 1)])
_RIGHT = np.ascontiguousarray(_LEFT[:, ::-1])
#: Largest values are sought to this share of the coefficients, a hundred roundings.
_CLOSE = 4e-14
#: Distance from a maximum whose square is nothing.
_NEAR = 1e-9


def bernstein_matrix(degree):
    """Return the matrix, shape (degree + 1, degree + 1), from power to Bernstein coefficients.

    Row i holds what the i-th power coefficient adds to the Bernstein coefficients.
    """
    matrix = np.zeros((degree + 1, degree + 1))
    for j in range(degree + 1):
        for i in range(j + 1):
            matrix[i, j] = math.comb(j, i) / math.comb(degree, i)
    return matrix


@kernel
def horner(coefficients, s):
    """Return the value and the derivative at s of the polynomial with power `coefficients`."""
    value, slope = 0.0, 0.0
    for k in range(coefficients.shape[0] - 1, -1, -1):
        slope = slope * s + value
        value = value * s + coefficients[k]
    return value, slope


@kernel
def _to_bernstein(coefficients, matrix, out):
    """Fill `out` with the Bernstein coefficients of a polynomial."""
    out[: coefficients.shape[0]] = coefficients[0]
    for i in range(1, coefficients.shape[0]):
        c = coefficients[i]
        for j in range(i, coefficients.shape[0]):
            out[j] += matrix[i, j] * c


@woven
def halve(b, left, whole, n):
    """Turn Bernstein coefficients into those of the right half; fill those of the left.

    Sums of columns, which the compiler does with all lanes of the vector unit; de Casteljau's
    scheme waits for its own results. `whole` is storage.
    """
    for k in range(n + 1):
        whole[k] = b[k]
        left[k], b[k] = 0.0, 0.0
    # A slice: the compiler does not know that a sum of two indices counts from the front.
    right = _RIGHT[:, _MOST - n :]
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
def _bracketed_root(coefficients, low, high):
    """Return the root on [low, high] of a polynomial that falls through zero once there."""
    s = 0.5 * (low + high)
    for step in range(MAX_NEWTON):
        value, slope = horner(coefficients, s)
        if value > 0.0:
            low = s
        else:
            high = s
        new = s - value / slope if slope < 0.0 else low
        if not low < new < high or step % 8 == 7:
            new = 0.5 * (low + high)
        moved = abs(new - s)
        s = new
        if moved <= 2e-16 * high:
            break
    return s


@kernel
def lowest_of_parabola(a, b, c):
    """Return the smallest value of a + b s + c s^2 on [0, 1]."""
    lowest = min(a, a + b + c)
    if c > 0.0 and 0.0 < -b < 2.0 * c:
        lowest = a - 0.25 * b * b / c
    return lowest


@kernel
def first_fall(coefficients, to_bernstein, work):
    """Return the first s in [0, 1] where a polynomial falls through zero, 2 if there is none.

    -1 if the budget of intervals does not suffice to tell. `coefficients`, shape (n + 1,), constant
    first, may be changed. From zero, or below it by the rounding of whoever starts there, the
    polynomial counts as falling at once when its slope is negative; else what counts is where it
    falls after it has come up. `to_bernstein`: `bernstein_matrix` of degree n; `work`, shape (50, n
    + 2): a row per waiting interval, its Bernstein coefficients and its width.
    """
    n = coefficients.shape[0] - 1
    noise = 0.0
    for k in range(n + 1):
        noise += abs(coefficients[k])
    noise *= _ROUNDING
    if not noise < math.inf:
        # Beyond the range of numbers: so is the end of the step, whose status says so.
        return 2.0
    if coefficients[0] <= 0.0 and coefficients[1] < -noise:
        return 0.0
    # From a start on the line a factor s is divided out, and another from a start at rest: beside
    # that root the next one could not be told from rounding.
    for _ in range(2):
        if coefficients[0] == 0.0:
            for k in range(n):
                coefficients[k] = coefficients[k + 1]
            coefficients[n] = 0.0
            if abs(coefficients[0]) <= noise and coefficients[1] < -noise:
                # Its root is closer than rounding can place it.
                return max(-coefficients[0] / coefficients[1], 0.0)
    # Most steps are far from the line.
    tail = 0.0
    for k in range(3, n + 1):
        tail += abs(coefficients[k])
    if lowest_of_parabola(coefficients[0], coefficients[1], coefficients[2]) > tail:
        return 2.0
    _to_bernstein(coefficients, to_bernstein, work[0])
    depth = 0  # rows 0 ... depth of `work` hold the intervals still to be looked at
    low = 0.0
    work[0, n + 1] = 1.0
    for _ in range(MAX_INTERVALS):
        if depth < 0:
            return 2.0
        b = work[depth]
        width = b[n + 1]
        smallest, largest, falling = b[0], b[0], True
        for j in range(1, n + 1):
            smallest, largest = min(smallest, b[j]), max(largest, b[j])
            if b[j] > b[j - 1]:
                falling = False
        if smallest >= -noise:
            low += width
            depth -= 1
        elif falling and b[n] < -noise:
            return _bracketed_root(coefficients, low, low + width)
        elif largest < 0.0 and b[n] >= b[0]:
            # Below from the start, and coming up.
            low += width
            depth -= 1
        elif depth == MAX_DEPTH:
            if b[n] < -noise and b[n] < b[0]:
                # Rounding hides how it falls, not that it does.
                return low
            low += width
            depth -= 1
        else:
            # The right half stays in this row, the left half goes on top.
            left = work[depth + 1]
            halve(b, left, work[MAX_DEPTH + 1], n)
            b[n + 1] = 0.5 * width
            left[n + 1] = 0.5 * width
            depth += 1
    return 2.0 if depth < 0 else -1.0


@inlined
def _value_and_slope(c, first, top, s):
    """Return sum c_k s^(k - first) from `first` to `top` and its derivative.

    Even and odd powers apart: two short chains of operations instead of a long one.
    """
    square = s * s
    even, odd, even_slope, odd_slope = 0.0, 0.0, 0.0, 0.0
    last = top - (top - first) % 2
    if last < top:
        odd = c[top]
    for k in range(last, first, -2):
        even_slope = even_slope * square + even
        odd_slope = odd_slope * square + odd
        even = even * square + c[k]
        odd = odd * square + c[k - 1]
    even_slope = even_slope * square + even
    even = even * square + c[first]
    return even + s * odd, odd + 2.0 * s * (even_slope + s * odd_slope)


@kernel
def fall_by_shape(coefficients, first):
    """Return where a polynomial falls through zero, 2 if it does not, -1 where this cannot tell.

    A polynomial that falls all along, or is bent one way all along, has at most one crossing
    between ends of opposite signs and, when it is not bent upwards, none between positive ones.
    Slope and bend are bounded by their parabolas and the magnitudes of all higher terms.
    `coefficients` as of `first_fall`, n >= 4; `first` is 1 to divide a factor s out (the start is
    on the line).
    """
    c, n = coefficients, coefficients.shape[0] - 1
    end, size, steep, bend = 0.0, 0.0, 0.0, 0.0
    slope_sum, slope_tail, bend_tail = 0.0, 0.0, 0.0
    for k in range(n, first - 1, -1):
        j = k - first
        value, large = c[k], abs(c[k])
        end += value
        size += large
        steep += j * value
        bend += (j * (j - 1)) * large
        slope_sum += j * large
        if j == 5:
            bend_tail = bend
        if j == 4:
            slope_tail = slope_sum
    noise = _ROUNDING * size
    c0, c1, c2, c3, c4 = c[first], c[first + 1], c[first + 2], c[first + 3], c[first + 4]
    if c0 <= noise or abs(end) <= noise:
        return -1.0
    falls = -lowest_of_parabola(-c1, -2.0 * c2, -3.0 * c3) + slope_tail < -noise
    if not falls:
        up = lowest_of_parabola(2.0 * c2, 6.0 * c3, 12.0 * c4) > bend_tail + noise
        if not up and lowest_of_parabola(-2.0 * c2, -6.0 * c3, -12.0 * c4) <= bend_tail + noise:
            return -1.0
        if up and end > 0.0 and c1 < noise and steep > -noise:
            return -1.0
    if end > 0.0:
        return 2.0
    # Newton's method from the parabola through value and slope at 0 and the value at 1.
    top = n
    while top > first + 4 and abs(c[top]) <= 1e-19 * size:
        top -= 1
    a = end - c0 - c1
    s = 2.0 * c0 / (math.sqrt(c1 * c1 - 4.0 * a * c0) - c1)
    # The first steps need few terms.
    for _ in range(3):
        value, slope = _value_and_slope(c, first, min(top, first + 7), s)
        if not 0.0 < s - value / slope < 1.0:
            break
        s -= value / slope
    low, high = 0.0, 1.0
    for _ in range(_FEW_NEWTON):
        value, slope = _value_and_slope(c, first, top, s)
        if value > 0.0:
            low = s
        else:
            high = s
        new = s - value / slope if slope < 0.0 else -1.0
        if low <= new <= high:
            # What a step of Newton's method leaves: its square times the bend.
            moved = abs(new - s)
            if moved <= 2e-16 * high or bend * moved * moved <= -1e-17 * slope * new:
                return new
        else:
            new = 0.5 * (low + high)
        s = new
    return -1.0


@kernel
def highest(coefficients, to_bernstein, work, floor):
    """Return the largest value of a polynomial on [0, 1], or `floor` if that is larger.

    NaN if the budget of intervals does not suffice. Arguments as of `first_fall`.
    """
    reach = 0.0
    for k in range(1, coefficients.shape[0]):
        reach += abs(coefficients[k])
    if coefficients[0] + reach <= floor:
        return floor
    _to_bernstein(coefficients, to_bernstein, work[0])
    return highest_from(work, coefficients.shape[0] - 1, floor)


@uncounted
def _one_peak(b, n):
    """Return whether Bernstein coefficients rise, then fall: their polynomial has one maximum."""
    k = 1
    while k <= n and b[k] >= b[k - 1]:
        k += 1
    while k <= n and b[k] <= b[k - 1]:
        k += 1
    return k > n


@uncounted
def _peak(b, n):
    """Return the largest value of such a polynomial, n >= 2, on [0, 1]."""
    s, low, high = 0.5, 0.0, 1.0
    for _ in range(_FEW_NEWTON):
        slope, bend, power, rest = 0.0, 0.0, 1.0, 1.0 - s
        for k in range(n - 1):
            rise, next_rise = b[k + 1] - b[k], b[k + 2] - b[k + 1]
            slope = slope * rest + power * (BINOMIALS[n - 1, k] * rise)
            bend = bend * rest + power * (BINOMIALS[n - 2, k] * (next_rise - rise))
            power *= s
        slope = slope * rest + power * (b[n] - b[n - 1])
        if slope > 0.0:
            low = s
        else:
            high = s
        new = s - slope / ((n - 1) * bend) if bend < 0.0 else -1.0
        if not low <= new <= high:
            new = 0.5 * (low + high)
        moved = abs(new - s)
        s = new
        if moved <= _NEAR:
            break
    value, power = 0.0, 1.0
    for k in range(n + 1):
        value = value * (1.0 - s) + power * (BINOMIALS[n, k] * b[k])
        power *= s
    return value


@uncounted
def highest_from(work, n, floor):
    """Return the same of Bernstein coefficients of degree n, which begin the first row of `work`.

    Branch and bound: an interval is dropped when no coefficient lies above the best value so far.
    """
    size = 0.0
    for k in range(n + 1):
        size = max(size, abs(work[0, k]))
    noise, depth = _CLOSE * size, 0
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
