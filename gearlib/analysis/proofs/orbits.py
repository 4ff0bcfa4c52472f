"""`certify`: a periodic orbit proven to exist, with its contacts, its multipliers and stability."""

import math
from functools import partial
from itertools import pairwise, product
from typing import Any

from gearlib import checks
from gearlib.analysis.orbits.shooting import check_orbit
from gearlib.analysis.proofs import krawczyk
from gearlib.analysis.proofs.balls import COARSE, digits_of, enclosure, flint, precision
from gearlib.analysis.proofs.candidate import check_model, laws_of, listed_contacts
from gearlib.analysis.proofs.certificate_files import (
    Certificate,
    Refusal,
    TrainCertificate,
    TrainFacts,
    Uncertain,
    listed,
)
from gearlib.analysis.proofs.extrema import extrema
from gearlib.analysis.proofs.multipliers import eigenvalues, judge, judge_two, of_two
from gearlib.analysis.proofs.path import Path
from gearlib.analysis.proofs.signs import check_contacts
from gearlib.analysis.proofs.windows import Windows, close

#: Farthest that the proven state may lie from the candidate's, in static deflections.
REACH = 1e-8
#: Bits beyond the digits asked for, where contacts come together too; how often they are doubled.
_GUARD, _MORE, _DOUBLINGS = 64, 320, 3
#: Status and sentence where the derivative is singular.
FOLD = (
    "fold",
    "the derivative of the equations has no inverse: a multiplier 1 is here, or too near to tell",
)
#: How often contacts at nearly one phase are put into another order; what is near, and the bits
#: that tell most of them apart.
_ORDERS, _NEAR, _SORTING = 3, 1e-9, 96
#: By how much derivatives in an order and through windows may differ.
_SAME = 2.0**-32
#: A box that shows how large a box about the orbit may be, and how often a smaller one is tried.
_SMALL, _TRIES = 2.0**-24, 20


def certify(orbit, digits=30):
    """Prove that a periodic orbit exists, which contacts it has, and whether it is stable.

    Parameters
    ----------
    orbit : Orbit
        The candidate, of `gearlib.periodic_orbit`, of a `GearPair`, of another model of one degree
        of freedom with linear phases of contact, of a `SixDegreePair` or a `GearTrain`; nothing it
        says is believed.
    digits : int, default 30
        Decimal digits of the enclosures, 10 to 300.

    Returns
    -------
    Certificate, TrainCertificate or Refusal
        A certificate has displacement, velocity and events with their enclosures (exact decimals),
        that of a pair the extrema of the displacement too, radius, within which there is no other
        such orbit, trace, determinant and multipliers, stability with its reason; `as_dict` for a
        file. A refusal is false where a truth value is asked for; its status and message name the
        step that failed.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    ImportError
        Without python-flint.

    Notes
    -----
    The floating-point numbers of a `GearPair` and the tuning are taken as exact numbers. The proven
    orbit lies within 1e-8 static deflections of the candidate and has its contacts, in its order,
    and no others. Method: Krawczyk's test in ball arithmetic, see the page on proofs.
    """
    check_orbit(orbit)
    digits = checks.integer("digits", digits, 10, 300)
    try:
        check_model(orbit.pair)
        contacts = listed_contacts(orbit)
        return proven(digits, lambda: Proof(orbit, *contacts).certificate(digits))
    except Uncertain as reason:
        return Refusal(*reason.args)


def proven(digits, step):
    """Return what a step gives, with more bits where contacts come together."""
    try:
        return first_with(digits, step)
    except Uncertain as reason:
        if reason.args[0] != "together":
            raise
        # Windows of contacts at once widen from one to the next.
        return first_with(digits, step, _MORE)


def first_with(digits, step, guard=_GUARD):
    """Return what a step gives at the first precision at which it reaches the digits.

    `step` returns (what it gives, digits reached); `guard` are the first bits beyond the digits.
    """
    bits, reached = math.ceil(digits / math.log10(2.0)) + guard, 0
    for _ in range(_DOUBLINGS):
        with precision(bits):
            found, reached = step()
        if reached >= digits:
            return found
        bits *= 2
    raise Uncertain("precision", f"only {reached} digits were reached, not {digits}")


