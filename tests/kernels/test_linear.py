"""Kernels of many coordinates: matrices, hash slots, modes, series, bounds and first events."""

import math
from itertools import product

import numpy as np
import pytest
from scipy.interpolate import BPoly
from scipy.linalg import expm

from gearlib.engines.codes import BACKLASH, BOTH, INVERSE, NORMAL
from gearlib.engines.linear import distances, modal_arcs, sparse_series, train_system
from gearlib.engines.linear.modal_frame import add_modes
from gearlib.engines.linear.run_storage import allocate_run_storage, run_constants
from tests.properties.known_models import CHAIN, SETTLING

TUNING, SEGMENT = 0.8, 1
PROPAGATOR = CHAIN.propagator(TUNING)
SYSTEM = PROPAGATOR.system
CONSTANTS = run_constants(SYSTEM)._replace(**sparse_series.nonzero_fields(SYSTEM, True))
M, N = SYSTEM.drive_lines.shape
CODES = list(product((NORMAL, BACKLASH, INVERSE), repeat=M))


def effects_of(codes):
    return SYSTEM.effect[np.array(codes) + 1, SEGMENT, np.arange(M)]


def matrix_of(effects):
    """Return A of z' = A z as the base matrix and the outer products of all forces."""
    matrix = SYSTEM.base_matrix.copy()
    for j, effect in enumerate(effects):
        matrix += SYSTEM.force_input[j, effect].T @ SYSTEM.force_output[j, effect]
    return matrix


def start():
    """Return a state z with the harmonics of phase 0.7."""
    z = np.append(SETTLING, np.zeros(N - len(SETTLING)))
    train_system.set_harmonics(SYSTEM.harmonics, z, 0.7)
    return z


def modes_of(codes):
    """Return (tables with the modes of these contacts, storage with the state in modes)."""
    tables = modal_arcs.allocate_modes(N, M, 1)
    add_modes(tables, SYSTEM, PROPAGATOR.frame, effects_of(codes))
    _, _, _, n, points = tables.curves.shape
    work = allocate_run_storage(n, tables.from_modes.shape[2], M, points - 1, True)
    work.state[:N], work.contact[:] = start(), codes
    modal_arcs.apply_stored_matrix(tables.to_modes, 0, work.state, work.modal_state)
    return tables, work


def distances_of(z):
    """Return the distances from coast-side and drive-side lines, (2, m)."""
    return np.array([SYSTEM.coast_lines @ z, SYSTEM.drive_lines @ z])


@pytest.mark.parametrize("n", range(10))
def test_unrolled_sums_are_products(n):
    rng = np.random.default_rng(n)
    a, b, matrix, image = *rng.normal(size=(2, 10)), rng.normal(size=(n, 16)), np.empty(16)
    assert distances._dot_of_first(a, b, n) == pytest.approx(a[:n] @ b[:n], abs=1e-14)
    assert train_system.dot(a, b[:n]) == pytest.approx(a[:n] @ b[:n], abs=1e-14)
    modal_arcs.fill_product(matrix, a[:n], image, 16)
    np.testing.assert_allclose(image, a[:n] @ matrix, atol=1e-13)
    product_of = train_system.matrix_vector_product(matrix.T.copy(), a[:n])
    np.testing.assert_allclose(product_of, image, atol=1e-13)


def test_matrix_and_harmonics_of_a_train():
    for codes in CODES:
        matrix = np.empty((N, N))
        train_system.fill_system_matrix(SYSTEM, effects_of(codes), matrix)
        np.testing.assert_allclose(matrix, matrix_of(effects_of(codes)), atol=1e-15)
    z, phases = np.zeros(N), 0.7 * SYSTEM.harmonics
    train_system.set_harmonics(SYSTEM.harmonics, z, 0.7)
    pairs = np.column_stack([np.cos(phases), np.sin(phases)]).ravel()
    np.testing.assert_allclose(z[N - 1 - pairs.size :], [1.0, *pairs], rtol=1e-15)


def test_contact_after_a_flank_line():
    after = {
        (code, line): train_system.next_contact(code, line)
        for code in (1, 0, -1)
        for line in (1, -1)
    }
    assert after == {(1, 1): 0, (0, 1): 1, (-1, 1): BOTH, (1, -1): BOTH, (0, -1): -1, (-1, -1): 0}
    line = np.array([1.0, -2.0])
    for past, z in [(False, (2.0, 1.0)), (False, (2.0, 1.0 + 1e-14)), (True, (2.0, 1.0 + 1e-12))]:
        assert train_system.is_past_coast_line(line, np.array(z)) == past


@pytest.mark.filterwarnings("ignore:overflow encountered")  # of the hash, uncompiled
def test_every_combination_has_its_hash_slot():
    keys = np.array(list(product(range(3), repeat=5)), np.int8)
    slots = np.full(512, -1)
    for row, key in enumerate(keys):
        slot = modal_arcs.find_slot(slots, keys, key.astype(np.int64))
        assert slots[slot] == -1
        slots[slot] = row
    found = [slots[modal_arcs.find_slot(slots, keys, key.astype(np.int64))] for key in keys]
    assert found == list(range(len(keys)))


