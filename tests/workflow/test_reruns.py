"""What the workflow runs after a change, and what it refuses: the real Snakemake, small jobs."""

import os
import shutil

import pytest
import yaml

from gearlib.data import storage
from tests.unit.test_gear_names import OWN
from tests.workflow.project import ROOT, Project, job_counts, small_project

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def shared(first_run, tmp_path_factory):
    """A copy of the project with all its results, which tests leave as it was."""
    folder = tmp_path_factory.mktemp("shared") / "project"
    shutil.copytree(first_run[0].folder, folder)
    return Project(folder)


def planned_after(project, path, edit):
    """Return the jobs that Snakemake would run after an edit of the text of a file; undo it."""
    text = (project / path).read_text(encoding="utf-8")
    try:
        (project / path).write_text(edit(text), encoding="utf-8")
        return project.planned()
    finally:
        (project / path).write_text(text, encoding="utf-8")


def planned_with(project, change):
    """Return the jobs that Snakemake would run with another configuration; undo the change."""

    def edit(text):
        settings = yaml.safe_load(text)
        change(settings)
        return yaml.safe_dump(settings, sort_keys=False)

    return planned_after(project, "config.yaml", edit)


def test_second_run_does_nothing(project):
    provenance = (project / "results/provenance.json").read_bytes()
    # New dates of equal files, other order and spelling in the configuration.
    for path in project.folder.rglob("*"):
        if ".snakemake" not in path.parts and "results" not in path.parts:
            os.utime(path)
    settings = yaml.safe_load((project / "config.yaml").read_text(encoding="utf-8"))
    settings["gear_pair"] = dict(reversed(settings["gear_pair"].items()))
    text = yaml.safe_dump(dict(reversed(settings.items())), sort_keys=False)
    assert "400000000.0" in text
    (project / "config.yaml").write_text(text.replace("400000000.0", "4e8"), encoding="utf-8")
    assert project.jobs("-j2") == {}
    assert (project / "results/provenance.json").read_bytes() == provenance


#: Edited module -> the rules that run again; "all" and "draw" stand for all jobs and all figures.
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
def test_edited_module_reruns_the_jobs_that_use_it(shared, first_run, path):
    jobs = job_counts(first_run[1])
    rules = EDITS[path]
    if rules in ("all", "draw"):
        rules = {rule for rule in jobs if rules == "all" or rule.startswith("draw_")}
    planned = planned_after(shared, path, lambda text: f"{text}\n# one more line\n")
    assert planned == {rule: jobs[rule] for rule in rules}


TRIAL = {"name": "mine", "method": "newmark", "options": {"contact": "frozen"}}
#: Change of the configuration, and the jobs that run then.
CHANGES = {
    "another colour, and more of the courses of a scene": (
        lambda c: (
            c["figures"]["colours"].update(k1="#123456"),
            c["scenes"]["fig7_damping"].update(periods_shown=2),
        ),
        {"draw_resonance": 1, "draw_phase_planes": 1, "draw_scene": 1},
    ),
    "a larger stop leaves the computed windows": (
        lambda c: c["resonance"].update(stop=2.3),
        {
            # One new cold window for each damping; up and down go through the whole range.
            "sweep_window": 4 * 3,
            "gather_resonance": 1,
            "draw_resonance": 1,
            "draw_run_ups": 1,
            "compute_claims": 1,
        },
    ),
    "one more method": (
        lambda c: c["failures"]["trials"].append(TRIAL),
        {"trial": 1, "gather_failures": 1, "draw_failures": 1},
    ),
}


@pytest.mark.parametrize("name", CHANGES)
def test_changed_configuration_reruns_the_jobs_that_use_the_key(shared, name):
    change, expected = CHANGES[name]
    assert planned_with(shared, change) == expected


def test_another_damping_reruns_the_jobs_with_this_damping(shared):
    planned = planned_with(shared, lambda c: c["dampings"]["k1"].update(material_damping=4000))
    one_damping = {"sweep_window": 3, "label": 1, "phase_plane": 1, "compute_branches": 1}
    assert one_damping.items() <= planned.items()
    unaffected = {"compute_basins", "compute_stability_chart", "compute_phase_lag", "trial"}
    assert not unaffected & {*planned}


