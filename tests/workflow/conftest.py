"""Fixtures with the small project, which runs once and is copied for tests that change it."""

import fcntl
import os
import pickle
import shutil

import pytest

from tests.workflow.project import Project, run_recorded


@pytest.fixture(scope="session")
def recorded(tmp_path_factory):
    """Return (project, output, job records) of the first run of the small project.

    If several workers need it, one of them runs the project while the others wait.
    """
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent
    pickled_run = folder / "recorded.pickle"
    with open(folder / "workflow.lock", "w", encoding="utf-8") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not pickled_run.exists():
            shutil.rmtree(folder / "workflow", ignore_errors=True)
            pickled_run.write_bytes(pickle.dumps(run_recorded(folder / "workflow")))
    return pickle.loads(pickled_run.read_bytes())


@pytest.fixture(scope="session")
def first_run(recorded):
    """Return the project, which tests must not change, and the output of its `snakemake -j2`."""
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
