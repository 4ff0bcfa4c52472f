"""Mode tables of each combination of contacts and stiffness levels, filled on first use.

A motion visits only few of the combinations that m meshes can form. In the modal coordinates of a
combination the state is y: first oscillating pairs of modes, whose complex amplitudes rotate, then
real modes, then a block of slow components (rigid-body motions, the constant), whose power series
is summed. With the state z of a `TrainSystem`, z = from_modes y and y = to_modes z.

The distances of the meshes from their flank lines are products of row vectors with y. Over a short
interval of theta they are polynomials to within rounding, whose Bernstein coefficients are products
of y with `distance_polynomials`. The magnitudes of the modes bound the distances until a contact
changes.

`gearlib.engines.linear.modal_frame` fills the tables. Matrices are stored by columns, padded to
multiples of eight, so that the compiler can add columns with vector instructions.
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.engines.jit import kernel, kernel_part
from gearlib.engines.linear.sparse_series import mode_cost_in_steps

#: Degrees of the distance polynomials over an interval. Long intervals of high degree are faster
#: for many components, whose change of modes costs more than the search for roots.
LOW_DEGREE, HIGH_DEGREE = 15, 23
#: Smallest number of components for which the high degree is used.
_HIGH_DEGREE_COMPONENTS = 20
#: Largest size in bytes of the tables of one thread; full tables are emptied and filled again.
MAX_TABLE_BYTES = 2**28
#: Largest number of combinations in the tables of runs that start with modes, and of runs that
#: start with Taylor series; largest number of distinct segment lengths per combination.
MAX_COMBINATIONS, _MAX_COMBINATIONS_BESIDE_SERIES, MAX_SEGMENT_LENGTHS = 512, 1024, 64
#: Smallest number of rows of tables, and of hash slots if Taylor series are used as well.
_MIN_ROWS, _MIN_SERIES_SLOTS = 16, 2**14
#: Largest |lambda| of a mode times the length of an interval, by degree. The Chebyshev series of
#: e^(lambda t), truncated after the degree, is exact to 2 (2.4 / 4)^16 / 16! = 3e-17
#: and 2 (7.2 / 4)^24 / 24! = 4e-18.
MAX_INTERVAL_RATES = {LOW_DEGREE: 2.4, HIGH_DEGREE: 7.2}
#: A series ends with a term below this fraction of the state, or after this number of terms.
_LAST_TERM, _MAX_TERMS = 1e-30, 60


class ModeTables(NamedTuple):
    """Mode tables of up to c combinations of contacts for n state components and m meshes.

    Index 0 of an axis of length 2 is the coast-side flank line, and index 1 the drive-side one.
    """

    combination_count: np.ndarray  #: int, number of rows in use, shape (1,)
    segment_factor_count: np.ndarray  #: int, rows of `segment_factors` in use, shape (1,)
    hash_slots: np.ndarray  #: int, hash table of rows; -1: free slot
    series_steps: np.ndarray  #: int, number of Taylor steps taken, per hash slot
    mode_cost: np.ndarray  #: int, number of Taylor steps that cost as much as modes, shape (1,)
    keys: np.ndarray  #: int8, force indices of all meshes, shape (c, m)
    pair_counts: np.ndarray  #: int, number of oscillating pairs, shape (c,)
    real_counts: np.ndarray  #: int, number of real modes, which follow the pairs, shape (c,)
    rates: np.ndarray  #: (growth, angular frequency) by theta of pairs and real modes, (c, n, 2)
    slow_matrix: np.ndarray  #: matrix of the slow components, which come last, shape (c, n, n)
    slow_rate: np.ndarray  #: estimated rate of the fastest slow component, shape (c,)
    interval_lengths: np.ndarray  #: theta over which polynomials hold, shape (c,)
    to_modes: np.ndarray  #: matrix from z to y, by columns, shape (c, n, n padded)
    from_modes: np.ndarray  #: matrix from y to z, by columns, shape (c, n, n padded)
    distance_polynomials: np.ndarray  #: Bernstein coefficients, (c, 2, m, n, degree + 1)
    mode_amplitude_factors: np.ndarray  #: distance due to a unit of each mode, (c, 2, m, n)
    constant_distance: np.ndarray  #: constant part of the distances, shape (c, 2, m)
    is_bounded: np.ndarray  #: bool, whether amplitudes bound the distance, (c, 2, m)
    segment_factor_rows: np.ndarray  #: int, row in `segment_factors` by length index, or -1, (c, k)
    segment_factors: np.ndarray  #: factors of the modes over a segment, shape (s, n)


def allocate_modes(n, m, length_count, combinations=MAX_COMBINATIONS):
    """Return empty `ModeTables` for a train with n state components and m meshes.

    A row of the tables belongs to one combination of contact states and stiffness levels of all
    meshes; `combinations` is the number of possible combinations. Each row has room for the mode
    factors of `length_count` distinct segment lengths. All tables together take at most
    MAX_TABLE_BYTES, but have at least two rows.
    """
    length_count = min(length_count, MAX_SEGMENT_LENGTHS)
    padded = (n + 7) // 8 * 8  # The next multiple of eight.
    degree = HIGH_DEGREE if n >= _HIGH_DEGREE_COMPONENTS else LOW_DEGREE
    # Both transformations, the slow matrix, and polynomials and amplitude factors of both sides.
    numbers_per_combination = 2 * n * padded + n * n + 2 * m * n * (degree + 2)
    rows = max(MAX_TABLE_BYTES // (8 * numbers_per_combination), 2)
    cost = mode_cost_in_steps(n)
    max_rows = _MAX_COMBINATIONS_BESIDE_SERIES if cost else MAX_COMBINATIONS
    rows = int(min(rows, max_rows, max(combinations, _MIN_ROWS)))
    # Combinations that are integrated by Taylor series take hash slots as well. The number of slots
    # is a power of two to allow a bit mask, and at least four times the number of rows to avoid
    # collisions.
    slots = _MIN_SERIES_SLOTS if cost else 1
    while slots < 4 * rows:
        slots *= 2
    return ModeTables(
        combination_count=np.zeros(1, np.int64),
        segment_factor_count=np.zeros(1, np.int64),
        hash_slots=np.full(slots, -1, np.int64),
        series_steps=np.zeros(slots, np.int64),
        mode_cost=np.full(1, cost),
        keys=np.empty((rows, m), np.int8),
        pair_counts=np.zeros(rows, np.int64),
        real_counts=np.zeros(rows, np.int64),
        rates=np.empty((rows, n, 2)),
        slow_matrix=np.empty((rows, n, n)),
        slow_rate=np.empty(rows),
        interval_lengths=np.empty(rows),
        to_modes=np.empty((rows, n, padded)),
        from_modes=np.empty((rows, n, padded)),
        distance_polynomials=np.empty((rows, 2, m, n, degree + 1)),
        mode_amplitude_factors=np.empty((rows, 2, m, n)),
        constant_distance=np.empty((rows, 2, m)),
        is_bounded=np.zeros((rows, 2, m), np.bool_),
        segment_factor_rows=np.full((rows, length_count), -1, np.int64),
        segment_factors=np.empty((rows * length_count, n)),
    )


@kernel(refcounts=False)
def find_slot(slots, keys, force_indices):
    """Return the hash slot of a combination of contacts, or the free slot in which to store it.

    `force_indices`, int, shape (m,), is the key of the combination. `slots` holds the row of each
    combination in `keys`, shape (c, m), or -1 if the slot is free. If another combination occupies
    a slot, the next slot is tried.
    """
    mask, hashed, m = slots.shape[0] - 1, 0, force_indices.shape[0]
    for j in range(m):
        # Multiplicative hashing by an odd number near the golden ratio; the product may overflow.
        hashed = (hashed + force_indices[j]) * 0x1E3779B97F4A7C15
    # The lowest bits of the product are mixed least, so they are dropped.
    slot = (hashed >> 20) & mask
    while slots[slot] >= 0:
        j, stored = 0, keys[slots[slot]]
        while j < m and stored[j] == force_indices[j]:
            j += 1
        if j == m:
            break
        slot = (slot + 1) & mask
    return slot


def clear_tables(tables: ModeTables) -> None:
    """Mark all rows of the mode tables as unused, so that they are filled again on demand."""
    tables.combination_count[0] = 0
    tables.hash_slots[:] = -1
    tables.series_steps[:] = 0
    clear_segment_factors(tables)


def clear_segment_factors(tables: ModeTables) -> None:
    """Mark the mode factors of whole segments as unused; they depend on the tuning."""
    tables.segment_factor_count[0] = 0
    tables.segment_factor_rows[:] = -1


@kernel_part(refcounts=False, inlined=True)
def fill_product(matrix, y, product, width):
    """Fill `product`, shape (width,), with y @ matrix; `matrix` has the shape (n, width).

    Four rows of the matrix are added at a time to reduce the memory traffic of `product`; the
    remaining rows follow one by one.
    """
    i, n = 0, matrix.shape[0]
    for r in range(width):
        product[r] = 0.0
    while i + 3 < n:
        y_0, y_1, y_2, y_3 = y[i], y[i + 1], y[i + 2], y[i + 3]
        for r in range(width):
            product[r] += (matrix[i, r] * y_0 + matrix[i + 1, r] * y_1) + (
                matrix[i + 2, r] * y_2 + matrix[i + 3, r] * y_3
            )
        i += 4
    while i < n:
        y_0 = y[i]
        for r in range(width):
            product[r] += matrix[i, r] * y_0
        i += 1


@kernel_part(refcounts=False, inlined=True)
def apply_stored_matrix(matrices, row, z, product):
    """Fill `product`, shape (w,), with the product of a stored matrix and the vector z.

    The matrix is stored by columns: ``matrices[row]``, of shape (n, w), is its transpose.
    """
    fill_product(matrices[row], z, product, matrices.shape[2])


@kernel_part(refcounts=False, inlined=True)
def fill_mode_factors(tables, combination, t, factors):
    """Fill `factors`, shape (n,), with the factors by which the modes change in the time t.

    A mode with the complex rate lambda changes by exp(lambda t). An oscillating pair of modes takes
    two entries, the real and the imaginary part; a real mode takes one. `tables.rates` holds
    (growth, angular frequency) of each mode, in the row `combination` for the present contacts of
    all meshes.
    """
    pair_count = tables.pair_counts[combination]
    for k in range(pair_count):
        growth = math.exp(tables.rates[combination, k, 0] * t)
        angle = tables.rates[combination, k, 1] * t
        factors[2 * k], factors[2 * k + 1] = growth * math.cos(angle), growth * math.sin(angle)
    for k in range(tables.real_counts[combination]):
        factors[2 * pair_count + k] = math.exp(tables.rates[combination, pair_count + k, 0] * t)


@kernel_part(refcounts=False, inlined=True)
def find_segment_factors(tables, combination, length_index, t):
    """Return the row of ``tables.segment_factors`` with the mode factors of a whole segment.

    A mode with the rate lambda changes by exp(lambda t) over a segment of constant stiffness of
    duration t. `length_index` is the index of t among the distinct durations. Factors are computed
    on first use and kept. `combination` is the row of the mode tables `tables` for the present
    contacts.
    """
    if tables.segment_factor_rows[combination, length_index] < 0:
        row = tables.segment_factor_count[0]
        fill_mode_factors(tables, combination, t, tables.segment_factors[row])
        tables.segment_factor_rows[combination, length_index] = row
        tables.segment_factor_count[0] = row + 1
    return tables.segment_factor_rows[combination, length_index]


@kernel_part(refcounts=False, inlined=True)
def advance_modes(tables, combination, factors, t, y, term, image):
    """Advance a modal state y, shape (n,) or longer, by the time t, in place.

    The oscillating pairs and the real modes come first and are multiplied by the `factors` that
    `fill_mode_factors` computes for t. The slow components, such as rigid-body motions, come last;
    they are coupled, and their power series is summed. `combination` is the row of the mode tables
    `tables` for the present contacts. `term` and `image`, shape (n,), are overwritten.
    """
    pair_count = tables.pair_counts[combination]
    real_count = tables.real_counts[combination]
    n = tables.slow_matrix.shape[1]
    for k in range(pair_count):
        u, v, p, q = y[2 * k], y[2 * k + 1], factors[2 * k], factors[2 * k + 1]
        # Multiply the complex numbers u + i v and p + i q.
        y[2 * k], y[2 * k + 1] = p * u - q * v, q * u + p * v
    first_slow = 2 * pair_count + real_count
    for k in range(2 * pair_count, first_slow):
        y[k] *= factors[k]
    matrix, rate = tables.slow_matrix[combination], tables.slow_rate[combination]
    _advance_block(matrix, n - first_slow, rate, t, y[first_slow:], term, image)


@kernel_part(refcounts=False, inlined=True)
def advance_modes_in_time(tables, combination, run, t, y):
    """Advance a modal state y by an arbitrary time t, in place.

    The mode factors are computed for t. `combination` is the row of the mode tables `tables` for
    the present contacts. `run` (`RunState`) is overwritten.
    """
    fill_mode_factors(tables, combination, t, run.mode_factors)
    advance_modes(tables, combination, run.mode_factors, t, y, run.term, run.image)


@kernel_part(refcounts=False)
def _advance_block(matrix, size, rate, t, y, term, image):
    """Advance the slow components y of a modal state, shape (size,), by the time t, in place.

    They obey y' = matrix @ y, where `matrix` has the shape (size, size) or larger. The power series
    of exp(matrix h) is summed in equal steps h of at most 1 / `rate`, so that it converges fast;
    `rate` is the rate of the fastest slow component. `term` and `image`, (size,), are overwritten.
    """
    # A block of one component is the constant 1 of the state, which does not change.
    steps = max(math.ceil(t * rate), 1.0) if size > 1 else 0.0
    h, step = t / max(steps, 1.0), 0.0
    while step < steps:
        largest = 0.0
        for r in range(size):
            term[r] = y[r]
            largest = max(largest, abs(y[r]))
        k, last_term = 0, 1.0
        while last_term > _LAST_TERM * largest and k < _MAX_TERMS:
            k += 1
            factor, last_term = h / k, 0.0
            for r in range(size):
                total = 0.0
                for i in range(size):
                    total += matrix[r, i] * term[i]
                image[r] = factor * total
                last_term = max(last_term, abs(image[r]))
            for r in range(size):
                term[r] = image[r]
                y[r] += term[r]
        step += 1.0
