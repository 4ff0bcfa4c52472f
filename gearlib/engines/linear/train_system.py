"""Gear trains as the kernels see them: rank-one forces of meshes on a linear system.

With N coordinates q in static deflections and the time theta (reference frequency times time), the
state is z = (q, dq/dtheta, 1, cos, sin, ...), of n = 2 N + 1 + 2 h components: the constant and h
pairs of harmonics make loads, deviations and run-out part of the state. Between events z' = A z,
and every mesh in contact adds outer products to A: a force is a functional of the state
(`force_output`), and it accelerates the state along a vector (`force_input`):

    A = base_matrix + sum over j, k of outer(force_input[j, d, k], force_output[j, d, k])

for meshes j and forces k. The effect d of a mesh is a small number for each contact and stiffness
level (and sense of friction) that it may have; effect 0 is no contact and adds nothing.
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.engines.codes import BOTH, NO_CONTACT
from gearlib.engines.jit import inlined_without_refcounts, kernel, kernel_without_refcounts

#: Largest overlap of both flanks that counts as rounding, relative to the terms of a distance.
_MAX_OVERLAP = 1e-13
#: Sums below this fraction of their terms count as zero.
ZERO_TOLERANCE = 1e-14


class TrainSystem(NamedTuple):
    """One train at one tuning: n components, m meshes, p segments, e effects of a mesh at most."""

    base_matrix: np.ndarray  #: A while no flanks touch, shape (n, n)
    drive_lines: np.ndarray  #: row vectors: displacement over the drive-side flank, shape (m, n)
    coast_lines: np.ndarray  #: row vectors: over the coast-side flank, contact where < 0, (m, n)
    force_input: np.ndarray  #: dz/dtheta for a unit of each force, shape (m, e, 2, n)
    force_output: np.ndarray  #: row vectors: mesh and friction force, shape (m, e, 2, n)
    effect: np.ndarray  #: int, effect by contact code + 1, segment and mesh, shape (3, p, m)
    stiffness: np.ndarray  #: over the mean of the reference mesh (0: as drive side), (3, p, m)
    below_mean: np.ndarray  #: bool, whether the stiffness is at its lower level, shape (3, p, m)
    starts: np.ndarray  #: phases tau of the reference mesh that bound segments, shape (p + 1,)
    first_segment: np.ndarray  #: where each reference mesh period begins, shape (repeats + 1,)
    max_step: float  #: longest step in theta: |A| theta <= exponential.MAX_NORM for every A
    harmonics: np.ndarray  #: frequencies of the harmonics by tau, shape (h,)
    tuning: float  #: dtau/dtheta
    repeats: int  #: reference mesh periods after which the excitation repeats
    first_period: int = 0  #: reference mesh period of the excitation in which runs begin


@kernel_without_refcounts
def fill_system_matrix(system, effects, matrix):
    """Fill `matrix`, (n, n), with A of z' = A z for a `TrainSystem` and the meshes' `effects`.

    `effects`, int, shape (m,), has the number of the contact effect of each mesh.
    """
    for r in range(matrix.shape[0]):
        for i in range(matrix.shape[0]):
            matrix[r, i] = system.base_matrix[r, i]
    for j in range(effects.shape[0]):
        for k in range(2):
            force_input = system.force_input[j, effects[j], k]
            force_output = system.force_output[j, effects[j], k]
            for r in range(force_input.shape[0]):
                if force_input[r] != 0.0:
                    for i in range(force_input.shape[0]):
                        matrix[r, i] += force_input[r] * force_output[i]


@kernel_without_refcounts
def set_harmonics(frequencies, z, phase):
    """Set the constant and the harmonics of the state z, shape (n,), at a mesh phase in rad.

    They are its last components: 1, then cos(w phase), sin(w phase) for each of the `frequencies`.
    """
    n, m = z.shape[0], frequencies.shape[0]
    z[n - 2 * m - 1] = 1.0
    for j in range(m):
        z[n - 2 * m + 2 * j] = math.cos(frequencies[j] * phase)
        z[n - 2 * m + 2 * j + 1] = math.sin(frequencies[j] * phase)


@kernel
def matrix_vector_product(matrix, z):
    """Return the product of a small matrix and the vector z, without a linear algebra library."""
    product = np.zeros(matrix.shape[0])
    for r in range(matrix.shape[0]):
        for i in range(matrix.shape[1]):
            product[r] += matrix[r, i] * z[i]
    return product


@kernel_without_refcounts
def dot(row_vector, z):
    """Return the scalar product of z, shape (n,), and a row vector, shape (n,) or longer."""
    total = 0.0
    for r in range(z.shape[0]):
        total += row_vector[r] * z[r]
    return total


@inlined_without_refcounts
def next_contact(contact, line):
    """Return the contact code of a mesh after it has crossed a flank line.

    `contact` is the code before: 1 drive-side contact, 0 contact loss, -1 coast-side contact;
    `line` is 1 for the drive side and -1 for the coast side. A mesh in contact there loses it; a
    mesh in contact on the other side would touch on `BOTH`.
    """
    if contact == line:
        return NO_CONTACT
    return BOTH if contact == -line else line


def flanks_may_overlap(drive_lines, coast_lines, constant_index):
    """Return whether both flanks of each mesh may touch at once, a bool array of shape (...).

    The lines, shape (..., n), are row vectors of the distances from the drive-side and the
    coast-side line; both flanks touch where drive distance >= 0 >= coast distance. Their clearance
    is provably positive if it contains no coordinates and its constant, at index `constant_index`,
    exceeds the amplitudes of the harmonics behind it. Otherwise the run has to check it.
    """
    clearance = (coast_lines - drive_lines).real
    cosines = clearance[..., constant_index + 1 :: 2]
    sines = clearance[..., constant_index + 2 :: 2]
    amplitudes = np.hypot(cosines, sines).sum(axis=-1) * (1.0 + 1e-12)
    return clearance[..., :constant_index].any(axis=-1) | (
        (amplitudes > 0.0) & (clearance[..., constant_index] <= amplitudes)
    )


@kernel_without_refcounts
def is_past_coast_line(coast_line, z):
    """Return whether the state z is beyond the coast-side flank line by more than rounding.

    A mesh that also touches on the drive side is then jammed. `coast_line`, shape (n,), is the row
    vector of the distance from the line; z has the shape (n,) or longer.
    """
    distance, magnitude = 0.0, 0.0
    for r in range(coast_line.shape[0]):
        distance += coast_line[r] * z[r]
        magnitude += abs(coast_line[r] * z[r])
    return distance < -_MAX_OVERLAP * magnitude
