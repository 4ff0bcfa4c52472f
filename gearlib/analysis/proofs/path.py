"""Equations of a periodic orbit; the unknowns are its state and the phases of contact events.

A path starts at the mesh phase tau = 0 and passes nodes: switches of the stiffness at known phases
and contact events at unknown phases. The unknowns are the state (y, dy/dtheta) at tau = 0, where
theta is tau over the tuning, and the phases of the contact events. The equations state that the
flank distance is zero at each contact event and that the state is periodic. States on arcs are
represented in orthonormal frames (Lohner), so that boxes rotate with the motion. Contact events
that are too close for a proven order share a time window. The transition matrix over a window is
the identity plus the saltations in any order, up to a remainder, see `docs/theory/proofs.md`.
"""

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from gearlib.analysis.proofs.arc_laws import propagate
from gearlib.analysis.proofs.balls import (
    first_column,
    flint,
    identity,
    norm_bound,
    to_column,
    to_matrix,
)
from gearlib.analysis.proofs.certificate_files import COINCIDENT, ProofFailed
from gearlib.analysis.proofs.models_in_balls import COAST_SIDE, DRIVE_SIDE
from gearlib.analysis.proofs.signs import JAMMED, check_arc, contact_conditions
from gearlib.engines.codes import DRIVE

#: Largest number of arcs of an orbit.
MAX_ARCS = 1000
#: Ratio of the length of a window to the uncertainty of its contact phases: without and with the
#: proof that no flank line is touched between windows.
_WINDOW_RATIO, _PROOF_WINDOW_RATIO = 4, 32
_NO_CROSSINGS = COINCIDENT, "nearly coincident contact events are not proven to be crossings"


class Node(NamedTuple):
    """The end of an arc: a contact event, a switch of the stiffness, or the end of the orbit."""

    matrix: Any  #: system matrix of the arc that ends here
    phase: Any = None  #: a ball, or None for a contact event, whose phase is unknown
    mesh: int = -1  #: index of the mesh of a contact event
    side: int = DRIVE_SIDE  #: side of the crossed flank line
    distance: Any = None  #: row vector: distance from this line for modal components
    before: int = 0  #: contact state of the mesh before the event
    after: int = 0  #: contact state after the event

    @property
    def is_contact(self) -> bool:
        """Whether the node is a contact event."""
        return self.phase is None

    def crosses(self, rate: Any) -> bool:
        """Return whether the flank distance changes in the direction of the contact event.

        `rate` is the rate of the flank distance, a ball (interval). It must be positive if the
        contact state increases (-1 coast side, 0 no contact, 1 drive side), and negative if it
        decreases. A ball that contains 0 proves neither.
        """
        return rate > 0 if self.after > self.before else rate < 0


class Arc(NamedTuple):
    """An arc with an orthonormal frame at its end: modal components = frame * frame components."""

    time: Any  #: approximate duration of the arc, a ball with radius 0
    transition: Any  #: transition matrix over this time, from the previous frame to this frame
    matrix: Any  #: system matrix in the frame of this arc
    frame: Any  #: matrix from frame components to modal components
    frame_inverse: Any

    def propagate(self, columns: Any, time: Any) -> Any:
        """Propagate state vectors, the columns of a matrix, from the start to the end of the arc.

        An arc is the motion between two events. The `columns` have components in the frame
        (orthonormal basis) of the previous arc; the result has components in the frame of this arc.
        `time`, a ball (interval), is close to the approximate duration `self.time`.
        """
        return propagate(self.matrix, self.transition * columns, time - self.time)


