"""The Taylor series of a motion while its contacts stay, and the zeros of polynomials."""

import math
from functools import cache
from itertools import accumulate, pairwise, repeat
from operator import add, mul

import mpmath

from tests.independent.equations import sense, stiffness_series, wave_series


class Step:
    """The Taylor series of a motion from a state at the time t of a `Piece`, with contact states.

    `middle` is a phase within the step, which decides on stiffness and sliding. `turned` says that
    the step starts at an extremum of the drive distance, where its rate is 0 up to rounding.
    """

    def __init__(self, equations, piece, t, state, codes, middle, turned=False):
        self.equations, self.t, self.middle, self.turned = equations, t, middle, turned
        self.contacts = list(zip(equations.contacts, codes, strict=True))
        self.phase, self.rate, self.bend = piece.phase_at(t)
        self.wave, dot, n = cache(self.wave), equations.dot, equations.n
        #: Taylor coefficients of coordinates, and of the distances of sides, first of their waves
        self.series = []
        sides = [side for contact in equations.contacts for side in contact.side.values()]
        self.curves = {side: list(self.wave(side.waves)) for side in sides}
        self._add(state[:n])
        self._add(state[n:])
        laws, share = self.laws(piece), piece.load + piece.slope * (t - piece.begin)
        for k, factor in enumerate([share, piece.slope, *[0] * (equations.terms - 2)]):
            (displacements, rates), total = self.series[k:], [factor * x for x in equations.load]
            for i, (springs, dampers) in enumerate(equations.rows):
                total[i] -= dot([(x, displacements[j]) for j, x in springs])
                total[i] -= (k + 1) * dot([(x, rates[j]) for j, x in dampers])
            for push, law in laws:
                value = law(k)
                for i, x in push:
                    total[i] -= x * value
            self._add([x / ((k + 1) * (k + 2)) for x in total])

    def _add(self, coefficients):
        """Append the next Taylor coefficients of the coordinates and of all distances."""
        order = len(self.series)
        for side, curve in self.curves.items():
            products = [(x, coefficients[j]) for j, x in side.row]
            curve[order] += self.equations.dot(products) + (0 if order else side.constant)
        self.series.append(coefficients)

    def wave(self, waves):
        """Return Taylor coefficients of a sum of waves of the phase."""
        context, terms = self.equations.context, self.equations.terms + 2
        return wave_series(context, waves, self.phase, terms, self.rate, self.bend)

    def stiffness(self, contact, side):
        """Return Taylor coefficients of the stiffness of a side."""
        r, context, terms = contact.rate, self.equations.context, self.equations.terms + 2
        about = r * self.phase, r * self.middle, terms, r * self.rate, r * self.bend
        return stiffness_series(context, side.course, *about)

    def laws(self, piece):
        """Return (accelerations by a unit force, function of k) of each force.

        The function returns the Taylor coefficient number k of the force.
        """
        inertia = [-piece.acceleration, *[0] * self.equations.terms]
        laws = [(list(enumerate(piece.push)), inertia.__getitem__)]
        for push, order, waves in self.equations.forces:
            forces = [-math.perm(k, order) * c for k, c in enumerate(self.wave(waves))]
            laws.append((push, forces[order:].__getitem__))
        for contact, code in self.contacts:
            for side, coefficients in contact.dampers(code):
                if any(coefficients):
                    laws.append((side.pushes[0], self.damper(side, *coefficients)))
            if code:
                side = contact.side[code]
                slides = side.has_friction and sense(contact.rate, side.turns, self.middle)
                laws.append((side.pushes[slides], self.spring(contact, code)))
        return laws

    def damper(self, side, d1, d2, d3):
        """Return a function of k with the Taylor coefficients of d1 v + d2 |v| v + d3 v^3.

        It must be called for k = 0, 1, ... in this order.
        """
        curve, times, rates, squares = self.curves[side], self.equations.product, [], []

        def term(k):
            """Return the Taylor coefficient number `k` of the force."""
            rate = (k + 1) * curve[k + 1]
            if not (d2 or d3):
                return d1 * rate
            # At an extremum the rate is rounding, whose sign must not count.
            rates.append(0 * rate if self.turned and k == 0 else rate)
            squares.append(times(rates, rates, k))
            sign = -1 if next(filter(None, rates), 0) < 0 else 1
            return d1 * rate + d2 * sign * squares[k] + d3 * times(squares, rates, k)

        return term

    def spring(self, contact, code):
        """Return a function of k with Taylor coefficients of c(tau) (g + p2 sgn(g) g^2 + p3 g^3).

        g is the distance of the side in contact. Calls must be for k = 0, 1, ... in this order.
        """
        side, times, (p2, p3) = contact.side[code], self.equations.product, contact.powers
        curve, levels, squares, springs = self.curves[side], self.stiffness(contact, side), [], []

        def term(k):
            """Return the Taylor coefficient number `k` of the force."""
            springs.append(curve[k])
            if p2 or p3:
                squares.append(times(curve, curve, k))
                springs[k] += p2 * code * squares[k] + p3 * times(squares, curve, k)
            return levels[0] * springs[k] if side.is_constant else times(levels, springs, k)

        return term

    def elastic(self, contact, code):
        """Return the Taylor coefficients of the elastic force of a contact, in units."""
        if not code:
            return [0 * self.t] * 2
        law, unit = self.spring(contact, code), self.equations.force
        return [law(k) / unit for k in range(self.equations.terms + 2)]

    def displacement(self, contact):
        """Return the Taylor coefficients of the displacement of a contact."""
        first, *others = self.curves[contact.drive]
        return [first - contact.zero, *others]

    def length(self, longest):
        """Return the length of a step, at most `longest`, whose last terms are negligible."""
        for order in (len(self.series) - 1, len(self.series) - 2):
            if size := max(map(abs, self.series[order]), default=0):
                share = self.equations.last_term / mpmath.mpf(size)
                longest = min(longest, self.equations.context.mpf(mpmath.root(share, order)))
        return longest

    def at(self, t):
        """Return the state at the time `t` after the start of the step."""
        value, columns = self.equations.value, list(zip(*self.series, strict=True))
        return [value(c, t) for c in columns] + [value(slope_of(c), t) for c in columns]


