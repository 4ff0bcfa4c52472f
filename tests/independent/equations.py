"""Mechanical systems with contacts, and their equations of motion in any number of digits.

    M q'' + C q' + K q + sum of contact forces = load + forces

All is in SI units, in the numbers of a context of mpmath: `mpmath.fp` computes in floats,
`mpmath.mp` in as many digits as it is set to. The phase tau runs with the constant `speed`, rad/s;
`length`, m, and `force`, N/m, are units. Each entry of `forces` has a row (n), the order of a time
derivative and harmonic terms (frequency, cosine, sine).

A contact has the fields

- ``frequency_ratio``: periods of its stiffness per period of the phase,
- ``oil_damping``: damping coefficients (linear, quadratic, cubic) in free flight,
- ``nonlinear_stiffness``: coefficients (quadratic, cubic) of the elastic force,
- ``friction_row`` (n): direction in which friction acts,
- ``displacement_origin``: distance at which the displacement is zero,
- ``sides``: the drive side, which touches where its distance row . q + constant + harmonic terms is
  positive, and, if there is one, the coast side, which touches where its distance is negative.

A side has ``row``, ``constant``, ``harmonic_terms``, ``friction``, ``material_damping`` (linear,
quadratic, cubic), ``sliding_reversal`` (mesh periods at which the sliding direction changes to 1)
and ``profile``, its stiffness: ``breakpoints`` in [0, 2 pi), the ``segments`` (value, slope) that
begin there, ``harmonic_terms``, ``shift`` in periods and ``threshold``, below which the stiffness
counts as low.
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

    def profile(self, breakpoints, segments, harmonic_terms=(), threshold=None, shift=0):
        """Return a stiffness ``profile`` with the fields that the module docstring describes.

        `threshold` is the mean stiffness if it is None.
        """
        if threshold is None:
            ends, period = (
                [*breakpoints[1:], breakpoints[0] + 2 * self.context.pi],
                2 * self.context.pi,
            )
            rows = zip(breakpoints, ends, segments, strict=True)
            threshold = sum((u - t) * (c + k * (u - t) / 2) for t, u, (c, k) in rows) / period
        return dict(
            breakpoints=breakpoints,
            segments=segments,
            harmonic_terms=harmonic_terms,
            threshold=threshold,
            shift=shift,
        )

    def rectangular_profile(self, mesh, shift=0):
        """Return the ``profile`` of Eq. (1) of the paper, C_max around `shift`, in periods."""
        half, high = self.context.pi * (mesh["contact_ratio"] - 1), mesh["max_stiffness"]
        segments = [(high * mesh["stiffness_ratio"], 0), (high, 0)]
        return self.profile(
            [half, 2 * self.context.pi - half], segments, threshold=high, shift=shift
        )

    def add_contact(self, sides, oil_damping, **fields):
        """Add a contact with its `sides`, its damping in free flight and further fields.

        A falsy second side means that the contact has no coast side.
        """
        defaults = {"constant": 0, "harmonic_terms": [], "friction": 0, "sliding_reversal": 0}
        sides = [defaults | side for side in sides if side]
        defaults = {
            "frequency_ratio": 1,
            "nonlinear_stiffness": (0, 0),
            "friction_row": self.zeros(self.n),
            "displacement_origin": 0,
        }
        self.contacts.append({"sides": sides, "oil_damping": oil_damping} | defaults | fields)

    def distance(self, side, q, phase):
        """Return the distance of a side, m, at coordinates `q` and a phase."""
        (deviation,) = harmonic_series(self.context, side["harmonic_terms"], phase, terms=1)
        return side["row"] @ q + side["constant"] + deviation

    def level(self, contact, side, phase):
        """Return the stiffness of a side at a phase of the motion."""
        phase = contact["frequency_ratio"] * phase
        return stiffness_series(self.context, side["profile"], phase, phase)[0]


class TimeInterval(NamedTuple):
    """An interval of the time theta in which the speed of the phase and the load are linear."""

    begin: object
    end: object
    phase: object
    speed: object
    acceleration: object = 0
    load: object = 1
    load_slope: object = 0
    phase_coupling: object = ()  #: accelerations of coordinates per unit phase acceleration

    def phase_at(self, t):
        """Return (phase, its rate, half its acceleration) at the time `t`."""
        s, half = t - self.begin, self.acceleration / 2
        return (self.phase + (self.speed + half * s) * s, self.speed + self.acceleration * s, half)


def harmonic_series(context, harmonic_terms, phase, terms, rate=1, half_acceleration=0):
    """Return Taylor coefficients in t of a sum of terms (frequency, cosine, sine) of the phase.

    The phase is phase + rate t + half_acceleration t^2.
    """
    total = [context.mpf(0)] * terms
    for f, a, b in harmonic_terms:
        last, current = 0, (a - context.j * b) * context.expj(f * phase)
        turn = context.j * f
        for k in range(terms):
            total[k] += current.real
            last, current = (
                current,
                turn * (rate * current + 2 * half_acceleration * last) / (k + 1),
            )
    return total


def stiffness_series(context, profile, phase, interior_phase, terms=1, rate=1, half_acceleration=0):
    """Return Taylor coefficients in t of a stiffness.

    The phase is phase + rate t + half_acceleration t^2. `interior_phase`, a phase within the step
    of the motion, selects the segment of the `profile`.
    """
    period, breakpoints = 2 * context.pi, profile["breakpoints"]
    phase, interior_phase = (x - period * profile["shift"] for x in (phase, interior_phase))
    index = bisect(breakpoints, interior_phase % period) - 1
    value, slope = profile["segments"][index]
    # The segment may have begun in the previous period.
    elapsed_phase = (interior_phase - breakpoints[index]) % period + (phase - interior_phase)
    line = [value + slope * elapsed_phase, slope * rate, slope * half_acceleration, *[0] * terms]
    harmonic_coefficients = harmonic_series(
        context, profile["harmonic_terms"], phase, terms, rate, half_acceleration
    )
    return [a + b for a, b in zip(line, harmonic_coefficients, strict=False)]


def sliding_direction(rate, sliding_reversal, phase):
    """Return the direction, 1 or -1, in which the flanks slide at a phase.

    `rate` is the number of mesh periods per period of the phase, and `sliding_reversal` is the
    number of mesh periods after which the direction changes to 1.
    """
    return 1 if (rate * phase / (2 * math.pi) - sliding_reversal) % 1 < 0.5 else -1


def nonzero_entries(row):
    """Return (index, value) of each nonzero entry of an array."""
    return [(i, x) for i, x in enumerate(row.tolist()) if x]


class Side:
    """A side of a contact, with its fields in units of length.

    `unit_accelerations` holds the accelerations of the coordinates under a unit normal force for
    each direction of sliding: 1, -1, or 0 without friction.
    """

    def __init__(self, equations, contact, side):
        length, friction_row = equations.length, side["friction"] * contact["friction_row"]
        self.row = nonzero_entries(side["row"])
        self.constant = side["constant"] / length
        self.harmonic_terms = tuple(
            (f, a / length, b / length) for f, a, b in side["harmonic_terms"]
        )
        self.profile, self.has_friction = side["profile"], friction_row.any()
        self.sliding_reversal = side["sliding_reversal"]
        breakpoints, period = self.profile["breakpoints"], 2 * equations.context.pi
        #: phases, in periods, at which stiffness or sliding direction change
        self.switch_phases = {
            b / period + self.profile["shift"] for b in breakpoints if len(breakpoints) > 1
        }
        if self.has_friction:
            self.switch_phases |= {self.sliding_reversal, self.sliding_reversal + 0.5}
        force_rows = {sense: side["row"] + sense * friction_row for sense in (-1, 0, 1)}
        self.unit_accelerations = {
            sense: nonzero_entries(equations.inverse @ row) for sense, row in force_rows.items()
        }
        self.material_damping = equations.damping(side["material_damping"])
        slopes = [slope for _, slope in self.profile["segments"]]
        self.is_constant = not self.profile["harmonic_terms"] and not any(slopes)


class Contact:
    """A contact with its fields in units; `side` maps contact states, 1 and -1, to sides."""

    def __init__(self, equations, contact):
        self.frequency_ratio = contact["frequency_ratio"]
        self.displacement_origin = contact["displacement_origin"] / equations.length
        self.oil_damping = equations.damping(contact["oil_damping"])
        sides = [Side(equations, contact, side) for side in contact["sides"]]
        self.drive, self.side = sides[0], dict(zip((1, -1), sides, strict=False))
        self.nonlinear_stiffness = [
            p * equations.length**k for k, p in enumerate(contact["nonlinear_stiffness"], start=1)
        ]
        self.has_kink = bool(self.oil_damping[1]) or any(side.material_damping[1] for side in sides)
        drive, *_, coast = sides[0], *sides
        #: whether both sides move alike, and whether there is no backlash
        self.sides_move_alike = (drive.row, drive.harmonic_terms) == (
            coast.row,
            coast.harmonic_terms,
        )
        self.has_zero_backlash = (
            drive is not coast and self.sides_move_alike and drive.constant == coast.constant
        )

    def possible_events(self, contact_state):
        """Return (side, sign, next contact state) of each possible event.

        The event occurs where sign times the distance of the side falls through 0.
        """
        if contact_state:
            return [
                (
                    self.side[contact_state],
                    contact_state,
                    -contact_state if self.has_zero_backlash else 0,
                )
            ]
        return [(side, -contact_state, contact_state) for contact_state, side in self.side.items()]

    def dampers(self, contact_state):
        """Return (side, coefficients) of each damper, which acts on the rate of the distance."""
        side, oil = self.side.get(contact_state), [(self.drive, self.oil_damping)]
        if not contact_state:
            return oil
        if side is self.drive or self.sides_move_alike:
            return [(side, side.material_damping)]
        # If the coast side moves differently, oil damps the drive distance throughout, and contact
        # adds the difference of material and oil damping on the coast side.
        damping = zip(self.oil_damping, side.material_damping, strict=True)
        return [*oil, (side, [material - oil for oil, material in damping])]


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
        digits, self.terms, self.tolerance, self.dot = floats if self.context is mpmath.fp else many
        #: the limit of the last terms of a series
        self.last_term = mp.mpf(10) ** -digits
        mass = self.context.matrix(system.mass.tolist())
        self.inverse = np.array((mass**-1).tolist()) / self.speed**2
        #: for each coordinate (stiffness, damping), sparse rows of accelerations
        matrices = self.inverse @ system.stiffness, self.inverse @ system.damping * self.speed
        self.rows = [tuple(map(nonzero_entries, rows)) for rows in zip(*matrices, strict=True)]
        self.load = (self.inverse @ system.load / self.length).tolist()
        #: rows (accelerations, order of the time derivative, harmonic terms)
        self.forces = [
            (
                nonzero_entries(self.inverse @ row * self.speed**order / self.length),
                order,
                tuple(harmonic_terms),
            )
            for row, order, harmonic_terms in system.forces
        ]
        self.contacts = [Contact(self, contact) for contact in system.contacts]

    def damping(self, coefficients):
        """Return damping coefficients for rates of distances in units of length per phase."""
        speed = self.speed * self.length
        return [d * self.speed * speed**k for k, d in enumerate(coefficients)]

    def product(self, a, b, k):
        """Return coefficient `k` of the product of two power series."""
        return self.dot(zip(a, b[k::-1], strict=False))

    def value(self, curve, t):
        """Return the value of a polynomial, with rising coefficients `curve`, at `t`."""
        return reduce(lambda total, coefficient: total * t + coefficient, reversed(curve))

    def distance(self, side, q, phase, order=0):
        """Return the distance of a side, or its rate if `order` is 1.

        `q` holds the coordinates, or their rates if `order` is 1.
        """
        deviation = harmonic_series(self.context, side.harmonic_terms, phase, terms=2)[order]
        constant = 0 if order else side.constant
        return self.dot([(x, q[i]) for i, x in side.row]) + deviation + constant
