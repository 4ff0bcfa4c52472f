"""Polynomials on [0, 1]: values, Bernstein form, first crossings and largest values."""

import math

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.interpolate import BPoly

from gearlib.engines import polynomial
from gearlib.engines.exponential import exponential
from gearlib.engines.linear.distances import restrict_to_start

DEGREE = 20
MATRIX = polynomial.bernstein_matrix(DEGREE)
WORK = np.empty((polynomial.WORK_ROWS, DEGREE + 2))
POINTS = np.linspace(0.0, 1.0, 21)


def in_bernstein_form(coefficients):
    """Return the function on [0, 1] with these Bernstein coefficients."""
    return BPoly(np.asarray(coefficients)[:, None], [0.0, 1.0])


def first_crossing(*coefficients):
    padded = np.append(np.array(coefficients, float), np.zeros(DEGREE + 1 - len(coefficients)))
    return polynomial.first_downward_crossing(padded, MATRIX, WORK)


@pytest.mark.parametrize("n", [1, 4, 7, 20])
def test_bernstein_coefficients_restrict_and_halve_a_polynomial(n):
    powers = np.random.default_rng(n).normal(size=n + 1)
    curve, b = Polynomial(powers), np.empty(n + 1)
    polynomial._to_bernstein(powers, polynomial.bernstein_matrix(n), b)
    np.testing.assert_allclose(in_bernstein_form(b)(POINTS), curve(POINTS), atol=1e-12)
    value, slope = polynomial.horner(powers, 0.3)
    assert (value, slope) == pytest.approx((curve(0.3), curve.deriv()(0.3)), rel=1e-13)
    start, right, left = b.copy(), b.copy(), np.empty(n + 1)
    restrict_to_start(start, 0.3, n)
    polynomial.halve(right, left, np.empty(n + 1), n)
    for part, points in ((start, 0.3 * POINTS), (left, 0.5 * POINTS), (right, 0.5 + 0.5 * POINTS)):
        np.testing.assert_allclose(in_bernstein_form(part)(POINTS), curve(points), atol=1e-12)


@pytest.mark.parametrize("seed", range(2))
def test_the_first_of_many_roots_is_found(seed):
    rng = np.random.default_rng(seed)
    for _ in range(200):
        roots = np.sort(rng.uniform(0.0, 1.0, rng.integers(0, 6)))
        # The other factor has no root in [0, 1].
        rest = rng.normal(size=DEGREE - roots.size + 1) * 0.5 ** np.arange(DEGREE - roots.size + 1)
        rest[0] = 1.0 + np.abs(rest).sum()
        # Below its smallest root the polynomial is positive.
        curve = math.prod((Polynomial([root, -1.0]) for root in roots), start=Polynomial(rest))
        distance = np.diff(np.append(roots, 2.0)).min() if roots.size else 1.0
        expected = roots[0] if roots.size else 2.0
        # Rounding of coefficients moves a root the more, the closer other roots are.
        tolerance = 1e-12 / distance ** max(1, roots.size - 1)
        assert abs(first_crossing(*curve.coef) - expected) <= tolerance


@pytest.mark.parametrize(
    ("coefficients", "crossing"),
    [
        ((0.25, -1.0, 1.0), 2.0),  # touches zero at 1/2
        ((0.24, -1.0, 1.0), 0.4),
        ((0.0, 1.0, -2.0), 0.5),  # rises from zero and falls back
        ((0.0, -1.0), 0.0),  # falls from zero at once
        ((0.0, 0.0, 1.0, -4.0), 0.25),  # rests at zero
        ((-1.0, 4.0, -3.2), 0.9045084971874737),  # starts below zero, rises above it and falls
        ((-1.0, 3.0), 2.0),
    ],
)
def test_crossings_of_curves_that_touch_or_start_at_zero(coefficients, crossing):
    assert first_crossing(*coefficients) == pytest.approx(crossing, abs=1e-14)


def test_the_largest_value_is_that_between_the_ends_too():
    for values in np.random.default_rng(0).normal(size=(20, 6)):
        curve = Polynomial(values)
        tops = [s.real for s in curve.deriv().roots() if abs(s.imag) < 1e-12 and 0 < s.real < 1]
        expected = max(curve(s) for s in (0.0, 1.0, *tops))
        coefficients = np.append(values, np.zeros(DEGREE - 5))
        for bound in (-math.inf, expected - 1e-3, expected + 1.0):
            found = polynomial.polynomial_maximum(coefficients, MATRIX, WORK, bound)
            assert found == pytest.approx(max(expected, bound), abs=1e-13)
        a, b, c = values[:3]
        lowest = (Polynomial([a, b, c]))(np.clip([0.0, 1.0, -b / (2.0 * c)], 0.0, 1.0)).min()
        assert polynomial.parabola_minimum(a, b, c) == pytest.approx(lowest, abs=1e-14)


def test_the_exponential_of_a_rotation_turns():
    turn = exponential(np.array([[0.0, -1.0], [1.0, 0.0]]), 1.2)
    cosine, sine = math.cos(1.2), math.sin(1.2)
    np.testing.assert_allclose(turn, [[cosine, -sine], [sine, cosine]], rtol=1e-15)
