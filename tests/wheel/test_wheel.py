"""The wheel and the source archive, in an environment where nothing else of the project is.

`make wheel` sets GEARLIB_DIST, the folder of both, and has their packages installed; else both are
built here, and the environment borrows the packages of the one that runs the tests.
"""

import os
import subprocess
import sys
import sysconfig
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest

from gearlib.version import __version__
from tests.workflow.project import ROOT

pytestmark = pytest.mark.slow


def run(*command, **options):
    """Run a command and return what it printed."""
    done = subprocess.run(
        [*map(str, command)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **options
    )
    assert done.returncode == 0, done.stdout
    return done.stdout


@pytest.fixture(scope="module")
def dist(tmp_path_factory):
    """The folder of the wheel and of the source archive."""
    if "GEARLIB_DIST" in os.environ:
        return Path(os.environ["GEARLIB_DIST"]).resolve()
    folder = tmp_path_factory.mktemp("dist")
    run(sys.executable, "-m", "hatchling", "build", "-d", folder, cwd=ROOT)
    return folder


@pytest.fixture(scope="module")
def installed(dist, tmp_path_factory):
    """The programs of an environment with the wheel."""
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder, symlinks=True)
    (wheel,) = dist.glob("*.whl")
    pip = [sys.executable, "-m", "pip", "--python", folder / "bin/python", "install", "--quiet"]
    if "GEARLIB_DIST" in os.environ:
        pinned = ["--constraint", ROOT / "requirements/constraints.txt"]
        run(*pip, *pinned, f"{wheel}[workflow,proof]")
    else:
        run(*pip, "--no-deps", "--no-index", wheel)
        # What lies in a folder that a .pth names is found; its own .pth, of this checkout, is not.
        own = sysconfig.get_path("purelib", vars={"base": folder, "platbase": folder})
        Path(own, "borrowed.pth").write_text(sysconfig.get_path("purelib") + "\n", "utf-8")
    return folder / "bin"


@pytest.fixture
def gearlib(installed, tmp_path):
    """Call the installed command in an empty folder; return what it printed."""
    ours = ("PYTHONPATH", "NUMBA_CACHE_LOCATOR_CLASSES")
    clean = {name: text for name, text in os.environ.items() if name not in ours}
    return lambda *words: run(installed / "gearlib", *words, cwd=tmp_path, env=clean)


def test_it_is_the_wheel_that_answers(gearlib, installed, tmp_path):
    assert __version__ in gearlib("--version")
    where = run(installed / "python", "-c", "import gearlib; print(gearlib.__file__)", cwd=tmp_path)
    assert Path(where).is_relative_to(installed.parent)
    drawing = ["--teeth", "23", "61", "--module", "2.5 mm", "--width", "18 mm"]
    assert "contact_ratio" in gearlib("gears", *drawing, "--torque", "85 N m")


def test_the_workflow_runs_from_the_wheel(gearlib, tmp_path):
    planned = gearlib("workflow", "-n", "paper")
    assert "draw_resonance" in planned and "compute_claims" in planned
    gearlib("workflow", "-j1", "results/mesh_stiffness.nc")
    assert (tmp_path / "results/mesh_stiffness.nc").stat().st_size > 1000
    assert "Nothing to be done" in gearlib("workflow", "-j1", "results/mesh_stiffness.nc")
    gearlib("workflow", "--report", "report.html", "results/mesh_stiffness.nc")
    assert (tmp_path / "report.html").stat().st_size > 1000
    # Of its own configuration, in place of the installed one.
    (tmp_path / "config.yaml").write_text("gear_pair: {}\n", "utf-8")
    with pytest.raises(AssertionError, match="gear_pair"):
        gearlib("workflow", "-n", "paper")


def test_the_wheel_holds_types_rules_and_configuration(dist):
    (wheel,) = dist.glob("*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    for name in ("py.typed", "config/config.schema.json"):
        assert f"gearlib/{name}" in names
    tracked = run("git", "ls-files", "workflow", "Snakefile", "config.yaml", "profiles", cwd=ROOT)
    assert {f"gearlib/installed_workflow/{name}" for name in tracked.split()} <= {*names}


def test_the_source_archive_makes_the_same_wheel(dist, tmp_path):
    (archive,), (wheel,) = dist.glob("*.tar.gz"), dist.glob("*.whl")
    with tarfile.open(archive) as file:
        file.extractall(tmp_path, filter="data")
    (folder,) = tmp_path.iterdir()
    run(sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", tmp_path, cwd=folder)
    (again,) = tmp_path.glob("*.whl")
    first, second = (zipfile.ZipFile(path) for path in (wheel, again))
    assert {*first.namelist()} == {*second.namelist()}
    for name in first.namelist():
        assert first.read(name) == second.read(name), name
