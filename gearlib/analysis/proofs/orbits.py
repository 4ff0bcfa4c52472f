"""`certify`: a periodic orbit proven to exist, with its contacts, its multipliers and stability."""

import math
from functools import partial
from typing import Any

from gearlib import checks
from gearlib.analysis.orbits.shooting import Orbit
from gearlib.analysis.proofs.balls import digits_of, enclosure, flint, precision
from gearlib.analysis.proofs.certificates import Certificate, Refusal, listed
from gearlib.analysis.proofs.extrema import extrema
from gearlib.analysis.proofs.krawczyk import enclose, polish, uniqueness
from gearlib.analysis.proofs.laws import Laws
from gearlib.analysis.proofs.path import SWITCH, Path, Uncertain
from gearlib.analysis.proofs.signs import check_contacts
from gearlib.kernels import orbit as columns
from gearlib.models.model import is_model
from gearlib.runs.run_arguments import MAX_EVENTS

#: Farthest that the proven state may lie from the candidate's, in static deflections.
REACH = 1e-8
#: Bits beyond the digits asked for, and how often they are doubled.
_GUARD, _DOUBLINGS = 64, 3
#: Status and sentence where the derivative is singular.
FOLD = (
    "fold",
    "the derivative of the equations has no inverse: a multiplier 1 is here, or too near to tell",
)
#: Where trace and determinant decide nothing at their precision.
UNCERTAIN_STABILITY = "undecided", "the enclosure of a multiplier meets the unit circle"


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
    if not isinstance(orbit, Orbit):
        raise ValueError(f"orbit = {orbit!r} is not allowed: it must be an Orbit")
    digits = checks.integer("digits", digits, 10, 300)
    try:
        model: Any = orbit.pair
        if model.equation is None:
            from gearlib.analysis.proofs.trains.orbits import train_certificate

            return train_certificate(orbit, digits)
        check_model(orbit.pair)
        contact, events = listed_contacts(orbit)
        return first_with(digits, lambda: Proof(orbit, contact, events).certificate(digits))
    except Uncertain as reason:
        return Refusal(*reason.args)


def first_with(digits, step, guard=_GUARD):
    """Return what a step gives at the first precision at which it reaches the digits.

    `step` returns (what it gives, digits reached); `guard` are the first bits beyond the digits.

    Raises
    ------
    Uncertain
    """
    bits, reached = math.ceil(digits / math.log10(2.0)) + guard, 0
    for _ in range(_DOUBLINGS):
        with precision(bits):
            found, reached = step()
        if reached >= digits:
            return found
        bits *= 2
    raise Uncertain("precision", f"only {reached} digits were reached, not {digits}")


def check_model(pair):
    """Raise `Uncertain` for a model without a proof."""
    if pair.equation is None or not pair.equation.is_piecewise_linear():
        name = type(pair).__name__
        raise Uncertain(
            "model",
            "proofs are written for one degree of freedom with linear phases of contact, not for "
            f"this {name}",
        )


def check_pair(pair):
    """Raise `Uncertain` for a model that is no `GearPair`: its laws depend on the tuning."""
    if not is_model(pair):
        raise ValueError(f"pair = {pair!r} is not allowed: it must be a GearPair")
    if pair.mesh is not pair:
        name = type(pair).__name__
        raise Uncertain("model", f"over the tuning only a GearPair is proven, not a {name}")


def run_contacts(pair, tuning, state, period):
    """Return (first contact code, events) of a motion in floating point: a candidate.

    Events are (phase, code before, code after), phases counted on over the mesh periods.
    """
    events, summary, _ = pair.propagator(tuning).record(state, period, MAX_EVENTS)
    if not len(events):
        near, far = pair.flank_lines
        low, high = summary[columns.X_MIN], summary[columns.X_MAX]
        return (1 if high > near else 0 if low > far else -1), []
    table = [
        (
            2.0 * math.pi * row[columns.EVENT_PERIOD] + row[columns.EVENT_PHASE],
            int(row[columns.EVENT_FROM]),
            int(row[columns.EVENT_TO]),
        )
        for row in events
    ]
    return table[0][1], table


def listed_contacts(orbit):
    """Return (first contact code, events) of the motion from a candidate, which lists them."""
    contact, events = run_contacts(orbit.pair, orbit.tuning, orbit.state, orbit.period)
    pattern = (contact, *(after for _, _, after in events))
    if pattern != tuple(orbit.pattern):
        raise Uncertain(
            "contacts",
            f"the motion from the candidate has the contacts {pattern}, not the listed "
            f"{tuple(orbit.pattern)}",
        )
    return contact, events


def enclosed(system, centre, inverse, given):
    """Return the box with one orbit, of state and phases, and how far it is from the given state.

    Raises
    ------
    Uncertain
        If there is no such box, or not near the state.
    """
    box = enclose(system, centre, inverse)
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


