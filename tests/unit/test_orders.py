"""Orders of runs and of sampled signals; duty points of gears, models and trains."""

import math

import numpy as np
import pytest
import xarray as xr

import gearlib
from gearlib import GearPair, LoadSharingPair, duty_point, orders, simulate
from gearlib.geometry import GearStage, SpurGear, dynamic_factor
from tests.geometry.stages import documentation_stage
from tests.physics.test_order_maps import ORDER_MAP_OPTIONS, assert_orders, ramp

PAIR_RATIOS = {"contact_ratio": 1.569, "stiffness_ratio": 0.5879, "teeth": 24}
PAIR_WITH_CONTACT_LOSS = GearPair.from_ratios(
    damping=0.02, backlash_ratio=0.5, backlash_damping=0.01, **PAIR_RATIOS
)


def simulate_whole_revolutions(pair=PAIR_WITH_CONTACT_LOSS, tuning=1.0, **options):
    """Simulate a gear pair with 24 teeth and record one revolution by default.

    `options` are further arguments of `simulate`.
    """
    return simulate(pair, tuning, **{"periods": 600, "record_periods": 24} | options)


def test_the_balance_of_every_order_holds():
    """The harmonics of displacement and force must satisfy the equation of motion.

    If damping in contact and in free flight are equal, the equation is linear in displacement X and
    mesh force F: (-w^2 + i w 2 beta / nu) X + F / nu^2 = 0 for each mesh order w > 0, with the
    damping ratio beta and the tuning nu. The mean force is the load.
    """
    beta, nu, teeth = 0.03, 0.66, 24
    pair = GearPair.from_ratios(
        damping=beta, backlash_ratio=0.5, backlash_damping=beta, **PAIR_RATIOS
    )
    spectrum = orders(
        simulate_whole_revolutions(pair, nu, periods=1500, samples_per_period=2048), count=40
    )
    # Every 24th order of the shaft is an order of the mesh.
    w = spectrum.mesh_order.values[teeth::teeth]
    displacement, force = (
        spectrum[f"{name}_amplitude"].values[teeth::teeth]
        * np.exp(1j * spectrum[f"{name}_phase"].values[teeth::teeth])
        for name in ("error", "force")
    )
    expected_force = displacement * (w**2 - 1j * w * 2.0 * beta / nu) * nu**2
    # The bound allows for the error of spectra from 2048 samples per period.
    assert np.abs(expected_force - force).max() < 1e-6
    assert spectrum.force_amplitude.values[0] == pytest.approx(1.0, abs=1e-8)


def test_errors_decrease_with_the_samples_and_are_estimated():
    """The error estimates must bound the differences from a spectrum with many samples."""
    coarse, fine, reference = (
        orders(simulate_whole_revolutions(samples_per_period=count), count=4)
        for count in (64, 256, 4096)
    )
    for name in ("force", "error"):
        exact = reference[f"{name}_amplitude"].values
        errors = [
            np.abs(spectrum[f"{name}_amplitude"].values - exact).max()
            for spectrum in (coarse, fine)
        ]
        assert errors[1] < 0.1 * errors[0] < 1e-3 * exact.max()
        for error, spectrum in zip(errors, (coarse, fine), strict=True):
            assert error <= spectrum[f"{name}_amplitude_error"].values.max()
    with pytest.raises(ValueError, match="samples_per_period = 32 is not allowed for these orders"):
        orders(simulate_whole_revolutions(samples_per_period=32), count=4)


def test_runs_without_whole_revolutions_are_refused():
    """`orders` must refuse 3 mesh periods for gears of 24 teeth, and models without rotation."""
    with pytest.raises(ValueError, match="multiple of 24"):
        orders(simulate_whole_revolutions(periods=3, record_periods=3))
    with pytest.raises(ValueError, match="with rotating bodies"):
        model = gearlib.DeadZoneOscillator(upper_stiffness=1.0, lower_stiffness=1.0, load=0.3)
        orders(simulate(model, 1.0, periods=3))
    # Two mesh periods are a twelfth of a revolution, so that the first order is 12.
    assert orders(simulate_whole_revolutions(record_periods=2)).order.values[1] == 12.0


def test_orders_of_a_known_signal_are_recovered_by_speed_or_tacho():
    """Orders of a signal with known waves must be exact with the speed or with a tacho signal."""
    data, revolutions_at = ramp(600.0, 1800.0, jitter=0.0)
    revolutions = revolutions_at(data.time.values)
    # The origin of time must not matter.
    data = data.assign_coords(time=data.time + 2.0)
    levels = gearlib.order_map(data, teeth=24, **ORDER_MAP_OPTIONS)
    assert levels.sizes["time"] == int(revolutions[-1]) and float(levels.teeth) == 24.0
    assert_orders(levels, 2e-5)
    # The root mean square of waves with the amplitudes 1 and 2 is the root of (1 + 4) / 2.
    assert np.abs(levels.overall - math.sqrt(2.5)).max() < 1e-4
    # The speed rises by 1200 rpm in 6 s.
    np.testing.assert_allclose(levels.rpm, 600.0 + 200.0 * (levels.time.values - 2.0), rtol=2e-3)
    # Without the option `amplitude` the map has root mean squares.
    order_3 = gearlib.order_map(data, orders=[3], variable="acceleration")
    assert np.abs(order_3.amplitude - math.sqrt(0.5)).max() < 2e-5
    pulse_times = np.interp(np.arange(int(revolutions[-1]) + 1), revolutions, data.time.values)
    order_map = gearlib.order_map(data.drop_vars("speed"), tacho=pulse_times, **ORDER_MAP_OPTIONS)
    # Blocks next to the first and last pulses are less accurate.
    assert_orders(order_map.isel(time=slice(3, -3)))


