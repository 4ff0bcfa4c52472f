"""Compare tongues of parametric resonance with 50 digits, Mathieu's equation and motions."""

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
from tests.properties.known_models import ALL_EXCITATIONS, gears_on_bearings
from tests.references import contact_map

PAPER_RATIOS = (1.569, 0.5879)
#: Contact, stiffness and damping ratios. In the last two meshes, the motion in single contact is
#: overdamped.
MESH_RATIOS = [
    (*PAPER_RATIOS, 0.0),
    (*PAPER_RATIOS, 0.0061),
    (1.2, 0.3, 0.03),
    (1.5, 1e-3, 0.05),
    (1.065, 4.6e-4, 0.25),
]


def pair_without_coast_flank(contact_ratio, stiffness_ratio, damping=0.0):
    """Return a pair with infinite backlash and the given ratios."""
    return GearPair.from_ratios(
        contact_ratio=contact_ratio, stiffness_ratio=stiffness_ratio, damping=damping
    )


def determinant(ratios, multiplier, nu):
    """Return det(M - multiplier I) of the period map M at the tuning `nu`, as an mpmath number.

    `ratios` are contact, stiffness and damping ratio. At the edges of tongues the determinant is 0
    for the multiplier 1 or -1.
    """
    m = contact_map(*ratios, nu)
    trace, determinant_of_map = m[0, 0] + m[1, 1], m[0, 0] * m[1, 1] - m[0, 1] * m[1, 0]
    # The square of the multiplier is 1.
    return 1 - multiplier * trace + determinant_of_map


@pytest.mark.parametrize("ratios", MESH_RATIOS)
def test_edges_of_tongues_match_50_digits(ratios):
    """Each edge of a tongue must be a zero of its determinant in 50 digits."""
    open_tongues = [
        tongue
        for tongue in find_tongues(pair_without_coast_flank(*ratios), 0.3, 6.0)
        if tongue.growth > 0.0
    ]
    assert open_tongues
    with mpmath.workdps(50):
        for tongue in open_tongues:
            edge_function = partial(determinant, ratios, tongue.multiplier)
            for nu in (tongue.start, tongue.stop):
                initial_tunings = mpmath.mpf(nu), mpmath.mpf(nu) * (1 + mpmath.mpf("1e-13"))
                exact_edge = mpmath.findroot(
                    edge_function, initial_tunings, solver="secant", verify=False
                )
                assert abs(edge_function(exact_edge)) < 1e-40
                assert abs(float(exact_edge - nu)) < 1e-12, (tongue, float(exact_edge))


@pytest.mark.parametrize("ratios", MESH_RATIOS)
def test_the_period_map_matches_50_digits(ratios):
    """The matrix that maps a state over a mesh period must agree with one in 50 digits."""
    nu = 0.66
    period_map, _ = meissner.period_map(pair_without_coast_flank(*ratios), nu)
    with mpmath.workdps(50):
        exact_map = np.array(contact_map(*ratios, nu).tolist(), float)
    # The accuracy is limited by the rounding of phase angles up to 100 rad.
    tolerance = 1e-12 * max(1.0, np.abs(exact_map).max())
    np.testing.assert_allclose(period_map, exact_map, rtol=0, atol=tolerance)
    spectral_radius = np.abs(np.linalg.eigvals(exact_map)).max()
    # Nearly equal eigenvalues change by the square root of a rounding error.
    assert meissner.growth(*ratios, nu) == pytest.approx(math.log(spectral_radius), abs=1e-7)


def test_growing_motions_lie_inside_the_tongues_found():
    """For random ratios, motions must grow exactly at the tunings inside the tongues found."""
    rng = np.random.default_rng(7)
    for _ in range(20):
        ratios = 1.0 + rng.random(), 10.0 ** rng.uniform(-4.0, 0.0)
        damping = rng.choice([0.0, 10.0 ** rng.uniform(-4.0, 0.5)])
        nu = 1.0 / np.linspace(0.25, 3.0, 3001)
        grows = meissner.growth(*ratios, damping, nu) > 1e-9
        inside, near_edge = np.zeros((2, nu.size), bool)
        for tongue in find_tongues(pair_without_coast_flank(*ratios, damping), 0.3, 4.5):
            inside |= (nu > tongue.start) & (nu < tongue.stop)
            # At an edge, the growth has an error of the square root of rounding errors.
            near_edge |= np.minimum(np.abs(nu - tongue.start), np.abs(nu - tongue.stop)) < 1e-8
        assert ((grows == inside) | near_edge).all(), (ratios, damping)


@pytest.mark.parametrize("order", [1, 2])
def test_both_edges_of_a_tongue_merge_at_its_closing_damping(order):
    """At the closing damping, the determinant must have a double zero over the tuning."""
    closing_damping = meissner.closing_damping(*PAPER_RATIOS, order)
    open_equation = meissner.meissner_equation(*PAPER_RATIOS, closing_damping * (1.0 - 1e-9))
    closed_equation = meissner.meissner_equation(*PAPER_RATIOS, closing_damping * (1.0 + 1e-9))
    tongue = meissner.find_tongue(open_equation, order)
    assert tongue.start < tongue.stop
    assert math.isnan(meissner.find_tongue(closed_equation, order).start)
    multiplier = -1 if order % 2 else 1

    def edge_function(nu, damping):
        return determinant((*PAPER_RATIOS, damping), multiplier, nu)

    def slope(nu, damping):
        return mpmath.diff(lambda tuning: edge_function(tuning, damping), nu)

    with mpmath.workdps(50):
        guess = tongue.peak, closing_damping
        double_zero = mpmath.findroot([edge_function, slope], guess, tol=1e-30)
    assert closing_damping == pytest.approx(float(double_zero[1]), abs=1e-12)


