"""What a caller gives as numbers, as an array."""

import numpy as np


def floats(given):
    """Return an array of float of the same shape; of shape (0,) where it cannot be one."""
    try:
        return np.asarray(given, float)
    except (TypeError, ValueError):
        return np.empty(0)
