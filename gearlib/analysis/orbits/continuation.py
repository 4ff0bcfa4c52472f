"""`continue_orbit`: continuation of periodic orbits; `switch_branch` at period doublings.

The exact shooting equation is continued by pseudo-arclength (`gearlib.analysis.orbits.tracing`). If
the sequence of contact states changes within a step, the grazing is located and added to the
branch. The continuation restarts just past the grazing with a short step, because the multipliers
change with the square root of the distance from it.
"""

from dataclasses import replace
from typing import Annotated, Any

import numpy as np
import xarray as xr
from annotated_types import Ge

from gearlib import checks
from gearlib.analysis.orbits import special_points as special
from gearlib.analysis.orbits import tracing
from gearlib.analysis.orbits.shooting import NoOrbit, Shooting, as_orbit, check_orbit, is_stable
from gearlib.analysis.orbits.special_points import BranchPoint, branch_dataset, branch_point
from gearlib.data.status import flags_of
from gearlib.parameters import INTEGER, Count, Finite, Limits, Positive, WholeNumber, checked
from gearlib.progress import Limit
from gearlib.runs.run_arguments import MAX_EVENTS, MaxSeconds

#: First step, smallest step and first step past a grazing, relative to the largest step.
_FIRST_STEP, _MIN_STEP, _STEP_PAST_GRAZING = 0.1, 1e-4, 1e-3
#: The step length increases after at most this number of Newton corrections.
_MAX_EASY_CORRECTIONS = 3
#: Displacement range, in static deflections, above which the largest step is proportional to it.
_LARGE_RANGE = 4.0
#: A branch is normal to the parameter axis if that component of its unit tangent is below this.
_NORMAL_TOLERANCE = 1e-9
#: Scaled distance from the first point at which such a branch is probed on both sides.
_PROBE_DISTANCE = 1e-3
#: Smallest number of points of a closed branch.
_MIN_CLOSED_POINTS = 10
#: Scaled distances from a period doubling at which the doubled orbit is searched for.
_SWITCH_DISTANCES = (0.02, 0.005, 0.1, 1e-3)
MaxPoints = Annotated[int, Ge(2), INTEGER]


@checked
def continue_orbit(
    orbit,
    parameter="tuning",
    *,
    to: Finite,
    limits: Limits | None = None,
    max_height: Positive = 200.0,
    step: Positive = 0.05,
    max_points: MaxPoints = 4000,
    max_events: Count = MAX_EVENTS,
    max_seconds: MaxSeconds = None,
):
    """Continue a periodic orbit in a parameter, around folds and past grazings.

    Parameters
    ----------
    orbit : Orbit
        A result of `gearlib.periodic_orbit`.
    parameter : str
        tuning, damping, backlash_damping, backlash, contact_ratio or stiffness_ratio, which are
        dimensionless; for a `OneDegreePair` also its quadratic_damping and similar parameters, for
        a `SixDegreePair` run_out_phase and pitch_phase, in the units of the model. All other
        parameters keep their values.
    to : float
        Value of the parameter at which the branch ends exactly.
    limits : tuple of float, optional
        Interval of the parameter (lowest, highest), at whose ends the branch also ends. By default
        the interval between the orbit's value and `to`.
    max_height : float
        Displacement range in static deflections above which the branch ends; without damping a
        resonance has no peak.
    step : float
        Largest arc length of a step. Displacements are measured in static deflections, the
        parameter in units of the distance from the orbit's value to `to`. Above a displacement
        range of 4 static deflections the largest step is proportional to this range.
    max_points : int
        Largest number of points of the branch.
    max_events : int
        Largest number of contact events in one mesh period.
    max_seconds : float, optional
        Time limit in seconds, after which the points computed so far are returned, see
        `gearlib.progress`.

    Returns
    -------
    xarray.Dataset
        Over ``point``, along the branch: the parameter under its name, state, multiplier_real,
        multiplier_imaginary, stable (no multiplier outside the unit circle), label, contacts (the
        sequence of contact states, D drive side, F free flight, C coast side), displacement_max,
        displacement_min, orbit_height (max - min), residual. Labelled points are located to
        rounding error; a branch that does not reach `to` has the label "end" at its last point.

    Raises
    ------
    ValueError
        If an argument is invalid; the message states its value and what is allowed.

    Notes
    -----
    At a grazing the orbit has a turning point on a flank line, and the sequence of contact states
    changes. Other special points are zeros of the test functions in
    `gearlib.analysis.orbits.special_points`.
    """
    check_orbit(orbit)
    name = tracing.check_parameter(orbit.model, parameter)
    start, to = tracing.start_and_goal(orbit.model, orbit.tuning, name, to, "the orbit")
    interval = _checked_limits(limits, start, to)
    scale = abs(to - start)
    time_limit = Limit(max_seconds)
    problem = Shooting(orbit.model, orbit.tuning, orbit.period, (name,), (scale,), max_events)
    try:
        first = _first_point(problem, problem.unknowns(orbit.state, [start]), np.sign(to - start))
        end_criteria = to, interval, max_height, step, max_points, time_limit
        points = _follow_branch(problem, first, *end_criteria)
    except tracing.ContinuationFailed as error:
        raise NoOrbit(f"no branch was found at the orbit: {error}") from None
    dataset = _branch_dataset(problem, points, name, to)
    missing = [] if time_limit.complete else [[points[-1].value, to]]
    return time_limit.mark(dataset, missing)


