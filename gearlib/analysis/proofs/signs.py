"""Proofs that a motion touches no flank line along an arc; extrema of its displacement.

On each piece of an arc a functional of the state is a Taylor polynomial. Its last coefficient is a
ball that holds the remainder. Its values where the rate is zero decide its sign and extrema.
"""

import math
from collections.abc import Iterator
from itertools import chain
from typing import Any, NamedTuple

from gearlib.analysis.proofs.arc_laws import propagated
from gearlib.analysis.proofs.balls import flint, norm
from gearlib.analysis.proofs.certificate_files import Uncertain
from gearlib.analysis.proofs.models_in_balls import COAST, DRIVE
from gearlib.engines.codes import INVERSE, NORMAL

#: Largest number of bisections of a piece, and its shortest part, as a share of the piece. Floats
#: represent all shares exactly.
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

    def __init__(self, coefficients: list, duration: Any, end: Any):
        """Set the polynomial by its coefficients, balls, its duration and its value at the end."""
        self.value = flint().arb_poly(coefficients)
        self.rate = self.value.derivative()
        self.acceleration = self.rate.derivative()
        self.duration = duration
        #: Values at both ends: the states know more of the end than the polynomial.
        self.begin, self.end = coefficients[0], end

    def values_at_rest(self, sign: int = 0) -> Iterator:
        """Yield enclosures, balls, of the values at points where the rate is zero.

        Parts of the piece with sign * value > 0 are left out.
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
            # A part where sign * value is concave has no minimum inside.
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

    def _zero_of_rate(self, around: Any) -> Any:
        """Return an enclosure of the zero of the rate within a ball of times, None without zero.

        It is found by the interval Newton method.
        """
        while True:
            middle = around.mid()
            newton = middle - self.rate(middle) / self.acceleration(around)
            if not newton.overlaps(around):
                return None
            narrower = newton.intersection(around)
            if not narrower.rad() < 0.5 * around.rad():
                return narrower
            around = narrower

    def _value_at_rest(self, around: Any) -> Any:
        """Return an enclosure of the value at a zero of the rate within a ball of times."""
        middle = around.mid()
        # The mean value theorem is sharper, because the rate is small here.
        mean = self.value(middle) + self.rate(around) * (around - middle)
        value = mean.intersection(self.value(around))
        # A ball that reaches beyond the piece need not hold a value of it.
        value = value if around > 0 else value.union(self.begin)
        return value if around < self.duration else value.union(self.end)


def pieces(law: Any, state: Any, end: Any, time: Any, rows: Any) -> Iterator[list[Curve]]:
    """Yield, for each piece of an arc, the `Curve`s of r functionals of the state.

    The arc leads from a modal state to the state `end` in a time, by state' = law state. The rows,
    shape (r, size), are the functionals.
    """
    module, size, start = flint(), norm(law), state
    # With this degree the remainder is as small as rounding.
    degree = module.ctx.prec // 4 + 2
    count = max(1, math.ceil(float(size * time.mid()) / _PIECE_LENGTH))
    duration = time / count
    # A wide state is propagated from the start, since each step would widen it. A narrow state is
    # propagated step by step with one exponential.
    is_wide = count > 1 and max(value.rad() for value in state.entries()) > _WIDE_STATE
    step = None if is_wide or count == 1 else (law * duration).exp()
    # Row k of the table of a functional is its derivative k + 1 over (k + 1)!, by the state's rate.
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
            state = propagated(law, start, number * duration) if is_wide else step * state
        curves = []
        for functional in zip(begins, (rows * state).entries(), tables, remainders, strict=True):
            begin, stop, table, remainder = functional
            last = module.arb(0, (remainder * largest).upper())
            curves.append(Curve([begin, *(table * rate).entries(), last], duration, stop))
        yield curves


def check_contacts(path: Any, arcs: list, ends: list, contact_phases: list) -> list:
    """Prove that a motion has the contact events of a path and no others; return their speeds.

    Arcs are (modal start state, duration), ends the modal states at the nodes of the `Path`. Speeds
    are rates of flank distances. `Uncertain` is raised if the proof fails.
    """
    laws, codes, rates, phases = path.laws, list(path.codes), [], path.phases(contact_phases)
    # The flank lines that are crossed at the start and at every node, None for a switch.
    crossed: list = [None]
    for node in path.nodes:
        crossed.append((node.mesh, node.side) if node.phase is None else None)
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


def check_arc(laws, law, state, end, time, codes, crossed, at) -> None:
    """Prove that no mesh touches a flank line within an arc from a modal state to the state `end`.

    The arc has the matrix `law` of the `ArcLaws`, a duration `time` and the contact codes of all
    meshes. `crossed` are the flank lines, (mesh, side) or None, that are crossed at both ends; `at`
    is the phase for the message of `Uncertain`.
    """
    bounds = bounds_of(laws, codes)
    rows = flint().arb_mat([bound.row.entries() for bound in bounds])
    curves_of_pieces = list(pieces(law, state, end, time, rows))
    for bound, curves in zip(bounds, zip(*curves_of_pieces, strict=True), strict=True):
        # At an end of the arc the motion may be on the line, elsewhere on the right side of it.
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

    def is_of(self, crossed: tuple | None) -> bool:
        """Return whether a crossed flank line, (mesh, side) or None, is that of this bound."""
        return crossed is not None and crossed[0] == self.mesh and crossed[1] in self.sides


def bounds_of(laws: Any, codes: list) -> list[Bound]:
    """Return the conditions that keep the contact codes of all meshes, from the `ArcLaws`.

    A varying backlash must also stay open.
    """
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


def extrema(path: Any, arcs: list, ends: list) -> tuple:
    """Return enclosures of the smallest and the largest first coordinate along a `Path`.

    Arcs are (modal start state, duration), ends the modal states at its nodes.
    """
    displacement = flint().arb_mat([path.laws.basis.tolist()[0]])
    values = []
    for node, (state, time), end in zip(path.nodes, arcs, ends, strict=True):
        for (curve,) in pieces(node.law, state, end, time, displacement):
            values += [curve.begin, curve.end, *curve.values_at_rest()]
    return _enclosed_minimum(values), -_enclosed_minimum([-value for value in values])


def _enclosed_minimum(balls: list) -> Any:
    """Return an enclosure of the smallest of the numbers that balls hold."""
    return min(ball.lower() for ball in balls).union(min(ball.upper() for ball in balls))
