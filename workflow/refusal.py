"""End the workflow with a sentence in place of a traceback."""

import difflib
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


def unknown_target(name, rules):
    """Return the error message for a target that is none of the workflow's `rules`."""
    names = [rule.name for rule in rules if not rule.name.startswith("_")]
    similar = difflib.get_close_matches(name, names, 1)
    advice = f"did you mean {similar[0]}?" if similar else "snakemake --list-rules names them"
    return f"target = {name!r} is not allowed: it must be one of the rules, {advice}"


def refuse(sentence):
    """Log an error message and exit; an exception would make Snakemake print a traceback."""
    logger.error(str(sentence))
    sys.exit(WRONG_INPUT)
