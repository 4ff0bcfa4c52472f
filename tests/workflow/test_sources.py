"""The automatic list of the sources of a script."""

import pytest

from workflow.sources import sources


def write(root, files):
    for path, text in files.items():
        (root / path).parent.mkdir(parents=True, exist_ok=True)
        (root / path).write_text(text, encoding="utf-8")


def test_imports_are_followed(tmp_path):
    write(
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
    paths = sources(tmp_path / "scripts/run.py", tmp_path)
    assert [str(path.relative_to(tmp_path)) for path in paths] == [
        "gearlib/core/__init__.py",
        "gearlib/core/march.py",
        "gearlib/pair.py",
        "gearlib/storage.py",
        "scripts/log.py",
        "scripts/run.py",
    ]


def test_modules_loaded_by_name_count_where_they_are_declared(tmp_path):
    by_name = "import importlib\n{}importlib.import_module('gearlib.one')"
    declared = by_name.format("if TYPE_CHECKING:\n    from gearlib import one\n")
    files = {"__init__": "", "one": "import gearlib.below", "two": "", "below": "", "by": declared}
    write(tmp_path, {f"gearlib/{name}.py": text for name, text in files.items()})
    write(tmp_path, {"run.py": "import gearlib.by"})
    paths = sources(tmp_path / "run.py", tmp_path, ["gearlib.two"])
    assert [path.stem for path in paths] == ["below", "by", "one", "two", "run"]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("import gearlib.none", "gearlib.none is no module"),
        ("from gearlib import GearPair", "full names"),
        ("import gearlib", "full names"),
        ("from . import pair", "full names"),
        ("__import__('gearlib.one')", "import under TYPE_CHECKING what is loaded by name"),
    ],
)
def test_imports_that_cannot_be_followed_are_refused(tmp_path, line, message):
    write(tmp_path, {"gearlib/__init__.py": "", "run.py": line})
    with pytest.raises(ImportError, match=message):
        sources(tmp_path / "run.py", tmp_path)
