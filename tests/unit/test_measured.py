"""Check how measured sets are read in SI units or refused, and how models are compared with them.

All sets are synthetic.
"""

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
LONG_TABLE = (
    "observableId,simulationConditionId,measurement,time,noiseParameters\n"
    "x,up,1.5,0,0.1\nx,up,1.6,1,0.2\nF,up,3,1,\nx,down,1,0,0.2\nF,down,1,inf,0.2\nF,down,2,inf,\n"
)


@pytest.fixture
def write_set(tmp_path):
    """Return a function that writes a measured set and returns the path of its settings."""

    def write(table=TABLE, **changes):
        """Write a table, unless it is None, and the settings with changes; None removes a key."""
        settings = {key: value for key, value in (SETTINGS | changes).items() if value is not None}
        if table is not None:
            data = table if isinstance(table, bytes) else table.encode()
            (tmp_path / settings.get("data", "rig.csv")).write_bytes(data)
        text = yaml.safe_dump(settings, allow_unicode=True)
        (tmp_path / "rig.yaml").write_text(text, encoding="utf-8")
        return tmp_path / "rig.yaml"

    return write


@pytest.fixture
def read_set(write_set):
    """Return a function that writes a synthetic measured set and reads it."""
    return lambda *table, **changes: read_measured(write_set(*table, **changes))


def changed_channels(**changes):
    """Return settings of the channels, in which the keys of some are changed.

    A change is given by the name of its channel, as in changed_channels(x={"unit": "mm"}).
    """
    return {"channels": {name: keys | changes.get(name, {}) for name, keys in CHANNELS.items()}}


def test_a_wide_table_is_read_in_si(read_set, tmp_path):
    """Values, attributes and known quantities must be in SI units, and survive storage."""
    data = read_set(known={"backlash": "80 um", "load": 3e3, "ramp_rate": None})
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
def test_units_of_measured_data_match_the_library(read_set, unit, observable, factor, units):
    """The values 1 and 2 must be multiplied by `factor` to get the units of the library."""
    channels = {"c": {"observableId": observable, "unit": unit}, "x": CHANNELS["x"]}
    variable = read_set("c,x\n1,1\n2,1\n", channels=channels)[observable]
    assert variable.values == pytest.approx([factor, 2.0 * factor], rel=1e-15)
    assert variable.attrs["units"] == units


def test_a_long_table_is_read_in_si(read_set):
    """A table with one row per value must become one sample per condition and time."""
    speeds = {"jump_down": {"value": "2500 rpm", "noise": "50 Hz"}}
    conditions = {"up": {"direction": "up", "speed": "20 Hz"}}
    conditions["down"] = {"direction": "down", "speed": 900}
    # The table has values of the channels x (um) and F (kN).
    data = read_set(LONG_TABLE, channels=X_AND_FORCE, conditions=conditions, speeds=speeds)
    assert data.condition.values.tolist() == ["up", "up", "down", "down", "down"]
    assert data.direction.values.tolist() == [1, 1, -1, -1, -1]
    assert data.speed.values.tolist() == [1200.0, 1200.0, 900.0, 900.0, 900.0]
    assert data.time.values.tolist() == [0.0, 1.0, 0.0, np.inf, np.inf]
    nan = np.nan
    assert np.allclose(data.displacement * 1e6, [1.5, 1.6, 1.0, nan, nan], equal_nan=True)
    assert np.allclose(data.dynamic_force, [nan, 3e3, nan, 1e3, 2e3], equal_nan=True)
    # A value without noise in its row has the noise of its channel, 10 N.
    assert np.allclose(data.dynamic_force_noise_std.values[[1, 3, 4]], [10.0, 200.0, 10.0])
    assert (float(data.jump_down), data.jump_down.noise_std) == (2500.0, 3000.0)


