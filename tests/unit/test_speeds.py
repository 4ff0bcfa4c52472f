"""Speeds in rpm and torques in N m beside tunings and static deflections."""

import math

import numpy as np
import pytest

import gearlib
from gearlib import (
    DeadZoneOscillator,
    SixDegreePair,
    split_power_reducer,
)
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


def test_scales_of_a_huge_tuning_are_numbers():
    assert PAPER.speed_scales(1e300)["acceleration_scale"] == math.inf


def test_a_sweep_over_speeds_is_that_over_tunings():
    run = {"periods": 20, "record_periods": 4}
    found = gearlib.sweep(PAPER, speeds=[1000.0, 4000.0], **run)
    np.testing.assert_allclose(found.speed, [1000.0, 4000.0], rtol=1e-12)
    assert found.equals(gearlib.sweep(PAPER, PAPER.tuning_at(np.array([1000.0, 4000.0])), **run))


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
