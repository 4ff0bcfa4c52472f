"""Check the command `gearlib fit`, and that unusable data are refused before any model runs."""

import json

import numpy as np
import pytest
import xarray as xr
import yaml
from click.testing import CliRunner

import gearlib
from gearlib.cli import main
from gearlib.uncertainty.observations import make_observations
from gearlib.uncertainty.synthetic_rigs import synthetic_rig
from tests.paper import PAPER_PAIR
from tests.sentences import assert_sentence

TRUE_PAIR = PAPER_PAIR.replace(material_damping=3953.7, backlash_damping=3953.7)
SPEED_COURSE = [(0.0, float(TRUE_PAIR.speed(0.6))), (0.4, float(TRUE_PAIR.speed(0.72)))]
RIG_DATA = synthetic_rig(TRUE_PAIR, SPEED_COURSE, 1)
TABLE = np.c_[RIG_DATA.time.values, 1e6 * RIG_DATA.displacement.values]
KNOWN_VALUES = {"max_stiffness": "4e5 N/mm", "stiffness_ratio": 0.5879, "contact_ratio": 1.569}
KNOWN_VALUES |= {
    "load": "3.2895396 kN",
    "backlash": "40 um",
    "backlash_damping": 3953.7,
    "teeth": 24,
}
KNOWN_VALUES |= {"damping": "unknown", "course": [list(row) for row in SPEED_COURSE]}
SETTINGS = {"data": "rig.csv", "title": "Rig 1", "source": "computed for this test"}
SETTINGS |= {"licence": "own data", "synthetic": True, "known": KNOWN_VALUES}
SETTINGS |= {"fit": {"free": {"material_damping": [1000, 9000], "reduced_mass": ["2600 g", 3.7]}}}
DISPLACEMENT_CHANNEL = {"observableId": "displacement", "unit": "um", "offset": "unknown"}
DISPLACEMENT_CHANNEL["noise"] = 1e6 * RIG_DATA.displacement.noise_std
SETTINGS["channels"] = {"t": {"observableId": "time", "unit": "s"}, "x": DISPLACEMENT_CHANNEL}
FIXED_VALUE_OPTIONS = ["--reduced-mass", "3.1", "--material-damping", "4000"]


