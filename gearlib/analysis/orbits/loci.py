"""`locus`: continuation of folds, period doublings and grazings in two parameters.

The shooting equation and the condition of the special point (a multiplier 1 or -1, or a turning
point on a flank line) define a curve in the space of the state and both parameters.
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
#: Step of the finite differences of the condition, in scaled unknowns.
_DIFFERENCE_STEP = 1e-6
#: Largest value of the condition at a special point, relative to the norm of its gradient.
_MAX_CONDITION = 1e-10
#: First and smallest step, and the longest step in which the locus may turn sharply, relative to
#: the largest step.
_FIRST_STEP, _MIN_STEP, _MAX_TURNING_STEP = 0.2, 1e-3, 2e-3
#: Largest displacement or velocity, in static deflections, above which the largest step is
#: proportional to it.
_LARGE_STATE = 2.0
#: The step length increases after at most this number of Newton corrections.
_MAX_EASY_CORRECTIONS = 4
#: Samples per mesh period, between which turning points are interpolated, and number of Newton
#: steps for the position of a turning point.
_SAMPLES, _TURNING_POINT_STEPS = 512, 2
#: Values, first and second derivatives of t^0 ... t^5 at t = 0 and at t = 1, shape (6, 6).
_POWERS = [[Polynomial.basis(k).deriv(m)(t) for k in range(6)] for t in (0, 1) for m in (0, 1, 2)]


class _SpecialPointProblem(Shooting):
    """Shooting equation with two parameters and the condition of a special point."""

    label: int = FOLD  #: FOLD, DOUBLING or GRAZING
    phase: float | None = None  #: mesh phase of the turning point of the previous grazing orbit
    flank_line: float = 0.0  #: displacement of the flank line that the orbit touches

    def turning_point(self, unknowns: np.ndarray) -> tuple[float, float]:
        """Return (mesh phase in rad, displacement) of the turning point of a grazing orbit.

        `unknowns` are the scaled unknowns of the orbit. The turning point, where the velocity is
        zero, is the one nearest to the phase `self.phase`. If this is None, it is the one nearest
        to a flank line (displacement at which flanks touch), whose displacement is stored in
        `self.flank_line`.
        """
        # An additional mesh period shows turning points near the start and end of the orbit.
        _, record = self.record(unknowns, self.period + 1, _SAMPLES)
        samples = record.samples[:, [SAMPLE_X, SAMPLE_V, SAMPLE_A]]
        step = math.tau / _SAMPLES
        # Between these samples and the next ones the velocity changes its sign.
        indices = np.flatnonzero(np.diff(samples[:, 1] < 0.0))
        if not indices.size:
            raise tracing.ContinuationFailed("the orbit has no turning point")
        if self.phase is None:
            # Turning points at the ends of the record may be missing in neighbouring orbits, so the
            # first and the last half mesh period are omitted.
            inner = indices[np.abs(indices / _SAMPLES - 0.5 - self.period / 2) <= self.period / 2]
            # The drive-side flank line is at 0, the coast-side one at minus the backlash.
            pairs = itertools.product(inner, (0.0, -self.model.backlash_ratio))  # (index, line)
            i, self.flank_line = min(pairs, key=lambda pair: abs(samples[pair[0], 0] - pair[1]))
        else:
            i = indices[np.abs(indices * step - self.phase).argmin()]
        # A polynomial of degree 5 interpolates displacement, velocity and acceleration of both
        # samples. Newton's method finds the position of its extremum, 0 to 1 between the samples.
        # Multiplying derivatives by powers of the step refers them to this position.
        end_values = samples[i : i + 2] * step ** np.arange(3.0)
        displacement = Polynomial(np.linalg.solve(_POWERS, end_values.ravel()))
        # The start of the iteration is the zero of the linearly interpolated velocity.
        position = end_values[0, 1] / (end_values[0, 1] - end_values[1, 1])
        for _ in range(_TURNING_POINT_STEPS):
            position -= displacement.deriv()(position) / displacement.deriv(2)(position)
        return (i + position) * step, float(displacement(position))

    def condition(self, unknowns: np.ndarray) -> float:
        """Return a number that is zero if the orbit at scaled unknowns is a special point.

        For a grazing it is the signed distance of the turning point from the flank line that the
        orbit touches. With the monodromy matrix M it is det(M - I) for a fold (multiplier 1) and
        det(M + I) for a period doubling (multiplier -1).
        """
        if self.label == GRAZING:
            return self.turning_point(unknowns)[1] - self.flank_line
        monodromy = super().evaluate(unknowns).monodromy
        multiplier = 1 if self.label == FOLD else -1
        return np.linalg.det(monodromy - multiplier * np.eye(len(monodromy)))

    def evaluate(self, unknowns: np.ndarray) -> Evaluation:
        """Return the `Evaluation` of the shooting equation, with the condition as last equation.

        The condition is divided by the norm of its gradient (finite differences), so that its
        residual is comparable with the others: a distance in scaled unknowns.
        """
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
        Any parameter of `gearlib.continue_orbit` except the parameter of the branch.
    to : float
        Value of this parameter at which the locus ends; the locus also ends if it returns to the
        value of the model.
    limits : tuple of float
        Interval (lowest, highest) of the parameter of the branch, outside which the locus also
        ends.
    step : float
        Largest arc length of a step. Displacements are measured in static deflections, the
        parameter of the branch in units of its range on the branch, the second parameter in units
        of its distance from `to`. The largest step is proportional to the state if that exceeds 2
        static deflections.
    max_points : int
        Largest number of points of the locus.
    max_events : int
        Largest number of contact events in one mesh period.
    max_seconds : float, optional
        Time limit in seconds, after which the points computed so far are returned, see
        `gearlib.progress`.

    Returns
    -------
    xarray.Dataset
        Over ``point``: both parameters under their names, state, multiplier_real,
        multiplier_imaginary, residual. A locus may end before `to`, as a locus of folds does at a
        grazing: the attribute ``ended`` states the reason, the attribute ``label`` the kind of
        special point.

    Raises
    ------
    ValueError
        If an argument is invalid; the message states its value and what is allowed.
    NoOrbit
        If the special point is not found.
    """
    # The condition of a grazing assumes a single mesh.
    labels = (FOLD, DOUBLING, GRAZING) if getattr(model, "pair", None) else (FOLD, DOUBLING)
    special_point = point_of_dataset(model, branch, point, max_events, labels)
    branch_problem = special_point.solution.problem
    label = int(branch.label[point])
    tuning, period = branch_problem.tuning, branch_problem.period
    names = branch.attrs["parameter"], tracing.check_parameter(model, parameter)
    checks.require(
        names[0] != names[1], "parameter", parameter, "different from the parameter of the branch"
    )
    start, to = tracing.start_and_goal(model, tuning, parameter, to, "the model")
    units = branch_problem.units[-1], abs(to - start)
    problem = _SpecialPointProblem(model, tuning, period, names, units, max_events)
    problem.label = label
    time_limit = Limit(max_seconds)
    unknowns = problem.unknowns(special_point.solution.state, [special_point.value, start])
    try:
        if label == GRAZING:
            problem.phase, _ = problem.turning_point(unknowns)
        is_allowed = not (problem.flank_line and model.moving_flank)
        allowed = "a grazing of the drive-side flank, because the coast-side flank line moves"
        checks.require(is_allowed, "point", point, allowed)
        solutions = [tracing.correct(problem, unknowns, np.eye(unknowns.size)[-1])[0]]
        end_criteria = to, limits, step, max_points, time_limit
        end_reason = _follow_locus(problem, solutions, *end_criteria)
    except tracing.ContinuationFailed as error:
        raise NoOrbit(f"the locus could not be followed from point {point}: {error}") from None
    title = "Locus of special points of periodic orbits of a gear mesh"
    dataset = branch_dataset(title, solutions, {}, parameters=list(names), to=to)
    dataset = dataset.assign_attrs(label=LABELS[label], ended=end_reason)
    missing = [] if time_limit.complete else [[float(dataset[parameter][-1]), to]]
    return time_limit.mark(dataset, missing)


