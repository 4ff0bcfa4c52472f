"""Proofs that a motion touches no flank line along an arc; extrema of its displacement.

On the pieces of an arc a functional of the state is a Taylor polynomial, whose last coefficient is
a ball that holds the remainder. Its values where the rate is zero decide its sign and extrema.
"""

import math
from itertools import chain
from typing import Any, NamedTuple

from gearlib.analysis.proofs.arc_laws import moved
from gearlib.analysis.proofs.balls import flint, norm
from gearlib.analysis.proofs.certificate_files import Uncertain
from gearlib.analysis.proofs.models_in_balls import COAST, DRIVE
from gearlib.engines.codes import INVERSE, NORMAL

#: Largest number of bisections of a piece, and its shortest part, as a share that floats
#: represent exactly.
_MAX_BISECTIONS, _MIN_PART = 2000, 2**-48
#: Largest duration of a piece, relative to one over the norm of the law.
_PIECE_LENGTH = 1.0
#: Radius above which a state counts as wide.
_WIDE_STATE = 2.0**-40
_TOGETHER = (
    "contacts of several meshes coincide, or come too near to each other to tell their order"
)
JAMMED = "jammed", "both flanks may touch at once: it is not proven that the backlash stays open"


class Curve:
    """A functional along a piece of an arc: a polynomial with balls as coefficients."""

    def __init__(self, coefficients, duration, end):
        self.value = flint().arb_poly(coefficients)
        self.rate = self.value.derivative()
        self.acceleration = self.rate.derivative()
        self.duration = duration
        #: Values at both ends: the states know more of the end than the polynomial.
        self.begin, self.end = coefficients[0], end

    def values_at_rest(self, sign=0):
        """Yield enclosures of the values where the rate is zero.

        Parts in which sign * value > 0 is certain are left out.
        """
        arb, parts, bisections = flint().arb, [(0.0, 1.0)], 0
        negligible = arb(2) ** (32 - flint().ctx.prec)
        while parts:
            low, length = parts.pop()
            around = self.duration * arb(low + 0.5 * length, 0.5 * length)
            value = self.value(around)
            if sign * value > 0:
                continue
            rate, acceleration = self.rate(around), self.acceleration(around)
            # Where sign * value is concave it has no least value.
            if rate > 0 or rate < 0 or sign * acceleration < 0:
                continue
            if acceleration > 0 or acceleration < 0:
                around = self._zero_of_rate(around)
                if around is not None:
                    yield self._value_at_rest(around)
            elif value.rad() > negligible and length > _MIN_PART and bisections < _MAX_BISECTIONS:
                bisections += 1
                parts += [(low, 0.5 * length), (low + 0.5 * length, 0.5 * length)]
            else:
                yield self._value_at_rest(around)

    def _zero_of_rate(self, around):
        """Enclose the zero of the rate by the interval Newton method; None if there is no zero."""
        while True:
            middle = around.mid()
            newton = middle - self.rate(middle) / self.acceleration(around)
            if not newton.overlaps(around):
                return None
            narrower = newton.intersection(around)
            if not narrower.rad() < 0.5 * around.rad():
                return narrower
            around = narrower

    def _value_at_rest(self, around):
        """Enclose the value at a zero of the rate within a ball of times."""
        middle = around.mid()
        # The mean value theorem is sharper, because the rate is small here.
        mean = self.value(middle) + self.rate(around) * (around - middle)
        value = mean.intersection(self.value(around))
        # A ball that reaches beyond the piece need not hold a value of it.
        value = value if around > 0 else value.union(self.begin)
        return value if around < self.duration else value.union(self.end)


def pieces(law, state, end, time, rows):
    """Yield the `Curve`s of functionals (r, size) on each piece of an arc up to a state `end`."""
    module, size, start = flint(), norm(law), state
    # The remainder is as small as rounding.
    degree = module.ctx.prec // 4 + 2
    count = max(1, math.ceil(float(size * time.mid()) / _PIECE_LENGTH))
    duration = time / count
    # A wide state would be wrapped anew at every piece; a narrow one needs one exponential.
    is_wide = count > 1 and max(value.rad() for value in state.entries()) > _WIDE_STATE
    step = None if is_wide or count == 1 else (law * duration).exp()
    # Row k of a functional's table: its derivative k + 1 over (k + 1)! by the rate of state.
    orders = [rows]
    for k in range(2, degree + 2):
        orders.append(orders[-1] * law * (1 / module.arb(k)))
    *orders, remainders = (order.tolist() for order in orders)
    tables = [module.arb_mat(list(table)) for table in zip(*orders, strict=True)]
    growth = (size * duration).exp()
    remainders = [sum(map(abs, row), module.arb(0)) * growth for row in remainders]
    for number in range(1, count + 1):
        begins, rate = (rows * state).entries(), law * state
        largest = max(abs(value).upper() for value in rate.entries())
        if number == count:
            state = end
        else:
            state = moved(law, start, number * duration) if is_wide else step * state
        curves = []
        for functional in zip(begins, (rows * state).entries(), tables, remainders, strict=True):
            begin, stop, table, remainder = functional
            last = module.arb(0, (remainder * largest).upper())
            curves.append(Curve([begin, *(table * rate).entries(), last], duration, stop))
        yield curves


