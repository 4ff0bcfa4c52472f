"""The equations of an orbit, with its state and all phases of its contacts as unknowns.

A path runs from tau = 0 through nodes: switches of the stiffness at known phases, contact events at
unknown phases. The unknowns are the state at tau = 0, (y, dy/dtheta) of its laws, and the phases of
the contact events. The equations state that the distance of the mesh from its flank line is 0 at
each contact event, and that the state returns. States on arcs are components along orthonormal
frames (Lohner), so that boxes rotate with the motion. A window of time surrounds contact events
that come together. Its derivative is I plus the saltations in any order, up to a remainder, see
`docs/theory/proofs.md`.
"""

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from gearlib.analysis.proofs.arc_laws import propagated
from gearlib.analysis.proofs.balls import column_of, first_column, flint, identity, matrix_of, norm
from gearlib.analysis.proofs.certificate_files import Uncertain
from gearlib.analysis.proofs.models_in_balls import COAST, DRIVE
from gearlib.analysis.proofs.signs import JAMMED, bounds_of, check_arc
from gearlib.engines.codes import NORMAL

#: Largest number of arcs of an orbit.
MAX_ARCS = 1000
#: Ratio of a window to the uncertainty of its contact phases, and the same for proofs of signs.
_WINDOW_RATIO, _PROOF_WINDOW_RATIO = 4, 32
_NO_CROSSINGS = "together", "contacts that come together are not proven to be crossings"


class Node(NamedTuple):
    """End of an arc: a contact event, a switch of stiffness, or the end of the orbit."""

    law: Any  #: matrix of the arc that ends here
    phase: Any = None  #: a ball; None for a contact event at an unknown phase
    mesh: int = -1  #: mesh of a contact event
    side: int = DRIVE  #: side of the flank line that is crossed
    distance: Any = None  #: distance from this line, a functional of modal components
    before: int = 0  #: contact code of the mesh before
    after: int = 0

    def crosses(self, rate: Any) -> bool:
        """Return whether a rate of the flank distance has the sign of the contact change."""
        return rate > 0 if self.after > self.before else rate < 0


class Arc(NamedTuple):
    """An arc in orthonormal frames at its ends: modal components = frame * framed components."""

    time: Any  #: exact number near the duration of the arc
    transition: Any  #: propagation by this time, from the frame of the arc before to this frame
    law: Any  #: matrix of the law in the frame of this arc
    frame: Any
    frame_inverse: Any

    def propagated(self, columns: Any, time: Any) -> Any:
        """Return columns of framed states, propagated by a time, in the frame at the arc's end."""
        return propagated(self.law, self.transition * columns, time - self.time)


