"""Proofs that a motion touches no flank line along an arc; extrema of its displacement.

On each piece of an arc a linear functional of the state is a Taylor polynomial whose last
coefficient is a ball that encloses the remainder. Its sign and extrema follow from its values at
the ends and its stationary values.
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

#: Largest number of bisections of a piece, and length of its shortest part relative to the piece, a
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
        """Create the curve, a polynomial of the time, from its `coefficients` in increasing powers.

        The curve is a linear function of the state, such as a flank distance. The time goes from 0
        to `duration`, and `end` is the value there. All are balls (intervals with error bounds).
        """
        self.value = flint().arb_poly(coefficients)
        self.rate = self.value.derivative()
        self.acceleration = self.rate.derivative()
        self.duration = duration
        #: Values at both ends; the value at the end is narrower than the polynomial gives it.
        self.begin, self.end = coefficients[0], end

    def stationary_values(self, sign: int = 0) -> Iterator:
        """Yield balls (intervals) that contain the values of the curve where its rate is zero.

        With `sign` 1 or -1 the caller wants to prove that sign * value is positive. Then values are
        left out if they are proven to satisfy this, or cannot be the smallest of sign * value.
        """
        arb, bisections = flint().arb, 0
        # Parts of the curve that may have stationary values are bisected until they are decided.
        parts = [(0.0, 1.0)]  # start and length of each part, as fractions of the duration
        negligible_radius = arb(2) ** (32 - flint().ctx.prec)
        while parts:
            low, length = parts.pop()
            interval = self.duration * arb(low + 0.5 * length, 0.5 * length)
            value = self.value(interval)
            if sign * value > 0:
                continue
            rate, acceleration = self.rate(interval), self.acceleration(interval)
            is_monotonic = rate > 0 or rate < 0
            # A part where sign * value is concave has no minimum inside.
            if is_monotonic or sign * acceleration < 0:
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
                # Nothing is decided about this short part, so it counts as a stationary value.
                yield self._stationary_value(interval)

    def _zero_of_rate(self, interval: Any) -> Any:
        """Return a narrow ball that contains the zero of the rate in a time interval, or None.

        `interval` is a ball in which the acceleration is not zero, so that it has at most one zero
        of the rate. It is narrowed by the interval Newton method; None is returned if it has no
        zero.
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
        """Return a ball that contains the value of the curve at a zero of the rate in `interval`.

        `interval` is a ball of the time. If it extends beyond an end of the piece, the result
        includes the value at this end, because the zero may lie outside the piece.
        """
        middle = interval.mid()
        # The mean value theorem gives a narrower ball, because the rate is small here.
        mean_value = self.value(middle) + self.rate(interval) * (interval - middle)
        value = mean_value.intersection(self.value(interval))
        if not interval > 0:
            value = value.union(self.begin)
        if not interval < self.duration:
            value = value.union(self.end)
        return value


def pieces(matrix: Any, state: Any, end: Any, time: Any, rows: Any) -> Iterator[list[Curve]]:
    """Yield for each piece of an arc the `Curve`s of several linear functions of the state.

    The functions are the rows of the matrix `rows`, such as flank distances. The arc, a motion
    between two events with state' = matrix state, goes from `state` to the state `end` in the
    duration `time`. It is divided into pieces of equal duration, which are short enough for Taylor
    polynomials. States are columns, shape (n, 1); all values are balls (intervals).
    """
    module, matrix_norm = flint(), norm(matrix)
    start = state  # of the arc; `state` is the start of each piece
    # With this degree the remainder is of the order of rounding errors.
    degree = module.ctx.prec // 4 + 2
    piece_count = max(1, math.ceil(float(matrix_norm * time.mid()) / _MAX_PIECE_LENGTH))
    duration = time / piece_count
    # A wide state is propagated from the start, because each step would widen it. A narrow state is
    # propagated step by step with a single matrix exponential.
    radius = max(component.rad() for component in state.entries())
    is_wide = piece_count > 1 and radius > _MAX_NARROW_RADIUS
    propagator: Any = None
    if piece_count > 1 and not is_wide:
        propagator = (matrix * duration).exp()
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
        elif is_wide:
            state = propagated(matrix, start, i * duration)
        else:
            state = propagator * state
        last_values = (rows * state).entries()
        curves = []
        for first_value, last_value, maps, remainder in zip(
            first_values, last_values, by_functional, remainders, strict=True
        ):
            remainder_ball = module.arb(0, (remainder * max_rate).upper())
            coefficients = [first_value, *(maps * rate).entries(), remainder_ball]
            curves.append(Curve(coefficients, duration, last_value))
        yield curves


