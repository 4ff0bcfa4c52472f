"""Speeds in rpm and torques in N m beside tunings and static deflections."""

import math

import numpy as np
import pytest

import gearlib
from gearlib import DeadZoneOscillator, SixDegreePair, split_power_reducer
from tests.paper import PAPER

SIX = SixDegreePair(
    pair=PAPER,
    base_radii=(0.1, 0.08),
    inertias=(0.06, 0.05),
    masses=(17.0, 12.0),
    bearing_stiffness=(1e8,) * 4,
    teeth=(30, 24),
)
TRAIN = split_power_reducer(PAPER)
OSCILLATOR = DeadZoneOscillator(lower_edge=-1.0, upper_stiffness=2.0, damping=0.1)
RUN = {"periods": 4, "samples_per_period": 8}


@pytest.mark.parametrize(("model", "teeth"), [(PAPER, 24), (SIX, 30), (TRAIN, 24)])
def test_a_run_at_a_speed_is_that_at_its_tuning(model, teeth):
    run = gearlib.simulate(model, speed=2000.0, **RUN)
    # So many mesh periods in a second.
    per_second = float(run.mesh_frequency) / (2.0 * math.pi)
    assert per_second == pytest.approx(2000.0 / 60.0 * teeth, rel=1e-12)
    assert float(run.speed) == pytest.approx(2000.0, rel=1e-12)
    assert run.speed.attrs["units"] == "min-1"
    same = gearlib.simulate(model, model.tuning_at(2000.0), **RUN)
    assert same.displacement.equals(run.displacement)


def test_a_sweep_over_speeds_is_that_over_tunings():
    run = {"periods": 20, "record_periods": 4}
    found = gearlib.sweep(PAPER, speeds=[1000.0, 4000.0], **run)
    np.testing.assert_allclose(found.speed, [1000.0, 4000.0], rtol=1e-12)
    assert found.equals(gearlib.sweep(PAPER, PAPER.tuning_at(np.array([1000.0, 4000.0])), **run))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: gearlib.simulate(PAPER, **RUN), "tuning = None with speed = None .* one of the"),
        (
            lambda: gearlib.simulate(PAPER, 0.7, speed=3000.0, **RUN),
            "tuning = 0.7 with speed = 3000.0 .* one of the two",
        ),
        (lambda: gearlib.simulate(PAPER, speed=0.0, **RUN), "speed = 0.0 .* > 0"),
        (lambda: gearlib.simulate(PAPER, speed="3000 rpm", **RUN), "speed = '3000 rpm' .* > 0"),
        (
            lambda: gearlib.simulate(OSCILLATOR, speed=10.0, **RUN),
            "speed = 10.0 .* nothing turns",
        ),
        (
            lambda: gearlib.sweep(PAPER, [0.7], speeds=[3000.0], periods=1, record_periods=1),
            r"tunings = \[0.7\] with speeds = \[3000.0\] ",
        ),
        (
            lambda: gearlib.sweep(PAPER, speeds=[3000.0, -1.0], periods=1, record_periods=1),
            r"speeds\[1\] = -1.0 .* > 0",
        ),
        (
            lambda: gearlib.sweep(PAPER, speeds=[10.0, 10.0], periods=1, record_periods=1),
            "speeds contains 10.0 twice",
        ),
    ],
)
def test_a_wrong_speed_is_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_torques_where_radii_are_known():
    six = gearlib.simulate(SIX, 0.7, **RUN)
    assert float(six.torque) == pytest.approx(PAPER.load * 0.1, rel=1e-12)
    train = gearlib.simulate(TRAIN, 0.7, **RUN)
    torque = train.torque.sel(body="input")
    # Three branches, each with the load of the pair.
    radius = TRAIN.by_name["input"].base_radius
    assert float(torque) == pytest.approx(3.0 * PAPER.load * radius, rel=1e-12)
    assert torque.attrs["units"] == "N m"
    # A pair knows the force alone.
    assert "torque" not in gearlib.simulate(PAPER, 0.7, **RUN)
