"""The first crossing of polynomials with many close roots, which motions meet by chance only."""

import math

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from gearlib.engines.polynomial import WORK_ROWS, bernstein_matrix, first_downward_crossing

DEGREE = 20
MATRIX = bernstein_matrix(DEGREE)


@pytest.mark.parametrize("seed", range(2))
def test_the_first_of_many_roots_is_found(seed):
    rng, work = np.random.default_rng(seed), np.empty((WORK_ROWS, DEGREE + 2))
    for _ in range(2000):
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
        found = first_downward_crossing(curve.coef, MATRIX, work)
        assert abs(found - expected) <= tolerance
