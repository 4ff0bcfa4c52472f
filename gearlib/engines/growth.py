"""Growth of a small deviation from a motion under the maps of mesh periods."""

import math

import numpy as np

from gearlib.engines.jit import kernel


@kernel
def propagate_deviation(maps, weights, deviation, log_growths):
    """Multiply a deviation, shape (n,), in place by maps, (k, n, n), and normalise it after each.

    The norm of a deviation is the Euclidean norm of weights * deviation, both of shape (n,). Fills
    `log_growths`, shape (k,), with the logarithm of the norm after each map. Returns False if the
    deviation vanishes.
    """
    n = deviation.shape[0]
    image = np.empty(n)
    for k in range(maps.shape[0]):
        squared_norm = 0.0
        for i in range(n):
            image[i] = 0.0
            for j in range(n):
                image[i] += maps[k, i, j] * deviation[j]
            squared_norm += (weights[i] * image[i]) ** 2
        norm = math.sqrt(squared_norm)
        if not norm > 0.0:
            return False
        for i in range(n):
            deviation[i] = image[i] / norm
        log_growths[k] = math.log(norm)
    return True
