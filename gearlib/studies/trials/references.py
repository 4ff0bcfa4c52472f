"""Compute the reference motions of the test problems in 50 or more digits.

A run is repeated with more digits until two runs agree to far more digits than a float has, so that
no method is measured against another method or itself. The reference of a gear train is an exact
run, which a test confirms with two other codes to `TRAIN_ACCURACY`.

The runs are power series of the motion between changes of contact. As long as the contact state and
the segment of the mesh period do not change, the state z follows

    z' = A z - d z[1]^3 e_1,

where d is the cubic damping. The truncation error of the series limits the step length, which is at
most a quarter of a radian of the natural oscillation. A step ends where the contact state changes,
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

from gearlib.data.result import evaluate_on_grid, make_study_result
from gearlib.engines.codes import COAST, DRIVE, NO_CONTACT
from gearlib.models.pair import GearPair
from gearlib.models.single_mesh_system import state_matrix_by_phase
from gearlib.studies.trials import problems

#: Additional digits for the rounding errors of about a thousand sums in a step.
GUARD_DIGITS = 10
#: Smallest number of steps per radian of the natural oscillation.
_STEPS_PER_RADIAN = 4
_CODES = (COAST, NO_CONTACT, DRIVE)
#: Function that converts arrays and lists of numbers to arrays of `Decimal`.
to_decimals = np.vectorize(Decimal, otypes=[object])


class Equations(NamedTuple):
    """Equations z' = A z - d z[1]^3 e_1 of a model at one tuning; arrays are of `Decimal`."""

    matrices: dict  #: (contact state, segment) -> A, shape (n, n)
    cubic: dict  #: contact state -> cubic damping d
    bounds: list  #: phases that bound the segments, 0 to 2 pi
    lines: np.ndarray  #: lines @ z: distances from drive-side and coast-side contact
    start: np.ndarray  #: z at rest at the beginning of drive-side contact


