"""Courses of the mesh stiffness over one mesh period: rectangular, truncated Fourier, tabulated.

A profile is written as pieces: between two neighbouring ``breaks`` the stiffness over its mean is
a straight line plus harmonics,

    c(tau) = value + slope (tau - break) + sum_n a_n cos(n tau) + b_n sin(n tau).

Breaks lie wherever c is not smooth and wherever it crosses its mean, so that every piece is
wholly above or wholly below it ("at the lower stiffness").
"""

import csv
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from gearlib import checks
from gearlib.stiffness import levels, stretches

#: Phases per shortest wave at which a sum of harmonics is compared with its mean.
_SCAN = 32


@dataclass(frozen=True)
class Pieces:
    """A profile in pieces; stiffness over mean stiffness."""

    breaks: np.ndarray  #: shape (m + 1,), from 0 to 2 pi
    lines: np.ndarray  #: value at the start of each piece and slope, shape (m, 2)
    low: np.ndarray  #: whether the piece lies below the mean, shape (m,)
    harmonics: np.ndarray  #: order, cosine, sine, shape (n, 3)


@dataclass(frozen=True)
class Rectangular:
    """The full series of Eq. (1): C_max around tau = 0, C_min elsewhere."""

    def pieces(self, pair):
        """Return the `Pieces` for a `GearPair`."""
        high, low = levels(pair.contact_ratio, pair.stiffness_ratio)
        half_high, whole_low = stretches(pair.contact_ratio)
        lengths = np.array([half_high, whole_low, half_high])
        values = np.array([high, low, high])
        is_low = np.array([False, True, False])
        there = lengths > 0.0
        breaks = np.concatenate([[0.0], np.cumsum(lengths[there])])
        breaks[-1] = 2.0 * math.pi
        lines = np.column_stack([values[there], np.zeros(there.sum())])
        return Pieces(breaks, lines, is_low[there], np.empty((0, 3)))


@dataclass(frozen=True)
class Fourier:
    """Eq. (1) cut after `harmonics` terms: a smooth stiffness, another model than the full series.

    Raises
    ------
    ValueError
        If `harmonics` is not an integer >= 1.
    """

    harmonics: int

    def __post_init__(self):
        checks.integer("harmonics", self.harmonics, 1, 10_000)

    def pieces(self, pair):
        """Return the `Pieces` for a `GearPair`."""
        # Imported here: it costs every job of the workflow 0.3 s, and only this profile needs it.
        from scipy.optimize import brentq

        high, low = levels(pair.contact_ratio, pair.stiffness_ratio)
        n = np.arange(1, self.harmonics + 1)
        swing = (high - low) / 2.0 * 4.0 / (math.pi * n) * (-1.0) ** n
        cosines = swing * np.sin(n * math.pi * (pair.contact_ratio - 2.0))
        table = np.column_stack([n, cosines, np.zeros(n.size)])

        def above(phase):
            return float(cosines @ np.cos(n * phase))

        scan = np.linspace(0.0, 2.0 * math.pi, _SCAN * self.harmonics + 1)
        signs = np.sign([above(phase) for phase in scan])
        turns = np.nonzero(signs[:-1] * signs[1:] < 0)[0]
        inner = [brentq(above, scan[i], scan[i + 1], xtol=1e-15) for i in turns]
        breaks = np.array([0.0, *inner, 2.0 * math.pi])
        middle = (breaks[:-1] + breaks[1:]) / 2.0
        low_pieces = np.array([above(phase) < 0.0 for phase in middle])
        lines = np.column_stack([np.ones(middle.size), np.zeros(middle.size)])
        return Pieces(breaks, lines, low_pieces, table)


