"""Define what all scripts need: read the datasets of a job and log its output."""

import contextlib
import os
import sys
import traceback
from pathlib import Path

import __main__
from gearlib.data import storage
from gearlib.data.files import set_source_files


def read_datasets(files):
    """Read the netCDF files among the inputs of a job; return name -> dataset or list of datasets.

    `files` are the named inputs of a Snakemake job, which are paths or lists of paths.
    """
    return {
        name: storage.read(paths) if isinstance(paths, str) else [*map(storage.read, paths)]
        for name, paths in files.items()
        if "".join(paths).endswith(".nc")
    }


def read_source_files(path):
    """Read the paths of source files from the list at `path`, which also has checksums."""
    lines = Path(path).read_text(encoding="utf-8").splitlines()
    return [line.split("  ", 1)[1] for line in lines]


def redirect_output(path):
    """Redirect standard output and error of Python and compiled code to the log file `path`.

    Also declare the source files of the job, because netCDF files contain their hash.
    """
    set_source_files(read_source_files(__main__.snakemake.input.sources))
    sys.stdout.flush()
    sys.stderr.flush()
    terminal = os.dup(2)
    # Compiled libraries write to file descriptors instead of sys.stdout.
    with open(path, "w", encoding="utf-8") as log:
        os.dup2(log.fileno(), 1)
        os.dup2(log.fileno(), 2)
    sys.excepthook = lambda *exception: _report_exception(terminal, *exception)


def _report_exception(terminal, exception_type, error, trace):
    """Write the traceback of an exception to the log, except after Ctrl-C.

    For an OSError, e.g. because of a full disk, only the message is written, both to the log and to
    `terminal`, the file descriptor of the original standard error.
    """
    if issubclass(exception_type, KeyboardInterrupt):
        return
    if not issubclass(exception_type, OSError):
        traceback.print_exception(exception_type, error, trace)
        return
    # The terminal comes first, because the disk of the log may be full.
    os.write(terminal, f"{error}\n".encode())
    with contextlib.suppress(OSError):
        print(error, file=sys.stderr, flush=True)
