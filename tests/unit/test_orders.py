"""Orders of runs and of sampled signals; duty points of gears, models and trains."""

import math

import numpy as np
import pytest
import xarray as xr

import gearlib
from gearlib import GearPair, LoadSharingPair, duty_point, orders, simulate
from gearlib.geometry import GearStage, SpurGear, dynamic_factor
from tests.geometry.stages import own
from tests.physics.test_order_maps import OPTIONS, assert_orders, ramp

COMMON = {"contact_ratio": 1.569, "stiffness_ratio": 0.5879, "teeth": 24}
LOSING = GearPair.from_ratios(damping=0.02, backlash_ratio=0.5, backlash_damping=0.01, **COMMON)


def run(pair=LOSING, tuning=1.0, **more):
    """Simulate a pair that loses contact and record whole revolutions."""
    return simulate(pair, tuning, **{"periods": 600, "record_periods": 24} | more)


def test_the_balance_of_every_order_holds():
    """If both dampings are equal, the equation of motion holds for each harmonic w > 0.

    It is (-w^2 + i w d) X + F / nu^2 = 0, with and without contact. The mean force is the load.
    """
    pair = GearPair.from_ratios(damping=0.03, backlash_ratio=0.5, backlash_damping=0.03, **COMMON)
    spectrum = orders(run(pair, 0.66, periods=1500, samples_per_period=2048), count=40)
    orders_of_mesh = spectrum.mesh_order.values[24::24]
    x, force = (
        spectrum[f"{name}_amplitude"].values[24::24]
        * np.exp(1j * spectrum[f"{name}_phase"].values[24::24])
        for name in ("error", "force")
    )
    stiffness = x * (orders_of_mesh**2 - 1j * orders_of_mesh * 0.06 / 0.66) * 0.66**2
    assert np.abs(stiffness - force).max() < 1e-6
    assert spectrum.force_amplitude.values[0] == pytest.approx(1.0, abs=1e-8)


def test_errors_decrease_with_the_samples_and_are_estimated():
    """The error estimates must bound the differences from a run with many samples."""
    few, more, many = (orders(run(samples_per_period=n), count=4) for n in (64, 256, 4096))
    for name in ("force", "error"):
        exact = many[f"{name}_amplitude"].values
        errors = [
            np.abs(spectrum[f"{name}_amplitude"].values - exact).max() for spectrum in (few, more)
        ]
        assert errors[1] < 0.1 * errors[0] < 1e-3 * exact.max()
        for error, spectrum in zip(errors, (few, more), strict=True):
            assert error <= spectrum[f"{name}_amplitude_error"].values.max()
    with pytest.raises(ValueError, match="samples_per_period = 32 is not allowed for these orders"):
        orders(run(samples_per_period=32), count=4)


def test_runs_without_whole_revolutions_are_refused():
    with pytest.raises(ValueError, match="multiple of 24"):
        orders(run(periods=3, record_periods=3))
    with pytest.raises(ValueError, match="with rotating bodies"):
        model = gearlib.DeadZoneOscillator(upper_stiffness=1.0, lower_stiffness=1.0, load=0.3)
        orders(simulate(model, 1.0, periods=3))
    assert orders(run(record_periods=2)).order.values[1] == 12.0


def test_orders_of_a_known_signal_are_recovered_by_speed_or_tacho():
    """The signal has three known waves; its overall level follows from their amplitudes."""
    data, turns = ramp(600.0, 1800.0, jitter=0.0)
    revolutions = turns(data.time.values)
    data = data.assign_coords(time=data.time + 2.0)
    levels = gearlib.order_map(data, teeth=24, **OPTIONS)
    assert levels.sizes["time"] == int(revolutions[-1]) and float(levels.teeth) == 24.0
    assert_orders(levels, 2e-5)
    assert np.abs(levels.overall - math.sqrt(2.5)).max() < 1e-4
    np.testing.assert_allclose(levels.rpm, 600.0 + 200.0 * (levels.time.values - 2.0), rtol=2e-3)
    track = gearlib.order_map(data, orders=[3], variable="acceleration")
    assert np.abs(track.amplitude - math.sqrt(0.5)).max() < 2e-5
    pulses = np.interp(np.arange(int(revolutions[-1]) + 1), revolutions, data.time.values)
    by_tacho = gearlib.order_map(data.drop_vars("speed"), tacho=pulses, **OPTIONS)
    # Blocks next to the first and last pulses are less accurate.
    assert_orders(by_tacho.isel(time=slice(3, -3)))


