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
from gearlib.analysis.proofs.certificate_files import COINCIDENT, ProofFailed
from gearlib.analysis.proofs.models_in_balls import COAST_SIDE, DRIVE_SIDE
from gearlib.engines.codes import COAST, DRIVE, NO_CONTACT

#: Largest number of bisections of a piece, and length of the shortest part relative to the piece, a
#: power of 2, so that positions are exact floats.
_MAX_BISECTIONS, _MIN_PART = 2000, 2**-48
#: Largest duration of a piece times the norm of the system matrix.
_MAX_PIECE_LENGTH = 1.0
#: Radius of the balls of a state above which it is propagated from the start of the arc.
_MAX_NARROW_RADIUS = 2.0**-40
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
        """Yield enclosures of the values where the rate is zero, except where sign * value > 0."""
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
        """Return an enclosure of the zero of the rate in an interval, or None (Newton)."""
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
    """Yield, for each piece of an arc with state' = matrix state, the `Curve`s of all rows."""
    module, matrix_norm, start = flint(), norm(matrix), state
    # With this degree the remainder is of the order of rounding errors.
    degree = module.ctx.prec // 4 + 2
    piece_count = max(1, math.ceil(float(matrix_norm * time.mid()) / _MAX_PIECE_LENGTH))
    duration = time / piece_count
    # A wide state is propagated from the start, because each step would widen it. A narrow state is
    # propagated step by step with a single matrix exponential.
    is_wide = piece_count > 1 and max(x.rad() for x in state.entries()) > _MAX_NARROW_RADIUS
    step = None if is_wide or piece_count == 1 else (matrix * duration).exp()
    # Coefficient k of the Taylor polynomials of all functionals is rows matrix^(k - 1) / k! times
    # the initial rate; the last of these matrices bounds the remainders.
    by_degree = [rows]
    for k in range(2, degree + 2):
        by_degree.append(by_degree[-1] * matrix * (1 / module.arb(k)))
    *by_degree, remainder_rows = (map_of_rate.tolist() for map_of_rate in by_degree)
    # For each functional, the matrix from the initial rate to all coefficients.
    by_functional = [module.arb_mat(list(maps)) for maps in zip(*by_degree, strict=True)]
    growth = (matrix_norm * duration).exp()
    remainders = [sum(map(abs, row), module.arb(0)) * growth for row in remainder_rows]
    for i in range(1, piece_count + 1):
        first_values, rate = (rows * state).entries(), matrix * state
        max_rate = max(abs(value).upper() for value in rate.entries())
        if i == piece_count:
            state = end
        else:
            state = propagated(matrix, start, i * duration) if is_wide else step * state
        curves, values = [], zip(first_values, (rows * state).entries(), strict=True)
        for (first, last), maps, remainder in zip(values, by_functional, remainders, strict=True):
            remainder_ball = module.arb(0, (remainder * max_rate).upper())
            coefficients = [first, *(maps * rate).entries(), remainder_ball]
            curves.append(Curve(coefficients, duration, last))
        yield curves


def check_contacts(path: Any, arcs: list, ends: list, contact_phases: list) -> list:
    """Prove that a motion has the contact events of a path and no others; return their speeds.

    `arcs` are (initial modal state, duration), `ends` the modal states at the nodes of the `Path`.
    Speeds are rates of flank distances.
    """
    dynamics, codes, phases = path.dynamics, list(path.codes), path.phases(contact_phases)
    # Flank lines that are crossed at the start and at each node; None at a switch.
    rates = []
    crossed = [None, *((node.mesh, node.side) if node.is_contact else None for node in path.nodes)]
    for i, (last, phase) in enumerate(zip([0, *phases], phases, strict=False)):
        if not phase > last:
            if crossed[i] and crossed[i + 1]:
                text = "several contacts coincide, or are too close to each other for an order"
                raise ProofFailed(COINCIDENT, text)
            text = "cannot be told apart from a switch of the stiffness or the start of the orbit"
            raise ProofFailed("switch", f"near phase {float(phase.mid()):.6g} a contact {text}")
    for i, (node, (state, time), end) in enumerate(zip(path.nodes, arcs, ends, strict=True)):
        at = float(phases[i].mid())
        if node.is_contact:
            rate = (node.distance * (node.matrix * end))[0, 0]
            if not node.crosses(rate):
                text = "is not proven to be a crossing"
                raise ProofFailed("grazing", f"the contact at phase {at:.6g} {text}")
            rates.append(rate)
        check_arc(dynamics, node.matrix, state, end, time, codes, crossed[i : i + 2], at)
        if node.is_contact:
            codes[node.mesh] = node.after
    return rates


