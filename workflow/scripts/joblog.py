"""The log of a job: everything that its process prints goes into one file."""

import os
import sys


def redirect_output(path):
    """Send standard output and standard error, of Python and of compiled code, to a file."""
    sys.stdout.flush()
    sys.stderr.flush()
    # Snakemake itself leaves the output of scripts on the terminal. The descriptors are
    # replaced, not sys.stdout: compiled libraries and the last traceback write to those.
    with open(path, "w", encoding="utf-8") as log:
        os.dup2(log.fileno(), 1)
        os.dup2(log.fileno(), 2)
