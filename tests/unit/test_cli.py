"""The command line: what it prints and writes, how it ends."""

import csv
import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
import yaml
from click.testing import CliRunner

import gearlib
from gearlib import config
from gearlib.cli import main
from gearlib.data import storage
from gearlib.parameters import WRITTEN_UNITS
from gearlib.uncertainty.designs import DrawnPair
from gearlib.uncertainty.quality_classes import by_class
from tests.geometry import drawings
from tests.paper import CONFIG, PAPER

PAIR = ["--max-stiffness", "4e5 N/mm", "--stiffness-ratio", "0.5879", "--contact-ratio", "1.569"]
PAIR += ["--reduced-mass", "3123 g", "--load", "3.2895396 kN", "--backlash", "40 um"]
PAIR += ["--teeth", "24", "--material-damping", "3953.7", "--backlash-damping", "0"]


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Call the command in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return lambda *arguments: CliRunner().invoke(main, [*arguments])


def pair():
    return PAPER.replace(material_damping=3953.7)


def test_simulate_writes_what_the_library_computes(run):
    done = run("simulate", *PAIR, "--tuning", "0.9", "--periods", "50", "-o", "run.nc")
    assert done.exit_code == 0, done.output
    assert "displacement_max" in done.output
    expected = gearlib.simulate(pair(), 0.9, periods=50)
    found = xr.load_dataset("run.nc")
    assert {"history", "source_hash"} == found.attrs.keys() - expected.attrs.keys()
    del found.attrs["history"], found.attrs["source_hash"]
    xr.testing.assert_identical(found, expected)


def test_speeds_stand_in_place_of_tunings(run):
    done = run("simulate", *PAIR, "--speed", "3000rpm", "--periods", "50", "-o", "run.nc")
    assert "3000 rpm" in done.output, done.output
    expected = gearlib.simulate(pair(), speed=3000.0, periods=50)
    assert xr.load_dataset("run.nc").displacement_max == expected.displacement_max
    grid = ["--start", "2000 rpm", "--stop", "2500rpm", "--points", "3", "--periods", "20"]
    done = run("sweep", *PAIR, *grid, "-o", "curve.nc")
    assert done.exit_code == 0, done.output
    curve = xr.load_dataset("curve.nc")
    np.testing.assert_allclose(curve.speed, [2000.0, 2250.0, 2500.0], rtol=1e-12)
    tuning = str(pair().tuning_at(3000.0))
    at_speed, at_tuning = (
        run("orbit", *PAIR, "--speed", "3000"),
        run("orbit", *PAIR, "--tuning", tuning),
    )
    assert at_speed.output == at_tuning.output and at_speed.exit_code == 0


def test_a_run_up_there_and_back_is_one_course(run):
    way = ["--start", "2000rpm", "--stop", "2500", "--acceleration", "1000", "--back"]
    done = run("run-up", *PAIR, *way, "-o", "run.nc")
    assert done.exit_code == 0 and "revolutions; that of the largest force" in done.output
    course = [(0.0, 2000.0), (0.5, 2500.0), (1.0, 2000.0)]
    xr.testing.assert_equal(xr.load_dataset("run.nc"), gearlib.run_up(pair(), speed=course))
    done = run("run-up", *PAIR, *way, "--duration", "1")
    assert done.exit_code == 2 and "acceleration = 1000.0 is not allowed" in done.output


@pytest.mark.parametrize("direction", ["cold", "up"])
def test_sweep_writes_what_the_library_computes(run, direction):
    grid = ["--start", "0.7", "--stop", "0.9", "--points", "101", "--periods", "60"]
    done = run("sweep", *PAIR, *grid, "--direction", direction, "-o", "curve.nc")
    assert done.exit_code == 0, done.output
    expected = gearlib.sweep(
        pair(), np.linspace(0.7, 0.9, 101), periods=60, record_periods=10, direction=direction
    )
    # Runs side by side have other neighbours in the pieces of a cold sweep: equal to rounding.
    xr.testing.assert_allclose(xr.load_dataset("curve.nc"), expected, rtol=1e-12)


