"""One run of the small workflow by `snakemake -j2`: its jobs, sources, data and report."""

import functools
import json
import os
import re
from importlib import metadata

import pytest

from gearlib import processor
from gearlib.config.configuration import TARGETS
from gearlib.data import storage
from tests.golden import data as golden
from tests.golden import figures
from tests.workflow.project import rules_in

pytestmark = pytest.mark.slow

#: A check that fails by a bug of the CF checker, which subtracts texts of a coordinate.
FAULT_OF_CHECKER = "check_coordinate_variables_strict_monotonicity"

#: Modules that jobs load but that cannot change results: lazy names.
NO_SOURCES = {"gearlib/__init__.py"}


def test_one_command_runs_every_rule(first_run):
    project, output = first_run
    lines = project.snakemake("--list-rules").splitlines()
    # The first line names the profile, and names of templates begin with an underscore.
    rules = {line for line in lines if " " not in line and not line.startswith("_")}
    # Rules that only name targets run no script. Measured sets are tested separately.
    run = rules_in(output)
    named = {"all", "paper", *TARGETS} - run
    measured = {rule for rule in rules if "measured" in rule}
    assert run == rules - named - measured


def test_the_sources_of_a_job_include_every_module_it_loads(first_run, records):
    """A module that a job loads but does not list as a source would not cause a rerun."""
    folder = f"{first_run[0].folder}/"
    missing = set()
    for job in records:
        paths = map(os.path.normpath, job["loaded"])
        loaded = {path.removeprefix(folder) for path in paths if path.startswith(folder)}
        assert "workflow/scripts/job.py" in loaded
        loaded = {path for path in loaded if path.startswith(("gearlib/", "workflow/"))}
        loaded |= {f"workflow/scripts/{job['script']}"}
        missing |= {(job["rule"], path) for path in loaded - NO_SOURCES - {*job["sources"]}}
    assert missing == set()


def test_computations_do_not_depend_on_drawing_code(records):
    figures = "gearlib/figures/"
    for job in records:
        if not any(figures in path for path in job["loaded"]):
            assert not any(path.startswith(figures) for path in job["sources"]), job["rule"]


def test_every_job_starts_with_the_settings_of_the_processor(records):
    settings = processor.environment_variables()
    # Snakemake sets this variable to the threads of a job.
    settings.pop("OPENBLAS_NUM_THREADS", None)
    assert all(settings.items() <= job["environment"].items() for job in records)


def test_numbers_behind_the_figures_match_golden_data(first_run):
    results = first_run[0] / "results"
    names = golden.datasets(results)
    stored = sorted(str(path.relative_to(golden.FOLDER)) for path in golden.FOLDER.rglob("*.nc"))
    assert names == stored, "`make golden` renews them"
    changes = [
        golden.differences(name, golden.read(name), golden.compared_part(results / name))
        for name in names
    ]
    assert not any(changes), "\n".join(sum(changes, []))


@pytest.fixture(scope="module")
def pictures(records, tmp_path_factory):
    """Return the folder of the figures that the present code draws from golden data."""
    return figures.draw(tmp_path_factory.mktemp("figures"), records)


@pytest.mark.parametrize("name", figures.stored())
def test_each_figure_matches_its_stored_picture(pictures, name):
    assert figures.difference(name, pictures) is None


def test_every_figure_has_a_stored_picture(pictures):
    drawn = sorted(path.stem for path in pictures.glob("*.png"))
    assert drawn == figures.stored(), "`make golden` renews them"


@pytest.fixture(scope="module")
def report(first_run, tmp_path_factory):
    """Return the report of the untouched project as (file, entries by path)."""
    path = tmp_path_factory.mktemp("report") / "report.html"
    first_run[0].snakemake("--report", str(path))
    (entries,) = re.findall(r"var results = (\{.*\});$", path.read_text(encoding="utf-8"), re.M)
    return path, json.loads(entries)


def test_the_report_contains_every_figure_and_table(first_run, report):
    """Each figure and table must have one entry with a caption and a distinct label."""
    project, (_, entries) = first_run[0], report
    results = project / "results"
    pictures = {str(path.relative_to(results)) for path in results.rglob("figures/**/*.png")}
    tables = {path.stem for path in results.glob("*.csv")}
    expected = {f"results/{name}" for name in pictures}
    expected |= {f"results/tables/{name}.html" for name in tables}
    assert set(entries) == expected
    for path, entry in entries.items():
        # A missing caption file would stop the report; here the text must not be trivial.
        assert len(entry["caption"]) > 80, path
        assert list(entry["labels"]) == ["figure"], path
    labels = [entry["labels"]["figure"] for entry in entries.values()]
    assert len(set(labels)) == len(labels)


@pytest.fixture(scope="module")
def kinds(first_run):
    """Return one file for each kind of dataset, which has a title, variables and attributes."""
    paths = {}
    for path in sorted((first_run[0] / "results").rglob("*.nc")):
        dataset = storage.read(path)
        paths.setdefault((dataset.attrs["title"], *dataset.variables, *dataset.attrs), path)
    return {str(path.relative_to(first_run[0] / "results")): path for path in paths.values()}


def test_every_dataset_follows_the_cf_conventions(kinds, monkeypatch):
    """Check one dataset of each kind with the official checker of the CF conventions."""
    runner = pytest.importorskip("compliance_checker.runner", reason="no CF checker installed")
    from compliance_checker.cf import util as cf_util

    suite = runner.CheckSuite()
    suite.load_all_available_checkers()
    # The checker calls these functions hundreds of times for each dataset.
    for name in ("get_geophysical_variables", "get_auxiliary_coordinate_variables"):
        monkeypatch.setattr(cf_util, name, functools.cache(getattr(cf_util, name)))
    faults = []
    for name, path in kinds.items():
        # The file must be closed, because reading an open file again crashes the HDF5 library.
        with suite.load_dataset(str(path)) as data:
            results, errors = suite.run_all(data, ["cf:1.11"])["cf:1.11"]
        faults += [(name, *group.msgs) for group in results if group.value[0] < group.value[1]]
        faults += [(name, fault) for fault in errors if fault != FAULT_OF_CHECKER]
    assert faults == []


def test_every_variable_is_described(kinds):
    for name, path in kinds.items():
        for key, variable in storage.read(path).variables.items():
            assert variable.attrs.get("long_name"), (name, key)
            assert "units" in variable.attrs or variable.dtype.kind not in "fi", (name, key)


def test_every_dataset_states_how_it_was_made(kinds):
    """Check source, history and source hash, and that embedded JSON is in canonical form."""
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


def test_the_stored_source_hash_matches_the_job(first_run):
    project, _ = first_run

    def source_hash(path):
        return storage.read(project / "results" / path).attrs["source_hash"]

    shard = next((project / "results/resonance/k1/cold").glob("*.nc"))
    assert source_hash("resonance.nc") == source_hash(shard)
    # Jobs of the phase lag have other sources and so another hash.
    assert source_hash("phase_lag.nc") != source_hash(shard)


def test_provenance_states_where_and_when_the_run_was_made(first_run):
    record = json.loads((first_run[0] / "results/provenance.json").read_bytes())
    assert set(record) == {"finished", "commit", "changed_files", "versions", "machine", "jobs"}
    assert record["versions"]["numpy"] == metadata.version("numpy")
    jobs = {job["job"]: job for job in record["jobs"]}
    assert {"compile_kernels", "gather_resonance", "draw_resonance"} <= jobs.keys()
    assert all(job["seconds"] >= 0.0 for job in jobs.values())
    assert record["machine"]["cores"] >= 1