def _checked_limits(limits: Any, start: float, to: float) -> tuple:
    """Check the argument `limits` of `continue_orbit`, and return (lowest, highest) value.

    The interval must contain the value `start` of the parameter at the first orbit and the value
    `to` at the end of the branch. If `limits` is None, it is the interval between these two.
    """
    if limits is None:
        return min(start, to), max(start, to)
    low, high = limits
    allowed = f"an interval that holds the orbit's value {start!r} and to = {to!r}"
    checks.require(low <= min(start, to) <= max(start, to) <= high, "limits", limits, allowed)
    return low, high


def _first_point(problem: Shooting, unknowns: np.ndarray, sign: float) -> BranchPoint:
    """Return the first `BranchPoint` of a branch, an orbit with the tangent of the branch.

    `unknowns` are the scaled unknowns of a solution of the shooting equation: the state, then the
    parameter. The tangent points to larger values of the parameter if `sign` is 1, to smaller ones
    if it is -1. If the branch is normal to the parameter axis, the tangent points to orbits with a
    larger displacement range.
    """
    solution = problem.evaluate(unknowns)
    direction = tracing.tangent(solution.jacobian, sign * np.eye(unknowns.size)[-1])
    first = branch_point(solution, direction)
    if abs(direction[-1]) < _NORMAL_TOLERANCE:
        # The sign decides nothing here: compare neighbouring orbits in both directions.
        displacement_ranges = []
        for distance in (_PROBE_DISTANCE, -_PROBE_DISTANCE):
            start = unknowns + distance * direction
            neighbour, _ = tracing.correct(problem, start, direction)
            displacement_ranges.append(branch_point(neighbour, direction).displacement_range)
        if displacement_ranges[0] < displacement_ranges[1]:
            return replace(first, tangent=-direction)
    return first


def _follow_branch(problem, first, goal, interval, max_range, max_step, max_points, time_limit):
    """Return the `BranchPoint`s of a branch from the point `first` to the parameter value `goal`.

    `problem` is the `Shooting` equation. The branch ends earlier if the parameter leaves the
    `interval` (lowest, highest), the displacement range exceeds `max_range`, there are `max_points`
    points or the `Limit` `time_limit` is over; the last point then has the label "end". A step has
    at most the arc length `max_step` in scaled unknowns, longer in proportion for displacement
    ranges above _LARGE_RANGE.
    """
    points = [first]
    scaled_goal = goal / problem.units[-1]

    def step(length: float) -> tuple[float, str]:
        """Continue the branch by a step of an arc length and append its end and special points.

        The points of the step are appended to `points`. Return (arc length of the next step, reason
        why the branch ends here, or "" if it goes on).
        """
        last = points[-1]
        solution, tangent, corrections = tracing.take_step(
            problem, last.unknowns, last.tangent, length, scaled_goal
        )
        new = branch_point(solution, tangent)
        end_value = _end_value(last.value, new.value, first.value, goal, interval)
        if end_value is not None:
            scaled_end = end_value / problem.units[-1]
            solution = tracing.solve_at_value(problem, last.unknowns, new.unknowns, scaled_end)
            tangent = tracing.tangent(solution.jacobian, last.tangent)
            # Scaling may have changed the last digit of the parameter value: set it exactly.
            new = replace(branch_point(solution, tangent), value=end_value)
        new_points, ends_at_grazing = _points_of_step(problem, last, new)
        points.extend(new_points)
        if ends_at_grazing:
            end_value = None  # The step is cut off at the grazing, before this value.
        if end_value == goal or _is_closed(points, length):
            return length, "complete"
        if end_value is not None or points[-1].displacement_range > max_range:
            return length, "a limit is exceeded"
        if ends_at_grazing:
            # The multipliers change fast past a grazing, so the next step is short.
            return _STEP_PAST_GRAZING * max_step, ""
        max_length = max_step * max(1.0, new.displacement_range / _LARGE_RANGE)
        return tracing.next_step_length(length, corrections, _MAX_EASY_CORRECTIONS, max_length), ""

    lengths = _FIRST_STEP * max_step, _MIN_STEP * max_step  # of the first and the shortest step
    end_reason = tracing.follow_curve(step, points, *lengths, max_points, time_limit)
    if end_reason != "complete":
        points[-1] = replace(points[-1], label=points[-1].label or special.END)
    return points


