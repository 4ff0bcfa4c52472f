"""Pseudo-arclength continuation of curves of solutions; parameters in which orbits are continued.

A curve is defined by n equations for n + 1 unknowns. The predictor is a step along the tangent of
the curve; the corrector is Newton's method in the plane normal to the tangent, so that folds are no
obstacle (Keller 1977; Allgower and Georg, Numerical Continuation Methods, 1990). Unknowns are
scaled to comparable units.

A *problem* has a method ``evaluate(unknowns)``, which returns a solution with

``unknowns``   its argument, shape (n + 1,)
``residuals``  residuals of the equations, shape (n,)
``jacobian``   derivatives of the residuals, shape (n, n + 1)
``converged``  whether the residuals are negligible

A continuation changes one parameter of the model, or the tuning, and keeps the others constant. The
parameters of a `GearPair` are dimensionless: a change of the contact ratio leaves the mean
stiffness and the damping ratios unchanged.
"""

import dataclasses
from collections.abc import Callable
from typing import Annotated, Any, Literal

import numpy as np

from gearlib import checks, parameters
from gearlib.engines.pair.stiffness import mean_over_max
from gearlib.models.model import is_model
from gearlib.models.pair_parameters import RATIOS, ratio_fields
from gearlib.parameters import CHOICE, Backlash, NonNegative, Positive
from gearlib.progress import Limit, with_bar
from gearlib.runs.run_arguments import check_tuning

#: Largest number of Newton corrections in a step.
_MAX_CORRECTIONS = 15
#: Longest allowed correction: after a longer one Newton's method may converge to another curve.
_MAX_CORRECTION_LENGTH = 1.0
#: Smallest cosine of the angle between the tangents at both ends of a step.
_MIN_TANGENT_COSINE = 0.95
#: Smallest singular value of the Jacobian matrix, relative to the largest, with a unique tangent.
_SINGULAR_TOLERANCE = 1e-8
#: Step of finite differences, in scaled units.
_DIFFERENCE_STEP = 1e-5


class ContinuationFailed(RuntimeError):
    """The corrector does not converge, or the curve has no unique tangent."""


def correct(problem: Any, start: np.ndarray, normal: np.ndarray) -> tuple:
    """Find the intersection of a curve and a plane by Newton's method, from a point of the plane.

    The curve is given by n equations for n + 1 unknowns: `problem.evaluate(unknowns)` returns a
    solution object with the attributes `residuals`, shape (n,), their derivatives `jacobian`, shape
    (n, n + 1), and `converged`. The plane contains the point `start`, shape (n + 1,), and is normal
    to the vector `normal` of the same shape. Return (solution object, number of Newton
    corrections). Raise ContinuationFailed if Newton's method does not converge.
    """
    unknowns = start
    for count in range(_MAX_CORRECTIONS):
        try:
            solution = problem.evaluate(unknowns)
            if solution.converged:
                return solution, count
            # The equation of the plane is the last of n + 1 equations.
            jacobian = np.vstack([solution.jacobian, normal])
            residuals = np.append(solution.residuals, normal @ (unknowns - start))
            correction = -np.linalg.solve(jacobian, residuals)
        except ValueError as error:
            # The unknowns are not valid for the model.
            raise ContinuationFailed(str(error)) from None
        # The negated comparison also refuses corrections that are NaN.
        if not np.linalg.norm(correction) < _MAX_CORRECTION_LENGTH:
            raise ContinuationFailed("a correction is too long")
        unknowns = unknowns + correction
    raise ContinuationFailed("the corrections do not converge")


