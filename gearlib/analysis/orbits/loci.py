"""`locus`: folds, period doublings and grazings over two parameters.

The shooting equation and one more, the defining function of the special point, fix a curve in the
space of state and both parameters, which is followed by pseudo-arclength like a branch:

================  =============================================================
fold              det(M - I) = 0
period doubling   det(M + I) = 0
grazing           a turning point lies on a flank line
================  =============================================================

Its derivatives are central differences, which decide how fast Newton's method converges, not where
to.
"""

import numpy as np

from gearlib import checks
from gearlib.analysis.orbits import followed_parameters, touching
from gearlib.analysis.orbits import special_points as special
from gearlib.analysis.orbits.branch_points import Evaluation, Shooting
from gearlib.analysis.orbits.continuation import restored
from gearlib.analysis.orbits.shooting import NoOrbit, multipliers_of
from gearlib.analysis.orbits.tracing import Lost, advance, at_value, tangent
from gearlib.data.result import result
from gearlib.runs.run_arguments import MAX_EVENTS

#: Step of the differences of the defining function, scaled.
_DIFFERENCE = 1e-6
#: The defining function counts as zero below this share of its change per scaled unit.
_ZERO = 1e-10
_FIRST, _LEAST, _EASY, _GROWTH, _LARGE = 0.2, 1e-3, 4, 1.5, 2.0


class _Extended:
    """The shooting equation with a defining function, over two parameters."""

    def __init__(self, shooting, label, touch):
        self.shooting, self.label, self.touch = shooting, label, touch
        self._sign = -1.0 if label == special.FOLD else 1.0

    def defining(self, y):
        """Return the defining function at scaled unknowns."""
        shooting = self.shooting
        if self.label == special.GRAZING:
            pair, tuning, z = shooting.model(y)
            rest = shooting.period, shooting.max_events
            return touching.distance(pair, tuning, z, *rest, *self.touch)[0]
        return np.prod(multipliers_of(shooting.evaluate(y).matrix) + self._sign).real

    def slopes(self, y):
        """Return its derivatives by the scaled unknowns, by central differences."""
        row = np.empty(y.size)
        for column in range(y.size):
            ends = []
            for step in (-_DIFFERENCE, _DIFFERENCE):
                moved = y.copy()
                moved[column] += step
                try:
                    self.shooting.model(moved)
                except ValueError:
                    # On the rim of the parameter's range the difference is one-sided.
                    moved = y
                ends.append((moved[column], self.defining(moved)))
            (low, first), (high, last) = ends
            row[column] = (last - first) / (high - low)
        return row

    def evaluate(self, y):
        """Return residuals and their derivatives at scaled unknowns."""
        return _Condition(self, y, self.shooting.evaluate(y))

    def follow(self, y):
        """Keep hold of the turning point that touches, while it moves."""
        if self.label == special.GRAZING:
            pair, tuning, z = self.shooting.model(y)
            rest = self.shooting.period, self.shooting.max_events
            _, phase = touching.distance(pair, tuning, z, *rest, *self.touch)
            self.touch = phase, self.touch[1]


class _Condition:
    """An `Evaluation` with the defining function below."""

    def __init__(self, problem, y, inner: Evaluation):
        self.inner = inner
        try:
            value = problem.defining(y)
            row = problem.slopes(y)
        except ValueError as error:
            raise Lost(str(error)) from None
        size = np.linalg.norm(row)
        self.value = value / size
        self.miss = np.append(inner.miss, self.value)
        self.jacobian = np.vstack([inner.jacobian, row / size])

    @property
    def small(self):
        """Whether the residuals count as none."""
        return self.inner.small and abs(self.value) <= _ZERO