def test_sorting_by_time_within_conditions_is_recorded_as_a_repair(read_set):
    """Samples must be sorted by time within each condition, and the dataset must say so."""
    table = "d,t,x\ndown,1,10\nup,2,20\ndown,0,0\nup,0,0\ndown,2,20\nup,1,10\n"
    direction = {"observableId": "direction", "unit": "1"}
    data = read_set(table, channels={"d": direction, "t": CHANNELS["t"], "x": CHANNELS["x"]})
    assert data.repairs == "samples sorted by time, each condition apart"
    # Conditions keep the order in which they first occur.
    assert data.direction.values.tolist() == [-1] * 3 + [1] * 3
    assert data.time.values == pytest.approx([0.0, 1e-3, 2e-3] * 2, rel=1e-15)
    assert data.displacement.values == pytest.approx([0.0, 1e-5, 2e-5] * 2, rel=1e-15)


def test_empty_cells_are_read_as_gaps_and_reported(read_set):
    data = read_set("t,x,F\n0,1,1\n1,,1\n2,3,1\n", **changed_channels(x={"gaps": True}))
    assert data.repairs == "displacement: 1 empty cells are not measured"
    assert np.isnan(data.displacement.values).tolist() == [False, True, False]


def test_tables_in_other_encodings_separators_and_date_formats_are_read(read_set):
    """Decimal commas, byte order marks, dates and numbers with many digits must be read exactly."""
    german = 'Prüfstand "7"\nt;x;F\n# Pause\n0;1,5;2\n1;2,5;2,5\n'
    table_format = {"separator": ";", "decimal": ",", "comment": "#", "skip": 1}
    for encoding in ("utf-8", "latin-1", "utf-16"):
        data = read_set(german.encode(encoding), encoding=encoding, **table_format)
        assert data.displacement.values == pytest.approx([1.5e-6, 2.5e-6])
    data = read_set(b"\xef\xbb\xbf" + TABLE.replace("\n", "\r\n").encode())
    assert data.dynamic_force.values[1] == 2500.0
    dates = "t,x,F\n2026-01-01T23:59:59.5Z,1,1\n2026-01-02T00:00:01Z,1,1\n"
    assert read_set(dates, **changed_channels(t={"unit": "ISO 8601"})).time.values.tolist() == [
        0.0,
        1.5,
    ]
    digits = "0.12345678901234567"
    data = read_set(f"t,x,F\n0,{digits},1\n", **changed_channels(x={"unit": "m"}))
    assert data.displacement.values[0] == float(digits)


DIRECTION_CHANNEL = {"channels": CHANNELS | {"other": {"observableId": "direction", "unit": "1"}}}
#: Table and changed settings by the message that refuses them; `...` stands for any words.
INVALID_SETS = {
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
    "rig.csv, column 'other' = 'a' ... up, down or rest": (TABLE, DIRECTION_CHANNEL),
    "channels.x.unit = 'mμ2m' ... dimension of m": (TABLE, changed_channels(x={"unit": "mμ2m"})),
    "channels.x.observableId = 'displacement' ... channels.F has it": (
        TABLE, changed_channels(F={"observableId": "displacement", "unit": "um"})
    ),
    "channels.x.counts_per_turn is missing": (TABLE, changed_channels(x={"unit": "counts"})),
    "known.load = '3 kg' ... dimension of N": (TABLE, {"known": {"load": "3 kg"}}),
    "channels.1 is not allowed as a name ... in quotes": (TABLE, {"channels": {1: CHANNELS["x"]}}),
    "speeds.jump_up.value = 'fast' ... in rpm": (TABLE, {"speeds": {"jump_up": {"value": "fast"}}}),
    "rig.csv, column 'time' = 1 occurs twice for the observableId 'x'": (
        LONG_TABLE + "x,up,9,1,\n", {"channels": {"x": CHANNELS["x"]}}
    ),
    "channels.c.unit = 'degC' ... K, from absolute zero": (
        "c\n1\n", {"channels": {"c": {"observableId": "temperature", "unit": "degC"}}}
    ),
    "rig.csv, column 'F', row 2 = '2.5' ... a number ... ','": (
        TABLE.replace(",", ";"), {"separator": ";", "decimal": ","}
    ),
    "data = 'rig.csv' ... utf-16 text": (TABLE.encode("utf-16-le"), {"encoding": "utf-16"}),
    "the observableId 'jump_up' of rig.csv occurs 2 times: it must occur only once": (
        "observableId,measurement,time\njump_up,47,0\njump_up,48,1\nx,1,0\n",
        {"channels": {"jump_up": {"unit": "Hz"}, "x": CHANNELS["x"]}},
    ),
    "simulationConditionId = 'down' ... one of up": (
        LONG_TABLE, {"channels": {"x": CHANNELS["x"]}, "conditions": {"up": {"direction": "up"}}}
    ),
}  # fmt: skip


