"""Measured sets, all synthetic here: read, in SI, or refused; how a model is compared with them."""

import json
import math
import re

import numpy as np
import pytest
import yaml

from gearlib import read_measured, sweep
from gearlib.data.gathering import gather_resonance
from gearlib.data.storage import read, write
from gearlib.figures import resonance_figure
from gearlib.studies import measured as study
from tests.paper import PAPER_PAIR
from tests.sentences import assert_sentence

CHANNELS = {
    "t": {"observableId": "time", "unit": "ms"},
    "x": {"observableId": "displacement", "unit": "µm", "noise": "500 nm", "offset": "unknown"},
    "F": {"observableId": "dynamic_force", "unit": "kN", "sensor": "strain gauge", "noise": 0.01},
}
X_AND_FORCE = {key: CHANNELS[key] for key in ("x", "F")}
SETTINGS = {"data": "rig.csv", "source": "synthetic", "licence": "own data", "channels": CHANNELS}
TABLE = "t,x,F,other\n0,1.5,2,a\n1,2.5,2.5,b\n2,-3,2.75,c\n"
LONG = (
    "observableId,simulationConditionId,measurement,time,noiseParameters\n"
    "x,up,1.5,0,0.1\nx,up,1.6,1,0.2\nF,up,3,1,\nx,down,1,0,0.2\nF,down,1,inf,0.2\nF,down,2,inf,\n"
)


@pytest.fixture
def written(tmp_path):
    """Return a function that writes a synthetic measured set and returns its path.

    A change to None removes a key.
    """

    def written(table=TABLE, **changes):
        """Write a table, or none, and the settings with changes."""
        settings = {key: value for key, value in (SETTINGS | changes).items() if value is not None}
        if table is not None:
            data = table if isinstance(table, bytes) else table.encode()
            (tmp_path / settings.get("data", "rig.csv")).write_bytes(data)
        text = yaml.safe_dump(settings, allow_unicode=True)
        (tmp_path / "rig.yaml").write_text(text, encoding="utf-8")
        return tmp_path / "rig.yaml"

    return written


@pytest.fixture
def rig(written):
    """Return a function that writes a synthetic measured set and reads it."""
    return lambda *table, **changes: read_measured(written(*table, **changes))


def channels(**changes):
    """Return the channels with some keys changed, as in channels(x={"unit": ...})."""
    return {"channels": {key: keys | changes.get(key, {}) for key, keys in CHANNELS.items()}}


def test_a_wide_table_is_read_in_si(rig, tmp_path):
    """Check values, attributes and known quantities, and that the dataset can be stored."""
    data = rig(known={"backlash": "80 um", "load": 3e3, "ramp_rate": None})
    assert data.time.values == pytest.approx([0.0, 1e-3, 2e-3], rel=1e-15)
    assert data.displacement.values == pytest.approx([1.5e-6, 2.5e-6, -3e-6], rel=1e-15)
    assert data.dynamic_force.values == pytest.approx([2000.0, 2500.0, 2750.0], rel=1e-15)
    x, force = data.displacement.attrs, data.dynamic_force.attrs
    assert (x["units"], x["noise_std"], x["unknown_offset"]) == ("m", 5e-7, 1)
    assert (force["units"], force["noise_std"], force["sensor"]) == ("N", 10.0, "strain gauge")
    assert json.loads(data.attrs["known"]) == {"backlash": 8e-5, "load": 3e3, "ramp_rate": None}
    assert "reduced_mass" in data.not_said and "backlash" not in data.not_said
    assert "ramp_rate" in data.not_said
    assert (data.repairs, data.not_read, data.synthetic) == ("", "other", 0)
    write(data, tmp_path / "rig.nc")
    assert read(tmp_path / "rig.nc").displacement.identical(data.displacement)


