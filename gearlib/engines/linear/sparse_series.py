"""Power series of the state for combinations of contacts without modes, with sparse matrices.

Modes of many coordinates cost as much as a thousand steps of the series, and a train of many meshes
that part one after the other hardly ever sees a combination again. So the series is used until
the steps in a combination have cost as much as its modes would. The total cost is thus at most
twice that of the better choice.
"""

import math

import numpy as np

from gearlib.engines import matrices
from gearlib.engines.jit import inlined_without_refcounts, kernel_without_refcounts

#: Row of a combination that has no modes and is advanced by the series.
SERIES = -2
#: |A| times the time unit of a series; terms beyond degree 23 add less than 4/3 of the last term.
_MAX_UNIT_NORM = 6.0
#: Largest last term of a series, as a fraction of the state.
_LAST_TERM = 2e-17
#: Number of components from which the series is tried first, and the cost of modes in steps of the
#: series over the square of the components.
_MIN_SERIES_COMPONENTS, _MODE_COST = 60, 0.015


def mode_cost_in_steps(n: int, fewest: int = _MIN_SERIES_COMPONENTS) -> int:
    """Return how many steps of the Taylor series cost as much as the modes of n state components.

    It is 0 with less than the `fewest` components for which the series is tried.
    """
    return int(_MODE_COST * n * n) if n >= fewest else 0


def combination_count(system) -> int:
    """Return how many combinations of contacts and stiffness levels a `TrainSystem` may have."""
    return system.force_input.shape[1] ** len(system.drive_lines)


def nonzero_fields(system, with_series=False):
    """Return the fields of `RunConstants` with the non-zeros of a `TrainSystem`, {name: array}.

    The arrays are empty if the system is so small that it needs no series, unless `with_series`.
    """
    names = ["nonzero_columns", "nonzero_counts", "mesh_components", "mesh_component_counts"]
    names.append("nonzero_values")
    n = system.base_matrix.shape[0]
    if not (mode_cost_in_steps(n) or with_series):
        empty = np.zeros((0, 0), np.int64), np.zeros(0, np.int64)
        return dict(zip(names, (*empty, *empty, np.zeros((0, 0))), strict=True))
    involved = (system.drive_lines != 0.0) | (system.coast_lines != 0.0)
    involved |= (system.force_output != 0.0).any(axis=(1, 2)) | (system.force_input != 0.0).any(
        axis=(1, 2)
    )
    columns, counts = _true_columns(system.base_matrix != 0.0)
    values = np.take_along_axis(system.base_matrix, columns, axis=1)
    return dict(zip(names, (columns, counts, *_true_columns(involved), values), strict=True))


