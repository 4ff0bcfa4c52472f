"""Mechanical systems with contacts, and their equations of motion in any number of digits.

    M q'' + C q' + K q + sum of contact forces = load + forces

All is in SI units, in the numbers of a context of mpmath: `mpmath.fp` computes in floats,
`mpmath.mp` in as many digits as it is set to. The phase tau runs with the constant `speed`, rad/s;
`length`, m, and `force`, N/m, are units. `forces` have a row (n), and the order of a derivative by
time of waves (frequency, cosine, sine).

A contact has ``rate`` (periods of its stiffness per period of the phase), ``film`` and, on each
side, ``material`` damping (linear, quadratic, cubic), ``powers`` of the elastic force (quadratic,
cubic), ``across`` (n, direction of friction), ``zero`` (distance of displacement zero) and
``sides``: the drive side touches where its distance row . q + constant + waves is positive, the
coast side, if there is one, where its own is negative. A side has ``row``, ``constant``, ``waves``,
``friction``, ``turns`` (periods at which the sliding turns to 1) and ``course``, its stiffness:
``breaks`` in [0, 2 pi), ``lines`` (value, slope) from each on, ``waves``, ``shift`` in periods,
``high``: below it counts as low.
"""

import math
import re
from bisect import bisect
from functools import reduce
from itertools import zip_longest
from typing import NamedTuple

import mpmath
import numpy as np
from mpmath import mp

_HEXADECIMAL = re.compile(r"-?(0x[0-9a-f.]+p[+-]\d+|inf)")


def exact(context, value):
    """Return a description with floats, also of hexadecimal digits, as numbers of a context."""
    if isinstance(value, dict):
        return {key: exact(context, item) for key, item in value.items()}
    if isinstance(value, list):
        return [exact(context, item) for item in value]
    if isinstance(value, str) and _HEXADECIMAL.fullmatch(value):
        value = float.fromhex(value)
    return context.mpf(value) if isinstance(value, (float, mpmath.mpf)) else value


def mean_stiffness(mesh):
    """Return C_s, Eq. (2), of a pair or mesh."""
    kappa = mesh["stiffness_ratio"]
    return mesh["max_stiffness"] * (kappa + (1 - kappa) * (mesh["contact_ratio"] - 1))


def harmonics(wave):
    """Return rows (order, cosine, sine) of described harmonics."""
    rows = zip_longest(wave["cosines"], wave["sines"], fillvalue=0)
    return [(order, *row) for order, row in enumerate(rows, start=1)]


class System:
    """Mass, stiffness and damping matrices, loads and contacts of a model, in SI units.

    Methods add springs, inertias and contacts one by one.
    """

    def __init__(self, context, size):
        self.context, self.n = context, size
        self.mass, self.stiffness, self.damping = (self.zeros(size, size) for _ in range(3))
        self.load, self.contacts, self.forces = self.zeros(size), [], []

    def zeros(self, *shape):
        """Return an array of zeros of the numbers of the context."""
        return np.full(shape, self.context.mpf(0), float if self.context is mpmath.fp else object)

    def unit(self, i):
        """Return the row that selects coordinate `i`."""
        row = self.zeros(self.n)
        row[i] += 1
        return row

    def spring(self, row, stiffness, damping=0):
        """Add a spring and damper that act on the elongation `row @ q`."""
        self.stiffness = self.stiffness + stiffness * np.outer(row, row)
        self.damping = self.damping + damping * np.outer(row, row)

    def inertia(self, row, mass):
        """Add a mass that moves by `row @ q`."""
        self.mass = self.mass + mass * np.outer(row, row)

    def course(self, breaks, lines, waves=(), high=None, shift=0):
        """Return a ``course`` of a stiffness, as the module describes it.

        If `high` is None, a stiffness below the mean counts as low.
        """
        if high is None:
            ends, period = [*breaks[1:], breaks[0] + 2 * self.context.pi], 2 * self.context.pi
            rows = zip(breaks, ends, lines, strict=True)
            high = sum((u - t) * (c + k * (u - t) / 2) for t, u, (c, k) in rows) / period
        return dict(breaks=breaks, lines=lines, waves=waves, high=high, shift=shift)

    def rectangular_course(self, mesh, shift=0):
        """Return the ``course`` of Eq. (1) of the paper, C_max around `shift`, in periods."""
        half, high = self.context.pi * (mesh["contact_ratio"] - 1), mesh["max_stiffness"]
        lines = [(high * mesh["stiffness_ratio"], 0), (high, 0)]
        return self.course([half, 2 * self.context.pi - half], lines, high=high, shift=shift)

    def add_contact(self, sides, film, **fields):
        """Add a contact with its `sides`, damping `film` in free flight and further fields.

        The second of `sides`, the coast side, may be falsy: then there is none.
        """
        defaults = {"constant": 0, "waves": [], "friction": 0, "turns": 0}
        sides = [defaults | side for side in sides if side]
        defaults = {"rate": 1, "powers": (0, 0), "across": self.zeros(self.n), "zero": 0}
        self.contacts.append({"sides": sides, "film": film} | defaults | fields)

    def distance(self, side, q, phase):
        """Return the distance of a side, m, at coordinates `q` and a phase."""
        (waves,) = wave_series(self.context, side["waves"], phase, terms=1)
        return side["row"] @ q + side["constant"] + waves

    def level(self, contact, side, phase):
        """Return the stiffness of a side at a phase of the motion."""
        phase = contact["rate"] * phase
        return stiffness_series(self.context, side["course"], phase, phase)[0]


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
        """Return (phase, its rate, half its acceleration) at the time `t`."""
        s, half = t - self.begin, self.acceleration / 2
        return (self.phase + (self.speed + half * s) * s, self.speed + self.acceleration * s, half)


