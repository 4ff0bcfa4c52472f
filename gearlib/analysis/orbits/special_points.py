"""Points of a branch of periodic orbits, and location of its special points.

A special point lies between two neighbouring points of a branch if the following quantity changes:

================  ====================================================================
fold              sign of det(M - I), and the parameter changes its direction
branch point      sign of det(M - I), and the parameter keeps its direction
period doubling   sign of det(M + I)
Neimark-Sacker    sign of |mu| - 1 of the largest pair of complex multipliers mu
grazing           sequence of contact states
================  ====================================================================

M is the monodromy matrix (Kuznetsov, Elements of Applied Bifurcation Theory, ch. 10). The special
point is located by Brent's method on the chord between both points, a grazing by bisection. Each
iterate is corrected to the branch by Newton's method, so that the located point is an orbit to
rounding error.

The mesh force is zero on a flank line. M is therefore continuous at a grazing, but changes with the
square root of the distance past it: the branch has no corner there, but its curvature jumps. Folds
and doublings often lie just past a grazing, never exactly at it.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr
from scipy.optimize import brentq

from gearlib.analysis.orbits.shooting import Evaluation, Shooting, contact_states_without_events
from gearlib.analysis.orbits.tracing import continuation_parameters, correct_to_curve, unit_tangent
from gearlib.data.result import make_result
from gearlib.engines import orbit as columns

#: Names of the labels; a label is the index in this tuple.
LABELS = ("regular", "fold", "period doubling", "Neimark-Sacker", "grazing", "branch point", "end")
REGULAR, FOLD, DOUBLING, NEIMARK_SACKER, GRAZING, BRANCH_POINT, END = range(len(LABELS))

#: Tolerance of the position of a special point, relative to the chord.
_CHORD_TOLERANCE = 1e-14
#: Distance past a grazing, relative to the chord, at which the continuation restarts. It is large
#: enough for contact states that do not depend on rounding errors.
_DISTANCE_PAST_GRAZING = 1e-7
#: Tolerance of the squared modulus of a complex pair of multipliers on the unit circle.
_CIRCLE_TOLERANCE = 1e-6
#: Smaller values of the Neimark-Sacker test function may change sign due to rounding errors.
_MIN_TEST_VALUE = 1e-9
#: Events of several meshes are simultaneous if their phases differ by less than this.
_SIMULTANEOUS_TOLERANCE = 1e-9
_CONTACT_LETTERS = {1: "D", 0: "F", -1: "C"}


@dataclass(frozen=True)
class BranchPoint:
    """An orbit on a branch, with its tangent, contact states, extrema and label."""

    solution: Evaluation
    tangent: np.ndarray  #: unit tangent of the branch
    value: float  #: value of the parameter
    contacts: str  #: cyclic sequence of contact states: D drive side, F free flight, C coast side
    displacement_max: float
    displacement_min: float
    label: int = REGULAR  #: index in `LABELS`

    @property
    def unknowns(self) -> np.ndarray:
        """Scaled unknowns of the shooting equation: the state, then the parameter."""
        return self.solution.unknowns

    @property
    def displacement_range(self) -> float:
        """Largest minus smallest displacement, in units of the static deflection."""
        return self.displacement_max - self.displacement_min


def branch_point(solution: Evaluation, tangent: np.ndarray) -> BranchPoint:
    """Create the `BranchPoint` of a solution of the shooting equation with one parameter.

    The orbit is simulated over its period to obtain its extrema and contact states. `tangent` is
    the unit tangent of the branch at the solution. The label is REGULAR (no special point).
    """
    problem = solution.problem
    model, record = problem.record(solution.unknowns, problem.period)
    summary = record.summary
    value = float(solution.unknowns[-1] * problem.units[-1])
    maximum, minimum = np.max(summary[..., columns.X_MAX]), np.min(summary[..., columns.X_MIN])
    contacts = _contact_sequence(record.events, summary, model.flank_lines)
    return BranchPoint(solution, tangent, value, contacts, maximum, minimum)


def branch_dataset(title: str, solutions: list, variables: dict, **attributes: Any) -> xr.Dataset:
    """Return solutions of the shooting equation as a dataset with the dimension ``point``.

    `solutions` are `Evaluation`s, whose states, multipliers, residuals and parameters become
    variables. `variables`, a mapping of names to (dims, values) or values, are added; values under
    the name of a continued parameter replace the values from the scaled unknowns, which have
    rounding errors. `title` and `attributes` become attributes of the dataset.
    """
    problem = solutions[0].problem
    multipliers = np.array([solution.multipliers for solution in solutions])
    unknowns = np.array([solution.unknowns * problem.units for solution in solutions])
    data = {
        "state": (("point", "coordinate"), np.array([solution.state for solution in solutions])),
        "multiplier_real": (("point", "multiplier"), multipliers.real),
        "multiplier_imaginary": (("point", "multiplier"), multipliers.imag),
        "residual": ("point", np.array([solution.residual_norm for solution in solutions])),
        "period": np.int32(problem.period),
    }
    if "tuning" not in problem.names:
        data["tuning"] = problem.tuning
    parameters = continuation_parameters(problem.model)
    # The unknowns are the components of the reduced state, then the parameters.
    for name, values in zip(problem.names, unknowns.T[len(problem.reduction) :], strict=True):
        data[name] = "point", variables.pop(name, values), parameters[name]
    attributes |= {"period": problem.period, "tuning": problem.tuning}
    method = "pseudo-arclength on shooting"
    return make_result(title, problem.model, data | variables, method=method, **attributes)


def _contact_sequence(events: np.ndarray, summary: np.ndarray, flank_lines: tuple) -> str:
    """Return the cyclic sequence of contact states of an orbit as a string.

    The letters are D for drive-side contact, F for free flight, C for coast-side contact. `events`
    has a row for each contact event, and `summary` has the extrema of the motion; both are tables
    of a `Record`. `flank_lines` are the displacements at which drive-side and coast-side contact
    start. The sequence starts at the event that makes it the last one in alphabetical order, so
    that it does not depend on the initial phase. With several meshes each letter is preceded by the
    index of its mesh, and simultaneous events are sorted by mesh.
    """
    if not len(events):
        # The contact state never changes, so the mean displacement determines it.
        mean = 0.5 * (summary[..., columns.X_MAX] + summary[..., columns.X_MIN])
        contact_states = contact_states_without_events(mean, mean, *flank_lines)
        return "".join(_CONTACT_LETTERS[state] for state in contact_states)
    # Events of several meshes have an additional last column, the index of the mesh.
    contact_states, mesh_column = events[:, columns.EVENT_TO], columns.EVENT_COLUMNS
    has_several_meshes = events.shape[1] > mesh_column
    if not has_several_meshes and events[0, columns.EVENT_FROM] != contact_states[-1]:
        # The orbit starts on a flank line within rounding errors, so its first event is missing.
        contact_states = np.append(contact_states, events[0, columns.EVENT_FROM])
    letters = [_CONTACT_LETTERS[int(state)] for state in contact_states]
    if has_several_meshes:
        phases = 2.0 * np.pi * events[:, columns.EVENT_PERIOD] + events[:, columns.EVENT_PHASE]
        # Simultaneous events have the same instant number.
        instants = np.cumsum(np.diff(phases, prepend=phases[0]) > _SIMULTANEOUS_TOLERANCE)
        meshes = events[:, mesh_column].astype(int)
        letters = [f"{meshes[i]}{letters[i]} " for i in np.lexsort((meshes, instants))]
    return max("".join(letters[i:] + letters[:i]) for i in range(len(letters))).strip()


def _neimark_sacker_test(multipliers: np.ndarray) -> float:
    """Return |mu|^2 - 1 for the complex Floquet multiplier mu with the largest modulus.

    This test function changes sign at a Neimark-Sacker point, where a complex pair crosses the unit
    circle. Return -1 if all multipliers are real.
    """
    complex_multipliers = multipliers[multipliers.imag > 1e-9]
    if not complex_multipliers.size:
        return -1.0
    return np.abs(complex_multipliers).max() ** 2 - 1.0


#: Label -> test function of the Floquet multipliers, which changes sign at the special point.
_TEST_FUNCTIONS = {
    FOLD: lambda multipliers: np.prod(multipliers - 1.0).real,
    DOUBLING: lambda multipliers: np.prod(multipliers + 1.0).real,
    NEIMARK_SACKER: _neimark_sacker_test,
}


def point_on_chord(problem: Shooting, first, last, position: float) -> BranchPoint:
    """Return the branch point in the plane normal to the chord at a position on the chord.

    The chord connects the `BranchPoint`s `first` and `last` of the branch of the `Shooting`
    equation `problem`; the position is 0 at `first` and 1 at `last`. The tangent is set to the
    direction of the chord, because the branch may have no tangent there.
    """
    chord = last.unknowns - first.unknowns
    direction = chord / np.linalg.norm(chord)
    solution, _ = correct_to_curve(problem, first.unknowns + position * chord, direction)
    return branch_point(solution, direction)


def locate(problem: Shooting, first: BranchPoint, last: BranchPoint, label: int) -> tuple | None:
    """Locate the special point with a label between the points `first` and `last` of a branch.

    `problem` is the `Shooting` equation; the label is FOLD, DOUBLING or NEIMARK_SACKER. Return
    (position on the chord from 0 to 1, special point), or None if the test function does not change
    sign between the points. If a multiplier crosses 1 but the parameter does not reverse its
    direction, the point is labelled BRANCH_POINT instead of FOLD.
    """
    test = _TEST_FUNCTIONS[label]
    end_values = {0.0: test(first.solution.multipliers), 1.0: test(last.solution.multipliers)}
    if not end_values[0.0] * end_values[1.0] < 0.0:
        return None
    smallest_value = min(abs(value) for value in end_values.values())
    if label == NEIMARK_SACKER and smallest_value < _MIN_TEST_VALUE:
        # The multipliers remain on the unit circle, e.g. without damping.
        return None

    def test_value(position: float) -> float:
        """Return the value of the test function at a position from 0 to 1 on the chord.

        The values at both ends are known; in between, an orbit of the branch is computed.
        """
        if position in end_values:
            return end_values[position]
        return test(point_on_chord(problem, first, last, position).solution.multipliers)

    precision = 4.0 * np.finfo(float).eps
    position = brentq(test_value, 0.0, 1.0, xtol=_CHORD_TOLERANCE, rtol=precision)
    point = point_on_chord(problem, first, last, position)
    if label == NEIMARK_SACKER and abs(test(point.solution.multipliers)) > _CIRCLE_TOLERANCE:
        # The sign changes only because the complex pair of multipliers becomes real.
        return None
    if label == FOLD and first.tangent[-1] * last.tangent[-1] > 0.0:
        # A multiplier crosses 1, but the parameter does not reverse its direction.
        label = BRANCH_POINT
    return position, replace(point, label=label)


def special_points(problem: Shooting, first: BranchPoint, last: BranchPoint) -> list:
    """Return the special points between two points of a branch with the same contact states.

    They are folds, branch points, period doublings and Neimark-Sacker points, as `BranchPoint`s
    sorted from `first` to `last`; `problem` is the `Shooting` equation. Raise ContinuationFailed if
    Newton's method does not converge on the chord.
    """
    results = [locate(problem, first, last, label) for label in _TEST_FUNCTIONS]
    located_points = [result for result in results if result is not None]
    located_points.sort(key=lambda position_and_point: position_and_point[0])
    return [point for _, point in located_points]


def locate_grazing(problem: Shooting, first: BranchPoint, last: BranchPoint) -> tuple:
    """Locate the grazing between two points of a branch with different contact states by bisection.

    At a grazing the orbit touches a flank, and its sequence of contact states changes. Return
    (`BranchPoint` just before the grazing with the label GRAZING, `BranchPoint` just past it). If
    the sequence changes more than once, any one of the changes is located. `problem` is the
    `Shooting` equation; positions on the chord are 0 at `first` and 1 at `last`.
    """
    low, high, point_before = 0.0, 1.0, first
    while high - low > _CHORD_TOLERANCE:
        midpoint = 0.5 * (low + high)
        # There is no floating-point number between two neighbouring ones.
        if not low < midpoint < high:
            break
        point = point_on_chord(problem, first, last, midpoint)
        if point.contacts == first.contacts:
            low, point_before = midpoint, point
        else:
            high = midpoint
    if point_before is first:
        # The orbit touches the flank line at the first point, which is added again with the label.
        point_before = point_on_chord(problem, first, last, low)
    point_past = last
    if high + _DISTANCE_PAST_GRAZING < 1.0:
        point_past = point_on_chord(problem, first, last, high + _DISTANCE_PAST_GRAZING)
        point_past = replace(
            point_past, tangent=unit_tangent(point_past.solution.jacobian, point_past.tangent)
        )
    return replace(point_before, label=GRAZING), point_past
