"""Taylor series of the state for combinations of contacts without modes, with sparse matrices.

Computing the modes of many coordinates costs as much as a thousand Taylor steps, and a train of
many meshes that lose contact one after the other rarely returns to the same combination. A
combination is therefore integrated by Taylor series until its steps have cost as much as its modes
would. The total cost is thus at most twice the cost of the better choice.
"""

import math

import numpy as np

from gearlib.engines import matrices
from gearlib.engines.jit import kernel_part

#: Used in place of a row of the mode tables for a combination that is integrated by Taylor series.
SERIES = -2
#: |A| times the time unit of a series. The terms beyond degree 23 add up to less than 4/3 of the
#: last term.
_MAX_UNIT_NORM = 6.0
#: Largest last term of a series, as a fraction of the state.
_LAST_TERM = 2e-17
#: Smallest number of state components for which Taylor series are tried before modes, and the cost
#: of modes, in Taylor steps, divided by the squared number of components.
_MIN_SERIES_COMPONENTS, _MODE_COST = 60, 0.015


def mode_cost_in_steps(n: int, min_components: int = _MIN_SERIES_COMPONENTS) -> int:
    """Return the number of Taylor steps that cost as much as the modes of n state components.

    The result is 0 if n is less than `min_components`: modes are then computed without trying
    Taylor series.
    """
    return int(_MODE_COST * n * n) if n >= min_components else 0


def combination_count(system) -> int:
    """Return an upper bound on the number of combinations of contact forces of a `TrainSystem`."""
    return system.force_input.shape[1] ** len(system.drive_distance_rows)


def nonzero_fields(system, with_series=False):
    """Return the fields of `RunConstants` that list the nonzero entries of a `TrainSystem`.

    The result maps field names to arrays: the columns and values of the nonzero entries of each row
    of the base matrix, and the state components on which the forces of each mesh depend or act.
    Only Taylor series need these arrays. They are empty if the system has few components, unless
    `with_series` is True.
    """
    names = ["nonzero_columns", "nonzero_counts", "mesh_components", "mesh_component_counts"]
    names.append("nonzero_values")
    n = system.base_matrix.shape[0]
    if not (mode_cost_in_steps(n) or with_series):
        empty = np.zeros((0, 0), np.int64), np.zeros(0, np.int64)
        return dict(zip(names, (*empty, *empty, np.zeros((0, 0))), strict=True))
    is_involved = ((system.force_input != 0.0) | (system.force_output != 0.0)).any(axis=(1, 2))
    is_involved |= (system.drive_distance_rows != 0.0) | (system.coast_distance_rows != 0.0)
    columns, counts = _columns_of_true_entries(system.base_matrix != 0.0)
    values = system.base_matrix[np.arange(n)[:, None], columns]
    return dict(
        zip(names, (columns, counts, *_columns_of_true_entries(is_involved), values), strict=True)
    )


