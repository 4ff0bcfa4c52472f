"""Dual numbers of intervals, the laws of motion of a gear pair in them, and arcs of a motion.

It shares no code with gearlib.
"""

from mpmath import iv, mp

iv.dps = mp.dps = 50


class Dual:
    """An interval with its derivatives by all unknowns, if it has any."""

    def __init__(self, value, slopes=()):
        self.value, self.slopes = value, slopes

    def _with(self, value, rate, other=None, other_rate=0):
        mine = [s * rate for s in self.slopes]
        theirs = [s * other_rate for s in other.slopes] if other is not None else []
        if mine and theirs:
            mine = [a + b for a, b in zip(mine, theirs, strict=True)]
        return Dual(value, mine or theirs)

    def __add__(self, other):
        other = dual(other)
        return self._with(self.value + other.value, 1, other, 1)

    def __sub__(self, other):
        return self + dual(other) * -1

    def __mul__(self, other):
        other = dual(other)
        return self._with(self.value * other.value, other.value, other, self.value)

    def inverse(self):
        value = 1 / self.value
        return self._with(value, -value * value)

    def __truediv__(self, other):
        return self * dual(other).inverse()

    def __rtruediv__(self, other):
        return self.inverse() * other

    def __rsub__(self, other):
        return self * -1 + other

    def __neg__(self):
        return self * -1

    __radd__, __rmul__ = __add__, __mul__

    @property
    def middle(self):
        return float(self.value.mid)

    def __gt__(self, number):
        return self.value.a > number

    def __lt__(self, number):
        return self.value.b < number


def dual(number):
    """Return a number as a dual number without derivatives."""
    return number if isinstance(number, Dual) else Dual(number)


def zero():
    return Dual(iv.mpf(0))


def exp(number):
    value = iv.exp(number.value)
    return number._with(value, value)


def cosine(number):
    return number._with(iv.cos(number.value), -iv.sin(number.value))


def sine(number):
    return number._with(iv.sin(number.value), iv.cos(number.value))


def duals(box):
    """Return the numbers of a box as unknowns."""
    n = len(box)
    return [Dual(value, [iv.mpf(int(i == j)) for j in range(n)]) for i, value in enumerate(box)]


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
            left = exp(-(rate * t))
            way = (1 - left) / rate
            return x + v * way + load * (t - way) / rate, v * left + load * way
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


class Arc:
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

    def turns(self, span):
        """Return intervals that hold the displacement wherever the velocity is zero."""
        found, todo = [], [iv.mpf([0, span.b])]
        for _ in range(3000):
            if not todo:
                return found
            piece = todo.pop()
            x, v = self.at(piece)
            if v > 0 or v < 0:
                continue
            bend = self.bends(x, v)
            if bend > 0 or bend < 0:
                piece = self._narrowed(piece, lambda x, v: (v, self.bends(x, v)))
                if piece is None:
                    continue
            elif x.value.delta > mp.mpf(10) ** -40:
                todo += [iv.mpf([piece.a, piece.mid]), iv.mpf([piece.mid, piece.b])]
                continue
            # Beyond the end of the arc there is no motion.
            ends = [self.at(span)[0].value] if piece.b > span.a else []
            values = [self.at(piece)[0].value, *ends]
            found.append(iv.mpf([min(x.a for x in values), max(x.b for x in values)]))
        return [iv.mpf(["-inf", "inf"])]

    def _newton(self, around, what):
        """Return where a quantity of the motion may be zero; `what` gives it and its rate."""
        middle = iv.mpf(around.mid)
        rate = what(*self.at(around))[1].value
        return None if 0 in rate else middle - what(*self.at(middle))[0].value / rate

    def _narrowed(self, around, what):
        """Return a narrower interval of times for a zero, None where there is none."""
        while True:
            newton = self._newton(around, what)
            if newton is None:
                return around
            low, high = max(newton.a, around.a), min(newton.b, around.b)
            if low > high:
                return None
            if not high - low < around.delta / 2:
                return iv.mpf([low, high])
            around = iv.mpf([low, high])

    def keeps_off(self, side, line, span, from_line, to_line):
        """Return whether side (x - line) > 0 strictly between the ends, which may be on it."""
        (x, _), (x_end, _) = self.state, self.at(span)
        if not from_line and not (x - line) * side > 0:
            return False
        if not to_line and not (x_end - line) * side > 0:
            return False
        todo = [(iv.mpf(0), span)]
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
            # Leaving the line, or coming to it.
            if from_line and low.b == 0 and v * side > 0:
                continue
            if to_line and high is span and v * side < 0:
                continue
            todo += [(low, middle), (middle, high)]
        return False


def inside(one, other):
    """Return whether an interval lies in the interior of another one."""
    return other.a < one.a and one.b < other.b
