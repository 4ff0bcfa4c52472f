"""The laws of motion in balls, with one degree of freedom and linear phases: closed forms.

Displacements are counted in the model's unit (static deflections), time in the unit in which the
frequency of the mesh is nu (1 / Omega_s): there the tuning is no part of the law of a `GearPair`,
it only sets when the stiffness switches. The state is z = (x, w, 1, cos, sin, ...) with w = dx/dt
and harmonics of the mesh phase, if the model has any. Between two events

    x'' + 2 b x' + c x = f + harmonics.

The floating-point numbers of a `GearPair` in SI units and the tuning are exact numbers; kappa,
epsilon, beta, ... follow from them in balls, by the formulas of `gearlib.models.pair`. Of other
models those of their `Equation` are exact.
"""

import math

from gearlib.analysis.proofs.balls import flint
from gearlib.kernels.codes import BACKLASH, INVERSE, NORMAL


class ClosedLaw:
    """One law; `rows` are (order, cosine, sine) of accelerations, `scale` is 1 / nu."""

    #: Whether the motion of an arc is known as a whole.
    closed = True

    def __init__(self, stiffness, damping, load, rows=(), scale=None):
        arb, arb_mat = flint().arb, flint().arb_mat
        self.stiffness, self.damping, self.load = arb(stiffness), arb(damping), arb(load)
        self.square = self.stiffness - self.damping * self.damping
        self.root = abs(self.square).sqrt()
        size = 3 + 2 * len(rows)
        self.matrix = arb_mat(size, size)
        self.matrix[0, 1] = 1
        for column, value in ((0, -self.stiffness), (1, -2 * self.damping), (2, self.load)):
            self.matrix[1, column] = value
        self.terms = []
        for k, (order, cosine, sine) in enumerate(rows):
            rate, column = order / scale, 3 + 2 * k
            self.matrix[1, column], self.matrix[1, column + 1] = cosine, sine
            self.matrix[column, column + 1], self.matrix[column + 1, column] = -rate, rate
            # Of A cos + B sin: (c - rate^2) A + 2 b rate B = a, (c - rate^2) B - 2 b rate A = b.
            near, across = self.stiffness - rate * rate, 2 * self.damping * rate
            share = 1 / (near * near + across * across)
            a, b = near * cosine - across * sine, near * sine + across * cosine
            self.terms.append((column, rate, a * share, b * share))

    def waves(self, t):
        """Return (C, S), the damped cosine and sine of a time, under a stiffness."""
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

    def _small(self, t):
        """Return the map of small deviations over a time, a row after the other."""
        if self.stiffness != 0:
            c, s = self.waves(t)
            drag = self.damping * s
            return c + drag, s, -self.stiffness * s, c - drag
        if self.damping == 0:
            return 1, t, 0, 1
        rate = 2 * self.damping
        shrink = (-rate * t).expm1()
        return 1, -shrink / rate, 0, 1 + shrink

    def flow(self, t):
        """Return the map of small deviations of z over a time: a matrix, of (x, w) alone."""
        found = flint().arb_mat(self.matrix.nrows(), self.matrix.nrows())
        found[0, 0], found[0, 1], found[1, 0], found[1, 1] = self._small(t)
        return found

    def _periodic(self, waves):
        """Return displacement and velocity of the motion that the harmonics keep up."""
        x = w = 0
        for column, rate, cosine, sine in self.terms:
            c, s = waves[column], waves[column + 1]
            x, w = x + cosine * c + sine * s, w + rate * (sine * c - cosine * s)
        return x, w

    def go(self, z, t):
        """Return z after a time."""
        ends = z.entries()
        x, w = ends[:2]
        p11, p12, p21, p22 = self._small(t)
        if self.terms:
            away = self._periodic(ends)
            x, w = x - away[0], w - away[1]
            for column, rate, *_ in self.terms:
                s, c = (rate * t).sin_cos()
                a, b = ends[column : column + 2]
                ends[column : column + 2] = c * a - s * b, s * a + c * b
        if self.stiffness != 0:
            x -= (rest := self.load / self.stiffness)
            x, w = rest + p11 * x + p12 * w, p21 * x + p22 * w
        else:
            drift = t * t / 2 if self.damping == 0 else (t - p12) / (2 * self.damping)
            x, w = x + w * p12 + self.load * drift, p22 * w + self.load * p12
        if self.terms:
            away = self._periodic(ends)
            x, w = x + away[0], w + away[1]
        ends[:2] = x, w
        return flint().arb_mat(len(ends), 1, ends)