def _enclosed(system, centre, inverse, given):
    """Return the box with one orbit, of state and phases, and its distance from a given state."""
    box = krawczyk.enclose(system, centre, inverse)
    if box is None:
        raise Uncertain(*FOLD)
    moved = max(abs(a - b).upper() for a, b in zip(box, given, strict=False))
    if not moved < REACH:
        raise Uncertain(
            "distance",
            f"the nearest orbit found lies {float(moved):.2g} static deflections from the "
            f"candidate; {REACH:g} is allowed",
        )
    return box, moved


def pattern_of(codes, contacts):
    """Return the contact codes in the order met, as those of an `Orbit`."""
    return (contacts[0][2], *(one[3] for one in contacts)) if contacts else tuple(codes)


def state_of(laws, box, scale, digits):
    """Return the enclosures of displacement and dx/dtau, of a train tuples of all coordinates."""
    within = partial(enclosure, digits=digits)
    if not laws.framed:
        return within(box[0]), within(box[1] * scale)
    return tuple(tuple(map(within, half)) for half in laws.spread(box, scale))


def train_of(laws, codes):
    """Return the `TrainFacts` of the laws of a train; None: of one degree of freedom."""
    if not laws.framed:
        return None
    fixed = tuple(laws.coordinates[i] for i in laws.fixed)
    return TrainFacts(laws.mesh_names, tuple(codes), laws.coordinates, fixed, laws.derived)


