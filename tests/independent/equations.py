"""The equations of a system of contacts in its units, for any number of digits.

The system is plain JSON, in SI units; the phase tau runs with the constant `speed`:

    M q'' + C q' + K q + sum of contact forces = load + forces + M (shaking)''

=========================  ===================================================================
``mass`` ...               ``mass``, ``damping``, ``stiffness``: n x n; ``load``: n
``speed``                  rad/s, rate of the phase
``length``, ``force``      units: m of coordinates; N/m, of a force over a length
``forces``, ``shaking``    rows [frequency, cosines (n), sines (n)] over the phase, N and m
``contacts``               see below
=========================  ===================================================================

A contact has ``rate`` (periods of its stiffness per period of the phase), ``film`` and, on each
side, ``material`` damping (linear, quadratic, cubic), ``powers`` of the elastic force (quadratic,
cubic), ``across`` (n, direction of friction), ``zero`` (distance of displacement zero) and
``sides``: the drive side touches where its distance row . q + constant + waves is positive, the
coast side, if there is one, where its own is negative. A side has ``row``, ``constant``, ``waves``
[frequency, cosine, sine], ``friction``, ``turns`` (periods at which the sliding turns to 1) and
``course``, its stiffness: ``breaks`` in [0, 2 pi), ``lines`` [value, slope] from each on,
``harmonics`` [order, cosine, sine], ``shift`` in periods, ``high``: below it counts as low.

Numbers may be texts of many digits. The context is that of mpmath: `mpmath.fp` computes in floats,
`mpmath.mp` in as many digits as it is set to.
"""

import json
import math
from operator import mul
from typing import NamedTuple

import mpmath


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


def wave(context, phase, terms, rate=1, bend=0):
    """Return Taylor coefficients in t of cos and of sin of phase + rate t + bend t^2."""
    c, s = [context.cos(phase)], [context.sin(phase)]
    for k in range(terms - 1):
        down, up = rate * s[k], rate * c[k]
        if k and bend:
            down, up = down + 2 * bend * s[k - 1], up + 2 * bend * c[k - 1]
        c.append(-down / (k + 1))
        s.append(up / (k + 1))
    return c, s


def stiffness_series(context, course, phase, middle, terms=1, rate=1, bend=0):
    """Return Taylor coefficients in t of a stiffness at phase + rate t + bend t^2.

    `middle`, a phase within the step of the motion, decides which line of the `course` holds.
    """
    period, breaks = 2 * context.pi, course["breaks"]
    shift = period * course["shift"]
    phase, middle = phase - shift, middle - shift
    at = max((i for i, b in enumerate(breaks) if b <= middle % period), default=-1)
    value, slope = course["lines"][at]
    # Since the break: one behind the last one may have begun a period before.
    since = (middle - breaks[at]) % period + (phase - middle)
    straight = [value + slope * since, slope * rate, slope * bend]
    series = [*straight, *[context.mpf(0)] * terms][:terms]
    for order, cosine, sine in course["harmonics"]:
        c, s = wave(context, order * phase, terms, order * rate, order * bend)
        series = [a + cosine * b + sine * d for a, b, d in zip(series, c, s, strict=True)]
    return series


def sense(rate, turns, phase):
    """Return the direction in which the flanks slide at a phase, 1 or -1."""
    return 1 if (rate * phase / (2 * math.pi) - turns) % 1 < 0.5 else -1


class Side:
    """A side in units, with the fields of the module's text.

    `push` are the accelerations of coordinates by a unit of normal force, `pushes` those with its
    friction while flanks slide in the direction 1 or -1.
    """

    def __init__(self, equations, contact, values):
        length, sparse = equations.length, equations.sparse
        row = values["row"]
        self.row = sparse(row)
        self.constant = values["constant"] / length
        self.waves = [[f, a / length, b / length] for f, a, b in values["waves"]]
        self.push = equations.accelerations(row)
        self.friction, self.turns = values["friction"], values["turns"]
        if self.friction:
            across = equations.accelerations([x * self.friction for x in contact["across"]])
            self.pushes = {
                direction: sparse(
                    [p + direction * a for p, a in zip(self.push, across, strict=True)]
                )
                for direction in (1, -1)
            }
        self.push = sparse(self.push)
        self.material = equations.damping_units(values["material"])
        course = values["course"]
        self.course = course | {
            "lines": [[x / equations.force for x in line] for line in course["lines"]],
            "harmonics": [
                [n, a / equations.force, b / equations.force] for n, a, b in course["harmonics"]
            ],
            "high": course["high"] / equations.force,
        }
        self.constant_stiffness = not course["harmonics"] and not any(k for _, k in course["lines"])


