"""Measured curves beside a model: what needs no calibration does not change with it.

All sets here are synthetic: sweeps and sums of waves written by the tests.
"""

import math

import numpy as np
import pytest
import xarray as xr
import yaml

from gearlib import run_up, sweep
from gearlib.data.gathering import gather_resonance
from gearlib.figures import measured_figure, resonance_figure
from gearlib.studies import measured as study
from tests.paper import PAPER

PAIR = PAPER.replace(material_damping=3953.7)
#: Between these tunings the orbit of the sweep up leaves the flank.
ONSET = (0.80, 0.81)
SPEED = {"observableId": "speed", "unit": "rpm"}
WAY = {"observableId": "direction", "unit": 1}


@pytest.fixture(scope="module")
def resonance():
    """The characteristics of the pair, as the workflow gathers them."""
    tunings = np.round(np.arange(0.55, 0.9501, 0.01), 4)
    run = {"periods": 120, "record_periods": 24}
    shards = [
        sweep(PAIR, tunings, direction=way, **run).assign_coords(damping="k", direction=way)
        for way in ("cold", "up", "down")
    ]
    return gather_resonance(shards)


def rig(folder, table, channels, **more):
    said = {"data": "rig.csv", "source": "synthetic", "licence": "own data", "synthetic": True}
    (folder / "rig.csv").write_text(table)
    (folder / "rig.yaml").write_text(yaml.safe_dump(said | {"channels": channels} | more))
    return folder / "rig.yaml"


def curve(folder, resonance, factor=1.0, zero=0.0, noise=0.0, **channel):
    """Return sweeps up and down as a rig would give them, laid over the characteristics."""
    rng, rows = np.random.default_rng(1), []
    for way in ("up", "down"):
        one = resonance.isel(damping=0).sel(direction=way)
        top = one.displacement_max.values * float(one.static_deflection) * 1e6
        top = factor * top + zero + noise * rng.normal(size=top.size)
        rows += [f"{n},{way},{x}\n" for n, x in zip(one.speed.values, top, strict=True)]
    top = {"observableId": "displacement_max", "unit": "um", "noise": noise} | channel
    path = rig(folder, "n,to,top\n" + "".join(rows), {"n": SPEED, "to": WAY, "top": top})
    return study.curve(path, resonance)


def scores(curves, resonance, **more):
    names, *rows = study.rows(curves, resonance, **more)
    return {row[1]: dict(zip(names, row, strict=True)) for row in rows}


def test_what_needs_no_calibration_does_not_change_with_it(tmp_path, resonance):
    plain = scores([curve(tmp_path, resonance)], resonance)
    unknown = {"gain": "unknown", "offset": "unknown"}
    away = curve(tmp_path, resonance, factor=1.7, zero=-30.0, **unknown)
    other = scores([away], resonance)
    jumps = plain["jump down over jump up"]
    assert jumps["measured"] == other["jump down over jump up"]["measured"] == jumps["computed"]
    assert 0.7 < jumps["measured"] < 0.95 and jumps["calibration"] == "none"
    free = "misfit of displacement_max over its range, free gain and offset"
    assert plain[free]["computed"] < 1e-12 and other[free]["computed"] < 1e-12
    peaks = other["highest displacement_max down over up"]
    assert peaks["measured"] == pytest.approx(peaks["computed"], rel=1e-5)
    # Nobody said a noise: none is known, which is not 0.
    assert peaks["standard_deviation"] == "" == plain[free]["standard_deviation"]
    # What needs the sensor is said of the one that has its calibration only.
    sensor = "misfit of displacement_max over its range, as calibrated"
    assert plain[sensor]["computed"] < 1e-12 and sensor not in other
    assert list(plain)[0] == "jump down over jump up" and plain[sensor]["calibration"] == "sensor"
    # The picture shows them where the model is.
    shown = (away.displacement_max - away.displacement_max.fitted_offset).values
    plain = curve(tmp_path, resonance).displacement_max.values
    assert shown / away.displacement_max.fitted_gain == pytest.approx(plain, rel=1e-9)