@pytest.mark.parametrize(
    ("unit", "observable", "factor", "units"),
    [
        ("Hz", "speed", 60.0, "min-1"),
        ("rad/s", "speed", 30.0 / np.pi, "min-1"),
        ("1", "displacement_max", 1.0, "1"),
        ("deg", "angle_shaft_2", np.pi / 180.0, "rad"),
        ("kN", "bearing_force_y3", 1e3, "N"),
        ("Nm", "torque", 1.0, "N m"),
        ("m/s^2", "order_amplitude", 1.0, "m s-2"),
        ("g", "acceleration", 9.80665, "m s-2"),
        ("um", "order_amplitude_z", 1e-6, "m"),
        ("percent", "contact_loss_fraction", 1e-2, "1"),
    ],
)
def test_units_of_measured_data_match_the_library(rig, unit, observable, factor, units):
    """Measured values must be converted by `factor` to the units of the library."""
    more = {"c": {"observableId": observable, "unit": unit}, "x": CHANNELS["x"]}
    column = rig("c,x\n1,1\n2,1\n", channels=more)[observable]
    assert column.values == pytest.approx([factor, 2.0 * factor], rel=1e-15)
    assert column.attrs["units"] == units


def test_a_long_table_is_read_in_si(rig):
    """Check samples of two conditions in a table with one row per value."""
    speeds = {"jump_down": {"value": "2500 rpm", "noise": "50 Hz"}}
    conditions = {"up": {"direction": "up", "speed": "20 Hz"}}
    conditions["down"] = {"direction": "down", "speed": 900}
    # LONG has a row for each value of the channels x (um) and F (kN).
    data = rig(LONG, channels=X_AND_FORCE, conditions=conditions, speeds=speeds)
    assert data.condition.values.tolist() == ["up", "up", "down", "down", "down"]
    assert data.direction.values.tolist() == [1, 1, -1, -1, -1]
    assert data.speed.values.tolist() == [1200.0, 1200.0, 900.0, 900.0, 900.0]
    assert data.time.values.tolist() == [0.0, 1.0, 0.0, np.inf, np.inf]
    nan = np.nan
    assert np.allclose(data.displacement * 1e6, [1.5, 1.6, 1.0, nan, nan], equal_nan=True)
    assert np.allclose(data.dynamic_force, [nan, 3e3, nan, 1e3, 2e3], equal_nan=True)
    # A row without noise has the noise of its channel.
    assert np.allclose(data.dynamic_force_noise_std.values[[1, 3, 4]], [10.0, 200.0, 10.0])
    assert (float(data.jump_down), data.jump_down.noise_std) == (2500.0, 3000.0)


def test_sorting_by_time_within_conditions_is_recorded_as_a_repair(rig):
    table = "d,t,x\ndown,1,10\nup,2,20\ndown,0,0\nup,0,0\ndown,2,20\nup,1,10\n"
    direction = {"observableId": "direction", "unit": "1"}
    data = rig(table, channels={"d": direction, "t": CHANNELS["t"], "x": CHANNELS["x"]})
    assert data.repairs == "samples sorted by time, each condition apart"
    # The condition that occurs first comes first.
    assert data.direction.values.tolist() == [-1] * 3 + [1] * 3
    assert data.time.values == pytest.approx([0.0, 1e-3, 2e-3] * 2, rel=1e-15)
    assert data.displacement.values == pytest.approx([0.0, 1e-5, 2e-5] * 2, rel=1e-15)


def test_empty_cells_are_read_as_gaps_and_reported(rig):
    data = rig("t,x,F\n0,1,1\n1,,1\n2,3,1\n", **channels(x={"gaps": True}))
    assert data.repairs == "displacement: 1 empty cells are not measured"
    assert np.isnan(data.displacement.values).tolist() == [False, True, False]


def test_tables_in_other_encodings_separators_and_date_formats_are_read(rig):
    """Read decimal commas, byte order marks, dates and numbers with many digits."""
    german = 'Prüfstand "7"\nt;x;F\n# Pause\n0;1,5;2\n1;2,5;2,5\n'
    table_format = {"separator": ";", "decimal": ",", "comment": "#", "skip": 1}
    for encoding in ("utf-8", "latin-1", "utf-16"):
        data = rig(german.encode(encoding), encoding=encoding, **table_format)
        assert data.displacement.values == pytest.approx([1.5e-6, 2.5e-6])
    data = rig(b"\xef\xbb\xbf" + TABLE.replace("\n", "\r\n").encode())
    assert data.dynamic_force.values[1] == 2500.0
    dates = "t,x,F\n2026-01-01T23:59:59.5Z,1,1\n2026-01-02T00:00:01Z,1,1\n"
    assert rig(dates, **channels(t={"unit": "ISO 8601"})).time.values.tolist() == [0.0, 1.5]
    digits = "0.12345678901234567"
    data = rig(f"t,x,F\n0,{digits},1\n", **channels(x={"unit": "m"}))
    assert data.displacement.values[0] == float(digits)