def run_precisely(
    model: Any, tuning: float, periods: int, digits: int, state: Sequence | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the final (x, dx/dtau) of a run, the phases of its contact events and their codes.

    `model` is a `GearPair`, a `SixDegreePair`, or a `OneDegreePair` with cubic damping. `tuning` is
    mesh frequency over natural frequency, tau the mesh phase; `digits` are the correct decimal
    digits of each step. `state` is (x, dx/dtau) at tau = 0 for one degree of freedom; None is rest
    where drive-side contact begins. Contact states (before, after) have the shape (n, 2).
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
        # The rows of A for the derivatives of displacements do not depend on the contact.
        derivative_matrix = equations.matrices[NO_CONTACT, 0]
        if state is not None:
            z = to_decimals([*state, 1])
            # Contact may begin or end at the start, so the contact state shortly after it is used.
            next_state = z + derivative_matrix @ z * Decimal(10) ** -digits
            contact = _contact_state(equations.lines @ next_state)
        # The stiffness is constant within a segment of the mesh period.
        for period in range(periods):
            for segment, (phase, end) in enumerate(pairwise(equations.bounds)):
                while phase < end:
                    matrix, cubic = equations.matrices[contact, segment], equations.cubic[contact]
                    series = _power_series(matrix, cubic, z)
                    # A radian of the natural oscillation is nu radians of the mesh phase.
                    max_length = Decimal(tuning) / _STEPS_PER_RADIAN
                    length = min(_convergent_step_length(series), max_length, end - phase)
                    distances = (equations.lines @ series.T).tolist()
                    length, next_contact = _find_end_of_step(contact, distances, length)
                    z = _evaluate_series(series, length)
                    phase += length
                    if next_contact != contact:
                        phases.append(2 * period * _compute_pi() + phase)
                        codes.append((contact, next_contact))
                        contact = next_contact
        derivatives = derivative_matrix @ z
        end_state = np.array([equations.lines[0] @ z, equations.lines[0] @ derivatives])
        return end_state, np.array(phases, object), np.array(codes, np.int8).reshape(-1, 2)


def _single_degree_equations(model: Any, tuning: float) -> Equations:
    """Return the equations of a model with one degree of freedom, state z = (x, dx/dtau, 1).

    x is the displacement in static deflections, tau the mesh phase. The tuning, mesh frequency over
    natural frequency, is nu; the contact ratio is epsilon, the stiffness ratio kappa.
    """
    pair = model.pair
    nu = Decimal(tuning)
    epsilon = Decimal(pair.contact_ratio)
    kappa = Decimal(pair.stiffness_ratio)
    backlash = Decimal(pair.backlash_ratio)  # static deflections
    mean = kappa + (1 - kappa) * (epsilon - 1)  # mean stiffness over the largest stiffness
    matrices = {}
    for code in _CODES:
        in_contact = code != NO_CONTACT
        damping_ratio = Decimal(pair.damping_ratio if in_contact else pair.backlash_damping_ratio)
        for segment, level in enumerate((Decimal(1), kappa, Decimal(1))):
            stiffness = level / mean / nu**2 if in_contact else 0
            load = 1 / nu**2 - (stiffness * backlash if code == COAST else 0)
            rows = [[0, 1, 0], [-stiffness, -2 * damping_ratio / nu, load], [0, 0, 0]]
            matrices[code, segment] = to_decimals(rows)
    # Rows of the damping belong to the contact states -1, 0 and 1; the last column is cubic
    # damping.
    cubic = {code: Decimal(model.equation.damping[code + 1, 2]) * nu for code in _CODES}
    coast_line = [0, 0, 1] if backlash.is_infinite() else [1, 0, backlash]
    lines = to_decimals([[1, 0, 0], coast_line])
    return Equations(matrices, cubic, _segment_bounds(epsilon), lines, to_decimals([0, 0, 1]))


def _six_degree_equations(model: Any, tuning: float) -> Equations:
    """Return the equations of a `SixDegreePair` in terms of the state z of its `TrainSystem`.

    The state z has two rotations, displacements of elastic bearings, and the derivatives of all of
    these with respect to the mesh phase. The tuning is mesh frequency over natural frequency.
    """
    system = model.system(tuning)
    pitch_phase = Decimal(model.pitch_phase)
    segments = range(system.starts.size - 1)
    matrices = {
        (code, segment): to_decimals(state_matrix_by_phase(system, [code], segment))
        for code in _CODES
        for segment in segments
    }
    # The starts of the segments are floats; each is replaced by the nearest precise phase.
    phases = _segment_bounds(Decimal(model.pair.contact_ratio))
    # At these two phases the friction changes its sign.
    phases += [(pitch_phase + k * _compute_pi()) % (2 * _compute_pi()) for k in range(2)]
    bounds = [min(phases, key=lambda phase: abs(float(phase) - start)) for start in system.starts]
    lines = to_decimals([system.drive_distance_rows[0], system.coast_distance_rows[0]])
    z = to_decimals(model.full_state(system, (0.0, 0.0)))
    # The first rotation and its velocity are corrected, so that the start is at rest exactly where
    # contact begins.
    coordinate_count = 2 + len(model.elastic_bearings())
    z[0] -= lines[0] @ z
    z[coordinate_count] -= lines[0] @ (matrices[NO_CONTACT, 0] @ z)
    return Equations(matrices, dict.fromkeys(_CODES, 0), bounds, lines, z)


def _compute_pi() -> Decimal:
    """Return pi in the current decimal precision, by the Gauss-Legendre iteration.

    Its sequences are arithmetic means a and geometric means b. Each iteration doubles the number of
    correct digits.
    """
    a = Decimal(1)
    b = Decimal("0.5").sqrt()
    total = Decimal("0.25")
    for k in range(getcontext().prec.bit_length()):
        total -= 2**k * ((a - b) / 2) ** 2
        a, b = (a + b) / 2, (a * b).sqrt()
    return (a + b) ** 2 / (4 * total)


def _segment_bounds(contact_ratio: Decimal) -> list[Decimal]:
    """Return the mesh phases, 0 to 2 pi, that bound the segments of constant stiffness."""
    return [_compute_pi() * multiple for multiple in (0, contact_ratio - 1, 3 - contact_ratio, 2)]


def _contact_state(distances: Sequence[Decimal]) -> int:
    """Return the contact state: drive-side contact, no contact, or coast-side contact.

    `distances` are those from the two flank lines, the displacements at which drive-side and
    coast-side contact begin.
    """
    if distances[0] >= 0:
        return DRIVE
    return COAST if distances[1] < 0 else NO_CONTACT


def _power_series(matrix: np.ndarray, cubic: Decimal | int, z: np.ndarray) -> np.ndarray:
    """Return the coefficients of the power series of the motion from a state z, (order + 1, n).

    The equation is z' = A z - d z[1]^3 e_1, where e_1 is the unit vector of the velocity z[1];
    `matrix` is A, shape (n, n), and `cubic` is the cubic damping d. The order of the series is the
    number of decimal digits.
    """
    order = getcontext().prec
    series = np.zeros((order + 1, len(z)), object)
    squares = np.zeros(order, object)  # series of the square of the velocity z[1]
    series[0] = z
    for k in range(order):
        derivatives = matrix @ series[k]
        velocities = series[: k + 1, 1]
        if cubic:
            # Products of power series are sums over coefficients in opposite order.
            squares[k] = velocities @ velocities[::-1]
            derivatives[1] -= cubic * (squares[: k + 1] @ velocities[::-1])
        series[k + 1] = derivatives / (k + 1)
    return series


def _convergent_step_length(series: np.ndarray) -> Decimal:
    """Return the step length at which the last two terms of a series are below the last digit.

    `series` has the coefficients of all components, shape (order + 1, n). The power of ten of the
    largest of the last coefficients gives the length.
    """
    order = len(series) - 1
    exponent = np.abs(series[-2:]).max().adjusted()
    return Decimal(10.0 ** ((-getcontext().prec - exponent) / order))


def _evaluate_series(series: np.ndarray | list, length: Decimal) -> Any:
    """Return the value of one or more power series at a distance `length` from the centre.

    `series` has the coefficients in increasing order; the polynomial is evaluated by Horner's
    scheme, from the highest coefficient on.
    """
    return reduce(lambda value, coefficients: value * length + coefficients, series[::-1])


def _find_end_of_step(contact: int, distances: list, length: Decimal) -> tuple[Decimal, int]:
    """Return the length of a step up to a change of contact, and the contact state after it.

    `contact` is the code at the start (drive-side, coast-side or no contact). `distances` are the
    power series of the distances from both flank lines, the displacements at which contact begins;
    `length` is the largest length of the step.
    """

    def contact_at(length: Decimal) -> int:
        """Return the contact state at a distance `length` from the start of the step."""
        return _contact_state([_evaluate_series(distance, length) for distance in distances])

    if contact_at(length) == contact:
        return length, contact
    # The change of contact is bisected: it lies between `low` and `high`.
    low, high = Decimal(0), length
    # A digit needs 3.3 halvings, so four per digit reach the full precision.
    for _ in range(4 * getcontext().prec):
        middle = (low + high) / 2
        if contact_at(middle) == contact:
            low = middle
        else:
            high = middle
    return high, contact_at(high)


#: Numbers of digits of successive runs, until two successive runs agree.
DIGITS = (30, 50, 100, 200, 400)
#: Largest difference of two runs that agree: 1e-4 of the spacing of floats at 1.
AGREEMENT = Decimal("1e-20")
#: Accuracy of the references of gear trains.
TRAIN_ACCURACY = 1e-11
#: Mesh periods in which the slowest of the damped problems settles to rounding errors.
SETTLING_PERIODS = 400
#: Half width of central differences: truncation and rounding errors are of equal size.
DIFFERENCE = Decimal("1e-17")
#: Largest difference of the states at the start and the end of a mesh period of an orbit.
MAX_RESIDUAL = 1e-9


def compute_reference(problem: problems.Problem) -> problems.Motion:
    """Return the motion of a test problem, correct to the last digit of a float.

    The number of digits is increased until two runs agree in all contact states and to `AGREEMENT`
    in the final state and the event phases. Raise ValueError if none do. A gear train is run by the
    exact method of the library instead.
    """
    if problem.model.mesh_names:
        return problems.run_problem(problem, "exact")
    arguments = problem.model, problem.tuning, problem.periods
    runs = (run_precisely(*arguments, digits) for digits in DIGITS)
    for (less_precise_state, less_precise_phases, less_precise_codes), run in pairwise(runs):
        state, phases, codes = run
        if not np.array_equal(codes, less_precise_codes):
            continue
        differences = np.concatenate([state - less_precise_state, phases - less_precise_phases])
        if (np.abs(differences) <= AGREEMENT).all():
            # Only events of the last mesh periods are returned.
            record_start = 2.0 * math.pi * (problem.periods - problem.record_periods)
            is_recorded = np.array(phases >= record_start, bool)
            event_phases = phases[is_recorded].astype(float)
            return problems.Motion(state.astype(float), event_phases, codes[is_recorded])
    raise ValueError(
        f"periods = {problem.periods} are not allowed for this {type(problem.model).__name__}: "
        f"its motion must be computable with {DIGITS[-1]} digits"
    )


def find_settled_orbit(problem: problems.Problem) -> tuple[np.ndarray, float]:
    """Return the state and the largest absolute Floquet multiplier of the orbit of a problem.

    The final state of a long run is corrected by one Newton step for a fixed point of the map over
    a mesh period, in 50 digits. Both are NaN if the problem does not settle on an orbit of one mesh
    period.
    """

    def period_map(start: np.ndarray) -> np.ndarray:
        """Return the state, (2,), one mesh period after the state `start`, in 50 digits."""
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

    `names` are names of problems; the gear `pair`, `six_degrees` (arguments of `SixDegreePair`) and
    `settings` (damping and numbers of mesh periods) are passed to `problems.build_problem`. Orbit
    and multiplier are NaN for problems without an orbit of one mesh period.
    """
    built = {name: problems.build_problem(name, pair, six_degrees, settings) for name in names}
    motions = {name: compute_reference(problem) for name, problem in built.items()}

    def orbit_data(name: str) -> dict:
        """Return the final state of a problem, its settled orbit and Floquet multiplier."""
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
    """Return the reference motion of the problem `name` from a dataset of `compute`.

    The dataset has the events of all problems in a row; those of this problem are selected.
    """
    events = dataset.isel(event=np.flatnonzero(dataset.event_problem.values == name))
    state = dataset.final_state.sel(problem=name).values
    codes = np.column_stack((events.event_from, events.event_to))
    return problems.Motion(state, events.event_phase.values, codes)
