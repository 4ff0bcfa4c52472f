"""The small project: built once, copied for each test that changes it."""

import fcntl
import json
import os
import shutil

import pytest

from tests.workflow.project import ROOT, Project, small_project


@pytest.fixture(scope="session")
def first_run(tmp_path_factory):
    """The untouched project after one `snakemake -j2`, and what that printed.

    Of several workers the first one builds it, and the others wait.
    """
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent
    printed = folder / "workflow.txt"
    with open(folder / "workflow.lock", "w", encoding="utf-8") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not printed.exists():
            for name in ("workflow", "records"):
                shutil.rmtree(folder / name, ignore_errors=True)
            (folder / "records").mkdir()
            paths = [str(ROOT / "tests/workflow/recorder"), os.environ.get("PYTHONPATH", "")]
            environment = {"PYTHONPATH": os.pathsep.join(filter(None, paths))}
            environment["GEARLIB_RECORDS"] = str(folder / "records")
            output = small_project(folder / "workflow").snakemake("-j2", **environment)
            printed.write_text(output, encoding="utf-8")
    return Project(folder / "workflow"), printed.read_text(encoding="utf-8")


@pytest.fixture(scope="session")
def records(first_run):
    """The records of the jobs of the first run, see `recorder/sitecustomize.py`."""
    paths = (first_run[0].folder.parent / "records").glob("*.json")
    return [json.loads(path.read_text(encoding="utf-8")) for path in paths]


@pytest.fixture
def project(first_run, tmp_path):
    """A copy of the project with all its results, for a test that changes it."""
    shutil.copytree(first_run[0].folder, tmp_path / "project")
    return Project(tmp_path / "project")
