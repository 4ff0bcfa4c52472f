"""Steps along a curve of solutions of n equations in n + 1 unknowns, by pseudo-arclength.

From a point of the curve a step goes along the tangent; Newton's method then comes back to the
curve in the plane across the step, so that folds are no obstacle (Keller 1977; Allgower and Georg,
Numerical Continuation Methods, 1990). Unknowns are scaled: one unit of each weighs the same.

A *problem* has ``evaluate(y)``, which returns an object with

``miss``      residuals, shape (n,)
``jacobian``  their derivatives, shape (n, n + 1)
``small``     whether the residuals count as none
"""

import numpy as np

#: Corrections after which a point counts as lost, and how far one may lead.
_MAX_NEWTON, _FARTHEST = 15, 1.0
#: Least cosine between the tangents at both ends of a step.
_STRAIGHT = 0.95
#: A second singular value below this share of the largest: the solutions are no single curve.
_NO_CURVE = 1e-8


class Lost(RuntimeError):
    """Newton's method did not come back to the curve."""


def correct(problem, start, row):
    """Return (y, evaluation, corrections) on the curve where row . (y - start) = 0, or `Lost`."""
    y = start.copy()
    for count in range(_MAX_NEWTON):
        found = problem.evaluate(y)
        if found.small:
            return y, found, count
        matrix = np.vstack([found.jacobian, row])
        try:
            step = -np.linalg.solve(matrix, np.append(found.miss, row @ (y - start)))
        except np.linalg.LinAlgError:
            raise Lost("the linearisation is singular") from None
        if not np.linalg.norm(step) < _FARTHEST:
            raise Lost("a correction leads too far")
        y = y + step
    raise Lost("the corrections do not converge")


def tangent(jacobian, along):
    """Return the unit tangent, shape (n + 1,), of positive product with `along`, or `Lost`."""
    _, sizes, rows = np.linalg.svd(jacobian)
    if sizes[-1] < _NO_CURVE * sizes[0]:
        raise Lost("the solutions are no single curve here")
    direction = rows[-1]
    return direction if direction @ along >= 0.0 else -direction


def advance(problem, y, along, h, corner=False):
    """Return (y, evaluation, tangent, corrections) a step of length h along the curve, or `Lost`.

    Lost too if the curve turns within the step, unless a corner is what is looked for.
    """
    new, found, corrections = correct(problem, y + h * along, along)
    direction = tangent(found.jacobian, along)
    if not corner:
        check_straight(direction, along)
    return new, found, direction, corrections


def check_straight(first, second):
    """Raise `Lost` if two tangents point in different directions."""
    if not first @ second > _STRAIGHT:
        raise Lost("the curve turns within the step")


def at_value(problem, start, column, value):
    """Return (y, evaluation) on the curve where one scaled unknown has a value."""
    row = np.zeros(start.size)
    row[column] = 1.0
    start = start.copy()
    start[column] = value
    y, found, _ = correct(problem, start, row)
    return y, found