def test_orbit_and_trust_say_what_they_found(run):
    done = run("orbit", *PAIR, "--tuning", "0.7", "-o", "orbit.nc")
    assert done.exit_code == 0 and "stable orbit of period 1" in done.output
    assert xr.load_dataset("orbit.nc").residual < 1e-12
    orbit = gearlib.periodic_orbit(pair(), 0.7)
    assert all(f"{x:.6g}" in done.output for x in orbit.state)
    assert all(f"{x.real:.6g} " in done.output for x in orbit.multipliers)
    done = run("trust", *PAIR, "--tuning", "0.7", "--periods", "500")
    assert done.exit_code == 0 and done.output.startswith("paper's pair\nperiodic: ")


def test_the_ending_decides_what_is_written(run):
    own = {
        "simulate": ["--tuning", "0.8"],
        "sweep": ["--points", "5"],
        "orbit": ["--tuning", "0.8"],
        "run-up": ["--start", "1500rpm", "--stop", "2000", "--duration", "0.2"],
        "scatter": ["-t", "load std=5%", "--samples", "4", "--points", "3"],
    }
    own["trust"] = own["simulate"]
    reducer = ["--config", str(Path(__file__).parents[2] / "config.yaml")]
    trains = dict.fromkeys(["modes", "static", "phasing", "campbell"], reducer)
    for name, arguments in (own | trains).items():
        files = [f"{name}.{end}" for end in ("nc", "csv", "png")]
        for file in files[:2]:
            done = run(name, *PAIR, *arguments, "-o", file, "--plot", files[2], "--force")
            assert done.exit_code == 0, done.output
        data = xr.load_dataset(files[0])
        with open(files[1], newline="", encoding="utf-8") as file:
            heads, *rows = csv.reader(file)
        over = heads[0].partition(" [")[0]
        assert len(rows) == (data.sizes[over] if over in data.sizes else 2)
        columns = dict(zip(heads, zip(*rows, strict=True), strict=True))
        for variable in data.data_vars.values():
            if variable.dims == (over,) and "units" in variable.attrs:
                unit = WRITTEN_UNITS.get(variable.units, variable.units)
                found = columns[f"{variable.name} [{unit}]" if unit else variable.name]
                assert [*map(float, found)] == variable.values.tolist()
        assert Path(files[2]).read_bytes().startswith(b"\x89PNG")
    several = next(csv.reader(Path("modes.csv").read_text(encoding="utf-8").splitlines()))
    assert "mode_shape input rotation" in several


def test_tolerances_are_read_with_their_units(run):
    given = ["backlash upper=10um lower=-4um", "load distribution=lognorm s=0.1 scale=3300"]
    given = [word for one in given for word in ("-t", one)]
    asked = ["--samples", "8", "--quantity", "jump_down", "--points", "2", "-o", "found.nc"]
    done = run("scatter", *PAIR, *given, *asked)
    assert done.exit_code == 0 and "jump_down  rpm" in done.output, done.output
    tolerances = {
        "backlash": {"upper": 1e-5, "lower": -4e-6},
        "load": {"distribution": "lognorm", "s": 0.1, "scale": 3300.0},
    }
    ways = {"directions": ("up", "down", "seeded"), "tunings": [0.5, 1.4]}
    expected = gearlib.scatter(pair(), tolerances, ("jump_down",), n=8, **ways)
    xr.testing.assert_equal(xr.load_dataset("found.nc"), expected)
    for wrong, words in (
        ("load", "must have keys, each once, as 'load std=5%'"),
        ("", "must have keys"),
        ("load std=1% std=2%", "must have keys"),
        ("load std=3um", "must be a finite number in N or a text with its unit"),
        ("torque std=5%", "need drawn gears"),
        ("load std=nan", "tolerances.load.std = 'nan' is not allowed: it must be a finite"),
        ("mass std=2%", "tolerances = 'mass' is not allowed: it must be one of"),
    ):
        done = run("scatter", *PAIR, "-t", wrong)
        assert done.exit_code == 2 and words in " ".join(done.output.split()), done.output


DRAWN = ["--teeth", "23", "61", "--module", "2.5mm", "--width", "18mm", "--torque", "85Nm"]
DRAWN += ["--backlash", "80um", "--damping-ratio", "0.05"]


