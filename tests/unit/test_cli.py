"""Check the printed output, written files and exit codes of the command line."""

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
from tests.unit.test_gear_names import config_with_tip_relief

PAIR_OPTIONS = (
    "--max-stiffness '4e5 N/mm' --stiffness-ratio 0.5879 --contact-ratio 1.569 "
    "--reduced-mass '3123 g' --load '3.2895396 kN' --backlash '40 um' "
    "--teeth 24 --material-damping 3953.7 --backlash-damping 0"
)
UNDAMPED_OPTIONS = "--teeth 23 61 --module 2.5mm --width 18mm --torque 85Nm --backlash 80um"
GEOMETRY_OPTIONS = f"{UNDAMPED_OPTIONS} --damping-ratio 0.05"
DAMPED_PAIR = PAPER_PAIR.replace(material_damping=3953.7)
CONFIG_OPTION = "--config mine.yaml"
CONFIG_FILE = Path(__file__).parents[2] / "config.yaml"


@pytest.fixture
def run_command(tmp_path, monkeypatch):
    """Return a function that runs a command line in an empty folder and returns its output."""
    monkeypatch.chdir(tmp_path)

    def invoke(command_line, exit_code=0):
        """Run a command line, check its exit code and return its output.

        The words PAIR_OPTIONS and GEOMETRY_OPTIONS are replaced by options that describe gears.
        """
        command_line = command_line.replace("PAIR_OPTIONS", PAIR_OPTIONS).replace(
            "GEOMETRY_OPTIONS", GEOMETRY_OPTIONS
        )
        result = CliRunner().invoke(main, shlex.split(command_line))
        assert result.exit_code == exit_code, (command_line, result.output)
        return result.output

    return invoke


def write_yaml(name, content):
    """Write a dict to a YAML file."""
    Path(name).write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")


def config_with_train(train_section):
    """Return a configuration of the paper's pair with a section `train`."""
    dampings = {"k1": {"material_damping": 3953.7, "backlash_damping": 0.0}}
    return {"gear_pair": CONFIG["gear_pair"], "dampings": dampings, "train": train_section}


SPLIT_POWER_REDUCER = gearlib.split_power_reducer(DAMPED_PAIR)
SWEEP_PERIODS = {"periods": 60, "record_periods": 10}
#: Calls of the library by the command line that must give the same dataset.
LIBRARY_CALLS = {
    "simulate --tuning 0.9 --periods 50": lambda: gearlib.simulate(DAMPED_PAIR, 0.9, periods=50),
    "sweep --start 0.7 --stop 0.9 --points 51 --periods 60": lambda: gearlib.sweep(
        DAMPED_PAIR, np.linspace(0.7, 0.9, 51), **SWEEP_PERIODS
    ),
    "sweep --points 5 --periods 60 --direction up": lambda: gearlib.sweep(
        DAMPED_PAIR, np.linspace(0.5, 1.4, 5), direction="up", **SWEEP_PERIODS
    ),
    "orbit --tuning 0.7": lambda: gearlib.periodic_orbit(DAMPED_PAIR, 0.7).dataset(),
    "run-up --start 2000rpm --stop 2500 --acceleration 1000 --back": lambda: gearlib.run_up(
        DAMPED_PAIR, speed=[(0.0, 2000.0), (0.5, 2500.0), (1.0, 2000.0)]
    ),
    "scatter -t 'load std=5%' --samples 4 --points 3 --quantity peak": lambda: gearlib.scatter(
        DAMPED_PAIR, {"load": {"std": "5%"}}, ("peak",), 4,
        tunings=np.linspace(0.5, 1.4, 3), directions=("up", "down", "seeded"),
    ),
    "trust --tuning 0.7 --periods 500": lambda: gearlib.trust(DAMPED_PAIR, 0.7, periods=500).runs,
    f"modes --config {CONFIG_FILE}": SPLIT_POWER_REDUCER.modes,
    f"static --phase 1.0 --config {CONFIG_FILE}": lambda: SPLIT_POWER_REDUCER.static(1.0),
    f"phasing --count 3 --config {CONFIG_FILE}": lambda: SPLIT_POWER_REDUCER.phasing(3),
    f"campbell --count 2 --config {CONFIG_FILE}": lambda: SPLIT_POWER_REDUCER.campbell(2),
}  # fmt: skip


