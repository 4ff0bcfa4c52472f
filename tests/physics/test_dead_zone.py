"""Oscillators whose dead zone has no width: closed forms."""

import numpy as np

from gearlib import DeadZoneOscillator, simulate


def test_undamped_motion_from_rest_without_backlash_is_a_cosine():
    """From rest the load swings the mass between 0 and twice its static displacement."""
    # The motion leaves one flank and meets the other at the same place. Rounding decides on the
    # order
    # of both events, and so many random values are tried.
    rng = np.random.default_rng(5)
    for _ in range(100):
        upper_stiffness, lower_stiffness = 10.0 ** rng.uniform(-2.0, 2.0, 2)
        load = rng.choice((-1.0, 1.0)) * 10.0 ** rng.uniform(-9.0, 2.0)
        model = DeadZoneOscillator(
            upper_stiffness=upper_stiffness,
            lower_edge=0.0,
            lower_stiffness=lower_stiffness,
            load=load,
        )
        run = simulate(model, 0.8, periods=1, samples_per_period=16)
        loaded_stiffness = upper_stiffness if load > 0.0 else lower_stiffness
        exact = (
            load
            / loaded_stiffness
            * (1.0 - np.cos(np.sqrt(loaded_stiffness) * run.phase.values / 0.8))
        )
        np.testing.assert_allclose(
            run.displacement, exact, rtol=0, atol=1e-12 * abs(load / loaded_stiffness)
        )