class Path:
    """Nodes, arcs and equations of a periodic motion."""

    def __init__(self, dynamics, contacts, events, period: int, inverse_tuning=None):
        """Create the nodes (events) of a motion and the arcs between them.

        `dynamics` are the `ArcDynamics` of the model, `contacts` the contact states of all meshes
        at tau = 0 (1 drive side, 0 no contact, -1 coast side). `events` are the sorted contact
        events (phase from tau = 0 in rad, mesh index, state before, state after, ...). `period` is
        the duration in mesh periods. `inverse_tuning` is 1 / nu, a ball (interval); by default nu
        is the tuning of the dynamics.
        """
        self.dynamics, self.contact_states = dynamics, tuple(contacts)
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
            # Time is phase over tuning. The approximate time is only used to choose the frame.
            time = ((phase - last_phase) * self.inverse_tuning).mid()
            columns = (node.matrix * time).exp() * frame
            frame = self._frame(node, columns)
            inverse = frame.inv()
            matrix = inverse * node.matrix * frame
            self.arcs.append(Arc(time, inverse * columns, matrix, frame, inverse))
            last_phase = phase

    def _set_nodes(self, events: list[tuple], period: int) -> None:
        """Create the nodes of the path: switches of the stiffness, contact events and the end.

        `events` are the sorted contact events (phase from tau = 0 in rad, mesh index, state before,
        state after, ...), with the contact states 1 drive side, 0 no contact, -1 coast side.
        `period` is the period of the motion in mesh periods.
        """
        arb, dynamics, contacts = flint().arb, self.dynamics, list(self.contact_states)
        mesh_period = 2 * arb.pi()
        # Entries are (phase, index of the segment that starts or None, contact event or None). A
        # segment is an interval of constant stiffness in the excitation period.
        entries: list = []
        for start in range(0, period, dynamics.excitation_period):
            for index, segment in enumerate(dynamics.model.segments):
                entries.append((segment.phase + mesh_period * start, index, None))
        entries += [(arb(phase), None, contact[:3]) for phase, *contact in events]
        if len(entries) >= MAX_ARCS:
            # Too many arcs are reported like coinciding events, for lack of a status of their own.
            message = f"{len(entries)} arcs are too many: there must be fewer than {MAX_ARCS}"
            raise ProofFailed(COINCIDENT, message)
        # The sort is stable for events with equal phases as floats.
        entries.sort(key=lambda entry: float(entry[0].mid()))
        segment_index = 0
        # Each node has the system matrix of the arc that ends there.
        for phase, next_index, contact in entries:
            matrix = dynamics.system_matrix(contacts, segment_index)
            if contact is None:
                segment_index = next_index
                # The first segment starts at phase 0, where no arc ends.
                if phase > 0:
                    if next_index == 0:
                        self.period_ends.append(len(self.nodes))
                    self.nodes.append(Node(matrix, phase))
                continue
            mesh, before, after = contact
            if before != contacts[mesh]:
                raise ProofFailed("contacts", "the contact events contradict the contact states")
            side = DRIVE_SIDE if DRIVE in (before, after) else COAST_SIDE
            self.initial_phases.append(phase)
            distance = dynamics.distance_rows[mesh][side]
            self.nodes.append(Node(matrix, None, mesh, side, distance, before, after))
            contacts[mesh] = after
        matrix = dynamics.system_matrix(contacts, segment_index)
        self.nodes.append(Node(matrix, mesh_period * period))

    def _frame(self, node: Node, columns: Any) -> Any:
        """Return the frame at a node, an orthonormal basis (size, size), by QR decomposition.

        `columns` are the modal components of the previous frame, propagated to this `node`. The
        frame follows their directions, so that boxes around a state grow little.
        """
        n, frame = self.dynamics.state_count, np.eye(self.dynamics.size)
        axes = np.array([[float(value) for value in row[:n]] for row in columns.tolist()[:n]])
        # The longest column comes first, because it determines the orientation of the box.
        axes = axes[:, np.argsort(-np.linalg.norm(axes, axis=0), kind="stable")]
        if node.is_contact:
            # The normal of the flank line comes first, because this component is known at the
            # event.
            normal = [float(value) for value in node.distance.entries()[:n]]
            axes = np.column_stack([normal, axes])
        frame[:n, :n], _ = np.linalg.qr(axes)
        return to_matrix(frame)

    def phases(self, contact_phases: list) -> list:
        """Return the phases of all nodes, given the sorted phases of the contact events.

        The phases of the other nodes, switches of the stiffness and the end of the orbit, are
        known.
        """
        phases = []
        remaining_phases = iter(contact_phases)
        for node in self.nodes:
            phases.append(next(remaining_phases) if node.is_contact else node.phase)
        return phases

    def initial_columns(self, state: list, unknown_count: int) -> Any:
        """Return the initial state and its derivatives with respect to the unknowns as columns.

        The columns have modal components, shape (size, 1 + unknown_count). `state` is (y,
        dy/dtheta) at tau = 0, where y are displacements and theta is the mesh phase tau over the
        tuning. Its entries are the first unknowns, so their derivatives are columns of the identity
        matrix.
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
        """Evaluate the equations; return (residuals, rows of their derivatives, arcs, end states).

        The unknowns are (y, dy/dtheta) at tau = 0, where y are displacements and theta is the mesh
        phase tau over the tuning, and the phases of the contact events, all as balls (intervals).
        The residuals are the flank distances at the contact events, then the change of (y,
        dy/dtheta) over the period. `arcs` are (initial modal state, duration) between successive
        nodes (events or switches of stiffness), and the end states are the modal states at all
        nodes.
        """
        dynamics, inverse_tuning, n = self.dynamics, self.inverse_tuning, self.dynamics.state_count
        # The columns are the state and its derivatives with respect to the unknowns.
        columns = self.initial_columns(unknowns[:n], len(unknowns))
        state = first_column(columns)
        residuals, jacobian_rows, arcs, end_states = [], [], [], []
        last_phase, phase_column = 0, n
        phases = self.phases(unknowns[n:])
        for i, (node, phase, arc) in enumerate(zip(self.nodes, phases, self.arcs, strict=True)):
            time = (phase - last_phase) * inverse_tuning
            arcs.append((state, time))
            columns = arc.propagate(columns, time)
            if node.is_contact:
                phase_column += 1
                # The product of a rate with this row is added to the derivative with respect to the
                # phase.
                phase_row = flint().arb_mat(1, len(unknowns) + 1)
                phase_row[0, phase_column] = 1
                columns += arc.matrix * first_column(columns) * inverse_tuning * phase_row
                distance_row = node.distance * arc.frame
                distance, *derivatives = (distance_row * columns).entries()
                residuals.append(distance)
                jacobian_rows.append(derivatives)
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
            end_states.append(state)
            last_phase = phase
        for i, row in enumerate((dynamics.basis * arc.frame * columns).tolist()[:n]):
            residuals.append(row[0] - unknowns[i])
            row[i + 1] -= 1
            jacobian_rows.append(row[1:])
        return residuals, jacobian_rows, arcs, end_states

    def monodromy(self, jacobian_rows: list) -> Any:
        """Return the monodromy matrix of (y, dy/dtheta) from the rows of the Jacobian matrix.

        It maps a change of the state at tau = 0 to its change after the period. `jacobian_rows`,
        from `equations`, belong to the contact events, then to the periodicity. The phases of the
        contact events, which depend on the state, are eliminated.
        """
        arb_mat, n = flint().arb_mat, self.dynamics.state_count
        k = len(jacobian_rows) - n  # number of contact events
        # The residuals of periodicity are final minus initial state, so the identity is added.
        state_block = arb_mat([row[:n] for row in jacobian_rows[k:]]) + identity(n)
        if not k:
            return state_block
        phase_block = arb_mat([row[n:] for row in jacobian_rows[:k]])
        try:
            phase_slopes = phase_block.solve(arb_mat([row[:n] for row in jacobian_rows[:k]]))
        except ZeroDivisionError:
            raise ProofFailed("grazing", "a contact event is not proven to be a crossing") from None
        return state_block - arb_mat([row[n:] for row in jacobian_rows[k:]]) * phase_slopes

    def determinant(self, arcs: list[tuple]) -> Any:
        """Return the determinant of the monodromy matrix by Liouville's formula.

        It is the exponential of the integral of the trace of the system matrix. `arcs` are (initial
        modal state, duration) between successive nodes, as returned by `equations`.
        """
        exponent = flint().arb(0)
        for node, (_, duration) in zip(self.nodes, arcs, strict=True):
            exponent += node.matrix.trace() * duration
        return exponent.exp()


def smallest_interval() -> Any:
    """Return the phase interval, a ball, below which successive contact events share a window."""
    return flint().arb(2) ** -(flint().ctx.prec // 2)


class Windows:
    """A `Path` with windows, time intervals around contact events without a proven order."""

    def __init__(self, path: Path, contact_phases: list):
        """Group the nodes of a `Path`: contact events without a proven order share a window.

        Nodes are contact events, switches of the stiffness and the end of the orbit.
        `contact_phases` are the sorted phases of the contact events, as balls (intervals).
        """
        self.path, self.dynamics = path, path.dynamics
        #: (indices of the nodes in the same window, phase) for each window
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
        """Evaluate the change of (y, dy/dtheta) over the period; return (residuals, Jacobian rows).

        The unknowns are the displacements y and rates dy/dtheta at tau = 0 (theta is the mesh phase
        tau over the tuning), a list of balls (intervals). The residuals are their changes over the
        period.
        """
        final_state, jacobian_rows, *_ = self.propagate(unknowns)
        # Subtract the derivative of the initial state, the identity matrix.
        for i, row in enumerate(jacobian_rows):
            row[i] -= 1
        residuals = [end - start for end, start in zip(final_state, unknowns, strict=True)]
        return residuals, jacobian_rows

    def propagate(self, unknowns: list, check_arcs: bool = False) -> tuple:
        """Return (final state, rows of its derivatives, phases, speeds, states at switches).

        The unknowns are (y, dy/dtheta) at tau = 0 as balls (intervals). Phases and speeds (rates of
        flank distances) belong to the contact events; a phase contains its whole window. States at
        switches of the stiffness are a dict with node indices as keys. `check_arcs` adds the proof
        that no mesh touches a flank line between windows.
        """
        module, dynamics, path = flint(), self.dynamics, self.path
        n, contacts = len(unknowns), list(path.contact_states)
        columns = path.initial_columns(unknowns, n)  # the state, then its derivatives
        start, time = first_column(columns), 0  # at the last window or switch
        phases, speeds, switch_states = [], [], {}
        ratio = _PROOF_WINDOW_RATIO if check_arcs else _WINDOW_RATIO
        for indices, phase in self.groups:
            node, arc = path.nodes[indices[0]], path.arcs[indices[0]]
            end, half_length = phase * path.inverse_tuning, 0
            if node.is_contact:
                state_at_node = arc.frame * arc.propagate(first_column(columns), end - time)
                half_length = self._half_length(indices, state_at_node, ratio)
            duration = end - half_length - time
            if not duration > 0:
                text = "cannot be separated from other events, a stiffness switch or tau = 0"
                raise ProofFailed(COINCIDENT, f"nearly coincident contact events {text}")
            columns = arc.propagate(columns, duration)
            before = arc.frame * first_column(columns)
            if check_arcs:
                # No flank line is crossed at the ends, because all crossings lie in windows.
                arc_ends = start, before, duration, contacts, (None, None)
                check_arc(dynamics, node.matrix, *arc_ends, phase=float(phase.mid()))
            time = end + half_length
            if not node.is_contact:
                start = switch_states[indices[0]] = before
                continue
            length = 2 * half_length
            transition, start, rates = self._cross_window(indices, before, length, contacts)
            speeds += rates
            window = module.arb(end.mid(), (half_length + end.rad()).upper())
            phases += [window / path.inverse_tuning] * len(rates)
            inverse = path.arcs[indices[-1]].frame_inverse
            propagated_rows = (inverse * (transition * (arc.frame * columns))).tolist()
            # The transition matrix only applies to derivatives; the state is enclosed by `start`.
            state = (inverse * start).entries()
            entries = zip(state, propagated_rows, strict=True)
            columns = module.arb_mat([[value, *row[1:]] for value, row in entries])
        rows = (dynamics.basis * arc.frame * columns).tolist()[:n]
        return [row[0] for row in rows], [row[1:] for row in rows], phases, speeds, switch_states

    def _half_length(self, indices: list[int], state: Any, ratio: int) -> Any:
        """Return half the duration of a window, `ratio` times the uncertainty of its contact times.

        A window is a time interval around nearly coincident contact events. It contains the nodes
        with the given `indices`, and `state` is a modal state near them, in balls (intervals). The
        uncertainty of a contact time is the flank distance divided by its rate.
        """
        half_length = flint().arb(2) ** -(0.7 * flint().ctx.prec)
        for i in indices:
            node = self.path.nodes[i]
            distance = (node.distance * state)[0, 0]
            rate = (node.distance * (node.matrix * state))[0, 0]
            # If the rate may be zero, the event may be a grazing instead of a crossing.
            if not (rate > 0 or rate < 0):
                raise ProofFailed(*_NO_CROSSINGS)
            bound = ratio * abs(distance).upper() / abs(rate).lower()
            half_length = max(half_length, bound.upper())
        return half_length

    def _cross_window(self, indices: list[int], state, length, contacts: list) -> tuple:
        """Return (transition matrix over a window, final state, speeds of the crossings).

        A window is a time interval around nearly coincident contact events, here the nodes with the
        given `indices`. It starts at the modal state `state` and has the duration `length`, in
        balls (intervals). `contacts`, the contact states of the meshes, are updated in place. The
        matrix refers to modal components; speeds are rates of flank distances.
        """
        module, dynamics, nodes = flint(), self.dynamics, self.path.nodes
        n, size, arb = len(dynamics.retained), dynamics.size, module.arb
        matrices = [nodes[i].matrix for i in [*indices, indices[-1] + 1]]
        changes = [after - before for before, after in pairwise(matrices)]
        bound = norm_bound(matrices[0]) + sum(map(norm_bound, changes), arb(0))
        relative_change = (bound * length).expm1().upper()
        max_component = max(abs(value).upper() for value in state.entries())
        max_change = arb(0, (relative_change * max_component).upper())
        # The enclosure contains the states at all times in the window.
        enclosure = state + to_column([max_change] * size)
        rate, jumps = matrices[0] * enclosure, [change * enclosure for change in changes]
        # Each jump of the rate acts for an unknown fraction of the window, the ball [0, 1].
        fraction = arb(0.5, 0.5)
        end = state + sum((jump * fraction for jump in jumps), rate) * length
        speeds = self._prove_crossings(indices, state, enclosure, end, rate, contacts)
        transition, growth = identity(size), arb(1)  # growth bounds the norm of the transition
        for i, jump, speed in zip(indices, jumps, speeds, strict=True):
            # The saltation matrix is the jump of the derivatives at a crossing, the jump of the
            # rate over the crossing speed. Contact forces only change velocities.
            values = [value if n <= k < 2 * n else 0 for k, value in enumerate(jump.entries())]
            saltation = to_column(values) * nodes[i].distance * (1 / speed)
            transition += saltation
            growth *= 1 + norm_bound(saltation)
        # Bound of the remainder for any order of the events, see docs/theory/proofs.md.
        factor = (1 + relative_change) ** (len(indices) + 1) - 1
        remainder = arb(0, (factor * growth).upper())
        return transition + module.arb_mat(size, size, [remainder] * size**2), end, speeds

    def _prove_crossings(self, indices, start, enclosure, end, rate, contacts: list) -> list:
        """Prove that each mesh crosses its flank line once in a window; return the crossing speeds.

        A window is a time interval around nearly coincident contact events, the nodes with the
        given `indices`. `start`, `enclosure` and `end` are the modal states at its start, in the
        whole window and at its end, and `rate` is the rate of the modal state, as balls
        (intervals). Speeds are rates of flank distances. `contacts`, the contact states of the
        meshes, are updated in place.
        """
        dynamics, nodes = self.dynamics, [self.path.nodes[i] for i in indices]
        contacts_after, speeds = list(contacts), []
        # Flank line (mesh, side) that each mesh crosses. A mesh with two events may not cross it.
        crossed = {node.mesh: (node.mesh, node.side) for node in nodes}
        if len(crossed) < len(nodes):
            raise ProofFailed(*_NO_CROSSINGS)
        for node in nodes:
            contacts_after[node.mesh] = node.after
            before = (node.distance * start)[0, 0]
            after = (node.distance * end)[0, 0]
            speed = (node.distance * rate)[0, 0]
            if not (node.crosses(-before) and node.crosses(after) and node.crosses(speed)):
                raise ProofFailed(*_NO_CROSSINGS)
            speeds.append(speed)
        conditions = contact_conditions(dynamics, contacts)
        for condition in conditions + contact_conditions(dynamics, contacts_after):
            is_open = condition.sign * (condition.row * enclosure)[0, 0] > 0
            if not (is_open or condition.refers_to(crossed.get(condition.mesh))):
                raise ProofFailed(*(JAMMED if condition.is_clearance else _NO_CROSSINGS))
        contacts[:] = contacts_after
        return speeds
