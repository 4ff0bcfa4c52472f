"""Write results/provenance.json: commit, versions, machine and run times of the results.

Data files only have entries that are the same whenever a calculation is repeated; all other entries
are in this file. It is written after a successful run of Snakemake.
"""

import csv
import json
import os
import platform
import subprocess
from contextlib import suppress
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path

from gearlib import processor
from gearlib.data.files import atomic_write

#: Packages whose versions can change results.
PACKAGES = (
    "gearlib matplotlib netCDF4 numba llvmlite numpy pydantic scipy snakemake xarray heyoka"
).split()


def write(results, root):
    """Write provenance.json to the folder `results`, unless it is newer than all jobs.

    `root` is the folder of the git repository.
    """
    target = results / "provenance.json"
    jobs = sorted((results / "benchmarks").rglob("*.tsv"))
    newest = max((path.stat().st_mtime for path in jobs), default=0.0)
    if target.exists() and target.stat().st_mtime >= newest:
        return
    record = {
        "finished": datetime.fromtimestamp(newest, UTC).isoformat(timespec="seconds"),
        "commit": _git(root, "rev-parse", "HEAD"),
        "changed_files": (_git(root, "status", "--porcelain") or "").splitlines(),
        "versions": {"python": platform.python_version()} | _versions(),
        "machine": {
            "system": platform.platform(),
            "processor": _processor(),
            "cores": os.cpu_count(),
            "settings": processor.environment_variables(),
        },
        "jobs": [_job(path, results / "benchmarks") for path in jobs],
    }
    with atomic_write(target) as temporary:
        temporary.write_text(json.dumps(record, indent=2) + "\n", encoding="utf-8")


def _git(root, *arguments):
    """Return the output of a git command in the folder `root`, or None if git fails."""
    try:
        command = ["git", "-C", root, *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return None


def _versions():
    """Return a dict of the versions of those `PACKAGES` that are installed."""
    versions = {}
    for name in PACKAGES:
        with suppress(metadata.PackageNotFoundError):
            versions[name] = metadata.version(name)
    return versions


def _processor():
    """Return the model name of the processor."""
    with suppress(OSError, StopIteration):
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        line = next(line for line in lines if line.startswith("model name"))
        return line.split(":", 1)[1].strip()
    return platform.processor()


def _job(path, folder):
    """Return name, run time and peak memory of a job from Snakemake's benchmark file `path`.

    The name is the path relative to `folder`, the folder of all benchmark files.
    """
    with path.open(encoding="utf-8") as file:
        row = next(csv.DictReader(file, delimiter="\t"))
    return {
        "job": str(path.relative_to(folder).with_suffix("")),
        "seconds": _number(row["s"]),
        "megabytes": _number(row["max_rss"]),
    }


def _number(text):
    """Convert text to a float; return None for other text, e.g. "-" for a missing measurement."""
    with suppress(ValueError):
        return float(text)
