"""Check polynomials on [0, 1]: values, Bernstein form, first crossings and maxima."""

import math

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.interpolate import BPoly

from gearlib.engines import polynomial
from gearlib.engines.linear.distances import restrict_to_start

DEGREE = 20
BERNSTEIN_MATRIX = polynomial.bernstein_matrix(DEGREE)
WORKSPACE = np.empty((polynomial.WORKSPACE_ROWS, DEGREE + 2))
GRID = np.linspace(0.0, 1.0, 21)


def first_crossing(*coefficients):
    """Return where a polynomial first falls through zero in (0, 1), or 2 if it does not.

    Coefficients are in ascending order.
    """
    padded = np.append(np.array(coefficients, float), np.zeros(DEGREE + 1 - len(coefficients)))
    return polynomial.first_downward_crossing(padded, BERNSTEIN_MATRIX, WORKSPACE)


@pytest.mark.parametrize("n", [1, 4, 7, 20])
def test_bernstein_coefficients_restrict_and_halve_a_polynomial(n):
    """Restricted and halved polynomials of degree `n` must have the values of the original one."""
    coefficients = np.random.default_rng(n).normal(size=n + 1)
    original, whole = Polynomial(coefficients), np.empty(n + 1)
    polynomial._convert_to_bernstein(coefficients, polynomial.bernstein_matrix(n), whole)
    point = 0.3
    beginning = whole.copy()
    restrict_to_start(beginning, point, n)
    left_half, right_half = np.empty(n + 1), whole.copy()
    polynomial.split_in_half(right_half, left_half, np.empty(n + 1), n)
    for bernstein_coefficients, low, high in (
        (whole, 0.0, 1.0),
        (beginning, 0.0, point),
        (left_half, 0.0, 0.5),
        (right_half, 0.5, 1.0),
    ):
        values = BPoly(bernstein_coefficients[:, None], [0.0, 1.0])(GRID)
        np.testing.assert_allclose(values, original(low + (high - low) * GRID), atol=1e-12)
    value_and_derivative = original(point), original.deriv()(point)
    assert polynomial.horner(coefficients, point) == pytest.approx(value_and_derivative, rel=1e-13)


@pytest.mark.parametrize("seed", range(2))
def test_the_first_of_many_roots_is_found(seed):
    """The smallest of up to five known roots must be found in random polynomials of degree 20.

    A polynomial is the product of its roots' factors and a factor without roots in [0, 1].
    """
    rng = np.random.default_rng(seed)
    for _ in range(1000):
        roots = np.sort(rng.uniform(0.0, 1.0, rng.integers(0, 6)))
        coefficient_count = DEGREE - roots.size + 1
        # The constant coefficient is larger than the sum of all others, so that there is no root.
        coefficients = rng.normal(size=coefficient_count) * 0.5 ** np.arange(coefficient_count)
        coefficients[0] = 1.0 + np.abs(coefficients).sum()
        # The product is positive below its smallest root.
        root_factors = (Polynomial([root, -1.0]) for root in roots)
        curve = math.prod(root_factors, start=Polynomial(coefficients))
        smallest_root = roots[0] if roots.size else 2.0
        # Rounding of the coefficients shifts a root more if other roots are close to it.
        distance = np.diff(np.append(roots, 2.0)).min() if roots.size else 1.0
        tolerance = 1e-12 / distance ** max(1, roots.size - 1)
        assert abs(first_crossing(*curve.coef) - smallest_root) <= tolerance


def test_crossings_of_curves_that_touch_or_start_at_zero():
    """A curve that only touches zero has no crossing; one that starts at zero may fall at once."""
    assert first_crossing(0.25, -1.0, 1.0) == 2.0  # touches zero at 0.5
    # Curves that start at zero, rise and fall through zero.
    assert first_crossing(0.0, 1.0, -2.0) == pytest.approx(0.5)
    assert first_crossing(0.0, 0.0, 1.0, -4.0) == pytest.approx(0.25)
    assert first_crossing(0.0, -1.0) == 0.0  # falls from zero
    # A curve that starts below zero has to rise before it can fall through zero.
    assert first_crossing(-1.0, 3.0) == 2.0
    larger_root = 0.625 + math.sqrt(0.078125)
    assert first_crossing(-1.0, 4.0, -3.2) == pytest.approx(larger_root)


def test_the_largest_value_may_lie_between_the_ends():
    """The maximum must be the largest value at the ends and at the zeros of the derivative.

    If a larger bound is given, the result is this bound.
    """
    for values in np.random.default_rng(0).normal(size=(20, 6)):
        curve = Polynomial(values)
        stationary_points = [
            root.real
            for root in curve.deriv().roots()
            if abs(root.imag) < 1e-12 and 0 < root.real < 1
        ]
        largest_value = max(curve(point) for point in (0.0, 1.0, *stationary_points))
        coefficients = np.append(values, np.zeros(DEGREE - 5))
        for bound in (-math.inf, largest_value - 1e-3, largest_value + 1.0):
            maximum = polynomial.polynomial_maximum(
                coefficients, BERNSTEIN_MATRIX, WORKSPACE, bound
            )
            assert maximum == pytest.approx(max(largest_value, bound), abs=1e-13)
        # The minimum of the parabola a + b s + c s^2 is at an end or at its vertex.
        a, b, c = values[:3]
        candidates = np.clip([0.0, 1.0, -b / (2.0 * c)], 0.0, 1.0)
        minimum = Polynomial([a, b, c])(candidates).min()
        assert polynomial.parabola_minimum(a, b, c) == pytest.approx(minimum, abs=1e-14)
