"""Dual numbers of intervals, for the second program: values with their derivatives.

It shares no code with gearlib.
"""

from contextlib import contextmanager

from mpmath import iv, mp

iv.dps = mp.dps = 50


@contextmanager
def digits(count):
    """Compute with so many decimal digits."""
    before = iv.dps
    iv.dps = mp.dps = count
    try:
        yield
    finally:
        iv.dps = mp.dps = before


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
        other = dual(other)
        return self._with(_sum(self.value, other.value), 1, other, 1)

    def __sub__(self, other):
        return self + dual(other) * -1

    def __mul__(self, other):
        other = dual(other)
        return self._with(_times(self.value, other.value), other.value, other, self.value)

    def inverse(self):
        value = self.value.inverse() if isinstance(self.value, Dual) else 1 / self.value
        return self._with(value, value * value * -1)

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


def dual(number):
    return number if isinstance(number, Dual) else Dual(number)


def zero():
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


def duals(box):
    """Return the numbers of a box as unknowns."""
    n = len(box)
    return [Dual(value, [iv.mpf(int(i == j)) for j in range(n)]) for i, value in enumerate(box)]
