"""Compute the reference motions of the test problems in 50 or more digits.

A run is repeated with more digits until two runs agree far below the last digit of a float, so that
no method is measured by another method or by itself. The reference of a gear train is an exact run,
which a test confirms with two other codes to `TRAIN_ACCURACY`.

The runs are power series of the motion between changes of contact. As long as the contact code and
the segment of the mesh period do not change, the state z follows

    z' = A z - d z[1]^3 e_1,

where d is the cubic damping. The truncation error of the series limits the step length, which is at
most a quarter of a radian of the natural oscillation. A step ends where the contact code changes,
which is found by bisection. Only the matrices of six degrees of freedom are taken from the library;
otherwise nothing is shared with the methods whose errors are measured.
"""

import math
from collections.abc import Sequence
from decimal import Decimal, getcontext, localcontext
from functools import reduce
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from gearlib.data.result import result_of_many, stacked
from gearlib.engines.codes import COAST, DRIVE, NO_CONTACT
from gearlib.models.pair import GearPair
from gearlib.models.single_mesh_system import state_matrix_by_phase
from gearlib.studies.trials import problems

#: Additional digits for the rounding errors of about a thousand sums in a step.
GUARD_DIGITS = 10
#: Steps per radian of the natural oscillation, at least.
_STEPS_PER_RADIAN = 4
_CODES = (COAST, NO_CONTACT, DRIVE)
#: Function that converts arrays and lists of numbers to arrays of `Decimal`.
decimals = np.vectorize(Decimal, otypes=[object])


class Equations(NamedTuple):
    """Equations z' = A z - d z[1]^3 e_1 of a model at one tuning; arrays are of `Decimal`."""

    matrices: dict  #: (contact code, segment) -> A, shape (n, n)
    cubic: dict  #: contact code -> cubic damping d
    bounds: list  #: phases that bound the segments, 0 to 2 pi
    lines: np.ndarray  #: lines @ z: distances from drive-side and coast-side contact
    start: np.ndarray  #: z at rest at the beginning of drive-side contact


