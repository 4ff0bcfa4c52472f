"""Check methods in the frequency domain: Schmidt's method, harmonic balance and Hill's method."""

import math

import numpy as np
import pytest

import gearlib
from gearlib import OneDegreePair, harmonic_balance, periodic_orbit, schmidt
from gearlib.analysis.harmonics.solution import compare_with_orbit, simulate_orbit
from tests.paper import PAPER_PAIR as UNDAMPED_PAIR

DAMPED_IN_CONTACT = UNDAMPED_PAIR.replace(material_damping=3953.7)
DAMPED_PAIR = DAMPED_IN_CONTACT.replace(backlash_damping=3953.7)
CUBICALLY_DAMPED_PAIR = OneDegreePair(
    pair=UNDAMPED_PAIR, cubic_damping=4e5, backlash_quadratic_damping=2e4
)
PAIR_OF_CONSTANT_STIFFNESS = gearlib.GearPair.from_ratios(
    contact_ratio=1.5, stiffness_ratio=1.0, damping=0.1, backlash_ratio=4.0
)


def test_motion_at_constant_stiffness_matches_the_closed_form():
    """Both solvers must return the frequency response of x'' + 2 beta / nu x' + x / nu^2 = f.

    The excitation f has a constant part and an amplitude of 0.3 / nu^2 at the order 2. Multipliers
    follow from the characteristic exponents of the equation.
    """
    nu, beta, amplitude, order, harmonic_count = 0.8, 0.1, 0.3, 2, 8
    excitation = gearlib.Harmonics(cosines=(0.0, amplitude))
    pair = OneDegreePair(pair=PAIR_OF_CONSTANT_STIFFNESS, excitation=excitation)
    dynamic_stiffness = 1.0 / nu**2 - order**2 + 2j * beta * order / nu
    coefficients = np.zeros(harmonic_count + 1, complex)
    coefficients[0] = 1.0
    # A real wave is the sum of two complex ones with half its amplitude.
    coefficients[order] = 0.5 * amplitude / nu**2 / dynamic_stiffness
    exponent = (-beta + 1j * math.sqrt(1.0 - beta**2)) / nu
    multipliers = np.exp(2 * math.pi * np.array([exponent, exponent.conjugate()]))
    expected = sorted(multipliers, key=lambda multiplier: multiplier.imag)
    for solver in (harmonic_balance, schmidt):
        result = solver(pair, nu, harmonics=harmonic_count)
        np.testing.assert_allclose(result.coefficients, coefficients, rtol=0, atol=1e-10)
        computed = sorted(result.multipliers, key=lambda multiplier: multiplier.imag)
        np.testing.assert_allclose(computed, expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("solver", [harmonic_balance, schmidt])
@pytest.mark.parametrize(
    ("pair", "nu"), [(DAMPED_PAIR, 0.7), (DAMPED_IN_CONTACT, 1.0), (CUBICALLY_DAMPED_PAIR, 0.9)]
)
def test_orbits_events_and_multipliers_match_exact_orbits(solver, pair, nu):
    """Truncated Fourier series must agree with exact orbits within their truncation errors."""
    result = solver(pair, nu, harmonics=64)
    solution_errors = compare_with_orbit(result)
    # Due to the jump of the acceleration, a series of h = 64 harmonics has errors of 0.25 / h^2 in
    # the displacement and 0.5 / h in its derivative dx/dtau. The bounds are about twice as large.
    # Phases of crossings and multipliers are as accurate as the displacement.
    assert solution_errors.displacement < 1e-4 and solution_errors.velocity < 1.6e-2
    assert solution_errors.state < 2e-4 and solution_errors.multiplier < 1e-4
    # At the tuning 0.7 there are no events, because contact is never lost.
    if nu != 0.7:
        assert solution_errors.event < 1e-4
    assert result.residual < 1e-8 and result.stable


def test_orbits_that_reach_the_coast_flank_match_exact_orbits():
    """Both solvers must agree with the exact orbit of a motion that touches both flanks."""
    # On the upper branch, which a downward sweep follows from the tuning 1 to 0.66, both flanks are
    # touched: the contact states 1 (drive) and -1 (coast) occur.
    curve = gearlib.sweep(
        DAMPED_IN_CONTACT,
        np.linspace(0.66, 1.0, 18),
        periods=120,
        record_periods=1,
        direction="down",
    )
    orbit = periodic_orbit(DAMPED_IN_CONTACT, 0.66, guess=curve.final_state.values[0])
    assert orbit.pattern == (0, -1, 0, 1, 0)
    guess = simulate_orbit(orbit, 512)[0]
    for solver in (harmonic_balance, schmidt):
        solution_errors = compare_with_orbit(
            solver(DAMPED_IN_CONTACT, 0.66, harmonics=64, guess=guess), orbit
        )
        # The bounds allow for the truncation to 64 harmonics.
        assert solution_errors.displacement < 3e-4 and solution_errors.event < 1e-4
        assert solution_errors.multiplier < 1e-5


def sort_multipliers(multipliers):
    """Sort multipliers by rounded imaginary and by real parts, robustly against rounding errors."""
    return sorted(multipliers, key=lambda multiplier: (round(multiplier.imag, 6), multiplier.real))


# At the larger damping, only the product of the multipliers shows whether one is found twice.
@pytest.mark.parametrize(("nu", "damping"), [(1.5, 800), (2.0, 800), (2.0, 4000)])
def test_multipliers_without_contact_loss_match_the_exact_orbit(nu, damping):
    """Multipliers by harmonic balance must equal those of the exact orbit of a linear mesh.

    Inside the instability tongue around nu = 2, they are real and negative, one below -1.
    """
    pair = UNDAMPED_PAIR.replace(backlash=0.0, material_damping=damping, backlash_damping=damping)
    orbit, result = periodic_orbit(pair, nu, guess=(1.0, 0.0)), harmonic_balance(pair, nu)
    # The truncation of Hill's matrix to 64 harmonics changes its exponents by about 1 / 64^3.
    np.testing.assert_allclose(
        sort_multipliers(result.multipliers), sort_multipliers(orbit.multipliers), rtol=0, atol=1e-5
    )
    assert result.stable == orbit.stable == (nu < 2.0)
    if nu == 2.0:
        assert orbit.multipliers[0].real < -1.0 and abs(orbit.multipliers[1]) < 1.0


def test_a_diverging_iteration_reports_no_multipliers():
    """A diverging iteration must end early, with NaN for multipliers and error bounds.

    Without degenerate harmonics, the successive approximations diverge for this pair.
    """
    start = 5.0 * np.cos(np.arange(16) * np.pi / 8)
    result = schmidt(
        CUBICALLY_DAMPED_PAIR, 0.95, harmonics=8, degenerate=0, guess=start, max_iterations=200
    )
    assert result.status == "diverged" and result.iterations < 200
    assert np.isnan(result.multipliers).all()
    assert np.isnan([result.norm_bound, result.contraction]).all()


def test_a_period_1_orbit_is_also_found_over_two_periods():
    """A search over two mesh periods must also find the orbit that repeats after one.

    It has the coefficients of this orbit at even harmonics, and squared multipliers.
    """
    single = harmonic_balance(DAMPED_IN_CONTACT, 1.0, harmonics=32)
    double = harmonic_balance(DAMPED_IN_CONTACT, 1.0, harmonics=64, samples=1024, period=2)
    np.testing.assert_allclose(double.coefficients[::2], single.coefficients, rtol=0, atol=1e-9)
    np.testing.assert_allclose(
        abs(double.multipliers), abs(single.multipliers) ** 2, rtol=0, atol=1e-6
    )
