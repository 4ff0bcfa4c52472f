"""The command line: printed output, written files and exit codes."""

import csv
import os
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
import yaml
from click.testing import CliRunner

import gearlib
from gearlib import config
from gearlib.cli import main
from gearlib.data import gathering, storage
from gearlib.units import WRITTEN_UNITS
from tests.geometry import stages
from tests.paper import CONFIG, PAPER_PAIR
from tests.unit.test_gear_names import relieved

PAIR = (
    "--max-stiffness '4e5 N/mm' --stiffness-ratio 0.5879 --contact-ratio 1.569 "
    "--reduced-mass '3123 g' --load '3.2895396 kN' --backlash '40 um' "
    "--teeth 24 --material-damping 3953.7 --backlash-damping 0"
)
UNDAMPED = "--teeth 23 61 --module 2.5mm --width 18mm --torque 85Nm --backlash 80um"
GEOMETRY = f"{UNDAMPED} --damping-ratio 0.05"
K1 = PAPER_PAIR.replace(material_damping=3953.7)
FROM_FILE = "--config mine.yaml"
CONFIG_FILE = Path(__file__).parents[2] / "config.yaml"


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Return a function that runs a command line in an empty folder and returns its output.

    It asserts that the command exits with `code`.
    """
    monkeypatch.chdir(tmp_path)

    def call(line, code=0):
        """Run a command line, in which PAIR and GEOMETRY stand for options of gears."""
        words = shlex.split(line.replace("PAIR", PAIR).replace("GEOMETRY", GEOMETRY))
        result = CliRunner().invoke(main, words)
        assert result.exit_code == code, (line, result.output)
        return result.output

    return call


def write(name, settings):
    """Write settings into a YAML file."""
    Path(name).write_text(yaml.safe_dump(settings, sort_keys=False), encoding="utf-8")


def with_train(section):
    """Return a configuration of the paper's pair with a train."""
    dampings = {"k1": {"material_damping": 3953.7, "backlash_damping": 0.0}}
    return {"gear_pair": CONFIG["gear_pair"], "dampings": dampings, "train": section}


REDUCER = gearlib.split_power_reducer(K1)
SPAN = {"periods": 60, "record_periods": 10}
#: Command lines with the computations of the library that they must match.
COMMANDS = {
    "simulate --tuning 0.9 --periods 50": lambda: gearlib.simulate(K1, 0.9, periods=50),
    "sweep --start 0.7 --stop 0.9 --points 51 --periods 60": lambda: gearlib.sweep(
        K1, np.linspace(0.7, 0.9, 51), **SPAN
    ),
    "sweep --points 5 --periods 60 --direction up": lambda: gearlib.sweep(
        K1, np.linspace(0.5, 1.4, 5), direction="up", **SPAN
    ),
    "orbit --tuning 0.7": lambda: gearlib.periodic_orbit(K1, 0.7).dataset(),
    "run-up --start 2000rpm --stop 2500 --acceleration 1000 --back": lambda: gearlib.run_up(
        K1, speed=[(0.0, 2000.0), (0.5, 2500.0), (1.0, 2000.0)]
    ),
    "scatter -t 'load std=5%' --samples 4 --points 3 --quantity peak": lambda: gearlib.scatter(
        K1, {"load": {"std": "5%"}}, ("peak",), 4,
        tunings=np.linspace(0.5, 1.4, 3), directions=("up", "down", "seeded"),
    ),
    "trust --tuning 0.7 --periods 500": lambda: gearlib.trust(K1, 0.7, periods=500).runs,
    f"modes --config {CONFIG_FILE}": REDUCER.modes,
    f"static --phase 1.0 --config {CONFIG_FILE}": lambda: REDUCER.static(1.0),
    f"phasing --count 3 --config {CONFIG_FILE}": lambda: REDUCER.phasing(3),
    f"campbell --count 2 --config {CONFIG_FILE}": lambda: REDUCER.campbell(2),
}  # fmt: skip


