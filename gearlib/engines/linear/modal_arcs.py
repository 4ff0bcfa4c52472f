"""Tables of the modes of each combination of contacts and stiffness levels, filled on first use.

A motion visits few of the combinations that m meshes may form. In the modes of a combination the
state is y: first oscillating pairs of modes, whose complex amplitudes rotate, then real modes, then
a block of slow components (rigid-body motions, the constant) whose power series is summed. With the
state z of `TrainSystem`, z = from_modes y and y = to_modes z.

The distances of the meshes from their flank lines are products of row vectors with y. Over a piece
of theta they are polynomials to within rounding, whose Bernstein coefficients are products of y
with `curves`. The magnitudes of the modes bound the distances until a contact changes.

`gearlib.engines.linear.modal_frame` fills the tables. Tables are stored by columns, padded to
multiples of eight, so that the compiler can add columns with vector instructions.
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.engines.jit import inlined_without_refcounts, kernel_without_refcounts
from gearlib.engines.linear.sparse_series import mode_cost_in_steps

#: Degrees of the polynomials of distances over a piece. Long pieces of high degree are faster with
#: many components, where a change of modes costs more than the search for roots.
LOW_DEGREE, HIGH_DEGREE = 15, 23
#: Smallest number of components for which the high degree is used.
_HIGH_DEGREE_COMPONENTS = 20
#: Largest size in bytes of the tables of one thread; full tables are emptied and filled again.
MAX_TABLE_BYTES = 2**28
#: Largest number of combinations in the tables of a run that begins with modes, and of a run that
#: begins with Taylor series; largest number of lengths of segments for each combination.
MAX_COMBINATIONS, _MAX_COMBINATIONS_BESIDE_SERIES, MAX_SEGMENT_LENGTHS = 512, 1024, 64
#: Smallest number of rows of tables, and of hash slots if Taylor series are used as well.
_MIN_ROWS, _MIN_SERIES_SLOTS = 16, 2**14
#: Largest |lambda| of a mode times the length of a piece, by degree. The Chebyshev series of
#: e^(lambda t), truncated after the degree, is exact to 2 (2.4 / 4)^16 / 16! = 3e-17
#: and 2 (7.2 / 4)^24 / 24! = 4e-18.
MAX_PIECE_RATES = {LOW_DEGREE: 2.4, HIGH_DEGREE: 7.2}
#: A series ends with a term below this fraction of the state, or after this number of terms.
_LAST_TERM, _MAX_TERMS = 1e-30, 60


class Modes(NamedTuple):
    """Tables of up to c combinations of a `TrainSystem`: n components, m meshes.

    Index 2 stands for the distances from the coast-side and the drive-side flank line.
    """

    combination_count: np.ndarray  #: int, number of rows in use, shape (1,)
    segment_factor_count: np.ndarray  #: int, rows of `segment_factors` in use, shape (1,)
    hash_slots: np.ndarray  #: int, hash table: row of a combination, or -1
    series_steps: np.ndarray  #: int, number of Taylor steps taken, by hash slot
    mode_cost: np.ndarray  #: int, number of Taylor steps that cost as much as modes, shape (1,)
    keys: np.ndarray  #: int8, effects of all meshes, shape (c, m)
    pair_counts: np.ndarray  #: int, number of oscillating pairs, shape (c,)
    real_counts: np.ndarray  #: int, number of real modes, which follow the pairs, shape (c,)
    rates: np.ndarray  #: (growth, angular frequency) by theta of pairs and real modes, (c, n, 2)
    slow_matrix: np.ndarray  #: matrix of the slow components, which come last, shape (c, n, n)
    slow_rate: np.ndarray  #: estimated rate of the fastest slow component, shape (c,)
    piece_lengths: np.ndarray  #: theta over which `curves` hold, shape (c,)
    to_modes: np.ndarray  #: matrix from z to y, by columns, shape (c, n, n padded)
    from_modes: np.ndarray  #: matrix from y to z, by columns, shape (c, n, n padded)
    curves: np.ndarray  #: Bernstein coefficients of the distances, (c, 2, m, n, degree + 1)
    mode_amplitude_factors: np.ndarray  #: distance for each mode of magnitude 1, (c, 2, m, n)
    constant_distance: np.ndarray  #: constant part of the distances, shape (c, 2, m)
    is_bounded: np.ndarray  #: bool, whether constant and amplitudes bound a distance, (c, 2, m)
    segment_factor_rows: (
        np.ndarray
    )  #: int, row of `segment_factors` by length of segment, or -1, (c, k)
    segment_factors: np.ndarray  #: factors of the modes over a segment, shape (s, n)


def allocate_modes(n, m, length_count, combinations=MAX_COMBINATIONS):
    """Return empty tables (`Modes`) for the modes of a train of n state components and m meshes.

    A row of the tables is for one combination of the contacts and stiffness levels of all meshes,
    of which `combinations` are possible. For each row there is room for the factors of the modes
    over `length_count` different durations of a segment of constant stiffness. All tables together
    take at most MAX_TABLE_BYTES, but have at least two rows.
    """
    length_count = min(length_count, MAX_SEGMENT_LENGTHS)
    padded = (n + 7) // 8 * 8  # The next multiple of eight.
    degree = HIGH_DEGREE if n >= _HIGH_DEGREE_COMPONENTS else LOW_DEGREE
    # Both transformations, the slow matrix, then curves and amplitude factors for both flank lines.
    numbers_per_combination = 2 * n * padded + n * n + 2 * m * n * (degree + 2)
    rows = max(MAX_TABLE_BYTES // (8 * numbers_per_combination), 2)
    cost = mode_cost_in_steps(n)
    max_rows = _MAX_COMBINATIONS_BESIDE_SERIES if cost else MAX_COMBINATIONS
    rows = int(min(rows, max_rows, max(combinations, _MIN_ROWS)))
    # Combinations that are integrated by Taylor series take hash slots as well. The number of slots
    # is a power of two, for a fast hash, and at least four times the number of rows, against
    # collisions.
    slots = _MIN_SERIES_SLOTS if cost else 1
    while slots < 4 * rows:
        slots *= 2
    return Modes(
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
        piece_lengths=np.empty(rows),
        to_modes=np.empty((rows, n, padded)),
        from_modes=np.empty((rows, n, padded)),
        curves=np.empty((rows, 2, m, n, degree + 1)),
        mode_amplitude_factors=np.empty((rows, 2, m, n)),
        constant_distance=np.empty((rows, 2, m)),
        is_bounded=np.zeros((rows, 2, m), np.bool_),
        segment_factor_rows=np.full((rows, length_count), -1, np.int64),
        segment_factors=np.empty((rows * length_count, n)),
    )


@kernel_without_refcounts
def find_slot(slots, keys, effects):
    """Return the hash slot of a combination of contacts, or the free slot in which to store it.

    `effects`, int, shape (m,), has a number for the contact and stiffness level of each mesh. A
    slot holds the row of its combination in `keys`, shape (c, m), or -1 if it is free. If a slot is
    taken by another combination, the next slot is tried.
    """
    mask, hashed, m = slots.shape[0] - 1, 0, effects.shape[0]
    for j in range(m):
        # Multiplicative hashing by an odd number near the golden ratio; the product may overflow.
        hashed = (hashed + effects[j]) * 0x1E3779B97F4A7C15
    # The lowest bits of the product are mixed least. The mask works as the slots are a power of
    # two.
    slot = (hashed >> 20) & mask
    while slots[slot] >= 0:
        j, stored = 0, keys[slots[slot]]
        while j < m and stored[j] == effects[j]:
            j += 1
        if j == m:
            break
        slot = (slot + 1) & mask
    return slot


def clear_tables(tables: Modes) -> None:
    """Mark all rows of the mode tables as unused, so that they are filled again when needed."""
    tables.combination_count[0] = 0
    tables.hash_slots[:] = -1
    tables.series_steps[:] = 0
    clear_segment_factors(tables)


def clear_segment_factors(tables: Modes) -> None:
    """Mark the mode factors of whole segments, which depend on the tuning, as unused."""
    tables.segment_factor_count[0] = 0
    tables.segment_factor_rows[:] = -1


@inlined_without_refcounts
def fill_product(matrix, y, product, width):
    """Fill `product`, shape (width,), with y @ matrix; `matrix` has the shape (n, width).

    Four rows of the matrix are added at a time, so that `product` is read and written less often.
    The last one to three rows follow one by one.
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


