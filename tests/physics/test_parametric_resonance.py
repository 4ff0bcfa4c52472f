"""Tongues of parametric resonance: 50 digits, Mathieu, Meissner, monodromy, growing motions."""

import math
from functools import partial

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


def mesh(contact_ratio, stiffness_ratio, damping=0.0):
    """Return a pair without coast-side flank."""
    return GearPair.from_ratios(
        contact_ratio=contact_ratio, stiffness_ratio=stiffness_ratio, damping=damping
    )


def determinant(ratios, multiplier, nu):
    """Return det(M - multiplier I) of the map M over one mesh period, in the digits of `mpmath`.

    The multiplier is 1 or -1; the edges of tongues are the zeros over the tuning.
    """
    m = contact_map(*ratios, nu)
    return 1 - multiplier * (m[0, 0] + m[1, 1]) + m[0, 0] * m[1, 1] - m[0, 1] * m[1, 0]


@pytest.mark.parametrize("ratios", MESHES)
def test_edges_of_tongues_match_50_digits(ratios):
    result = [tongue for tongue in find_tongues(mesh(*ratios), 0.3, 6.0) if tongue.growth > 0.0]
    assert result
    with mpmath.workdps(50):
        for tongue in result:
            function = partial(determinant, ratios, tongue.multiplier)
            for nu in (tongue.start, tongue.stop):
                near = mpmath.mpf(nu), mpmath.mpf(nu) * (1 + mpmath.mpf("1e-13"))
                true = mpmath.findroot(function, near, solver="secant", verify=False)
                assert abs(function(true)) < 1e-40
                assert abs(float(true - nu)) < 1e-12, (tongue, float(true))


@pytest.mark.parametrize("ratios", MESHES)
def test_the_period_map_matches_50_digits(ratios):
    nu = 0.66
    result, _ = meissner.period_map(mesh(*ratios), nu)
    with mpmath.workdps(50):
        true = np.array(contact_map(*ratios, nu).tolist(), float)
    # The phases of a period round by themselves times 1e-16, the slower of them up to 100 rad.
    np.testing.assert_allclose(result, true, rtol=0, atol=1e-12 * max(1.0, np.abs(true).max()))
    radius = np.abs(np.linalg.eigvals(true)).max()
    # An eigenvalue next to a double one moves by the square root of rounding.
    assert meissner.growth(*ratios, nu) == pytest.approx(math.log(radius), abs=1e-7)


def test_growing_motions_lie_inside_the_tongues_found():
    random = np.random.default_rng(7)
    for _ in range(20):
        ratios = 1.0 + random.random(), 10.0 ** random.uniform(-4.0, 0.0)
        damping = random.choice([0.0, 10.0 ** random.uniform(-4.0, 0.5)])
        nu = 1.0 / np.linspace(0.25, 3.0, 3001)
        grows = meissner.growth(*ratios, damping, nu) > 1e-9
        inside, close = np.zeros((2, nu.size), bool)
        for tongue in find_tongues(mesh(*ratios, damping), 0.3, 4.5):
            inside |= (nu > tongue.start) & (nu < tongue.stop)
            # The growth has the root of rounding at the edges.
            close |= np.minimum(np.abs(nu - tongue.start), np.abs(nu - tongue.stop)) < 1e-8
        assert ((grows == inside) | close).all(), (ratios, damping)


@pytest.mark.parametrize("order", [1, 2])
def test_both_edges_of_a_tongue_merge_at_its_closing_damping(order):
    result = meissner.closing_damping(*PAPER, order)
    below, above = (
        meissner.tongue(meissner.meissner_equation(*PAPER, result * (1.0 + side * 1e-9)), order)
        for side in (-1, 1)
    )
    assert below.start < below.stop and math.isnan(above.start)

    def function(nu, beta):
        return determinant((*PAPER, beta), -1 if order % 2 else 1, nu)

    def slope(nu, beta):
        return mpmath.diff(lambda x: function(x, beta), nu)

    with mpmath.workdps(50):
        true = mpmath.findroot([function, slope], (below.peak, result), tol=1e-30)
    assert result == pytest.approx(float(true[1]), abs=1e-12)


