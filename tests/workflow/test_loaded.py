"""What the jobs of the first run really loaded, against the sources that their rules declare."""

import re
import sysconfig
from collections import Counter
from pathlib import Path

import pytest

from tests.workflow.project import ROOT

pytestmark = pytest.mark.slow

# A table of lazy names, which `workflow.sources` refuses; checksums change no result.
NO_SOURCES = {"gearlib/__init__.py", "workflow/checksums.py"}


def scripts():
    """Return rule -> path of its script, of all rules that have one."""
    text = "".join(path.read_text("utf-8") for path in (ROOT / "workflow/rules").glob("*.smk"))
    rules = re.findall(r"^rule (\w+):\n((?:(?!rule ).*\n)*)", text, re.M)
    found = {name: re.search(r'script:\s+"\.\./(.+)"', body) for name, body in rules}
    return {name: f"workflow/{match[1]}" for name, match in found.items() if match}


@pytest.fixture(scope="module")
def jobs(records):
    return [record for record in records if record["rule"]]


def test_every_rule_with_a_script_was_run(jobs):
    assert {job["rule"] for job in jobs} == scripts().keys()
    assert len(scripts()) > 50


def test_what_a_job_loads_is_declared(first_run, jobs):
    folder, script = first_run[0].folder, scripts()
    missing = set()
    for job in jobs:
        ours = {Path(path).resolve() for path in job["loaded"]}
        ours = {str(path.relative_to(folder)) for path in ours if path.is_relative_to(folder)}
        assert "workflow/scripts/joblog.py" in ours
        ours = {path for path in ours if path.startswith(("gearlib/", "workflow/"))}
        ours = (ours | {script[job["rule"]]}) - NO_SOURCES
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
