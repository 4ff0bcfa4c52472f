"""The equations of a system in its units, for any number of digits.

The context of the system is one of mpmath: `mpmath.fp` computes in floats, `mpmath.mp` in as many
digits as it is set to.
"""

import math
from bisect import bisect
from functools import reduce
from typing import NamedTuple

import mpmath
import numpy as np


class Piece(NamedTuple):
    """An interval of the time theta in which the speed of the phase and the load are linear."""

    begin: object
    end: object
    phase: object
    speed: object
    acceleration: object = 0
    load: object = 1
    slope: object = 0
    push: object = ()  #: accelerations of coordinates, in units, for one of the phase

    def phase_at(self, t):
        """Return (phase, its rate, half its acceleration) at a time."""
        s, half = t - self.begin, self.acceleration / 2
        return (self.phase + (self.speed + half * s) * s, self.speed + self.acceleration * s, half)


def wave_series(context, waves, phase, terms, rate=1, bend=0):
    """Return Taylor coefficients in t of waves (frequency, cosine, sine) of a phase.

    It is phase + rate t + bend t^2.
    """
    total = [context.mpf(0)] * terms
    for f, a, b in waves:
        last, current = 0, (a - context.j * b) * context.expj(f * phase)
        turn = context.j * f
        for k in range(terms):
            total[k] += current.real
            last, current = current, turn * (rate * current + 2 * bend * last) / (k + 1)
    return total


def stiffness_series(context, course, phase, middle, terms=1, rate=1, bend=0):
    """Return Taylor coefficients in t of a stiffness at phase + rate t + bend t^2.

    `middle`, a phase within the step of the motion, decides which line of the `course` holds.
    """
    period, breaks = 2 * context.pi, course["breaks"]
    phase, middle = (x - period * course["shift"] for x in (phase, middle))
    at = bisect(breaks, middle % period) - 1
    value, slope = course["lines"][at]
    # Since the break: one behind the last one may have begun a period before.
    since = (middle - breaks[at]) % period + (phase - middle)
    line = [value + slope * since, slope * rate, slope * bend, *[0] * terms]
    waves = wave_series(context, course["harmonics"], phase, terms, rate, bend)
    return [a + b for a, b in zip(line, waves, strict=False)]


def sense(rate, turns, phase):
    """Return the direction in which the flanks slide at a phase, 1 or -1."""
    return 1 if (rate * phase / (2 * math.pi) - turns) % 1 < 0.5 else -1


def sparse(row):
    """Return (index, value) of the entries of an array that are not zero."""
    return [(i, x) for i, x in enumerate(row.tolist()) if x]


class Side:
    """A side with the fields of `assembly`; its distance is in units of length.

    `pushes` are accelerations of coordinates by a unit of normal force, without friction, 0, or
    with that while flanks slide in the direction 1 or -1.
    """

    def __init__(self, equations, contact, side):
        length, across = equations.length, side["friction"] * contact["across"]
        self.row = sparse(side["row"])
        self.constant = side["constant"] / length
        self.waves = tuple((f, a / length, b / length) for f, a, b in side["waves"])
        self.course, self.has_friction, self.turns = side["course"], across.any(), side["turns"]
        pushes = {sense: equations.inverse @ (side["row"] + sense * across) for sense in (-1, 0, 1)}
        self.pushes = {sense: sparse(push) for sense, push in pushes.items()}
        self.material = equations.damping(side["material"])
        slopes = [slope for _, slope in self.course["lines"]]
        self.is_constant = not self.course["harmonics"] and not any(slopes)


