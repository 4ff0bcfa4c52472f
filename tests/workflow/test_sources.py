"""The automatic list of the sources of a script."""

import pytest

from workflow.sources import sources


def write(root, files):
    """Write a dict of path -> text as files below a folder."""
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


def test_modules_imported_by_name_are_sources_if_type_checking_or_the_rule_names_them(tmp_path):
    files = {
        "gearlib/__init__.py": "",
        "gearlib/loader.py": """import importlib
if TYPE_CHECKING:
    from gearlib import typed
importlib.import_module('gearlib.typed')""",
        "gearlib/typed.py": "import gearlib.imported",
        "gearlib/imported.py": "",
        "gearlib/of_rule.py": "",
        "run.py": "import gearlib.loader",
    }
    write(tmp_path, files)
    paths = sources(tmp_path / "run.py", tmp_path, loaded=["gearlib.of_rule"])
    assert [path.stem for path in paths] == ["imported", "loader", "of_rule", "typed", "run"]


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
