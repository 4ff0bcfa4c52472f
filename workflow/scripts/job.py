"""What all scripts do: read the datasets of a job and log its output."""

import contextlib
import os
import sys
import traceback
from pathlib import Path

import __main__
from gearlib.data import storage
from gearlib.data.files import declare_sources


def datasets(files):
    """Return input name -> dataset, or list of datasets, of the netCDF files among the inputs.

    `files` are the named inputs of a Snakemake job, paths or lists of paths.
    """
    return {
        name: storage.read(paths) if isinstance(paths, str) else [*map(storage.read, paths)]
        for name, paths in files.items()
        if "".join(paths).endswith(".nc")
    }


def source_files(path):
    """Return the files in the list of sources at `path`, which has their checksums first."""
    lines = Path(path).read_text(encoding="utf-8").splitlines()
    return [line.split("  ", 1)[1] for line in lines]


def redirect_output(path):
    """Redirect standard output and error of Python and compiled code to the log file `path`.

    The source files of the job are declared, because netCDF files store their hash.
    """
    declare_sources(source_files(__main__.snakemake.input.sources))
    sys.stdout.flush()
    sys.stderr.flush()
    terminal = os.dup(2)
    # Compiled libraries write to the file descriptors, not to sys.stdout.
    with open(path, "w", encoding="utf-8") as log:
        os.dup2(log.fileno(), 1)
        os.dup2(log.fileno(), 2)
    sys.excepthook = lambda *exception: _report_exception(terminal, *exception)


def _report_exception(terminal, exception_type, error, trace):
    """Write a traceback to the log, but none of Ctrl-C.

    Of an OSError only the message is written, also to the terminal.

    `terminal` is the file descriptor of the original standard error.
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
