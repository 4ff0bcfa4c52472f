"""Gear trains as the kernels see them: rank-one forces of meshes on a linear system.

With N coordinates q in static deflections and the time theta (reference frequency times time), the
state is z = (q, dq/dtheta, 1, cos, sin, ...), of n = 2 N + 1 + 2 h components: the constant and h
pairs of harmonics make loads, deviations and run-out part of the state. Between events z' = A z,
and every mesh in contact adds to A the outer products of where its forces push with what they are
made of:

    A = free + sum over meshes j, terms k of outer(push[j, d, k], grip[j, d, k])

with d the effect of the mesh, a small number for each contact and stiffness level (and sense of
friction) that it may have; effect 0 is the backlash and adds nothing.
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.engines.codes import BACKLASH, BOTH
from gearlib.engines.jit import kernel, uncounted, woven

#: Overlap of both flanks at a start, in shares of the terms of a distance, that is no rounding.
_JAM = 1e-13
#: A sum this small, as a share of its parts, is the rounding of zero.
REST = 1e-14


class TrainSystem(NamedTuple):
    """One train at one tuning: n components, m meshes, p segments, e effects of a mesh at most."""

    free: np.ndarray  #: dz/dtheta = free z while all meshes are in their backlash, shape (n, n)
    near: np.ndarray  #: functionals d_j, displacement over the drive-side flank, shape (m, n)
    far: np.ndarray  #: functionals over the coast-side flank, in contact where negative, (m, n)
    push: np.ndarray  #: dz/dtheta by a unit of each force, shape (m, e, 2, n)
    grip: np.ndarray  #: functionals of these forces, shape (m, e, 2, n); the second: friction
    effect: np.ndarray  #: int, effect by contact code + 1, segment and mesh, shape (3, p, m)
    stiffness: np.ndarray  #: over the mean of the reference mesh (0: as drive side), (3, p, m)
    low: np.ndarray  #: bool, whether at the lower level (0: as drive side), shape (3, p, m)
    starts: np.ndarray  #: phases tau of the reference mesh that bound segments, shape (p + 1,)
    first_segment: np.ndarray  #: where each reference mesh period begins, shape (repeats + 1,)
    longest: float  #: longest substep in theta: |A| theta <= REACH for every A, scaled
    harmonics: np.ndarray  #: frequencies of the harmonics by tau, shape (h,)
    tuning: float  #: dtau/dtheta
    repeats: int  #: reference mesh periods after which the excitation repeats
    first: int = 0  #: reference mesh period of the excitation in which runs begin


@uncounted
def matrix_of(system, effects, a):
    """Fill `a`, shape (n, n), with the matrix of a combination of effects, shape (m,)."""
    for r in range(a.shape[0]):
        for i in range(a.shape[0]):
            a[r, i] = system.free[r, i]
    for j in range(effects.shape[0]):
        for k in range(2):
            push, grip = system.push[j, effects[j], k], system.grip[j, effects[j], k]
            for r in range(push.shape[0]):
                if push[r] != 0.0:
                    for i in range(push.shape[0]):
                        a[r, i] += push[r] * grip[i]


@uncounted
def set_harmonics(frequencies, z, phase):
    """Put the constant and the harmonics of z, shape (n,), to their values at `phase`."""
    n, m = z.shape[0], frequencies.shape[0]
    z[n - 2 * m - 1] = 1.0
    for j in range(m):
        z[n - 2 * m + 2 * j] = math.cos(frequencies[j] * phase)
        z[n - 2 * m + 2 * j + 1] = math.sin(frequencies[j] * phase)


@kernel
def image(matrix, z):
    """Return matrix z: small ones are faster by hand than by a linear algebra library."""
    out = np.zeros(matrix.shape[0])
    for r in range(matrix.shape[0]):
        for c in range(matrix.shape[1]):
            out[r] += matrix[r, c] * z[c]
    return out


@uncounted
def dot(functional, z):
    """Return a functional, shape (n,) or longer, of z, shape (n,)."""
    total = 0.0
    for r in range(z.shape[0]):
        total += functional[r] * z[r]
    return total


@woven
def next_contact(contact, line):
    """Return the contact behind a flank line that a motion crosses, 1 drive, -1 coast side.

    A flank of its own it leaves; from the other one it would come into contact with `BOTH`.
    """
    if contact == line:
        return BACKLASH
    return BOTH if contact == -line else line


def may_close(near, far, one):
    """Return whether both flanks might touch at once: whether far - near can fall below zero.

    Both touch where near >= 0 >= far. Proven for all time if far - near, of shape (..., n), is a
    constant and harmonics that are smaller together; where coordinates, before the component `one`,
    move it, or the harmonics behind it might, the run has to tell.
    """
    rows = (far - near).real
    cosines, sines = rows[..., one + 1 :: 2], rows[..., one + 2 :: 2]
    most = np.hypot(cosines, sines).sum(axis=-1) * (1.0 + 1e-12)
    return rows[..., :one].any(axis=-1) | ((most > 0.0) & (rows[..., one] <= most))


@uncounted
def behind(far, z):
    """Return whether a state lies behind the coast-side line by more than rounding.

    z of shape (n,) or longer. Where the drive side touches, both do.
    """
    value, size = 0.0, 0.0
    for r in range(far.shape[0]):
        value += far[r] * z[r]
        size += abs(far[r] * z[r])
    return value < -_JAM * size
