"""End the workflow with a sentence in place of a traceback."""

import sys

from snakemake.logging import logger

#: Exit status for wrong input, the same as that of the command `gearlib`.
WRONG_INPUT = 2


def interrupted(kind, error, trace):
    """Print a message for an interrupt before any job, else the traceback; for `sys.excepthook`."""
    if issubclass(kind, KeyboardInterrupt):
        print("Interrupted before any job.", file=sys.stderr)
    else:
        sys.__excepthook__(kind, error, trace)


def refuse(sentence):
    """Log an error message and exit; an exception would make Snakemake print a traceback."""
    logger.error(str(sentence))
    sys.exit(WRONG_INPUT)
