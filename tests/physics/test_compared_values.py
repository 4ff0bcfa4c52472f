"""What fits compare, against second codes in 50 digits."""

import mpmath as mp
import numpy as np
import pytest

import gearlib
from gearlib.uncertainty import orbit_values
from gearlib.uncertainty.observation import Channel
from tests.physics.test_fits import TRUTH
from tests.references import reference_elimination, reference_slopes
from tests.references.described_models import describe
from tests.references.reference_equations import machine_of

#: What is measured to so many digits.
CLOSE = 1e-9


def rate_of(description):
    """Return the speed in rpm of the tuning 1."""
    return machine_of(description, 1.0, mp).speed * 30 / (mp.pi * description["teeth"])


@pytest.mark.parametrize("tuning", [0.7, 0.9])
def test_statistics_at_a_speed_are_those_in_fifty_digits(tuning):
    # On the upper branch, where contact is lost.
    tunings = np.linspace(tuning, 1.0, 8)
    run = gearlib.sweep(TRUTH, tunings, periods=300, record_periods=1, direction="down")
    speed, state = float(TRUTH.speed(tuning)), run.final_state.values[0]
    point = orbit_values.at_speed(TRUTH, speed, state)
    assert point["displacement_min"] < 0.0
    with mp.workdps(50):
        pair = describe(TRUTH)
        nu = mp.mpf(speed) / rate_of(pair)
        z, _ = reference_slopes._orbit(pair, nu, 1, state)
        machine = machine_of(pair, nu, mp)
        table = reference_slopes.columns(pair, nu, 1, list(z))
        scale = {"displacement": machine.length, "dynamic": machine.length * machine.force_unit}
        for name in orbit_values.STATISTICS:
            wanted = float(table[name][0] * scale.get(name.partition("_")[0], 1))
            value = orbit_values.pick(point, name, 0)
            assert value == pytest.approx(wanted, rel=CLOSE, abs=1e-30), name


def apart(residuals, wanted):
    """Return the largest error of residuals, over the largest of these."""
    wanted = np.array(wanted, float)
    return np.abs(residuals - wanted).max() / np.abs(wanted).max()


@pytest.mark.parametrize("gain", [False, True])
@pytest.mark.parametrize("offset", [False, True])
def test_gain_and_offset_are_eliminated_as_in_fifty_digits(gain, offset):
    rng = np.random.default_rng(5)
    measured, predicted = rng.normal(size=(2, 12))
    deviations = rng.uniform(0.5, 2.0, 12)
    channel = Channel("x", measured, deviations, True, gain, offset)
    residuals = (channel.sensed(predicted)[0] - measured) / deviations
    with mp.workdps(50):
        basis = [(1.0 / deviations).tolist()] * offset
        rows = ((values / deviations).tolist() for values in (measured, predicted))
        wanted = reference_elimination.left(*rows, basis, gain)
    assert apart(residuals, wanted) < CLOSE
