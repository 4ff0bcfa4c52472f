"""A second program that checks certificates, from their JSON alone; it shares no code with gearlib.

Intervals of mpmath, mesh phase as time, closed forms by amplitudes, and derivatives by arithmetic
of dual numbers: nothing is differentiated by hand, and no saltation matrix is written down, since
the map of small deviations follows from the derivatives of the equations by elimination.

    python -m tests.proofs.checker results/certificates.json
"""

import json
import sys
from itertools import pairwise

from mpmath import iv, matrix, mp

from tests.independent import certificates
from tests.proofs.meshes import Arc, Dual, Mesh, duals, inside, zero

#: Shortest part of a piece, as a share of it.
_SHORTEST = 1 / 32


class Claim:
    """The equations of a claim in its unknowns: x, v, phases of contacts, and nu of a range."""

    def __init__(self, claim):
        self.claim, self.mesh = claim, Mesh(claim["pair"])
        self.tuned = claim["claim"] != "orbit"
        events = sorted(claim["events"], key=lambda event: iv.mpf(event["phase"]).mid)
        self.kinds = [(event["before"], event["after"]) for event in events]
        boxes = [claim["displacement"], claim["velocity"], *(event["phase"] for event in events)]
        boxes += [claim["tuning"]] if self.tuned else []
        self.box = [iv.mpf(box) for box in boxes]
        self.nu = None if self.tuned else Dual(iv.mpf(float.fromhex(claim["tuning"])))

    def nodes(self, phases):
        """Return [(phase, contact and level before, what happens)] in the order of the orbit."""
        half, turn, periods = self.mesh.half, 2 * iv.pi, self.claim["period"]
        marks = list(zip(phases, self.kinds, strict=True))
        for n in range(-1, -1 if self.mesh.constant else periods + 1):
            marks.append((Dual(half + n * turn), "low"))
            marks.append((Dual((n + 1) * turn - half), "high"))
        marks.append((Dual(periods * turn), "end"))
        marks.sort(key=lambda mark: mark[0].middle)
        low, contact, found = not half.b > 0, self.claim["pattern"][0], []
        for phase, what in marks:
            if phase.middle > 0:
                found.append((phase, contact, low, what))
            if what == "end":
                return found
            if what in ("low", "high"):
                low = what == "low"
            else:
                assert what[0] == contact, "contacts do not follow from each other"
                contact = what[1]

    def line(self, what):
        """Return the flank line of a contact; None at other nodes."""
        if isinstance(what, tuple):
            return zero() if 1 in what else self.mesh.far
        return None

    def equations(self, unknowns):
        """Return residuals of contacts, and those of the return."""
        x, v, *phases = unknowns
        nu = phases.pop() if self.tuned else self.nu
        at, contacts = zero(), []
        for phase, contact, low, what in self.nodes(phases):
            x, v = self.mesh.move(contact, low, nu, x, v, phase - at)
            at, end = phase, self.line(what)
            if end is not None:
                contacts.append(x - end)
                # The equation holds: on the line from here on.
                x = end
        return contacts, [x - unknowns[0], v - unknowns[1]]

    def system(self, box):
        """Return the residuals over a box, dual numbers in the unknowns."""
        contacts, back = self.equations(duals(box))
        return [*contacts, *back]

    def deviations(self, contacts, back):
        """Return the map of small deviations over the orbit: the contacts' phases eliminated."""
        rates = []
        for i, row in enumerate(contacts):
            pair = []
            for column in (0, 1):
                total = row.slopes[column]
                for j in range(i):
                    total = total + row.slopes[2 + j] * rates[j][column]
                pair.append(total * -1 * (1 / row.slopes[2 + i]))
            rates.append(pair)
        found = []
        for i, row in enumerate(back):
            for column in (0, 1):
                total = row.slopes[column] + (1 if i == column else 0)
                for j, pair in enumerate(rates):
                    total = total + row.slopes[2 + j] * pair[column]
                found.append(total)
        return found

    def image(self, box):
        """Return the box in which Krawczyk's test encloses the one zero in a box, else None."""
        n = len(box)
        centre = [iv.mpf(value.mid) for value in box]
        residuals = [row.value for row in self.system(centre)]
        rows = [row.slopes for row in self.system(box)]
        inverse = inverted(rows)
        if inverse is None:
            return None
        found = []
        for i in range(n):
            image = centre[i] - sum(inverse[i][j] * residuals[j] for j in range(n))
            for j in range(n):
                entry = sum(inverse[i][k] * rows[k][j] for k in range(n))
                image += ((i == j) - entry) * (box[j] - centre[j])
            found.append(image)
        return found if all(map(inside, found, box)) else None

    def within(self, share):
        """Return a share of the box in which the claim says that there is no other."""
        rates = [1, 1 / self.nu.value, *[1] * (len(self.box) - 2)]
        radius = iv.mpf([-1, 1]) * self.claim["radius"] * share
        return [
            iv.mpf(value.mid) + radius * rate for value, rate in zip(self.box, rates, strict=True)
        ]

    def repeats_earlier(self, box):
        """Return whether the orbit may repeat after fewer mesh periods than the claim says."""
        period = self.claim["period"]
        for part in range(1, period):
            if period % part:
                continue
            events = [e for e in self.claim["events"] if float(e["phase"][0]) < 2 * mp.pi * part]
            shorter = Claim(self.claim | {"period": part, "events": events})
            way = shorter.follow(box[: 2 + len(events)])
            if way is None or all(
                one.a <= other.b and other.a <= one.b
                for one, other in zip(way[1], box[:2], strict=True)
            ):
                return True
        return False

    def follow(self, box):
        """Go along all motions of a box of unknowns; None unless the contacts are all.

        That is, unless every arc keeps off the flank lines strictly between its ends.

        Returns (arcs with their durations, state at the end).
        """
        x, v, *phases = map(Dual, box)
        nu = phases.pop() if self.tuned else self.nu
        at, arcs, count = zero(), [], 0
        on = zero() if x.value.a == x.value.b == 0 else None
        for phase, contact, low, what in self.nodes(phases):
            arc, end = Arc(self.mesh, contact, low, nu, x, v), self.line(what)
            span = phase - at
            if not span > 0:
                return None
            for side, line in self.sides(contact):
                ends = [mark is not None and mark.value == line.value for mark in (on, end)]
                if not arc.keeps_off(side, line, span.value, *ends):
                    return None
            x, v = arc.at(span.value)
            if end is not None:
                if not (v > 0 if what[1] > what[0] else v < 0):
                    return None
                x, count = end, count + 1
            at, on = phase, end
            arcs.append((arc, span.value))
        return (arcs, (x.value, v.value)) if count == len(phases) else None

    def sides(self, contact):
        """Return (side, line): side (x - line) > 0 is what a contact code means."""
        far = self.mesh.far
        if contact == 0:
            return [(-1, zero())] + ([(1, far)] if mp.isfinite(far.value.a) else [])
        return [(1, zero())] if contact == 1 else [(-1, far)]

    def invariants(self, box):
        """Return trace and determinant of the map of small deviations over the orbit."""
        contacts, back = self.equations(duals(box))
        a, b, c, d = self.deviations(contacts, back)
        drags = [self.mesh.material if code else self.mesh.oil for code in self.claim["pattern"]]
        # Where nothing is damped, areas are kept.
        kept = all(drag.value == 0 for drag in drags)
        return a + d, iv.mpf(1) if kept else a * d - b * c

    def is_judged_right(self, box):
        """Return whether trace, determinant, multipliers and the verdict agree with the claim."""
        trace, determinant = self.invariants(box)
        given = [iv.mpf(self.claim[name]) for name in ("trace", "determinant")]
        (p, q), (r, s) = [[iv.mpf(part) for part in one] for one in self.claim["multipliers"]]
        pairs = zip((trace, determinant), given, strict=True)
        roots = zip((trace, determinant, 0), (p + r, p * r - q * s, q + s), strict=True)
        if not all(one in two for one, two in [*pairs, *roots]):
            return False
        stability = self.claim["stability"]
        return stability == "undecided" or stability == judged(trace, determinant)

    def extrema_are_right(self, arcs):
        """Return whether the smallest and the largest displacement lie where the claim says."""
        found = []
        for arc, span in arcs:
            found += [arc.state[0].value, arc.at(span)[0].value, *arc.turns(span)]
        for name, sign in (("displacement_min", 1), ("displacement_max", -1)):
            given, values = iv.mpf(self.claim[name]) * sign, [x * sign for x in found]
            if not min(x.a for x in values) >= given.a or not min(x.b for x in values) <= given.b:
                return False
        return True


