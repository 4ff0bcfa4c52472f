"""`certify_fold`, `certify_grazing`: proven tunings of special points.

The equations of an orbit, and one more, or two with the phase of a touch; 1 / nu is an unknown:

==================  ==========================================
fold                det(M - I) = 0
period doubling     det(M + I) = 0
grazing             x on a flank line and x' = 0 at a phase
==================  ==========================================

In place of the determinants of fold and doubling stands a number g that is zero where they are:
with J the derivative of the equations by state and phases, at a doubling with the sign of the
return changed, and fixed b and c

    (J    b) (v)   (0)                             (J^T  c) (w)   (0)
    (c^T  0) (g) = (1),   dg/du = - w^T dJ/du v,   (b^T  0) (g) = (1)

(Govaerts, Numerical Methods for Bifurcations of Dynamical Equilibria, ch. 3).
"""

import math
from functools import partial

import numpy as np

from gearlib import checks
from gearlib.analysis.orbits import special_points as special
from gearlib.analysis.orbits.continuation import restored
from gearlib.analysis.proofs import certificate_files, krawczyk
from gearlib.analysis.proofs.balls import COARSE, digits_of, enclosure, flint, precision
from gearlib.analysis.proofs.candidate import check_model, laws_over_tunings, run_contacts
from gearlib.analysis.proofs.orbits import first_with, pattern_of, state_of, train_of
from gearlib.analysis.proofs.path import COAST, DRIVE, TOUCH, Path
from gearlib.analysis.proofs.signs import bounds_of, check_contacts
from gearlib.kernels.codes import NORMAL
from gearlib.models.model import is_model
from gearlib.runs.run_arguments import MAX_EVENTS

#: Farthest that a proven point may lie from the candidate, in static deflections and in tuning. A
#: candidate near a fold or a grazing is known to half of the digits.
REACH = 1e-6
SINGULAR = "fold", "the derivative of the equations has no inverse: the point is not a simple one"
#: Contacts this close to a touch, in phase, are the touch itself.
_ONE_TOUCH = 1e-3
#: A touch this close to tau = 0 is looked at from tau = pi.
_NEAR_START = 0.1
#: Places of an arc at which a turning point is looked for, and corrections of it.
_PLACES, _CORRECTIONS = 48, 6


