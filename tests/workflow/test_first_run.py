"""What one bare `snakemake -j2` makes, and what its data and its report say of themselves.

The real Snakemake in a small configuration.
"""

import functools
import json
import re
from importlib import metadata

import pytest

from gearlib.data import storage
from tests.browser.chromium import browser, errors, wait_for
from tests.golden import data as golden
from tests.golden import redraw
from tests.workflow.jobs import EVERYTHING
from tests.workflow.project import job_counts

assert browser  # a fixture

pytestmark = pytest.mark.slow

# Of the CF checker, which takes the difference of names where a coordinate holds texts.
CHECKERS_OWN = "check_coordinate_variables_strict_monotonicity"


def test_one_command_builds_everything(first_run):
    project, output = first_run
    assert job_counts(output) == EVERYTHING
    for name in ("resonance.nc", "phase_planes.nc", "claims.csv", "claims.md"):
        assert (project / "results" / name).stat().st_size > 0
    for figure in ("fig3_resonance", "fig5_phase_planes"):
        assert (project / f"results/figures/{figure}.png").stat().st_size > 1000


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
    tables = {path.stem for path in results.glob("*.csv")}
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


@pytest.fixture(scope="module")
def kinds(first_run):
    """One file, by its path, for each kind: of equal title, variables and attributes."""
    project, _ = first_run
    found = {}
    for path in sorted((project / "results").rglob("*.nc")):
        data = storage.read(path)
        found.setdefault((data.attrs["title"], *data.variables, *data.attrs), path)
    return {str(path.relative_to(project / "results")): path for path in found.values()}


def test_every_dataset_keeps_to_cf(kinds, monkeypatch):
    runner = pytest.importorskip("compliance_checker.runner", reason="no CF checker installed")
    from compliance_checker.cf import util as cf_util

    suite = runner.CheckSuite()
    suite.load_all_available_checkers()
    # Of each dataset the checker asks this hundreds of times: two thirds of its time.
    for name in ("get_geophysical_variables", "get_auxiliary_coordinate_variables"):
        monkeypatch.setattr(cf_util, name, functools.cache(getattr(cf_util, name)))
    faults = []
    for name, path in kinds.items():
        # Closed: a file that is left open here and read again crashes the HDF5 library.
        with suite.load_dataset(str(path)) as data:
            results, errors = suite.run_all(data, ["cf:1.11"])["cf:1.11"]
        faults += [(name, *group.msgs) for group in results if group.value[0] < group.value[1]]
        faults += [(name, fault) for fault in errors if fault != CHECKERS_OWN]
    assert faults == []


def test_every_variable_is_described(kinds):
    for name, path in kinds.items():
        for key, one in storage.read(path).variables.items():
            assert one.attrs.get("long_name"), (name, key)
            assert "units" in one.attrs or one.dtype.kind not in "fi", (name, key)


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


def test_the_run_says_where_and_when_it_was_made(first_run):
    record = json.loads((first_run[0] / "results/provenance.json").read_bytes())
    assert set(record) == {
        *("finished", "commit", "changed_files", "versions", "machine", "jobs"),
    }
    assert record["versions"]["numpy"] == metadata.version("numpy")
    jobs = {job["job"]: job for job in record["jobs"]}
    assert {"compile_kernels", "gather_resonance", "draw_resonance"} <= jobs.keys()
    assert all(job["seconds"] >= 0.0 for job in jobs.values())
    assert record["machine"]["cores"] >= 1
