"""Growth of a small deviation that is carried along by maps of mesh periods."""

import math

import numpy as np

from gearlib.engines.jit import kernel


@kernel
def carry(maps, weights, vector, logs):
    """Carry a deviation, shape (n,), through maps, shape (k, n, n), and scale it after each.

    The length is that of weights * deviation, both of shape (n,). Fills `logs`, shape (k,), with
    the logarithms of the growth. Returns False where the deviation has vanished.
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