DIRECTION = {"channels": CHANNELS | {"other": {"observableId": "direction", "unit": "1"}}}
#: Table and changed settings for each sentence of refusal; `...` stands for any words.
REFUSED = {
    "source is missing: it must be a text": (TABLE, {"source": None}),
    "data = 'rig.xlsx' ... csv": (TABLE, {"data": "rig.xlsx"}),
    "data = 'rig.csv' ... a file in the same folder": (None, {}),
    "data = 'rig.csv' ... it is empty": ("", {}),
    "data = 'rig.csv' ... utf-8 text": (b"t,x,F\n0,1,1\n\xff\xfe\xb5,1,2\n", {}),
    "the column 'F' of rig.csv is missing: it must be one of 't', 'x'": ("t,x\n0,1\n", {}),
    "the column 'F' ... separator must be ';'": ("t;x;F\n0;1;2\n", {}),
    "the column 'x' of rig.csv occurs more than once": ("t,x,F,x\n0,1,2,3\n", {}),
    "rig.csv, column 'x', row 2 = '2.6mm' ... a number": (TABLE.replace(",2.5,", ",2.6mm,"), {}),
    "rig.csv, column 'x', row 2, is empty or NaN": (TABLE.replace("1,2.5", "1,nan"), {}),
    "rig.csv, column 'F', row 3 = inf ... finite": (TABLE.replace("2.75", "inf"), {}),
    "rig.csv, row 2: it must have 3 cells": ("t,x,F\n0,1,1\n1,1,5,3\n", {}),
    "rig.csv, row 1: it must have 3 cells ... comma": ("t,x,F\n0,0,1,5,2,0\n", {}),
    "rig.csv, column 't' = 0.001 occurs twice, in rows 2 and 4": (TABLE + "1,3,3,c\n", {}),
    "rig.csv, column 'other' = 'a' ... up, down or rest": (TABLE, DIRECTION),
    "channels.x.unit = 'mμ2m' ... dimension of m": (TABLE, channels(x={"unit": "mμ2m"})),
    "channels.x.observableId = 'displacement' ... channels.F has it": (
        TABLE, channels(F={"observableId": "displacement", "unit": "um"})
    ),
    "channels.x.counts_per_turn is missing": (TABLE, channels(x={"unit": "counts"})),
    "known.load = '3 kg' ... dimension of N": (TABLE, {"known": {"load": "3 kg"}}),
    "channels.1 is not allowed as a name ... in quotes": (TABLE, {"channels": {1: CHANNELS["x"]}}),
    "speeds.jump_up.value = 'fast' ... in rpm": (TABLE, {"speeds": {"jump_up": {"value": "fast"}}}),
    "rig.csv, column 'time' = 1 occurs twice for the observableId 'x'": (
        LONG + "x,up,9,1,\n", {"channels": {"x": CHANNELS["x"]}}
    ),
    "channels.c.unit = 'degC' ... K, from absolute zero": (
        "c\n1\n", {"channels": {"c": {"observableId": "temperature", "unit": "degC"}}}
    ),
    "rig.csv, column 'F', row 2 = '2.5' ... a number ... ','": (
        TABLE.replace(",", ";"), {"separator": ";", "decimal": ","}
    ),
    "data = 'rig.csv' ... utf-16 text": (TABLE.encode("utf-16-le"), {"encoding": "utf-16"}),
    "the observableId 'jump_up' of rig.csv occurs 2 times: it must occur once": (
        "observableId,measurement,time\njump_up,47,0\njump_up,48,1\nx,1,0\n",
        {"channels": {"jump_up": {"unit": "Hz"}, "x": CHANNELS["x"]}},
    ),
    "simulationConditionId = 'down' ... one of up": (
        LONG, {"channels": {"x": CHANNELS["x"]}, "conditions": {"up": {"direction": "up"}}}
    ),
}  # fmt: skip


