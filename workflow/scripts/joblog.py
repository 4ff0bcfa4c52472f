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
    """Send standard output and standard error, of Python and of compiled code, to a file.

    At the end of the job the file gets the checksums of its outputs for `workflow.checksums`. The
    source files of the job are declared, since netCDF files hold their hash.
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
    """Print what stopped the job: a sentence for disks and damaged files, else a traceback."""
    if not issubclass(kind, OSError):
        traceback.print_exception(kind, error, trace)
        return
    # To the terminal first: the log may lie on the same full disk.
    os.write(terminal, f"{error}\n".encode())
    with contextlib.suppress(OSError):
        print(error, file=sys.stderr, flush=True)
