"""That a motion touches no flank line along an arc: the contacts that are listed are all."""

from gearlib.analysis.proofs.balls import flint
from gearlib.analysis.proofs.path import CONTACT, TOUCH, Uncertain

#: How the state lies at an end of an arc: off the line, crossing it, or at rest on it.
OFF, CROSSING, TOUCHING = range(3)
#: Most pieces of one arc, and the shortest, as a share of it.
_PIECES, _SHORTEST = 2000, 2**-48


def keeps_off(law, x, w, t, phase, side, line, first, last):
    """Return whether side (x - line) > 0 is proven strictly between the ends of an arc.

    The arc is cut into pieces. On a piece the sign is proven if the enclosure of x has it, or if x
    is not on the wrong side at both ends of the piece and is monotone or curved towards the line
    between them. Next to a touch, at rest, it is curved away from the line.

    Parameters
    ----------
    law : Contact or Flight
    x, w : arb
        State at the start of the arc.
    t, phase : arb
        Its duration, and the mesh phase at its start.
    side : int
    line : arb
    first, last : int
        `OFF`, `CROSSING` or `TOUCHING` at either end; what is not `OFF` is on the line by what is
        already proven.
    """
    arb = flint().arb

    def state(at):
        return law.go(x, w, at, phase)[:2]

    if first == OFF and not side * (x - line) > 0:
        return False
    if last == OFF and not side * (state(t)[0] - line) > 0:
        return False
    todo, count = [(0.0, 1.0)], 0
    while todo:
        low, length = todo.pop()
        middle = low + 0.5 * length
        piece = t * arb(middle, 0.5 * length)
        y, v = state(piece)
        if side * (y - line) > 0:
            continue
        bend = side * law.acceleration(y, v, phase, piece)
        if v > 0 or v < 0 or bend < 0:
            continue
        x_middle = state(t * middle)[0]
        # By the mean value of the velocity: sharper where it is small.
        if side * (x_middle + v * t * arb(0, 0.5 * length) - line) > 0:
            continue
        touches = (low == 0.0 and first == TOUCHING) or (low + length == 1.0 and last == TOUCHING)
        if touches and bend > 0:
            continue
        count += 1
        if count > _PIECES or length < _SHORTEST:
            return False
        if not side * (x_middle - line) > 0:
            return False
        todo += [(low, 0.5 * length), (middle, 0.5 * length)]
    return True


def check_contacts(path, start, states, first=OFF):
    """Prove that the contacts of a path are crossings, in this order, and all there are.

    Parameters
    ----------
    path : Path
    start : tuple of arb
        (x, w) at tau = 0.
    states : list
        Of `Path.states`.
    first : int
        How the state lies at tau = 0, to the flank line that is nearest to it.

    Raises
    ------
    Uncertain
    """
    x, w = start
    last, contact, touched = path.start, path.contact, None
    if first != OFF:
        touched = path.laws.near if x == path.laws.near else path.laws.far
    for node, (x_end, w_end, phase, t) in zip(path.nodes, states, strict=True):
        at = float(phase.mid())
        if not phase > last:
            raise Uncertain(
                "switch",
                f"near phase {at:.6g} a contact cannot be told apart from a switch of the "
                "stiffness or the start of the orbit",
            )
        on = path.line(node) if node.kind in (CONTACT, TOUCH) else None
        if node.kind == CONTACT and not (w_end > 0 if node.after > node.before else w_end < 0):
            raise Uncertain(
                "grazing", f"the contact at phase {at:.6g} is not proven to be a crossing"
            )
        end = TOUCHING if node.kind == TOUCH else CROSSING
        for side, line in path.laws.bounds(contact):
            ends = (first if line is touched else OFF), (end if line is on else OFF)
            if not keeps_off(node.law, x, w, t, last, side, line, *ends):
                raise Uncertain(
                    "grazing",
                    f"before phase {at:.6g} the motion comes too near to a flank line to prove "
                    "that it does not touch it",
                )
        x, w, last, contact = x_end, w_end, phase, node.after
        first, touched = end, on
