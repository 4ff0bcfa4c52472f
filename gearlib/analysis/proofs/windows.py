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

from itertools import pairwise

from gearlib.analysis.proofs.balls import column_of, flint, identity, norm
from gearlib.analysis.proofs.certificate_files import Uncertain
from gearlib.analysis.proofs.path import first_column
from gearlib.analysis.proofs.signs import JAMMED, bounds_of, check_arc

#: By how much wider a window is than what is known of its contacts; more where signs next to it
#: are to be proven.
_WIDTH, _PROOF_WIDTH = 4, 32
_NO_CROSSINGS = "together", "contacts that come together are not proven to be crossings"


def smallest_interval():
    """Return how near contacts come to each other that share a window, in phase."""
    return flint().arb(2) ** -(flint().ctx.prec // 2)


class Windows:
    """The nodes of a `Path`, with windows in place of single contacts.

    `phases` are those of its contacts, exact numbers in their order.
    """

    def __init__(self, path, phases):
        self.path, self.laws = path, path.laws
        #: (Numbers of the nodes that are passed at once, phase).
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
        """Return whether any contacts come together."""
        return any(len(numbers) > 1 for numbers, _ in self.groups)

    def equations(self, unknowns):
        """Return (residuals, derivatives, a row each) of the return, by (y, dy/dtheta)."""
        ends, rows, *_ = self.run(unknowns)
        for i, row in enumerate(rows):
            row[i] -= 1
        return [end - value for end, value in zip(ends, unknowns, strict=True)], rows

    def equations_or_nothing(self, unknowns):
        """Return the same, without a bound in a box in which windows are not passed."""
        try:
            return self.equations(unknowns)
        except Uncertain:
            nothing, n = flint().arb("nan"), len(unknowns)
            return [nothing] * n, [[nothing] * n] * n

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
                half = self._half_width(numbers, near, _PROOF_WIDTH if prove else _WIDTH)
            duration = end - half - time
            if not duration > 0:
                raise Uncertain(
                    "together",
                    "contacts that come together cannot be told apart from others, a switch of a "
                    "stiffness or the start of the orbit",
                )
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

    def _half_width(self, numbers, state, width):
        """Return half the length of a window about contacts, by a modal state near to them."""
        largest = flint().arb(2) ** -(0.7 * flint().ctx.prec)
        for node in (self.path.nodes[i] for i in numbers):
            row = self.laws.distances[node.mesh][node.side]
            distance, rate = (row * state)[0, 0], (row * (node.law * state))[0, 0]
            if not (rate > 0 or rate < 0):
                raise Uncertain(*_NO_CROSSINGS)
            largest = max(largest, (width * abs(distance).upper() / abs(rate).lower()).upper())
        return largest

    def _crossed(self, numbers, state, length, codes):
        """Return (map of small deviations through a window, modal state behind it, speeds).

        `codes` are changed in place.
        """
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
            # Forces change rates only.
            values = [value if e <= k < 2 * e else 0 for k, value in enumerate(jump.entries())]
            row = laws.distances[nodes[i].mesh][nodes[i].side]
            saltation = column_of(values) * row * (1 / speed)
            transition += saltation
            growth *= 1 + norm(saltation)
        remainder = arb(0, (((1 + eta) ** (len(numbers) + 1) - 1) * growth).upper())
        return transition + module.arb_mat(size, size, [remainder] * size**2), end, speeds

    def _checked_speeds(self, numbers, begin, within, end, rate, codes):
        """Prove that the meshes of a window cross their lines once, and no others touch one.

        Returns the rates of their distances.
        """
        laws, nodes, speeds = self.laws, [self.path.nodes[i] for i in numbers], []
        if len({node.mesh for node in nodes}) < len(nodes):
            raise Uncertain(*_NO_CROSSINGS)
        crossed, codes_after = {(node.mesh, node.side) for node in nodes}, list(codes)
        for node in nodes:
            codes_after[node.mesh] = node.after
            row, sign = laws.distances[node.mesh][node.side], 1 if node.after > node.before else -1
            before, after, speed = ((row * state)[0, 0] for state in (begin, end, rate))
            if not (sign * before < 0 and sign * after > 0 and sign * speed > 0):
                raise Uncertain(*_NO_CROSSINGS)
            speeds.append(speed)
        for bound in [*bounds_of(laws, codes), *bounds_of(laws, codes_after)]:
            is_open = any(map(bound.is_of, crossed)) or bound.sign * (bound.row * within)[0, 0] > 0
            if not is_open:
                raise Uncertain(*(JAMMED if bound.is_overlap else _NO_CROSSINGS))
        codes[:] = codes_after
        return speeds