def check_contacts(path, arcs, ends, contact_phases):
    """Prove that a path has all contacts and crosses at each; return the rates of distance."""
    laws, codes, rates, phases = path.laws, list(path.codes), [], path.phases(contact_phases)
    # The flank lines crossed at the start and at every node: None for a switch.
    crossed = [None, *((n.mesh, n.side) if n.phase is None else None for n in path.nodes)]
    for i, (last, phase) in enumerate(zip([0, *phases], phases, strict=False)):
        if not phase > last:
            if crossed[i] and crossed[i + 1]:
                raise Uncertain("together", _TOGETHER)
            text = "cannot be told apart from a switch of the stiffness or the start of the orbit"
            raise Uncertain("switch", f"near phase {float(phase.mid()):.6g} a contact {text}")
    for i, (node, (state, time), end) in enumerate(zip(path.nodes, arcs, ends, strict=True)):
        at = float(phases[i].mid())
        if node.phase is None:
            rate = (node.distance * (node.law * end))[0, 0]
            if not node.crosses(rate):
                text = "is not proven to be a crossing"
                raise Uncertain("grazing", f"the contact at phase {at:.6g} {text}")
            rates.append(rate)
        check_arc(laws, node.law, state, end, time, codes, crossed[i : i + 2], at)
        if node.phase is None:
            codes[node.mesh] = node.after
    return rates


def check_arc(laws, law, state, end, time, codes, crossed, at):
    """Prove that no mesh touches a flank line within an arc, from a modal state to `end`.

    `crossed` are (mesh, side) of the flank line that is crossed at either end, None where there is
    none; `at` is the phase that a refusal names.
    """
    bounds = bounds_of(laws, codes)
    rows = flint().arb_mat([bound.row.entries() for bound in bounds])
    curves_of_pieces = list(pieces(law, state, end, time, rows))
    for bound, curves in zip(bounds, zip(*curves_of_pieces, strict=True), strict=True):
        # On the line at an end of the arc, elsewhere on the right side of it.
        values = [value for curve in curves for value in (curve.begin, curve.end)]
        values = values[bound.is_of(crossed[0]) : len(values) - bound.is_of(crossed[1])]
        values_at_rest = (curve.values_at_rest(bound.sign) for curve in curves)
        if all(bound.sign * value > 0 for value in chain(values, *values_at_rest)):
            continue
        name, several = laws.mesh_names[bound.mesh], len(laws.mesh_names) > 1
        if bound.is_overlap:
            raise Uncertain(JAMMED[0], f"before phase {at:.6g} of mesh {name!r} {JAMMED[1]}")
        mover = f"the mesh {name!r}" if several else "the motion"
        text = "comes too near to a flank line to prove that it does not touch it"
        raise Uncertain("grazing", f"before phase {at:.6g} {mover} {text}")


class Bound(NamedTuple):
    """The condition of a contact code on a flank line: sign * distance > 0."""

    mesh: int
    sides: tuple  #: of the mesh whose flank line this is, both without backlash
    sign: int
    row: Any  #: the distance, a functional of the state
    is_overlap: bool  #: whether both flanks touch where the mesh meets the line

    def is_of(self, crossed):
        """Return whether a crossed (mesh, side) belongs to this flank line."""
        return crossed is not None and crossed[0] == self.mesh and crossed[1] in self.sides


def bounds_of(laws, codes):
    """Return the `Bound`s of the contact codes of all meshes; varying backlash must stay open."""
    bounds = []
    states = zip(codes, laws.numbers.meshes, laws.distances, strict=True)
    for j, (code, mesh, rows) in enumerate(states):
        for side, loaded in ((DRIVE, NORMAL), (COAST, INVERSE)):
            is_overlap = bool(code) and code != loaded
            if rows[side] is None or (is_overlap and not mesh.clearance_varies):
                continue
            sides = (side,) if mesh.has_backlash else (COAST, DRIVE)
            sign = loaded if code == loaded else -loaded
            bounds.append(Bound(j, sides, sign, rows[side], is_overlap))
    return bounds


def extrema(path, arcs, ends):
    """Enclose the smallest and the largest value of the first coordinate along a path."""
    displacement = flint().arb_mat([path.laws.basis.tolist()[0]])
    values = []
    for node, (state, time), end in zip(path.nodes, arcs, ends, strict=True):
        for (curve,) in pieces(node.law, state, end, time, displacement):
            values += [curve.begin, curve.end, *curve.values_at_rest()]
    return _least(values), -_least([-value for value in values])


def _least(balls):
    return min(ball.lower() for ball in balls).union(min(ball.upper() for ball in balls))
