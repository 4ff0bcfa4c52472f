"""Polynomials on [0, 1]: values, Bernstein form, first crossings and largest values."""

import math

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.interpolate import BPoly

from gearlib.engines import polynomial
from gearlib.engines.linear.distances import restrict_to_start

DEGREE = 20
MATRIX = polynomial.bernstein_matrix(DEGREE)
WORK = np.empty((polynomial.WORKSPACE_ROWS, DEGREE + 2))
POINTS = np.linspace(0.0, 1.0, 21)


def first_crossing(*coefficients):
    """Return the first downward crossing of a polynomial on (0, 1), given by its coefficients."""
    padded = np.append(np.array(coefficients, float), np.zeros(DEGREE + 1 - len(coefficients)))
    return polynomial.first_downward_crossing(padded, MATRIX, WORK)


@pytest.mark.parametrize("n", [1, 4, 7, 20])
def test_bernstein_coefficients_restrict_and_halve_a_polynomial(n):
    """Compare the values of restricted and halved polynomials with the original."""
    powers = np.random.default_rng(n).normal(size=n + 1)
    curve, b, left = Polynomial(powers), np.empty(n + 1), np.empty(n + 1)
    polynomial._convert_to_bernstein(powers, polynomial.bernstein_matrix(n), b)
    start, right = b.copy(), b.copy()
    restrict_to_start(start, 0.3, n)
    polynomial.split_in_half(right, left, np.empty(n + 1), n)
    for part, low, high in ((b, 0.0, 1.0), (start, 0.0, 0.3), (left, 0.0, 0.5), (right, 0.5, 1.0)):
        values = BPoly(part[:, None], [0.0, 1.0])(POINTS)
        np.testing.assert_allclose(values, curve(low + (high - low) * POINTS), atol=1e-12)
    expected = curve(0.3), curve.deriv()(0.3)
    assert polynomial.horner(powers, 0.3) == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("seed", range(2))
def test_the_first_of_many_roots_is_found(seed):
    """Multiply known roots in (0, 1) by a factor without roots there."""
    rng = np.random.default_rng(seed)
    for _ in range(1000):
        roots = np.sort(rng.uniform(0.0, 1.0, rng.integers(0, 6)))
        # The remaining factor has no root in [0, 1].
        other_factor = rng.normal(size=DEGREE - roots.size + 1) * 0.5 ** np.arange(
            DEGREE - roots.size + 1
        )
        other_factor[0] = 1.0 + np.abs(other_factor).sum()
        # The polynomial is positive below its smallest root.
        curve = math.prod(
            (Polynomial([root, -1.0]) for root in roots), start=Polynomial(other_factor)
        )
        distance = np.diff(np.append(roots, 2.0)).min() if roots.size else 1.0
        smallest_root = roots[0] if roots.size else 2.0
        # The closer other roots are, the more a root is moved by rounding of coefficients.
        tolerance = 1e-12 / distance ** max(1, roots.size - 1)
        assert abs(first_crossing(*curve.coef) - smallest_root) <= tolerance


def test_crossings_of_curves_that_touch_or_start_at_zero():
    """Check first downward zeros of polynomials, whose coefficients are in ascending order."""
    assert first_crossing(0.25, -1.0, 1.0) == 2.0
    assert first_crossing(0.0, 1.0, -2.0) == pytest.approx(0.5)
    assert first_crossing(0.0, 0.0, 1.0, -4.0) == pytest.approx(0.25)
    assert first_crossing(0.0, -1.0) == 0.0
    # A curve that starts below zero has to rise before it can fall through zero.
    assert first_crossing(-1.0, 3.0) == 2.0
    assert first_crossing(-1.0, 4.0, -3.2) == pytest.approx(0.625 + math.sqrt(0.078125))


def test_the_largest_value_may_lie_between_the_ends():
    """Compare maxima with values at the ends and at real roots of the derivative."""
    for values in np.random.default_rng(0).normal(size=(20, 6)):
        curve = Polynomial(values)
        stationary_points = [
            s.real for s in curve.deriv().roots() if abs(s.imag) < 1e-12 and 0 < s.real < 1
        ]
        largest_value = max(curve(s) for s in (0.0, 1.0, *stationary_points))
        coefficients = np.append(values, np.zeros(DEGREE - 5))
        for bound in (-math.inf, largest_value - 1e-3, largest_value + 1.0):
            maximum = polynomial.polynomial_maximum(coefficients, MATRIX, WORK, bound)
            assert maximum == pytest.approx(max(largest_value, bound), abs=1e-13)
        a, b, c = values[:3]
        lowest = Polynomial([a, b, c])(np.clip([0.0, 1.0, -b / (2.0 * c)], 0.0, 1.0)).min()
        assert polynomial.parabola_minimum(a, b, c) == pytest.approx(lowest, abs=1e-14)
