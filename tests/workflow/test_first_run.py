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
from tests.workflow.project import rules_in_job_table

pytestmark = pytest.mark.slow

#: A check that fails because of a bug in the CF checker, which subtracts strings of a coordinate.
FAULTY_CF_CHECK = "check_coordinate_variables_strict_monotonicity"

#: Modules that jobs load but that cannot change results, because they only import names lazily.
MODULES_WITHOUT_RESULTS = {"gearlib/__init__.py"}


def test_one_command_runs_every_rule(first_run):
    """`snakemake -j2` must run each rule that computes or draws, so that all scripts are tested."""
    project, output = first_run
    lines = project.snakemake("--list-rules").splitlines()
    # The first line contains the profile, and names of templates start with an underscore.
    all_rules = {line for line in lines if " " not in line and not line.startswith("_")}
    executed_rules = rules_in_job_table(output)
    # Rules of targets run no script, and measured sets have a test of their own.
    target_rules = {"all", "paper", *TARGETS} - executed_rules
    measured_rules = {rule for rule in all_rules if "measured" in rule}
    assert executed_rules == all_rules - target_rules - measured_rules


def test_the_sources_of_a_job_include_every_module_it_loads(first_run, records):
    """Each loaded module must be a source, because only edits of sources cause a rerun."""
    project, _ = first_run
    folder, missing_sources = f"{project.folder}/", set()
    for job in records:
        paths = map(os.path.normpath, job["loaded"])
        loaded = {path.removeprefix(folder) for path in paths if path.startswith(folder)}
        assert "workflow/scripts/job.py" in loaded
        loaded = {path for path in loaded if path.startswith(("gearlib/", "workflow/"))}
        loaded |= {f"workflow/scripts/{job['script']}"}
        loaded -= MODULES_WITHOUT_RESULTS
        missing_sources |= {(job["rule"], path) for path in loaded - {*job["sources"]}}
    assert missing_sources == set()


def test_computations_do_not_depend_on_drawing_code(records):
    """A job that draws nothing must not have drawing code as a source, which would cause reruns."""
    drawing_folder = "gearlib/figures/"
    for job in records:
        draws = any(drawing_folder in path for path in job["loaded"])
        if not draws:
            assert not any(path.startswith(drawing_folder) for path in job["sources"]), job["rule"]


def test_every_job_runs_with_the_processor_settings_of_the_library(records):
    """All jobs need the same environment variables, so that they write the same bytes."""
    variables = processor.environment_variables()
    # Snakemake sets this variable to the number of threads of a job.
    variables.pop("OPENBLAS_NUM_THREADS", None)
    assert all(variables.items() <= job["environment"].items() for job in records)


def test_numbers_behind_the_figures_match_golden_data(first_run):
    """The workflow must write the golden datasets with equal numbers up to tolerances."""
    results = first_run[0] / "results"
    names = golden.dataset_names(results)
    golden_paths = golden.FOLDER.rglob("*.nc")
    golden_names = sorted(str(path.relative_to(golden.FOLDER)) for path in golden_paths)
    assert names == golden_names, "`make golden` renews the golden data"
    changes = [
        golden.describe_differences(
            name, golden.read(name), golden.read_compared_data(results / name)
        )
        for name in names
    ]
    assert not any(changes), "\n".join(sum(changes, []))


@pytest.fixture(scope="module")
def pictures(records, tmp_path_factory):
    """Return the folder of the figures that the current code draws from golden data."""
    return figures.draw(tmp_path_factory.mktemp("figures"), records)


@pytest.mark.parametrize("name", figures.stored_names())
def test_each_figure_matches_its_stored_picture(pictures, name):
    assert figures.describe_difference(name, pictures) is None


def test_every_figure_has_a_stored_picture(pictures):
    names = sorted(path.stem for path in pictures.glob("*.png"))
    assert names == figures.stored_names(), "`make golden` renews the stored pictures"


@pytest.fixture(scope="module")
def report(first_run, tmp_path_factory):
    """Return the path of the report on the first run, and its entries by path of the result."""
    path = tmp_path_factory.mktemp("report") / "report.html"
    first_run[0].snakemake("--report", str(path))
    (entries,) = re.findall(r"var results = (\{.*\});$", path.read_text(encoding="utf-8"), re.M)
    return path, json.loads(entries)