@pytest.mark.parametrize("command", LIBRARY_CALLS)
def test_output_files_match_the_library_in_the_format_of_their_suffix(run_command, command):
    """The NetCDF and CSV files of each command must hold the dataset that the library computes."""
    run_command(f"{command} PAIR_OPTIONS -o data.nc --plot picture.png")
    run_command(f"{command} PAIR_OPTIONS -o data.csv")
    data, expected = xr.load_dataset("data.nc"), LIBRARY_CALLS[command]()
    # The command divides sweeps from rest into other batches, which changes the rounding.
    xr.testing.assert_allclose(data, expected, rtol=1e-12)
    if command.startswith("simulate"):
        xr.testing.assert_identical(data.drop_attrs(deep=False), expected.drop_attrs(deep=False))
    assert data.attrs.items() - expected.attrs.items() == {
        (name, data.attrs[name]) for name in ("history", "source_hash")
    }
    column_names, *rows = csv.reader(Path("data.csv").read_text(encoding="utf-8").splitlines())
    # The first column is the dimension of the dataset, with its unit in brackets. The table of an
    # orbit has none, but a row for displacement and velocity each.
    dimension = column_names[0].partition(" [")[0]
    assert len(rows) == (data.sizes[dimension] if dimension in data.sizes else 2)
    columns = dict(zip(column_names, zip(*rows, strict=True), strict=True))
    for variable in data.data_vars.values():
        if variable.dims == (dimension,) and "units" in variable.attrs:
            unit = WRITTEN_UNITS.get(variable.units, variable.units)
            column = columns[f"{variable.name} [{unit}]" if unit else variable.name]
            np.testing.assert_array_equal([float(cell) for cell in column], variable.values)
    # A variable with further dimensions has a column for each of their entries.
    assert "modes" not in command or "mode_shape input rotation" in column_names
    assert Path("picture.png").read_bytes().startswith(b"\x89PNG")


def test_a_left_hand_helix_is_a_negative_angle(run_command):
    """Both hands of the helix must give the same table of gears, apart from the printed angle."""
    right_hand_table, left_hand_table = (
        run_command(f"gears GEOMETRY_OPTIONS --helix-angle {sign}15deg").splitlines()
        for sign in ("", "-")
    )
    assert "-15" in left_hand_table[0] and right_hand_table[1:] == left_hand_table[1:]


def test_gears_are_described_by_the_properties_their_model_uses(run_command):
    """The printed description must state that a rectangular stiffness omits the tip relief."""
    write_yaml("relieved.yaml", config_with_tip_relief())
    line = "simulate --config relieved.yaml --speed 4000rpm"
    rectangle = "tip relief left out; rectangle, kappa 0.5714, epsilon 1.689, ISO 6336-1"
    assert rectangle in " ".join(run_command(f"{line} --model rectangle").split())
    assert "tip relief; pairs of teeth, energy method" in " ".join(run_command(line).split())


def test_a_run_up_an_orbit_and_trust_print_their_results(run_command):
    """Printed states and multipliers must be those of the library, rounded to six digits."""
    line = "run-up PAIR_OPTIONS --start 2000rpm --stop 2500 --acceleration 1000"
    assert "revolutions; the revolution with the largest force" in run_command(line)
    # Acceleration and duration exclude each other.
    assert "acceleration = 1000.0 is not allowed" in run_command(
        f"{line} --duration 1", exit_code=2
    )
    output, orbit = (
        run_command("orbit PAIR_OPTIONS --tuning 0.7"),
        gearlib.periodic_orbit(DAMPED_PAIR, 0.7),
    )
    assert "stable orbit of period 1" in output
    assert all(f"{component:.6g}" in output for component in orbit.state)
    assert all(f"{multiplier.real:.6g} " in output for multiplier in orbit.multipliers)
    output = run_command("trust PAIR_OPTIONS --tuning 0.7 --periods 500")
    assert output.startswith("paper's pair; rectangle, kappa 0.5879, epsilon 1.569\nperiodic: ")
    write_yaml("train.yaml", config_with_train({"kind": "planetary"}))
    output = run_command("orbit --config train.yaml --model train --tuning 2.5")
    # The rows of the state of a train are numbered from 0.
    last_row = gearlib.planetary().size - 1
    assert "orbit of period 1" in output and f"\n{last_row} " in output


