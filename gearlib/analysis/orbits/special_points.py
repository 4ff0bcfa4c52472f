"""Special points of a branch: fold, period doubling, Neimark-Sacker, grazing, branch point.

Between two neighbouring points of a branch a special point shows as a change of sign of

================  =============================================================
fold              det(M - I), and the parameter turns round
branch point      det(M - I), and the parameter goes on
period doubling   det(M + I)
Neimark-Sacker    |mu| - 1 of the largest pair of complex multipliers mu
grazing           the order in which the phases of contact are met
================  =============================================================

with M the map of the whole period (Kuznetsov, Elements of Applied Bifurcation Theory, ch. 10). It
is located by Brent's method on the chord between the two, a grazing by bisection, with a Newton
correction to the branch in every step, so that the located point is an orbit to rounding.

The mesh force is zero on a flank line. M is therefore continuous at a grazing, but beyond it
changes like the root of the distance: the branch goes on without a corner, with a curvature that
jumps, and folds and doublings often lie close behind a grazing, never exactly on it.
"""

from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from gearlib.analysis.orbits.branch_points import branch_point
from gearlib.analysis.orbits.tracing import correct, tangent

#: Names of the labels; a label is the place in this list.
LABELS = (
    "regular",
    "fold",
    "period doubling",
    "Neimark-Sacker",
    "grazing",
    "branch point",
    "end",
)
REGULAR, FOLD, DOUBLING, NEIMARK_SACKER, GRAZING, BRANCH_POINT, END = range(len(LABELS))

#: Places on a chord are found to this share of it.
_PLACE = 1e-14
#: How far behind a grazing, in shares of the chord, the branch is taken up: so that rounding does
#: not show as contact.
_BEHIND = 1e-7
#: A complex pair whose modulus is this far from 1, squared, is not on the circle.
_ON_CIRCLE = 1e-6
#: Changes of a test function below this are rounding: nothing is lost or gained on the way.
_ROUNDING = 1e-9


def _torus(multipliers):
    """Return |mu|^2 - 1 of the largest pair of complex multipliers, -1 without one."""
    pairs = multipliers[multipliers.imag > 1e-9]
    return np.abs(pairs).max() ** 2 - 1.0 if pairs.size else -1.0


_TESTS = {
    FOLD: lambda multipliers: np.prod(multipliers - 1.0).real,
    DOUBLING: lambda multipliers: np.prod(multipliers + 1.0).real,
    NEIMARK_SACKER: _torus,
}


def between(problem, a, b, share):
    """Return the `BranchPoint` at a share of the chord from point `a` to point `b`.

    Its tangent is the chord's: that of the branch costs more and may not be there.
    """
    chord = b.y - a.y
    row = chord / np.linalg.norm(chord)
    orbit, _ = correct(problem, a.y + share * chord, row)
    return branch_point(orbit, row)


def located(problem, a, b, label):
    """Return (share of the chord, `BranchPoint`) of a special point from `a` to `b`, else None."""
    test = _TESTS[label]
    ends = {0.0: test(a.orbit.multipliers), 1.0: test(b.orbit.multipliers)}
    if not ends[0.0] * ends[1.0] < 0.0:
        return None
    if label == NEIMARK_SACKER and min(map(abs, ends.values())) < _ROUNDING:
        return None

    def value(share):
        return ends.get(share) or test(between(problem, a, b, share).orbit.multipliers)

    share = brentq(value, 0.0, 1.0, xtol=_PLACE, rtol=4.0 * np.finfo(float).eps)
    point = between(problem, a, b, share)
    if label == NEIMARK_SACKER and abs(test(point.orbit.multipliers)) > _ON_CIRCLE:
        # The pair became real on the way.
        return None
    if label == FOLD and a.tangent[-1] * b.tangent[-1] > 0.0:
        label = BRANCH_POINT
    return share, replace(point, label=label)


def special_points(problem, a, b):
    """Return the special points other than grazings from point `a` to `b`, in branch order.

    Neighbours of one contact pattern; Lost if the branch could not be followed on the chord.
    """
    pairs = [pair for label in _TESTS if (pair := located(problem, a, b, label))]
    return [point for _, point in sorted(pairs, key=lambda pair: pair[0])]


def grazing(problem, a, b):
    """Return the points just before and after the first change of the contact pattern, or `Lost`.

    The first of them carries the label.
    """
    low, high, before = 0.0, 1.0, a
    while high - low > _PLACE:
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        point = between(problem, a, b, middle)
        if point.pattern == a.pattern:
            low, before = middle, point
        else:
            high = middle
    if before is a:
        # The point itself touches: its place is taken by its neighbour with a label.
        before = between(problem, a, b, low)
    after = b
    if high + _BEHIND < 1.0:
        after = between(problem, a, b, high + _BEHIND)
        after = replace(after, tangent=tangent(after.orbit.jacobian, after.tangent))
    return replace(before, label=GRAZING), after
