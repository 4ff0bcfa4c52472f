"""The source files a script depends on: they are inputs of its rule.

Snakemake sees neither edits of imported modules nor, with the triggers of this workflow, of the
script itself. Listed as inputs they count by their content: an edit reruns the jobs whose results
it can change and no others, a touched file reruns nothing.

Modules that are loaded by their names, with `import_module`, cannot be seen. Those that any run may
load are imported under `if TYPE_CHECKING`, where they are named; those that a job is told to load
are given by its rule.
"""

import ast
from functools import cache
from pathlib import Path

PACKAGE = "gearlib"


def sources(script, root, loaded=()):
    """Return a script and every module of the package that it imports, directly or not.

    ``gearlib/__init__.py`` does not count: it is a table of lazy names. Scripts and modules
    therefore import submodules, by their full names.

    Parameters
    ----------
    script : pathlib.Path
        A Python file; modules beside it (not in the package) are followed as well.
    root : pathlib.Path
        The folder that holds the package.
    loaded : iterable of str
        Full names of modules that the script loads because it is told to.

    Returns
    -------
    list of pathlib.Path
        Sorted.

    Raises
    ------
    ImportError
        If a file imports from the package what is no module of it, the lazy names; or loads modules
        by name and says not which.
    """
    script, root = Path(script), Path(root)
    found, waiting = set(), [script]
    for name in loaded:
        waiting += _module_files(name, script, root)
    while waiting:
        path = waiting.pop()
        if path not in found:
            found.add(path)
            waiting += _imported_files(path, root)
    return sorted(found)


# Most scripts share most modules, and every start of Snakemake lists the sources of all scripts.
@cache
def _imported_files(path, root):
    return list(_follow_imports(path, root))


def _follow_imports(path, root):
    text = path.read_text(encoding="utf-8")
    if ("import_module" in text or "__import__" in text) and "if TYPE_CHECKING:" not in text:
        raise ImportError(f"{path}: import under TYPE_CHECKING what is loaded by name")
    module = ast.parse(text, filename=str(path))
    for node in _statements(module):
        if isinstance(node, ast.Import):
            for alias in node.names:
                if alias.name == PACKAGE:
                    raise ImportError(f"{path}:{node.lineno}: import modules by full names")
                yield from _module_files(alias.name, path, root)
        elif isinstance(node, ast.ImportFrom):
            if node.level:
                raise ImportError(f"{path}:{node.lineno}: import {PACKAGE} modules by full names")
            yield from _module_files(node.module, path, root)
            for alias in node.names:
                name = f"{node.module}.{alias.name}"
                yield from _module_files(name, path, root, optional=node.module != PACKAGE)


def _statements(node):
    """Yield all statements below a node; expressions, which hold no imports, are not entered."""
    for field in ("body", "orelse", "handlers", "finalbody", "cases"):
        inner = getattr(node, field, ())
        # The body of a lambda or of a conditional expression is no list.
        for child in inner if isinstance(inner, list) else ():
            yield child
            yield from _statements(child)


def _module_files(name, importer, root, optional=False):
    """Yield the files that ``import name`` runs, of the package or beside the importer."""
    parts = name.split(".")
    if parts[0] != PACKAGE:
        beside = importer.parent / f"{name}.py"
        if beside.is_file():
            yield beside
        return
    for depth in range(2, len(parts) + 1):
        folder = root.joinpath(*parts[:depth])
        module, package = folder.with_suffix(".py"), folder / "__init__.py"
        if module.is_file():
            yield module
        elif package.is_file():
            yield package
        elif not optional:
            raise ImportError(f"{importer}: {name} is no module of {PACKAGE}; import by full names")
