"""results/provenance.json: commit, versions, machine and times of the results beside it.

The data files hold nothing that changes between two equal calculations. This file holds it, and is
written at the end of a run that ran a job.
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
from gearlib.data.files import replacing

#: Packages whose versions can change results.
PACKAGES = (
    "gearlib matplotlib netCDF4 numba llvmlite numpy pydantic scipy snakemake xarray heyoka"
).split()


def write(results, root):
    """Write the file if any job is newer than it; return whether it was written."""
    target = results / "provenance.json"
    jobs = sorted((results / "benchmarks").rglob("*.tsv"))
    newest = max((path.stat().st_mtime for path in jobs), default=0.0)
    if target.exists() and target.stat().st_mtime >= newest:
        return False
    record = {
        "finished": datetime.fromtimestamp(newest, UTC).isoformat(timespec="seconds"),
        "commit": _git(root, "rev-parse", "HEAD"),
        "changed_files": (_git(root, "status", "--porcelain") or "").splitlines(),
        "versions": {"python": platform.python_version()} | _versions(),
        "machine": {
            "system": platform.platform(),
            "processor": _processor(),
            "cores": os.cpu_count(),
            "settings": processor.settings(),
        },
        "jobs": [_job(path, results / "benchmarks") for path in jobs],
    }
    with replacing(target) as temporary:
        temporary.write_text(json.dumps(record, indent=2) + "\n", encoding="utf-8")
    return True


def _git(root, *arguments):
    """Return the output of git, None outside a repository."""
    try:
        command = ["git", "-C", root, *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return None


def _versions():
    """Return name -> version of the packages that are installed."""
    versions = {}
    for name in PACKAGES:
        with suppress(metadata.PackageNotFoundError):
            versions[name] = metadata.version(name)
    return versions


def _processor():
    """Return the name of the processor."""
    with suppress(OSError, StopIteration):
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        line = next(line for line in lines if line.startswith("model name"))
        return line.split(":", 1)[1].strip()
    return platform.processor()


def _job(path, folder):
    """Return name, seconds and memory of a job from Snakemake's benchmark file."""
    with path.open(encoding="utf-8") as file:
        row = next(csv.DictReader(file, delimiter="\t"))
    return {
        "job": str(path.relative_to(folder).with_suffix("")),
        "seconds": _number(row["s"]),
        "megabytes": _number(row["max_rss"]),
    }


def _number(text):
    """Return a number, None where Snakemake could not measure it."""
    with suppress(ValueError):
        return float(text)
