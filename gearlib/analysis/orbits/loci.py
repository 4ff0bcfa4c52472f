"""`locus`: continuation of folds, period doublings and grazings in two parameters.

The shooting equation and the condition for the special point (a multiplier 1 or -1, or a turning
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
from gearlib.progress import TimeLimit
from gearlib.runs.run_arguments import MAX_EVENTS, MaxSeconds

_Limit = Annotated[float, Unit("1", infinity_text="-infinity and infinity included")]
#: Step of the finite differences of the condition, in scaled unknowns.
_DIFFERENCE_STEP = 1e-6
#: Tolerance of the condition at a special point, relative to the norm of its gradient.
_MAX_CONDITION = 1e-10
#: First and smallest step, and longest step in which the locus may turn sharply, relative to the
#: largest step.
_FIRST_STEP, _MIN_STEP, _MAX_TURNING_STEP = 0.2, 1e-3, 2e-3
#: Largest component of the state, in units of the static deflection, above which the largest step
#: is proportional to it.
_LARGE_STATE = 2.0
#: The step length increases after at most this number of Newton corrections.
_MAX_EASY_CORRECTIONS = 4
#: Samples per mesh period, between which turning points are interpolated, and number of Newton
#: iterations for the position of a turning point.
_SAMPLES, _TURNING_POINT_ITERATIONS = 512, 2
#: Values, first and second derivatives of 1, t, ..., t^5 at t = 0 and at t = 1, shape (6, 6).
_HERMITE_MATRIX = [
    [Polynomial.basis(k).deriv(m)(t) for k in range(6)] for t in (0, 1) for m in (0, 1, 2)
]


class _SpecialPointProblem(Shooting):
    """Shooting equation with two parameters, extended by the condition for a special point."""

    label: int = FOLD  #: FOLD, DOUBLING or GRAZING
    phase: float | None = None  #: mesh phase of the turning point of the previous grazing orbit
    flank_line: float = 0.0  #: displacement of the flank line that the orbit touches

    def turning_point(self, unknowns: np.ndarray) -> tuple[float, float]:
        """Return (mesh phase in rad, displacement) of the turning point of a grazing orbit.

        `unknowns` are the scaled unknowns of the orbit. At turning points the velocity is zero; the
        one nearest to the phase `self.phase` is returned. If this is None, it is the turning point
        nearest to a flank line (displacement at which flanks touch), and the displacement of this
        line is stored in `self.flank_line`.
        """
        # An additional mesh period contains the turning points near the start and the end of the
        # orbit.
        _, record = self.record(unknowns, self.period + 1, _SAMPLES)
        samples = record.samples[:, [SAMPLE_X, SAMPLE_V, SAMPLE_A]]
        step = math.tau / _SAMPLES
        # The velocity changes sign between these samples and the next ones.
        indices = np.flatnonzero(np.diff(samples[:, 1] < 0.0))
        if not indices.size:
            raise tracing.ContinuationFailed("the orbit has no turning point")
        if self.phase is None:
            # Neighbouring orbits may lack turning points at the ends of the record, so the first
            # and the last half mesh period are omitted.
            inner = indices[np.abs(indices / _SAMPLES - 0.5 - self.period / 2) <= self.period / 2]
            # The drive-side flank line is at 0, the coast-side one at minus the backlash.
            candidates = itertools.product(inner, (0.0, -self.model.backlash_ratio))
            i, self.flank_line = min(candidates, key=lambda c: abs(samples[c[0], 0] - c[1]))
        else:
            i = indices[np.abs(indices * step - self.phase).argmin()]
        # The quintic Hermite polynomial interpolates displacement, velocity and acceleration of
        # both samples. Its variable is the position between the samples, from 0 to 1, so that
        # derivatives are multiplied by powers of the step. Newton's method locates its extremum.
        end_values = samples[i : i + 2] * step ** np.arange(3.0)
        displacement = Polynomial(np.linalg.solve(_HERMITE_MATRIX, end_values.ravel()))
        # The iteration starts at the zero of the linearly interpolated velocity.
        position = end_values[0, 1] / (end_values[0, 1] - end_values[1, 1])
        for _ in range(_TURNING_POINT_ITERATIONS):
            position -= displacement.deriv()(position) / displacement.deriv(2)(position)
        return (i + position) * step, float(displacement(position))

    def condition(self, unknowns: np.ndarray) -> float:
        """Evaluate the condition for the special point, which is zero at a special point.

        For a grazing it is the signed distance of the turning point from the flank line that the
        orbit touches. With the monodromy matrix M it is det(M - I) for a fold (multiplier 1) and
        det(M + I) for a period doubling (multiplier -1). `unknowns` are the scaled unknowns of the
        orbit.
        """
        if self.label == GRAZING:
            return self.turning_point(unknowns)[1] - self.flank_line
        monodromy = super().evaluate(unknowns).monodromy
        multiplier = 1 if self.label == FOLD else -1
        return np.linalg.det(monodromy - multiplier * np.eye(len(monodromy)))

    def evaluate(self, unknowns: np.ndarray) -> Evaluation:
        """Evaluate the shooting equation and, as the last equation, the condition.

        The condition is divided by the norm of its gradient (finite differences). Its residual is
        then a distance in scaled unknowns, like the other residuals.
        """
        solution = super().evaluate(unknowns)
        derivatives = [
            tracing.difference_quotient(self.condition, unknowns, i, _DIFFERENCE_STEP)
            for i in range(unknowns.size)
        ]
        gradient = np.array(derivatives)
        gradient_norm = np.linalg.norm(gradient)
        value = self.condition(unknowns) / gradient_norm
        solution.jacobian = np.vstack([solution.jacobian, gradient / gradient_norm])
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
        Interval (lowest, highest) of the parameter of the branch; the locus also ends where it
        leaves this interval.
    step : float
        Largest arc length of a step. Displacements are measured in units of the static deflection,
        the parameter of the branch in units of its range on the branch, the second parameter in
        units of its distance from `to`. If the state exceeds 2 static deflections, the largest step
        is proportional to it.
    max_points : int
        Largest number of points of the locus.
    max_events : int
        Largest number of contact events in one mesh period.
    max_seconds : float, optional
        Time limit in seconds; the points computed up to then are returned, see `gearlib.progress`.

    Returns
    -------
    xarray.Dataset
        Over ``point``: both parameters under their names, state, multiplier_real,
        multiplier_imaginary, residual. A locus may end before `to`, e.g. a locus of folds at a
        grazing: the attribute ``ended`` states the reason, the attribute ``label`` the type of
        special point.

    Raises
    ------
    ValueError
        If an argument is invalid; the message states its value and what is allowed.
    NoOrbit
        If the special point is not found.
    """
    # The condition for a grazing assumes a single mesh.
    labels = (FOLD, DOUBLING, GRAZING) if getattr(model, "pair", None) else (FOLD, DOUBLING)
    special_point = point_of_dataset(model, branch, point, max_events, labels)
    branch_problem = special_point.solution.problem
    label = int(branch.label[point])
    tuning, period = branch_problem.tuning, branch_problem.period
    names = branch.attrs["parameter"], tracing.check_parameter(model, parameter)
    checks.require(
        names[0] != names[1], "parameter", parameter, "different from the parameter of the branch"
    )
    start, to = tracing.start_and_target(model, tuning, parameter, to, "the model")
    units = branch_problem.units[-1], abs(to - start)
    problem = _SpecialPointProblem(model, tuning, period, names, units, max_events)
    problem.label = label
    time_limit = TimeLimit(max_seconds)
    unknowns = problem.unknowns(special_point.solution.state, [special_point.value, start])
    try:
        if label == GRAZING:
            problem.phase, _ = problem.turning_point(unknowns)
        is_allowed = not (problem.flank_line and model.moving_flank)
        allowed = "a grazing of the drive-side flank, because the coast-side flank line moves"
        checks.require(is_allowed, "point", point, allowed)
        solutions = [tracing.correct_to_curve(problem, unknowns, np.eye(unknowns.size)[-1])[0]]
        end_criteria = to, limits, step, max_points, time_limit
        end_reason = _follow_locus(problem, solutions, *end_criteria)
    except tracing.ContinuationFailed as error:
        raise NoOrbit(f"the locus could not be followed from point {point}: {error}") from None
    title = "Locus of special points of periodic orbits of a gear mesh"
    dataset = branch_dataset(title, solutions, {}, parameters=list(names), to=to)
    dataset = dataset.assign_attrs(label=LABELS[label], ended=end_reason)
    missing = [] if time_limit.complete else [[float(dataset[parameter][-1]), to]]
    return time_limit.record_missing(dataset, missing)


