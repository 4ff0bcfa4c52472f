"""What the workflow runs and what it does not, and what its data say of themselves.

The real Snakemake in a small configuration.
"""

import json
import os
import re
import shutil
from importlib import metadata

import pytest
import yaml

from gearlib.data import storage
from tests.browser.chromium import browser, errors, wait_for
from tests.golden import data as golden
from tests.golden import pictures, redraw
from tests.workflow.jobs import (
    DAMPINGS,
    EVERYTHING,
    after_an_edit_of_simulate,
    after_another_k1,
    drawn,
    jobs,
)
from tests.workflow.project import ROOT, job_counts, small_project

assert browser  # a fixture

pytestmark = pytest.mark.slow

# What rests on the charts of work and precision.
MEASURED = ("work_precision", "jump_by_method", "steady_orbits")
# Of the CF checker, which takes the difference of names where a coordinate holds texts.
CHECKERS_OWN = "check_coordinate_variables_strict_monotonicity"


def edit(path, text):
    path.write_text(path.read_text(encoding="utf-8") + text, encoding="utf-8")


def test_one_command_builds_everything(first_run):
    project, output = first_run
    assert job_counts(output) == EVERYTHING
    for name in ("resonance.nc", "phase_planes.nc", "claims.csv", "claims.md"):
        assert (project / "results" / name).stat().st_size > 0
    for figure in ("fig3_resonance", "fig5_phase_planes"):
        for suffix in ("png", "pdf"):
            assert (project / f"results/figures/{figure}.{suffix}").stat().st_size > 1000


def test_numbers_behind_the_figures_are_the_golden_ones(first_run):
    results = first_run[0] / "results"
    found = golden.datasets(results)
    known = sorted(str(path.relative_to(golden.FOLDER)) for path in golden.FOLDER.rglob("*.nc"))
    sentences = [f"{name}: no golden data; `make golden` adds it" for name in found]
    sentences = [words for name, words in zip(found, sentences, strict=True) if name not in known]
    sentences += [f"{name}: gone; `make golden` removes it" for name in known if name not in found]
    for name in sorted(set(found) & set(known)):
        sentences += golden.differences(name, golden.read(name), golden.kept(results / name))
    assert not sentences, "\n".join(sentences)


def test_what_every_figure_holds_is_stored(first_run):
    # tests/golden/test_drawn.py compares it.
    made = sorted(path.stem for path in (first_run[0] / "results/figures").glob("*.png"))
    assert made == redraw.stored(), "`make golden` renews it"


def test_pictures_inform(first_run):
    # Other versions of matplotlib draw otherwise: a page to look at, and no verdict.
    pictures.compare(first_run[0] / "results", ROOT / "build/pictures")
    assert (ROOT / "build/pictures" / pictures.PAGE).is_file()


def test_the_second_run_does_nothing(project):
    assert project.jobs("-j2") == {}


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


def test_a_new_tuning_runs_its_points_and_what_draws_them(project):
    before = {path: (project / path).stat().st_mtime_ns for path in project.results()}
    project.configure(lambda settings: settings["phase_planes"]["tunings"].append(0.7))
    assert project.jobs("-j2") == jobs("phase_planes", "claims")
    for path, time in before.items():
        if path.startswith(("results/phase_planes/", "results/resonance/")):
            assert (project / path).stat().st_mtime_ns == time, path
    assert project.jobs("-j2") == {}


def test_a_changed_colour_only_redraws(project):
    before = project.results()
    project.configure(lambda settings: settings["figures"]["colours"].update(k1="#123456"))
    assert project.jobs("-j2") == drawn("resonance", "phase_planes", "report_page")
    after = project.results()
    changed = {path for path in before if before[path] != after[path]}
    assert {path.rsplit("/", 1)[0] for path in changed} == {"results/figures", "results/report"}


def test_a_new_format_only_redraws(project):
    project.configure(lambda settings: settings["figures"]["formats"].append("svg"))
    pictures = {rule: count for rule, count in drawn().items() if rule != "draw_report_page"}
    assert project.planned() == pictures


