"""Proofs that a motion touches no flank line along an arc; extrema of its displacement.

On each piece of an arc a functional of the state is a Taylor polynomial whose last coefficient is a
ball that encloses the remainder. Its sign and extrema follow from its stationary values.
"""

import math
from collections.abc import Iterator
from itertools import chain
from typing import Any, NamedTuple

from gearlib.analysis.proofs.arc_laws import propagated
from gearlib.analysis.proofs.balls import flint, norm
from gearlib.analysis.proofs.certificate_files import ProofFailed
from gearlib.analysis.proofs.models_in_balls import COAST, DRIVE
from gearlib.engines.codes import INVERSE, NORMAL

#: Largest number of bisections of a piece, and length of the shortest part relative to the piece, a
#: power of 2, so that positions are exact floats.
_MAX_BISECTIONS, _MIN_PART = 2000, 2**-48
#: Largest duration of a piece times the norm of the system matrix.
_MAX_PIECE_LENGTH = 1.0
#: Radius of the balls of a state above which it is propagated from the start of the arc.
_MAX_NARROW_RADIUS = 2.0**-40
_TOGETHER = (
    "contacts of several meshes coincide, or come too near to each other to tell their order"
)
JAMMED = "jammed", "both flanks may touch at once: it is not proven that the backlash stays open"


class Curve:
    """A functional of the state along a piece of an arc: a polynomial with ball coefficients."""

    def __init__(self, coefficients: list, duration: Any, end: Any):
        """Set the polynomial from coefficients, duration and value at the end, all in balls."""
        self.value = flint().arb_poly(coefficients)
        self.rate = self.value.derivative()
        self.acceleration = self.rate.derivative()
        self.duration = duration
        #: Values at both ends; that of the end is narrower than the value of the polynomial.
        self.begin, self.end = coefficients[0], end

    def stationary_values(self, sign: int = 0) -> Iterator:
        """Yield enclosures (balls) of the values at points where the rate is zero.

        Parts of the piece with sign * value > 0 are omitted.
        """
        arb, parts, bisections = flint().arb, [(0.0, 1.0)], 0
        negligible_radius = arb(2) ** (32 - flint().ctx.prec)
        while parts:
            low, length = parts.pop()
            interval = self.duration * arb(low + 0.5 * length, 0.5 * length)
            value = self.value(interval)
            if sign * value > 0:
                continue
            rate, acceleration = self.rate(interval), self.acceleration(interval)
            # A part where sign * value is concave has no minimum inside.
            if rate > 0 or rate < 0 or sign * acceleration < 0:
                continue
            is_wide = value.rad() > negligible_radius
            if acceleration > 0 or acceleration < 0:
                interval = self._zero_of_rate(interval)
                if interval is not None:
                    yield self._stationary_value(interval)
            elif is_wide and length > _MIN_PART and bisections < _MAX_BISECTIONS:
                bisections += 1
                parts += [(low, 0.5 * length), (low + 0.5 * length, 0.5 * length)]
            else:
                yield self._stationary_value(interval)

    def _zero_of_rate(self, interval: Any) -> Any:
        """Return an enclosure of the zero of the rate in a time interval, a ball, or None.

        It is found by the interval Newton method.
        """
        while True:
            middle = interval.mid()
            newton = middle - self.rate(middle) / self.acceleration(interval)
            if not newton.overlaps(interval):
                return None
            narrower = newton.intersection(interval)
            if not narrower.rad() < 0.5 * interval.rad():
                return narrower
            interval = narrower

    def _stationary_value(self, interval: Any) -> Any:
        """Return an enclosure of the value at a zero of the rate in a time interval, a ball."""
        middle = interval.mid()
        # The mean value theorem gives a narrower ball, because the rate is small here.
        mean_value = self.value(middle) + self.rate(interval) * (interval - middle)
        value = mean_value.intersection(self.value(interval))
        # The zero may lie outside the piece if the interval extends beyond its ends.
        value = value if interval > 0 else value.union(self.begin)
        return value if interval < self.duration else value.union(self.end)


