"""Arrays of the numbers that a caller gives."""

import numpy as np


def stretches(where):
    """Return (first, last) of every stretch of places in which `where`, shape (n,), holds."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(where, np.int8), [0]])))
    return [(int(i), int(j) - 1) for i, j in zip(edges[::2], edges[1::2], strict=True)]


def floats(given):
    """Return an array of float of the same shape; of shape (0,) where it cannot be one."""
    try:
        return np.asarray(given, float)
    except (TypeError, ValueError):
        return np.empty(0)
