"""Fits: the command gearlib fit, and data that are refused before any model runs."""

import json

import numpy as np
import pytest
import xarray as xr
import yaml
from click.testing import CliRunner

import gearlib
from gearlib.cli import main
from gearlib.uncertainty.observations import observations_of
from gearlib.uncertainty.synthetic_rigs import synthetic_rig
from tests.paper import PAPER_PAIR
from tests.sentences import assert_sentence

TRUTH = PAPER_PAIR.replace(material_damping=3953.7, backlash_damping=3953.7)
COURSE = [(0.0, float(TRUTH.speed(0.6))), (0.4, float(TRUTH.speed(0.72)))]
DATA = synthetic_rig(TRUTH, COURSE, 1)
TABLE = np.c_[DATA.time.values, 1e6 * DATA.displacement.values]
KNOWN = {"max_stiffness": "4e5 N/mm", "stiffness_ratio": 0.5879, "contact_ratio": 1.569}
KNOWN |= {"load": "3.2895396 kN", "backlash": "40 um", "backlash_damping": 3953.7, "teeth": 24}
KNOWN |= {"damping": "unknown", "course": [list(row) for row in COURSE]}
SETTINGS = {"data": "rig.csv", "title": "Rig 1", "source": "computed for this test"}
SETTINGS |= {"licence": "own data", "synthetic": True, "known": KNOWN}
SETTINGS |= {"fit": {"free": {"material_damping": [1000, 9000], "reduced_mass": ["2600 g", 3.7]}}}
HEIGHT = {"observableId": "displacement", "unit": "um", "offset": "unknown"}
HEIGHT["noise"] = 1e6 * DATA.displacement.noise_std
SETTINGS["channels"] = {"t": {"observableId": "time", "unit": "s"}, "x": HEIGHT}
FIXED = ["--reduced-mass", "3.1", "--material-damping", "4000"]


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Return a function that writes a measured set into an empty folder and fits it by command."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments, table=TABLE, **changes):
        """Write the set with changed settings and run the command with further arguments."""
        np.savetxt("rig.csv", table, delimiter=",", header="t,x", comments="", fmt="%.9g")
        (tmp_path / "rig.yaml").write_text(yaml.safe_dump(SETTINGS | changes), encoding="utf-8")
        return CliRunner().invoke(main, ["fit", "rig.yaml", *arguments])

    return call


def test_the_command_fits_with_the_settings_of_its_file(run):
    """Compare the printed and stored fit of the command with `gearlib.fit`."""
    result = run("-o", "fit.nc", "--plot", "fit.png")
    assert result.exit_code == 0 and "plotted to fit.png" in result.output, result.output
    lines = result.output.splitlines()
    # The name of the gears, printed first, may take two lines.
    assert "Rig 1, synthetic: computed for this test" in lines and "[[Variables]]" in lines
    # A fit starts from the middle of the bounds. It is computed here as in the library, because
    # another
    # last digit may change the number of steps.
    middle = (2.6 + 3.7) / 2.0
    guess = TRUTH.replace(material_damping=5000.0, reduced_mass=middle, load=3289.5396)
    free = {"material_damping": (1000.0, 9000.0), "reduced_mass": (2.6, 3.7)}
    fit = gearlib.fit(guess, gearlib.read_measured("rig.yaml"), free)
    assert str(fit) in result.output
    stored, computed = xr.load_dataset("fit.nc"), fit.dataset()
    computed["identifiable"] = computed.identifiable.astype(stored.identifiable.dtype)
    # The command converts units of the file, whose rounding grows in derivatives by differences.
    xr.testing.assert_allclose(stored, computed, rtol=1e-8)
    assert stored.parameter.values.tolist() == [*free]
    assert stored.parameter_units.values.tolist() == ["N s m-1", "kg"]
    for name, parameter in fit.params.items():
        assert parameter.init == getattr(guess, name), name


WRONG_CALLS = [
    ([], {"fit": {"free": {"load": ["2 kN", "5 kg"]}}}, "free.load = ['2 kN', '5 kg'] is n"),
    ([], {"fit": {"free": {"load": [2000.0]}}}, "fit.free.load"),
    (
        [],
        {"fit": {"free": {"mass": ["2 kg", "3 kg"]}}},
        "a list of 2 entries, each a finite number",
    ),
    ([], {"fit": {"fre": {}}}, "fit.fre"),
    ([], {"fit": {}}, "--free is missing: give NAME=LOW,HIGH, or fit.free in rig.yaml"),
    (["--free", "load"], {}, "free.load = [] is not allowed: it must be a list of 2 entries"),
    (["--free", "weight=1,2", *FIXED], {}, "free = 'weight' is not allowed: it must be one of"),
    (["--free", "load=1 kN,2 kN", *FIXED], {}, "a range that holds load = 3289.54"),
    ([], {"known": {}}, "max_stiffness is missing"),
    ([], {"known": KNOWN | {"course": 2450}}, "known.course: speed = 2450"),
    ([], {"table": TABLE[:, :1].repeat(3, 1)}, "must"),
]


