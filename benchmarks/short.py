"""How often benchmarks call: as often as they say, or once, `make bench SHORT=1`."""

import os

SHORT = bool(os.environ.get("SHORT"))


def repeats(count):
    """Return how often to call what is timed `count` times."""
    return 1 if SHORT else count