@pytest.mark.parametrize("sentence", INVALID_SETS)
def test_invalid_measured_data_are_refused_in_one_sentence(read_set, tmp_path, sentence):
    """The message must begin with the path of the settings, followed by the expected sentence."""
    table, changes = INVALID_SETS[sentence]
    with pytest.raises(ValueError) as refusal:
        read_set(table, **changes)
    text = str(refusal.value).removeprefix(f"{tmp_path / 'rig.yaml'}: ")
    assert_sentence(text, sentence, max_length=700)


def universal_file(path, binary=0, **changes):
    """Write two signals of 50 points to a universal file; return the times and signals by name.

    `binary` is 1 for a binary file and 0 for text. `changes` replace keys of the datasets.
    """
    import pyuff

    time = np.arange(50) * 1e-3
    signals = {"x": np.sin(90.0 * time), "F": 2.0 + np.cos(70.0 * time)}
    # Codes of the format: time response (func_type 1), equal steps (abscissa_spacing 1),
    # displacement (8), no denominator (0), real numbers of double precision (4).
    keys = {"binary": binary, "func_type": 1, "x": time, "num_pts": time.size, "ref_dir": 3}
    keys |= {"rsp_node": 1, "rsp_dir": 3, "ref_node": 1, "abscissa_spacing": 1}
    keys |= {"abscissa_inc": 1e-3, "abscissa_min": 0.0, "ordinate_spec_data_type": 8}
    keys |= {"orddenom_spec_data_type": 0, "ord_data_type": 4} | changes
    sets = [pyuff.prepare_58(id1=name, data=data, **keys) for name, data in signals.items()]
    pyuff.UFF(str(path)).write_sets(sets, "add")
    return time, signals


@pytest.mark.parametrize("binary", [0, 1])
def test_a_universal_file_with_datasets_58_is_read(read_set, tmp_path, binary):
    """Signals in um and kN must be read in SI units; unknown names and other files are refused."""
    time, signals = universal_file(tmp_path / "rig.uff", binary)
    data = read_set(None, data="rig.uff", channels=X_AND_FORCE)
    assert data.time.values == pytest.approx(time, rel=1e-6, abs=1e-12)
    assert data.displacement.values == pytest.approx(1e-6 * signals["x"], rel=1e-6, abs=1e-12)
    assert data.dynamic_force.values == pytest.approx(1e3 * signals["F"], rel=1e-6)
    with pytest.raises(ValueError, match="the channel 'y' of rig.uff is missing: .* 'x', 'F'"):
        read_set(None, data="rig.uff", channels={"y": CHANNELS["x"]})
    with pytest.raises(ValueError, match="universal file"):
        read_set(b"no\nuff\n", data="rig.uff", channels=X_AND_FORCE)


