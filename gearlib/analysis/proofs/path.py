"""An orbit as a system of equations: its state, all phases of its contacts, and their derivatives.

A path runs from tau = 0 through nodes: switches of the stiffness at known phases, contacts gained
and lost at unknown ones, perhaps a touch of a flank line. Unknowns are the state (x, w) at tau = 0,
w = dx/dt, the phases of the contacts, that of the touch, and 1 / nu where the tuning is asked for
as well. The equations: x lies on the flank line at each contact; at a touch w = 0 too; the state
returns. All flights are closed forms, so is the derivative.
"""

from dataclasses import dataclass
from typing import Any

from gearlib.analysis.proofs.balls import flint

SWITCH, CONTACT, TOUCH, END = range(4)


@dataclass(frozen=True)
class Node:
    """Where one arc ends and the next begins."""

    kind: int
    law: Any  #: of the arc that ends here
    phase: Any = None  #: a ball; None: unknown
    before: int = 0  #: contact code of the arc that ends here
    after: int = 0


class Uncertain(Exception):
    """A step of a proof failed: (status, sentence)."""


class Path:
    """The nodes of a motion over mesh periods.

    Parameters
    ----------
    laws : Laws
    contact : int
        Contact code at tau = 0.
    events : list of (phase, code before, code after)
        As a run in floating point has them; phases count on over the periods.
    period : int
    touch : tuple, optional
        Phase at which a flank line is touched, and its displacement.
    start : arb, default 0
        Mesh phase from 0 to 2 pi, away from a switch, at which the path begins and ends.

    Raises
    ------
    Uncertain
        If an event and a switch of the stiffness cannot be told apart.
    """

    def __init__(self, laws, contact, events, period, touch=None, start=0):
        arb = flint().arb
        self.laws, self.contact, self.start = laws, contact, arb(start)
        turn = 2 * arb.pi()
        end = self.start + period * turn
        switches = [
            (phase + n * turn, SWITCH, segment)
            for n in range(period + 1)
            for phase, segment in laws.switches
        ]
        segment = laws.first
        for phase, _, following in switches:
            if phase < self.start:
                segment = following
        marks = [mark for mark in switches if self.start < mark[0] < end]
        marks += [(arb(phase), CONTACT, (before, after)) for phase, before, after in events]
        if touch is not None:
            phase, self.touched = touch
            marks.append((arb(phase), TOUCH, None))
        marks.sort(key=lambda mark: float(mark[0].mid()))
        self.nodes, self.guess = [], []
        for phase, kind, what in marks:
            law = laws.law(contact, segment)
            if kind == SWITCH:
                self.nodes.append(Node(SWITCH, law, phase, contact, contact))
                segment = what
                continue
            before, after = what or (contact, contact)
            if before != contact:
                raise Uncertain("contacts", "the contacts do not follow from each other")
            self.nodes.append(Node(kind, law, None, before, after))
            self.guess.append(phase)
            contact = after
        self.nodes.append(Node(END, laws.law(contact, segment), end, contact, contact))

    def phases(self, unknown):
        """Return the phase of every node; `unknown` are those that are not known."""
        unknown = iter(unknown)
        return [next(unknown) if node.phase is None else node.phase for node in self.nodes]

    def line(self, node):
        """Return the flank line of a contact or of a touch."""
        touches = node.kind == TOUCH
        return self.touched if touches else self.laws.line(node.before, node.after)

    def equations(self, unknowns, scale=None):
        """Return (residuals, derivatives by the unknowns, a row each).

        Parameters
        ----------
        unknowns : list of arb
            x, w, phases; 1 / nu if `scale` is not given.
        scale : arb, optional
            1 / nu.
        """
        n, free = len(unknowns), scale is None
        if free:
            scale = unknowns[-1]
        x, w = unknowns[:2]
        gx, gw = [0] * n, [0] * n
        gx[0] = gw[1] = 1
        residuals, rows = [], []
        last, last_column, column = self.start, None, 2
        for node, phase in zip(self.nodes, self.phases(unknowns[2 : n - free]), strict=True):
            law, span = node.law, phase - last
            t = span * scale
            speed = w, law.acceleration(x, w, last)
            x, w, (p11, p12, p21, p22) = law.go(x, w, t, last)
            a = law.acceleration(x, w, phase)
            if last_column is not None:
                # The later the arc begins, the less of it there is.
                gx[last_column] -= scale * speed[0]
                gw[last_column] -= scale * speed[1]
            gx, gw = (
                [p11 * i + p12 * j for i, j in zip(gx, gw, strict=True)],
                [p21 * i + p22 * j for i, j in zip(gx, gw, strict=True)],
            )
            moved, last, last_column = [], phase, None
            if node.phase is None:
                moved.append((column, scale))
                last_column = column
                column += 1
            if free:
                moved.append((n - 1, span))
            for i, rate in moved:
                gx[i] += w * rate
                gw[i] += a * rate
            if node.kind in (CONTACT, TOUCH):
                line = self.line(node)
                residuals.append(x - line)
                rows.append(gx)
                # From here on the state lies on the line, as the equation says.
                x, gx = line, [0] * n
                if node.kind == TOUCH:
                    residuals.append(w)
                    rows.append(gw)
                    w, gw = flint().arb(0), [0] * n
        gx[0] -= 1
        gw[1] -= 1
        return [*residuals, x - unknowns[0], w - unknowns[1]], [*rows, gx, gw]

    def states(self, x, w, unknown, scale):
        """Return (x, w, phase, time since the last node) at each node, x the line where it is."""
        found, last = [], self.start
        for node, phase in zip(self.nodes, self.phases(unknown), strict=True):
            t = (phase - last) * scale
            x, w, _ = node.law.go(x, w, t, last)
            if node.kind in (CONTACT, TOUCH):
                x = self.line(node)
            if node.kind == TOUCH:
                w = flint().arb(0)
            found.append((x, w, phase, t))
            last = phase
        return found

    def contacts(self, states, scale):
        """Return [(phase, code before, code after, dx/dtau)] of the contacts, from `states`."""
        return [
            (phase, node.before, node.after, w * scale)
            for node, (_, w, phase, _) in zip(self.nodes, states, strict=True)
            if node.kind == CONTACT
        ]

    def monodromy(self, times):
        """Return (map of small deviations over the whole path, its determinant).

        Of the times since the last node, one for each. Rows one after the other, by (x, w); with
        the saltation of Eq. (20) at every contact, and the determinant by Liouville's formula:
        saltation has the determinant 1.
        """
        matrix, loss = (1, 0, 0, 1), 0
        for node, t in zip(self.nodes, times, strict=True):
            matrix = product(node.law.matrix(t), matrix)
            if node.kind == CONTACT:
                matrix = product((1, 0, self.laws.kick(node.before, node.after), 1), matrix)
            loss -= 2 * node.law.damping * t
        return matrix, flint().arb(loss).exp()

    def trace(self, unknowns):
        """Return (trace of the map, its determinant, the derivatives of both by the unknowns).

        The map depends on the phases of the contacts and on 1 / nu, the last unknown, alone.
        """
        scale = unknowns[-1]
        phases = self.phases(unknowns[2:-1])
        arcs, kicks, last = [], [], self.start
        for node, phase in zip(self.nodes, phases, strict=True):
            arcs.append(node.law.matrix((phase - last) * scale))
            kick = self.laws.kick(node.before, node.after) if node.kind == CONTACT else 0
            kicks.append((1, 0, kick, 1))
            last = phase
        ahead, behind = [(1, 0, 0, 1)], (1, 0, 0, 1)
        for arc, kick in zip(arcs, kicks, strict=True):
            ahead.append(product(kick, product(arc, ahead[-1])))
        total = ahead[-1]
        slopes, exponents = [0] * len(unknowns), [0] * len(unknowns)
        column, loss = len(unknowns) - 2, 0
        for i in range(len(arcs) - 1, -1, -1):
            node = self.nodes[i]
            span = phases[i] - (phases[i - 1] if i else self.start)
            # The end of this arc moves: it lasts longer, the next one is shorter.
            here = product(kicks[i], product(node.law.generator(), product(arcs[i], ahead[i])))
            slopes[-1] += span * mixed_trace(behind, here)
            exponents[-1] -= 2 * node.law.damping * span
            loss -= 2 * node.law.damping * span * scale
            if node.phase is None:
                after = self.nodes[i + 1].law
                there = product(after.generator(), ahead[i + 1])
                slopes[column] = scale * (mixed_trace(behind, here) - mixed_trace(behind, there))
                exponents[column] = scale * 2 * (after.damping - node.law.damping)
                column -= 1
            behind = product(behind, product(kicks[i], arcs[i]))
        determinant = flint().arb(loss).exp()
        return (
            total[0] + total[3],
            determinant,
            slopes,
            [determinant * rate for rate in exponents],
        )


def product(a, b):
    """Return the product of two matrices, rows one after the other."""
    return (
        a[0] * b[0] + a[1] * b[2],
        a[0] * b[1] + a[1] * b[3],
        a[2] * b[0] + a[3] * b[2],
        a[2] * b[1] + a[3] * b[3],
    )


def mixed_trace(a, b):
    """Return the trace of a product of two matrices."""
    return a[0] * b[0] + a[1] * b[2] + a[2] * b[1] + a[3] * b[3]
