"""An orbit of a train as a system of equations, with its derivatives.

As in `gearlib.analysis.proofs.path`, with exponentials of matrices for closed forms: unknowns are
the state at tau = 0, (y, dy/dtheta) of `TrainLaws`, and the phases at which contact is gained or
lost in any of the meshes. The equations: there the mesh's distance from its flank line is 0; the
state returns.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from gearlib.analysis.proofs.balls import COARSE, flint, precision
from gearlib.analysis.proofs.path import Uncertain
from gearlib.analysis.proofs.trains.laws import norm
from gearlib.analysis.proofs.trains.parts import COAST, DRIVE
from gearlib.kernels.codes import NORMAL

#: Most arcs of an orbit.
_MOST = 1000
#: Of an arc that hardly turns or stretches a box: its time by the norm of its law.
_SHORT = 0.125


@dataclass(frozen=True)
class Node:
    """Where one arc ends and the next begins."""

    law: Any  #: matrix of the arc that ends here
    phase: Any = None  #: a ball; None: unknown
    mesh: int = -1  #: of a contact
    side: int = DRIVE  #: of the flank line that is crossed
    before: int = 0  #: contact code of the mesh before
    after: int = 0


class Arc(NamedTuple):
    """An arc in the frames of its ends: z~ = frame c."""

    base: Any  #: time near to that of the arc; where both ends are known the time itself
    power: Any  #: exponential of that time, from the frame before to that of this arc
    begins: Any  #: the law in the frame before; None where the arc begins at a known phase
    law: Any  #: the law in the frame of this arc; None where it ends at a known phase
    frame: Any
    back: Any  #: its inverse

    def turn(self, t):
        """Return the exponential of what a time differs from the base by; None: by nothing."""
        law = self.begins if self.law is None else self.law
        return None if law is None else (law * (t - self.base)).exp()

    def after(self, z, turn):
        """Return columns in the frame before after `turn` of a time, in the frame of this arc."""
        if turn is None:
            return self.power * z
        return turn * (self.power * z) if self.law is not None else self.power * (turn * z)

    def go(self, z, t):
        """Return columns in the frame before after a time, in the frame of this arc."""
        return self.after(z, self.turn(t))


class TrainPath:
    """The nodes of a motion of a train, and its equations.

    Parameters
    ----------
    laws : TrainLaws
    codes : list of int
        Contact codes of all meshes at tau = 0.
    events : list of (phase, mesh, code before, code after)
        In their order; phases, floats or balls, count on over the periods.
    period : int
    framed : bool
        Whether boxes turn with the motion; of use where they are wide, or the bits are many.
    """

    def __init__(self, laws, codes, events, period, framed=True):
        arb, now = flint().arb, list(codes)
        self.laws, self.scale = laws, 1 / laws.tuning
        turn = 2 * arb.pi()
        marks = [
            (turn * arb((cut + n).numerator) / (cut + n).denominator, segment, None)
            for n in range(0, period, laws.repeats)
            for cut, segment in laws.segments
        ]
        marks = marks[1:] + [(arb(phase), None, what) for phase, *what in events]
        if len(marks) >= _MOST:
            raise Uncertain("together", f"{len(marks)} arcs are too many: {_MOST} are allowed")
        # Events that floats do not tell apart stay in their order.
        marks.sort(key=lambda mark: float(mark[0].mid()))
        #: Numbers of the nodes at which a common period ends, and the next one begins.
        self.ends, segment = [], 0
        self.nodes, self.guess = [], []
        for phase, following, what in marks:
            law = laws.law(now, segment)
            if what is None:
                if following == 0:
                    self.ends.append(len(self.nodes))
                self.nodes.append(Node(law, phase))
                segment = following
                continue
            mesh, before, after = what
            if before != now[mesh]:
                raise Uncertain("contacts", "the contacts do not follow from each other")
            side = DRIVE if NORMAL in (before, after) else COAST
            self.nodes.append(Node(law, None, mesh, side, before, after))
            self.guess.append(phase)
            now[mesh] = after
        self.nodes.append(Node(laws.law(now, segment), turn * period))
        self.arcs = self._frames(framed)

    def phases(self, unknown):
        """Return the phase of every node; `unknown` are those that are not known."""
        unknown = iter(unknown)
        return [next(unknown) if node.phase is None else node.phase for node in self.nodes]

    def _frames(self, framed):
        """Return the `Arc` of every node: exponentials at about the times that arcs will last.

        Frames are orthogonal, by the QR method of Lohner: boxes turn with the motion, and hardly
        grow by being wrapped anew after every arc. A short arc keeps the frame before.
        """
        n = 2 * len(self.laws.kept)
        frame = back = _unit(self.laws.size)
        spread, found, last, known = np.eye(n), [], 0, True
        for node, phase in zip(self.nodes, self.phases(self.guess), strict=True):
            starts_known, known = known, node.phase is not None
            base = (phase - last) * self.scale
            if not (starts_known and known):
                base = base.mid()
            law = None
            if not framed:
                begins = law = node.law
                power = self.laws.flow(law, base)
            elif abs(base) * norm(node.law) < _SHORT:
                begins = law = back * node.law * frame
                power = (law * base).exp()
            else:
                flow = self.laws.flow(node.law, base)
                begins = None if starts_known else back * node.law * frame
                spread = _floats(flow)[:n, :n] @ spread
                # The longest direction first: it decides how the box lies.
                order = np.argsort(-np.linalg.norm(spread, axis=0), kind="stable")
                spread, _ = np.linalg.qr(spread[:, order])
                power, frame = flow * frame, _unit(self.laws.size)
                for i in range(n):
                    for j in range(n):
                        frame[i, j] = float(spread[i, j])
                back = frame.inv()
                power = back * power
                law = None if known else back * node.law * frame
            found.append(Arc(base, power, begins, law, frame, back))
            last = phase
        return found

    def equations(self, unknowns, bits=None):
        """Return (residuals, derivatives, a row each) by the unknowns (y, dy/dtheta, phases).

        Derivatives with so many bits; by default with as many as Newton's method has a use for.
        """
        arb_mat, laws = flint().arb_mat, self.laws
        n, size, m = 2 * len(laws.kept), laws.size, len(unknowns)
        bits = bits or max(COARSE, flint().ctx.prec // 3)
        z = laws.inverse * arb_mat([[value] for value in [*unknowns[:n], *laws.rest()]])
        slopes = arb_mat(size, m)
        for i in range(size):
            for j in range(n):
                slopes[i, j] = laws.inverse[i, j]
        residuals, rows = [], []
        last, last_column, column = 0, None, n
        phases = self.phases(unknowns[n:])
        for node, phase, arc in zip(self.nodes, phases, self.arcs, strict=True):
            if last_column is not None:
                # The later the arc begins, the less of it there is.
                _add(slopes, last_column, arc.begins * z * -self.scale)
            turn = arc.turn((phase - last) * self.scale)
            z = arc.after(z, turn)
            with precision(bits):
                slopes = arc.after(slopes, turn)
            last, last_column = phase, None
            if node.phase is None:
                _add(slopes, column, arc.law * z * self.scale)
                distance = laws.distances[node.mesh][node.side] * arc.frame
                residuals.append((distance * z)[0, 0])
                rows.append((distance * slopes).entries())
                last_column = column
                column += 1
        ends = laws.basis * self.arcs[-1].frame
        z, slopes = ends * z, ends * slopes
        for i in range(n):
            residuals.append(z[i, 0] - unknowns[i])
            row = [slopes[i, j] for j in range(m)]
            row[i] -= 1
            rows.append(row)
        return residuals, rows

    def states(self, unknowns):
        """Return (z~ at the start, time) of every arc, and z~ at the nodes."""
        arb_mat, n, last = flint().arb_mat, 2 * len(self.laws.kept), 0
        z = self.laws.inverse * arb_mat([[value] for value in [*unknowns[:n], *self.laws.rest()]])
        arcs, ends = [], []
        phases = self.phases(unknowns[n:])
        start = z
        for phase, arc in zip(phases, self.arcs, strict=True):
            t = (phase - last) * self.scale
            arcs.append((start, t))
            z = arc.go(z, t)
            start = arc.frame * z
            ends.append(start)
            last = phase
        return arcs, ends

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
        rates = by_phases.solve(arb_mat([row[:n] for row in rows[:k]]))
        return back - arb_mat([row[n:] for row in rows[k:]]) * rates


def _add(matrix, column, values):
    """Add values, shape (n, 1), to a column of a matrix."""
    for i, value in enumerate(values.entries()):
        matrix[i, column] += value


def _unit(n):
    """Return the unit matrix."""
    return flint().arb_mat([[int(i == j) for j in range(n)] for i in range(n)])


def _floats(matrix):
    return np.array([[float(value) for value in row] for row in matrix.tolist()])