def test_the_report_contains_every_figure_and_table(first_run, report):
    """Each figure and table must have one entry with a caption and a unique label."""
    project, (_, entries) = first_run[0], report
    results = project / "results"
    pictures = {str(path.relative_to(results)) for path in results.rglob("figures/**/*.png")}
    tables = {path.stem for path in results.glob("*.csv")}
    expected = {f"results/{name}" for name in pictures}
    expected |= {f"results/tables/{name}.html" for name in tables}
    assert set(entries) == expected
    for path, entry in entries.items():
        # Without a caption file Snakemake would fail. A caption of one sentence has more than 80
        # characters.
        assert len(entry["caption"]) > 80, path
        assert list(entry["labels"]) == ["figure"], path
    labels = [entry["labels"]["figure"] for entry in entries.values()]
    assert len(set(labels)) == len(labels)


@pytest.fixture(scope="module")
def dataset_paths(first_run):
    """Return one dataset file for each combination of title, variables and attributes."""
    paths = {}
    for path in sorted((first_run[0] / "results").rglob("*.nc")):
        dataset = storage.read(path)
        paths.setdefault((dataset.attrs["title"], *dataset.variables, *dataset.attrs), path)
    return {str(path.relative_to(first_run[0] / "results")): path for path in paths.values()}


def test_every_dataset_follows_the_cf_conventions(dataset_paths, monkeypatch):
    """The checker of the CF conventions must find no fault in one dataset of each kind."""
    runner = pytest.importorskip("compliance_checker.runner", reason="no CF checker installed")
    from compliance_checker.cf import util as cf_util

    suite = runner.CheckSuite()
    suite.load_all_available_checkers()
    # The checker calls these functions hundreds of times per dataset; the cache saves time.
    for name in ("get_geophysical_variables", "get_auxiliary_coordinate_variables"):
        monkeypatch.setattr(cf_util, name, functools.cache(getattr(cf_util, name)))
    faults = []
    for name, path in dataset_paths.items():
        # The file must be closed, because opening it twice crashes the HDF5 library.
        with suite.load_dataset(str(path)) as dataset:
            checks, errors = suite.run_all(dataset, ["cf:1.11"])["cf:1.11"]
        for check in checks:
            score, full_score = check.value
            if score < full_score:
                faults.append((name, *check.msgs))
        faults += [(name, check_name) for check_name in errors if check_name != FAULTY_CF_CHECK]
    assert faults == []


def test_every_variable_has_a_description_and_units(dataset_paths):
    """Users of a dataset need a long name for each variable and units for each number."""
    for name, path in dataset_paths.items():
        for key, variable in storage.read(path).variables.items():
            assert variable.attrs.get("long_name"), (name, key)
            assert "units" in variable.attrs or variable.dtype.kind not in "fi", (name, key)


def test_every_dataset_states_how_it_was_made(dataset_paths):
    """Attributes must state program, history and source hash, and contain JSON in canonical form.

    JSON with sorted keys and without spaces makes files equal to the byte.
    """
    for name, path in dataset_paths.items():
        attributes = storage.read(path).attrs
        if "times" in name:
            continue
        assert attributes["source"].startswith("gearlib "), name
        assert attributes["history"].startswith(attributes["title"]), name
        assert re.fullmatch("[0-9a-f]{16}", attributes["source_hash"]), name
        for key in {"parameters", "gear_pair", "model"} & attributes.keys():
            text = json.dumps(json.loads(attributes[key]), sort_keys=True, separators=(",", ":"))
            assert attributes[key] == text, name


def test_the_source_hash_depends_on_the_sources_of_the_job(first_run):
    """Jobs of one study must store the same hash, and jobs with other sources another one."""
    project, _ = first_run

    def source_hash(path):
        """Return the source hash that a result file stores."""
        return storage.read(project / "results" / path).attrs["source_hash"]

    shard = next((project / "results/resonance/k1/cold").glob("*.nc"))
    assert source_hash("resonance.nc") == source_hash(shard)
    # The phase lag is computed by other modules than the resonance.
    assert source_hash("phase_lag.nc") != source_hash(shard)


def test_provenance_describes_the_run(first_run):
    """The file must state time, commit, versions, machine and jobs of the run."""
    record = json.loads((first_run[0] / "results/provenance.json").read_bytes())
    assert set(record) == {"finished", "commit", "changed_files", "versions", "machine", "jobs"}
    assert record["versions"]["numpy"] == metadata.version("numpy")
    jobs = {job["job"]: job for job in record["jobs"]}
    assert {"compile_kernels", "gather_resonance", "draw_resonance"} <= jobs.keys()
    assert all(job["seconds"] >= 0.0 for job in jobs.values())
    assert record["machine"]["cores"] >= 1
