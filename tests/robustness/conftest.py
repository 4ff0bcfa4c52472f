"""The very small project: built once, copied for every test that does it harm."""

import shutil
import time
from dataclasses import dataclass

import pytest

from tests.robustness.disturbed import data, tiny_project
from tests.workflow.project import Project


@dataclass(frozen=True)
class Undisturbed:
    """A run that nobody disturbed: its project, its data, the seconds it took."""

    project: Project
    data: dict
    seconds: float


@pytest.fixture(scope="session")
def undisturbed(tmp_path_factory):
    """The run that all others have to equal."""
    project = tiny_project(tmp_path_factory.mktemp("robustness") / "built")
    began = time.monotonic()
    project.snakemake("-j2")
    return Undisturbed(project, data(project), time.monotonic() - began)


@pytest.fixture
def project(undisturbed, tmp_path):
    """A copy of the project with all its results."""
    shutil.copytree(undisturbed.project.folder, tmp_path / "project")
    return Project(tmp_path / "project")
