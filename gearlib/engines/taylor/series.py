"""Taylor series of the nonlinear mesh, Eq. (3) with one degree of freedom.

In static deflections and mesh phase, while one contact code and one sign of x' last,

    x'' = F(tau) - e x - d1 x' - d2 |x'| x' - d3 x'^3 - c(tau) (g + p2 |g| g + p3 g^3),

every term is a polynomial in x, x' and the series of c and F, so that the coefficients of the
solution follow from each other by Cauchy products. F, e and c contain the factor 1 / nu^2. The
newest coefficient enters a product linearly. It is added last, by a factor of its own, so that the
processor can compute the other sums in parallel.
"""

from typing import NamedTuple

import numpy as np

from gearlib.engines.codes import BACKLASH, INVERSE, NORMAL
from gearlib.engines.copies import copy
from gearlib.engines.jit import inlined, kernel
from gearlib.engines.pair.elementary import cos_sin

#: Degree of the series. The cost of a step grows with its square, the length of a step at most with
#: its logarithm; between 16 and 24 the cost per phase hardly changes.
ORDER = 20
_INVERSE = 1.0 / np.arange(1, ORDER + 2)  # of k + 1

# Steps take plain arrays, since the reference counts of named tuples cost more than the sums.
#: Rows of the array of series: x, x', elastic deflection, stiffness, deflection with its powers,
#: mesh force, squares of deflection and x', excitation, a polynomial of the share of a step.
X, V, U, C, G, MESH_FORCE, U_SQUARE, V_SQUARE, FORCE, SCALED = range(10)
ROWS = 10
#: Columns of the constants of a contact code on a piece of c(tau): damping, powers of the
#: stiffness (with the sign of the flank), flank line, stiffness at the start of the piece, its
#: slope and the phase of the start. The other columns are equal in all rows.
(D1, D2, D3, P2, P3, LINE, LEVEL, SLOPE, START) = range(9)
(GROUND, LOAD, UPPER, LOWER, TUNING, STEP_SCALE) = range(9, 15)
COLUMNS = 15
#: Row of the excitation in the array of harmonics, behind stiffnesses by contact code + 1.
EXCITATION = 3


class Law(NamedTuple):
    """Dimensionless constants and tables of the nonlinear mesh at one tuning."""

    tuning: float
    backlash: float  #: in static deflections, drive_line - coast_line
    drive_damping: np.ndarray  #: d1, d2, d3 in drive-side contact, shape (3,)
    backlash_damping: np.ndarray  #: d1, d2, d3 in the backlash, shape (3,)
    stiffness_powers: np.ndarray  #: p2, p3 of the contact stiffness, shape (2,)
    segment_bounds: np.ndarray  #: phases that bound the segments of c(tau), (m + 1,), 0 to 2 pi
    stiffness_lines: np.ndarray  #: c at the start of a segment and its slope, shape (m, 2)
    below_mean: np.ndarray  #: bool, whether c lies below its mean on a segment, shape (m,)
    stiffness_harmonics: np.ndarray  #: added to c: order, cosine, sine, shape (j, 3)
    force_harmonics: np.ndarray  #: of F (order 0 the mean): order, cosine, sine, shape (k, 3)
    tolerance: float  #: truncation error of a step, in static deflections
    # In gear pairs the drive flank lies at 0, both flanks have the same laws, and e = 0.
    drive_line: float  #: displacement of the drive flank
    coast_line: float  #: displacement of the coast flank
    ground_stiffness: float  #: e, stiffness towards x = 0 in all contacts
    coast_damping: np.ndarray  #: d1, d2, d3 in back-side contact, shape (3,)
    coast_stiffness_lines: np.ndarray  #: as `stiffness_lines`, of the coast flank
    coast_stiffness_harmonics: np.ndarray  #: as `stiffness_harmonics`, of the coast flank


@inlined
def damping_of(law, contact):
    """Return the damping coefficients d1, d2, d3 of a contact code, shape (3,)."""
    if contact == BACKLASH:
        return law.backlash_damping
    return law.drive_damping if contact == NORMAL else law.coast_damping


@inlined
def _fill_harmonics(table, rows):
    """Fill `rows` with harmonics and their derivatives; return the mean, the term of order 0.

    `table`, shape (j, 3), has order, cosine and sine; a row gets these and n^k / k! with signs.
    """
    mean, row = 0.0, 0
    for i in range(table.shape[0]):
        n = table[i, 0]
        if n == 0.0:
            mean += table[i, 1]
            continue
        copy(table[i], rows[row, :3])
        # n^k / k! with the signs of the derivatives of cosine and sine.
        rows[row, 3], rows[row, 4] = 1.0, n
        for k in range(2, ORDER + 1):
            rows[row, 3 + k] = -n * n * rows[row, 1 + k] / (k * (k - 1.0))
        row += 1
    return mean