@dataclass(frozen=True)
class Tabulated:
    """A table of a tooth-contact program, linear between its points, taken periodic.

    Parameters
    ----------
    phase : sequence of float
        Mesh phases, rad, strictly rising within [0, 2 pi).
    stiffness : sequence of float
        Mesh stiffness there, N/m; finite, > 0.

    Raises
    ------
    ValueError
        Naming the entry that is wrong.
    """

    phase: tuple
    stiffness: tuple

    def __post_init__(self):
        phase = tuple(checks.number("phase", p, "finite", math.isfinite) for p in self.phase)
        values = tuple(
            checks.finite_positive(f"stiffness[{i}]", c) for i, c in enumerate(self.stiffness)
        )
        if len(phase) != len(values) or len(phase) < 2:
            raise ValueError(
                f"a table of {len(phase)} phases and {len(values)} stiffnesses is not allowed: "
                "it must have equally many, at least 2"
            )
        rising = all(a < b for a, b in zip(phase, phase[1:], strict=False))
        if not rising or phase[0] < 0.0 or phase[-1] >= 2.0 * math.pi:
            raise ValueError(
                f"phase = {phase[0]!r} ... {phase[-1]!r} is not allowed: it must rise strictly "
                "within [0, 2 pi)"
            )
        object.__setattr__(self, "phase", phase)
        object.__setattr__(self, "stiffness", values)

    @classmethod
    def read(cls, path, phase="phase", stiffness="stiffness"):
        """Return the table in a CSV file (with a header) or a netCDF file.

        Parameters
        ----------
        path : str or os.PathLike
        phase, stiffness : str
            Names of the columns or variables, in rad and N/m.

        Raises
        ------
        ValueError
            If a column is missing or an entry is not allowed.
        """
        path = Path(path)
        if path.suffix == ".csv":
            with path.open(newline="", encoding="utf-8") as file:
                rows = list(csv.DictReader(file))
            columns = list(rows[0]) if rows else []
            table = {name: [row[name] for row in rows] for name in columns}
        else:
            with xr.open_dataset(path) as dataset:
                table = {name: dataset[name].values.tolist() for name in dataset.variables}
        for name in (phase, stiffness):
            if name not in table:
                raise ValueError(
                    f"{path.name} has no column {name!r}: it must be one of {sorted(table)}"
                )
        try:
            return cls(tuple(map(float, table[phase])), tuple(map(float, table[stiffness])))
        except ValueError as error:
            raise ValueError(f"{path.name}: {error}") from None

    def mean(self):
        """Return the mean stiffness over one period, N/m."""
        phase, values = self._closed()
        return float(np.trapezoid(values, phase) / (2.0 * math.pi))

    def ratios(self):
        """Return (max_stiffness, stiffness_ratio, contact_ratio) of a rectangle of equal mean.

        A `GearPair` with these has the table's extrema and mean stiffness.
        """
        high, low, mean = max(self.stiffness), min(self.stiffness), self.mean()
        if high == low:
            return high, 1.0, 1.5
        return high, low / high, 1.0 + (mean - low) / (high - low)

    def pieces(self, pair):
        """Return the `Pieces`, the table scaled to the mean stiffness of a `GearPair`."""
        phase, values = self._closed()
        values = values / self.mean()
        knots = [0.0]
        for i in range(phase.size - 1):
            a, b = values[i] - 1.0, values[i + 1] - 1.0
            if a * b < 0.0:
                knots.append(phase[i] + (phase[i + 1] - phase[i]) * a / (a - b))
            knots.append(phase[i + 1])
        # The closed table starts at its own first phase: bring all knots into one period from 0.
        knots = np.unique(np.mod(knots[1:] if phase[0] > 0.0 else knots, 2.0 * math.pi))
        breaks = np.unique(np.concatenate([[0.0], knots, [2.0 * math.pi]]))
        at = np.interp(breaks, phase, values, period=2.0 * math.pi)
        slopes = np.diff(at) / np.diff(breaks)
        low = (at[:-1] + at[1:]) / 2.0 < 1.0
        return Pieces(breaks, np.column_stack([at[:-1], slopes]), low, np.empty((0, 3)))

    def _closed(self):
        phase = np.array([*self.phase, self.phase[0] + 2.0 * math.pi])
        return phase, np.array([*self.stiffness, self.stiffness[0]])
