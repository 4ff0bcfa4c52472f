"""`certify_fold`, `certify_grazing`, `certify_tongues`: proven tunings of special points.

The equations of an orbit, and one more, or two with the phase of a touch; 1 / nu is an unknown:

==================  ==========================================
fold                det(M - I) = 0
period doubling     det(M + I) = 0
grazing             x on a flank line and x' = 0 at a phase
edge of a tongue    det(M - (-1)^n I) = 0 without loss of contact
==================  ==========================================
"""

import math
from functools import partial

import numpy as np

from gearlib import checks
from gearlib.analysis import tongues
from gearlib.analysis.orbits import special_points as special
from gearlib.analysis.orbits.continuation import restored
from gearlib.analysis.orbits.touching import lines, turning_points
from gearlib.analysis.proofs import krawczyk
from gearlib.analysis.proofs.balls import digits_of, enclosure, flint
from gearlib.analysis.proofs.certificates import PointCertificate, Refusal, Tongue, listed
from gearlib.analysis.proofs.laws import Laws
from gearlib.analysis.proofs.orbits import check_pair, first_with, run_contacts
from gearlib.analysis.proofs.path import TOUCH, Path, Uncertain
from gearlib.analysis.proofs.signs import check_contacts
from gearlib.kernels import orbit as columns
from gearlib.kernels.codes import NORMAL
from gearlib.runs.run_arguments import MAX_EVENTS

#: Farthest that a proven point may lie from the candidate, in static deflections and in tuning. A
#: candidate near a fold or a grazing is known to half of the digits.
_REACH = 1e-6
_SINGULAR = "fold", "the derivative of the equations has no inverse: the point is not a simple one"
#: Contacts this close to a touch, in phase, are the touch itself.
_ONE_TOUCH = 1e-3
#: A touch this close to tau = 0 is looked at from tau = pi.
_NEAR_START = 0.1
#: Pieces into which the inside of a tongue is cut at most.
_PIECES = 4000


def certify_fold(pair, branch, point, digits=30):
    """Prove a fold or a period doubling of a branch over the tuning, and where it lies.

    Parameters
    ----------
    pair : GearPair
        Whose orbit was continued.
    branch : xarray.Dataset
        As of `gearlib.continue_orbit` over the tuning; nothing it says is believed.
    point : int
        Number of a point labelled "fold" or "period doubling".
    digits : int, default 30
        Decimal digits of the enclosures, 10 to 300.

    Returns
    -------
    PointCertificate or Refusal

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    ImportError
        Without python-flint.
    """
    return _certify(pair, branch, point, digits, (special.FOLD, special.DOUBLING))


def certify_grazing(pair, branch, point, digits=30):
    """Prove a grazing of a branch over the tuning: an orbit that touches a flank line.

    Parameters, returns and errors as of `certify_fold`; the point is labelled "grazing".
    """
    return _certify(pair, branch, point, digits, (special.GRAZING,))


