"""The log of a job: the output of its process, then the checksums of its results."""

import atexit
import contextlib
import os
import sys
import traceback
from pathlib import Path

import __main__
from gearlib.data.files import declare_sources
from workflow import sources
from workflow.checksums import record


def redirect_output(path):
    """Redirect standard output and error of Python and compiled code to the log file `path`.

    At the end of the job its outputs' checksums are appended for `workflow.checksums`. The job's
    source files are declared, because netCDF files store their hash.
    """
    declare_sources(sources.read(__main__.snakemake.input.sources))
    sys.stdout.flush()
    sys.stderr.flush()
    terminal = os.dup(2)
    # Compiled libraries and the last traceback write to the descriptors, not to sys.stdout.
    with open(path, "w", encoding="utf-8") as log:
        os.dup2(log.fileno(), 1)
        os.dup2(log.fileno(), 2)
    atexit.register(_record_outputs, path)
    sys.excepthook = lambda *fault: _report(terminal, *fault)


def _record_outputs(log):
    print(record(log, map(Path, __main__.snakemake.output)), end="")


def _report(terminal, kind, error, trace):
    """Report an exception: the message of an OSError also on the terminal, else a traceback.

    `terminal` is the file descriptor of the original standard error.
    """
    if not issubclass(kind, OSError):
        traceback.print_exception(kind, error, trace)
        return
    # To the terminal first: the log may lie on the same full disk.
    os.write(terminal, f"{error}\n".encode())
    with contextlib.suppress(OSError):
        print(error, file=sys.stderr, flush=True)
