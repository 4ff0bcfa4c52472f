"""The frequency domain: E. Schmidt's method, harmonic balance, Hill's method."""

import math

import numpy as np
import pytest

import gearlib
from gearlib import OneDegreePair, harmonic_balance, periodic_orbit, schmidt
from gearlib.analysis.harmonics.solution import compare_with_orbit, simulate_orbit
from tests.paper import PAPER_PAIR as FREE

MATERIAL = FREE.replace(material_damping=3953.7)
BOTH = MATERIAL.replace(backlash_damping=3953.7)
CUBIC = OneDegreePair(pair=FREE, cubic_damping=4e5, backlash_quadratic_damping=2e4)
CONSTANT = gearlib.GearPair.from_ratios(
    contact_ratio=1.5, stiffness_ratio=1.0, damping=0.1, backlash_ratio=4.0
)


def test_motion_at_constant_stiffness_matches_the_closed_form():
    """Compare both solvers with the exact harmonic response.

    The motion is linear, so that coefficients and multipliers follow from the frequency response.
    """
    # The motion is linear with a single harmonic: x = 1 + amplitude / dynamic_stiffness.
    pair = OneDegreePair(pair=CONSTANT, excitation=gearlib.Harmonics(cosines=(0.0, 0.3)))
    nu = 0.8
    dynamic_stiffness = 1.0 / nu**2 - 4.0 + 2j * 0.1 * 2.0 / nu
    coefficients = np.zeros(9, complex)
    coefficients[0], coefficients[2] = 1.0, 0.15 / nu**2 / dynamic_stiffness
    for result in (harmonic_balance(pair, nu, harmonics=8), schmidt(pair, nu, harmonics=8)):
        np.testing.assert_allclose(result.coefficients, coefficients, rtol=0, atol=1e-10)
        # The multipliers follow from x'' + 2 beta / nu x' + x / nu^2 = 0 with beta = 0.1.
        exponent = (-0.1 + 1j * math.sqrt(1.0 - 0.01)) / nu
        np.testing.assert_allclose(
            sorted(result.multipliers, key=lambda m: m.imag),
            sorted(
                np.exp(2 * math.pi * np.array([exponent, exponent.conjugate()])),
                key=lambda m: m.imag,
            ),
            rtol=0,
            atol=1e-9,
        )


@pytest.mark.parametrize("solver", [harmonic_balance, schmidt])
@pytest.mark.parametrize(("pair", "nu"), [(BOTH, 0.7), (MATERIAL, 1.0), (CUBIC, 0.9)])
def test_orbits_events_and_multipliers_match_exact_orbits(solver, pair, nu):
    """Compare truncated Fourier series with orbits that are exact between contact events."""
    result = solver(pair, nu, harmonics=64)
    solution_errors = compare_with_orbit(result)
    # The jump of the acceleration costs truncated series of h = 64 harmonics 0.25 / h^2 of the
    # displacement and 0.5 / h of dx/dtau; the bounds are about twice as large. Phases of crossings
    # and multipliers are as accurate as the displacement.
    assert (
        solution_errors.displacement < 1e-4
        and solution_errors.velocity < 1.6e-2
        and solution_errors.state < 2e-4
    )
    assert solution_errors.multiplier < 1e-4
    # Contact is never lost at the tuning 0.7.
    if nu != 0.7:
        assert solution_errors.event < 1e-4
    assert result.residual < 1e-8 and result.stable


def test_orbits_that_reach_the_coast_flank_match_exact_orbits():
    """Compare the solvers with the exact orbit of a motion that touches both flanks."""
    # The upper branch, followed from tuning 1 down to 0.66, touches both flanks, 1 and -1.
    curve = gearlib.sweep(
        MATERIAL, np.linspace(0.66, 1.0, 18), periods=120, record_periods=1, direction="down"
    )
    orbit = periodic_orbit(MATERIAL, 0.66, guess=curve.final_state.values[0])
    assert orbit.pattern == (0, -1, 0, 1, 0)
    guess = simulate_orbit(orbit, 512)[0]
    for solver in (harmonic_balance, schmidt):
        solution_errors = compare_with_orbit(solver(MATERIAL, 0.66, harmonics=64, guess=guess), orbit)
        assert (
            solution_errors.displacement < 3e-4
            and solution_errors.event < 1e-4
            and solution_errors.multiplier < 1e-5
        )


def ordered(multipliers):
    """Sort multipliers so that their order does not depend on rounding."""
    return sorted(multipliers, key=lambda m: (round(m.imag, 6), m.real))


# At the larger damping only the product of the multipliers shows whether one is found twice.
@pytest.mark.parametrize(("nu", "damping"), [(1.5, 800), (2.0, 800), (2.0, 4000)])
def test_multipliers_without_contact_loss_match_the_exact_orbit(nu, damping):
    """Multipliers by harmonic balance must equal those of the exact orbit of a linear mesh."""
    # Inside the tongue around nu = 2 the multipliers are real and negative, one less than -1.
    pair = FREE.replace(backlash=0.0, material_damping=damping, backlash_damping=damping)
    orbit, result = periodic_orbit(pair, nu, guess=(1.0, 0.0)), harmonic_balance(pair, nu)
    # Hill's matrix is truncated at 64 harmonics, which costs about 1 / 64^3 of its exponents.
    np.testing.assert_allclose(
        ordered(result.multipliers), ordered(orbit.multipliers), rtol=0, atol=1e-5
    )
    assert result.stable == orbit.stable == (nu < 2.0)
    if nu == 2.0:
        assert orbit.multipliers[0].real < -1.0 and abs(orbit.multipliers[1]) < 1.0


def test_a_diverging_iteration_reports_no_multipliers():
    """A diverging iteration must end early with NaN for multipliers and error bounds."""
    # Without degenerate harmonics the successive approximations diverge here.
    start = 5.0 * np.cos(np.arange(16) * np.pi / 8)
    result = schmidt(CUBIC, 0.95, harmonics=8, degenerate=0, guess=start, max_iterations=200)
    assert result.status == "diverged" and result.iterations < 200
    assert np.isnan(result.multipliers).all()
    assert np.isnan([result.norm_bound, result.contraction]).all()


def test_a_period_1_orbit_is_also_found_over_two_periods():
    """A search over two mesh periods must return the orbit that repeats after one."""
    # Over two periods only even harmonics are left, and the multipliers are squared.
    single = harmonic_balance(MATERIAL, 1.0, harmonics=32)
    double = harmonic_balance(MATERIAL, 1.0, harmonics=64, samples=1024, period=2)
    np.testing.assert_allclose(double.coefficients[::2], single.coefficients, rtol=0, atol=1e-9)
    np.testing.assert_allclose(
        abs(double.multipliers), abs(single.multipliers) ** 2, rtol=0, atol=1e-6
    )
