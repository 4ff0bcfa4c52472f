"""The page `reference/configuration.md`, written from the typed model of the configuration.

Keys, descriptions and ranges are those of `gearlib.config`; the words for a range are the ones
with which a wrong value is refused.
"""

from mkdocs.structure.files import File

from gearlib.config import schema, schema_text
from gearlib.config.validation import allowed_text, resolve

PAGE, SCHEMA = "reference/configuration.md", "config.schema.json"
_HEAD = f"""# Configuration

Every key of `config.yaml`, written from the typed model that checks it (`gearlib/config`). Required
are `gear_pair` or `gears`, and `dampings`; all keys of `gear_pair`; in entries of lists and of
`scenes` all keys but `change` and `options`; in each of `dampings` a material and a backlash
damping. All other keys have defaults. Defaults with a dimension follow from the gears; where they
need damping and the gears have none, it is 5 % of the critical one. A wrong key or value is refused
before the first job, in a sentence that names key, value and allowed range. Names in angle
brackets are free: letters, digits, `+`, `_`, `-`.

Editors with YAML support complete the keys; they read `build/config.schema.json`, which `make`
writes. [The same schema]({SCHEMA}) comes from `gearlib schema`.
Values with a dimension are [numbers in SI or texts with a unit](../how_to/units.md).
"""


def on_files(files, config):
    """Add the page, and the schema beside it."""
    files.append(File.generated(config, PAGE, content=reference()))
    files.append(File.generated(config, f"reference/{SCHEMA}", content=schema_text()))
    return files


def reference():
    """Return the page as Markdown."""
    whole = schema()
    plain, sections = [], []
    for key, node in whole["properties"].items():
        inside = _section(node, whole)
        if inside is None:
            plain.append(_row(key, node, whole))
        else:
            rows = list(_rows("", node, whole))
            sections.append((key, _words(node, whole), rows))
    lines = [_HEAD, "## Plain keys", "", *_table(plain)]
    for key, words, rows in sections:
        lines += [f"## {key}", "", words, "", *_table(rows)]
    return "\n".join(lines)


def _rows(prefix, node, whole):
    """Yield the rows of all keys below a node, those of inner sections included."""
    node = resolve(node, whole)
    inner = _section(node, whole)
    if inner is None:
        if prefix:
            yield _row(prefix, node, whole)
        return
    name, inside = inner
    if name is not None:
        yield from _rows(f"{prefix}{name}", inside, whole)
        return
    for key, child in inside["properties"].items():
        path = f"{prefix}.{key}" if prefix else key
        if _section(child, whole) is None:
            yield _row(path, child, whole)
        else:
            # The default of a section is that of its keys.
            own = "default" in child and "$ref" not in child
            if own or "Default:" in child.get("description", ""):
                yield _row(path, child, whole)
            yield from _rows(path, child, whole)


def _section(node, whole):
    """Return (name of free keys or None, section below), or None where the node holds a value."""
    node = resolve(node, whole)
    if "properties" in node:
        return None, node
    if node.get("type") == "array" and "$ref" in node.get("items", {}):
        inside = resolve(node["items"], whole)
        return ("[ ]", inside) if "properties" in inside else None
    entries = list(node.get("patternProperties", {}).values())
    if entries:
        inside = resolve(entries[0], whole)
        return ("<name>", inside) if "properties" in inside else None
    return None


def _row(key, node, whole):
    default = node.get("default")
    shown = "" if default in (None, {}, []) else _short(default)
    words = allowed_text(node, whole).replace("|", "\\|").replace("<", "&lt;").replace(">", "&gt;")
    return f"`{key}`", _words(node, whole), words, shown


def _words(node, whole):
    words = node.get("description") or resolve(node, whole).get("description", "")
    return " ".join(words.split()).replace("|", "\\|")


def _short(value):
    if isinstance(value, dict) or (isinstance(value, list) and isinstance(value[0], dict)):
        # Entries of a list go by their first key, which names them.
        value = [*value] if isinstance(value, dict) else [[*entry.values()][0] for entry in value]
    if isinstance(value, bool):
        value = str(value).lower()
    values = value if isinstance(value, list) else [value]
    text = ", ".join(f"{v:g}" if isinstance(v, float) and abs(v) >= 1e6 else str(v) for v in values)
    return f"`{text}`" if len(text) <= 60 else f"`{text[:57]}` …"


def _table(rows):
    head = ["| key | meaning | allowed | default |", "|---|---|---|---|"]
    return [*head, *(f"| {' | '.join(row)} |" for row in rows), ""]