def test_gears_given_by_geometry_come_from_options_or_a_saved_file(run_command):
    """Options on the command line, a saved file and the library must give the same motion."""
    run_command("gears GEOMETRY_OPTIONS --save mine.yaml --plot stiffness.svg")
    assert Path("stiffness.svg").exists()
    pair = gearlib.LoadSharingPair.from_geometry(
        stages.documentation_stage(), torque=85.0, damping_ratio=0.05
    )
    expected = gearlib.simulate(pair, speed=4000.0, periods=200, initial_state="static")
    outputs = {
        gears: run_command(f"simulate {gears} --speed 4000")
        for gears in ("GEOMETRY_OPTIONS", CONFIG_OPTION)
    }
    run_command(f"simulate {CONFIG_OPTION} --speed 4000 -o run.nc")
    displacement = xr.load_dataset("run.nc").displacement
    np.testing.assert_allclose(displacement, expected.displacement, rtol=1e-9)
    first_line = outputs["GEOMETRY_OPTIONS"].splitlines()[0]
    assert first_line == "gear pair z 23/61, m 2.5 mm; pairs of teeth, energy method"
    # Runs without a speed use the one saved with the gears.
    run_command("gears GEOMETRY_OPTIONS --speed 4000 --save fast.yaml")
    assert (
        run_command("simulate --config fast.yaml")
        == outputs["GEOMETRY_OPTIONS"]
        == outputs[CONFIG_OPTION]
    )
    # Options replace values of the file: twice the torque doubles the static deflection.
    output = run_command(f"simulate {CONFIG_OPTION} --torque '170 Nm' --speed 4000")
    assert f" {2.0 * pair.static_deflection:.10g} m " in output
    # For gears given by parameters --teeth is the number of teeth of the pinion.
    assert " 1500 rpm " in run_command("simulate PAIR_OPTIONS --teeth 48 --speed 1500")
    # The table of gears needs no damping, but an undamped motion at a speed does not settle.
    run_command(f"gears {UNDAMPED_OPTIONS}")
    line = f"gears {UNDAMPED_OPTIONS} --damping-ratio 0 --speed 4000"
    assert "has not settled" in run_command(line, exit_code=1)


def test_optional_keys_of_a_new_project_are_shown_as_comments(run_command):
    """A key of the new configuration must take effect when its comment sign is removed."""
    run_command("init mine")
    assert "mine/config.yaml exists: choose another folder" in run_command("init mine", exit_code=2)
    text = Path("mine/config.yaml").read_text(encoding="utf-8")
    # The first "shift" belongs to the pinion.
    line = next(line for line in text.splitlines() if line.strip().startswith("# shift:"))
    gears = config.load(yaml.safe_load(text.replace(line, "    shift: 0.3", 1))).gears
    assert (gears.pinion.shift, gears.pinion.module, gears.torque) == (0.3, 2.5e-3, 85.0)


def test_compare_prints_gears_side_by_side_and_draws_their_resonance(run_command):
    """Two folders of results must be compared in one table and in a figure of resonance curves."""
    curve = gearlib.sweep(DAMPED_PAIR, [0.7, 0.8, 0.9], periods=60, record_periods=10)
    curve = gathering.gather_resonance([curve.assign_coords(damping="k1", direction="cold")])
    for name in ("light", "heavy"):
        Path(name, "results").mkdir(parents=True)
        storage.write(curve, f"{name}/results/resonance.nc")
    assert "static_deflection m 1e-05 1e-05" in " ".join(run_command("compare light heavy").split())
    for name, teeth in (("light", 23), ("heavy", 61)):
        table = f"name,of,value,unit,meaning\nmass,pinion,{teeth},kg,of the blank\n"
        Path(name, "results/gears.csv").write_text(table, encoding="utf-8")
    output = run_command("compare light heavy -o curves.png")
    assert output.split()[:7] == ["light", "heavy", "mass", "pinion", "kg", "23", "61"]
    assert Path("curves.png").stat().st_size > 1000
    message = "FOLDER = 'other' is not allowed: it must be a folder with results/resonance.nc"
    assert message in run_command("compare light other", exit_code=2)


