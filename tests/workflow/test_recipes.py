"""Follow each recipe of CONTRIBUTING.md in a copy of the project and test the result."""

import os
import re
import shutil
import subprocess
import sys

import pytest

from tests.workflow.project import ROOT, small_project

PAGE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
_BLOCK = re.compile(r'^```(\w+) title="([^"]+)"\n(.*?)^```', re.DOTALL | re.MULTILINE)


def follow_recipe(folder, heading):
    """Follow the recipe under a heading of CONTRIBUTING.md in a copy of the project.

    A code block is appended to the file in its title, and a diff is applied to it.
    """
    recipe = re.search(rf"^### {heading}\n(.*?)^##", PAGE, re.DOTALL | re.MULTILINE)[1]
    for language, name, text in _BLOCK.findall(recipe):
        path = folder / name
        content = path.read_text(encoding="utf-8") if path.exists() else ""
        if language == "diff":
            for hunk in text.split("@@\n"):
                lines = hunk.splitlines(keepends=True)
                old_text = "".join(line[1:] for line in lines if line[0] != "+")
                new_text = "".join(line[1:] for line in lines if line[0] != "-")
                assert content.count(old_text) == 1, f"{name}: {old_text}"
                content = content.replace(old_text, new_text)
        else:
            content = f"{content}\n\n{text}" if content else text
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content, encoding="utf-8")


@pytest.fixture
def library_copy(tmp_path):
    """Return a folder with a copy of the library and its tests."""
    ignored = shutil.ignore_patterns("__pycache__", "golden")
    for name in ("gearlib", "tests"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=ignored)
    for name in ("pyproject.toml", "config.yaml"):
        shutil.copy2(ROOT / name, tmp_path)
    return tmp_path


def run_python(folder, *arguments):
    """Run Python with the library in a folder, without compiling kernels; return the process."""
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(folder)}
    options = {"cwd": folder, "env": environment, "text": True, "capture_output": True}
    return subprocess.run([sys.executable, *arguments], check=False, **options)


PROFILE_SCRIPT = """
from gearlib.config import load
from gearlib.models.from_values import build_model
from tests.paper import CONFIG
config = load(CONFIG | {"profile": {"kind": "trapezoid", "ramp": 0.2}})
pair = build_model(config.pair_description("k1"))
print(pair.stiffness_model, pair.force_note, pair.equation.is_piecewise_linear())
load(CONFIG | {"profile": {"kind": "trapezoid", "ramp": -0.2}})
"""


def test_a_new_stiffness_profile_works_by_the_recipe(library_copy):
    """The new profile must be configurable, describe itself and refuse a wrong parameter."""
    follow_recipe(library_copy, "A stiffness profile")
    process = run_python(library_copy, "-c", PROFILE_SCRIPT)
    assert process.stdout == "trapezoid with ramps of 0.2 rad  False\n"
    assert "profile.ramp = -0.2 is not allowed: it must be a finite number > 0" in process.stderr


MODEL_SCRIPT = """
import numpy as np
import gearlib
stop = gearlib.Stop(stiffness=1.0)
twin = gearlib.DeadZoneOscillator(
    upper_stiffness=1.0, damping=0.1, load=1.0, forcing=gearlib.Harmonics((0.5,))
)
runs = [gearlib.sweep(model, [0.5, 0.9], periods=5, record_periods=2) for model in (stop, twin)]
assert all(np.array_equal(runs[0][x], runs[1][x], equal_nan=True) for x in runs[0].data_vars)
orbits = [gearlib.periodic_orbit(model, 0.9) for model in (stop, twin)]
assert (orbits[0].multipliers == orbits[1].multipliers).all()
print(*stop.propagators, runs[0].title)
gearlib.Stop(stiffness=-1.0)
"""


def test_a_new_model_works_by_the_recipe(library_copy):
    """The new model must give the results of an equivalent `DeadZoneOscillator`."""
    follow_recipe(library_copy, "A model")
    process = run_python(library_copy, "-c", MODEL_SCRIPT)
    assert process.stdout.startswith("exact taylor ") and "a mass at a stop" in process.stdout
    assert "stiffness = -1.0 is not allowed" in process.stderr


