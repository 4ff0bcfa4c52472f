"""Points of a branch: fold, period doubling, Neimark-Sacker, grazing, branch point, regular points.

A special point lies between two neighbouring points of a branch if this quantity changes:

================  ====================================================================
fold              sign of det(M - I), and the parameter changes its direction
branch point      sign of det(M - I), and the parameter keeps its direction
period doubling   sign of det(M + I)
Neimark-Sacker    sign of |mu| - 1 of the largest pair of complex multipliers mu
grazing           sequence of contact states
================  ====================================================================

M is the monodromy matrix (Kuznetsov, Elements of Applied Bifurcation Theory, ch. 10). The point is
located by Brent's method on the chord between both points, a grazing by bisection. Every iterate is
corrected to the branch by Newton's method, so that the located point is an orbit to rounding error.

The mesh force is zero on a flank line. M is therefore continuous at a grazing, but past it changes
with the square root of the distance: the branch has no corner there, but its curvature jumps. Folds
and doublings often lie just past a grazing, never exactly at it.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr
from scipy.optimize import brentq

from gearlib.analysis.orbits.shooting import Evaluation, Shooting, codes_without_events
from gearlib.analysis.orbits.tracing import continuation_parameters, correct, tangent
from gearlib.data.result import result
from gearlib.engines import orbit as columns

#: Names of the labels; a label is the index in this tuple.
LABELS = ("regular", "fold", "period doubling", "Neimark-Sacker", "grazing", "branch point", "end")
REGULAR, FOLD, DOUBLING, NEIMARK_SACKER, GRAZING, BRANCH_POINT, END = range(len(LABELS))

#: Tolerance of the position of a special point, relative to the chord.
_CHORD_TOLERANCE = 1e-14
#: Distance past a grazing, relative to the chord, at which the continuation restarts: there the
#: contact states do not depend on rounding errors.
_DISTANCE_PAST_GRAZING = 1e-7
#: Largest difference of the squared modulus from 1 for a complex pair on the unit circle.
_CIRCLE_TOLERANCE = 1e-6
#: Sign changes of smaller test functions of Neimark-Sacker points are rounding errors.
_MIN_TEST_VALUE = 1e-9
#: Phases of simultaneous events of several meshes differ by less than this.
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
        """Largest minus smallest displacement, static deflections."""
        return self.displacement_max - self.displacement_min


def branch_point(solution: Evaluation, tangent: np.ndarray) -> BranchPoint:
    """Return a solution of the shooting equation with one parameter as a `BranchPoint`.

    The orbit is simulated over its period for its extrema and contact states. `tangent` is the unit
    tangent of the branch at the solution. The label is REGULAR (no special point).
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

    `title` is the title of the dataset. `solutions` are `Evaluation`s, whose states, multipliers,
    residuals and parameters become variables. `variables`, {name: (dims, values) or values}, are
    added. If one of them has the name of a continued parameter, its values replace those computed
    from the scaled unknowns, which have rounding errors. `attributes` are added to the attributes
    of the dataset.
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
    return result(title, problem.model, data | variables, method=method, **attributes)


def _contact_sequence(events: np.ndarray, summary: np.ndarray, flank_lines: tuple) -> str:
    """Return the cyclic sequence of contact states of an orbit as a string.

    The letters are D for drive-side contact, F for free flight, C for coast-side contact. `events`
    has a row for each contact event and `summary` the extrema of the motion; both are tables of a
    `Record`. `flank_lines` are the displacements at which drive- and coast-side contact start. The
    sequence is shifted cyclically to the alphabetically last one, so that it does not depend on the
    initial phase. With several meshes each letter has the index of its mesh as a prefix, and
    simultaneous events are sorted by mesh.
    """
    if not len(events):
        # The whole motion has the contact state of its mean displacement.
        middle = 0.5 * (summary[..., columns.X_MAX] + summary[..., columns.X_MIN])
        codes = codes_without_events(middle, middle, *flank_lines)
        return "".join(_CONTACT_LETTERS[code] for code in codes)
    # Events of several meshes have an additional last column, the index of the mesh.
    codes, mesh_column = events[:, columns.EVENT_TO], columns.EVENT_COLUMNS
    has_several_meshes = events.shape[1] > mesh_column
    if not has_several_meshes and events[0, columns.EVENT_FROM] != codes[-1]:
        # The orbit starts on a flank line up to rounding, so that its first event is missing.
        codes = np.append(codes, events[0, columns.EVENT_FROM])
    letters = [_CONTACT_LETTERS[int(code)] for code in codes]
    if has_several_meshes:
        phases = 2.0 * np.pi * events[:, columns.EVENT_PERIOD] + events[:, columns.EVENT_PHASE]
        # Events have the same instant number if the time between them is within the tolerance.
        instants = np.cumsum(np.diff(phases, prepend=phases[0]) > _SIMULTANEOUS_TOLERANCE)
        meshes = events[:, mesh_column].astype(int)
        letters = [f"{meshes[i]}{letters[i]} " for i in np.lexsort((meshes, instants))]
    return max("".join(letters[i:] + letters[:i]) for i in range(len(letters))).strip()


