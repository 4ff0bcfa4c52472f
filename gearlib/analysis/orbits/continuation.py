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
from gearlib.analysis.orbits.branch_points import Shooting, as_orbit, branch_point
from gearlib.analysis.orbits.shooting import NoOrbit, check_orbit
from gearlib.data.result import result
from gearlib.runs.run_arguments import MAX_EVENTS

#: First step, smallest step, step behind a grazing, over the largest.
_FIRST, _LEAST, _BEHIND = 0.1, 1e-4, 1e-3
#: A step that needs at most this many corrections may grow.
_EASY, _GROWTH = 3, 1.5
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
    start = followed_parameters.value_of(orbit.pair, orbit.tuning, name)
    to = checks.number("to", to, f"another {name} than that of the orbit", lambda v: v != start)
    followed_parameters.with_parameter(orbit.pair, orbit.tuning, name, to)
    low, high = _limits(limits, start, to)
    max_height = checks.finite_positive("max_height", max_height)
    step = checks.finite_positive("step", step)
    max_points = checks.integer("max_points", max_points, 2)
    problem = Shooting(
        orbit.pair, orbit.tuning, orbit.period, (name,), (abs(to - start),), max_events
    )
    try:
        points = _follow(problem, orbit, start, to, (low, high), max_height, step, max_points)
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


def _follow(problem, orbit, start, to, limits, max_height, largest, max_points):
    """Return the points of the branch, a list of `BranchPoint`."""
    y = problem.unknowns(orbit.state, [start])
    found = problem.evaluate(y)
    ahead = np.zeros(y.size)
    ahead[-1] = np.sign(to - start)
    direction = tracing.tangent(found.jacobian, ahead)
    first = branch_point(problem, y, found, direction)
    if abs(direction[-1]) < _VERTICAL:
        first = _towards_larger(problem, first)
    points, h = [first], _FIRST * largest
    # On the side where the branch began, rounding is no reason to end it.
    slack = 1e-9 * abs(to - start)
    while len(points) < max_points:
        last = points[-1]
        try:
            new, corrections = _advance(problem, last, h, to)
            end = _passed(last.value, new.value, to, limits, slack)
            if end is not None:
                new = _at_end(problem, last, new, end)
            added = _with_special(problem, last, new)
        except tracing.Lost:
            h *= 0.5
            if h < _LEAST * largest:
                points[-1] = replace(last, label=last.label or special.END)
                break
            continue
        points += added
        grazed = len(added) > 1 and added[-2].label == special.GRAZING
        if end is not None and not grazed:
            if end != to:
                points[-1] = replace(points[-1], label=special.END)
            break
        if points[-1].high - points[-1].low > max_height:
            points[-1] = replace(points[-1], label=special.END)
            break
        if _closed(points, h):
            break
        if grazed:
            h = _BEHIND * largest
        elif corrections <= _EASY:
            # Where the motion is large, so may be the steps.
            h = min(_GROWTH * h, largest * max(1.0, (new.high - new.low) / _LARGE))
    else:
        points[-1] = replace(points[-1], label=points[-1].label or special.END)
    return points


def _advance(problem, last, h, to):
    """Return (point, corrections) one step of length h behind the last point, or at `to`."""
    goal = to / problem.units[-1]
    ahead = last.y[-1] + h * last.tangent[-1]
    if (last.y[-1] - goal) * (ahead - goal) < 0.0:
        # What lies behind may not be allowed.
        share = (goal - last.y[-1]) / (ahead - last.y[-1])
        y, found = tracing.at_value(problem, last.y + share * h * last.tangent, -1, goal)
        if not np.linalg.norm(y - last.y) < 2.0 * h:
            raise tracing.Lost("the step leads too far")
        direction, corrections = tracing.tangent(found.jacobian, last.tangent), 0
        tracing.check_straight(direction, last.tangent)
    else:
        y, found, direction, corrections = tracing.advance(problem, last.y, last.tangent, h)
    return branch_point(problem, y, found, direction), corrections


def _passed(last, new, to, limits, slack):
    """Return the value at which the branch ends within a step, None if it does not."""
    if (last - to) * (new - to) <= 0.0 and last != to:
        return to
    low, high = limits
    if new < low - slack and low != to:
        return low
    if new > high + slack and high != to:
        return high
    return None


