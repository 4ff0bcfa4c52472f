"""Equations of a periodic orbit; the unknowns are its state and the phases of contact events.

A path runs from the mesh phase tau = 0 through nodes: switches of the stiffness at known phases,
and contact events at unknown phases. The unknowns are the state (y, dy/dtheta) at tau = 0, where
theta is tau over the tuning, and the phases of the contact events. The equations are zero flank
distance at each contact event, and periodicity of the state. States on arcs are components in
orthonormal frames (Lohner), so that boxes rotate with the motion. Contact events that are too close
to have a proven order share a time window. The derivative of the state over a window is the
identity plus the saltations in any order, up to a remainder, see `docs/theory/proofs.md`.
"""

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from gearlib.analysis.proofs.arc_laws import propagated
from gearlib.analysis.proofs.balls import column_of, first_column, flint, identity, matrix_of, norm
from gearlib.analysis.proofs.certificate_files import COINCIDENT, ProofFailed
from gearlib.analysis.proofs.models_in_balls import COAST_SIDE, DRIVE_SIDE
from gearlib.analysis.proofs.signs import JAMMED, check_arc, contact_bounds
from gearlib.engines.codes import DRIVE

#: Largest number of arcs of an orbit.
MAX_ARCS = 1000
#: Ratio of the length of a window to the uncertainty of its contact phases, without and with the
#: proof that no flank line is touched between windows.
_WINDOW_RATIO, _PROOF_WINDOW_RATIO = 4, 32
_NO_CROSSINGS = COINCIDENT, "nearly coincident contacts are not proven to be crossings"


class Node(NamedTuple):
    """The end of an arc: a contact event, a switch of the stiffness, or the end of the orbit."""

    matrix: Any  #: system matrix of the arc that ends here
    phase: Any = None  #: a ball; None for a contact event, whose phase is unknown
    mesh: int = -1  #: index of the mesh of a contact event
    side: int = DRIVE_SIDE  #: side of the crossed flank line
    distance: Any = None  #: distance from this line, a functional of modal components
    before: int = 0  #: contact code of the mesh before the event
    after: int = 0  #: contact code after the event

    @property
    def is_contact(self) -> bool:
        """Whether the node is a contact event."""
        return self.phase is None

    def crosses(self, rate: Any) -> bool:
        """Return whether the flank distance changes in the direction of the contact event.

        `rate` is the rate of the flank distance, a ball (interval). The distance must increase if
        the contact code increases (-1 coast side, 0 none, 1 drive side), and else decrease. A ball
        that contains 0 proves neither.
        """
        return rate > 0 if self.after > self.before else rate < 0


class Arc(NamedTuple):
    """An arc with an orthonormal frame at its end: modal components = frame * components in it."""

    time: Any  #: approximate duration of the arc, a ball with radius 0
    transition: Any  #: propagator over this time from the frame of the previous arc to this frame
    matrix: Any  #: system matrix in the frame of this arc
    frame: Any  #: matrix from components in the frame to modal components
    frame_inverse: Any

    def propagated(self, columns: Any, time: Any) -> Any:
        """Propagate state vectors, the columns of a matrix, from the start to the end of the arc.

        An arc is the motion between two events. `columns` are components in the frame (orthonormal
        basis) of the previous arc, and the returned ones are in the frame of this arc. `time`, a
        ball (interval), is near the approximate duration `self.time`.
        """
        return propagated(self.matrix, self.transition * columns, time - self.time)


