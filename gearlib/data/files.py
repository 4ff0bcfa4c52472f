"""Files written in one step, tables as CSV and HTML, canonical JSON and the hash of the sources."""

import csv
import hashlib
import json
import math
import os
import re
from contextlib import contextmanager
from html import escape
from pathlib import Path

_PAGE = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<title>{title}</title>
<style>
body {{ font: 15px/1.4 system-ui, sans-serif; color: #222; background: #fff; margin: 1.5em; }}
table {{ border-collapse: collapse; font-variant-numeric: tabular-nums; }}
th, td {{ padding: 0.35em 0.8em; text-align: left; vertical-align: top; max-width: 30em; }}
th {{ position: sticky; top: 0; background: #444; color: #fff; }}
td {{ border-bottom: 1px solid #ddd; overflow-wrap: break-word; }}
</style>
<p>{gears}</p>
<table>
{rows}
</table>
</html>
"""
#: Files whose hash a dataset has: those of the library, or those that a job declares.
_sources = sorted(Path(__file__).parents[1].rglob("*.py"))


@contextmanager
def replacing(path):
    """Yield a temporary path to write to, and on success rename it to `path` in one step.

    A missing folder is created. The temporary name has the suffix of `path`.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{os.getpid()}.{path.name}")
    try:
        yield temporary
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def remove_leftovers(folder):
    """Remove temporary files that killed processes left in `folder` or below.

    No other process may write there meanwhile, because its temporary files are removed too.
    """
    for path in folder.rglob(".*"):
        if re.match(r"\.\d+\.", path.name):
            path.unlink(missing_ok=True)


def write_table(rows, path):
    """Write rows of cells to a CSV file in one step; the first row has the column names."""
    with replacing(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)


def write_table_page(csv_path, path, gears=""):
    """Write the table of a CSV file as an HTML page in one step, with the name `gears` on top.

    The first row has the column names, in which ``_`` becomes a space.
    """

    def row(tag, cells):
        return f"<tr>{''.join(f'<{tag}>{escape(cell)}</{tag}>' for cell in cells)}</tr>"

    with open(csv_path, newline="", encoding="utf-8") as file:
        header, *body = csv.reader(file)
    lines = [row("th", [name.replace("_", " ") for name in header])]
    lines += [row("td", cells) for cells in body]
    title = escape(Path(csv_path).stem.replace("_", " "))
    with replacing(path) as temporary:
        page = _PAGE.format(title=title, gears=escape(gears), rows="\n".join(lines))
        temporary.write_text(page, "utf-8")


def canonical_json(value):
    """Return a value as compact JSON with sorted keys; infinite numbers become "inf" or "-inf"."""

    def plain(value):
        if isinstance(value, dict):
            return {str(key): plain(item) for key, item in value.items()}
        if isinstance(value, (list, tuple)):
            return [plain(item) for item in value]
        if isinstance(value, float) and math.isinf(value):
            return "inf" if value > 0 else "-inf"
        return value

    return json.dumps(plain(value), sort_keys=True, separators=(",", ":"), allow_nan=False)


def declare_sources(paths):
    """Set the source files whose contents, in this order, determine the hash of `source_hash`."""
    _sources[:] = map(Path, paths)


def source_hash():
    """Return 16 hex digits of the SHA-256 of the declared source files or of the whole library."""
    digest = hashlib.sha256()
    for path in _sources:
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()[:16]
