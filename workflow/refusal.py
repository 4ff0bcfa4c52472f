"""How the workflow ends where nothing can be done: with a sentence, and not where Python was."""

import sys

from snakemake.logging import logger

#: As the commands of the library have it for wrong input.
WRONG_INPUT = 2


def interrupted(kind, error, trace):
    """Print that Snakemake was interrupted while it planned; as `sys.excepthook`."""
    if issubclass(kind, KeyboardInterrupt):
        print("Interrupted before any job.", file=sys.stderr)
    else:
        sys.__excepthook__(kind, error, trace)


def refuse(words):
    """Print why, and end Snakemake; an error would be printed with the lines that raised it."""
    logger.error(str(words))
    sys.exit(WRONG_INPUT)