@pytest.mark.parametrize("sentence", REFUSED)
def test_invalid_measured_data_are_refused_in_one_sentence(rig, tmp_path, sentence):
    table, changes = REFUSED[sentence]
    with pytest.raises(ValueError) as refusal:
        rig(table, **changes)
    text = str(refusal.value).removeprefix(f"{tmp_path / 'rig.yaml'}: ")
    assert_sentence(text, sentence, max_length=700)


def universal_file(path, binary=0, **changes):
    """Write a universal file of 50 points, and return their times and the signals by name."""
    import pyuff

    time = np.arange(50) * 1e-3
    signals = {"x": np.sin(90.0 * time), "F": 2.0 + np.cos(70.0 * time)}
    # Codes of the format: a time response (1) in equal steps (1) of displacements (8), no
    # denominator (0), real numbers of double precision (4).
    keys = {"binary": binary, "func_type": 1, "x": time, "num_pts": time.size, "ref_dir": 3}
    keys |= {"rsp_node": 1, "rsp_dir": 3, "ref_node": 1, "abscissa_spacing": 1}
    keys |= {"abscissa_inc": 1e-3, "abscissa_min": 0.0, "ordinate_spec_data_type": 8}
    keys |= {"orddenom_spec_data_type": 0, "ord_data_type": 4} | changes
    sets = [pyuff.prepare_58(id1=name, data=data, **keys) for name, data in signals.items()]
    pyuff.UFF(str(path)).write_sets(sets, "add")
    return time, signals


@pytest.mark.parametrize("binary", [0, 1])
def test_a_universal_file_with_datasets_58_is_read(rig, tmp_path, binary):
    time, signals = universal_file(tmp_path / "rig.uff", binary)
    data = rig(None, data="rig.uff", channels=X_AND_FORCE)
    assert data.time.values == pytest.approx(time, rel=1e-6, abs=1e-12)
    assert data.displacement.values == pytest.approx(1e-6 * signals["x"], rel=1e-6, abs=1e-12)
    assert data.dynamic_force.values == pytest.approx(1e3 * signals["F"], rel=1e-6)
    with pytest.raises(ValueError, match="the channel 'y' of rig.uff is missing: .* 'x', 'F'"):
        rig(None, data="rig.uff", channels={"y": CHANNELS["x"]})
    with pytest.raises(ValueError, match="universal file"):
        rig(b"no\nuff\n", data="rig.uff", channels=X_AND_FORCE)


@pytest.mark.parametrize("changes", [{"binary": 1}, {}, {"abscissa_spacing": 0}])
def test_a_universal_file_ends_at_its_stated_number_of_points(rig, tmp_path, changes):
    """A file must be read up to a smaller stated number of points and refused for a larger one."""
    time, signals = universal_file(tmp_path / "rig.uff", **changes)
    content = (tmp_path / "rig.uff").read_bytes()
    if "binary" not in changes:
        content = b"\n".join(line.ljust(80) for line in content.splitlines())
    stated = [content.replace(b"%10d" % 50, b"%10d" % count) for count in (47, 60)]
    data = rig(stated[0], data="rig.uff", channels=X_AND_FORCE)
    assert data.time.values == pytest.approx(time[:47], rel=1e-6, abs=1e-12)
    assert data.dynamic_force.values == pytest.approx(1e3 * signals["F"][:47], rel=1e-6)
    with pytest.raises(ValueError, match="the set 'F' of rig.uff has 50 points: it must have 60"):
        rig(stated[1], data="rig.uff", channels=X_AND_FORCE)


