"""Build the source archive and the wheel, and install the wheel as a user does with pip.

Both builds are isolated, and the wheel is installed with its dependencies in a new environment.
`make wheel` sets GEARLIB_DIST, the folder for archive and wheel.
"""

import os
import subprocess
import sys
import sysconfig
import tomllib
import venv
import zipfile
from pathlib import Path

import pytest

from gearlib.version import __version__
from tests.workflow.project import ROOT

pytestmark = [pytest.mark.slow, pytest.mark.release]


def run(*command, **options):
    """Run a command, assert that it succeeds, and return its output."""
    process = subprocess.run(
        [*map(str, command)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **options
    )
    assert process.returncode == 0, process.stdout
    return process.stdout


def install(python, *packages):
    """Install packages in pinned versions into the environment of a Python interpreter."""
    pip = [sys.executable, "-m", "pip", "--python", python, "install", "--quiet", "--no-compile"]
    run(*pip, "--constraint", ROOT / "requirements/constraints.txt", *packages)


def new_environment(folder):
    """Create a virtual environment without packages and return the path of its Python."""
    venv.create(folder, symlinks=True)
    return folder / "bin/python"


def build_wheel(source, folder):
    """Build a wheel from a project folder or source archive in isolation and return its path."""
    run(sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "-w", folder, source)
    (wheel,) = folder.glob("*.whl")
    return wheel


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    """Return the source archive, built with only the packages that pyproject.toml requires."""
    given_folder = os.environ.get("GEARLIB_DIST")
    folder = Path(given_folder).resolve() if given_folder else tmp_path_factory.mktemp("dist")
    python = new_environment(tmp_path_factory.mktemp("builder"))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    install(python, *project["build-system"]["requires"])
    run(python, "-m", "hatchling", "build", "-t", "sdist", "-d", folder, cwd=ROOT)
    (path,) = folder.glob("*.tar.gz")
    return path


@pytest.fixture(scope="module")
def wheel(archive):
    """Return the wheel built from the source archive."""
    return build_wheel(archive, archive.parent)


@pytest.fixture(scope="module")
def python(wheel, tmp_path_factory):
    """Return the Python of an environment with the wheel and its dependencies."""
    path = new_environment(tmp_path_factory.mktemp("environment"))
    install(path, wheel)
    return path


@pytest.fixture(scope="module")
def python_with_extras(python):
    """Return the same Python after adding the packages of the test environment to its path."""
    site_packages = sysconfig.get_path("purelib")
    (folder,) = python.parents[1].glob("lib/python*/site-packages")
    (folder / "extras.pth").write_text(site_packages, encoding="utf-8")
    return python


@pytest.fixture
def run_program(tmp_path):
    """Return a function that runs a program in an empty folder and returns its output."""
    # These variables of the test run would change which modules are imported and cached.
    unset_variables = ("PYTHONPATH", "NUMBA_CACHE_LOCATOR_CLASSES", "PYTHONDONTWRITEBYTECODE")
    environment = {name: text for name, text in os.environ.items() if name not in unset_variables}
    return lambda *arguments: run(*arguments, cwd=tmp_path, env=environment)


def test_the_wheel_runs_in_a_fresh_environment(run_program, python, tmp_path):
    """The command and the installed package must work without the project folder."""
    command = python.with_name("gearlib")
    assert __version__ in run_program(command, "--version") and "simulate" in run_program(
        command, "--help"
    )
    package_path = run_program(python, "-c", "import gearlib; print(gearlib.__file__)")
    assert Path(package_path).is_relative_to(python.parents[1])
    gears = ["--teeth", "23", "61", "--module", "2.5 mm", "--width", "18 mm"]
    assert "contact_ratio" in run_program(command, "gears", *gears, "--torque", "85 N m")


def test_the_workflow_runs_from_the_wheel(run_program, python_with_extras, tmp_path):
    """The command must find the installed workflow and write results to the working folder."""

    def gearlib(*arguments):
        """Run the command `gearlib` and return its output."""
        return run_program(python_with_extras.with_name("gearlib"), *arguments)

    gearlib("workflow", "-j1", "results/mesh_stiffness.nc")
    assert (tmp_path / "results/mesh_stiffness.nc").stat().st_size > 1000
    assert "Nothing to be done" in gearlib("workflow", "-j1", "results/mesh_stiffness.nc")
    # A configuration file in the working folder replaces the installed one; this one is invalid.
    (tmp_path / "config.yaml").write_text("gear_pair: {}\n", "utf-8")
    with pytest.raises(AssertionError, match="gear_pair"):
        gearlib("workflow", "-n", "paper")


def test_the_wheel_contains_types_rules_and_configuration(wheel):
    """Type checkers need `py.typed`, and the workflow needs each file that git tracks."""
    names = zipfile.ZipFile(wheel).namelist()
    assert "gearlib/py.typed" in names
    tracked_files = run(
        "git", "ls-files", "workflow", "Snakefile", "config.yaml", "profiles", cwd=ROOT
    )
    assert {f"gearlib/installed_workflow/{name}" for name in tracked_files.split()} <= {*names}


def test_the_source_archive_gives_the_same_wheel_as_the_project(wheel, tmp_path):
    """The source archive must be complete, so that both wheels contain the same bytes."""
    archive_wheel = zipfile.ZipFile(wheel)
    project_wheel = zipfile.ZipFile(build_wheel(ROOT, tmp_path))
    assert {*archive_wheel.namelist()} == {*project_wheel.namelist()}
    for name in archive_wheel.namelist():
        assert archive_wheel.read(name) == project_wheel.read(name), name
