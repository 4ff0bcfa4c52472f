"""The automatic list of the sources of a script."""

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
#: What scripts/run.py imports, also indirectly, with the packages around it.
IMPORTED = ["lib/core/__init__.py", "lib/core/march.py", "lib/of_core.py", "lib/pair.py"]
SCRIPTS = ["scripts/log.py", "scripts/run.py"]


@pytest.fixture(autouse=True)
def _package(tmp_path, monkeypatch):
    """Write the package "lib" and its scripts into the working directory."""
    for path, text in FILES.items():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)


def test_imports_are_followed():
    assert find_sources("scripts/run.py", package="lib") == IMPORTED + SCRIPTS


def test_modules_named_by_a_rule_are_sources():
    paths = find_sources("scripts/run.py", ["lib.loaded"], package="lib")
    assert paths == sorted([*IMPORTED, "lib/loaded.py", "lib/storage.py", *SCRIPTS])


def test_lazy_names_are_refused():
    with pytest.raises(ImportError, match="scripts/lazy.py imports from lib itself"):
        find_sources("scripts/lazy.py", package="lib")
