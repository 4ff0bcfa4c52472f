"""The tables of `reference/configuration.md`, made from the schema of the configuration."""

import yaml
from mkdocs.structure.files import File

from gearlib.config import schema, schema_text
from gearlib.config.validation import allowed_text, resolve

_HEAD = "| key | meaning | allowed | default |\n|---|---|---|---|\n"


def on_files(files, config):
    """Add the schema beside the page."""
    files.append(File.generated(config, "reference/config.schema.json", content=schema_text()))
    return files


def on_page_markdown(markdown, **_):
    """Put the tables into the page."""
    mark = "<!-- keys of the configuration -->"
    return markdown.replace(mark, tables()) if mark in markdown else markdown


def tables():
    """Return a table of the plain keys and one for each section."""
    whole = schema()
    nodes = whole["properties"]
    sections = {key: node for key, node in nodes.items() if _children(node, whole)}
    plain = "".join(_row(key, node, whole) for key, node in nodes.items() if key not in sections)
    parts = [f"## Plain keys\n\n{_HEAD}{plain}"]
    for key, node in sections.items():
        rows = "".join(_rows("", node, whole))
        parts.append(f"## {key}\n\n{_words(node, whole)}\n\n{_HEAD}{rows}")
    return "\n".join(parts)


def _children(node, whole):
    """Return the nodes below a node by what follows in their path, none below a value."""
    node = resolve(node, whole)
    if "properties" in node:
        return {f".{key}": child for key, child in node["properties"].items()}
    entries = [("[ ]", node.get("items", {}))]
    entries += [("<name>", entry) for entry in node.get("patternProperties", {}).values()]
    return {path: entry for path, entry in entries if "properties" in resolve(entry, whole)}


def _rows(path, node, whole):
    """Yield the rows of all keys below a node."""
    for part, child in _children(node, whole).items():
        below = f"{path}{part}".removeprefix(".")
        # The default of a section is that of its keys.
        is_set = "default" in child and "$ref" not in child
        if is_set or "Default:" in child.get("description", "") or not _children(child, whole):
            yield _row(below, child, whole)
        yield from _rows(below, child, whole)


def _row(path, node, whole):
    default = node.get("default")
    text = yaml.safe_dump(default, default_flow_style=True, width=999).split("\n")[0]
    shown = "" if default in (None, {}, []) else f"`{text if len(text) <= 60 else text[:57] + '…'}`"
    cells = _words(node, whole), allowed_text(node, whole), shown
    return f"| `{path}` | {' | '.join(cell.replace('|', '&#124;') for cell in cells)} |\n"


def _words(node, whole):
    words = node.get("description") or resolve(node, whole).get("description", "")
    return " ".join(words.split())
