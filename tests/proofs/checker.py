"""A second program that checks certificates, from their JSON alone; it shares no code with gearlib.

Intervals of mpmath, mesh phase as time, closed forms by amplitudes, and derivatives by arithmetic
of dual numbers: nothing is differentiated by hand, and no saltation matrix is written down, since
the map of small deviations follows from the derivatives of the equations by elimination.
"""

from mpmath import iv, matrix, mp

iv.dps = mp.dps = 50


class Dual:
    """A value with its derivatives by all unknowns, if it has any; it may be a dual itself."""

    def __init__(self, value, slopes=()):
        self.value, self.slopes = value, slopes

    def _with(self, value, rate, other=None, other_rate=0):
        mine = [_times(s, rate) for s in self.slopes]
        theirs = [_times(s, other_rate) for s in other.slopes] if other is not None else []
        if mine and theirs:
            mine = [_sum(a, b) for a, b in zip(mine, theirs, strict=True)]
        return Dual(value, mine or theirs)

    def __add__(self, other):
        other = _dual(other)
        return self._with(_sum(self.value, other.value), 1, other, 1)

    def __sub__(self, other):
        return self + _dual(other) * -1

    def __mul__(self, other):
        other = _dual(other)
        return self._with(_times(self.value, other.value), other.value, other, self.value)

    def inverse(self):
        value = self.value.inverse() if isinstance(self.value, Dual) else 1 / self.value
        return self._with(value, value * value * -1)

    def __truediv__(self, other):
        return self * _dual(other).inverse()

    def __rtruediv__(self, other):
        return self.inverse() * other

    def __rsub__(self, other):
        return self * -1 + other

    def __neg__(self):
        return self * -1

    __radd__, __rmul__ = __add__, __mul__

    @property
    def interval(self):
        return self.value.interval if isinstance(self.value, Dual) else self.value

    @property
    def middle(self):
        return float(self.interval.mid)

    def __gt__(self, number):
        return self.interval.a > number

    def __lt__(self, number):
        return self.interval.b < number


def _sum(a, b):
    # mpmath does not leave a sum or product with what it does not know to the other side.
    return b + a if isinstance(b, Dual) else a + b


def _times(a, b):
    return b * a if isinstance(b, Dual) else a * b


def _dual(number):
    return number if isinstance(number, Dual) else Dual(number)


def _zero():
    return Dual(iv.mpf(0))


def exp(number):
    if not isinstance(number, Dual):
        return iv.exp(number)
    value = exp(number.value)
    return number._with(value, value)


def cosine(number):
    if not isinstance(number, Dual):
        return iv.cos(number)
    return number._with(cosine(number.value), sine(number.value) * -1)


def sine(number):
    if not isinstance(number, Dual):
        return iv.sin(number)
    return number._with(sine(number.value), cosine(number.value))


class Mesh:
    """Ratios of a gear pair, from its SI numbers as exact numbers."""

    def __init__(self, pair):
        given = {name: iv.mpf(float.fromhex(text)) for name, text in pair.items()}
        kappa, overlap = given["stiffness_ratio"], given["contact_ratio"] - 1
        stiffness = given["max_stiffness"] * (kappa * (1 - overlap) + overlap)
        high = given["max_stiffness"] / stiffness
        self.levels = Dual(high), Dual(high * kappa)
        critical = 2 * iv.sqrt(stiffness * given["reduced_mass"])
        self.material = Dual(given["material_damping"] / critical)
        self.oil = Dual(given["backlash_damping"] / critical)
        self.far = Dual(-given["backlash"] * stiffness / given["load"])
        #: Half the length of the segment of maximum stiffness.
        self.half = iv.pi * overlap
        #: Whether the stiffness never switches.
        self.constant = kappa == 1 or overlap == 0 or overlap == 1

    def move(self, contact, low, nu, x, v, t):
        """Return (x, v) after a phase t; v is dx/dtau."""
        load = 1 / (nu * nu)
        if contact == 0:
            if self.oil.value == 0:
                return x + v * t + load * t * t / 2, v + load * t
            rate = self.oil * 2 / nu
            final = load / rate
            left = (v - final) * exp(-(rate * t))
            return x + final * t + ((v - final) - left) / rate, final + left
        c, a = self.levels[low], self.material / nu
        rest = 1 / c + (0 if contact == 1 else self.far)
        u, square = x - rest, c - self.material * self.material
        if square > 0:
            w = Dual(iv.sqrt(square.value)) / nu
            one, two, decay = u, (v + a * u) / w, exp(-(a * t))
            cos, sin = cosine(w * t), sine(w * t)
            y = decay * (one * cos + two * sin)
            return y + rest, decay * w * (two * cos - one * sin) - a * y
        assert square < 0, "critical damping is beyond this checker"
        w = Dual(iv.sqrt(-square.value)) / nu
        slow, fast = w - a, -w - a
        one, two = (v - fast * u) / (w * 2), (slow * u - v) / (w * 2)
        one, two = one * exp(slow * t), two * exp(fast * t)
        return one + two + rest, slow * one + fast * two