def test_the_last_revolution_counts_and_powers_have_squared_units():
    """The last whole revolution must count, and a wave of amplitude 3 has the power 4.5."""
    # Sums of floats end slightly before or after the last whole revolution.
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
        ({}, {"tacho": [0.0, 1.0]}, r"tacho = \[0.0, 1.0\] is not .*four increasing"),
        ({"speed": math.inf}, {}, r"speed\[100\] = inf is not allowed: it must be finite"),
        ({"acceleration": -math.inf}, {}, r"acceleration\[100\] = -inf is not .* NaN"),
        ({"time": 0.0}, {}, r"time\[100\] = 0.0 is not allowed: it must be later"),
        ({}, {"pulses_per_revolution": 60}, "pulses_per_revolution = 60 is not .* 1 without tacho"),
        ({"speed": None}, {}, "tacho is missing: it is required for a dataset without"),
    ],
)
def test_signals_without_orders_are_refused(change, options, words):
    data, _ = ramp(600.0, 1800.0)
    for name, value in change.items():
        data = data.drop_vars(name) if value is None else data.copy(deep=True)
        if value is not None:
            data[name][100] = value
    with pytest.raises(ValueError, match=words):
        gearlib.order_map(data, **{"variable": "acceleration"} | options)


MESH = own(quality=5)


def test_a_duty_point_matches_the_settled_run_in_si_units():
    """Compare forces, errors and orders with a long run and with ISO 6336."""
    point = duty_point(MESH, 6000.0, torque=85.0, damping_ratio=0.05)
    pair = LoadSharingPair.from_geometry(MESH, torque=85.0, damping_ratio=0.05)
    run = simulate(pair, speed=6000.0, periods=1000)
    assert point.mesh_frequency_hertz == pytest.approx(6000.0 / 60.0 * 23, rel=1e-12)
    assert point.static_force == pytest.approx(85.0 / (MESH.pinion.base_diameter / 2), rel=1e-12)
    assert point.dynamic_factor == pytest.approx(float(run.dynamic_force_max), rel=1e-9)
    assert point.mesh_force_max == pytest.approx(point.dynamic_factor * point.static_force)
    peak_to_peak = float(run.displacement_max - run.displacement_min) * pair.static_deflection
    assert point.error_peak_to_peak == pytest.approx(peak_to_peak, rel=1e-9)
    power = (point.mesh_order_error.values**2).sum() / 2.0
    assert point.error_rms.item() ** 2 == pytest.approx(power, rel=1e-4)
    assert point.iso_dynamic_factor == dynamic_factor(MESH, 85.0, 6000.0).factor
    # The motion repeats and is never without drive-side contact.
    assert point.settled == 1 and point.contact_loss_fraction == pytest.approx(0.0, abs=1e-12)
    assert all({"units", "long_name"} <= value.attrs.keys() for value in point.data_vars.values())


def test_mesh_orders_hidden_by_free_vibrations_are_nan():
    """Mesh orders close to a free vibration that persists must be NaN, all others finite."""
    # Undamped free vibrations persist and hide the mesh orders close to their frequency.
    mesh = GearStage(*(SpurGear(teeth=z, module=4e-3, width=0.032) for z in (19, 47)), backlash=0.0)
    options = {"damping_ratio": 0.0, "initial_state": (0.0, 0.0), "options": {"coupling": 1.0}}
    point = duty_point(mesh, 700.0, torque=210.0, **options)
    assert point.settled == 0 and point.dynamic_factor > 1.5
    # All other orders have values.
    assert 0 < np.isnan(point.mesh_order_force.values).sum() < 3


def test_bearings_of_six_degrees_and_trains_carry_the_load():
    """Bearings must carry the static mesh force if the stiffness of the mesh is constant."""
    pair = GearPair.from_geometry(MESH, torque=85.0, damping_ratio=0.05)
    bodies = {"base_radii": (0.027, 0.0716), "inertias": (1e-4, 5e-3), "masses": (0.4, 2.5)}
    bearings = {"bearing_stiffness": (1e8,) * 4, "bearing_damping": (500.0,) * 4}
    six_degrees = gearlib.SixDegreePair(pair=pair.replace(contact_ratio=2.0), **bodies, **bearings)
    # At constant stiffness the bearings carry the static mesh force.
    forces = duty_point(six_degrees, 3000.0).bearing_force_max.values
    assert forces == pytest.approx([pair.load] * 2, rel=1e-6)
    train = duty_point(gearlib.two_stage(pair), 3000.0)
    assert train.mesh_force_max.dims == ("mesh",) and train.bearing_force_max.dims == ("body",)
    # A model has a load of its own, while gear geometry needs a torque.
    with pytest.raises(ValueError, match="torque = 1"):
        duty_point(pair, 3000.0, torque=1.0)
    with pytest.raises(ValueError, match="torque is missing"):
        duty_point(MESH, 3000.0)
