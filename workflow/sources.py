"""Source files of a script: a list of them, with checksums, is an input of its rule.

Snakemake does not see edits of imported modules. Every start of it writes the lists whose sources
have changed, so that an edit reruns the jobs whose results it can change, and a touched file reruns
nothing.

Modules that are loaded by name, with `import_module`, are found if they are imported under
`if TYPE_CHECKING` too, or if the rule names them.
"""

import hashlib
import os
import re
from functools import cache
from pathlib import Path

PACKAGE = "gearlib"

#: Folder of the lists, beside what Snakemake records of its jobs.
LISTS = Path(".snakemake/sources")

# Every start of Snakemake lists the sources of all scripts, and a parser takes ten times as long.
# Text between quotes that looks like an import counts as one.
_IMPORT = re.compile(
    r"^[ \t]*(?:import[ \t]+([^\n#;]+)"
    r"|from[ \t]+([\w.]+)[ \t]+import[ \t]*(?:\(([^)]*)\)|([^\n#;]+)))",
    re.M,
)


def sources(script, root, loaded=()):
    """Return the files of a script and of all package modules that it imports, also indirectly.

    `root` is the folder of the package; `loaded` names modules that the script loads dynamically.
    ``gearlib/__init__.py`` does not count: it only has lazy names, so that scripts and modules
    import submodules by full names. ImportError for lazy names and undeclared dynamic imports.
    """
    script, root = os.fspath(script), os.fspath(root)
    files, pending = set(), [script]
    for name in loaded:
        pending += _module_files(name, os.path.dirname(script), root, script)
    while pending:
        path = pending.pop()
        if path not in files:
            files.add(path)
            pending += _imported_files(path, root)
    return sorted(map(Path, files))


def listed(script, files):
    """Write the list of a script's source `files` with checksums if it changed; return its path."""
    names = [_relative_path(os.fspath(file)) for file in files]
    digest = hashlib.sha256("\n".join(names).encode()).hexdigest()[:8]
    path = LISTS / f"{Path(script).stem}-{digest}.txt"
    text = "".join(f"{_checksum(name)}  {name}\n" for name in names)
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = path.with_name(f".{os.getpid()}.{path.name}")
        temporary.write_text(text, encoding="utf-8")
        # Snakemake compares dates if it does not know the job of a result.
        newest = max(map(_modified, names))
        os.utime(temporary, ns=(newest, newest))
        os.replace(temporary, path)
    return str(path)


def read(path):
    """Return the source files in the list at `path`, without their checksums."""
    lines = Path(path).read_text(encoding="utf-8").splitlines()
    return [line.split("  ", 1)[1] for line in lines]


@cache
def _relative_path(path):
    return os.path.relpath(path)


@cache
def _modified(path):
    return os.stat(path).st_mtime_ns


@cache
def _checksum(path):
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


@cache
def _imported_files(path, root):
    """Return the files that a Python file imports from the package or from its own folder."""
    return list(_follow_imports(path, root))


def _follow_imports(path, root):
    """Yield each file that a Python file imports from the package or from its own folder."""
    with open(path, encoding="utf-8") as file:
        text = file.read()
    if ("import_module" in text or "__import__" in text) and "if TYPE_CHECKING:" not in text:
        raise ImportError(f"{path}: import under TYPE_CHECKING what is loaded by name")
    folder = os.path.dirname(path)
    for modules, origin, in_brackets, without_brackets in _IMPORT.findall(text):
        for name in _names(modules):
            if name == PACKAGE:
                raise ImportError(f"{path}: import {name}: import modules by full names")
            yield from _module_files(name, folder, root, path)
        if not origin:
            continue
        if origin.startswith("."):
            raise ImportError(f"{path}: from {origin}: import {PACKAGE} modules by full names")
        yield from _module_files(origin, folder, root, path)
        for name in _names(re.sub("#.*", "", in_brackets) or without_brackets):
            name, optional = f"{origin}.{name}", origin != PACKAGE
            yield from _module_files(name, folder, root, path, optional)


def _names(text):
    """Return the imported names in the text of an import statement, without "as ..."."""
    return [name.split()[0] for name in text.split(",") if name.strip()]


def _module_files(name, folder, root, importer, optional=False):
    """Return the files that ``import name`` runs, from the package or the importer's `folder`.

    ImportError if the package has no such module, unless it is `optional`.
    """
    files = _files(name, root) if name.split(".")[0] == PACKAGE else _beside(name, folder)
    if None in files and not optional:
        raise ImportError(f"{importer}: {name} is no module of {PACKAGE}; import by full names")
    return [path for path in files if path]


@cache
def _beside(name, folder):
    """Return a list with the file of the module `name` in a folder, empty if there is none."""
    path = os.path.join(folder, f"{name}.py")
    return [path] if os.path.isfile(path) else []


@cache
def _files(name, root):
    """Return the file of each module in a dotted name, with None for a missing one."""
    parts = name.split(".")
    folders = [os.path.join(root, *parts[:depth]) for depth in range(2, len(parts) + 1)]
    candidates = [(f"{folder}.py", os.path.join(folder, "__init__.py")) for folder in folders]
    return [next(filter(os.path.isfile, pair), None) for pair in candidates]
