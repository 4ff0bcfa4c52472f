"""Whether the results are still what their jobs wrote, and whether these were jobs of this folder.

To Snakemake a file that is newer than its inputs is up to date, whoever wrote it. Each job
therefore ends its log with the checksums of its outputs, and every start of Snakemake compares
them. A file whose time stamp is that of its checksum is not read again. A job that is running,
or was killed, has no checksums in its log: Snakemake itself knows that its outputs do not count.

Drawings and pages do not count: no job reads them, and no number is taken from them. A picture that
somebody has changed stays until its data change, as for Snakemake it is up to date.

The same lines go into a record beside Snakemake's own records of what its jobs were given. Logs
whose lines are not there came with results from another folder, made with nobody knows which
configuration.
"""

import hashlib
import os
import re
from pathlib import Path

#: Below the working folder, as all that Snakemake knows of earlier runs.
RECORDS = Path(".snakemake/seals")

#: What shows data and holds none that others take.
DRAWN = {".png", ".svg", ".pdf", ".html"}

_SEAL = re.compile(r"^wrote sha256 ([0-9a-f]{64}) at ([0-9]+) ns: (.+)$", re.M)


def seal(log, outputs):
    """Return the lines that say what the outputs of a job hold now, and record them.

    Parameters
    ----------
    log : str or os.PathLike
        The job's log, seen from the working folder; the lines should be its last.
    outputs : iterable of pathlib.Path
        Those that are no files are left out.

    Returns
    -------
    str
    """
    lines = "".join(
        f"wrote sha256 {_digest(path)} at {path.stat().st_mtime_ns} ns: {path}\n"
        for path in outputs
        if path.is_file()
    )
    # Before the log has them: a job that is killed here is not taken for one from elsewhere.
    record = RECORDS / os.path.relpath(log)
    record.parent.mkdir(parents=True, exist_ok=True)
    record.write_text(lines, encoding="utf-8")
    return lines


def foreign(results):
    """Return the data files whose jobs did not run in this folder, sorted.

    Parameters
    ----------
    results : pathlib.Path
        As of `replaced`, seen from the working folder.
    """
    found = set()
    for log in results.rglob("logs/**/*.log"):
        record = RECORDS / log
        known = _seals(record) if record.is_file() else set()
        found |= {path for *_, path in _seals(log) - known}
    return sorted(path for path in found if path.is_file())


def replaced(results):
    """Return the data files that somebody changed after their jobs had written them.

    Parameters
    ----------
    results : pathlib.Path
        The folder of the results, with the logs of the jobs somewhere below; the paths in the logs
        are seen from the working folder.

    Returns
    -------
    list of pathlib.Path
        Sorted. Files that are gone do not count: Snakemake makes them anew.
    """
    found = set()
    for log in results.rglob("logs/**/*.log"):
        for digest, time, path in _seals(log):
            if path.is_file() and path.stat().st_mtime_ns != time and _digest(path) != digest:
                found.add(path)
    return sorted(found)


def _seals(log):
    """Return the (digest, time, path) of data in a log."""
    lines = _SEAL.findall(log.read_text(encoding="utf-8", errors="replace"))
    seals = {(digest, int(time), Path(name)) for digest, time, name in lines}
    return {seal for seal in seals if seal[-1].suffix not in DRAWN}


def _digest(path):
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
