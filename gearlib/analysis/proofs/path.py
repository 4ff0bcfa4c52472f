"""The equations of an orbit, with its state and all phases of its contacts as unknowns.

A path runs from tau = 0 through nodes: switches of the stiffness at known phases, contacts gained
and lost at unknown ones. Unknowns are the state at tau = 0, (y, dy/dtheta) of its laws, and the
phases of the contacts. The equations: at each contact the mesh's distance from its flank line is 0;
the state returns. From arc to arc states are given along orthonormal frames (Lohner), with which
boxes turn. Around contacts that come together lies a window of time, through which the derivative
is I plus the saltations in any order, up to a remainder: derivation in `docs/theory/proofs.md`.
"""

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from gearlib.analysis.proofs.arc_laws import moved
from gearlib.analysis.proofs.balls import column_of, first_column, flint, identity, matrix_of, norm
from gearlib.analysis.proofs.certificate_files import Uncertain
from gearlib.analysis.proofs.models_in_balls import COAST, DRIVE
from gearlib.analysis.proofs.signs import JAMMED, bounds_of, check_arc
from gearlib.engines.codes import NORMAL

#: Largest number of arcs of an orbit.
MAX_ARCS = 1000
#: Ratio of a window to the uncertainty of its contacts, and where signs next to it are proven.
_WINDOW_RATIO, _PROOF_WINDOW_RATIO = 4, 32
_NO_CROSSINGS = "together", "contacts that come together are not proven to be crossings"


class Node(NamedTuple):
    """End of an arc: a contact that is gained or lost, a switch of stiffness, or the end."""

    law: Any  #: of the arc that ends here
    phase: Any = None  #: a ball; None: that of a contact, unknown
    mesh: int = -1  #: of a contact
    side: int = DRIVE  #: of the flank line that is crossed
    distance: Any = None  #: of the mesh from this line, a functional of modal components
    before: int = 0  #: contact code of the mesh before
    after: int = 0

    def crosses(self, rate):
        """Return whether a rate of the distance has the sign of the contact change."""
        return rate > 0 if self.after > self.before else rate < 0


class Arc(NamedTuple):
    """An arc in orthonormal frames at its ends: modal components = frame * framed components."""

    time: Any  #: near to that of the arc, exact
    transition: Any  #: by this time, from the frame of the arc before to the one of this arc
    law: Any  #: in the frame of this arc
    frame: Any
    frame_inverse: Any

    def moved(self, columns, time):
        """Propagate columns from the frame at the start of the arc to the frame at its end."""
        return moved(self.law, self.transition * columns, time - self.time)


class Path:
    """The nodes of a motion, and its equations.

    `codes` are the contact codes of all meshes at the start, `events` (phase, mesh, code before,
    code after, ...) in their order, phases counted on over the periods; `scale` is 1 / nu, a ball.
    """

    def __init__(self, laws, codes, events, period, scale=None):
        self.laws, self.codes = laws, tuple(codes)
        self.scale = 1 / laws.tuning if scale is None else scale
        #: Nodes; numbers of those at which a common period ends; phases near those of contacts.
        self.nodes, self.period_ends, self.guess = [], [], []
        self._set_nodes(events, period)
        self._set_arcs()

    def _set_nodes(self, events, period):
        """Set the nodes of the path from switches of the stiffness and contact events."""
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
            distance = laws.distances[mesh][side]
            self.nodes.append(Node(law, None, mesh, side, distance, before, after))
            codes[mesh] = after
        self.nodes.append(Node(laws.law(codes, segment), turn * period))

    def _set_arcs(self):
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

    def _frame(self, node, columns):
        """Return the orthonormal frame at a node from the propagated frame of the last node."""
        n, frame = self.laws.state_count, np.eye(self.laws.size)
        axes = np.array([[float(value) for value in row[:n]] for row in columns.tolist()[:n]])
        # The longest direction comes first, because it decides the orientation of the box.
        axes = axes[:, np.argsort(-np.linalg.norm(axes, axis=0), kind="stable")]
        if node.phase is None:
            # The normal of the flank line comes first, so that a contact fixes this component.
            across = [float(value) for value in node.distance.entries()[:n]]
            axes = np.column_stack([across, axes])
        frame[:n, :n], _ = np.linalg.qr(axes)
        return matrix_of(frame)

    def phases(self, contact_phases):
        """Return the phase of every node."""
        remaining = iter(contact_phases)
        return [next(remaining) if node.phase is None else node.phase for node in self.nodes]

    def start(self, state, unknown_count):
        """Return modal components at the start and their derivatives, (size, 1 + unknowns)."""
        waves = [1, 0] * len(self.laws.wave_columns)
        columns = flint().arb_mat(self.laws.size, 1 + unknown_count)
        for i, value in enumerate([*state, 1, *waves]):
            columns[i, 0] = value
        for i in range(len(state)):
            columns[i, 1 + i] = 1
        return self.laws.basis_inverse * columns

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

    def monodromy(self, rows):
        """Return the monodromy matrix of y and dy/dtheta, with all phases eliminated."""
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

    def determinant(self, arcs):
        """Return the determinant of the monodromy matrix by Liouville's formula."""
        both = zip(self.nodes, arcs, strict=True)
        return sum((node.law.trace() * time for node, (_, time) in both), flint().arb(0)).exp()


