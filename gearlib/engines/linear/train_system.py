"""Gear trains in the form that kernels take: a linear system with rank-one forces, and run storage.

With N coordinates q in static deflections and the time theta (reference frequency times time), the
state is z = (q, dq/dtheta, 1, cos, sin, ...), of n = 2 N + 1 + 2 h components: through the constant
and h pairs of harmonics, loads, deviations and run-out are part of the state. Between events z' = A
z, and each mesh in contact adds outer products to A: a force is a linear function of the state
(`force_output`), and it changes the derivative of the state along a vector (`force_input`):

    A = base_matrix + sum over j, k of outer(force_input[j, d, k], force_output[j, d, k])

for meshes j and forces k. The effect d of a mesh is a small number for each contact and stiffness
level (and sense of friction) that it may have; effect 0 is no contact and adds nothing.
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.engines.codes import BOTH, NO_CONTACT
from gearlib.engines.jit import inlined_without_refcounts, kernel, kernel_without_refcounts
from gearlib.engines.linear.modal_arcs import HIGH_DEGREE, MAX_COMBINATIONS
from gearlib.engines.linear.sparse_series import (
    combination_count,
    mode_cost_in_steps,
    nonzero_fields,
)
from gearlib.engines.polynomial import WORK_ROWS, bernstein_matrix

#: Largest overlap of both flanks that counts as rounding, relative to the terms of a distance.
_MAX_OVERLAP = 1e-13
#: Sums below this fraction of their terms count as zero.
ZERO_TOLERANCE = 1e-14


class TrainSystem(NamedTuple):
    """A train at one tuning: n components, m meshes, p segments, up to e effects of a mesh."""

    base_matrix: np.ndarray  #: A while no flanks touch, shape (n, n)
    drive_lines: np.ndarray  #: row vectors: distance from the drive-side line, contact > 0, (m, n)
    coast_lines: np.ndarray  #: row vectors: distance from the coast-side line, contact < 0, (m, n)
    force_input: np.ndarray  #: dz/dtheta for a unit of each force, shape (m, e, 2, n)
    force_output: np.ndarray  #: row vectors: mesh and friction force, shape (m, e, 2, n)
    effect: np.ndarray  #: int, effect by contact code + 1, segment and mesh, shape (3, p, m)
    stiffness: np.ndarray  #: over the mean of the reference mesh, (3, p, m); 0: same as drive side
    below_mean: np.ndarray  #: bool, whether the stiffness is at its lower level, shape (3, p, m)
    starts: np.ndarray  #: phases tau of the reference mesh that bound segments, shape (p + 1,)
    first_segment: np.ndarray  #: first segment of each reference mesh period, shape (repeats + 1,)
    max_step: float  #: longest step in theta: |A| theta <= matrices.MAX_NORM for every A
    harmonics: np.ndarray  #: frequencies of the harmonics by tau, shape (h,)
    tuning: float  #: dtau/dtheta
    repeats: int  #: reference mesh periods after which the excitation repeats
    first_period: int = 0  #: reference mesh period of the excitation in which runs begin


@kernel_without_refcounts
def fill_system_matrix(system, effects, matrix):
    """Fill `matrix`, shape (n, n), with the matrix A of the equation of motion z' = A z.

    `system` is the `TrainSystem`. `effects`, int, shape (m,), has a number for the contact and
    stiffness level of each mesh, 0 without contact. Each mesh adds the outer products of its two
    forces, mesh force and friction: of the vector by which a force acts and the vector from which
    it follows.
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

    They are its last components: 1, then cos(w * phase) and sin(w * phase) for each frequency w in
    `frequencies`, shape (h,), which is relative to the mesh frequency.
    """
    n, m = z.shape[0], frequencies.shape[0]
    z[n - 2 * m - 1] = 1.0
    for j in range(m):
        z[n - 2 * m + 2 * j] = math.cos(frequencies[j] * phase)
        z[n - 2 * m + 2 * j + 1] = math.sin(frequencies[j] * phase)


@kernel
def matrix_vector_product(matrix, z):
    """Return the product of a small matrix and the vector z, by plain loops.

    For small matrices they are faster than a call of a linear algebra library.
    """
    product = np.zeros(matrix.shape[0])
    for r in range(matrix.shape[0]):
        for i in range(matrix.shape[1]):
            product[r] += matrix[r, i] * z[i]
    return product


@kernel_without_refcounts
def dot(row_vector, z):
    """Return the scalar product of z, shape (n,), and the first n entries of a row vector."""
    total = 0.0
    for r in range(z.shape[0]):
        total += row_vector[r] * z[r]
    return total


@inlined_without_refcounts
def next_contact(contact, line):
    """Return the contact code of a mesh after it has crossed a flank line.

    `contact` is the code before: 1 drive-side contact, 0 no contact, -1 coast-side contact; `line`
    is 1 for the drive-side and -1 for the coast-side line, where the flanks just touch. A mesh in
    contact on this side loses contact, a mesh without contact comes into contact, and a mesh in
    contact on the other side touches on both sides, with the code BOTH.
    """
    if contact == line:
        return NO_CONTACT
    return BOTH if contact == -line else line


def flanks_may_overlap(drive_lines, coast_lines, constant_index):
    """Return whether both flanks of each mesh may touch at once, a bool array of shape (...).

    The lines, shape (..., n), are row vectors: a product with the state is the distance of a mesh
    from its drive-side or coast-side flank line. Both flanks touch if drive distance >= 0 >= coast
    distance. This is excluded if the clearance (coast less drive distance) does not depend on
    coordinates and is never negative: it has no harmonics, or its constant, at `constant_index`,
    exceeds the sum of the amplitudes of its harmonics, which follow it. Otherwise a run has to
    check it.
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

    A mesh that also touches on the drive side is then jammed. `coast_line`, shape (n,), is a row
    vector; its product with z, of shape (n,) or longer, is the distance from the line.
    """
    distance, magnitude = 0.0, 0.0
    for r in range(coast_line.shape[0]):
        distance += coast_line[r] * z[r]
        magnitude += abs(coast_line[r] * z[r])
    return distance < -_MAX_OVERLAP * magnitude


# Entries of `RunStorage.counters`: number of rows of the event table in use, mesh period, segment
# (-1 at the start of a period), numbers of events and samples of this period so far, first row of
# its events, and number of mesh periods that the segments of the system cover.
EVENT_ROWS, PERIOD, SEGMENT, PERIOD_EVENTS, SAMPLES_TAKEN, FIRST_EVENT_ROW, KNOWN_PERIODS = range(7)
#: Largest relative difference between lengths of segments that counts as rounding.
_SAME_LENGTH_TOLERANCE = 1e-13


class RunConstants(NamedTuple):
    """Constants derived from a `TrainSystem`: p segments, m meshes, n state components."""

    lengths: np.ndarray  #: durations of the segments in theta, shape (p,)
    length_index: np.ndarray  #: int, index among different lengths, -1: occurs once, shape (p,)
    drive_rates: np.ndarray  #: row vectors: derivatives of `drive_lines` by theta, shape (m, n)
    coast_rates: np.ndarray  #: row vectors: derivatives of `coast_lines` by theta, shape (m, n)
    no_coast_side: np.ndarray  #: bool, whether a mesh has no coast side, shape (m,)
    may_jam: np.ndarray  #: bool, whether both flanks may touch at once, shape (m,)
    constant_gap: np.ndarray  #: bool, whether the backlash is constant, shape (m,)
    has_backlash: np.ndarray  #: bool, whether the backlash is not zero, shape (m,)
    harmonic_frequencies: np.ndarray  #: frequencies of the harmonics by theta, shape (h,)
    summary_blocks: np.ndarray  #: int, block of the summary of each mesh period, shape (repeats,)
    sample_starts: np.ndarray  #: int, first sample of each period, shape (repeats + 1,) or (0,)
    nonzero_columns: np.ndarray  #: int, columns of the nonzero entries of `base_matrix`, by rows
    nonzero_counts: np.ndarray  #: int, number of nonzero entries in each row, shape (n,)
    nonzero_values: np.ndarray  #: their values, by rows
    mesh_components: np.ndarray  #: int, components that a mesh depends on or acts on, by meshes
    mesh_component_counts: np.ndarray  #: int, number of these components, shape (m,)
    chirp_frequencies: np.ndarray  #: frequencies by tau of harmonics at changing speed, shape (h,)
    speed_component: int  #: index of the state component dtau/dtheta at changing speed


class RunStorage(NamedTuple):
    """State and storage of a run: m meshes, n components, padded to a multiple of eight."""

    contact: np.ndarray  #: int, contact codes, shape (m,)
    zero_order: np.ndarray  #: int, 0: off the lines; k: on one, first k derivatives zero, (m,)
    start_line: np.ndarray  #: int, line of `zero_order`: 1 drive side, -1 coast side, shape (m,)
    effects: np.ndarray  #: int, effects of the meshes, shape (m,)
    stays_off: np.ndarray  #: bool, whether a mesh provably reaches no flank line, shape (m,)
    event_instant: np.ndarray  #: instant of the next event, as a fraction of a piece, shape (m,)
    contact_after: np.ndarray  #: int, contact code after the next event, shape (m,)
    instant_rounding: np.ndarray  #: rounding error of `event_instant`, shape (m,)
    state: np.ndarray  #: z, padded
    modal_state: np.ndarray  #: y, the state in modes, padded
    mode_buffer: np.ndarray  #: y at a later time in `sample_motion`, or a perturbation in modes
    sampled_modes: np.ndarray  #: y at a sample
    sampled_state: np.ndarray  #: z at a sample
    term: np.ndarray  #: term of a power series
    image: np.ndarray  #: next term of a power series
    mode_factors: np.ndarray  #: factors by which modes change, see `fill_mode_factors`
    amplitudes: np.ndarray  #: magnitudes of the modes in y, shape (n,)
    counters: (
        np.ndarray
    )  #: int, progress of the run, entries EVENT_ROWS to KNOWN_PERIODS, shape (7,)
    progress: np.ndarray  #: theta until the end of the segment, phase of the previous event
    curve: np.ndarray  #: Bernstein coefficients of a distance, shape (degree + 1,)
    search: np.ndarray  #: Bernstein coefficients and widths of intervals, see `polynomial`
    series: np.ndarray  #: Taylor series of the state, shape (degree + 1, padded)
    distance_series: (
        np.ndarray
    )  #: Taylor series of coast- and drive-side distances, (2, m, degree + 2)
    to_bernstein: np.ndarray  #: matrix from powers to Bernstein coefficients, (degree + 1,) * 2


def run_constants(system: TrainSystem) -> RunConstants:
    """Return the `RunConstants` of a `TrainSystem`: durations of segments, mesh flags, and more.

    The clearance is the distance between the two flank lines of a mesh, which is the backlash.
    """
    lengths = np.diff(system.starts) / system.tuning
    # Lengths that differ only by rounding get the same index.
    order = np.argsort(lengths, kind="stable")
    tolerances = _SAME_LENGTH_TOLERANCE * lengths[order][1:]
    is_new = np.concatenate([[True], np.diff(lengths[order]) > tolerances])
    length_index = np.empty(lengths.size, np.int64)
    length_index[order] = np.cumsum(is_new) - 1
    # Index of the constant 1 in the state; pairs of harmonics follow it.
    constant = system.base_matrix.shape[0] - 1 - 2 * system.harmonics.size
    no_coast_side = ~system.coast_lines[:, :constant].any(axis=1)
    clearance = system.coast_lines - system.drive_lines
    constant_gap = ~(clearance[:, :constant].any(axis=1) | clearance[:, constant + 1 :].any(axis=1))
    return RunConstants(
        lengths=lengths[order][is_new][length_index],
        length_index=length_index,
        drive_rates=system.drive_lines @ system.base_matrix,
        coast_rates=system.coast_lines @ system.base_matrix,
        no_coast_side=no_coast_side,
        may_jam=~no_coast_side
        & flanks_may_overlap(system.drive_lines, system.coast_lines, constant),
        constant_gap=constant_gap,
        has_backlash=~constant_gap | (clearance[:, constant] != 0.0),
        harmonic_frequencies=system.harmonics * system.tuning,
        # All mesh periods share a block of the summary and have equal numbers of samples.
        summary_blocks=np.zeros(len(system.first_segment) - 1, np.int64),
        sample_starts=np.empty(0, np.int64),
        chirp_frequencies=np.empty(0),
        speed_component=0,
        # The tables of modes may be too small for all combinations of contacts.
        **nonzero_fields(system, combination_count(system) > MAX_COMBINATIONS),
    )


def allocate_run_storage(n, padded, m, degree=HIGH_DEGREE, with_series=False):
    """Return an empty `RunStorage` for m meshes and n state components, stored as `padded` numbers.

    Flank distances are polynomials of `degree`. Storage for Taylor series is included if n is so
    large that they may cost less than modes, or if `with_series`.
    """
    has_series = with_series or mode_cost_in_steps(n) > 0
    integer_fields = "contact", "zero_order", "start_line", "effects", "contact_after"
    state_fields = "state", "modal_state", "mode_buffer", "sampled_modes", "sampled_state"
    counters = np.zeros(7, np.int64)
    # A run begins at the start of a mesh period.
    counters[SEGMENT] = -1
    return RunStorage(
        **{name: np.zeros(m, np.int64) for name in integer_fields},
        **{name: np.zeros(m) for name in ("event_instant", "instant_rounding")},
        **{name: np.zeros(padded) for name in (*state_fields, "term", "image")},
        **{name: np.zeros(n) for name in ("mode_factors", "amplitudes")},
        stays_off=np.zeros(m, np.bool_),
        counters=counters,
        progress=np.zeros(2),
        curve=np.zeros(degree + 1),
        search=np.zeros((WORK_ROWS, degree + 2)),
        series=np.zeros((degree + 1 if has_series else 0, padded)),
        distance_series=np.zeros((2, m, degree + 2 if has_series else 0)),
        to_bernstein=bernstein_matrix(degree if has_series else 0),
    )
