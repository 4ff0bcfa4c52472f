"""Which jobs the real Snakemake runs after a change, and which configurations are refused."""

import os
import re
import shutil

import pytest
import yaml

from tests.unit.test_gear_names import GEOMETRY_CONFIG
from tests.workflow.project import ROOT, Project, rules_in_job_table, small_project

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def unchanged_project(first_run, tmp_path_factory):
    """Return a copy of the project with all its results, which tests must leave unchanged."""
    folder = tmp_path_factory.mktemp("unchanged_project") / "project"
    shutil.copytree(first_run[0].folder, folder)
    return Project(folder)


def rules_after_edit(project, path, edit):
    """Return the rules that would run after an edit of a file, and restore the file."""
    text = (project / path).read_text(encoding="utf-8")
    try:
        (project / path).write_text(edit(text), encoding="utf-8")
        return project.planned_rules()
    finally:
        (project / path).write_text(text, encoding="utf-8")


def rules_with_change(project, change):
    """Return the rules that would run with a changed configuration, and restore the file.

    `change` modifies the configuration dict in place.
    """

    def edit(text):
        """Return the text of the changed configuration."""
        configuration = yaml.safe_load(text)
        change(configuration)
        return yaml.safe_dump(configuration, sort_keys=False)

    return rules_after_edit(project, "config.yaml", edit)


def test_a_second_run_starts_no_job(project):
    """New dates, another order of keys and another notation of a number must not rerun any job."""
    provenance = (project / "results/provenance.json").read_bytes()
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


#: Module -> rules that must run again after an edit. "all" means all rules, and "draw" means the
#: rules of figures.
RULES_AFTER_EDITS = {
    "gearlib/engines/pair/events.py": "all",
    "gearlib/figures/style.py": "draw",
    "gearlib/analysis/global_dynamics/poincare.py": {
        *("compute_basins", "draw_basins", "compute_poincare", "draw_poincare"),
        *("compute_bifurcation", "draw_bifurcation"),
    },
    "gearlib/config/experiments.py": set(),
}


@pytest.mark.parametrize("path", RULES_AFTER_EDITS)
def test_an_edited_module_reruns_the_jobs_that_use_it(unchanged_project, first_run, path):
    """An edit must rerun exactly the jobs that load the edited module."""
    expected = RULES_AFTER_EDITS[path]
    if expected in ("all", "draw"):
        _, output = first_run
        all_rules = rules_in_job_table(output)
        drawing_rules = {rule for rule in all_rules if rule.startswith("draw_")}
        expected = all_rules if expected == "all" else drawing_rules
    rules = rules_after_edit(unchanged_project, path, lambda text: f"{text}\n# one more line\n")
    assert rules == expected


TRIAL = {"name": "mine", "method": "newmark", "options": {"contact": "frozen"}}
#: Changes of the configuration, and the rules whose jobs run after them.
CHANGES = {
    "another colour and a longer time history in a scene": (
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
def test_a_changed_configuration_key_reruns_the_jobs_that_use_it(unchanged_project, name):
    change, expected = CHANGES[name]
    assert rules_with_change(unchanged_project, change) == expected


def test_a_larger_tuning_range_keeps_the_computed_windows(unchanged_project):
    """Only the new window of sweeps from rest must be computed, because each run starts anew."""
    output = unchanged_project.snakemake("-n", "--config", "resonance={stop: 2.3}")
    windows = {*re.findall(r"^    output: results/resonance/k1/(.*).nc$", output, re.M)}
    # Sweeps up and down pass on their state, so that the whole range is computed again.
    assert windows == {"cold/1.5000-2.3000", "up/0.5000-2.3000", "down/0.5000-2.3000"}
    rules = {"sweep_window", "gather_resonance", "draw_resonance", "draw_run_ups", "compute_claims"}
    assert rules_in_job_table(output) == rules


def test_a_changed_damping_reruns_only_the_jobs_with_this_damping(unchanged_project):
    """Studies that do not use the damping k1 must not run again."""
    rules = rules_with_change(
        unchanged_project, lambda c: c["dampings"]["k1"].update(material_damping=4000)
    )
    assert {"sweep_window", "label", "phase_plane", "compute_branches"} <= rules
    unaffected_rules = {"compute_basins", "compute_stability_chart", "compute_phase_lag", "trial"}
    assert not unaffected_rules & rules


def test_targets_and_the_command_line_choose_the_jobs(unchanged_project, tmp_path):
    """Only jobs that depend on changed keys, or that a requested target needs, may be planned."""
    (tmp_path / "mine.yaml").write_text("phase_planes: {tunings: [0.9]}\n", encoding="utf-8")
    phase_lag_change = "phase_lag={periods: 110}"
    changed_rules = unchanged_project.planned_rules(
        "--configfile", tmp_path / "mine.yaml", "--config", phase_lag_change
    )
    assert {"phase_plane", "compute_phase_lag"} <= changed_rules
    assert not {"sweep_window", "compute_basins"} & changed_rules
    paper_rules = small_project(tmp_path / "project").planned_rules("paper")
    assert {"draw_phase_lag", "draw_resonance", "draw_scene", "compute_claims"} <= paper_rules
    assert not {"compute_basins", "work_precision_errors", "draw_branches"} & paper_rules


def test_a_new_scene_runs_without_repeating_the_others(project):
    """A new scene must run its own jobs and leave all existing results unchanged."""
    modification_times = {path: (project / path).stat().st_mtime_ns for path in project.results()}
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
    for path, modification_time in modification_times.items():
        assert (project / path).stat().st_mtime_ns == modification_time, path


def test_results_in_another_folder_are_independent_of_the_project(project, tmp_path):
    """A run with `--directory` must use and write only files in that folder."""
    arguments = ("--directory", tmp_path / "mine", "phase_lag", "-j2")
    configuration = {"gear_pair": {"max_stiffness": 3e8}, "targets": ["phase_lag"]}
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(configuration), encoding="utf-8")
    options = ("--configfile", tmp_path / "mine.yaml", "--config", "phase_lag={periods: 100}")
    rules = {"compile_kernels", "compute_phase_lag", "draw_phase_lag", "phase_lag"}
    assert project.run_rules(*arguments, *options) == rules
    assert (tmp_path / "mine/results/figures/phase_shift.png").exists()
    assert project.planned_rules() == set()
    # A configuration file in the folder takes effect and makes the results outdated.
    shutil.copy(ROOT / "config.yaml", tmp_path / "mine")
    assert project.planned_rules(*arguments) == rules - {"compile_kernels"}


def test_a_failed_job_reports_the_error_of_the_library(project):
    """The output must contain the error message, and no result may be written."""
    module = project / "gearlib/studies/claims.py"
    with module.open("a") as source:
        source.write("\nraise RuntimeError(f'claims are broken in {__file__}')\n")
    output = project.snakemake("-j2", "results/claims.csv", succeed=False)
    assert f"claims are broken in {module}" in output
    assert not (project / "results/claims.csv").exists()


def test_the_linter_of_snakemake_reports_nothing(unchanged_project):
    assert "good condition" in unchanged_project.snakemake("--lint")


def test_a_wrong_configuration_is_refused_in_one_sentence(project):
    """Wrong values, missing keys, unknown targets and invalid YAML must each give one sentence."""

    def refusal(*arguments):
        """Return the last line of the output of a dry run that is refused."""
        output = project.snakemake("-n", *arguments, succeed=False)
        assert "Traceback" not in output and ".smk" not in output
        return output.splitlines()[-1]

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
