"""End the workflow with a sentence in place of a traceback."""

import sys

from snakemake.logging import logger

#: Exit status for wrong input, the same as that of the command `gearlib`.
WRONG_INPUT = 2


def interrupted(kind, error, trace):
    """Print that Snakemake was interrupted before any job; for `sys.excepthook`."""
    if issubclass(kind, KeyboardInterrupt):
        print("Interrupted before any job.", file=sys.stderr)
    else:
        sys.__excepthook__(kind, error, trace)


def refuse(sentence):
    """Print a sentence and end Snakemake, which would print a traceback of an exception."""
    logger.error(str(sentence))
    sys.exit(WRONG_INPUT)