def test_drawings_and_their_classes_scatter(run):
    asked = ["--samples", "2", "--points", "0", "--quantity", "jump_up", "--force", "-o", "a.nc"]
    mesh = drawings.own()
    pair = gearlib.GearPair.from_geometry(mesh, torque=85.0, damping_ratio=0.05)
    ways = {"torque": 85.0, "material_damping": pair.material_damping}
    gears = [
        dataclasses.replace(one, quality=7, tip_diameter=None) for one in (mesh.pinion, mesh.wheel)
    ]
    loose = DrawnPair(dataclasses.replace(mesh, pinion=gears[0], wheel=gears[1]), **ways)
    free = DrawnPair(dataclasses.replace(loose.mesh, backlash=None), backlash=None, **ways)
    distance = {"upper": 2e-5, "lower": -2e-5}
    classes = by_class(free.mesh, thickness="26cd", centre_distance="js7", form=True)
    for given, source, tolerances in (
        (["-t", "centre_distance upper=20um lower=-20um"], loose, {"centre_distance": distance}),
        (
            ["--thickness-class", "26cd", "--distance-class", "js7", "--quality", "7"],
            free,
            classes,
        ),
    ):
        done = run("scatter", *DRAWN, *given, *asked)
        assert done.exit_code == 0, done.output
        expected = gearlib.scatter(source, tolerances, ("jump_up",), n=2)
        # Coefficients of the damping go through a file of 12 digits.
        found = xr.load_dataset("a.nc")
        np.testing.assert_allclose(found.jump_up, expected.jump_up, rtol=1e-6)
        assert {*found.data_vars} == {*expected.data_vars}
    for gears, words in ((PAIR, "need drawn gears"), (DRAWN, "js7'")):
        done = run("scatter", *gears, "--distance-class", "js77", *asked)
        assert done.exit_code == 2 and words in " ".join(done.output.split()), done.output
    # Without options what the section of the configuration says.
    section = {"parameters": [{"parameter": "load", "std": "5 %"}]}
    Path("own.yaml").write_text(json.dumps(CONFIG | {"tolerances": section}), encoding="utf-8")
    done = run("scatter", "--config", "own.yaml", *asked)
    assert done.exit_code == 0, done.output
    assert "load" in xr.load_dataset("a.nc")
    done = run("scatter", *DRAWN, *asked)
    assert done.exit_code == 2 and "--tolerance is missing" in done.output, done.output


def test_gears_are_drawn_by_options_of_every_command(run):
    done = run("gears", *DRAWN, "--save", "mine.yaml", "--plot", "stiffness.svg")
    assert done.exit_code == 0 and Path("stiffness.svg").exists(), done.output
    pair = gearlib.GearPair.from_geometry(drawings.own(), torque=85.0, damping_ratio=0.05)
    expected = gearlib.simulate(pair, speed=4000.0, periods=200)
    asked = ["-t", "load std=5%", "--samples", "2", "--points", "0", "--quantity", "jump_up"]
    done = run("scatter", *DRAWN, *asked)
    assert done.exit_code == 0 and "gear pair z 23/61, m 2.5 mm\n" in done.output, done.output
    for given in (DRAWN, ["--config", "mine.yaml"]):
        done = run("simulate", *given, "--speed", "4000", "-o", "run.nc", "--force")
        assert done.exit_code == 0 and "gear pair z 23/61, m 2.5 mm\n" in done.output, done.output
        found = xr.load_dataset("run.nc")
        np.testing.assert_allclose(found.displacement, expected.displacement, rtol=1e-9)
    # The speed of a drawing is that of its runs.
    assert run("gears", *DRAWN, "--speed", "4000", "--save", "fast.yaml").exit_code == 0
    own = run("simulate", "--config", "fast.yaml").output
    assert own == run("simulate", *DRAWN, "--speed", "4000").output != ""
    # A drawing that options change, and the one number of teeth of a pair that is not drawn.
    done = run("simulate", "--config", "mine.yaml", "--torque", "170 Nm", "--speed", "4000")
    assert " 1.719953376e-05 m " in done.output, done.output
    done = run("simulate", *PAIR, "--teeth", "48", "--speed", "1500")
    assert done.exit_code == 0 and " 1500 rpm " in done.output, done.output
    assert run("gears", *DRAWN, "--save", "mine.yaml").exit_code == 2
    # Without a word on damping motions would grow; the table and modes need none.
    for own in (["gears", "--save", "other.yaml"], ["simulate", "--tuning", "1"]):
        done = run(*own, *DRAWN[:-2])
        assert done.exit_code == 2 and "damping_ratio is missing" in done.output, done.output
    assert run("gears", *DRAWN[:-2]).exit_code == 0


