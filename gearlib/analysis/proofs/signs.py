"""That a motion touches no flank line along an arc: the contacts that are listed are all.

Where the motion of an arc is known in closed form its distance from a line is. Else the arc is cut
into pieces, on each of which the distances are Taylor polynomials, with a ball for the last
coefficient that holds the remainder.
"""

import math

from gearlib.analysis.proofs.arcs import norm
from gearlib.analysis.proofs.balls import COARSE, flint, precision
from gearlib.analysis.proofs.certificate_files import Uncertain
from gearlib.analysis.proofs.path import COAST, CONTACT, DRIVE
from gearlib.kernels.codes import INVERSE, NORMAL

#: Most pieces of one arc, and the shortest, as a share of it.
_PIECES, _SHORTEST = 2000, 2**-48
#: Degree of the polynomials, and the time of one of them by the norm of the law.
_ORDER, _REACH = 18, 1.0
#: States that are wider than this are not wrapped from piece to piece.
_WIDE = 2.0**-40
_TOGETHER = (
    "contacts of several meshes coincide, or come too near to each other to tell their order"
)
JAMMED = "jammed", "both flanks may touch at once: it is not proven that the backlash stays open"


class Curve:
    """A distance from a flank line as a polynomial with balls as coefficients."""

    def __init__(self, coefficients):
        self.value = flint().arb_poly(coefficients)
        self.rate = self.value.derivative()
        self.bends = self.rate.derivative()

    def at(self, t):
        """Return the distance and its rate at a time."""
        return self.value(t), self.rate(t)

    def bend(self, t):
        """Return its second derivative at a time."""
        return self.bends(t)


class ClosedCurve:
    """The same of a motion in closed form, from a state z on."""

    def __init__(self, law, z, row):
        self.law, self.z, self.row = law, z, row
        self.rate = row * law.matrix
        self.second = self.rate * law.matrix

    def at(self, t):
        """Return the distance and its rate at a time."""
        z = self.law.go(self.z, t)
        return (self.row * z)[0, 0], (self.rate * z)[0, 0]

    def bend(self, t):
        """Return its second derivative at a time."""
        return (self.second * self.law.go(self.z, t))[0, 0]


def keeps_off(curve, t, side):
    """Return whether side times distance > 0 is proven strictly between the ends of an arc.

    The arc is cut into pieces. On a piece the sign is proven if the enclosure of the distance has
    it, or if the distance is not on the wrong side at both ends of the piece and is monotone or
    curved towards the line between them. `t` is its duration. That both ends of the arc are on the
    line, or on the right side of it, is already proven.
    """
    arb = flint().arb
    todo, count = [(0.0, 1.0)], 0
    while todo:
        low, length = todo.pop()
        middle = low + 0.5 * length
        piece = t * arb(middle, 0.5 * length)
        y, v = curve.at(piece)
        if side * y > 0:
            continue
        bend = side * curve.bend(piece)
        if v > 0 or v < 0 or bend < 0:
            continue
        y_middle = curve.at(t * middle)[0]
        # By the mean value of the velocity: sharper where it is small.
        if side * (y_middle + v * t * arb(0, 0.5 * length)) > 0:
            continue
        count += 1
        if count > _PIECES or length < _SHORTEST:
            return False
        if not side * y_middle > 0:
            return False
        todo += [(low, 0.5 * length), (middle, 0.5 * length)]
    return True


def check_contacts(path, arcs, ends, phases):
    """Prove that the contacts of a path are crossings, in this order, and all there are.
    Returns the rates of distance at the contacts, by theta. `arcs` and `ends` are of `Path.states`,
    `phases` of all nodes.
    """
    laws, now, rates = path.laws, list(path.codes), []
    # What is met at every node, and at the start of every arc: None for a switch.
    met = [(node.mesh, node.side) if node.kind == CONTACT else None for node in path.nodes]
    crossed = [None, *met]
    for i, (last, phase) in enumerate(zip([0, *phases], phases, strict=False)):
        if not phase > last:
            if i and met[i] and crossed[i]:
                raise Uncertain("together", _TOGETHER)
            raise Uncertain(
                "switch",
                f"near phase {float(phase.mid()):.6g} a contact cannot be told apart from a switch "
                "of the stiffness or the start of the orbit",
            )
    for i, (node, (z, t), end) in enumerate(zip(path.nodes, arcs, ends, strict=True)):
        at = float(phases[i].mid())
        if node.kind == CONTACT:
            rate = (laws.distances[node.mesh][node.side] * (node.law.matrix * end))[0, 0]
            if not (rate > 0 if node.after > node.before else rate < 0):
                raise Uncertain(
                    "grazing", f"the contact at phase {at:.6g} is not proven to be a crossing"
                )
            rates.append(rate)
        check_arc(laws, node.law, z, end, t, now, (crossed[i], met[i]), at)
        if node.kind == CONTACT:
            now[node.mesh] = node.after
    return rates