class Path:
    """The nodes of a motion, and its equations.

    `codes` are the contact codes of all meshes at the start, `events` (phase, mesh, code before,
    code after, ...) in their order, phases counted on over the periods; `scale` is 1 / nu, a ball.
    """

    def __init__(self, laws, codes, events, period: int, scale=None):
        """Set nodes and arcs; the period is in mesh periods, `scale` is by default 1 / tuning."""
        self.laws, self.codes = laws, tuple(codes)
        self.scale = 1 / laws.tuning if scale is None else scale
        #: Nodes; numbers of those at which a common period ends; phases near those of contacts.
        self.nodes, self.period_ends, self.guess = [], [], []
        self._set_nodes(events, period)
        self._set_arcs()

    def _set_nodes(self, events: list[tuple], period: int) -> None:
        """Set the nodes of the path: switches of the stiffness, contact events and the end.

        Events are (phase, mesh, code before, code after, ...); the period is in mesh periods.
        """
        arb, laws, codes = flint().arb, self.laws, list(self.codes)
        mesh_period, segments = 2 * arb.pi(), laws.numbers.segments
        marks: list = [
            (segment.phase + mesh_period * start, number, None)
            for start in range(0, period, laws.common_period)
            for number, segment in enumerate(segments)
        ]
        marks += [(arb(phase), None, contact[:3]) for phase, *contact in events]
        if len(marks) >= MAX_ARCS:
            raise Uncertain("together", f"{len(marks)} arcs are too many: {MAX_ARCS} are allowed")
        # Events with equal phases in floats stay in their order.
        marks.sort(key=lambda mark: float(mark[0].mid()))
        segment = 0
        for phase, number, contact in marks:
            law = laws.law(codes, segment)
            if contact is None:
                segment = number
                if phase > 0:
                    if number == 0:
                        self.period_ends.append(len(self.nodes))
                    self.nodes.append(Node(law, phase))
                continue
            mesh, before, after = contact
            if before != codes[mesh]:
                raise Uncertain("contacts", "the contacts do not follow from each other")
            side = DRIVE if NORMAL in (before, after) else COAST
            self.guess.append(phase)
            distance = laws.distances[mesh][side]
            self.nodes.append(Node(law, None, mesh, side, distance, before, after))
            codes[mesh] = after
        self.nodes.append(Node(laws.law(codes, segment), mesh_period * period))

    def _set_arcs(self) -> None:
        """Set the arcs between the nodes, with orthonormal frames at their ends."""
        self.arcs, frame, last_phase = [], identity(self.laws.size), 0
        for node, phase in zip(self.nodes, self.phases(self.guess), strict=True):
            time = ((phase - last_phase) * self.scale).mid()
            columns = (node.law * time).exp() * frame
            frame = self._frame(node, columns)
            inverse = frame.inv()
            law = inverse * node.law * frame
            self.arcs.append(Arc(time, inverse * columns, law, frame, inverse))
            last_phase = phase

    def _frame(self, node: Node, columns: Any) -> Any:
        """Return the orthonormal frame at a node from the propagated frame of the node before."""
        n, frame = self.laws.state_count, np.eye(self.laws.size)
        axes = np.array([[float(value) for value in row[:n]] for row in columns.tolist()[:n]])
        # The longest direction comes first, because it decides the orientation of the box.
        axes = axes[:, np.argsort(-np.linalg.norm(axes, axis=0), kind="stable")]
        if node.phase is None:
            # The normal of the flank line comes first, so that a contact fixes this component.
            normal = [float(value) for value in node.distance.entries()[:n]]
            axes = np.column_stack([normal, axes])
        frame[:n, :n], _ = np.linalg.qr(axes)
        return matrix_of(frame)

    def phases(self, contact_phases: list) -> list:
        """Return the phases of all nodes, from those of the contact events in their order."""
        remaining = iter(contact_phases)
        return [next(remaining) if node.phase is None else node.phase for node in self.nodes]

    def start(self, state: list, unknown_count: int) -> Any:
        """Return modal components of the start and their derivatives by all unknowns.

        The state is (y, dy/dtheta), which are the first unknowns. The columns are the state, then
        a derivative for each unknown.
        """
        waves = [1, 0] * len(self.laws.wave_columns)
        columns = flint().arb_mat(self.laws.size, 1 + unknown_count)
        for i, value in enumerate([*state, 1, *waves]):
            columns[i, 0] = value
        for i in range(len(state)):
            columns[i, 1 + i] = 1
        return self.laws.basis_inverse * columns

    def equations(self, unknowns: list) -> tuple[list, list, list, list]:
        """Return (residuals, rows of their derivatives, arcs, end states) of the orbit equations.

        Unknowns are the state at tau = 0 and the phases of contact events. Arcs are (modal start
        state, duration), end states the modal states at all nodes.
        """
        laws, scale, n = self.laws, self.scale, self.laws.state_count
        columns = self.start(unknowns[:n], len(unknowns))
        state, residuals, rows, arcs, ends = first_column(columns), [], [], [], []
        last_phase, column = 0, n
        phases = self.phases(unknowns[n:])
        for i, (node, phase, arc) in enumerate(zip(self.nodes, phases, self.arcs, strict=True)):
            time = (phase - last_phase) * scale
            arcs.append((state, time))
            columns = arc.propagated(columns, time)
            if node.phase is None:
                column += 1
                unit = flint().arb_mat(1, len(unknowns) + 1)
                unit[0, column] = 1
                columns += arc.law * first_column(columns) * scale * unit
                row = node.distance * arc.frame
                residual, *slopes = (row * columns).entries()
                residuals.append(residual)
                rows.append(slopes)
                columns = _projection_to_line(row) * columns
            state = arc.frame * first_column(columns)
            if node.phase is None:
                # A later contact shortens the next arc.
                speed = self.nodes[i + 1].law * state * scale
                columns -= arc.frame_inverse * speed * unit
            ends.append(state)
            last_phase = phase
        for i, row in enumerate((laws.basis * arc.frame * columns).tolist()[:n]):
            residuals.append(row[0] - unknowns[i])
            row[i + 1] -= 1
            rows.append(row[1:])
        return residuals, rows, arcs, ends

    def monodromy(self, rows: list) -> Any:
        """Return the monodromy matrix of (y, dy/dtheta), with all contact phases eliminated.

        The rows are the derivatives that `equations` returns.
        """
        arb_mat, n = flint().arb_mat, self.laws.state_count
        k = len(rows) - n
        by_state = arb_mat([row[:n] for row in rows[k:]]) + identity(n)
        if not k:
            return by_state
        by_phases = arb_mat([row[n:] for row in rows[:k]])
        try:
            phase_slopes = by_phases.solve(arb_mat([row[:n] for row in rows[:k]]))
        except ZeroDivisionError:
            raise Uncertain("grazing", "a contact is not proven to be a crossing") from None
        return by_state - arb_mat([row[n:] for row in rows[k:]]) * phase_slopes

    def determinant(self, arcs: list[tuple]) -> Any:
        """Return the determinant of the monodromy matrix by Liouville's formula.

        Arcs are (modal start state, duration).
        """
        exponent = flint().arb(0)
        for node, (_, duration) in zip(self.nodes, arcs, strict=True):
            exponent += node.law.trace() * duration
        return exponent.exp()