def test_six_degrees_take_a_drawing_and_ask_for_its_bearings(run):
    asked = ["simulate", *DRAWN, "--speed", "4000", "--model", "six_degrees"]
    done = run(*asked)
    assert done.exit_code == 2 and "bearing_stiffness is missing" in done.output, done.output
    done = run(*asked, "--bearing-stiffness", "0.1 kN/um", "--bearing-damping", "900", "-o", "a.nc")
    assert done.exit_code == 0, done.output
    mesh, bearings = drawings.own(), {"bearing_stiffness": [1e8] * 4, "bearing_damping": [900] * 4}
    load = {"torque": 85.0, "damping_ratio": 0.05}
    pair = gearlib.SixDegreePair.from_geometry(mesh, **load, **bearings)
    assert pair.base_radii == (mesh.pinion.base_diameter / 2, mesh.wheel.base_diameter / 2)
    assert pair.masses == (mesh.pinion.mass, mesh.wheel.mass) and pair.teeth == (23, 61)
    assert pair.inertias == (mesh.pinion.inertia, mesh.wheel.inertia)
    assert pair.friction == pair.eccentricities == (0.0, 0.0)
    expected = gearlib.simulate(pair, speed=4000.0, periods=200)
    np.testing.assert_allclose(xr.load_dataset("a.nc").displacement, expected.displacement, 1e-8)


def test_trains_and_settled_motions_are_asked_for(run):
    for gears in ([], PAIR, DRAWN):
        for name in ("modes", "static", "phasing", "campbell"):
            assert "train is missing" in (done := run(name, *gears)).output and done.exit_code == 2
    # A duty point that does not settle is no success.
    done = run("gears", *DRAWN[:-1], "0", "--speed", "4000")
    assert done.exit_code == 1 and "has not settled" in done.output, done.output


def test_sentences_show_what_was_typed(run):
    for given, words in (
        (["simulate", *DRAWN, "--speed", "1e9rpm"], "speed = 1000000000.0 is not allowed"),
        (["sweep", *DRAWN, "--stop", "1e9rpm"], "stop = 1000000000.0 is not allowed"),
        (["gears", *DRAWN, "--pressure-angle", "70deg"], "pressure_angle = '70deg' is not allowed"),
        (["gears", *DRAWN, "--torque", "99 kNm"], "torque = '99 kNm' is not allowed"),
        (["gears", *DRAWN, "--teeth", "40", "30", "--internal"], "teeth = 30 is not allowed"),
        (["gears", *DRAWN[:7], "--power", "9 kW"], "speed is missing"),
        (["gears", *DRAWN[:-2], "--damping-ratio", "5"], "damping_ratio = 5 is not allowed"),
    ):
        done = run(*given)
        assert done.exit_code == 2 and words in done.output, done.output
        assert "did you mean" not in done.output


def test_the_default_sweep_of_drawn_gears_holds_their_speed_and_goes_on_until_it_jumps(run):
    light = [*DRAWN[:-1], "0.004", "--speed", "9000", "--save", "light.yaml"]
    assert run("gears", *light).exit_code == 0
    asked = ["sweep", "--config", "light.yaml", "--points", "201", "-o", "a.nc", "--force"]
    done = run(*asked, "--direction", "down")
    assert done.exit_code == 0 and "has jumped down above" in done.output, done.output
    down = xr.load_dataset("a.nc")
    assert down.speed[0] < 9000.0 and down.tuning.size > 201
    # In one step throughout, and at its end the motion from rest.
    np.testing.assert_allclose(np.diff(down.tuning), float(down.tuning[2] - down.tuning[1]))
    assert run(*asked).exit_code == 0
    assert float(xr.load_dataset("a.nc").speed[0]) == pytest.approx(9000.0)


def test_a_new_project_can_be_used_as_it_is(run):
    assert run("init").exit_code == 0 and run("init").exit_code == 2
    text = Path("gears.yaml").read_text(encoding="utf-8")
    settings = config.load(yaml.safe_load(text))
    assert settings.gears.torque == 85.0 and settings.gears.pinion.module == 2.5e-3
    # What may be left out is a key where it stands.
    lines = text.splitlines()
    at = lines.index(next(line for line in lines if line.strip().startswith("# shift:")))
    lines[at] = "    shift: 0.3"
    assert config.load(yaml.safe_load("\n".join(lines))).gears.pinion.shift == 0.3
    assert "z 23/61" in run("gears", "--config", "gears.yaml").output


