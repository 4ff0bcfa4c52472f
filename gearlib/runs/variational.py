"""Maps of small deviations, as of `Model.propagator`, without the free rotation."""

import numpy as np


def rotation_free(pair):
    """Return the matrices (reduce, lift) between the state and the one without free rotation.

    Only the sum of the two rotations enters the mesh; their difference turns freely and would add
    two multipliers 1. Shapes (n - 2, n), (n, n - 2); identities where nothing turns freely.
    """
    n = pair.size
    if not pair.free_rotation:
        return np.eye(n), np.eye(n)
    # Rows u3 + u2, bearings, and their rates; lifted back with all of the sum in u3.
    lift = np.delete(np.eye(n), [1, n // 2 + 1], axis=1)
    reduce = lift.T.copy()
    reduce[0, 1] = reduce[n // 2 - 1, n // 2 + 1] = 1.0
    return reduce, lift


def without_rotation(pair, maps):
    """Return the maps without the free rotation, shape as of `rotation_free`."""
    reduce, lift = rotation_free(pair)
    return reduce @ maps @ lift
