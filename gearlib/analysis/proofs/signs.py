"""Proofs that a motion touches no flank line along an arc; extrema of its displacement.

On each piece of an arc a linear function of the state is a Taylor polynomial whose last coefficient
is a ball that encloses the remainder. Its sign and extrema follow from its values at the ends and
its stationary values.
"""

import math
from collections.abc import Iterator
from itertools import chain
from typing import Any, NamedTuple

from gearlib.analysis.proofs.arc_laws import propagate
from gearlib.analysis.proofs.balls import flint, norm_bound
from gearlib.analysis.proofs.certificate_files import COINCIDENT, ProofFailed
from gearlib.analysis.proofs.models_in_balls import COAST_SIDE, DRIVE_SIDE
from gearlib.engines.codes import COAST, DRIVE, NO_CONTACT

#: Largest number of bisections of a piece, and shortest subinterval relative to the piece: a power
#: of 2, so that positions are exact floats.
_MAX_BISECTIONS, _MIN_SUBINTERVAL = 2000, 2**-48
#: Largest duration of a piece times the norm of the system matrix.
_MAX_PIECE_LENGTH = 1.0
#: Largest radius of a state that is propagated from piece to piece.
_MAX_NARROW_RADIUS = 2.0**-40
JAMMED = "jammed", "both flanks may touch at once: the clearance is not proven to remain open"


class TaylorCurve:
    """A linear function of the state on a piece of an arc: a polynomial with ball coefficients."""

    def __init__(self, coefficients: list, duration: Any, end: Any):
        """Create the polynomial of the time from its `coefficients` in increasing powers.

        The curve is a linear function of the state, such as a flank distance. The time runs from 0
        to `duration`, and `end` is the value there. All are balls (intervals with error bounds).
        """
        self.value = flint().arb_poly(coefficients)
        self.rate = self.value.derivative()
        self.acceleration = self.rate.derivative()
        self.duration = duration
        #: Values at both ends; `end` is narrower than the value of the polynomial.
        self.start, self.end = coefficients[0], end

    def stationary_values(self, sign: int = 0) -> Iterator:
        """Yield balls (intervals) that contain the values of the curve where its rate is zero.

        With `sign` 1 or -1 the caller wants to prove that sign * value is positive. Then values are
        omitted if this is proven for them or if they cannot be the minimum of sign * value.
        """
        arb, bisections = flint().arb, 0
        # Subintervals that may contain stationary values are bisected until they are decided.
        subintervals = [(0.0, 1.0)]  # (start, length) as fractions of the duration
        negligible_radius = arb(2) ** (32 - flint().ctx.prec)
        while subintervals:
            start, length = subintervals.pop()
            interval = self.duration * arb(start + 0.5 * length, 0.5 * length)
            value = self.value(interval)
            if sign * value > 0:
                continue
            rate, acceleration = self.rate(interval), self.acceleration(interval)
            is_monotonic = rate > 0 or rate < 0
            # If sign * value is concave, it has no minimum inside.
            if is_monotonic or sign * acceleration < 0:
                continue
            is_wide = value.rad() > negligible_radius
            if acceleration > 0 or acceleration < 0:
                interval = self._zero_of_rate(interval)
                if interval is not None:
                    yield self._stationary_value(interval)
            elif is_wide and length > _MIN_SUBINTERVAL and bisections < _MAX_BISECTIONS:
                bisections += 1
                subintervals += [(start, 0.5 * length), (start + 0.5 * length, 0.5 * length)]
            else:
                # This short subinterval is undecided, so it counts as a stationary value.
                yield self._stationary_value(interval)

    def _zero_of_rate(self, interval: Any) -> Any:
        """Return a narrow ball that contains the zero of the rate in a time interval, or None.

        `interval` is a ball in which the acceleration is not zero, so that the rate has at most one
        zero. It is narrowed by the interval Newton method; None is returned if there is no zero.
        """
        while True:
            midpoint = interval.mid()
            newton = midpoint - self.rate(midpoint) / self.acceleration(interval)
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
        midpoint = interval.mid()
        # The mean value theorem gives a narrower ball, because the rate is small here.
        mean_value = self.value(midpoint) + self.rate(interval) * (interval - midpoint)
        value = mean_value.intersection(self.value(interval))
        if not interval > 0:
            value = value.union(self.start)
        if not interval < self.duration:
            value = value.union(self.end)
        return value