@kernel
def tables(law):
    """Return (constants, harmonics) of a `Law` for the Taylor steps.

    The shapes are (3, m, COLUMNS), by contact code + 1 and piece, and (4, n, ORDER + 4), whose rows
    end with zeros.
    """
    most = max(
        law.stiffness_harmonics.shape[0],
        law.coast_stiffness_harmonics.shape[0],
        law.force_harmonics.shape[0],
    )
    constants = np.empty((3, law.stiffness_lines.shape[0], COLUMNS))
    harmonics = np.zeros((4, most + 1, ORDER + 4))
    load = _fill_harmonics(law.force_harmonics, harmonics[EXCITATION])
    for contact in (INVERSE, BACKLASH, NORMAL):
        # In the backlash the stiffness is recorded, but exerts no force.
        far = contact == INVERSE
        waves = law.coast_stiffness_harmonics if far else law.stiffness_harmonics
        mean = _fill_harmonics(waves, harmonics[contact + 1])
        pieces = law.coast_stiffness_lines if far else law.stiffness_lines
        damping = damping_of(law, contact)
        side = 1.0 if contact == NORMAL else -1.0
        for piece in range(pieces.shape[0]):
            row = constants[contact + 1, piece]
            row[D1], row[D2], row[D3] = damping[0], damping[1], damping[2]
            row[P2], row[P3] = side * law.stiffness_powers[0], law.stiffness_powers[1]
            row[LINE] = law.coast_line if far else law.drive_line
            row[LEVEL], row[SLOPE] = pieces[piece, 0] + mean, pieces[piece, 1]
            row[START], row[GROUND], row[LOAD] = (
                law.segment_bounds[piece],
                law.ground_stiffness,
                load,
            )
            row[UPPER], row[LOWER], row[TUNING] = law.drive_line, law.coast_line, law.tuning
            row[STEP_SCALE] = law.tolerance ** (1.0 / ORDER)
    return constants, harmonics


@inlined
def _add_harmonics(harmonics, group, phase, series, row):
    """Add the Taylor coefficients at `phase` of a group of harmonics to a row of `series`."""
    for j in range(harmonics.shape[1]):
        n = harmonics[group, j, 0]
        if n == 0.0:
            break
        cosine, sine = cos_sin(n * phase)
        even = harmonics[group, j, 1] * cosine + harmonics[group, j, 2] * sine
        odd = harmonics[group, j, 2] * cosine - harmonics[group, j, 1] * sine
        for k in range(0, ORDER, 2):
            series[row, k] += harmonics[group, j, 3 + k] * even
            series[row, k + 1] += harmonics[group, j, 4 + k] * odd
        series[row, ORDER] += harmonics[group, j, 3 + ORDER] * even