#: Invalid command line | part of the error message.
INVALID_COMMAND_LINES = """
simulate PAIR_OPTIONS | tuning and speed are missing
trust PAIR_OPTIONS --speed '50 Hz' | speed = '50 Hz' is not allowed: it must be
simulate --tuning 1 | max_stiffness is missing
simulate PAIR_OPTIONS --tuning 1 -o no/run.nc | run.nc cannot be written: No such file
simulate PAIR_OPTIONS --tuning 1 -o run.h5 | must end with one of .nc, .csv
sweep PAIR_OPTIONS --plot curve.jpg | must end with one of .png, .svg, .pdf
simulate PAIR_OPTIONS --tuning 1 --damping k1 | give --config
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
run-up PAIR_OPTIONS --start 2000 --stop '5 kg' --acceleration 9 | stop = '5 kg' is not allowed
run-up PAIR_OPTIONS --start 2000 --duration 1 | stop is missing: it must be a finite number >= 0
run-up PAIR_OPTIONS --start 2000 --stop 3000 --duration '2 kg' | '2 kg' is not allowed: it must be
sweep PAIR_OPTIONS --start 0 | start = 0 is not allowed: it must be a finite number from 1e-12
sweep PAIR_OPTIONS --start 1 --stop 1 | stop = 1 is not allowed: it must be different
sweep GEOMETRY_OPTIONS --stop 1e9rpm | stop = 1000000000.0 is not allowed
simulate GEOMETRY_OPTIONS --model six_degrees --speed 4000 | bearing_stiffness is missing
simulate --tuning 1 UNDAMPED_OPTIONS | damping_ratio is missing
gears UNDAMPED_OPTIONS --save other.yaml | damping_ratio is missing
modes GEOMETRY_OPTIONS | train is missing
campbell PAIR_OPTIONS | train is missing
scatter PAIR_OPTIONS -t load | must have distinct keys, as in 'load std=5%'
scatter PAIR_OPTIONS -t 'load std=1% std=2%' | must have distinct keys
scatter PAIR_OPTIONS -t 'load stdd=5%' | must only have the keys mean, std
scatter GEOMETRY_OPTIONS --thickness-class '1 2 3' | --thickness-class = '1 2 3' is not allowed
scatter PAIR_OPTIONS -t 'torque std=5%' | need gears given by geometry
scatter PAIR_OPTIONS --distance-class js7 | need gears given by geometry
scatter GEOMETRY_OPTIONS | --tolerance is missing
"""


def test_invalid_command_lines_exit_with_code_2(run_command):
    """Each command line must print the expected part of an error message."""
    Path("binary.yaml").write_bytes(b"\xff\xfe")
    Path("colon.yaml").write_text("resonance\n", encoding="utf-8")
    write_yaml("five.yaml", {"gear_pair": CONFIG["gear_pair"], "dampings": 5})
    Path("syntax.yaml").write_text("run: [1\n", encoding="utf-8")
    Path("twice.yaml").write_text("run:\n  a: 1\n  a: 2\n", encoding="utf-8")
    write_yaml(
        "four_planets.yaml", config_with_train({"kind": "planetary", "planetary": {"planets": 4}})
    )
    write_yaml("misspelt.yaml", CONFIG | {"resonanse": {"start": 0.6}})
    for row in INVALID_COMMAND_LINES.strip().splitlines():
        line, message = row.replace("UNDAMPED_OPTIONS", UNDAMPED_OPTIONS).split(" | ")
        output = run_command(line, exit_code=2)
        # The message may be broken into several lines.
        assert message in " ".join(output.split()), line


@pytest.mark.parametrize(
    "line",
    ["gears GEOMETRY_OPTIONS", "gears GEOMETRY_OPTIONS --format csv", "workflow --list-rules"],
)
def test_a_closed_pipe_ends_a_command_silently(line):
    """A command whose output nobody reads, as in `gearlib ... | head`, must print no error."""
    read_end, write_end = os.pipe()
    os.close(read_end)
    arguments = shlex.split(line.replace("GEOMETRY_OPTIONS", GEOMETRY_OPTIONS))
    command = [sys.executable, "-m", "gearlib", *arguments]
    process = subprocess.run(command, stdout=write_end, stderr=subprocess.PIPE, text=True)
    os.close(write_end)
    # The stream is not empty, because Snakemake prints the name of its profile.
    assert "Error" not in process.stderr and "Traceback" not in process.stderr


def test_speeds_and_durations_are_given_with_units(run_command):
    expected = run_command("run-up PAIR_OPTIONS --start 2000 --stop 2500 --duration 0.5")
    line = "run-up PAIR_OPTIONS --start '2000 1/min' --stop '2500 U/min' --duration '500 ms'"
    assert run_command(line) == expected


def test_explore_without_panel_names_the_extra_to_install(run_command, monkeypatch):
    """If the package panel cannot be imported, the error must name the extra `explore`."""
    monkeypatch.setitem(sys.modules, "panel", None)
    monkeypatch.delitem(sys.modules, "gearlib.explorer.page", raising=False)
    monkeypatch.delattr("gearlib.explorer.page", raising=False)
    assert "gearlib[explore]" in run_command("explore PAIR_OPTIONS --no-show", exit_code=1)