def _columns_of_true_entries(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (columns of the true entries, number of true entries) of each row of a mask.

    The first array has as many columns as the largest number of true entries. Rows with fewer true
    entries are filled up with columns of false entries.
    """
    counts = mask.sum(axis=1)
    # A stable sort of the inverted mask puts the columns of true entries first.
    return np.argsort(~mask, axis=1, kind="stable")[:, : counts.max()].copy(), counts


@kernel_part(refcounts=False)
def _fill_scaled_product(system, constants, force_indices, z, factor, product):
    """Fill `product`, shape (n,), with factor * A @ z, where A is the state matrix of z' = A z.

    A is the base matrix of the `TrainSystem` `system` plus the forces of all meshes with the
    indices `force_indices`, int, shape (m,), 0 without contact. Only the nonzero entries listed in
    `constants` (`RunConstants`) are multiplied.
    """
    for r in range(constants.nonzero_counts.shape[0]):
        total = 0.0
        for i in range(constants.nonzero_counts[r]):
            total += constants.nonzero_values[r, i] * z[constants.nonzero_columns[r, i]]
        product[r] = factor * total
    for j in range(force_indices.shape[0]):
        # The second force is the friction, which may be zero.
        for k in range(2 if force_indices[j] > 0 else 0):
            output_vector, force = system.force_output[j, force_indices[j], k], 0.0
            input_vector = system.force_input[j, force_indices[j], k]
            for i in range(constants.mesh_component_counts[j]):
                r = constants.mesh_components[j, i]
                force += output_vector[r] * z[r]
            if force != 0.0:
                force *= factor
                for i in range(constants.mesh_component_counts[j]):
                    r = constants.mesh_components[j, i]
                    product[r] += input_vector[r] * force


@kernel_part(refcounts=False)
def _fill_chirp_rates(constants, k, time_unit, terms):
    """Fill term k + 1 of the Taylor series of the harmonics' derivatives at variable speed.

    After displacements and velocities, the state holds the speed nu and, for each harmonic of
    frequency w, the cosine c, the sine s and their derivatives. With c' = -w nu s and s' = w nu c,
    the second derivatives are c'' = -w (nu' s + nu s') and s'' = w (nu' c + nu c'), where nu' is
    constant. `terms`, shape (degree + 1, n), is the Taylor series in units of `time_unit`;
    `constants` (`RunConstants`) holds the frequencies.
    """
    speed = constants.speed_component
    # The speed is linear in time, so that products with it have two terms.
    speed_start, speed_change = terms[0, speed], terms[1, speed]
    for j in range(constants.chirp_frequencies.shape[0]):
        i, factor = speed + 1 + 4 * j, constants.chirp_frequencies[j] / (k + 1)
        for is_sine in range(2):
            # The rate of the cosine depends on the sine, and vice versa.
            value, rate = i + 1 - is_sine, i + 3 - is_sine
            total = speed_change * terms[k, value] + time_unit * speed_start * terms[k, rate]
            if k > 0:
                total += time_unit * speed_change * terms[k - 1, rate]
            terms[k + 1, i + 2 + is_sine] = factor * total if is_sine == 1 else -factor * total


@kernel_part(refcounts=False)
def fill_taylor_series(system, constants, force_indices, z, terms):
    """Fill `terms`, shape (degree + 1, n padded), with the Taylor series of the state z in time.

    Returns the time unit of the series: term k is the coefficient of (time / unit)^k, and up to one
    unit the series is exact to rounding. The equation of motion is z' = A z, where A depends on the
    `force_indices`, int, shape (m,), of the meshes in the `TrainSystem` `system`. `constants`
    (`RunConstants`) lists the nonzero entries of A.
    """
    degree, n = terms.shape[0] - 1, constants.nonzero_counts.shape[0]
    time_unit = _MAX_UNIT_NORM / matrices.MAX_NORM * system.max_step
    largest, last_term = 0.0, 0.0
    for r in range(n):
        terms[0, r] = z[r]
        largest = max(largest, abs(z[r]))
    for k in range(degree):
        _fill_scaled_product(
            system, constants, force_indices, terms[k], time_unit / (k + 1), terms[k + 1]
        )
        if constants.chirp_frequencies.shape[0] > 0:
            _fill_chirp_rates(constants, k, time_unit, terms)
    for r in range(n):
        last_term = max(last_term, abs(terms[degree, r]))
    # The last term bounds the neglected terms. If it is too large, a shorter time unit makes it
    # small enough; it is zero for a state at rest.
    unit_fraction = 1.0
    if _LAST_TERM * largest < last_term < math.inf:
        unit_fraction = (_LAST_TERM * largest / last_term) ** (1.0 / degree)
    power = 1.0
    for k in range(1, degree + 1):
        power *= unit_fraction
        for r in range(n):
            terms[k, r] *= power
    return time_unit * unit_fraction


@kernel_part(refcounts=False)
def fill_distance_series(system, constants, terms, distance_series):
    """Fill `distance_series`, (2, m, degree + 2), with the Taylor series of the flank distances.

    A flank distance is the distance of a mesh from a flank line, the displacement at which the
    flanks touch. The first index is 0 for the coast side and 1 for the drive side; the second index
    is the mesh. The last column, the sum of the magnitudes of the terms of the distance at the
    start, scales the rounding error. `terms`, (degree + 1, n), is the Taylor series of the state.
    """
    for j in range(constants.mesh_component_counts.shape[0]):
        for side in range(2):
            distance_row = (
                system.drive_distance_rows[j] if side == 1 else system.coast_distance_rows[j]
            )
            magnitude = 0.0
            for i in range(constants.mesh_component_counts[j]):
                r = constants.mesh_components[j, i]
                magnitude += abs(distance_row[r] * terms[0, r])
            for k in range(terms.shape[0]):
                total = 0.0
                for i in range(constants.mesh_component_counts[j]):
                    r = constants.mesh_components[j, i]
                    total += distance_row[r] * terms[k, r]
                distance_series[side, j, k] = total
            distance_series[side, j, terms.shape[0]] = magnitude


@kernel_part(refcounts=False, inlined=True)
def sum_series(terms, n, fraction, state):
    """Fill `state` with the sum of a Taylor series of n components at a fraction of its time unit.

    Row k of `terms`, shape (degree + 1, n or more), is multiplied by fraction^k, by Horner's
    scheme.
    """
    for r in range(n):
        state[r] = terms[terms.shape[0] - 1, r]
    for k in range(terms.shape[0] - 2, -1, -1):
        for r in range(n):
            state[r] = state[r] * fraction + terms[k, r]


@kernel_part(refcounts=False)
def advance_by_series(system, constants, force_indices, length, z, terms):
    """Advance a state z, or a perturbation of it, by the duration `length` in theta, in place.

    The contacts, given by the `force_indices`, int, shape (m,), do not change in this time. `terms`
    is overwritten with the Taylor series of each step.
    """
    remaining = length
    while remaining > 0.0:
        time_unit = fill_taylor_series(system, constants, force_indices, z, terms)
        step = min(time_unit, remaining)
        sum_series(terms, constants.nonzero_counts.shape[0], step / time_unit, z)
        remaining -= step


@kernel_part(refcounts=False, inlined=True)
def series_may_reach_zero(distance_series, sign, degree):
    """Return whether the Taylor series of a flank distance may reach zero within its time unit.

    `distance_series` holds the Taylor coefficients of the distance up to `degree`, followed by the
    magnitude that scales its rounding error. `sign`, 1 or -1, is the present sign of the distance.
    There is no zero if the constant term exceeds the sum of the magnitudes of all other
    coefficients.
    """
    variation = 0.0
    for k in range(1, degree + 1):
        variation += abs(distance_series[k])
    return not sign * distance_series[0] > variation + 1e-14 * distance_series[degree + 1]
