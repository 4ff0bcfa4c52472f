"""Jobs that the workflow runs after a change, and its refusals, by the real Snakemake."""

import os
import re
import shutil

import pytest
import yaml

from tests.unit.test_gear_names import GEOMETRY_CONFIG
from tests.workflow.project import ROOT, Project, rules_in_job_table, small_project

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def shared(first_run, tmp_path_factory):
    """Return a copy of the project with all its results, which tests must leave unchanged."""
    folder = tmp_path_factory.mktemp("shared") / "project"
    shutil.copytree(first_run[0].folder, folder)
    return Project(folder)


def planned_after(project, path, edit):
    """Return the rules that would run after an edit of a file, and undo the edit."""
    text = (project / path).read_text(encoding="utf-8")
    try:
        (project / path).write_text(edit(text), encoding="utf-8")
        return project.planned_rules()
    finally:
        (project / path).write_text(text, encoding="utf-8")


def planned_with(project, change):
    """Return the rules that would run with a changed configuration, and undo the change."""

    def edit(text):
        """Return the text of the changed configuration."""
        settings = yaml.safe_load(text)
        change(settings)
        return yaml.safe_dump(settings, sort_keys=False)

    return planned_after(project, "config.yaml", edit)


def test_a_second_run_starts_no_job(project):
    provenance = (project / "results/provenance.json").read_bytes()
    # Files get new dates, and the configuration another order and spelling of its values.
    for path in project.folder.rglob("*"):
        if ".snakemake" not in path.parts and "results" not in path.parts:
            os.utime(path)
    settings = yaml.safe_load((project / "config.yaml").read_text(encoding="utf-8"))
    settings["gear_pair"] = dict(reversed(settings["gear_pair"].items()))
    text = yaml.safe_dump(dict(reversed(settings.items())), sort_keys=False)
    assert "400000000.0" in text
    (project / "config.yaml").write_text(text.replace("400000000.0", "4e8"), encoding="utf-8")
    assert project.run_rules("-j2") == set()
    assert (project / "results/provenance.json").read_bytes() == provenance


#: Rules that run again after an edit of a module; "all" means all jobs and "draw" all figures.
EDITS = {
    "gearlib/engines/pair/events.py": "all",
    "gearlib/figures/style.py": "draw",
    "gearlib/analysis/global_dynamics/poincare.py": {
        *("compute_basins", "draw_basins", "compute_poincare", "draw_poincare"),
        *("compute_bifurcation", "draw_bifurcation"),
    },
    "gearlib/config/experiments.py": set(),
}


@pytest.mark.parametrize("path", EDITS)
def test_an_edited_module_reruns_the_jobs_that_use_it(shared, first_run, path):
    rules = EDITS[path]
    if rules in ("all", "draw"):
        run = rules_in_job_table(first_run[1])
        rules = {rule for rule in run if rules == "all" or rule.startswith("draw_")}
    planned = planned_after(shared, path, lambda text: f"{text}\n# one more line\n")
    assert planned == rules


