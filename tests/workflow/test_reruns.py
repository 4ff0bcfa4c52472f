"""What the workflow runs after a change, and what it does not.

The real Snakemake in a small configuration.
"""

import os
import shutil
from collections import Counter

import pytest
import yaml
from click.testing import CliRunner

from gearlib.cli import main
from gearlib.data import storage
from tests.unit.test_gear_names import OWN
from tests.workflow.jobs import (
    DAMPINGS,
    EVERYTHING,
    after_an_edit_of_simulate,
    after_another_k1,
    drawn,
    jobs,
)
from tests.workflow.project import ROOT, small_project

pytestmark = pytest.mark.slow


def after_an_edit(path, records):
    """Return rule -> number of the jobs that read a source, or what such jobs write."""
    waiting = [record for record in records if record["rule"]]
    changed, counts = {path}, Counter()
    while ready := [job for job in waiting if changed.intersection(job["read"])]:
        counts.update(job["rule"] for job in ready)
        changed.update(path for job in ready for path in job["written"])
        waiting = [job for job in waiting if job not in ready]
    return counts


def edit(path, text):
    path.write_text(path.read_text(encoding="utf-8") + text, encoding="utf-8")


def test_the_second_run_does_nothing(project):
    written = {path: path.read_bytes() for path in (project / "results").glob("provenance*")}
    assert project.jobs("-j2") == {}
    # Nor was anything made anew of which a date could be told.
    assert written and all(path.read_bytes() == text for path, text in written.items())


def test_a_touched_file_of_equal_content_reruns_nothing(project):
    for path in project.folder.rglob("*"):
        if ".snakemake" not in path.parts and "results" not in path.parts:
            os.utime(path)
    assert project.planned() == {}


def test_order_and_spelling_in_the_configuration_rerun_nothing(project):
    path = project / "config.yaml"
    settings = yaml.safe_load(path.read_text(encoding="utf-8"))
    settings["gear_pair"] = dict(reversed(settings["gear_pair"].items()))
    text = yaml.safe_dump(dict(reversed(settings.items())), sort_keys=False)
    assert "400000000.0" in text
    path.write_text(text.replace("400000000.0", "4e8"), encoding="utf-8")
    assert project.planned() == {}


def test_a_new_tuning_and_a_new_scene_run_what_is_theirs(project):
    before = {path: (project / path).stat().st_mtime_ns for path in project.results()}

    def add(settings):
        settings["phase_planes"]["tunings"].append(0.7)
        case = {"title": "mine", "damping": "k1", "tuning": 0.9, "change": {"contact_ratio": 1.3}}
        settings["scenes"]["mine"] = {
            "model": "six_degrees",
            "observables": ["bounces"],
            "tolerance": 0.1,
            "cases": [case],
            "courses": ["bearing_y2"],
            "periods_shown": 2,
        }

    project.configure(add)
    assert project.planned() == {
        **jobs("phase_planes", "certificates", "claims"),
        "compare_models": 1,
        "model_table": 1,
        "draw_models": 1,
        "scene": 1,
        "draw_scene": 1,
    }
    project.snakemake("-j2", "results/figures/mine.png", "results/figures/fig5_phase_planes.png")
    assert (project / "results/figures/mine.png").stat().st_size > 1000
    for path, time in before.items():
        if path.startswith(("results/phase_planes/", "results/resonance/", "results/scenes/")):
            assert (project / path).stat().st_mtime_ns == time, path


def test_a_changed_colour_only_redraws(project):
    before = project.results()
    project.configure(lambda settings: settings["figures"]["colours"].update(k1="#123456"))
    assert project.jobs("-j2") == drawn("resonance", "phase_planes")
    after = project.results()
    changed = {path for path in before if before[path] != after[path]}
    assert {path.rsplit("/", 1)[0] for path in changed} == {"results/figures"}


