"""Kernels of many coordinates: matrices, hash slots, modes, series, bounds and first events."""

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
M, N = SYSTEM.drive_distance_rows.shape
CODES = list(product((DRIVE, NO_CONTACT, COAST), repeat=M))


def problem(codes, scale=1.0):
    """Return (force_indices of the contacts, matrix A of z' = A z, state z, mode tables, storage).

    `codes` are the contacts of the meshes, and `scale` multiplies the state.
    """
    force_indices = SYSTEM.force_index[np.array(codes) + 1, SEGMENT, np.arange(M)]
    matrix, z = SYSTEM.base_matrix.copy(), np.zeros(N)
    for j, force_index in enumerate(force_indices):
        matrix += SYSTEM.force_input[j, force_index].T @ SYSTEM.force_output[j, force_index]
    z[: len(SETTLING)] = scale * np.array(SETTLING)
    train_system.set_harmonics(SYSTEM.harmonics, z, 0.7)
    tables = modal_arcs.allocate_modes(N, M, 1)
    add_modes(tables, SYSTEM, PROPAGATOR.frame, force_indices)
    run = allocate_run_state(
        N, tables.from_modes.shape[2], M, tables.distance_polynomials.shape[4] - 1, True
    )
    run.state[:N], run.contact[:], run.zero_order[:], run.stays_clear[:] = z, codes, 0, False
    modal_arcs.apply_stored_matrix(tables.to_modes, 0, run.state, run.modal_state)
    return force_indices, matrix, z, tables, run


def distances_along(matrix, z, times):
    """Return the distances from coast and drive lines at equally spaced times.

    The shape is (times, 2, meshes).
    """
    step, states = expm(times[1] * matrix), [z]
    for _ in times[1:]:
        states.append(step @ states[-1])
    return np.array(
        [[SYSTEM.coast_distance_rows @ z, SYSTEM.drive_distance_rows @ z] for z in states]
    )


@pytest.mark.parametrize("n", range(10))
def test_unrolled_sums_match_matrix_products(n):
    """Compare unrolled loops with products of numpy for vectors of length `n`."""
    rng, image = np.random.default_rng(n), np.empty(16)
    a, b, matrix = *rng.normal(size=(2, 10)), rng.normal(size=(n, 16))
    assert distances._partial_dot(a, b, n) == pytest.approx(a[:n] @ b[:n], abs=1e-14)
    assert train_system.dot(a, b[:n]) == pytest.approx(a[:n] @ b[:n], abs=1e-14)
    modal_arcs.fill_product(matrix, a[:n], image, 16)
    np.testing.assert_allclose(image, a[:n] @ matrix, atol=1e-13)


@pytest.mark.parametrize("codes", CODES)
def test_modes_and_series_match_the_matrix_exponential(codes):
    """Advance a state by 0.9 by modes, by series and by the matrix exponential of scipy."""
    force_indices, reference_matrix, z, tables, run = problem(codes)
    matrix = train_system.system_matrix(SYSTEM, force_indices)
    np.testing.assert_allclose(matrix, reference_matrix, atol=1e-15)
    phases = 0.7 * SYSTEM.harmonics
    assert z[N - 1 - 2 * phases.size :: 2] == pytest.approx([1.0, *np.sin(phases)])
    row = modal_arcs.find_segment_factors(tables, 0, 0, 0.9)
    assert modal_arcs.find_segment_factors(tables, 0, 0, 0.9) == row
    arguments = tables.segment_factors[row], 0.9, run.modal_state, run.term, run.image
    modal_arcs.advance_modes(tables, 0, *arguments)
    modal_arcs.apply_stored_matrix(tables.from_modes, 0, run.modal_state, run.sampled_state)
    final_state = expm(0.9 * matrix) @ z
    np.testing.assert_allclose(run.sampled_state[:N], final_state, rtol=0, atol=1e-11)
    sparse_series.advance_by_series(SYSTEM, CONSTANTS, force_indices, 0.9, z, run.series)
    np.testing.assert_allclose(z, final_state, rtol=0, atol=1e-11)


