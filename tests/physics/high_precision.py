"""A high-precision reference of the linear one-degree mesh, written for the tests alone.

mpmath with 50 digits, event by event. Nothing is shared with the library: contact is the pair of
complex exponentials exp(r t) (or their double limit), turning points are the zeros of their
derivative, crossings are bracketed between turning points and bisected, then polished by
Newton's method. Parameters are taken as the exact binary numbers that the floats are.
"""

import mpmath
from mpmath import mp, mpf

mp.dps = 50
_TINY = mpf(10) ** -40


class Arc:
    """Motion x'' + 2 a x' + w2 x = f from (x, v) at t = 0, as x(t), v(t) and turning points."""

    def __init__(self, a, w2, f, x, v):
        self.a, self.w2, self.f, self.x0, self.v0 = a, w2, f, x, v
        if w2 == 0:
            return
        self.rest = f / w2
        self.root = mpmath.sqrt(mpmath.mpc(a * a - w2))
        u = x - self.rest
        if self.root == 0:
            self.amplitudes = (u, v + a * u)
        else:
            r1, r2 = -a + self.root, -a - self.root
            self.rates = (r1, r2)
            self.amplitudes = ((v - r2 * u) / (r1 - r2), (r1 * u - v) / (r1 - r2))

    def at(self, t):
        """Return (x, v) at t."""
        if self.w2 == 0:
            if self.a == 0:
                return self.x0 + self.v0 * t + self.f * t * t / 2, self.v0 + self.f * t
            final = self.f / (2 * self.a)
            gone = -mpmath.expm1(-2 * self.a * t)
            v = final + (self.v0 - final) * (1 - gone)
            return self.x0 + final * t + (self.v0 - final) * gone / (2 * self.a), v
        if self.root == 0:
            c, d = self.amplitudes
            e = mpmath.exp(-self.a * t)
            return self.rest + e * (c + d * t), e * (d - self.a * (c + d * t))
        terms = [c * mpmath.exp(r * t) for c, r in zip(self.amplitudes, self.rates, strict=True)]
        speeds = [r * term for r, term in zip(self.rates, terms, strict=True)]
        return self.rest + mpmath.re(sum(terms)), mpmath.re(sum(speeds))

    def turning_points(self, horizon):
        """Return the times in (0, horizon) at which v = 0, in order (the first few suffice)."""
        times = []
        if self.w2 == 0:
            if self.v0 < 0:
                ratio = -2 * self.a * self.v0 / self.f
                times = [mpmath.log1p(ratio) / (2 * self.a) if self.a else -self.v0 / self.f]
        elif self.root == 0:
            c, d = self.amplitudes
            if d != 0 and self.a != 0:
                times = [1 / self.a - c / d]
        else:
            (c1, c2), (r1, r2) = self.amplitudes, self.rates
            if c1 != 0 and c2 != 0:
                # exp((r1 - r2) t) = -c2 r2 / (c1 r1)
                log = mpmath.log(-c2 * r2 / (c1 * r1))
                step = r1 - r2
                if mpmath.im(step) == 0:
                    times = [mpmath.re(log / step)] if abs(mpmath.im(log)) < _TINY else []
                else:
                    first = mpmath.re(log / step)
                    half = mp.pi / (mpmath.im(step) / 2)
                    first = first % half
                    times = [first + k * half for k in range(-1, 4)]
        return sorted(t for t in times if _TINY < t < horizon)

    def first_crossing(self, line, direction, horizon):
        """Return (t, v) of the first crossing of `line` in `direction` within horizon, or None."""
        knots = [mpf(0), *self.turning_points(horizon), horizon]
        for low, high in zip(knots, knots[1:], strict=False):
            x_low = self.at(low)[0] if low else self.x0
            x_high = self.at(high)[0]
            if direction * (x_high - x_low) <= 0:
                continue
            if direction * (x_low - line) > 0 or direction * (x_high - line) <= 0:
                continue
            return self._polish(line, direction, low, high)
        return None

    def _polish(self, line, direction, low, high):
        for _ in range(30):
            middle = (low + high) / 2
            if direction * (self.at(middle)[0] - line) > 0:
                high = middle
            else:
                low = middle
        t = (low + high) / 2
        for _ in range(100):
            x, v = self.at(t)
            step = (x - line) / v
            new = t - step
            if not low <= new <= high:
                new = (low + high) / 2
            if direction * (x - line) > 0:
                high = min(high, t)
            else:
                low = max(low, t)
            if abs(new - t) < mpf(10) ** -45 * (1 + t):
                break
            t = new
        return t, self.at(t)[1]


def propagate(
    contact_ratio,
    stiffness_ratio,
    damping,
    backlash_damping,
    backlash,
    tuning,
    periods,
    initial_state=(0.0, 0.0),
    arcs=None,
):
    """Return (x, v, events) after `periods` mesh periods from tau = 0.

    `events` is a list of (phase, contact before, contact after, v). A start on a flank line
    belongs to where the motion goes, without an event; the load pulls up. `arcs` is a list to which
    (mesh period, arc, duration, contact, stiffness over the mean) of all arcs are added.
    """
    eps, kappa, beta, beta_m, s, nu = (
        mpf(p)
        for p in (
            contact_ratio,
            stiffness_ratio,
            damping,
            backlash_damping,
            backlash,
            tuning,
        )
    )
    x, v = map(mpf, initial_state)
    mean = kappa + (1 - kappa) * (eps - 1)
    half, low = mp.pi * (eps - 1), 2 * mp.pi * (2 - eps)
    stretches = [(half, 1 / mean), (low, kappa / mean), (half, 1 / mean)]
    f = 1 / nu**2
    if x > 0 or (x == 0 and v >= 0):
        contact = 1
    elif x < -s or (x == -s and v < 0):
        contact = -1
    else:
        contact = 0
    events = []
    for n in range(periods):
        phase = 2 * mp.pi * n
        for length, c in stretches:
            left = length
            while left > 0:
                if contact == 0:
                    arc = Arc(beta_m / nu, mpf(0), f, x, v)
                    lines = [(mpf(0), 1, 1), (-s, -1, -1)]
                elif contact == 1:
                    arc = Arc(beta / nu, c / nu**2, f, x, v)
                    lines = [(mpf(0), -1, 0 if s > 0 else -1)]
                else:
                    arc = Arc(beta / nu, c / nu**2, f, x + s, v)
                    lines = [(mpf(0), 1, 0 if s > 0 else 1)]
                hits = []
                for line, direction, target in lines:
                    if mpmath.isinf(line):
                        continue
                    hit = arc.first_crossing(line, direction, left)
                    if hit is not None:
                        hits.append((*hit, line, target))
                if arcs is not None:
                    lasts = min(hits)[0] if hits else left
                    arcs.append((n, arc, lasts, contact, c))
                if not hits:
                    x, v = arc.at(left)
                    if contact == -1:
                        x -= s
                    left = mpf(0)
                    break
                t, v, line, target = min(hits)
                left -= t
                x = -s if contact == -1 else line
                events.append((phase + length - left, contact, target, v))
                contact = target
            phase += length
    return x, v, events
