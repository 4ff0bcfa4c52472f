"""What all scripts do: read the datasets of a job, log its output and checksums of its results."""

import atexit
import contextlib
import os
import sys
import traceback
from pathlib import Path

import __main__
from gearlib.data import storage
from gearlib.data.files import declare_sources
from workflow import sources
from workflow.checksums import record


def datasets(files):
    """Return input name -> dataset, or list of datasets, of the netCDF files among the inputs.

    `files` are the named inputs of a Snakemake job, paths or lists of paths.
    """
    return {
        name: storage.read(paths) if isinstance(paths, str) else [*map(storage.read, paths)]
        for name, paths in files.items()
        if "".join(paths).endswith(".nc")
    }


def redirect_output(path):
    """Redirect standard output and error of Python and compiled code to the log file `path`.

    When the job ends, the checksums of its outputs are appended. The source files of the job are
    declared, because netCDF files store their hash.
    """
    declare_sources(sources.read(__main__.snakemake.input.sources))
    sys.stdout.flush()
    sys.stderr.flush()
    terminal = os.dup(2)
    # Compiled libraries write to the file descriptors, not to sys.stdout.
    with open(path, "w", encoding="utf-8") as log:
        os.dup2(log.fileno(), 1)
        os.dup2(log.fileno(), 2)
    atexit.register(_record_outputs, path)
    sys.excepthook = lambda *exception: _report_exception(terminal, *exception)


def _record_outputs(log):
    print(record(log, map(Path, __main__.snakemake.output)), end="")


def _report_exception(terminal, exception_type, error, trace):
    """Write a traceback to the log, but only the message of an OSError, also to the terminal.

    `terminal` is the file descriptor of the original standard error.
    """
    if not issubclass(exception_type, OSError):
        traceback.print_exception(exception_type, error, trace)
        return
    # The terminal comes first, because the disk of the log may be full.
    os.write(terminal, f"{error}\n".encode())
    with contextlib.suppress(OSError):
        print(error, file=sys.stderr, flush=True)