@pytest.mark.parametrize("command", COMMANDS)
def test_output_files_match_the_library_in_the_format_of_their_suffix(run, command):
    """Compare a NetCDF and a CSV file of each command with the dataset of the library."""
    run(f"{command} PAIR -o data.nc --plot picture.png")
    run(f"{command} PAIR -o data.csv")
    data, expected = xr.load_dataset("data.nc"), COMMANDS[command]()
    # The command splits sweeps from rest into other batches, which changes the rounding.
    xr.testing.assert_allclose(data, expected, rtol=1e-12)
    if command.startswith("simulate"):
        xr.testing.assert_identical(data.drop_attrs(deep=False), expected.drop_attrs(deep=False))
    assert data.attrs.items() - expected.attrs.items() == {
        (name, data.attrs[name]) for name in ("history", "source_hash")
    }
    heads, *rows = csv.reader(Path("data.csv").read_text(encoding="utf-8").splitlines())
    dimension = heads[0].partition(" [")[0]
    # A table of an orbit has no column for its dimension; the state of a pair has two entries.
    assert len(rows) == (data.sizes[dimension] if dimension in data.sizes else 2)
    columns = dict(zip(heads, zip(*rows, strict=True), strict=True))
    for variable in data.data_vars.values():
        if variable.dims == (dimension,) and "units" in variable.attrs:
            unit = WRITTEN_UNITS.get(variable.units, variable.units)
            column = columns[f"{variable.name} [{unit}]" if unit else variable.name]
            np.testing.assert_array_equal([*map(float, column)], variable.values)
    # A variable with further dimensions has a column for each of their entries.
    assert "modes" not in command or "mode_shape input rotation" in heads
    assert Path("picture.png").read_bytes().startswith(b"\x89PNG")


def test_a_left_hand_helix_is_a_negative_angle(run):
    right, left = (
        run(f"gears GEOMETRY --helix-angle {sign}15deg").splitlines() for sign in ("", "-")
    )
    assert "-15" in left[0] and right[1:] == left[1:]


def test_gears_are_described_by_the_properties_their_model_uses(run):
    write("relieved.yaml", relieved())
    line = "simulate --config relieved.yaml --speed 4000rpm"
    rectangle = "tip relief left out; rectangle, kappa 0.5714, epsilon 1.689, ISO 6336-1"
    assert rectangle in " ".join(run(f"{line} --model rectangle").split())
    assert "tip relief; pairs of teeth, energy method" in " ".join(run(line).split())


def test_a_run_up_an_orbit_and_trust_print_their_results(run):
    # Below this line the command prints the revolution with the largest force.
    line = "run-up PAIR --start 2000rpm --stop 2500 --acceleration 1000"
    assert "revolutions; the revolution of the largest force" in run(line)
    assert "acceleration = 1000.0 is not allowed" in run(f"{line} --duration 1", code=2)
    output, orbit = run("orbit PAIR --tuning 0.7"), gearlib.periodic_orbit(K1, 0.7)
    assert "stable orbit of period 1" in output
    assert all(f"{x:.6g}" in output for x in orbit.state)
    assert all(f"{x.real:.6g} " in output for x in orbit.multipliers)
    output = run("trust PAIR --tuning 0.7 --periods 500")
    assert output.startswith("paper's pair; rectangle, kappa 0.5879, epsilon 1.569\nperiodic: ")
    write("train.yaml", with_train({"kind": "planetary"}))
    output = run("orbit --config train.yaml --model train --tuning 2.5")
    # The table of the state of a train counts its rows from 0.
    last_row = gearlib.planetary().size - 1
    assert "orbit of period 1" in output and f"\n{last_row} " in output


