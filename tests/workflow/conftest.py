"""The small project: built once, copied for every test that changes it."""

import fcntl
import os
import shutil

import pytest

from tests.workflow.project import Project, small_project


@pytest.fixture(scope="session")
def first_run(tmp_path_factory):
    """The untouched result of one bare `snakemake -j2`: project, printed output.

    Workers share it: the first one builds, the others wait.
    """
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent
    printed = folder / "workflow.txt"
    with open(folder / "workflow.lock", "w", encoding="utf-8") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not printed.exists():
            shutil.rmtree(folder / "workflow", ignore_errors=True)
            output = small_project(folder / "workflow").snakemake("-j2")
            printed.write_text(output, encoding="utf-8")
    return Project(folder / "workflow"), printed.read_text(encoding="utf-8")


@pytest.fixture
def project(first_run, tmp_path):
    """A copy of the project with all its results, to be changed by a test."""
    built, _ = first_run
    shutil.copytree(built.folder, tmp_path / "project")
    return Project(tmp_path / "project")
