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
COURSE = [(0.0, float(TRUTH.speed(0.6))), (0.4, float(TRUTH.speed(0.72)))]
DATA = synthetic_rig(TRUTH, COURSE, 1)
TABLE = np.c_[DATA.time.values, 1e6 * DATA.displacement.values]
KNOWN = {"max_stiffness": "4e5 N/mm", "stiffness_ratio": 0.5879, "contact_ratio": 1.569}
KNOWN |= {"load": "3.2895396 kN", "backlash": "40 um", "backlash_damping": 3953.7, "teeth": 24}
KNOWN |= {"damping": "unknown", "course": [list(row) for row in COURSE]}
SETTINGS = {
    "data": "rig.csv",
    "title": "Rig 1",
    "source": "computed for this test",
    "licence": "own data",
    "synthetic": True,
    "channels": {
        "t": {"observableId": "time", "unit": "s"},
        "x": {"observableId": "displacement", "unit": "um", "offset": "unknown"},
    },
    "known": KNOWN,
    "fit": {"free": {"material_damping": [1000, 9000], "reduced_mass": ["2600 g", 3.7]}},
}
SETTINGS["channels"]["x"]["noise"] = 1e6 * DATA.displacement.noise_std
FIXED = ["--reduced-mass", "3.1", "--material-damping", "4000"]


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Write a measured set into an empty folder and call the command on it."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments, table=TABLE, **changes):
        np.savetxt("rig.csv", table, delimiter=",", header="t,x", comments="", fmt="%.9g")
        (tmp_path / "rig.yaml").write_text(yaml.safe_dump(SETTINGS | changes), encoding="utf-8")
        return CliRunner().invoke(main, ["fit", "rig.yaml", *arguments])

    return call


def test_the_settings_of_the_file_are_fitted_and_results_are_not_replaced(run):
    result = run("-o", "fit.nc", "--plot", "fit.png")
    assert result.exit_code == 0 and "drawn in fit.png" in result.output, result.output
    lines = result.output.splitlines()
    assert lines[1] == "Rig 1, synthetic: computed for this test" and "[[Variables]]" in lines
    # A fit starts from the middle of the bounds, computed as in the library: another last digit may
    # change its number of steps.
    middle = (2.6 + 3.7) / 2.0
    guess = TRUTH.replace(material_damping=5000.0, reduced_mass=middle, load=3289.5396)
    free = {"material_damping": (1000.0, 9000.0), "reduced_mass": (2.6, 3.7)}
    expected = gearlib.fit(guess, gearlib.read_measured("rig.yaml"), free)
    assert str(expected) in result.output
    stored, computed = xr.load_dataset("fit.nc"), expected.dataset()
    computed["identifiable"] = computed.identifiable.astype(stored.identifiable.dtype)
    # The command converts units of the file: its rounding grows in derivatives by differences.
    xr.testing.assert_allclose(stored, computed, rtol=1e-8)
    assert stored.parameter.values.tolist() == [*free]
    assert stored.parameter_units.values.tolist() == ["N s m-1", "kg"]
    for name, parameter in expected.params.items():
        assert abs(parameter.value - getattr(TRUTH, name)) < 4.0 * parameter.stderr
        assert parameter.init == getattr(guess, name)
    for option, name in (("-o", "fit.nc"), ("--plot", "fit.png")):
        result = run(option, name)
        assert result.exit_code == 2 and f"{name} exists" in result.output


REFUSED = [
    ([], {"fit": {"free": {"load": ["2 kN", "5 kg"]}}}, "free.load = ['2 kN', '5 kg'] is n"),
    ([], {"fit": {"free": {"load": [2000.0]}}}, "fit.free.load"),
    ([], {"fit": {"free": {"mass": ["2 kg", "3 kg"]}}}, "two values, each a finite number in SI"),
    ([], {"fit": {"fre": {}}}, "fit.fre"),
    ([], {"fit": {}}, "--free is missing: give NAME=LOW,HIGH, or fit.free in rig.yaml"),
    (["--free", "load"], {}, "free.load = [] is not allowed: it must be two values"),
    (["--free", "weight=1,2", *FIXED], {}, "free = 'weight' is not allowed: it must be one of"),
    (["--free", "load=1 kN,2 kN", *FIXED], {}, "a range that holds load = 3289.54"),
    ([], {"known": {}}, "max_stiffness is missing"),
    ([], {"known": KNOWN | {"course": 2450}}, "known.course: speed = 2450"),
    ([], {"table": TABLE[:, :1].repeat(3, 1)}, "must"),
]


@pytest.mark.parametrize(("options", "changes", "words"), REFUSED)
def test_what_is_not_in_order_is_refused_in_a_sentence(run, options, changes, words):
    result = run(*options, "-o", "fit.nc", **changes)
    assert result.exit_code == 2, result.output
    assert words in " ".join(result.output.partition("Error: ")[2].split()), result.output
    assert not isinstance(result.exception, ValueError)