@pytest.mark.parametrize("changes", [{"binary": 1}, {}, {"abscissa_spacing": 0}])
def test_a_universal_file_ends_at_its_stated_number_of_points(read_set, tmp_path, changes):
    """If the stated number of points is too small, further points are ignored.

    If it is larger than the number of points in the file, the file must be refused.
    """
    time, signals = universal_file(tmp_path / "rig.uff", **changes)
    content = (tmp_path / "rig.uff").read_bytes()
    if "binary" not in changes:
        content = b"\n".join(line.ljust(80) for line in content.splitlines())
    content_with_47, content_with_60 = (
        content.replace(b"%10d" % 50, b"%10d" % count) for count in (47, 60)
    )
    data = read_set(content_with_47, data="rig.uff", channels=X_AND_FORCE)
    assert data.time.values == pytest.approx(time[:47], rel=1e-6, abs=1e-12)
    assert data.dynamic_force.values == pytest.approx(1e3 * signals["F"][:47], rel=1e-6)
    with pytest.raises(ValueError, match="the set 'F' of rig.uff has 50 points: it must have 60"):
        read_set(content_with_60, data="rig.uff", channels=X_AND_FORCE)


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
def test_the_unit_of_an_axis_must_agree_with_its_channel(
    read_set, tmp_path, observable, unit, label, factor
):
    """A label of the axis with the unit of the channel is accepted, any other refused.

    `factor` converts the unit to SI; it is None for labels that must be refused.
    """
    _, signals = universal_file(tmp_path / "rig.uff", ordinate_axis_units_lab=label)
    channels = {"x": {"observableId": observable, "unit": unit}}
    if factor is not None:
        data = read_set(None, data="rig.uff", channels=channels)
        assert data[observable].values == pytest.approx(factor * signals["x"], rel=1e-6, abs=1e-9)
    else:
        with pytest.raises(ValueError, match=f"channels.x.unit = '{re.escape(unit)}' .*'{label}'"):
            read_set(None, data="rig.uff", channels=channels)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"abscissa_axis_units_lab": "ms"}, "channels.time.unit = 's' .*'ms'"),
        ({"abscissa_spec_data_type": 18}, "the type of the abscissa .* = 18 .* 17 .time"),
    ],
)
def test_an_abscissa_that_is_not_in_seconds_is_refused(read_set, tmp_path, changes, message):
    universal_file(tmp_path / "rig.uff", **changes)
    with pytest.raises(ValueError, match=message):
        read_set(None, data="rig.uff", channels=X_AND_FORCE)


def test_a_long_table_may_have_speeds_of_jumps_only(read_set):
    table = "observableId,measurement\njump_up,47\n"
    assert read_set(table, channels={"jump_up": {"unit": "Hz"}}).jump_up == 2820.0


PAIR = PAPER_PAIR.replace(material_damping=3953.7)
UNKNOWN_CALIBRATION = {"gain": "unknown", "offset": "unknown"}


@pytest.fixture(scope="module")
def resonance():
    """Return the resonance curves of the pair from rest ("cold"), upwards and downwards."""
    tunings = np.round(np.arange(0.55, 0.9501, 0.01), 4)
    run_options = {"periods": 120, "record_periods": 24}
    shards = []
    for direction in ("cold", "up", "down"):
        measure_curve = sweep(PAIR, tunings, direction=direction, **run_options)
        shards.append(measure_curve.assign_coords(damping="k", direction=direction))
    return gather_resonance(shards)


def csv_text(column_names, *columns):
    """Return the text of a CSV file with given column names and columns."""
    rows = [column_names, *zip(*columns, strict=True)]
    return "".join(",".join(map(str, row)) + "\n" for row in rows)


@pytest.fixture
def measure_curve(write_set, resonance):
    """Return a function that simulates the measurement of resonance curves, up and down."""

    def measure(factor=1.0, shift=0.0, **channel_changes):
        """Write and read a measured set with the values factor * displacement_max + shift, in um.

        `channel_changes` are keys of the channel of the displacement.
        """
        sweeps = resonance.isel(damping=0).sel(direction=["up", "down"])
        displacements = 1e6 * (sweeps.displacement_max * sweeps.static_deflection).values
        speeds = np.tile(sweeps.speed.values, 2)
        directions = np.repeat(["up", "down"], displacements.shape[1])
        channels = {
            "n": {"observableId": "speed", "unit": "rpm"},
            "direction": {"observableId": "direction", "unit": 1},
            "x": {"observableId": "displacement_max", "unit": "um", "noise": 0.0} | channel_changes,
        }
        table = csv_text(channels, speeds, directions, factor * displacements.ravel() + shift)
        return study.read_response_curve(write_set(table, channels=channels), resonance)

    return measure