def test_a_raised_stop_leaves_the_computed_windows(project):
    project.configure(lambda settings: settings["resonance"].update(stop=2.3))
    assert project.planned() == {
        # One new cold window; up and down carry their state through the whole range.
        "sweep_window": DAMPINGS * (1 + 1 + 1),
        "gather_resonance": 1,
        "draw_resonance": 1,
        "draw_report_page": 1,
        "claims": 1,
    }


def test_a_damping_value_reruns_its_combination(project):
    project.configure(lambda settings: settings["dampings"]["k1"].update(material=4000))
    assert project.planned() == after_another_k1()


def test_a_scene_more_runs_that_scene(project):
    def add(settings):
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
    assert project.jobs("-j2") == {
        "compare_models": 1,
        "model_table": 1,
        "draw_models": 1,
        "scene": 1,
        "draw_scene": 1,
        "claims": 1,
    }
    assert (project / "results/figures/mine.png").stat().st_size > 1000


def test_a_changed_picture_of_a_scene_redraws_it(project):
    project.configure(lambda settings: settings["scenes"]["fig7_damping"].update(periods_shown=2))
    assert project.planned() == {"draw_scene": 1}


def test_a_method_more_runs_its_trial(project):
    trial = {"name": "mine", "method": "newmark", "options": {"contact": "frozen"}}
    project.configure(lambda settings: settings["failures"]["trials"].append(trial))
    assert project.planned() == {"trial": 1, "gather_failures": 1, "draw_failures": 1}


@pytest.mark.parametrize(
    ("path", "expected"),
    [
        ("gearlib/kernels/closed_form/event_by_event.py", EVERYTHING),
        ("gearlib/kernels/closed_form/sections.py", jobs("basins", "bifurcation", "poincare")),
        ("gearlib/runs/simulation.py", after_an_edit_of_simulate()),
        ("gearlib/methods/newmark.py", jobs("stability_chart")),
        ("gearlib/methods/rk4.py", {**jobs("stability_chart", "failures"), "trial": 1}),
        ("gearlib/studies/trials/difficult_problems.py", jobs("failures")),
        ("gearlib/figures/resonance.py", {"draw_resonance": 1, "draw_report_page": 1}),
        ("gearlib/figures/style.py", drawn()),
        ("gearlib/figures/time_courses.py", drawn("scenes")),
        ("gearlib/figures/poincare.py", drawn("poincare")),
        ("gearlib/figures/work_precision.py", drawn(*MEASURED)),
        (
            "gearlib/studies/trials/work_precision.py",
            {rule: n for rule, n in jobs(*MEASURED).items() if rule != "work_precision_references"},
        ),
        ("gearlib/studies/trials/high_precision.py", jobs("work_precision", "steady_orbits")),
        ("gearlib/studies/claims/scenes.py", jobs("claims")),
        ("workflow/scripts/draw_phase_planes.py", {"draw_phase_planes": 1}),
        ("gearlib/config/experiments.py", {}),
    ],
)
def test_an_edited_source_reruns_what_depends_on_it(project, path, expected):
    edit(project / path, "\n# one more line\n")
    assert project.planned() == expected


def test_only_what_is_wanted(project):
    project.configure(lambda settings: settings.update(targets=["phase_planes"]))
    (project / "results/figures/fig3_resonance.png").unlink()
    assert project.planned() == {}
    (project / "results/figures/fig5_phase_planes.png").unlink()
    assert project.planned() == {"draw_phase_planes": 1}


def test_fig_3_alone_computes_its_sweeps_only(tmp_path):
    project = small_project(tmp_path / "project")
    project.configure(lambda settings: settings.update(targets=["resonance"]))
    alone = {"compile_kernels": 1, **jobs("resonance")}
    assert project.planned() == alone
    beside = ["labels", "branches", "parametric_resonance"]
    project.configure(lambda settings: settings["targets"].extend(beside))
    shown = {"label": DAMPINGS, "branches": DAMPINGS, "tongues": 1}
    assert project.planned("results/figures/fig3_resonance.png") == alone | shown