class Path:
    """Nodes, arcs and equations of a periodic motion."""

    def __init__(self, dynamics, codes, events, period: int, inverse_tuning=None):
        """Create the nodes (events) of a motion and the arcs between them.

        `dynamics` are the `ArcDynamics` of the model, `codes` the contact codes of all meshes at
        tau = 0 (1 drive side, 0 none, -1 coast side). `events` are the sorted contact events (phase
        since tau = 0 in rad, index of the mesh, code before, code after, ...). `period` is the
        duration in mesh periods. `inverse_tuning` is 1 / nu, a ball (interval), by default for the
        tuning nu of the dynamics.
        """
        self.dynamics, self.codes = dynamics, tuple(codes)
        self.inverse_tuning = 1 / dynamics.tuning if inverse_tuning is None else inverse_tuning
        self.nodes: list = []
        #: Indices of the nodes at the ends of periods of the excitation.
        self.period_ends: list = []
        #: Approximate phases of the contact events.
        self.initial_phases: list = []
        self._set_nodes(events, period)
        self.arcs: list = []
        frame, last_phase = identity(dynamics.size), 0
        for node, phase in zip(self.nodes, self.phases(self.initial_phases), strict=True):
            # Phase over tuning is time. The approximate time serves only to choose the frame.
            time = ((phase - last_phase) * self.inverse_tuning).mid()
            columns = (node.matrix * time).exp() * frame
            frame = self._frame(node, columns)
            inverse = frame.inv()
            matrix = inverse * node.matrix * frame
            self.arcs.append(Arc(time, inverse * columns, matrix, frame, inverse))
            last_phase = phase

    def _set_nodes(self, events: list[tuple], period: int) -> None:
        """Create the nodes of the path: switches of the stiffness, contact events and the end.

        `events` are the sorted contact events (phase since tau = 0 in rad, index of the mesh, code
        before, code after, ...), where codes are 1 drive side, 0 no contact, -1 coast side.
        `period` is the period of the motion in mesh periods.
        """
        arb, dynamics, codes = flint().arb, self.dynamics, list(self.codes)
        mesh_period = 2 * arb.pi()
        # Entries are (phase, index of the segment that starts or None, contact or None). A segment
        # is an interval of constant stiffness in the period of the excitation.
        entries: list = []
        for start in range(0, period, dynamics.excitation_period):
            for index, segment in enumerate(dynamics.model.segments):
                entries.append((segment.phase + mesh_period * start, index, None))
        entries += [(arb(phase), None, contact[:3]) for phase, *contact in events]
        if len(entries) >= MAX_ARCS:
            text = f"{len(entries)} arcs are too many: {MAX_ARCS} are allowed"
            raise ProofFailed(COINCIDENT, text)  # too many arcs have no status of their own
        # The sort is stable for events with equal phases as floats.
        entries.sort(key=lambda entry: float(entry[0].mid()))
        segment_index = 0
        # Each node has the system matrix of the arc that ends there.
        for phase, next_index, contact in entries:
            matrix = dynamics.system_matrix(codes, segment_index)
            if contact is None:
                segment_index = next_index
                # The first segment starts at phase 0, where no arc ends.
                if phase > 0:
                    if next_index == 0:
                        self.period_ends.append(len(self.nodes))
                    self.nodes.append(Node(matrix, phase))
                continue
            mesh, before, after = contact
            if before != codes[mesh]:
                raise ProofFailed("contacts", "the contacts do not follow from each other")
            side = DRIVE_SIDE if DRIVE in (before, after) else COAST_SIDE
            self.initial_phases.append(phase)
            distance = dynamics.distance_rows[mesh][side]
            self.nodes.append(Node(matrix, None, mesh, side, distance, before, after))
            codes[mesh] = after
        matrix = dynamics.system_matrix(codes, segment_index)
        self.nodes.append(Node(matrix, mesh_period * period))

    def _frame(self, node: Node, columns: Any) -> Any:
        """Return the frame at a node, an orthonormal basis (size, size), by QR decomposition.

        `columns` are the modal components of the previous frame after propagation to this `node`.
        The frame follows their directions, so that boxes around a state grow little.
        """
        n, frame = self.dynamics.state_count, np.eye(self.dynamics.size)
        axes = np.array([[float(value) for value in row[:n]] for row in columns.tolist()[:n]])
        # The longest direction comes first, because it determines the orientation of the box.
        axes = axes[:, np.argsort(-np.linalg.norm(axes, axis=0), kind="stable")]
        if node.is_contact:
            # The normal of the flank line comes first: it is fixed at the contact event.
            normal = [float(value) for value in node.distance.entries()[:n]]
            axes = np.column_stack([normal, axes])
        frame[:n, :n], _ = np.linalg.qr(axes)
        return matrix_of(frame)

    def phases(self, contact_phases: list) -> list:
        """Return the phases of all nodes, given the sorted phases of the contact events.

        The other nodes, switches of the stiffness and the end of the orbit, have known phases.
        """
        phases = []
        remaining_phases = iter(contact_phases)
        for node in self.nodes:
            phases.append(next(remaining_phases) if node.is_contact else node.phase)
        return phases

    def start(self, state: list, unknown_count: int) -> Any:
        """Return the initial state and its derivatives by the unknowns as columns of a matrix.

        They are modal components, shape (size, 1 + unknown_count). `state` is (y, dy/dtheta) at tau
        = 0, where y are displacements and theta is the mesh phase tau over the tuning. Its entries
        are the first unknowns, so their derivatives are columns of the identity matrix.
        """
        # At tau = 0 the cosine of each harmonic is 1 and its sine is 0.
        cosines_and_sines = [1, 0] * len(self.dynamics.harmonic_columns)
        columns = flint().arb_mat(self.dynamics.size, 1 + unknown_count)
        for i, value in enumerate([*state, 1, *cosines_and_sines]):
            columns[i, 0] = value
        for i in range(len(state)):
            columns[i, 1 + i] = 1
        return self.dynamics.basis_inverse * columns

    def equations(self, unknowns: list) -> tuple[list, list, list, list]:
        """Return (residuals, rows of their derivatives, arcs, end states) of the orbit equations.

        The unknowns are (y, dy/dtheta) at tau = 0, where y are displacements and theta is the mesh
        phase tau over the tuning, and the phases of the contact events, all as balls (intervals).
        The residuals are the flank distances at the contact events, and the change of (y,
        dy/dtheta) over the period. `arcs` are (initial modal state, duration) between successive
        nodes (events or switches of stiffness), and end states are the modal states at all nodes.
        """
        dynamics, inverse_tuning, n = self.dynamics, self.inverse_tuning, self.dynamics.state_count
        # The columns are the state and its derivatives by the unknowns.
        columns = self.start(unknowns[:n], len(unknowns))
        state = first_column(columns)
        residuals, rows, arcs, ends = [], [], [], []
        last_phase, phase_column = 0, n
        phases = self.phases(unknowns[n:])
        for i, (node, phase, arc) in enumerate(zip(self.nodes, phases, self.arcs, strict=True)):
            time = (phase - last_phase) * inverse_tuning
            arcs.append((state, time))
            columns = arc.propagated(columns, time)
            if node.is_contact:
                phase_column += 1
                # Row whose product with a rate adds it to the derivative by the phase of the event.
                phase_row = flint().arb_mat(1, len(unknowns) + 1)
                phase_row[0, phase_column] = 1
                columns += arc.matrix * first_column(columns) * inverse_tuning * phase_row
                distance_row = node.distance * arc.frame
                residual, *slopes = (distance_row * columns).entries()
                residuals.append(residual)
                rows.append(slopes)
                # Project the columns onto the flank line along the first axis of the frame.
                projection, coefficients = identity(dynamics.size), distance_row.entries()
                projection[0, 0] = 0
                for k in range(1, dynamics.size):
                    projection[0, k] = -coefficients[k] / coefficients[0]
                columns = projection * columns
            state = arc.frame * first_column(columns)
            if node.is_contact:
                # The next arc is shorter if the contact event is later.
                state_rate = self.nodes[i + 1].matrix * state * inverse_tuning
                columns -= arc.frame_inverse * state_rate * phase_row
            ends.append(state)
            last_phase = phase
        for i, row in enumerate((dynamics.basis * arc.frame * columns).tolist()[:n]):
            residuals.append(row[0] - unknowns[i])
            row[i + 1] -= 1
            rows.append(row[1:])
        return residuals, rows, arcs, ends

    def monodromy(self, rows: list) -> Any:
        """Return the monodromy matrix of (y, dy/dtheta) from the derivatives in `rows`.

        It maps a change of the state at tau = 0 to its change after the period. `rows` are the rows
        of the derivatives from `equations`: first the equations of the contact events, then those
        of periodicity. The phases of the contact events, which depend on the state, are eliminated.
        """
        arb_mat, n = flint().arb_mat, self.dynamics.state_count
        k = len(rows) - n  # number of contact events
        # The equations of periodicity are final minus initial state, so the identity is added.
        state_block = arb_mat([row[:n] for row in rows[k:]]) + identity(n)
        if not k:
            return state_block
        phase_block = arb_mat([row[n:] for row in rows[:k]])
        try:
            phase_slopes = phase_block.solve(arb_mat([row[:n] for row in rows[:k]]))
        except ZeroDivisionError:
            raise ProofFailed("grazing", "a contact is not proven to be a crossing") from None
        return state_block - arb_mat([row[n:] for row in rows[k:]]) * phase_slopes

    def determinant(self, arcs: list[tuple]) -> Any:
        """Return the determinant of the monodromy matrix by Liouville's formula.

        It is the exponential of the integral of the trace of the system matrix. `arcs` are (initial
        modal state, duration) between successive nodes, as `equations` returns them.
        """
        exponent = flint().arb(0)
        for node, (_, duration) in zip(self.nodes, arcs, strict=True):
            exponent += node.matrix.trace() * duration
        return exponent.exp()


