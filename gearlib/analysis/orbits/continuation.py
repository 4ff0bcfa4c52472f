"""`continue_orbit`: a branch of periodic orbits over a parameter; `switch_branch` at doublings.

Steps by pseudo-arclength (`gearlib.analysis.orbits.tracing`) on the exact shooting equation. Where
the order of the phases of contact changes within a step, the grazing is located first, put on the
branch, and the branch is taken up just behind it with a short step, because the multipliers change
there like the root of the distance.
"""

from dataclasses import replace

import numpy as np

from gearlib import checks
from gearlib.analysis.orbits import followed_parameters, tracing
from gearlib.analysis.orbits import special_points as special
from gearlib.analysis.orbits.branch_points import branch_point, orbit_dataset
from gearlib.analysis.orbits.shooting import NoOrbit, Shooting, as_orbit, check_orbit, is_stable
from gearlib.data.status import flags_of
from gearlib.runs.run_arguments import MAX_EVENTS

#: First step, smallest step, step behind a grazing, over the largest.
_FIRST, _LEAST, _BEHIND = 0.1, 1e-4, 1e-3
#: A step that needs at most this many corrections may grow.
_EASY = 3
#: Height of an orbit, in static deflections, from which on the largest step grows with it.
_LARGE = 4.0
#: A tangent whose share of the parameter is smaller stands across it.
_VERTICAL = 1e-9
#: Distances from a period doubling at which the doubled orbit is looked for, scaled.
_AWAY = (0.02, 0.005, 0.1, 1e-3)


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
        As of `gearlib.periodic_orbit`.
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
    max_events : int
        As of `gearlib.simulate`.

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
    low, high = _limits(limits, start, to)
    max_height = checks.finite_positive("max_height", max_height)
    step = checks.finite_positive("step", step)
    max_points = checks.integer("max_points", max_points, 2)
    scale = abs(to - start)
    problem = Shooting(orbit.pair, orbit.tuning, orbit.period, (name,), (scale,), max_events)
    try:
        first = _first_point(problem, problem.unknowns(orbit.state, [start]), np.sign(to - start))
        points = _follow(problem, first, to, (low, high), max_height, step, max_points)
    except tracing.Lost as error:
        raise NoOrbit(f"no branch was found at the orbit: {error}") from None
    return _dataset(problem, points, name, to)


def _limits(limits, start, to):
    if limits is None:
        return min(start, to), max(start, to)
    low, high = (
        checks.number("limits", v, "two finite numbers", np.isfinite)
        for v in checks.many("limits", limits, 2)
    )
    if not low <= min(start, to) <= max(start, to) <= high:
        raise ValueError(
            f"limits = {limits!r} is not allowed: the orbit's value {start!r} and to = {to!r} must "
            "lie between them"
        )
    return low, high


def _first_point(problem, y, sign):
    """Return the first point of a branch, whose parameter grows or falls by `sign`.

    If it stands across the parameter, it is set towards the higher orbits.
    """
    orbit = problem.evaluate(y)
    direction = tracing.tangent(orbit.jacobian, sign * np.eye(y.size)[-1])
    first = branch_point(orbit, direction)
    if abs(direction[-1]) < _VERTICAL:
        steps = [tracing.correct(problem, y + h * direction, direction) for h in (1e-3, -1e-3)]
        ahead, back = (branch_point(orbit, direction).height for orbit, _ in steps)
        if ahead < back:
            return replace(first, tangent=-direction)
    return first


def _follow(problem, first, to, limits, max_height, largest, max_points):
    """Return the points of the branch, a list of `BranchPoint`."""
    points, goal = [first], to / problem.units[-1]

    def go(h):
        last = points[-1]
        orbit, tangent, corrections = tracing.advance(problem, last.y, last.tangent, h, goal)
        new = branch_point(orbit, tangent)
        end = _passed(last.value, new.value, first.value, to, limits)
        if end is not None:
            orbit = tracing.at_value(problem, last.y, new.y, end / problem.units[-1])
            tangent = tracing.tangent(orbit.jacobian, last.tangent)
            # Scaling and back may have cost the last digit of the value.
            new = replace(branch_point(orbit, tangent), value=end)
        added = _with_special(problem, last, new)
        points.extend(added)
        grazed = len(added) > 1 and added[-2].label == special.GRAZING
        if (end == to and not grazed) or _closed(points, h):
            return h, "complete"
        if (end is not None and not grazed) or points[-1].height > max_height:
            return h, "beyond its limits"
        # Where the motion is large, so may be the steps.
        h = tracing.longer(h, corrections, _EASY, largest * max(1.0, new.height / _LARGE))
        return _BEHIND * largest if grazed else h, ""

    ended = tracing.follow(go, points, _FIRST * largest, _LEAST * largest, max_points)
    if ended != "complete":
        points[-1] = replace(points[-1], label=points[-1].label or special.END)
    return points