def _at_end(problem, last, new, value):
    """Return the point between two at which the parameter has a value."""
    share = (value - last.value) / (new.value - last.value)
    start = last.y + share * (new.y - last.y)
    y, found = tracing.at_value(problem, start, -1, value / problem.units[-1])
    point = branch_point(problem, y, found, tracing.tangent(found.jacobian, last.tangent))
    # Scaling and back may have cost the last digit.
    return replace(point, value=value)


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


def _towards_larger(problem, first):
    """Return the first point of a branch that stands across the parameter, set to grow."""

    def height(sign):
        y, found, _ = tracing.correct(problem, first.y + sign * 1e-3 * first.tangent, first.tangent)
        point = branch_point(problem, y, found, first.tangent)
        return point.high - point.low

    return first if height(1) >= height(-1) else replace(first, tangent=-first.tangent)


def _dataset(problem, points, name, to):
    multipliers = np.array([point.multipliers for point in points])
    high = np.array([point.high for point in points])
    low = np.array([point.low for point in points])
    data = {
        "state": (("point", "coordinate"), np.array([point.state for point in points])),
        "multiplier_real": (("point", "multiplier"), multipliers.real),
        "multiplier_imaginary": (("point", "multiplier"), multipliers.imag),
        "stable": ("point", np.array([point.stable for point in points], np.int8)),
        "label": ("point", np.array([point.label for point in points], np.int8)),
        "contacts": ("point", np.array([point.pattern for point in points], object)),
        "displacement_max": ("point", high),
        "displacement_min": ("point", low),
        "orbit_height": ("point", high - low),
        "residual": ("point", np.array([point.residual for point in points])),
        "period": np.int32(problem.period),
        "static_deflection": problem.pair.static_deflection,
    }
    if problem.pair.mesh:
        data["backlash_ratio"] = problem.pair.backlash_ratio
    if name != "tuning":
        data["tuning"] = problem.tuning
    attributes = followed_parameters.attributes(problem.pair, name)
    data[name] = "point", np.array([point.value for point in points]), attributes
    dataset = result(
        "Branch of periodic orbits of a gear mesh",
        problem.pair,
        data,
        method="pseudo-arclength on shooting",
        parameter=name,
        period=problem.period,
        tuning=problem.tuning,
        to=to,
    )
    dataset["label"].attrs |= {
        "long_name": "what kind of point of the branch",
        "flag_values": np.arange(len(special.LABELS), dtype=np.int8),
        "flag_meanings": " ".join(label.replace(" ", "_") for label in special.LABELS),
    }
    return dataset.assign_attrs(parameter=name)


def restored(model, branch, point, max_events):
    """Return (problem, point) of a branch that is given as a dataset."""
    if "parameter" not in getattr(branch, "attrs", ()):
        raise ValueError(f"branch = {branch!r} is not allowed: it must be one of continue_orbit")
    point = checks.integer("point", point, 0, branch.sizes["point"] - 1)
    name = followed_parameters.check_parameter(model, branch.attrs["parameter"])
    value = float(branch[name][point])
    tuning = value if name == "tuning" else float(branch.tuning)
    scale = float(np.ptp(branch[name].values)) or 1.0
    # One number, or that of each point where several branches are put together.
    period = int(branch.period[point] if branch.period.ndim else branch.period)
    problem = Shooting(model, tuning, period, (name,), (scale,), max_events)
    y = problem.unknowns(branch["state"].values[point], [value])
    return problem, branch_point(problem, y, problem.evaluate(y), np.zeros(y.size))


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
    problem, chosen = restored(pair, branch, point, max_events)
    if int(branch.label[point]) != special.DOUBLING:
        raise ValueError(f"point = {point!r} is not allowed: it must be labelled period doubling")
    values, vectors = np.linalg.eig(chosen.matrix)
    n = len(values)
    row = np.zeros(n + 1)
    row[:n] = vectors[:, np.argmin(abs(values + 1.0))].real / problem.units[:n]
    row /= np.linalg.norm(row)
    doubled = Shooting(
        pair,
        problem.tuning,
        2 * problem.period,
        problem.names,
        problem.units[n:],
        max_events,
    )
    for distance in _AWAY:
        try:
            y, found, _ = tracing.correct(doubled, chosen.y + distance * row, row)
        except tracing.Lost:
            continue
        return as_orbit(doubled, branch_point(doubled, y, found, row))
    raise NoOrbit(f"no orbit of twice the period was found at point {point}: try a neighbour's")