class Claim:
    """The equations of a claim in its unknowns: x, v, phases of contacts, of a touch, and nu."""

    def __init__(self, claim):
        self.claim, self.mesh = claim, Mesh(claim["pair"])
        self.kind, self.tuned = claim["claim"], claim["claim"] != "orbit"
        marks = [(event["phase"], (event["before"], event["after"])) for event in claim["events"]]
        if claim.get("touch"):
            marks.append((claim["touch"], "touch"))
        marks.sort(key=lambda mark: float(mark[0][0]))
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
            return _zero() if contact == 1 else self.mesh.far
        if isinstance(what, tuple):
            return _zero() if 1 in what else self.mesh.far
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
            v = _zero() if what == "touch" else v
        return contacts, touches, [x - unknowns[0], v - unknowns[1]]

    def system(self, box):
        """Return the residuals over a box, dual numbers in the unknowns."""
        n = len(box)
        if self.kind not in ("fold", "period doubling"):
            contacts, touches, back = self.equations(_duals(box))
            return [*contacts, *touches, *back]
        # The multiplier depends on derivatives: of these the derivatives are asked for.
        outer = [
            Dual(value, [Dual(iv.mpf(int(i == j))) for j in range(n)])
            for i, value in enumerate(_duals(box))
        ]
        contacts, _, back = self.equations(outer)
        a, b, c, d = self.deviations(contacts, back)
        sign = 1 if self.kind == "fold" else -1
        rows = [row.value for row in [*contacts, *back]]
        return [*rows, (1 - a * sign) * (1 - d * sign) - b * c]

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

    def has_one_zero(self, box):
        """Return whether Krawczyk's test proves one zero of the equations in a box."""
        n = len(box)
        centre = [iv.mpf(value.mid) for value in box]
        residuals = [row.interval for row in self.system(centre)]
        rows = [[_dual(slope).interval for slope in row.slopes] for row in self.system(box)]
        try:
            inverse = matrix([[mp.mpf(entry.mid) for entry in row] for row in rows]) ** -1
        except ZeroDivisionError:
            return False
        for i in range(n):
            image = centre[i] - sum(iv.mpf(inverse[i, j]) * residuals[j] for j in range(n))
            for j in range(n):
                entry = sum(iv.mpf(inverse[i, k]) * rows[k][j] for k in range(n))
                image += ((i == j) - entry) * (box[j] - centre[j])
            if not (box[i].a < image.a and image.b < box[i].b):
                return False
        return True

    def within(self, share):
        """Return a share of the box in which the claim says that there is no other."""
        radius = iv.mpf([-1, 1]) * iv.mpf(self.claim["radius"]) * share
        rates = [1, 1 / self.nu.value, *[1] * (len(self.box) - 2)]
        return [
            iv.mpf(value.mid) + radius * rate for value, rate in zip(self.box, rates, strict=True)
        ]

    def contacts_are_all(self):
        """Return whether every arc keeps off the flank lines strictly between its ends."""
        x, v, *phases = map(Dual, self.box)
        nu = phases.pop() if self.tuned else self.nu
        at, on = self.start, None
        for phase, contact, low, what in self.nodes(phases):
            span, end = phase - at, self.line(contact, what)
            if not span > 0:
                return False
            arc = _Arc(self.mesh, contact, low, nu, x, v)
            for side, line in self.sides(contact):
                ends = [mark is not None and mark.value == line.value for mark in (on, end)]
                if not arc.keeps_off(side, line, span.value, *ends):
                    return False
            x, v = self.mesh.move(contact, low, nu, x, v, span)
            if isinstance(what, tuple) and not (v > 0 if what[1] > what[0] else v < 0):
                return False
            x = x if end is None else end
            v = _zero() if what == "touch" else v
            at, on = phase, end
        return True

    def sides(self, contact):
        """Return (side, line): side (x - line) > 0 is what a contact code means."""
        far = self.mesh.far
        if contact == 0:
            return [(-1, _zero())] + ([(1, far)] if mp.isfinite(far.value.a) else [])
        return [(1, _zero())] if contact == 1 else [(-1, far)]

    def is_judged_right(self):
        """Return whether trace, determinant, multipliers and the verdict agree with the claim."""
        contacts, _, back = self.equations(_duals(self.box))
        a, b, c, d = self.deviations(contacts, back)
        trace, determinant = a + d, a * d - b * c
        given = [iv.mpf(self.claim[name]) for name in ("trace", "determinant")]
        (p, q), (r, s) = [[iv.mpf(part) for part in one] for one in self.claim["multipliers"]]
        sums = trace, determinant, p + r, p * r - q * s, q + s
        for one, two in zip(sums, [*given, trace, determinant, iv.mpf(0)], strict=True):
            if one.b < two.a or two.b < one.a:
                return False
        excess = abs(trace) - determinant
        if self.claim["stability"] == "stable":
            return determinant.b < 1 and excess.b < 1
        if self.claim["stability"] == "unstable":
            return determinant.a > 1 or excess.a > 1
        return True


