"""Check kernels of trains: matrices, hash slots, modes, series, bounds and first events."""

import math
from itertools import product

import numpy as np
import pytest
from scipy.interpolate import BPoly
from scipy.linalg import expm

from gearlib.engines.codes import BOTH, COAST, DRIVE, NO_CONTACT
from gearlib.engines.linear import distances, modal_arcs, sparse_series, train_system
from gearlib.engines.linear.modal_frame import add_modes
from gearlib.engines.linear.train_system import allocate_run_state, run_constants
from tests.properties.known_models import CHAIN, SETTLING

#: The hash of a combination overflows, which numpy reports if kernels are not compiled.
pytestmark = pytest.mark.filterwarnings("ignore:overflow encountered")

PROPAGATOR = CHAIN.propagator(0.8)
SYSTEM, SEGMENT = PROPAGATOR.system, 1
CONSTANTS = run_constants(SYSTEM)._replace(**sparse_series.nonzero_fields(SYSTEM, True))
MESH_COUNT, STATE_SIZE = SYSTEM.drive_distance_rows.shape
#: All combinations of the contact states of the meshes.
CONTACT_STATES = list(product((DRIVE, NO_CONTACT, COAST), repeat=MESH_COUNT))


def prepare_run(codes, scale=1.0):
    """Prepare a run of z' = A z for given contact states of the meshes.

    Return the indices of the mesh forces, the matrix A, the initial state z, the tables of modes
    and the storage of the run. `scale` is a factor on the coordinates and velocities in z.
    """
    force_indices = SYSTEM.force_index[np.array(codes) + 1, SEGMENT, np.arange(MESH_COUNT)]
    matrix, z = SYSTEM.base_matrix.copy(), np.zeros(STATE_SIZE)
    for j, force_index in enumerate(force_indices):
        matrix += SYSTEM.force_input[j, force_index].T @ SYSTEM.force_output[j, force_index]
    z[: len(SETTLING)] = scale * np.array(SETTLING)
    train_system.set_harmonics(SYSTEM.harmonics, z, 0.7)
    tables = modal_arcs.allocate_modes(STATE_SIZE, MESH_COUNT, 1)
    add_modes(tables, SYSTEM, PROPAGATOR.frame, force_indices)
    run = allocate_run_state(
        STATE_SIZE,
        tables.from_modes.shape[2],
        MESH_COUNT,
        tables.distance_polynomials.shape[4] - 1,
        True,
    )
    run.state[:STATE_SIZE], run.contact[:], run.zero_order[:], run.stays_clear[:] = (
        z,
        codes,
        0,
        False,
    )
    modal_arcs.apply_stored_matrix(tables.to_modes, 0, run.state, run.modal_state)
    return force_indices, matrix, z, tables, run


def flank_distances(matrix, z, times):
    """Return the distances from the coast and the drive flank lines at equally spaced times.

    The motion starts at the state `z` and follows z' = matrix z. The shape is (times, 2, meshes).
    """
    transition_matrix, states = expm(times[1] * matrix), [z]
    for _ in times[1:]:
        states.append(transition_matrix @ states[-1])
    return np.array(
        [[SYSTEM.coast_distance_rows @ z, SYSTEM.drive_distance_rows @ z] for z in states]
    )


@pytest.mark.parametrize("n", range(10))
def test_unrolled_sums_match_matrix_products(n):
    """Sums in unrolled loops must equal products of numpy for vectors of length `n`."""
    rng, column_count = np.random.default_rng(n), 16
    a, b, matrix = *rng.normal(size=(2, 10)), rng.normal(size=(n, column_count))
    assert distances._partial_dot(a, b, n) == pytest.approx(a[:n] @ b[:n], abs=1e-14)
    assert train_system.dot(a, b[:n]) == pytest.approx(a[:n] @ b[:n], abs=1e-14)
    result = np.empty(column_count)
    modal_arcs.fill_product(matrix, a[:n], result, column_count)
    np.testing.assert_allclose(result, a[:n] @ matrix, atol=1e-13)


@pytest.mark.parametrize("codes", CONTACT_STATES)
def test_modes_and_series_match_the_matrix_exponential(codes):
    """A state advanced by modes and by Taylor series must match the matrix exponential."""
    duration, phase = 0.9, 0.7
    force_indices, reference_matrix, z, tables, run = prepare_run(codes)
    matrix = train_system.system_matrix(SYSTEM, force_indices)
    np.testing.assert_allclose(matrix, reference_matrix, atol=1e-15)
    # The state ends with 1 and the cosine and sine of each harmonic of the phase.
    phases = phase * SYSTEM.harmonics
    assert z[STATE_SIZE - 1 - 2 * phases.size :: 2] == pytest.approx([1.0, *np.sin(phases)])
    row = modal_arcs.find_segment_factors(tables, 0, 0, duration)
    # The factors are stored, so that the same row is found again.
    assert modal_arcs.find_segment_factors(tables, 0, 0, duration) == row
    arguments = tables.segment_factors[row], duration, run.modal_state, run.term, run.image
    modal_arcs.advance_modes(tables, 0, *arguments)
    modal_arcs.apply_stored_matrix(tables.from_modes, 0, run.modal_state, run.sampled_state)
    final_state = expm(duration * matrix) @ z
    np.testing.assert_allclose(run.sampled_state[:STATE_SIZE], final_state, rtol=0, atol=1e-11)
    sparse_series.advance_by_series(SYSTEM, CONSTANTS, force_indices, duration, z, run.series)
    np.testing.assert_allclose(z, final_state, rtol=0, atol=1e-11)


