"""Zeros of polynomials, isolated by their coefficients; in floats or numbers of mpmath."""

import functools
import math

import mpmath
import numpy as np


def product(a, b, k):
    """Return the k-th coefficient of the product of two series."""
    return sum(a[i] * b[k - i] for i in range(k + 1))


def value_at(curve, t):
    """Return a polynomial, or an array of them, at t."""
    total = curve[-1]
    for coefficient in curve[-2::-1]:
        total = total * t + coefficient
    return total


def slope_of(curve):
    return np.array([k * c for k, c in enumerate(curve)][1:], curve.dtype)


@functools.cache
def _binomials(count, kind):
    """Return (binomials, powers) of a polynomial about another place, shapes (count, count)."""
    rows = [[math.comb(j, k) for j in range(count)] for k in range(count)]
    rows = rows if kind is float else [[mpmath.mpf(n) for n in row] for row in rows]
    powers = [[max(j - k, 0) for j in range(count)] for k in range(count)]
    return np.array(rows, kind), np.array(powers)


def _powers(value, curve):
    if curve.dtype == float:
        return value ** np.arange(len(curve))
    return np.array([value**k for k in range(len(curve))], object)


def _judge(curve, low, half, margin):
    """Return whether a polynomial has no zero about the middle of a stretch, 0, or no turn, 1."""
    powers, middle = _powers(half, curve), low + half
    if low:
        rows, places = _binomials(len(curve), float if curve.dtype == float else object)
        local = (rows * _powers(middle, curve)[places]) @ curve
    else:
        # Seen from the start no zero is ruled out within the whole stretch.
        local, powers = curve, powers * 2 ** np.arange(len(curve))
    sizes = np.abs(local) * powers
    if margin:
        margin *= (np.abs(curve) * _powers(middle + half, curve)).sum()
    if sizes[0] > sizes[1:].sum() + margin:
        return 0
    turning = (np.arange(2, len(curve)) * sizes[2:]).sum()
    return 1 if sizes[1] > turning + len(curve) * margin else 2


def zeros(curve, low, high, least, floor=0, small=None, coarse=None):
    """Yield the zeros of a polynomial between two places, in order; double ones are left out.

    Stretches are judged in floats, as far as these can tell; what stays below `floor` is rounding.
    """
    half = (high - low) / 2
    if not half > least:
        return
    if small is None and (np.abs(curve) * _powers(high, curve)).sum() <= floor:
        return
    if small is None:
        small, coarse = curve.astype(float), 1e-6 * half if curve.dtype == object else least
    if half > coarse:
        verdict = _judge(small, float(low), float(half), 1e-13 if curve.dtype == object else 0.0)
    else:
        verdict = _judge(curve, low, half, 0)
    if verdict == 1:
        ends = value_at(curve, low), value_at(curve, high)
        if (ends[0] > 0) != (ends[1] > 0):
            yield _polished(curve, low, high, ends[1] > 0)
    elif verdict:
        yield from zeros(curve, low, low + half, least, floor, small, coarse)
        yield from zeros(curve, low + half, high, least, floor, small, coarse)


def _polished(curve, low, high, rises):
    """Return the one zero between two places, by Newton's method kept inside."""
    slope, t, width = slope_of(curve), (low + high) / 2, high - low
    if curve.dtype == object:
        ends = float(low), float(high)
        t = mpmath.mpf(min(max(_polished(curve.astype(float), *ends, rises), ends[0]), ends[1]))
    close = width * (mpmath.mpf(10) ** (2 - mpmath.mp.dps) if curve.dtype == object else 3e-16)
    for _ in range(200):
        value = value_at(curve, t)
        if not value:
            return t
        low, high = (low, t) if (value > 0) == rises else (t, high)
        rate = value_at(slope, t)
        new = t - value / rate if rate else low
        if not low <= new <= high:
            new = (low + high) / 2
        if abs(new - t) <= close:
            return new
        t = new
    return t
