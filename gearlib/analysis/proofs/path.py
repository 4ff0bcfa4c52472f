"""An orbit as a system of equations: its state, all phases of its contacts, and their derivatives.

A path runs from tau = 0 through nodes: switches of the stiffness at known phases, contacts gained
and lost at unknown ones. Unknowns are the state at tau = 0, (y, dy/dtheta) of its laws, and the
phases of the contacts. The equations: at each contact the mesh's distance from its flank line is 0;
the state returns. Arcs are linear flows, so is the derivative.
"""

from dataclasses import dataclass
from typing import Any

from gearlib.analysis.proofs import arcs
from gearlib.analysis.proofs.balls import COARSE, flint, precision
from gearlib.analysis.proofs.certificate_files import Uncertain
from gearlib.kernels.codes import NORMAL

#: Numbers of the two sides of a tooth, as in tables of the models.
COAST, DRIVE = 0, 1
SWITCH, CONTACT, END = range(3)
#: Most arcs of an orbit.
_MOST = 1000


@dataclass(frozen=True)
class Node:
    """Where one arc ends and the next begins."""

    kind: int
    law: Any  #: of the arc that ends here
    phase: Any = None  #: a ball; None: unknown
    mesh: int = -1  #: of a contact
    side: int = DRIVE  #: of the flank line that is crossed
    before: int = 0  #: contact code of the mesh before
    after: int = 0