@pytest.mark.parametrize(("options", "changes", "words"), WRONG_CALLS)
def test_invalid_settings_of_a_fit_are_refused_in_one_sentence(run, options, changes, words):
    result = run(*options, "-o", "fit.nc", **changes)
    assert result.exit_code == 2, result.output
    assert words in " ".join(result.output.partition("Error: ")[2].split()), result.output
    assert not isinstance(result.exception, ValueError)


TIME = np.arange(2000) * 1e-3


def run_up(values=None, time=TIME, known=None, course=((0.0, 1e3), (2.0, 1.2e3)), **attrs):
    """Return made-up data of a run-up; `attrs` are attributes of the displacement.

    `course` has rows of s and rpm. `known` is a dict of further known values or, to be wrong, a
    text.
    """
    values = np.sin(TIME) if values is None else values
    data = xr.Dataset({"displacement": ("sample", values, {"units": "m"} | attrs)})
    known = json.dumps({"course": course} | (known or {})) if not isinstance(known, str) else known
    return data.assign_coords(time=("sample", time)).assign_attrs(known=known)


def sweep(speed=(1e3, 2e3, 3e3), direction=(1, 1, 1), **attrs):
    """Return made-up data of a sweep: the largest displacement at three speeds."""
    data = xr.Dataset({"displacement_max": ("sample", [1e-5, 2e-5, 3e-5], {"units": "m"} | attrs)})
    coords = {"speed": ("sample", list(speed)), "direction": ("sample", list(direction))}
    return data.assign_coords(coords)


def jump(value, **attrs):
    """Return data of a single upward jump speed."""
    return xr.Dataset({"jump_up": (np.shape(value) and ("a",), value, attrs)})


SHORT = "time = '0 to 1.999 s' ... within known.course, 0 to 1 s"
SLOW = "time = '0 to 1.999 s' ... more than 12 whole revolutions of known.course, not 0"
#: Data with the sentence that refuses them; `...` stands for any words.
WRONG_DATA = {
    "data = 'ndarray' ... datasets": np.zeros(3),
    "displacement = 'complex128' ... real numbers": run_up(np.sin(TIME) + 0j),
    "displacement = 'of shape (2, 2000)' ... over samples": xr.concat([run_up()] * 2, "run"),
    "time = 'empty'": run_up().isel(sample=slice(0)),
    "time = 'NaN' ... finite": run_up(time=np.where(TIME == 0.0, np.nan, TIME)),
    "time = 'unsorted' ... increasing": run_up(time=TIME[::-1]),
    "noise_std of displacement = -1.0": run_up(noise_std=-1.0),
    "unknown_offset of displacement = 2": run_up(unknown_offset=2),
    "units of displacement = 'mm' ... m, or any unit with unknown_gain = 1": run_up(units="mm"),
    "known = '{' ... json": run_up(known="{"),
    "displacement = 'over time' ... over sample": run_up().swap_dims(sample="time"),
    "known.course: speed[1][0] = 0.0 ... after 0.0 s": run_up(course=[[0.0, 1e3], [0.0, 2e3]]),
    "known.course: speed = 'fast'": run_up(course="fast"),
    "known.options = 'colour' ... one of 'load'": run_up(known={"options": {"colour": 1}}),
    SHORT: run_up(course=[[0.0, 1000.0], [1.0, 1200.0]]),
    "time = '1 to 2.999 s' ... within known.course": run_up(time=1.0 + TIME),
    "time = '0 to 1.999 s' ... a mesh period or more, 2.5 s at 1 rpm": run_up().assign_coords(
        speed=("sample", np.ones(TIME.size))
    ),
    SLOW: run_up(course=[[0.0, 10.0], [2.0, 12.0]]),
    "speed = -1.0 ... > 0": sweep((-1.0, 2e3, 3e3)),
    "direction = 7 ... one of 1, -1, 0": sweep(direction=(1, 7, 1)),
    "units of displacement_max = 'um' ... m": sweep(units="um"),
    "jump_up = np.float64(nan) ... finite number > 0": jump(np.nan),
    "jump_up = 'of shape (2,)' ... one number": jump([1.0, 2.0]),
    "units of jump_up = 'Hz' ... min-1": jump(50.0, units="Hz"),
}


@pytest.mark.parametrize("sentence", WRONG_DATA)
def test_data_that_cannot_be_fitted_are_refused_in_one_sentence(sentence):
    with pytest.raises(ValueError, match="is not allowed") as error:
        gearlib.fit(PAPER_PAIR, WRONG_DATA[sentence], {"reduced_mass": (2.6, 3.7)})
    assert_sentence(error.value, sentence)


def test_gain_and_offset_are_eliminated_and_noise_is_single_or_common():
    noise = np.array([1e-7, 2e-7, 3e-7])
    data = sweep(unknown_gain=1, unknown_offset=1, noise_std=2e-7, units="V")
    with_noise = data.assign(displacement_max_noise_std=("sample", noise))
    single = observations_of(PAPER_PAIR, with_noise)[0].channels[0]
    common = observations_of(PAPER_PAIR, data)[0].channels[0]
    assert single.eliminated == 2 and single.deviations.tolist() == noise.tolist()
    assert common.deviations.tolist() == [2e-7] * 3