def _follow_locus(problem, solutions, goal, interval, max_step, max_points, time_limit) -> str:
    """Continue a locus from the `Evaluation` in `solutions`, and return the reason for its end.

    A locus is a curve of special points, such as folds, in two parameters. `problem` is its
    `_SpecialPointProblem`; points are appended to the list `solutions`. The last two unknowns are
    the parameters: the locus ends at the value `goal` of the second, or where the first leaves the
    `interval` (lowest, highest), with `max_points` points, or when the `Limit` `time_limit` is
    over. `max_step` is the largest arc length of a step in scaled unknowns; for states above
    _LARGE_STATE it grows in proportion.
    """
    scaled_goal = goal / problem.units[-1]
    first_value = solutions[0].unknowns[-1]
    sign = np.sign(scaled_goal - first_value)
    axis = np.eye(solutions[0].unknowns.size)[-1]
    direction = tracing.tangent(solutions[0].jacobian, sign * axis)

    def step(length: float) -> tuple[float, str]:
        """Continue the locus by a step of an arc length and append its end to `solutions`.

        Return (arc length of the next step, reason why the locus ends here, or "" if it goes on).
        """
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
        if not interval[0] <= unknowns[-2] * problem.units[-2] <= interval[1]:
            return length, "at a limit"
        if (unknowns[-1] - first_value) * sign < 0.0:
            return length, "back at its beginning"
        return length, ""

    first_length, min_length = _FIRST_STEP * max_step, _MIN_STEP * max_step
    return tracing.follow_curve(step, solutions, first_length, min_length, max_points, time_limit)