def _neimark_sacker_test(multipliers: np.ndarray) -> float:
    """Return |mu|^2 - 1 for the complex Floquet multiplier mu of largest modulus.

    This test function changes its sign at a Neimark-Sacker point, where a complex pair crosses the
    unit circle. Return -1 if all multipliers are real.
    """
    complex_multipliers = multipliers[multipliers.imag > 1e-9]
    if not complex_multipliers.size:
        return -1.0
    return np.abs(complex_multipliers).max() ** 2 - 1.0


#: Label -> test function of the Floquet multipliers, which changes its sign at the special point.
_TEST_FUNCTIONS = {
    FOLD: lambda multipliers: np.prod(multipliers - 1.0).real,
    DOUBLING: lambda multipliers: np.prod(multipliers + 1.0).real,
    NEIMARK_SACKER: _neimark_sacker_test,
}


def point_on_chord(problem: Shooting, first, last, position: float) -> BranchPoint:
    """Return the point of a branch next to a position on the chord between two `BranchPoint`s.

    `problem` is the `Shooting` equation of the branch. The position is 0 at `first` and 1 at
    `last`; the returned `BranchPoint` lies in the plane normal to the chord. Its tangent is the
    direction of the chord, because the tangent of the branch may not exist there.
    """
    chord = last.unknowns - first.unknowns
    direction = chord / np.linalg.norm(chord)
    solution, _ = correct(problem, first.unknowns + position * chord, direction)
    return branch_point(solution, direction)


def locate(problem: Shooting, first: BranchPoint, last: BranchPoint, label: int) -> tuple | None:
    """Locate the special point with a label between the points `first` and `last` of a branch.

    `problem` is the `Shooting` equation of the branch; the label is FOLD, DOUBLING or
    NEIMARK_SACKER. Return (position on the chord from 0 to 1, special point), or None if the test
    function of the label does not change its sign between the points. If the parameter keeps its
    direction at a fold, the point is labelled BRANCH_POINT instead.
    """
    test = _TEST_FUNCTIONS[label]
    end_values = {0.0: test(first.solution.multipliers), 1.0: test(last.solution.multipliers)}
    if not end_values[0.0] * end_values[1.0] < 0.0:
        return None
    smallest_value = min(abs(value) for value in end_values.values())
    if label == NEIMARK_SACKER and smallest_value < _MIN_TEST_VALUE:
        # The multipliers stay on the unit circle, as without damping.
        return None

    def test_value(position: float) -> float:
        """Return the value of the test function at a position on the chord, 0 to 1.

        The values at both ends are known; between them an orbit on the branch is computed.
        """
        if position in end_values:
            return end_values[position]
        return test(point_on_chord(problem, first, last, position).solution.multipliers)

    precision = 4.0 * np.finfo(float).eps
    position = brentq(test_value, 0.0, 1.0, xtol=_CHORD_TOLERANCE, rtol=precision)
    point = point_on_chord(problem, first, last, position)
    if label == NEIMARK_SACKER and abs(test(point.solution.multipliers)) > _CIRCLE_TOLERANCE:
        # The sign changes because the complex pair of multipliers becomes real.
        return None
    if label == FOLD and first.tangent[-1] * last.tangent[-1] > 0.0:
        # A multiplier crosses 1, but the parameter keeps its direction.
        label = BRANCH_POINT
    return position, replace(point, label=label)


def special_points(problem: Shooting, first: BranchPoint, last: BranchPoint) -> list:
    """Return the special points between two points of a branch with the same contact states.

    Special points are folds, branch points, period doublings and Neimark-Sacker points. They are
    `BranchPoint`s, sorted from `first` to `last`; `problem` is the `Shooting` equation. Raise
    ContinuationFailed if Newton's method does not converge on the chord.
    """
    located = [locate(problem, first, last, label) for label in _TEST_FUNCTIONS]
    positions_and_points = [pair for pair in located if pair is not None]
    positions_and_points.sort(key=lambda pair: pair[0])
    return [point for _, point in positions_and_points]


def locate_grazing(problem: Shooting, first: BranchPoint, last: BranchPoint) -> tuple:
    """Locate the grazing between two points of a branch with different contact states by bisection.

    At a grazing the orbit touches a flank, and its sequence of contact states changes. Return
    (`BranchPoint` just before the grazing with the label GRAZING, `BranchPoint` just past it). If
    the sequence changes more than once, one of these changes is located. `problem` is the
    `Shooting` equation; positions on the chord are 0 at `first` and 1 at `last`.
    """
    low, high, before = 0.0, 1.0, first
    while high - low > _CHORD_TOLERANCE:
        middle = 0.5 * (low + high)
        # Two neighbouring floating-point numbers have no number between them.
        if not low < middle < high:
            break
        point = point_on_chord(problem, first, last, middle)
        if point.contacts == first.contacts:
            low, before = middle, point
        else:
            high = middle
    if before is first:
        # The first point itself touches the flank line; it is added again with the label.
        before = point_on_chord(problem, first, last, low)
    past = last
    if high + _DISTANCE_PAST_GRAZING < 1.0:
        past = point_on_chord(problem, first, last, high + _DISTANCE_PAST_GRAZING)
        past = replace(past, tangent=tangent(past.solution.jacobian, past.tangent))
    return replace(before, label=GRAZING), past
