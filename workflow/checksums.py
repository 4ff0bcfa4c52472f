"""Checksums of results: find files that somebody changed, and files of another folder.

Snakemake takes a file that is newer than its inputs for up to date, whoever wrote it. Each job
therefore ends its log with the checksums of its outputs, and every start of Snakemake compares them
with the files whose time stamps have changed. The same lines are recorded beside Snakemake's
metadata: logs whose lines are not recorded there came with results from another folder.

Pictures and pages are not checked, because no job reads them.
"""

import hashlib
import os
import re
from pathlib import Path

#: Folder of the records, beside Snakemake's metadata.
RECORDS = Path(".snakemake/checksums")

#: Suffixes of pictures and pages.
DRAWN = {".png", ".svg", ".pdf", ".html"}

_LINE = re.compile(r"^wrote sha256 ([0-9a-f]{64}) at ([0-9]+) ns: (.+)$", re.M)


def record(log, outputs):
    """Return lines with the checksums of a job's outputs for its log, and record them."""
    lines = "".join(
        f"wrote sha256 {_digest(path)} at {path.stat().st_mtime_ns} ns: {path}\n"
        for path in outputs
        if path.is_file()
    )
    # They are recorded before the log gets them: a job killed in between is not foreign then.
    path = RECORDS / os.path.relpath(log)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(lines, encoding="utf-8")
    return lines


def foreign(results):
    """Return the sorted data files below `results` that came from another folder."""
    paths = set()
    for log in results.rglob("logs/**/*.log"):
        recorded = _checksums(RECORDS / log) if (RECORDS / log).is_file() else set()
        paths |= {path for *_, path in _checksums(log) - recorded}
    return sorted(path for path in paths if path.is_file())


def replaced(results):
    """Return the sorted data files below `results` that were changed after their jobs had ended."""
    paths = set()
    for log in results.rglob("logs/**/*.log"):
        for digest, time, path in _checksums(log):
            if path.is_file() and path.stat().st_mtime_ns != time and _digest(path) != digest:
                paths.add(path)
    return sorted(paths)


def _checksums(log):
    """Return the set of (SHA-256, modification time in ns, path) of the data files in a log."""
    lines = _LINE.findall(log.read_text(encoding="utf-8", errors="replace"))
    entries = {(digest, int(time), Path(name)) for digest, time, name in lines}
    return {entry for entry in entries if entry[-1].suffix not in DRAWN}


def _digest(path):
    """Return the SHA-256 of a file as text."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
