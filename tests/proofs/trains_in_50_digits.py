"""A second program for certificates of trains: the orbit in 50 digits.

Taylor series in time for flights, contacts looked for along the way, saltation matrices at
contacts. It proves nothing; what it finds has to lie in the enclosures.
"""

from mpmath import eig, lu_solve, matrix, mp, mpf, nstr, sqrt

from tests.proofs.claimed_trains import Train
from tests.references.reference_motion import cuts_of

#: Terms of a series, how far it reaches by the fastest rate, places where distances are looked at.
_TERMS, _REACH, _PLACES = 48, 2, 20
#: Of what follows from the middle of a claim with 20 digits.
_ROOM = mpf(10) ** -17
#: How far from a line, in static deflections, a turning point lies that touches it.
_TOUCH = mpf(10) ** -20


class Motion(Train):
    """The motions of the train of a claim."""

    #: Turning points of distances, (how far off, phase, mesh, side), where they are asked for.
    nearest: list | None = None

    def run(self, y, rates, vary=False, along=()):
        """Run from reduced coordinates and rates, m, over the period of the claim.

        Returns (coordinates and rates at the end, events, the map of small deviations or None); the
        map is of all deviations, or of those in `along`, a column each.
        """
        n, e = self.n, len(self.kept)
        columns = [[mpf(0)] * (2 * n) + [mpf(1)] + [mpf(1), mpf(0)] * len(self.frequencies)]
        for i, k in enumerate(self.kept):
            columns[0][k], columns[0][n + k] = y[i], rates[i]
        if vary:
            along = [[mpf(int(i == j)) for i in range(2 * e)] for j in range(2 * e)]
        for deviation in along:
            column = [mpf(0)] * len(columns[0])
            for i, value in enumerate(deviation):
                column[self.kept[i % e] + (n if i >= e else 0)] = mpf(value)
            columns.append(column)
        # Cuts of equal phases differ by rounding.
        cuts = cuts_of(self.machine, self.claim["period"], mpf(10) ** -40)
        codes, events, tau = list(self.codes), [], mpf(0)
        for cut in cuts:
            laws: dict = {}
            middle = (tau + cut) / 2

            def law_of(codes, laws=laws, middle=middle):
                key = tuple(codes)
                if key not in laws:
                    laws[key] = self.law(middle, codes)
                return laws[key]

            while tau < cut:
                law = law_of(codes)
                tau, met = self._flight(law, columns, codes, tau, cut)
                if met is None:
                    continue
                j, side, after = met
                distance, rate = self.functional(self.sides[j][side])
                speed = _dot(rate, columns[0])
                events.append((tau, j, codes[j], after, speed))
                codes[j] = after
                jump = [
                    b - a
                    for a, b in zip(
                        _times(law, columns[0]),
                        _times(law_of(codes), columns[0]),
                        strict=True,
                    )
                ]
                for column in columns[1:]:
                    share = _dot(distance, column) / speed
                    column[:] = [x + share * d for x, d in zip(column, jump, strict=True)]
        ends = [self.reduced(c[:n]) + self.reduced(c[n : 2 * n]) for c in columns]
        found = None
        if along:
            found = matrix([[column[i] for column in ends[1:]] for i in range(2 * e)])
        return ends[0], events, found

    def _flight(self, law, columns, codes, tau, cut):
        """Go on to the next contact, a cut, or as far as a series reaches; columns are changed."""
        n = self.n
        # In units in which velocities are like displacements of the fastest motion.
        fast = sqrt(max(sum(abs(v) for j, v in row if j < n) for row in law[n : 2 * n]))
        fast = max([fast, *(abs(v) for row in law[2 * n :] for _, v in row)])
        fast += max(sum(abs(v) for j, v in row if n <= j < 2 * n) for row in law[n : 2 * n])
        h = min(cut - tau, _REACH / max(fast, mpf(1)))
        series = [columns[0]]
        for k in range(1, _TERMS):
            series.append([value / k for value in _times(law, series[-1])])
        best, met = h, None
        for j, code in enumerate(codes):
            for side, sign, after in (
                [(1, 1, 0)] if code == 1 else [(0, -1, 0)] if code == -1 else []
            ) + ([(1, -1, 1), (0, 1, -1)] if code == 0 else []):
                if self.sides[j][side] is None:
                    continue
                distance, _ = self.functional(self.sides[j][side])
                curve = [sign * _dot(distance, one) for one in series]
                if abs(curve[0]) < mpf(10) ** -44 * self.length:
                    # This contact has just been met: on the line.
                    curve[0] = mpf(0)
                if self.nearest is not None and self._touches(j, side, curve, h, tau):
                    continue
                root = _first_fall(curve, h)
                if root is not None and root < best:
                    best, met = root, (j, side, after)
        for i, column in enumerate(columns):
            terms = series
            if i:
                terms = [column]
                for k in range(1, _TERMS):
                    terms.append([value / k for value in _times(law, terms[-1])])
            column[:] = [_horner([term[r] for term in terms], best) for r in range(len(column))]
        return (cut if met is None and best == cut - tau else tau + best), met

    def orbit(self):
        """Return (y, rates, events, map): a step of Newton from the middle of the claim's boxes.

        Events and map are those of the middle itself.
        """
        boxes = [self.claim[name][i] for name in ("displacement", "velocity") for i in self.kept]
        y = [self.length * (mpf(low) + mpf(high)) / 2 for low, high in boxes]
        e = len(self.kept)
        end, events, slopes = self.run(y[:e], y[e:], vary=True)
        miss = matrix([a - b for a, b in zip(end, y, strict=True)])
        steps = lu_solve(slopes - mp.eye(2 * e), miss)
        y = [value - step for value, step in zip(y, steps, strict=True)]
        return y[:e], y[e:], events, slopes

    def _contacts(self, events):
        """Return ([(event, what is listed)], ["contacts"] if they do not belong together)."""
        model = self.claim["pair"]
        names = [mesh["name"] for mesh in model["meshes"]] if "meshes" in model else ["mesh"]
        # At one phase, to rounding, the order says nothing.
        events = sorted(events, key=lambda one: (nstr(one[0], 15), names[one[1]]))
        listed = [one | {"mesh": one.get("mesh", "mesh")} for one in self.claim["events"]]
        listed.sort(key=lambda one: (nstr(mpf(one["phase"][0]), 15), one["mesh"]))
        own = [(names[j], before, after) for _, j, before, after, _ in events]
        if own != [(one["mesh"], one["before"], one["after"]) for one in listed]:
            return [], ["contacts"]
        return list(zip(events, listed, strict=True)), []

    def point(self):
        """Return what is not confirmed of a fold, a doubling or a grazing, from the middle."""
        boxes = [self.claim[name][i] for name in ("displacement", "velocity") for i in self.kept]
        y = [self.length * (mpf(low) + mpf(high)) / 2 for low, high in boxes]
        e, kind = len(self.kept), self.claim["claim"]
        self.nearest = []
        end, events, slopes = self.run(y[:e], y[e:], vary=kind != "grazing")
        away = max(abs(a - b) for a, b in zip(end, y, strict=True)) / self.length
        wrong = [] if away < mpf(10) ** -24 else ["orbit"]
        wrong += self._contacts(events)[1]
        if kind != "grazing":
            one = -1 if kind == "period doubling" else 1
            multipliers = eig(slopes, left=False, right=False)
            if not min(abs(value - one) for value in multipliers) < mpf(10) ** -12:
                wrong.append("multiplier")
            return wrong
        # Of a flank that is not crossed: how near it comes, and when.
        name, side = self.claim["touched"]
        names = [mesh["name"] for mesh in self.claim["pair"]["meshes"]]
        own = [(gap, at) for gap, at, *which in self.nearest
               if which == [names.index(name), ("coast", "drive").index(side)]]  # fmt: skip
        gap, at = min(own, default=(mpf(1), mpf(0)))
        near = abs(at - sum(map(mpf, self.claim["touch"])) / 2)
        return wrong if gap < _TOUCH and near < mpf(10) ** -12 else [*wrong, "touch"]

    def _touches(self, j, side, curve, h, tau):
        """Note where a distance turns in a series and how far off; return whether it touches."""
        slopes = [k * c for k, c in enumerate(curve)][1:]
        bends = [k * c for k, c in enumerate(slopes)][1:]
        for i in range(_PLACES):
            low, high = h * i / _PLACES, h * (i + 1) / _PLACES
            if _horner(slopes, low) < 0 < _horner(slopes, high):
                at = (low + high) / 2
                for _ in range(9):
                    at -= _horner(slopes, at) / _horner(bends, at)
                self.nearest.append((abs(_horner(curve, at)) / self.length, tau + at, j, side))
                if self.nearest[-1][0] < _TOUCH:
                    return True
        return False

    def faults(self, found):
        """Return what of an orbit does not lie in the enclosures of the claim."""
        y, rates, events, slopes = found
        claim, wrong = self.claim, []
        for name, values in (("displacement", y), ("velocity", rates)):
            boxes = [claim[name][i] for i in self.kept]
            inside = [_holds(box, v / self.length) for box, v in zip(boxes, values, strict=True)]
            wrong += [] if all(inside) else [name]
        listed, missing = self._contacts(events)
        if missing:
            return [*wrong, *missing]
        for (tau, *_, speed), event in listed:
            if not _holds(event["phase"], tau, _ROOM):
                wrong.append("phase")
            if not _holds(event["velocity"], speed / self.length, _ROOM):
                wrong.append("speed")
        if slopes is not None:
            multipliers = eig(slopes, left=False, right=False)
            boxes = list(claim["multipliers"])
            for one in multipliers:
                parts = one.real, one.imag
                own = [
                    box
                    for box in boxes
                    if all(_holds(*pair, _ROOM) for pair in zip(box, parts, strict=True))
                ]
                if not own:
                    wrong.append("multiplier")
                    break
                boxes.remove(own[0])
            outside = max(abs(one) for one in multipliers) > 1
            wrong += [] if (claim["stability"] == "unstable") == outside else ["stability"]
        return wrong


