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

from typing import NamedTuple

import numpy as np

from gearlib.kernels.arrays import copy_rows
from gearlib.kernels.jit import kernel


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


@kernel
def matrix_of(system, effects, a):
    """Fill `a`, shape (n, n), with the matrix of a combination of effects, shape (m,)."""
    copy_rows(system.free, a)
    for j in range(effects.shape[0]):
        for k in range(2):
            push, grip = system.push[j, effects[j], k], system.grip[j, effects[j], k]
            for r in range(push.shape[0]):
                if push[r] != 0.0:
                    for i in range(push.shape[0]):
                        a[r, i] += push[r] * grip[i]
