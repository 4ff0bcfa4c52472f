"""The recipes of CONTRIBUTING, each done in a copy of the project as the page says."""

import os
import re
import shutil
import subprocess
import sys

import pytest

from tests.workflow.project import ROOT

PAGE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
_BLOCK = re.compile(r'^```(\w+) title="([^"]+)"\n(.*?)^```', re.DOTALL | re.MULTILINE)


def follow(folder, heading):
    """Take the steps of a recipe: extend files, or change the lines of a diff."""
    recipe = re.search(rf"^### {heading}\n(.*?)^##", PAGE, re.DOTALL | re.MULTILINE)[1]
    for language, name, text in _BLOCK.findall(recipe):
        path = folder / name
        old = path.read_text(encoding="utf-8") if path.exists() else ""
        if language == "diff":
            lines = text.splitlines(keepends=True)
            before = "".join(line[1:] for line in lines if line[0] != "+")
            assert old.count(before) == 1, f"{name}: {before}"
            new = old.replace(before, "".join(line[1:] for line in lines if line[0] != "-"))
        else:
            new = f"{old}\n\n{text}" if old else text
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(new, encoding="utf-8")


@pytest.fixture
def copy(tmp_path):
    """Return a copy of the library and its tests."""
    ignored = shutil.ignore_patterns("__pycache__", "golden")
    for name in ("gearlib", "tests"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=ignored)
    for name in ("pyproject.toml", "config.yaml"):
        shutil.copy2(ROOT / name, tmp_path)
    return tmp_path


def python(folder, *arguments):
    """Run Python in a folder, with its library and without compilation; return the process."""
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(folder)}
    options = {"cwd": folder, "env": environment, "text": True, "capture_output": True}
    return subprocess.run([sys.executable, *arguments], check=False, **options)


PROFILE = """
from gearlib.config import load
from gearlib.models.from_values import model
from tests.paper import CONFIG
pair = model(load(CONFIG | {"profile": {"kind": "trapezoid", "ramp": 0.2}}).pair("k1"))
print(pair.stiffness_model, pair.force_note, pair.equation.is_piecewise_linear())
load(CONFIG | {"profile": {"kind": "trapezoid", "ramp": -0.2}})
"""


def test_a_stiffness_profile(copy):
    follow(copy, "A stiffness profile")
    process = python(copy, "-c", PROFILE)
    assert process.stdout == "trapezoid with ramps of 0.2 rad  False\n"
    assert "profile.ramp = -0.2 is not allowed: it must be a finite number > 0" in process.stderr


MODEL = """
import gearlib
stop = gearlib.Stop(stiffness=1.0)
twin = gearlib.DeadZoneOscillator(
    upper_stiffness=1.0, damping=0.1, load=1.0, forcing=gearlib.Harmonics((0.5,))
)
runs = [gearlib.simulate(model, 0.9, periods=5) for model in (stop, twin)]
print(*(float(run.displacement_max) for run in runs))
gearlib.Stop(stiffness=-1.0)
"""


def test_a_model(copy):
    follow(copy, "A model")
    process = python(copy, "-c", MODEL)
    first, second = process.stdout.split()
    assert first == second and "stiffness = -1.0 is not allowed" in process.stderr
