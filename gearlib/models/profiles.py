"""Courses of a stiffness over one period: rectangles, truncated Fourier, series, steps, tables.

A profile is written as pieces: between two neighbouring ``breaks`` the stiffness over its mean is
a straight line plus harmonics,

    c(tau) = value + slope (tau - break) + sum_n a_n cos(n tau) + b_n sin(n tau).

Breaks lie wherever c is not smooth and wherever it crosses its mean, so that every piece is
wholly above or wholly below it ("at the lower stiffness").
"""

import csv
import math
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import Annotated

import numpy as np

from gearlib import parameters
from gearlib.engines.pair.stiffness import levels, segment_lengths
from gearlib.models.harmonics import Harmonics

_PHASES = parameters.Many(parameters.ANGLE)
#: Phases per shortest wave at which a sum of harmonics is compared with its mean.
_SCAN = 32


@dataclass(frozen=True)
class Pieces:
    """A profile in pieces; of gear pairs the stiffness over its mean."""

    breaks: np.ndarray  #: shape (m + 1,), from 0 to 2 pi
    lines: np.ndarray  #: value at the start of each piece and slope, shape (m, 2)
    low: np.ndarray  #: whether the piece lies below the mean, shape (m,)
    harmonics: np.ndarray  #: order, cosine, sine, shape (n, 3)

    def at(self, breaks):
        """Return the same profile cut at `breaks`, which hold all of its own."""
        owner = np.searchsorted(self.breaks, breaks[:-1], side="right") - 1
        values, slopes = self.lines[owner].T
        values = values + slopes * (breaks[:-1] - self.breaks[owner])
        return Pieces(breaks, np.column_stack([values, slopes]), self.low[owner], self.harmonics)


class Profile:
    """A course of the stiffness over one period."""

    def as_dict(self):
        """Return its kind and its parameters as plain values."""
        return {"kind": type(self).__name__.lower(), **asdict(self)}


@dataclass(frozen=True)
class Rectangular(Profile):
    """The full series of Eq. (1): C_max around tau = 0, C_min elsewhere."""

    def pieces(self, pair):
        """Return the `Pieces` for a `GearPair`."""
        high, low = levels(pair.contact_ratio, pair.stiffness_ratio)
        half_high, whole_low = segment_lengths(pair.contact_ratio)
        lengths = np.array([half_high, whole_low, half_high])
        present = lengths > 0.0
        breaks = np.append(0.0, np.cumsum(lengths[present]))
        breaks[-1] = 2.0 * math.pi
        values, is_low = np.array([high, low, high]), np.array([False, True, False])
        return _constant(breaks, values[present], is_low[present])


@parameters.documented
@dataclass(frozen=True)
class Fourier(Profile):
    """Eq. (1) cut after `harmonics` terms: a smooth stiffness, another model than the full series.

    Raises
    ------
    ValueError
        If `harmonics` is not an integer >= 1.
    """

    harmonics: Annotated[int, parameters.Integer(1, 10_000), "Number of terms"]

    def __post_init__(self):
        parameters.check(self)

    def pieces(self, pair):
        """Return the `Pieces` for a `GearPair`."""
        high, low = levels(pair.contact_ratio, pair.stiffness_ratio)
        n = np.arange(1, self.harmonics + 1)
        swing = (high - low) / 2.0 * 4.0 / (math.pi * n) * (-1.0) ** n
        cosines = swing * np.sin(n * math.pi * (pair.contact_ratio - 2.0))
        table = np.column_stack([n, cosines, np.zeros(n.size)])
        return _about(1.0, table)


@parameters.documented
@dataclass(frozen=True)
class Series(Profile):
    """A mean with harmonics about it, for `gearlib.DeadZoneOscillator`, in its unit of stiffness.

    Raises
    ------
    ValueError
        If the mean is not allowed, or the harmonics make the stiffness negative somewhere.
    """

    mean: Annotated[float, parameters.POSITIVE, "Mean"]
    harmonics: Annotated[Harmonics, parameters.Instance((Harmonics,), "Harmonics"), "Added to it"]

    def __post_init__(self):
        parameters.check(self)
        table = self.harmonics.table()
        phase = np.linspace(0.0, 2.0 * math.pi, _SCAN * len(table) + 1)
        least = self.mean + float(_waves(table, phase).min())
        # A series that touches zero rounds to either side of it.
        if least < -1e-12 * self.mean:
            raise ValueError(
                f"harmonics = {self.harmonics!r} is not allowed: about mean = {self.mean!r} the "
                f"stiffness falls to {least:.6g}; it must be >= 0 at every phase"
            )

    def pieces(self):
        """Return the `Pieces`, in the unit of the mean."""
        return _about(self.mean, self.harmonics.table())