class Contact:
    """A contact in units, with the fields of `assembly`; `coast` may be None."""

    def __init__(self, equations, contact):
        self.rate = contact["rate"]
        self.zero = contact["zero"] / equations.length
        self.film = equations.damping(contact["film"])
        self.sides = [Side(equations, contact, side) for side in contact["sides"]]
        self.drive, self.coast = (*self.sides, None)[:2]
        #: each side and the code of its contact
        self.touching = list(zip(self.sides, (1, -1), strict=False))
        self.powers = [p * equations.length**k for k, p in enumerate(contact["powers"], start=1)]
        self.has_kink = bool(self.film[1]) or any(side.material[1] for side in self.sides)
        near, far = self.sides[0], self.sides[-1]
        #: whether both sides move alike, and whether there is no backlash
        self.alike = (near.row, near.waves) == (far.row, far.waves)
        self.closed = self.coast is not None and self.alike and near.constant == far.constant

    def side(self, code):
        """Return the side that touches."""
        return (None, self.drive, self.coast)[code]

    def possible_events(self, code):
        """Return (side, sign, next code) of each: where sign times the distance falls through 0."""
        if code:
            return [(self.side(code), code, -code if self.closed else 0)]
        return [(side, -code, code) for side, code in self.touching]

    def dampers(self, code):
        """Return (side, coefficients) of each damper; it takes the rate of the side's distance."""
        side, oil = self.side(code), [(self.drive, self.film)]
        if not code:
            return oil
        if side is self.drive or self.alike:
            return [(side, side.material)]
        # A coast side that moves apart: oil damps the drive distance throughout, contact adds the
        # rest of the material damping.
        return [*oil, (side, [b - a for a, b in zip(self.film, side.material, strict=True)])]

    def cuts(self, context):
        """Return the phases, in periods, at which stiffness or sliding direction change."""
        cuts = set()
        for side in self.sides:
            breaks, shift = side.course["breaks"], side.course["shift"]
            cuts |= {b / (2 * context.pi) + shift for b in breaks if len(breaks) > 1}
            cuts |= {side.turns, side.turns + 0.5} if side.has_friction else set()
        return cuts


class Equations:
    """The equations of a `System` in units of its length, by phase, solved for accelerations.

    Forces and stiffness are in SI units.
    """

    def __init__(self, system):
        self.context, self.n = system.context, system.n
        self.speed, self.length, self.force = system.speed, system.length, system.force
        is_float = self.context is mpmath.fp
        # Floats have 16 digits; more digits need more terms of the series.
        digits = 16.5 if is_float else mpmath.mp.dps
        self.terms = 26 if is_float else int(digits * 0.9) + 6
        #: rounding errors of numbers near 1, and the limit of the last terms of a series
        self.tiny = 1e-13 if is_float else mpmath.mpf(10) ** (5 - digits)
        self.last_term = mpmath.mpf(10) ** -digits
        #: the sum of the products of pairs
        self.dot = _float_dot if is_float else mpmath.fdot
        mass = self.context.matrix(system.mass.tolist())
        self.inverse = np.array((mass**-1).tolist()) / self.speed**2
        springs, dampers = self.inverse @ system.stiffness, self.inverse @ system.damping
        #: for each coordinate (stiffness, damping), sparse rows of accelerations
        self.rows = [
            (sparse(k), sparse(self.speed * c)) for k, c in zip(springs, dampers, strict=True)
        ]
        self.load = (self.inverse @ system.load / self.length).tolist()
        #: rows (accelerations, order of the derivative by time, waves)
        self.forces = [
            (sparse(self.inverse @ row * self.speed**order / self.length), order, tuple(waves))
            for row, order, waves in system.forces
        ]
        self.contacts = [Contact(self, contact) for contact in system.contacts]

    def damping(self, coefficients):
        """Return coefficients for the rate of a distance in units, by phase."""
        speed = self.speed * self.length
        return [d * self.speed * speed**k for k, d in enumerate(coefficients)]

    def product(self, a, b, k):
        """Return the k-th coefficient of the product of two series."""
        return self.dot(zip(a, b[k::-1], strict=False))

    def value(self, curve, t):
        """Return a polynomial at t."""
        return reduce(lambda total, coefficient: total * t + coefficient, reversed(curve))

    def distance(self, side, q, phase, order=0):
        """Return the distance of a side at coordinates, or, of order 1, its rate at their rates."""
        waves = wave_series(self.context, side.waves, phase, terms=2)[order]
        return self.dot([(x, q[i]) for i, x in side.row]) + waves + (0 if order else side.constant)


def _float_dot(pairs):
    return sum([a * b for a, b in pairs])