def pieces(matrix: Any, state: Any, end: Any, time: Any, rows: Any) -> Iterator[list[Curve]]:
    """Yield, for each piece of an arc, the `Curve`s of r functionals of the state.

    The arc leads from a modal state to the state `end` in a time, by state' = matrix state. The
    functionals are the rows of a matrix, shape (r, size).
    """
    module, matrix_norm, start = flint(), norm(matrix), state
    # With this degree the remainder is of the order of rounding errors.
    degree = module.ctx.prec // 4 + 2
    count = max(1, math.ceil(float(matrix_norm * time.mid()) / _MAX_PIECE_LENGTH))
    duration = time / count
    # A wide state is propagated from the start, because each step would widen it. A narrow state is
    # propagated step by step with a single matrix exponential.
    is_wide = count > 1 and max(value.rad() for value in state.entries()) > _MAX_NARROW_RADIUS
    step = None if is_wide or count == 1 else (matrix * duration).exp()
    # A table multiplies the rate to the Taylor coefficients 1, 2, ... of a functional.
    orders = [rows]
    for k in range(2, degree + 2):
        orders.append(orders[-1] * matrix * (1 / module.arb(k)))
    *orders, remainders = (order.tolist() for order in orders)
    tables = [module.arb_mat(list(table)) for table in zip(*orders, strict=True)]
    growth = (matrix_norm * duration).exp()
    remainders = [sum(map(abs, row), module.arb(0)) * growth for row in remainders]
    for i in range(1, count + 1):
        first_values, rate = (rows * state).entries(), matrix * state
        max_rate = max(abs(value).upper() for value in rate.entries())
        if i == count:
            state = end
        else:
            state = propagated(matrix, start, i * duration) if is_wide else step * state
        curves, values = [], zip(first_values, (rows * state).entries(), strict=True)
        for (first, last), table, remainder in zip(values, tables, remainders, strict=True):
            remainder_ball = module.arb(0, (remainder * max_rate).upper())
            coefficients = [first, *(table * rate).entries(), remainder_ball]
            curves.append(Curve(coefficients, duration, last))
        yield curves


def check_contacts(path: Any, arcs: list, ends: list, contact_phases: list) -> list:
    """Prove that a motion has the contact events of a path and no others; return their speeds.

    `arcs` are (initial modal state, duration), `ends` the modal states at the nodes of the `Path`.
    Speeds are rates of flank distances. Raise `ProofFailed` if the proof fails.
    """
    dynamics, codes, phases = path.dynamics, list(path.codes), path.phases(contact_phases)
    # Flank lines that are crossed at the start and at each node; None at a switch.
    rates, crossed = [], [None]
    for node in path.nodes:
        crossed.append((node.mesh, node.side) if node.phase is None else None)
    for i, (last, phase) in enumerate(zip([0, *phases], phases, strict=False)):
        if not phase > last:
            if crossed[i] and crossed[i + 1]:
                raise ProofFailed("together", _TOGETHER)
            text = "cannot be told apart from a switch of the stiffness or the start of the orbit"
            raise ProofFailed("switch", f"near phase {float(phase.mid()):.6g} a contact {text}")
    for i, (node, (state, time), end) in enumerate(zip(path.nodes, arcs, ends, strict=True)):
        at = float(phases[i].mid())
        if node.phase is None:
            rate = (node.distance * (node.matrix * end))[0, 0]
            if not node.crosses(rate):
                text = "is not proven to be a crossing"
                raise ProofFailed("grazing", f"the contact at phase {at:.6g} {text}")
            rates.append(rate)
        check_arc(dynamics, node.matrix, state, end, time, codes, crossed[i : i + 2], at)
        if node.phase is None:
            codes[node.mesh] = node.after
    return rates


