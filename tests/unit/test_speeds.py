"""Speeds in rpm and torques in N m beside tunings and static deflections."""

import math

import numpy as np
import pytest
import yaml

import gearlib
from gearlib import (
    DeadZoneOscillator,
    GearPair,
    SixDegreePair,
    config,
    split_power_reducer,
    tunings,
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


def configured(path, value):
    """Return the project's configuration with a key, by its path, of another value."""
    with open("config.yaml", encoding="utf-8") as file:
        mapping = yaml.safe_load(file)
    node, *keys = mapping, *path
    for key in keys[:-1]:
        node = node[key]
    node[keys[-1]] = value
    return config.load(mapping)


def test_a_grid_in_rpm_is_one_of_tunings():
    grid = {"start": "2000 rpm", "stop": "5000rpm", "step": "20 rpm", "window": "1500 rpm"}
    found = configured(["resonance"], grid)
    pair = GearPair(**found.pair_parameters("k1"))
    section = found.resonance
    values = tunings.grid(section.start, section.stop, section.step)
    # Rounded to 12 decimals of the tuning; step by step that adds up.
    np.testing.assert_allclose(pair.speed(np.array(values)), np.arange(2000, 5001, 20), rtol=1e-9)
    assert values[-1] == section.stop and len(section.windows("cold")) == 2


def test_single_tunings_in_rpm():
    found = configured(["phase_planes", "tunings"], ["3000 rpm", 0.8])
    pair = GearPair(**found.pair_parameters("k1"))
    assert pair.speed(found.phase_planes.tunings[0]) == pytest.approx(3000.0, rel=1e-12)
    assert found.phase_planes.tunings[1] == 0.8
    # Branches take no grid; a case counts with its own gears.
    ends = configured(["branches", "start"], "1500 rpm").branches
    assert pair.speed(ends.start) == pytest.approx(1500.0, rel=1e-12) and ends.stop == 1.4
    case = configured(["basins", "cases", 2, "tuning"], "2000 rpm")
    gears = case.global_parameters(case.basins.cases[2])
    assert gears["stiffness_ratio"] == 0.35
    found = GearPair(**gears).speed(case.basins.cases[2].tuning)
    assert found == pytest.approx(2000.0, rel=1e-12)


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (
            ["labels", "start"],
            "2000 rpm",
            "labels.stop = 1.4 is not allowed: a grid must be",
        ),
        (["labels"], {"start": "2000 rpm"}, "labels.stop is missing: a grid must be in rpm"),
        (
            ["labels"],
            {"start": "2000 rpm", "stop": "2010 rpm", "step": "3 rpm"},
            "labels.stop = '2010 rpm' is not allowed: it must be labels.start = '2000 rpm' plus",
        ),
        (["labels"], dict.fromkeys(("start", "stop", "step"), "0 rpm"), "labels.stop = '0 rpm'"),
        (
            ["labels"],
            {"start": "1 rpm", "stop": "9e99 rpm", "step": "1 rpm"},
            "labels.stop = 2.2",
        ),
        (
            ["labels"],
            {"start": "1 rpm", "stop": "9 rpm", "step": "1e-99 rpm"},
            "labels.stop = '9 rpm'",
        ),
        (["phase_lag", "tuning"], "-3 rpm", "phase_lag.tuning = -0.0007"),
        (["phase_lag", "tuning"], "50 Hz", "phase_lag.tuning = '50 Hz' .* such as '1500 rpm'"),
        (["reducer", "start"], "2000 rpm", "reducer.start = '2000 rpm' .* <= 100$"),
        (["relief_dynamics", "start"], "2000 rpm", "relief_dynamics.start = '2000 rpm' .* <= "),
        (["gear_pair", "backlash"], "3 rpm", "gear_pair.backlash = '3 rpm'"),
    ],
)
def test_a_wrong_speed_in_a_configuration_is_refused(path, value, message):
    with pytest.raises(config.ConfigError, match=message):
        configured(path, value)


def test_refused_gears_alone_are_complained_about():
    grid = {"start": "2000 rpm", "stop": "5000 rpm", "step": "20 rpm"}
    with open("config.yaml", encoding="utf-8") as file:
        mapping = yaml.safe_load(file) | {"labels": grid}
    mapping["gear_pair"]["load"] = -1
    with pytest.raises(config.ConfigError) as refusal:
        config.load(mapping)
    assert str(refusal.value).splitlines()[0].startswith("gear_pair.load = -1")
    assert "labels" not in str(refusal.value)
