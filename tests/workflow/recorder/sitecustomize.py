"""In every process of the small workflow: its processor, what it loaded, what it had to compile."""

import atexit
import json
import os
import sys
import time
from importlib.machinery import SourceFileLoader
from pathlib import Path

import code_taken

_compiled = []
_source_to_code = SourceFileLoader.source_to_code


def _compile(loader, data, path, **options):
    _compiled.append(str(path))
    return _source_to_code(loader, data, path, **options)


def _write():
    # The process from which Snakemake is forked outlives the run that it records.
    if not os.path.isdir(os.environ["GEARLIB_RECORDS"]):
        return
    # Snakemake puts this into the main module of a job.
    job = getattr(sys.modules["__main__"], "snakemake", None)
    files = {getattr(module, "__file__", None) for module in list(sys.modules.values())}
    declared = []
    if hasattr(job, "rule"):
        from workflow import sources

        declared = sources.read(job.input.sources)
    record = {
        "rule": getattr(job, "rule", ""),
        # Snakemake runs a copy, whose name begins with letters of its own.
        "script": Path(sys.argv[0]).name.partition(".")[2] if job else "",
        "declared": declared,
        "read": [*job.input, *declared] if hasattr(job, "rule") else [],
        "written": list(job.output) if hasattr(job, "rule") else [],
        "loaded": sorted(filter(None, files)),
        "compiled": _compiled,
        "processor": code_taken.taken() if job else {},
    }
    path = Path(os.environ["GEARLIB_RECORDS"], f"{os.getpid()}-{time.time_ns()}.json")
    path.write_text(json.dumps(record), encoding="utf-8")


SourceFileLoader.source_to_code = _compile
atexit.register(_write)