def comparison_by_quantity(curves, resonance):
    """Return the rows of the comparison table, as dicts by the compared quantity."""
    column_names, *rows = study.comparison_rows(curves, resonance)
    return {row[1]: dict(zip(column_names, row, strict=True)) for row in rows}


def test_scores_that_need_no_calibration_do_not_change_with_gain_and_offset(
    measure_curve, resonance
):
    """A calibrated sensor and one of unknown gain and offset must give equal ratios and misfits.

    The measured curves are computed by the model itself, so that the misfits must be 0.
    """
    calibrated_curve = measure_curve()
    uncalibrated_curve = measure_curve(factor=1.7, shift=-30.0, **UNKNOWN_CALIBRATION)
    calibrated_rows = comparison_by_quantity([calibrated_curve], resonance)
    uncalibrated_rows = comparison_by_quantity([uncalibrated_curve], resonance)
    quantity = "jump down over jump up"
    speed_ratio, measured = calibrated_rows[quantity], uncalibrated_rows[quantity]["measured"]
    assert speed_ratio["measured"] == measured == speed_ratio["computed"]
    assert 0.7 < measured < 0.95 and speed_ratio["calibration"] == "none"
    misfit = "misfit of displacement_max over its range, free gain and offset"
    assert calibrated_rows[misfit]["computed"] < 1e-12
    assert uncalibrated_rows[misfit]["computed"] < 1e-12
    peak_ratio = uncalibrated_rows["highest displacement_max down over up"]
    assert peak_ratio["measured"] == pytest.approx(peak_ratio["computed"], rel=1e-5)
    # A noise of 0 counts as unknown, so that the standard deviation is empty, not 0.
    assert peak_ratio["standard_deviation"] == ""
    assert calibrated_rows[misfit]["standard_deviation"] == ""
    # The misfit "as calibrated" exists for the calibrated sensor only.
    misfit = "misfit of displacement_max over its range, as calibrated"
    assert calibrated_rows[misfit]["computed"] < 1e-12 and misfit not in uncalibrated_rows
    assert calibrated_rows[misfit]["calibration"] == "sensor"


def test_the_figure_fits_an_uncalibrated_curve_to_the_model(measure_curve, resonance):
    """Open markers of the uncalibrated curve must lie on the points of the calibrated one."""
    curves = [measure_curve(), measure_curve(factor=1.7, shift=-30.0, **UNKNOWN_CALIBRATION)]
    figure = resonance_figure.draw_resonance(resonance, measured=curves, forces=True)
    lines = [line for axes in figure.axes for line in axes.lines]
    # Each curve has markers of size 3 for the directions up and down.
    points = [line for line in lines if line.get_marker() in "^v" and line.get_markersize() == 3.0]
    calibrated_up, _, uncalibrated_up, _ = points
    assert uncalibrated_up.get_markerfacecolor() == "none"
    assert np.allclose(calibrated_up.get_ydata(), uncalibrated_up.get_ydata(), rtol=1e-9)


def test_differences_are_reported_in_standard_deviations_where_the_noise_is_known(
    measure_curve, resonance
):
    """A difference must be stated as such and divided by the standard deviation of the ratio."""
    # The computed displacements are changed, so that measured and computed ratios differ.
    changed_resonance = resonance.assign(displacement_max=resonance.displacement_max**1.1)
    rows = comparison_by_quantity([measure_curve(noise=2.0)], changed_resonance)
    row = rows["highest displacement_max down over up"]
    difference = row["computed"] - row["measured"]
    assert row["difference"] == pytest.approx(difference, abs=1e-4) and difference > 0.1
    assert row["deviations"] == pytest.approx(difference / row["standard_deviation"], rel=1e-4)