def _passed(last, new, first, to, limits):
    """Return the value at which the branch ends within a step, None if it does not."""
    if (last - to) * (new - to) <= 0.0 and last != to:
        return to
    # On the side where the branch began, rounding is no reason to end it.
    slack = 1e-9 * abs(to - first)
    low, high = limits
    if new < low - slack and low != to:
        return low
    if new > high + slack and high != to:
        return high
    return None


def _with_special(problem, last, new):
    """Return the points of a step: special points, and the new one or that behind a grazing."""
    if new.pattern == last.pattern:
        return [*special.special_points(problem, last, new), new]
    before, after = special.grazing(problem, last, new)
    return [*special.special_points(problem, last, before), before, after]


def _closed(points, h):
    """Return whether the branch has come back to its first point, in its first direction."""
    if len(points) < 10:
        return False
    first, last = points[0], points[-1]
    way = first.y - last.y
    near = np.linalg.norm(way) < h
    return near and first.tangent @ last.tangent > 0.0 and way @ last.tangent >= 0.0


def _dataset(problem, points, name, to):
    """Return the branch as a dataset over its points."""
    values, high, low = np.array([(point.value, point.high, point.low) for point in points]).T
    stable = [is_stable(point.orbit.multipliers) for point in points]
    data = {
        "stable": ("point", np.array(stable, np.int8)),
        "label": ("point", np.array([point.label for point in points], np.int8)),
        "contacts": ("point", np.array([point.pattern for point in points], object)),
        "displacement_max": ("point", high),
        "displacement_min": ("point", low),
        "orbit_height": ("point", high - low),
        "static_deflection": problem.pair.static_deflection,
        name: values,
    }
    if problem.pair.mesh:
        data["backlash_ratio"] = problem.pair.backlash_ratio
    orbits, title = [point.orbit for point in points], "Branch of periodic orbits of a gear mesh"
    dataset = orbit_dataset(title, orbits, data, parameter=name, to=to)
    dataset["label"].attrs |= flags_of(special.LABELS)
    dataset["label"].attrs["long_name"] = "what kind of point of the branch"
    return dataset.assign_attrs(parameter=name)


def restored(model, branch, point, max_events, labels=None):
    """Return a `BranchPoint` of a dataset, else ValueError, also if its label is none of these."""
    if "parameter" not in getattr(branch, "attrs", ()):
        raise ValueError(f"branch = {branch!r} is not allowed: it must be one of continue_orbit")
    point = checks.integer("point", point, 0, branch.sizes["point"] - 1)
    if labels and int(branch.label[point]) not in labels:
        words = [special.LABELS[label] for label in (*labels, int(branch.label[point]))]
        raise ValueError(
            f"point = {point!r} is not allowed: it must be labelled "
            f"{' or '.join(words[:-1])}, it is {words[-1]}"
        )
    name = followed_parameters.check_parameter(model, branch.attrs["parameter"])
    value = float(branch[name][point])
    tuning = value if name == "tuning" else float(branch.tuning)
    scale = float(np.ptp(branch[name].values)) or 1.0
    # One number, or that of each point where several branches are put together.
    period = int(branch.period[point] if branch.period.ndim else branch.period)
    problem = Shooting(model, tuning, period, (name,), (scale,), max_events)
    y = problem.unknowns(branch["state"].values[point], [value])
    return branch_point(problem.evaluate(y), np.zeros(y.size))


def switch_branch(pair, branch, point, *, max_events=MAX_EVENTS):
    """Return an orbit of twice the period, on the branch born at a period doubling.

    Parameters
    ----------
    pair : GearPair, OneDegreePair or SixDegreePair
        The model whose orbit was continued.
    branch : xarray.Dataset
        As of `continue_orbit`.
    point : int
        Number of a point labelled "period doubling".
    max_events : int
        As of `gearlib.simulate`.

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
    chosen = restored(pair, branch, point, max_events, (special.DOUBLING,))
    problem = chosen.orbit.problem
    values, vectors = np.linalg.eig(chosen.orbit.matrix)
    n = len(values)
    row = np.append(vectors[:, np.argmin(abs(values + 1.0))].real / problem.units[:n], 0.0)
    row /= np.linalg.norm(row)
    period, scales = 2 * problem.period, problem.units[n:]
    doubled = Shooting(pair, problem.tuning, period, problem.names, scales, max_events)
    for distance in _AWAY:
        try:
            orbit, _ = tracing.correct(doubled, chosen.y + distance * row, row)
        except tracing.Lost:
            continue
        return as_orbit(orbit)
    raise NoOrbit(f"no orbit of twice the period was found at point {point}: try a neighbour's")
