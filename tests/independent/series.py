"""The Taylor series of a motion while its contacts stay, and the zeros of polynomials."""

import math
from itertools import pairwise

import mpmath

from tests.independent.equations import sense, stiffness_series, wave


class Step:
    """The Taylor series of a motion from a state at the time t of a `Piece`, with contact codes.

    `middle` is a phase within the step, which decides on stiffness and sliding. `turned`: the last
    step ended where the drive distance has a turn, so that its rate is 0 but for rounding.
    """

    def __init__(self, equations, piece, t, state, codes, middle, turned=False):
        self.equations, self.t, self.codes, self.turned = equations, t, codes, turned
        self.phase, self.rate, self.bend = piece.phase_at(t)
        #: by side the Taylor coefficients of its distance, and of those of constant and waves
        self.curves, self.shifts = {}, {}
        self.middle, self.waves = middle, {}
        n, terms = equations.n, equations.terms
        self.series = [list(state[:n]), list(state[n:])]
        laws = self.laws()
        forces = self.forces(piece)
        for k in range(terms):
            displacements, rates = self.series[k], self.series[k + 1]
            total = forces[k]
            for i, (springs, dampers) in enumerate(equations.rows):
                total[i] -= equations.dot([(x, displacements[j]) for j, x in springs])
                total[i] -= (k + 1) * equations.dot([(x, rates[j]) for j, x in dampers])
            for push, law in laws:
                value = law(k)
                for i, x in push:
                    total[i] -= x * value
            self.series.append([x / ((k + 1) * (k + 2)) for x in total])

    def wave(self, frequency):
        """Return Taylor coefficients of cos and sin of a frequency times the phase."""
        if frequency not in self.waves:
            phase, rate, bend = (frequency * x for x in (self.phase, self.rate, self.bend))
            terms, context = self.equations.terms + 2, self.equations.context
            self.waves[frequency] = wave(context, phase, terms, rate, bend)
        return self.waves[frequency]

    def forces(self, piece):
        """Return Taylor coefficients of the accelerations that do not depend on the state."""
        equations, terms = self.equations, self.equations.terms
        share = piece.load + piece.slope * (self.t - piece.begin)
        factors = [share, piece.slope, *[0] * (terms - 2)]
        total = [[factor * x for x in equations.load] for factor in factors]
        for i, p in enumerate(piece.push):
            total[0][i] += p * piece.acceleration
        # Of motions of supports the second derivatives count.
        for rows, order in ((equations.forces, 0), (equations.shaking, 2)):
            for f, cosines, sines in rows:
                c, s = self.wave(f)
                for k in range(terms):
                    factor = (k + 1) * (k + 2) if order else 1
                    for i, (a, b) in enumerate(zip(cosines, sines, strict=True)):
                        total[k][i] += factor * (a * c[k + order] + b * s[k + order])
        return total

    def coefficient(self, side, k):
        """Return a Taylor coefficient of the distance of a side; those before it are known."""
        if side not in self.curves:
            rows = [(a, b, *self.wave(f)) for f, a, b in side.waves]
            shift = [side.constant, *[0] * (self.equations.terms + 1)]
            for a, b, c, s in rows:
                shift = [x + a * y + b * z for x, y, z in zip(shift, c, s, strict=True)]
            self.curves[side], self.shifts[side] = [], shift
        curve, shift = self.curves[side], self.shifts[side]
        for i in range(len(curve), k + 1):
            values = self.series[i]
            curve.append(shift[i] + self.equations.dot([(x, values[j]) for j, x in side.row]))
        return curve[k]

    def curve(self, side):
        """Return the Taylor coefficients of the distance of a side."""
        self.coefficient(side, self.equations.terms + 1)
        return self.curves[side]

    def stiffness(self, contact, side, terms):
        """Return Taylor coefficients of the stiffness of a side."""
        r, context = contact.rate, self.equations.context
        about = r * self.phase, r * self.middle, terms, r * self.rate, r * self.bend
        return stiffness_series(context, side.course, *about)

    def laws(self):
        """Return (accelerations, function of k that returns the next coefficient of the force)."""
        laws = []
        for contact, code in zip(self.equations.contacts, self.codes, strict=True):
            for side, coefficients in contact.dampers(code):
                if any(coefficients):
                    laws.append((side.push, self.damper(side, coefficients)))
            if code:
                side = contact.side(code)
                push = side.push
                if side.friction:
                    push = side.pushes[sense(contact.rate, side.turns, self.middle)]
                laws.append((push, self.spring(contact, side, code)))
        return laws

    def damper(self, side, coefficients):
        """Return the force of a damper, d1 v + d2 |v| v + d3 v^3.

        It is a function that returns the k-th Taylor coefficient, to be called for k = 0, 1, ...
        """
        d1, d2, d3 = coefficients
        if not (d2 or d3):
            return lambda k: d1 * ((k + 1) * self.coefficient(side, k + 1))
        rates, squares, signs, product = [], [], [], self.equations.product

        def term(k):
            rate = (k + 1) * self.coefficient(side, k + 1)
            rates.append(rate)
            # Where the motion turns its rate is rounding.
            if not signs and rate and not (self.turned and k == 0):
                signs.append(1 if rate > 0 else -1)
            squares.append(product(rates, rates, k))
            total = d1 * rate + d2 * (signs[0] if signs else 1) * squares[k]
            return total + (d3 * product(squares, rates, k) if d3 else 0)

        return term

    def spring(self, contact, side, code):
        """Return the elastic force c(tau) (g + p2 sgn(g) g^2 + p3 g^3), as `damper` does."""
        product, (p2, p3) = self.equations.product, contact.powers
        levels = self.stiffness(contact, side, self.equations.terms + 2)
        squares, springs = [], []
        if side.constant_stiffness and not (p2 or p3):
            return lambda k: levels[0] * self.coefficient(side, k)

        def term(k):
            value = self.coefficient(side, k)
            curve = self.curves[side]
            if p2 or p3:
                squares.append(product(curve, curve, k))
                value += p2 * code * squares[k]
                value += p3 * product(squares, curve, k) if p3 else 0
            springs.append(value)
            return product(levels, springs, k)

        return term

    def elastic(self, contact, code):
        """Return the Taylor coefficients of the elastic force of a contact that touches."""
        law = self.spring(contact, contact.side(code), code)
        return [law(k) for k in range(self.equations.terms + 2)]

    def displacement(self, contact):
        """Return the Taylor coefficients of the displacement of a contact."""
        curve = list(self.curve(contact.drive))
        curve[0] -= contact.zero
        return curve

    def length(self, longest):
        """Return for how long the series holds: the last terms are below the last digit."""
        for last in (-1, -2):
            size = max(map(abs, self.series[last]), default=0)
            if size:
                order = len(self.series) + last
                reach = (self.equations.last_term / mpmath.mpf(size)) ** (mpmath.mpf(1) / order)
                longest = min(longest, self.equations.context.mpf(reach))
        return longest

    def at(self, t):
        """Return the state at t after the begin."""
        columns = list(zip(*self.series, strict=True))
        value = self.equations.value
        return [value(c, t) for c in columns] + [value(slope_of(c), t) for c in columns]