def test_wrong_input_is_refused_with_code_2(run, tmp_path):
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe")
    (tmp_path / "open.yaml").write_text("run: [1\n", encoding="utf-8")
    (tmp_path / "twice.yaml").write_text("run:\n  a: 1\n  a: 2\n", encoding="utf-8")
    four = yaml.safe_dump(mapping({"kind": "planetary", "planetary": {"planets": 4}}))
    (tmp_path / "four.yaml").write_text(four, encoding="utf-8")
    for arguments, fault in [
        (["simulate", *PAIR, "--tuning", "1", "--backlash", "4 kg"], "backlash = '4 kg'"),
        (["simulate", *PAIR], "tuning = None with speed = None is not allowed"),
        (["orbit", *PAIR, "--tuning", "1", "--speed", "1"], "tuning = 1.0 with speed = 1 is not"),
        (["trust", *PAIR, "--speed", "50 Hz"], "speed = '50 Hz' is not allowed: it must be"),
        (["sweep", *PAIR, "--start", "1/min"], "or a speed in rpm such as 1500rpm"),
        (["simulate", "--tuning", "1"], "max_stiffness is missing"),
        (["simulate", *PAIR, "--tuning", "1", "--method", "ode45"], "method = 'ode45'"),
        (
            ["simulate", *PAIR, "--tuning", "1", "-o", "no/run.nc"],
            "run.nc cannot be written: No such file",
        ),
        (
            ["trust", *PAIR, "--tuning", "1", "--periods", "3"],
            "periods = 3",
        ),
        (["explore", "--port", "65536"], "65536 is not in the range"),
        (["orbit", "--config", "binary.yaml", "--tuning", "1"], "binary.yaml is not YAML"),
        (["orbit", "--config", "twice.yaml", "--tuning", "1"], "a is given twice, again in line 3"),
        (["orbit", *PAIR, "--tuning", "1", "--period", "0"], "period = 0"),
        (["simulate", *PAIR, "--tuning", "1", "--damping", "k1"], "give --config"),
        (["orbit", "--config", "open.yaml", "--tuning", "1"], "open.yaml is not YAML, line 2, col"),
        (["simulate", *PAIR, "--tuning", "1", "-o", "a" * 300 + ".nc"], "File name too"),
        (["simulate", *PAIR, "--tuning", "1", "-o", "run.h5"], "it must end with one of .nc, .csv"),
        (["sweep", *PAIR, "--plot", "curve.jpg"], "it must end with one of .png, .svg, .pdf"),
        (["gears", "--teeth", "23", "--module", "2 mm"], "--teeth = 23 is not allowed: it must be"),
        (["gears", "--shift", "0.2", "--module", "2 mm"], "--module is not allowed as a value"),
        (["simulate", *PAIR, "--tuning", "1e-300"], "tuning = 1e-300 is not allowed: it must be"),
        (["simulate", *PAIR, "--speed", "3e9"], "speed = 3000000000.0 is not allowed: it must be"),
        (["simulate", *PAIR, "--tuning", "1", "--samples", "1000000000"], "within 2 GB of memory"),
        (["sweep", *PAIR, "--points", "1000000000"], "is not in the range 2<=x<=10000000"),
        (["modes", "--config", "four.yaml"], "planets = 4 is not allowed: (z_s + z_r) / N"),
    ]:
        done = run(*arguments)
        assert done.exit_code == 2, (arguments, done.output)
        assert fault in done.output


def test_no_file_is_replaced_unasked(run, tmp_path):
    (tmp_path / "run.nc").write_text("mine", encoding="utf-8")
    command = ["simulate", *PAIR, "--tuning", "0.7", "-o", "run.nc"]
    assert run(*command).exit_code == 2
    assert (tmp_path / "run.nc").read_text(encoding="utf-8") == "mine"
    assert run(*command, "--force").exit_code == 0
    assert xr.load_dataset("run.nc").tuning == 0.7


def test_a_file_that_cannot_be_written_ends_with_code_1(run, monkeypatch):
    def refuse(dataset, path):
        raise OSError(f"{path} cannot be written: the disk is full")

    monkeypatch.setattr(storage, "write", refuse)
    done = run("simulate", *PAIR, "--tuning", "0.7", "-o", "run.nc")
    assert done.exit_code == 1 and "Error: run.nc cannot be written: the disk" in done.output