@pytest.mark.parametrize("own", [0, 1])
def test_gain_and_offset_are_those_of_the_damping_that_suits_best(tmp_path, resonance, own):
    # Of another shape: no line leads from one to the other.
    other = resonance.assign(displacement_max=resonance.displacement_max**2)
    both = [resonance, other.assign_coords(damping=["other"])]
    both = xr.concat(both if own == 0 else both[::-1], "damping", data_vars="minimal")
    unknown = {"gain": "unknown", "offset": "unknown"}
    scale = 1e6 * float(resonance.static_deflection)
    attrs = curve(tmp_path, resonance, 1.7, -30.0, **unknown).displacement_max.attrs
    found = study.curve(tmp_path / "rig.yaml", both).displacement_max.attrs
    for name, value in (("fitted_gain", 1.7), ("fitted_offset", -30.0 / scale)):
        assert found[name] == pytest.approx(attrs[name], rel=1e-12)
        # Of six digits in the table.
        assert found[name] == pytest.approx(value, rel=1e-5)


def test_another_model_is_told_apart_in_standard_deviations(tmp_path, resonance):
    noisy = curve(tmp_path, resonance, noise=0.3)
    found = scores([noisy], resonance)
    assert abs(found["jump down over jump up"]["deviations"]) < 2.0
    assert (
        0.001 < found["misfit of displacement_max over its range, as calibrated"]["computed"] < 0.05
    )
    moved = noisy.assign(jump_up=((), 4000.0, {"noise_std": 5.0}))
    found = scores([moved], resonance)["jump up min-1"]
    assert found["measured"] == 4000.0 and found["deviations"] < -5.0


def test_a_jump_is_a_step_that_stands_alone():
    speed = np.linspace(1000.0, 2000.0, 101)
    step = np.where(speed < 1503.0, 1.0, 3.0) + 0.3 * np.sin(speed / 100.0)
    rng = np.random.default_rng(2)
    mixed = rng.permutation(speed.size)
    at, std = study.jump(speed[mixed], step[mixed])
    assert at == 1505.0 and std == pytest.approx(10.0 / math.sqrt(12.0))
    for smooth in (np.tanh((speed - 1500.0) / 25.0), np.ones(speed.size), speed):
        assert math.isnan(study.jump(speed, smooth)[0])
    assert math.isnan(study.jump(speed[:3], step[:3])[0])


def test_the_onset_of_contact_loss_is_that_of_the_sweep_up(tmp_path, resonance):
    path = rig(tmp_path, "n,x\n1,1\n", {"n": SPEED, "x": {"observableId": "bounces", "unit": 1}},
               speeds={"onset_of_contact_loss": {"value": 3000.0}})  # fmt: skip
    found = scores([study.curve(path, resonance)], resonance)["onset of contact loss min-1"]
    up = resonance.isel(damping=0).sel(direction="up")
    below, above = (up.sel(tuning=nu, method="nearest") for nu in ONSET)
    assert (float(below.fraction_normal), float(above.fraction_normal) < 1.0) == (1.0, True)
    assert float(below.speed) < found["computed"] < float(above.speed)


def test_a_run_up_gives_the_extremes_of_its_stretches(tmp_path, resonance):
    time = np.linspace(0.0, 40.0, 40_001)
    speed = 1500.0 + 1000.0 * np.interp(time, [0.0, 20.0, 40.0], [0.0, 1.0, 0.0])
    wave = (speed / 1000.0) * np.sin(2.0 * np.pi * 50.0 * time)
    table = "".join(f"{t},{n},{x}\n" for t, n, x in zip(time, speed, wave, strict=True))
    names = {"t": {"observableId": "time", "unit": "s"}, "n": SPEED}
    names["x"] = {"observableId": "displacement", "unit": "mm"}
    found = study.curve(rig(tmp_path, f"t,n,x\n{table}", names), resonance)
    scale = 1e-6 / float(resonance.static_deflection)
    assert found.sizes["sample"] > 300
    assert found.displacement_max.values == pytest.approx(scale * found.speed.values, rel=2e-3)
    assert found.displacement_min.values == pytest.approx(-scale * found.speed.values, rel=2e-3)
    assert set(found.direction.values[:190]) == {1} and set(found.direction.values[-190:]) == {-1}


