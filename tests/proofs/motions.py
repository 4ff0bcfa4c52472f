"""The second program on motions: a run from exact numbers into a trap about a stable orbit.

It shares no code with gearlib.
"""

from mpmath import iv

from tests.proofs.checker import Claim, faults
from tests.proofs.duals import digits, dual

#: Decimal digits of a run, and those more for each mesh period: its enclosure widens on the way.
_DIGITS, _LOST = 60, 4
#: Shortest side of the parts into which the neighbourhood of the orbit is cut, as a share of it.
_SHORTEST = 1 / 128


def _number(text):
    return iv.mpf(float.fromhex(text))


def _end_of_run(claim):
    """Return the enclosure of (x, v) after the listed mesh periods; None: not confirmed."""
    x, v = map(_number, claim["initial_state"])
    if claim["periods"] == 0:
        return x, v
    with digits(_DIGITS + _LOST * claim["periods"]):
        run = Claim(
            claim
            | {"claim": "orbit", "period": claim["periods"], "events": claim["run"]}
            | {"pattern": claim["run_pattern"], "displacement": x, "velocity": v}
        )
        way = run.follow(run.box, narrow=True)
    return None if way is None else way[2]


class _Trap:
    """An ellipse about the state of an orbit: (x, nu v) = orbit + V y with |y| <= radius."""

    def __init__(self, claim):
        phases = [
            event | {"phase": phase}
            for event, phase in zip(claim["events"], claim["trap_phases"], strict=True)
        ]
        self.orbit = Claim(claim | {"claim": "orbit", "events": phases})
        self.nu, self.centre = self.orbit.nu.value, self.orbit.box[:2]
        self.basis = [_number(text) for text in claim["basis"]]
        a, b, c, d = self.basis
        share = a * d - b * c
        self.inverse = d / share, -b / share, -c / share, a / share
        self.radius, self.rate = map(_number, (claim["trap_radius"], claim["contraction"]))

    def holds(self, x, v):
        """Return whether a state lies in the ellipse."""
        a, b, c, d = self.inverse
        p, q = x - self.centre[0], (v - self.centre[1]) * self.nu
        return ((a * p + b * q) ** 2 + (c * p + d * q) ** 2).b < (self.radius**2).a

    def contracts(self):
        """Return whether the derivative of the period map is as small as claimed all over it."""
        side = iv.mpf([-1, 1])
        todo = [(side, side)]
        while todo:
            one, two = todo.pop()
            if (one**2 + two**2).a > 1 or self._shrinks(one, two):
                continue
            if one.delta <= 2 * _SHORTEST:
                return False
            todo += [(p, q) for p in _halves(one) for q in _halves(two)]
        return 0 < self.rate < 1

    def _shrinks(self, one, two):
        a, b, c, d = self.basis
        y, z = self.radius * one, self.radius * two
        x, v = self.centre[0] + a * y + b * z, self.centre[1] + (c * y + d * z) / self.nu
        way = self.orbit.follow([x, v, *self.orbit.box[2:]], narrow=True)
        if way is None:
            return False
        p, q, r, s = self._map(way[0])
        rows = _product(self.inverse, _product((p, q / self.nu, r * self.nu, s), self.basis))
        p, q, r, s = rows
        # The larger eigenvalue of the square.
        half, mixed = (p**2 + r**2 - q**2 - s**2) / 2, p * q + r * s
        largest = (p**2 + r**2 + q**2 + s**2) / 2 + iv.sqrt(half**2 + mixed**2)
        return iv.sqrt(largest).b <= self.rate.a

    def _map(self, box):
        """Return the map of small deviations over a box of unknowns, by its mean value."""
        middle = [iv.mpf(value.mid) for value in box]
        ends = [self.orbit.with_deviations(values)[1] for values in (middle, box)]
        found = []
        for at, wide in zip(*ends, strict=True):
            # Without contacts it does not depend on the state: there are no slopes.
            ways = zip(wide.slopes, box, middle, strict=False)
            found.append(at.interval + sum(dual(s).interval * (b - m) for s, b, m in ways))
        return found


def _halves(side):
    return iv.mpf([side.a, side.mid]), iv.mpf([side.mid, side.b])


def _product(one, other):
    a, b, c, d = one
    p, q, r, s = other
    return a * p + b * r, a * q + b * s, c * p + d * r, c * q + d * s


def motion_faults(claim, share=0.25):
    """Return what is not confirmed of a motion that tends to an orbit."""
    found = faults(claim | {"claim": "orbit"}, share)
    trap, end = _Trap(claim), _end_of_run(claim)
    if claim["stability"] != "stable" or not trap.contracts():
        found.append("trap")
    if end is None:
        return [*found, "run"]
    if not all(value in iv.mpf(given) for value, given in zip(end, claim["arrival"], strict=True)):
        found.append("arrival")
    if claim["periods"] % claim["period"] or not trap.holds(*end):
        found.append("caught")
    return found
