"""Steps along a curve of solutions of n equations in n + 1 unknowns, by pseudo-arclength.

From a point of the curve a step goes along the tangent; Newton's method then comes back to the
curve in the plane across the step, so that folds are no obstacle (Keller 1977; Allgower and Georg,
Numerical Continuation Methods, 1990). Unknowns are scaled: one unit of each weighs the same.

A *problem* has ``evaluate(y)``, which returns a solution with

``y``         the unknowns
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
#: Step of differences by a parameter, in shares of its scale.
_DIFFERENCE = 1e-5


class Lost(RuntimeError):
    """Newton's method did not come back to the curve."""


def correct(problem, start, row):
    """Return (solution, corrections) on the curve where row . (y - start) = 0, or `Lost`."""
    y = start
    for count in range(_MAX_NEWTON):
        try:
            solution = problem.evaluate(y)
            if solution.small:
                return solution, count
            matrix = np.vstack([solution.jacobian, row])
            step = -np.linalg.solve(matrix, np.append(solution.miss, row @ (y - start)))
        except ValueError as error:
            raise Lost(str(error)) from None
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


def advance(problem, y, along, h, goal=None, corner=False):
    """Return (solution, tangent, corrections) a step of length h on, or `Lost`.

    A step that would pass the value `goal` of the last unknown ends there. Lost too if the curve
    turns within the step, unless a corner is allowed.
    """
    start = y + h * along
    if goal is not None and (y[-1] - goal) * (start[-1] - goal) < 0.0:
        solution, corrections = at_value(problem, y, start, goal), 0
        if not np.linalg.norm(solution.y - y) < 2.0 * h:
            raise Lost("the step leads too far")
    else:
        solution, corrections = correct(problem, start, along)
    direction = tangent(solution.jacobian, along)
    if not corner and not direction @ along > _STRAIGHT:
        raise Lost("the curve turns within the step")
    return solution, direction, corrections


def longer(h, corrections, few, largest):
    """Return the next step: one that needed few corrections grows by a half, up to the largest."""
    return min(1.5 * h, largest) if corrections <= few else h


def follow(go, points, h, least, max_points):
    """Call `go` for steps until the curve ends, and return why it does.

    `go(h)` takes a step of length h, adds to `points`, and returns the length of the next step and
    why the curve ends there, "" where it does not. `Lost` halves the step, down to `least`.
    """
    while len(points) < max_points:
        try:
            h, ended = go(h)
        except Lost as error:
            h *= 0.5
            ended = str(error) if h < least else ""
        if ended:
            return ended
    return "after max_points"


def at_value(problem, y, ahead, value):
    """Return the solution where the last unknown has a value, guessed between two points."""
    share = (value - y[-1]) / (ahead[-1] - y[-1])
    start = y + share * (ahead - y)
    start[-1] = value
    return correct(problem, start, np.eye(y.size)[-1])[0]


def slope(function, y, column, step=_DIFFERENCE):
    """Return the derivative of a function by one unknown, one-sided on the rim of its range."""
    places, values = [], []
    for ahead in (-step, step):
        moved = y + ahead * np.eye(y.size)[column]
        try:
            values.append(function(moved))
        except ValueError:
            moved = y
            values.append(function(moved))
        places.append(moved[column])
    return (values[1] - values[0]) / (places[1] - places[0])