def test_damping_may_open_a_closed_tongue_again():
    # The softer stretch is next to over-damped: damping lowers its frequency before all.
    ratios, order = (1.0653989653616667, 0.00046219012511841736), 5
    equations = [meissner.meissner_equation(*ratios, damping) for damping in (0.036, 0.05, 0.3)]
    first, closed, again = (meissner.tongue(equation, order).growth for equation in equations)
    assert first > 0.0 > closed and again > 0.0
    assert meissner.closing_damping(*ratios, order) > 0.3


def test_tongues_of_a_single_harmonic_match_mathieus_equation():
    model = OneDegreePair(pair=mesh(contact_ratio=1.5, stiffness_ratio=0.9), profile=Fourier(1))
    ripple = abs(model.profile.pieces(model.pair).harmonics[0, 1])
    result = {tongue.order: tongue for tongue in find_tongues(model, 0.5, 3.0)}
    for order in (1, 2, 3):
        tongue = result[order]
        for nu in (tongue.start, tongue.stop):
            # y'' + (a - 2 q cos 2v) y = 0 with tau = 2 v.
            a, q = 4.0 / nu**2, 2.0 * ripple / nu**2
            error = min(abs(a - f(order, q)) for f in (mathieu_a, mathieu_b))
            # Rounding of the trace of the map, 1e-15, over its slope, proportional to the width.
            assert error < 1e-14 / (tongue.stop - tongue.start)


def test_tongues_of_a_table_have_multiplier_minus_one_at_edges_and_close_with_damping():
    phase = tuple(np.linspace(0.0, 2.0 * math.pi, 8, endpoint=False).tolist())
    table = Tabulated(phase, (4.0, 3.8, 3.0, 2.4, 2.6, 2.2, 3.1, 3.6))
    high, kappa, ratio = table.ratios()

    def model(damping):
        return OneDegreePair(pair=mesh(ratio, kappa, damping), profile=table)

    data = tongues(model(0.01), start=1.5, stop=2.5)
    # Without backlash springs push and pull: linear. `move` is the code of `tests.independent`.
    pair = model(0.01).pair.replace(backlash=0.0, backlash_damping=model(0.01).material_damping)
    linear = describe(OneDegreePair(pair=pair, profile=table))
    nu = float(data.tuning_from[0])
    ends = [move(linear, nu, 1, state).state for state in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))]
    matrix = (np.array(ends[1:]) - ends[0]).T
    assert np.linalg.det(matrix + np.eye(2)) == pytest.approx(0.0, abs=1e-10)
    for factor, is_open in ((0.999, True), (1.001, False)):
        (near,) = find_tongues(model(factor * float(data.closing_damping[0])), 1.5, 2.5)
        assert (near.growth > 0.0) == is_open


def test_tongues_on_rigid_bearings_match_the_one_degree_model():
    pair = gears(bearing=math.inf, material=80.0)
    six = tongues(pair, start=0.45, stop=1.2, step=0.01)
    one = tongues(pair.pair, start=0.45, stop=1.2)
    # Tongues that damping closes have no edges.
    is_open = np.isfinite(one.tuning_from.values)
    edges = one.tuning_from.values[is_open], one.tuning_to.values[is_open]
    expected = sorted(zip(*edges, strict=True))
    result = list(zip(six.tuning_from.values, six.tuning_to.values, strict=True))
    # Zeros of a determinant of two nearly equal multipliers: rounding over the width.
    np.testing.assert_allclose(result, expected, rtol=0, atol=1e-12)
    assert sorted(six.edge_multiplier.values) == sorted(one.edge_multiplier.values[is_open])
    closings = sorted(one.closing_damping.values[is_open])
    # A determinant has its maximum there: the error is of the order of the root of rounding.
    np.testing.assert_allclose(sorted(six.closing_damping.values), closings, rtol=0, atol=1e-10)


def test_soft_bearings_cause_combination_resonance():
    pair = gears(bearing=1e8, **EVERYTHING)
    result = tongues(pair, start=1.3, stop=1.45, step=0.005)
    # Edges of combination resonances have complex multipliers, which 0 stands for.
    (i,) = np.nonzero(result.edge_multiplier.values == 0)[0]
    nu = float(result.growth_tuning[i])
    largest = max(np.linalg.eigvals(pair.contact_monodromy(nu)), key=abs)
    assert abs(largest.imag) > 1e-3
    assert math.log(abs(largest)) == pytest.approx(float(result.growth[i]), rel=1e-9)
