"""A second program that checks certificates, from their JSON alone; it shares no code with gearlib.

Intervals of mpmath, mesh phase as time, closed forms by amplitudes, and derivatives by arithmetic
of dual numbers: nothing is differentiated by hand, and no saltation matrix is written down, since
the map of small deviations follows from the derivatives of the equations by elimination.

Here orbits, folds, period doublings and grazings; `tongues`, `motions` and `ranges` for the others.
"""

from mpmath import iv, matrix, mp

from tests.proofs import trains_in_50_digits
from tests.proofs.duals import Dual, dual, duals, zero
from tests.proofs.meshes import Arc, Mesh, inside


class Claim:
    """The equations of a claim in its unknowns: x, v, phases of contacts, of a touch, and nu."""

    def __init__(self, claim):
        self.claim, self.mesh = claim, Mesh(claim["pair"])
        self.kind, self.tuned = claim["claim"], claim["claim"] != "orbit"
        marks = [(event["phase"], (event["before"], event["after"])) for event in claim["events"]]
        if claim.get("touch"):
            marks.append((claim["touch"], "touch"))
        marks.sort(key=lambda mark: iv.mpf(mark[0]).mid)
        self.kinds = [what for _, what in marks]
        boxes = [claim["displacement"], claim["velocity"], *(phase for phase, _ in marks)]
        boxes += [claim["tuning"]] if self.tuned else []
        self.box = [iv.mpf(box) for box in boxes]
        self.nu = None if self.tuned else Dual(iv.mpf(float.fromhex(claim["tuning"])))
        self.start = Dual(iv.pi if claim.get("start") == "pi" else iv.mpf(0))

    def nodes(self, phases):
        """Return [(phase, contact and level before, what happens)] in the order of the orbit."""
        half, turn, periods = self.mesh.half, 2 * iv.pi, self.claim["period"]
        marks = list(zip(phases, self.kinds, strict=True))
        for n in range(-1, -1 if self.mesh.constant else periods + 1):
            marks.append((Dual(half + n * turn), "low"))
            marks.append((Dual((n + 1) * turn - half), "high"))
        marks.append((self.start + periods * turn, "end"))
        marks.sort(key=lambda mark: mark[0].middle)
        low, contact, found = not half.b > 0, self.claim["pattern"][0], []
        for phase, what in marks:
            if phase.middle > self.start.middle:
                found.append((phase, contact, low, what))
            if what == "end":
                return found
            if what in ("low", "high"):
                low = what == "low"
            elif what != "touch":
                assert what[0] == contact, "contacts do not follow from each other"
                contact = what[1]

    def line(self, contact, what):
        """Return the flank line of a contact or of a touch; None at other nodes."""
        if what == "touch":
            # Where the load bends the motion away from the line.
            return zero() if contact == 1 else self.mesh.far
        if isinstance(what, tuple):
            return zero() if 1 in what else self.mesh.far
        return None

    def equations(self, unknowns):
        """Return residuals of contacts, of a touch, and those of the return."""
        x, v, *phases = unknowns
        nu = phases.pop() if self.tuned else self.nu
        at, contacts, touches = self.start, [], []
        for phase, contact, low, what in self.nodes(phases):
            x, v = self.mesh.move(contact, low, nu, x, v, phase - at)
            at, end = phase, self.line(contact, what)
            if what == "touch":
                touches += [x - end, v]
            elif end is not None:
                contacts.append(x - end)
            # The equation holds: on the line from here on.
            x = x if end is None else end
            v = zero() if what == "touch" else v
        return contacts, touches, [x - unknowns[0], v - unknowns[1]]

    def system(self, box):
        """Return the residuals over a box, dual numbers in the unknowns."""
        if self.kind not in ("fold", "period doubling"):
            contacts, touches, back = self.equations(duals(box))
            return [*contacts, *touches, *back]
        rows, (a, b, c, d) = self.with_deviations(box)
        sign = 1 if self.kind == "fold" else -1
        return [*rows, (1 - a * sign) * (1 - d * sign) - b * c]

    def with_deviations(self, box):
        """Return the residuals, and the map of small deviations, each with its derivatives."""
        n = len(box)
        # The map depends on derivatives: of these the derivatives are asked for.
        outer = [
            Dual(value, [Dual(iv.mpf(int(i == j))) for j in range(n)])
            for i, value in enumerate(duals(box))
        ]
        contacts, _, back = self.equations(outer)
        return [row.value for row in [*contacts, *back]], self.deviations(contacts, back)

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
        residuals = [row.interval for row in self.system(centre)]
        rows = [[dual(slope).interval for slope in row.slopes] for row in self.system(box)]
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
        nu = self.box[-1] if self.tuned else self.nu.value
        rates = [1, 1 / nu, *[1] * (len(self.box) - 2)]
        # The radius of a tuning is one of 1 / nu.
        rates = rates[:-1] + [nu**2] if self.tuned else rates
        radius = iv.mpf([-1, 1]) * self.claim["radius"] * share
        return [
            iv.mpf(value.mid) + radius * rate for value, rate in zip(self.box, rates, strict=True)
        ]

    def is_the_only_one(self, share):
        """Return whether there is no other in a share of the box, and the box is what is said."""
        ends = [1 / iv.mpf(tuning) - 1 / self.box[-1] for tuning in self.claim.get("interval", ())]
        radius = self.claim["radius"]
        return all(abs(end).b <= radius for end in ends) and bool(self.image(self.within(share)))

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
                for one, other in zip(way[2], box[:2], strict=True)
            ):
                return True
        return False

    def follow(self, box, narrow=False):
        """Go along all motions of a box of unknowns; None unless the contacts are all.

        That is, unless every arc keeps off the flank lines strictly between its ends. `narrow`: the
        phases of contact are near those in the box, and follow from the state.

        Returns (unknowns, arcs with their durations, state at the end).
        """
        x, v, *phases = map(Dual, box)
        nu = phases.pop() if self.tuned else self.nu
        at, arcs, found = self.start, [], [x.value, v.value]
        on = zero() if x.value.a == x.value.b == 0 else None
        for phase, contact, low, what in self.nodes(phases):
            arc, end = Arc(self.mesh, contact, low, nu, x, v), self.line(contact, what)
            span = phase - at
            if narrow and end is not None:
                time = arc.crossing(span.value, end)
                if time is None:
                    return None
                span, phase = Dual(time), at + time
            if not span > 0:
                return None
            for side, line in self.sides(contact):
                ends = [mark is not None and mark.value == line.value for mark in (on, end)]
                if not arc.keeps_off(side, line, span.value, *ends):
                    return None
            x, v = arc.at(span.value)
            if isinstance(what, tuple) and not (v > 0 if what[1] > what[0] else v < 0):
                return None
            x = x if end is None else end
            v = zero() if what == "touch" else v
            at, on = phase, end
            arcs.append((arc, span.value))
            if end is not None:
                found.append(phase.value)
        found += [nu.value] * self.tuned
        return (found, arcs, (x.value, v.value)) if len(found) == len(box) else None

    def sides(self, contact):
        """Return (side, line): side (x - line) > 0 is what a contact code means."""
        far = self.mesh.far
        if contact == 0:
            return [(-1, zero())] + ([(1, far)] if mp.isfinite(far.value.a) else [])
        return [(1, zero())] if contact == 1 else [(-1, far)]

    def invariants(self, box):
        """Return trace and determinant of the map of small deviations over the orbit."""
        contacts, _, back = self.equations(duals(box))
        a, b, c, d = [entry.interval for entry in map(dual, self.deviations(contacts, back))]
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
    """Return what this program cannot confirm of a claim, a list of words.

    Of a train, or six degrees of freedom, in 50 digits; it proves nothing then.

    Its enclosures are wider than balls, so that it proves uniqueness in a share of the radius only.
    """
    if "coordinates" in claim:
        return trains_in_50_digits.faults(claim)
    one, found = Claim(claim), []
    box = one.image(one.box)
    if box is None:
        return ["existence"]
    way = one.follow(box)
    if way is None:
        found.append("contacts")
    if not (claim["radius"] > 0 and one.is_the_only_one(share)):
        found.append("uniqueness")
    if one.kind == "orbit":
        if one.repeats_earlier(box):
            found.append("period")
        if not one.is_judged_right(box):
            found.append("stability")
        if way and not one.extrema_are_right(way[1]):
            found.append("extrema")
    return found
