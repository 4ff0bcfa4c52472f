"""Whether the results are still what their jobs wrote.

To Snakemake a file that is newer than its inputs is up to date, whoever wrote it. Each job
therefore ends its log with the checksums of its outputs, and every start of Snakemake compares
them. A file whose time stamp is that of its checksum is not read again. A job that is running,
or was killed, has no checksums in its log: Snakemake itself knows that its outputs do not count.
"""

import hashlib
import re
from pathlib import Path

_SEAL = re.compile(r"^wrote sha256 ([0-9a-f]{64}) at ([0-9]+) ns: (.+)$", re.M)


def seal(path):
    """Return the line that says what `path` holds now."""
    return f"wrote sha256 {_digest(path)} at {path.stat().st_mtime_ns} ns: {path}"


def replaced(results):
    """Return the result files that somebody changed after their jobs had written them.

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
        for digest, time, name in _SEAL.findall(log.read_text(encoding="utf-8", errors="replace")):
            path = Path(name)
            if path.is_file() and path.stat().st_mtime_ns != int(time) and _digest(path) != digest:
                found.add(path)
    return sorted(found)


def _digest(path):
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
