"""Taylor series of the motion of a nonlinear mesh, Eq. (3) with one degree of freedom.

In units of the static deflection and mesh phase, for one contact state and one sign of x',

    x'' = F(tau) - e x - d1 x' - d2 |x'| x' - d3 x'^3 - c(tau) (g + p2 |g| g + p3 g^3),

all terms are polynomials in x, x' and the series of c and F. The coefficients of the solution
therefore follow from each other by Cauchy products. F, e and c contain the factor 1 / nu^2. The
newest coefficient enters a product linearly and is added last, so that the processor can compute
the other sums in parallel.
"""

from typing import NamedTuple

import numpy as np

from gearlib.engines.codes import COAST, DRIVE, NO_CONTACT
from gearlib.engines.jit import kernel_part
from gearlib.engines.matrices import copy
from gearlib.engines.pair.motion import cos_sin

#: Degree of the series. The cost of a step grows with its square, and the length of a step at most
#: with its logarithm; the cost per unit of phase hardly changes between degrees 16 and 24.
ORDER = 20
#: Entry k is 1 / (k + 1).
INVERSE_INTEGERS = 1.0 / np.arange(1, ORDER + 2)

# Steps use plain arrays, because counting references of named tuples costs more than the sums.
#: Rows of the array of series: x, x', elastic deflection, stiffness, deflection with its powers,
#: mesh force, squares of deflection and x', excitation, a polynomial in the fraction of a step.
(
    DISPLACEMENT,
    VELOCITY,
    DEFLECTION,
    STIFFNESS,
    SPRING_FORCE,
    MESH_FORCE,
    DEFLECTION_SQUARE,
    VELOCITY_SQUARE,
    EXTERNAL_FORCE,
    SCALED,
) = range(10)
ROWS = 10
#: Columns of the constants of a contact state in a segment of c(tau): damping, powers of the
#: stiffness (with the sign of the flank), flank line, stiffness at the start of the segment, its
#: slope and the phase at the start. The other columns are equal in all rows.
(D1, D2, D3, P2, P3, FLANK_LINE, START_STIFFNESS, STIFFNESS_SLOPE, START_PHASE) = range(9)
(GROUND_STIFFNESS, MEAN_FORCE, DRIVE_LINE, COAST_LINE, TUNING, STEP_SCALE) = range(9, 15)
COLUMNS = 15
#: Index of the excitation in the harmonics; indices 0 to 2 are stiffnesses by contact state + 1.
EXCITATION = 3


class NonlinearMesh(NamedTuple):
    """Dimensionless constants and tables of a nonlinear mesh at one tuning."""

    tuning: float
    backlash_ratio: float  #: drive_line - coast_line, in static deflections
    drive_damping: np.ndarray  #: coefficients d1, d2, d3 in drive-side contact, shape (3,)
    backlash_damping: np.ndarray  #: d1, d2, d3 in free flight, shape (3,)
    stiffness_powers: np.ndarray  #: p2, p3 of the contact stiffness, shape (2,)
    segment_bounds: np.ndarray  #: phases that bound the segments of c(tau), (m + 1,), 0 to 2 pi
    stiffness_segments: np.ndarray  #: c at the start of each segment and its slope, shape (m, 2)
    below_mean: np.ndarray  #: bool, whether c is below its mean in a segment, shape (m,)
    stiffness_harmonics: np.ndarray  #: harmonics of c: order, cosine, sine, shape (j, 3)
    force_harmonics: np.ndarray  #: harmonics of F: order (0: mean), cosine, sine, shape (k, 3)
    tolerance: float  #: truncation error of a step, in static deflections
    # Gear pairs have the drive-side flank line at 0, equal coefficients of both flanks, and e = 0.
    drive_line: float  #: displacement at which the drive-side flanks touch
    coast_line: float  #: displacement at which the coast-side flanks touch
    ground_stiffness: float  #: e, stiffness of a spring to x = 0 in all contact states
    coast_damping: np.ndarray  #: d1, d2, d3 in coast-side contact, shape (3,)
    coast_stiffness_segments: np.ndarray  #: `stiffness_segments` of the coast flank
    coast_stiffness_harmonics: np.ndarray  #: `stiffness_harmonics` of the coast flank


@kernel_part(inlined=True)
def damping_coefficients(mesh, contact_state):
    """Return the damping coefficients d1, d2, d3, shape (3,), for a contact state.

    They multiply x', |x'| x' and x'^3. The contact state is drive 1, none 0 or coast -1; `mesh` is
    a `NonlinearMesh`.
    """
    if contact_state == NO_CONTACT:
        return mesh.backlash_damping
    return mesh.drive_damping if contact_state == DRIVE else mesh.coast_damping