def smallest_interval() -> Any:
    """Return the phase interval, a ball, below which successive contact events share a window."""
    return flint().arb(2) ** -(flint().ctx.prec // 2)


class Windows:
    """A `Path` with windows: time intervals around contact events without a proven order."""

    def __init__(self, path: Path, contact_phases: list):
        """Group the nodes of a `Path`: contact events without a proven order share a time window.

        Nodes are contact events, switches of the stiffness and the end of the orbit.
        `contact_phases` are the sorted phases of the contact events, as balls (intervals).
        """
        self.path, self.dynamics = path, path.dynamics
        #: (indices of the nodes in the same window, phase)
        self.groups: list = []
        last_contact = None  # phase of the previous node if it is a contact event
        phases = path.phases(contact_phases)
        for i, (node, phase) in enumerate(zip(path.nodes, phases, strict=True)):
            follows_contact = node.is_contact and last_contact is not None
            if follows_contact and phase - last_contact < smallest_interval():
                self.groups[-1][0].append(i)
            else:
                self.groups.append(([i], phase))
            last_contact = phase if node.is_contact else None

    def are_needed(self) -> bool:
        """Return whether any window contains several contact events."""
        return any(len(indices) > 1 for indices, _ in self.groups)

    def equations(self, unknowns: list) -> tuple[list, list]:
        """Return (residuals, rows of their derivatives) of the periodicity of (y, dy/dtheta).

        The unknowns are the displacements y and rates dy/dtheta at tau = 0 (theta is the mesh phase
        tau over the tuning), a list of balls (intervals). Residuals are their changes over the
        period.
        """
        ends, rows, *_ = self.propagate(unknowns)
        # Subtract the derivative of the initial state, the identity matrix.
        for i, row in enumerate(rows):
            row[i] -= 1
        return [end - value for end, value in zip(ends, unknowns, strict=True)], rows

    def propagate(self, unknowns: list, check_arcs: bool = False) -> tuple:
        """Return (final state, rows of its derivatives, phases, speeds, states at switches).

        The unknowns are (y, dy/dtheta) at tau = 0 as balls (intervals). Phases and speeds (rates of
        flank distances) belong to the contact events; a phase contains its whole time window.
        States at switches of the stiffness are a dict by index of the node. `check_arcs` adds the
        proof that no mesh touches a flank line between windows.
        """
        module, dynamics, path = flint(), self.dynamics, self.path
        n, codes = len(unknowns), list(path.codes)
        columns = path.start(unknowns, n)  # the state, then its derivatives by the unknowns
        start, time = first_column(columns), 0  # at the end of the last window or switch
        phases, speeds, switch_states = [], [], {}
        ratio = _PROOF_WINDOW_RATIO if check_arcs else _WINDOW_RATIO
        for indices, phase in self.groups:
            node, arc = path.nodes[indices[0]], path.arcs[indices[0]]
            end, half_length = phase * path.inverse_tuning, 0
            if node.is_contact:
                state_at_node = arc.frame * arc.propagated(first_column(columns), end - time)
                half_length = self._half_length(indices, state_at_node, ratio)
            duration = end - half_length - time
            if not duration > 0:
                text = "nearly coincident contacts cannot be told apart from others, a switch of a "
                raise ProofFailed(COINCIDENT, text + "stiffness or the start of the orbit")
            columns = arc.propagated(columns, duration)
            before = arc.frame * first_column(columns)
            if check_arcs:
                # No flank line is crossed at the ends, because crossings lie in windows.
                arc_ends = start, before, duration, codes, (None, None)
                check_arc(dynamics, node.matrix, *arc_ends, phase=float(phase.mid()))
            time = end + half_length
            if not node.is_contact:
                start = switch_states[indices[0]] = before
                continue
            transition, start, rates = self._pass_window(indices, before, 2 * half_length, codes)
            speeds += rates
            window = module.arb(end.mid(), (half_length + end.rad()).upper())
            phases += [window / path.inverse_tuning] * len(rates)
            inverse = path.arcs[indices[-1]].frame_inverse
            propagated_rows = (inverse * (transition * (arc.frame * columns))).tolist()
            # The linearised map holds for the derivatives only; the state is enclosed by `start`.
            state = (inverse * start).entries()
            entries = zip(state, propagated_rows, strict=True)
            columns = module.arb_mat([[value, *row[1:]] for value, row in entries])
        rows = (dynamics.basis * arc.frame * columns).tolist()[:n]
        return [row[0] for row in rows], [row[1:] for row in rows], phases, speeds, switch_states

    def _half_length(self, indices: list[int], state: Any, ratio: int) -> Any:
        """Return half the duration of a window, `ratio` times the uncertainty of its contact times.

        A window is a time interval around nearly coincident contact events. It contains the nodes
        with the given `indices`, and `state` is a modal state near them, in balls (intervals). The
        uncertainty of a contact time is the flank distance over its rate.
        """
        half_length = flint().arb(2) ** -(0.7 * flint().ctx.prec)
        for i in indices:
            node = self.path.nodes[i]
            distance = (node.distance * state)[0, 0]
            rate = (node.distance * (node.matrix * state))[0, 0]
            # A rate that may be zero allows a grazing instead of a crossing.
            if not (rate > 0 or rate < 0):
                raise ProofFailed(*_NO_CROSSINGS)
            bound = ratio * abs(distance).upper() / abs(rate).lower()
            half_length = max(half_length, bound.upper())
        return half_length

    def _pass_window(self, indices: list[int], state: Any, length: Any, codes: list) -> tuple:
        """Return (linearised map over a window, final state, speeds of the crossings).

        A window is a time interval around nearly coincident contact events, here the nodes with the
        given `indices`. It starts at the modal state `state` and has the duration `length`, in
        balls (intervals). `codes`, the contact codes of the meshes, are changed in place. The map
        refers to modal components; speeds are rates of flank distances.
        """
        module, dynamics, nodes = flint(), self.dynamics, self.path.nodes
        n, size, arb = len(dynamics.retained), dynamics.size, module.arb
        matrices = [nodes[i].matrix for i in [*indices, indices[-1] + 1]]
        changes = [after - before for before, after in pairwise(matrices)]
        bound = norm(matrices[0]) + sum(map(norm, changes), arb(0))
        relative_change = (bound * length).expm1().upper()
        max_component = max(abs(value).upper() for value in state.entries())
        max_change = arb(0, (relative_change * max_component).upper())
        # It contains the states at all times in the window.
        enclosure = state + column_of([max_change] * size)
        rate, jumps = matrices[0] * enclosure, [change * enclosure for change in changes]
        # Each jump of the rate acts for an unknown fraction of the window: a ball for [0, 1].
        fraction = arb(0.5, 0.5)
        end = state + sum((jump * fraction for jump in jumps), rate) * length
        speeds = self._crossing_speeds(indices, state, enclosure, end, rate, codes)
        transition, growth = identity(size), arb(1)  # growth bounds the norm of the transition
        for i, jump, speed in zip(indices, jumps, speeds, strict=True):
            # A saltation matrix is the jump of the derivatives at a crossing: the jump of the rate
            # over the crossing speed. Contact forces change velocities only.
            values = [value if n <= k < 2 * n else 0 for k, value in enumerate(jump.entries())]
            saltation = column_of(values) * nodes[i].distance * (1 / speed)
            transition += saltation
            growth *= 1 + norm(saltation)
        # Bound of the remainder for any order of the events, see docs/theory/proofs.md.
        factor = (1 + relative_change) ** (len(indices) + 1) - 1
        remainder = arb(0, (factor * growth).upper())
        return transition + module.arb_mat(size, size, [remainder] * size**2), end, speeds

    def _crossing_speeds(self, indices, start, enclosure, end, rate, codes: list) -> list:
        """Prove that each mesh crosses its flank line once in a window; return the speeds.

        A window is a time interval around nearly coincident contact events, the nodes with the
        given `indices`. `start`, `enclosure` and `end` are the modal states at its start, in the
        whole window and at its end, `rate` is the rate of the modal state, all as balls
        (intervals). Speeds are rates of flank distances. `codes`, the contact codes of the meshes,
        are changed in place.
        """
        dynamics, nodes = self.dynamics, [self.path.nodes[i] for i in indices]
        codes_after, speeds = list(codes), []
        # Flank line, (mesh, side), that each mesh crosses. A mesh with two events may not cross.
        crossed = {node.mesh: (node.mesh, node.side) for node in nodes}
        if len(crossed) < len(nodes):
            raise ProofFailed(*_NO_CROSSINGS)
        for node in nodes:
            codes_after[node.mesh] = node.after
            before = (node.distance * start)[0, 0]
            after = (node.distance * end)[0, 0]
            speed = (node.distance * rate)[0, 0]
            if not (node.crosses(-before) and node.crosses(after) and node.crosses(speed)):
                raise ProofFailed(*_NO_CROSSINGS)
            speeds.append(speed)
        for bound in [*contact_bounds(dynamics, codes), *contact_bounds(dynamics, codes_after)]:
            is_open = bound.sign * (bound.row * enclosure)[0, 0] > 0
            if not (is_open or bound.belongs_to(crossed.get(bound.mesh))):
                raise ProofFailed(*(JAMMED if bound.is_clearance else _NO_CROSSINGS))
        codes[:] = codes_after
        return speeds
