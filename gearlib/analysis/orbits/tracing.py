"""Pseudo-arclength continuation of solution curves; parameters in which orbits are continued.

A curve is defined by n equations for n + 1 unknowns. The predictor is a step along the tangent of
the curve; the corrector is Newton's method in the plane normal to the tangent, so that the curve
can be followed around folds (Keller 1977; Allgower and Georg, Numerical Continuation Methods,
1990). The unknowns are scaled to comparable magnitudes.

A *problem* has a method ``evaluate(unknowns)``, which returns a solution with

``unknowns``   its argument, shape (n + 1,)
``residuals``  residuals of the equations, shape (n,)
``jacobian``   derivatives of the residuals, shape (n, n + 1)
``converged``  whether the residuals are negligible

A continuation varies one parameter of the model, or the tuning, and keeps the others constant. The
parameters of a `GearPair` are dimensionless: varying the contact ratio does not change the mean
stiffness or the damping ratios.
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
from gearlib.progress import TimeLimit, with_progress_bar
from gearlib.runs.run_arguments import check_tuning

#: Largest number of Newton corrections in a step.
_MAX_CORRECTIONS = 15
#: Longest Newton correction: after a longer one, the iteration may converge to another curve.
_MAX_CORRECTION_LENGTH = 1.0
#: Smallest cosine of the angle between the tangents at both ends of a step.
_MIN_TANGENT_COSINE = 0.95
#: The tangent is unique if the ratio of the smallest to the largest singular value exceeds this.
_SINGULAR_TOLERANCE = 1e-8
#: Step of the finite differences, in scaled unknowns.
_DIFFERENCE_STEP = 1e-5


class ContinuationFailed(RuntimeError):
    """The corrector does not converge, or the curve has no unique tangent."""


def correct_to_curve(problem: Any, start: np.ndarray, normal: np.ndarray) -> tuple:
    """Correct a predicted point to a solution curve by Newton's method in a plane.

    The plane passes through the predicted point `start`, shape (n + 1,), and is normal to the
    vector `normal`. `problem.evaluate(unknowns)` evaluates the n equations of the curve (see the
    module). Return (solution, number of Newton corrections). Raise ContinuationFailed if the method
    does not converge.
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
            # The model does not allow these parameter values.
            raise ContinuationFailed(str(error)) from None
        # `not <` instead of `>=` also rejects NaN.
        if not np.linalg.norm(correction) < _MAX_CORRECTION_LENGTH:
            raise ContinuationFailed("a Newton correction is too long")
        unknowns = unknowns + correction
    raise ContinuationFailed("Newton's method does not converge")


