"""Studies of one mesh: equal work of dampings, the phase lag."""

import math

import pytest
from scipy.integrate import quad

from gearlib.studies import nonlinear_damping, paper
from tests.paper import PARAMETERS


@pytest.mark.parametrize("power", [1, 2, 3, 4])
def test_coefficients_are_of_equal_work(power):
    d, amplitude, w = 7.0, 3e-5, 8000.0

    def work(t):
        v = amplitude * w * math.cos(w * t)
        return d * abs(v) ** (power - 1) * v * v

    # Half a period at a time: |v| has no kink inside.
    expected = 2.0 * quad(work, -math.pi / (2 * w), math.pi / (2 * w), epsabs=0)[0]
    loss = nonlinear_damping.dissipation(d, power, amplitude, w)
    assert loss == pytest.approx(expected, rel=1e-12)
    coefficient = nonlinear_damping.equivalent_coefficient(1.0, power, amplitude, w)
    assert nonlinear_damping.dissipation(coefficient, power, amplitude, w) == pytest.approx(
        nonlinear_damping.dissipation(1.0, 1, amplitude, w)
    )


def test_phase_lag_of_a_mesh_without_resonance():
    # Slowly, in contact and with small stiffness swings, y follows F / C at once: 180 degrees
    # against the stiffness, and damping adds the lag of a first-order system.
    pair = PARAMETERS | {"stiffness_ratio": 0.99, "contact_ratio": 1.5, "backlash": math.inf}
    options = {"harmonics": 1, "periods": 60, "samples_per_period": 4096}
    damping = 2.0 * 0.5 * math.sqrt(pair["reduced_mass"] * 0.995 * pair["max_stiffness"])
    # Time histories at `tuning` are not used here, the lags of the first harmonic at `tunings` are.
    tunings = [0.05, 0.1]
    lags = paper.phase_lag(pair, [damping], tuning=0.05, tunings=tunings, **options)
    for nu, lag in zip(tunings, lags.first_lag.values[0], strict=True):
        # Transfer function of the mean oscillator, beta = 0.5; the swing is 1 % of it.
        expected = 180.0 + math.degrees(math.atan2(nu, 1.0 - nu * nu))
        assert lag == pytest.approx(expected, abs=0.1)