@inlined_without_refcounts
def apply_stored_matrix(matrices, row, z, product):
    """Fill `product`, shape (w,), with the product of a stored matrix and the vector z.

    ``matrices[row]``, of shape (n, w), holds the columns of this matrix as its rows.
    """
    fill_product(matrices[row], z, product, matrices.shape[2])


@inlined_without_refcounts
def fill_mode_factors(tables, combination, t, factors):
    """Fill `factors`, shape (n,), with the factors by which modes change in a time t.

    A mode with the complex rate lambda changes by exp(lambda t). An oscillating pair of modes takes
    two entries, the real and the imaginary part; a real mode takes one. `tables.rates` has (growth,
    angular frequency) of each mode, in the row `combination` for the present contacts of the
    meshes.
    """
    pair_count = tables.pair_counts[combination]
    for k in range(pair_count):
        growth = math.exp(tables.rates[combination, k, 0] * t)
        angle = tables.rates[combination, k, 1] * t
        factors[2 * k], factors[2 * k + 1] = growth * math.cos(angle), growth * math.sin(angle)
    for k in range(tables.real_counts[combination]):
        factors[2 * pair_count + k] = math.exp(tables.rates[combination, pair_count + k, 0] * t)


@inlined_without_refcounts
def find_segment_factors(tables, combination, length_index, t):
    """Return the row of ``tables.segment_factors`` with the mode factors over a segment.

    A mode with the rate lambda changes by exp(lambda t) over a segment of constant stiffness of
    duration t. `length_index` numbers the different durations. Factors are computed at first use
    and kept. `combination` is the row of the mode tables `tables` (`Modes`) for the present
    contacts.
    """
    if tables.segment_factor_rows[combination, length_index] < 0:
        row = tables.segment_factor_count[0]
        fill_mode_factors(tables, combination, t, tables.segment_factors[row])
        tables.segment_factor_rows[combination, length_index] = row
        tables.segment_factor_count[0] = row + 1
    return tables.segment_factor_rows[combination, length_index]


