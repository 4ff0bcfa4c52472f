"""The source archive and the wheel from it, built and installed as pip does it for a user.

Both builds are isolated, and the wheel lies in an environment of its own with the packages that it
asks for. `make wheel` sets GEARLIB_DIST, the folder for archive and wheel.
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

pytestmark = pytest.mark.slow


def run(*command, **options):
    """Run a command, assert that it succeeds, and return its output."""
    process = subprocess.run(
        [*map(str, command)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **options
    )
    assert process.returncode == 0, process.stdout
    return process.stdout


def install(python, *packages):
    """Install packages into the environment of a Python, in the versions that are pinned."""
    pip = [sys.executable, "-m", "pip", "--python", python, "install", "--quiet", "--no-compile"]
    run(*pip, "--constraint", ROOT / "requirements/constraints.txt", *packages)


def new_environment(folder):
    """Create an environment without packages and return the path of its Python."""
    venv.create(folder, symlinks=True)
    return folder / "bin/python"


def build_wheel(source, folder):
    """Build the wheel of a folder or source archive in isolation and return its path."""
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
    """Return the same Python, which also finds the packages of the test environment."""
    site_packages = sysconfig.get_path("purelib")
    (folder,) = python.parents[1].glob("lib/python*/site-packages")
    (folder / "extras.pth").write_text(site_packages, encoding="utf-8")
    return python


@pytest.fixture
def call(tmp_path):
    """Return a function that runs a program in an empty folder and returns its output."""
    # Without these variables modules are compiled once, where they are imported.
    unset = ("PYTHONPATH", "NUMBA_CACHE_LOCATOR_CLASSES", "PYTHONDONTWRITEBYTECODE")
    environment = {name: text for name, text in os.environ.items() if name not in unset}
    return lambda *words: run(*words, cwd=tmp_path, env=environment)


def test_the_wheel_runs_in_a_fresh_environment(call, python, tmp_path):
    command = python.with_name("gearlib")
    assert __version__ in call(command, "--version") and "simulate" in call(command, "--help")
    where = call(python, "-c", "import gearlib; print(gearlib.__file__)")
    assert Path(where).is_relative_to(python.parents[1])
    gears = ["--teeth", "23", "61", "--module", "2.5 mm", "--width", "18 mm"]
    assert "contact_ratio" in call(command, "gears", *gears, "--torque", "85 N m")


def test_the_workflow_runs_from_the_wheel(call, python_with_extras, tmp_path):
    def gearlib(*words):
        return call(python_with_extras.with_name("gearlib"), *words)

    gearlib("workflow", "-j1", "results/mesh_stiffness.nc")
    assert (tmp_path / "results/mesh_stiffness.nc").stat().st_size > 1000
    assert "Nothing to be done" in gearlib("workflow", "-j1", "results/mesh_stiffness.nc")
    # A configuration in the folder replaces the installed one.
    (tmp_path / "config.yaml").write_text("gear_pair: {}\n", "utf-8")
    with pytest.raises(AssertionError, match="gear_pair"):
        gearlib("workflow", "-n", "paper")


def test_the_wheel_holds_types_rules_and_configuration(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    assert "gearlib/py.typed" in names
    tracked = run("git", "ls-files", "workflow", "Snakefile", "config.yaml", "profiles", cwd=ROOT)
    assert {f"gearlib/installed_workflow/{name}" for name in tracked.split()} <= {*names}


def test_the_source_archive_makes_the_same_wheel_as_the_project(wheel, tmp_path):
    first, second = (zipfile.ZipFile(path) for path in (wheel, build_wheel(ROOT, tmp_path)))
    assert {*first.namelist()} == {*second.namelist()}
    for name in first.namelist():
        assert first.read(name) == second.read(name), name
