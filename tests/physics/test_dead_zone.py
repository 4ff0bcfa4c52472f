"""Compare oscillators with a dead zone of zero width with closed forms."""

import numpy as np

from gearlib import DeadZoneOscillator, simulate


def test_undamped_motion_from_rest_without_backlash_is_a_cosine():
    """From rest, the mass must oscillate between 0 and twice its static displacement.

    The mass leaves one flank and touches the other at the same displacement. Rounding decides the
    order of both events, so that many random values are tried.
    """
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
        time = run.phase.values / 0.8
        static_displacement = load / loaded_stiffness
        exact = static_displacement * (1.0 - np.cos(np.sqrt(loaded_stiffness) * time))
        tolerance = 1e-12 * abs(static_displacement)
        np.testing.assert_allclose(run.displacement, exact, rtol=0, atol=tolerance)
