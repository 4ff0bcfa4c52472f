"""The small project: built once, copied for every test that changes it."""

import fcntl
import json
import os
import shutil
import subprocess

import pytest

from tests.workflow.forked import LONGEST, SNAKEMAKE
from tests.workflow.project import ROOT, Project, small_project

RECORDER = ROOT / "tests/workflow/recorder"


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
            shutil.rmtree(folder / "records", ignore_errors=True)
            (folder / "records").mkdir()
            recorded = {
                "GEARLIB_RECORDS": str(folder / "records"),
                "PYTHONPATH": os.pathsep.join(
                    filter(None, [str(RECORDER), os.getenv("PYTHONPATH")])
                ),
                "PYTHONDONTWRITEBYTECODE": "1",
            }
            project = small_project(folder / "workflow")
            # A process of its own, as users start it: it is recorded too.
            done = subprocess.run(
                [SNAKEMAKE, "-j2"],
                cwd=project.folder,
                env=os.environ | recorded,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                timeout=LONGEST,
            )
            assert done.returncode == 0, done.stdout
            printed.write_text(done.stdout, encoding="utf-8")
    return Project(folder / "workflow"), printed.read_text(encoding="utf-8")


@pytest.fixture(scope="session")
def records(first_run):
    """What each process of the first run loaded and compiled, see `recorder/sitecustomize.py`."""
    found = (first_run[0].folder.parent / "records").glob("*.json")
    return [json.loads(path.read_text(encoding="utf-8")) for path in found]


@pytest.fixture
def project(first_run, tmp_path):
    """A copy of the project with all its results, to be changed by a test."""
    built, _ = first_run
    shutil.copytree(built.folder, tmp_path / "project")
    return Project(tmp_path / "project")
