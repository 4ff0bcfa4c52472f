"""The automatic list of the sources of a script."""

import json
import subprocess
import sys

import pytest

from tests.workflow.project import ROOT
from workflow.sources import sources

SCRIPTS = sorted(path.stem for path in (ROOT / "workflow/scripts").glob("*.py"))

LOADED = """
import json, runpy, sys
sys.path[:0] = [{root!r}, {root!r} + "/workflow/scripts"]
runpy.run_path({script!r})
files = [getattr(module, "__file__", None) for module in list(sys.modules.values())]
print(json.dumps([file for file in files if file and "/.venv/" not in file]))
"""


@pytest.mark.parametrize("name", SCRIPTS)
def test_nothing_that_a_script_loads_is_missing(name):
    script = ROOT / f"workflow/scripts/{name}.py"
    code = LOADED.format(root=str(ROOT), script=str(script))
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    listed = {str(path) for path in sources(script, ROOT)} | {str(ROOT / "gearlib/__init__.py")}
    loaded = {path for path in json.loads(done.stdout) if path.startswith(str(ROOT))}
    assert loaded <= listed


def make(root, files):
    for path, text in files.items():
        (root / path).parent.mkdir(parents=True, exist_ok=True)
        (root / path).write_text(text, encoding="utf-8")


def test_imports_are_followed(tmp_path):
    make(
        tmp_path,
        {
            "gearlib/__init__.py": "",
            "gearlib/core/__init__.py": "",
            "gearlib/core/march.py": "",
            "gearlib/pair.py": "def f():\n    import gearlib.core.march",
            "gearlib/storage.py": "import xarray",
            "gearlib/unused.py": "",
            "scripts/log.py": "",
            "scripts/run.py": "import log\nfrom gearlib import storage\nfrom gearlib.pair import f",
        },
    )
    found = sources(tmp_path / "scripts/run.py", tmp_path)
    assert [str(path.relative_to(tmp_path)) for path in found] == [
        "gearlib/core/__init__.py",
        "gearlib/core/march.py",
        "gearlib/pair.py",
        "gearlib/storage.py",
        "scripts/log.py",
        "scripts/run.py",
    ]


@pytest.mark.parametrize("line", ["from gearlib import GearPair", "from . import pair"])
def test_lazy_and_relative_imports_are_refused(tmp_path, line):
    make(tmp_path, {"gearlib/__init__.py": "", "run.py": line})
    with pytest.raises(ImportError, match="full names"):
        sources(tmp_path / "run.py", tmp_path)
