"""`locus`: continuation of folds, period doublings and grazings in two parameters.

The shooting equation and the condition of the special point (a multiplier 1 or -1, or a turning
point on a flank line) define a curve over the state and both parameters.
"""

import itertools
import math
from typing import Annotated

import numpy as np
from numpy.polynomial import Polynomial

from gearlib import checks
from gearlib.analysis.orbits import tracing
from gearlib.analysis.orbits.continuation import MaxPoints, point_of_dataset
from gearlib.analysis.orbits.shooting import Evaluation, NoOrbit, Shooting
from gearlib.analysis.orbits.special_points import DOUBLING, FOLD, GRAZING, LABELS, branch_dataset
from gearlib.engines.orbit import SAMPLE_A, SAMPLE_V, SAMPLE_X
from gearlib.parameters import Count, Finite, Positive, Unit, Values, WholeNumber, checked
from gearlib.progress import Limit
from gearlib.runs.run_arguments import MAX_EVENTS, MaxSeconds

_Limit = Annotated[float, Unit("1", infinite="-infinity and infinity included")]
#: Scaled step of the finite differences of the condition.
_DIFFERENCE_STEP = 1e-6
#: Largest value of the condition, relative to its gradient, at a special point.
_MAX_CONDITION = 1e-10
#: First and smallest step, and the longest step in which the locus may turn sharply, relative to
#: the largest step.
_FIRST_STEP, _MIN_STEP, _MAX_TURNING_STEP = 0.2, 1e-3, 2e-3
#: The largest step is proportional to the state above this, in static deflections.
_LARGE_STATE = 2.0
#: The step length increases after at most this number of Newton corrections.
_MAX_EASY_CORRECTIONS = 4
#: Samples per mesh period, between which turning points are interpolated, and Newton steps for
#: the position of a turning point.
_SAMPLES, _TURNING_POINT_STEPS = 512, 2
#: Values, first and second derivatives of the powers 0 to 5 at 0 and at 1, shape (6, 6).
_POWERS = [[Polynomial.basis(k).deriv(m)(t) for k in range(6)] for t in (0, 1) for m in (0, 1, 2)]


class _SpecialPointProblem(Shooting):
    """Shooting equation with the condition of a special point and two parameters."""

    label: int = FOLD  #: kind of special point
    phase: float | None = None  #: mesh phase of the turning point of the previous grazing orbit
    flank_line: float = 0.0  #: displacement of the flank line that the orbit touches

    def turning_point(self, unknowns: np.ndarray) -> tuple[float, float]:
        """Return (mesh phase, displacement) of the turning point of a grazing orbit.

        It is the turning point nearest to `self.phase`. If this is None, it is the one nearest to a
        flank line, and this line is stored in `self.flank_line`.
        """
        # An additional mesh period shows turning points near the start and end of the orbit.
        _, record = self.record(unknowns, self.period + 1, _SAMPLES)
        samples = record.samples[:, [SAMPLE_X, SAMPLE_V, SAMPLE_A]]
        step = math.tau / _SAMPLES
        # Indices of the samples after which the velocity changes its sign.
        indices = np.flatnonzero(np.diff(samples[:, 1] < 0.0))
        if not indices.size:
            raise tracing.ContinuationFailed("the orbit has no turning point")
        if self.phase is None:
            # Turning points at the ends of the record may be missing in neighbouring orbits, so the
            # first and the last half mesh period are omitted.
            inner = indices[np.abs(indices / _SAMPLES - 0.5 - self.period / 2) <= self.period / 2]
            pairs = itertools.product(inner, (0.0, -self.model.backlash_ratio))
            i, self.flank_line = min(pairs, key=lambda pair: abs(samples[pair[0], 0] - pair[1]))
        else:
            i = indices[np.abs(indices * step - self.phase).argmin()]
        # A polynomial of degree 5 interpolates displacement, velocity and acceleration of both
        # samples. The position of its extremum, 0 to 1 between them, follows by Newton's method.
        end_values = samples[i : i + 2] * step ** np.arange(3.0)
        displacement = Polynomial(np.linalg.solve(_POWERS, end_values.ravel()))
        position = end_values[0, 1] / (end_values[0, 1] - end_values[1, 1])
        for _ in range(_TURNING_POINT_STEPS):
            position -= displacement.deriv()(position) / displacement.deriv(2)(position)
        return (i + position) * step, float(displacement(position))

    def condition(self, unknowns: np.ndarray) -> float:
        """Return a number that is zero if the orbit at scaled unknowns is a special point."""
        if self.label == GRAZING:
            return self.turning_point(unknowns)[1] - self.flank_line
        monodromy = super().evaluate(unknowns).monodromy
        multiplier = 1 if self.label == FOLD else -1
        return np.linalg.det(monodromy - multiplier * np.eye(len(monodromy)))

    def evaluate(self, unknowns: np.ndarray) -> Evaluation:
        """Return the `Evaluation` of the shooting equation with the condition as last equation."""
        solution = super().evaluate(unknowns)
        differences = [
            tracing.difference_quotient(self.condition, unknowns, i, _DIFFERENCE_STEP)
            for i in range(unknowns.size)
        ]
        gradient = np.array(differences)
        norm = np.linalg.norm(gradient)
        value = self.condition(unknowns) / norm
        solution.jacobian = np.vstack([solution.jacobian, gradient / norm])
        solution.residuals = np.append(solution.residuals, value)
        solution.converged = solution.converged and abs(value) <= _MAX_CONDITION
        return solution


