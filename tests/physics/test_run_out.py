"""Run-out: motions that repeat with it, over single runs, sweeps and Lyapunov exponents."""

import math

import numpy as np
import pytest

from gearlib import (
    periodic_orbit,
    simulate,
    sweep,
    trust,
)
from gearlib.engines import orbit
from gearlib.models.one_mesh_system import state_matrix_by_phase
from tests.properties.known_models import EVERYTHING, gears

EQUAL, UNEQUAL = (24, 24), (24, 31)


def damped(teeth, **more):
    """Return damped gears with run-out, friction and deviations on soft bearings."""
    everything = EVERYTHING | {"teeth": teeth} | more
    return gears(3e7, 3953.7, 3953.7, free=True, share=0.2, **everything)


@pytest.mark.parametrize(("teeth", "repeats", "nu"), [(EQUAL, 24, 0.9), (UNEQUAL, 744, 0.7)])
def test_a_damped_motion_repeats_with_the_run_out(teeth, repeats, nu):
    pair = damped(teeth)
    assert pair.repeats == repeats
    settings = {"periods": 2 * repeats + 300, "record_periods": 1}
    run = simulate(pair, nu, **settings)
    assert int(run.period) == repeats
    assert int(sweep(pair, [nu], **settings).period[0]) == repeats
    # Shooting, which knows nothing of it, closes after as many periods, and on the same motion.
    result = periodic_orbit(pair, nu, period=repeats)
    assert result.stable and int(result.dataset().period) == repeats
    back = sweep(pair, [nu], periods=10 * repeats, record_periods=1)
    np.testing.assert_allclose(back.final_state[0], relative(pair, nu, result.state), atol=1e-9)


def relative(pair, nu, state):
    """Return displacement and velocity at tau = 0 of a full state without constants."""
    system = pair.system(nu)
    z, (near,) = pair.full_state(system, (0.0, 0.0)), system.drive_lines
    z[: state.size] = state
    return near @ z, near @ (state_matrix_by_phase(system, [0], 0) @ z)


def test_trust_asks_for_two_repeats():
    # Four times as many, in the longer run, are less than two repeats as well.
    result = trust(damped(UNEQUAL), 0.9, periods=300, exponent_periods=100)
    assert result.label == "undecided"
    assert "two repeats of the run-out, of 744 periods each" in result.message


def test_a_doubled_run_out_and_a_slow_one():
    # States over 2 R periods that repeat after R, or after 2 R only, or hardly move at all.
    repeats = 30
    phase = 2.0 * math.pi * np.arange(4 * repeats + 40) / repeats
    states = np.stack([np.sin(phase), np.cos(phase)], axis=1)
    assert orbit.orbit_period(states, 1.0, 1.0, repeats) == repeats
    assert orbit.orbit_period(states[: 2 * repeats], 1.0, 1.0, repeats) == repeats
    assert orbit.orbit_period(states[: 2 * repeats - 1], 1.0, 1.0, repeats) == 0
    doubled = np.stack([np.sin(phase) + 0.1 * np.sin(phase / 2.0), np.cos(phase)], axis=1)
    assert orbit.orbit_period(doubled, 1.0, 1.0, repeats) == 2 * repeats
    # Gears whose run-outs cancel: what repeats all through a repeat has its own period.
    third = np.stack([np.arange(400) % 3, np.zeros(400)], axis=1).astype(float)
    assert orbit.orbit_period(third, 1.0, 1.0, repeats) == 3
    # 2e-7 from a period to the next is less than the tolerance, 0.06 in half a repeat is not.
    slow = 0.03 * np.sin(2.0 * math.pi * np.arange(2_000_000) / 1_000_000)
    states = np.stack([slow, np.zeros_like(slow)], axis=1)
    assert orbit.orbit_period(states, 1.0, 1.0, 1_000_000) == 1_000_000


def test_a_sweep_lets_the_gears_turn_on():
    # Tunings equal to rounding, ten periods each: one run, were it not for the order.
    pair, nu = damped(UNEQUAL), 0.9
    tunings = nu + 1e-13 * np.arange(5)
    swept = sweep(pair, tunings, periods=10, record_periods=10, direction="down")
    for count, i in enumerate(range(4, -1, -1), 1):
        run = simulate(pair, nu, periods=10 * count, record_periods=10)
        # Rounding of the tuning over fifty periods with bounces.
        np.testing.assert_allclose(swept.final_state[i], run.final_state, atol=1e-9)
        assert float(swept.displacement_max[i]) == pytest.approx(float(run.displacement_max))
