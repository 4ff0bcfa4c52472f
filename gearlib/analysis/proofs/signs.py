"""That a motion touches no flank line along an arc, and the extrema of its displacement.

An arc is cut into pieces, on each of which a functional of the state is a Taylor polynomial, with a
ball for the last coefficient that holds the remainder.
"""

import math
from typing import Any, NamedTuple

from gearlib.analysis.proofs.arc_laws import moved
from gearlib.analysis.proofs.balls import flint, norm
from gearlib.analysis.proofs.certificate_files import Uncertain
from gearlib.analysis.proofs.models_in_balls import COAST, DRIVE
from gearlib.engines.codes import INVERSE, NORMAL

#: Most cuts of one piece, the shortest part, as a share of it, and most corrections of a zero.
_MAX_CUTS, _SHORTEST_PART, _MAX_CORRECTIONS = 2000, 2**-48, 40
#: Time of a piece by the norm of the law.
_PIECE_LENGTH = 1.0
#: States that are wider than this are not wrapped from piece to piece.
_WIDE_STATE = 2.0**-40
_TOGETHER = (
    "contacts of several meshes coincide, or come too near to each other to tell their order"
)
JAMMED = "jammed", "both flanks may touch at once: it is not proven that the backlash stays open"


class Curve:
    """A functional along a piece of an arc: a polynomial with balls as coefficients."""

    def __init__(self, coefficients):
        self.value = flint().arb_poly(coefficients)
        self.rate = self.value.derivative()
        self.acceleration = self.rate.derivative()


class Piece(NamedTuple):
    """A piece of an arc."""

    curves: list  #: of the functionals, `Curve`
    duration: Any
    begins: list  #: values of the functionals at the start
    ends: list
    first: bool  #: whether the arc begins with this piece
    last: bool


def pieces(law, state, end, time, rows):
    """Yield the `Piece`s of an arc from a modal state to `end`, of functionals, shape (r, size)."""
    module, size, start = flint(), norm(law), state
    # The remainder is as small as rounding.
    degree = module.ctx.prec // 4 + 2
    is_wide = max(value.rad() for value in state.entries()) > _WIDE_STATE
    count = max(1, math.ceil(float(size * time.mid()) / _PIECE_LENGTH))
    duration = time / count
    step = None if is_wide or count == 1 else (law * duration).exp()
    # Row k of a functional's table: its derivative k + 1 over (k + 1)! by the rate of state.
    orders = [rows]
    for k in range(2, degree + 2):
        orders.append(orders[-1] * law * (1 / module.arb(k)))
    *orders, remainders = (order.tolist() for order in orders)
    tables = [module.arb_mat(list(table)) for table in zip(*orders, strict=True)]
    growth = (size * duration).exp()
    remainders = [sum(map(abs, row), module.arb(0)) * growth for row in remainders]
    for number in range(count):
        begins, rate = (rows * state).entries(), law * state
        largest = max(abs(value).upper() for value in rate.entries())
        curves = [
            Curve([begin, *(table * rate).entries(), module.arb(0, (rest * largest).upper())])
            for begin, table, rest in zip(begins, tables, remainders, strict=True)
        ]
        last = number == count - 1
        if last:
            state = end
        else:
            state = moved(law, start, (number + 1) * duration) if is_wide else step * state
        yield Piece(curves, duration, begins, (rows * state).entries(), number == 0, last)


def keeps_off(curve, time, sign):
    """Return whether sign * distance > 0 is proven strictly between the ends of a piece.

    The piece is cut into parts. On a part the sign is proven if the enclosure of the distance has
    it, or if the distance is not on the wrong side at both ends of the part and is monotone or
    curved towards the line between them. That both ends of the piece are on the line, or on the
    right side of it, is already proven.
    """
    arb = flint().arb
    parts, cuts = [(0.0, 1.0)], 0
    while parts:
        low, length = parts.pop()
        middle = low + 0.5 * length
        part = time * arb(middle, 0.5 * length)
        if sign * curve.value(part) > 0:
            continue
        rate = curve.rate(part)
        if rate > 0 or rate < 0 or sign * curve.acceleration(part) < 0:
            continue
        distance = curve.value(time * middle)
        # By the mean value of the velocity: sharper where it is small.
        if sign * (distance + rate * time * arb(0, 0.5 * length)) > 0:
            continue
        cuts += 1
        if cuts > _MAX_CUTS or length < _SHORTEST_PART or not sign * distance > 0:
            return False
        parts += [(low, 0.5 * length), (middle, 0.5 * length)]
    return True


def check_contacts(path, arcs, ends, phases):
    """Prove that the contacts of a path are crossings, in this order, and all there are.

    Returns the rates of distance at the contacts, by theta. `arcs` and `ends` are of
    `Path.equations`, `phases` of all nodes.
    """
    laws, codes, rates = path.laws, list(path.codes), []
    # What is crossed at every node, and at the start of every arc: None for a switch.
    crossed = [None, *((n.mesh, n.side) if n.phase is None else None for n in path.nodes)]
    for i, (last, phase) in enumerate(zip([0, *phases], phases, strict=False)):
        if not phase > last:
            if crossed[i] and crossed[i + 1]:
                raise Uncertain("together", _TOGETHER)
            raise Uncertain(
                "switch",
                f"near phase {float(phase.mid()):.6g} a contact cannot be told apart from a switch "
                "of the stiffness or the start of the orbit",
            )
    for i, (node, (state, time), end) in enumerate(zip(path.nodes, arcs, ends, strict=True)):
        at = float(phases[i].mid())
        if node.phase is None:
            distance = laws.distances[node.mesh][node.side]
            rate = (distance * (node.law * end))[0, 0]
            if not (rate > 0 if node.after > node.before else rate < 0):
                raise Uncertain(
                    "grazing", f"the contact at phase {at:.6g} is not proven to be a crossing"
                )
            rates.append(rate)
        check_arc(laws, node.law, state, end, time, codes, crossed[i : i + 2], at)
        if node.phase is None:
            codes[node.mesh] = node.after
    return rates