@inlined_without_refcounts
def advance_modes(tables, combination, factors, t, y, term, image):
    """Advance a state y in modal coordinates, shape (n,) or longer, by the time t, in place.

    First come the oscillating pairs and the real modes, which are multiplied by the `factors` that
    `fill_mode_factors` computes for t. The slow components, such as rigid-body motions, come last;
    they are coupled, and their power series is summed. `combination` is the row of the mode tables
    `tables` for the present contacts. `term` and `image`, shape (n,), are overwritten.
    """
    pair_count = tables.pair_counts[combination]
    real_count = tables.real_counts[combination]
    n = tables.slow_matrix.shape[1]
    for k in range(pair_count):
        u, v, p, q = y[2 * k], y[2 * k + 1], factors[2 * k], factors[2 * k + 1]
        # The product of the complex numbers u + i v and p + i q.
        y[2 * k], y[2 * k + 1] = p * u - q * v, q * u + p * v
    first_slow = 2 * pair_count + real_count
    for k in range(2 * pair_count, first_slow):
        y[k] *= factors[k]
    matrix, rate = tables.slow_matrix[combination], tables.slow_rate[combination]
    _advance_block(matrix, n - first_slow, rate, t, y[first_slow:], term, image)


@inlined_without_refcounts
def advance_modes_in_time(tables, combination, work, t, y):
    """Advance a state y in modal coordinates by any time t, in place.

    The factors of the modes are computed for t. `combination` is the row of the mode tables
    `tables` for the present contacts of the meshes. Arrays of `work` (`RunStorage`) are
    overwritten.
    """
    fill_mode_factors(tables, combination, t, work.mode_factors)
    advance_modes(tables, combination, work.mode_factors, t, y, work.term, work.image)


@kernel_without_refcounts
def _advance_block(matrix, size, rate, t, y, term, image):
    """Advance the slow components y of a modal state, shape (size,), by the time t, in place.

    They obey y' = matrix @ y, with `matrix` of shape (size, size) or larger. The power series of
    exp(matrix h) is summed in equal steps h of at most 1 / `rate`, where `rate` is the rate of the
    fastest slow component, so that it converges quickly. `term` and `image`, (size,), are
    overwritten.
    """
    # A block of one component holds the constant 1 of the state, which does not change.
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