class _Arc:
    """A motion between two nodes."""

    def __init__(self, mesh, contact, low, nu, x, v):
        self.mesh, self.given, self.state = mesh, (contact, low, nu), (x, v)

    def at(self, t):
        return self.mesh.move(*self.given, *self.state, Dual(t))

    def bends(self, x, v):
        (contact, low, nu), mesh = self.given, self.mesh
        force, drag = Dual(iv.mpf(1)), mesh.material
        if contact == 0:
            drag = mesh.oil
        else:
            force = force - mesh.levels[low] * (x - (0 if contact == 1 else mesh.far))
        return force / (nu * nu) - drag * 2 / nu * v

    def keeps_off(self, side, line, span, from_line, to_line):
        """Return whether side (x - line) > 0 strictly between the ends, which may be on it."""
        (x, v), (x_end, v_end) = self.state, self.at(span)
        if not from_line and not (x - line) * side > 0:
            return False
        if not to_line and not (x_end - line) * side > 0:
            return False
        rests, todo = (_still(v.value), _still(v_end.value)), [(iv.mpf(0), span)]
        for _ in range(3000):
            if not todo:
                return True
            low, high = todo.pop()
            piece, middle = iv.mpf([low.a, high.b]), iv.mpf((low.mid + high.mid) / 2)
            x, v = self.at(piece)
            if (x - line) * side > 0:
                continue
            # By the mean value of the velocity: sharper where it is small.
            if (self.at(middle)[0] + v * (piece - middle) - line) * side > 0:
                continue
            # Leaving the line, or coming to it: by speed, or at rest and bent away.
            away = self.bends(x, v) * side > 0
            if from_line and low.b == 0 and (v * side > 0 or (rests[0] and away)):
                continue
            if to_line and high is span and (v * side < 0 or (rests[1] and away)):
                continue
            todo += [(low, middle), (middle, high)]
        return False


def _still(speed):
    """Return whether a speed is that of a touch, zero by the equations."""
    return 0 in speed and abs(speed).b < 1e-20


def _duals(box):
    n = len(box)
    return [Dual(value, [iv.mpf(int(i == j)) for j in range(n)]) for i, value in enumerate(box)]


def faults(claim, share=0.25):
    """Return what this program cannot confirm of a claim, a list of words.

    Its enclosures are wider than balls, so that it proves uniqueness in a share of the radius only.
    """
    one, found = Claim(claim), []
    if not one.has_one_zero(one.box):
        found.append("existence")
    if not one.contacts_are_all():
        found.append("contacts")
    if one.kind == "orbit":
        if not (claim["radius"] > 0 and one.has_one_zero(one.within(share))):
            found.append("uniqueness")
        if not one.is_judged_right():
            found.append("stability")
    return found