@pytest.mark.parametrize("codes", CODES)
def test_modes_and_series_advance_a_state_as_the_exponential(codes):
    tables, work = modes_of(codes)
    factor_row = modal_arcs.find_segment_factors(tables, 0, 0, 0.9)
    factors, y = tables.segment_factors[factor_row], work.modal_state.copy()
    assert modal_arcs.find_segment_factors(tables, 0, 0, 0.9) == factor_row
    modal_arcs.advance_modes(tables, 0, factors, 0.9, y, work.term, work.image)
    modal_arcs.apply_stored_matrix(tables.from_modes, 0, y, work.sampled_state)
    expected = expm(0.9 * matrix_of(effects_of(codes))) @ start()
    np.testing.assert_allclose(work.sampled_state[:N], expected, rtol=0, atol=1e-11)
    z = start()
    sparse_series.advance_by_series(SYSTEM, CONSTANTS, effects_of(codes), 0.9, z, work.series)
    np.testing.assert_allclose(z, expected, rtol=0, atol=1e-11)


@pytest.mark.parametrize("codes", CODES)
def test_distances_of_a_piece_and_their_bounds(codes):
    tables, work = modes_of(codes)
    matrix, piece = matrix_of(effects_of(codes)), tables.piece_lengths[0]
    states = [expm(t * matrix) @ start() for t in np.linspace(0.0, piece, 9)]
    curves = np.array([distances_of(z) for z in states])
    unit = sparse_series.fill_taylor_series(
        SYSTEM, CONSTANTS, effects_of(codes), start(), work.series
    )
    sparse_series.fill_distance_series(SYSTEM, CONSTANTS, work.series, work.distance_series)
    count = distances.fill_amplitudes(tables, 0, work.modal_state, work.amplitudes)
    for j, side in product(range(M), range(2)):
        distances.fill_curve(tables.curves[0, side, j], work.modal_state, work.curve)
        found = BPoly(work.curve[:, None], [0.0, 1.0])(np.linspace(0.0, 1.0, 9))
        np.testing.assert_allclose(found, curves[:, side, j], rtol=0, atol=1e-11)
        powers = work.distance_series[side, j, :-1]
        end = distances_of(expm(0.5 * unit * matrix) @ start())[side, j]
        assert np.polyval(powers[::-1], 0.5) == pytest.approx(end, abs=1e-11)
        if tables.is_bounded[0, side, j]:
            amplitude = distances.distance_amplitude(tables, 0, side, j, work, count)
            center = tables.constant_distance[0, side, j]
            assert np.abs(curves[:, side, j] - center).max() <= amplitude
        sign = math.copysign(1.0, powers[0])
        degree = powers.size - 1
        if not sparse_series.series_may_reach_zero(work.distance_series[side, j], sign, degree):
            assert (sign * curves[: int(8 * unit / piece) + 1, side, j] > 0.0).all()


def test_first_events_are_the_first_sign_changes():
    found = 0
    for phase in np.linspace(0.0, 2.0 * math.pi, 13):
        z = start()
        z[:12] *= math.cos(phase)
        drive, coast = SYSTEM.drive_lines @ z, SYSTEM.coast_lines @ z
        codes = np.where(drive > 0.0, NORMAL, np.where(coast < 0.0, INVERSE, BACKLASH))
        tables, work = modes_of(codes)
        work.state[:N] = z
        modal_arcs.apply_stored_matrix(tables.to_modes, 0, work.state, work.modal_state)
        work.zero_order[:] = 0
        work.stays_off[:] = False
        first = distances.find_first_events(tables, 0, CONSTANTS, work, 1.0)
        count = distances.fill_amplitudes(tables, 0, work.modal_state, work.amplitudes)
        matrix = matrix_of(effects_of(codes))
        times = np.linspace(0.0, tables.piece_lengths[0], 1001)
        step, states = expm(times[1] * matrix), [z]
        for _ in times[1:]:
            states.append(step @ states[-1])
        curves = np.array([distances_of(state) for state in states])
        for j in range(M):
            # Without contact both lines count, in contact the line of that side.
            sides = {NORMAL: [1], INVERSE: [0], BACKLASH: [0, 1]}[int(codes[j])]
            signs = np.sign(curves[:, sides, j])
            changes = np.flatnonzero((signs != signs[0]).any(axis=1))
            instant = work.event_instant[j]
            if changes.size:
                found += 1
                assert (changes[0] - 1) / 1000.0 <= instant <= changes[0] / 1000.0
                assert not distances.stays_off_lines(tables, 0, j, CONSTANTS, work, count)
            else:
                assert instant > 1.0
        assert first == work.event_instant.min()
    assert found > 5
