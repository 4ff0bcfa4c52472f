"""An orbit of a train as a system of equations, with its derivatives.

As in `gearlib.analysis.proofs.path`, with exponentials of matrices for closed forms: unknowns are
the state at tau = 0, (y, dy/dtheta) of `TrainLaws`, and the phases at which contact is gained or
lost in any of the meshes. The equations: there the mesh's distance from its flank line is 0; the
state returns.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from gearlib.analysis.proofs.balls import flint
from gearlib.analysis.proofs.path import Uncertain
from gearlib.analysis.proofs.trains.parts import COAST, DRIVE
from gearlib.kernels.codes import NORMAL

#: Most arcs of an orbit.
_MOST = 1000


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

    base: Any  #: time near to that of the arc
    power: Any  #: exponential of that time, from the frame before to that of this arc
    begins: Any  #: the law in the frame before
    law: Any  #: the law in the frame of this arc
    frame: Any
    back: Any  #: its inverse

    def go(self, z, t):
        """Return columns in the frame before after a time, in the frame of this arc."""
        return (self.law * (t - self.base)).exp() * (self.power * z)


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
    """

    def __init__(self, laws, codes, events, period):
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
        self.arcs = self._frames()

    def phases(self, unknown):
        """Return the phase of every node; `unknown` are those that are not known."""
        unknown = iter(unknown)
        return [next(unknown) if node.phase is None else node.phase for node in self.nodes]

    def _frames(self):
        """Return the `Arc` of every node: exponentials at about the times that arcs will last.

        Frames are orthogonal, by the QR method of Lohner: boxes turn with the motion, and hardly
        grow by being wrapped anew after every arc.
        """
        n = 2 * len(self.laws.kept)
        frame = back = _unit(self.laws.size)
        spread, found, last = np.eye(n), [], 0
        for node, phase in zip(self.nodes, self.phases(self.guess), strict=True):
            base = ((phase - last) * self.scale).mid()
            power, begins = (node.law * base).exp(), back * node.law * frame
            spread = _floats(power)[:n, :n] @ spread
            # The longest direction first: it decides how the box lies.
            order = np.argsort(-np.linalg.norm(spread, axis=0), kind="stable")
            spread, _ = np.linalg.qr(spread[:, order])
            old, frame = frame, _unit(self.laws.size)
            for i in range(n):
                for j in range(n):
                    frame[i, j] = float(spread[i, j])
            back = frame.inv()
            law = back * node.law * frame
            found.append(Arc(base, back * power * old, begins, law, frame, back))
            last = phase
        return found

    def equations(self, unknowns):
        """Return (residuals, derivatives, a row each) by the unknowns (y, dy/dtheta, phases)."""
        arb_mat, laws = flint().arb_mat, self.laws
        n, size, m = 2 * len(laws.kept), laws.size, len(unknowns)
        # The state, and its derivatives behind it.
        z = arb_mat(size, 1 + m)
        for i, value in enumerate([*unknowns[:n], *laws.rest()]):
            z[i, 0] = value
            if i < n:
                z[i, 1 + i] = 1
        z = laws.inverse * z
        residuals, rows = [], []
        last, last_column, column = 0, None, n + 1
        phases = self.phases(unknowns[n:])
        for node, phase, arc in zip(self.nodes, phases, self.arcs, strict=True):
            if last_column is not None:
                # The later the arc begins, the less of it there is.
                self._move(z, arc.begins, last_column, -self.scale)
            z = arc.go(z, (phase - last) * self.scale)
            last, last_column = phase, None
            if node.phase is None:
                self._move(z, arc.law, column, self.scale)
                distance = laws.distances[node.mesh][node.side] * arc.frame
                residual, *row = (distance * z).entries()
                residuals.append(residual)
                rows.append(row)
                last_column = column
                column += 1
        z = laws.basis * (self.arcs[-1].frame * z)
        for i in range(n):
            residuals.append(z[i, 0] - unknowns[i])
            row = [z[i, 1 + j] for j in range(m)]
            row[i] -= 1
            rows.append(row)
        return residuals, rows

    @staticmethod
    def _move(z, law, column, rate):
        """Add what a later phase adds to the state to a column of its derivatives."""
        state = flint().arb_mat([[z[i, 0]] for i in range(z.nrows())])
        for i, value in enumerate((law * state).entries()):
            z[i, column] += value * rate

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


def _unit(n):
    """Return the unit matrix."""
    return flint().arb_mat([[int(i == j) for j in range(n)] for i in range(n)])


def _floats(matrix):
    return np.array([[float(value) for value in row] for row in matrix.tolist()])