def test_gears_given_by_geometry_come_from_options_or_a_saved_file(run):
    """Options, a saved file and the library must give the same motion of the same gears."""
    run("gears GEOMETRY --save mine.yaml --plot stiffness.svg")
    assert Path("stiffness.svg").exists()
    pair = gearlib.LoadSharingPair.from_geometry(stages.own(), torque=85.0, damping_ratio=0.05)
    expected = gearlib.simulate(pair, speed=4000.0, periods=200, initial_state="static")
    outputs = {gears: run(f"simulate {gears} --speed 4000") for gears in ("GEOMETRY", FROM_FILE)}
    run(f"simulate {FROM_FILE} --speed 4000 -o run.nc")
    displacement = xr.load_dataset("run.nc").displacement
    np.testing.assert_allclose(displacement, expected.displacement, rtol=1e-9)
    first_line = outputs["GEOMETRY"].splitlines()[0]
    assert first_line == "gear pair z 23/61, m 2.5 mm; pairs of teeth, energy method"
    # Runs without a speed use the one saved with the gears.
    run("gears GEOMETRY --speed 4000 --save fast.yaml")
    assert run("simulate --config fast.yaml") == outputs["GEOMETRY"] == outputs[FROM_FILE]
    # Options replace values of the file: twice the torque doubles the static deflection.
    output = run(f"simulate {FROM_FILE} --torque '170 Nm' --speed 4000")
    assert f" {2.0 * pair.static_deflection:.10g} m " in output
    # For gears given by parameters --teeth is the number of teeth of the pinion.
    assert " 1500 rpm " in run("simulate PAIR --teeth 48 --speed 1500")
    # Undamped gears have a table, but their motion at a speed does not settle, which is an error.
    run(f"gears {UNDAMPED}")
    assert "has not settled" in run(f"gears {UNDAMPED} --damping-ratio 0 --speed 4000", code=1)


def test_optional_keys_of_a_new_project_are_shown_as_comments(run):
    run("init mine")
    assert "mine/config.yaml exists: choose another folder" in run("init mine", code=2)
    text = Path("mine/config.yaml").read_text(encoding="utf-8")
    # The first "shift" belongs to the pinion.
    line = next(line for line in text.splitlines() if line.strip().startswith("# shift:"))
    gears = config.load(yaml.safe_load(text.replace(line, "    shift: 0.3", 1))).gears
    assert (gears.pinion.shift, gears.pinion.module, gears.torque) == (0.3, 2.5e-3, 85.0)


def test_compare_prints_gears_side_by_side_and_draws_their_resonance(run):
    """Compare two result folders by their resonance curves and by tables of gears."""
    curve = gearlib.sweep(K1, [0.7, 0.8, 0.9], periods=60, record_periods=10)
    curve = gathering.gather_resonance([curve.assign_coords(damping="k1", direction="cold")])
    for name in ("light", "heavy"):
        Path(name, "results").mkdir(parents=True)
        storage.write(curve, f"{name}/results/resonance.nc")
    assert "static_deflection m 1e-05 1e-05" in " ".join(run("compare light heavy").split())
    for name, teeth in (("light", 23), ("heavy", 61)):
        table = f"name,of,value,unit,meaning\nmass,pinion,{teeth},kg,of the blank\n"
        Path(name, "results/gears.csv").write_text(table, encoding="utf-8")
    output = run("compare light heavy -o curves.png")
    assert output.split()[:7] == ["light", "heavy", "mass", "pinion", "kg", "23", "61"]
    assert Path("curves.png").stat().st_size > 1000
    words = "FOLDER = 'other' is not allowed: it must be a folder with results/resonance.nc"
    assert words in run("compare light other", code=2)


