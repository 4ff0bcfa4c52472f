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
#: Contact, stiffness and damping ratios; in the last two meshes the softer level is overdamped.
MESHES = [
    (*PAPER, 0.0),
    (*PAPER, 0.0061),
    (1.2, 0.3, 0.03),
    (1.5, 1e-3, 0.05),
    (1.065, 4.6e-4, 0.25),
]


def mesh(contact_ratio, stiffness_ratio, damping=0.0):
    """Return a pair without coast flank, described by its ratios."""
    return GearPair.from_ratios(
        contact_ratio=contact_ratio, stiffness_ratio=stiffness_ratio, damping=damping
    )


def determinant(ratios, multiplier, nu):
    """Return det(M - multiplier I) of the period map M at the tuning `nu`, in digits of `mpmath`.

    `ratios` are contact, stiffness and damping ratio. The multiplier is 1 or -1; the edges of
    tongues are zeros of the determinant over the tuning.
    """
    m = contact_map(*ratios, nu)
    return 1 - multiplier * (m[0, 0] + m[1, 1]) + m[0, 0] * m[1, 1] - m[0, 1] * m[1, 0]


@pytest.mark.parametrize("ratios", MESHES)
def test_edges_of_tongues_match_50_digits(ratios):
    """Each edge must be a zero of the determinant of its multiplier in 50 digits."""
    result = [tongue for tongue in find_tongues(mesh(*ratios), 0.3, 6.0) if tongue.growth > 0.0]
    assert result
    with mpmath.workdps(50):
        for tongue in result:
            edge_function = partial(determinant, ratios, tongue.multiplier)
            for nu in (tongue.start, tongue.stop):
                initial_tunings = mpmath.mpf(nu), mpmath.mpf(nu) * (1 + mpmath.mpf("1e-13"))
                exact_edge = mpmath.findroot(
                    edge_function, initial_tunings, solver="secant", verify=False
                )
                assert abs(edge_function(exact_edge)) < 1e-40
                assert abs(float(exact_edge - nu)) < 1e-12, (tongue, float(exact_edge))


@pytest.mark.parametrize("ratios", MESHES)
def test_the_period_map_matches_50_digits(ratios):
    """Compare the matrix that maps the state over a mesh period with one in 50 digits."""
    nu = 0.66
    result, _ = meissner.period_map(mesh(*ratios), nu)
    with mpmath.workdps(50):
        exact_map = np.array(contact_map(*ratios, nu).tolist(), float)
    # Rounding of the phase angles of a period, up to 100 rad, limits the accuracy.
    np.testing.assert_allclose(
        result, exact_map, rtol=0, atol=1e-12 * max(1.0, np.abs(exact_map).max())
    )
    radius = np.abs(np.linalg.eigvals(exact_map)).max()
    # Nearly double eigenvalues change by the square root of rounding.
    assert meissner.growth(*ratios, nu) == pytest.approx(math.log(radius), abs=1e-7)


def test_growing_motions_lie_inside_the_tongues_found():
    """On a fine grid of tunings motions must grow exactly inside the tongues, of random ratios."""
    random = np.random.default_rng(7)
    for _ in range(20):
        ratios = 1.0 + random.random(), 10.0 ** random.uniform(-4.0, 0.0)
        damping = random.choice([0.0, 10.0 ** random.uniform(-4.0, 0.5)])
        nu = 1.0 / np.linspace(0.25, 3.0, 3001)
        grows = meissner.growth(*ratios, damping, nu) > 1e-9
        inside, near_edge = np.zeros((2, nu.size), bool)
        for tongue in find_tongues(mesh(*ratios, damping), 0.3, 4.5):
            inside |= (nu > tongue.start) & (nu < tongue.stop)
            # At the edges the growth is uncertain by the square root of rounding.
            near_edge |= np.minimum(np.abs(nu - tongue.start), np.abs(nu - tongue.stop)) < 1e-8
        assert ((grows == inside) | near_edge).all(), (ratios, damping)


@pytest.mark.parametrize("order", [1, 2])
def test_both_edges_of_a_tongue_merge_at_its_closing_damping(order):
    """At the closing damping the determinant has a double zero over the tuning, in 50 digits."""
    closing_damping = meissner.closing_damping(*PAPER, order)
    open_equation = meissner.meissner_equation(*PAPER, closing_damping * (1.0 - 1e-9))
    closed_equation = meissner.meissner_equation(*PAPER, closing_damping * (1.0 + 1e-9))
    tongue = meissner.find_tongue(open_equation, order)
    assert tongue.start < tongue.stop
    assert math.isnan(meissner.find_tongue(closed_equation, order).start)
    multiplier = -1 if order % 2 else 1

    def edge_function(nu, damping):
        return determinant((*PAPER, damping), multiplier, nu)

    def slope(nu, damping):
        return mpmath.diff(lambda tuning: edge_function(tuning, damping), nu)

    with mpmath.workdps(50):
        guess = tongue.peak, closing_damping
        double_zero = mpmath.findroot([edge_function, slope], guess, tol=1e-30)
    assert closing_damping == pytest.approx(float(double_zero[1]), abs=1e-12)


