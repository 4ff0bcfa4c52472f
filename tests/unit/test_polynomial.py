"""First crossings and largest values of polynomials, against their known roots."""

import math

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from gearlib.engines.polynomial import (
    WORK_ROWS,
    bernstein_matrix,
    first_downward_crossing,
    polynomial_maximum,
)
from gearlib.engines.taylor.series import DISPLACEMENT, ROWS
from gearlib.engines.taylor.taylor_run import first_crossing

DEGREE = 20
MATRIX = bernstein_matrix(DEGREE)
WORK = np.empty((WORK_ROWS, DEGREE + 2))


def crossing_in_a_step(coefficients):
    """Return the first fall through zero as a Taylor step finds it, which tries bounds first."""
    step, line, direction, series = 0.3, 0.0, 1.0, np.zeros((ROWS, DEGREE + 1))
    series[DISPLACEMENT] = coefficients / step ** np.arange(DEGREE + 1)
    return first_crossing(series, DISPLACEMENT, line, direction, step, MATRIX, WORK)


def with_roots(roots, rng):
    """Return coefficients, falling through zero first at the smallest root in (0, 1)."""
    c = np.array([1.0])
    for root in roots:
        c = np.convolve(c, [root, -1.0])
    rest = rng.normal(size=DEGREE - len(roots) + 1) * 0.5 ** np.arange(DEGREE - len(roots) + 1)
    rest[0] = 1.0 + np.abs(rest).sum()
    return np.convolve(c, rest)


@pytest.mark.parametrize(
    "find", [lambda c: first_downward_crossing(c, MATRIX, WORK), crossing_in_a_step]
)
@pytest.mark.parametrize("seed", range(2))
def test_the_first_of_many_roots_is_found(seed, find):
    rng = np.random.default_rng(seed)
    for _ in range(2000):
        roots = np.sort(rng.uniform(0.0, 1.0, rng.integers(0, 6)))
        distance = np.diff(np.append(roots, 2.0)).min() if roots.size else 1.0
        expected = roots[0] if roots.size else 2.0
        # Rounding of coefficients moves a root the more, the closer other roots are.
        tolerance = 1e-12 / distance ** max(1, roots.size - 1)
        assert abs(find(with_roots(roots, rng)) - expected) <= tolerance


@pytest.mark.parametrize("seed", range(20))
def test_the_largest_value_is_that_between_the_ends_too(seed):
    c = np.zeros(DEGREE + 1)
    c[:6] = np.random.default_rng(seed).normal(size=6)
    curve = Polynomial(c[:6])
    tops = [s.real for s in curve.deriv().roots() if abs(s.imag) < 1e-12 and 0.0 < s.real < 1.0]
    wanted = max(float(curve(s)) for s in (0.0, 1.0, *tops))
    assert polynomial_maximum(c, MATRIX, WORK, -math.inf) == pytest.approx(wanted, abs=1e-13)