def _end_value(last: float, new: float, first: float, goal: float, interval: tuple) -> float | None:
    """Return the parameter value at which a branch ends within a step, or None if it goes on.

    The step changes the parameter from `last` to `new`; its value was `first` at the start of the
    branch. The branch ends at `goal` or where the parameter leaves the `interval` (lowest,
    highest).
    """
    # The branch may start at the goal: it ends there only when it returns.
    if (last - goal) * (new - goal) <= 0.0 and last != goal:
        return goal
    # A branch that starts at an end of the interval must not end there due to a rounding error.
    tolerance = 1e-9 * abs(goal - first)
    low, high = interval
    if new < low - tolerance and low != goal:
        return low
    if new > high + tolerance and high != goal:
        return high
    return None


def _points_of_step(problem: Shooting, last: BranchPoint, new: BranchPoint) -> tuple[list, bool]:
    """Return (points added by a step from the point `last` to `new`, whether it meets a grazing).

    The points are the special points within the step, such as folds, and its end, `new`. If the
    sequence of contact states changes within the step, the orbit grazes (touches) a flank there:
    then the points end just past this grazing instead.
    """
    if new.contacts == last.contacts:
        return [*special.special_points(problem, last, new), new], False
    grazing, past_grazing = special.locate_grazing(problem, last, new)
    return [*special.special_points(problem, last, grazing), grazing, past_grazing], True


def _is_closed(points: list, step_length: float) -> bool:
    """Return whether a branch has returned to its first point, so that it is a closed curve.

    `points` are its `BranchPoint`s. The first one must lie ahead of the last one along its tangent,
    nearer than `step_length`, the length of a step, and the scalar product of both tangents must be
    positive.
    """
    if len(points) < _MIN_CLOSED_POINTS:
        return False
    first, last = points[0], points[-1]
    difference = first.unknowns - last.unknowns
    is_near = np.linalg.norm(difference) < step_length
    is_ahead = difference @ last.tangent >= 0.0
    return bool(is_near and is_ahead and first.tangent @ last.tangent > 0.0)


def _branch_dataset(problem: Shooting, points: list, name: str, goal: float) -> xr.Dataset:
    """Return the `BranchPoint`s of a branch as a dataset with the dimension ``point``.

    `problem` is the `Shooting` equation of the orbits, `name` the name of the continued parameter,
    and `goal` the value at which the branch should end.
    """
    maxima = np.array([point.displacement_max for point in points])
    minima = np.array([point.displacement_min for point in points])
    stable = [is_stable(point.solution.multipliers) for point in points]
    data = {
        "stable": ("point", np.array(stable, np.int8)),
        "label": ("point", np.array([point.label for point in points], np.int8)),
        "contacts": ("point", np.array([point.contacts for point in points], object)),
        "displacement_max": ("point", maxima),
        "displacement_min": ("point", minima),
        "orbit_height": ("point", maxima - minima),  # displacement range
        "static_deflection": problem.model.static_deflection,
    }
    if problem.model.pair:  # the `GearPair` of a model with one pair of gears
        data["backlash_ratio"] = problem.model.backlash_ratio
    data[name] = np.array([point.value for point in points])
    solutions = [point.solution for point in points]
    title = "Branch of periodic orbits of a gear mesh"
    dataset = branch_dataset(title, solutions, data, parameter=name, to=goal)
    dataset["label"].attrs |= flags_of(special.LABELS)
    dataset["label"].attrs["long_name"] = "type of special point"
    return dataset.assign_attrs(parameter=name)


