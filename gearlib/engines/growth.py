"""Growth of a small deviation under the maps of mesh periods."""

import math

import numpy as np

from gearlib.engines.jit import kernel


@kernel
def carry(maps, weights, vector, logs):
    """Multiply a deviation, shape (n,), by maps, shape (k, n, n), and normalise it after each.

    The norm is that of weights * deviation, both of shape (n,). Fills `logs`, shape (k,), with the
    logarithms of the growth. Returns False if the deviation has vanished.
    """
    n = vector.shape[0]
    image = np.empty(n)
    for i in range(maps.shape[0]):
        total = 0.0
        for r in range(n):
            image[r] = 0.0
            for c in range(n):
                image[r] += maps[i, r, c] * vector[c]
            total += (weights[r] * image[r]) ** 2
        length = math.sqrt(total)
        if not length > 0.0:
            return False
        for r in range(n):
            vector[r] = image[r] / length
        logs[i] = math.log(length)
    return True
