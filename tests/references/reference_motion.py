"""A motion of a `Machine`, event by event, by Taylor series in any number of digits.

Zeros of a distance are isolated: a stretch is halved until the distance has no zero there, or no
turning point, by the sum of its Taylor coefficients about the middle. So a touch between two steps
is not missed.
"""

import math
from typing import NamedTuple

import mpmath
import numpy as np

from tests.references.polynomial_zeros import product, slope_of, value_at, zeros
from tests.references.reference_equations import machine_of
from tests.references.reference_record import Record, note, sample


class Event(NamedTuple):
    """A change of contact."""

    phase: object
    contact: int  #: which
    before: int
    after: int
    rate: object  #: of the drive-side distance, by phase, in units of length
    own_rate: object  #: of the distance from the side that is met or left


class Motion:
    """What `move` returns: the last state, in units, all events, the record, the switches."""

    def __init__(self, state, events, record, machine, cuts):
        self.state, self.events, self.record, self.machine = state, events, record, machine
        self.cuts = cuts

    def mesh_state(self, periods, contact=0):
        """Return (x, x') of a contact at the end, in units."""
        machine, n = self.machine, self.machine.n
        q, v = (self.state[:n] * machine.length, self.state[n:] * machine.length)
        side, tau = machine.contacts[contact].drive, 2 * machine.context.pi * periods
        # From the edge of an oscillator, whose constant is no deviation.
        x = machine.distance(side, q, tau) - (side.constant if n == 1 else 0)
        return x / machine.length, machine.distance_rate(side, v, tau) / machine.length


class Step:
    """The Taylor series of a motion from one state, its contacts and segment given."""

    def __init__(self, machine, tau, q, v, codes, middle, terms, turned=False):
        self.machine, self.context = machine, machine.context
        self.tau, self.codes, self.middle, self.terms = tau, codes, middle, terms
        self.turned = turned
        stiffness, damping, self.constant = machine.stiffness, machine.damping, machine.load
        self.curved, waves = [], []
        for j, (contact, code) in enumerate(zip(machine.contacts, codes, strict=True)):
            if not contact.linear:
                self.curved.append((j, contact, code))
                continue
            for side, push, c, d in self.laws(contact, code):
                stiffness = stiffness + np.outer(push, side.row) * c
                damping = damping + np.outer(side.row, side.row) * d
                self.constant = self.constant - push * (c * side.constant)
                waves += [(row, push * c, side.row * d) for row in side.waves]
        self.stiffness, self.damping = stiffness, damping
        self.force = [machine.zeros(machine.n) for _ in range(terms)]
        self.force[0] = self.force[0] + self.constant
        for (frequency, a, b), push, drag in waves:
            value = [a * c + b * s for c, s in machine.wave(frequency, tau, terms + 1)]
            for k in range(terms):
                rate = (k + 1) * machine.speed * value[k + 1]
                self.force[k] = self.force[k] - push * value[k] - drag * rate
        for frequency, i, a, b in machine.forcing:
            for k, (c, s) in enumerate(machine.wave(frequency, tau, terms)):
                self.force[k][i] += a * c + b * s
        if machine.piece is not None:
            machine.piece.add_forces(machine, tau, self.force)
        self.series = self.expand(q, v)

    def laws(self, contact, code):
        """Yield (side, row of its force, stiffness, damping) of a linear contact."""
        yield contact.drive, contact.drive.row, 0, contact.film[0]
        if code:
            side = contact.drive if code > 0 else contact.coast
            c = self.level(contact, side)[0]
            push = side.row
            if side.friction:
                way = contact.sense(self.context, side, self.middle)
                push = push + contact.across * (way * side.friction)
            yield side, push, c, 0
            yield side, side.row, 0, side.material[0] - contact.film[0]

    def level(self, contact, side, terms=1):
        phase, rate, bend = self.machine.about(self.tau)
        return contact.level(self.context, side, phase, self.middle, terms, rate, bend)

    def expand(self, q, v):
        """Return the coefficients of q by phase, shape (terms + 2, n)."""
        machine, w = self.machine, self.machine.speed
        found, inverse = [q, v], machine.inverse / w**2
        curved = [_Curved(self, *one) for one in self.curved]
        for k in range(self.terms):
            total = self.force[k] - self.stiffness @ found[k]
            total = total - (self.damping @ found[k + 1]) * ((k + 1) * w)
            for one in curved:
                total = total - one.force(k, found)
            found.append(inverse @ total / ((k + 1) * (k + 2)))
        return np.array(found, machine.kind)

    def distance(self, side):
        """Return the coefficients of the distance of a side."""
        found = self.series @ side.row
        found[0] += side.constant
        for frequency, a, b in side.waves:
            for k, (c, s) in enumerate(self.machine.wave(frequency, self.tau, len(found))):
                found[k] += a * c + b * s
        return found

    def length(self, longest):
        """Return for how long the series holds: the last terms are below the last digit."""
        scale, found = self.machine.length, longest
        for last in (-1, -2):
            size = max(abs(value) for value in self.series[last]) / scale
            if size:
                order = len(self.series) + last
                least = mpmath.mpf(10) ** (-16.5 if self.machine.kind is float else -mpmath.mp.dps)
                reach = self.context.mpf((least / mpmath.mpf(size)) ** (mpmath.mpf(1) / order))
                found = min(found, reach)
        return found


