"""Derivatives in 50 digits, by differences of `tests.physics.high_precision.propagate`.

Of a step of 1e-22 one difference keeps 22 digits, so that one side suffices: of the limits of the
contact ratio, or of no backlash, there is only one. Orbits and folds are solved for on both sides.
Away from 0 a parameter goes by a wider step, since the closed forms of `Arc` divide by the damping.
"""

import mpmath
from mpmath import mpf

from tests.physics.high_precision import propagate

_STEP = mpf(10) ** -22
_FROM_ZERO = mpf(10) ** -12
_APART = mpf(10) ** -10
FIELDS = (
    "max_stiffness",
    "stiffness_ratio",
    "contact_ratio",
    "reduced_mass",
    "load",
    "backlash",
    "material_damping",
    "backlash_damping",
)


def _record(ratios, tuning, periods, state):
    """Return what is differentiated: final state, extrema and times of the last period, event."""
    arcs: list = []
    x, v, events = propagate(*ratios, tuning, periods, state, arcs)
    epsilon, kappa, *_, far = ratios
    most = 1 / (kappa + (1 - kappa) * (epsilon - 1))
    heights, forces = [], []
    times = [mpf(0)] * 4
    for period, arc, lasts, contact, c in arcs:
        if period < periods - 1:
            continue
        places = [mpf(0), *arc.turning_points(lasts), lasts]
        values = [arc.x0, *(arc.at(t)[0] for t in places[1:])]
        heights += [value - far if contact == -1 else value for value in values]
        forces += [c * value if contact else mpf(0) for value in values]
        times[1 - contact] += lasts
        if contact and c < most:
            times[3] += lasts
    last = [event for event in events if event[0] > 2 * mpmath.pi * (periods - 1)]
    event = (last[-1][0], last[-1][3]) if last else ()
    extrema = max(heights), min(heights), max(forces), min(forces)
    return [x, v, *extrema, *times, *event], len(events)


def of_run(ratios, tuning, periods, state):
    """Return the derivatives by the five ratios, the tuning and the start, a row each.

    Columns: displacement and velocity at the end; of the last period the extrema of displacement
    and force, the times in normal mesh, backlash, inverse mesh and in mesh at C_min; phase and
    velocity of its last event where there is one, and the change leaves the number of events.
    """
    values = [*map(mpf, ratios), mpf(tuning), *map(mpf, state)]
    base, count = _record(values[:5], values[5], periods, values[6:])
    rows = []
    for j in range(8):
        step = _STEP if values[j] or j > 5 else _FROM_ZERO
        step = -step if j == 0 and ratios[0] == 2.0 else step
        moved = list(values)
        moved[j] += step
        other, same = _record(moved[:5], moved[5], periods, moved[6:])
        length = len(base) if same == count else 10
        rows.append([(b - a) / step for a, b in zip(base[:length], other[:length], strict=False)])
    return rows


def ratios_of(fields):
    """Return the ratios of a pair in SI units, by the definitions in `docs/theory/model.md`."""
    stiffness, kappa, epsilon, mass, load, backlash, material, oil = fields
    mean = stiffness * (kappa + (1 - kappa) * (epsilon - 1))
    unit = 2 * mass * mpmath.sqrt(mean / mass)
    return [epsilon, kappa, material / unit, oil / unit, backlash * mean / load]


def of_fields(fields, tuning, periods, state):
    """Return the derivatives by the fields of a pair, as `of_run`."""
    values, start = [mpf(value) for value in fields], [*map(mpf, state)]
    base, _ = _record(ratios_of(values), mpf(tuning), periods, start)
    rows = []
    for j, value in enumerate(values):
        moved = list(values)
        moved[j] += _STEP * value
        other, _ = _record(ratios_of(moved), mpf(tuning), periods, start)
        pairs = zip(base, other, strict=True)
        rows.append([(b - a) / (_STEP * value) for a, b in pairs])
    return rows


def _map(ratios, tuning, period, z):
    """Return (end, map) of one repeat, the map by differences."""
    end = mpmath.matrix(propagate(*ratios, tuning, period, z)[:2])
    columns = []
    for j in range(2):
        moved = list(z)
        moved[j] += _STEP
        columns.append((mpmath.matrix(propagate(*ratios, tuning, period, moved)[:2]) - end) / _STEP)
    return end, mpmath.matrix([[columns[j][i] for j in range(2)] for i in range(2)])


def _orbit(ratios, tuning, period, guess):
    """Return (state, multipliers, largest first and with positive imaginary part first)."""
    z = mpmath.matrix(list(map(mpf, guess)))
    for _ in range(4):
        end, matrix = _map(ratios, tuning, period, list(z))
        z = z + mpmath.lu_solve(mpmath.eye(2) - matrix, end - z)
    _, matrix = _map(ratios, tuning, period, list(z))
    half, product = (matrix[0, 0] + matrix[1, 1]) / 2, mpmath.det(matrix)
    root = mpmath.sqrt(half * half - product)
    return z, sorted((half + root, half - root), key=lambda mu: (-abs(mu), -mpmath.im(mu)))


def of_orbit(ratios, tuning, period, guess):
    """Return the derivatives of an orbit by the five ratios and the tuning, a row each.

    Columns: state at tau = 0, then real and imaginary part of both multipliers.
    """
    values, rows = [*map(mpf, ratios), mpf(tuning)], []
    for j in range(6):
        sides = []
        for sign in (1, -1):
            moved = list(values)
            moved[j] += sign * _APART
            z, (first, second) = _orbit(moved[:5], moved[5], period, guess)
            parts = [f(mu) for mu in (first, second) for f in (mpmath.re, mpmath.im)]
            sides.append([*z, *parts])
        rows.append([(a - b) / (2 * _APART) for a, b in zip(*sides, strict=True)])
    return rows


def _fold(ratios, period, guess):
    """Return the tuning of a fold: an orbit whose map has the multiplier 1."""

    def residual(y):
        end, matrix = _map(ratios, y[2], period, [y[0], y[1]])
        return mpmath.matrix([end[0] - y[0], end[1] - y[1], mpmath.det(matrix - mpmath.eye(2))])

    y, step = mpmath.matrix(list(map(mpf, guess))), mpf(10) ** -11
    for _ in range(5):
        miss, jacobian = residual(y), mpmath.matrix(3, 3)
        for j in range(3):
            moved = y.copy()
            moved[j] += step
            jacobian[:, j] = (residual(moved) - miss) / step
        y = y - mpmath.lu_solve(jacobian, miss)
    return y[2]


def of_fold(ratios, period, guess):
    """Return the derivatives of the tuning of a fold by the five ratios, one row."""
    values, row = list(map(mpf, ratios)), []
    for j in range(5):
        sides = []
        for sign in (1, -1):
            moved = list(values)
            moved[j] += sign * _APART
            sides.append(_fold(moved, period, guess))
        row.append((sides[0] - sides[1]) / (2 * _APART))
    return [row]