def test_existing_files_are_kept_and_failed_writes_exit_with_code_1(run_command, monkeypatch):
    """A file may be overwritten with --force only, and a full disk must be reported."""
    Path("run.nc").write_text("existing content", encoding="utf-8")
    run_command("simulate PAIR_OPTIONS --tuning 0.7 -o run.nc", exit_code=2)
    assert Path("run.nc").read_text(encoding="utf-8") == "existing content"
    run_command("simulate PAIR_OPTIONS --tuning 0.7 -o run.nc --force")
    assert xr.load_dataset("run.nc").tuning == 0.7

    def fail_to_write(dataset, path):
        """Fail as on a full disk."""
        raise OSError(f"{path} cannot be written: the disk is full")

    monkeypatch.setattr(storage, "write", fail_to_write)
    output = run_command("simulate PAIR_OPTIONS --tuning 0.7 -o new.nc", exit_code=1)
    assert "Error: new.nc cannot be written: the disk" in output


def printed_numbers(output, name):
    """Return the numbers in the row `name` of a printed table.

    Wide tables are printed in several blocks of columns, one below the other.
    """
    lines = [line for line in output.splitlines() if line.startswith(f"{name} ")]
    return [float(word) for line in lines for word in line.removeprefix(name).split()]


@pytest.fixture
def reducer(run_command):
    """Write the configuration of a reducer with a pin error to train.yaml; return the reducer."""
    pin_errors = [[0.0, 10e-6], [0.0, 0.0], [0.0, 0.0]]
    write_yaml("train.yaml", config_with_train({"split_power_reducer": {"pin_errors": pin_errors}}))
    return gearlib.split_power_reducer(DAMPED_PAIR, pin_errors=pin_errors)


def assert_rows(output, dataset, columns):
    """Assert that a printed table has a row for each mesh with the given variables of a dataset."""
    for mesh in dataset.mesh.values:
        expected = [dataset[column].sel(mesh=mesh).item() for column in columns]
        # Numbers are printed with six digits.
        np.testing.assert_allclose(printed_numbers(output, mesh), expected, rtol=5e-6, atol=1e-9)


def test_runs_of_a_train_print_a_row_for_each_mesh(run_command, reducer):
    """A run, and a sweep at its largest force, must print the values that the library computes."""
    train_options = "--config train.yaml --model train --periods 30"
    columns = ["displacement_max", "displacement_min", "dynamic_force_max", "dynamic_force_min"]
    columns += ["peak_force_ratio", "mean_force", "load_sharing"]
    columns += ["fraction_drive", "contact_loss_fraction", "bounces"]
    output = run_command(f"simulate {train_options} --tuning 0.7 -o run.nc")
    expected = gearlib.simulate(reducer, 0.7, periods=30)
    assert xr.load_dataset("run.nc").displacement.equals(expected.displacement)
    assert f"{expected.speed.item():.10g} rpm" in output
    # The pin error makes the branches share the load unequally.
    assert float(expected.load_sharing.std()) > 0.01
    assert_rows(output, expected, columns)
    output = run_command(f"sweep {train_options} --start 0.3 --stop 0.5 --points 3")
    curve = gearlib.sweep(reducer, np.linspace(0.3, 0.5, 3), periods=30, record_periods=10)
    largest = curve.isel(tuning=int(curve.peak_force_ratio.max("mesh").argmax("tuning")))
    assert f"{largest.tuning.item():.10g} " in output
    assert_rows(output, largest, columns)


def test_modes_static_phasing_and_campbell_print_the_results_of_the_library(run_command, reducer):
    """Compare frequencies, static forces, excited modes and critical speeds with the library."""
    modes, static, phasing, campbell = (
        run_command(f"{command} --config train.yaml")
        for command in ("modes", "static --phase 1.0", "phasing --count 3", "campbell --count 2")
    )
    assert_rows(static, reducer.static(1.0), ("load_sharing", "mesh_force", "contact"))
    # At this order the branches mesh in phase, which excites rotational modes only.
    excitations = reducer.phasing(3)
    is_excited = excitations.excites.sel(stiffness_order=2.0).values
    assert (is_excited == (excitations.mode_kind.values == "rotational")).all()
    assert f"{sum(is_excited)} of {sum(is_excited)}" in phasing
    # Each table has two lines of column titles.
    title_lines, expected = 2, reducer.modes()
    pairs = zip(expected.natural_frequency.values, expected.mode_kind.values, strict=True)
    expected_rows = [[f"{frequency:.6g}", kind] for frequency, kind in pairs]
    rows = [row.split() for row in modes.splitlines()[title_lines:]]
    assert [row[1:] for row in rows[: len(expected_rows)]] == expected_rows
    diagram = reducer.campbell(2)
    critical_speeds = np.sort(diagram.critical_speed.values[diagram.excites.values])
    rows = campbell.splitlines()[title_lines:][: critical_speeds.size]
    printed_speeds = [float(row.split()[0]) for row in rows]
    np.testing.assert_allclose(printed_speeds, critical_speeds, rtol=1e-5)
