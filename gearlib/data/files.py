"""Atomic writing of files, CSV and HTML tables, canonical JSON and the source hash."""

import csv
import hashlib
import json
import math
import os
import re
from contextlib import contextmanager
from fractions import Fraction
from html import escape
from pathlib import Path

_PAGE_TEMPLATE = """<!doctype html>
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
<p>{caption}</p>
<table>
{rows}
</table>
</html>
"""
#: Files that determine `source_hash`: the library, unless `set_source_files` replaces them.
_source_files = sorted(Path(__file__).parents[1].rglob("*.py"))


@contextmanager
def atomic_write(path):
    """Yield a temporary path to write to; move it to `path` if the block succeeds.

    The move is atomic, so that no reader sees an incomplete file. Missing folders are created. The
    temporary file is in the same folder and has the suffix of `path`; it is removed if the block
    raises an error.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{os.getpid()}.{path.name}")
    try:
        yield temporary
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def remove_temporary_files(folder):
    """Remove temporary files that killed processes left in `folder` and its subfolders.

    Their names are ".<process id>.<final name>". No other process may write there at the same time,
    because its temporary files would be removed, too.
    """
    for path in folder.rglob(".*"):
        if re.match(r"\.\d+\.", path.name):
            path.unlink(missing_ok=True)


def write_csv(rows, path):
    """Write rows, of which the first is the header, to a CSV file atomically."""
    with (
        atomic_write(path) as temporary,
        open(temporary, "w", newline="", encoding="utf-8") as file,
    ):
        csv.writer(file, lineterminator="\n").writerows(rows)


def write_html_table(csv_path, path, caption=""):
    """Write the table in a CSV file to an HTML page atomically, with `caption` above the table.

    The first row of the CSV file is the header; underscores in it become spaces.
    """

    def format_row(tag, cells):
        """Return a row of the HTML table; `tag` is "th" for header cells, "td" for others."""
        html_cells = [f"<{tag}>{escape(cell)}</{tag}>" for cell in cells]
        return f"<tr>{''.join(html_cells)}</tr>"

    with open(csv_path, newline="", encoding="utf-8") as file:
        header, *body = csv.reader(file)
    rows = [format_row("th", [name.replace("_", " ") for name in header])]
    rows += [format_row("td", cells) for cells in body]
    title = escape(Path(csv_path).stem.replace("_", " "))
    with atomic_write(path) as temporary:
        page = _PAGE_TEMPLATE.format(title=title, caption=escape(caption), rows="\n".join(rows))
        temporary.write_text(page, "utf-8")


def canonical_json(value):
    """Return `value` as compact JSON with sorted keys, so that equal values give equal strings.

    Infinite numbers become "inf" or "-inf"; fractions and NumPy scalars become plain numbers.
    """

    def to_json_types(value):
        """Convert a value recursively to dicts, lists, strings and plain numbers."""
        if isinstance(value, dict):
            return {str(key): to_json_types(item) for key, item in value.items()}
        if isinstance(value, (list, tuple)):
            return [to_json_types(item) for item in value]
        if hasattr(value, "item") and not hasattr(value, "__len__"):  # a NumPy scalar
            value = value.item()
        if isinstance(value, Fraction):
            value = float(value)
        if isinstance(value, float) and math.isinf(value):
            return "inf" if value > 0 else "-inf"
        return value

    plain_value = to_json_types(value)
    return json.dumps(plain_value, sort_keys=True, separators=(",", ":"), allow_nan=False)


def set_source_files(paths):
    """Set the files whose names and contents, in this order, determine `source_hash`."""
    _source_files[:] = map(Path, paths)


def source_hash():
    """Return the first 16 hexadecimal digits of the SHA-256 hash of the source files.

    These are the files set by `set_source_files`, by default all modules of the library. Datasets
    store the hash, so that the code that computed them can be identified.
    """
    digest = hashlib.sha256()
    for path in _source_files:
        # The folder is not hashed, so that the hash is the same on all machines.
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()[:16]