class _Curved:
    """The force of a contact with powers, or a stiffness that is no step, term by term."""

    def __init__(self, step, _, contact, code):
        self.contact, self.code = contact, code
        self.side = {1: contact.drive, -1: contact.coast}.get(code)
        assert not any(side.waves or side.friction for side in contact.sides)
        # By time: a speed is a rate by phase times the mesh speed.
        self.speed = step.machine.speed
        if self.side:
            self.c = step.level(contact, self.side, step.terms)
        self.g, self.square, self.spring, self.rate, self.drag = [], [], [], [], []
        self.sign, self.turned = None, step.turned

    def force(self, k, series):
        """Return the k-th coefficient of the force on the coordinates."""
        row, code = self.contact.drive.row, self.code
        rate = (k + 1) * (row @ series[k + 1]) * self.speed
        self.rate.append(rate)
        d1, d2, d3 = self.side.material if code else self.contact.film
        # Where the motion turns its rate is rounding.
        if self.sign is None and rate and not (self.turned and k == 0):
            self.sign = 1 if rate > 0 else -1
        self.drag.append(product(self.rate, self.rate, k))
        total = d1 * rate + d2 * (self.sign or 1) * self.drag[k]
        total += d3 * product(self.drag, self.rate, k) if d3 else 0
        if code:
            g = row @ series[k] + (self.side.constant if k == 0 else 0)
            self.g.append(g)
            p2, p3 = self.contact.powers
            self.square.append(product(self.g, self.g, k))
            spring = g + p2 * code * self.square[k]
            spring += p3 * product(self.square, self.g, k) if p3 else 0
            self.spring.append(spring)
            total += product(self.c, self.spring, k)
        return row * total


def move(
    model, tuning, periods, state=(0.0, 0.0), context=mpmath.fp, recorded=0, phases=(), codes=None
):
    """Return the `Motion` of a description from phase 0, over periods that need not be whole.

    state : displacement and velocity by phase in units; of trains all components, or "static".
    recorded : of how many periods extrema and times are taken.
    phases : rising, at which samples are taken.
    codes : contacts at the start, where they are not those of the state.
    """
    machine = machine_of(model, tuning, context)
    machine.inverse = machine.inverse_mass()
    q, v = start_of(machine, state)
    whole, tau = 2 * context.pi, context.mpf(0)
    cuts = cuts_of(machine, periods, least_of(context))
    events, record = [], Record(len(machine.contacts), phases)
    crossed = {(j, s): True for j, c in enumerate(machine.contacts) for s in c.sides
               if on_line(machine, s, q)}  # fmt: skip
    begin = whole * (periods - recorded) if recorded else math.inf
    q, v, _ = along(machine, (tau, cuts), q, v, codes, crossed, events, record, begin)
    return Motion(np.concatenate([q, v]) / machine.length, events, record, machine, cuts)


