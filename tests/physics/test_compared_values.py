"""What fits compare, against 50 digits and least squares of numpy."""

import mpmath as mp
import numpy as np
import pytest

import gearlib
from gearlib.rig.orbit_at_speed import STATISTICS, OrbitAtSpeed
from gearlib.rig.order_observations import MeshOrders
from gearlib.rig.projection import projected
from tests.independent import differences
from tests.independent.systems import describe, system_of
from tests.physics.test_fits import TRUTH

#: What is measured to so many digits.
CLOSE = 1e-9


def rate_of(description):
    """Return the speed in rpm of the tuning 1."""
    return system_of(description, 1.0, mp).speed * 30 / (mp.pi * description["teeth"])


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
        state, _ = differences.orbit_of(pair, nu, 1, point.orbit.state)
        system = system_of(pair, nu, mp)
        table = differences.columns(pair, nu, 1, state)
        scale = {"length": system.length, "force": system.length * system.force, "share": 1}
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


def apart(residuals, measured, modelled, basis, gain):
    """Return the largest error of residuals of least squares, over the largest of these.

    They are gain times modelled, plus columns of a basis, less measured; a known gain is 1.
    """
    target = measured if gain else measured - modelled
    columns = np.column_stack([*([modelled] if gain else []), *basis, np.zeros(len(target))])
    wanted = columns @ np.linalg.lstsq(columns, target, rcond=None)[0] - target
    return np.abs(residuals - wanted).max() / np.abs(wanted).max()


@pytest.mark.parametrize("gain", [False, True])
@pytest.mark.parametrize("phase", [0.0, 0.8])
def test_gain_is_eliminated_from_orders(gain, phase):
    waves = Waves(gain, phase)
    turned = waves.orders * np.exp(1j * phase * np.arange(1, 5))
    rows = (
        (x / (0.3 * np.sqrt(waves.share / 2.0))[:, None])[waves.kept].ravel().view(float)
        for x in (waves.measured, turned)
    )
    assert apart(waves.residuals(None), *rows, [], gain) < CLOSE


@pytest.mark.parametrize("gain", [False, True])
@pytest.mark.parametrize("columns", [0, 1, 3])
def test_gain_and_offset_are_eliminated(gain, columns):
    rng = np.random.default_rng(5)
    measured, modelled = rng.normal(size=(2, 12))
    basis = np.vstack([np.ones(12), rng.normal(size=(2, 12))])[:columns]
    residuals = projected(measured, modelled, basis.T, gain)[0]
    assert apart(residuals, measured, modelled, basis, gain) < CLOSE