def test_a_configuration_file_on_the_command_line(project):
    (project / "mine.yaml").write_text("phase_planes: {tunings: [0.9]}\n", encoding="utf-8")
    assert project.planned("--configfile", "mine.yaml")["phase_plane"] == DAMPINGS


def test_a_key_on_the_command_line(project):
    change = "phase_planes={tunings: [0.9]}"
    assert project.planned("--config", change)["phase_plane"] == DAMPINGS


def test_the_paper_alone(tmp_path):
    planned = small_project(tmp_path / "project").planned("paper")
    assert {"draw_phase_lag", "draw_resonance", "draw_scene", "draw_jump", "claims"} <= set(planned)
    assert not {"basins", "published", "work_precision_errors", "draw_branches"} & set(planned)


def test_cases_side_by_side(tmp_path):
    project = small_project(tmp_path / "project")
    cases = {"light": {"gear_pair": {"load": "1 kN"}}, "heavy": {"gear_pair": {"load": "6 kN"}}}
    project.configure(lambda settings: settings.update(targets=["phase_lag"], cases=cases))
    project.configure(lambda settings: settings["phase_lag"].pop("material_dampings"))
    parts = ("compile_kernels", "phase_lag", "draw_phase_lag")
    both = {f"{case}_{rule}": 1 for case in cases for rule in parts}
    assert project.jobs("-j2") == both
    light, heavy = (storage.read(project / f"results/{case}/phase_lag.nc") for case in cases)
    assert '"load":1000.0' in light.attrs["gear_pair"]
    assert '"load":6000.0' in heavy.attrs["gear_pair"]
    # Captions know what the configuration leaves out.
    project.snakemake("--report", "report.html")
    assert "3953.7, 39.537" in (project / "report.html").read_text(encoding="utf-8")
    project.configure(lambda settings: settings["cases"]["light"]["gear_pair"].update(load="2 kN"))
    assert project.planned() == {"light_phase_lag": 1, "light_draw_phase_lag": 1}
    assert (project / "results/light/provenance.json").exists()


def test_the_configuration_of_the_paper(tmp_path):
    project = small_project(tmp_path / "project")
    shutil.copy(ROOT / "config.yaml", project / "config.yaml")
    assert project.planned()["phase_plane"] == 6 * 4


def test_a_failed_job_shows_its_log_and_leaves_no_output(project):
    edit(
        project / "gearlib/studies/claims/scenes.py", "\nraise RuntimeError('claims are broken')\n"
    )
    output = project.snakemake("-j2", succeed=False)
    assert "claims are broken" in output
    assert not (project / "results/claims.csv").exists()


def test_lint_finds_nothing(project):
    assert "good condition" in project.snakemake("--lint")


@pytest.fixture(scope="module")
def report(first_run, tmp_path_factory):
    """The report of the untouched project: its file, and entry by path of what it holds."""
    path = tmp_path_factory.mktemp("report") / "report.html"
    first_run[0].snakemake("--report", str(path))
    (entries,) = re.findall(r"var results = (\{.*\});$", path.read_text(encoding="utf-8"), re.M)
    return path, json.loads(entries)


def test_the_report_holds_every_figure_and_table(first_run, report):
    project, (_, entries) = first_run[0], report
    results = project / "results"
    pictures = {path.stem for path in (results / "figures").iterdir()}
    tables = {path.stem for path in [*results.glob("*.csv"), *results.glob("*.txt")]}
    expected = {f"results/figures/{name}.png" for name in pictures}
    expected |= {f"results/tables/{name}.html" for name in tables}
    assert set(entries) == expected
    for path, entry in entries.items():
        # Without a file for its caption there would be no report.
        assert len(entry["caption"]) > 80, path
        assert list(entry["labels"]) == ["figure"], path
    labels = [entry["labels"]["figure"] for entry in entries.values()]
    assert len(set(labels)) == len(labels)


