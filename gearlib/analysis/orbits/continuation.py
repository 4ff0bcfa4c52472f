"""`continue_orbit`: continuation of periodic orbits; `switch_branch` at period doublings.

The exact shooting equation is continued by pseudo-arclength (`gearlib.analysis.orbits.tracing`). If
the sequence of contact states changes within a step, the grazing is located and added to the
branch. The continuation restarts just past the grazing with a short step, because the multipliers
change with the square root of the distance from the grazing.
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
from gearlib.data.status import flag_attributes
from gearlib.parameters import INTEGER, Count, Finite, Limits, Positive, WholeNumber, checked
from gearlib.progress import TimeLimit
from gearlib.runs.run_arguments import MAX_EVENTS, MaxSeconds

#: First, smallest, and first step past a grazing, relative to the largest step.
_FIRST_STEP, _MIN_STEP, _STEP_PAST_GRAZING = 0.1, 1e-4, 1e-3
#: The step length increases after at most this number of Newton corrections.
_MAX_EASY_CORRECTIONS = 3
#: Displacement range, in units of the static deflection, above which the largest step is
#: proportional to the range.
_LARGE_RANGE = 4.0
#: A branch is normal to the parameter axis if the parameter component of its unit tangent is
#: smaller.
_NORMAL_TOLERANCE = 1e-9
#: Scaled distance at which such a branch is probed on both sides of its first point.
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
        Interval (lowest, highest) of the parameter; the branch also ends where it leaves this
        interval. By default the interval between the orbit's value and `to`.
    max_height : float
        Displacement range in units of the static deflection above which the branch ends, because a
        resonance without damping has no peak.
    step : float
        Largest arc length of a step. Displacements are measured in units of the static deflection,
        the parameter in units of the distance from the orbit's value to `to`. Above a displacement
        range of 4 static deflections the largest step is proportional to this range.
    max_points : int
        Largest number of points of the branch.
    max_events : int
        Largest number of contact events in one mesh period.
    max_seconds : float, optional
        Time limit in seconds; the points computed up to then are returned, see `gearlib.progress`.

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
    start, to = tracing.start_and_target(orbit.model, orbit.tuning, name, to, "the orbit")
    interval = _check_limits(limits, start, to)
    scale = abs(to - start)
    time_limit = TimeLimit(max_seconds)
    problem = Shooting(orbit.model, orbit.tuning, orbit.period, (name,), (scale,), max_events)
    try:
        first = _first_point(problem, problem.unknowns(orbit.state, [start]), np.sign(to - start))
        end_criteria = to, interval, max_height, step, max_points, time_limit
        points = _follow_branch(problem, first, *end_criteria)
    except tracing.ContinuationFailed as error:
        raise NoOrbit(f"no branch was found at the orbit: {error}") from None
    dataset = _branch_dataset(problem, points, name, to)
    missing = [] if time_limit.complete else [[points[-1].value, to]]
    return time_limit.record_missing(dataset, missing)


def _check_limits(limits: Any, start: float, to: float) -> tuple:
    """Check the argument `limits` of `continue_orbit`; return (lowest, highest) value.

    The interval must contain the first value `start` of the parameter and its value `to` at the end
    of the branch. If `limits` is None, return the interval between these two values.
    """
    if limits is None:
        return min(start, to), max(start, to)
    low, high = limits
    allowed = f"an interval that contains the orbit's value {start!r} and to = {to!r}"
    checks.require(low <= min(start, to) <= max(start, to) <= high, "limits", limits, allowed)
    return low, high


def _first_point(problem: Shooting, unknowns: np.ndarray, sign: float) -> BranchPoint:
    """Return the first `BranchPoint` of a branch: an orbit and the unit tangent of the branch.

    `unknowns` are the scaled unknowns of a solution of the shooting equation: the state, then the
    parameter. With `sign` 1 the tangent points to larger values of the parameter, with -1 to
    smaller values. If the branch is normal to the parameter axis, the tangent points to orbits with
    a larger displacement range.
    """
    solution = problem.evaluate(unknowns)
    direction = tracing.unit_tangent(solution.jacobian, sign * np.eye(unknowns.size)[-1])
    first_point = branch_point(solution, direction)
    if abs(direction[-1]) < _NORMAL_TOLERANCE:
        # The sign does not determine the direction here, so compare the orbits on both sides.
        displacement_ranges = []
        for distance in (_PROBE_DISTANCE, -_PROBE_DISTANCE):
            predicted = unknowns + distance * direction
            neighbour, _ = tracing.correct_to_curve(problem, predicted, direction)
            displacement_ranges.append(branch_point(neighbour, direction).displacement_range)
        if displacement_ranges[0] < displacement_ranges[1]:
            return replace(first_point, tangent=-direction)
    return first_point


def _follow_branch(problem, start, target, interval, max_range, max_step, max_points, time_limit):
    """Return the `BranchPoint`s of a branch from the point `start` to the parameter value `target`.

    `problem` is the `Shooting` equation. The branch ends earlier if the parameter leaves the
    `interval` (lowest, highest), the displacement range exceeds `max_range`, there are `max_points`
    points, or the `TimeLimit` `time_limit` is reached; the last point then has the label "end". The
    arc length of a step in scaled unknowns is at most `max_step`, and increases in proportion to
    displacement ranges above _LARGE_RANGE.
    """
    points = [start]
    scaled_target = target / problem.units[-1]

    def step(length: float) -> tuple[float, str]:
        """Continue the branch by a step; append its end and the special points within it.

        `length` is the arc length of the step. Return (arc length of the next step, reason why the
        branch ends here, or "" if it continues).
        """
        previous = points[-1]
        solution, tangent, corrections = tracing.take_step(
            problem, previous.unknowns, previous.tangent, length, scaled_target
        )
        new = branch_point(solution, tangent)
        end_value = _end_value(previous.value, new.value, start.value, target, interval)
        if end_value is not None:
            scaled_end = end_value / problem.units[-1]
            solution = tracing.solve_at_value(problem, previous.unknowns, new.unknowns, scaled_end)
            tangent = tracing.unit_tangent(solution.jacobian, previous.tangent)
            # Scaling may have changed the last digit of the parameter value, so set it exactly.
            new = replace(branch_point(solution, tangent), value=end_value)
        new_points, ends_at_grazing = _points_of_step(problem, previous, new)
        points.extend(new_points)
        if ends_at_grazing:
            end_value = None  # The grazing comes before this value.
        if end_value == target or _is_closed(points, length):
            return length, "complete"
        if end_value is not None or points[-1].displacement_range > max_range:
            return length, "a limit is exceeded"
        if ends_at_grazing:
            # The multipliers change rapidly past a grazing, so the next step is short.
            return _STEP_PAST_GRAZING * max_step, ""
        max_length = max_step * max(1.0, new.displacement_range / _LARGE_RANGE)
        return tracing.next_step_length(length, corrections, _MAX_EASY_CORRECTIONS, max_length), ""

    # Lengths of the first and of the shortest step.
    step_lengths = _FIRST_STEP * max_step, _MIN_STEP * max_step
    end_reason = tracing.follow_curve(step, points, *step_lengths, max_points, time_limit)
    if end_reason != "complete":
        points[-1] = replace(points[-1], label=points[-1].label or special.END)
    return points


def _end_value(last_value, new_value, first_value, target, interval: tuple) -> float | None:
    """Return the parameter value at which a branch ends within a step, or None if it continues.

    The parameter changes from `last_value` to `new_value` in the step and was `first_value` at the
    start of the branch. The branch ends at `target` or where the parameter leaves the `interval`
    (lower limit, upper limit).
    """
    # A branch that starts at the target ends there only when it returns.
    if (last_value - target) * (new_value - target) <= 0.0 and last_value != target:
        return target
    # A rounding error must not end a branch that starts at a limit.
    tolerance = 1e-9 * abs(target - first_value)
    lower_limit, upper_limit = interval
    if new_value < lower_limit - tolerance and lower_limit != target:
        return lower_limit
    if new_value > upper_limit + tolerance and upper_limit != target:
        return upper_limit
    return None


def _points_of_step(
    problem: Shooting, last_point: BranchPoint, new_point: BranchPoint
) -> tuple[list, bool]:
    """Return (points to append for a step, whether the step ends at a grazing).

    The step goes from `last_point` to `new_point`. The points are the special points within the
    step, such as folds, followed by `new_point`. If the sequence of contact states changes, the
    orbit grazes (touches) a flank within the step, and the points end just past this grazing
    instead.
    """
    if new_point.contacts == last_point.contacts:
        return [*special.special_points(problem, last_point, new_point), new_point], False
    grazing, past_grazing = special.locate_grazing(problem, last_point, new_point)
    return [*special.special_points(problem, last_point, grazing), grazing, past_grazing], True


def _is_closed(points: list, step_length: float) -> bool:
    """Return whether a branch is a closed curve that has returned to its first point.

    `points` are its `BranchPoint`s. The first point must lie ahead of the last point, at a distance
    below `step_length`, and the branch must pass both points in the same direction.
    """
    if len(points) < _MIN_CLOSED_POINTS:
        return False
    first_point, last_point = points[0], points[-1]
    difference = first_point.unknowns - last_point.unknowns
    is_near = np.linalg.norm(difference) < step_length
    is_ahead = difference @ last_point.tangent >= 0.0
    return bool(is_near and is_ahead and first_point.tangent @ last_point.tangent > 0.0)


def _branch_dataset(problem: Shooting, points: list, name: str, target: float) -> xr.Dataset:
    """Return the `BranchPoint`s of a branch as a dataset with the dimension ``point``.

    `problem` is the `Shooting` equation of the orbits, `name` the continued parameter, and `target`
    the value at which the branch was to end.
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
    if problem.model.pair:  # only models with a single gear pair have a backlash ratio
        data["backlash_ratio"] = problem.model.backlash_ratio
    data[name] = np.array([point.value for point in points])
    solutions = [point.solution for point in points]
    title = "Branch of periodic orbits of a gear mesh"
    dataset = branch_dataset(title, solutions, data, parameter=name, to=target)
    dataset["label"].attrs |= flag_attributes(special.LABELS)
    dataset["label"].attrs["long_name"] = "type of special point"
    return dataset.assign_attrs(parameter=name)


