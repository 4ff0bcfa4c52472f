"""What fits compare, against second codes in 50 digits."""

import mpmath as mp
import numpy as np
import pytest

import gearlib
from gearlib.rig.orbit_at_speed import STATISTICS, OrbitAtSpeed
from gearlib.rig.order_observations import MeshOrders
from gearlib.rig.projection import projected
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
    point = OrbitAtSpeed(TRUTH, speed, state)
    assert point.least < 0.0
    with mp.workdps(50):
        pair = describe(TRUTH)
        nu = mp.mpf(speed) / rate_of(pair)
        z, _ = reference_slopes._orbit(pair, nu, 1, point.orbit.state)
        machine = machine_of(pair, nu, mp)
        table = reference_slopes.columns(pair, nu, 1, list(z))
        scale = {"length": machine.length, "force": machine.length * machine.force_unit, "share": 1}
        wanted = {name: float(table[name][0] * scale[kind]) for name, kind in STATISTICS.items()}
    for name, value in wanted.items():
        assert point.of(name) == pytest.approx(value, rel=CLOSE, abs=1e-30), name


class Waves(MeshOrders):
    """Orders, shape (6, 4), of which one block is left out."""

    def __init__(self, gain, phase):
        rng = np.random.default_rng(4)
        self.orders, noise = rng.normal(size=(2, 6, 4)) + 1j * rng.normal(size=(2, 6, 4))
        self.gain, self.phase, self.deviation = gain, phase, 0.3
        self.share, self.kept = rng.uniform(0.1, 2.0, 6), np.arange(6) != 2
        self.measured = 1.7 * np.exp(0.8j * np.arange(1, 5)) * self.orders + 0.3 * noise

    def modelled(self, model):
        return self.orders


def apart(residuals, wanted):
    """Return the largest error of residuals, over the largest of these."""
    wanted = np.array(wanted, float)
    return np.abs(residuals - wanted).max() / np.abs(wanted).max()


@pytest.mark.parametrize("gain", [False, True])
@pytest.mark.parametrize("phase", [0.0, 0.8])
def test_gain_is_eliminated_from_orders_as_in_fifty_digits(gain, phase):
    waves = Waves(gain, phase)
    with mp.workdps(50):
        sizes = [0.3 * mp.sqrt(mp.mpf(x) / 2) for x in waves.share[waves.kept]]
        rows = (x[waves.kept].tolist() for x in (waves.measured, waves.orders))
        wanted = reference_elimination.left_of_orders(*rows, sizes, gain, phase)
    assert apart(waves.residuals(None), wanted) < CLOSE


@pytest.mark.parametrize("gain", [False, True])
@pytest.mark.parametrize("columns", [0, 1, 3])
def test_gain_and_offset_are_eliminated_as_in_fifty_digits(gain, columns):
    rng = np.random.default_rng(5)
    measured, modelled = rng.normal(size=(2, 12))
    basis = np.vstack([np.ones(12), rng.normal(size=(2, 12))])[:columns]
    with mp.workdps(50):
        wanted = reference_elimination.left(measured, modelled.tolist(), basis, gain)
    assert apart(projected(measured, modelled, basis.T, gain)[0], wanted) < CLOSE