@pytest.mark.parametrize(
    ("observable", "unit", "label", "factor"),
    [
        ("acceleration", "g", "g", 9.80665),
        ("acceleration", "mm/s^2", "(mm/s²)", 1e-3),
        ("angle", "deg", "DEG", math.pi / 180.0),
        ("acceleration", "m/s^2", "g", None),
        ("acceleration", "m/s^2", "mm/s2", None),
        ("displacement", "um", "V", None),
    ],
)
def test_each_axis_takes_the_unit_of_its_channel(rig, tmp_path, observable, unit, label, factor):
    _, signals = universal_file(tmp_path / "rig.uff", ordinate_axis_units_lab=label)
    channels = {"x": {"observableId": observable, "unit": unit}}
    if factor:
        data = rig(None, data="rig.uff", channels=channels)
        assert data[observable].values == pytest.approx(factor * signals["x"], rel=1e-6, abs=1e-9)
    else:
        with pytest.raises(ValueError, match=f"channels.x.unit = '{re.escape(unit)}' .*'{label}'"):
            rig(None, data="rig.uff", channels=channels)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"abscissa_axis_units_lab": "ms"}, "channels.time.unit = 's' .*'ms'"),
        ({"abscissa_spec_data_type": 18}, "the kind of the abscissa .* = 18 .* 17, time"),
    ],
)
def test_an_abscissa_that_is_not_in_seconds_is_refused(rig, tmp_path, changes, words):
    universal_file(tmp_path / "rig.uff", **changes)
    with pytest.raises(ValueError, match=words):
        rig(None, data="rig.uff", channels=X_AND_FORCE)


def test_a_long_table_may_have_speeds_of_jumps_only(rig):
    table = "observableId,measurement\njump_up,47\n"
    assert rig(table, channels={"jump_up": {"unit": "Hz"}}).jump_up == 2820.0


PAIR = PAPER_PAIR.replace(material_damping=3953.7)
UNKNOWN = {"gain": "unknown", "offset": "unknown"}


@pytest.fixture(scope="module")
def resonance():
    """Return the resonance curves of the pair, gathered as by the workflow."""
    tunings = np.round(np.arange(0.55, 0.9501, 0.01), 4)
    run = {"periods": 120, "record_periods": 24}
    shards = [
        sweep(PAIR, tunings, direction=to, **run).assign_coords(damping="k", direction=to)
        for to in ("cold", "up", "down")
    ]
    return gather_resonance(shards)


def csv(heads, *columns):
    """Return the text of a table with given column heads and columns."""
    rows = [heads, *zip(*columns, strict=True)]
    return "".join(",".join(map(str, row)) + "\n" for row in rows)


@pytest.fixture
def curve(written, resonance):
    """Return a function that makes measured resonance curves, up and down.

    They are factor * displacement_max + shift, in um; further arguments are keys of the channel.
    """

    def measure(factor=1.0, shift=0.0, **channel):
        """Write a measured set and read its resonance curve."""
        sweeps = resonance.isel(damping=0).sel(direction=["up", "down"])
        height = 1e6 * (sweeps.displacement_max * sweeps.static_deflection).values
        count = height.shape[1]
        columns = np.tile(sweeps.speed.values, 2), np.repeat(["up", "down"], count), height.ravel()
        peak = {"observableId": "displacement_max", "unit": "um", "noise": 0.0} | channel
        channels = {"n": {"observableId": "speed", "unit": "rpm"}}
        channels |= {"to": {"observableId": "direction", "unit": 1}, "top": peak}
        table = csv(channels, *columns[:2], factor * columns[2] + shift)
        return study.read_response_curve(written(table, channels=channels), resonance)

    return measure


def scores(curves, resonance):
    """Return the row of the comparison table of each compared quantity, as dicts."""
    names, *rows = study.comparison_rows(curves, resonance)
    return {row[1]: dict(zip(names, row, strict=True)) for row in rows}


def test_scores_that_need_no_calibration_do_not_change_with_gain_and_offset(curve, resonance):
    """Ratios of speeds and peaks and the misfit with free gain must not depend on the sensor."""
    plain, scaled = curve(), curve(factor=1.7, shift=-30.0, **UNKNOWN)
    calibrated = scores([plain], resonance)
    free = scores([scaled], resonance)
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
    # The figure fits the scaled set to the model, so that its open markers lie on the same points.
    figure = resonance_figure.draw_resonance(resonance, measured=[plain, scaled], forces=True)
    lines = [line for axes in figure.axes for line in axes.lines]
    points = [line for line in lines if line.get_marker() in "^v" and line.get_markersize() == 3.0]
    assert len(points) == 4 and points[2].get_markerfacecolor() == "none"
    assert np.allclose(points[0].get_ydata(), points[2].get_ydata(), rtol=1e-9)