def test_damping_may_open_a_closed_tongue_again():
    """The growth in an instability tongue must change sign twice as the damping increases.

    In single contact the motion is nearly overdamped, so that damping mainly lowers its frequency.
    """
    ratios, order = (1.0653989653616667, 0.00046219012511841736), 5
    equations = [meissner.meissner_equation(*ratios, damping) for damping in (0.036, 0.05, 0.3)]
    growth_at_low_damping, growth_at_medium_damping, growth_at_high_damping = (
        meissner.find_tongue(equation, order).growth for equation in equations
    )
    assert growth_at_low_damping > 0.0 > growth_at_medium_damping and growth_at_high_damping > 0.0
    assert meissner.closing_damping(*ratios, order) > 0.3


def test_tongues_of_a_single_harmonic_match_mathieus_equation():
    """For a stiffness with one harmonic, edges must be characteristic values of Mathieu's equation.

    It is y'' + (a - 2 q cos 2v) y = 0 with v = tau / 2, half the mesh phase.
    """
    model = OneDegreePair(
        pair=pair_without_coast_flank(contact_ratio=1.5, stiffness_ratio=0.9), profile=Fourier(1)
    )
    ripple = abs(model.profile.piecewise_stiffness(model.pair).harmonics[0, 1])
    tongue_of_order = {tongue.order: tongue for tongue in find_tongues(model, 0.5, 3.0)}
    for order in (1, 2, 3):
        tongue = tongue_of_order[order]
        for nu in (tongue.start, tongue.stop):
            a, q = 4.0 / nu**2, 2.0 * ripple / nu**2
            error = min(abs(a - mathieu_a(order, q)), abs(a - mathieu_b(order, q)))
            # The error is the rounding of the trace of the map, 1e-15, divided by the slope of the
            # trace, which is proportional to the width of the tongue.
            assert error < 1e-14 / (tongue.stop - tongue.start)


def test_tongues_of_a_table_have_multiplier_minus_one_at_edges_and_close_with_damping():
    """The period map of the independent program must have the eigenvalue -1 at an edge of a tongue.

    The tongue must be open for less than the closing damping and closed for more.
    """
    phase = tuple(np.linspace(0.0, 2.0 * math.pi, 8, endpoint=False).tolist())
    table = Tabulated(phase, (4.0, 3.8, 3.0, 2.4, 2.6, 2.2, 3.1, 3.6))
    max_stiffness, kappa, ratio = table.ratios()

    def model(damping):
        return OneDegreePair(pair=pair_without_coast_flank(ratio, kappa, damping), profile=table)

    data = tongues(model(0.01), start=1.5, stop=2.5)
    # Without backlash the model is linear, so that differences of final states, computed by the
    # independent program, are the columns of the period map.
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
    """Tongues of gears on rigid bearings must equal the tongues of the pair."""
    six_degree_pair = gears_on_bearings(bearing_stiffness=math.inf, material_damping=80.0)
    six_degree_tongues = tongues(six_degree_pair, start=0.45, stop=1.2, step=0.01)
    pair_tongues = tongues(six_degree_pair.pair, start=0.45, stop=1.2)
    # Closed tongues have no edges.
    is_open = np.isfinite(pair_tongues.tuning_from.values)
    edges = pair_tongues.tuning_from.values[is_open], pair_tongues.tuning_to.values[is_open]
    expected = sorted(zip(*edges, strict=True))
    starts, stops = six_degree_tongues.tuning_from.values, six_degree_tongues.tuning_to.values
    # Edges are zeros of a determinant. Two nearly equal multipliers amplify the rounding errors.
    np.testing.assert_allclose(list(zip(starts, stops, strict=True)), expected, rtol=0, atol=1e-12)
    assert sorted(six_degree_tongues.edge_multiplier.values) == sorted(
        pair_tongues.edge_multiplier.values[is_open]
    )
    expected_dampings = sorted(pair_tongues.closing_damping.values[is_open])
    closing_dampings = sorted(six_degree_tongues.closing_damping.values)
    # The errors are larger, because the closing damping is where the determinant has a maximum.
    np.testing.assert_allclose(closing_dampings, expected_dampings, rtol=0, atol=1e-10)


def test_soft_bearings_cause_combination_resonance():
    """Soft bearings must cause a tongue with complex multipliers, a combination resonance."""
    model = gears_on_bearings(bearing_stiffness=1e8, **ALL_EXCITATIONS)
    result = tongues(model, start=1.3, stop=1.45, step=0.005)
    # The value 0 marks edges with complex multipliers.
    (index,) = np.nonzero(result.edge_multiplier.values == 0)[0]
    nu = float(result.growth_tuning[index])
    multiplier = max(np.linalg.eigvals(model.contact_monodromy(nu)), key=abs)
    assert abs(multiplier.imag) > 1e-3
    assert math.log(abs(multiplier)) == pytest.approx(float(result.growth[index]), rel=1e-9)
