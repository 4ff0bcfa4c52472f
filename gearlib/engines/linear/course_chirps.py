"""Run-out and deviations of piecewise-linear models while the speed changes: chirps."""

import numpy as np


def chirped(system, twice, size):
    """Return a system in whose harmonics the phase is quadratic in theta.

    Behind the coordinates and rates comes dtau/dtheta, and cosine, sine and their rates by theta of
    each harmonic: what damping makes of these is no matter of the speed then. It is what `twice`,
    the system of tuning 2, has more than that of tuning 1. The rates of the rates are those of
    `sparse_series`.
    """
    h = system.harmonics.size
    wide = size + 2 + 4 * h
    places = [size + 1 + 4 * j for j in range(h)]

    def moved(array, other):
        found = np.zeros((*array.shape[:-1], wide))
        found[..., :size], found[..., -1] = array[..., :size], array[..., size]
        for j, (i, w) in enumerate(zip(places, system.harmonics, strict=True)):
            cosine, sine = (size + 1 + 2 * j + k for k in range(2))
            rate = other - array
            found[..., i] = array[..., cosine] - rate[..., cosine]
            found[..., i + 1] = array[..., sine] - rate[..., sine]
            found[..., i + 2], found[..., i + 3] = -rate[..., sine] / w, rate[..., cosine] / w
        return found

    names = "near", "far", "push", "grip"
    lines = {name: moved(getattr(system, name), getattr(twice, name)) for name in names}
    free = np.zeros((wide, wide))
    free[:size] = moved(system.free[:size], twice.free[:size])
    for i in places:
        free[i, i + 2] = free[i + 1, i + 3] = 1.0
    return system._replace(free=free, harmonics=np.empty(0), **lines)