def certify_tongues(pair, *, start=0.3, stop=3.0, digits=30):
    """Prove the edges of tongues of parametric resonance, and that deviations grow between them.

    Parameters
    ----------
    pair : GearPair
    start, stop : float
        As of `gearlib.tongues`, which gives the candidates.
    digits : int, default 30
        Decimal digits of the enclosures, 10 to 300.

    Returns
    -------
    list of Tongue or Refusal
        In the order of `gearlib.tongues`, of those that are open.

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
        check_pair(pair)
    except Uncertain as reason:
        return [Refusal(*reason.args)]
    return [
        _proven(partial(_tongue, pair, one, digits), pair, digits)
        for one in tongues.find(pair, start, stop)
        if one is not None and one.start < one.stop
    ]


def _proven(step, pair, digits):
    """Return what a step of `first_with` gives, or a `Refusal`."""
    try:
        check_pair(pair)
        return first_with(digits, step)
    except Uncertain as reason:
        return Refusal(*reason.args)


def _certify(pair, branch, point, digits, labels):
    digits = checks.integer("digits", digits, 10, 300)
    problem, chosen = restored(pair, branch, point, MAX_EVENTS)
    label = int(branch.label[point])
    if label not in labels or branch.attrs["parameter"] != "tuning":
        names = " or ".join(special.LABELS[one] for one in labels)
        raise ValueError(
            f"point = {point!r} is not allowed: it must be a {names} of a branch over the tuning"
        )
    given = chosen.state, chosen.value, problem.period
    return _proven(partial(_point, pair, given, label, digits), pair, digits)


def _touching(pair, given):
    """Return (contact, events, (phase, number of the line), start, state there): a candidate.

    Where the flank is touched near tau = 0 the orbit is looked at from tau = pi.
    """
    state, tuning, period = given
    phases, heights = turning_points(pair, tuning, state, period, MAX_EVENTS)
    gaps = np.abs(heights[:, None] - lines(pair))
    at, which = np.unravel_index(np.argmin(gaps), gaps.shape)
    touch, start, whole = float(phases[at]), 0.0, 2.0 * math.pi * period
    contact, events = run_contacts(pair, tuning, state, period)
    if _apart(touch, 0.0, period) < _NEAR_START:
        start = math.pi
        _, _, samples = pair.propagator(tuning).record(state, 1, MAX_EVENTS, 2)
        state = samples[1, [columns.SAMPLE_X, columns.SAMPLE_V]]
        contact = ([contact] + [after for at, _, after in events if at < start])[-1]
        events = sorted((at + whole * (at < start), *codes) for at, *codes in events)
    # A point on the far side of the grazing, or rounding, makes contacts of the touch.
    events = [event for event in events if _apart(event[0], touch, period) > _ONE_TOUCH]
    return contact, events, (touch - start) % whole + start, which, start, state


def _apart(a, b, period):
    """Return how far two phases lie apart on an orbit."""
    whole = 2.0 * math.pi * period
    return abs((a - b + 0.5 * whole) % whole - 0.5 * whole)


def _point(pair, given, label, digits):
    """Return (the `PointCertificate`, its digits) at the present precision."""
    arb, laws, (state, tuning, period) = flint().arb, Laws(pair, given[1]), given
    touch, start = None, 0.0
    if label == special.GRAZING:
        contact, events, phase, which, start, state = _touching(pair, given)
        touch = phase, laws.far if which else laws.near
    else:
        contact, events = run_contacts(pair, tuning, state, period)
    path = Path(laws, contact, events, period, touch, arb.pi() if start else 0)
    sign = -1 if label == special.DOUBLING else 1

    def system(u):
        residuals, rows = path.equations(u)
        if label == special.GRAZING:
            return residuals, rows
        trace, determinant, slopes, rates = path.trace(u)
        row = [rate - sign * slope for slope, rate in zip(slopes, rates, strict=True)]
        return [*residuals, 1 - sign * trace + determinant], [*rows, row]

    first = arb(float(state[0])), arb(float(state[1])) * tuning
    box, centre, inverse = _enclosed(system, [*first, *path.guess, 1 / arb(tuning)])
    x, w, *phases, scale = box
    nu = 1 / scale
    moved = max(abs(a - b).upper() for a, b in ((x, first[0]), (w, first[1]), (nu, arb(tuning))))
    if not moved < _REACH:
        raise Uncertain(
            "distance",
            f"the nearest point found lies {float(moved):.2g} from the candidate; {_REACH:g} is "
            "allowed",
        )
    states = path.states(x, w, phases, scale)
    check_contacts(path, (x, w), states)
    radius = krawczyk.uniqueness(system, centre, inverse, _SINGULAR)
    touches = [
        p for node, (_, _, p, _) in zip(path.nodes, states, strict=True) if node.kind == TOUCH
    ]
    contacts = path.contacts(states, scale)
    found = PointCertificate(
        special.LABELS[label],
        pair,
        period,
        (contact, *(after for _, _, after, _ in contacts)),
        enclosure(nu, digits),
        _interval(centre[-1], radius),
        enclosure(x, digits),
        enclosure(w * scale, digits),
        listed(contacts, digits),
        enclosure(touches[0], digits) if touches else None,
        "pi" if start else "0",
        radius,
        float(moved),
        digits,
    )
    values = [nu, x, w, *phases]
    return found, min(digits_of(value) for value in values)


def _enclosed(system, start):
    centre, inverse = krawczyk.polish(system, start, _SINGULAR)
    box = krawczyk.enclose(system, centre, inverse)
    if box is None:
        raise Uncertain(*_SINGULAR)
    return box, centre, inverse


def _interval(scale, radius):
    """Return the tunings within a radius of 1 / nu, rounded inwards."""
    low, high = 1 / (scale + radius), 1 / (scale - radius)
    ends = float(low.mid()), float(high.mid())
    return math.nextafter(ends[0], math.inf), math.nextafter(ends[1], -math.inf)


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


def _tongue(pair, candidate, digits):
    """Return (the `Tongue`, its digits) at the present precision."""
    arb, order, sign = flint().arb, candidate.order, candidate.multiplier
    path = Path(Laws(pair, candidate.start), NORMAL, [], 1)

    def excess(scale):
        """Return det(M - sign I), < 0 where deviations grow, and its derivative by 1 / nu."""
        trace, determinant, slopes, rates = path.trace([0, 0, scale])
        return 1 - sign * trace + determinant, rates[-1] - sign * slopes[-1]

    def system(u):
        value, slope = excess(u[0])
        return [value], [[slope]]

    edges, intervals = [], []
    for tuning in (candidate.start, candidate.stop):
        box, centre, inverse = _enclosed(system, [1 / arb(tuning)])
        if not abs(1 / box[0] - tuning) < _REACH:
            raise Uncertain("distance", f"no edge of order {order} is where it was looked for")
        radius = krawczyk.uniqueness(system, centre, inverse, _SINGULAR)
        edges.append(1 / box[0])
        intervals.append(_interval(centre[0], radius))
    _check_inside(excess, 1 / edges[1], 1 / edges[0], order)
    found = Tongue(
        pair,
        order,
        sign,
        enclosure(edges[0], digits),
        enclosure(edges[1], digits),
        intervals[0],
        intervals[1],
        digits,
    )
    return found, min(digits_of(edge) for edge in edges)
