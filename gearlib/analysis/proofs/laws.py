"""The laws of motion of a `GearPair` in balls: ratios from the SI numbers, and closed forms.

Displacements are counted in static deflections, time in 1 / Omega_s: there the tuning is no part of
the law, it only sets when the stiffness switches. Between two events

    x'' + 2 b x' + c (x - l) = 1,

with l = 0 in normal mesh, l = -s in inverse mesh, and c = 0 in the backlash, whose damping ratio
takes the place of b. The floating-point numbers of the model and the tuning are exact numbers;
kappa, epsilon, beta, ... follow from them in balls, by the formulas of `gearlib.models.pair`.
"""

import math

from gearlib.analysis.proofs.balls import flint
from gearlib.kernels.codes import BACKLASH, INVERSE, NORMAL


class Contact:
    """A phase of contact under one stiffness."""

    def __init__(self, stiffness, damping, line):
        self.stiffness, self.damping, self.line = stiffness, damping, line
        self.rest = line + 1 / stiffness
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

    def after(self, x, w, matrix, t):
        """Return the state after the time of a matrix."""
        p11, p12, p21, p22 = matrix
        u = x - self.rest
        return self.rest + p11 * u + p12 * w, p21 * u + p22 * w

    def acceleration(self, x, w):
        """Return x''."""
        return 1 - 2 * self.damping * w - self.stiffness * (x - self.line)

    def generator(self):
        """Return the matrix of the linear law, a row after the other."""
        return 0, 1, -self.stiffness, -2 * self.damping


class Flight:
    """The backlash: free motion under the load and the drag of the oil."""

    def __init__(self, damping):
        self.damping = damping

    def matrix(self, t):
        """Return the map of small deviations over a time, a row after the other."""
        if self.damping == 0:
            return 1, t, 0, 1
        rate = 2 * self.damping
        shrink = (-rate * t).expm1()
        return 1, -shrink / rate, 0, 1 + shrink

    def after(self, x, w, matrix, t):
        """Return the state after the time of a matrix."""
        _, path, _, left = matrix
        if self.damping == 0:
            return x + w * t + t * t / 2, w + t
        return x + w * path + (t - path) / (2 * self.damping), left * w + path

    def acceleration(self, x, w):
        """Return x''."""
        return 1 - 2 * self.damping * w

    def generator(self):
        """Return the matrix of the linear law, a row after the other."""
        return 0, 1, 0, -2 * self.damping


class Laws:
    """All laws of a `GearPair`, and the mesh phases at which the stiffness switches."""

    def __init__(self, pair):
        arb = flint().arb
        kappa, ratio = arb(pair.stiffness_ratio), arb(pair.contact_ratio)
        mean = kappa + (1 - kappa) * (ratio - 1)
        natural = (arb(pair.max_stiffness) * mean / pair.reduced_mass).sqrt()
        unit = 2 * arb(pair.reduced_mass) * natural
        #: Damping ratios in contact and in the backlash.
        self.damping, self.oil = pair.material_damping / unit, pair.backlash_damping / unit
        levels = 1 / mean, kappa / mean
        #: Displacements of the flank lines; one and the same without backlash.
        self.near, self.far = arb(0), None
        if pair.backlash == 0.0:
            self.far = self.near
        elif math.isfinite(pair.backlash):
            deflection = arb(pair.load) / (arb(pair.max_stiffness) * mean)
            self.far = -arb(pair.backlash) / deflection
        self._flight = Flight(self.oil)
        self._contacts = {
            NORMAL: [Contact(c, self.damping, self.near) for c in levels],
            INVERSE: [Contact(c, self.damping, self.far) for c in levels if self.far is not None],
        }
        pi, constant = arb.pi(), pair.stiffness_ratio == 1.0 or pair.contact_ratio in (1.0, 2.0)
        #: (mesh phase, whether the stiffness is the lower one from there on) within a period.
        self.switches = [] if constant else [(pi * (ratio - 1), True), (pi * (3 - ratio), False)]
        #: Whether a mesh period begins at the lower stiffness: at contact ratio 1 only.
        self.begins_low = pair.contact_ratio == 1.0

    def law(self, contact, low):
        """Return the law of a contact code, at the lower or the upper stiffness."""
        return self._flight if contact == BACKLASH else self._contacts[contact][low]

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
        if BACKLASH not in (before, after):
            return 0
        jump = 2 * (self.damping - self.oil)
        return jump if after == BACKLASH else -jump