def _projection_to_line(row):
    """Return the projection of framed states to the flank line, along their first axis."""
    across, *others = row.entries()
    matrix = identity(len(others) + 1)
    for i, value in enumerate([0, *(-value / across for value in others)]):
        matrix[0, i] = value
    return matrix


def smallest_interval():
    """Return the phase interval below which neighbouring contacts share a window."""
    return flint().arb(2) ** -(flint().ctx.prec // 2)


class Windows:
    """A `Path` with windows of time around contacts that come together."""

    def __init__(self, path, phases):
        self.path, self.laws = path, path.laws
        #: (Numbers of the nodes that are passed together, phase).
        self.groups: list = []
        last = None
        for i, (node, phase) in enumerate(zip(path.nodes, path.phases(phases), strict=True)):
            is_contact = node.phase is None
            if is_contact and last is not None and phase - last < smallest_interval():
                self.groups[-1][0].append(i)
            else:
                self.groups.append(([i], phase))
            last = phase if is_contact else None

    def any(self):
        """Return whether there are contacts that come together."""
        return any(len(numbers) > 1 for numbers, _ in self.groups)

    def equations(self, unknowns):
        """Return (residuals, rows of their derivatives) of the return to the initial state."""
        ends, rows, *_ = self.run(unknowns)
        for i, row in enumerate(rows):
            row[i] -= 1
        return [end - value for end, value in zip(ends, unknowns, strict=True)], rows

    def run(self, unknowns, prove=False):
        """Return (state at the end, rows of its derivatives, phases, speeds, states at switches).

        A phase is a ball that holds a whole window; speeds are those of the distances by theta.
        Only where `prove` is set is it proven that no mesh comes to a flank line between windows.
        """
        module, laws, path = flint(), self.laws, self.path
        n, codes = len(unknowns), list(path.codes)
        columns = path.start(unknowns, n)
        start, time, phases, speeds, switches = first_column(columns), 0, [], [], {}
        for numbers, phase in self.groups:
            node, arc = path.nodes[numbers[0]], path.arcs[numbers[0]]
            end, half = phase * path.scale, 0
            if node.phase is None:
                near = arc.frame * arc.moved(first_column(columns), end - time)
                half = self._half_width(
                    numbers, near, _PROOF_WINDOW_RATIO if prove else _WINDOW_RATIO
                )
            duration = end - half - time
            if not duration > 0:
                text = "from others, a switch of a stiffness or the start of the orbit"
                text = f"contacts that come together cannot be told apart {text}"
                raise Uncertain("together", text)
            columns = arc.moved(columns, duration)
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

    def _half_width(self, numbers, state, ratio):
        """Return half the length of a window around contacts from a modal state near them."""
        largest = flint().arb(2) ** -(0.7 * flint().ctx.prec)
        for node in (self.path.nodes[i] for i in numbers):
            distance = (node.distance * state)[0, 0]
            rate = (node.distance * (node.law * state))[0, 0]
            if not (rate > 0 or rate < 0):
                raise Uncertain(*_NO_CROSSINGS)
            largest = max(largest, (ratio * abs(distance).upper() / abs(rate).lower()).upper())
        return largest

    def _crossed(self, numbers, state, length, codes):
        """Pass a window: return (map of deviations, state behind it, speeds) and set `codes`."""
        module, laws, nodes = flint(), self.laws, self.path.nodes
        e, size, arb = len(laws.retained), laws.size, module.arb
        matrices = [nodes[i].law for i in [*numbers, numbers[-1] + 1]]
        changes = [after - before for before, after in pairwise(matrices)]
        bound = norm(matrices[0]) + sum(map(norm, changes), arb(0))
        eta = (bound * length).expm1().upper()
        room = arb(0, (eta * max(abs(value).upper() for value in state.entries())).upper())
        within = state + column_of([room] * size)
        rate, jumps = matrices[0] * within, [change * within for change in changes]
        end = state + sum((jump * arb(0.5, 0.5) for jump in jumps), rate) * length
        speeds = self._checked_speeds(numbers, state, within, end, rate, codes)
        transition, growth = identity(size), arb(1)
        for i, jump, speed in zip(numbers, jumps, speeds, strict=True):
            # Forces change velocities only.
            values = [value if e <= k < 2 * e else 0 for k, value in enumerate(jump.entries())]
            saltation = column_of(values) * nodes[i].distance * (1 / speed)
            transition += saltation
            growth *= 1 + norm(saltation)
        remainder = arb(0, (((1 + eta) ** (len(numbers) + 1) - 1) * growth).upper())
        return transition + module.arb_mat(size, size, [remainder] * size**2), end, speeds

    def _checked_speeds(self, numbers, begin, within, end, rate, codes):
        """Prove that each mesh crosses its line once; return the speeds and set `codes`."""
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
