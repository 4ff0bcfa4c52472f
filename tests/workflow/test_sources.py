"""The automatic list of the sources of a script."""

import json
import subprocess
import sys

import pytest

from tests.workflow.project import ROOT, small_project
from workflow.sources import sources

SCRIPTS = sorted(path.stem for path in (ROOT / "workflow/scripts").glob("*.py"))

# One process for all scripts, in which what is ours is loaded anew for every script, and parsed
# once: others' packages and parsing are most of the time that a start takes.
LOADED = """
import json, runpy, sys
from importlib.machinery import SourceFileLoader
parse, parsed = SourceFileLoader.source_to_code, {}
def once(loader, data, path, **options):
    if path not in parsed:
        parsed[path] = parse(loader, data, path, **options)
    return parsed[path]
SourceFileLoader.source_to_code = once
root, *scripts = sys.argv[1:]
sys.path[:0] = [root, root + "/workflow/scripts"]
loaded = {}
for script in scripts:
    runpy.run_path(f"{root}/workflow/scripts/{script}.py")
    files = {name: getattr(module, "__file__", None) for name, module in sys.modules.items()}
    ours = {name: file for name, file in files.items() if file and file.startswith(root + "/")}
    ours = {name: file for name, file in ours.items() if "/.venv/" not in file}
    # Checksums, lists, removed names and the cache of the tests change no result.
    unheard = ["workflow/checksums.py", "workflow/sources.py", "gearlib/removed.py"]
    unheard = [f"{root}/{name}" for name in (*unheard, "tests/shared_cache/shared_cache.py")]
    ours = {name: file for name, file in ours.items() if file not in unheard}
    loaded[script] = list(ours.values())
    for name in ours:
        del sys.modules[name]
print(json.dumps(loaded))
"""


@pytest.fixture(scope="module")
def loaded():
    """The files of this project that each script loads."""
    command = [sys.executable, "-c", LOADED, str(ROOT), *SCRIPTS]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return {name: set(files) for name, files in json.loads(done.stdout).items()}


@pytest.mark.parametrize("name", SCRIPTS)
def test_nothing_that_a_script_loads_is_missing(loaded, name):
    script = ROOT / f"workflow/scripts/{name}.py"
    listed = {str(path) for path in sources(script, ROOT)} | {str(ROOT / "gearlib/__init__.py")}
    assert loaded[name] or name in ("joblog", "one_thread")
    assert loaded[name] <= listed


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


def test_modules_loaded_by_name_count_where_they_are_declared(tmp_path):
    names = "import importlib\n{}importlib.import_module('gearlib.one')"
    declared = names.format("if TYPE_CHECKING:\n    from gearlib import one\n")
    files = {"__init__": "", "one": "import gearlib.below", "two": "", "below": "", "by": declared}
    make(tmp_path, {f"gearlib/{name}.py": text for name, text in files.items()})
    make(tmp_path, {"run.py": "import gearlib.by"})
    found = [path.stem for path in sources(tmp_path / "run.py", tmp_path)]
    assert found == ["below", "by", "one", "run"]
    told = [path.stem for path in sources(tmp_path / "run.py", tmp_path, ["gearlib.two"])]
    assert told == ["below", "by", "one", "two", "run"]
    make(tmp_path, {"gearlib/silent.py": names.format(""), "run2.py": "import gearlib.silent"})
    with pytest.raises(ImportError, match="import under TYPE_CHECKING what is loaded by name"):
        sources(tmp_path / "run2.py", tmp_path)


def test_what_is_no_module_is_refused(tmp_path):
    make(tmp_path, {"gearlib/__init__.py": "", "run.py": "import gearlib.none"})
    with pytest.raises(ImportError, match="gearlib.none is no module"):
        sources(tmp_path / "run.py", tmp_path)


LAZY = ["from gearlib import GearPair", "import gearlib"]


@pytest.mark.parametrize("line", [*LAZY, "from . import pair"])
def test_lazy_and_relative_imports_are_refused(tmp_path, line):
    make(tmp_path, {"gearlib/__init__.py": "", "run.py": line})
    with pytest.raises(ImportError, match="full names"):
        sources(tmp_path / "run.py", tmp_path)


@pytest.mark.slow
def test_lists_are_there_before_snakemake_looks(tmp_path):
    # It looks once what files a folder has: lists made for a wildcard came too late for it.
    project = small_project(tmp_path / "project")
    found = project.planned("draw_failures", "draw_work_precision")
    assert {"trial", "draw_work_precision"} <= found.keys()