def slope_of(curve):
    return [k * c for k, c in enumerate(curve)][1:]


def _bernstein(scaled):
    """Return the Bernstein coefficients on (0, 1) of a polynomial."""
    degree = len(scaled) - 1
    values = [c / math.comb(degree, k) for k, c in enumerate(scaled)]
    for first in range(1, degree + 1):
        for i in range(degree, first - 1, -1):
            values[i] += values[i - 1]
    return values


def _brackets(values, low, width, least):
    """Yield (low, high) around zeros of odd order, by signs of Bernstein coefficients."""
    changes = sum((a > 0) != (b > 0) for a, b in pairwise(values))
    if changes == 1:
        yield low, low + width
    elif changes and width > least:
        left, right = [], list(values)
        for last in range(len(values) - 1, -1, -1):
            left.append(right[0])
            for i in range(last):
                right[i] = (right[i] + right[i + 1]) / 2
        yield from _brackets(left, low, width / 2, least)
        yield from _brackets(right, low + width / 2, width / 2, least)


def zeros(equations, curve, end, least, floor):
    """Yield the zeros of odd order of a polynomial on (0, end], in order.

    What stays below `floor` is rounding; zeros closer than `least` count as a touch.
    """
    power, scaled = 1, []
    for c in curve:
        scaled.append(c * power)
        power *= end
    first, others = abs(scaled[0]), sum(map(abs, scaled[1:]))
    if first > others or first + others <= floor or not end > least:
        return
    # Floats rule out most of them.
    rough = _bernstein([float(c / (first + others)) for c in scaled])
    if min(rough) > 1e-12 or max(rough) < -1e-12:
        return
    for low, high in _brackets(_bernstein(scaled), 0 * end, 1 + 0 * end, least / end):
        yield _polished(equations, curve, low * end, high * end)


def _polished(equations, curve, low, high):
    """Return the zero between two places by Newton's method kept inside."""
    value_at, slope = equations.value, slope_of(curve)
    first, last = value_at(curve, low), value_at(curve, high)
    # The secant first.
    t = low - first * (high - low) / (last - first) if last != first else low
    rises, close = first <= 0, equations.tiny * 3e-3 * high
    for _ in range(200):
        value = value_at(curve, t)
        if not value:
            break
        low, high = (low, t) if (value > 0) == rises else (t, high)
        rate = value_at(slope, t)
        new = t - value / rate if rate else low
        new = new if low <= new <= high else (low + high) / 2
        if abs(new - t) <= close:
            return new
        t = new
    return t
