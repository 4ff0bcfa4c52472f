"""The smallest and the largest displacement of a proven motion, enclosed.

They are taken at the ends of arcs or where the velocity is zero. Each arc is cut up until on a
piece the velocity has one sign; or the acceleration has, so that there is one zero of the velocity
at most, which Newton's method for intervals encloses; or the displacement is as good as constant.
"""

from gearlib.analysis.proofs.balls import flint
from gearlib.analysis.proofs.signs import ClosedCurve

#: Shortest piece, as a share of its arc; most corrections of a zero.
_SHORTEST, _CORRECTIONS = 2**-48, 40


def extrema(path, arcs, ends):
    """Return balls of the smallest and largest displacement; `arcs`, `ends` of `Path.states`."""
    displacement = flint().arb_mat([[1] + [0] * (path.laws.size - 1)])
    # Every one of these balls holds a displacement of the motion, and none is more extreme.
    found = [arcs[0][0][0, 0]]
    for node, (z, t), end in zip(path.nodes, arcs, ends, strict=True):
        curve = ClosedCurve(node.law, z, displacement)
        found += [end[0, 0], *_turns(curve, z[0, 0], end[0, 0], t)]
    return _least(found), -_least([-y for y in found])


def _least(balls):
    return min(y.lower() for y in balls).union(min(y.upper() for y in balls))


def _turns(curve, x, x_end, t):
    """Yield balls that hold the displacement at all zeros of the velocity along an arc."""
    arb = flint().arb
    tiny = arb(2) ** (32 - flint().ctx.prec)
    todo = [(0.0, 1.0)]
    while todo:
        low, length = todo.pop()
        around = t * arb(low + 0.5 * length, 0.5 * length)
        y, v = curve.at(around)
        if v > 0 or v < 0:
            continue
        bend = curve.bend(around)
        if bend > 0 or bend < 0:
            around = _zero(curve, around)
            if around is None:
                continue
            y, _ = curve.at(around)
        elif y.rad() > tiny and length > _SHORTEST:
            todo += [(low, 0.5 * length), (low + 0.5 * length, 0.5 * length)]
            continue
        # A ball that reaches beyond the arc need not hold a displacement of it.
        y = y if around > 0 else y.union(x)
        yield y if around < t else y.union(x_end)


def _zero(curve, around):
    """Return the ball of times within which the velocity may be zero; None: it is not."""
    for _ in range(_CORRECTIONS):
        middle = around.mid()
        newton = middle - curve.at(middle)[1] / curve.bend(around)
        if not newton.overlaps(around):
            return None
        narrower = newton.intersection(around)
        if not narrower.rad() < 0.5 * around.rad():
            return narrower
        around = narrower
    return around
