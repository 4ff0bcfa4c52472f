"""The page `reference/api.md`: docstrings of gearlib, of `gearlib.geometry` and `gearlib.plot`."""

import inspect

from mkdocs.structure.files import File

import gearlib
import gearlib.geometry
import gearlib.plot
from gearlib import parameters

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
_LONGEST = 96
#: Title, where the names are, which of them.
_SECTIONS = (
    *((title, gearlib, belongs) for title, belongs in _GROUPS),
    ("Gears by their drawing: gearlib.geometry", gearlib.geometry, callable),
    ("Pictures: gearlib.plot", gearlib.plot, callable),
)


def on_files(files, config):
    """Add the page."""
    files.append(File.generated(config, PAGE, content=reference()))
    return files


def reference():
    """Return the page as Markdown with a directive of mkdocstrings for each name."""
    lines = [_HEAD]
    for title, module, belongs in _SECTIONS:
        lines += [f"## {title}", ""]
        for name in module.__all__:
            thing = getattr(module, name)
            if not belongs(thing):
                continue
            lines += [f"### {name}", "", "```python", signature(thing), "```", ""]
            lines += parameters_of(thing)
            lines += [f"::: {thing.__module__}.{thing.__qualname__}", ""]
    return "\n".join(lines)


def parameters_of(thing):
    """Return the table of what a class or function declares, see `gearlib.parameters`."""
    if not callable(thing) or not (declared := parameters.declared_parameters(thing)):
        return []
    lines = ["| parameter | meaning | allowed | default |", "|---|---|---|---|"]
    for name, one in declared.items():
        default = "" if one.default in (None, parameters.MISSING) else f"`{one.default!r}`"
        cells = f"`{name}`", one.description, one.kind.allowed, default
        lines.append(f"| {' | '.join(cell.replace('<', '&lt;') for cell in cells)} |")
    return [*lines, ""]


def signature(thing):
    """Return the call of a function or class in one line, or a line for each parameter."""
    parameters = inspect.signature(thing).parameters.values()
    shown = [str(p.replace(annotation=p.empty)).replace("<factory>", "...") for p in parameters]
    star = next((i for i, p in enumerate(parameters) if p.kind is p.KEYWORD_ONLY), None)
    if star is not None:
        shown.insert(star, "*")
    line = f"{thing.__name__}({', '.join(shown)})"
    if len(line) <= _LONGEST:
        return line
    inside = "".join(f"    {text},\n" for text in shown)
    return f"{thing.__name__}(\n{inside})"