def test_differences_are_reported_in_standard_deviations_where_the_noise_is_known(curve, resonance):
    other = resonance.assign(displacement_max=resonance.displacement_max**1.1)
    row = scores([curve(noise=2.0)], other)["highest displacement_max down over up"]
    difference = row["computed"] - row["measured"]
    assert row["difference"] == pytest.approx(difference, abs=1e-4) and difference > 0.1
    assert row["deviations"] == pytest.approx(difference / row["standard_deviation"], rel=1e-4)


def test_a_jump_is_a_single_large_step():
    """A step of one interval is a jump, also for unsorted speeds; steep smooth curves are not."""
    speed = np.linspace(1000.0, 2000.0, 101)
    step = np.where(speed < 1503.0, 1.0, 3.0) + 0.3 * np.sin(speed / 100.0)
    mixed = np.random.default_rng(2).permutation(speed.size)
    jump_speed, std = study.find_jump(speed[mixed], step[mixed])
    assert jump_speed == 1505.0 and std == pytest.approx(10.0 / math.sqrt(12.0))
    for smooth in (np.tanh((speed - 1500.0) / 25.0), np.ones(speed.size), speed):
        assert math.isnan(study.find_jump(speed, smooth)[0])
    assert math.isnan(study.find_jump(speed[:3], step[:3])[0])


def test_harmonics_of_a_synthetic_time_history_are_recovered(written):
    """Amplitudes, and phases relative to the first harmonic, must equal the synthetic ones."""
    amplitudes, phases = np.array([5.0, 2.0, 1.0, 0.5, 0.25]), np.array([0.4, 1.0, -0.7, 2.0, 0.1])
    orders, rate = np.arange(1, 6), 2.0 * np.pi * 3333.0 / 60.0 * 24
    time = np.sort(np.random.default_rng(3).uniform(0.0, 1.0, 3000))
    waves = np.cos(np.outer(rate * (time + 0.7), orders) + phases)
    channels = {"t": {"observableId": "time", "unit": "s"}}
    channels["x"] = {"observableId": "displacement", "unit": "um"}
    conditions = {"one": {"speed": "3333 rpm"}}
    table = csv(channels, time, 7.0 + waves @ amplitudes)
    path = written(table, channels=channels, conditions=conditions)
    run = {"periods": 240, "record_periods": 24, "samples_per_period": 32}
    course = study.compare_time_histories(path, {"k": PAIR}, run).squeeze()
    assert course.amplitude.values == pytest.approx(1e-6 * amplitudes, rel=1e-9)
    shape = np.radians(course.shape_phase.values) - (phases - orders * phases[0])
    assert np.cos(shape) == pytest.approx(1.0, abs=1e-12)
    # The computed curve covers one closed period and starts at the maximum of its first harmonic.
    samples = course.computed.values[:-1]
    # These are harmonics 1 and 2.
    wave = np.fft.rfft(samples)[1:3] * 2.0 / samples.size
    assert np.angle(wave[0]) == pytest.approx(0.0, abs=0.05)
    assert np.abs(wave) == pytest.approx(course.computed_amplitude.values[:2], rel=0.03)


def test_conditions_may_have_different_observables(written):
    conditions = {"up": {"speed": 3000}, "down": {"speed": 2000}}
    rows = [f"{name},{time / 7919},{time % 7}" for name in ("x,up", "F,down") for time in range(20)]
    table = "observableId,simulationConditionId,time,measurement\n" + "\n".join(rows)
    path = written(table, channels=X_AND_FORCE, conditions=conditions)
    run = {"periods": 24, "record_periods": 1, "samples_per_period": 32}
    courses = study.compare_time_histories(path, {"k": PAIR}, run)
    # The first condition has no force, and the second one no displacement.
    np.testing.assert_array_equal(
        np.isnan(courses.amplitude[..., 0]).squeeze(), ~np.eye(2, dtype=bool)
    )
