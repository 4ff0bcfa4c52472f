"""Growth of a small perturbation from a motion under the maps of mesh periods."""

import math

import numpy as np

from gearlib.engines.jit import kernel


@kernel
def propagate_perturbation(maps, weights, perturbation, log_growths):
    """Multiply a perturbation, (n,), in place by k period maps, (k, n, n), normalising after each.

    The norm is the Euclidean norm of weights * perturbation, both of shape (n,). Fills
    `log_growths`, shape (k,), with its logarithm after each map. Returns False if the perturbation
    vanishes.
    """
    n = perturbation.shape[0]
    image = np.empty(n)
    for k in range(maps.shape[0]):
        squared_norm = 0.0
        for i in range(n):
            image[i] = 0.0
            for j in range(n):
                image[i] += maps[k, i, j] * perturbation[j]
            squared_norm += (weights[i] * image[i]) ** 2
        norm = math.sqrt(squared_norm)
        if not norm > 0.0:
            return False
        for i in range(n):
            perturbation[i] = image[i] / norm
        log_growths[k] = math.log(norm)
    return True