def check_arc(laws, law, state, end, time, codes, crossed, at):
    """Prove that no mesh touches a flank line within an arc, from a modal state to `end`.

    `crossed` are (mesh, side) of the flank line that is crossed at either end, None where there is
    none; `at` is the phase that a refusal names.
    """
    bounds = bounds_of(laws, codes)
    rows = flint().arb_mat([bound.row.entries() for bound in bounds])
    for piece in pieces(law, state, end, time, rows):
        for curve, begin, stop, bound in zip(
            piece.curves, piece.begins, piece.ends, bounds, strict=True
        ):
            # Of the ends the states know more than the polynomials.
            if not (
                (bound.sign * begin > 0 or (piece.first and bound.is_of(crossed[0])))
                and (bound.sign * stop > 0 or (piece.last and bound.is_of(crossed[1])))
                and keeps_off(curve, piece.duration, bound.sign)
            ):
                name, several = laws.mesh_names[bound.mesh], len(laws.mesh_names) > 1
                if bound.is_overlap:
                    raise Uncertain(
                        JAMMED[0], f"before phase {at:.6g} of mesh {name!r} {JAMMED[1]}"
                    )
                raise Uncertain(
                    "grazing",
                    f"before phase {at:.6g} {f'the mesh {name!r}' if several else 'the motion'} "
                    "comes too near to a flank line to prove that it does not touch it",
                )


class Bound(NamedTuple):
    """What a contact code says of a flank line: sign * distance > 0."""

    mesh: int
    sides: tuple  #: of the mesh whose flank line this is, both without backlash
    sign: int
    row: Any  #: the distance, a functional of the state
    is_overlap: bool  #: whether both flanks touch where the mesh meets the line

    def is_of(self, crossed):
        """Return whether (mesh, side) that is crossed is of this flank line."""
        return crossed is not None and crossed[0] == self.mesh and crossed[1] in self.sides


def bounds_of(laws, codes):
    """Return the `Bound`s of all meshes by their contact codes.

    Where the play between the flanks changes, it must not close either.
    """
    bounds = []
    for j, (code, mesh, rows) in enumerate(
        zip(codes, laws.numbers.meshes, laws.distances, strict=True)
    ):
        for side, loaded in ((DRIVE, NORMAL), (COAST, INVERSE)):
            is_overlap = bool(code) and code != loaded
            if rows[side] is None or (is_overlap and not mesh.clearance_varies):
                continue
            sides = (side,) if mesh.has_backlash else (COAST, DRIVE)
            sign = loaded if code == loaded else -loaded
            bounds.append(Bound(j, sides, sign, rows[side], is_overlap))
    return bounds


def extrema(path, arcs, ends):
    """Return balls of the smallest and largest first coordinate; arguments of `Path.equations`.

    They are taken at the ends of arcs or where the velocity is zero.
    """
    displacement = flint().arb_mat([path.laws.basis.tolist()[0]])
    values = []
    for node, (state, time), end in zip(path.nodes, arcs, ends, strict=True):
        for piece in pieces(node.law, state, end, time, displacement):
            values += [*piece.begins, *piece.ends, *_stationary_values(piece)]
    return _least(values), -_least([-value for value in values])


def _least(balls):
    return min(ball.lower() for ball in balls).union(min(ball.upper() for ball in balls))


def _stationary_values(piece):
    """Yield balls that hold the value at all zeros of the rate on a piece, each a value of it.

    The piece is cut until on a part the rate has one sign; or the acceleration has, so that there
    is one zero of the rate at most; or the value is as good as constant.
    """
    arb, (curve,), parts = flint().arb, piece.curves, [(0.0, 1.0)]
    negligible = arb(2) ** (32 - flint().ctx.prec)
    while parts:
        low, length = parts.pop()
        around = piece.duration * arb(low + 0.5 * length, 0.5 * length)
        rate, acceleration = curve.rate(around), curve.acceleration(around)
        if rate > 0 or rate < 0:
            continue
        if acceleration > 0 or acceleration < 0:
            around = _zero(curve, around)
            if around is None:
                continue
        elif curve.value(around).rad() > negligible and length > _SHORTEST_PART:
            parts += [(low, 0.5 * length), (low + 0.5 * length, 0.5 * length)]
            continue
        value = curve.value(around)
        # A ball that reaches beyond the piece need not hold a value of it.
        value = value if around > 0 else value.union(piece.begins[0])
        yield value if around < piece.duration else value.union(piece.ends[0])


def _zero(curve, around):
    """Return the ball of times within which the rate may be zero, by Newton; None: it is not."""
    for _ in range(_MAX_CORRECTIONS):
        middle = around.mid()
        newton = middle - curve.rate(middle) / curve.acceleration(around)
        if not newton.overlaps(around):
            return None
        narrower = newton.intersection(around)
        if not narrower.rad() < 0.5 * around.rad():
            return narrower
        around = narrower
    return around