def taylor_curves(matrix, state, end_state, time: Any, rows: Any) -> Iterator[list[TaylorCurve]]:
    """Yield, for each piece of an arc, the `TaylorCurve`s of several linear functions of the state.

    The functions are the rows of the matrix `rows`, such as flank distances. The arc, a motion
    between two events with state' = matrix state, leads from `state` to `end_state` in the duration
    `time`. It is divided into pieces of equal duration that are short enough for Taylor
    polynomials. States are columns, shape (n, 1); all values are balls (intervals).
    """
    module, matrix_norm = flint(), norm_bound(matrix)
    start = state  # `start` belongs to the arc, `state` to the current piece
    # At this degree the remainder is of the order of rounding errors.
    degree = module.ctx.prec // 4 + 2
    piece_count = max(1, math.ceil(float(matrix_norm * time.mid()) / _MAX_PIECE_LENGTH))
    duration = time / piece_count
    # A wide state is propagated from the start of the arc, because each step would widen it. A
    # narrow state is propagated step by step with a single matrix exponential.
    radius = max(component.rad() for component in state.entries())
    is_wide = piece_count > 1 and radius > _MAX_NARROW_RADIUS
    propagator: Any = None
    if piece_count > 1 and not is_wide:
        propagator = (matrix * duration).exp()
    # Taylor coefficient k of all functions is rows matrix^(k - 1) / k! times the initial rate; the
    # last of these matrices bounds the remainders.
    matrices_by_degree = [rows]
    for k in range(2, degree + 2):
        matrices_by_degree.append(matrices_by_degree[-1] * matrix * (1 / module.arb(k)))
    *rows_by_degree, remainder_rows = (matrix.tolist() for matrix in matrices_by_degree)
    # For each function, the matrix from the initial rate to all coefficients.
    matrices_by_function = [module.arb_mat(list(r)) for r in zip(*rows_by_degree, strict=True)]
    growth = (matrix_norm * duration).exp()
    remainders = [sum(map(abs, row), module.arb(0)) * growth for row in remainder_rows]
    for i in range(1, piece_count + 1):
        first_values, rate = (rows * state).entries(), matrix * state
        max_rate = max(abs(value).upper() for value in rate.entries())
        if i == piece_count:
            state = end_state
        elif is_wide:
            state = propagate(matrix, start, i * duration)
        else:
            state = propagator * state
        last_values = (rows * state).entries()
        curves = []
        for first_value, last_value, rate_matrix, remainder in zip(
            first_values, last_values, matrices_by_function, remainders, strict=True
        ):
            remainder_ball = module.arb(0, (remainder * max_rate).upper())
            coefficients = [first_value, *(rate_matrix * rate).entries(), remainder_ball]
            curves.append(TaylorCurve(coefficients, duration, last_value))
        yield curves


def check_contacts(path: Any, arcs: list, end_states: list, contact_phases: list) -> list:
    """Prove that a motion has the contact events of a `Path` and no others; return their speeds.

    The path consists of arcs between nodes (contact events, switches of the stiffness, the end).
    `arcs` are (initial modal state, duration) of the arcs, `end_states` the modal states at the
    nodes, and `contact_phases` the phases of the contact events, all as balls (intervals). The
    speeds are the rates of the flank distances at the contact events. Raise `ProofFailed` if the
    proof fails.
    """
    dynamics, phases = path.dynamics, path.phases(contact_phases)
    contacts = list(path.contact_states)
    # Flank line (mesh, side) that is crossed at the start and at each node, or None.
    crossed_lines: list = [None]
    for node in path.nodes:
        crossed_lines.append((node.mesh, node.side) if node.is_contact else None)
    for i, (previous_phase, phase) in enumerate(zip([0, *phases], phases, strict=False)):
        if not phase > previous_phase:
            if crossed_lines[i] and crossed_lines[i + 1]:
                text = "contact events coincide or are too close for a proven order"
                raise ProofFailed(COINCIDENT, f"several {text}")
            text = "cannot be separated from a stiffness switch or the start of the orbit"
            raise ProofFailed("switch", f"the contact near phase {float(phase.mid()):.6g} {text}")
    rates = []
    for i, (node, (state, time), end) in enumerate(zip(path.nodes, arcs, end_states, strict=True)):
        phase_at_node = float(phases[i].mid())
        if node.is_contact:
            rate = (node.distance * (node.matrix * end))[0, 0]
            if not node.crosses(rate):
                event = f"the contact event at phase {phase_at_node:.6g}"
                raise ProofFailed("grazing", f"{event} is not proven to be a crossing")
            rates.append(rate)
        crossed_at_ends = crossed_lines[i : i + 2]
        check_arc(dynamics, node.matrix, state, end, time, contacts, crossed_at_ends, phase_at_node)
        if node.is_contact:
            contacts[node.mesh] = node.after
    return rates


