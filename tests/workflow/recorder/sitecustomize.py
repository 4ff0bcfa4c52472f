"""Record the rule, inputs and loaded modules of each job of the small workflow.

Python imports this module at the start of each process.
"""

import atexit
import json
import os
import sys
from pathlib import Path

_ENVIRONMENT = dict(os.environ)


def write_record():
    """Write a JSON record of this job to the folder GEARLIB_RECORDS when its process ends."""
    # Snakemake defines this object in the main module of a job.
    job = getattr(sys.modules["__main__"], "snakemake", None)
    if not hasattr(job, "rule"):
        return
    module_files = {getattr(module, "__file__", None) for module in [*sys.modules.values()]}
    record = {
        "rule": job.rule,
        # Snakemake runs a copy of the script, whose name has a random prefix.
        "script": Path(sys.argv[0]).name.partition(".")[2],
        "input": {name: files for name, files in job.input.items() if name != "sources"},
        "output": [*job.output],
        "params": dict(job.params.items()),
        "sources": [line.split("  ", 1)[1] for line in open(job.input.sources).read().splitlines()],
        "loaded": sorted(filter(None, module_files)),
        "environment": _ENVIRONMENT,
    }
    Path(os.environ["GEARLIB_RECORDS"], f"{os.getpid()}.json").write_text(
        json.dumps(record, default=list)
    )


atexit.register(write_record)