#: Wrong command line | part of the error message.
REFUSED = """
simulate PAIR | tuning and speed are missing
trust PAIR --speed '50 Hz' | speed = '50 Hz' is not allowed: it must be
simulate --tuning 1 | max_stiffness is missing
simulate PAIR --tuning 1 -o no/run.nc | run.nc cannot be written: No such file
simulate PAIR --tuning 1 -o run.h5 | must end with one of .nc, .csv
sweep PAIR --plot curve.jpg | must end with one of .png, .svg, .pdf
simulate PAIR --tuning 1 --damping k1 | give --config
orbit --config binary.yaml --tuning 1 | binary.yaml is not YAML
orbit --config twice.yaml --tuning 1 | the key a is given again in line 3
orbit --config syntax.yaml --tuning 1 | syntax.yaml is not YAML, line 2, col
orbit --config colon.yaml --tuning 1 | colon.yaml: 'resonance' is not allowed: it must be a mapping
workflow -n --configfile colon.yaml | colon.yaml: 'resonance' is not allowed: it must be a mapping
workflow -n --configfile no.yaml | --configfile = 'no.yaml' is not allowed: it must be a file
simulate --config five.yaml --tuning 1 | dampings = 5 is not allowed: it must be
modes --config four_planets.yaml | planets = 4 is not allowed: it must be such that (z_s + z_r) / N
simulate --config misspelt.yaml --tuning 1 | did you mean resonance
simulate --config four_planets.yaml --damping k9 --tuning 1 | one of k1
gears --teeth 23 --module '2 mm' | --teeth = 23 is not allowed: it must be
gears --teeth 23 -59 --module '2 mm' | gears.wheel.teeth = -59 is not allowed: it must be an integer
gears --teeth '1 2 3' --module '2 mm' | --teeth = '1 2 3' is not allowed: it must be
gears --shift 0.2 --module '2 mm' | --module is not allowed as a value
run-up PAIR --start 2000 --stop '5 kg' --acceleration 9 | stop = '5 kg' is not allowed
run-up PAIR --start 2000 --duration 1 | stop is missing: it must be a finite number >= 0
run-up PAIR --start 2000 --stop 3000 --duration '2 kg' | '2 kg' is not allowed: it must be
sweep PAIR --start 0 | start = 0 is not allowed: it must be a finite number from 1e-12
sweep PAIR --start 1 --stop 1 | stop = 1 is not allowed: it must be different
sweep GEOMETRY --stop 1e9rpm | stop = 1000000000.0 is not allowed
simulate GEOMETRY --model six_degrees --speed 4000 | bearing_stiffness is missing
simulate --tuning 1 UNDAMPED | damping_ratio is missing
gears UNDAMPED --save other.yaml | damping_ratio is missing
modes GEOMETRY | train is missing
campbell PAIR | train is missing
scatter PAIR -t load | must have distinct keys, as in 'load std=5%'
scatter PAIR -t 'load std=1% std=2%' | must have distinct keys
scatter PAIR -t 'load stdd=5%' | must only have the keys mean, std
scatter GEOMETRY --thickness-class '1 2 3' | --thickness-class = '1 2 3' is not allowed: it must be
scatter PAIR -t 'torque std=5%' | need gears given by geometry
scatter PAIR --distance-class js7 | need gears given by geometry
scatter GEOMETRY | --tolerance is missing
"""


def test_invalid_command_lines_exit_with_code_2(run):
    """Each line of REFUSED must print its part of the message."""
    Path("binary.yaml").write_bytes(b"\xff\xfe")
    Path("colon.yaml").write_text("resonance\n", encoding="utf-8")
    write("five.yaml", {"gear_pair": CONFIG["gear_pair"], "dampings": 5})
    Path("syntax.yaml").write_text("run: [1\n", encoding="utf-8")
    Path("twice.yaml").write_text("run:\n  a: 1\n  a: 2\n", encoding="utf-8")
    write("four_planets.yaml", with_train({"kind": "planetary", "planetary": {"planets": 4}}))
    write("misspelt.yaml", CONFIG | {"resonanse": {"start": 0.6}})
    for row in REFUSED.strip().splitlines():
        line, message = row.replace("UNDAMPED", UNDAMPED).split(" | ")
        assert message in " ".join(run(line, code=2).split()), line


@pytest.mark.parametrize(
    "line", ["gears GEOMETRY", "gears GEOMETRY --format csv", "workflow --list-rules"]
)
def test_a_closed_pipe_ends_a_command_in_silence(line):
    reader, writer = os.pipe()
    os.close(reader)
    words = shlex.split(line.replace("GEOMETRY", GEOMETRY))
    command = [sys.executable, "-m", "gearlib", *words]
    process = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, text=True)
    os.close(writer)
    # Snakemake names its profile there.
    assert "Error" not in process.stderr and "Traceback" not in process.stderr


def test_speeds_and_durations_are_given_with_units(run):
    expected = run("run-up PAIR --start 2000 --stop 2500 --duration 0.5")
    line = "run-up PAIR --start '2000 1/min' --stop '2500 U/min' --duration '500 ms'"
    assert run(line) == expected


def test_explore_without_panel_names_the_extra_to_install(run, monkeypatch):
    monkeypatch.setitem(sys.modules, "panel", None)
    monkeypatch.delitem(sys.modules, "gearlib.explorer.page", raising=False)
    monkeypatch.delattr("gearlib.explorer.page", raising=False)
    assert "gearlib[explore]" in run("explore PAIR --no-show", code=1)