METHOD_SCRIPT = """
import gearlib
from gearlib.config import load
from tests.paper import CONFIG, PAPER_PAIR
pair = PAPER_PAIR.replace(material_damping=3953.7)
method = {"method": "dop853", "options": {"rtol": 1e-10, "atol": 1e-10}}
runs = [gearlib.simulate(pair, 0.9, periods=3, **options) for options in (method, {})]
print(*(run.final_state.values[0] for run in runs), *(run.sizes["event"] for run in runs))
trials = [{"name": name, "method": name} for name in ("dop853", "dop854")]
load(CONFIG | {"failures": {"trials": trials}})
"""


def test_a_new_method_works_by_the_recipe(library_copy):
    """The new method must match the exact method and be a known name in configurations."""
    follow_recipe(library_copy, "A method")
    process = run_python(library_copy, "-c", METHOD_SCRIPT)
    first, second, *events = map(float, process.stdout.split())
    assert first == pytest.approx(second, rel=1e-8) and events[0] == events[1] > 0
    assert "failures.trials[1].method = 'dop854' is not allowed" in process.stderr
    assert "failures.trials[0]" not in process.stderr


@pytest.mark.release
@pytest.mark.slow
def test_a_new_summary_quantity_works_by_the_recipe(library_copy):
    """Tests must pass for the new quantity and fail if it is wrong or has no expected value."""
    follow_recipe(library_copy, "A quantity in summaries")
    tests, orbit = (
        library_copy / "tests/properties/test_summaries.py",
        library_copy / "gearlib/engines/orbit.py",
    )
    # The selected motions touch both flanks and are computed by engines and by a step method.
    test_selection = tests, "-k", "(flanks or strikes or unequal) and (exact or taylor or rk4)"
    assert run_python(library_copy, "-m", "pytest", *test_selection).returncode == 0
    correct_source = orbit.read_text(encoding="utf-8")
    orbit.write_text(
        correct_source.replace("[IMPACTS] += ", "[IMPACTS] += 2.0 * "), encoding="utf-8"
    )
    assert run_python(library_copy, "-m", "pytest", *test_selection).returncode == 1
    # The original tests have no expected value of the new quantity.
    orbit.write_text(correct_source, encoding="utf-8")
    shutil.copy2(ROOT / "tests/properties/test_summaries.py", tests)
    assert run_python(library_copy, "-m", "pytest", *test_selection).returncode == 1


def run_with_report(project, target):
    """Run one target of a project and return the executed rules and the text of the report."""
    project.configure(lambda settings: settings.update(targets=[target]))
    rules = project.run_rules("-j2")
    project.snakemake("--report", "report.html")
    return rules, (project / "report.html").read_text(encoding="utf-8")


@pytest.mark.release
@pytest.mark.slow
def test_a_new_figure_of_existing_data_works_by_the_recipe(tmp_path):
    """The figure must be drawn, appear in the report and be redrawn alone after an edit."""
    project = small_project(tmp_path / "project")
    follow_recipe(project, "A figure of data that exist")
    rules, report = run_with_report(project, "harris_map")
    assert rules == {"compute_harris_map", "draw_harris_map", "draw_relieved_stiffness"}
    assert "Mesh stiffness at 1.0 times the design torque." in report
    assert (project / "results/figures/relieved_stiffness.png").stat().st_size > 1000
    with (project / "gearlib/figures/relieved_stiffness_figure.py").open("a") as source:
        source.write("\n# one more line\n")
    assert project.planned_rules() == {"draw_relieved_stiffness"}


@pytest.mark.release
@pytest.mark.slow
def test_a_new_study_works_by_the_recipe(tmp_path):
    """The new study must run, appear in the report, rerun after a change and check its keys."""
    project = small_project(tmp_path / "project")
    follow_recipe(project, "A study")
    run, report = run_with_report(project, "load_study")
    rules = {"compute_load_study", "load_study_table"}
    assert run == {"compile_kernels", *rules} and "From rest, at tuning 0.75." in report
    assert len((project / "results/load_study.csv").read_text().splitlines()) == 3
    project.configure(lambda settings: settings.update(load_study={"tuning": 0.8}))
    assert project.planned_rules() == rules
    project.configure(lambda settings: settings.update(load_study={"tuned": 0.8}))
    refusal = project.snakemake("-n", succeed=False)
    assert "load_study.tuned = 0.8 is not a known key" in refusal
