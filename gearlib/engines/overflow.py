"""States that are too large for floating-point numbers, of all kinds of kernels."""

import math

from gearlib.engines.jit import kernel


@kernel
def within_range(x, v):
    """Return whether a state is finite with room for the squares that the kernels take."""
    return math.fabs(x) < 1e150 and math.fabs(v) < 1e150
