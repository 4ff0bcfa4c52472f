"""`certify_tongues`: proven edges of tongues of parametric resonance, det(M - (-1)^n I) = 0."""

from functools import partial

from gearlib import checks
from gearlib.analysis import tongues
from gearlib.analysis.proofs import krawczyk, points
from gearlib.analysis.proofs.balls import digits_of, enclosure, flint
from gearlib.analysis.proofs.candidate import laws_over_tunings
from gearlib.analysis.proofs.certificate_files import Refusal, Tongue, Uncertain
from gearlib.analysis.proofs.path import Path
from gearlib.kernels.codes import NORMAL

#: Pieces into which the inside of a tongue is cut at most.
_PIECES = 4000


def certify_tongues(pair, *, start=0.3, stop=3.0, digits=30):
    """Prove the edges of tongues of parametric resonance, and that deviations grow between them.

    Parameters
    ----------
    pair : GearPair, OneDegreePair, SixDegreePair or GearTrain
        Without harmonics of load, deviation or run-out.
    start, stop : float
        As of `gearlib.tongues`, which gives the candidates.
    digits : int, default 30
        Decimal digits of the enclosures, 10 to 300.

    Returns
    -------
    list of Tongue or Refusal
        In the order of `gearlib.tongues`, of those that are open and whose edges have a real
        multiplier.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    ImportError
        Without python-flint.
    """
    digits = checks.integer("digits", digits, 10, 300)
    allowed = f">= {tongues.LEAST_TUNING}"
    start = checks.number("start", start, allowed, lambda nu: tongues.LEAST_TUNING <= nu < 1e6)
    stop = checks.number("stop", stop, f"> start = {start!r}", lambda nu: start < nu < 1e6)
    try:
        points.check_any(pair)
    except Uncertain as reason:
        return [Refusal(*reason.args)]
    return [
        points.proven_point(partial(_tongue, pair, one, digits), pair, digits)
        for one in tongues.find(tongues.linear(pair), start, stop)
        if one is not None and one.start < one.stop and one.multiplier
    ]


def _check_inside(excess, first, last, order):
    """Prove that a function, zero at two places, is < 0 between them; it returns its slope too."""
    todo, count = [(first, last, True, True)], 0
    while todo:
        a, b, at_first, at_last = todo.pop()
        value, slope = excess(a.union(b))
        # Next to a zero the sign follows from the slope.
        if value < 0 or (at_first and slope < 0 and not at_last):
            continue
        if at_last and slope > 0 and not at_first:
            continue
        middle, count = ((a + b) / 2).mid(), count + 1
        if count > _PIECES or not excess(middle)[0] < 0:
            raise Uncertain(
                "tongue", f"it is not proven that deviations grow everywhere within order {order}"
            )
        todo += [(a, middle, at_first, False), (middle, b, False, at_last)]


def _tongue(model, candidate, digits):
    """Return (the `Tongue`, its digits) at the present precision."""
    arb, order, sign = flint().arb, candidate.order, candidate.multiplier
    laws = laws_over_tunings(model, candidate.start)
    path = Path(laws, [NORMAL] * len(laws.mesh_names), [], laws.repeats, framed=False)

    def excess(scale):
        """Return det(M - sign I) and its derivative by 1 / nu.

        The characteristic polynomial of M, of even degree, is positive far away: where it is < 0
        at 1 or -1, a real multiplier lies beyond.
        """
        matrix, rate = path.without_contacts(scale)
        return _determinant(matrix, rate, sign)

    def system(u):
        value, slope = excess(u[0])
        return [value], [[slope]]

    edges, intervals = [], []
    for tuning in (candidate.start, candidate.stop):
        box, centre, inverse = points.enclosed_zero(system, [1 / arb(tuning)])
        if not abs(1 / box[0] - tuning) < points.REACH:
            raise Uncertain("distance", f"no edge of order {order} is where it was looked for")
        radius = krawczyk.uniqueness(system, centre, inverse, points.SINGULAR)
        edges.append(1 / box[0])
        intervals.append(points.interval_of(centre[0], radius))
    _check_inside(excess, 1 / edges[1], 1 / edges[0], order)
    found = Tongue(
        model,
        order,
        sign,
        enclosure(edges[0], digits),
        enclosure(edges[1], digits),
        intervals[0],
        intervals[1],
        digits,
        laws.derived or None,
    )
    return found, min(digits_of(edge) for edge in edges)


def _determinant(matrix, rate, sign):
    """Return det(M - sign I) and its derivative, from those of M."""
    n = matrix.nrows()
    whole = matrix * 1
    for i in range(n):
        whole[i, i] -= sign
    slope = flint().arb(0)
    for j in range(n):
        # A column after the other by its derivative.
        moved = whole * 1
        for i in range(n):
            moved[i, j] = rate[i, j]
        slope += moved.det()
    return whole.det(), slope