def point_of_dataset(model: Any, branch, point, max_events: int, labels=()) -> BranchPoint:
    """Compute the `BranchPoint` of the point number `point` in a dataset of `continue_orbit`.

    `branch` is the dataset, `model` the model whose orbit was continued, and `max_events` the
    largest number of contact events in one mesh period. Raise ValueError if the point does not
    exist, or if its label is not among `labels`, which are indices in `special_points.LABELS`; an
    empty tuple allows any label. The tangent of the point is set to zero, because it is not known.
    """
    is_branch = "parameter" in getattr(branch, "attrs", ()) and {"state", "label"} <= {*branch}
    if not is_branch:
        name = type(branch).__name__
        raise ValueError(f"branch = {name} is not allowed: it must be from continue_orbit")
    last = branch.sizes["point"] - 1
    checks.require(point <= last, "point", point, f"an integer from 0 to {last}")
    if labels and int(branch.label[point]) not in labels:
        allowed = " or ".join(special.LABELS[label] for label in labels)
        raise ValueError(
            f"point = {point!r} is not allowed: it must be labelled {allowed}, it is "
            f"{special.LABELS[int(branch.label[point])]}"
        )
    name = tracing.check_parameter(model, branch.attrs["parameter"])
    state = branch["state"].values[point]
    allowed = f"the model of the branch, whose states have {state.size} components"
    checks.require(model.size == state.size, "model", type(model).__name__, allowed)
    value = float(branch[name][point])
    tuning = value if name == "tuning" else float(branch.tuning)
    # The parameter is scaled by its range on the branch, unless that is zero.
    scale = float(np.ptp(branch[name].values)) or 1.0
    # A dataset of several branches has a period for each point.
    period = int(branch.period[point] if branch.period.ndim else branch.period)
    problem = Shooting(model, tuning, period, (name,), (scale,), max_events)
    unknowns = problem.unknowns(state, [value])
    unknown_tangent = np.zeros(unknowns.size)
    try:
        return branch_point(problem.evaluate(unknowns), unknown_tangent)
    except tracing.ContinuationFailed as error:
        raise NoOrbit(f"the orbit of point {point} was not found: {error}") from None


@checked
def switch_branch(model, branch, point: WholeNumber, *, max_events: Count = MAX_EVENTS):
    """Switch at a period doubling to the branch of orbits with twice the period.

    Parameters
    ----------
    model : GearPair, OneDegreePair or SixDegreePair
        The model whose orbit was continued.
    branch : xarray.Dataset
        A result of `gearlib.continue_orbit`.
    point : int
        Index of a point labelled "period doubling".
    max_events : int
        Largest number of contact events in one mesh period.

    Returns
    -------
    Orbit
        Orbit of twice the period near the period doubling, for `continue_orbit`.

    Raises
    ------
    ValueError
        If the point does not exist or is not a period doubling.
    NoOrbit
        If no orbit of twice the period was found.
    """
    doubling = point_of_dataset(model, branch, point, max_events, (special.DOUBLING,))
    problem = doubling.solution.problem
    eigenvalues, eigenvectors = np.linalg.eig(doubling.solution.monodromy)
    n = len(eigenvalues)
    # The branch of twice the period starts along the eigenvector of the multiplier -1, at a
    # constant parameter. The eigenvector is scaled like the unknowns.
    eigenvector = eigenvectors[:, np.argmin(abs(eigenvalues + 1.0))].real / problem.units[:n]
    direction = np.append(eigenvector, 0.0)
    direction /= np.linalg.norm(direction)
    period, units = 2 * problem.period, problem.units[n:]
    doubled = Shooting(model, problem.tuning, period, problem.names, units, max_events)
    for distance in _SWITCH_DISTANCES:
        # Newton's method in the plane normal to the eigenvector cannot return to the old branch.
        start = doubling.unknowns + distance * direction
        try:
            solution, _ = tracing.correct(doubled, start, direction)
        except tracing.ContinuationFailed:
            continue
        return as_orbit(solution)
    raise NoOrbit(f"no orbit of twice the period was found at point {point}: try another point")
