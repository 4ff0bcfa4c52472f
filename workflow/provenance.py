"""results/provenance.json: commit, versions, machine and times of the results beside it.

What changes between two equal calculations stays out of the data files, so that their bytes
repeat; it is kept here. The file is written at the end of a run that did something.
"""

import csv
import json
import os
import platform
import subprocess
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path

from gearlib import processor

#: Packages whose versions can change results.
PACKAGES = [
    "gearlib",
    "matplotlib",
    "netCDF4",
    "numba",
    "llvmlite",
    "numpy",
    "pydantic",
    "scipy",
] + ["snakemake", "xarray", "heyoka"]


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
    temporary = target.with_name(f".{os.getpid()}.{target.name}")
    temporary.write_text(json.dumps(record, indent=2) + "\n", encoding="utf-8")
    os.replace(temporary, target)
    return True


def _git(root, *arguments):
    """Return what git says, None outside a repository."""
    try:
        done = subprocess.run(
            ["git", "-C", root, *arguments], capture_output=True, text=True, check=True
        )
    except (OSError, subprocess.CalledProcessError):
        return None
    return done.stdout.strip()


def _versions():
    found = {}
    for name in PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found


def _processor():
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()


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
    try:
        return float(text)
    except ValueError:
        return None
