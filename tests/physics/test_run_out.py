"""Run-out: motions that repeat with it in single runs, sweeps and `trust`."""

import math

import numpy as np
import pytest

from gearlib import periodic_orbit, simulate, sweep, trust
from gearlib.engines import orbit
from tests.properties.known_models import EVERYTHING, gears

UNEQUAL = (24, 31)


def damped(teeth):
    """Return damped gears with run-out, friction and deviations on soft bearings."""
    everything = EVERYTHING | {"teeth": teeth}
    return gears(3e7, 3953.7, 3953.7, free=True, share=0.2, **everything)


@pytest.mark.parametrize(("teeth", "repeats", "nu"), [((24, 24), 24, 0.9), (UNEQUAL, 744, 0.7)])
def test_a_damped_motion_repeats_with_the_run_out(teeth, repeats, nu):
    """Runs, sweeps and periodic orbits must all have the period after which both gears repeat."""
    pair = damped(teeth)
    assert pair.repeats == repeats
    settings = {"periods": 2 * repeats + 300, "record_periods": 1}
    run = simulate(pair, nu, **settings)
    assert int(run.period) == repeats
    assert int(sweep(pair, [nu], **settings).period[0]) == repeats
    # Shooting, which makes no use of the repeat, must find the same motion.
    orbit = periodic_orbit(pair, nu, period=repeats)
    assert orbit.stable and int(orbit.dataset().period) == repeats
    run = sweep(pair, [nu], periods=10 * repeats, record_periods=1)
    start = simulate(pair, nu, periods=1, initial_state=tuple(orbit.state), samples_per_period=1)
    orbit_state = float(start.displacement[0]), float(start.velocity[0])
    np.testing.assert_allclose(run.final_state[0], orbit_state, atol=1e-9)


def test_trust_is_undecided_below_two_repeats_of_the_run_out():
    """`trust` must not judge a motion that is shorter than two periods of the run-out."""
    # The longer run of `trust` has 1200 periods, which are less than two repeats as well.
    result = trust(damped(UNEQUAL), 0.9, periods=300, exponent_periods=100)
    assert result.label == "undecided"
    assert "two repeats of the run-out, of 744 periods each" in result.message


def repeating_period(displacement, velocity, repeats):
    """Return the period of a motion whose states at the bounds of mesh periods are given."""
    states = np.stack([displacement, velocity], axis=1)
    return orbit.orbit_period(states, tuning=1.0, displacement_range=1.0, repeats=repeats)


def test_the_period_is_judged_over_a_whole_repeat_of_the_run_out():
    """Sines and cosines with known periods stand for motions with a run-out of 30 periods."""
    repeats = 30
    phase = 2.0 * math.pi * np.arange(4 * repeats + 40) / repeats
    x, v = np.sin(phase), np.cos(phase)
    assert repeating_period(x, v, repeats) == repeats
    assert repeating_period(x[: 2 * repeats], v[: 2 * repeats], repeats) == repeats
    # One period less shows fewer than two repeats.
    assert repeating_period(x[: 2 * repeats - 1], v[: 2 * repeats - 1], repeats) == 0
    assert repeating_period(x + 0.1 * np.sin(phase / 2.0), v, repeats) == 2 * repeats
    # If the run-outs of both gears cancel, the motion may have a period of three.
    assert repeating_period(np.arange(400.0) % 3, np.zeros(400), repeats) == 3
    # A drift of 2e-7 a period is below the tolerance, but adds up to 0.06 in half a repeat.
    slow = 0.03 * np.sin(2.0 * math.pi * np.arange(2_000_000) / 1_000_000)
    assert repeating_period(slow, np.zeros_like(slow), 1_000_000) == 1_000_000


def test_a_sweep_carries_the_run_out_phase_from_one_tuning_to_the_next():
    """A sweep at equal tunings must equal one uninterrupted run, also in the phase of run-out."""
    # All tunings are equal up to rounding, so that the downward sweep is one continuous run.
    pair, nu = damped(UNEQUAL), 0.9
    tunings = nu + 1e-13 * np.arange(5)
    swept = sweep(pair, tunings, periods=10, record_periods=10, direction="down")
    for index in range(5):
        run = simulate(pair, nu, periods=10 * (5 - index), record_periods=10)
        # The tunings differ by 1e-13, which fifty periods with bounces amplify.
        np.testing.assert_allclose(swept.final_state[index], run.final_state, atol=1e-9)
        assert float(swept.displacement_max[index]) == pytest.approx(float(run.displacement_max))