def _follow_locus(problem, solutions, target, interval, max_step, max_points, time_limit) -> str:
    """Continue a locus from the `Evaluation` in `solutions`; return the reason for its end.

    A locus is a curve of special points, such as folds, in two parameters. `problem` is its
    `_SpecialPointProblem`; its points are appended to the list `solutions`. The last two unknowns
    are the parameters: the locus ends at the value `target` of the second one, where the first one
    leaves the `interval` (lowest, highest), when it has `max_points` points, or when the
    `TimeLimit` `time_limit` is reached. `max_step` is the largest arc length of a step in scaled
    unknowns, which increases in proportion to states above _LARGE_STATE.
    """
    scaled_target = target / problem.units[-1]
    first_value = solutions[0].unknowns[-1]
    sign = np.sign(scaled_target - first_value)
    axis = np.eye(solutions[0].unknowns.size)[-1]
    direction = tracing.unit_tangent(solutions[0].jacobian, sign * axis)

    def step(length: float) -> tuple[float, str]:
        """Continue the locus by a step of the arc length `length`; append its end to `solutions`.

        Return (arc length of the next step, reason why the locus ends here, or "" if it continues).
        """
        nonlocal direction
        # Loci of folds and doublings have a corner where a contact event coincides with a stiffness
        # switch.
        allow_corner = length < _MAX_TURNING_STEP * max_step
        solution, direction, corrections = tracing.take_step(
            problem, solutions[-1].unknowns, direction, length, scaled_target, allow_corner
        )
        solutions.append(solution)
        unknowns = solution.unknowns
        if problem.label == GRAZING:
            # The next orbit will touch the flank line near this phase.
            problem.phase, _ = problem.turning_point(unknowns)
        max_length = max_step * max(1.0, np.abs(unknowns[:-2]).max() / _LARGE_STATE)
        length = tracing.next_step_length(length, corrections, _MAX_EASY_CORRECTIONS, max_length)
        if unknowns[-1] == scaled_target:
            return length, "at its goal"
        if not interval[0] <= unknowns[-2] * problem.units[-2] <= interval[1]:
            return length, "at a limit"
        if (unknowns[-1] - first_value) * sign < 0.0:
            return length, "back at its beginning"
        return length, ""

    first_length, min_length = _FIRST_STEP * max_step, _MIN_STEP * max_step
    return tracing.follow_curve(step, solutions, first_length, min_length, max_points, time_limit)
