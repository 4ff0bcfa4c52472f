"""The page `reference/api.md`: the docstring of every name in `gearlib.__all__`."""

import importlib
import inspect

from mkdocs.structure.files import File

import gearlib
from tables import markdown

PAGE = "reference/api.md"
_HEAD = """# Python

The public names of `gearlib`; everything else may change. Datasets are `xarray.Dataset`s with CF
attributes: `units` and `long_name` of every variable, and in the attributes of the whole how it
was made.
"""
#: Runs first, then what they take.
_GROUPS = (
    ("Runs and orbits", inspect.isfunction),
    ("Gears and what they are made of", inspect.isclass),
)


def on_files(files, config):
    """Add the page."""
    files.append(File.generated(config, PAGE, content=reference()))
    return files


def reference():
    """Return the page as Markdown with a directive of mkdocstrings for each name."""
    lines = [_HEAD]
    for title, belongs in _GROUPS:
        lines += [f"## {title}", ""]
        for name in gearlib.__all__:
            thing = getattr(gearlib, name)
            if not belongs(thing):
                continue
            lines += [f"### {name}", ""]
            if "table of the module" in inspect.getdoc(thing):
                # The class leaves its parameters to the table at the head of its module.
                module = importlib.import_module(thing.__module__)
                lines += [markdown(inspect.getdoc(module)), ""]
            lines += [f"::: {thing.__module__}.{thing.__qualname__}", ""]
    return "\n".join(lines)