def wave_series(context, waves, phase, terms, rate=1, bend=0):
    """Return Taylor coefficients in t of a sum of waves (frequency, cosine, sine) of the phase.

    The phase is phase + rate t + bend t^2.
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
    """Return Taylor coefficients in t of a stiffness at the phase phase + rate t + bend t^2.

    `middle`, a phase within the step of the motion, decides which line of the `course` applies.
    """
    period, breaks = 2 * context.pi, course["breaks"]
    phase, middle = (x - period * course["shift"] for x in (phase, middle))
    at = bisect(breaks, middle % period) - 1
    value, slope = course["lines"][at]
    # The line may have begun at a break of the previous period.
    since = (middle - breaks[at]) % period + (phase - middle)
    line = [value + slope * since, slope * rate, slope * bend, *[0] * terms]
    waves = wave_series(context, course["waves"], phase, terms, rate, bend)
    return [a + b for a, b in zip(line, waves, strict=False)]


def sense(rate, turns, phase):
    """Return the direction, 1 or -1, in which the flanks slide at a phase.

    `rate` is the number of mesh periods per period of the phase, and `turns` are the mesh periods
    at which the direction changes to 1.
    """
    return 1 if (rate * phase / (2 * math.pi) - turns) % 1 < 0.5 else -1


def sparse(row):
    """Return (index, value) of each nonzero entry of an array."""
    return [(i, x) for i, x in enumerate(row.tolist()) if x]


class Side:
    """A side of a contact, with its fields in units of length.

    `pushes` are the accelerations of coordinates by a unit normal force, by the direction of
    sliding: 1, -1, or 0 for no friction.
    """

    def __init__(self, equations, contact, side):
        length, across = equations.length, side["friction"] * contact["across"]
        self.row = sparse(side["row"])
        self.constant = side["constant"] / length
        self.waves = tuple((f, a / length, b / length) for f, a, b in side["waves"])
        self.course, self.has_friction, self.turns = side["course"], across.any(), side["turns"]
        breaks, period = self.course["breaks"], 2 * equations.context.pi
        #: phases, in periods, at which stiffness or sliding direction change
        self.cuts = {b / period + self.course["shift"] for b in breaks if len(breaks) > 1}
        self.cuts |= {self.turns, self.turns + 0.5} if self.has_friction else set()
        pushes = {sense: equations.inverse @ (side["row"] + sense * across) for sense in (-1, 0, 1)}
        self.pushes = {sense: sparse(push) for sense, push in pushes.items()}
        self.material = equations.damping(side["material"])
        slopes = [slope for _, slope in self.course["lines"]]
        self.is_constant = not self.course["waves"] and not any(slopes)


class Contact:
    """A contact with its fields in units; `side` maps contact states, 1 and -1, to sides."""

    def __init__(self, equations, contact):
        self.rate = contact["rate"]
        self.zero = contact["zero"] / equations.length
        self.film = equations.damping(contact["film"])
        sides = [Side(equations, contact, side) for side in contact["sides"]]
        self.drive, self.side = sides[0], dict(zip((1, -1), sides, strict=False))
        self.powers = [p * equations.length**k for k, p in enumerate(contact["powers"], start=1)]
        self.has_kink = bool(self.film[1]) or any(side.material[1] for side in sides)
        near, *_, far = sides[0], *sides
        #: whether both sides move alike, and whether there is no backlash
        self.alike = (near.row, near.waves) == (far.row, far.waves)
        self.closed = near is not far and self.alike and near.constant == far.constant

    def possible_events(self, code):
        """Return (side, sign, next code) of each possible event.

        The event occurs where sign times the distance of the side falls through 0.
        """
        if code:
            return [(self.side[code], code, -code if self.closed else 0)]
        return [(side, -code, code) for code, side in self.side.items()]

    def dampers(self, code):
        """Return (side, coefficients) of each damper, which acts on the rate of the distance."""
        side, oil = self.side.get(code), [(self.drive, self.film)]
        if not code:
            return oil
        if side is self.drive or self.alike:
            return [(side, side.material)]
        # If the coast side moves differently, oil damps the drive distance throughout, and contact
        # adds the difference of material and oil damping on the coast side.
        return [*oil, (side, [b - a for a, b in zip(self.film, side.material, strict=True)])]


class Equations:
    """The equations of motion of a `System`, solved for the accelerations.

    Displacements are in units of the system's length, and derivatives are with respect to the
    phase. Forces and stiffness are in SI units.
    """

    def __init__(self, system):
        self.context, self.n = system.context, system.n
        self.speed, self.length, self.force = system.speed, system.length, system.force
        # Series need more terms for more digits than the 16 of floats.
        floats = 16.5, 26, 1e-13, lambda pairs: sum([a * b for a, b in pairs])
        many = mp.dps, int(mp.dps * 0.9) + 6, mp.mpf(10) ** (5 - mp.dps), mp.fdot
        #: terms of series, rounding errors of numbers near 1, and the sum of the products of pairs
        digits, self.terms, self.tiny, self.dot = floats if self.context is mpmath.fp else many
        #: the limit of the last terms of a series
        self.last_term = mp.mpf(10) ** -digits
        mass = self.context.matrix(system.mass.tolist())
        self.inverse = np.array((mass**-1).tolist()) / self.speed**2
        #: for each coordinate (stiffness, damping), sparse rows of accelerations
        matrices = self.inverse @ system.stiffness, self.inverse @ system.damping * self.speed
        self.rows = [tuple(map(sparse, rows)) for rows in zip(*matrices, strict=True)]
        self.load = (self.inverse @ system.load / self.length).tolist()
        #: rows (accelerations, order of the derivative by time, waves)
        self.forces = [
            (sparse(self.inverse @ row * self.speed**order / self.length), order, tuple(waves))
            for row, order, waves in system.forces
        ]
        self.contacts = [Contact(self, contact) for contact in system.contacts]

    def damping(self, coefficients):
        """Return damping coefficients for rates of distances in units of length per phase."""
        speed = self.speed * self.length
        return [d * self.speed * speed**k for k, d in enumerate(coefficients)]

    def product(self, a, b, k):
        """Return the coefficient number `k` of the product of two series."""
        return self.dot(zip(a, b[k::-1], strict=False))

    def value(self, curve, t):
        """Return the value of a polynomial, with rising coefficients `curve`, at `t`."""
        return reduce(lambda total, coefficient: total * t + coefficient, reversed(curve))

    def distance(self, side, q, phase, order=0):
        """Return the distance of a side, or for `order` 1 its rate.

        `q` holds coordinates, or for `order` 1 their rates, without the constant of the distance.
        """
        waves = wave_series(self.context, side.waves, phase, terms=2)[order]
        return self.dot([(x, q[i]) for i, x in side.row]) + waves + (0 if order else side.constant)