def locus(
    pair,
    branch,
    point,
    parameter,
    *,
    to,
    limits=(-np.inf, np.inf),
    step=0.05,
    max_points=1000,
    max_events=MAX_EVENTS,
):
    """Follow a fold, a period doubling or a grazing over a second parameter.

    Parameters
    ----------
    pair : GearPair, OneDegreePair or SixDegreePair
        The model whose orbit was continued.
    branch : xarray.Dataset
        As of `gearlib.continue_orbit`.
    point : int
        Number of a point labelled "fold", "period doubling" or "grazing".
    parameter : str
        Another parameter than the branch's, as of `gearlib.continue_orbit`.
    to : float
        Value of it at which the locus ends; also where it comes back to the pair's own value.
    limits : tuple of float
        The locus also ends where the branch's parameter leaves this interval.
    step : float
        Largest step; one is a static deflection, the range of the branch, the way to `to`. Where
        the state is larger than 2 static deflections the steps grow with it.
    max_points : int
    max_events : int
        As of `gearlib.simulate`.

    Returns
    -------
    xarray.Dataset
        Over ``point``: both parameters under their names, state, multiplier_real,
        multiplier_imaginary, residual; the label of all. A locus may end before `to`, for instance
        a fold where it meets a grazing: see the attribute ``ended``.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    NoOrbit
        If the special point itself was not found.
    """
    problem, chosen = restored(pair, branch, point, max_events)
    first = branch.attrs["parameter"]
    second = followed_parameters.check_parameter(pair, parameter)
    label = int(branch.label[point])
    if label not in (special.FOLD, special.DOUBLING, special.GRAZING):
        raise ValueError(
            f"point = {point!r} is not allowed: it must be labelled fold, period doubling or "
            f"grazing, it is {special.LABELS[label]}"
        )
    checks.require(second != first, "parameter", parameter, "another than the branch's")
    start = followed_parameters.value_of(pair, problem.tuning, second)
    to = checks.number("to", to, f"another {second} than the pair's", lambda v: v != start)
    followed_parameters.with_parameter(pair, problem.tuning, second, to)
    step = checks.finite_positive("step", step)
    shooting = Shooting(
        pair,
        problem.tuning,
        problem.period,
        (first, second),
        (problem.units[-1], abs(to - start)),
        max_events,
    )
    y = shooting.unknowns(chosen.state, [chosen.value, start])
    try:
        touch = _touch(shooting, y) if label == special.GRAZING else None
        extended = _Extended(shooting, label, touch)
        y, found = at_value(extended, y, -1, y[-1])
        points, ended = _follow(extended, y, found, to, limits, step, max_points)
    except Lost as error:
        raise NoOrbit(f"the locus could not be followed from point {point}: {error}") from None
    return _dataset(extended, points, to, ended)


def _touch(shooting, y):
    """Return (phase, number of the line) of the turning point that touches."""
    pair, tuning, z = shooting.model(y)
    touch = touching.nearest_touch(pair, tuning, z, shooting.period, shooting.max_events)
    if touch[1] and pair.moving_flank:
        raise ValueError(
            f"point: the far flank of a {type(pair).__name__} moves; only grazings of the normal "
            "flank are followed"
        )
    return touch


def _follow(problem, y, found, to, limits, largest, max_points):
    """Return the points of the locus, a list of (y, evaluation), and why it ended."""
    units = problem.shooting.units
    goal, home = to / units[-1], y[-1]
    ahead = np.zeros(y.size)
    ahead[-1] = np.sign(goal - home)
    along = tangent(found.jacobian, ahead)
    points, h = [(y, found)], _FIRST * largest
    while len(points) < max_points:
        try:
            y, _ = points[-1]
            if (y[-1] + h * along[-1] - goal) * ahead[-1] > 0.0:
                share = (goal - y[-1]) / along[-1]
                new = at_value(problem, y + share * along, -1, goal)
                if np.linalg.norm(new[0] - y) > 2.0 * h:
                    raise Lost("the step leads too far")
                return [*points, new], "at its goal"
            # Where an event meets a stiffness switch, folds and doublings have a corner.
            corner = h < 2.0 * _LEAST * largest
            new_y, new_found, direction, corrections = advance(problem, y, along, h, corner)
        except Lost as error:
            h *= 0.5
            if h < _LEAST * largest:
                return points, str(error)
            continue
        points.append((new_y, new_found))
        along = direction
        problem.follow(new_y)
        if not limits[0] <= new_y[-2] * units[-2] <= limits[1]:
            return points, "at a limit"
        if (new_y[-1] - home) * ahead[-1] < 0.0:
            return points, "back at its beginning"
        if corrections <= _EASY:
            # Where the state is large, so may be the steps.
            h = min(_GROWTH * h, largest * max(1.0, np.abs(new_y[:-2]).max() / _LARGE))
    return points, "after max_points"


def _dataset(problem, points, to, ended):
    shooting = problem.shooting
    n = len(shooting.reduce)
    multipliers = np.array([multipliers_of(found.inner.matrix) for _, found in points])
    scaled = np.array([y for y, _ in points]) * shooting.units
    data = {
        "state": (("point", "coordinate"), scaled[:, :n] @ shooting.lift.T),
        "multiplier_real": (("point", "multiplier"), multipliers.real),
        "multiplier_imaginary": (("point", "multiplier"), multipliers.imag),
        "residual": ("point", np.array([found.inner.residual for _, found in points])),
        "period": np.int32(shooting.period),
    }
    if "tuning" not in shooting.names:
        data["tuning"] = shooting.tuning
    for column, name in enumerate(shooting.names):
        data[name] = (
            "point",
            scaled[:, n + column],
            followed_parameters.attributes(shooting.pair, name),
        )
    dataset = result(
        "Locus of special points of periodic orbits of a gear mesh",
        shooting.pair,
        data,
        method="pseudo-arclength on shooting",
        parameters=list(shooting.names),
        period=shooting.period,
        tuning=shooting.tuning,
        to=to,
    )
    return dataset.assign_attrs(label=special.LABELS[problem.label], ended=ended)