@kernel_part(inlined=True)
def _fill_harmonics(harmonics, series_terms):
    """Tabulate the factors of the Taylor series of harmonics; return the mean, the order 0.

    `harmonics`, shape (j, 3), has the columns order n, cosine and sine coefficient. Each row of
    `series_terms`, shape (j, ORDER + 4), is filled with these three values, followed by n^k / k!,
    the Taylor coefficients of cosine and sine, with the signs of their derivatives. Order 0 is
    omitted.
    """
    mean, row = 0.0, 0
    for i in range(harmonics.shape[0]):
        order = harmonics[i, 0]
        if order == 0.0:
            mean += harmonics[i, 1]
            continue
        copy(harmonics[i], series_terms[row, :3])
        # n^k / k! with the signs of the derivatives of cosine and sine.
        series_terms[row, 3], series_terms[row, 4] = 1.0, order
        for k in range(2, ORDER + 1):
            series_terms[row, 3 + k] = -order * order * series_terms[row, 1 + k] / (k * (k - 1.0))
        row += 1
    return mean


@kernel_part
def tabulate_mesh(mesh):
    """Return (constants, harmonics) of a `NonlinearMesh` for the Taylor steps.

    `constants` has the shape (3, m, COLUMNS), by contact state (drive 1, none 0, coast -1) + 1 and
    segment of the piecewise linear stiffness. `harmonics` has the shape (4, n, ORDER + 4): the
    first index is the contact state + 1 for harmonics of the stiffness, or EXCITATION. A row of
    zeros follows the last harmonic.
    """
    max_count = max(
        mesh.stiffness_harmonics.shape[0],
        mesh.coast_stiffness_harmonics.shape[0],
        mesh.force_harmonics.shape[0],
    )
    constants = np.empty((3, mesh.stiffness_segments.shape[0], COLUMNS))
    harmonics = np.zeros((4, max_count + 1, ORDER + 4))
    mean_force = _fill_harmonics(mesh.force_harmonics, harmonics[EXCITATION])
    for contact_state in (COAST, NO_CONTACT, DRIVE):
        # In free flight, the stiffness of the drive side is recorded, but there is no mesh force.
        is_coast = contact_state == COAST
        harmonics_of_side = mesh.coast_stiffness_harmonics if is_coast else mesh.stiffness_harmonics
        mean = _fill_harmonics(harmonics_of_side, harmonics[contact_state + 1])
        stiffness_segments = mesh.coast_stiffness_segments if is_coast else mesh.stiffness_segments
        damping = damping_coefficients(mesh, contact_state)
        # Deflections are negative on the coast side, so quadratic terms change their sign.
        sign = 1.0 if contact_state == DRIVE else -1.0
        for segment in range(stiffness_segments.shape[0]):
            row = constants[contact_state + 1, segment]
            row[D1], row[D2], row[D3] = damping[0], damping[1], damping[2]
            row[P2], row[P3] = sign * mesh.stiffness_powers[0], mesh.stiffness_powers[1]
            row[FLANK_LINE] = mesh.coast_line if is_coast else mesh.drive_line
            row[START_STIFFNESS] = stiffness_segments[segment, 0] + mean
            row[STIFFNESS_SLOPE] = stiffness_segments[segment, 1]
            row[START_PHASE], row[MEAN_FORCE] = mesh.segment_bounds[segment], mean_force
            row[GROUND_STIFFNESS], row[TUNING] = mesh.ground_stiffness, mesh.tuning
            row[DRIVE_LINE], row[COAST_LINE] = mesh.drive_line, mesh.coast_line
            row[STEP_SCALE] = mesh.tolerance ** (1.0 / ORDER)
    return constants, harmonics


@kernel_part(inlined=True)
def _add_harmonics(harmonics, group, phase, series, quantity):
    """Add the Taylor coefficients of harmonics at a phase to the row `quantity` of `series`.

    `harmonics`, shape (4, n, ORDER + 4), is a result of `tabulate_mesh`. Its first index `group` is
    a contact state + 1 or EXCITATION; a row has the order, the cosine and sine coefficient, and n^k
    / k! with signs.
    """
    for j in range(harmonics.shape[1]):
        order = harmonics[group, j, 0]
        # A row of zeros ends the group.
        if order == 0.0:
            break
        cosine, sine = cos_sin(order * phase)
        even = harmonics[group, j, 1] * cosine + harmonics[group, j, 2] * sine
        odd = harmonics[group, j, 2] * cosine - harmonics[group, j, 1] * sine
        for k in range(0, ORDER, 2):
            series[quantity, k] += harmonics[group, j, 3 + k] * even
            series[quantity, k + 1] += harmonics[group, j, 4 + k] * odd
        series[quantity, ORDER] += harmonics[group, j, 3 + ORDER] * even


