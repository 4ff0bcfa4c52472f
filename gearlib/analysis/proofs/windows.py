"""Contacts of several meshes at once: an orbit as a fixed point, whatever their order.

Around contacts that come together a window of time is laid, in which each of their meshes is proven
to cross its flank line once, at a speed that does not vanish, and no other mesh to touch one. With
A + sum_j s_j dA_j for the law in the window, each s_j 0 or 1, and a a bound of its norm, the state
moves there by no more than e^(a h) - 1 of its norm. The derivative of the flow through it is a
product of exponentials near I and of saltations S_j = I + D_j, D_j = dA_j z b_j^T / d_j'. Since b_j
has entries at displacements and dA_j z at rates only, D_i D_j = 0: in every order the product is
I + sum_j D_j, up to ((1 + eta)^(m + 1) - 1) prod_j (1 + |D_j|) with eta = e^(a h) - 1.

The flow is continuous, and smooth for each order; so Krawczyk's test holds with this derivative.
"""

from typing import Any, NamedTuple

from gearlib.analysis.proofs.arcs import norm
from gearlib.analysis.proofs.balls import COARSE, flint, precision
from gearlib.analysis.proofs.certificate_files import Uncertain
from gearlib.analysis.proofs.signs import JAMMED, bounds_of, check_arc, overlaps

#: By how much wider a window is than what is known of its contacts; more where signs next to it
#: are to be proven.
_ROOM, _WIDE = 4, 32
_STATUS = "together", "contacts that come together are not proven to be crossings"