def test_the_report_in_a_browser(browser, report):
    path, entries = report
    browser.get(path.as_uri())
    parts = wait_for(lambda: browser.execute_script("return categories"))
    opened = []
    for part, groups in parts.items():
        browser.execute_script("app.setView({navbarMode: 'menu'})")
        item = f'//a[contains(., "{part}")]'
        wait_for(lambda item=item: browser.find_elements("xpath", item))[0].click()
        (paths,) = groups.values()
        # The first sign of an entry, the eye, shows it.
        eyes = wait_for(lambda: browser.find_elements("css selector", "#app td a:first-child"))
        assert len(eyes) == len(paths)
        for eye in eyes:
            eye.click()
            opened.append(wait_for(lambda: _shown(browser, opened)))
    assert sorted(opened) == sorted(entry["data_uri"] for entry in entries.values())
    assert errors(browser) == []
    fetched = browser.execute_script(
        "return performance.getEntriesByType('resource').map(entry => entry.name)"
    )
    assert [name for name in fetched if not name.startswith("data:")] == []


def _shown(driver, before):
    """Return the source of the picture or page on show, once it is a new one and decoded."""
    source = driver.execute_script(
        """
        const shown = document.querySelector("#app .p-3 > img, #app iframe");
        return shown && (shown.tagName === "IFRAME" || shown.naturalWidth > 0) && shown.src;
        """
    )
    return source and source not in before and source


def test_the_library_beside_the_snakefile_is_used(project):
    # Whatever else is installed: a job that gathers says where its library lies.
    edit(project / "gearlib/data/gathering.py", "\nprint(__file__)\n")
    assert str(project / "gearlib/data/gathering.py") in project.snakemake("-j2")


@pytest.fixture(scope="module")
def kinds(first_run):
    """One file, by its path, for each kind: of equal title, variables and attributes."""
    project, _ = first_run
    found = {}
    for path in sorted((project / "results").rglob("*.nc")):
        data = storage.read(path)
        found.setdefault((data.attrs["title"], *data.variables, *data.attrs), path)
    return {str(path.relative_to(project / "results")): path for path in found.values()}


def test_every_dataset_keeps_to_cf(kinds):
    runner = pytest.importorskip("compliance_checker.runner", reason="no CF checker installed")
    suite = runner.CheckSuite()
    suite.load_all_available_checkers()
    faults = []
    for name, path in kinds.items():
        results, errors = suite.run_all(suite.load_dataset(str(path)), ["cf:1.11"])["cf:1.11"]
        faults += [(name, *group.msgs) for group in results if group.value[0] < group.value[1]]
        faults += [(name, fault) for fault in errors if fault != CHECKERS_OWN]
    assert faults == []


def test_every_dataset_says_how_it_was_made(kinds):
    for name, path in kinds.items():
        attributes = storage.read(path).attrs
        if "times" in name:
            continue
        assert attributes["source"].startswith("gearlib "), name
        assert attributes["history"].startswith(attributes["title"]), name
        assert re.fullmatch("[0-9a-f]{16}", attributes["source_hash"]), name
        for key in {"parameters", "gear_pair", "model"} & attributes.keys():
            text = json.dumps(json.loads(attributes[key]), sort_keys=True, separators=(",", ":"))
            assert attributes[key] == text, name


def test_a_source_hash_is_that_of_what_computed_the_data(first_run):
    project, _ = first_run

    def source_hash(path):
        return storage.read(project / "results" / path).attrs["source_hash"]

    shard = next((project / "results/resonance/k1/cold").glob("*.nc"))
    assert source_hash("resonance.nc") == source_hash(shard)
    # They rest on other modules.
    assert source_hash("phase_lag.nc") != source_hash(shard)


def test_the_run_says_where_and_when_it_was_made(project):
    path = project / "results/provenance.json"
    before = path.read_bytes()
    record = json.loads(before)
    assert set(record) == {
        *("finished", "commit", "changed_files", "versions", "machine", "jobs"),
    }
    assert record["versions"]["numpy"] == metadata.version("numpy")
    jobs = {job["job"]: job for job in record["jobs"]}
    assert {"compile_kernels", "gather_resonance", "draw_resonance"} <= jobs.keys()
    assert all(job["seconds"] >= 0.0 for job in jobs.values())
    assert record["machine"]["cores"] >= 1
    project.snakemake("-j2")
    assert path.read_bytes() == before
