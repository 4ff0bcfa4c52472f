"""First crossings and largest values of polynomials, against their known roots."""

import numpy as np
import pytest

from gearlib.core.nonlinear import first_crossing
from gearlib.core.polynomial import bernstein_matrix, first_fall, highest
from gearlib.core.series import ROWS, X

DEGREE = 20
MATRIX = bernstein_matrix(DEGREE)
WORK = np.empty((50, DEGREE + 2))


def of_a_step(coefficients):
    """Return what a Taylor step finds on a polynomial, its bounds and its shape asked first."""
    h, series = 0.3, np.zeros((ROWS, DEGREE + 1))
    series[X] = coefficients / h ** np.arange(DEGREE + 1)
    return first_crossing(series, X, 0.0, 1.0, h, MATRIX, WORK)


def with_roots(roots, rng):
    """Return coefficients, falling through zero first at the smallest root in (0, 1)."""
    c = np.array([1.0])
    for root in roots:
        c = np.convolve(c, [root, -1.0])
    rest = rng.normal(size=DEGREE - len(roots) + 1) * 0.5 ** np.arange(DEGREE - len(roots) + 1)
    rest[0] = 1.0 + np.abs(rest).sum()
    return np.convolve(c, rest)


@pytest.mark.parametrize("find", [lambda c: first_fall(c, MATRIX, WORK), of_a_step])
@pytest.mark.parametrize("seed", range(4))
def test_first_of_many_roots(seed, find):
    rng = np.random.default_rng(seed)
    for _ in range(2000):
        roots = np.sort(rng.uniform(0.0, 1.0, rng.integers(0, 6)))
        apart = np.diff(np.append(roots, 2.0)).min() if roots.size else 1.0
        found = find(with_roots(roots, rng))
        # Coefficients carry 1e-16; a root near others moves by that over the distance to them.
        expected = roots[0] if roots.size else 2.0
        assert abs(found - expected) <= 1e-12 / apart ** max(1, roots.size - 1)


@pytest.mark.parametrize("gap", [1e-3, 1e-5, 1e-7])
def test_two_crossings_close_to_each_other(gap):
    c = np.zeros(DEGREE + 1)
    c[:3] = 0.25 - gap * gap, -1.0, 1.0
    assert first_fall(c, MATRIX, WORK) == pytest.approx(0.5 - gap, abs=1e-9)


def test_a_start_on_the_line():
    c = np.zeros(DEGREE + 1)
    c[1:3] = 1.0, -1.5
    assert first_fall(c, MATRIX, WORK) == pytest.approx(2 / 3, abs=1e-14)
    c[:3] = 0.0, -1.0, -1.5
    assert first_fall(c, MATRIX, WORK) == 0.0


def test_a_polynomial_that_hugs_the_line_ends():
    c = np.random.default_rng(0).normal(size=DEGREE + 1) * 1e-16
    c[0] = 1e-16
    first_fall(c, MATRIX, WORK)
    c[0] += 1.0
    assert highest(c, MATRIX, WORK, 0.0) == pytest.approx(1.0, abs=1e-14)


def test_largest_value():
    rng = np.random.default_rng(5)
    grid = np.linspace(0.0, 1.0, 20001)
    for _ in range(200):
        c = rng.normal(size=DEGREE + 1) * 0.7 ** np.arange(DEGREE + 1)
        sampled = np.polynomial.polynomial.polyval(grid, c).max()
        found = highest(c, MATRIX, WORK, -np.inf)
        # A grid of 5e-5 misses a smooth maximum by its curvature times 1e-9.
        assert -1e-12 <= found - sampled <= 1e-6
