"""Check of states that are too large for floating-point numbers."""

import math

from gearlib.engines.jit import kernel


@kernel
def within_range(x, v):
    """Return whether displacement and velocity are finite and small enough to be squared."""
    return math.fabs(x) < 1e150 and math.fabs(v) < 1e150
