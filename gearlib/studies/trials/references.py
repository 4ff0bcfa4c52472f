"""Compute the reference motions of the test problems with 50 or more digits.

Each run is repeated with more digits until two runs agree to far more digits than the precision of
floats, so that references do not depend on the methods under test. The reference of a gear train is
an exact run, which a test confirms with two other programs to `TRAIN_ACCURACY`.

Between changes of contact, the motion is computed as a power series. As long as the contact state
and the segment of the mesh period do not change, the state z satisfies

    z' = A z - d z[1]^3 e_1,

where d is the cubic damping. The truncation error of the series limits the step length, whose
maximum is a quarter of a radian of the natural oscillation. A step ends where the contact state
changes, which is found by bisection. Only the matrices of six degrees of freedom are taken from the
library; nothing else is shared with the methods under test.
"""

import math
from collections.abc import Sequence
from decimal import Decimal, getcontext, localcontext
from functools import reduce
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from gearlib.data.result import evaluate_on_grid, make_study_result
from gearlib.engines.codes import COAST, DRIVE, NO_CONTACT
from gearlib.models.pair import GearPair
from gearlib.models.single_mesh_system import state_matrix_by_phase
from gearlib.studies.trials import problems

#: Additional digits, because a step has the rounding errors of about a thousand additions.
GUARD_DIGITS = 10
#: Minimum number of steps per radian of the natural oscillation.
_STEPS_PER_RADIAN = 4
_CODES = (COAST, NO_CONTACT, DRIVE)
#: Function that converts arrays and lists of numbers to arrays of `Decimal`.
to_decimals = np.vectorize(Decimal, otypes=[object])


class Equations(NamedTuple):
    """Equations z' = A z - d z[1]^3 e_1 of a model at one tuning, with `Decimal` numbers."""

    matrices: dict  #: (contact state, segment) -> A, shape (n, n)
    cubic: dict  #: contact state -> cubic damping d
    bounds: list  #: phases that bound the segments, 0 to 2 pi
    gap_rows: np.ndarray  #: gap_rows @ z: distances from drive-side and coast-side flank line
    start: np.ndarray  #: initial z, at rest where drive-side contact begins