def unit_tangent(jacobian: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Return the unit tangent of a solution curve, shape (n + 1,).

    `jacobian`, shape (n, n + 1), has the derivatives of the n equations with respect to the n + 1
    unknowns; the tangent spans its null space. Of the two orientations, return the one with a
    non-negative scalar product with `direction`. Raise ContinuationFailed if the null space has
    more than one dimension.
    """
    _, singular_values, right_vectors = np.linalg.svd(jacobian)
    if singular_values[-1] < _SINGULAR_TOLERANCE * singular_values[0]:
        raise ContinuationFailed("the curve has no unique tangent here")
    null_vector = right_vectors[-1]
    if null_vector @ direction >= 0.0:
        return null_vector
    return -null_vector


def take_step(problem, unknowns, tangent, length, target=None, allow_corner=False) -> tuple:
    """Take a predictor-corrector step along a curve; return (solution, unit tangent, corrections).

    `problem` evaluates the equations of the curve. The step starts at the point `unknowns`, shape
    (n + 1,), with the unit tangent `tangent`, and has the arc length `length`. If the last unknown,
    the continuation parameter, would pass `target`, the step ends exactly there, and the number of
    Newton corrections is returned as 0. Raise ContinuationFailed if the curve turns by more than a
    small angle, unless `allow_corner` is true.
    """
    predicted = unknowns + length * tangent
    if target is not None and (unknowns[-1] - target) * (predicted[-1] - target) < 0.0:
        corrections = 0
        solution = solve_at_value(problem, unknowns, predicted, target)
        # A solution that is much farther away may lie on another curve.
        if not np.linalg.norm(solution.unknowns - unknowns) < 2.0 * length:
            raise ContinuationFailed("the step is too long")
    else:
        solution, corrections = correct_to_curve(problem, predicted, tangent)
    new_tangent = unit_tangent(solution.jacobian, tangent)
    if not allow_corner and not new_tangent @ tangent > _MIN_TANGENT_COSINE:
        raise ContinuationFailed("the curve turns within the step")
    return solution, new_tangent, corrections


def next_step_length(length, corrections, max_easy_corrections, max_length) -> float:
    """Return the length of the next step along a curve.

    If the last step of length `length` needed at most `max_easy_corrections` Newton corrections,
    the length is increased by a factor of 1.5, up to `max_length`; otherwise it is kept.
    """
    if corrections <= max_easy_corrections:
        return min(1.5 * length, max_length)
    return length


def follow_curve(
    step: Callable, points: list, length, min_length, max_points: int, time_limit=None
) -> str:
    """Take steps along a curve until it ends; return the reason for its end as a string.

    `step(length)` takes a step of this arc length, appends its end to `points`, and returns (length
    of the next step, reason for the end of the curve or ""). If it raises ContinuationFailed, the
    step is repeated with half the length, unless that is below `min_length`. The first step has the
    length `length`. The curve also ends when `points` has `max_points` entries or when
    `time_limit`, a `TimeLimit` or None, is reached.
    """
    time_limit = time_limit or TimeLimit(None)
    steps = iter(lambda: len(points) < max_points, False)  # ends at `max_points`
    for _ in time_limit.iterate(with_progress_bar("steps", steps)):
        try:
            length, end_reason = step(length)
        except ContinuationFailed as error:
            length *= 0.5
            # Without a reason the loop continues with the shorter step.
            end_reason = str(error) if length < min_length else ""
        if end_reason:
            return end_reason
    return "after max_points" if time_limit.complete else "after max_seconds"


def solve_at_value(problem: Any, point: np.ndarray, other_point: np.ndarray, value: float) -> Any:
    """Return the solution on a curve at which the last unknown is equal to `value`.

    `problem` evaluates the equations of the curve. `value` lies between the last unknowns of
    `point` and `other_point`, shape (n + 1,), which are on or near the curve. Newton's method
    starts from the linear interpolation between them.
    """
    fraction = (value - point[-1]) / (other_point[-1] - point[-1])
    start = point + fraction * (other_point - point)
    start[-1] = value
    # In a plane normal to the axis of the last unknown, corrections do not change it.
    return correct_to_curve(problem, start, np.eye(point.size)[-1])[0]


def difference_quotient(function: Callable, unknowns, index, step=_DIFFERENCE_STEP) -> Any:
    """Return the derivative of `function(unknowns)` with respect to the unknown number `index`.

    `unknowns` has shape (n,). The derivative is a central difference with the given `step`, or a
    one-sided difference if the function raises ValueError on one side. It has the shape of the
    function value.
    """
    abscissae, values = [], []
    for signed_step in (-step, step):
        shifted = unknowns + signed_step * np.eye(unknowns.size)[index]
        try:
            values.append(function(shifted))
        except ValueError:
            # The parameter is outside its valid range on this side, so the difference is one-sided.
            shifted = unknowns
            values.append(function(shifted))
        abscissae.append(shifted[index])
    return (values[1] - values[0]) / (abscissae[1] - abscissae[0])


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

    The result maps each name to {"units": ..., "long_name": ...}. It has the model's own
    `parameters` and, for a model with a single gear pair (`model.pair`), the
    `DIMENSIONLESS_PARAMETERS`.
    """
    parameters = (DIMENSIONLESS_PARAMETERS if model.pair else {}) | model.parameters
    return {
        name: {"units": units, "long_name": long_name}
        for name, (units, long_name) in parameters.items()
    }


def check_parameter(model: Any, name: str) -> str:
    """Check that orbits of a model can be continued in the parameter `name`; return the name.

    Raise ValueError if the model has no gears or no such parameter.
    """
    # Models with gears have a `GearPair` in `pair` or, for trains, `mesh_names`; an oscillator has
    # neither.
    allowed = "a GearPair, a OneDegreePair, a SixDegreePair or a GearTrain"
    has_gears = is_model(model) and (model.pair or model.mesh_names)
    checks.require(has_gears, "model", type(model).__name__, allowed)
    return checks.check_choice("parameter", name, continuation_parameters(model))


def start_and_target(model: Any, tuning, name: str, target, owner: str) -> tuple:
    """Return the first and the last value of the parameter `name` in a continuation.

    The first value is the present one: an attribute of `model`, or `tuning` if the name is
    "tuning". Raise ValueError if the last value, `target`, is equal to the first one or is invalid
    for the model. `owner` is what has the present value in the message, such as "the orbit".
    """
    start = value_of(model, tuning, name)
    checks.require(target != start, "to", target, f"different from the {name} of {owner}")
    with_parameter(model, tuning, name, target)  # raises ValueError if the target is invalid
    return start, target


def value_of(model: Any, tuning: float, name: str) -> float:
    """Return the value of the parameter `name` of a model, or `tuning` for the name "tuning".

    The tuning, mesh frequency over mean natural frequency, is not an attribute of the model.
    """
    if name == "tuning":
        return float(tuning)
    if name in model.parameters:
        return float(model.parameter(name))
    return float(getattr(model, _ATTRIBUTE_NAMES.get(name, name)))


def with_parameter(model: Any, tuning: float, name: str, value: float) -> tuple:
    """Return (model, tuning) with a changed value of the parameter `name`.

    The name is a key of `continuation_parameters(model)`. All other dimensionless parameters keep
    their values; the tuning is mesh frequency over mean natural frequency. Raise ValueError if
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
        # The pair stores damping and backlash in SI units, which are computed from the ratio.
        return model.replace(**ratio_fields(model, attribute, value)), tuning
    # The remaining names are contact_ratio and stiffness_ratio. The maximum stiffness is adapted to
    # keep the mean stiffness, to which the tuning and all ratios refer.
    changed_model = model.replace(**{name: value})
    mean_ratio = mean_over_max(changed_model.contact_ratio, changed_model.stiffness_ratio)
    return changed_model.replace(max_stiffness=model.mean_stiffness / mean_ratio), tuning


def parameter_cases(model: Any, tuning: float | None, parameter: str, values: np.ndarray) -> list:
    """Return a list of (model, tuning), one for each value of a dimensionless parameter.

    `values`, shape (k,), are the values of the parameter named `parameter`. If this is "tuning"
    (mesh frequency over mean natural frequency), the argument `tuning` must be None. Any other
    parameter requires a `GearPair` and a `tuning`. Raise ValueError if an argument is missing or
    invalid.
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
