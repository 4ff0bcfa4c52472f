"""The second program on ranges of tunings: one branch of orbits, from piece to piece.

It shares no code with gearlib.
"""

from itertools import pairwise

from mpmath import iv

from tests.proofs.checker import Claim, inverted, judged
from tests.proofs.duals import dual, duals
from tests.proofs.meshes import inside

#: Shortest part of a piece, as a share of it.
_SHORTEST = 1 / 32


def _number(text):
    return iv.mpf(float.fromhex(text))


class Piece(Claim):
    """The equations of a piece, with nu dx/dtau in place of dx/dtau."""

    def __init__(self, claim, piece):
        codes = claim["pattern"]
        middles = [_number(middle) for middle in piece["centre"]]
        radii = [_number(radius) * iv.mpf([-1, 1]) for radius in piece["radii"]]
        self.wide = [middle + radius for middle, radius in zip(middles, radii, strict=True)]
        self.tunings = iv.mpf([_number(piece["start"]).a, _number(piece["stop"]).b])
        names = dict(zip(("displacement", "velocity"), self.wide, strict=False))
        events = [
            {"phase": phase, "before": before, "after": after}
            for phase, (before, after) in zip(self.wide[2:], pairwise(codes), strict=True)
        ]
        super().__init__(claim | names | {"events": events, "tuning": self.tunings})

    def orbit(self, box, nu):
        """Return where Krawczyk's test encloses the orbits of tunings, of each one; else None.

        The mean value is taken over state and tuning at once.
        """
        middle, at = [iv.mpf(value.mid) for value in box], iv.mpf(nu.mid)
        residuals = [row.interval for row in self.rows([*middle, at])]
        rows = [[dual(s).interval for s in row.slopes] for row in self.rows([*box, nu])]
        inverse = inverted([row[:-1] for row in rows])
        if inverse is None:
            return None
        found = []
        for i, line in enumerate(inverse):
            total = middle[i]
            for a, residual, row in zip(line, residuals, rows, strict=True):
                total -= a * (residual + row[-1] * (nu - at))
            for j, value in enumerate(box):
                entry = sum(a * row[j] for a, row in zip(line, rows, strict=True))
                total += ((i == j) - entry) * (value - middle[j])
            found.append(total)
        return found if all(map(inside, found, box)) else None

    def rows(self, unknowns):
        """Return the residuals, dual numbers in x, nu dx/dtau, the phases and nu."""
        x, w, *rest = duals(unknowns)
        contacts, (back_x, back_v) = self.equations([x, w / rest[-1], *rest])
        return [*contacts, back_x, back_v]

    def holds_at(self, nu):
        """Return whether contacts and stability are confirmed at all tunings of an interval."""
        box = self.orbit(self.wide, nu)
        if box is None:
            return False
        for _ in range(2):
            # The same orbits in a narrower box, as long as it gets narrower.
            box = self.orbit(box, nu) or box
        x, w, *phases = box
        box = [x, w / nu, *phases, nu]
        if self.follow(box) is None:
            return False
        trace, determinant = self.invariants(box)
        if self.claim["stability"] == "undecided":
            # Areas are kept: both multipliers on the unit circle, apart from each other.
            return determinant.a == determinant.b == 1 and abs(trace).b < 2
        return self.claim["stability"] == judged(trace, determinant)

    def holds(self):
        """Return whether they are in the whole piece."""
        todo = [self.tunings]
        while todo:
            nu = todo.pop()
            if self.holds_at(nu):
                continue
            if nu.delta < _SHORTEST * self.tunings.delta:
                return False
            todo += [iv.mpf([nu.a, nu.mid]), iv.mpf([nu.mid, nu.b])]
        return True

    def meets(self, other):
        """Return whether the orbit at the last tuning is the other piece's at its first."""
        box, nu = self.wide, iv.mpf(self.tunings.b)
        for _ in range(4):
            box = self.orbit(box, nu)
            if box is None:
                return False
            if all(map(inside, box, other.wide)):
                return True
        return False


def range_faults(claim):
    """Return what is not confirmed of a range of tunings."""
    pieces = claim["pieces"]
    cuts = [claim["start"], *(piece["stop"] for piece in pieces)]
    found = []
    if cuts[:-1] != [piece["start"] for piece in pieces] or cuts[-1] != claim["stop"]:
        found.append("cuts")
    if not all(float.fromhex(low) < float.fromhex(high) for low, high in pairwise(cuts)):
        found.append("order")
    if found:
        return found
    boxes = [Piece(claim, piece) for piece in pieces]
    if not all(box.holds() for box in boxes):
        found.append("pieces")
    if not all(one.meets(other) for one, other in pairwise(boxes)):
        found.append("branch")
    return found