class ClosedLaws:
    """All laws of a model of one degree of freedom at a tuning; as of `TrainLaws`.

    ``lines``   displacements of the flank lines, (far or None, near); one and the same without
                backlash
    ``tuned``   whether the laws depend on the tuning
    """

    repeats, fixed, kept, framed = 1, (), (0,), False
    mesh_names, coordinates, moving, derived = ("mesh",), ("displacement",), (False,), {}

    def __init__(self, model, tuning):
        self.tuning, self.frequencies, self._laws = flint().arb(tuning), [], {}
        self._of_pair(model) if model.mesh is model else self._of_equation(model.equation)
        self.tuned, self.size = bool(self.frequencies), 3 + 2 * len(self.frequencies)
        far, near = self.lines
        arb_mat = flint().arb_mat
        self.basis = self.inverse = arb_mat(self.size, self.size, [
            int(i == j) for i in range(self.size) for j in range(self.size)
        ])  # fmt: skip
        drive = self._row(near)
        coast = drive if far is near else None if far is None else self._row(far)
        self.rows = self.distances = [[coast, drive]]

    def _row(self, line):
        return flint().arb_mat([[1, 0, -line] + [0] * (self.size - 3)])

    def _of_pair(self, pair):
        arb = flint().arb
        kappa, ratio = arb(pair.stiffness_ratio), arb(pair.contact_ratio)
        mean = kappa + (1 - kappa) * (ratio - 1)
        natural = (arb(pair.max_stiffness) * mean / pair.reduced_mass).sqrt()
        unit = 2 * arb(pair.reduced_mass) * natural
        damping, oil = pair.material_damping / unit, pair.backlash_damping / unit
        near, far = arb(0), None
        if pair.backlash == 0.0:
            far = near
        elif math.isfinite(pair.backlash):
            deflection = arb(pair.load) / (arb(pair.max_stiffness) * mean)
            far = -arb(pair.backlash) / deflection
        self.lines = far, near
        levels = 1 / mean, kappa / mean
        self._laws[BACKLASH] = [ClosedLaw(0, oil, 1)] * 2
        for contact, line in ((NORMAL, near), (INVERSE, far)):
            if line is not None:
                self._laws[contact] = [ClosedLaw(c, damping, c * line + 1) for c in levels]
        constant = pair.stiffness_ratio == 1.0 or pair.contact_ratio in (1.0, 2.0)
        pi = arb.pi()
        self.segments = [(arb(0), 1 if pair.contact_ratio == 1.0 else 0)]
        self.segments += [] if constant else [(pi * (ratio - 1), 1), (pi * (3 - ratio), 0)]

    def _of_equation(self, equation):
        arb, scale = flint().arb, 1 / self.tuning
        near, far = arb(equation.upper), None
        if equation.lower == equation.upper:
            far = near
        elif math.isfinite(equation.lower):
            far = arb(equation.lower)
        self.lines = far, near
        rows = [(int(n), arb(float(a)), arb(float(b))) for n, a, b in equation.force.tolist()]
        # The inertia of the deviation's second derivative by time.
        rows += [
            (int(n), -arb(a) * (int(n) / scale) ** 2, -arb(b) * (int(n) / scale) ** 2)
            for n, a, b in equation.deviation.tolist()
        ]
        self.frequencies = [order for order, *_ in rows]
        ground, load = arb(equation.ground), arb(equation.load)
        drive, coast = equation.sides()

        def law(contact, stiffness, line):
            damping = arb(float(equation.damping[contact + 1, 0])) / 2
            return ClosedLaw(stiffness + ground, damping, load + stiffness * line, rows, scale)

        self._laws[BACKLASH] = [law(BACKLASH, arb(0), near)] * len(drive.low)
        for contact, side, line in ((NORMAL, drive, near), (INVERSE, coast, far)):
            if line is not None:
                values = [arb(float(c)) for c in side.lines[:, 0]]
                self._laws[contact] = [law(contact, c, line) for c in values]
        self.segments = [(arb(0), 0)]
        self.segments += [(arb(float(at)), i + 1) for i, at in enumerate(drive.breaks[1:-1])]

    def law(self, codes, segment):
        """Return the law for the contact code of the mesh, a list of one, on a segment."""
        return self._laws[codes[0]][segment]

    def on_line(self, side):
        """Return the matrix that puts z where a contact has it: on the flank line."""
        found = self.basis * 1
        found[0, 0], found[0, 2] = 0, self.lines[side]
        return found

    def kick(self, before, after, z, row):
        """Return by what a crossing changes z over the distance: the saltation of Eq. (20)."""
        change = 2 * (before.damping - after.damping)
        return flint().arb_mat(self.size, 1, [0, change] + [0] * (self.size - 2))

    def start(self, state):
        """Return (x, dx/dt) of a state (x, dx/dtau) in floats, a list of balls."""
        arb = flint().arb
        return [arb(float(state[0])), arb(float(state[1])) * self.tuning]

    def spread(self, box, scale):
        """Return ([displacement], [dx/dtau]) from (x, dx/dt)."""
        return [box[0]], [box[1] * scale]