TRIAL = {"name": "mine", "method": "newmark", "options": {"contact": "frozen"}}
#: Changes of the configuration, and the rules whose jobs run after them.
CHANGES = {
    "another colour, and more of the courses of a scene": (
        lambda c: (
            c["figures"]["colours"].update(k1="#123456"),
            c["scenes"]["fig7_damping"].update(periods_shown=2),
        ),
        {"draw_resonance", "draw_phase_planes", "draw_scene"},
    ),
    "one more method": (
        lambda c: c["failures"]["trials"].append(TRIAL),
        {"trial", "gather_failures", "draw_failures"},
    ),
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_changed_configuration_key_reruns_the_jobs_that_use_it(shared, name):
    change, expected = CHANGES[name]
    assert planned_with(shared, change) == expected


def test_a_larger_stop_keeps_the_computed_windows(shared):
    printed = shared.snakemake("-n", "--config", "resonance={stop: 2.3}")
    planned = {*re.findall(r"^    output: results/resonance/k1/(.*).nc$", printed, re.M)}
    # Sweeps up and down pass through the whole range and must be computed again.
    assert planned == {"cold/1.5000-2.3000", "up/0.5000-2.3000", "down/0.5000-2.3000"}
    rules = {"sweep_window", "gather_resonance", "draw_resonance", "draw_run_ups", "compute_claims"}
    assert rules_in_job_table(printed) == rules


def test_a_changed_damping_reruns_only_the_jobs_with_this_damping(shared):
    planned = planned_with(shared, lambda c: c["dampings"]["k1"].update(material_damping=4000))
    assert {"sweep_window", "label", "phase_plane", "compute_branches"} <= planned
    unaffected = {"compute_basins", "compute_stability_chart", "compute_phase_lag", "trial"}
    assert not unaffected & planned


def test_targets_and_the_command_line_choose_the_jobs(shared, tmp_path):
    """Only jobs for the changed keys and for the requested targets may be planned."""
    (tmp_path / "mine.yaml").write_text("phase_planes: {tunings: [0.9]}\n", encoding="utf-8")
    key = "phase_lag={periods: 110}"
    planned = shared.planned_rules("--configfile", tmp_path / "mine.yaml", "--config", key)
    assert {"phase_plane", "compute_phase_lag"} <= planned
    assert not {"sweep_window", "compute_basins"} & planned
    paper = small_project(tmp_path / "project").planned_rules("paper")
    assert {"draw_phase_lag", "draw_resonance", "draw_scene", "compute_claims"} <= paper
    assert not {"compute_basins", "work_precision_errors", "draw_branches"} & paper


def test_a_new_scene_runs_without_repeating_the_others(project):
    """Adding a scene must run its own jobs and leave all existing results as they are."""
    before = {path: (project / path).stat().st_mtime_ns for path in project.results()}
    case = {"title": "mine", "damping": "k1", "tuning": 0.9, "change": {"contact_ratio": 1.3}}
    scene = {
        "model": "six_degrees",
        "observables": ["bounces"],
        "tolerance": 0.1,
        "cases": [case],
        "courses": ["bearing_y2"],
        "periods_shown": 2,
    }
    project.configure(lambda settings: settings["scenes"].update(mine=scene))
    expected = {"scene", "compare_models", "draw_scene"}
    assert project.run_rules("-j2", "results/figures/mine.png") == expected
    assert (project / "results/figures/mine.png").stat().st_size > 1000
    for path, modified in before.items():
        assert (project / path).stat().st_mtime_ns == modified, path


def test_each_project_writes_to_its_own_folder(project, tmp_path):
    arguments = ("--directory", tmp_path / "mine", "phase_lag", "-j2")
    gears = {"gear_pair": {"max_stiffness": 3e8}, "targets": ["phase_lag"]}
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(gears), encoding="utf-8")
    settings = ("--configfile", tmp_path / "mine.yaml", "--config", "phase_lag={periods: 100}")
    rules = {"compile_kernels", "compute_phase_lag", "draw_phase_lag", "phase_lag"}
    assert project.run_rules(*arguments, *settings) == rules
    assert (tmp_path / "mine/results/figures/phase_shift.png").exists()
    assert project.planned_rules() == set()
    # Another configuration in the folder makes its results out of date.
    shutil.copy(ROOT / "config.yaml", tmp_path / "mine")
    assert project.planned_rules(*arguments) == rules - {"compile_kernels"}


def test_a_failed_job_reports_the_failing_line_of_the_library(project):
    module = project / "gearlib/studies/claims.py"
    with module.open("a") as source:
        source.write("\nraise RuntimeError(f'claims are broken in {__file__}')\n")
    output = project.snakemake("-j2", "results/claims.csv", succeed=False)
    assert f"claims are broken in {module}" in output
    assert not (project / "results/claims.csv").exists()


def test_the_linter_of_snakemake_reports_nothing(shared):
    assert "good condition" in shared.snakemake("--lint")


def test_a_wrong_configuration_is_refused_in_one_sentence(project):
    """Try a missing key, an unknown target and a file that is not YAML."""

    def refusal(*arguments):
        """Return the last line that a refused dry run prints."""
        printed = project.snakemake("-n", *arguments, succeed=False)
        assert "Traceback" not in printed and ".smk" not in printed
        return printed.splitlines()[-1]

    correlations = "correlations: [{parameters: [load, backlash], rho: 0.4}]"
    project.snakemake("-n", "-q", "--config", f"tolerances={{{correlations}}}")
    gamma = "parameters: [{parameter: load, distribution: gamma, shape: {b: 2.0}}]"
    message = refusal("--config", f"tolerances={{{gamma}}}")
    assert message.startswith("tolerances.parameters[0]")
    (project / "mine.yaml").write_text(yaml.safe_dump(GEOMETRY_CONFIG), encoding="utf-8")
    assert refusal("reducer", "--configfile", "mine.yaml").startswith("reducer.teeth is missing")
    assert "No rule to produce resonace" in project.snakemake("-n", "resonace", succeed=False)
    (project / "config.yaml").write_text("run: [1\n", encoding="utf-8")
    assert refusal().startswith("config.yaml is not YAML, line 2, column 1: ")