def test_damping_may_open_a_closed_tongue_again():
    """The growth in an instability tongue must change sign twice as the damping rises."""
    # At the softer level the mesh is nearly overdamped, so that damping mainly lowers its
    # frequency.
    ratios, order = (1.0653989653616667, 0.00046219012511841736), 5
    equations = [meissner.meissner_equation(*ratios, damping) for damping in (0.036, 0.05, 0.3)]
    growth_at_low_damping, growth_at_medium_damping, growth_at_high_damping = (
        meissner.find_tongue(equation, order).growth for equation in equations
    )
    assert growth_at_low_damping > 0.0 > growth_at_medium_damping and growth_at_high_damping > 0.0
    assert meissner.closing_damping(*ratios, order) > 0.3


def test_tongues_of_a_single_harmonic_match_mathieus_equation():
    """A stiffness with one harmonic gives Mathieu's equation, whose edges scipy computes."""
    model = OneDegreePair(pair=mesh(contact_ratio=1.5, stiffness_ratio=0.9), profile=Fourier(1))
    ripple = abs(model.profile.piecewise_stiffness(model.pair).harmonics[0, 1])
    tongue_of_order = {tongue.order: tongue for tongue in find_tongues(model, 0.5, 3.0)}
    for order in (1, 2, 3):
        tongue = tongue_of_order[order]
        for nu in (tongue.start, tongue.stop):
            # y'' + (a - 2 q cos 2v) y = 0 with tau = 2 v.
            a, q = 4.0 / nu**2, 2.0 * ripple / nu**2
            error = min(abs(a - mathieu_a(order, q)), abs(a - mathieu_b(order, q)))
            # The error is the rounding of the trace of the map, 1e-15, divided by the slope of the
            # trace, which is proportional to the width of the tongue.
            assert error < 1e-14 / (tongue.stop - tongue.start)


def test_tongues_of_a_table_have_multiplier_minus_one_at_edges_and_close_with_damping():
    """The period map of a second code must have the eigenvalue -1 at the edge of the tongue."""
    phase = tuple(np.linspace(0.0, 2.0 * math.pi, 8, endpoint=False).tolist())
    table = Tabulated(phase, (4.0, 3.8, 3.0, 2.4, 2.6, 2.2, 3.1, 3.6))
    max_stiffness, kappa, ratio = table.ratios()

    def model(damping):
        return OneDegreePair(pair=mesh(ratio, kappa, damping), profile=table)

    data = tongues(model(0.01), start=1.5, stop=2.5)
    # Without backlash the model is linear, and differences of motions by the code of
    # `tests.independent` give the period map.
    pair = model(0.01).pair.replace(backlash=0.0, backlash_damping=model(0.01).material_damping)
    linear = describe(OneDegreePair(pair=pair, profile=table))
    nu = float(data.tuning_from[0])
    final_states = [
        move(linear, nu, 1, state).state for state in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))
    ]
    period_map = (np.array(final_states[1:]) - final_states[0]).T
    assert np.linalg.det(period_map + np.eye(2)) == pytest.approx(0.0, abs=1e-10)
    for factor, is_open in ((0.999, True), (1.001, False)):
        (tongue,) = find_tongues(model(factor * float(data.closing_damping[0])), 1.5, 2.5)
        assert (tongue.growth > 0.0) == is_open


def test_tongues_on_rigid_bearings_match_the_one_degree_model():
    """Instability tongues of gears on rigid bearings must equal those of the one-degree pair."""
    pair = gears(bearing=math.inf, material=80.0)
    six_tongues = tongues(pair, start=0.45, stop=1.2, step=0.01)
    pair_tongues = tongues(pair.pair, start=0.45, stop=1.2)
    # Closed tongues have no edges.
    is_open = np.isfinite(pair_tongues.tuning_from.values)
    edges = pair_tongues.tuning_from.values[is_open], pair_tongues.tuning_to.values[is_open]
    expected = sorted(zip(*edges, strict=True))
    result = list(zip(six_tongues.tuning_from.values, six_tongues.tuning_to.values, strict=True))
    # Edges are zeros of a determinant with two nearly equal multipliers, which amplify rounding.
    np.testing.assert_allclose(result, expected, rtol=0, atol=1e-12)
    assert sorted(six_tongues.edge_multiplier.values) == sorted(
        pair_tongues.edge_multiplier.values[is_open]
    )
    closings = sorted(pair_tongues.closing_damping.values[is_open])
    # At the closing damping the determinant has a maximum, so that the error is larger.
    np.testing.assert_allclose(
        sorted(six_tongues.closing_damping.values), closings, rtol=0, atol=1e-10
    )


def test_soft_bearings_cause_combination_resonance():
    """Soft bearings must give a tongue with complex multipliers: combination resonance."""
    pair = gears(bearing=1e8, **EVERYTHING)
    result = tongues(pair, start=1.3, stop=1.45, step=0.005)
    # The value 0 marks edges with complex multipliers, as combination resonances have.
    (tongue_index,) = np.nonzero(result.edge_multiplier.values == 0)[0]
    nu = float(result.growth_tuning[tongue_index])
    multiplier = max(np.linalg.eigvals(pair.contact_monodromy(nu)), key=abs)
    assert abs(multiplier.imag) > 1e-3
    assert math.log(abs(multiplier)) == pytest.approx(float(result.growth[tongue_index]), rel=1e-9)
