"""Power series of the state for combinations of contacts without modes, with sparse matrices.

Modes of many coordinates cost as much as a thousand steps of the series, and a train of many meshes
that lose contact one after the other hardly ever returns to a combination. So the series is used
until its steps in a combination have cost as much as the modes would. The total cost is thus at
most twice the cost of the better choice.
"""

import math

import numpy as np

from gearlib.engines import matrices
from gearlib.engines.jit import inlined_without_refcounts, kernel_without_refcounts

#: Code in place of a row of mode tables, for a combination that is integrated by Taylor series.
SERIES = -2
#: |A| times the time unit of a series. The terms beyond degree 23 add up to less than 4/3 of the
#: last term.
_MAX_UNIT_NORM = 6.0
#: Largest last term of a series, as a fraction of the state.
_LAST_TERM = 2e-17
#: Smallest number of state components for which the series is tried first, and the cost of modes,
#: in Taylor steps, over the squared number of components.
_MIN_SERIES_COMPONENTS, _MODE_COST = 60, 0.015


def mode_cost_in_steps(n: int, fewest: int = _MIN_SERIES_COMPONENTS) -> int:
    """Return the number of Taylor steps that cost as much as the modes of n state components.

    With less than `fewest` components the result is 0: Taylor series are then not tried before
    modes.
    """
    return int(_MODE_COST * n * n) if n >= fewest else 0


def combination_count(system) -> int:
    """Return an upper bound of the number of combinations of contact effects of a `TrainSystem`."""
    return system.force_input.shape[1] ** len(system.drive_lines)


def nonzero_fields(system, with_series=False):
    """Return the fields of `RunConstants` that list the nonzero entries of a `TrainSystem`.

    The result maps field names to arrays: columns and values of the nonzero entries in each row of
    the base matrix, and the state components on which the forces of each mesh depend or act. Only
    Taylor series need them; in a system of few components they are empty, unless `with_series`.
    """
    names = ["nonzero_columns", "nonzero_counts", "mesh_components", "mesh_component_counts"]
    names.append("nonzero_values")
    n = system.base_matrix.shape[0]
    if not (mode_cost_in_steps(n) or with_series):
        empty = np.zeros((0, 0), np.int64), np.zeros(0, np.int64)
        return dict(zip(names, (*empty, *empty, np.zeros((0, 0))), strict=True))
    is_involved = (system.drive_lines != 0.0) | (system.coast_lines != 0.0)
    is_involved |= (system.force_output != 0.0).any(axis=(1, 2)) | (system.force_input != 0.0).any(
        axis=(1, 2)
    )
    columns, counts = _true_columns(system.base_matrix != 0.0)
    values = np.take_along_axis(system.base_matrix, columns, axis=1)
    return dict(zip(names, (columns, counts, *_true_columns(is_involved), values), strict=True))


def _true_columns(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (columns of the true entries, their number) for each row of a mask.

    All rows of the first array have the length of the largest number. A row with fewer true entries
    ends with columns of false entries.
    """
    counts = mask.sum(axis=1)
    # Sorted by the inverted mask, the columns of true entries come first.
    return np.argsort(~mask, axis=1, kind="stable")[:, : counts.max()].copy(), counts


@kernel_without_refcounts
def _fill_scaled_image(system, constants, effects, z, factor, image):
    """Fill `image`, shape (n,), with factor * A @ z, for the matrix A of the equation z' = A z.

    A is the base matrix of the `TrainSystem` `system` plus the forces of all meshes. `effects`,
    int, (m,), has a number for the contact and stiffness level of each mesh, 0 without contact.
    Only nonzero entries are multiplied, which `constants` (`RunConstants`) list.
    """
    for r in range(constants.nonzero_counts.shape[0]):
        total = 0.0
        for i in range(constants.nonzero_counts[r]):
            total += constants.nonzero_values[r, i] * z[constants.nonzero_columns[r, i]]
        image[r] = factor * total
    for j in range(effects.shape[0]):
        # The second force is the friction, which may be zero.
        for k in range(2 if effects[j] > 0 else 0):
            output_vector, force = system.force_output[j, effects[j], k], 0.0
            input_vector = system.force_input[j, effects[j], k]
            for i in range(constants.mesh_component_counts[j]):
                r = constants.mesh_components[j, i]
                force += output_vector[r] * z[r]
            if force != 0.0:
                force *= factor
                for i in range(constants.mesh_component_counts[j]):
                    r = constants.mesh_components[j, i]
                    image[r] += input_vector[r] * force


@kernel_without_refcounts
def _fill_chirp_rates(constants, k, time_unit, terms):
    """Fill term k + 1 of the Taylor series of the harmonics' derivatives while the speed changes.

    After displacements and velocities the state holds the speed nu and, for each harmonic of
    frequency w, cosine c, sine s and their derivatives. From c' = -w nu s and s' = w nu c follow
    c'' = -w (nu' s + nu s') and s'' = w (nu' c + nu c'), with a constant nu'. `terms`, shape
    (degree + 1, n), is the Taylor series in units of `time_unit`, and `constants` (`RunConstants`)
    hold the frequencies.
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


@kernel_without_refcounts
def fill_taylor_series(system, constants, effects, z, terms):
    """Fill `terms`, shape (degree + 1, n padded), with the Taylor series of the state z in time.

    Returns the time unit of the series, up to which it is exact to within rounding; `terms` are
    scaled by its powers. The equation of motion is z' = A z. `effects`, int, (m,), has a number for
    the contact and stiffness level of each mesh in the `TrainSystem` `system`, from which A
    follows; `constants` (`RunConstants`) list its nonzero entries.
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


@kernel_without_refcounts
def fill_distance_series(system, constants, terms, curves):
    """Fill `curves`, (2, m, degree + 2), with the Taylor series of the distances from flank lines.

    A flank line is the displacement at which the flanks of a mesh touch; the first index is 0 for
    the coast and 1 for the drive side, the second is the mesh. The last column, the sum of the
    magnitudes of the terms of a distance at the start, scales its rounding error. `terms`, (degree
    + 1, n), is the Taylor series of the state.
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

    Row k of `terms`, shape (degree + 1, n or more), is multiplied by fraction^k (Horner's scheme).
    """
    for r in range(n):
        state[r] = terms[terms.shape[0] - 1, r]
    for k in range(terms.shape[0] - 2, -1, -1):
        for r in range(n):
            state[r] = state[r] * fraction + terms[k, r]


@kernel_without_refcounts
def advance_by_series(system, constants, effects, length, z, terms):
    """Advance a state z, or a perturbation of it, by the time `length` in theta, in place.

    `effects`, int, (m,), has a number for the contact and stiffness level of each mesh, which do
    not change in this time. `terms` is overwritten with Taylor series of z, one for each step.
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

    Row `curve` holds the coefficients of the distance's Taylor series up to `degree`, then the
    magnitude that scales its rounding error. `sign`, 1 or -1, is the present sign of the distance.
    If the constant exceeds the sum of the magnitudes of all other coefficients, there is no zero.
    """
    variation = 0.0
    for k in range(1, degree + 1):
        variation += abs(curve[k])
    return not sign * curve[0] > variation + 1e-14 * curve[degree + 1]