class Contact:
    """A contact in units, with the fields of the module's text; `coast` may be None."""

    def __init__(self, equations, values):
        self.rate = values["rate"]
        self.zero = values["zero"] / equations.length
        self.film = equations.damping_units(values["film"])
        self.sides = [Side(equations, values, side) for side in values["sides"]]
        self.drive, self.coast = (*self.sides, None)[:2]
        p2, p3 = values["powers"]
        self.powers = p2 * equations.length, p3 * equations.length**2
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
        return [(self.drive, -1, 1), *([(self.coast, 1, -1)] if self.coast else [])]

    def dampers(self, code):
        """Return (side, coefficients) of each damper; it takes the rate of the side's distance."""
        side = self.side(code)
        if code and (code > 0 or self.alike):
            return [(side, side.material)]
        if not code:
            return [(self.drive, self.film)]
        # A coast side that moves apart: oil damps the drive distance throughout, contact adds the
        # rest of the material damping.
        rest = [b - a for a, b in zip(self.film, side.material, strict=True)]
        return [(self.drive, self.film), (side, rest)]

    def cuts(self, context):
        """Return the phases, in periods, at which stiffness or sliding direction change."""
        cuts = []
        for side in self.sides:
            course = side.course
            inner = course["breaks"] if len(course["breaks"]) > 1 else []
            cuts += [b / (2 * context.pi) + course["shift"] for b in inner]
            cuts += [side.turns, side.turns + 0.5] if side.friction else []
        return cuts


def numbers(value, context):
    """Return a system with numbers of a context."""
    if isinstance(value, dict):
        return {key: numbers(item, context) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [numbers(item, context) for item in value]
    return context.mpf(value)


class Equations:
    """The equations of a system in units of its length, by phase, solved for accelerations."""

    def __init__(self, system, context=mpmath.fp):
        system = numbers(json.loads(system), context)
        self.context, self.n = context, len(system["load"])
        self.speed, self.length, self.force = (system[k] for k in ("speed", "length", "force"))
        is_float = context is mpmath.fp
        # Floats have 16 digits; more digits need more terms of the series.
        digits = 16.5 if is_float else mpmath.mp.dps
        self.terms = 26 if is_float else int(digits * 0.9) + 6
        #: rounding errors of numbers near 1, and the limit of the last terms of a series
        self.tiny = 1e-13 if is_float else mpmath.mpf(10) ** (5 - digits)
        self.last_term = mpmath.mpf(10) ** -digits
        self.inverse = self._inverse(system["mass"])
        springs = self._rows(system["stiffness"], self.speed**2)
        #: for each coordinate (stiffness, damping), sparse rows of accelerations
        self.rows = list(zip(springs, self._rows(system["damping"], self.speed), strict=True))
        unit = self.speed**2 * self.length
        self.load = [x / unit for x in self.solved(system["load"])]
        self.forces = [
            (f, *([x / unit for x in self.solved(part)] for part in (a, b)))
            for f, a, b in system["forces"]
        ]
        self.shaking = [
            (f, [x / self.length for x in a], [x / self.length for x in b])
            for f, a, b in system["shaking"]
        ]
        self.contacts = [Contact(self, values) for values in system["contacts"]]

    def _inverse(self, mass):
        if any(x for i, row in enumerate(mass) for j, x in enumerate(row) if i != j):
            inverse = self.context.matrix(mass) ** -1
            return [[(j, x) for j, x in enumerate(row) if x] for row in inverse.tolist()]
        return [[(i, 1 / row[i])] for i, row in enumerate(mass)]

    def sparse(self, row):
        """Return (index, value) of the entries of a row that are not zero."""
        return [(i, x) for i, x in enumerate(row) if x]

    def solved(self, column):
        """Return the inverse mass times a column."""
        return [self.dot([(x, column[j]) for j, x in row]) for row in self.inverse]

    def _rows(self, matrix, unit):
        """Return the sparse rows of the inverse mass times a matrix."""
        columns = [self.solved(column) for column in zip(*matrix, strict=True)]
        return [self.sparse([x / unit for x in row]) for row in zip(*columns, strict=True)]

    def accelerations(self, row):
        """Return the accelerations for a unit of force along a row."""
        return [x * self.force / self.speed**2 for x in self.solved(row)]

    def damping_units(self, coefficients):
        speed = self.speed * self.length
        return [d * self.speed * speed**k / self.force for k, d in enumerate(coefficients)]

    def dot(self, pairs):
        """Return the sum of products."""
        if self.context is mpmath.fp:
            return sum([a * b for a, b in pairs])
        return mpmath.mp.fdot(pairs)

    def product(self, a, b, k):
        """Return the k-th coefficient of the product of two series."""
        if self.context is mpmath.fp:
            return sum(map(mul, a[: k + 1], b[k::-1]))
        return mpmath.mp.fdot(zip(a[: k + 1], b[k::-1], strict=True))

    def value(self, curve, t):
        """Return a polynomial at t."""
        total = curve[-1]
        for coefficient in curve[-2::-1]:
            total = total * t + coefficient
        return total

    def distance(self, side, q, phase):
        """Return the distance of a side at coordinates and a phase."""
        total = side.constant + self.dot([(x, q[i]) for i, x in side.row])
        for f, a, b in side.waves:
            total += a * self.context.cos(f * phase) + b * self.context.sin(f * phase)
        return total

    def rate(self, side, v, phase, speed=1):
        """Return the rate of the distance of a side."""
        total = self.dot([(x, v[i]) for i, x in side.row])
        for f, a, b in side.waves:
            total += speed * f * (b * self.context.cos(f * phase) - a * self.context.sin(f * phase))
        return total

    def on_line(self, side, q, phase):
        return abs(self.distance(side, q, phase)) <= self.tiny
