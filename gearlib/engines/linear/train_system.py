"""Gear trains as the kernels see them: rank-one forces on a linear system, and storage of a run.

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
    max_step: float  #: longest step in theta: |A| theta <= matrices.MAX_NORM for every A
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


# Entries of `RunStorage.counters`: rows in use of the event table, mesh period, segment (-1: at the
# start of a period), events and samples of this period so far, first row of its events, and the
# number of mesh periods that the segments of the system last for.
EVENT_ROWS, PERIOD, SEGMENT, PERIOD_EVENTS, SAMPLES_TAKEN, FIRST_EVENT_ROW, KNOWN_PERIODS = range(7)
#: Largest relative difference of lengths of segments that is rounding.
_SAME_LENGTH_TOLERANCE = 1e-13


class RunConstants(NamedTuple):
    """Quantities that the kernels need of a `TrainSystem`: p segments, m meshes, n components."""

    lengths: np.ndarray  #: theta of the segments, shape (p,)
    length_index: np.ndarray  #: int, number of that length, -1: it comes once, shape (p,)
    drive_rates: np.ndarray  #: row vectors: derivatives of `drive_lines` by theta, shape (m, n)
    coast_rates: np.ndarray  #: row vectors: derivatives of `coast_lines` by theta, shape (m, n)
    no_coast_side: np.ndarray  #: bool, whether a mesh has no coast side, shape (m,)
    may_jam: np.ndarray  #: bool, whether both of its flanks may touch at once, shape (m,)
    constant_gap: np.ndarray  #: bool, whether its flanks are a constant apart, shape (m,)
    has_backlash: np.ndarray  #: bool, whether there is a backlash between them, shape (m,)
    harmonic_frequencies: np.ndarray  #: frequencies of the harmonics by theta, shape (h,)
    summary_blocks: np.ndarray  #: int, block of the summary of each mesh period, shape (repeats,)
    sample_starts: np.ndarray  #: int, first sample of each period, shape (repeats + 1,) or (0,)
    nonzero_columns: np.ndarray  #: int, columns of the non-zeros of `base_matrix`, by rows
    nonzero_counts: np.ndarray  #: int, number of non-zeros in each row, shape (n,)
    nonzero_values: np.ndarray  #: their values, by rows
    mesh_components: np.ndarray  #: int, components that a mesh depends on or acts on, by meshes
    mesh_component_counts: np.ndarray  #: int, number of these components, shape (m,)
    chirp_frequencies: np.ndarray  #: by tau, of harmonics while the speed changes, shape (h,)
    speed_component: int  #: the component that is dtau/dtheta while the speed changes


class RunStorage(NamedTuple):
    """State and storage of a run: m meshes, n components, padded to a multiple of eight."""

    contact: np.ndarray  #: int, contact codes, shape (m,)
    zero_order: np.ndarray  #: int, 0: off the lines; k: on one, first k derivatives zero, (m,)
    start_line: np.ndarray  #: int, that line: 1 drive side, -1 coast side, shape (m,)
    effects: np.ndarray  #: int, effects of the meshes, shape (m,)
    stays_off: np.ndarray  #: bool, whether a mesh provably reaches no flank line, shape (m,)
    event_instant: np.ndarray  #: instant of the next event, as a fraction of a piece, shape (m,)
    contact_after: np.ndarray  #: int, contact code after that event, shape (m,)
    instant_rounding: np.ndarray  #: rounding error of `event_instant`, shape (m,)
    state: np.ndarray  #: z, padded
    modal_state: np.ndarray  #: y, the state in modes, padded
    mode_buffer: np.ndarray  #: copy of y that `sample_motion` moves on, or a deviation in modes
    sampled_modes: np.ndarray  #: y at a sample
    sampled_state: np.ndarray  #: z at a sample
    term: np.ndarray  #: storage of a series
    image: np.ndarray  #: storage of a series
    mode_factors: np.ndarray  #: factors of the modes over a time
    amplitudes: np.ndarray  #: magnitudes of the modes in y, shape (n,)
    counters: np.ndarray  #: int, progress of the run, by the names above, shape (7,)
    progress: np.ndarray  #: theta that remains of the segment, phase of the last event
    curve: np.ndarray  #: Bernstein coefficients of a distance, shape (degree + 1,)
    search: np.ndarray  #: Bernstein coefficients and widths of intervals, storage of `polynomial`
    series: np.ndarray  #: Taylor series of the state, shape (degree + 1, padded)
    distance_series: np.ndarray  #: of coast-side and drive-side distances, (2, m, degree + 2)
    to_bernstein: np.ndarray  #: matrix from powers to Bernstein coefficients, (degree + 1,) * 2


def run_constants(system: TrainSystem) -> RunConstants:
    """Return the `RunConstants` of a `TrainSystem`: lengths of segments, properties of meshes."""
    lengths = np.diff(system.starts) / system.tuning
    # Lengths that differ only by rounding get the same index.
    order = np.argsort(lengths, kind="stable")
    tolerances = _SAME_LENGTH_TOLERANCE * lengths[order][1:]
    is_new = np.concatenate([[True], np.diff(lengths[order]) > tolerances])
    length_index = np.empty(lengths.size, np.int64)
    length_index[order] = np.cumsum(is_new) - 1
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

    Distances are polynomials of `degree`. There is storage for Taylor series if n is so large that
    they may cost less than modes, or if `with_series`.
    """
    has_series = with_series or mode_cost_in_steps(n) > 0
    integers = "contact", "zero_order", "start_line", "effects", "contact_after"
    states = "state", "modal_state", "mode_buffer", "sampled_modes", "sampled_state"
    counters = np.zeros(7, np.int64)
    counters[SEGMENT] = -1
    return RunStorage(
        **{name: np.zeros(m, np.int64) for name in integers},
        **{name: np.zeros(m) for name in ("event_instant", "instant_rounding")},
        **{name: np.zeros(padded) for name in (*states, "term", "image")},
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