def check_arc(dynamics, matrix, state, end, time, codes, crossed, phase: float) -> None:
    """Prove that no mesh touches a flank line inside an arc from a modal state to the state `end`.

    The arc has a system matrix of the `ArcDynamics`, a duration `time` and the contact codes of all
    meshes. `crossed` are the flank lines, (mesh, side) or None, that are crossed at its two ends;
    `phase` is the phase in the message of `ProofFailed`.
    """
    bounds = contact_bounds(dynamics, codes)
    rows = flint().arb_mat([bound.row.entries() for bound in bounds])
    curves_of_pieces = list(pieces(matrix, state, end, time, rows))
    for bound, curves in zip(bounds, zip(*curves_of_pieces, strict=True), strict=True):
        # Only at a crossing at an end of the arc may the motion be on the flank line.
        values = [value for curve in curves for value in (curve.begin, curve.end)]
        values = values[bound.is_of(crossed[0]) : len(values) - bound.is_of(crossed[1])]
        stationary_values = (curve.stationary_values(bound.sign) for curve in curves)
        if all(bound.sign * value > 0 for value in chain(values, *stationary_values)):
            continue
        name, has_several_meshes = dynamics.mesh_names[bound.mesh], len(dynamics.mesh_names) > 1
        if bound.is_overlap:
            raise ProofFailed(JAMMED[0], f"before phase {phase:.6g} of mesh {name!r} {JAMMED[1]}")
        mover = f"the mesh {name!r}" if has_several_meshes else "the motion"
        text = "comes too near to a flank line to prove that it does not touch it"
        raise ProofFailed("grazing", f"before phase {phase:.6g} {mover} {text}")


class Bound(NamedTuple):
    """Condition of a contact code for a flank line: sign * distance > 0."""

    mesh: int
    sides: tuple  #: sides of the mesh with this flank line, both without backlash
    sign: int
    row: Any  #: flank distance as a functional of the state
    is_overlap: bool  #: whether both flanks are in contact on the line

    def is_of(self, crossed: tuple | None) -> bool:
        """Return whether a crossed flank line, (mesh, side) or None, is the one of this bound."""
        return crossed is not None and crossed[0] == self.mesh and crossed[1] in self.sides


def contact_bounds(dynamics: Any, codes: list) -> list[Bound]:
    """Return the conditions for the contact codes of all meshes of the `ArcDynamics`.

    They include that a varying clearance stays open.
    """
    bounds = []
    states = zip(codes, dynamics.model.meshes, dynamics.distances, strict=True)
    for j, (code, mesh, rows) in enumerate(states):
        for side, side_code in ((DRIVE, NORMAL), (COAST, INVERSE)):
            is_overlap = bool(code) and code != side_code
            if rows[side] is None or (is_overlap and not mesh.clearance_varies):
                continue
            sides = (side,) if mesh.has_backlash else (COAST, DRIVE)
            sign = side_code if code == side_code else -side_code
            bounds.append(Bound(j, sides, sign, rows[side], is_overlap))
    return bounds


def extrema(path: Any, arcs: list, ends: list) -> tuple:
    """Return enclosures of the smallest and the largest first coordinate along a `Path`.

    `arcs` are (initial modal state, duration), `ends` the modal states at its nodes.
    """
    displacement = flint().arb_mat([path.dynamics.basis.tolist()[0]])
    values = []
    for node, (state, time), end in zip(path.nodes, arcs, ends, strict=True):
        for (curve,) in pieces(node.matrix, state, end, time, displacement):
            values += [curve.begin, curve.end, *curve.stationary_values()]
    return _enclosed_minimum(values), -_enclosed_minimum([-value for value in values])


def _enclosed_minimum(balls: list) -> Any:
    """Return an enclosure of the smallest of the numbers that are enclosed in balls."""
    return min(ball.lower() for ball in balls).union(min(ball.upper() for ball in balls))
