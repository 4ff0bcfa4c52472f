"""The frequency domain: E. Schmidt's method, harmonic balance, Hill's method."""

import math

import numpy as np
import pytest

import gearlib
from gearlib import OneDegreePair, harmonic_balance, periodic_orbit, schmidt
from gearlib.analysis.harmonics.solution import errors, exact_motion
from tests.paper import PAPER as FREE

MATERIAL = FREE.replace(material_damping=3953.7)
BOTH = MATERIAL.replace(backlash_damping=3953.7)
CUBIC = OneDegreePair(pair=FREE, cubic_damping=4e5, backlash_quadratic_damping=2e4)
CONSTANT = gearlib.GearPair.from_ratios(
    contact_ratio=1.5, stiffness_ratio=1.0, damping=0.1, backlash_ratio=4.0
)


def test_motion_at_constant_stiffness_matches_the_closed_form():
    # Linear, one harmonic: x = 1 + amplitude / symbol.
    pair = OneDegreePair(pair=CONSTANT, excitation=gearlib.Harmonics(cosines=(0.0, 0.3)))
    nu = 0.8
    symbol = 1.0 / nu**2 - 4.0 + 2j * 0.1 * 2.0 / nu
    expected = np.zeros(9, complex)
    expected[0], expected[2] = 1.0, 0.15 / nu**2 / symbol
    for result in (harmonic_balance(pair, nu, harmonics=8), schmidt(pair, nu, harmonics=8)):
        np.testing.assert_allclose(result.coefficients, expected, rtol=0, atol=1e-10)
        # The multipliers of x'' + 2 beta / nu x' + x / nu^2 = 0.
        root = (-0.1 + 1j * math.sqrt(1.0 - 0.01)) / nu
        np.testing.assert_allclose(
            sorted(result.multipliers, key=lambda m: m.imag),
            sorted(np.exp(2 * math.pi * np.array([root, root.conjugate()])), key=lambda m: m.imag),
            rtol=0,
            atol=1e-9,
        )


@pytest.mark.parametrize("solve", [harmonic_balance, schmidt])
@pytest.mark.parametrize(("pair", "nu"), [(BOTH, 0.7), (MATERIAL, 1.0), (CUBIC, 0.9)])
def test_orbits_events_and_multipliers_match_exact_orbits(solve, pair, nu):
    result = solve(pair, nu, harmonics=64)
    error = errors(result)
    # Gibbs: 0.25 / h^2 of the displacement, 0.5 / h of dx/dtau, with room of about two; phases
    # of crossings and multipliers as good as the displacement.
    assert error.displacement < 1e-4 and error.velocity < 1.6e-2 and error.state < 2e-4
    assert error.multiplier < 1e-4
    if nu != 0.7:  # there contact is never lost
        assert error.event < 1e-4
    assert result.residual < 1e-8 and result.stable


def test_orbits_that_reach_the_coast_flank_match_exact_orbits():
    # The upper branch at 0.66, followed down from 1, has contact with both flanks, 1 and -1.
    curve = gearlib.sweep(
        MATERIAL, np.linspace(0.66, 1.0, 18), periods=120, record_periods=1, direction="down"
    )
    orbit = periodic_orbit(MATERIAL, 0.66, guess=curve.final_state.values[0])
    assert orbit.pattern == (0, -1, 0, 1, 0)
    guess = exact_motion(orbit, 512)[0]
    for solve in (harmonic_balance, schmidt):
        error = errors(solve(MATERIAL, 0.66, harmonics=64, guess=guess), orbit)
        assert error.displacement < 3e-4 and error.event < 1e-4 and error.multiplier < 1e-5


def ordered(multipliers):
    """Return multipliers in an order that does not depend on the last digit."""
    return sorted(multipliers, key=lambda m: (round(m.imag, 6), m.real))


# At the larger damping only the product of the multipliers shows whether one is found twice.
@pytest.mark.parametrize(("nu", "damping"), [(1.5, 800), (2.0, 800), (2.0, 4000)])
def test_multipliers_without_contact_loss_match_the_exact_orbit(nu, damping):
    # Inside the tongue around nu = 2 they are real and negative, one beyond -1.
    pair = FREE.replace(backlash=0.0, material_damping=damping, backlash_damping=damping)
    orbit, result = periodic_orbit(pair, nu, guess=(1.0, 0.0)), harmonic_balance(pair, nu)
    # Hill's matrix cut at 64 harmonics: its exponents err by some 1 / 64^3.
    np.testing.assert_allclose(
        ordered(result.multipliers), ordered(orbit.multipliers), rtol=0, atol=1e-5
    )
    assert result.stable == orbit.stable == (nu < 2.0)
    if nu == 2.0:
        assert orbit.multipliers[0].real < -1.0 and abs(orbit.multipliers[1]) < 1.0


def test_a_diverging_iteration_reports_no_multipliers():
    # Without degenerate harmonics the successive approximations diverge here.
    start = 5.0 * np.cos(np.arange(16) * np.pi / 8)
    result = schmidt(CUBIC, 0.95, harmonics=8, degenerate=0, guess=start, max_iterations=200)
    assert result.status == "diverged" and result.iterations < 200
    assert np.isnan(result.multipliers).all()
    assert np.isnan([result.norm_bound, result.contraction]).all()


def test_a_period_1_orbit_is_also_found_over_two_periods():
    # The orbit of one period is one of two as well, its multipliers squared.
    one = harmonic_balance(MATERIAL, 1.0, harmonics=32)
    two = harmonic_balance(MATERIAL, 1.0, harmonics=64, samples=1024, period=2)
    np.testing.assert_allclose(two.coefficients[::2], one.coefficients, rtol=0, atol=1e-9)
    np.testing.assert_allclose(abs(two.multipliers), abs(one.multipliers) ** 2, rtol=0, atol=1e-6)