def test_existing_files_are_kept_and_failed_writes_exit_with_code_1(run, monkeypatch):
    """Only --force may replace a file, and a full disk must be reported."""
    Path("run.nc").write_text("mine", encoding="utf-8")
    run("simulate PAIR --tuning 0.7 -o run.nc", code=2)
    assert Path("run.nc").read_text(encoding="utf-8") == "mine"
    run("simulate PAIR --tuning 0.7 -o run.nc --force")
    assert xr.load_dataset("run.nc").tuning == 0.7

    def refuse(dataset, path):
        """Fail as on a full disk."""
        raise OSError(f"{path} cannot be written: the disk is full")

    monkeypatch.setattr(storage, "write", refuse)
    output = run("simulate PAIR --tuning 0.7 -o new.nc", code=1)
    assert "Error: new.nc cannot be written: the disk" in output


def cells(text, name):
    """Return the numbers of the row of a printed table that begins with a name.

    Wide tables are printed in several parts, one below the other.
    """
    lines = [line for line in text.splitlines() if line.startswith(f"{name} ")]
    return [float(word) for line in lines for word in line.removeprefix(name).split()]


@pytest.fixture
def reducer(run):
    """Return a reducer with a misplaced pin, after writing its configuration to train.yaml."""
    errors = [[0.0, 10e-6], [0.0, 0.0], [0.0, 0.0]]
    write("train.yaml", with_train({"split_power_reducer": {"pin_errors": errors}}))
    return gearlib.split_power_reducer(K1, pin_errors=errors)


def assert_rows(output, data, columns):
    """Assert that the output has a row for each mesh with the given variables of a dataset."""
    for name in data.mesh.values:
        row = [data[column].sel(mesh=name).item() for column in columns]
        np.testing.assert_allclose(cells(output, name), row, rtol=5e-6, atol=1e-9)


def test_runs_of_a_train_print_a_row_for_each_mesh(run, reducer):
    """Compare the printed rows of a run and of a sweep's largest force with the library."""
    train_options = "--config train.yaml --model train --periods 30"
    columns = ["displacement_max", "displacement_min", "dynamic_force_max", "dynamic_force_min"]
    columns += ["peak_force_ratio", "mean_force", "load_sharing"]
    columns += ["fraction_drive", "contact_loss_fraction", "bounces"]
    output = run(f"simulate {train_options} --tuning 0.7 -o run.nc")
    expected = gearlib.simulate(reducer, 0.7, periods=30)
    assert xr.load_dataset("run.nc").displacement.equals(expected.displacement)
    assert f"{expected.speed.item():.10g} rpm" in output
    # The displaced pin makes the branches share the load unequally.
    assert float(expected.load_sharing.std()) > 0.01
    assert_rows(output, expected, columns)
    output = run(f"sweep {train_options} --start 0.3 --stop 0.5 --points 3")
    curve = gearlib.sweep(reducer, np.linspace(0.3, 0.5, 3), periods=30, record_periods=10)
    largest = curve.isel(tuning=int(curve.peak_force_ratio.max("mesh").argmax("tuning")))
    assert f"{largest.tuning.item():.10g} " in output
    assert_rows(output, largest, columns)


def test_modes_static_phasing_and_campbell_print_the_results_of_the_library(run, reducer):
    modes, static, phasing, campbell = (
        run(f"{command} --config train.yaml")
        for command in ("modes", "static --phase 1.0", "phasing --count 3", "campbell --count 2")
    )
    assert_rows(static, reducer.static(1.0), ("load_sharing", "mesh_force", "contact"))
    # Branches in phase excite rotational modes alone.
    excitations = reducer.phasing(3)
    excited = excitations.excites.sel(stiffness_order=2.0).values
    assert (excited == (excitations.mode_kind.values == "rotational")).all()
    assert f"{sum(excited)} of {sum(excited)}" in phasing
    # Two lines of titles stand above the rows.
    rows, expected = [row.split() for row in modes.splitlines()[2:]], reducer.modes()
    pairs = zip(expected.natural_frequency.values, expected.mode_kind.values, strict=True)
    table = [[f"{frequency:.6g}", kind] for frequency, kind in pairs]
    assert [row[1:] for row in rows[: len(table)]] == table
    diagram = reducer.campbell(2)
    speeds = np.sort(diagram.critical_speed.values[diagram.excites.values])
    printed = [float(row.split()[0]) for row in campbell.splitlines()[2:][: speeds.size]]
    np.testing.assert_allclose(printed, speeds, rtol=1e-5)