def close():
    """Return how near contacts come to each other that share a window."""
    return flint().arb(2) ** -(flint().ctx.prec // 2)


class Crossed(NamedTuple):
    """What is known of a window."""

    phase: Any  #: a ball that holds the whole window
    speeds: list  #: of distance by theta, one of each contact


class Windows:
    """The nodes of a `Path`, with windows in place of single contacts.

    `codes` are the contact codes of all meshes at tau = 0, `phases` those of its contacts, exact
    numbers in their order.
    """

    def __init__(self, path, codes, phases):
        self.path, self.laws, self.codes = path, path.laws, list(codes)
        #: Numbers of the nodes, those of one window together, and their phases.
        self.groups, last = [], None
        for i, (node, phase) in enumerate(zip(path.nodes, path.phases(phases), strict=True)):
            together = last is not None and node.phase is None and phase - last < close()
            if together:
                self.groups[-1][0].append(i)
            else:
                self.groups.append(([i], phase))
            last = phase if node.phase is None else None

    def any(self):
        """Return whether any contacts come together."""
        return any(len(numbers) > 1 for numbers, _ in self.groups)

    def equations(self, unknowns):
        """Return (residuals, derivatives, a row each) of the return, by (y, dy/dtheta)."""
        ends, rows, _, _ = self.run(unknowns)
        for i, row in enumerate(rows):
            row[i] -= 1
        return [end - value for end, value in zip(ends, unknowns, strict=True)], rows

    def equations_or_nothing(self, unknowns):
        """Return the same, without a bound in a box in which windows are not passed."""
        try:
            return self.equations(unknowns)
        except Uncertain:
            nothing, n = flint().arb("nan"), len(unknowns)
            return [nothing] * n, [[nothing] * n for _ in range(n)]

    def proven(self, box):
        """Return (phases, speeds, state at every switch, map of small deviations) of an orbit."""
        _, rows, found, switches = self.run(box, prove=True)
        phases = [one.phase for one in found for _ in one.speeds]
        speeds = [speed for one in found for speed in one.speeds]
        return phases, speeds, switches, flint().arb_mat(rows)

    def run(self, unknowns, prove=False):
        """Return (state at the end, rows of its derivatives, `Crossed` windows, z~ at switches).

        Only where `prove` is set is it proven that no mesh comes to a flank line between windows,
        and have derivatives all digits.
        """
        module, laws, path = flint(), self.laws, self.path
        n, now, bits = len(unknowns), list(self.codes), module.ctx.prec
        few = bits if prove else max(COARSE, bits // 3)
        start = z = path.column(unknowns)
        slopes = module.arb_mat([row[:n] for row in laws.inverse.tolist()])
        time, found, switches, scale = 0, [], {}, 1 / laws.tuning
        for numbers, phase in self.groups:
            first, arc = path.nodes[numbers[0]], path.arcs[numbers[0]]
            end = phase * scale
            half = 0
            if first.phase is None:
                near = arc.frame * arc.go(z, end - time)
                half = self._half(numbers, near, _WIDE if prove else _ROOM)
            if not end - half > time:
                raise Uncertain(
                    "together",
                    "contacts that come together cannot be told apart from others, a switch of a "
                    "stiffness or the start of the orbit",
                )
            t = end - half - time
            turn = arc.turn(t)
            z = arc.after(z, turn)
            with precision(few):
                slopes = arc.after(slopes, turn)
            here = arc.frame * z
            if prove:
                at = float(phase.mid())
                check_arc(laws, first.law, start, here, t, now, (None, None), at)
            time = end + half
            if first.phase is None:
                through, start, speeds = self._through(numbers, here, 2 * half, now)
                ball = module.arb(end.mid(), (half + end.rad()).upper())
                found.append(Crossed(ball / scale, speeds))
                back = path.arcs[numbers[-1]].back
                z = back * start
                with precision(few):
                    slopes = back * (through * (arc.frame * slopes))
            else:
                start = switches[numbers[0]] = here
        ends = module.arb_mat((laws.basis * path.arcs[-1].frame).tolist()[:n])
        return (ends * z).entries(), (ends * slopes).tolist(), found, switches

    def _half(self, numbers, z, room):
        """Return half the length of a window about contacts, by a state near to them."""
        module, laws = flint(), self.laws
        largest = module.arb(2) ** -(0.7 * module.ctx.prec)
        for i in numbers:
            node = self.path.nodes[i]
            row = laws.distances[node.mesh][node.side]
            distance, rate = (row * z)[0, 0], (row * (node.law.matrix * z))[0, 0]
            if not (rate > 0 or rate < 0):
                raise Uncertain(*_STATUS)
            largest = max(largest, (room * abs(distance).upper() / abs(rate).lower()).upper())
        return largest

    def _through(self, numbers, z, length, now):
        """Return (map of small deviations through a window, z~ behind it, speeds).

        `now` is changed in place.
        """
        module, laws, path = flint(), self.laws, self.path
        e, size, arb = len(laws.kept), laws.size, module.arb
        begins = laws.basis * z
        law = laws.basis * path.nodes[numbers[0]].law.matrix * laws.inverse
        changes = []
        for i in numbers:
            change = (
                laws.basis
                * (path.nodes[i + 1].law.matrix - path.nodes[i].law.matrix)
                * laws.inverse
            )
            changes.append(change)
        most = norm(law) + sum((norm(one) for one in changes), arb(0))
        eta = (most * length).expm1().upper()
        room = arb(0, (eta * max(abs(value).upper() for value in begins.entries())).upper())
        within = begins + module.arb_mat(size, 1, [room] * size)
        moved = law * within
        for change in changes:
            moved += change * within * arb(0.5, 0.5)
        ends = begins + moved * length
        self._check(numbers, begins, within, ends, now)
        through, bound, speeds = module.arb_mat(size, size), arb(1), []
        for i, change in zip(numbers, changes, strict=True):
            node = path.nodes[i]
            row = laws.rows[node.mesh][node.side]
            speed = (row * (law * within))[0, 0]
            jump = change * within
            for k in range(size):
                # Forces change rates only.
                if not e <= k < 2 * e:
                    jump[k, 0] = 0
            kick = jump * row * (1 / speed)
            through += kick
            bound *= 1 + norm(kick)
            speeds.append(speed)
        rest = (((1 + eta) ** (len(numbers) + 1) - 1) * bound).upper()
        through += module.arb_mat(size, size, [arb(0, rest)] * size**2)
        for k in range(size):
            through[k, k] += 1
        return laws.inverse * through * laws.basis, laws.inverse * ends, speeds

    def _check(self, numbers, begins, within, ends, now):
        """Prove that the meshes of a window cross their lines once, and no others touch one."""
        laws, nodes = self.laws, [self.path.nodes[i] for i in numbers]
        law = laws.basis * nodes[0].law.matrix * laws.inverse
        crossing = {(node.mesh, node.side) for node in nodes}
        if len({node.mesh for node in nodes}) < len(nodes):
            raise Uncertain(*_STATUS)
        after = list(now)
        for node in nodes:
            after[node.mesh] = node.after
            row, sign = laws.rows[node.mesh][node.side], 1 if node.after > node.before else -1
            rate = sign * (row * (law * within))[0, 0]
            apart = sign * (row * begins)[0, 0], sign * (row * ends)[0, 0]
            if not (apart[0] < 0 and apart[1] > 0 and rate > 0):
                raise Uncertain(*_STATUS)
        for codes in (now, after):
            for j, side, sign, row in bounds_of(laws, codes, laws.rows):
                if (j, side) not in crossing and not sign * (row * within)[0, 0] > 0:
                    raise Uncertain(*(JAMMED if overlaps(codes[j], side) else _STATUS))
        now[:] = after