def test_targets_and_the_command_line_choose_the_jobs(shared, tmp_path):
    (tmp_path / "mine.yaml").write_text("phase_planes: {tunings: [0.9]}\n", encoding="utf-8")
    key = "phase_lag={periods: 110}"
    planned = shared.planned("--configfile", tmp_path / "mine.yaml", "--config", key)
    assert (planned["phase_plane"], planned["compute_phase_lag"]) == (4, 1)
    project = small_project(tmp_path / "project")
    paper = {*project.planned("paper")}
    assert {"draw_phase_lag", "draw_resonance", "draw_scene", "compute_claims"} <= paper
    assert not {"compute_basins", "work_precision_errors", "draw_branches"} & paper
    shutil.copy(ROOT / "gallery.yaml", project / "gallery.yaml")
    files = [f"results/{case}" for case in ("fzg_c/resonance.nc", "planetary/train_sweep.nc")]
    assert project.planned("--configfile", "gallery.yaml", "--", *files) == {
        "fzg_c_compile_kernels": 1,
        "fzg_c_sweep_window": 3,
        "fzg_c_gather_resonance": 1,
        "planetary_compile_matrix_kernels": 1,
        "planetary_compute_train_sweep": 1,
    }


def test_new_scene_runs_beside_the_others(project):
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
    expected = {"scene": 1, "compare_models": 1, "draw_scene": 1}
    assert project.jobs("-j2", "results/figures/mine.png") == expected
    assert (project / "results/figures/mine.png").stat().st_size > 1000
    for path, modified in before.items():
        assert (project / path).stat().st_mtime_ns == modified, path


def test_cases_have_folders_side_by_side(tmp_path):
    project = small_project(tmp_path / "project")
    cases = {"light": {"gear_pair": {"load": "1 kN"}}, "heavy": {"gear_pair": {"load": "6 kN"}}}
    project.configure(lambda settings: settings.update(targets=["phase_lag"], cases=cases))
    parts = ("compile_kernels", "compute_phase_lag", "draw_phase_lag")
    both = {f"{case}_{rule}": 1 for case in cases for rule in parts}
    assert project.jobs("-j2") == both
    light, heavy = (storage.read(project / f"results/{case}/phase_lag.nc") for case in cases)
    assert '"load":1000.0' in light.attrs["gear_pair"]
    assert '"load":6000.0' in heavy.attrs["gear_pair"]
    project.configure(lambda settings: settings["cases"]["light"]["gear_pair"].update(load="2 kN"))
    assert project.planned() == {"light_compute_phase_lag": 1, "light_draw_phase_lag": 1}


def test_other_gears_have_their_own_folder(tmp_path):
    project = small_project(tmp_path / "project")
    gears = {"gear_pair": {"max_stiffness": 3e8}, "targets": ["phase_lag"]}
    mine = project / "mine.yaml"
    mine.write_text(yaml.safe_dump(gears), encoding="utf-8")
    arguments = ("--configfile", "mine.yaml")
    project.snakemake("-j2", "phase_lag", *arguments)
    assert (project / "results/mine/figures/phase_shift.png").exists()
    assert [path.name for path in (project / "results").iterdir()] == ["mine"]
    # Another load belongs to the same gears, another stiffness to other gears.
    mine.write_text(yaml.safe_dump(gears | {"gear_pair": {"max_stiffness": 3e8, "load": 1e3}}))
    expected = {"compute_phase_lag": 1, "draw_phase_lag": 1, "gears_table": 1}
    assert project.planned(*arguments) == expected
    mine.write_text(yaml.safe_dump(gears | {"gear_pair": {"max_stiffness": 2e8}}))
    printed = project.snakemake("-j2", *arguments, succeed=False)
    assert "results/mine/ holds what was computed for the gear pair C_max 300 N/µm" in printed
    mine.write_text(yaml.safe_dump(gears | {"project": "softer"}))
    assert "results/softer/phase_lag.nc" in project.snakemake("-n", *arguments)


def test_a_failed_job_shows_where_the_library_beside_the_snakefile_failed(project):
    module = project / "gearlib/studies/claims/scene_claims.py"
    with module.open("a") as source:
        source.write("\nraise RuntimeError(f'claims are broken in {__file__}')\n")
    output = project.snakemake("-j2", "results/claims.csv", succeed=False)
    assert f"claims are broken in {module}" in output
    assert not (project / "results/claims.csv").exists()


def test_lint_finds_nothing(shared):
    assert "good condition" in shared.snakemake("--lint")


def test_wrong_configuration_is_refused_in_one_sentence(project):
    def refusal(*arguments):
        printed = project.snakemake("-n", *arguments, succeed=False)
        assert "Traceback" not in printed and ".smk" not in printed
        return printed.splitlines()[-1]

    (project / "mine.yaml").write_text(yaml.safe_dump(OWN), encoding="utf-8")
    assert refusal("reducer", "--configfile", "mine.yaml").startswith("reducer.teeth is missing")
    assert refusal("compare").startswith("compare needs several cases or projects")
    (project / "config.yaml").write_text("run: [1\n", encoding="utf-8")
    assert refusal().startswith("config.yaml is not YAML, line 2, column 1: ")
