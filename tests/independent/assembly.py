"""A system in parts, in SI units and in the numbers of a context of mpmath.

    M q'' + C q' + K q + sum of contact forces = load + forces

The phase tau runs with the constant `speed`, rad/s; `length`, m, and `force`, N/m, are its units.
`forces` have a row (n), and the order of a derivative by time of waves (frequency, cosine, sine).

A contact has ``rate`` (periods of its stiffness per period of the phase), ``film`` and, on each
side, ``material`` damping (linear, quadratic, cubic), ``powers`` of the elastic force (quadratic,
cubic), ``across`` (n, direction of friction), ``zero`` (distance of displacement zero) and
``sides``: the drive side touches where its distance row . q + constant + waves is positive, the
coast side, if there is one, where its own is negative. A side has ``row``, ``constant``, ``waves``
(frequency, cosine, sine), ``friction``, ``turns`` (periods at which the sliding turns to 1) and
``course``, its stiffness: ``breaks`` in [0, 2 pi), ``lines`` (value, slope) from each on,
``harmonics`` (order, cosine, sine), ``shift`` in periods, ``high``: below it counts as low.
"""

import re
from itertools import pairwise, zip_longest

import mpmath
import numpy as np

from tests.independent.equations import stiffness_series, wave_series

_HEXADECIMAL = re.compile(r"-?(0x[0-9a-f.]+p[+-]\d+|inf)")


def with_numbers_of(context, value):
    """Return a description with its floats, or their hexadecimal texts, as numbers of a context."""
    if isinstance(value, dict):
        return {key: with_numbers_of(context, item) for key, item in value.items()}
    if isinstance(value, list):
        return [with_numbers_of(context, item) for item in value]
    if isinstance(value, str) and _HEXADECIMAL.fullmatch(value):
        value = float.fromhex(value)
    return context.mpf(value) if isinstance(value, (float, mpmath.mpf)) else value


def mean_stiffness(mesh):
    """Return C_s, Eq. (2), of a pair or mesh."""
    kappa = mesh["stiffness_ratio"]
    return mesh["max_stiffness"] * (kappa + (1 - kappa) * (mesh["contact_ratio"] - 1))


def harmonics(wave):
    """Return rows (order, cosine, sine) of described harmonics."""
    rows = zip_longest(wave["cosines"], wave["sines"], fillvalue=0)
    return [(order, *row) for order, row in enumerate(rows, start=1)]


def course(breaks, lines, period, harmonics=(), high=None, shift=0):
    """Return a ``course``; without `high` a stiffness below the mean counts as low."""
    if high is None:
        spans = [b - a for a, b in pairwise([*breaks, breaks[0] + period])]
        high = sum(w * (c + k * w / 2) for w, (c, k) in zip(spans, lines, strict=True)) / period
    return dict(breaks=breaks, lines=lines, harmonics=harmonics, high=high, shift=shift)


def rectangular_course(mesh, context, shift=0):
    """Return the ``course`` of Eq. (1) of the paper: C_max about a phase, `shift` in periods."""
    half, high = context.pi * (mesh["contact_ratio"] - 1), mesh["max_stiffness"]
    breaks, lines = [half, 2 * context.pi - half], [(high * mesh["stiffness_ratio"], 0), (high, 0)]
    return course(breaks, lines, 2 * context.pi, high=high, shift=shift)


def contact(sides, film, rate=1, powers=(0, 0), across=None, zero=0):
    """Return a contact by its fields; without a coast side the last is falsy."""
    sides = [side for side in sides if side]
    across = 0 * sides[0]["row"] if across is None else across
    return dict(sides=sides, film=film, rate=rate, powers=powers, across=across, zero=zero)


def flank(row, course, material, constant=0, waves=(), friction=0, turns=0):
    """Return one side of a contact by its fields."""
    side = dict(row=row, course=course, material=material, constant=constant)
    return side | dict(waves=waves, friction=friction, turns=turns)


class System:
    """Matrices, loads and contacts to be filled."""

    def __init__(self, context, size):
        self.context, self.n = context, size
        self.mass, self.stiffness, self.damping = (self.zeros(size, size) for _ in range(3))
        self.load, self.contacts, self.forces = self.zeros(size), [], []

    def zeros(self, *shape):
        return np.full(shape, self.context.mpf(0), float if self.context is mpmath.fp else object)

    def unit(self, i):
        row = self.zeros(self.n)
        row[i] += 1
        return row

    def spring(self, row, stiffness, damping=0):
        """Add a spring and damper that act on the elongation `row @ q`."""
        self.stiffness = self.stiffness + stiffness * np.outer(row, row)
        self.damping = self.damping + damping * np.outer(row, row)

    def inertia(self, row, mass):
        self.mass = self.mass + mass * np.outer(row, row)

    def distance(self, side, q, phase):
        """Return the distance of a side in m."""
        (waves,) = wave_series(self.context, side["waves"], phase, terms=1)
        return side["row"] @ q + side["constant"] + waves

    def level(self, contact, side, phase):
        """Return the stiffness of a side at a phase."""
        phase = contact["rate"] * phase
        return stiffness_series(self.context, side["course"], phase, phase)[0]