class Proof:
    """The steps of the proof of one orbit, at the present precision.

    Raises
    ------
    Uncertain
        At the first step that fails.
    """

    def __init__(self, orbit, contact, events):
        arb = flint().arb
        self.orbit, self.laws = orbit, Laws(orbit.pair, orbit.tuning)
        self.scale = 1 / arb(orbit.tuning)
        self.path = Path(self.laws, contact, events, orbit.period)
        given = arb(float(orbit.state[0])), arb(float(orbit.state[1])) * orbit.tuning
        system = lambda u: self.path.equations(u, self.scale)  # noqa: E731
        self.centre, inverse = polish(system, [*given, *self.path.guess], FOLD)
        self.box, self.moved = enclosed(system, self.centre, inverse, given)
        x, w, *phases = self.box
        self.states = self.path.states(x, w, phases, self.scale)
        check_contacts(self.path, (x, w), self.states)
        self.radius = uniqueness(system, self.centre, inverse, FOLD)
        self._check_period()

    def _check_period(self):
        """Refuse an orbit that repeats earlier: with the same contacts, and the same state."""
        count, period = len(self.box) - 2, self.orbit.period
        for part in range(1, period):
            if period % part or count * part % period:
                continue
            first = self.states_at(part)
            if all(a.overlaps(b) for a, b in zip(first, self.box, strict=False)):
                plural = "s" * (part > 1)
                raise Uncertain(
                    "period",
                    f"it repeats after {part} mesh period{plural} already, not after {period}",
                )

    def states_at(self, part):
        """Return the enclosure of (x, w) after some whole mesh periods."""
        turn = 2 * flint().arb.pi() * part
        (x, w), last = self.box[:2], self.path.start
        for node, (x_end, w_end, phase, _) in zip(self.path.nodes, self.states, strict=True):
            if phase.overlaps(turn):
                if node.kind == SWITCH:
                    # Only a switch at the start of a period is this close to it: they are one.
                    return x_end, w_end
                raise Uncertain(
                    "switch", f"a contact may coincide with the start of mesh period {part}"
                )
            if phase > turn:
                t = (turn - last) * self.scale
                return node.law.go(x, w, t, last)[:2]
            x, w, last = x_end, w_end, phase
        return x, w

    def certificate(self, digits):
        """Return (the `Certificate`, the digits that its enclosures have)."""
        orbit, rate = self.orbit, self.scale
        matrix, determinant = self.path.monodromy([t for *_, t in self.states])
        trace = flint().arb(matrix[0] + matrix[3])
        multipliers = eigenvalues(trace, determinant)
        stability, reason = judge(trace, determinant)
        contacts = self.path.contacts(self.states, rate)
        x, v = self.box[0], self.box[1] * rate
        least, most = extrema(self.path, self.box[:2], self.states)
        numbers = [x, v, least, most, trace, determinant]
        numbers += [part for one in multipliers for part in one]
        numbers += [value for phase, _, _, speed in contacts for value in (phase, speed)]
        within = partial(enclosure, digits=digits)
        found = Certificate(
            orbit.pair,
            orbit.tuning,
            orbit.period,
            (self.path.contact, *(after for _, _, after, _ in contacts)),
            within(x),
            within(v),
            listed(contacts, digits),
            within(least),
            within(most),
            self.radius,
            float(self.moved),
            within(trace),
            within(determinant),
            tuple((within(real), within(imaginary)) for real, imaginary in multipliers),
            stability,
            reason,
            digits,
        )
        return found, min(digits_of(value) for value in numbers)


def eigenvalues(trace, determinant):
    """Return the multipliers, the larger first: pairs of balls, real and imaginary part."""
    arb, half = flint().arb, trace / 2
    square = half * half - determinant
    if square < 0:
        root = (-square).sqrt()
        return (half, root), (half, -root)
    if square > 0:
        root = square.sqrt()
        # The larger root without cancellation, the other by the product.
        large = half + root if trace > 0 else half - root
        return (large, arb(0)), (determinant / large, arb(0))
    size = arb(0, abs(square).upper().sqrt().upper())
    return (half + size, size), (half + size, size)


def judge(trace, determinant):
    """Return (stability, reason): Jury's conditions on trace and determinant."""
    if determinant > 1 or abs(trace) > 1 + determinant:
        return "unstable", "a multiplier lies outside the unit circle"
    if determinant < 1 and abs(trace) < 1 + determinant:
        return "stable", "both multipliers lie inside the unit circle"
    if determinant == 1 and abs(trace) < 2:
        return (
            "undecided",
            "nothing is damped on its way: both multipliers lie on the unit circle, exactly, and "
            "decide nothing",
        )
    return UNCERTAIN_STABILITY
