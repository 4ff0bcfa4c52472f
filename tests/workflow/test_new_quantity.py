"""A new quantity in summaries, added to a copy of the project as CONTRIBUTING describes it."""

import os
import re
import shutil
import subprocess
import sys

import pytest

from tests.workflow.project import ROOT

pytestmark = pytest.mark.slow


def test_a_new_quantity_takes_the_steps_of_contributing(tmp_path):
    for name in ("gearlib", "tests"):
        shutil.copytree(ROOT / name, tmp_path / name)
    for name in ("pyproject.toml", "config.yaml"):
        shutil.copy2(ROOT / name, tmp_path)
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    row, rule, value = re.findall(r"^```text\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    orbit = "gearlib/engines/orbit.py"

    def insert(path, after, text):
        old = (tmp_path / path).read_text(encoding="utf-8")
        assert old.count(after) == 1
        (tmp_path / path).write_text(old.replace(after, after + text), encoding="utf-8")

    def exit_code():
        # Without compilation: runs that strike both flanks, by engines and steps.
        chosen = "(flanks or strikes or unequal) and (exact or taylor or rk4)"
        command = [sys.executable, "-m", "pytest", "tests/properties/test_summaries.py"]
        environment = os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(tmp_path)}
        return subprocess.run([*command, "-k", chosen], cwd=tmp_path, env=environment).returncode

    insert("gearlib/engines/summary_columns.py", "trains_only=True),\n", row)
    insert(orbit, "    FORCE_SUM,\n", "    IMPACTS,\n")
    insert(orbit, "        summary[BOUNCES] += 1.0\n", rule)
    assert exit_code() == 1
    insert("tests/properties/test_summaries.py", "(before == 1).sum() * math.tau / span,\n", value)
    assert exit_code() == 0
    insert(orbit, "summary[IMPACTS] += ", "2.0 * ")
    assert exit_code() == 1