def certify_fold(pair, branch, point, digits=30):
    """Prove a fold or a period doubling of a branch over the tuning, and where it lies.

    Parameters
    ----------
    pair : GearPair, another model of one degree of freedom, SixDegreePair or GearTrain
        Whose orbit was continued; without harmonics of load, deviation or run-out.
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


def check_any(model):
    if not is_model(model):
        raise ValueError(f"pair = {model!r} is not allowed: it must be a GearPair or another model")
    check_model(model)


def proven_point(step, model, digits):
    """Return what a step of `first_with` gives, or a `Refusal`."""
    try:
        check_any(model)
        return first_with(digits, step)
    except certificate_files.Uncertain as reason:
        return certificate_files.Refusal(*reason.args)


def _certify(pair, branch, point, digits, labels):
    digits = checks.integer("digits", digits, 10, 300)
    problem, chosen = restored(pair, branch, point, MAX_EVENTS)
    label = int(branch.label[point])
    if label not in labels or branch.attrs["parameter"] != "tuning":
        names = " or ".join(special.LABELS[one] for one in labels)
        raise checks.refusal("point", point, f"a {names} of a branch over the tuning")
    given = chosen.state, chosen.value, problem.period
    return proven_point(partial(_point, pair, given, label, digits), pair, digits)


def _touching(model, given):
    """Return (codes, events, (phase, mesh, side), start, state there): a candidate, in floats.

    Where the flank is touched near tau = 0 the orbit is looked at from tau = pi.
    """
    state, tuning, period = given
    codes, events, _ = run_contacts(model, tuning, state, period)
    whole, start = 2.0 * math.pi * period, 0.0
    # Rounding, or a point on the far side of the grazing, makes contacts of the touch.
    close = [
        (one, other)
        for one, other in zip(events, events[1:] + events[:1], strict=True)
        if one[1] == other[1] and one[2] == other[3] and len(events) > 1
        and (other[0] - one[0]) % whole < _ONE_TOUCH
    ]  # fmt: skip
    ends = dict(enumerate(codes)) | {mesh: after for _, mesh, _, after in events}
    opened = [mesh for mesh, code in enumerate(codes) if ends[mesh] != code]
    if opened and not close:
        # One of the two lies just beyond the end, or before the start.
        half = min(
            (event for event in events if event[1] == opened[0]),
            key=lambda event: _apart(event[0], 0.0, period),
        )
        close, touch = [half], (half[0], half[1], _side(half))
        if half[0] < 0.5 * whole:
            codes[half[1]] = half[3]
        events = [event for event in events if event is not half]
    for one, other in close[:1] if not opened else ():
        touch = one[0] + 0.5 * ((other[0] - one[0]) % whole), one[1], _side(one)
        events = [event for event in events if event not in (one, other)]
        if one[0] > other[0]:
            # They lie on either side of the start.
            codes[one[1]] = one[2]
    with precision(COARSE):
        laws = laws_over_tunings(model, tuning)
        path, scale = Path(laws, codes, events, period, framed=False), 1 / laws.tuning
        values = laws.start(state)
        phases = path.phases(path.guess)
        arcs, _ = path.states([*values, *path.guess], scale)
        if not close:
            touch = _turning(laws, path, arcs, phases)
        if _apart(touch[0], 0.0, period) < _NEAR_START:
            start = math.pi
            place = next(i for i, phase in enumerate(phases) if phase > start)
            last = phases[place - 1] if place else path.start
            z = path.nodes[place].law.go(arcs[place][0], (flint().arb.pi() - last) * scale)
            values = krawczyk.middle((laws.basis * z).entries()[: len(values)])
            for at, mesh, _, after in events:
                if at < start:
                    codes[mesh] = after
            events = sorted((at + whole * (at < start), *what) for at, *what in events)
    events = [event for event in events if _apart(event[0], touch[0], period) > _ONE_TOUCH]
    return codes, events, ((touch[0] - start) % whole + start, *touch[1:]), start, values


def _side(event):
    return DRIVE if NORMAL in event[2:] else COAST


def _turning(laws, path, arcs, phases):
    """Return (phase, mesh, side) of the turning point of a distance that is nearest to a line."""
    found, codes, last = [], list(path.codes), path.start
    for node, (z, t), phase in zip(path.nodes, arcs, phases, strict=True):
        shares = np.linspace(0.0, 1.0, _PLACES)
        states = [node.law.go(z, t * share) for share in shares]
        for j, side, _, row in bounds_of(laws, codes, laws.distances):
            rate = row * node.law.matrix
            speeds = np.array([float((rate * one)[0, 0]) for one in states])
            for i in np.flatnonzero((speeds[:-1] < 0.0) != (speeds[1:] < 0.0)):
                at = t * float(
                    shares[i] + np.diff(shares)[i] * speeds[i] / (speeds[i] - speeds[i + 1])
                )
                for _ in range(_CORRECTIONS):
                    there = node.law.go(z, at)
                    at = (at - (rate * there / (rate * node.law.matrix * there)[0, 0])[0, 0]).mid()
                gap = abs(float((row * node.law.go(z, at))[0, 0]))
                found.append((gap, float(last + at * laws.tuning), j, side))
        if node.mesh >= 0:
            codes[node.mesh] = node.after
        last = phase
    if not found:
        raise certificate_files.Uncertain("grazing", "no turning point is near a flank line")
    return min(found)[1:]


def _apart(a, b, period):
    """Return how far two phases lie apart on an orbit."""
    whole = 2.0 * math.pi * period
    return abs((a - b + 0.5 * whole) % whole - 0.5 * whole)


class _Bordered:
    """The equations of an orbit and g, see above; unknowns are state, phases and 1 / nu."""

    def __init__(self, path, sign, start):
        self.path, self.sign = path, sign
        _, rows = self.path.equations(start)
        jacobian = self._square(rows)
        floats = np.array([[float(value) for value in row] for row in jacobian.tolist()])
        left, _, right = np.linalg.svd(floats)
        self.size = len(floats)
        self.left, self.right = _rounded(left[:, -1]), _rounded(right[-1])

    def _square(self, rows):
        """Return J; at a doubling the state returns with the other sign."""
        arb_mat, n = flint().arb_mat, 2 * len(self.path.laws.kept)
        found = arb_mat([row[:-1] for row in rows])
        if self.sign < 0:
            for i in range(n):
                found[len(rows) - n + i, i] += 2
        return found

    def __call__(self, unknowns):
        module, n = flint(), self.size
        residuals, rows = self.path.equations(unknowns, bits=module.ctx.prec)
        jacobian = self._square(rows)
        whole = module.arb_mat(
            [[*row, b] for row, b in zip(jacobian.tolist(), self.left, strict=True)]
            + [[*self.right, 0]]
        )
        unit = module.arb_mat([[0]] * n + [[1]])
        v, w = (_solved(matrix, unit).entries() for matrix in (whole, whole.transpose()))
        *_, bends = self.path.equations(unknowns, direction=v[:n])
        slopes = module.arb_mat([w[:n]]) * module.arb_mat(bends) * -1
        return [*residuals, v[n]], [*rows, slopes.entries()]


def _rounded(vector):
    """Return a vector with few digits: of more, and of its sign, processors have own opinions."""
    return np.round(vector * np.sign(vector[np.abs(vector).argmax()]), 3).tolist()


def _solved(matrix, column):
    """Return the solution of linear equations, by an inverse near to all in the balls.

    Without a bound where there may be none.
    """
    try:
        near = matrix.mid().inv().mid()
        return (near * matrix).solve(near * column)
    except ZeroDivisionError:
        return column * flint().arb("nan")


def _point(model, given, label, digits):
    """Return (the `PointCertificate`, its digits) at the present precision."""
    arb, (state, tuning, period) = flint().arb, given
    laws, touch, start = laws_over_tunings(model, tuning), None, 0.0
    if label == special.GRAZING:
        codes, events, touch, start, first = _touching(model, given)
    else:
        codes, events, _ = run_contacts(model, tuning, state, period)
        first = laws.start(state)
    path = Path(laws, codes, events, period, touch, arb.pi() if start else 0, framed=False)
    guess = [*first, *path.guess, 1 / arb(tuning)]
    system = path.equations
    if label != special.GRAZING:
        system = _Bordered(path, -1 if label == special.DOUBLING else 1, guess)
    box, centre, inverse = enclosed_zero(system, guess)
    *unknowns, scale = box
    n, nu = len(first), 1 / scale
    away = zip((*unknowns[:n], nu), (*first, arb(tuning)), strict=True)
    moved = max(abs(a - b).upper() for a, b in away)
    if not moved < REACH:
        raise certificate_files.Uncertain(
            "distance",
            f"the nearest point found lies {float(moved):.2g} from the candidate; {REACH:g} is "
            "allowed",
        )
    phases = path.phases(unknowns[n:])
    arcs, ends = path.states(unknowns, scale)
    speeds = iter(check_contacts(path, arcs, ends, phases))
    radius = krawczyk.uniqueness(system, centre, inverse, SINGULAR)
    touches = [p for node, p in zip(path.nodes, phases, strict=True) if node.kind == TOUCH]
    contacts = [
        (p, node.mesh, node.before, node.after, next(speeds) * scale)
        for node, p in zip(path.nodes, phases, strict=True)
        if node in path.contacts()
    ]
    displacement, velocity = state_of(laws, unknowns, scale, digits)
    found = certificate_files.PointCertificate(
        special.LABELS[label],
        model,
        period,
        pattern_of(codes, contacts),
        enclosure(nu, digits),
        interval_of(centre[-1], radius),
        displacement,
        velocity,
        certificate_files.listed(contacts, digits, laws.mesh_names if laws.framed else ()),
        enclosure(touches[0], digits) if touches else None,
        "pi" if start else "0",
        radius,
        float(moved),
        digits,
        train_of(laws, codes, touch),
    )
    values = [nu, *unknowns]
    return found, min(digits_of(value) for value in values)


def enclosed_zero(system, start):
    centre, inverse = krawczyk.polish(system, start, SINGULAR)
    box = krawczyk.enclose(system, centre, inverse)
    if box is None:
        raise certificate_files.Uncertain(*SINGULAR)
    return box, centre, inverse


def interval_of(scale, radius):
    """Return the tunings within a radius of 1 / nu, rounded inwards."""
    low, high = 1 / (scale + radius), 1 / (scale - radius)
    ends = float(low.mid()), float(high.mid())
    return math.nextafter(ends[0], math.inf), math.nextafter(ends[1], -math.inf)
