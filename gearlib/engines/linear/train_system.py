"""Gear trains in the form that kernels take: a linear system, its constants and the state of a run.

With N coordinates q in units of the static deflection and the time theta (reference frequency times
time), the state is z = (q, dq/dtheta, 1, cos, sin, ...), of n = 2 N + 1 + 2 h components. The
constant and h pairs of harmonics make loads, deviations and run-out part of the state. Between
events z' = A z, and each mesh in contact adds outer products to A: a force is a linear function of
the state (`force_output`) and changes the derivative of the state along a vector (`force_input`):

    A = base_matrix + sum over j, k of outer(force_input[j, d, k], force_output[j, d, k])

for meshes j and their forces k (mesh force and friction). The force index d of a mesh depends on
its contact state, its stiffness level and the sense of friction; without contact d = 0, and the
force is zero.
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.engines.codes import BOTH, NO_CONTACT
from gearlib.engines.jit import kernel, kernel_part
from gearlib.engines.linear.modal_arcs import HIGH_DEGREE, MAX_COMBINATIONS
from gearlib.engines.linear.sparse_series import (
    combination_count,
    mode_cost_in_steps,
    nonzero_fields,
)
from gearlib.engines.polynomial import WORKSPACE_ROWS, bernstein_matrix

#: Largest overlap of both flanks that counts as rounding, relative to the terms of a distance.
_MAX_OVERLAP = 1e-13
#: Sums below this fraction of their terms count as zero.
ZERO_TOLERANCE = 1e-14


class TrainSystem(NamedTuple):
    """Linear system of a gear train at one tuning.

    A state z has n components. There are m meshes, p segments of constant stiffness, and up to e
    contact forces per mesh. The product of a distance row and z is the distance of a mesh from a
    flank line. Without contact, `stiffness` and `below_mean` have the values of the drive side.
    """

    base_matrix: np.ndarray  #: A while no flanks touch, shape (n, n)
    drive_distance_rows: np.ndarray  #: distance from the drive-side line, > 0 in contact, (m, n)
    coast_distance_rows: np.ndarray  #: distance from the coast-side line, < 0 in contact, (m, n)
    force_input: np.ndarray  #: dz/dtheta due to a unit of each force, shape (m, e, 2, n)
    force_output: np.ndarray  #: row vectors of mesh force and friction force, (m, e, 2, n)
    force_index: np.ndarray  #: int, index d by contact state + 1, segment, mesh, shape (3, p, m)
    stiffness: np.ndarray  #: over the mean of the reference mesh, shape (3, p, m)
    below_mean: np.ndarray  #: bool, whether the stiffness is at its lower level, shape (3, p, m)
    starts: np.ndarray  #: phases tau of the reference mesh that bound segments, shape (p + 1,)
    first_segment: np.ndarray  #: first segment of each mesh period, (excitation_period + 1,)
    max_step: float  #: longest step in theta: |A| theta <= matrices.MAX_NORM for every A
    harmonics: np.ndarray  #: frequencies of the harmonics by tau, shape (h,)
    tuning: float  #: dtau/dtheta
    excitation_period: int  #: reference mesh periods after which the excitation repeats
    first_period: int = 0  #: reference mesh period of the excitation in which runs begin


def system_matrix(system, force_indices):
    """Return the state matrix A of the equation of motion z' = A z, shape (n, n).

    `system` is the `TrainSystem`, and `force_indices`, int, shape (m,), holds the force index of
    each mesh, 0 without contact. Each mesh adds the outer products of its two forces, the mesh
    force and the friction.
    """
    meshes, n = np.arange(len(force_indices)), len(system.base_matrix)
    force_input = system.force_input[meshes, force_indices].reshape(-1, n)
    force_output = system.force_output[meshes, force_indices].reshape(-1, n)
    return system.base_matrix + force_input.T @ force_output


@kernel(refcounts=False)
def set_harmonics(frequencies, z, phase):
    """Set the constant and the harmonics in the state z, shape (n,), for a mesh phase in rad.

    The last components of the state are 1, then cos(w * phase) and sin(w * phase) for each
    frequency w in `frequencies`, shape (h,). A frequency is a multiple of the mesh frequency.
    """
    n, count = z.shape[0], frequencies.shape[0]
    z[n - 2 * count - 1] = 1.0
    for j in range(count):
        z[n - 2 * count + 2 * j] = math.cos(frequencies[j] * phase)
        z[n - 2 * count + 2 * j + 1] = math.sin(frequencies[j] * phase)


@kernel_part(refcounts=False)
def dot(row_vector, z):
    """Return the scalar product of z, shape (n,), and the first n entries of a row vector."""
    total = 0.0
    for r in range(z.shape[0]):
        total += row_vector[r] * z[r]
    return total


@kernel_part(refcounts=False, inlined=True)
def next_contact(contact, line):
    """Return the contact state of a mesh after it has crossed a flank line.

    `contact` is the contact state before the crossing: DRIVE 1, NO_CONTACT 0 or COAST -1. `line` is
    DRIVE or COAST, the side of the flank line (the displacement at which the flanks just touch). A
    mesh in contact on this side loses contact. A mesh without contact gains contact. A mesh in
    contact on the other side is then in contact on both sides, which is the state BOTH.
    """
    if contact == line:
        return NO_CONTACT
    return BOTH if contact == -line else line


def flanks_may_overlap(drive_distance_rows, coast_distance_rows, constant_index):
    """Return a mask of the meshes whose flanks may touch on both sides at once, shape (...).

    The arguments `drive_distance_rows` and `coast_distance_rows`, shape (..., n), are row vectors.
    Their products with the state are the distances of a mesh from its drive-side and its coast-side
    flank line. Both sides touch if drive distance >= 0 >= coast distance. This is impossible if the
    clearance, the coast distance minus the drive distance, does not depend on the coordinates and
    is never negative: it has no harmonics, or its constant part, at index `constant_index`, exceeds
    the sum of the amplitudes of the harmonics that follow it.
    """
    clearance = (coast_distance_rows - drive_distance_rows).real
    cosines = clearance[..., constant_index + 1 :: 2]
    sines = clearance[..., constant_index + 2 :: 2]
    amplitudes = np.hypot(cosines, sines).sum(axis=-1) * (1.0 + 1e-12)
    return clearance[..., :constant_index].any(axis=-1) | (
        (amplitudes > 0.0) & (clearance[..., constant_index] <= amplitudes)
    )


@kernel_part(refcounts=False)
def is_past_coast_line(distance_row, z):
    """Return whether the state z lies beyond the coast-side flank line by more than rounding.

    A mesh that also touches on the drive side is then jammed. The product of the row vector
    `distance_row`, shape (n,), and z, of shape (n,) or longer, is the distance from the flank line.
    """
    distance, magnitude = 0.0, 0.0
    for r in range(distance_row.shape[0]):
        distance += distance_row[r] * z[r]
        magnitude += abs(distance_row[r] * z[r])
    return distance < -_MAX_OVERLAP * magnitude


# Entries of `RunState.counters`: number of rows of the event table in use, mesh period, segment
# (-1 at the start of a period), number of events in this period, number of samples taken in this
# period, row of its first event, and number of mesh periods that the segments of the system cover.
EVENT_ROWS, PERIOD, SEGMENT, PERIOD_EVENTS = range(4)
SAMPLES_TAKEN, FIRST_EVENT_ROW, COVERED_PERIODS = range(4, 7)
#: Largest relative difference between lengths of segments that counts as rounding.
_SAME_LENGTH_TOLERANCE = 1e-13


class RunConstants(NamedTuple):
    """Constants derived from a `TrainSystem` with p segments, m meshes and n state components."""

    lengths: np.ndarray  #: durations of the segments in theta, shape (p,)
    length_index: np.ndarray  #: int, index of the length among all distinct lengths, or -1, (p,)
    drive_velocity_rows: np.ndarray  #: row vectors of d(drive distance)/dtheta, (m, n)
    coast_velocity_rows: np.ndarray  #: row vectors of d(coast distance)/dtheta, (m, n)
    no_coast_side: np.ndarray  #: bool, whether a mesh has no coast side, shape (m,)
    may_jam: np.ndarray  #: bool, whether both flanks may touch at once, shape (m,)
    constant_gap: np.ndarray  #: bool, whether the backlash is constant, shape (m,)
    has_backlash: np.ndarray  #: bool, whether the backlash is not zero, shape (m,)
    harmonic_frequencies: np.ndarray  #: frequencies of the harmonics by theta, shape (h,)
    summary_blocks: np.ndarray  #: int, summary block of each mesh period, (excitation_period,)
    sample_starts: np.ndarray  #: int, first sample of each period, (excitation_period + 1,) or (0,)
    nonzero_columns: np.ndarray  #: int, columns of the nonzero entries of each row of `base_matrix`
    nonzero_counts: np.ndarray  #: int, number of nonzero entries of each row, shape (n,)
    nonzero_values: np.ndarray  #: values of the nonzero entries of each row
    mesh_components: np.ndarray  #: int, state components that each mesh depends on or acts on
    mesh_component_counts: np.ndarray  #: int, number of these components, shape (m,)
    chirp_frequencies: np.ndarray  #: frequencies by tau of harmonics at variable speed, shape (h,)
    speed_component: int  #: index of the state component dtau/dtheta at variable speed


class RunState(NamedTuple):
    """State of a run with m meshes, and the arrays that its kernels overwrite.

    A state has n components, padded to a multiple of eight.
    """

    contact: np.ndarray  #: int, contact states, shape (m,)
    zero_order: np.ndarray  #: int, k if the distance and k - 1 derivatives are zero, shape (m,)
    start_line: np.ndarray  #: int, side of the flank line of `zero_order`, 1 or -1, shape (m,)
    force_indices: np.ndarray  #: int, force index of each mesh, shape (m,)
    stays_clear: np.ndarray  #: bool, whether a mesh provably reaches no flank line, shape (m,)
    event_instant: np.ndarray  #: instant of the next event, as a fraction of an interval, (m,)
    contact_after: np.ndarray  #: int, contact state after the next event, shape (m,)
    instant_rounding: np.ndarray  #: rounding error of `event_instant`, shape (m,)
    state: np.ndarray  #: z, padded
    modal_state: np.ndarray  #: y, the state in modal coordinates, padded
    mode_buffer: np.ndarray  #: y during `sample_motion`, or a perturbation in modal coordinates
    sampled_modes: np.ndarray  #: y at a sample
    sampled_state: np.ndarray  #: z at a sample
    term: np.ndarray  #: term of a power series
    image: np.ndarray  #: next term of a power series
    mode_factors: np.ndarray  #: factors by which the modes change in a step
    amplitudes: np.ndarray  #: magnitudes of the modes in y, shape (n,)
    counters: np.ndarray  #: int, progress of the run: EVENT_ROWS to COVERED_PERIODS, shape (7,)
    progress: np.ndarray  #: theta up to the end of the segment, phase of the previous event
    polynomial: np.ndarray  #: Bernstein coefficients of a distance, shape (degree + 1,)
    search: np.ndarray  #: Bernstein coefficients and widths of intervals, see `polynomial`
    series: np.ndarray  #: Taylor series of the state, shape (degree + 1, padded)
    distance_series: np.ndarray  #: Taylor series of the flank distances, (2, m, degree + 2)
    to_bernstein: np.ndarray  #: `bernstein_matrix` of this degree


def run_constants(system: TrainSystem) -> RunConstants:
    """Return the `RunConstants` of a `TrainSystem`."""
    lengths = np.diff(system.starts) / system.tuning
    # Lengths that differ only by rounding get the same index.
    order = np.argsort(lengths, kind="stable")
    tolerances = _SAME_LENGTH_TOLERANCE * lengths[order][1:]
    is_new = np.concatenate([[True], np.diff(lengths[order]) > tolerances])
    length_index = np.empty(lengths.size, np.int64)
    length_index[order] = np.cumsum(is_new) - 1
    # Index of the constant 1 in the state; pairs of harmonics follow it.
    constant = system.base_matrix.shape[0] - 1 - 2 * system.harmonics.size
    no_coast_side = ~system.coast_distance_rows[:, :constant].any(axis=1)
    # The clearance is the distance between the flank lines of a mesh, which is its backlash.
    clearance = system.coast_distance_rows - system.drive_distance_rows
    constant_gap = ~(clearance[:, :constant].any(axis=1) | clearance[:, constant + 1 :].any(axis=1))
    return RunConstants(
        lengths=lengths[order][is_new][length_index],
        length_index=length_index,
        drive_velocity_rows=system.drive_distance_rows @ system.base_matrix,
        coast_velocity_rows=system.coast_distance_rows @ system.base_matrix,
        no_coast_side=no_coast_side,
        may_jam=~no_coast_side
        & flanks_may_overlap(system.drive_distance_rows, system.coast_distance_rows, constant),
        constant_gap=constant_gap,
        has_backlash=~constant_gap | (clearance[:, constant] != 0.0),
        harmonic_frequencies=system.harmonics * system.tuning,
        # All mesh periods share one summary block and have the same number of samples.
        summary_blocks=np.zeros(len(system.first_segment) - 1, np.int64),
        sample_starts=np.empty(0, np.int64),
        chirp_frequencies=np.empty(0),
        speed_component=0,
        # The tables of modes may be too small for all combinations of contacts.
        **nonzero_fields(system, combination_count(system) > MAX_COMBINATIONS),
    )


def allocate_run_state(n, padded, m, degree=HIGH_DEGREE, with_series=False):
    """Return an empty `RunState` for m meshes and n state components.

    States are padded to `padded` numbers. Distances from flank lines are polynomials of `degree`.
    Taylor series get arrays if `with_series`, or if n is so large that they may cost less than
    modes.
    """
    has_series = with_series or mode_cost_in_steps(n) > 0
    integer_fields = "contact", "zero_order", "start_line", "force_indices", "contact_after"
    state_fields = "state", "modal_state", "mode_buffer", "sampled_modes", "sampled_state"
    counters = np.zeros(7, np.int64)
    # A run begins at the start of a mesh period.
    counters[SEGMENT] = -1
    return RunState(
        **{name: np.zeros(m, np.int64) for name in integer_fields},
        **{name: np.zeros(m) for name in ("event_instant", "instant_rounding")},
        **{name: np.zeros(padded) for name in (*state_fields, "term", "image")},
        **{name: np.zeros(n) for name in ("mode_factors", "amplitudes")},
        stays_clear=np.zeros(m, np.bool_),
        counters=counters,
        progress=np.zeros(2),
        polynomial=np.zeros(degree + 1),
        search=np.zeros((WORKSPACE_ROWS, degree + 2)),
        series=np.zeros((degree + 1 if has_series else 0, padded)),
        distance_series=np.zeros((2, m, degree + 2 if has_series else 0)),
        to_bernstein=bernstein_matrix(degree if has_series else 0),
    )