def test_the_last_revolution_counts_and_powers_have_squared_units():
    """A signal of whole revolutions must give all of them, and an amplitude of 3 the power 4.5."""
    speed, frequency, options = 600.0, 50.0, {"amplitude": "power", "highest": 8}
    # The computed angle may end slightly before or after the last revolution, due to rounding.
    for duration in (0.7, 1.1, 2.0, 2.9):
        times = np.linspace(0.0, duration, 20_001)
        signal = 3.0 * np.sin(math.tau * frequency * times)
        data = xr.Dataset(
            {"acceleration": ("sample", signal, {"units": "m s-2"})},
            {"time": ("sample", times), "speed": ("sample", np.full_like(times, speed))},
        )
        order_map = gearlib.order_map(data, variable="acceleration", **options)
        assert order_map.sizes["time"] == round(speed / 60.0 * duration)
        assert np.abs(order_map.amplitude.sel(order=5) - 4.5).max() < 1e-6
    assert order_map.amplitude.units == "(m s-2)2"
    data.acceleration.attrs["units"] = "m"
    order_map = gearlib.order_map(data, variable="acceleration", **options)
    assert order_map.amplitude.units == "m2"


@pytest.mark.parametrize(
    ("changes", "options", "message"),
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
def test_invalid_signals_and_options_of_order_maps_are_refused(changes, options, message):
    """Set sample 100 of some variables to an invalid value, or remove a variable (None)."""
    data, _ = ramp(600.0, 1800.0)
    for name, value in changes.items():
        if value is None:
            data = data.drop_vars(name)
        else:
            data = data.copy(deep=True)
            data[name][100] = value
    with pytest.raises(ValueError, match=message):
        gearlib.order_map(data, **{"variable": "acceleration"} | options)


GEAR_STAGE = documentation_stage(quality=5)


def test_a_duty_point_matches_the_settled_run_in_si_units():
    """Forces, errors and orders must match a settled run, and the factor of ISO 6336."""
    speed, torque, pinion_teeth = 6000.0, 85.0, 23
    point = duty_point(GEAR_STAGE, speed, torque=torque, damping_ratio=0.05)
    pair = LoadSharingPair.from_geometry(GEAR_STAGE, torque=torque, damping_ratio=0.05)
    run = simulate(pair, speed=speed, periods=1000)
    assert point.mesh_frequency_hertz == pytest.approx(speed / 60.0 * pinion_teeth, rel=1e-12)
    base_radius = GEAR_STAGE.pinion.base_diameter / 2
    assert point.static_force == pytest.approx(torque / base_radius, rel=1e-12)
    assert point.dynamic_factor == pytest.approx(float(run.dynamic_force_max), rel=1e-9)
    assert point.mesh_force_max == pytest.approx(point.dynamic_factor * point.static_force)
    peak_to_peak = float(run.displacement_max - run.displacement_min) * pair.static_deflection
    assert point.error_peak_to_peak == pytest.approx(peak_to_peak, rel=1e-9)
    # The mean square of a sum of waves is half the sum of the squared amplitudes.
    mean_square = (point.mesh_order_error.values**2).sum() / 2.0
    assert point.error_rms.item() ** 2 == pytest.approx(mean_square, rel=1e-4)
    assert point.iso_dynamic_factor == dynamic_factor(GEAR_STAGE, torque, speed).factor
    # The motion is periodic and never loses contact.
    assert point.settled == 1 and point.contact_loss_fraction == pytest.approx(0.0, abs=1e-12)
    assert all({"units", "long_name"} <= value.attrs.keys() for value in point.data_vars.values())


def test_mesh_orders_hidden_by_free_vibrations_are_nan():
    """Mesh orders close to the frequency of an undamped free vibration must be NaN.

    Without damping, the vibration persists and cannot be separated from these orders.
    """
    stage = GearStage(
        *(SpurGear(teeth=z, module=4e-3, width=0.032) for z in (19, 47)), backlash=0.0
    )
    options = {"damping_ratio": 0.0, "initial_state": (0.0, 0.0), "options": {"coupling": 1.0}}
    point = duty_point(stage, 700.0, torque=210.0, **options)
    assert point.settled == 0 and point.dynamic_factor > 1.5
    # One or two orders are hidden, and all others are finite.
    assert 0 < np.isnan(point.mesh_order_force.values).sum() < 3


def test_bearings_of_six_degrees_and_trains_carry_the_load():
    """If the mesh stiffness is constant, each bearing must carry the static mesh force."""
    pair = GearPair.from_geometry(GEAR_STAGE, torque=85.0, damping_ratio=0.05)
    bodies = {"base_radii": (0.027, 0.0716), "inertias": (1e-4, 5e-3), "masses": (0.4, 2.5)}
    bearings = {"bearing_stiffness": (1e8,) * 4, "bearing_damping": (500.0,) * 4}
    six_degrees = gearlib.SixDegreePair(pair=pair.replace(contact_ratio=2.0), **bodies, **bearings)
    # With the contact ratio 2 the mesh stiffness is constant.
    forces = duty_point(six_degrees, 3000.0).bearing_force_max.values
    assert forces == pytest.approx([pair.load] * 2, rel=1e-6)
    train = duty_point(gearlib.two_stage(pair), 3000.0)
    assert train.mesh_force_max.dims == ("mesh",) and train.bearing_force_max.dims == ("body",)
    # The load is part of a model, whereas gears given by geometry need a torque.
    with pytest.raises(ValueError, match="torque = 1"):
        duty_point(pair, 3000.0, torque=1.0)
    with pytest.raises(ValueError, match="torque is missing"):
        duty_point(GEAR_STAGE, 3000.0)