def precise_run(
    model: Any, tuning: float, periods: int, digits: int, state: Sequence | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the final (x, dx/dtau) of a run, the phases of its contact events and their codes.

    `model` is a `GearPair`, a `SixDegreePair`, or a `OneDegreePair` with cubic damping; `digits`
    are the correct decimal digits of each step; `state` is (x, dx/dtau) at tau = 0 for one degree
    of freedom, None for rest on the drive-side flank. Codes (before, after) have the shape (n, 2).
    """
    with localcontext(prec=digits + GUARD_DIGITS):
        # Only models with one degree of freedom have a scalar equation of motion.
        equations = (_six_degrees if model.equation is None else _one_degree)(model, tuning)
        z, contact, phases, codes = equations.start, DRIVE, [], []
        # The rows of A in z' = A z for derivatives of displacements do not depend on the contact.
        derivative_matrix = equations.matrices[NO_CONTACT, 0]
        if state is not None:
            z = decimals([*state, 1])
            # Contact may begin or end at the start, so the contact code shortly after it is used.
            next_state = z + derivative_matrix @ z * Decimal(10) ** -digits
            contact = _contact_code(equations.lines @ next_state)
        for period in range(periods):
            for segment, (phase, end) in enumerate(pairwise(equations.bounds)):
                while phase < end:
                    matrix, cubic = equations.matrices[contact, segment], equations.cubic[contact]
                    series = _series(matrix, cubic, z)
                    # A radian of the natural oscillation is nu radians of the mesh phase.
                    limits = Decimal(tuning) / _STEPS_PER_RADIAN, end - phase
                    length = min(_step_length(series), *limits)
                    distances = (equations.lines @ series.T).tolist()
                    length, next_contact = _end_of_step(contact, distances, length)
                    z, phase = _series_value(series, length), phase + length
                    if next_contact != contact:
                        phases.append(2 * period * _pi() + phase)
                        codes.append((contact, next_contact))
                        contact = next_contact
        derivatives = derivative_matrix @ z
        end_state = np.array([equations.lines[0] @ z, equations.lines[0] @ derivatives])
        return end_state, np.array(phases, object), np.array(codes, np.int8).reshape(-1, 2)


def _one_degree(model: Any, tuning: float) -> Equations:
    """Return the equations of a model with one degree of freedom, state z = (x, dx/dtau, 1)."""
    pair, nu = model.pair, Decimal(tuning)
    ratios = pair.contact_ratio, pair.stiffness_ratio, pair.backlash_ratio
    epsilon, kappa, backlash = map(Decimal, ratios)
    mean, matrices = kappa + (1 - kappa) * (epsilon - 1), {}
    for code in _CODES:
        in_contact = code != NO_CONTACT
        ratio = Decimal(pair.damping_ratio if in_contact else pair.backlash_damping_ratio)
        for segment, level in enumerate((Decimal(1), kappa, Decimal(1))):
            stiffness = level / mean / nu**2 if in_contact else 0
            load = 1 / nu**2 - (stiffness * backlash if code == COAST else 0)
            rows = [[0, 1, 0], [-stiffness, -2 * ratio / nu, load], [0, 0, 0]]
            matrices[code, segment] = decimals(rows)
    # Rows of the damping are the contact codes -1, 0 and 1; the last column is cubic damping.
    cubic = {code: Decimal(model.equation.damping[code + 1, 2]) * nu for code in _CODES}
    coast_line = [0, 0, 1] if backlash.is_infinite() else [1, 0, backlash]
    lines = decimals([[1, 0, 0], coast_line])
    return Equations(matrices, cubic, _segment_bounds(epsilon), lines, decimals([0, 0, 1]))


def _six_degrees(model: Any, tuning: float) -> Equations:
    """Return the equations of a `SixDegreePair`, with the state z of its `TrainSystem`.

    z has two rotations, displacements of elastic bearings, and the derivatives of all of these.
    """
    system, pitch_phase = model.system(tuning), Decimal(model.pitch_phase)
    segments = range(system.starts.size - 1)
    matrices = {
        (code, segment): decimals(state_matrix_by_phase(system, [code], segment))
        for code in _CODES
        for segment in segments
    }
    # Each start of a segment, a float, is replaced by the nearest decimal.
    phases = _segment_bounds(Decimal(model.pair.contact_ratio))
    phases += [(pitch_phase + k * _pi()) % (2 * _pi()) for k in range(2)]
    bounds = [min(phases, key=lambda phase: abs(float(phase) - start)) for start in system.starts]
    lines = decimals([system.drive_lines[0], system.coast_lines[0]])
    z = decimals(model.full_state(system, (0.0, 0.0)))
    # Correct the first rotation and its velocity: the start is at rest where contact begins.
    coordinate_count = 2 + len(model.elastic_bearings())
    z[0] -= lines[0] @ z
    z[coordinate_count] -= lines[0] @ (matrices[NO_CONTACT, 0] @ z)
    return Equations(matrices, dict.fromkeys(_CODES, 0), bounds, lines, z)


def _pi() -> Decimal:
    """Return pi in the current decimal precision, by the Gauss-Legendre iteration."""
    a, b, total = Decimal(1), Decimal("0.5").sqrt(), Decimal("0.25")
    for k in range(getcontext().prec.bit_length()):
        total -= 2**k * ((a - b) / 2) ** 2
        a, b = (a + b) / 2, (a * b).sqrt()
    return (a + b) ** 2 / (4 * total)


def _segment_bounds(contact_ratio: Decimal) -> list[Decimal]:
    """Return the mesh phases, 0 to 2 pi, that bound the segments of constant stiffness."""
    return [_pi() * multiple for multiple in (0, contact_ratio - 1, 3 - contact_ratio, 2)]


def _contact_code(distances: Sequence[Decimal]) -> int:
    """Return the contact code at distances from the drive-side and the coast-side flank line."""
    if distances[0] >= 0:
        return DRIVE
    return COAST if distances[1] < 0 else NO_CONTACT


def _series(matrix: np.ndarray, cubic: Decimal | int, z: np.ndarray) -> np.ndarray:
    """Return the coefficients of the power series of the motion from z, shape (digits + 1, n).

    `matrix`, shape (n, n), is that of the linear equation, and `cubic` is the cubic damping.
    """
    count = getcontext().prec
    series, squares = np.zeros((count + 1, len(z)), object), np.zeros(count, object)
    series[0] = z
    for k in range(count):
        derivatives, velocities = matrix @ series[k], series[: k + 1, 1]
        if cubic:
            squares[k] = velocities @ velocities[::-1]
            derivatives[1] -= cubic * (squares[: k + 1] @ velocities[::-1])
        series[k + 1] = derivatives / (k + 1)
    return series


def _step_length(series: np.ndarray) -> Decimal:
    """Return the step length at which the last two terms of a series are below the last digit."""
    order = len(series) - 1
    exponent = np.abs(series[-2:]).max().adjusted()
    return Decimal(10.0 ** ((-getcontext().prec - exponent) / order))


def _series_value(series: np.ndarray | list, length: Decimal) -> Any:
    """Return the value of one or more power series at a distance `length` from the centre."""
    return reduce(lambda value, coefficients: value * length + coefficients, series[::-1])


def _end_of_step(contact: int, distances: list, length: Decimal) -> tuple[Decimal, int]:
    """Return the length of a step up to a change of contact, and the contact code after it.

    `distances` are the power series of the distances from both flank lines, `contact` is the code
    at the start, and `length` is the largest length of the step.
    """

    def contact_at(length: Decimal) -> int:
        return _contact_code([_series_value(distance, length) for distance in distances])

    if contact_at(length) == contact:
        return length, contact
    low, high = Decimal(0), length
    for _ in range(4 * getcontext().prec):
        middle = (low + high) / 2
        low, high = (middle, high) if contact_at(middle) == contact else (low, middle)
    return high, contact_at(high)


#: Digits of the runs; each run is checked by the next one until two agree.
DIGITS = (30, 50, 100, 200, 400)
#: Limit on the difference of two runs: 1e-4 of the spacing of floats at 1.
AGREEMENT = Decimal("1e-20")
#: Accuracy of the references of gear trains.
TRAIN_ACCURACY = 1e-11
#: Mesh periods in which the slowest of the damped problems settles to rounding.
SETTLING_PERIODS = 400
#: Half width of central differences: truncation and rounding errors are of equal size.
DIFFERENCE = Decimal("1e-17")
#: Limit on the difference of the states at start and end of a mesh period of an orbit.
MAX_RESIDUAL = 1e-9


def reference(problem: problems.Problem) -> problems.Motion:
    """Return the motion of a test problem, correct to the last digit of a float.

    The number of digits is increased until two runs agree; a gear train is run by method "exact".
    """
    if problem.model.mesh_names:
        return problems.run(problem, "exact")
    arguments = problem.model, problem.tuning, problem.periods
    runs = (precise_run(*arguments, digits) for digits in DIGITS)
    for (last_state, last_phases, last_codes), (state, phases, codes) in pairwise(runs):
        if not np.array_equal(codes, last_codes):
            continue
        differences = np.concatenate([state - last_state, phases - last_phases])
        if (np.abs(differences) <= AGREEMENT).all():
            record_start = 2.0 * math.pi * (problem.periods - problem.record_periods)
            is_recorded = np.array(phases >= record_start, bool)
            event_phases = phases[is_recorded].astype(float)
            return problems.Motion(state.astype(float), event_phases, codes[is_recorded])
    raise ValueError(
        f"periods = {problem.periods} are not allowed for this {type(problem.model).__name__}: "
        f"its motion must be computable with {DIGITS[-1]} digits"
    )


def settled_orbit(problem: problems.Problem) -> tuple[np.ndarray, float]:
    """Return the state and the largest absolute Floquet multiplier of the orbit of a problem.

    The final state of a long run is corrected by a Newton step in 50 digits. Both are NaN if the
    problem does not settle on an orbit of one mesh period.
    """

    def period_map(start: np.ndarray) -> np.ndarray:
        return precise_run(problem.model, problem.tuning, 1, DIGITS[1], start)[0]

    state = problems.run(problem, periods=SETTLING_PERIODS).state
    if problem.settles and np.isfinite(state).all():
        with localcontext(prec=DIGITS[1]):
            start = decimals(state)
            residual = (period_map(start) - start).astype(float)
            if np.abs(residual).max() < MAX_RESIDUAL:
                matrix = problems.period_map_jacobian(period_map, start, DIFFERENCE)
                orbit = state + np.linalg.solve(np.eye(2) - matrix, residual)
                return orbit, problems.largest_multiplier(matrix)
    return np.full(2, math.nan), math.nan


def compute(names: Sequence[str], pair: GearPair, six_degrees: dict, settings: dict) -> xr.Dataset:
    """Return the reference motions, orbits and multipliers of the test problems of these names.

    The other arguments are those of `problems.build`. Orbit and multiplier are NaN for problems
    without an orbit of one mesh period.
    """
    built = {name: problems.build(name, pair, six_degrees, settings) for name in names}
    motions = {name: reference(problem) for name, problem in built.items()}

    def orbit_data(name: str) -> dict:
        orbit, multiplier = settled_orbit(built[name])
        state = motions[name].state
        return {"final_state": state, "orbit_state": orbit, "largest_multiplier": multiplier}

    axes = {"problem": list(names)}
    phases = [motion.phases for motion in motions.values()]
    codes = np.concatenate([motion.codes for motion in motions.values()])
    data = stacked(axes, orbit_data, "component") | {
        "event_problem": ("event", np.repeat(names, [*map(len, phases)])),
        "event_phase": ("event", np.concatenate(phases)),
        "event_from": ("event", codes[:, 0]),
        "event_to": ("event", codes[:, 1]),
    }
    title = "References of the test problems, from 50 digits or more"
    parameters = {"settings": settings, "six_degrees": six_degrees}
    origin = {
        "references": GearPair.references,
        "gear_pair": pair.as_dict(),
        "parameters": parameters,
    }
    return result_of_many(title, data, axes, **origin)


def motion_of(dataset: xr.Dataset, name: str) -> problems.Motion:
    """Return the reference motion of the problem `name` from a dataset of `compute`."""
    events = dataset.isel(event=np.flatnonzero(dataset.event_problem.values == name))
    state, codes = dataset.final_state.sel(problem=name), (events.event_from, events.event_to)
    return problems.Motion(state.values, events.event_phase.values, np.column_stack(codes))
