"""Fits of trains to load sharing and mesh orders, all synthetic."""

import math
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

import gearlib
from gearlib.uncertainty import observation
from gearlib.uncertainty.observations import quantities_of
from gearlib.uncertainty.synthetic_rigs import synthetic_rig
from tests.physics.test_fits import TRUTH

SUN, RING = "max_stiffness of mesh sun 1", "max_stiffness of mesh ring 1"
PIN = "offset of body planet 1, y"
FREE = {SUN: (4e8, 1e9), RING: (4e8, 1e9), PIN: (-3e-5, 3e-5)}
NAMES = (
    "load_sharing_sun_1",
    "load_sharing_sun_2",
    "load_sharing_sun_3",
    "order_amplitude_1_sun_1",
    "order_amplitude_1_ring_1",
    "order_amplitude_2_sun_1",
)
SPEED = 2500.0


def planetary():
    """Return a planetary set whose first pin lies 10 um behind its place."""
    train = gearlib.planetary(
        stiffness_ratio=(0.6, 0.7), pin_errors=((0.0, 1e-5), (0.0, 0.0), (0.0, 0.0))
    )
    return train.replace(reference_frequency=train.reference_angular_frequency / (2.0 * np.pi))


def synthetic_points(model, speed, names):
    """Return values of a settled motion with a noise of 0.3 %."""
    rng = np.random.default_rng(5)
    point = observation.orbit_quantities(model, speed, None, observation.SAMPLES_PER_PERIOD)
    data = xr.Dataset(coords={"speed": ("sample", [speed])})
    for name, which in quantities_of(model, names).items():
        value = observation.mesh_quantity(point, *which)
        attrs = {"noise_std": 0.003 * abs(value)}
        data[name] = "sample", value + rng.normal(0.0, attrs["noise_std"], 1), attrs
    return data


def test_two_stiffnesses_and_a_pin_error_are_found_from_load_sharing_and_orders():
    truth = planetary()
    data = synthetic_points(truth, SPEED, NAMES)
    off = truth.with_values({SUN: 5.5e8, RING: 6.5e8, PIN: 0.0})
    found = gearlib.fit(off, data, FREE)
    assert found.ndata == 6 and found.redchi < 2.6 and not found.unknown
    for name, one in found.params.items():
        low, high = one.interval
        assert low <= truth.value(name) <= high, name
        assert abs(one.value - truth.value(name)) < 5.0 * one.stderr, name
    # The pin error shows in the load sharing: 5 % of a load for 10 um.
    assert found.params[PIN].stderr < 2e-6 and found.params[SUN].stderr < 2e7


def test_an_offset_of_an_axis_is_an_error_of_its_meshes():
    train = planetary()
    tuning = float(train.tuning_at(SPEED))
    # Planet 1 lies at the angle 0: its arms are directions along the lines of action.
    arms = {
        name: train.structure.arms[train.mesh_names.index(name)] for name in ("sun 1", "ring 1")
    }
    which = {"sun 1": 1, "ring 1": 0}
    for k, axis in enumerate("xy"):
        offset, size = f"offset of body planet 1, {axis}", 1e-6
        errors = {f"error of mesh {mesh}": arms[mesh][which[mesh]][k] for mesh in which}
        changes = [
            {offset: train.value(offset) + size},
            {name: train.value(name) + size * arm for name, arm in errors.items()},
        ]
        states = [
            gearlib.periodic_orbit(train.with_values(change), tuning).state for change in changes
        ]
        change = np.abs(states[0] - gearlib.periodic_orbit(train, tuning).state).max()
        assert change > 1e-5 and np.abs(states[1] - states[0]).max() < 1e-7 * change


def test_a_run_up_of_an_idler_tells_its_two_meshes_apart():
    truth = gearlib.idler(TRUTH)
    first, second = (f"max_stiffness of mesh {name}" for name in truth.mesh_names)
    # Both meshes lose contact in it.
    data = synthetic_rig(truth, [(0.0, truth.speed(0.45)), (0.6, truth.speed(0.52))], 1)
    assert data.attrs["synthetic"] == 1 and "displacement_pinion-idler" in data
    free = {name: (0.7 * truth.value(name), 1.4 * truth.value(name)) for name in (first, second)}
    off = truth.with_values({first: 3.9e8, second: 4.1e8})
    found = gearlib.fit(off, data, free)
    for name, one in found.params.items():
        assert abs(one.value - truth.value(name)) < 4.0 * one.stderr < 4e-3 * truth.value(name)


def refused(model, data, free):
    with pytest.raises(ValueError, match="not allowed") as error:
        gearlib.fit(model, data, free)
    return str(error.value)


def test_what_does_not_go_together_is_refused_in_a_sentence():
    free = {"material_damping": (1000.0, 9000.0)}
    low, high = TRUTH.speed(0.6), TRUTH.speed(0.72)
    run_up = synthetic_rig(TRUTH, [(0.0, low), (0.5, high)], 1)
    smooth = gearlib.OneDegreePair(pair=TRUTH, profile=gearlib.Fourier(3))
    assert "OneDegreePair is not allowed in a run-up" in refused(smooth, run_up, free)
    still = gearlib.DeadZoneOscillator(upper_stiffness=1.0, lower_stiffness=1.0, load=0.3)
    assert "nothing turns in it" in refused(still, run_up, free)
    train = planetary()
    points = synthetic_points(TRUTH, 2000.0, ("order_amplitude_1",))
    assert "'mass' is not allowed: it must be one of" in refused(train, points, {"mass": (1, 9e3)})
    # Nothing says of which mesh it is.
    assert "data = " in refused(train, points, {PIN: (-1e-5, 3e-5)})
    points["order_amplitude_1"].attrs["units"] = "N"
    assert "units of order_amplitude_1 = 'N'" in refused(TRUTH, points, free)


def test_settable_parameters_keep_their_names():
    # Two axes that share no value have no name together.
    train = planetary().with_values({"support_damping of body sun, y": 7.0})
    assert "support_damping of body sun" not in train.settable
    # Of a support that is rigid along x, y alone is meant.
    guided = gearlib.split_power_reducer(TRUTH)
    stiff = {"support_stiffness": (math.inf, 1e8), "support_damping": (0.0, 500.0)}
    body = replace(guided.bodies[0], mass=3.0, **stiff)
    guided = guided.replace(bodies=(body, *guided.bodies[1:]))
    assert guided.value(f"support_damping of body {body.name}") == 500.0
    for model in (train, guided):
        for name in model.settable:
            value = model.value(name)
            other = model.with_values({name: value})
            assert other.value(name) == value and other == model, name
    two = train.with_values({"support_stiffness of body sun": 2e8, "error of mesh sun 2": 1e-6})
    assert two.by_name["sun"].support_stiffness == (2e8, 2e8)
    assert two.value("error of mesh sun 2") == 1e-6 and two.value("error of mesh sun 1") == 0.0
    gears = gearlib.SixDegreePair(
        pair=TRUTH,
        base_radii=(0.03, 0.03),
        inertias=(0.0056, 0.0056),
        masses=(3.0, 3.0),
        bearing_stiffness=(1e8,) * 4,
    )
    other = gears.with_values({"masses[1]": 4.0, "masses[0]": 2.0, "load": 3000.0})
    assert other.masses == (2.0, 4.0) and other.load == 3000.0
    assert other.torques == pytest.approx((90.0, 90.0))
