"""Tongues of parametric resonance: 50 digits, Mathieu, Meissner, monodromy, growing motions."""

import math

import mpmath
import numpy as np
import pytest
from scipy.special import mathieu_a, mathieu_b

from gearlib import Fourier, GearPair, OneDegreePair, Tabulated, tongues
from gearlib.analysis.tongues import meissner
from gearlib.analysis.tongues.search import find_tongues
from tests.independent.systems import describe, move
from tests.properties.known_models import EVERYTHING, gears
from tests.references import contact_map

PAPER = (1.569, 0.5879)
#: Contact ratio, stiffness ratio, damping ratio; in the last two the softer stretch is over-damped.
MESHES = [
    (*PAPER, 0.0),
    (*PAPER, 0.0061),
    (1.2, 0.3, 0.03),
    (1.5, 1e-3, 0.05),
    (1.065, 4.6e-4, 0.25),
]


def mesh(contact_ratio, stiffness_ratio, damping=0.0, **more):
    return GearPair.from_ratios(
        contact_ratio=contact_ratio, stiffness_ratio=stiffness_ratio, damping=damping, **more
    )


def miss_in_50_digits(ratios, sign):
    """Return det(M - sign I) as a function of the tuning."""

    def miss(nu):
        m = contact_map(*ratios, nu)
        return 1 - sign * (m[0, 0] + m[1, 1]) + m[0, 0] * m[1, 1] - m[0, 1] * m[1, 0]

    return miss


@pytest.mark.parametrize("ratios", MESHES)
def test_edges_in_50_digits(ratios):
    result = [one for one in find_tongues(mesh(*ratios), 0.3, 6.0) if one.growth > 0.0]
    assert result
    with mpmath.workdps(50):
        for one in result:
            miss = miss_in_50_digits(ratios, one.multiplier)
            for nu in (one.start, one.stop):
                near = mpmath.mpf(nu), mpmath.mpf(nu) * (1 + mpmath.mpf("1e-13"))
                true = mpmath.findroot(miss, near, solver="secant", verify=False)
                assert abs(miss(true)) < 1e-40
                assert abs(float(true - nu)) < 1e-12, (one, float(true))


@pytest.mark.parametrize("ratios", MESHES)
def test_the_map_of_one_period_in_50_digits(ratios):
    nu = 0.66
    pair = mesh(*ratios)
    result, _ = meissner.period_map(pair, nu)
    with mpmath.workdps(50):
        true = np.array(contact_map(*ratios, nu).tolist(), float)
    # The phases of a period round by themselves times 1e-16, the slower of them up to 100 rad.
    np.testing.assert_allclose(result, true, rtol=0, atol=1e-12 * max(1.0, np.abs(true).max()))
    liouville = math.exp(-4.0 * math.pi * ratios[2] / nu)
    assert np.linalg.det(result) == pytest.approx(liouville, rel=1e-10, abs=1e-13)
    radius = np.abs(np.linalg.eigvals(true)).max()
    # An eigenvalue next to a double one moves by the square root of rounding.
    assert meissner.growth(*ratios, nu) == pytest.approx(math.log(radius), abs=1e-7)


def test_every_tongue_is_found_and_is_one_interval():
    random = np.random.default_rng(7)
    for _ in range(20):
        ratios = 1.0 + random.random(), 10.0 ** random.uniform(-4.0, 0.0)
        damping = random.choice([0.0, 10.0 ** random.uniform(-4.0, 0.5)])
        nu = 1.0 / np.linspace(0.25, 3.0, 3001)
        grows = meissner.growth(*ratios, damping, nu) > 1e-9
        inside, close = np.zeros((2, nu.size), bool)
        for one in find_tongues(mesh(*ratios, damping), 0.3, 4.5):
            inside |= (nu > one.start) & (nu < one.stop)
            # The growth has the root of rounding at the edges.
            close |= np.minimum(np.abs(nu - one.start), np.abs(nu - one.stop)) < 1e-8
        assert ((grows == inside) | close).all(), (ratios, damping)


@pytest.mark.parametrize("order", [1, 2])
def test_the_damping_that_closes_a_tongue(order):
    result = meissner.closing_damping(*PAPER, order)
    below, above = (
        meissner.tongue(meissner.meissner_equation(*PAPER, result * (1.0 + side * 1e-9)), order)
        for side in (-1, 1)
    )
    assert below.start < below.stop and math.isnan(above.start)
    sign = -1 if order % 2 else 1
    with mpmath.workdps(50):

        def miss(nu, beta):
            return miss_in_50_digits((*PAPER, beta), sign)(nu)

        def slope(nu, beta):
            return mpmath.diff(lambda x: miss(x, beta), nu)

        true = mpmath.findroot([miss, slope], (below.peak, result), tol=1e-30)
    assert result == pytest.approx(float(true[1]), abs=1e-12)