def test_harmonics_of_a_course_are_those_it_was_made_of(tmp_path, resonance):
    speed, shift, amplitudes = 3333.0, 0.7, (5.0, 2.0, 1.0, 0.5, 0.25)
    phases = (0.4, 1.0, -0.7, 2.0, 0.1)
    rate = 2.0 * np.pi * speed / 60.0 * 24
    time = np.sort(np.random.default_rng(3).uniform(0.0, 1.0, 3000))
    x = 7.0 + sum(
        a * np.cos(k * rate * (time + shift) + p)
        for k, (a, p) in enumerate(zip(amplitudes, phases, strict=True), 1)
    )
    table = "t,x\n" + "".join(
        f"{t!r},{one!r}\n" for t, one in zip(time.tolist(), x.tolist(), strict=True)
    )
    names = {"t": {"observableId": "time", "unit": "s"}}
    names["x"] = {"observableId": "displacement", "unit": "um"}
    path = rig(tmp_path, table, names, conditions={"one": {"speed": f"{speed} rpm"}})
    run = {"periods": 240, "record_periods": 24, "samples_per_period": 32}
    found = study.courses(path, {"k": PAIR.as_dict()}, run).squeeze()
    assert found.amplitude.values == pytest.approx(1e-6 * np.array(amplitudes), rel=1e-9)
    shape = [math.degrees(p - k * phases[0]) for k, p in enumerate(phases, 1)]
    assert np.cos(np.radians(found.shape_phase.values - shape)) == pytest.approx(1.0, abs=1e-12)
    # The model against itself: its own course, at any phase, with any gain and offset.
    own = found.computed.values[:-1]
    wave = np.fft.rfft(own)[1:6]
    assert np.angle(wave[0]) == pytest.approx(0.0, abs=0.05)
    assert 2.0 / own.size * np.abs(wave[:2]) == pytest.approx(
        found.computed_amplitude.values[:2], rel=0.03
    )


def test_orders_of_a_run_up_are_those_of_the_model_that_made_it(tmp_path, resonance):
    run = run_up(PAIR, 2600.0, 3600.0, duration=4.0, samples_per_period=40)
    x = 1e6 * run.displacement.values * 1.3 + 5.0
    rows = zip(run.time.values.tolist(), run.speed.values.tolist(), x.tolist(), strict=True)
    table = "t,n,x\n" + "".join(f"{t!r},{n!r},{one!r}\n" for t, n, one in rows)
    names = {"t": {"observableId": "time", "unit": "s"}, "n": SPEED}
    names["x"] = {"observableId": "displacement", "unit": "um", "gain": "unknown"}
    others = {"k": PAIR.as_dict(), "light": (PAIR.replace(material_damping=1500.0)).as_dict()}
    found = study.orders(rig(tmp_path, table, names), others)
    own = found.sel(damping="k").squeeze()
    gain = (own.amplitude / own.computed_amplitude).sel(order=1).values
    # All whole revolutions: 3,100 rpm in the mean of 4 s.
    assert gain == pytest.approx(1.3, rel=0.02) and own.sizes["block"] == 206
    both = resonance.assign_coords(damping=["k"])
    score = scores([], both, orders=[found])
    ratio = score["largest order 2z of displacement over order z"]
    assert ratio["computed"] == pytest.approx(ratio["measured"], rel=0.02)
    # Each observable by itself.
    other = found.assign(amplitude=found.amplitude * (found.order + 1.0))
    other = other.assign_coords(observable=["velocity"])
    every = scores([], both, orders=[xr.concat([found, other], "observable", data_vars="minimal")])
    second = every["largest order 2z of velocity over order z"]["measured"]
    assert second == pytest.approx(1.5 * ratio["measured"], rel=1e-5)
    light = found.sel(damping="light").squeeze().computed_amplitude
    assert np.abs(light / own.computed_amplitude - 1.0).sel(order=1).values.max() > 0.05
    assert len(measured_figure.draw_orders([found]).axes) == 3
    lines = table.splitlines(keepends=True)
    gap = lines[: len(lines) // 2] + lines[len(lines) // 2 + 1000 :]
    with pytest.warns(UserWarning, match="2 of 206 blocks of revolutions are left out"):
        part = study.orders(rig(tmp_path, "".join(gap), names), others)
    there = np.isfinite(part.amplitude.values)
    assert part.amplitude.values[there] == pytest.approx(found.amplitude.values[there], rel=1e-9)


def test_pictures_hold_the_points(tmp_path, resonance):
    unknown = {"gain": "unknown"}
    measured = [curve(tmp_path, resonance), curve(tmp_path, resonance, factor=2.0, **unknown)]
    figure = resonance_figure.draw(resonance, measured=measured, forces=True)
    (axes,) = [one for one in figure.axes if one.get_legend()]
    words = [text.get_text() for text in axes.get_legend().get_texts()]
    assert words[1:] == ["measured: rig", "measured: rig"]
    points = [
        line for line in axes.lines if line.get_marker() in "^v" and line.get_markersize() == 3.0
    ]
    assert len(points) == 4 and points[2].get_markerfacecolor() == "none"
    assert np.allclose(points[0].get_ydata(), points[2].get_ydata(), rtol=1e-9)