def check_arc(dynamics, matrix, state, end_state, time, contacts, crossed, phase) -> None:
    """Prove that no mesh touches a flank line inside an arc, or raise `ProofFailed`.

    An arc is the motion between two events, with the system matrix `matrix`. It leads from the
    modal state `state` to `end_state` in the duration `time`; `contacts` are the contact states of
    all meshes on it. `crossed` are the flank lines, (mesh, side) or None, that are crossed at its
    start and at its end. `phase` is the phase of its end in rad, for the error message.
    """
    conditions = contact_conditions(dynamics, contacts)
    rows = flint().arb_mat([condition.row.entries() for condition in conditions])
    curves_of_pieces = list(taylor_curves(matrix, state, end_state, time, rows))
    for condition, curves in zip(conditions, zip(*curves_of_pieces, strict=True), strict=True):
        # The motion may be on a flank line only at a crossing, at an end of the arc.
        values = [value for curve in curves for value in (curve.start, curve.end)]
        if condition.refers_to(crossed[0]):
            values = values[1:]
        if condition.refers_to(crossed[1]):
            values = values[:-1]
        stationary_values = (curve.stationary_values(condition.sign) for curve in curves)
        if all(condition.sign * value > 0 for value in chain(values, *stationary_values)):
            continue
        name = dynamics.mesh_names[condition.mesh]
        if condition.is_clearance:
            raise ProofFailed(JAMMED[0], f"mesh {name!r}, before phase {phase:.6g}: {JAMMED[1]}")
        subject = f"mesh {name!r}" if len(dynamics.mesh_names) > 1 else "the motion"
        text = "is too close to a flank line to prove that it does not touch"
        raise ProofFailed("grazing", f"before phase {phase:.6g} {subject} {text}")


class ContactCondition(NamedTuple):
    """Condition sign * distance > 0 that a contact state imposes on a flank distance."""

    mesh: int  #: index of the mesh
    sides: tuple  #: sides of the mesh with this flank line, both if there is no backlash
    sign: int  #: 1 or -1
    row: Any  #: row vector: flank distance for a state
    is_clearance: bool  #: whether the other side is in contact, so that the teeth would jam

    def refers_to(self, flank_line: tuple | None) -> bool:
        """Return whether this condition refers to a flank line, (mesh, side) or None."""
        return flank_line is not None and flank_line[0] == self.mesh and flank_line[1] in self.sides


def contact_conditions(dynamics: Any, contacts: list) -> list[ContactCondition]:
    """Return the conditions on the flank distances that the contact states of all meshes impose.

    `contacts` has the contact state of each mesh: 1 drive side, 0 no contact, -1 coast side.
    `dynamics` are the `ArcDynamics`. If the clearance of a mesh in contact varies, a further
    condition is that the flank on the other side does not touch.
    """
    conditions = []
    states = zip(contacts, dynamics.model.meshes, dynamics.distance_rows, strict=True)
    for j, (contact, mesh, rows) in enumerate(states):
        # The flank distance is positive in drive-side contact and negative in coast-side contact.
        for side, side_contact, contact_sign in ((DRIVE_SIDE, DRIVE, 1), (COAST_SIDE, COAST, -1)):
            is_clearance = contact not in (NO_CONTACT, side_contact)
            if rows[side] is None or (is_clearance and not mesh.clearance_varies):
                continue
            # Without backlash both sides have the same flank line.
            sides = (side,) if mesh.has_backlash else (COAST_SIDE, DRIVE_SIDE)
            sign = contact_sign if contact == side_contact else -contact_sign
            conditions.append(ContactCondition(j, sides, sign, rows[side], is_clearance))
    return conditions


def extrema(path: Any, arcs: list, end_states: list) -> tuple:
    """Return (minimum, maximum) of the first coordinate along a `Path` as balls (intervals).

    `arcs` are (initial modal state, duration) of the arcs between its nodes (events); `end_states`
    are the modal states at the nodes.
    """
    # The first row of the basis converts modal components to the first coordinate.
    displacement_row = flint().arb_mat([path.dynamics.basis.tolist()[0]])
    values = []
    for node, (state, time), end in zip(path.nodes, arcs, end_states, strict=True):
        for (curve,) in taylor_curves(node.matrix, state, end, time, displacement_row):
            values += [curve.start, curve.end, *curve.stationary_values()]
    # The minimum lies between the smallest lower bound and the smallest upper bound.
    lower_bounds = [value.lower() for value in values]
    upper_bounds = [value.upper() for value in values]
    return min(lower_bounds).union(min(upper_bounds)), max(upper_bounds).union(max(lower_bounds))