@inlined
def _square_and_cube_terms(series, a, square, k):
    """Return the k-th coefficients of a^2 and a^3 without the terms 2 a_0 a_k and 3 a_0^2 a_k.

    `a` and `square` are rows of `series`; the latter, a^2, is filled below k.
    """
    first = series[a, 0]
    if k == 0:
        return -first * first, -2.0 * first * first * first
    total, near, far = 0.0, 0.0, 0.0
    if k % 2 == 0:
        total = 0.5 * series[a, k // 2] * series[a, k // 2]
        near = series[square, k // 2] * series[a, k // 2]
    half = (k + 1) // 2
    for j in range(1, half):
        # Pairs of terms are summed such that the newest coefficients come last.
        i = half - j
        total += series[a, i] * series[a, k - i]
        near += series[square, i] * series[a, k - i]
        far += series[square, k - i] * series[a, i]
    total *= 2.0
    return total, near + far + total * first


@inlined
def _product(series, a, b, k):
    """Return the k-th coefficient of the Cauchy product of rows a and b of `series`.

    The terms are summed such that the newest coefficients come last.
    """
    if k == 0:
        return series[a, 0] * series[b, 0]
    first_sum, second_sum = 0.0, 0.0
    if k % 2 == 0:
        first_sum = series[a, k // 2] * series[b, k // 2]
    half = (k + 1) // 2
    for j in range(1, half):
        i = half - j
        first_sum += series[a, i] * series[b, k - i]
        second_sum += series[a, k - i] * series[b, i]
    return (first_sum + series[a, k] * series[b, 0]) + second_sum + series[a, 0] * series[b, k]


@kernel
def expand(constants, harmonics, piece, phase, contact, sign, x, v, series, terms):
    """Fill the Taylor series of a motion through (x, x') at `phase`, in piece `piece` of c(tau).

    `constants` and `harmonics` are those of `tables`, `sign` is the sign of x' throughout the step.
    `series`, shape (ROWS, ORDER + 1), gets `terms` <= ORDER coefficients of x' beyond the first.
    """
    i = contact + 1
    d1, d2, d3 = constants[i, piece, D1], sign * constants[i, piece, D2], constants[i, piece, D3]
    p2, p3, ground = constants[i, piece, P2], constants[i, piece, P3], constants[i, piece, GROUND]
    slope = constants[i, piece, SLOPE]
    level = constants[i, piece, LEVEL] + slope * (phase - constants[i, piece, START])
    touching, has_harmonics = contact != BACKLASH, harmonics[i, 0, 0] != 0.0
    nonlinear_damping, nonlinear_stiffness = d2 != 0.0 or d3 != 0.0, p2 != 0.0 or p3 != 0.0
    for k in range(ORDER + 1):
        series[FORCE, k] = 0.0
        series[C, k] = 0.0
    series[FORCE, 0] = constants[i, piece, LOAD]
    series[C, 0], series[C, 1] = level, slope
    _add_harmonics(harmonics, EXCITATION, phase, series, FORCE)
    _add_harmonics(harmonics, i, phase, series, C)
    u = x - constants[i, piece, LINE]
    series[X, 0], series[V, 0], series[U, 0] = x, v, u
    # Factors of the newest coefficients of x' and of the deflection.
    damping_factor = d1 + (2.0 * d2 + 3.0 * d3 * v) * v
    square_factor, stiffness_factor = 2.0 * u, 1.0 + (2.0 * p2 + 3.0 * p3 * u) * u
    force, previous = 0.0, 0.0
    for k in range(terms):
        if touching:
            g = series[U, k]
            if nonlinear_stiffness:
                square, cube = _square_and_cube_terms(series, U, U_SQUARE, k)
                series[U_SQUARE, k] = square + square_factor * g
                g = stiffness_factor * g + (p2 * square + p3 * cube)
            series[G, k] = g
            force = _product(series, C, G, k) if has_harmonics else level * g + slope * previous
            previous = g
        series[MESH_FORCE, k] = force
        acceleration = series[FORCE, k] - force - ground * series[X, k]
        newest = series[V, k]
        if nonlinear_damping:
            square, cube = _square_and_cube_terms(series, V, V_SQUARE, k)
            series[V_SQUARE, k] = square + 2.0 * v * newest
            acceleration -= d2 * square + d3 * cube
        series[X, k + 1] = series[U, k + 1] = newest * _INVERSE[k]
        series[V, k + 1] = (acceleration - damping_factor * newest) * _INVERSE[k]
    # The last term of the mesh force is below rounding.
    series[MESH_FORCE, ORDER] = 0.0


@inlined
def step_length(constants, series, longest):
    """Return the longest step, at most `longest`, whose last terms stay below the tolerance.

    The last two terms show how fast the terms decrease (one may vanish by symmetry). Velocities
    count as the displacement that they cause in 1 / nu of phase.
    """
    tuning, scale = constants[0, 0, TUNING], constants[0, 0, STEP_SCALE]
    size, ratio = max(1.0, abs(series[X, 0])), longest / scale
    last = max(abs(series[X, ORDER]), tuning * abs(series[V, ORDER])) / size
    if last * ratio**ORDER > 1.0:
        ratio = last ** (-1.0 / ORDER)
    last = max(abs(series[X, ORDER - 1]), tuning * abs(series[V, ORDER - 1])) / size
    if last * ratio ** (ORDER - 1) > 1.0:
        ratio = last ** (-1.0 / (ORDER - 1))
    return min(ratio * scale, longest)


@inlined
def state_at(series, t):
    """Return x and x' at the phase t after the start of a series, summed by even and odd powers."""
    square = t * t
    x, odd_x = series[X, ORDER], series[X, ORDER - 1]
    v, odd_v = series[V, ORDER], series[V, ORDER - 1]
    for k in range(ORDER - 2, 0, -2):
        x, odd_x = x * square + series[X, k], odd_x * square + series[X, k - 1]
        v, odd_v = v * square + series[V, k], odd_v * square + series[V, k - 1]
    return series[X, 0] + (t * odd_x + square * x), series[V, 0] + (t * odd_v + square * v)