def test_a_jump_is_a_single_large_step():
    """A step within one interval must be found, but not a smooth curve, however steep it is."""
    speeds = np.linspace(1000.0, 2000.0, 101)
    curve_with_step = np.where(speeds < 1503.0, 1.0, 3.0) + 0.3 * np.sin(speeds / 100.0)
    # The order of the points must not matter.
    order = np.random.default_rng(2).permutation(speeds.size)
    jump_speed, standard_deviation = study.find_jump(speeds[order], curve_with_step[order])
    # The jump lies in the middle of the interval from 1500 to 1510 rpm, and the deviation is that
    # of a uniform distribution of 10 rpm width.
    assert jump_speed == 1505.0 and standard_deviation == pytest.approx(10.0 / math.sqrt(12.0))
    steep_curve = np.tanh((speeds - 1500.0) / 25.0)
    for smooth_curve in (steep_curve, np.ones(speeds.size), speeds):
        assert math.isnan(study.find_jump(speeds, smooth_curve)[0])
    # Three points are too few to find a jump.
    assert math.isnan(study.find_jump(speeds[:3], curve_with_step[:3])[0])


def test_harmonics_of_a_synthetic_time_history_are_recovered(write_set):
    """Amplitudes, and phases relative to the first harmonic, must equal the synthetic ones."""
    amplitudes, phases = np.array([5.0, 2.0, 1.0, 0.5, 0.25]), np.array([0.4, 1.0, -0.7, 2.0, 0.1])
    orders, teeth = np.arange(1, 6), 24
    mesh_frequency = 2.0 * np.pi * 3333.0 / 60.0 * teeth
    time = np.sort(np.random.default_rng(3).uniform(0.0, 1.0, 3000))
    # The time 0 of the measurement has an arbitrary mesh phase.
    harmonics = np.cos(np.outer(mesh_frequency * (time + 0.7), orders) + phases)
    channels = {"t": {"observableId": "time", "unit": "s"}}
    channels["x"] = {"observableId": "displacement", "unit": "um"}
    conditions = {"one": {"speed": "3333 rpm"}}
    table = csv_text(channels, time, 7.0 + harmonics @ amplitudes)
    path = write_set(table, channels=channels, conditions=conditions)
    run_options = {"periods": 240, "record_periods": 24, "samples_per_period": 32}
    comparison = study.compare_time_histories(path, {"k": PAIR}, run_options).squeeze()
    assert comparison.amplitude.values == pytest.approx(1e-6 * amplitudes, rel=1e-9)
    # Phases refer to the time at which the first harmonic has its maximum.
    expected_phases = phases - orders * phases[0]
    phase_errors = np.radians(comparison.shape_phase.values) - expected_phases
    assert np.cos(phase_errors) == pytest.approx(1.0, abs=1e-12)
    # The computed curve starts at the maximum of its first harmonic. Its last point repeats the
    # first one.
    samples = comparison.computed.values[:-1]
    first_two_harmonics = np.fft.rfft(samples)[1:3] * 2.0 / samples.size
    # The tolerances allow for the few samples of the curve.
    assert np.angle(first_two_harmonics[0]) == pytest.approx(0.0, abs=0.05)
    computed_amplitudes = comparison.computed_amplitude.values[:2]
    assert np.abs(first_two_harmonics) == pytest.approx(computed_amplitudes, rel=0.03)


def test_conditions_may_have_different_observables(write_set):
    """Harmonics must be NaN for observables that a condition lacks."""
    conditions = {"up": {"speed": 3000}, "down": {"speed": 2000}}
    rows = [f"{name},{time / 7919},{time % 7}" for name in ("x,up", "F,down") for time in range(20)]
    table = "observableId,simulationConditionId,time,measurement\n" + "\n".join(rows)
    path = write_set(table, channels=X_AND_FORCE, conditions=conditions)
    run_options = {"periods": 24, "record_periods": 1, "samples_per_period": 32}
    comparison = study.compare_time_histories(path, {"k": PAIR}, run_options)
    # Condition "up" has a displacement only, and condition "down" a force only.
    is_missing = np.isnan(comparison.amplitude[..., 0]).squeeze()
    np.testing.assert_array_equal(is_missing, [[False, True], [True, False]])