@checked
def locus(
    model,
    branch,
    point: WholeNumber,
    parameter,
    *,
    to: Finite,
    limits: Annotated[tuple[_Limit, ...], Values(2)] = (-np.inf, np.inf),
    step: Positive = 0.05,
    max_points: MaxPoints = 1000,
    max_events: Count = MAX_EVENTS,
    max_seconds: MaxSeconds = None,
):
    """Continue a fold, a period doubling or a grazing in a second parameter.

    Parameters
    ----------
    model : GearPair, OneDegreePair or SixDegreePair
        The model whose orbit was continued.
    branch : xarray.Dataset
        A result of `gearlib.continue_orbit`.
    point : int
        Index of a point labelled "fold", "period doubling" or, unless the model is a `GearTrain`,
        "grazing".
    parameter : str
        Any parameter of `gearlib.continue_orbit` except that of the branch.
    to : float
        Value of this parameter at which the locus ends; it also ends if it returns to the value of
        the pair.
    limits : tuple of float
        The locus also ends if the parameter of the branch leaves this interval.
    step : float
        Largest step length. The unit is one static deflection, the range of the branch, or the
        distance to `to`. The largest step is proportional to the state if that exceeds 2 static
        deflections.
    max_points : int
        Largest number of points.
    max_events : int
        Largest number of contact events in one mesh period.
    max_seconds : float, optional
        Seconds after which the call returns what is done, see `gearlib.progress`.

    Returns
    -------
    xarray.Dataset
        Over ``point``: both parameters under their names, state, multiplier_real,
        multiplier_imaginary, residual. A locus may end before `to`, such as that of a fold at a
        grazing: the attribute ``ended`` has the reason, the attribute ``label`` the kind of point.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    NoOrbit
        If the special point is not found.
    """
    # The turning point of a grazing is that of one mesh.
    labels = (FOLD, DOUBLING, GRAZING) if getattr(model, "pair", None) else (FOLD, DOUBLING)
    special_point = point_of_dataset(model, branch, point, max_events, labels)
    branch_problem, label = special_point.solution.problem, int(branch.label[point])
    tuning, period = branch_problem.tuning, branch_problem.period
    names = branch.attrs["parameter"], tracing.check_parameter(model, parameter)
    checks.require(
        names[0] != names[1], "parameter", parameter, "another parameter than that of the branch"
    )
    start, to = tracing.start_and_goal(model, tuning, parameter, to, "that of the pair")
    units = branch_problem.units[-1], abs(to - start)
    problem = _SpecialPointProblem(model, tuning, period, names, units, max_events)
    problem.label, limit = label, Limit(max_seconds)
    unknowns = problem.unknowns(special_point.solution.state, [special_point.value, start])
    try:
        if label == GRAZING:
            problem.phase, _ = problem.turning_point(unknowns)
        allowed = not (problem.flank_line and model.moving_flank)
        checks.require(
            allowed, "point", point, "a grazing of the drive-side flank: the other moves"
        )
        solutions = [tracing.correct(problem, unknowns, np.eye(unknowns.size)[-1])[0]]
        arguments = to, limits, step, max_points, limit
        end_reason = _follow_locus(problem, solutions, *arguments)
    except tracing.ContinuationFailed as error:
        raise NoOrbit(f"the locus could not be followed from point {point}: {error}") from None
    title = "Locus of special points of periodic orbits of a gear mesh"
    dataset = branch_dataset(title, solutions, {}, parameters=list(names), to=to)
    dataset = dataset.assign_attrs(label=LABELS[label], ended=end_reason)
    return limit.mark(dataset, [] if limit.complete else [[float(dataset[parameter][-1]), to]])


def _follow_locus(problem, solutions, goal, limits, max_step, max_points, limit) -> str:
    """Continue a locus from its first `Evaluation`, `solutions[0]`; return the reason for its end.

    Up to `max_points` solutions are appended. The last two unknowns are the parameters: the locus
    ends at the value `goal` of the second or at the `limits` (lowest, highest) of the first.
    `max_step` is the largest arc length of a step in scaled unknowns, for small states.
    """
    scaled_goal, first_value = goal / problem.units[-1], solutions[0].unknowns[-1]
    sign = np.sign(scaled_goal - first_value)
    axis = np.eye(solutions[0].unknowns.size)[-1]
    direction = tracing.tangent(solutions[0].jacobian, sign * axis)

    def step(length: float) -> tuple[float, str]:
        """Take a step and add its point; return (next length, reason for the end or "")."""
        nonlocal direction
        # Loci of folds and doublings have a corner if an event coincides with a stiffness switch.
        allow_corner = length < _MAX_TURNING_STEP * max_step
        solution, direction, corrections = tracing.take_step(
            problem, solutions[-1].unknowns, direction, length, scaled_goal, allow_corner
        )
        solutions.append(solution)
        unknowns = solution.unknowns
        if problem.label == GRAZING:
            # The next orbit touches the flank line near this phase.
            problem.phase, _ = problem.turning_point(unknowns)
        max_length = max_step * max(1.0, np.abs(unknowns[:-2]).max() / _LARGE_STATE)
        length = tracing.next_step_length(length, corrections, _MAX_EASY_CORRECTIONS, max_length)
        if unknowns[-1] == scaled_goal:
            return length, "at its goal"
        if not limits[0] <= unknowns[-2] * problem.units[-2] <= limits[1]:
            return length, "at a limit"
        return length, "back at its beginning" if (unknowns[-1] - first_value) * sign < 0.0 else ""

    lengths = _FIRST_STEP * max_step, _MIN_STEP * max_step
    return tracing.follow_curve(step, solutions, *lengths, max_points, limit)