def least_of(context):
    """Return a phase, or a time in units of such, that is rounding."""
    return 1e-13 if context is mpmath.fp else mpmath.mpf(10) ** (5 - mpmath.mp.dps)


def along(machine, way, q, v, codes, crossed, events, record, begin=math.inf):
    """Return (q, v, codes) at the end of a way: where it begins, and where laws change on it.

    Fills events, samples, and from `begin` on the record; `crossed`: sides on whose lines it
    starts; `codes` None: those of the state.
    """
    context, (tau, cuts) = machine.context, way
    terms = 26 if context is mpmath.fp else int(mpmath.mp.dps * 0.9) + 6
    least, turned = least_of(context), False
    codes = codes or first_codes(machine, q, v, machine.about((tau + cuts[0]) / 2)[0], terms)
    for stop in cuts:
        middle = machine.about((tau + stop) / 2)[0]
        while tau < stop:
            step = Step(machine, tau, q, v, codes, middle, terms, turned)
            h = step.length(stop - tau)
            t, met, turned = _first(step, codes, crossed, h, least)
            if stop > begin + least:
                note(step, record, t, codes)
            while record.phases and record.phases[0] < (stop if t == stop - tau else tau + t):
                record.samples.append(sample(step, record.phases.pop(0)))
            q, v = value_at(step.series, t), value_at(rates_of(step.series), t)
            whole_step = t == stop - tau
            if t:
                crossed = {}
            tau = stop if whole_step else tau + t
            for j, side, code in met:
                rates = (machine.distance_rate(s, v, tau) / machine.length
                         for s in (machine.contacts[j].drive, side))  # fmt: skip
                events.append(Event(tau, j, codes[j], code, *rates))
                codes = [*codes[:j], code, *codes[j + 1 :]]
                crossed[j, side] = True
    return q, v, codes


def rates_of(series):
    return np.arange(1, len(series))[:, None] * series[1:]


def before(machine, tau, q, v, codes):
    """Return (q, v) at phase 0 from which contacts lead to a state at tau, in the first segment."""
    machine.inverse, terms = machine.inverse_mass(), 26
    middle = tau / 2
    while tau > 0:
        step = Step(machine, tau, q, v, codes, middle, terms)
        t = -step.length(tau)
        q, v, tau = value_at(step.series, t), value_at(rates_of(step.series), t), tau + t
    return q, v


def turning_state(model, tuning, phase, contact, miss, q=None, v=None):
    """Return a start, in units, from which a drive side turns at a phase, `miss` over its line.

    Other coordinates are those of (q, v) at that phase, in m; None: it does not turn upwards there.
    """
    machine = machine_of(model, tuning)
    machine.inverse, tau = machine.inverse_mass(), phase
    q = machine.zeros(machine.n) if q is None else q
    v = machine.zeros(machine.n) if v is None else v
    side = machine.contacts[contact].drive
    square = side.row @ side.row
    q = q + side.row * ((miss * machine.length - machine.distance(side, q, tau)) / square)
    v = v - side.row * (machine.distance_rate(side, v, tau) / square)
    codes = first_codes(machine, q, v, tau, 4)
    codes[contact] = 1
    if Step(machine, tau, q, v, codes, tau, 3).distance(side)[2] <= 0:
        return None
    return np.concatenate(before(machine, tau, q, v, codes)) / machine.length


def start_of(machine, state):
    """Return (q, q') in m for a state."""
    if isinstance(state, str) or len(state) != 2 * machine.n:
        return machine.start(state)
    values = [machine.context.mpf(x) * machine.length for x in state]
    values = np.array(values, machine.kind)
    return values[: machine.n], values[machine.n :]