def run_precisely(
    model: Any, tuning: float, periods: int, digits: int, state: Sequence | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Run a model with high precision; return final state, event phases and contact states.

    `model` is a `GearPair`, a `SixDegreePair`, or a `OneDegreePair` with cubic damping. `tuning` is
    mesh frequency over natural frequency, and `digits` is the number of correct decimal digits of
    each step. States are (x, dx/dtau) with displacement x and mesh phase tau. The initial `state`
    is None (rest where drive-side contact begins) or, for one degree of freedom, any state. The
    contact states (before, after) of the events have the shape (n, 2).
    """
    with localcontext(prec=digits + GUARD_DIGITS):
        if model.equation is None:
            equations = _six_degree_equations(model, tuning)
        else:  # a scalar equation of motion, one degree of freedom
            equations = _single_degree_equations(model, tuning)
        z = equations.start  # the state in z' = A z
        contact = DRIVE
        phases: list = []
        codes: list = []
        # The rows of A for displacements do not depend on the contact state.
        derivative_matrix = equations.matrices[NO_CONTACT, 0]
        if state is not None:
            z = to_decimals([*state, 1])
            # Contact may begin or end at the initial state, so a slightly later state is used.
            next_state = z + derivative_matrix @ z * Decimal(10) ** -digits
            contact = _contact_state(equations.gap_rows @ next_state)
        # The stiffness is constant within a segment of the mesh period.
        for period in range(periods):
            for segment, (phase, end) in enumerate(pairwise(equations.bounds)):
                while phase < end:
                    matrix, cubic = equations.matrices[contact, segment], equations.cubic[contact]
                    series = _power_series(matrix, cubic, z)
                    # A radian of the natural oscillation is `tuning` radians of the mesh phase.
                    max_length = Decimal(tuning) / _STEPS_PER_RADIAN
                    length = min(_convergent_step_length(series), max_length, end - phase)
                    distances = (equations.gap_rows @ series.T).tolist()
                    length, next_contact = _find_end_of_step(contact, distances, length)
                    z = _evaluate_series(series, length)
                    phase += length
                    if next_contact != contact:
                        phases.append(2 * period * _compute_pi() + phase)
                        codes.append((contact, next_contact))
                        contact = next_contact
        derivatives = derivative_matrix @ z
        end_state = np.array([equations.gap_rows[0] @ z, equations.gap_rows[0] @ derivatives])
        return end_state, np.array(phases, object), np.array(codes, np.int8).reshape(-1, 2)


def _single_degree_equations(model: Any, tuning: float) -> Equations:
    """Return the equations of a model with one degree of freedom, with the state (x, dx/dtau, 1).

    x is the displacement in static deflections, and tau the mesh phase. In the code, nu is the
    tuning (mesh frequency over natural frequency), epsilon the contact ratio, and kappa the
    stiffness ratio.
    """
    pair = model.pair
    nu = Decimal(tuning)
    epsilon = Decimal(pair.contact_ratio)
    kappa = Decimal(pair.stiffness_ratio)
    backlash = Decimal(pair.backlash_ratio)  # static deflections
    mean = kappa + (1 - kappa) * (epsilon - 1)  # mean over maximum stiffness
    matrices = {}
    for code in _CODES:
        in_contact = code != NO_CONTACT
        damping_ratio = Decimal(pair.damping_ratio if in_contact else pair.backlash_damping_ratio)
        for segment, level in enumerate((Decimal(1), kappa, Decimal(1))):
            stiffness = level / mean / nu**2 if in_contact else 0
            load = 1 / nu**2 - (stiffness * backlash if code == COAST else 0)
            rows = [[0, 1, 0], [-stiffness, -2 * damping_ratio / nu, load], [0, 0, 0]]
            matrices[code, segment] = to_decimals(rows)
    # The rows of the damping are in the order of `_CODES`; the last column is cubic damping.
    dampings = zip(_CODES, model.equation.damping[:, -1], strict=True)
    cubic = {code: Decimal(damping) * nu for code, damping in dampings}
    coast_row = [0, 0, 1] if backlash.is_infinite() else [1, 0, backlash]
    gap_rows = to_decimals([[1, 0, 0], coast_row])
    return Equations(matrices, cubic, _segment_bounds(epsilon), gap_rows, to_decimals([0, 0, 1]))


def _six_degree_equations(model: Any, tuning: float) -> Equations:
    """Return the equations of a `SixDegreePair` at a tuning, with the state of its `TrainSystem`.

    The state has two rotations, the displacements of elastic bearings, and the derivatives of both
    with respect to the mesh phase. The tuning is mesh frequency over natural frequency.
    """
    system = model.system(tuning)
    pitch_phase = Decimal(model.pitch_phase)
    segments = range(system.starts.size - 1)
    matrices = {
        (code, segment): to_decimals(state_matrix_by_phase(system, [code], segment))
        for code in _CODES
        for segment in segments
    }
    # The starts of the segments, which are floats, are replaced by the nearest precise phases.
    phases = _segment_bounds(Decimal(model.pair.contact_ratio))
    # Friction changes its sign at these two phases.
    phases += [(pitch_phase + k * _compute_pi()) % (2 * _compute_pi()) for k in range(2)]
    bounds = [min(phases, key=lambda phase: abs(float(phase) - start)) for start in system.starts]
    gap_rows = to_decimals([system.drive_distance_rows[0], system.coast_distance_rows[0]])
    z = to_decimals(model.full_state(system, (0.0, 0.0)))
    # Correct the first rotation and its velocity, so that the initial state is at rest exactly
    # where contact begins.
    coordinate_count = 2 + len(model.elastic_bearings())
    z[0] -= gap_rows[0] @ z
    z[coordinate_count] -= gap_rows[0] @ (matrices[NO_CONTACT, 0] @ z)
    return Equations(matrices, dict.fromkeys(_CODES, 0), bounds, gap_rows, z)


def _compute_pi() -> Decimal:
    """Compute pi with the current decimal precision by the Gauss-Legendre algorithm.

    a is the arithmetic and b the geometric mean of the previous a and b. Each iteration doubles the
    number of correct digits.
    """
    a = Decimal(1)
    b = Decimal("0.5").sqrt()
    total = Decimal("0.25")
    for k in range(getcontext().prec.bit_length()):
        total -= 2**k * ((a - b) / 2) ** 2
        a, b = (a + b) / 2, (a * b).sqrt()
    return (a + b) ** 2 / (4 * total)


def _segment_bounds(contact_ratio: Decimal) -> list[Decimal]:
    """Return the bounds of the segments of constant stiffness, mesh phases from 0 to 2 pi."""
    return [_compute_pi() * multiple for multiple in (0, contact_ratio - 1, 3 - contact_ratio, 2)]


def _contact_state(distances: Sequence[Decimal]) -> int:
    """Return the contact state DRIVE, NO_CONTACT or COAST.

    `distances` are the distances from the displacements at which drive-side and coast-side contact
    begin (the flank lines).
    """
    if distances[0] >= 0:
        return DRIVE
    return COAST if distances[1] < 0 else NO_CONTACT


def _power_series(matrix: np.ndarray, cubic: Decimal | int, z: np.ndarray) -> np.ndarray:
    """Return the power series coefficients of the motion from a state z, shape (order + 1, n).

    The equation is z' = A z - d z[1]^3 e_1, where e_1 is the unit vector of the velocity z[1];
    `matrix` is A, shape (n, n), and `cubic` is the cubic damping d. The order of the series equals
    the number of decimal digits.
    """
    order = getcontext().prec
    series = np.zeros((order + 1, len(z)), object)
    squared_velocity = np.zeros(order, object)  # power series of z[1]^2
    series[0] = z
    for k in range(order):
        derivatives = matrix @ series[k]
        velocities = series[: k + 1, 1]
        if cubic:
            # The coefficients of a product of power series are convolutions.
            squared_velocity[k] = velocities @ velocities[::-1]
            derivatives[1] -= cubic * (squared_velocity[: k + 1] @ velocities[::-1])
        series[k + 1] = derivatives / (k + 1)
    return series


def _convergent_step_length(series: np.ndarray) -> Decimal:
    """Return the step length at which the last two terms of a series are below the last digit.

    `series` has the coefficients of all components, shape (order + 1, n).
    """
    order = len(series) - 1
    exponent = np.abs(series[-2:]).max().adjusted()
    return Decimal(10.0 ** ((-getcontext().prec - exponent) / order))


def _evaluate_series(series: np.ndarray | list, length: Decimal) -> Any:
    """Evaluate one or more power series at the distance `length` from the centre.

    `series` has the coefficients in increasing order. Horner's method is used.
    """
    return reduce(lambda value, coefficients: value * length + coefficients, series[::-1])


def _find_end_of_step(contact: int, distances: list, length: Decimal) -> tuple[Decimal, int]:
    """Return the length of a step that ends at a change of contact, and the next contact state.

    `contact` is the contact state at the start of the step. `distances` has the power series of the
    distances from the displacements at which drive-side and coast-side contact begin. `length` is
    the maximum length of the step.
    """

    def contact_at(length: Decimal) -> int:
        """Return the contact state at a distance `length` from the start of the step."""
        return _contact_state([_evaluate_series(distance, length) for distance in distances])

    if contact_at(length) == contact:
        return length, contact
    # Bisect the change of contact, which lies between `low` and `high`.
    low, high = Decimal(0), length
    # A decimal digit needs 3.3 bisections, so four per digit reach full precision.
    for _ in range(4 * getcontext().prec):
        middle = (low + high) / 2
        if contact_at(middle) == contact:
            low = middle
        else:
            high = middle
    return high, contact_at(high)


#: Numbers of digits of successive runs, until two successive runs agree.
DIGITS = (30, 50, 100, 200, 400)
#: Maximum difference of two runs that agree, 1e-4 of the spacing of floats at 1.
AGREEMENT = Decimal("1e-20")
#: Accuracy of the references of gear trains.
TRAIN_ACCURACY = 1e-11
#: Mesh periods after which even the slowest damped problem has settled to rounding errors.
SETTLING_PERIODS = 400
#: Half width of central differences, for which truncation and rounding errors are about equal.
DIFFERENCE = Decimal("1e-17")
#: Maximum difference of the states at the start and the end of a period-one orbit.
MAX_RESIDUAL = 1e-9


def compute_reference(problem: problems.Problem) -> problems.Motion:
    """Compute the motion of a test problem, correct to the last digit of a float.

    The number of digits is increased until two runs have the same contact states and agree to
    `AGREEMENT` in final state and event phases. Raise ValueError if no two runs agree. Gear trains
    are run by the exact method of the library instead.
    """
    if problem.model.mesh_names:
        return problems.run_problem(problem, "exact")
    arguments = problem.model, problem.tuning, problem.periods
    runs = (run_precisely(*arguments, digits) for digits in DIGITS)
    for (coarse_state, coarse_phases, coarse_codes), run in pairwise(runs):
        state, phases, codes = run
        if not np.array_equal(codes, coarse_codes):
            continue
        differences = np.concatenate([state - coarse_state, phases - coarse_phases])
        if (np.abs(differences) <= AGREEMENT).all():
            # Only events of the last mesh periods are returned.
            record_start = 2.0 * math.pi * (problem.periods - problem.record_periods)
            is_recorded = np.array(phases >= record_start, bool)
            event_phases = phases[is_recorded].astype(float)
            return problems.Motion(state.astype(float), event_phases, codes[is_recorded])
    raise ValueError(
        f"the motion of this {type(problem.model).__name__} over {problem.periods} mesh periods "
        f"cannot be computed with {DIGITS[-1]} digits: choose fewer periods"
    )


def find_settled_orbit(problem: problems.Problem) -> tuple[np.ndarray, float]:
    """Find the orbit of a problem; return its state and its largest absolute Floquet multiplier.

    The final state of a long run is refined by one Newton step for a fixed point of the period map,
    with 50 digits. Both results are NaN if the problem does not settle on a period-one orbit.
    """

    def period_map(start: np.ndarray) -> np.ndarray:
        """Return the state, (2,), one mesh period after the state `start`, with 50 digits."""
        return run_precisely(problem.model, problem.tuning, 1, DIGITS[1], start)[0]

    state = problems.run_problem(problem, periods=SETTLING_PERIODS).state
    if problem.settles and np.isfinite(state).all():
        with localcontext(prec=DIGITS[1]):
            start = to_decimals(state)
            residual = (period_map(start) - start).astype(float)
            if np.abs(residual).max() < MAX_RESIDUAL:
                matrix = problems.period_map_jacobian(period_map, start, DIFFERENCE)
                orbit = state + np.linalg.solve(np.eye(2) - matrix, residual)
                return orbit, problems.largest_multiplier(matrix)
    return np.full(2, math.nan), math.nan


def compute_references(
    names: Sequence[str], pair: GearPair, six_degrees: dict, settings: dict
) -> xr.Dataset:
    """Compute the reference motions, orbits and Floquet multipliers of several test problems.

    `names` are the names of the problems. The gear `pair`, `six_degrees` (arguments of
    `SixDegreePair`) and `settings` (damping and numbers of mesh periods) are passed to
    `problems.build_problem`. Orbit and multiplier are NaN for problems without a period-one orbit.
    """
    built = {name: problems.build_problem(name, pair, six_degrees, settings) for name in names}
    motions = {name: compute_reference(problem) for name, problem in built.items()}

    def orbit_data(name: str) -> dict:
        """Return final state, orbit state and largest Floquet multiplier of a problem."""
        orbit, multiplier = find_settled_orbit(built[name])
        state = motions[name].state
        return {"final_state": state, "orbit_state": orbit, "largest_multiplier": multiplier}

    axes = {"problem": list(names)}
    phases = [motion.phases for motion in motions.values()]
    codes = np.concatenate([motion.codes for motion in motions.values()])
    data = evaluate_on_grid(axes, orbit_data, "component") | {
        "event_problem": ("event", np.repeat(names, [*map(len, phases)])),
        "event_phase": ("event", np.concatenate(phases)),
        "event_from": ("event", codes[:, 0]),
        "event_to": ("event", codes[:, 1]),
    }
    title = "References of the test problems, from 50 digits or more"
    return make_study_result(
        title,
        data,
        axes,
        references=GearPair.references,
        gear_pair=pair.as_dict(),
        parameters={"settings": settings, "six_degrees": six_degrees},
    )


def select_motion(dataset: xr.Dataset, name: str) -> problems.Motion:
    """Return the reference motion of the problem `name` from a dataset of `compute_references`.

    In the dataset, the events of all problems are concatenated.
    """
    events = dataset.isel(event=np.flatnonzero(dataset.event_problem.values == name))
    state = dataset.final_state.sel(problem=name).values
    codes = np.column_stack((events.event_from, events.event_to))
    return problems.Motion(state, events.event_phase.values, codes)
