"""``gearlib fit``: what a file says, what options say, what is printed, written and refused."""

import numpy as np
import pytest
import xarray as xr
import yaml
from click.testing import CliRunner

import gearlib
from gearlib.cli import main
from gearlib.uncertainty.synthetic_rigs import synthetic_rig
from tests.paper import PAPER

TRUTH = PAPER.replace(material_damping=3953.7, backlash_damping=3953.7)
LOW, HIGH = TRUTH.speed(0.6), TRUTH.speed(0.72)
COURSE = [(0.0, float(LOW)), (0.4, float(HIGH))]
DATA = synthetic_rig(TRUTH, COURSE, 1)
NOISE = 1e6 * DATA.displacement.noise_std
SAID = {
    "data": "rig.csv",
    "title": "Rig 1",
    "source": "computed for this test",
    "licence": "own data",
    "synthetic": True,
    "channels": {
        "t": {"observableId": "time", "unit": "s"},
        "x": {"observableId": "displacement", "unit": "um", "noise": NOISE, "offset": "unknown"},
    },
    "known": {
        "max_stiffness": "4e5 N/mm",
        "stiffness_ratio": 0.5879,
        "contact_ratio": 1.569,
        "load": "3.2895396 kN",
        "backlash": "40 um",
        "backlash_damping": 3953.7,
        "teeth": 24,
        "damping": "unknown",
        "course": [list(row) for row in COURSE],
    },
    "fit": {"free": {"material_damping": [1000, 9000], "reduced_mass": ["2600 g", 3.7]}},
}


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Write a measured set into an empty folder and call the command."""
    monkeypatch.chdir(tmp_path)
    write()
    return lambda *arguments: CliRunner().invoke(main, ["fit", "rig.yaml", *arguments])


def write(rows=None, **changes):
    table = np.c_[DATA.time.values, 1e6 * DATA.displacement.values] if rows is None else rows
    np.savetxt("rig.csv", table, delimiter=",", header="t,x", comments="", fmt="%.9g")
    with open("rig.yaml", "w", encoding="utf-8") as file:
        yaml.safe_dump(SAID | changes, file)


def test_what_the_file_says_is_fitted(run):
    done = run("-o", "fit.nc")
    assert done.exit_code == 0, done.output
    said = done.output.splitlines()
    assert said[1] == "Rig 1, synthetic: computed for this test" and "[[Variables]]" in said
    # The middle of its bounds, digit by digit: the number of steps can hang on the last one.
    middle = (2.6 + 3.7) / 2.0
    guess = TRUTH.replace(material_damping=5000.0, reduced_mass=middle, load=3289.5396)
    free = {"material_damping": (1000.0, 9000.0), "reduced_mass": (2.6, 3.7)}
    expected = gearlib.fit(guess, gearlib.read_measured("rig.yaml"), free)
    assert str(expected) in done.output
    found = xr.load_dataset("fit.nc")
    own = expected.dataset()
    own["identifiable"] = own.identifiable.astype(found.identifiable.dtype)
    # Units are converted on one way only, and differences make more of the rounding.
    xr.testing.assert_allclose(found, own, rtol=1e-8)
    assert found.parameter.values.tolist() == [*free]
    assert found.parameter_units.values.tolist() == ["N s m-1", "kg"]
    for name, one in expected.params.items():
        assert abs(one.value - getattr(TRUTH, name)) < 4.0 * one.stderr
        assert one.init == getattr(guess, name)


def test_options_come_before_the_file(run):
    asked = ["--free", "reduced_mass", "--free", "load=2 kN,5 kN"]
    done = run(*asked, "--material-damping", "3.9537 N s/mm", "--load", "3 kN", "-o", "fit.csv")
    assert done.exit_code == 0, done.output
    with open("fit.csv", encoding="utf-8") as file:
        head, *rows = [line.split(",") for line in file.read().splitlines()]
    found = {row[0]: dict(zip(head, row, strict=True)) for row in rows}
    assert set(found) == {"reduced_mass", "load"}
    assert float(found["load"]["initial_value"]) == 3000.0
    assert float(found["load"]["range_high"]) == 5000.0
    assert float(found["load"]["fitted_value"]) == pytest.approx(3289.5, rel=0.01)


def test_no_bound_of_the_backlash_is_told_where_no_tooth_leaves_its_flank(run):
    write(TABLE[: 9 * len(TABLE) // 10])
    asked = ["--free", "backlash=10um,90um", "--free", "reduced_mass"]
    done = run(*asked, *REST)
    assert done.exit_code == 0, done.output
    said = "contact is never lost in what is compared; nothing tells how large it is"
    assert said in " ".join(done.output.split()), done.output


def test_a_picture_is_drawn_and_nothing_replaced(run, tmp_path):
    done = run("--plot", "fit.png")
    assert done.exit_code == 0 and "drawn in fit.png" in done.output, done.output
    (tmp_path / "fit.nc").write_text("mine", encoding="utf-8")
    for option, name in (("-o", "fit.nc"), ("--plot", "fit.png")):
        done = run(option, name)
        assert done.exit_code == 2 and f"{name} exists" in done.output
    assert (tmp_path / "fit.nc").read_text(encoding="utf-8") == "mine"


REST = ["--reduced-mass", "3.1", "--material-damping", "4000"]
KNOWN = SAID["known"]
TABLE = np.c_[DATA.time.values, 1e6 * DATA.displacement.values]


def test_the_command_says_how_many_revolutions_are_left_out(run):
    write(TABLE[(TABLE[:, 0] < 0.25) | (TABLE[:, 0] > 0.27)])
    done = run()
    assert done.exit_code == 0, done.output
    assert "Warning: 2 of 11 revolutions are left out of the run-up" in done.stderr


@pytest.mark.parametrize(
    ("rows", "changes", "options", "says"),
    [
        ([], {}, [], "rig.csv' is not allowed: it must be a file with rows: it has none"),
        (TABLE[:, :1].repeat(3, 1), {}, [], "must"),
        (
            np.where(np.arange(len(TABLE))[:, None] == [9, 7], np.nan, TABLE),
            {},
            [],
            "row 10, is empty or",
        ),
        (np.c_[TABLE[:, 0] // 0.01, TABLE[:, 1]], {}, [], "column 't'"),
        (None, {"channels": {"t": SAID["channels"]["t"], "y": SAID["channels"]["x"]}}, [], "'y'"),
        (
            None,
            {"channels": SAID["channels"] | {"x": SAID["channels"]["x"] | {"unit": "kN"}}},
            [],
            "channels.x.unit = 'kN' is not allowed",
        ),
        (
            None,
            {"fit": {"free": {"load": ["2 kN", "5 kg"]}}},
            [],
            "free.load = ['2 kN', '5 kg'] is n",
        ),
        (None, {"fit": {"free": {"load": [2000.0]}}}, [], "fit.free.load"),
        (
            None,
            {"fit": {"free": {"mass": ["2 kg", "3 kg"]}}},
            [],
            "two values, each a finite number in SI",
        ),
        (
            None,
            {"known": KNOWN | {"course": [[0, 2450], [1, "3 rpm"]]}},
            [],
            "course: speed[1][1] =",
        ),
        (None, {"known": KNOWN | {"course": 2450}}, [], "known.course: speed = 2450"),
        (None, {"known": KNOWN | {"course": []}}, [], "known.course: speed = [] is not allowed"),
        (
            None,
            {"known": KNOWN | {"course": [[0, 2450], [0.1, 3000]]}},
            [],
            "time = '0 to 0.399994 s' is not allowed: it must be within known.course, 0 to 0.1 s",
        ),
        (TABLE[:30], {}, [], "it must be of more than 12 whole revolutions of known.course, not 0"),
        (None, {"fit": {"fre": {}}}, [], "fit.fre"),
        (
            None,
            {"fit": {}},
            [],
            "--free is missing: give NAME=LOW,HIGH, or fit.free in rig.yaml",
        ),
        (None, {}, ["--free", "load"], "free.load = [] is not allowed: it must be two values"),
        (
            None,
            {},
            ["--free", "weight=1,2", *REST],
            "free = 'weight' is not allowed: it must be one of",
        ),
        (None, {}, ["--free", "load=1 kN,2 kN", *REST], "a range that holds load = 3289.54"),
        (None, {"known": {}}, [], "max_stiffness is missing"),
    ],
)
def test_what_is_not_in_order_is_refused_in_a_sentence(run, rows, changes, options, says):
    write(rows, **changes)
    done = run(*options, "-o", "fit.nc")
    assert done.exit_code == 2, done.output
    told = " ".join(done.output.partition("Error: ")[2].split())
    assert says in told and "Traceback" not in told, told
    assert not isinstance(done.exception, ValueError)
