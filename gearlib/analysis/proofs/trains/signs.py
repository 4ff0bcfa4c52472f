"""That no mesh of a train touches a flank line between the contacts that are listed.

Every arc is cut into pieces. On each the distances are Taylor polynomials, with a ball for the last
coefficient that holds the remainder; `gearlib.analysis.proofs.signs` proves their sign.
"""

import math

from gearlib.analysis.proofs.balls import COARSE, flint, precision
from gearlib.analysis.proofs.path import Uncertain
from gearlib.analysis.proofs.signs import CROSSING, keeps_off
from gearlib.analysis.proofs.trains.laws import norm
from gearlib.analysis.proofs.trains.parts import COAST, DRIVE
from gearlib.kernels.codes import INVERSE, NORMAL

#: Degree of the polynomials, and the time of one of them by the norm of the law.
_ORDER, _REACH = 18, 1.0
_TOGETHER = (
    "together",
    "contacts of several meshes coincide, or come too near to each other to tell their order",
)
_SWITCH = (
    "switch",
    "a contact cannot be told apart from a switch of a stiffness or the start of the orbit",
)
JAMMED = "jammed", "both flanks may touch at once: it is not proven that the backlash stays open"


class Curve:
    """A distance as a polynomial with balls as coefficients, for `signs.keeps_off`."""

    def __init__(self, coefficients):
        self.value = flint().arb_poly(coefficients)
        self.rate = self.value.derivative()
        self.bend = self.rate.derivative()

    def go(self, x, w, t, phase):
        """Return the distance and its rate at a time."""
        return self.value(t), self.rate(t)

    def acceleration(self, x, w, phase, t=0):
        """Return its second derivative at a time."""
        return self.bend(t)


def check_contacts(path, codes, unknowns):
    """Prove that the contacts of a path are crossings, in this order, and all there are.

    Returns the rates of distance at the contacts, by theta.

    Raises
    ------
    Uncertain
    """
    laws, now, rates = path.laws, list(codes), []
    phases = path.phases(unknowns[2 * len(laws.kept) :])
    # The contact at every node, and at the start of every arc: (mesh, side), None for a switch.
    met = [None if node.phase is not None else (node.mesh, node.side) for node in path.nodes]
    crossed = [None, *met]
    for i, (last, phase) in enumerate(zip([0, *phases], phases, strict=False)):
        if not phase > last:
            raise Uncertain(*(_TOGETHER if met[i] and crossed[i] else _SWITCH))
    arcs, ends = path.states(unknowns)
    for i, (node, (z, t), end) in enumerate(zip(path.nodes, arcs, ends, strict=True)):
        at = float(phases[i].mid())
        check_arc(laws, node.law, z, end, t, now, (crossed[i], met[i]), at)
        if met[i]:
            rate = (laws.distances[node.mesh][node.side] * (node.law * end))[0, 0]
            if not (rate > 0 if node.after > node.before else rate < 0):
                raise Uncertain(
                    "grazing", f"the contact at phase {at:.6g} is not proven to be a crossing"
                )
            rates.append(rate)
            now[node.mesh] = node.after
    return rates


def check_arc(laws, law, z, end, t, codes, on_line, at):
    """Prove that no mesh touches a flank line within an arc from z to `end`.

    `on_line` are (mesh, side) of the contact at either end, None where there is none.
    """
    module = flint()
    bounds = bounds_of(laws, codes, laws.distances)
    rows = module.arb_mat([row.entries() for *_, row in bounds])
    size = norm(law)
    count = max(1, math.ceil(float(size * t.mid()) / _REACH))
    h = t / count
    for piece in range(count):
        begins = (rows * z).entries()
        with precision(COARSE):
            terms, power, following = [z], module.arb(1), z
            for k in range(1, _ORDER + 1):
                terms.append(law * terms[-1] * (1 / module.arb(k)))
                power *= h
                following += terms[-1] * power
            # The last coefficient holds the remainder, of the distance and of its derivatives.
            rest = law * terms[-1] * (1 / module.arb(_ORDER + 1))
            largest = max(abs(value).upper() for value in rest.entries())
            room = module.arb(0, ((size * h).exp() * largest).upper())
            terms.append(module.arb_mat([[room]] * laws.size))
            series = [begins, *((rows * term).entries() for term in terms[1:])]
        z = end if piece == count - 1 else following + terms[-1] * (power * h)
        ends = (rows * z).entries()
        for i, (j, side, sign, _) in enumerate(bounds):
            curve = Curve([values[i] for values in series])
            # Of the ends the states know more than the polynomials.
            starts = series[0][i] * sign > 0 or (piece == 0 and on_line[0] == (j, side))
            stops = ends[i] * sign > 0 or (piece == count - 1 and on_line[1] == (j, side))
            if not (
                starts
                and stops
                and keeps_off(curve, None, None, h, None, sign, 0, CROSSING, CROSSING)
            ):
                name = laws.parts.meshes[j].name
                if overlaps(codes[j], side):
                    raise Uncertain(
                        JAMMED[0], f"before phase {at:.6g} of mesh {name!r} {JAMMED[1]}"
                    )
                raise Uncertain(
                    "grazing",
                    f"before phase {at:.6g} the mesh {name!r} comes too near to a flank line to "
                    "prove that it does not touch it",
                )


def overlaps(code, side):
    """Return whether both flanks touch where a mesh of this contact code comes to a side."""
    return (code, side) in ((NORMAL, COAST), (INVERSE, DRIVE))


def bounds_of(laws, codes, distances):
    """Return (mesh, side, sign, functional) of contact codes: sign times distance > 0 in them."""
    return [
        (j, side, sign, row)
        for j, code in enumerate(codes)
        for side, sign, row in _bounds(code, distances[j], laws.parts.meshes[j].moving)
    ]


def _bounds(code, distances, moving):
    """Return (side, sign, functional) of one contact code.

    Where the play between the flanks changes, it must not close either.
    """
    drive, coast = (DRIVE, 1, distances[DRIVE]), (COAST, 1, distances[COAST])
    if code == INVERSE:
        found = [(COAST, -1, distances[COAST])]
        return [*found, (DRIVE, -1, distances[DRIVE])] if moving else found
    if code == NORMAL:
        return [drive, coast] if moving and coast[2] is not None else [drive]
    found = [(DRIVE, -1, distances[DRIVE])]
    return found if coast[2] is None else [*found, coast]
