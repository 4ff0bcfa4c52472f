"""Whole files or none: what is written appears in one step."""

import csv
import os
import re
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def replacing(path):
    """Give a temporary path beside `path` to write to; on success it takes the place of `path`.

    The folder is made if need be. The temporary name keeps the suffix.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{os.getpid()}.{path.name}")
    try:
        yield temporary
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def write_table(rows, path):
    """Write rows, the first of them the names of the columns, as CSV in one step."""
    with replacing(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)


def remove_leftovers(folder):
    """Remove the temporary files below `folder` of processes that were killed while they wrote.

    No other process may be writing there: its temporary files would go as well.
    """
    for path in folder.rglob(".*"):
        if re.match(r"\.\d+\.", path.name):
            path.unlink(missing_ok=True)
