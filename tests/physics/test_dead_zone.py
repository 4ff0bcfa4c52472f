"""Oscillators with a dead zone: closed forms, chaos, what their datasets say."""

import math

import numpy as np
import pytest

from gearlib import DeadZoneOscillator, periodic_orbit, simulate
from gearlib.analysis.lyapunov import largest_exponent
from tests.physics import published


def test_the_soft_stop_has_chaos_beside_the_motion_without_impact():
    model, frequency = published.PROBLEMS["soft_impact"]
    steady = 0.5 / (1.0 - frequency**2 + 0.04j * frequency)
    orbit = periodic_orbit(model, frequency, guess=(0.6, 0.0))
    assert orbit.pattern == (0,)
    assert orbit.state == pytest.approx([steady.real, -steady.imag], abs=1e-12)
    # Liouville: the product of the multipliers is what damping leaves of an area in a period.
    left = math.exp(-0.08 * math.pi / frequency)
    assert orbit.multipliers.prod().real == pytest.approx(left, abs=1e-12)
    chaos = largest_exponent(model, frequency, state=(0.0, 0.0), settle=400, periods=600)
    assert chaos.value > 10.0 * chaos.uncertainty
    # It ends where it grazes the stop: just beyond its amplitude the stop is out of reach.
    grazing = periodic_orbit(published.soft_impact(abs(steady))[0], frequency, guess=(0.6, 0.0))
    assert grazing.grazing


def test_a_start_at_rest_without_backlash_or_damping_is_a_cosine():
    # Rounding hides in which order the mesh leaves one flank and meets the other: many cases.
    rng = np.random.default_rng(5)
    for _ in range(100):
        upper, lower = 10.0 ** rng.uniform(-2.0, 2.0, 2)
        load = rng.choice((-1.0, 1.0)) * 10.0 ** rng.uniform(-9.0, 2.0)
        model = DeadZoneOscillator(
            upper_stiffness=upper, lower_edge=0.0, lower_stiffness=lower, load=load
        )
        run = simulate(model, 0.8, periods=1, samples_per_period=16)
        k = upper if load > 0.0 else lower
        exact = load / k * (1.0 - np.cos(math.sqrt(k) * run.phase.values / 0.8))
        np.testing.assert_allclose(run.displacement, exact, rtol=0, atol=1e-12 * abs(load / k))
