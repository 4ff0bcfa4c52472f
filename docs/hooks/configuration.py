"""The tables of `reference/configuration.md`, made from the annotations of the configuration."""

from typing import Annotated, get_args, get_origin

import yaml
from mkdocs.structure.files import File
from pydantic import BaseModel

from gearlib.config import schema_text
from gearlib.config.configuration import Config
from gearlib.parameters import describe_requirement, is_union, split_annotation

_HEAD = "| key | meaning | allowed | default |\n|---|---|---|---|\n"


def on_files(files, config):
    """Add the schema beside the page."""
    files.append(File.generated(config, "reference/config.schema.json", content=schema_text()))
    return files


def on_page_markdown(markdown, page, **_):
    """Put the tables into the page."""
    return f"{markdown}\n{tables()}" if page.file.name == "configuration" else markdown


def tables():
    """Return a table of the plain keys and one for each section."""
    fields = Config.model_fields
    plain = "".join(_row(key, x) for key, x in fields.items() if not any(_below(x.annotation)))
    tables = [f"## Plain keys\n\n{_HEAD}{plain}"]
    for key, field in fields.items():
        if rows := "".join(_rows(field.annotation)):
            words = " ".join(
                (field.description or split_annotation(field.annotation)[0].__doc__).split()
            )
            tables.append(f"## {key}\n\n{words}\n\n{_HEAD}{rows}")
    return "\n".join(tables)


def _below(annotation):
    """Yield (end of the path, section) for the sections in an annotation."""
    base, _ = split_annotation(annotation)
    if is_union(base):
        yield from ((f"({x.__name__})", x) for x in get_args(base))
    elif get_origin(base) in (list, dict):
        end = "[ ]" if get_origin(base) is list else "<name>"
        yield from ((f"{end}{path}", x) for path, x in _below(get_args(base)[-1]))
    elif isinstance(base, type) and issubclass(base, BaseModel):
        yield "", base


def _rows(annotation, path=""):
    """Yield the rows of all keys in an annotation; the default of a section is that of its keys."""
    for end, section in _below(annotation):
        for key, field in section.model_fields.items():
            place = f"{path}{end}.{key}".removeprefix(".")
            below = "".join(_rows(field.annotation, place))
            if not below or field.default not in (None, {}) or "Default:" in str(field.description):
                yield _row(place, field)
            yield below


def _row(path, field):
    default = None if field.is_required() else field.default
    default = (field.json_schema_extra or {}).get("default", default)
    text = yaml.safe_dump(default, default_flow_style=True, width=999).split("\n")[0]
    shown = "" if default in (None, {}, []) else f"`{text if len(text) <= 60 else text[:57] + '…'}`"
    allowed = describe_requirement(
        Annotated[(field.annotation, *field.metadata, field)], in_file=True
    )
    cells = field.description or "", allowed.replace("|", "&#124;"), shown
    return f"| `{path}` | {' | '.join(cells)} |\n"
