"""Oscillators with a dead zone of no width: closed forms."""

import numpy as np

from gearlib import DeadZoneOscillator, simulate


def test_undamped_motion_from_rest_without_backlash_is_a_cosine():
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
        exact = load / k * (1.0 - np.cos(np.sqrt(k) * run.phase.values / 0.8))
        np.testing.assert_allclose(run.displacement, exact, rtol=0, atol=1e-12 * abs(load / k))
