"""The data of a finished run: CF attributes, and what it says of its own making."""

import json
import re
from importlib import metadata

import pytest

from gearlib import storage

pytestmark = pytest.mark.slow

# Of the checker, which takes the difference of names where a coordinate holds texts.
CHECKERS_OWN = "check_coordinate_variables_strict_monotonicity"


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