@pytest.fixture
def run_fit_command(tmp_path, monkeypatch):
    """Return a function that runs `gearlib fit` on a measured set in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def invoke(*arguments, table=TABLE, **changes):
        """Write the table and the settings with `changes`, and run the command on them."""
        np.savetxt("rig.csv", table, delimiter=",", header="t,x", comments="", fmt="%.9g")
        (tmp_path / "rig.yaml").write_text(yaml.safe_dump(SETTINGS | changes), encoding="utf-8")
        return CliRunner().invoke(main, ["fit", "rig.yaml", *arguments])

    return invoke


def test_the_command_fits_with_the_settings_of_its_file(run_fit_command):
    """The printed and the stored fit must equal the fit that `gearlib.fit` computes."""
    result = run_fit_command("-o", "fit.nc", "--plot", "fit.png")
    assert result.exit_code == 0 and "plotted to fit.png" in result.output, result.output
    lines = result.output.splitlines()
    # The name of the gears, which is printed first, may be broken into two lines.
    assert "Rig 1, synthetic: computed for this test" in lines and "[[Variables]]" in lines
    # A fit starts from the middle of the bounds. The sum must be rounded as in the library, because
    # a different last digit may change the number of iterations.
    reduced_mass = (2.6 + 3.7) / 2.0
    guess = TRUE_PAIR.replace(material_damping=5000.0, reduced_mass=reduced_mass, load=3289.5396)
    free = {"material_damping": (1000.0, 9000.0), "reduced_mass": (2.6, 3.7)}
    fit = gearlib.fit(guess, gearlib.read_measured("rig.yaml"), free)
    assert str(fit) in result.output
    stored, computed = xr.load_dataset("fit.nc"), fit.dataset()
    computed["identifiable"] = computed.identifiable.astype(stored.identifiable.dtype)
    # The command converts units, and differences for derivatives amplify the rounding errors.
    xr.testing.assert_allclose(stored, computed, rtol=1e-8)
    assert stored.parameter.values.tolist() == [*free]
    assert stored.parameter_units.values.tolist() == ["N s m-1", "kg"]
    for name, parameter in fit.params.items():
        assert parameter.init == getattr(guess, name), name


INVALID_SETTINGS = [
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
    (
        ["--free", "weight=1,2", *FIXED_VALUE_OPTIONS],
        {},
        "free = 'weight' is not allowed: it must be one of",
    ),
    (
        ["--free", "load=1 kN,2 kN", *FIXED_VALUE_OPTIONS],
        {},
        "a range that contains load = 3289.54",
    ),
    ([], {"known": {}}, "max_stiffness is missing"),
    ([], {"known": KNOWN_VALUES | {"course": 2450}}, "known.course: speed = 2450"),
    ([], {"table": TABLE[:, :1].repeat(3, 1)}, "must"),
]


@pytest.mark.parametrize(("options", "changes", "message"), INVALID_SETTINGS)
def test_invalid_settings_of_a_fit_are_refused(run_fit_command, options, changes, message):
    """The command must exit with code 2 and print an error message, but no traceback."""
    result = run_fit_command(*options, "-o", "fit.nc", **changes)
    assert result.exit_code == 2, result.output
    printed_message = result.output.partition("Error: ")[2]
    # The message may be broken into several lines.
    assert message in " ".join(printed_message.split()), result.output
    assert not isinstance(result.exception, ValueError)


TIMES = np.arange(2000) * 1e-3


def run_up_data(values=None, time=TIMES, known=None, course=((0.0, 1e3), (2.0, 1.2e3)), **attrs):
    """Return artificial data of a run-up, a displacement over time.

    `values` are the displacements, a sine by default, with the attributes `attrs`. `course` is the
    speed course, rows of s and rpm. `known` is a dict of further known values, or an invalid string
    in place of their JSON representation.
    """
    if values is None:
        values = np.sin(TIMES)
    if not isinstance(known, str):
        known = json.dumps({"course": course} | (known or {}))
    data = xr.Dataset({"displacement": ("sample", values, {"units": "m"} | attrs)})
    return data.assign_coords(time=("sample", time)).assign_attrs(known=known)


def sweep_data(speed=(1e3, 2e3, 3e3), direction=(1, 1, 1), **attrs):
    """Return artificial data of a sweep: the largest displacement at each of three speeds.

    `speed` is in rpm, `direction` is 1 upwards and -1 downwards, and `attrs` are attributes of the
    displacement.
    """
    data = xr.Dataset({"displacement_max": ("sample", [1e-5, 2e-5, 3e-5], {"units": "m"} | attrs)})
    coords = {"speed": ("sample", list(speed)), "direction": ("sample", list(direction))}
    return data.assign_coords(coords)


def jump_data(value, **attrs):
    """Return a dataset with the upward jump speed `value`, rpm, as its only variable."""
    dims = ("a",) if np.shape(value) else ()
    return xr.Dataset({"jump_up": (dims, value, attrs)})


COURSE_TOO_SHORT = "time = '0 to 1.999 s' ... within known.course, 0 to 1 s"
COURSE_TOO_SLOW = "time = '0 to 1.999 s' ... more than 12 whole revolutions of known.course, not 0"
#: Invalid data by the message that refuses them, in which `...` stands for any words.
INVALID_DATA = {
    "data = 'ndarray' ... datasets": np.zeros(3),
    "displacement = 'complex128' ... real numbers": run_up_data(np.sin(TIMES) + 0j),
    "displacement = 'of shape (2, 2000)' ... over samples": xr.concat([run_up_data()] * 2, "run"),
    "time = 'empty'": run_up_data().isel(sample=slice(0)),
    "time = 'NaN' ... finite": run_up_data(time=np.where(TIMES == 0.0, np.nan, TIMES)),
    "time = 'unsorted' ... increasing": run_up_data(time=TIMES[::-1]),
    "noise_std of displacement = -1.0": run_up_data(noise_std=-1.0),
    "unknown_offset of displacement = 2": run_up_data(unknown_offset=2),
    "units of displacement = 'mm' ... m, or any unit with unknown_gain = 1": run_up_data(
        units="mm"
    ),
    "known = '{' ... json": run_up_data(known="{"),
    "displacement = 'over time' ... over sample": run_up_data().swap_dims(sample="time"),
    "known.course: speed[1][0] = 0.0 ... after 0.0 s": run_up_data(course=[[0.0, 1e3], [0.0, 2e3]]),
    "known.course: speed = 'fast'": run_up_data(course="fast"),
    "known.options = 'colour' ... one of 'load'": run_up_data(known={"options": {"colour": 1}}),
    COURSE_TOO_SHORT: run_up_data(course=[[0.0, 1000.0], [1.0, 1200.0]]),
    "time = '1 to 2.999 s' ... within known.course": run_up_data(time=1.0 + TIMES),
    "time = '0 to 1.999 s' ... a mesh period or more, 2.5 s at 1 rpm": run_up_data().assign_coords(
        speed=("sample", np.ones(TIMES.size))
    ),
    COURSE_TOO_SLOW: run_up_data(course=[[0.0, 10.0], [2.0, 12.0]]),
    "speed = -1.0 ... > 0": sweep_data((-1.0, 2e3, 3e3)),
    "direction = 7 ... one of 1, -1, 0": sweep_data(direction=(1, 7, 1)),
    "units of displacement_max = 'um' ... m": sweep_data(units="um"),
    "jump_up = np.float64(nan) ... finite number > 0": jump_data(np.nan),
    "jump_up = 'of shape (2,)' ... one number": jump_data([1.0, 2.0]),
    "units of jump_up = 'Hz' ... min-1": jump_data(50.0, units="Hz"),
}


@pytest.mark.parametrize("sentence", INVALID_DATA)
def test_data_that_cannot_be_fitted_are_refused_in_one_sentence(sentence):
    """`gearlib.fit` must refuse invalid data by a sentence that names the problem."""
    with pytest.raises(ValueError, match="is not allowed") as error:
        gearlib.fit(PAPER_PAIR, INVALID_DATA[sentence], {"reduced_mass": (2.6, 3.7)})
    assert_sentence(error.value, sentence)


def test_noise_is_given_per_sample_or_for_a_whole_channel():
    """Each sample must have its own standard deviation if given, else that of the channel.

    Unknown gain and offset of the sensor are two parameters that the fit eliminates.
    """
    sample_noise, channel_noise = np.array([1e-7, 2e-7, 3e-7]), 2e-7
    data = sweep_data(unknown_gain=1, unknown_offset=1, noise_std=channel_noise, units="V")
    data_with_sample_noise = data.assign(displacement_max_noise_std=("sample", sample_noise))
    channel = make_observations(PAPER_PAIR, data_with_sample_noise)[0].channels[0]
    assert channel.eliminated == 2 and channel.deviations.tolist() == sample_noise.tolist()
    channel = make_observations(PAPER_PAIR, data)[0].channels[0]
    assert channel.deviations.tolist() == [channel_noise] * 3