@kernel_part(inlined=True)
def _square_and_cube_terms(series, quantity, square_quantity, k):
    """Return coefficient k of a^2 and of a^3 without the terms 2 a_0 a_k and 3 a_0^2 a_k.

    The caller adds these terms last, because they need the newest coefficient a_k. The row
    `quantity` of `series` holds the power series a, and the row `square_quantity` holds the
    coefficients of a^2 up to k - 1.
    """
    constant_term = series[quantity, 0]
    # With the terms 2 a_0^2 and 3 a_0^3 that the caller adds, the sums are a_0^2 and a_0^3.
    if k == 0:
        return -constant_term * constant_term, -2.0 * constant_term * constant_term * constant_term
    square_sum, cube_sum, cube_tail = 0.0, 0.0, 0.0
    if k % 2 == 0:
        square_sum = 0.5 * series[quantity, k // 2] * series[quantity, k // 2]
        cube_sum = series[square_quantity, k // 2] * series[quantity, k // 2]
    half = (k + 1) // 2
    for j in range(1, half):
        # The newest coefficients come last in the sums.
        i = half - j
        square_sum += series[quantity, i] * series[quantity, k - i]
        cube_sum += series[square_quantity, i] * series[quantity, k - i]
        cube_tail += series[square_quantity, k - i] * series[quantity, i]
    square_sum *= 2.0
    return square_sum, cube_sum + cube_tail + square_sum * constant_term


@kernel_part(inlined=True)
def _product_coefficient(series, quantity, other_quantity, k):
    """Return coefficient k of the product of two power series, a sum of k + 1 products.

    `quantity` and `other_quantity` are their rows in `series`. The newest coefficients are added
    last, so that the processor can compute the other sums in parallel.
    """
    if k == 0:
        return series[quantity, 0] * series[other_quantity, 0]
    first_sum, second_sum = 0.0, 0.0
    if k % 2 == 0:
        first_sum = series[quantity, k // 2] * series[other_quantity, k // 2]
    half = (k + 1) // 2
    for j in range(1, half):
        i = half - j
        first_sum += series[quantity, i] * series[other_quantity, k - i]
        second_sum += series[quantity, k - i] * series[other_quantity, i]
    return (
        (first_sum + series[quantity, k] * series[other_quantity, 0])
        + second_sum
        + series[quantity, 0] * series[other_quantity, k]
    )


@kernel_part
def expand_motion(
    constants, harmonics, segment, phase, contact_state, velocity_sign, x, v, series, term_count
):
    """Fill the Taylor series of the motion that starts from (x, v) at a phase of a segment.

    The contact state (drive 1, none 0, coast -1) and the sign of the velocity are constant during
    the step. `constants` and `harmonics` are results of `tabulate_mesh`; `segment` is the index of
    a segment of the piecewise linear stiffness. `series`, shape (ROWS, ORDER + 1), is filled with
    `term_count` <= ORDER coefficients of the velocity beyond the constant.
    """
    i = contact_state + 1
    d1, d3 = constants[i, segment, D1], constants[i, segment, D3]
    d2 = velocity_sign * constants[i, segment, D2]
    p2, p3 = constants[i, segment, P2], constants[i, segment, P3]
    ground = constants[i, segment, GROUND_STIFFNESS]
    stiffness_slope = constants[i, segment, STIFFNESS_SLOPE]
    segment_phase = phase - constants[i, segment, START_PHASE]
    stiffness = constants[i, segment, START_STIFFNESS] + stiffness_slope * segment_phase
    is_touching, has_harmonics = contact_state != NO_CONTACT, harmonics[i, 0, 0] != 0.0
    has_nonlinear_damping, has_nonlinear_stiffness = d2 != 0.0 or d3 != 0.0, p2 != 0.0 or p3 != 0.0
    for k in range(ORDER + 1):
        series[EXTERNAL_FORCE, k] = 0.0
        series[STIFFNESS, k] = 0.0
    series[EXTERNAL_FORCE, 0] = constants[i, segment, MEAN_FORCE]
    series[STIFFNESS, 0], series[STIFFNESS, 1] = stiffness, stiffness_slope
    _add_harmonics(harmonics, EXCITATION, phase, series, EXTERNAL_FORCE)
    _add_harmonics(harmonics, i, phase, series, STIFFNESS)
    u = x - constants[i, segment, FLANK_LINE]
    series[DISPLACEMENT, 0], series[VELOCITY, 0], series[DEFLECTION, 0] = x, v, u
    # Factors of the newest coefficients of x' and of the deflection.
    damping_factor = d1 + (2.0 * d2 + 3.0 * d3 * v) * v
    square_factor, stiffness_factor = 2.0 * u, 1.0 + (2.0 * p2 + 3.0 * p3 * u) * u
    force, previous_spring_force = 0.0, 0.0
    for k in range(term_count):
        if is_touching:
            spring_force = series[DEFLECTION, k]
            if has_nonlinear_stiffness:
                square, cube = _square_and_cube_terms(series, DEFLECTION, DEFLECTION_SQUARE, k)
                series[DEFLECTION_SQUARE, k] = square + square_factor * spring_force
                spring_force = stiffness_factor * spring_force + (p2 * square + p3 * cube)
            series[SPRING_FORCE, k] = spring_force
            force = (
                _product_coefficient(series, STIFFNESS, SPRING_FORCE, k)
                if has_harmonics
                else stiffness * spring_force + stiffness_slope * previous_spring_force
            )
            previous_spring_force = spring_force
        series[MESH_FORCE, k] = force
        acceleration = series[EXTERNAL_FORCE, k] - force - ground * series[DISPLACEMENT, k]
        newest = series[VELOCITY, k]
        if has_nonlinear_damping:
            square, cube = _square_and_cube_terms(series, VELOCITY, VELOCITY_SQUARE, k)
            series[VELOCITY_SQUARE, k] = square + 2.0 * v * newest
            acceleration -= d2 * square + d3 * cube
        series[DISPLACEMENT, k + 1] = series[DEFLECTION, k + 1] = newest * INVERSE_INTEGERS[k]
        series[VELOCITY, k + 1] = (acceleration - damping_factor * newest) * INVERSE_INTEGERS[k]
    # The last term of the mesh force is below rounding.
    series[MESH_FORCE, ORDER] = 0.0


@kernel_part(inlined=True)
def step_length(constants, series, max_step):
    """Return the longest step up to `max_step` for which the last series terms are negligible.

    `series` holds the Taylor series of the motion. `constants`, shape (3, m, COLUMNS), holds
    tolerance ** (1 / ORDER) and the tuning (mesh frequency over natural frequency), which converts
    velocities by phase to velocities by natural time. The last two terms show how fast the terms
    decrease; one of them may vanish by symmetry.
    """
    tuning, step_scale = constants[0, 0, TUNING], constants[0, 0, STEP_SCALE]
    state_size, step_ratio = max(1.0, abs(series[DISPLACEMENT, 0])), max_step / step_scale
    last_term = (
        max(abs(series[DISPLACEMENT, ORDER]), tuning * abs(series[VELOCITY, ORDER])) / state_size
    )
    if last_term * step_ratio**ORDER > 1.0:
        step_ratio = last_term ** (-1.0 / ORDER)
    last_term = (
        max(abs(series[DISPLACEMENT, ORDER - 1]), tuning * abs(series[VELOCITY, ORDER - 1]))
        / state_size
    )
    if last_term * step_ratio ** (ORDER - 1) > 1.0:
        step_ratio = last_term ** (-1.0 / (ORDER - 1))
    return min(step_ratio * step_scale, max_step)


@kernel_part(inlined=True)
def state_at(series, t):
    """Return (x, x') of a Taylor series at the phase t after its start.

    `series` has the rows DISPLACEMENT and VELOCITY. Even and odd powers are summed separately, so
    that the processor can add them in parallel.
    """
    square = t * t
    x, odd_x = series[DISPLACEMENT, ORDER], series[DISPLACEMENT, ORDER - 1]
    v, odd_v = series[VELOCITY, ORDER], series[VELOCITY, ORDER - 1]
    for k in range(ORDER - 2, 0, -2):
        x, odd_x = (
            x * square + series[DISPLACEMENT, k],
            odd_x * square + series[DISPLACEMENT, k - 1],
        )
        v, odd_v = v * square + series[VELOCITY, k], odd_v * square + series[VELOCITY, k - 1]
    return series[DISPLACEMENT, 0] + (t * odd_x + square * x), series[VELOCITY, 0] + (
        t * odd_v + square * v
    )