def test_a_configuration_gives_pair_damping_and_model(run, request):
    config = str(request.config.rootpath / "config.yaml")
    for model in ("one_degree", "six_degrees"):
        done = run(
            "simulate", "--config", config, "--damping", "k1m", "--model", model, "--tuning", "0.7"
        )
        assert done.exit_code == 0, done.output
    done = run("simulate", "--config", config, "--damping", "k9", "--tuning", "0.7")
    assert done.exit_code == 2 and "one of k1, k1m" in done.output


def test_options_come_before_the_configuration(run, tmp_path):
    gears = {"max_stiffness": "4e5 N/mm", "stiffness_ratio": 0.5879, "contact_ratio": 1.569}
    gears |= {"reduced_mass": 3.123, "load": 3289.5396, "backlash": "40 um", "teeth": 24}
    dampings = {"oil": {"material_damping": 0.0, "backlash_damping": 3953.7}}
    text = yaml.safe_dump({"gear_pair": gears, "dampings": dampings})
    (tmp_path / "config.yaml").write_text(text, encoding="utf-8")
    done = run("simulate", "--tuning", "0.7", "--reduced-mass", "3.2", "-o", "run.nc")
    assert done.exit_code == 0, done.output
    expected = gearlib.simulate(
        pair().replace(reduced_mass=3.2, material_damping=0.0, backlash_damping=3953.7),
        0.7,
        periods=200,
    )
    assert xr.load_dataset("run.nc").displacement.equals(expected.displacement)


def test_only_what_a_command_needs_is_asked_for(run, request, tmp_path):
    config = str(request.config.rootpath / "config.yaml")
    # Scenes of the configuration need more teeth.
    done = run("simulate", "--config", config, "--teeth", "1", "--tuning", "0.8")
    assert done.exit_code == 0, done.output
    done = run("explore", "--config", config, "--teeth", "1")
    assert done.exit_code == 2 and "scenes" in done.output
    wrong = yaml.safe_dump(CONFIG | {"resonanse": {"start": 0.6}}, sort_keys=False)
    (tmp_path / "wrong.yaml").write_text(wrong, encoding="utf-8")
    for arguments, fault in (
        (["--config", "wrong.yaml"], "did you mean resonance"),
        (["--config", config, "--case", "a"], "--case a: it must be one of"),
        (["--case", "a"], "--case and --damping need a configuration"),
    ):
        done = run("simulate", *PAIR, *arguments, "--tuning", "0.8")
        assert done.exit_code == 2 and fault in done.output


def test_one_of_several_cases(run, tmp_path):
    light = mapping({}) | {"cases": {"light": {"gear_pair": {"load": 1000.0}}, "heavy": {}}}
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(light, sort_keys=False), encoding="utf-8")
    given = ["--config", "mine.yaml", "--tuning", "0.8"]
    done = run("simulate", *given)
    assert (
        done.exit_code == 2
        and "--case is missing: it must be one of ['light', 'heavy']" in done.output
    )
    done = run("simulate", *given, "--case", "dark")
    assert done.exit_code == 2 and "--case dark: it must be one of" in done.output
    done = run("simulate", *given, "--case", "light", "-o", "run.nc")
    assert done.exit_code == 0, done.output
    assert xr.load_dataset("run.nc").force_scale == 1000.0
    light["cases"]["heavy"] = {"gear_pair": {"load": -1.0}}
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(light, sort_keys=False), encoding="utf-8")
    done = run("simulate", *given, "--case", "light")
    assert done.exit_code == 2 and "cases.heavy: gear_pair.load = -1.0" in done.output


def cells(text, first):
    """Return the row of a printed table that begins with a name, its columns as numbers.

    A wide table is printed in parts, one below the other.
    """
    lines = [line for line in text.splitlines() if line.startswith(f"{first} ")]
    return [float(word) for line in lines for word in line.removeprefix(first).split()]


MESHES = ("displacement_max", "displacement_min", "dynamic_force_max", "dynamic_factor")
MESHES += ("mean_force", "load_sharing", "fraction_normal", "bounces")


@pytest.fixture
def reducer(tmp_path):
    """A reducer with a misplaced pin, and the configuration that describes it."""
    section = {"split_power_reducer": {"pin_errors": [[0.0, "10 um"], [0, 0], [0, 0]]}}
    (tmp_path / "train.yaml").write_text(yaml.safe_dump(mapping(section)), encoding="utf-8")
    errors = [(0.0, 10e-6), (0.0, 0.0), (0.0, 0.0)]
    return gearlib.split_power_reducer(pair(), pin_errors=errors)