def check_contacts(path: Any, arcs: list, ends: list, contact_phases: list) -> list:
    """Prove that a motion has the contact events of a `Path` and no others; return their speeds.

    The path consists of arcs between nodes (contact events, switches of the stiffness, the end).
    `arcs` are (initial modal state, duration) of the arcs, `ends` the modal states at the nodes,
    and `contact_phases` the phases of the contact events, all as balls (intervals). The speeds are
    the rates of the flank distances at the contact events. Raise `ProofFailed` without a proof.
    """
    dynamics, codes, phases = path.dynamics, list(path.codes), path.phases(contact_phases)
    # Flank lines, (mesh, side), that are crossed at the start and at each node; None at a switch.
    crossed: list = [None]
    for node in path.nodes:
        crossed.append((node.mesh, node.side) if node.is_contact else None)
    for i, (previous_phase, phase) in enumerate(zip([0, *phases], phases, strict=False)):
        if not phase > previous_phase:
            if crossed[i] and crossed[i + 1]:
                text = "several contacts coincide, or are too close to each other for an order"
                raise ProofFailed(COINCIDENT, text)
            text = "cannot be told apart from a switch of the stiffness or the start of the orbit"
            raise ProofFailed("switch", f"near phase {float(phase.mid()):.6g} a contact {text}")
    rates = []
    for i, (node, (state, time), end) in enumerate(zip(path.nodes, arcs, ends, strict=True)):
        phase_at_node = float(phases[i].mid())
        if node.is_contact:
            rate = (node.distance * (node.matrix * end))[0, 0]
            if not node.crosses(rate):
                text = "is not proven to be a crossing"
                raise ProofFailed("grazing", f"the contact at phase {phase_at_node:.6g} {text}")
            rates.append(rate)
        crossed_at_ends = crossed[i : i + 2]
        check_arc(dynamics, node.matrix, state, end, time, codes, crossed_at_ends, phase_at_node)
        if node.is_contact:
            codes[node.mesh] = node.after
    return rates


def check_arc(dynamics, matrix, state, end, time, codes, crossed, phase: float) -> None:
    """Prove that no mesh touches a flank line inside an arc, or raise `ProofFailed`.

    An arc is the motion between two events, with the system matrix `matrix`. It goes from the modal
    state `state` to `end` in the duration `time`; `codes` are the contact codes of all meshes on
    it. `crossed` are the flank lines, (mesh, side) or None, that are crossed at its start and at
    its end. `phase` is the phase of its end in rad, for the error message.
    """
    bounds = contact_bounds(dynamics, codes)
    rows = flint().arb_mat([bound.row.entries() for bound in bounds])
    curves_of_pieces = list(pieces(matrix, state, end, time, rows))
    for bound, curves in zip(bounds, zip(*curves_of_pieces, strict=True), strict=True):
        # The motion may be on the flank line only at a crossing at an end of the arc.
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
    """Condition that a contact code sets for a flank line: sign * distance > 0."""

    mesh: int  #: index of the mesh
    sides: tuple  #: sides of the mesh with this flank line, both if there is no backlash
    sign: int  #: 1 or -1
    row: Any  #: flank distance as a functional of the state
    is_clearance: bool  #: whether the other side is in contact, so that the teeth jam on the line

    def belongs_to(self, flank_line: tuple | None) -> bool:
        """Return whether this bound refers to a flank line, (mesh, side) or None."""
        return flank_line is not None and flank_line[0] == self.mesh and flank_line[1] in self.sides


def contact_bounds(dynamics: Any, codes: list) -> list[Bound]:
    """Return the conditions on the flank distances that the contacts of all meshes require.

    `codes` has a contact code for each mesh: 1 drive side, 0 none, -1 coast side. `dynamics` are
    the `ArcDynamics`. If the clearance of a mesh in contact varies, a further condition is that the
    flank on the other side does not touch.
    """
    bounds = []
    states = zip(codes, dynamics.model.meshes, dynamics.distance_rows, strict=True)
    for j, (code, mesh, rows) in enumerate(states):
        # In contact, the flank distance is positive on the drive and negative on the coast side.
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
    """Return (minimum, maximum) of the first coordinate along a `Path` as balls (intervals).

    `arcs` are (initial modal state, duration) of the arcs between its nodes (events); `ends` are
    the modal states at the nodes.
    """
    # The first row of the basis converts modal components to the first coordinate.
    displacement = flint().arb_mat([path.dynamics.basis.tolist()[0]])
    values = []
    for node, (state, time), end in zip(path.nodes, arcs, ends, strict=True):
        for (curve,) in pieces(node.matrix, state, end, time, displacement):
            values += [curve.begin, curve.end, *curve.stationary_values()]
    # The minimum lies between the smallest lower bound and the smallest upper bound.
    lower, upper = [value.lower() for value in values], [value.upper() for value in values]
    return min(lower).union(min(upper)), max(upper).union(max(lower))
