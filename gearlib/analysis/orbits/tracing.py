"""Continuation by pseudo-arclength: steps along a curve of solutions of n equations.

There are n + 1 unknowns. A step goes along the tangent of the curve; Newton's method then comes
back to the curve in the plane across the step, so that folds are no obstacle (Keller 1977;
Allgower and Georg, Numerical Continuation Methods, 1990). Unknowns are scaled: one unit of each
weighs the same.

A *problem* has ``evaluate(unknowns)``, which returns a solution with

``unknowns``   where it was evaluated, shape (n + 1,)
``residuals``  of the equations, shape (n,)
``jacobian``   derivatives of the residuals, shape (n, n + 1)
``converged``  whether the residuals are negligible
"""

from collections.abc import Callable
from typing import Any

import numpy as np

_MAX_CORRECTIONS = 15
#: Longest correction: beyond it Newton's method may reach another curve.
_MAX_CORRECTION_LENGTH = 1.0
#: Smallest cosine between the tangents at both ends of a step.
_MIN_TANGENT_COSINE = 0.95
#: Relative size of the smallest singular value below which the solutions form no single curve.
_SINGULAR_TOLERANCE = 1e-8
#: Step of the differences by a parameter, in scaled units.
_DIFFERENCE_STEP = 1e-5


class ContinuationFailed(RuntimeError):
    """Newton's method did not come back to the curve."""


def correct(problem: Any, start: np.ndarray, normal: np.ndarray) -> tuple:
    """Return (solution, number of corrections) where the curve of a problem meets a plane.

    The plane goes through the unknowns `start`, normal to a vector. Raise ContinuationFailed if
    Newton's method does not converge.
    """
    unknowns = start
    for count in range(_MAX_CORRECTIONS):
        try:
            solution = problem.evaluate(unknowns)
            if solution.converged:
                return solution, count
            matrix = np.vstack([solution.jacobian, normal])
            residuals = np.append(solution.residuals, normal @ (unknowns - start))
            correction = -np.linalg.solve(matrix, residuals)
        except ValueError as error:
            raise ContinuationFailed(str(error)) from None
        if not np.linalg.norm(correction) < _MAX_CORRECTION_LENGTH:
            raise ContinuationFailed("a correction leads too far")
        unknowns = unknowns + correction
    raise ContinuationFailed("the corrections do not converge")


def tangent(jacobian: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Return the unit tangent of the curve, shape (n + 1,), that points along a direction.

    `jacobian` is the derivative of the residuals, shape (n, n + 1).
    """
    _, singular_values, right_vectors = np.linalg.svd(jacobian)
    if singular_values[-1] < _SINGULAR_TOLERANCE * singular_values[0]:
        raise ContinuationFailed("the solutions are no single curve here")
    null_vector = right_vectors[-1]
    return null_vector if null_vector @ direction >= 0.0 else -null_vector


def take_step(
    problem: Any,
    unknowns: np.ndarray,
    direction: np.ndarray,
    length: float,
    goal: float | None = None,
    allow_corner: bool = False,
) -> tuple:
    """Take one step along the curve and return (solution, tangent, number of corrections).

    The step begins at `unknowns`, along the unit tangent `direction`. A step that would pass the
    value `goal` of the last unknown ends there. Raise ContinuationFailed if the curve turns within
    the step and no corner is allowed.
    """
    predicted = unknowns + length * direction
    if goal is not None and (unknowns[-1] - goal) * (predicted[-1] - goal) < 0.0:
        solution, corrections = solve_at_value(problem, unknowns, predicted, goal), 0
        if not np.linalg.norm(solution.unknowns - unknowns) < 2.0 * length:
            raise ContinuationFailed("the step leads too far")
    else:
        solution, corrections = correct(problem, predicted, direction)
    new_direction = tangent(solution.jacobian, direction)
    if not allow_corner and not new_direction @ direction > _MIN_TANGENT_COSINE:
        raise ContinuationFailed("the curve turns within the step")
    return solution, new_direction, corrections


def next_step_length(
    length: float, corrections: int, max_easy_corrections: int, max_length: float
) -> float:
    """Return the length of the next step: half as long again if few corrections were needed."""
    return min(1.5 * length, max_length) if corrections <= max_easy_corrections else length


def follow_curve(
    step: Callable, points: list, length: float, min_length: float, max_points: int
) -> str:
    """Take steps along a curve until it ends, and return the reason for its end.

    `step(length)` adds points to `points` and returns (length of the next step, reason why the
    curve ends there or ""). After a ContinuationFailed it is repeated with half the length, down
    to `min_length`.
    """
    while len(points) < max_points:
        try:
            length, end_reason = step(length)
        except ContinuationFailed as error:
            length *= 0.5
            end_reason = str(error) if length < min_length else ""
        if end_reason:
            return end_reason
    return "after max_points"


def solve_at_value(
    problem: Any, unknowns: np.ndarray, unknowns_ahead: np.ndarray, value: float
) -> Any:
    """Return the solution at which the last unknown has a value.

    `unknowns` and `unknowns_ahead` are points of the curve on either side of it.
    """
    share = (value - unknowns[-1]) / (unknowns_ahead[-1] - unknowns[-1])
    start = unknowns + share * (unknowns_ahead - unknowns)
    start[-1] = value
    return correct(problem, start, np.eye(unknowns.size)[-1])[0]


def difference_quotient(
    function: Callable, unknowns: np.ndarray, index: int, step: float = _DIFFERENCE_STEP
) -> Any:
    """Return the derivative of a function of the unknowns by the unknown with an index.

    It is a central difference of half width `step`, one-sided where the function raises ValueError.
    """
    positions, values = [], []
    for signed_step in (-step, step):
        shifted = unknowns + signed_step * np.eye(unknowns.size)[index]
        try:
            values.append(function(shifted))
        except ValueError:
            shifted = unknowns
            values.append(function(shifted))
        positions.append(shifted[index])
    return (values[1] - values[0]) / (positions[1] - positions[0])