@pytest.mark.parametrize("codes", CODES)
def test_polynomials_of_distances_stay_within_their_bounds(codes):
    """Compare polynomials of distances with the motion, and check their claims about zeros."""
    force_indices, matrix, z, tables, run = problem(codes)
    unit = sparse_series.fill_taylor_series(SYSTEM, CONSTANTS, force_indices, z, run.series)
    sparse_series.fill_distance_series(SYSTEM, CONSTANTS, run.series, run.distance_series)
    count = distances.fill_amplitudes(tables, 0, run.modal_state, run.amplitudes)
    fractions = np.linspace(0.0, 1.0, 21)
    on_piece = distances_along(matrix, z, tables.interval_lengths[0] * fractions)
    in_unit = distances_along(matrix, z, unit * fractions)
    for j, side in product(range(M), range(2)):
        distances.fill_distance_polynomial(
            tables.distance_polynomials[0, side, j], run.modal_state, run.polynomial
        )
        curve = BPoly(run.polynomial[:, None], [0.0, 1.0])(fractions)
        np.testing.assert_allclose(curve, on_piece[:, side, j], rtol=0, atol=1e-11)
        terms, series = run.distance_series[side, j], in_unit[:, side, j]
        values = np.polyval(terms[-2::-1], fractions)
        np.testing.assert_allclose(values, series, rtol=0, atol=1e-11)
        sign, degree = math.copysign(1.0, terms[0]), terms.size - 2
        may_reach = sparse_series.series_may_reach_zero(terms, sign, degree)
        assert may_reach or (sign * series > 0.0).all()
        amplitude = distances.distance_amplitude(tables, 0, side, j, run, count)
        swing = np.abs(curve - tables.constant_distance[0, side, j]).max()
        assert swing <= amplitude or not tables.is_bounded[0, side, j]


def test_a_series_that_reaches_zero_is_never_excluded():
    # The curves are 0.5 - s + 0.6 s^2 and 0.5 - 0.3 s + 0.1 s^2, followed by a magnitude.
    curves = np.array([[0.5, -1.0, 0.6, 0.5], [0.5, -0.3, 0.1, 0.5]])
    assert [sparse_series.series_may_reach_zero(c, 1.0, 2) for c in curves] == [True, False]


def test_first_events_match_the_first_sign_changes():
    """Compare first events with sign changes of distances on a dense grid."""
    event_count, fractions = 0, np.linspace(0.0, 1.0, 1001)
    for scale in np.cos(np.linspace(0.0, math.pi, 13)):
        z = problem(CODES[0], scale)[2]
        drive, coast = SYSTEM.drive_distance_rows @ z, SYSTEM.coast_distance_rows @ z
        codes = np.where(drive > 0.0, DRIVE, np.where(coast < 0.0, COAST, NO_CONTACT))
        _, matrix, z, tables, run = problem(codes, scale)
        first_instant = distances.find_first_events(tables, 0, CONSTANTS, run, 1.0)
        count = distances.fill_amplitudes(tables, 0, run.modal_state, run.amplitudes)
        signs = np.sign(distances_along(matrix, z, tables.interval_lengths[0] * fractions))
        for j, code in enumerate(codes.tolist()):
            # Without contact both flank lines may be crossed, in contact only the line of that
            # side.
            sides = {DRIVE: [1], COAST: [0], NO_CONTACT: [0, 1]}[code]
            changed = np.flatnonzero((signs[:, sides, j] != signs[0, sides, j]).any(axis=1))
            if changed.size:
                event_count += 1
                assert changed[0] - 1 <= 1000.0 * run.event_instant[j] <= changed[0]
                assert not distances.stays_clear_of_lines(tables, 0, j, CONSTANTS, run, count)
            else:
                assert run.event_instant[j] > 1.0
        assert first_instant == run.event_instant.min()
    assert event_count > 5


def test_crossing_a_flank_line_changes_the_contact():
    """Check the contact after a crossing for each code and line (1 drive, -1 coast, 0 none)."""
    after = {(1, 1): 0, (0, 1): 1, (-1, 1): BOTH, (1, -1): BOTH, (0, -1): -1, (-1, -1): 0}
    for (code, line), code_after in after.items():
        assert train_system.next_contact(code, line) == code_after
    line, states = np.array([1.0, -2.0]), np.array([[2.0, 1.0], [2.0, 1.0 + 1e-12]])
    assert [train_system.is_past_coast_line(line, z) for z in states] == [False, True]


def test_every_combination_of_contacts_gets_its_own_hash_slot():
    """All 243 combinations of five contact states must be stored and found in separate slots."""
    keys, slots = np.array(list(product(range(3), repeat=5)), np.int8), np.full(512, -1)
    for row, key in enumerate(keys):
        slot = modal_arcs.find_slot(slots, keys, key.astype(np.int64))
        assert slots[slot] == -1
        slots[slot] = row
    stored_rows = [slots[modal_arcs.find_slot(slots, keys, key.astype(np.int64))] for key in keys]
    assert stored_rows == list(range(len(keys)))
