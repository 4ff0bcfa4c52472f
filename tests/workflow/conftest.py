"""The small project: built once, copied for every test that changes it."""

import shutil

import pytest

from tests.workflow.project import Project, small_project


@pytest.fixture(scope="session")
def first_run(tmp_path_factory):
    """The untouched result of one bare `snakemake -j2`: project, printed output."""
    folder = tmp_path_factory.mktemp("workflow") / "built"
    project = small_project(folder)
    return project, project.snakemake("-j2")


@pytest.fixture
def project(first_run, tmp_path):
    """A copy of the project with all its results, to be changed by a test."""
    built, _ = first_run
    shutil.copytree(built.folder, tmp_path / "project")
    return Project(tmp_path / "project")