def slope_of(curve):
    """Return the coefficients of the derivative of a polynomial."""
    return [k * c for k, c in enumerate(curve)][1:]


def zeros(equations, curve, end, floor):
    """Return the zeros of odd order of a polynomial on (0, end), in rising order.

    A polynomial whose terms add up to at most `floor` is rounding and has none.
    """
    scaled = list(map(mul, curve, accumulate(repeat(end), mul, initial=1)))
    size = sum(map(abs, scaled))
    if size <= floor or 2 * abs(scaled[0]) > size:
        return []
    # Floats are enough to exclude zeros of most polynomials.
    rough = _bernstein([float(c / size) for c in scaled])
    if min(rough) > 1e-12 or max(rough) < -1e-12:
        return []
    marks = _brackets(_bernstein(scaled), 0 * end, 1 + 0 * end, equations.tiny * 1e-3)
    return [_polished(equations, scaled, *ends) * end for ends in marks]


def _bernstein(curve):
    """Return the Bernstein coefficients of a polynomial on (0, 1)."""
    values = [c / math.comb(len(curve) - 1, k) for k, c in enumerate(curve)]
    for k in range(1, len(curve)):
        values[k:] = map(add, values[k:], values[k - 1 :])
    return values


def _brackets(values, low, high, least):
    """Yield an interval (low, high) around each zero of odd order.

    `values` are Bernstein coefficients on the interval, whose sign changes bound the number of
    zeros. Intervals shorter than `least` are not divided further.
    """
    changes = sum((a > 0) != (b > 0) for a, b in pairwise(values))
    if changes == 1:
        yield low, high
    elif changes and high - low > least:
        rows, middle = [values], (low + high) / 2
        while len(rows[-1]) > 1:
            rows.append([(a + b) / 2 for a, b in pairwise(rows[-1])])
        yield from _brackets([row[0] for row in rows], low, middle, least)
        yield from _brackets([row[-1] for row in rows[::-1]], middle, high, least)


def _polished(equations, curve, low, high):
    """Return the zero between two bounds by Newton's method, safeguarded by bisection."""
    slope, rises, t = slope_of(curve), equations.value(curve, low) <= 0, (low + high) / 2
    for _ in range(200):
        value, rate = equations.value(curve, t), equations.value(slope, t)
        low, high = (low, t) if (value > 0) == rises else (t, high)
        new = t - value / rate if rate else low
        new = new if low <= new <= high else (low + high) / 2
        if abs(new - t) <= equations.tiny * 3e-3 * high:
            break
        t = new
    return new