def check_arc(dynamics, matrix, state, end, time, codes, crossed, phase: float) -> None:
    """Prove that no mesh touches a flank line inside an arc from a modal state to the state `end`.

    `crossed` are the flank lines, (mesh, side) or None, that are crossed at its two ends.
    """
    bounds = contact_bounds(dynamics, codes)
    rows = flint().arb_mat([bound.row.entries() for bound in bounds])
    curves_of_pieces = list(pieces(matrix, state, end, time, rows))
    for bound, curves in zip(bounds, zip(*curves_of_pieces, strict=True), strict=True):
        # Only at a crossing at an end of the arc may the motion be on the flank line.
        values = [value for curve in curves for value in (curve.begin, curve.end)]
        if bound.belongs_to(crossed[0]):
            values = values[1:]
        if bound.belongs_to(crossed[1]):
            values = values[:-1]
        stationary_values = (curve.stationary_values(bound.sign) for curve in curves)
        if all(bound.sign * value > 0 for value in chain(values, *stationary_values)):
            continue
        name = dynamics.mesh_names[bound.mesh]
        if bound.is_clearance:
            raise ProofFailed(JAMMED[0], f"before phase {phase:.6g} of mesh {name!r} {JAMMED[1]}")
        mover = f"the mesh {name!r}" if len(dynamics.mesh_names) > 1 else "the motion"
        text = "comes too near to a flank line to prove that it does not touch it"
        raise ProofFailed("grazing", f"before phase {phase:.6g} {mover} {text}")


class Bound(NamedTuple):
    """Condition of a contact code for a flank line: sign * distance > 0."""

    mesh: int
    sides: tuple  #: sides of the mesh with this flank line, both without backlash
    sign: int
    row: Any  #: flank distance as a functional of the state
    is_clearance: bool  #: whether the other side is in contact, so that the teeth jam on the line

    def belongs_to(self, flank_line: tuple | None) -> bool:
        """Return whether this bound refers to a flank line, (mesh, side) or None."""
        return flank_line is not None and flank_line[0] == self.mesh and flank_line[1] in self.sides


def contact_bounds(dynamics: Any, codes: list) -> list[Bound]:
    """Return the conditions for the contact codes of all meshes, with those of clearances."""
    bounds = []
    states = zip(codes, dynamics.model.meshes, dynamics.distance_rows, strict=True)
    for j, (code, mesh, rows) in enumerate(states):
        # In contact, the flank distance is positive on the drive side and negative on the other.
        for side, side_code, contact_sign in ((DRIVE_SIDE, DRIVE, 1), (COAST_SIDE, COAST, -1)):
            is_clearance = code not in (NO_CONTACT, side_code)
            if rows[side] is None or (is_clearance and not mesh.clearance_varies):
                continue
            # Without backlash both sides have the same flank line.
            sides = (side,) if mesh.has_backlash else (COAST_SIDE, DRIVE_SIDE)
            sign = contact_sign if code == side_code else -contact_sign
            bounds.append(Bound(j, sides, sign, row=rows[side], is_clearance=is_clearance))
    return bounds


def extrema(path: Any, arcs: list, ends: list) -> tuple:
    """Return enclosures of the smallest and the largest first coordinate along a `Path`."""
    displacement = flint().arb_mat([path.dynamics.basis.tolist()[0]])
    values = []
    for node, (state, time), end in zip(path.nodes, arcs, ends, strict=True):
        for (curve,) in pieces(node.matrix, state, end, time, displacement):
            values += [curve.begin, curve.end, *curve.stationary_values()]
    lower, upper = [value.lower() for value in values], [value.upper() for value in values]
    return min(lower).union(min(upper)), max(upper).union(max(lower))
