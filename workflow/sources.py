"""Source files of a script: a list of them, with checksums, is an input of its rule.

Snakemake does not see edits of imported modules. Every start of it writes the lists whose sources
have changed, so that an edit reruns the jobs whose results it can change, and a touched file reruns
nothing. Modules that are loaded by name, with `import_module`, are named by the rule.
"""

import ast
import hashlib
import os
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import grimp

#: Folder of the lists, beside what Snakemake records of its jobs.
LISTS = Path(".snakemake/sources")


def sources(script, loaded=(), package="gearlib"):
    """Return the sorted files of a script and of all modules that it imports, also indirectly.

    These are modules of the package and scripts in the same folder; `loaded` names modules that the
    script loads by name. The ``__init__.py`` of the package only has lazy names and does not count:
    ImportError if it is imported for them.
    """
    graph, scripts, pending = _imports_of(package), [Path(script)], [*loaded]
    for path in scripts:
        for name in _imported_names(path):
            first = name.split(".")[0]
            other_script = path.with_name(f"{first}.py")
            if first == package:
                pending.append(name if name in graph.modules else name.rpartition(".")[0])
            elif other_script.is_file() and other_script not in scripts:
                scripts.append(other_script)
    modules = set()
    while pending:
        module = pending.pop()
        if module == package:
            raise ImportError(f"{script} imports from {package} itself: import its modules")
        if module not in modules:
            modules.add(module)
            pending += graph.find_modules_directly_imported_by(module)
            # Importing a module also runs the packages it lies in.
            pending += [parent for parent in [module.rpartition(".")[0]] if parent != package]
    return sorted([*scripts, *map(_file_of, modules)])


def listed(script, files):
    """Write the list of a script's source `files` with checksums if it changed; return its path."""
    names = [os.path.relpath(file) for file in files]
    digest = hashlib.sha256("\n".join(names).encode()).hexdigest()[:8]
    path = LISTS / f"{Path(script).stem}-{digest}.txt"
    text = "".join(f"{_checksum(name)}  {name}\n" for name in names)
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = path.with_name(f".{os.getpid()}.{path.name}")
        temporary.write_text(text, encoding="utf-8")
        os.replace(temporary, path)
    return str(path)


@cache
def _imports_of(package):
    """Return the graph of imports of a package, without those for type checkers only."""
    return grimp.build_graph(package, cache_dir=None, exclude_type_checking_imports=True)


@cache
def _imported_names(path):
    """Return the names that a script imports, such as "os" or "job.datasets"."""
    names = []
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names += [f"{node.module}.{alias.name}" for alias in node.names]
    return names


@cache
def _file_of(module):
    """Return the file of a module of a package."""
    package, *parts = module.split(".")
    path = Path(find_spec(package).origin).parent.joinpath(*parts)
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


@cache
def _checksum(path):
    """Return the SHA-256 of a file as text."""
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()
