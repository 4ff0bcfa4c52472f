"""The orbit of a pair that keeps contact, over a box of the numbers that it depends on.

Over mesh phase x'' + 2 b x' + c x = 1, with c = s in the C_max segments and kappa s in the C_min
segment between them, whose ends are set by the contact ratio: load, backlash and the oil take no
part. Where balls for all four numbers are too wide, their parts follow by the mean value theorem:
x(p) lies in x(p0) + sum_j dx/dp_j(P) (P_j - p0_j), with derivatives as power series in balls.
"""

from contextlib import contextmanager

from gearlib.analysis.proofs.balls import flint
from gearlib.analysis.proofs.multipliers import judge_two

#: Shortest piece of a segment, as a share of it.
_SHORTEST = 2.0**-9
#: How often derivatives and orbits are enclosed by each other.
_PASSES = 2


@contextmanager
def _of_first_order():
    """Compute power series up to their first derivative."""
    context = flint().ctx
    before, context.cap = context.cap, 2
    try:
        yield
    finally:
        context.cap = before


def _flow(x, v, c, b, t):
    """Return displacement and velocity after a phase; all numbers are balls or series."""
    root, rest = (c - b * b).sqrt(), 1 / c
    sine, cosine = (root * t).sin_cos()
    decay, sine, u = (-b * t).exp(), sine / root, x - rest
    return (
        rest + decay * (u * (cosine + b * sine) + v * sine),
        decay * (v * (cosine - b * sine) - c * u * sine),
    )


class _Map:
    """The map of a mesh period of four numbers: its segments (c, length), matrix and constants."""

    def __init__(self, numbers, pi):
        s, kappa, b, ratio = numbers
        half = pi * (ratio - 1)
        self.b, self.segments = b, [(s, half), (kappa * s, 2 * pi - 2 * half), (s, half)]
        (x, v), *moved = (self.states(*one)[-1] for one in ((0, 0), (1, 0), (0, 1)))
        #: A row after the other, then the constants.
        self.entries = [moved[0][0] - x, moved[1][0] - x, moved[0][1] - v, moved[1][1] - v, x, v]

    def states(self, x, v):
        """Return the states at the beginnings of all segments and at the end."""
        states = [(x, v)]
        for c, length in self.segments:
            x, v = _flow(x, v, c, self.b, length)
            states.append((x, v))
        return states

    def at(self, i, start, share):
        """Return displacement and velocity at a share of a segment."""
        (x, v), (c, length) = start, self.segments[i]
        return _flow(x, v, c, self.b, length * share)


class KeptContact:
    """The same of all numbers of a box, four balls: s, kappa, b and the contact ratio.

    ZeroDivisionError, of series ValueError, where the orbits are not enclosed.
    """

    def __init__(self, numbers):
        arb, series, arb_mat = flint().arb, flint().arb_series, flint().arb_mat
        self.numbers, pi = numbers, arb.pi()
        if not numbers[0] * numbers[1] > numbers[2] * numbers[2]:
            raise ZeroDivisionError
        self.middle = _Map([one.mid() for one in numbers], pi)
        self.wide = _Map(numbers, pi)
        self.apart = [arb(0, one.rad()) for one in numbers]
        with _of_first_order():
            self.ahead = []
            for j in range(4):
                along = [series([one, int(i == j)]) for i, one in enumerate(numbers)]
                self.ahead.append(_Map(along, series([pi])))
        entries = [
            self._about(value, [one.entries[i] for one in self.ahead])
            for i, value in enumerate(self.middle.entries)
        ]
        a, b, c, d, x, v = entries
        unit = arb_mat([[1, 0], [0, 1]])
        near = unit - arb_mat([self.middle.entries[:2], self.middle.entries[2:4]])
        inverse = near.mid().inv().mid()
        whole = (inverse * (unit - arb_mat([[a, b], [c, d]]))).inv() * inverse
        self.trace = a + d
        first = near.inv() * arb_mat([[one] for one in self.middle.entries[4:]])
        state = whole * arb_mat([[x], [v]])
        slopes: list = []
        for _ in range(_PASSES):
            slopes = []
            for one in self.ahead:
                a, b, c, d, x, v = (entry[1] for entry in one.entries)
                slopes.append(whole * (arb_mat([[a, b], [c, d]]) * state + arb_mat([[x], [v]])))
            state = first + sum(
                (one * way for one, way in zip(slopes, self.apart, strict=True)),
                arb_mat([[0], [0]]),
            )
        self.first = self.middle.states(*first.entries())
        with _of_first_order():
            self.starts = [
                one.states(
                    *(
                        series([z, dz])
                        for z, dz in zip(state.entries(), slope.entries(), strict=True)
                    )
                )
                for one, slope in zip(self.ahead, slopes, strict=True)
            ]
        self.about = [
            tuple(self._about(z[k], [one[i][k] for one in self.starts]) for k in range(2))
            for i, z in enumerate(self.first)
        ]

    def _about(self, value, ahead):
        """Return a number over the box from that of its middle and series in every direction."""
        return value + sum(
            (one[1] * way for one, way in zip(ahead, self.apart, strict=True)), flint().arb(0)
        )

    def width(self, j):
        """Return how wide the orbit is in one of the numbers."""
        return max(float(abs(x[1] * self.apart[j]).upper()) for one in self.starts[j] for x in one)

    def stable(self):
        """Return whether both multipliers are proven to lie inside the unit circle."""
        determinant = (-4 * flint().arb.pi() * self.numbers[2]).exp()
        return judge_two(self.trace, determinant)[0] == "stable"

    def keeps_contact(self):
        """Return whether the displacement is proven to be positive throughout."""
        return all(map(self._above, range(3)))

    def _above(self, i):
        arb, todo = flint().arb, [(0.5, 0.5)]
        length = self.wide.segments[i][1]
        while todo:
            share, half = todo.pop()
            x, v = self.wide.at(i, self.about[i], arb(share, half))
            if x > 0:
                continue
            with _of_first_order():
                ahead = [
                    one.at(i, start[i], share)[0]
                    for one, start in zip(self.ahead, self.starts, strict=True)
                ]
            x = self._about(self.middle.at(i, self.first[i], arb(share))[0], ahead)
            if x + v * length * arb(0, half) > 0:
                continue
            if not x > 0 or half < _SHORTEST:
                return False
            todo += [(share - 0.5 * half, 0.5 * half), (share + 0.5 * half, 0.5 * half)]
        return True