def check_arc(laws, law, z, end, t, codes, on_line, at):
    """Prove that no mesh touches a flank line within an arc from z to `end`.

    `on_line` are (mesh, side) of the flank line that is crossed at either end, None where there is
    none.
    """
    bounds = bounds_of(laws, codes, laws.distances)
    pieces = _closed if law.closed else _pieces
    for curves, h, begins, ends, first, last in pieces(law, z, end, t, [b[-1] for b in bounds]):
        for curve, begin, stop, (j, side, sign, _) in zip(
            curves, begins, ends, bounds, strict=True
        ):
            coast, drive = laws.distances[j]
            crossed = [
                # Without backlash the lines of both sides are one.
                here and mark and mark[0] == j and (mark[1] == side or coast is drive)
                for here, mark in zip((first, last), on_line, strict=True)
            ]
            # Of the ends the states know more than the polynomials.
            known = [
                mark or sign * value > 0 for mark, value in zip(crossed, (begin, stop), strict=True)
            ]
            if not all(known) or not keeps_off(curve, h, sign):
                _refuse(laws, j, side, codes[j], at)


def _closed(law, z, end, t, rows):
    """Yield (curves, time, values at both ends, whether these are the ends of the arc)."""
    curves = [ClosedCurve(law, z, row) for row in rows]
    values = [[(row * one)[0, 0] for row in rows] for one in (z, end)]
    yield curves, t, *values, True, True


def _pieces(law, z, end, t, rows):
    """Yield the same of pieces of an arc, with polynomials."""
    module, start, matrix = flint(), z, law.matrix
    rows = module.arb_mat([row.entries() for row in rows])
    wide = max(value.rad() for value in z.entries()) > _WIDE
    size = norm(matrix)
    count = max(1, math.ceil(float(size * t.mid()) / _REACH))
    h = t / count
    for piece in range(count):
        begins = (rows * z).entries()
        with precision(COARSE):
            terms, power, following = [z], module.arb(1), z
            for k in range(1, _ORDER + 1):
                terms.append(matrix * terms[-1] * (1 / module.arb(k)))
                power *= h
                following += terms[-1] * power
            # The last coefficient holds the remainder, of the distance and of its derivatives.
            rest = matrix * terms[-1] * (1 / module.arb(_ORDER + 1))
            largest = max(abs(value).upper() for value in rest.entries())
            room = module.arb(0, ((size * h).exp() * largest).upper())
            terms.append(module.arb_mat([[room]] * rows.ncols()))
            series = [begins, *((rows * term).entries() for term in terms[1:])]
        if piece == count - 1:
            z = end
        else:
            z = law.go(start, (piece + 1) * h) if wide else following + terms[-1] * (power * h)
        curves = [Curve([values[i] for values in series]) for i in range(rows.nrows())]
        yield curves, h, begins, (rows * z).entries(), piece == 0, piece == count - 1


def _refuse(laws, mesh, side, code, at):
    """Raise `Uncertain`: a mesh comes too near to a flank line before a phase."""
    several = len(laws.mesh_names) > 1
    name = laws.mesh_names[mesh]
    if overlaps(code, side):
        raise Uncertain(JAMMED[0], f"before phase {at:.6g} of mesh {name!r} {JAMMED[1]}")
    who = f"the mesh {name!r}" if several else "the motion"
    raise Uncertain(
        "grazing",
        f"before phase {at:.6g} {who} comes too near to a flank line to prove that it does not "
        "touch it",
    )


def overlaps(code, side):
    """Return whether both flanks touch where a mesh of this contact code comes to a side."""
    return (code, side) in ((NORMAL, COAST), (INVERSE, DRIVE))


def bounds_of(laws, codes, distances):
    """Return (mesh, side, sign, functional) of contact codes: sign times distance > 0 in them."""
    return [
        (j, side, sign, row)
        for j, code in enumerate(codes)
        for side, sign, row in _bounds(code, distances[j], laws.moving[j])
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
