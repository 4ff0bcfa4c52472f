"""Arcs of a motion between two nodes, as they are or in frames that turn along with it."""

from fractions import Fraction

import numpy as np

from gearlib.analysis.proofs.balls import flint

#: Of an arc that hardly turns or stretches a box: its time by the norm of its law.
_SHORT = 0.125
#: Times that are wider than this move a state by their mean value.
_WIDE = 2.0**-30


class Arc:
    """An arc in the components of the laws themselves: no frames."""

    frame = back = None

    def __init__(self, law):
        self.law, self.begins, self.ends = law, law.matrix, law.matrix

    def turn(self, t):
        """Return what takes columns through a time."""
        return self.law.flow(t)

    def after(self, columns, turn):
        """Return columns after `turn` of a time."""
        return turn * columns

    def go(self, z, t, turn=None):
        """Return a state after a time."""
        return moved(self.law, z, t)

    def out(self, z):
        """Return columns in the components of the laws."""
        return z


class FramedArc:
    """An arc in the frames of its ends: z~ = frame c.

    ``base``    time near to that of the arc; where both ends are known the time itself
    ``power``   exponential of that time, from the frame before to that of this arc
    ``begins``  the law in the frame before; None where the arc begins at a known phase
    ``ends``    the law in the frame of this arc; None where it ends at a known phase
    """

    def __init__(self, base, power, begins, ends, frame, back):
        self.base, self.power, self.begins, self.ends = base, power, begins, ends
        self.frame, self.back = frame, back

    def turn(self, t):
        """Return the exponential of what a time differs from the base by; None: by nothing."""
        law = self.begins if self.ends is None else self.ends
        return None if law is None else (law * (t - self.base)).exp()

    def after(self, z, turn):
        """Return columns in the frame before after `turn` of a time, in the frame of this arc."""
        if turn is None:
            return self.power * z
        return turn * (self.power * z) if self.ends is not None else self.power * (turn * z)

    def go(self, z, t, turn=None):
        """Return columns in the frame before after a time, in the frame of this arc.

        `turn` is that of the time, where it is known.
        """
        return self.after(z, self.turn(t) if turn is None else turn)

    def out(self, z):
        """Return columns in the components of the laws."""
        return self.frame * z


def framed(path):
    """Return the `FramedArc` of every node of a path: exponentials at about their times.

    Frames are orthogonal, by the QR method of Lohner: boxes turn with the motion, and hardly
    grow by being wrapped anew after every arc. A short arc keeps the frame before.
    """
    n, scale = 2 * len(path.laws.kept), 1 / path.laws.tuning
    frame = back = unit(path.laws.size)
    spread, found, last, known = np.eye(n), [], 0, True
    for node, phase in zip(path.nodes, path.phases(path.guess), strict=True):
        starts_known, known = known, node.phase is not None
        base = (phase - last) * scale
        if not (starts_known and known):
            base = base.mid()
        law = None
        if abs(base) * norm(node.law.matrix) < _SHORT:
            begins = law = back * node.law.matrix * frame
            power = (law * base).exp()
        else:
            flow = node.law.flow(base)
            begins = None if starts_known else back * node.law.matrix * frame
            floats = [[float(value) for value in row[:n]] for row in flow.tolist()[:n]]
            spread = np.array(floats) @ spread
            # The longest direction first: it decides how the box lies.
            order = np.argsort(-np.linalg.norm(spread, axis=0), kind="stable")
            spread, _ = np.linalg.qr(spread[:, order])
            power, frame = flow * frame, unit(path.laws.size)
            for i in range(n):
                for j in range(n):
                    frame[i, j] = float(spread[i, j])
            back = frame.inv()
            power = back * power
            law = None if known else back * node.law.matrix * frame
        found.append(FramedArc(base, power, begins, law, frame, back))
        last = phase
    return found


def moved(law, z, t):
    """Return a state after a time, by the mean value of its speed where the time is wide."""
    if not t.rad() > _WIDE:
        return law.go(z, t)
    middle = t.mid()
    return law.go(z, middle) + law.matrix * law.go(z, t) * (t - middle)


def norm(matrix):
    """Return the largest sum of magnitudes in a row, an upper bound."""
    arb = flint().arb
    return max(sum(map(abs, row), arb(0)).upper() for row in matrix.tolist())


def ball_of(fraction):
    """Return a fraction, or a whole number, as a ball."""
    fraction = Fraction(fraction)
    return flint().arb(fraction.numerator) / fraction.denominator


def add(matrix, column, values):
    """Add values, shape (n, 1), to a column of a matrix."""
    for i, value in enumerate(values.entries()):
        matrix[i, column] += value


def unit(n):
    """Return the unit matrix."""
    return flint().arb_mat([[int(i == j) for j in range(n)] for i in range(n)])