def mapping(train):
    gears = {"max_stiffness": 4e8, "stiffness_ratio": 0.5879, "contact_ratio": 1.569}
    gears |= {"reduced_mass": 3.123, "load": 3289.5396, "backlash": "40 um", "teeth": 24}
    dampings = {"k1": {"material_damping": 3953.7, "backlash_damping": 0.0}}
    return {"gear_pair": gears, "dampings": dampings, "train": train}


def test_runs_of_a_train_print_a_row_for_each_mesh(run, reducer):
    train = ["--config", "train.yaml", "--model", "train"]
    done = run("simulate", *train, "--tuning", "0.7", "--periods", "30", "-o", "run.nc")
    assert done.exit_code == 0, done.output
    expected = gearlib.simulate(reducer, 0.7, periods=30)
    found = xr.load_dataset("run.nc")
    assert found.displacement.equals(expected.displacement)
    assert f"{expected.speed.item():.10g} rpm" in done.output
    # Where a pin is displaced, the branches differ.
    assert float(expected.load_sharing.std()) > 0.01
    for name in reducer.mesh_names:
        row = [float(f"{expected[key].sel(mesh=name).item():.6g}") for key in MESHES]
        assert cells(done.output, name) == row

    # The mesh that moves most here is neither the first one nor the one that moves least.
    grid = ["--start", "0.3", "--stop", "0.5", "--points", "3", "--periods", "30"]
    done = run("sweep", *train, *grid)
    assert done.exit_code == 0, done.output
    tunings = np.linspace(0.3, 0.5, 3)
    swept = gearlib.sweep(reducer, tunings, periods=30, record_periods=10)
    top = swept.isel(tuning=int(swept.displacement_max.max("mesh").argmax("tuning")))
    assert f"{top.tuning.item():.10g} " in done.output
    for name in reducer.mesh_names:
        row = [top[key].sel(mesh=name).item() for key in MESHES]
        np.testing.assert_allclose(cells(done.output, name), row, rtol=1e-5, atol=1e-9)


def test_what_a_train_is_without_a_run(run, reducer):
    found = reducer.modes()
    done = run("modes", "--config", "train.yaml", "-o", "modes.nc")
    assert done.exit_code == 0, done.output
    xr.testing.assert_allclose(xr.load_dataset("modes.nc"), found)
    for i, line in enumerate(done.output.splitlines()[2 : 2 + found.mode.size]):
        frequency, kind = found.natural_frequency.values[i], found.mode_kind.values[i]
        assert line.split() == [str(i), f"{frequency:.6g}", kind]

    done = run("static", "--config", "train.yaml", "--phase", "1.0", "-o", "static.nc")
    assert done.exit_code == 0, done.output
    still = reducer.static(1.0)
    for name in reducer.mesh_names:
        keys = ("load_sharing", "mesh_force", "contact")
        row = [still[key].sel(mesh=name).item() for key in keys]
        np.testing.assert_allclose(cells(done.output, name), row, rtol=1e-5)
    assert xr.load_dataset("static.nc").load_sharing.equals(still.load_sharing)

    done = run("phasing", "--config", "train.yaml", "--count", "3", "-o", "phasing.nc")
    assert done.exit_code == 0, done.output
    sums = reducer.phasing(3)
    assert xr.load_dataset("phasing.nc").phase_sum.equals(sums.phase_sum)
    own = sums.excites.sel(stiffness_order=2.0).values
    rotational = sums.mode_kind.values == "rotational"
    assert f"{own[rotational].sum()} of {rotational.sum()}" in done.output
    assert own[rotational].all() and not own[~rotational].any()

    done = run("campbell", "--config", "train.yaml", "--count", "2", "-o", "campbell.nc")
    assert done.exit_code == 0, done.output
    critical = reducer.campbell(2)
    assert xr.load_dataset("campbell.nc").critical_speed.equals(critical.critical_speed)
    excited = np.sort(critical.critical_speed.values[critical.excites.values])
    rows = [line.split() for line in done.output.splitlines()[2 : 2 + excited.size]]
    np.testing.assert_allclose([float(row[0]) for row in rows], excited, rtol=1e-5)
    assert {row[-1] for row in rows} == {"rotational"}
