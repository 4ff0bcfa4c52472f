"""The laws of motion in balls, with one degree of freedom and linear phases: closed forms.

Displacements are counted in the model's unit (static deflections), time in the unit in which the
frequency of the mesh is nu (1 / Omega_s): there the tuning is no part of the law of a `GearPair`,
it only sets when the stiffness switches. Between two events

    x'' + 2 b x' + c (x - r) = f,

with a rest position r, or with c = 0 under a load: the numbers of normal mesh, backlash or inverse
mesh. f are harmonics of the mesh phase, if the model has any.

The floating-point numbers of a `GearPair` in SI units and the tuning are exact numbers; kappa,
epsilon, beta, ... follow from them in balls, by the formulas of `gearlib.models.pair`. Of other
models those of their `Equation` are exact.
"""

import math

from gearlib.analysis.proofs.balls import flint
from gearlib.kernels.codes import BACKLASH, INVERSE, NORMAL


class Elastic:
    """Motion about a rest position r: contact, or a backlash with a spring to the ground."""

    def __init__(self, stiffness, damping, rest):
        self.stiffness, self.damping, self.rest = stiffness, damping, rest
        self.square = stiffness - damping * damping
        self.root = abs(self.square).sqrt()

    def waves(self, t):
        """Return (C, S), the damped cosine and sine of a time."""
        if self.square > 0:
            sine, cosine = (self.root * t).sin_cos()
            sine /= self.root
        elif self.square < 0:
            sine, cosine = (self.root * t).sinh_cosh()
            sine /= self.root
        else:
            # Next to critical damping: both are entire functions of the square.
            z, arb = -self.square * t * t / 4, flint().arb
            cosine, sine = z.hypgeom_0f1(arb(1) / 2), t * z.hypgeom_0f1(arb(3) / 2)
        decay = (-self.damping * t).exp()
        return decay * cosine, decay * sine

    def matrix(self, t):
        """Return the map of small deviations over a time, a row after the other."""
        c, s = self.waves(t)
        drag = self.damping * s
        return c + drag, s, -self.stiffness * s, c - drag

    def go(self, x, w, t, phase):
        """Return (x, w, matrix) after a time from a mesh phase."""
        p11, p12, p21, p22 = matrix = self.matrix(t)
        u = x - self.rest
        return self.rest + p11 * u + p12 * w, p21 * u + p22 * w, matrix

    def acceleration(self, x, w, phase, t=0):
        """Return x'' of a state at a time after a mesh phase."""
        return -2 * self.damping * w - self.stiffness * (x - self.rest)

    def generator(self):
        """Return the matrix of the linear law, a row after the other."""
        return 0, 1, -self.stiffness, -2 * self.damping


class Flight:
    """The backlash: free motion under a load and the drag of the oil."""

    def __init__(self, damping, load):
        self.damping, self.load = damping, load

    def matrix(self, t):
        """Return the map of small deviations over a time, a row after the other."""
        if self.damping == 0:
            return 1, t, 0, 1
        rate = 2 * self.damping
        shrink = (-rate * t).expm1()
        return 1, -shrink / rate, 0, 1 + shrink

    def go(self, x, w, t, phase):
        """Return (x, w, matrix) after a time from a mesh phase."""
        matrix = self.matrix(t)
        _, path, _, left = matrix
        drift = t * t / 2 if self.damping == 0 else (t - path) / (2 * self.damping)
        return x + w * path + self.load * drift, left * w + self.load * path, matrix

    def acceleration(self, x, w, phase, t=0):
        """Return x'' of a state at a time after a mesh phase."""
        return self.load - 2 * self.damping * w

    def generator(self):
        """Return the matrix of the linear law, a row after the other."""
        return 0, 1, 0, -2 * self.damping


class Forced:
    """A law under harmonics: its own motion beside a periodic one, in closed form as well.

    Parameters
    ----------
    law : Elastic or Flight
    rows : list of (order, cosine, sine)
        Accelerations.
    scale : arb
        1 / nu.
    """

    def __init__(self, law, rows, scale):
        self.law, self.damping, self.scale = law, law.damping, scale
        self.matrix, self.generator = law.matrix, law.generator
        _, _, stiffness, drag = law.generator()
        self.terms = []
        for order, cosine, sine in rows:
            rate = order / scale
            # Of A cos + B sin: (c - rate^2) A + 2 b rate B = a, (c - rate^2) B - 2 b rate A = b.
            near, across = -stiffness - rate * rate, -drag * rate
            size = near * near + across * across
            a, b = near * cosine - across * sine, near * sine + across * cosine
            self.terms.append((order, rate, a / size, b / size))

    def periodic(self, phase):
        """Return displacement, velocity and acceleration of the periodic motion at a phase."""
        x = w = a = 0
        for order, rate, cosine, sine in self.terms:
            s, c = (order * phase).sin_cos()
            now, turned = cosine * c + sine * s, sine * c - cosine * s
            x, w, a = x + now, w + rate * turned, a - rate * rate * now
        return x, w, a

    def go(self, x, w, t, phase):
        """Return (x, w, matrix) after a time from a mesh phase."""
        x_0, w_0, _ = self.periodic(phase)
        x_1, w_1, _ = self.periodic(phase + t / self.scale)
        x, w, matrix = self.law.go(x - x_0, w - w_0, t, phase)
        return x + x_1, w + w_1, matrix

    def acceleration(self, x, w, phase, t=0):
        """Return x'' of a state at a time after a mesh phase."""
        x_0, w_0, a = self.periodic(phase + t / self.scale)
        return a + self.law.acceleration(x - x_0, w - w_0, phase)