@parameters.documented
@dataclass(frozen=True)
class Steps(Profile):
    """A stiffness of constant segments, taken periodic, for `gearlib.DeadZoneOscillator`.

    Raises
    ------
    ValueError
        Naming the entry that is wrong.
    """

    phase: Annotated[tuple, _PHASES, "Where segments start, strictly rising within [0, 2 pi)"]
    stiffness: Annotated[
        tuple, parameters.Many(parameters.NONNEGATIVE), "Their stiffness in the model's own unit"
    ]

    def __post_init__(self):
        _check_table(self, 1)

    def pieces(self):
        """Return the `Pieces`, in the unit given."""
        starts, values = np.array(self.phase), np.array(self.stiffness)
        if starts[0] > 0.0:
            starts, values = np.append(0.0, starts), np.append(values[-1], values)
        breaks = np.append(starts, 2.0 * math.pi)
        mean = float(values @ np.diff(breaks)) / (2.0 * math.pi)
        # A stiffness that never changes lies at its mean, whatever the rounding of that.
        return _constant(breaks, values, values < (1.0 - 1e-12) * mean)


@parameters.documented
@dataclass(frozen=True)
class Tabulated(Profile):
    """A table of a tooth-contact program, linear between its points, taken periodic.

    Raises
    ------
    ValueError
        Naming the entry that is wrong.
    """

    phase: Annotated[tuple, _PHASES, "Mesh phases, strictly rising within [0, 2 pi)"]
    stiffness: Annotated[tuple, parameters.Many(parameters.STIFFNESS), "Mesh stiffness there"]

    def __post_init__(self):
        _check_table(self, 2)

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
            table = {name: [row[name] for row in rows] for name in (rows[0] if rows else ())}
        else:
            # Imported here: a start of the workflow with drawn gears needs no datasets.
            import xarray as xr

            with xr.open_dataset(path) as dataset:
                table = {name: dataset[name].values.tolist() for name in dataset.variables}
        missing = [name for name in (phase, stiffness) if name not in table]
        if missing:
            words = f"it must be one of {sorted(table)}"
            raise ValueError(f"{path.name} has no column {missing[0]!r}: {words}")
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
        before, after = values[:-1] - 1.0, values[1:] - 1.0
        crossed = before * after < 0.0
        share = before[crossed] / (before - after)[crossed]
        crossings = phase[:-1][crossed] + np.diff(phase)[crossed] * share
        # The closed table starts at its own first phase: bring all breaks into one period from 0.
        breaks = np.mod(np.concatenate([phase[1:], crossings]), 2.0 * math.pi)
        breaks = np.unique(np.append(breaks, [0.0, 2.0 * math.pi]))
        at = np.interp(breaks, phase, values, period=2.0 * math.pi)
        slopes = np.diff(at) / np.diff(breaks)
        low = (at[:-1] + at[1:]) / 2.0 < 1.0
        return Pieces(breaks, np.column_stack([at[:-1], slopes]), low, np.empty((0, 3)))

    def _closed(self):
        phase = np.array([*self.phase, self.phase[0] + 2.0 * math.pi])
        return phase, np.array([*self.stiffness, self.stiffness[0]])


def _check_table(profile, least):
    """Check what a profile declares, and that its phases rise and are as many as its values."""
    parameters.check(profile)
    phase, stiffness = profile.phase, profile.stiffness
    if len(phase) != len(stiffness) or len(phase) < least:
        table = f"a table of {len(phase)} phases and {len(stiffness)} stiffnesses"
        words = f"it must have equally many, at least {least}"
        raise ValueError(f"{table} is not allowed: {words}")
    rising = all(a < b for a, b in pairwise(phase))
    if not rising or phase[0] < 0.0 or phase[-1] >= 2.0 * math.pi:
        words = "is not allowed: it must rise strictly within [0, 2 pi)"
        raise ValueError(f"phase = {phase[0]!r} ... {phase[-1]!r} {words}")


def _constant(breaks, values, low, harmonics=()):
    """Return the `Pieces` of a constant in each piece, and harmonics, rows as in `Pieces`."""
    lines = np.column_stack([values, 0.0 * values])
    return Pieces(breaks, lines, low, np.reshape(harmonics, (-1, 3)))


def _waves(table, phase):
    """Return the sum of the harmonics in `table`, rows (order, cosine, sine), at phases."""
    angles = np.multiply.outer(phase, table[:, 0])
    return np.cos(angles) @ table[:, 1] + np.sin(angles) @ table[:, 2]


def _about(mean, table):
    """Return the `Pieces` of a mean and the harmonics in `table`, cut where they cross it."""
    # Imported here: it costs every job of the workflow 0.3 s, and only these profiles need it.
    from scipy.optimize import brentq

    scan = np.linspace(0.0, 2.0 * math.pi, _SCAN * max(int(table[:, 0].max(initial=0.0)), 1) + 1)
    signs = np.sign(_waves(table, scan))
    turns = np.nonzero(signs[:-1] * signs[1:] < 0)[0]
    inner = [
        brentq(lambda phase: float(_waves(table, phase)), scan[i], scan[i + 1], xtol=1e-15)
        for i in turns
    ]
    breaks = np.array([0.0, *inner, 2.0 * math.pi])
    middle = (breaks[:-1] + breaks[1:]) / 2.0
    return _constant(breaks, np.full(middle.size, mean), _waves(table, middle) < 0.0, table)
