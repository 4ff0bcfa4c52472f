"""The small project: built once, copied for each test that changes it."""

import fcntl
import os
import pickle
import shutil

import pytest

from tests.workflow.project import Project, recorded_run


@pytest.fixture(scope="session")
def recorded(tmp_path_factory):
    """Return (project, output, records of jobs) of the first run of the small project.

    One of several workers builds it while the others wait.
    """
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent
    done = folder / "recorded.pickle"
    with open(folder / "workflow.lock", "w", encoding="utf-8") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not done.exists():
            shutil.rmtree(folder / "workflow", ignore_errors=True)
            done.write_bytes(pickle.dumps(recorded_run(folder / "workflow")))
    return pickle.loads(done.read_bytes())


@pytest.fixture(scope="session")
def first_run(recorded):
    """Return (untouched project, output) after one run of `snakemake -j2`."""
    return recorded[:2]


@pytest.fixture(scope="session")
def records(recorded):
    """Return the records of the jobs of the first run, see `recorder/sitecustomize.py`."""
    return recorded[2]


@pytest.fixture
def project(first_run, tmp_path):
    """Return a copy of the project with all its results, for a test that changes it."""
    shutil.copytree(first_run[0].folder, tmp_path / "project")
    return Project(tmp_path / "project")
