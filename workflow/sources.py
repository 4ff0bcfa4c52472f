"""List the source files of a script, with checksums, as an input of its rule.

Snakemake does not detect edits of imported modules. Whenever it starts, the lists whose source
files have changed are written. An edit therefore reruns the jobs whose results it can affect, but a
new time stamp alone reruns nothing. Rules state the modules that their scripts load by name with
`import_module`.
"""

import ast
import hashlib
import os
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import grimp

#: Folder of the lists, beside the records of Snakemake.
LISTS = Path(".snakemake/sources")


def find_sources(script, loaded=(), package="gearlib"):
    """Return the sorted paths of a script and of all modules that it imports, also indirectly.

    Only modules of the package and scripts in the same folder are included. `loaded` has the names
    of modules that the script loads by name. Paths are relative to the working directory. The
    ``__init__.py`` of the package, which loads names lazily, is not included; raise ImportError if
    a script imports from it.
    """
    graph, known_modules = _import_graph(package)
    scripts = [Path(script)]
    modules = {*loaded}
    for path in scripts:  # imported scripts are appended to the list
        for name in _imported_names(path):
            top_level_name = name.split(".")[0]
            other_script = path.with_name(f"{top_level_name}.py")
            if top_level_name == package:
                # A name may be a module, or an object in a module.
                modules.add(name if name in known_modules else name.rpartition(".")[0])
            elif other_script.is_file() and other_script not in scripts:
                scripts.append(other_script)
    modules = modules.union(*map(graph.find_upstream_modules, modules))
    if package in modules:
        raise ImportError(f"{script} imports from {package} itself: import its modules")
    return sorted([*map(os.path.relpath, scripts), *map(_module_path, modules)])


def write_source_list(script, paths):
    """Update the list of a script's source files with checksums; return the path of the list.

    `paths` are the source files, a result of `find_sources`.
    """
    digest = hashlib.sha256("\n".join(paths).encode()).hexdigest()[:8]
    path = LISTS / f"{Path(script).stem}-{digest}.txt"
    text = "".join(f"{_checksum(source)}  {source}\n" for source in paths)
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = path.with_name(f".{os.getpid()}.{path.name}")
        temporary.write_text(text, encoding="utf-8")
        os.replace(temporary, path)
    return str(path)


@cache
def _import_graph(package):
    """Return the import graph of a package, and the set of its modules.

    Imports that are only for type checkers are excluded. Importing a module also runs the
    ``__init__.py`` of the packages that contain it, so the graph contains these imports, too.
    """
    graph = grimp.build_graph(package, cache_dir=None, exclude_type_checking_imports=True)
    modules = graph.modules
    for module in modules:
        parent = module.rpartition(".")[0]
        if parent not in ("", package):
            graph.add_import(importer=module, imported=parent)
    return graph, modules


@cache
def _imported_names(path):
    """Return the names that a script imports, e.g. "os" or "job.datasets"."""
    names = []
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names += [f"{node.module}.{alias.name}" for alias in node.names]
    return names


@cache
def _module_path(module):
    """Return the path of a module of a package."""
    package, *parts = module.split(".")
    path = os.path.join(os.path.dirname(find_spec(package).origin), *parts)
    # Beside a module, there may be a folder of compiled files from a former package.
    in_package = os.path.join(path, "__init__.py")
    return os.path.relpath(in_package if os.path.isfile(in_package) else f"{path}.py")


@cache
def _checksum(path):
    """Return the SHA-256 of a file as text."""
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()