def faults(claim):
    """Return what this program cannot confirm of a claim about a train, a list of words."""
    motion = Motion(claim)
    return motion.faults(motion.orbit()) if claim["claim"] == "train" else motion.point()


def _holds(box, value, room=0):
    """Return whether an enclosure, widened by some room, holds a value."""
    return mpf(box[0]) - room <= value <= mpf(box[1]) + room


def _dot(row, z):
    return sum((a * b for a, b in zip(row, z, strict=True) if a), mpf(0))


def _times(law, z):
    return [sum((value * z[j] for j, value in row), mpf(0)) for row in law]


def _horner(coefficients, t):
    total = mpf(0)
    for value in reversed(coefficients):
        total = total * t + value
    return total


def _first_fall(curve, h):
    """Return the first t in (0, h] at which a polynomial falls through 0, None if nowhere seen."""
    last, t_last = curve[0], mpf(0)
    if last == 0 and curve[1] < 0:
        # Met at once with another contact.
        return last
    for i in range(1, _PLACES + 1):
        t = h * i / _PLACES
        value = _horner(curve, t)
        if value < 0 and (last > 0 or (last == 0 and t_last == 0 and curve[1] > 0)):
            low, high = t_last, t
            if last == 0:
                low = t / 2**20
            for _ in range(20):
                middle = (low + high) / 2
                low, high = (middle, high) if _horner(curve, middle) > 0 else (low, middle)
            root = (low + high) / 2
            slopes = [k * c for k, c in enumerate(curve)][1:]
            for _ in range(8):
                root -= _horner(curve, root) / _horner(slopes, root)
            return root
        last, t_last = value, t
    return None