def judged(trace, determinant):
    """Return what Jury's conditions say, None where they say nothing."""
    excess = abs(trace) - determinant
    if determinant.b < 1 and excess.b < 1:
        return "stable"
    return "unstable" if determinant.a > 1 or excess.a > 1 else None


def inverted(rows):
    """Return an inverse near that of all matrices in intervals, None where there is none."""
    try:
        inverse = matrix([[mp.mpf(entry.mid) for entry in row] for row in rows]) ** -1
    except ZeroDivisionError:
        return None
    return [[iv.mpf(inverse[i, j]) for j in range(len(rows))] for i in range(len(rows))]


def faults(claim, share=0.25):
    """Return what this program cannot confirm of a claim of any kind, a list of words.

    Of a train, or six degrees of freedom, in 50 digits; it proves nothing then.

    Its enclosures are wider than balls, so that it proves uniqueness in a share of the radius only.
    """
    if claim["claim"] == "range":
        return range_faults(claim)
    if "coordinates" in claim:
        return certificates.faults(claim)
    one, found = Claim(claim), []
    box = one.image(one.box)
    if box is None:
        return ["existence"]
    way = one.follow(box)
    if way is None:
        found.append("contacts")
    if not (claim["radius"] > 0 and one.image(one.within(share))):
        found.append("uniqueness")
    if one.repeats_earlier(box):
        found.append("period")
    if not one.is_judged_right(box):
        found.append("stability")
    if way and not one.extrema_are_right(way[0]):
        found.append("extrema")
    return found


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
        residuals = [row.value for row in self.rows([*middle, at])]
        rows = [row.slopes for row in self.rows([*box, nu])]
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


def main(path):
    """Print the faults of a file; return how many claims have any."""
    with open(path, encoding="utf-8") as file:
        claims = [row for row in json.load(file) if row["claim"] not in ("count", "refusal")]
    wrong = 0
    for claim in claims:
        unconfirmed = faults(claim, 1e-3)
        wrong += bool(unconfirmed)
        if unconfirmed:
            place = claim.get("tuning", claim.get("start"))
            print(claim["damping"], claim["claim"], place, *unconfirmed)
    print(f"{len(claims) - wrong} of {len(claims)} claims are confirmed")
    return wrong


if __name__ == "__main__":
    sys.exit(bool(main(sys.argv[1])))
