"""Order spectra: the balance of every order, errors of sampling; tests/physics has the phases."""

import numpy as np
import pytest

from gearlib import DeadZoneOscillator, GearPair, orders, simulate

COMMON = {"contact_ratio": 1.569, "stiffness_ratio": 0.5879, "teeth": 24}
LOSING = GearPair.from_ratios(damping=0.02, backlash=0.5, backlash_damping=0.01, **COMMON)


def run(pair=LOSING, tuning=1.0, **more):
    return simulate(pair, tuning, **{"periods": 600, "record_periods": 24} | more)


def test_the_balance_of_every_order_holds():
    # (-w^2 + i w d) X + F / nu^2 = 0 at w > 0 by the equation of motion, in contact or not, where
    # both dampings are equal; the mean force is the load.
    pair = GearPair.from_ratios(damping=0.03, backlash=0.5, backlash_damping=0.03, **COMMON)
    spectrum = orders(run(pair, 0.66, periods=1500, samples_per_period=2048), count=40)
    w = spectrum.mesh_order.values[24::24]
    x, force = (
        spectrum[f"{name}_amplitude"].values[24::24]
        * np.exp(1j * spectrum[f"{name}_phase"].values[24::24])
        for name in ("error", "force")
    )
    stiffness = x * (w**2 - 1j * w * 0.06 / 0.66) * 0.66**2
    assert np.abs(stiffness - force).max() < 1e-6
    assert spectrum.force_amplitude.values[0] == pytest.approx(1.0, abs=1e-8)


def test_errors_fall_with_the_samples_and_are_estimated():
    few, more, many = (orders(run(samples_per_period=n), count=4) for n in (64, 256, 4096))
    for name in ("force", "error"):
        exact = many[f"{name}_amplitude"].values
        errors = [np.abs(part[f"{name}_amplitude"].values - exact).max() for part in (few, more)]
        assert errors[1] < 0.1 * errors[0] < 1e-3 * exact.max()
        for error, part in zip(errors, (few, more), strict=True):
            assert error <= part[f"{name}_amplitude_error"].values.max()
    with pytest.raises(ValueError, match="samples_per_period = 32 is not allowed for these orders"):
        orders(run(samples_per_period=32), count=4)


def test_what_has_no_revolutions_is_refused():
    with pytest.raises(ValueError, match="multiple of 24"):
        orders(run(periods=3, record_periods=3))
    with pytest.raises(ValueError, match="gears that turn"):
        model = DeadZoneOscillator(upper_stiffness=1.0, lower_stiffness=1.0, load=0.3)
        orders(simulate(model, 1.0, periods=3))
    assert orders(run(record_periods=2)).order.values[1] == 12.0