class Proof:
    """The steps of the proof of one orbit, at the present precision."""

    def __init__(self, orbit, codes, events):
        self.orbit, self.codes = orbit, tuple(codes)
        self.laws = laws = laws_of(orbit.pair, orbit.tuning)
        self.scale = 1 / laws.tuning
        if orbit.period % laws.repeats:
            raise Uncertain(
                "period",
                f"the excitation repeats after {laws.repeats} mesh periods, not after "
                f"{orbit.period}",
            )
        given = laws.start(orbit.state)
        self.centre, inverse = self._polished(given, events)
        system, n = self.system, len(given)
        windows = Windows(self.path, codes, self.centre[n:]) if laws.framed else None
        if windows and windows.any():
            system = windows.equations
            self._check_derivative(windows)
            self.centre, inverse = krawczyk.polish(system, self.centre[:n], FOLD)
        else:
            windows = None
        self.box, self.moved = _enclosed(system, self.centre, inverse, given)
        if windows:
            self.phases, self.speeds, self.ends, self.map = windows.proven(self.box)
            system = windows.equations_or_nothing
        else:
            self.phases = self.box[n:]
            self.arcs, self.ends = self.path.states(self.box, self.scale)
            self.speeds = check_contacts(
                self.path, self.arcs, self.ends, self.path.phases(self.phases)
            )
            _, rows = self.path.equations(self.box, self.scale, flint().ctx.prec)
            self.map = self.path.monodromy(rows)
        self._check_period()
        # Few bits suffice for a radius, but not for windows.
        with precision(flint().ctx.prec if windows or not laws.framed else COARSE):
            self.radius = self._radius(system, inverse)

    def system(self, unknowns):
        """Return the equations at the tuning of the orbit."""
        return self.path.equations(unknowns, self.scale)

    def _check_derivative(self, windows):
        """Hold the derivative through windows against that in the one order that was found.

        Differences would say nothing: at another place than their middle windows are as wide as the
        step to it.
        """
        n = 2 * len(self.laws.kept)
        residuals, rows = self.system(self.centre)
        krawczyk.check_derivative(self.system, self.centre, residuals)
        ordered = self.path.monodromy(rows)
        _, rows = windows.equations(self.centre[:n])
        for i, j in product(range(n), repeat=2):
            apart = ordered[i, j] - (i == j) - rows[i][j]
            if not abs(apart).lower() < _SAME * max(1, abs(ordered[i, j])):
                raise Uncertain(*krawczyk.WRONG)

    def _radius(self, system, inverse, small=_SMALL):
        """Return the radius of uniqueness; `small` is one that shows how large it may be."""
        n = len(self.centre)
        for _ in range(_TRIES):
            shift = krawczyk.image(system, self.centre, [small] * n, inverse, [0] * n)
            # The share of a box that its image fills grows with the box.
            share = float(max(abs(s) for s in shift).upper()) / small
            if share < 1.0:
                break
            small *= _SMALL
        largest = min(krawczyk.LARGEST, small / _SMALL, 0.5 * small / max(share, small))
        return krawczyk.uniqueness(system, self.centre, inverse, FOLD, largest)

    def _path(self, events, framed=None):
        return Path(self.laws, self.codes, events, self.orbit.period, framed=framed)

    def _polished(self, given, events):
        """Return (midpoints of a zero, inverse of the derivative); the contacts in their order."""
        n = len(given)
        start, events = self._ordered(given, events)
        for _ in range(_ORDERS):
            self.path = self._path(events)
            centre, inverse = krawczyk.polish(self.system, [*start, *self.path.guess], FOLD)
            # What coincides has no order.
            if all(a - b < close() for a, b in pairwise(centre[n:])):
                break
            events = [(centre[n + i], *events[i][1:]) for i in _order(centre[n:])]
        return centre, inverse

    def _ordered(self, start, events):
        """Return state and events; where floats may have mixed up their order, in a better one."""
        phases = [phase for phase, *_ in events]
        if len(self.codes) == 1 or not any(b - a < _NEAR for a, b in pairwise(phases)):
            return start, events
        with precision(_SORTING):
            self.path = self._path(events, framed=False)
            centre, _ = krawczyk.polish(self.system, [*start, *self.path.guess], FOLD)
        n = len(start)
        return centre[:n], [(centre[n + i], *events[i][1:]) for i in _order(centre[n:])]

    def _check_period(self):
        """Refuse an orbit that repeats earlier: the states at the ends of its repeats differ."""
        period, repeats, n = self.orbit.period, self.laws.repeats, 2 * len(self.laws.kept)
        for count, node in enumerate(self.path.ends, start=1):
            part = count * repeats
            end = (self.laws.basis * self.ends[node]).entries()[:n]
            if period % part == 0 and all(map(flint().arb.overlaps, end, self.box)):
                plural = "s" * (part > 1)
                raise Uncertain(
                    "period",
                    f"it repeats after {part} mesh period{plural} already, not after {period}",
                )

    def certificate(self, digits):
        """Return (the `Certificate` or `TrainCertificate`, the digits that its enclosures have)."""
        laws, contacts, within = self.laws, self.contacts(), partial(enclosure, digits=digits)
        kind, own, multipliers, (stability, reason) = (
            self._of_train() if laws.framed else self._of_one_degree(contacts)
        )
        numbers = [ball for half in laws.spread(self.box, self.scale) for ball in half]
        numbers += [ball for phase, *_, speed in contacts for ball in (phase, speed)]
        numbers += [part for one in multipliers for part in (one.real, one.imag)]
        numbers += [value for value in own.values() if isinstance(value, flint().arb)]
        displacement, velocity = state_of(laws, self.box, self.scale, digits)
        found = kind(
            pair=self.orbit.pair,
            tuning=self.orbit.tuning,
            period=self.orbit.period,
            displacement=displacement,
            velocity=velocity,
            events=listed(contacts, digits, laws.mesh_names if laws.framed else ()),
            radius=self.radius,
            moved=float(self.moved),
            multipliers=tuple((within(one.real), within(one.imag)) for one in multipliers),
            stability=stability,
            reason=reason,
            digits=digits,
            **{
                name: within(value) if isinstance(value, flint().arb) else value
                for name, value in own.items()
            },
        )
        return found, min(map(digits_of, numbers))

    def contacts(self):
        """Return [(phase, mesh, code before, code after, rate of distance by tau)]."""
        return [
            (phase, node.mesh, node.before, node.after, speed * self.scale)
            for node, phase, speed in zip(
                self.path.contacts(), self.phases, self.speeds, strict=True
            )
        ]

    def _of_one_degree(self, contacts):
        """Return (record, what it has of its own, multipliers, stability with its reason)."""
        determinant = self.path.determinant([t for _, t in self.arcs])
        trace = self.map[0, 0] + self.map[1, 1]
        least, most = extrema(self.path, self.arcs, self.ends)
        own = {
            "pattern": (*self.codes, *(after for *_, after, _ in contacts)),
            "displacement_min": least,
            "displacement_max": most,
            "trace": trace,
            "determinant": determinant,
        }
        return Certificate, own, of_two(trace, determinant), judge_two(trace, determinant)

    def _of_train(self):
        """Return the same of a train."""
        multipliers = eigenvalues(self.map)
        own = vars(train_of(self.laws, self.codes))
        return TrainCertificate, own, multipliers, judge(multipliers)


def _order(phases: Any):
    """Return the numbers of phases in their order."""
    return sorted(range(len(phases)), key=phases.__getitem__)