def point_of_dataset(model: Any, branch, point, max_events: int, labels=()) -> BranchPoint:
    """Compute the `BranchPoint` number `point` of a dataset of `continue_orbit`.

    `branch` is the dataset, `model` the model whose orbit was continued, and `max_events` the
    largest number of contact events in one mesh period. `labels` are the allowed labels, indices in
    `special_points.LABELS`; if it is empty, any label is allowed. Raise ValueError if the point
    does not exist or has another label. The tangent of the point is set to zero, because it is
    unknown.
    """
    is_branch = "parameter" in getattr(branch, "attrs", ()) and {"state", "label"} <= {*branch}
    if not is_branch:
        name = type(branch).__name__
        raise ValueError(f"branch = {name} is not allowed: it must be a result of continue_orbit")
    last_index = branch.sizes["point"] - 1
    checks.require(point <= last_index, "point", point, f"an integer from 0 to {last_index}")
    if labels and int(branch.label[point]) not in labels:
        allowed = " or ".join(special.LABELS[label] for label in labels)
        raise ValueError(
            f"point = {point!r} is not allowed: it must be labelled {allowed}, but its label is "
            f"{special.LABELS[int(branch.label[point])]}"
        )
    name = tracing.check_parameter(model, branch.attrs["parameter"])
    state = branch["state"].values[point]
    allowed = f"the model of the branch, whose states have {state.size} components"
    checks.require(model.size == state.size, "model", type(model).__name__, allowed)
    value = float(branch[name][point])
    tuning = value if name == "tuning" else float(branch.tuning)
    # The parameter is scaled by its range on the branch, unless this range is zero.
    scale = float(np.ptp(branch[name].values)) or 1.0
    # A dataset with several branches has a period for each point.
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
        An orbit of twice the period near the period doubling, from which `continue_orbit` can
        start.

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
    # The new branch starts in the direction of the eigenvector of the multiplier -1, at a constant
    # parameter. The eigenvector is scaled like the unknowns.
    eigenvector = eigenvectors[:, np.argmin(abs(eigenvalues + 1.0))].real / problem.units[:n]
    direction = np.append(eigenvector, 0.0)
    direction /= np.linalg.norm(direction)
    period, units = 2 * problem.period, problem.units[n:]
    doubled_problem = Shooting(model, problem.tuning, period, problem.names, units, max_events)
    for distance in _SWITCH_DISTANCES:
        # Newton's method in a plane normal to the eigenvector cannot return to the old branch.
        predicted = doubling.unknowns + distance * direction
        try:
            solution, _ = tracing.correct_to_curve(doubled_problem, predicted, direction)
        except tracing.ContinuationFailed:
            continue
        return as_orbit(solution)
    raise NoOrbit(f"no orbit of twice the period was found at point {point}: try another point")