class Path:
    """The nodes of a motion, and its equations.

    `codes` are the contact codes of all meshes at the start, `events` (phase, mesh, code before,
    code after, ...) in their order, phases counted on over the periods. `framed`: whether boxes
    turn with the motion, of use where there are many coordinates, and they are wide, or the bits
    are many; by default as the laws have it.
    """

    def __init__(self, laws, codes, events, period, framed=None):
        arb, now = flint().arb, list(codes)
        self.laws, self.codes = laws, tuple(codes)
        turn = 2 * arb.pi()
        end = turn * period
        marks: list = []
        segment = 0
        for n in range(0, period + laws.repeats, laws.repeats):
            for i, (phase, following) in enumerate(laws.segments):
                at = phase + turn * n
                if at < end and at > 0:
                    marks.append((at, SWITCH, (following, i == 0)))
                elif not at > 0:
                    segment = following
        marks += [(arb(phase), CONTACT, what[:3]) for phase, *what in events]
        if len(marks) >= _MOST:
            raise Uncertain("together", f"{len(marks)} arcs are too many: {_MOST} are allowed")
        # Events that floats do not tell apart stay in their order.
        marks.sort(key=lambda mark: float(mark[0].mid()))
        #: Numbers of the nodes at which a common period ends, and the next one begins.
        self.ends = []
        self.nodes, self.guess = [], []
        for phase, kind, what in marks:
            law = laws.law(now, segment)
            if kind == SWITCH:
                segment, whole = what
                if whole:
                    self.ends.append(len(self.nodes))
                self.nodes.append(Node(SWITCH, law, phase))
                continue
            self.guess.append(phase)
            mesh, before, after = what
            if before != now[mesh]:
                raise Uncertain("contacts", "the contacts do not follow from each other")
            side = DRIVE if NORMAL in (before, after) else COAST
            self.nodes.append(Node(CONTACT, law, None, mesh, side, before, after))
            now[mesh] = after
        self.nodes.append(Node(END, laws.law(now, segment), end))
        framed = laws.framed if framed is None else framed
        if framed:
            self.arcs = arcs.framed(self)
        else:
            self.arcs = [arcs.Arc(node.law) for node in self.nodes]

    def phases(self, unknown):
        """Return the phase of every node; `unknown` are those that are not known."""
        unknown = iter(unknown)
        return [next(unknown) if node.phase is None else node.phase for node in self.nodes]

    def contacts(self):
        """Return the nodes at which contact is gained or lost."""
        return [node for node in self.nodes if node.kind == CONTACT]

    def column(self, state):
        """Return z~ at the start, shape (size, 1), of (y, dy/dtheta)."""
        values = [*state, 1, *[1, 0] * len(self.laws.frequencies)]
        return self.laws.inverse * flint().arb_mat(len(values), 1, values)

    def equations(self, unknowns, scale, bits=None):
        """Return (residuals, derivatives by the unknowns, a row each).

        Unknowns are state and phases, `scale` is 1 / nu. `bits` are those of the derivatives, by
        default as many as Newton's method has a use for.
        """
        arb_mat, laws = flint().arb_mat, self.laws
        n, size, m = 2 * len(laws.kept), laws.size, len(unknowns)
        bits = bits or max(COARSE, flint().ctx.prec // 3)
        z, slopes = self.column(unknowns[:n]), arb_mat(size, m)
        for i in range(size):
            for j in range(n):
                slopes[i, j] = laws.inverse[i, j]
        residuals, rows = [], []
        last, last_column, column = 0, None, n
        phases = self.phases(unknowns[n:])
        for node, phase, arc in zip(self.nodes, phases, self.arcs, strict=True):
            t = (phase - last) * scale
            turn = arc.turn(t)
            if last_column is not None:
                # The later the arc begins, the less of it there is.
                arcs.add(slopes, last_column, arc.begins * z * -scale)
            z = arc.go(z, t, turn)
            with precision(bits):
                slopes = arc.after(slopes, turn)
            last, last_column = phase, None
            if node.phase is None:
                arcs.add(slopes, column, arc.ends * z * scale)
                last_column, column = column, column + 1
            if node.kind == CONTACT:
                row = laws.distances[node.mesh][node.side]
                row = row if arc.frame is None else row * arc.frame
                residuals.append((row * z)[0, 0])
                rows.append((row * slopes).entries())
                place = None if arc.frame is not None else laws.on_line(node.side)
                if place is not None:
                    # From here on the state lies on the line, as the equation says.
                    z, slopes = place * z, place * slopes
        ends = laws.basis if arc.frame is None else laws.basis * arc.frame
        z, slopes = ends * z, ends * slopes
        for i in range(n):
            residuals.append(z[i, 0] - unknowns[i])
            row = [slopes[i, j] for j in range(m)]
            row[i] -= 1
            rows.append(row)
        return residuals, rows

    def states(self, unknowns, scale):
        """Return (z~ at the start, time) of every arc, and z~ at the nodes."""
        n, last, laws = 2 * len(self.laws.kept), 0, self.laws
        z = start = self.column(unknowns[:n])
        begins, ends = [], []
        phases = self.phases(unknowns[n:])
        for node, phase, arc in zip(self.nodes, phases, self.arcs, strict=True):
            t = (phase - last) * scale
            begins.append((start, t))
            z = arc.go(z, t)
            if node.kind == CONTACT and arc.frame is None:
                place = laws.on_line(node.side)
                z = z if place is None else place * z
            start = arc.out(z)
            ends.append(start)
            last = phase
        return begins, ends

    def monodromy(self, rows):
        """Return the map of small deviations of y and dy/dtheta, from rows of `equations`.

        The phases of the contacts follow from the state: by the derivative of an implicit function.
        """
        arb_mat, n = flint().arb_mat, 2 * len(self.laws.kept)
        k = len(rows) - n
        back = arb_mat([row[:n] for row in rows[k:]])
        for i in range(n):
            back[i, i] += 1
        if not k:
            return back
        by_phases = arb_mat([row[n:] for row in rows[:k]])
        try:
            rates = by_phases.solve(arb_mat([row[:n] for row in rows[:k]]))
        except ZeroDivisionError:
            raise Uncertain("grazing", "a contact is not proven to be a crossing") from None
        return back - arb_mat([row[n:] for row in rows[k:]]) * rates

    def deviations(self, begins, ends):
        """Return the map of small deviations, of `states` of wide boxes: saltation at contacts."""
        laws, whole = self.laws, arcs.unit(self.laws.size)
        for i, (node, (_, t), end) in enumerate(zip(self.nodes, begins, ends, strict=True)):
            whole = node.law.flow(t) * whole
            if node.kind == CONTACT:
                row = laws.distances[node.mesh][node.side]
                kick = laws.kick(node.law, self.nodes[i + 1].law, end, row)
                whole += kick * (row * whole)
        return self._reduced(whole)

    def _reduced(self, matrix):
        """Return what a map of z~ does to (y, dy/dtheta)."""
        n, whole = 2 * len(self.laws.kept), self.laws.basis * matrix * self.laws.inverse
        return flint().arb_mat([row[:n] for row in whole.tolist()[:n]])

    def determinant(self, times):
        """Return that of the map, of the times of all arcs: by Liouville's formula.

        Saltation has the determinant 1.
        """
        loss = flint().arb(0)
        for node, t in zip(self.nodes, times, strict=True):
            matrix = node.law.matrix
            loss += sum((matrix[i, i] for i in range(self.laws.size)), flint().arb(0)) * t
        return loss.exp()