def _projection_to_line(distance: Any) -> Any:
    """Return the projection of framed states to a flank line along their first axis, a matrix.

    The distance from the line is a functional of framed states, shape (1, size).
    """
    slopes = distance.entries()
    matrix = identity(len(slopes))
    matrix[0, 0] = 0
    for i in range(1, len(slopes)):
        matrix[0, i] = -slopes[i] / slopes[0]
    return matrix


def smallest_interval() -> Any:
    """Return the phase interval, a ball, below which neighbouring contact events share a window."""
    return flint().arb(2) ** -(flint().ctx.prec // 2)


class Windows:
    """A `Path` with windows of time around contacts that come together."""

    def __init__(self, path: Path, phases: list):
        """Group the nodes of a `Path` by the phases of its contact events, balls in their order."""
        self.path, self.laws = path, path.laws
        #: (Indices of the nodes that are passed together, phase).
        self.groups: list = []
        last = None
        for i, (node, phase) in enumerate(zip(path.nodes, path.phases(phases), strict=True)):
            is_contact = node.phase is None
            if is_contact and last is not None and phase - last < smallest_interval():
                self.groups[-1][0].append(i)
            else:
                self.groups.append(([i], phase))
            last = phase if is_contact else None

    def any(self) -> bool:
        """Return whether any contact events come together, so that a window is needed."""
        return any(len(numbers) > 1 for numbers, _ in self.groups)

    def equations(self, unknowns: list) -> tuple[list, list]:
        """Return (residuals, rows of their derivatives) for a state that returns to itself.

        Unknowns are (y, dy/dtheta) at tau = 0.
        """
        ends, rows, *_ = self.run(unknowns)
        for i, row in enumerate(rows):
            row[i] -= 1
        return [end - value for end, value in zip(ends, unknowns, strict=True)], rows

    def run(self, unknowns: list, prove: bool = False) -> tuple:
        """Return (end state, rows of its derivatives, phases, speeds, states at switches).

        Unknowns are (y, dy/dtheta) at tau = 0. A phase is a ball that holds a whole window; speeds
        are rates of flank distances by theta. With `prove` it is also proven that no mesh touches a
        flank line between windows.
        """
        module, laws, path = flint(), self.laws, self.path
        n, codes = len(unknowns), list(path.codes)
        columns = path.start(unknowns, n)
        start, time, phases, speeds, switches = first_column(columns), 0, [], [], {}
        for numbers, phase in self.groups:
            node, arc = path.nodes[numbers[0]], path.arcs[numbers[0]]
            end, half = phase * path.scale, 0
            if node.phase is None:
                near = arc.frame * arc.propagated(first_column(columns), end - time)
                half = self._half_width(
                    numbers, near, _PROOF_WINDOW_RATIO if prove else _WINDOW_RATIO
                )
            duration = end - half - time
            if not duration > 0:
                text = "from others, a switch of a stiffness or the start of the orbit"
                text = f"contacts that come together cannot be told apart {text}"
                raise Uncertain("together", text)
            columns = arc.propagated(columns, duration)
            before = arc.frame * first_column(columns)
            if prove:
                at = float(phase.mid())
                check_arc(laws, node.law, start, before, duration, codes, (None, None), at)
            time = end + half
            if node.phase is not None:
                start = switches[numbers[0]] = before
                continue
            transition, start, rates = self._crossed(numbers, before, 2 * half, codes)
            speeds += rates
            window = module.arb(end.mid(), (half + end.rad()).upper())
            phases += [window / path.scale] * len(rates)
            inverse = path.arcs[numbers[-1]].frame_inverse
            slopes = (inverse * (transition * (arc.frame * columns))).tolist()
            state = (inverse * start).entries()
            columns = module.arb_mat([[z, *row[1:]] for z, row in zip(state, slopes, strict=True)])
        rows = (laws.basis * arc.frame * columns).tolist()[:n]
        return [row[0] for row in rows], [row[1:] for row in rows], phases, speeds, switches

    def _half_width(self, numbers: list[int], state: Any, ratio: int) -> Any:
        """Return half the duration of a window around the nodes with these numbers.

        The modal state lies near the nodes; the ratio is that of the window to the uncertainty of
        the phases.
        """
        largest = flint().arb(2) ** -(0.7 * flint().ctx.prec)
        for node in (self.path.nodes[i] for i in numbers):
            distance = (node.distance * state)[0, 0]
            rate = (node.distance * (node.law * state))[0, 0]
            if not (rate > 0 or rate < 0):
                raise Uncertain(*_NO_CROSSINGS)
            largest = max(largest, (ratio * abs(distance).upper() / abs(rate).lower()).upper())
        return largest

    def _crossed(self, numbers: list[int], state: Any, length: Any, codes: list) -> tuple:
        """Pass a window; return (map of deviations, state after it, speeds of the crossings).

        The window contains the nodes with these numbers and starts at a modal state; its duration
        is `length`. The contact codes of the meshes change in place.
        """
        module, laws, nodes = flint(), self.laws, self.path.nodes
        e, size, arb = len(laws.retained), laws.size, module.arb
        matrices = [nodes[i].law for i in [*numbers, numbers[-1] + 1]]
        changes = [after - before for before, after in pairwise(matrices)]
        bound = norm(matrices[0]) + sum(map(norm, changes), arb(0))
        eta = (bound * length).expm1().upper()
        max_change = arb(0, (eta * max(abs(value).upper() for value in state.entries())).upper())
        within = state + column_of([max_change] * size)
        rate, jumps = matrices[0] * within, [change * within for change in changes]
        end = state + sum((jump * arb(0.5, 0.5) for jump in jumps), rate) * length
        speeds = self._checked_speeds(numbers, state, within, end, rate, codes)
        transition, growth = identity(size), arb(1)
        for i, jump, speed in zip(numbers, jumps, speeds, strict=True):
            # Contact forces change velocities only.
            values = [value if e <= k < 2 * e else 0 for k, value in enumerate(jump.entries())]
            saltation = column_of(values) * nodes[i].distance * (1 / speed)
            transition += saltation
            growth *= 1 + norm(saltation)
        remainder = arb(0, (((1 + eta) ** (len(numbers) + 1) - 1) * growth).upper())
        return transition + module.arb_mat(size, size, [remainder] * size**2), end, speeds

    def _checked_speeds(
        self, numbers: list[int], begin: Any, within: Any, end: Any, rate: Any, codes: list
    ) -> list:
        """Prove that each mesh crosses its flank line once in a window; return the speeds.

        Modal states are those at the begin, within and at the end of the window, with their rate.
        The contact codes of the meshes change in place.
        """
        laws, nodes, speeds = self.laws, [self.path.nodes[i] for i in numbers], []
        crossed, codes_after = {node.mesh: (node.mesh, node.side) for node in nodes}, list(codes)
        if len(crossed) < len(nodes):
            raise Uncertain(*_NO_CROSSINGS)
        for node in nodes:
            codes_after[node.mesh] = node.after
            before, after, speed = ((node.distance * state)[0, 0] for state in (begin, end, rate))
            if not (node.crosses(-before) and node.crosses(after) and node.crosses(speed)):
                raise Uncertain(*_NO_CROSSINGS)
            speeds.append(speed)
        for bound in [*bounds_of(laws, codes), *bounds_of(laws, codes_after)]:
            is_open = bound.sign * (bound.row * within)[0, 0] > 0
            if not (is_open or bound.is_of(crossed.get(bound.mesh))):
                raise Uncertain(*(JAMMED if bound.is_overlap else _NO_CROSSINGS))
        codes[:] = codes_after
        return speeds
