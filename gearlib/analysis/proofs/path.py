"""An orbit as a system of equations: its state, all phases of its contacts, and their derivatives.

A path runs from tau = 0 through nodes: switches of the stiffness at known phases, contacts gained
and lost at unknown ones. Unknowns are the state at tau = 0, (y, dy/dtheta) of its laws, and the
phases of the contacts. The equations: at each contact the mesh's distance from its flank line is 0;
the state returns. Arcs are linear flows, so is the derivative.

From arc to arc states are given along orthonormal frames, by the QR method of Lohner: boxes turn
with the motion, and hardly grow by being wrapped anew after every arc.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from gearlib.analysis.proofs.arc_laws import moved
from gearlib.analysis.proofs.balls import column_of, flint, identity
from gearlib.analysis.proofs.certificate_files import Uncertain
from gearlib.analysis.proofs.models_in_balls import COAST, DRIVE
from gearlib.engines.codes import NORMAL

#: Most arcs of an orbit.
MAX_ARCS = 1000


@dataclass(frozen=True)
class Node:
    """Where one arc ends and the next begins: a contact gained or lost, a switch, or the end."""

    law: Any  #: of the arc that ends here
    phase: Any = None  #: a ball; None: that of a contact, unknown
    mesh: int = -1  #: of a contact
    side: int = DRIVE  #: of the flank line that is crossed
    before: int = 0  #: contact code of the mesh before
    after: int = 0


class Arc(NamedTuple):
    """An arc in the frames of its ends: modal components = frame * framed components."""

    time: Any  #: near to that of the arc, exact
    transition: Any  #: by this time, from the frame of the arc before to the one of this arc
    law: Any  #: in the frame of this arc
    frame: Any
    frame_inverse: Any

    def moved(self, columns, time):
        """Return columns in the frame before at the end of the arc, in its frame."""
        return moved(self.law, self.transition * columns, time - self.time)


class Path:
    """The nodes of a motion, and its equations.

    `codes` are the contact codes of all meshes at the start, `events` (phase, mesh, code before,
    code after, ...) in their order, phases counted on over the periods; `scale` is 1 / nu, a ball.
    """

    def __init__(self, laws, codes, events, period, scale=None):
        self.laws, self.codes = laws, tuple(codes)
        self.scale = 1 / laws.tuning if scale is None else scale
        #: Numbers of the nodes at which a common period ends, and the next one begins.
        self.period_ends: list = []
        self.nodes: list = []
        #: Phases of the contacts, near to those of the motion.
        self.guess: list = []
        self._set_nodes(events, period)
        self._set_arcs()

    def _set_nodes(self, events, period):
        arb, laws, codes = flint().arb, self.laws, list(self.codes)
        turn, segments = 2 * arb.pi(), laws.numbers.segments
        marks: list = [
            (segment.phase + turn * start, number, None)
            for start in range(0, period, laws.common_period)
            for number, segment in enumerate(segments)
        ]
        marks += [(arb(phase), None, contact[:3]) for phase, *contact in events]
        if len(marks) >= MAX_ARCS:
            raise Uncertain("together", f"{len(marks)} arcs are too many: {MAX_ARCS} are allowed")
        # Events that floats do not tell apart stay in their order.
        marks.sort(key=lambda mark: float(mark[0].mid()))
        segment = 0
        for phase, number, contact in marks:
            law = laws.law(codes, segment)
            if contact is None:
                segment = number
                if phase > 0:
                    self.period_ends += [len(self.nodes)] if number == 0 else []
                    self.nodes.append(Node(law, phase))
                continue
            mesh, before, after = contact
            if before != codes[mesh]:
                raise Uncertain("contacts", "the contacts do not follow from each other")
            side = DRIVE if NORMAL in (before, after) else COAST
            self.guess.append(phase)
            self.nodes.append(Node(law, None, mesh, side, before, after))
            codes[mesh] = after
        self.nodes.append(Node(laws.law(codes, segment), turn * period))

    def _set_arcs(self):
        self.arcs, frame, last_phase = [], identity(self.laws.size), 0
        for node, phase in zip(self.nodes, self.phases(self.guess), strict=True):
            time = ((phase - last_phase) * self.scale).mid()
            columns = (node.law * time).exp() * frame
            frame = self._frame(node, columns)
            inverse = frame.inv()
            law = inverse * node.law * frame
            self.arcs.append(Arc(time, inverse * columns, law, frame, inverse))
            last_phase = phase

    def _frame(self, node, columns):
        """Return the frame at a node from what the frame before has become there."""
        n, frame = self.laws.state_count, identity(self.laws.size)
        axes = np.array([[float(value) for value in row[:n]] for row in columns.tolist()[:n]])
        # The longest direction first: it decides how the box lies.
        axes = axes[:, np.argsort(-np.linalg.norm(axes, axis=0), kind="stable")]
        if node.phase is None:
            # Across the flank line first, so that a contact fixes this component.
            distance = self.laws.distances[node.mesh][node.side].entries()
            axes = np.column_stack([[float(value) for value in distance[:n]], axes])
        axes, _ = np.linalg.qr(axes)
        for i, j in np.ndindex(n, n):
            frame[i, j] = float(axes[i, j])
        return frame

    def phases(self, contact_phases):
        """Return the phase of every node."""
        remaining = iter(contact_phases)
        return [next(remaining) if node.phase is None else node.phase for node in self.nodes]

    def start(self, state, unknown_count):
        """Return modal components at the start and their derivatives, (size, 1 + unknowns)."""
        waves, rows = [1, 0] * len(self.laws.wave_columns), []
        modal_state = (self.laws.basis_inverse * column_of([*state, 1, *waves])).entries()
        for value, row in zip(modal_state, self.laws.basis_inverse.tolist(), strict=True):
            rows.append([value, *row[: len(state)], *[0] * (unknown_count - len(state))])
        return flint().arb_mat(rows)

    def equations(self, unknowns):
        """Return (residuals, derivatives by the unknowns, a row each, arcs, ends).

        Arcs are (modal state at the start, time), `ends` the modal states at all nodes.
        """
        laws, scale, n = self.laws, self.scale, self.laws.state_count
        columns = self.start(unknowns[:n], len(unknowns))
        state, residuals, rows, arcs, ends = first_column(columns), [], [], [], []
        last_phase, column = 0, n
        phases = self.phases(unknowns[n:])
        for i, (node, phase, arc) in enumerate(zip(self.nodes, phases, self.arcs, strict=True)):
            time = (phase - last_phase) * scale
            arcs.append((state, time))
            columns = arc.moved(columns, time)
            if node.phase is None:
                column += 1
                _add(columns, column, arc.law * first_column(columns) * scale)
                row = laws.distances[node.mesh][node.side] * arc.frame
                residual, *slopes = (row * columns).entries()
                residuals.append(residual)
                rows.append(slopes)
                columns = _on_line(row) * columns
            state = arc.frame * first_column(columns)
            if node.phase is None:
                # The later the next arc begins, the less of it there is.
                speed = self.nodes[i + 1].law * state * scale
                _add(columns, column, arc.frame_inverse * speed * -1)
            ends.append(state)
            last_phase = phase
        for i, row in enumerate((laws.basis * arc.frame * columns).tolist()[:n]):
            residuals.append(row[0] - unknowns[i])
            row[i + 1] -= 1
            rows.append(row[1:])
        return residuals, rows, arcs, ends

    def monodromy(self, rows):
        """Return the map of small deviations of y and dy/dtheta, from rows of `equations`.

        The phases of the contacts follow from the state: by the derivative of an implicit function.
        """
        arb_mat, n = flint().arb_mat, self.laws.state_count
        k = len(rows) - n
        by_state = arb_mat([row[:n] for row in rows[k:]])
        for i in range(n):
            by_state[i, i] += 1
        if not k:
            return by_state
        by_phases = arb_mat([row[n:] for row in rows[:k]])
        try:
            phase_slopes = by_phases.solve(arb_mat([row[:n] for row in rows[:k]]))
        except ZeroDivisionError:
            raise Uncertain("grazing", "a contact is not proven to be a crossing") from None
        return by_state - arb_mat([row[n:] for row in rows[k:]]) * phase_slopes

    def determinant(self, arcs):
        """Return that of the map of small deviations, of all arcs: by Liouville's formula.

        Saltation has the determinant 1.
        """
        exponent = flint().arb(0)
        for node, (_, time) in zip(self.nodes, arcs, strict=True):
            exponent += sum(np.diagonal(node.law.tolist())) * time
        return exponent.exp()


def first_column(matrix):
    """Return the first column of a matrix, shape (n, 1)."""
    return column_of([matrix[i, 0] for i in range(matrix.nrows())])


def _add(matrix, column, values):
    for i, value in enumerate(values.entries()):
        matrix[i, column] += value


def _on_line(row):
    """Return what puts a state on the flank line, as its equation says: row * state = 0.

    The first component of its frame goes across the line.
    """
    across, *others = row.entries()
    matrix = identity(len(others) + 1)
    for i, value in enumerate([0, *(-value / across for value in others)]):
        matrix[0, i] = value
    return matrix
