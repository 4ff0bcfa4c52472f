"""The source files a script depends on: a list of them, with checksums, is an input of its rule.

Snakemake sees neither edits of imported modules nor, with the triggers of this workflow, of the
script itself. Every start of it writes the lists whose sources have changed: so an edit reruns the
jobs whose results it can change and no others, a touched file reruns nothing. A list is one input
in place of some seventy, which Snakemake would look up, and print, for each job.

Modules that are loaded by their names, with `import_module`, cannot be seen. Those that any run may
load are imported under `if TYPE_CHECKING`, where they are named; those that a job is told to load
are given by its rule.
"""

import hashlib
import os
import re
from functools import cache
from pathlib import Path

PACKAGE = "gearlib"

#: Below the working folder, as all that Snakemake knows of its jobs.
LISTS = Path(".snakemake/sources")

# Every start of Snakemake lists the sources of all scripts: to parse them takes ten times as long.
# Text between quotes that looks like an import counts as one; `ruff` sees to one import a line.
_IMPORT = re.compile(
    r"^[ \t]*(?:import[ \t]+([^\n#;]+)"
    r"|from[ \t]+([\w.]+)[ \t]+import[ \t]*(?:\(([^)]*)\)|([^\n#;]+)))",
    re.M,
)


def sources(script, root, loaded=()):
    """Return a script and every module of the package that it imports, directly or not.

    ``gearlib/__init__.py`` does not count: it is a table of lazy names. Scripts and modules
    therefore import submodules, by their full names.

    Raises
    ------
    ImportError
        If a file imports from the package what is no module of it, the lazy names; or loads modules
        by name and says not which.
    """
    script, root = os.fspath(script), os.fspath(root)
    found, waiting = set(), [script]
    for name in loaded:
        waiting += _module_files(name, os.path.dirname(script), root, script)
    while waiting:
        path = waiting.pop()
        if path not in found:
            found.add(path)
            waiting += _imported_files(path, root)
    return sorted(map(Path, found))


def listed(script, files):
    """Write the list of the sources of a script where it is not there yet; return its path."""
    names = [*map(_below, map(os.fspath, files))]
    own = hashlib.sha256("\n".join(names).encode()).hexdigest()[:8]
    path = LISTS / f"{Path(script).stem}-{own}.txt"
    text = "".join(f"{_checksum(name)}  {name}\n" for name in names)
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = path.with_name(f".{os.getpid()}.{path.name}")
        temporary.write_text(text, encoding="utf-8")
        # As old as what it lists: results whose jobs Snakemake does not know are judged by dates.
        newest = max(map(_changed, names))
        os.utime(temporary, ns=(newest, newest))
        os.replace(temporary, path)
    return str(path)


def read(path):
    """Return the source files of a list."""
    lines = Path(path).read_text(encoding="utf-8").splitlines()
    return [line.split("  ", 1)[1] for line in lines]


# Each is in most lists.
@cache
def _below(path):
    return os.path.relpath(path)


@cache
def _changed(path):
    return os.stat(path).st_mtime_ns


@cache
def _checksum(path):
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


# Most scripts share most modules.
@cache
def _imported_files(path, root):
    return list(_follow_imports(path, root))


def _follow_imports(path, root):
    with open(path, encoding="utf-8") as file:
        text = file.read()
    if ("import_module" in text or "__import__" in text) and "if TYPE_CHECKING:" not in text:
        raise ImportError(f"{path}: import under TYPE_CHECKING what is loaded by name")
    folder = os.path.dirname(path)
    for modules, origin, inside, beside in _IMPORT.findall(text):
        for name in _names(modules):
            if name == PACKAGE:
                raise ImportError(f"{path}: import {name}: import modules by full names")
            yield from _module_files(name, folder, root, path)
        if not origin:
            continue
        if origin.startswith("."):
            raise ImportError(f"{path}: from {origin}: import {PACKAGE} modules by full names")
        yield from _module_files(origin, folder, root, path)
        for name in _names(re.sub("#.*", "", inside) or beside):
            name, optional = f"{origin}.{name}", origin != PACKAGE
            yield from _module_files(name, folder, root, path, optional)


def _names(text):
    """Return the names of an import, without what they are called."""
    return [part.split()[0] for part in text.split(",") if part.strip()]


def _module_files(name, folder, root, importer, optional=False):
    """Return the files that ``import name`` runs, of the package or in the importer's folder."""
    files = _files(name, root) if name.split(".")[0] == PACKAGE else _beside(name, folder)
    if None in files and not optional:
        raise ImportError(f"{importer}: {name} is no module of {PACKAGE}; import by full names")
    return [path for path in files if path]


@cache
def _beside(name, folder):
    path = os.path.join(folder, f"{name}.py")
    return [path] if os.path.isfile(path) else []


@cache
def _files(name, root):
    """Return a file for each part of a name below the package, None where there is no such one."""
    parts = name.split(".")
    folders = [os.path.join(root, *parts[:depth]) for depth in range(2, len(parts) + 1)]
    candidates = [(f"{folder}.py", os.path.join(folder, "__init__.py")) for folder in folders]
    return [next(filter(os.path.isfile, pair), None) for pair in candidates]
