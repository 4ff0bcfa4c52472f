"""What the piecewise-linear models share: harmonics as components, an absent flank, substeps.

See `gearlib.kernels.piecewise_linear.system` for the form of these models.
"""

import numpy as np

from gearlib.kernels.piecewise_linear.system import REACH, Part, exponential


def waves(n, first, frequencies):
    """Return the matrix, shape (n, n), that turns cosine-sine pairs from component `first` on."""
    a = np.zeros((n, n), np.asarray(frequencies).dtype)
    for j, frequency in enumerate(frequencies):
        c = first + 2 * j
        a[c, c + 1], a[c + 1, c] = -frequency, frequency
    return a


def never(n, one):
    """Return the functional of a flank that is not there: the constant 1, component `one`."""
    functional = np.zeros(n)
    functional[one] = 1.0
    return functional


def substeps(a, starts, m, one, frequency):
    """Return the number of substeps of every segment, by the norm of its matrices.

    The norm is that of scaled components: velocities over a natural frequency; constants and
    harmonics, whose columns drive and never feed back, by their own frequencies.
    """
    a, starts = a.real, starts.real
    scale = np.ones(a.shape[2])
    scale[m : 2 * m] = frequency.real
    scaled = a * scale[None, :] / scale[:, None]
    driven = np.linalg.norm(scaled[..., : 2 * m, : 2 * m], 2, axis=(2, 3))
    waves = np.abs(a[..., one:, one:]).max(axis=(2, 3), initial=0.0)
    norms = np.maximum(driven, waves).max(axis=0)
    return np.maximum(np.ceil(norms * np.diff(starts) / REACH), 1.0).astype(np.int64)


def contact_map(model, pieces):
    """Return the map of deviations over pieces of constant contact; see `Model.reduction`.

    `pieces` are (matrix, length of a substep, number of substeps).
    """
    n = model.size
    matrix = np.eye(n)
    for a, length, substeps in pieces:
        one = exponential(a, n, length)
        matrix = np.linalg.matrix_power(one, int(substeps)) @ matrix
    reduce, lift = model.reduction()
    return reduce @ matrix @ lift


def undivided(system):
    """Return the `Part` of a system that is all of it."""
    n = system.near.size
    nothing = np.zeros((0, n))
    return Part(system, np.eye(n), np.eye(n), np.zeros((0, 0)), nothing, np.zeros((n, 0)))
