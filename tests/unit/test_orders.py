"""Orders of runs and of sampled signals: balances, known waves, errors, a tacho, wrong ones."""

import math

import numpy as np
import pytest
import xarray as xr

import gearlib
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


RATE, SECONDS = 20_000.0, 6.0


def chirp(first=600.0, last=1800.0, start=0.0, order=12.0):
    """Return a signal of a mean and waves of orders 3 and `order`, and the revolutions made.

    The speed goes from `first` to `last`, rpm; the signal begins at the time `start`, s.
    """
    t = start + np.arange(int(RATE * SECONDS)) / RATE
    speed = first + (last - first) * (t - start) / SECONDS
    turns = (first + 0.5 * (last - first) * (t - start) / SECONDS) * (t - start) / 60.0
    x = 0.5 + 2.0 * np.cos(math.tau * 3.0 * turns + 0.4) + np.sin(math.tau * order * turns)
    data = {"acceleration": ("sample", x, {"units": "m s-2"})}
    coords = {"time": ("sample", t), "speed": ("sample", speed)}
    return xr.Dataset(data, coords), turns


def test_a_chirp_has_its_orders_by_its_speed_or_a_tacho():
    data, turns = chirp(start=2.0)
    options = {"variable": "acceleration", "amplitude": "peak", "highest": 20, "teeth": 24}
    levels = gearlib.order_map(data, **options)
    assert levels.sizes["time"] == int(turns[-1]) and float(levels.teeth) == 24.0
    # Splines through ten samples of the shortest wave and more.
    exact = np.zeros(21)
    exact[[0, 3, 12]] = 0.5, 2.0, 1.0
    assert np.abs(levels.amplitude.values - exact).max() < 2e-5
    assert np.abs(levels.phase.sel(order=3) - 0.4).max() < 1e-5
    assert np.abs(levels.overall - math.sqrt(2.5)).max() < 1e-4
    np.testing.assert_allclose(levels.rpm, 600.0 + 200.0 * (levels.time.values - 2.0), rtol=2e-3)
    track = gearlib.order_map(data, orders=[12], variable="acceleration")
    assert np.abs(track.amplitude - math.sqrt(0.5)).max() < 2e-5
    pulses = np.interp(np.arange(int(turns[-1]) + 1), turns, data.time.values)
    by_tacho = gearlib.order_map(data.drop_vars("speed"), tacho=pulses, **options)
    # The first and last pulses have neighbours on one side only.
    assert np.abs(by_tacho.amplitude.values - exact)[3:-3].max() < 1e-4


def test_the_last_revolution_counts_and_powers_have_squared_units():
    # Sums of floats end a little before or behind the last whole revolution.
    for seconds in (0.7, 1.1, 2.0, 2.9):
        t = np.linspace(0.0, seconds, 20_001)
        wave = {"acceleration": ("sample", 3.0 * np.sin(math.tau * 50.0 * t), {"units": "m s-2"})}
        data = xr.Dataset(wave, {"time": ("sample", t), "speed": ("sample", 0.0 * t + 600.0)})
        levels = gearlib.order_map(data, variable="acceleration", amplitude="power", highest=8)
        assert levels.sizes["time"] == round(10.0 * seconds)
        assert np.abs(levels.amplitude.sel(order=5) - 4.5).max() < 1e-6
    assert levels.amplitude.units == "(m s-2)2"
    data.acceleration.attrs["units"] = "m"
    shown = gearlib.order_map(data, variable="acceleration", amplitude="power", highest=8)
    assert shown.amplitude.units == "m2"


@pytest.mark.parametrize(
    ("change", "options", "words"),
    [
        ({}, {"highest": 1e4}, "highest = 10000.0 is not allowed: it must be at most"),
        ({}, {"variable": "x"}, "variable = 'x' is not allowed"),
        ({}, {"tacho": [0.0, 1.0]}, "tacho is not allowed: it must be at least four increasing"),
        ({"speed": -1.0}, {}, "speed is not allowed: it must be > 0 at all samples"),
        ({"acceleration": math.nan}, {}, "acceleration is not allowed"),
        ({"time": 0.0}, {}, "time is not allowed: it must "),
        ({"speed": None}, {}, "tacho = None is not allowed for a dataset without"),
    ],
)
def test_what_has_no_orders_is_refused(change, options, words):
    data, _ = chirp()
    for name, value in change.items():
        data = data.drop_vars(name) if value is None else data.copy(deep=True)
        if value is not None:
            data[name][100] = value
    with pytest.raises(ValueError, match=words):
        gearlib.order_map(data, **{"variable": "acceleration"} | options)