def _true_columns(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (column indices of the true entries of each row, their number in each row) of a mask.

    Rows with fewer true entries are filled with other columns.
    """
    counts = mask.sum(axis=1)
    return np.argsort(~mask, axis=1, kind="stable")[:, : counts.max()].copy(), counts


@kernel_without_refcounts
def _fill_scaled_image(system, constants, effects, z, factor, image):
    """Fill `image`, shape (n,), with factor * A @ z for the matrix A of a `TrainSystem`.

    `effects`, int, (m,), are the contact effects of the meshes; `constants` list non-zeros of A.
    """
    for r in range(constants.nonzero_counts.shape[0]):
        total = 0.0
        for i in range(constants.nonzero_counts[r]):
            total += constants.nonzero_values[r, i] * z[constants.nonzero_columns[r, i]]
        image[r] = factor * total
    for j in range(effects.shape[0]):
        # The second force is the friction, which may be zero.
        for k in range(2 if effects[j] > 0 else 0):
            row, force = system.force_output[j, effects[j], k], 0.0
            column = system.force_input[j, effects[j], k]
            for i in range(constants.mesh_component_counts[j]):
                r = constants.mesh_components[j, i]
                force += row[r] * z[r]
            if force != 0.0:
                force *= factor
                for i in range(constants.mesh_component_counts[j]):
                    r = constants.mesh_components[j, i]
                    image[r] += column[r] * force


@kernel_without_refcounts
def _fill_chirp_rates(constants, k, time_unit, terms):
    """Fill term k + 1 of the Taylor series of the harmonics' derivatives while the speed changes.

    Behind displacements and velocities the state has the speed nu and, for each harmonic, cosine c,
    sine s and their derivatives. Since c' = -w nu s, c'' = -w (nu' s + nu s'), and likewise for the
    sine. `time_unit` is that of the series `terms`, shape (degree + 1, n).
    """
    speed = constants.speed_component
    speed_start, speed_change = terms[0, speed], terms[1, speed]
    for j in range(constants.chirp_frequencies.shape[0]):
        i, factor = speed + 1 + 4 * j, constants.chirp_frequencies[j] / (k + 1)
        for is_sine in range(2):
            # The rate of the cosine depends on the sine, and that of the sine on the cosine.
            value, rate = i + 1 - is_sine, i + 3 - is_sine
            total = speed_change * terms[k, value] + time_unit * speed_start * terms[k, rate]
            if k > 0:
                total += time_unit * speed_change * terms[k - 1, rate]
            terms[k + 1, i + 2 + is_sine] = factor * total if is_sine == 1 else -factor * total


@kernel_without_refcounts
def fill_taylor_series(system, constants, effects, z, terms):
    """Fill `terms`, shape (degree + 1, n padded), with the Taylor series of the state z.

    Returns its time unit in theta, over which the series is exact to rounding. The equation of
    motion z' = A z is that of the `TrainSystem` with the meshes' contact `effects`, int, (m,);
    `constants` (`RunConstants`) list the non-zeros of A.
    """
    degree, n = terms.shape[0] - 1, constants.nonzero_counts.shape[0]
    time_unit = _MAX_UNIT_NORM / matrices.MAX_NORM * system.max_step
    largest, last_term = 0.0, 0.0
    for r in range(n):
        terms[0, r] = z[r]
        largest = max(largest, abs(z[r]))
    for k in range(degree):
        _fill_scaled_image(system, constants, effects, terms[k], time_unit / (k + 1), terms[k + 1])
        if constants.chirp_frequencies.shape[0] > 0:
            _fill_chirp_rates(constants, k, time_unit, terms)
    for r in range(n):
        last_term = max(last_term, abs(terms[degree, r]))
    # The last term bounds those that follow; it is zero for a state at rest.
    unit_fraction = 1.0
    if _LAST_TERM * largest < last_term < math.inf:
        unit_fraction = (_LAST_TERM * largest / last_term) ** (1.0 / degree)
    power = 1.0
    for k in range(1, degree + 1):
        power *= unit_fraction
        for r in range(n):
            terms[k, r] *= power
    return time_unit * unit_fraction


@kernel_without_refcounts
def fill_distance_series(system, constants, terms, curves):
    """Fill `curves`, (2, m, degree + 2), with the Taylor series of all distances from flank lines.

    The first index is 0 for the coast side and 1 for the drive side; the last column is the sum of
    magnitudes, a scale of the rounding error. `terms` is from `fill_taylor_series`.
    """
    for j in range(constants.mesh_component_counts.shape[0]):
        for side in range(2):
            row = system.drive_lines[j] if side == 1 else system.coast_lines[j]
            magnitude = 0.0
            for i in range(constants.mesh_component_counts[j]):
                r = constants.mesh_components[j, i]
                magnitude += abs(row[r] * terms[0, r])
            for k in range(terms.shape[0]):
                total = 0.0
                for i in range(constants.mesh_component_counts[j]):
                    r = constants.mesh_components[j, i]
                    total += row[r] * terms[k, r]
                curves[side, j, k] = total
            curves[side, j, terms.shape[0]] = magnitude


@inlined_without_refcounts
def sum_series(terms, n, fraction, state):
    """Fill `state` with the sum of a Taylor series of n components at a fraction of its time unit.

    `terms`, shape (degree + 1, n padded), is that of `fill_taylor_series`.
    """
    for r in range(n):
        state[r] = terms[terms.shape[0] - 1, r]
    for k in range(terms.shape[0] - 2, -1, -1):
        for r in range(n):
            state[r] = state[r] * fraction + terms[k, r]


@kernel_without_refcounts
def advance_by_series(system, constants, effects, length, z, terms):
    """Advance a state z, or a perturbation, by `length` in theta at constant contacts, in place.

    `effects` are the contact effects of the meshes; `terms`, the series, is overwritten.
    """
    remaining = length
    while remaining > 0.0:
        time_unit = fill_taylor_series(system, constants, effects, z, terms)
        step = min(time_unit, remaining)
        sum_series(terms, constants.nonzero_counts.shape[0], step / time_unit, z)
        remaining -= step


@inlined_without_refcounts
def series_may_reach_zero(curve, sign, degree):
    """Return whether a distance from a flank line may reach zero within its series' time unit.

    `curve` is a row of `fill_distance_series`, `sign`, 1 or -1, the sign of the distance in the
    present contact state, and `degree` the degree of the series.
    """
    variation = 0.0
    for k in range(1, degree + 1):
        variation += abs(curve[k])
    return not sign * curve[0] > variation + 1e-14 * curve[degree + 1]