TRIAL = {"name": "mine", "method": "newmark", "options": {"contact": "frozen"}}
#: Change of the configuration -> what runs then.
CHANGES = {
    "a new format": (lambda c: c["figures"]["formats"].append("svg"), drawn()),
    "a raised stop leaves the computed windows": (
        lambda c: c["resonance"].update(stop=2.3),
        {
            # One new cold window; up and down carry their state through the whole range.
            "sweep_window": DAMPINGS * (1 + 1 + 1),
            "gather_resonance": 1,
            "draw_resonance": 1,
            "draw_run_ups": 1,
            "compute_claims": 1,
        },
    ),
    "a damping value": (
        lambda c: c["dampings"]["k1"].update(material_damping=4000),
        after_another_k1(),
    ),
    "a picture of a scene": (
        lambda c: c["scenes"]["fig7_damping"].update(periods_shown=2),
        {"draw_scene": 1},
    ),
    "a method more": (
        lambda c: c["failures"]["trials"].append(TRIAL),
        {"trial": 1, "gather_failures": 1, "draw_failures": 1},
    ),
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_change_of_the_configuration_reruns_what_is_its(project, name):
    change, expected = CHANGES[name]
    project.configure(change)
    assert project.planned() == expected


@pytest.mark.parametrize(
    ("path", "expected"),
    [
        ("gearlib/engines/pair/events.py", EVERYTHING),
        (
            "gearlib/analysis/global_dynamics/poincare.py",
            jobs("basins", "bifurcation", "poincare"),
        ),
        ("gearlib/runs/simulation.py", after_an_edit_of_simulate()),
        (
            "gearlib/integrators/fixed_steps.py",
            {
                **jobs("stability_chart", "failures"),
                "trial": 1,
            },
        ),
        ("gearlib/studies/trials/difficult_problems.py", jobs("failures")),
        ("gearlib/figures/resonance_figure.py", {"draw_resonance": 1}),
        ("gearlib/figures/style.py", drawn()),
        ("workflow/scripts/draw.py", drawn()),
        ("gearlib/figures/time_courses_figure.py", drawn("scenes")),
        (
            "gearlib/figures/global_picture_figure.py",
            drawn("basins", "bifurcation", "poincare"),
        ),
        ("gearlib/figures/work_precision_figure.py", drawn("work_precision")),
        (
            "gearlib/studies/trials/work_precision.py",
            {
                rule: n
                for rule, n in jobs("work_precision").items()
                if rule != "work_precision_references"
            },
        ),
        ("gearlib/studies/trials/high_precision.py", jobs("work_precision")),
        ("gearlib/studies/claims/scene_claims.py", jobs("claims")),
        ("gearlib/figures/phase_planes_figure.py", drawn("phase_planes", "scenes")),
        ("gearlib/config/experiments.py", {}),
    ],
)
def test_an_edited_source_reruns_what_depends_on_it(records, path, expected):
    assert after_an_edit(path, records) == expected


@pytest.mark.parametrize(
    "path", ["gearlib/engines/pair/events.py", "gearlib/integrators/fixed_steps.py"]
)
def test_snakemake_finds_the_same(project, records, path):
    edit(project / path, "\n# one more line\n")
    assert project.planned() == after_an_edit(path, records)


def test_only_what_is_wanted(project):
    project.configure(lambda settings: settings.update(targets=["phase_planes"]))
    for name in ("fig3_resonance", "fig5_phase_planes"):
        (project / f"results/figures/{name}.png").unlink()
    assert project.planned() == {"draw_phase_planes": 1}


def test_fig_3_alone_computes_its_sweeps_only(tmp_path):
    project = small_project(tmp_path / "project")
    project.configure(lambda settings: settings.update(targets=["resonance"]))
    alone = {"compile_kernels": 1, **jobs("resonance")}
    assert project.planned() == alone
    beside = ["labels", "branches", "parametric_resonance"]
    project.configure(lambda settings: settings["targets"].extend(beside))
    shown = {"label": DAMPINGS, "compute_branches": DAMPINGS, "tongues": 1}
    assert project.planned("results/figures/fig3_resonance.png") == alone | shown


def test_a_file_and_a_key_on_the_command_line(project):
    (project / "mine.yaml").write_text("phase_planes: {tunings: [0.9]}\n", encoding="utf-8")
    key = "phase_lag={periods: 110}"
    planned = project.planned("--configfile", "mine.yaml", "--config", key)
    assert (planned["phase_plane"], planned["compute_phase_lag"]) == (DAMPINGS, 1)


def test_the_paper_alone(tmp_path):
    planned = small_project(tmp_path / "project").planned("paper")
    assert {"draw_phase_lag", "draw_resonance", "draw_scene", "draw_jump", "compute_claims"} <= set(
        planned
    )
    assert not {"compute_basins", "work_precision_errors", "draw_branches"} & set(planned)


def test_cases_side_by_side(tmp_path):
    project = small_project(tmp_path / "project")
    cases = {"light": {"gear_pair": {"load": "1 kN"}}, "heavy": {"gear_pair": {"load": "6 kN"}}}
    project.configure(lambda settings: settings.update(targets=["phase_lag"], cases=cases))
    project.configure(lambda settings: settings["phase_lag"].pop("material_dampings"))
    parts = ("compile_kernels", "compute_phase_lag", "draw_phase_lag")
    both = {f"{case}_{rule}": 1 for case in cases for rule in parts}
    assert project.jobs("-j2") == both
    light, heavy = (storage.read(project / f"results/{case}/phase_lag.nc") for case in cases)
    assert '"load":1000.0' in light.attrs["gear_pair"]
    assert '"load":6000.0' in heavy.attrs["gear_pair"]
    # Captions know what the configuration leaves out.
    project.snakemake("--report", "report.html")
    assert "3953.7, 39.537" in (project / "report.html").read_text(encoding="utf-8")
    project.configure(lambda settings: settings["cases"]["light"]["gear_pair"].update(load="2 kN"))
    assert project.planned() == {"light_compute_phase_lag": 1, "light_draw_phase_lag": 1}
    assert (project / "results/light/provenance.json").exists()


def test_the_configuration_of_the_paper(tmp_path):
    project = small_project(tmp_path / "project")
    shutil.copy(ROOT / "config.yaml", project / "config.yaml")
    assert project.planned()["phase_plane"] == 6 * 4


def test_a_failed_job_shows_its_log_and_leaves_no_output(project):
    edit(
        project / "gearlib/studies/claims/scene_claims.py",
        "\nraise RuntimeError('claims are broken')\n",
    )
    output = project.snakemake("-j2", "results/claims.csv", succeed=False)
    assert "claims are broken" in output
    assert not (project / "results/claims.csv").exists()


def test_lint_finds_nothing(project):
    assert "good condition" in project.snakemake("--lint")


def test_the_library_beside_the_snakefile_is_used(project):
    # Whatever else is installed: a job that gathers says where its library lies.
    edit(project / "gearlib/data/gathering.py", "\nprint(__file__)\n")
    project.snakemake("-j2", "results/phase_planes.nc")
    printed = (project / "results/logs/gather_phase_planes.log").read_text(encoding="utf-8")
    assert str(project / "gearlib/data/gathering.py") in printed


def test_other_gears_have_a_folder_of_their_own(tmp_path):
    project = small_project(tmp_path / "project")
    own = {"gear_pair": {"max_stiffness": 3e8}, "targets": ["phase_lag"]}
    mine = project / "mine.yaml"
    mine.write_text(yaml.safe_dump(own), encoding="utf-8")
    arguments = ("--configfile", "mine.yaml")
    # Every name of `targets` is a target.
    project.snakemake("-j2", "phase_lag", *arguments)
    assert (project / "results/mine/figures/phase_shift.png").exists()
    assert [path.name for path in (project / "results").iterdir()] == ["mine"]
    assert project.planned(*arguments) == {}
    # Another load is no other machine, another stiffness is.
    mine.write_text(yaml.safe_dump(own | {"gear_pair": {"max_stiffness": 3e8, "load": 1e3}}))
    assert project.planned(*arguments) == {"compute_phase_lag": 1, "draw_phase_lag": 1}
    mine.write_text(yaml.safe_dump(own | {"gear_pair": {"max_stiffness": 2e8}}))
    printed = project.snakemake("-j2", *arguments, succeed=False)
    assert "results/mine/ holds what was computed for the gear pair C_max 3e+08 N/m" in printed
    mine.write_text(yaml.safe_dump(own | {"project": "softer"}))
    assert "results/softer/phase_lag.nc" in project.snakemake("-n", *arguments)
    mine.write_text(yaml.safe_dump(own | {"project": "figures"}))
    assert "project = 'figures' is not allowed" in project.snakemake(
        "-n", *arguments, succeed=False
    )


def test_a_name_that_is_no_target(project):
    printed = project.snakemake("-n", "resonances", succeed=False)
    assert "No rule to produce resonances" in printed


def test_a_refusal_is_a_sentence_and_no_line_of_python(project):
    def refused(*arguments):
        printed = project.snakemake("-n", *arguments, succeed=False)
        assert "Traceback" not in printed and ".smk" not in printed
        return printed.splitlines()[-1]

    (project / "mine.yaml").write_text(yaml.safe_dump(OWN), encoding="utf-8")
    missing = refused("reducer", "--configfile", "mine.yaml")
    assert missing.startswith("reducer.teeth is missing: it must be"), missing
    assert refused("compare").startswith("compare needs several cases or projects")
    named = refused("--config", "targets=[compare]")
    assert named.startswith("targets[0] = 'compare' is not allowed") and "-j2 compare" in named
    (project / "config.yaml").write_text("run: [1\n", encoding="utf-8")
    assert refused().startswith("config.yaml is not YAML, line 2, column 1: ")
    other = CliRunner().invoke(main, ["workflow", "--configfile", str(project / "config.yaml")])
    assert other.exit_code == 2 and "is not YAML, line 2" in other.output
