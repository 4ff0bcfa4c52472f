"""What the jobs of the first run really loaded, against the sources that their rules declare."""

import sysconfig
from collections import Counter
from itertools import chain
from pathlib import Path

import pytest

from gearlib import processor
from gearlib.config.configuration import TARGETS
from tests.workflow.recorder import code_taken

pytestmark = pytest.mark.slow

# A table of lazy names, which `workflow.sources` refuses; checksums and lists change no result.
NO_SOURCES = {
    "gearlib/removed.py",
    "gearlib/__init__.py",
    "workflow/checksums.py",
    "workflow/sources.py",
}


@pytest.fixture(scope="module")
def jobs(records):
    return [record for record in records if record["rule"]]


def test_every_rule_with_a_script_was_run(first_run, jobs):
    lines = first_run[0].snakemake("--list-rules").splitlines()
    # Templates run nothing.
    rules = {line for line in lines if " " not in line and not line.startswith("_")}
    # The rules of names, and that for cases, run no script: a name's script has a rule of its own.
    names = {"all", "paper", "compare", *TARGETS}
    assert {f"compute_{name}" for name in names} & rules
    # Measured sets have a run of their own.
    measured = {name for name in rules if "measured" in name}
    assert {job["rule"] for job in jobs} == rules - names - measured
    assert len(rules) > 50


def test_what_a_job_loads_is_declared(first_run, jobs):
    folder = first_run[0].folder.resolve()
    # Each path is looked up once: most are those of packages, and the same in every job.
    paths = {path: Path(path).resolve() for path in {*chain(*(job["loaded"] for job in jobs))}}
    inside = {
        name: str(path.relative_to(folder))
        for name, path in paths.items()
        if path.is_relative_to(folder)
    }
    missing = set()
    for job in jobs:
        ours = {inside[path] for path in job["loaded"] if path in inside}
        assert "workflow/scripts/joblog.py" in ours
        ours = {path for path in ours if path.startswith(("gearlib/", "workflow/"))}
        ours = (ours | {f"workflow/scripts/{job['script']}"}) - NO_SOURCES
        missing |= {(job["rule"], path) for path in ours - set(job["declared"])}
    assert missing == set()


def test_what_draws_is_no_source_of_what_computes(jobs):
    drawing = "gearlib/figures/"
    for job in jobs:
        loaded = any(drawing in path for path in job["loaded"])
        assert loaded or not any(path.startswith(drawing) for path in job["declared"]), job["rule"]


def test_no_process_compiles_what_is_installed(records):
    # They ran under PYTHONDONTWRITEBYTECODE, which keeps nothing for the next one.
    installed = tuple(sysconfig.get_path(name) for name in ("purelib", "platlib"))
    compiled = {path for record in records for path in record["compiled"]}
    assert sorted(path for path in compiled if path.startswith(installed)) == []


def test_no_job_compiles_what_another_has_compiled(first_run, jobs):
    compiled = Counter(path for job in jobs for path in set(job["compiled"]))
    ours = {path: n for path, n in compiled.items() if path.startswith(str(first_run[0].folder))}
    # Two at once start without.
    assert ours and {path for path, times in ours.items() if times > 2} == set()


@pytest.mark.skipif(not processor.settings(), reason="this processor has no settings")
def test_every_job_ran_under_the_settings(jobs):
    assert code_taken.others(jobs) == []
    libraries = [library for job in jobs for library in job["processor"]]
    assert {"OpenBLAS", "numpy", "numba", "glibc"} <= {library.split()[0] for library in libraries}
    # Not only in jobs that load nothing.
    assert libraries.count("glibc") == len(jobs) and libraries.count("numba") > len(jobs) / 2
