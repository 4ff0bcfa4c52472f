"""The Taylor series of a motion while its contacts stay, and the zeros of polynomials."""

import math
from functools import cache
from itertools import accumulate, pairwise, repeat
from operator import add, mul

import mpmath

from tests.independent.equations import harmonic_series, sliding_direction, stiffness_series


class Step:
    """The Taylor series of a motion from a state at the time t of a `TimeInterval`.

    `interior_phase`, a phase within the step, selects the stiffness and the sliding direction.
    `starts_at_extremum` is true if the step starts at an extremum of the drive distance, where its
    rate is 0 up to rounding.
    """

    def __init__(
        self,
        equations,
        interval,
        t,
        state,
        contact_states,
        interior_phase,
        starts_at_extremum=False,
    ):
        self.equations, self.t = equations, t
        self.interior_phase, self.starts_at_extremum = interior_phase, starts_at_extremum
        self.contacts = list(zip(equations.contacts, contact_states, strict=True))
        self.phase, self.rate, self.half_acceleration = interval.phase_at(t)
        self.expand_harmonics, dot, n = cache(self.expand_harmonics), equations.dot, equations.n
        #: Taylor coefficients of the coordinates; those of the distances are in `curves`.
        self.series = []
        sides = [side for contact in equations.contacts for side in contact.side.values()]
        self.curves = {side: list(self.expand_harmonics(side.harmonic_terms)) for side in sides}
        self._add(state[:n])
        self._add(state[n:])
        force_terms = self.force_terms(interval)
        load_factor = interval.load + interval.load_slope * (t - interval.begin)
        for k, factor in enumerate(
            [load_factor, interval.load_slope, *[0] * (equations.terms - 2)]
        ):
            (displacements, rates), total = self.series[k:], [factor * x for x in equations.load]
            for i, (springs, dampers) in enumerate(equations.rows):
                total[i] -= dot([(x, displacements[j]) for j, x in springs])
                total[i] -= (k + 1) * dot([(x, rates[j]) for j, x in dampers])
            for accelerations, coefficient_of in force_terms:
                value = coefficient_of(k)
                for i, x in accelerations:
                    total[i] -= x * value
            self._add([x / ((k + 1) * (k + 2)) for x in total])

    def _add(self, coefficients):
        """Append the next Taylor coefficients of the coordinates and of all distances."""
        order = len(self.series)
        for side, curve in self.curves.items():
            products = [(x, coefficients[j]) for j, x in side.row]
            curve[order] += self.equations.dot(products) + (0 if order else side.constant)
        self.series.append(coefficients)

    def expand_harmonics(self, harmonic_terms):
        """Return the Taylor coefficients of a sum of harmonic terms."""
        context, terms = self.equations.context, self.equations.terms + 2
        return harmonic_series(
            context, harmonic_terms, self.phase, terms, self.rate, self.half_acceleration
        )

    def stiffness(self, contact, side):
        """Return Taylor coefficients of the stiffness of a side."""
        r, context, terms = (
            contact.frequency_ratio,
            self.equations.context,
            self.equations.terms + 2,
        )
        arguments = (
            r * self.phase,
            r * self.interior_phase,
            terms,
            r * self.rate,
            r * self.half_acceleration,
        )
        return stiffness_series(context, side.profile, *arguments)

    def force_terms(self, interval):
        """Return (accelerations under a unit force, function of k) for each force.

        The function returns the k-th Taylor coefficient of the force.
        """
        inertia = [-interval.acceleration, *[0] * self.equations.terms]
        force_terms = [(list(enumerate(interval.phase_coupling)), inertia.__getitem__)]
        for accelerations, order, harmonic_terms in self.equations.forces:
            coefficients = enumerate(self.expand_harmonics(harmonic_terms))
            forces = [-math.perm(k, order) * c for k, c in coefficients]
            force_terms.append((accelerations, forces[order:].__getitem__))
        for contact, contact_state in self.contacts:
            for side, coefficients in contact.dampers(contact_state):
                if any(coefficients):
                    force_terms.append(
                        (side.unit_accelerations[0], self.damper(side, *coefficients))
                    )
            if contact_state:
                side = contact.side[contact_state]
                direction = side.has_friction and sliding_direction(
                    contact.frequency_ratio, side.sliding_reversal, self.interior_phase
                )
                accelerations = side.unit_accelerations[direction]
                force_terms.append((accelerations, self.spring(contact, contact_state)))
        return force_terms

    def damper(self, side, d1, d2, d3):
        """Return a function of k with the Taylor coefficients of d1 v + d2 |v| v + d3 v^3.

        It must be called for k = 0, 1, ... in this order.
        """
        curve, times, rates, squares = self.curves[side], self.equations.product, [], []

        def term(k):
            """Return the k-th Taylor coefficient of the force."""
            rate = (k + 1) * curve[k + 1]
            if not (d2 or d3):
                return d1 * rate
            # At an extremum the rate consists of rounding errors, whose sign is ignored.
            rates.append(0 * rate if self.starts_at_extremum and k == 0 else rate)
            squares.append(times(rates, rates, k))
            sign = -1 if next(filter(None, rates), 0) < 0 else 1
            return d1 * rate + d2 * sign * squares[k] + d3 * times(squares, rates, k)

        return term

    def spring(self, contact, contact_state):
        """Return a function of k with Taylor coefficients of c(tau) (g + p2 sgn(g) g^2 + p3 g^3).

        g is the distance of the side in contact. Calls must be for k = 0, 1, ... in this order.
        """
        side, times = contact.side[contact_state], self.equations.product
        p2, p3 = contact.nonlinear_stiffness
        curve, levels, squares, springs = self.curves[side], self.stiffness(contact, side), [], []

        def term(k):
            """Return the k-th Taylor coefficient of the force."""
            springs.append(curve[k])
            if p2 or p3:
                squares.append(times(curve, curve, k))
                springs[k] += p2 * contact_state * squares[k] + p3 * times(squares, curve, k)
            return levels[0] * springs[k] if side.is_constant else times(levels, springs, k)

        return term

    def elastic(self, contact, contact_state):
        """Return the Taylor coefficients of the elastic force of a contact, in units."""
        if not contact_state:
            return [0 * self.t] * 2
        coefficient_of, unit = self.spring(contact, contact_state), self.equations.force
        return [coefficient_of(k) / unit for k in range(self.equations.terms + 2)]

    def displacement(self, contact):
        """Return the Taylor coefficients of the displacement of a contact."""
        first, *others = self.curves[contact.drive]
        return [first - contact.displacement_origin, *others]

    def length(self, max_length):
        """Return the length of a step, at most `max_length`, whose last terms are negligible."""
        for order in (len(self.series) - 1, len(self.series) - 2):
            if size := max(map(abs, self.series[order]), default=0):
                share = self.equations.last_term / mpmath.mpf(size)
                max_length = min(max_length, self.equations.context.mpf(mpmath.root(share, order)))
        return max_length

    def state_at(self, t):
        """Return the state at the time `t` after the start of the step."""
        value, columns = self.equations.value, list(zip(*self.series, strict=True))
        return [value(c, t) for c in columns] + [value(derivative_of(c), t) for c in columns]


