"""Measured curves beside a model: what needs no calibration does not change with it.

All sets here are synthetic: sweeps and sums of waves written by the tests.
"""

import math

import numpy as np
import pytest
import yaml

from gearlib import sweep
from gearlib.data.gathering import gather_resonance
from gearlib.figures import resonance_figure
from gearlib.studies import measured as study
from tests.paper import PAPER

PAIR = PAPER.replace(material_damping=3953.7)
UNKNOWN = {"gain": "unknown", "offset": "unknown"}


@pytest.fixture(scope="module")
def resonance():
    """The characteristics of the pair, as the workflow gathers them."""
    tunings = np.round(np.arange(0.55, 0.9501, 0.01), 4)
    run = {"periods": 120, "record_periods": 24}
    shards = [
        sweep(PAIR, tunings, direction=to, **run).assign_coords(damping="k", direction=to)
        for to in ("cold", "up", "down")
    ]
    return gather_resonance(shards)


@pytest.fixture
def rig(tmp_path):
    """Write a set of columns and return its path."""

    def write(channels, *columns, **more):
        settings = {"data": "rig.csv", "source": "synthetic", "licence": "own data"}
        settings |= {"synthetic": True, "channels": channels} | more
        rows = [channels, *zip(*columns, strict=True)]
        text = "".join(",".join(map(str, row)) + "\n" for row in rows)
        (tmp_path / "rig.csv").write_text(text)
        (tmp_path / "rig.yaml").write_text(yaml.safe_dump(settings))
        return tmp_path / "rig.yaml"

    return write


@pytest.fixture
def curve(rig, resonance):
    """Return a function that makes measured response curves of the computed sweeps up and down."""

    def measure(factor=1.0, shift=0.0, **channel):
        """Measure factor * displacement_max + shift (um); `channel` are further keys of it."""
        sweeps = resonance.isel(damping=0).sel(direction=["up", "down"])
        height = 1e6 * (sweeps.displacement_max * sweeps.static_deflection).values
        count = height.shape[1]
        columns = np.tile(sweeps.speed.values, 2), np.repeat(["up", "down"], count), height.ravel()
        top = {"observableId": "displacement_max", "unit": "um", "noise": 0.0} | channel
        channels = {"n": {"observableId": "speed", "unit": "rpm"}}
        channels |= {"to": {"observableId": "direction", "unit": 1}, "top": top}
        path = rig(channels, *columns[:2], factor * columns[2] + shift)
        return study.measured_response_curve(path, resonance)

    return measure


def scores(curves, resonance):
    """Return name of a compared quantity -> row of the table, a dict."""
    names, *rows = study.comparison_rows(curves, resonance)
    return {row[1]: dict(zip(names, row, strict=True)) for row in rows}


def test_scores_that_need_no_calibration_do_not_change_with_gain_and_offset(curve, resonance):
    plain, scaled = curve(), curve(factor=1.7, shift=-30.0, **UNKNOWN)
    calibrated, free = (scores([part], resonance) for part in (plain, scaled))
    jumps = calibrated["jump down over jump up"]
    assert jumps["measured"] == free["jump down over jump up"]["measured"] == jumps["computed"]
    assert 0.7 < jumps["measured"] < 0.95 and jumps["calibration"] == "none"
    misfit = "misfit of displacement_max over its range, free gain and offset"
    assert calibrated[misfit]["computed"] < 1e-12 and free[misfit]["computed"] < 1e-12
    peaks = free["highest displacement_max down over up"]
    assert peaks["measured"] == pytest.approx(peaks["computed"], rel=1e-5)
    # A noise of 0 counts as unknown: the standard deviation is empty, not 0.
    assert peaks["standard_deviation"] == "" == calibrated[misfit]["standard_deviation"]
    # The misfit "as calibrated" exists for the calibrated sensor only.
    sensor = "misfit of displacement_max over its range, as calibrated"
    assert calibrated[sensor]["computed"] < 1e-12 and sensor not in free
    assert calibrated[sensor]["calibration"] == "sensor"
    # The figure draws the scaled set in open markers, fitted to the model: at the same points.
    figure = resonance_figure.draw(resonance, measured=[plain, scaled], forces=True)
    lines = [line for axes in figure.axes for line in axes.lines]
    points = [line for line in lines if line.get_marker() in "^v" and line.get_markersize() == 3.0]
    assert len(points) == 4 and points[2].get_markerfacecolor() == "none"
    assert np.allclose(points[0].get_ydata(), points[2].get_ydata(), rtol=1e-9)


def test_a_jump_is_a_step_that_stands_alone():
    speed = np.linspace(1000.0, 2000.0, 101)
    step = np.where(speed < 1503.0, 1.0, 3.0) + 0.3 * np.sin(speed / 100.0)
    mixed = np.random.default_rng(2).permutation(speed.size)
    at, std = study.jump(speed[mixed], step[mixed])
    assert at == 1505.0 and std == pytest.approx(10.0 / math.sqrt(12.0))
    for smooth in (np.tanh((speed - 1500.0) / 25.0), np.ones(speed.size), speed):
        assert math.isnan(study.jump(speed, smooth)[0])
    assert math.isnan(study.jump(speed[:3], step[:3])[0])


def test_harmonics_of_a_time_history_are_those_it_was_made_of(rig):
    amplitudes, phases = np.array([5.0, 2.0, 1.0, 0.5, 0.25]), np.array([0.4, 1.0, -0.7, 2.0, 0.1])
    orders, rate = np.arange(1, 6), 2.0 * np.pi * 3333.0 / 60.0 * 24
    time = np.sort(np.random.default_rng(3).uniform(0.0, 1.0, 3000))
    waves = np.cos(np.outer(rate * (time + 0.7), orders) + phases)
    channels = {"t": {"observableId": "time", "unit": "s"}}
    channels["x"] = {"observableId": "displacement", "unit": "um"}
    conditions = {"one": {"speed": "3333 rpm"}}
    path = rig(channels, time, 7.0 + waves @ amplitudes, conditions=conditions)
    run = {"periods": 240, "record_periods": 24, "samples_per_period": 32}
    course = study.time_history_harmonics(path, {"k": PAIR.as_dict()}, run).squeeze()
    assert course.amplitude.values == pytest.approx(1e-6 * amplitudes, rel=1e-9)
    shape = np.radians(course.shape_phase.values) - (phases - orders * phases[0])
    assert np.cos(shape) == pytest.approx(1.0, abs=1e-12)
    # The computed displacement is drawn over one period, closed, from the top of its first wave.
    samples = course.computed.values[:-1]
    wave = np.fft.rfft(samples)[1:3] * 2.0 / samples.size  # harmonics 1 and 2
    assert np.angle(wave[0]) == pytest.approx(0.0, abs=0.05)
    assert np.abs(wave) == pytest.approx(course.computed_amplitude.values[:2], rel=0.03)