def tangent(jacobian: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Return the unit tangent of a curve, shape (n + 1,), oriented like a vector `direction`.

    `jacobian`, shape (n, n + 1), holds the derivatives of the n equations of the curve by its n + 1
    unknowns. The tangent spans the null space of this matrix; raise ContinuationFailed if the null
    space has more than one dimension. Of the two unit tangents, return the one whose scalar product
    with `direction`, shape (n + 1,), is not negative.
    """
    _, singular_values, right_vectors = np.linalg.svd(jacobian)
    if singular_values[-1] < _SINGULAR_TOLERANCE * singular_values[0]:
        raise ContinuationFailed("the curve has no unique tangent here")
    null_vector = right_vectors[-1]
    if null_vector @ direction >= 0.0:
        return null_vector
    return -null_vector


def take_step(problem, unknowns, direction, length, goal=None, allow_corner=False) -> tuple:
    """Take a step along a curve; return (solution, unit tangent there, number of corrections).

    `problem` evaluates the equations of the curve, as in `correct`. The step starts at the point
    `unknowns` of the curve, shape (n + 1,), and has the given `length` along the unit tangent
    `direction`. If the last unknown, the continuation parameter, would pass the value `goal`, the
    step ends exactly there, and 0 is returned for the number of Newton corrections. Raise
    ContinuationFailed if the curve turns by more than a small angle, unless `allow_corner` is set.
    """
    predicted = unknowns + length * direction
    if goal is not None and (unknowns[-1] - goal) * (predicted[-1] - goal) < 0.0:
        corrections = 0
        solution = solve_at_value(problem, unknowns, predicted, goal)
        # A solution that is much farther away may lie on another curve.
        if not np.linalg.norm(solution.unknowns - unknowns) < 2.0 * length:
            raise ContinuationFailed("the step is too long")
    else:
        solution, corrections = correct(problem, predicted, direction)
    new_direction = tangent(solution.jacobian, direction)
    if not allow_corner and not new_direction @ direction > _MIN_TANGENT_COSINE:
        raise ContinuationFailed("the curve turns within the step")
    return solution, new_direction, corrections


def next_step_length(length, corrections, max_easy_corrections, max_length) -> float:
    """Return the length of the next step along a curve.

    After an easy step, with at most `max_easy_corrections` Newton corrections, it is 1.5 times the
    last `length`, but at most `max_length`; otherwise it is the last length. `corrections` is the
    number of corrections in the last step.
    """
    if corrections <= max_easy_corrections:
        return min(1.5 * length, max_length)
    return length


def follow_curve(
    step: Callable, points: list, length, min_length, max_points: int, time_limit=None
) -> str:
    """Take steps along a curve until it ends, and return the reason for its end as a string.

    The caller's function `step(length)` takes a step of this arc length, appends its end to
    `points`, and returns (length of the next step, reason for the end of the curve or ""). If it
    raises ContinuationFailed, it is repeated with half the length, as long as that is at least
    `min_length`. `length` is the length of the first step. The curve also ends when there are
    `max_points` points, or when the time of `time_limit`, a `Limit` or None, is over.
    """
    time_limit = time_limit or Limit(None)
    steps = iter(lambda: len(points) < max_points, False)  # endless until there are max_points
    for _ in time_limit.each(with_bar("steps", steps)):
        try:
            length, end_reason = step(length)
        except ContinuationFailed as error:
            length *= 0.5
            # An empty reason lets the loop go on with the shorter step.
            end_reason = str(error) if length < min_length else ""
        if end_reason:
            return end_reason
    return "after max_points" if time_limit.complete else "after max_seconds"


def solve_at_value(problem: Any, first: np.ndarray, second: np.ndarray, value: float) -> Any:
    """Return the solution on a curve at which the last unknown is equal to `value`.

    `problem` evaluates the equations of the curve, as in `correct`. `first` and `second` are the
    unknowns, shape (n + 1,), at two points on or near the curve; `value` lies between the last
    unknowns of both. Newton's method starts from the linear interpolation between these points.
    """
    fraction = (value - first[-1]) / (second[-1] - first[-1])
    start = first + fraction * (second - first)
    start[-1] = value
    # In a plane normal to the axis of the last unknown, corrections do not change it.
    return correct(problem, start, np.eye(first.size)[-1])[0]


def difference_quotient(function: Callable, unknowns, index, step=_DIFFERENCE_STEP) -> Any:
    """Return the finite-difference derivative of `function(unknowns)` by unknown number `index`.

    `unknowns` has shape (n,). The difference is central with the given `step`, or one-sided if the
    function raises ValueError on one side. The result has the shape of the function value.
    """
    positions, values = [], []
    for signed_step in (-step, step):
        shifted = unknowns + signed_step * np.eye(unknowns.size)[index]
        try:
            values.append(function(shifted))
        except ValueError:
            # The parameter is outside its valid range on this side: use the unshifted point.
            shifted = unknowns
            values.append(function(shifted))
        positions.append(shifted[index])
    return (values[1] - values[0]) / (positions[1] - positions[0])


#: Name -> (CF units, long_name) of the parameters of every gear pair.
DIMENSIONLESS_PARAMETERS = {
    "tuning": ("1", "tuning nu, mesh frequency over mean eigenfrequency"),
    "damping": ("1", "damping ratio beta of the material in contact"),
    "backlash_damping": ("1", "damping ratio beta_m of the oil in free flight"),
    "backlash_ratio": ("1", "backlash in static deflections"),
    "contact_ratio": ("1", "contact ratio epsilon"),
    "stiffness_ratio": ("1", "stiffness ratio kappa = C_min / C_max"),
}
DimensionlessParameter = Annotated[
    Literal[
        "tuning",
        "damping",
        "backlash_damping",
        "backlash_ratio",
        "contact_ratio",
        "stiffness_ratio",
    ],
    CHOICE,
]
#: Parameter name -> name of the attribute of models that holds its value, if the names differ.
_ATTRIBUTE_NAMES = {"damping": "damping_ratio", "backlash_damping": "backlash_damping_ratio"}


def continuation_parameters(model: Any) -> dict:
    """Return the parameters in which orbits of a model can be continued, with CF attributes.

    The result is {name: {"units": ..., "long_name": ...}}. They are the model's own `parameters`
    and, for a model of a single pair of gears, whose `model.pair` is a `GearPair`, the
    `DIMENSIONLESS_PARAMETERS`, such as tuning and damping ratio.
    """
    parameters = (DIMENSIONLESS_PARAMETERS if model.pair else {}) | model.parameters
    return {
        name: {"units": units, "long_name": long_name}
        for name, (units, long_name) in parameters.items()
    }


def check_parameter(model: Any, name: str) -> str:
    """Check that orbits of a model can be continued in the parameter `name`, and return the name.

    Raise ValueError if the model has no gears or no such parameter.
    """
    # A model with gears has a `GearPair` in `pair`, or is a train, which has `mesh_names`. Other
    # models, such as an oscillator, have neither.
    allowed = "a GearPair, a OneDegreePair, a SixDegreePair or a GearTrain"
    has_gears = is_model(model) and (model.pair or model.mesh_names)
    checks.require(has_gears, "model", type(model).__name__, allowed)
    return checks.check_choice("parameter", name, continuation_parameters(model))


def start_and_goal(model: Any, tuning, name: str, goal, owner: str) -> tuple:
    """Return the values of the parameter `name` at both ends of a continuation, (start, goal).

    The continuation starts at the present value of the parameter: an attribute of `model`, or
    `tuning` if the name is "tuning". Raise ValueError if the `goal` is equal to this value or is
    invalid for the model. The message calls the owner of the present value `owner`, such as "the
    orbit".
    """
    start = value_of(model, tuning, name)
    checks.require(goal != start, "to", goal, f"different from the {name} of {owner}")
    with_parameter(model, tuning, name, goal)  # raises ValueError if the goal is invalid
    return start, goal


def value_of(model: Any, tuning: float, name: str) -> float:
    """Return the value of the parameter `name` of a model, or `tuning` for the name "tuning".

    The tuning, mesh frequency over mean natural frequency, is not a part of the model.
    """
    if name == "tuning":
        return float(tuning)
    if name in model.parameters:
        return float(model.parameter(name))
    return float(getattr(model, _ATTRIBUTE_NAMES.get(name, name)))


def with_parameter(model: Any, tuning: float, name: str, value: float) -> tuple:
    """Return copies (model, tuning) in which the parameter `name` has another value.

    The name is a key of `continuation_parameters(model)`. All other dimensionless parameters keep
    their values; the tuning is mesh frequency over mean natural frequency. Raise ValueError if the
    `value` is invalid.
    """
    if name == "tuning":
        return model, parameters.check(name, value, Positive)
    if name in model.parameters:
        return model.with_parameter(name, value), tuning
    if model.pair is not model:
        # The model contains a `GearPair`, which has the parameter.
        inner_pair, _ = with_parameter(model.pair, tuning, name, value)
        return dataclasses.replace(model, pair=inner_pair), tuning
    if name == "backlash_ratio":
        value = parameters.check(name, value, Backlash)
    elif name in ("damping", "backlash_damping"):
        value = parameters.check(name, value, NonNegative)
    attribute = _ATTRIBUTE_NAMES.get(name, name)
    if attribute in RATIOS:
        # The pair stores damping and backlash in SI units, which follow from the ratio.
        return model.replace(**ratio_fields(model, attribute, value)), tuning
    # The other names are contact_ratio and stiffness_ratio. The largest stiffness is adapted, so
    # that the mean stiffness, to which the tuning and all ratios refer, does not change.
    changed = model.replace(**{name: value})
    mean_ratio = mean_over_max(changed.contact_ratio, changed.stiffness_ratio)
    return changed.replace(max_stiffness=model.mean_stiffness / mean_ratio), tuning


def parameter_cases(model: Any, tuning: float | None, parameter: str, values: np.ndarray) -> list:
    """Return a list of (model, tuning), one for each value of a dimensionless parameter.

    `values`, shape (k,), are the values of the parameter named `parameter`. If it is "tuning" (mesh
    frequency over mean natural frequency), the argument `tuning` must be None. Any other parameter
    requires a `GearPair` as the model, and its `tuning`. Raise ValueError if these rules are broken
    or a value is invalid.
    """
    if parameter == "tuning":
        checks.require(tuning is None, "tuning", tuning, "omitted if the tuning is varied")
        return [(model, check_tuning(f"values[{i}]", nu)) for i, nu in enumerate(values.tolist())]
    if tuning is None:
        raise ValueError(f"tuning = None is not allowed: it must be given if {parameter} is varied")
    if model.pair is not model:  # Only a `GearPair` is its own `pair`.
        raise ValueError(
            f"parameter = {parameter!r} is not allowed for this {type(model).__name__}: it must be "
            "'tuning' unless the model is a GearPair"
        )
    return [with_parameter(model, tuning, parameter, value) for value in values.tolist()]