def cuts_of(machine, periods, least):
    """Return the phases at which a stiffness or sliding changes, the periods and the end."""
    context, found = machine.context, []
    whole = 2 * context.pi
    for contact in machine.contacts:
        last = int(periods * contact.rate) + 2
        for cut in contact.cuts(context):
            found += [whole * (cut % 1 + k) / contact.rate for k in range(-1, last)]
    found += [whole * k for k in range(1, periods)]
    end, kept = whole * periods, []
    for cut in sorted(found):
        if least < cut < end - least and (not kept or cut - kept[-1] > least):
            kept.append(cut)
    return [*kept, end]


def on_line(machine, side, q):
    """Return whether a start is on the line of a side, to rounding."""
    return abs(machine.distance(side, q, 0 * machine.speed)) <= machine.tiny * machine.length


def first_codes(machine, q, v, middle, terms):
    """Return the contacts of a start; on a line that of where the motion goes."""
    codes, zero = [], machine.context.mpf(0)
    for contact in machine.contacts:
        drive = (
            0 if on_line(machine, contact.drive, q) else machine.distance(contact.drive, q, zero)
        )
        coast = machine.distance(contact.coast, q, zero) if contact.coast else None
        coast = 0 if contact.coast and on_line(machine, contact.coast, q) else coast
        if drive > 0 or (drive == 0 and coast is not None and coast <= 0):
            codes.append(1)
        else:
            codes.append(-1 if coast is not None and coast < 0 else 0)
    for j, contact in enumerate(machine.contacts):
        for side in contact.sides:
            if not on_line(machine, side, q):
                continue
            curve = Step(machine, zero, q, v, codes, middle, terms).distance(side)
            least = machine.tiny * max(map(abs, curve[1:4]))
            first = next((c for c in curve[1:] if abs(c) > least), 0)
            if side is contact.drive:
                codes[j] = 1 if first >= 0 else min(codes[j], 0)
            elif first < 0:
                codes[j] = -1
    return codes


def watched(contact, code):
    """Return (side, sign, next code): met where sign times the distance falls through zero."""
    if code:
        side = contact.drive if code > 0 else contact.coast
        return [(side, code, -code if contact.closed else 0)]
    return [(contact.drive, -1, 1), *([(contact.coast, 1, -1)] if contact.coast else [])]


def _first(step, codes, crossed, h, least):
    """Return (time, [(contact, side, next code)], whether it turns) of what ends a step."""
    found, met, turned = h, [], False
    floor = step.machine.length * step.machine.tiny * 1e-3
    for j, (contact, code) in enumerate(zip(step.machine.contacts, codes, strict=True)):
        if not contact.linear and (contact.film[1] or any(s.material[1] for s in contact.sides)):
            # |y'| y' has a kink: the series ends where y' turns.
            slope = slope_of(step.distance(contact.drive))
            slope = slope[1:] if step.turned or not slope[0] else slope
            turn = next(iter(zeros(slope, h * 0, found, least * 1e-3, floor)), None)
            if turn is not None and 0 < turn < found:
                found, met, turned = turn, [], True
        for side, sign, code_after in watched(contact, code):
            curve = sign * step.distance(side)
            if (j, side) in crossed:
                # From the line on: the zero at the start is divided out.
                curve = curve[1:]
            elif not curve[0] or (curve[0] < 0 and curve[1] < 0):
                if curve[1] < 0:
                    return h * 0, [(j, side, code_after)], False
            for zero in zeros(curve, h * 0, found, least * 1e-3, floor):
                inside = zero if (j, side) not in crossed or zero else None
                if inside is not None and value_at(slope_of(curve), zero) < 0:
                    if zero < found:
                        found, met, turned = zero, [(j, side, code_after)], False
                    break
    return found, met, turned
