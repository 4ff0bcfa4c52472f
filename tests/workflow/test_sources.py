"""Tests of `find_sources`, which lists the modules that a script imports."""

import pytest

from workflow.sources import find_sources

FILES = {
    "lib/__init__.py": "",
    "lib/core/__init__.py": "import lib.of_core",
    "lib/core/march.py": "",
    "lib/of_core.py": "if TYPE_CHECKING:\n    import lib.unused",
    "lib/pair.py": "def f():\n    from lib.core import march",
    "lib/loaded.py": "from .storage import read",
    "lib/storage.py": "import xarray",
    "lib/unused.py": "",
    "scripts/log.py": "",
    "scripts/run.py": "from log import redirect\nfrom lib.pair import f",
    "scripts/lazy.py": "from lib import GearPair",
}
#: Modules that scripts/run.py imports directly or indirectly, with their packages.
IMPORTED = ["lib/core/__init__.py", "lib/core/march.py", "lib/of_core.py", "lib/pair.py"]
SCRIPTS = ["scripts/log.py", "scripts/run.py"]


@pytest.fixture(autouse=True)
def _package(tmp_path, monkeypatch):
    """Write the files of FILES into a new working directory from which they can be imported."""
    for path, text in FILES.items():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)


def test_indirectly_imported_modules_are_sources():
    assert find_sources("scripts/run.py", package="lib") == IMPORTED + SCRIPTS


def test_modules_named_by_a_rule_are_sources():
    paths = find_sources("scripts/run.py", ["lib.loaded"], package="lib")
    assert paths == sorted([*IMPORTED, "lib/loaded.py", "lib/storage.py", *SCRIPTS])


def test_imports_of_lazy_names_are_refused():
    # The package loads such names on demand, so that their modules cannot be found.
    with pytest.raises(ImportError, match="scripts/lazy.py imports from lib itself"):
        find_sources("scripts/lazy.py", package="lib")