def test_damping_may_open_a_closed_tongue_again():
    # The softer stretch is next to over-damped: damping lowers its frequency before all.
    ratios, order = (1.0653989653616667, 0.00046219012511841736), 5
    equations = [meissner.meissner_equation(*ratios, damping) for damping in (0.036, 0.05, 0.3)]
    first, closed, again = (meissner.tongue(one, order).growth for one in equations)
    assert first > 0.0 > closed and again > 0.0
    assert meissner.closing_damping(*ratios, order) > 0.3


@pytest.mark.parametrize(("kappa", "orders"), [(0.9, (1, 2, 3))])
def test_one_harmonic_is_mathieu(kappa, orders):
    pair = mesh(1.5, kappa)
    model = OneDegreePair(pair=pair, profile=Fourier(1))
    ripple = abs(model.profile.pieces(pair).harmonics[0, 1])
    result = {one.order: one for one in find_tongues(model, 0.5, 3.0)}
    for order in orders:
        one = result[order]
        misses = []
        for nu in (one.start, one.stop):
            # y'' + (a - 2 q cos 2v) y = 0 with tau = 2 v.
            a, q = 4.0 / nu**2, 2.0 * ripple / nu**2
            misses.append(min(abs(a - f(order, q)) for f in (mathieu_a, mathieu_b)))
        # Rounding of T, 1e-15, over its slope at the edges, which is that of the width.
        assert max(misses) < 1e-14 / (one.stop - one.start)


def test_a_table_against_the_independent_program():
    phase = tuple(np.linspace(0.0, 2.0 * math.pi, 8, endpoint=False).tolist())
    table = Tabulated(phase, (4.0, 3.8, 3.0, 2.4, 2.6, 2.2, 3.1, 3.6))
    high, kappa, ratio = table.ratios()
    pair = GearPair.from_ratios(contact_ratio=ratio, stiffness_ratio=kappa, damping=0.01)
    data = tongues(OneDegreePair(pair=pair, profile=table), start=1.5, stop=2.5)
    (nu,) = data.tuning_from.values
    # Without backlash its springs act both ways: as linear as far away as here.
    whole = OneDegreePair(pair=pair.replace(backlash=0.0, backlash_damping=pair.material_damping),
                          profile=table)  # fmt: skip
    ends = [move(describe(whole), nu, 1, z).state for z in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))]
    matrix = (np.array(ends[1:]) - ends[0]).T
    # The rounding of a period, over the slope of a determinant.
    assert np.linalg.det(matrix + np.eye(2)) == pytest.approx(0.0, abs=1e-10)
    assert 0.01 < float(data.closing_damping[0]) < 0.2


def test_rigid_bearings_have_the_tongues_of_one_degree():
    pair = gears(math.inf, 80.0, 0.0)
    six = tongues(pair, start=0.45, stop=1.2, step=0.01)
    one = tongues(pair.pair, start=0.45, stop=1.2)
    still = np.isfinite(one.tuning_from.values)
    expected = sorted(zip(one.tuning_from.values[still], one.tuning_to.values[still], strict=True))
    result = list(zip(six.tuning_from.values, six.tuning_to.values, strict=True))
    # Zeros of a determinant of two nearly equal multipliers: rounding over the width.
    np.testing.assert_allclose(result, expected, rtol=0, atol=1e-12)
    assert sorted(six.edge_multiplier.values) == sorted(one.edge_multiplier.values[still])
    closings = sorted(one.closing_damping.values[still])
    # The largest of a determinant, whose place has the root of rounding.
    np.testing.assert_allclose(sorted(six.closing_damping.values), closings, rtol=0, atol=1e-10)


def test_bearings_bring_combination_resonance():
    pair = gears(1e8, 0.0, 0.0, **EVERYTHING)
    result = tongues(pair, start=1.3, stop=1.45, step=0.005)
    (i,) = np.nonzero(result.edge_multiplier.values == 0)[0]
    nu = float(result.growth_tuning[i])
    largest = max(np.linalg.eigvals(pair.contact_monodromy(nu)), key=abs)
    assert abs(largest.imag) > 1e-3
    assert math.log(abs(largest)) == pytest.approx(float(result.growth[i]), rel=1e-9)
