"""Taylor series of the nonlinear mesh against convolutions in 40 digits."""

import mpmath
import numpy as np
import pytest

from gearlib import Fourier, Harmonics, OneDegreePair
from gearlib.kernels.codes import BACKLASH, INVERSE, NORMAL
from gearlib.kernels.polynomial import bernstein_matrix
from gearlib.kernels.taylor.series import ORDER, ROWS, V, X, expand, tables
from gearlib.kernels.taylor.taylor_run import first_crossing
from tests.paper import PAPER


def convolved(law, piece, phase, contact, sign, x, v):
    """Return the series of x and x', by the plain sums of Eq. (17) in 40 digits."""
    n = range(ORDER + 1)

    def times(a, b):
        return [mpmath.fsum(a[i] * b[k - i] for i in range(k + 1)) for k in range(len(a))]

    def waves(table, k):
        # The k-th derivative turns a wave by k quarters.
        total = mpmath.mpf(0)
        for order, a, b in table.tolist():
            angle = order * mpmath.mpf(phase) + k * mpmath.pi / 2
            total += mpmath.mpf(order) ** k * (a * mpmath.cos(angle) + b * mpmath.sin(angle))
        return total / mpmath.factorial(k)

    far = contact == INVERSE
    d1, d2, d3 = (
        law.oil if contact == BACKLASH else law.far_damping if far else law.material
    ).tolist()
    p2, p3 = law.powers.tolist()
    level, slope = (law.far_pieces if far else law.pieces)[piece].tolist()
    c = [waves(law.far_stiffness if far else law.stiffness, k) for k in n]
    c[0] += level + slope * (mpmath.mpf(phase) - law.breaks[piece].item())
    c[1] += slope
    side = 1 if contact == NORMAL else -1
    xs, vs = [mpmath.mpf(x)], [mpmath.mpf(v)]
    for k in range(ORDER):
        u = [xs[0] - (law.lower if far else law.upper), *xs[1:]]
        u2, v2 = times(u, u), times(vs, vs)
        g = [a + side * p2 * b + p3 * e for a, b, e in zip(u, u2, times(u2, u), strict=True)]
        push = times(c[: k + 1], g)[k] if contact != BACKLASH else 0
        drag = d1 * vs[k] + sign * d2 * v2[k] + d3 * times(v2, vs)[k]
        xs.append(vs[k] / (k + 1))
        vs.append((waves(law.force, k) - drag - push - law.ground * xs[k]) / (k + 1))
    return xs, vs


def law_of_everything():
    """Return a `Law` in which every term acts, each side with its own."""
    pair = OneDegreePair(
        pair=PAPER.replace(material_damping=1000.0, backlash_damping=300.0),
        quadratic_damping=3e4,
        cubic_damping=4e5,
        backlash_quadratic_damping=2e4,
        backlash_cubic_damping=2e5,
        quadratic_stiffness=5e3,
        cubic_stiffness=2e9,
        profile=Fourier(9),
        excitation=Harmonics((500.0, 200.0), (-800.0,)),
    )
    law = pair.law(0.8, 1e-16)
    pieces = law.pieces + np.array([0.0, 0.1])
    return law._replace(
        pieces=pieces,
        far_pieces=1.5 * pieces,
        far_stiffness=0.7 * law.stiffness[::2] + np.array([0.0, 0.0, 0.1]),
        far_damping=0.5 * law.material,
        ground=0.3,
    )


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("contact", "x"), [(NORMAL, 1.3), (BACKLASH, -2.1), (INVERSE, -5.2)])
def test_series_against_40_digits(contact, x, sign):
    law, phase, series = law_of_everything(), 2.9, np.zeros((ROWS, ORDER + 1))
    piece = int(np.searchsorted(law.breaks, phase)) - 1
    v = 0.9 * sign
    expand(*tables(law), piece, phase, contact, sign, x, v, series, ORDER)
    with mpmath.workdps(40):
        expected = convolved(law, piece, phase, contact, sign, x, v)
        for row, exact in zip((X, V), expected, strict=True):
            error = [abs(float(a - b)) for a, b in zip(exact, series[row], strict=True)]
            # The terms fall or rise as powers of the radius of convergence: rounding of each
            # beside the largest up to there.
            size = np.maximum.accumulate(np.abs(np.array(exact, float)))
            assert (error <= 1e-13 * size).all()


@pytest.mark.parametrize("degree", range(1, ORDER + 1))
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_crossing_is_seen_whatever_term_brings_it(degree, side):
    # side (x - line) = 1 - 2 (t / h)^degree, and the same without a crossing in the step.
    h, line, work = 0.4, 0.7, np.empty((50, ORDER + 2))
    for fall, place in ((2.0, 0.5 ** (1.0 / degree)), (0.99, 2.0)):
        series = np.zeros((ROWS, ORDER + 1))
        series[X, 0], series[X, degree] = line + side, -side * fall / h**degree
        found = first_crossing(series, X, line, side, h, bernstein_matrix(ORDER), work)
        assert found == pytest.approx(place, abs=1e-13)


def test_a_line_alone_and_a_plain_spring():
    # Without harmonics the product with the stiffness has two terms, or one.
    law = law_of_everything()
    none = np.empty((0, 3))
    for slope in (0.2, 0.0):
        line = np.array([[0.8, slope]])
        plain = law._replace(
            pieces=line, far_pieces=line, breaks=np.array([0.0, 7.0]), stiffness=none
        )
        series = np.zeros((ROWS, ORDER + 1))
        expand(*tables(plain), 0, 0.4, NORMAL, 1.0, 1.3, 0.9, series, ORDER)
        with mpmath.workdps(40):
            exact = convolved(plain, 0, 0.4, NORMAL, 1.0, 1.3, 0.9)[1]
            size = np.maximum.accumulate(np.abs(np.array(exact, float)))
            found = [abs(float(a - b)) for a, b in zip(exact, series[V], strict=True)]
            assert (found <= 1e-13 * size).all()