@pytest.mark.parametrize("codes", CONTACT_STATES)
def test_polynomials_of_distances_stay_within_their_bounds(codes):
    """Polynomials of flank distances must match the motion, and their bounds must hold.

    A distance whose series excludes zeros must keep its sign, and a bounded distance must stay
    within its amplitude.
    """
    force_indices, matrix, z, tables, run = prepare_run(codes)
    series_duration = sparse_series.fill_taylor_series(
        SYSTEM, CONSTANTS, force_indices, z, run.series
    )
    sparse_series.fill_distance_series(SYSTEM, CONSTANTS, run.series, run.distance_series)
    count = distances.fill_amplitudes(tables, 0, run.modal_state, run.amplitudes)
    fractions = np.linspace(0.0, 1.0, 21)
    distances_in_interval = flank_distances(matrix, z, tables.interval_lengths[0] * fractions)
    distances_in_series = flank_distances(matrix, z, series_duration * fractions)
    for j, side in product(range(MESH_COUNT), range(2)):
        distances.fill_distance_polynomial(
            tables.distance_polynomials[0, side, j], run.modal_state, run.polynomial
        )
        values = BPoly(run.polynomial[:, None], [0.0, 1.0])(fractions)
        np.testing.assert_allclose(values, distances_in_interval[:, side, j], rtol=0, atol=1e-11)
        amplitude = distances.distance_amplitude(tables, 0, side, j, run, count)
        deviation = np.abs(values - tables.constant_distance[0, side, j]).max()
        assert deviation <= amplitude or not tables.is_bounded[0, side, j]
        # The terms of a series are followed by a magnitude.
        terms, expected = run.distance_series[side, j], distances_in_series[:, side, j]
        values = np.polyval(terms[-2::-1], fractions)
        np.testing.assert_allclose(values, expected, rtol=0, atol=1e-11)
        sign, degree = math.copysign(1.0, terms[0]), terms.size - 2
        may_reach_zero = sparse_series.series_may_reach_zero(terms, sign, degree)
        assert may_reach_zero or (sign * expected > 0.0).all()


def test_a_series_that_reaches_zero_is_never_excluded():
    # The curves are 0.5 - s + 0.6 s^2 and 0.5 - 0.3 s + 0.1 s^2. The fourth number is a magnitude.
    curves = np.array([[0.5, -1.0, 0.6, 0.5], [0.5, -0.3, 0.1, 0.5]])
    assert [sparse_series.series_may_reach_zero(curve, 1.0, 2) for curve in curves] == [True, False]


def test_first_events_match_the_first_sign_changes():
    """The first event of each mesh must be where a distance changes its sign on a dense grid."""
    event_count, grid_size = 0, 1001
    fractions = np.linspace(0.0, 1.0, grid_size)
    for scale in np.cos(np.linspace(0.0, math.pi, 13)):
        _, _, z, _, _ = prepare_run(CONTACT_STATES[0], scale)
        drive, coast = SYSTEM.drive_distance_rows @ z, SYSTEM.coast_distance_rows @ z
        codes = np.where(drive > 0.0, DRIVE, np.where(coast < 0.0, COAST, NO_CONTACT))
        _, matrix, z, tables, run = prepare_run(codes, scale)
        first_instant = distances.find_first_events(tables, 0, CONSTANTS, run, 1.0)
        count = distances.fill_amplitudes(tables, 0, run.modal_state, run.amplitudes)
        signs = np.sign(flank_distances(matrix, z, tables.interval_lengths[0] * fractions))
        for j, code in enumerate(codes.tolist()):
            # Without contact, either flank line may be crossed; in contact, only the line of this
            # side, 0 for coast and 1 for drive.
            sides = {DRIVE: [1], COAST: [0], NO_CONTACT: [0, 1]}[code]
            has_changed = (signs[:, sides, j] != signs[0, sides, j]).any(axis=1)
            if has_changed.any():
                event_count += 1
                first_change = int(np.argmax(has_changed))
                event_position = (grid_size - 1) * run.event_instant[j]
                assert first_change - 1 <= event_position <= first_change
                assert not distances.stays_clear_of_lines(tables, 0, j, CONSTANTS, run, count)
            else:
                assert run.event_instant[j] > 1.0
        assert first_instant == run.event_instant.min()
    assert event_count > 5


def test_crossing_a_flank_line_changes_the_contact():
    """Crossing a flank line must end its contact, establish it, or make both flanks touch."""
    contact_after = {
        (DRIVE, DRIVE): NO_CONTACT,
        (NO_CONTACT, DRIVE): DRIVE,
        (COAST, DRIVE): BOTH,
        (DRIVE, COAST): BOTH,
        (NO_CONTACT, COAST): COAST,
        (COAST, COAST): NO_CONTACT,
    }
    for (contact, crossed_line), expected in contact_after.items():
        assert train_system.next_contact(contact, crossed_line) == expected
    # A state is past the line if its distance, row @ state, is negative by more than rounding.
    distance_row, states = np.array([1.0, -2.0]), np.array([[2.0, 1.0], [2.0, 1.0 + 1e-12]])
    assert [train_system.is_past_coast_line(distance_row, z) for z in states] == [False, True]


def test_every_combination_of_contacts_gets_its_own_hash_slot():
    """All 243 combinations of five contact states must be stored and found in separate slots."""
    keys, slots = np.array(list(product(range(3), repeat=5)), np.int8), np.full(512, -1)
    for row, key in enumerate(keys):
        slot = modal_arcs.find_slot(slots, keys, key.astype(np.int64))
        assert slots[slot] == -1
        slots[slot] = row
    stored_rows = [slots[modal_arcs.find_slot(slots, keys, key.astype(np.int64))] for key in keys]
    assert stored_rows == list(range(len(keys)))
