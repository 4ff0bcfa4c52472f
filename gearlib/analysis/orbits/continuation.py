"""`continue_orbit`: a branch of periodic orbits over a parameter; `switch_branch` at doublings.

Steps by pseudo-arclength (`gearlib.analysis.orbits.tracing`) on the exact shooting equation. Where
the order of the contact states changes within a step, the grazing is located first and put on the
branch, which goes on just behind it with a short step, because the multipliers change there like
the root of the distance.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from gearlib import checks
from gearlib.analysis.orbits import followed_parameters, tracing
from gearlib.analysis.orbits import special_points as special
from gearlib.analysis.orbits.shooting import NoOrbit, Shooting, as_orbit, check_orbit, is_stable
from gearlib.analysis.orbits.special_points import BranchPoint, branch_dataset, branch_point
from gearlib.data.status import flags_of
from gearlib.runs.run_arguments import MAX_EVENTS

#: First step, smallest step and step behind a grazing, as shares of the largest step.
_FIRST_STEP, _MIN_STEP, _STEP_BEHIND_GRAZING = 0.1, 1e-4, 1e-3
#: Corrections up to which a step counts as easy, so that the next may be longer.
_MAX_EASY_CORRECTIONS = 3
#: Height of an orbit, in static deflections, from which on the largest step grows with it.
_LARGE_HEIGHT = 4.0
#: Component of the parameter in a tangent below which the branch is normal to its axis.
_NORMAL_TOLERANCE = 1e-9
#: Distances from a period doubling at which the doubled orbit is sought, scaled.
_SWITCH_DISTANCES = (0.02, 0.005, 0.1, 1e-3)


def continue_orbit(
    orbit,
    parameter="tuning",
    *,
    to,
    limits=None,
    max_height=200.0,
    step=0.05,
    max_points=4000,
    max_events=MAX_EVENTS,
):
    """Follow a periodic orbit over a parameter, past folds and through changes of contact.

    Parameters
    ----------
    orbit : Orbit
        A result of `gearlib.periodic_orbit`.
    parameter : str
        tuning, damping, backlash_damping, backlash, contact_ratio or stiffness_ratio, which are
        dimensionless; of a `OneDegreePair` also its quadratic_damping and the like, of a
        `SixDegreePair` run_out_phase and pitch_phase, in the units of the model. All others keep
        their values.
    to : float
        Value at which the branch ends; it is met exactly.
    limits : tuple of float, optional
        The branch also ends where it leaves this interval; by default that between the orbit's
        value and `to`.
    max_height : float
        The branch ends at orbits higher than this, in static deflections: without damping a
        resonance has no top.
    step : float
        Largest step, in static deflections; the way from the orbit's value to `to` counts as one.
        Where orbits are higher than 4 static deflections the steps grow with them.
    max_points : int
        Largest number of points.
    max_events : int
        Largest number of contact events in one mesh period.

    Returns
    -------
    xarray.Dataset
        Over ``point``, in branch order: the parameter under its name, state, multiplier_real,
        multiplier_imaginary, stable (no multiplier outside the unit circle), label, contacts (the
        order of the phases of contact, N normal, B backlash, I inverse), displacement_max,
        displacement_min, orbit_height, residual. Labelled points are orbits of their own, located
        to rounding; the label "end" is on a last point that is not at `to`.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.

    Notes
    -----
    Grazings are where the order of contacts changes: an orbit that comes to a flank line and turns
    there. See `gearlib.analysis.orbits.special_points` for the test functions of the others.
    """
    check_orbit(orbit)
    name = followed_parameters.check_parameter(orbit.pair, parameter)
    start, to = followed_parameters.check_goal(
        orbit.pair, orbit.tuning, name, to, "that of the orbit"
    )
    interval = _checked_limits(limits, start, to)
    max_height = checks.finite_positive("max_height", max_height)
    step = checks.finite_positive("step", step)
    max_points = checks.integer("max_points", max_points, 2)
    scale = abs(to - start)
    problem = Shooting(orbit.pair, orbit.tuning, orbit.period, (name,), (scale,), max_events)
    try:
        first = _first_point(problem, problem.unknowns(orbit.state, [start]), np.sign(to - start))
        points = _follow_branch(problem, first, to, interval, max_height, step, max_points)
    except tracing.ContinuationFailed as error:
        raise NoOrbit(f"no branch was found at the orbit: {error}") from None
    return _dataset(problem, points, name, to)


def _checked_limits(limits: Any, start: float, to: float) -> tuple:
    """Return the argument `limits` as (lowest, highest) value of the parameter, checked.

    By default they are its values `start` at the first orbit and `to` at the end of the branch.
    """
    if limits is None:
        return min(start, to), max(start, to)
    low, high = (
        checks.number("limits", limit, "two finite numbers", np.isfinite)
        for limit in checks.many("limits", limits, 2)
    )
    if not low <= min(start, to) <= max(start, to) <= high:
        raise ValueError(
            f"limits = {limits!r} is not allowed: the orbit's value {start!r} and to = {to!r} must "
            "lie between them"
        )
    return low, high


def _first_point(problem: Shooting, unknowns: np.ndarray, sign: float) -> BranchPoint:
    """Return the first point of a branch, at scaled unknowns of the shooting equation.

    Its tangent leads to larger values of the parameter for the sign 1, to smaller ones for -1; to
    higher orbits if the branch is normal to the parameter's axis.
    """
    solution = problem.evaluate(unknowns)
    direction = tracing.tangent(solution.jacobian, sign * np.eye(unknowns.size)[-1])
    first = branch_point(solution, direction)
    if abs(direction[-1]) < _NORMAL_TOLERANCE:
        heights = []
        for distance in (1e-3, -1e-3):
            start = unknowns + distance * direction
            neighbour, _ = tracing.correct(problem, start, direction)
            heights.append(branch_point(neighbour, direction).height)
        if heights[0] < heights[1]:
            return replace(first, tangent=-direction)
    return first


def _follow_branch(
    problem: Shooting,
    first: BranchPoint,
    to: float,
    limits: tuple,
    max_height: float,
    max_step: float,
    max_points: int,
) -> list:
    """Return the `BranchPoint`s of a branch from its first point to the parameter value `to`.

    It ends earlier where it leaves the parameter limits (lowest, highest) or orbits become higher
    than `max_height`; the last point then has the label "end".
    """
    points, goal = [first], to / problem.units[-1]

    def step(length: float) -> tuple[float, str]:
        """Take a step and add its points; return (next length, reason for the end or "")."""
        last = points[-1]
        solution, tangent, corrections = tracing.take_step(
            problem, last.unknowns, last.tangent, length, goal
        )
        new = branch_point(solution, tangent)
        end = _value_at_end(last.value, new.value, first.value, to, limits)
        if end is not None:
            scaled_end = end / problem.units[-1]
            solution = tracing.solve_at_value(problem, last.unknowns, new.unknowns, scaled_end)
            tangent = tracing.tangent(solution.jacobian, last.tangent)
            # Scaling and back may have cost the last digit of the value.
            new = replace(branch_point(solution, tangent), value=end)
        added = _points_of_step(problem, last, new)
        points.extend(added)
        grazed = len(added) > 1 and added[-2].label == special.GRAZING
        if (end == to and not grazed) or _is_closed(points, length):
            return length, "complete"
        if (end is not None and not grazed) or points[-1].height > max_height:
            return length, "beyond its limits"
        if grazed:
            return _STEP_BEHIND_GRAZING * max_step, ""
        longest = max_step * max(1.0, new.height / _LARGE_HEIGHT)
        return tracing.next_step_length(length, corrections, _MAX_EASY_CORRECTIONS, longest), ""

    end_reason = tracing.follow_curve(
        step, points, _FIRST_STEP * max_step, _MIN_STEP * max_step, max_points
    )
    if end_reason != "complete":
        points[-1] = replace(points[-1], label=points[-1].label or special.END)
    return points


def _value_at_end(last: float, new: float, first: float, to: float, limits: tuple) -> float | None:
    """Return the value of the parameter at which the branch ends within a step, or None.

    The parameter goes from `last` to `new` in the step; the branch began at `first` and ends at
    `to` or at a limit (lowest, highest).
    """
    if (last - to) * (new - to) <= 0.0 and last != to:
        return to
    # Rounding must not end the branch at the limit where it began.
    slack = 1e-9 * abs(to - first)
    low, high = limits
    if new < low - slack and low != to:
        return low
    if new > high + slack and high != to:
        return high
    return None


def _points_of_step(problem: Shooting, last: BranchPoint, new: BranchPoint) -> list:
    """Return the points that a step from `last` to `new` adds: special points, then `new`.

    If the step passes a grazing, it ends at the point just behind the grazing instead.
    """
    if new.pattern == last.pattern:
        return [*special.special_points(problem, last, new), new]
    before, behind = special.locate_grazing(problem, last, new)
    return [*special.special_points(problem, last, before), before, behind]


def _is_closed(points: list, step_length: float) -> bool:
    """Return whether a branch has come back to within a step of its first point.

    `points` are its `BranchPoint`s; both ends must have the same direction.
    """
    if len(points) < 10:
        return False
    first, last = points[0], points[-1]
    difference = first.unknowns - last.unknowns
    is_near = np.linalg.norm(difference) < step_length
    same_direction = first.tangent @ last.tangent > 0.0 and difference @ last.tangent >= 0.0
    return bool(is_near and same_direction)


def _dataset(problem: Shooting, points: list, name: str, to: float) -> xr.Dataset:
    """Return the `BranchPoint`s of a branch as a dataset over ``point``.

    `name` is the parameter, `to` the value at which the branch was to end.
    """
    highest = np.array([point.displacement_max for point in points])
    lowest = np.array([point.displacement_min for point in points])
    stable = [is_stable(point.solution.multipliers) for point in points]
    data = {
        "stable": ("point", np.array(stable, np.int8)),
        "label": ("point", np.array([point.label for point in points], np.int8)),
        "contacts": ("point", np.array([point.pattern for point in points], object)),
        "displacement_max": ("point", highest),
        "displacement_min": ("point", lowest),
        "orbit_height": ("point", highest - lowest),
        "static_deflection": problem.pair.static_deflection,
        name: np.array([point.value for point in points]),
    }
    if problem.pair.mesh:
        data["backlash_ratio"] = problem.pair.backlash_ratio
    solutions = [point.solution for point in points]
    title = "Branch of periodic orbits of a gear mesh"
    dataset = branch_dataset(title, solutions, data, parameter=name, to=to)
    dataset["label"].attrs |= flags_of(special.LABELS)
    dataset["label"].attrs["long_name"] = "what kind of point of the branch"
    return dataset.assign_attrs(parameter=name)


def point_of_dataset(
    model: Any, branch: xr.Dataset, point: int, max_events: int, labels: tuple = ()
) -> BranchPoint:
    """Return the point with a number in a dataset of `continue_orbit` as a `BranchPoint`.

    Raise ValueError if there is no such point, or if its label is none of `labels` (indices in
    `special_points.LABELS`; empty: any).
    """
    if "parameter" not in getattr(branch, "attrs", ()):
        raise ValueError(f"branch = {branch!r} is not allowed: it must be one of continue_orbit")
    point = checks.integer("point", point, 0, branch.sizes["point"] - 1)
    if labels and int(branch.label[point]) not in labels:
        allowed = " or ".join(special.LABELS[label] for label in labels)
        raise ValueError(
            f"point = {point!r} is not allowed: it must be labelled {allowed}, it is "
            f"{special.LABELS[int(branch.label[point])]}"
        )
    name = followed_parameters.check_parameter(model, branch.attrs["parameter"])
    value = float(branch[name][point])
    tuning = value if name == "tuning" else float(branch.tuning)
    scale = float(np.ptp(branch[name].values)) or 1.0
    # Where several branches are put together, each point has a period.
    period = int(branch.period[point] if branch.period.ndim else branch.period)
    problem = Shooting(model, tuning, period, (name,), (scale,), max_events)
    unknowns = problem.unknowns(branch["state"].values[point], [value])
    return branch_point(problem.evaluate(unknowns), np.zeros(unknowns.size))


def switch_branch(pair, branch, point, *, max_events=MAX_EVENTS):
    """Return an orbit of twice the period, on the branch born at a period doubling.

    Parameters
    ----------
    pair : GearPair, OneDegreePair or SixDegreePair
        The model whose orbit was continued.
    branch : xarray.Dataset
        A result of `gearlib.continue_orbit`.
    point : int
        Number of a point labelled "period doubling".
    max_events : int
        Largest number of contact events in one mesh period.

    Returns
    -------
    Orbit
        Near the doubling, its pair and tuning those at which it lies; `continue_orbit` follows it.

    Raises
    ------
    ValueError
        If the point is none, or no period doubling.
    NoOrbit
        If the doubled orbit was not found.
    """
    doubling = point_of_dataset(pair, branch, point, max_events, (special.DOUBLING,))
    problem = doubling.solution.problem
    values, vectors = np.linalg.eig(doubling.solution.monodromy)
    n = len(values)
    eigenvector = vectors[:, np.argmin(abs(values + 1.0))].real / problem.units[:n]
    direction = np.append(eigenvector, 0.0)
    direction /= np.linalg.norm(direction)
    period, scales = 2 * problem.period, problem.units[n:]
    doubled = Shooting(pair, problem.tuning, period, problem.names, scales, max_events)
    for distance in _SWITCH_DISTANCES:
        start = doubling.unknowns + distance * direction
        try:
            solution, _ = tracing.correct(doubled, start, direction)
        except tracing.ContinuationFailed:
            continue
        return as_orbit(solution)
    raise NoOrbit(f"no orbit of twice the period was found at point {point}: try a neighbour's")