class Laws:
    """All laws of a model at a tuning, and the mesh phases at which they switch.

    ``near``, ``far``   displacements of the flank lines; one and the same without backlash, None
    ``switches``        (mesh phase, number of the segment from there on) within a period
    ``first``           number of the segment in which a period begins
    """

    def __init__(self, model, tuning):
        self._laws: dict = {}
        by_pair = model.mesh is model
        self._of_pair(model) if by_pair else self._of_equation(model.equation, tuning)

    def _of_pair(self, pair):
        arb = flint().arb
        kappa, ratio = arb(pair.stiffness_ratio), arb(pair.contact_ratio)
        mean = kappa + (1 - kappa) * (ratio - 1)
        natural = (arb(pair.max_stiffness) * mean / pair.reduced_mass).sqrt()
        unit = 2 * arb(pair.reduced_mass) * natural
        damping, oil = pair.material_damping / unit, pair.backlash_damping / unit
        self.near, self.far = arb(0), None
        if pair.backlash == 0.0:
            self.far = self.near
        elif math.isfinite(pair.backlash):
            deflection = arb(pair.load) / (arb(pair.max_stiffness) * mean)
            self.far = -arb(pair.backlash) / deflection
        levels = 1 / mean, kappa / mean
        self._laws[BACKLASH] = [Flight(oil, arb(1))] * 2
        for contact, line in ((NORMAL, self.near), (INVERSE, self.far)):
            if line is not None:
                self._laws[contact] = [Elastic(c, damping, line + 1 / c) for c in levels]
        constant = pair.stiffness_ratio == 1.0 or pair.contact_ratio in (1.0, 2.0)
        pi = arb.pi()
        self.switches = [] if constant else [(pi * (ratio - 1), 1), (pi * (3 - ratio), 0)]
        self.first = 1 if pair.contact_ratio == 1.0 else 0

    def _of_equation(self, equation, tuning):
        arb = flint().arb
        scale = 1 / arb(tuning)
        self.near, self.far = arb(equation.upper), None
        if equation.lower == equation.upper:
            self.far = self.near
        elif math.isfinite(equation.lower):
            self.far = arb(equation.lower)
        rows = [(int(n), arb(float(a)), arb(float(b))) for n, a, b in equation.force.tolist()]
        # The inertia of the deviation's second derivative by time.
        rows += [
            (int(n), -arb(a) * (int(n) / scale) ** 2, -arb(b) * (int(n) / scale) ** 2)
            for n, a, b in equation.deviation.tolist()
        ]
        ground, load = arb(equation.ground), arb(equation.load)
        near, far = equation.sides()

        def law(contact, stiffness, line):
            damping, total = arb(equation.damping[contact + 1, 0]) / 2, stiffness + ground
            one = Flight(damping, load)
            if total > 0:
                one = Elastic(total, damping, (load + stiffness * line) / total)
            return Forced(one, rows, scale) if rows else one

        self._laws[BACKLASH] = [law(BACKLASH, arb(0), self.near)] * len(near.low)
        for contact, side, line in ((NORMAL, near, self.near), (INVERSE, far, self.far)):
            if line is not None:
                values = [arb(float(c)) for c in side.lines[:, 0]]
                self._laws[contact] = [law(contact, c, line) for c in values]
        self.switches = [(arb(float(at)), i + 1) for i, at in enumerate(near.breaks[1:-1])]
        if self.switches:
            # Where the period ends the first segment follows.
            self.switches.append((2 * arb.pi(), 0))
        self.first = 0

    def law(self, contact, segment):
        """Return the law of a contact code on a segment."""
        return self._laws[contact][segment]

    def line(self, before, after):
        """Return the displacement of the flank line between two contact codes."""
        return self.near if NORMAL in (before, after) else self.far

    def bounds(self, contact):
        """Return (side, line) of a contact code: side (x - line) > 0 holds in it."""
        if contact == NORMAL:
            return [(1, self.near)]
        if contact == INVERSE:
            return [(-1, self.far)]
        return [(-1, self.near)] + ([] if self.far is None else [(1, self.far)])

    def kick(self, before, after):
        """Return by what a crossing changes dw' over dx: the saltation of Eq. (20)."""
        return 2 * (self._laws[before][0].damping - self._laws[after][0].damping)
