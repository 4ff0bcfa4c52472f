"""Checksums of results: are they what their jobs wrote, and did these jobs run in this folder?

To Snakemake a file that is newer than its inputs is up to date, whoever wrote it. Each job
therefore ends its log with the checksums of its outputs, and every start of Snakemake compares
them. A file with an unchanged time stamp is not read again. A job that is running, or was killed,
has no checksums in its log: Snakemake itself knows that its outputs are incomplete.

Pictures and pages are not checked: no job reads them, and no number is taken from them. A picture
that was changed by hand stays until its data change, because to Snakemake it is up to date.

The same lines are recorded beside Snakemake's metadata of its jobs. Logs whose lines are not
recorded there came with results from another folder, of an unknown configuration.
"""

import hashlib
import os
import re
from pathlib import Path

#: Below the working folder, as all that Snakemake knows of earlier runs.
RECORDS = Path(".snakemake/checksums")

#: What shows data and holds none that others take.
DRAWN = {".png", ".svg", ".pdf", ".html"}

_LINE = re.compile(r"^wrote sha256 ([0-9a-f]{64}) at ([0-9]+) ns: (.+)$", re.M)


def record(log, outputs):
    """Return the lines that say what the outputs of a job hold now, and record them."""
    lines = "".join(
        f"wrote sha256 {_digest(path)} at {path.stat().st_mtime_ns} ns: {path}\n"
        for path in outputs
        if path.is_file()
    )
    # Before the log has them: a job that is killed here is not taken for one from elsewhere.
    kept = RECORDS / os.path.relpath(log)
    kept.parent.mkdir(parents=True, exist_ok=True)
    kept.write_text(lines, encoding="utf-8")
    return lines


def foreign(results):
    """Return the data files whose jobs did not run in this folder, sorted."""
    found = set()
    for log in results.rglob("logs/**/*.log"):
        kept = RECORDS / log
        known = _checksums(kept) if kept.is_file() else set()
        found |= {path for *_, path in _checksums(log) - known}
    return sorted(path for path in found if path.is_file())


def replaced(results):
    """Return the data files that somebody changed after their jobs had written them."""
    found = set()
    for log in results.rglob("logs/**/*.log"):
        for digest, time, path in _checksums(log):
            if path.is_file() and path.stat().st_mtime_ns != time and _digest(path) != digest:
                found.add(path)
    return sorted(found)


def _checksums(log):
    """Return the (digest, time, path) of data in a log."""
    lines = _LINE.findall(log.read_text(encoding="utf-8", errors="replace"))
    found = {(digest, int(time), Path(name)) for digest, time, name in lines}
    return {one for one in found if one[-1].suffix not in DRAWN}


def _digest(path):
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
