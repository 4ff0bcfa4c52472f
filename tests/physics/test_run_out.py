"""Check that motions with run-out get the period after which the run-out repeats."""

import math

import numpy as np
import pytest

from gearlib import periodic_orbit, simulate, sweep, trust
from gearlib.engines import orbit
from tests.properties.known_models import ALL_EXCITATIONS, gears_on_bearings

UNEQUAL_TEETH = (24, 31)


def damped_gears(teeth):
    """Return damped gears with run-out, friction and deviations on soft bearings."""
    options = ALL_EXCITATIONS | {"teeth": teeth}
    return gears_on_bearings(
        3e7, 3953.7, 3953.7, translating=True, bearing_damping_ratio=0.2, **options
    )


@pytest.mark.parametrize(
    ("teeth", "repeats", "nu"), [((24, 24), 24, 0.9), (UNEQUAL_TEETH, 744, 0.7)]
)
def test_a_damped_motion_repeats_with_the_run_out(teeth, repeats, nu):
    """Runs, sweeps and orbits must have the period after which both gears are in phase again."""
    pair = damped_gears(teeth)
    assert pair.repeats == repeats
    run_options = {"periods": 2 * repeats + 300, "record_periods": 1}
    run = simulate(pair, nu, **run_options)
    assert int(run.period) == repeats
    assert int(sweep(pair, [nu], **run_options).period[0]) == repeats
    # The shooting method for orbits does not use the known period of the run-out.
    orbit = periodic_orbit(pair, nu, period=repeats)
    assert orbit.stable and int(orbit.dataset().period) == repeats
    run = sweep(pair, [nu], periods=10 * repeats, record_periods=1)
    start = simulate(pair, nu, periods=1, initial_state=tuple(orbit.state), samples_per_period=1)
    orbit_state = float(start.displacement[0]), float(start.velocity[0])
    np.testing.assert_allclose(run.final_state[0], orbit_state, atol=1e-9)


def test_trust_is_undecided_below_two_repeats_of_the_run_out():
    """`trust` must not judge runs that are shorter than two periods of the run-out.

    Its longer run has 1200 mesh periods, less than two times 744.
    """
    result = trust(damped_gears(UNEQUAL_TEETH), 0.9, periods=300, exponent_periods=100)
    assert result.label == "undecided"
    assert "two run-out periods of 744 each" in result.message


def repeating_period(displacement, velocity, repeats):
    """Return the period of a motion from its states at the start of each mesh period.

    `repeats` is the number of mesh periods after which the run-out repeats.
    """
    states = np.stack([displacement, velocity], axis=1)
    return orbit.orbit_period(states, tuning=1.0, displacement_range=1.0, excitation_period=repeats)


def test_the_period_is_judged_over_a_whole_repeat_of_the_run_out():
    """Periods of sine functions must be found if they are observed for two repeats or longer."""
    repeats = 30
    phase = 2.0 * math.pi * np.arange(4 * repeats + 40) / repeats
    x, v = np.sin(phase), np.cos(phase)
    assert repeating_period(x, v, repeats) == repeats
    assert repeating_period(x[: 2 * repeats], v[: 2 * repeats], repeats) == repeats
    # With one period less, two repeats are not complete.
    assert repeating_period(x[: 2 * repeats - 1], v[: 2 * repeats - 1], repeats) == 0
    assert repeating_period(x + 0.1 * np.sin(phase / 2.0), v, repeats) == 2 * repeats
    # If the run-outs of both gears cancel, the motion may have a shorter period, here three.
    assert repeating_period(np.arange(400.0) % 3, np.zeros(400), repeats) == 3
    # A drift of 2e-7 per period is below the tolerance, but adds up to 0.06 in half a repeat.
    long_repeats = 1_000_000
    slow_motion = 0.03 * np.sin(2.0 * math.pi * np.arange(2 * long_repeats) / long_repeats)
    assert repeating_period(slow_motion, np.zeros_like(slow_motion), long_repeats) == long_repeats


def test_a_sweep_carries_the_run_out_phase_from_one_tuning_to_the_next():
    """A downward sweep over nearly equal tunings must equal one uninterrupted run."""
    pair, nu = damped_gears(UNEQUAL_TEETH), 0.9
    tunings = nu + 1e-13 * np.arange(5)
    curve = sweep(pair, tunings, periods=10, record_periods=10, direction="down")
    for index in range(tunings.size):
        # The sweep starts at the last tuning.
        run = simulate(pair, nu, periods=10 * (tunings.size - index), record_periods=10)
        # The tunings differ by 1e-13, which up to fifty periods with contact loss amplify.
        np.testing.assert_allclose(curve.final_state[index], run.final_state, atol=1e-9)
        assert float(curve.displacement_max[index]) == pytest.approx(float(run.displacement_max))