def derivative_of(curve):
    """Return the coefficients of the derivative of a polynomial."""
    return [k * c for k, c in enumerate(curve)][1:]


def find_roots(equations, curve, end, floor):
    """Return the roots of odd order of a polynomial on (0, end), in ascending order.

    A polynomial whose terms add up to at most `floor` counts as zero and has no roots.
    """
    scaled = list(map(mul, curve, accumulate(repeat(end), mul, initial=1)))
    size = sum(map(abs, scaled))
    if size <= floor or 2 * abs(scaled[0]) > size:
        return []
    # For most polynomials floats suffice to exclude roots.
    rough = _bernstein_coefficients([float(c / size) for c in scaled])
    if min(rough) > 1e-12 or max(rough) < -1e-12:
        return []
    brackets = _bracket_roots(
        _bernstein_coefficients(scaled), 0 * end, 1 + 0 * end, equations.tolerance * 1e-3
    )
    return [_refine_root(equations, scaled, *bracket) * end for bracket in brackets]


def _bernstein_coefficients(curve):
    """Return the Bernstein coefficients of a polynomial on (0, 1)."""
    values = [c / math.comb(len(curve) - 1, k) for k, c in enumerate(curve)]
    for k in range(1, len(curve)):
        values[k:] = map(add, values[k:], values[k - 1 :])
    return values


def _bracket_roots(values, low, high, least):
    """Yield an interval (low, high) around each zero of odd order.

    `values` are Bernstein coefficients on the interval, whose sign changes bound the number of
    zeros. Intervals shorter than `least` are not divided further.
    """
    changes = sum((a > 0) != (b > 0) for a, b in pairwise(values))
    if changes == 1:
        yield low, high
    elif changes and high - low > least:
        rows, midpoint = [values], (low + high) / 2
        while len(rows[-1]) > 1:
            rows.append([(a + b) / 2 for a, b in pairwise(rows[-1])])
        yield from _bracket_roots([row[0] for row in rows], low, midpoint, least)
        yield from _bracket_roots([row[-1] for row in rows[::-1]], midpoint, high, least)


def _refine_root(equations, curve, low, high):
    """Return the zero between two bounds by Newton's method, safeguarded by bisection."""
    slope, rises, t = derivative_of(curve), equations.value(curve, low) <= 0, (low + high) / 2
    for _ in range(200):
        value, rate = equations.value(curve, t), equations.value(slope, t)
        low, high = (low, t) if (value > 0) == rises else (t, high)
        next_t = t - value / rate if rate else low
        next_t = next_t if low <= next_t <= high else (low + high) / 2
        if abs(next_t - t) <= equations.tolerance * 3e-3 * high:
            break
        t = next_t
    return next_t
