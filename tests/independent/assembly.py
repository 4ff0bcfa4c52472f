"""A system in parts: matrices, loads, stiffness and contacts, in the numbers of a context."""

import json

import mpmath
import numpy as np

from tests.independent.equations import stiffness_series


def with_numbers_of(context, value):
    """Return a description with its floats as numbers of a context; integers and booleans stay."""
    if isinstance(value, dict):
        return {key: with_numbers_of(context, item) for key, item in value.items()}
    if isinstance(value, list):
        return [with_numbers_of(context, item) for item in value]
    return context.mpf(value) if isinstance(value, (float, mpmath.mpf)) else value


def mean_stiffness(mesh):
    """Return C_s, Eq. (2), of a pair or mesh."""
    kappa = mesh["stiffness_ratio"]
    return mesh["max_stiffness"] * (kappa + (1 - kappa) * (mesh["contact_ratio"] - 1))


def harmonics(wave):
    """Return rows (order, cosine, sine) of described harmonics."""
    cosines, sines = (list(wave[name]) for name in ("cosines", "sines"))
    count = max(len(cosines), len(sines))
    cosines, sines = (row + [0] * (count - len(row)) for row in (cosines, sines))
    return list(zip(range(1, count + 1), cosines, sines, strict=True))


def stiffness_profile(breaks, lines, period, waves=(), high=None, shift=0):
    """Return the ``course`` of a stiffness, see `equations`: (value, slope) from each break on.

    `waves` are its harmonics; without `high` a stiffness below the mean counts as low.
    """
    if high is None:
        ends = [*breaks[1:], breaks[0] + period]
        spans = [b - a for a, b in zip(breaks, ends, strict=True)]
        high = sum(w * (c + k * w / 2) for w, (c, k) in zip(spans, lines, strict=True)) / period
    names = {"breaks": breaks, "lines": lines, "harmonics": list(waves)}
    return names | {"high": high, "shift": shift}


def rectangular_profile(mesh, context, shift=0):
    """Return the ``course`` of Eq. (1) of the paper: C_max about a phase, `shift` in periods."""
    half, high = context.pi * (mesh["contact_ratio"] - 1), mesh["max_stiffness"]
    low, period = high * mesh["stiffness_ratio"], 2 * context.pi
    breaks, lines = [half, period - half], [(low, 0), (high, 0)]
    if half == 0 or half == context.pi:
        breaks, lines = [context.mpf(0)], [(low if half == 0 else high, 0)]
    return stiffness_profile(breaks, lines, period, high=high, shift=shift)


def contact(sides, film, rate=1, powers=(0, 0), across=None, zero=0):
    """Return a contact by its fields, see `equations`; without a coast side the last is falsy."""
    sides = [side for side in sides if side]
    across = sides[0]["row"] * 0 if across is None else across
    names = {"sides": sides, "film": film, "rate": rate, "powers": powers}
    return names | {"across": across, "zero": zero}


def flank(row, stiffness, material, constant=0, waves=(), friction=0, turns=0):
    """Return one side of a contact by its fields, see `equations`."""
    names = {"row": row, "course": stiffness, "material": material, "constant": constant}
    return names | {"waves": list(waves), "friction": friction, "turns": turns}


class System:
    """Matrices, loads and contacts to be filled, with the fields and units of `equations`."""

    def __init__(self, context, size):
        self.context, self.n = context, size
        self.mass, self.stiffness, self.damping = (self.zeros(size, size) for _ in range(3))
        self.load, self.contacts, self.forces, self.shaking = self.zeros(size), [], [], []
        self.length = self.speed = self.force = None

    def zeros(self, *shape):
        return np.full(shape, self.context.mpf(0), float if self.context is mpmath.fp else object)

    def unit(self, i):
        row = self.zeros(self.n)
        row[i] += 1
        return row

    def spring(self, row, stiffness, damping=0):
        """Add a spring and damper that act on the elongation `row @ q`."""
        square = np.outer(row, row)
        self.stiffness = self.stiffness + stiffness * square
        self.damping = self.damping + damping * square

    def inertia(self, row, mass):
        self.mass = self.mass + mass * np.outer(row, row)

    def distance(self, side, q, phase):
        """Return the distance of a side in m."""
        waves = (
            a * self.context.cos(f * phase) + b * self.context.sin(f * phase)
            for f, a, b in side["waves"]
        )
        return side["row"] @ q + side["constant"] + sum(waves)

    def level(self, contact, side, phase):
        """Return the stiffness of a side at a phase."""
        phase = contact["rate"] * phase
        return stiffness_series(self.context, side["course"], phase, phase)[0]

    def json(self):
        """Return the system as JSON; numbers of many digits are texts."""
        names = ("mass", "stiffness", "damping", "load", "contacts", "forces", "shaking")
        names += ("length", "speed", "force")
        return json.dumps({name: getattr(self, name) for name in names}, default=_encoded)


def _encoded(value):
    if isinstance(value, np.ndarray):
        return value.tolist()
    return mpmath.nstr(value, mpmath.mp.dps + 5)
