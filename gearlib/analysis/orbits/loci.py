"""`locus`: folds, period doublings and grazings over two parameters.

The shooting equation and the condition of the special point (a multiplier 1, -1, or a turning point
on a flank line) fix a curve over the state and both parameters, followed by pseudo-arclength.
"""

import itertools
import math

import numpy as np
from numpy.polynomial import Polynomial

from gearlib import checks
from gearlib.analysis.orbits import followed_parameters, tracing
from gearlib.analysis.orbits.branch_points import orbit_dataset
from gearlib.analysis.orbits.continuation import restored
from gearlib.analysis.orbits.shooting import NoOrbit, Shooting
from gearlib.analysis.orbits.special_points import DOUBLING, FOLD, GRAZING, LABELS
from gearlib.engines.orbit import SAMPLE_A, SAMPLE_V, SAMPLE_X
from gearlib.runs.run_arguments import MAX_EVENTS

#: Scaled step of differences; value of the condition over its slope that counts as zero.
_DIFFERENCE, _ZERO = 1e-6, 1e-10
#: Smallest step over the largest; size of states from which on, and
#: corrections up to which, steps grow.
_LEAST, _LARGE, _EASY = 1e-3, 2.0, 4
_SAMPLES = 512  #: of a mesh period, between which turning points are interpolated
#: Values, slopes and second derivatives at 0 and 1 of the powers 0 to 5, shape (6, 6).
_HERMITE = [[Polynomial.basis(k).deriv(m)(t) for k in range(6)] for t in (0, 1) for m in (0, 1, 2)]


class _SpecialPoints(Shooting):
    """Orbits with a special point, over two parameters."""

    label, phase, line = FOLD, None, 0.0

    def touch(self, y):
        """Return (phase, displacement) of the turning point next to `phase`, at first to a line."""
        samples = self.record(y, self.period + 1, _SAMPLES)[1].samples
        samples = samples[:, [SAMPLE_X, SAMPLE_V, SAMPLE_A]]
        turns, step = np.flatnonzero(np.diff(samples[:, 1] < 0.0)), math.tau / _SAMPLES
        if not turns.size:
            raise tracing.Lost("the orbit has no turning point")
        if self.phase is None:
            # Half a period off both ends a turning point is found at neighbouring orbits too.
            inside = turns[np.abs(turns / _SAMPLES - 0.5 - self.period / 2) <= self.period / 2]
            touches = itertools.product(inside, (0.0, -self.pair.backlash_ratio))
            i, self.line = min(touches, key=lambda touch: abs(samples[touch[0], 0] - touch[1]))
        else:
            i = turns[np.abs(turns * step - self.phase).argmin()]
        ends = samples[i : i + 2] * step ** np.arange(3.0)
        course = Polynomial(np.linalg.solve(_HERMITE, ends.ravel()))
        place = ends[0, 1] / (ends[0, 1] - ends[1, 1])
        for _ in range(2):
            place -= course.deriv()(place) / course.deriv(2)(place)
        return (i + place) * step, float(course(place))

    def condition(self, y):
        """Return the function that is zero at the special point."""
        if self.label == GRAZING:
            return self.touch(y)[1] - self.line
        matrix = super().evaluate(y).matrix
        return np.linalg.det(matrix - (1 if self.label == FOLD else -1) * np.eye(len(matrix)))

    def evaluate(self, y):
        """Return the `Evaluation` of the shooting equation with the condition below."""
        orbit = super().evaluate(y)
        row = [tracing.slope(self.condition, y, column, _DIFFERENCE) for column in range(y.size)]
        value = self.condition(y) / np.linalg.norm(row)
        orbit.jacobian = np.vstack([orbit.jacobian, np.array(row) / np.linalg.norm(row)])
        orbit.miss = np.append(orbit.miss, value)
        orbit.small = orbit.small and abs(value) <= _ZERO
        return orbit


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
        Of `gearlib.continue_orbit`.
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
    max_points, max_events : int
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
    chosen = restored(pair, branch, point, max_events, (FOLD, DOUBLING, GRAZING))
    known, label = chosen.orbit.problem, int(branch.label[point])
    names = branch.attrs["parameter"], followed_parameters.check_parameter(pair, parameter)
    checks.require(names[0] != names[1], "parameter", parameter, "another than the branch's")
    start, to = followed_parameters.check_goal(pair, known.tuning, parameter, to, "the pair's")
    step = checks.finite_positive("step", step)
    scales = known.units[-1], abs(to - start)
    problem = _SpecialPoints(pair, known.tuning, known.period, names, scales, max_events)
    problem.label, y = label, problem.unknowns(chosen.orbit.state, [chosen.value, start])
    try:
        if label == GRAZING:
            problem.phase, _ = problem.touch(y)
        allowed = not (problem.line and pair.moving_flank)
        checks.require(allowed, "point", point, "a grazing of the normal flank: the other moves")
        orbits = [tracing.correct(problem, y, np.eye(y.size)[-1])[0]]
        ended = _follow(problem, orbits, to, limits, step, max_points)
    except tracing.Lost as error:
        raise NoOrbit(f"the locus could not be followed from point {point}: {error}") from None
    title = "Locus of special points of periodic orbits of a gear mesh"
    dataset = orbit_dataset(title, orbits, {}, parameters=list(names), to=to)
    return dataset.assign_attrs(label=LABELS[label], ended=ended)


def _follow(problem, orbits, to, limits, largest, max_points):
    """Add the orbits of the locus behind the first, and return why it ended."""
    goal, home = to / problem.units[-1], orbits[0].y[-1]
    sign = np.sign(goal - home)
    along = tracing.tangent(orbits[0].jacobian, sign * np.eye(orbits[0].y.size)[-1])

    def go(h):
        nonlocal along
        # Where an event meets a stiffness switch, folds and doublings have a corner.
        corner = h < 2.0 * _LEAST * largest
        new, along, corrections = tracing.advance(problem, orbits[-1].y, along, h, goal, corner)
        orbits.append(new)
        if problem.label == GRAZING:
            problem.phase, _ = problem.touch(new.y)
        # Where the state is large, so may be the steps.
        size = max(1.0, np.abs(new.y[:-2]).max() / _LARGE)
        h = tracing.longer(h, corrections, _EASY, largest * size)
        ends = {
            "at its goal": new.y[-1] == goal,
            "at a limit": not limits[0] <= new.y[-2] * problem.units[-2] <= limits[1],
            "back at its beginning": (new.y[-1] - home) * sign < 0.0,
        }
        return h, next((reason for reason, reached in ends.items() if reached), "")

    return tracing.follow(go, orbits, 0.2 * largest, _LEAST * largest, max_points)
