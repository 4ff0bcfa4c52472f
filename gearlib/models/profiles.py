"""Stiffness profiles over one mesh period: rectangles, Fourier series, steps and tables.

numpy is imported in functions, because the configuration reads the declarations of the profiles.

The engines use every profile as `Pieces`: between two neighbouring ``breaks`` the stiffness divided
by its mean is a straight line plus harmonics,

    c(tau) = value + slope (tau - break) + sum_n a_n cos(n tau) + b_n sin(n tau).

There is a break wherever c is not smooth and wherever it crosses its mean, so that each piece lies
entirely above or entirely below the mean ("at the lower stiffness").
"""

import csv
import math
import os
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from annotated_types import Ge, Le

from gearlib import checks, parameters
from gearlib.engines.pair.stiffness import segment_lengths, stiffness_levels
from gearlib.models.harmonics import Harmonics
from gearlib.parameters import Angle, NonNegative, Positive, Stiffness, Values, declared, described

if TYPE_CHECKING:
    import numpy as np

#: Samples per period of the highest harmonic in a search for crossings of the mean.
_SAMPLES_PER_WAVE = 32


@dataclass(frozen=True)
class Pieces:
    """A periodic stiffness in pieces; for gear pairs it is divided by its mean."""

    breaks: "np.ndarray"  #: phases where pieces begin or end, shape (m + 1,), from 0 to 2 pi
    lines: "np.ndarray"  #: value at the start of each piece and slope, shape (m, 2)
    low: "np.ndarray"  #: whether the piece lies below the mean, shape (m,)
    harmonics: "np.ndarray"  #: rows (order, cosine, sine), shape (n, 3)

    @property
    def smallest_ratio(self) -> float:
        """Ratio of smaller to larger stiffness at the largest jump, 1 if there is no jump.

        Each row of `lines` holds the stiffness at the start of a straight piece and its slope;
        pieces lie between `breaks`, phases from 0 to 2 pi.
        """
        import numpy as np

        start_values, slopes = self.lines.T
        end_values = start_values + slopes * np.diff(self.breaks)
        # The harmonics are continuous and add the same value on both sides of a break.
        oscillation = _sum_of_harmonics(self.harmonics, self.breaks)[:-1]
        # Stiffnesses before and after each break but the last, where the next period begins.
        before, after = np.roll(end_values, 1) + oscillation, start_values + oscillation
        return float(np.min(np.minimum(before, after) / np.maximum(before, after)))

    def cut_at(self, breaks: "np.ndarray") -> "Pieces":
        """Return the same stiffness divided into more pieces, between the phases `breaks`.

        `breaks` ascend from 0 to 2 pi and must include the present breaks. The value at the start
        of each new straight piece follows from the piece in which it lies.
        """
        import numpy as np

        # The indices of the present pieces in which the new pieces lie.
        indices = np.searchsorted(self.breaks, breaks[:-1], side="right") - 1
        values, slopes = self.lines[indices].T
        values = values + slopes * (breaks[:-1] - self.breaks[indices])
        return Pieces(breaks, np.column_stack([values, slopes]), self.low[indices], self.harmonics)


class Profile:
    """A stiffness over one mesh period, the shape of the mesh stiffness of a pair.

    A new profile is a class above `PROFILES` with a method ``pieces``, and an entry in
    ``gearlib/__init__.py``.
    """

    @property
    def description(self) -> str:
        """The stiffness in words, "" for the rectangle of the pair."""
        return ""

    def pieces(self, pair: Any = None) -> Pieces:
        """Return the stiffness as `Pieces`, for a `GearPair` divided by its mean."""
        raise NotImplementedError

    def as_dict(self) -> dict:
        """Return the kind of the profile and its parameters as a dict of plain values."""
        return {"kind": type(self).__name__.lower(), **asdict(self)}


@dataclass(frozen=True)
class Rectangular(Profile):
    """The rectangular stiffness of Eq. (1): C_max around tau = 0, C_min elsewhere."""

    def pieces(self, pair: Any = None) -> Pieces:
        """Return the rectangular mesh stiffness of a `GearPair` as `Pieces`, divided by its mean.

        The pieces are the maximum, the minimum and again the maximum stiffness.
        """
        import numpy as np

        high, low = stiffness_levels(pair.contact_ratio, pair.stiffness_ratio)
        # The period starts in the middle of the higher level, so that this level is cut in half.
        half_high_length, low_length = segment_lengths(pair.contact_ratio)
        lengths = np.array([half_high_length, low_length, half_high_length])
        nonempty = lengths > 0.0  # A contact ratio of 1 or 2 leaves only one level.
        breaks = np.append(0.0, np.cumsum(lengths[nonempty]))
        breaks[-1] = 2.0 * math.pi
        values = np.array([high, low, high])
        is_low = np.array([False, True, False])
        return _constant_pieces(breaks, values[nonempty], is_low[nonempty])


@declared(kw_only=False)
class Fourier(Profile):
    """The Fourier series of Eq. (1), truncated after `harmonics` terms: a smooth stiffness.

    Raises
    ------
    ValueError
        If `harmonics` is not an integer >= 1.
    """

    harmonics: Annotated[
        int, Ge(1), Le(10_000), parameters.INTEGER, described("Number of terms of the series")
    ]

    @property
    def description(self) -> str:
        """The stiffness in words."""
        return f"Fourier series of {self.harmonics} harmonics"

    def pieces(self, pair: Any = None) -> Pieces:
        """Return the truncated Fourier series of the rectangular mesh stiffness as `Pieces`.

        The stiffness of `pair`, a `GearPair`, is divided by its mean. The series has
        `self.harmonics` terms.
        """
        import numpy as np

        high, low = stiffness_levels(pair.contact_ratio, pair.stiffness_ratio)
        orders = np.arange(1, self.harmonics + 1)
        # The series of a rectangular wave whose higher level is centred on phase 0.
        amplitudes = (high - low) / 2.0 * 4.0 / (math.pi * orders) * (-1.0) ** orders
        cosines = amplitudes * np.sin(orders * math.pi * (pair.contact_ratio - 2.0))
        harmonics = np.column_stack([orders, cosines, np.zeros(orders.size)])
        return _harmonic_pieces(1.0, harmonics)


@declared(kw_only=False)
class Series(Profile):
    """A mean stiffness plus harmonics.

    Raises
    ------
    ValueError
        If the mean is not allowed, or the harmonics make the stiffness negative somewhere.
    """

    mean: Annotated[Positive, described("Mean stiffness")]
    harmonics: Annotated[Harmonics, described("Harmonics added to the mean")]

    def __post_init__(self) -> None:
        """Raise ValueError if the stiffness, mean plus harmonics, is negative at a phase.

        It is computed at `_SAMPLES_PER_WAVE` phases per period of the highest harmonic.
        """
        import numpy as np

        table = self.harmonics.table()
        phase = np.linspace(0.0, 2.0 * math.pi, _SAMPLES_PER_WAVE * len(table) + 1)
        minimum = self.mean + float(_sum_of_harmonics(table, phase).min())
        # Rounding makes the minimum of a series that touches zero slightly negative.
        if minimum < -1e-12 * self.mean:
            raise ValueError(
                f"harmonics = {self.harmonics!r} is not allowed: about mean = {self.mean!r} the "
                f"stiffness falls to {minimum:.6g}; it must be >= 0 at every phase"
            )

    @property
    def description(self) -> str:
        """The stiffness in words."""
        return f"mean and harmonics up to order {len(self.harmonics.table())}"

    def pieces(self, pair: Any = None) -> Pieces:
        """Return the stiffness as `Pieces`, straight lines and harmonics between breaks.

        With a `GearPair` as `pair` it is divided by its mean.
        """
        mean = self.mean if pair is None else 1.0
        return _harmonic_pieces(mean, self.harmonics.table(mean / self.mean))


@declared(kw_only=False)
class Steps(Profile):
    """A periodic stiffness of constant segments.

    Raises
    ------
    ValueError
        Naming the entry that is wrong.
    """

    phase: Annotated[
        tuple[Angle, ...],
        Values(),
        described("Phases at which segments start, strictly increasing within [0, 2 pi)"),
    ]
    stiffness: Annotated[
        tuple[NonNegative, ...],
        Values(),
        described("Stiffness of each segment in the unit of the model"),
    ]

    def __post_init__(self):
        """Raise ValueError unless phases increase strictly and each phase has a stiffness."""
        _check_table(self, min_length=1)

    @property
    def description(self) -> str:
        """The stiffness in words."""
        return f"{len(self.phase)} steps"

    def pieces(self, pair: Any = None) -> Pieces:
        """Return the stiffness as `Pieces`, here constants between breaks from phase 0 to 2 pi.

        With a `GearPair` as `pair` it is divided by its mean.
        """
        import numpy as np

        starts, values = np.array(self.phase), np.array(self.stiffness)
        if starts[0] > 0.0:  # The last segment continues from phase 0 to the first start.
            starts, values = np.append(0.0, starts), np.append(values[-1], values)
        breaks = np.append(starts, 2.0 * math.pi)
        mean = float(values @ np.diff(breaks)) / (2.0 * math.pi)
        # The tolerance prevents a constant stiffness from lying below its rounded mean.
        is_low = values < (1.0 - 1e-12) * mean
        if pair is not None:
            values = values / mean
        return _constant_pieces(breaks, values, is_low)


@declared(kw_only=False)
class Tabulated(Profile):
    """A periodic table of the mesh stiffness, linear between its points.

    Raises
    ------
    ValueError
        Naming the entry that is wrong.
    """

    phase: Annotated[
        tuple[Angle, ...], Values(), described("Mesh phases, strictly increasing within [0, 2 pi)")
    ]
    stiffness: Annotated[tuple[Stiffness, ...], Values(), described("Mesh stiffness at each phase")]

    def __post_init__(self):
        """Raise ValueError unless phases increase strictly and each phase has a stiffness."""
        _check_table(self, min_length=2)

    @property
    def description(self) -> str:
        """The stiffness in words."""
        return f"table of {len(self.phase)} phases"

    @classmethod
    def read(
        cls, path: str | os.PathLike, phase: str = "phase", stiffness: str = "stiffness"
    ) -> "Tabulated":
        """Read the table from a CSV file with a header or from a netCDF file.

        Cells are separated by commas or, with decimal points or commas, by semicolons or tabs.

        Parameters
        ----------
        path : str or os.PathLike
            Path of the file.
        phase, stiffness : str
            Names of the columns or variables with the phase in rad and the stiffness in N/m.

        Raises
        ------
        ValueError
            If a column is missing, an entry is not allowed, or more than half of the period has no
            phase.
        """
        import numpy as np

        is_file = isinstance(path, str | os.PathLike) and Path(path).is_file()
        checks.require(is_file, "path", path, "a CSV or netCDF file")
        path = Path(path)
        try:
            if path.suffix.lower() == ".csv":
                table = cls(*_csv_columns(path, (phase, stiffness)))
            else:
                table = cls(*_netcdf_columns(path, (phase, stiffness)))
            # The largest distance between two neighbouring phases of the closed period.
            gap = float(np.diff(table._closed_period()[0]).max())
            # Rounded phases of two opposite points leave half of the period.
            if gap > math.pi + 1e-3:
                raise ValueError(
                    f"{phase} = {table.phase[0]!r} ... {table.phase[-1]!r} is not allowed: "
                    f"{gap:.4g} rad are left out; it must cover the mesh period, 0 to 2 pi rad, "
                    "without a gap of more than half of it"
                )
        except ValueError as error:
            raise ValueError(f"{path.name}: {error}") from None
        return table

    def mean(self) -> float:
        """Return the mean over one period of the stiffness, which is linear between points, N/m."""
        import numpy as np

        phase, values = self._closed_period()
        return float(np.trapezoid(values, phase) / (2.0 * math.pi))

    def ratios(self) -> tuple[float, float, float]:
        """Return (max_stiffness, stiffness_ratio, contact_ratio) of an equivalent rectangle.

        The rectangular stiffness has the same largest and smallest value and the same mean as the
        table: the fraction contact_ratio - 1 of the period has the largest value, the rest
        stiffness_ratio times that.
        """
        high, low, mean = max(self.stiffness), min(self.stiffness), self.mean()
        if high == low:  # The stiffness is constant with any contact ratio.
            return high, 1.0, 1.5
        return high, low / high, 1.0 + (mean - low) / (high - low)

    def pieces(self, pair: Any = None) -> Pieces:
        """Return the table as `Pieces`, straight lines between breaks, divided by its mean.

        The argument `pair` is not used, because the table holds the stiffness itself. There are
        breaks at the points of the table and where it crosses its mean.
        """
        import numpy as np

        phase, values = self._closed_period()
        values = values / self.mean()
        # The phases at which the straight lines between points cross the mean, which is 1.
        left, right = values[:-1] - 1.0, values[1:] - 1.0
        crosses_mean = left * right < 0.0
        fraction = left[crosses_mean] / (left - right)[crosses_mean]
        crossings = phase[:-1][crosses_mean] + np.diff(phase)[crosses_mean] * fraction
        # The table may start at any phase, but breaks must lie in one period from 0.
        breaks = np.mod(np.concatenate([phase[1:], crossings]), 2.0 * math.pi)
        breaks = np.unique(np.append(breaks, [0.0, 2.0 * math.pi]))
        values = np.interp(breaks, phase, values, period=2.0 * math.pi)
        slopes = np.diff(values) / np.diff(breaks)
        low = (values[:-1] + values[1:]) / 2.0 < 1.0
        return Pieces(breaks, np.column_stack([values[:-1], slopes]), low, np.empty((0, 3)))

    def _closed_period(self) -> tuple["np.ndarray", "np.ndarray"]:
        """Return phases and stiffnesses of the table, closed to a full period.

        The first point is repeated one period later.
        """
        import numpy as np

        phase = np.array([*self.phase, self.phase[0] + 2.0 * math.pi])
        return phase, np.array([*self.stiffness, self.stiffness[0]])


#: Kind of a profile -> its class.
PROFILES = {kind.__name__.lower(): kind for kind in Profile.__subclasses__()}


def profile_of(kind: str, **values: Any) -> Profile:
    """Return the stiffness profile of a kind, such as "fourier", with these parameters.

    `kind` is a key of `PROFILES`, and `values` are parameters as plain values; a dict of harmonics
    becomes `Harmonics`.
    """
    if isinstance(values.get("harmonics"), dict):
        values["harmonics"] = Harmonics(**values["harmonics"])
    return PROFILES[kind](**values)


def _csv_columns(path: Path, names: tuple[str, str]) -> list[tuple]:
    """Read two columns of a CSV file with a header, and return them as tuples of numbers.

    `names` are the names of the columns for phase and stiffness. The separator of cells and the
    decimal sign, a point or a comma, are recognized. Raises ValueError with the number of the line
    that cannot be read.
    """
    table = []  # (line number, cells) of all lines that are not empty
    try:
        # Spreadsheets write a byte order mark, which "utf-8-sig" removes.
        lines = path.read_text(encoding="utf-8-sig").splitlines()
        header_line = next(filter(str.strip, lines), "")
        # The separator is the sign that occurs most often in the header.
        separator = max(",;\t", key=header_line.count)
        for line_number, row in enumerate(csv.reader(lines, delimiter=separator), 1):
            cells = [cell.strip() for cell in row]
            if any(cells):
                table.append((line_number, cells))
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"it must be a CSV file in UTF-8 ({error})") from None
    header = table.pop(0)[1] if table else []
    indices = _indices(header, names)
    columns: tuple[list, list] = [], []
    decimal_sign = "." if separator == "," else ""  # "": the first number with a sign decides
    for line_number, cells in table:
        if len(cells) < len(header) or any(cells[len(header) :]):
            allowed = f"{len(header)}, one for each column"
            if separator == ",":
                allowed += "; decimal commas need semicolons between cells"
            raise checks.InputError(
                f"the number of cells in line {line_number}", len(cells), allowed
            )
        for name, i, column in zip(names, indices, columns, strict=True):
            cell = cells[i]
            # If a file had both signs, it would be unclear which one separates thousands.
            decimal_sign = decimal_sign or next((sign for sign in cell if sign in ",."), "")
            try:
                if decimal_sign == "," and "." in cell:
                    raise ValueError
                column.append(float(cell.replace(decimal_sign or ".", ".")))
            except ValueError:
                allowed = f"a number with the decimal sign {decimal_sign or '.'!r}"
                raise checks.InputError(f"line {line_number}: {name}", cell, allowed) from None
    return [*map(tuple, columns)]


def _netcdf_columns(path: Path, names: tuple[str, str]) -> list[tuple]:
    """Read two variables of a netCDF file, and return them as tuples of numbers.

    `names` are the names of the variables for phase and stiffness. Raises ValueError if the file is
    not netCDF or has no such variable.
    """
    import numpy as np

    # Imported here, because only netCDF files need xarray.
    import xarray as xr

    try:
        dataset = xr.load_dataset(path)
    except FileNotFoundError:
        raise
    except (OSError, ValueError):
        raise ValueError("it must be a CSV file, whose name ends with .csv, or netCDF") from None
    _indices([*map(str, dataset.variables)], names)  # raises ValueError if a name is missing
    return [tuple(np.atleast_1d(dataset[name].values).tolist()) for name in names]


def _indices(known_names: list[str], names: tuple[str, str]) -> list[int]:
    """Return the indices of the phase column and the stiffness column in a file.

    `known_names` are the names of all its columns, and `names` are those that the user gave for
    (phase, stiffness). Raises ValueError if a name is missing or occurs more than once.
    """
    for key, name in zip(("phase", "stiffness"), names, strict=True):
        allowed = f"the name of a column, one of {sorted(known_names)}"
        checks.require(checks.is_one_of(name, known_names), key, name, allowed)
        if known_names.count(name) > 1:
            raise ValueError(f"the column {name!r} occurs more than once")
    return [known_names.index(name) for name in names]


def _check_table(profile: Any, min_length: int) -> None:
    """Raise ValueError unless the phases of a stiffness profile increase and each has a value.

    `profile` is a `Steps` or `Tabulated`. It must have at least `min_length` phases, in [0, 2 pi).
    """
    phase, stiffness = profile.phase, profile.stiffness
    if len(phase) != len(stiffness) or len(phase) < min_length:
        table = f"a table of {len(phase)} phases and {len(stiffness)} stiffnesses"
        allowed = f"it must have equally many, at least {min_length}"
        raise ValueError(f"{table} is not allowed: {allowed}")
    increasing = all(current < next_phase for current, next_phase in pairwise(phase))
    if not increasing or phase[0] < 0.0 or phase[-1] >= 2.0 * math.pi:
        reason = "is not allowed: it must increase strictly within [0, 2 pi)"
        raise ValueError(f"phase = {phase[0]!r} ... {phase[-1]!r} {reason}")


def _constant_pieces(breaks, values, low, harmonics=()) -> Pieces:
    """Return the `Pieces` of a stiffness that is constant between breaks, plus harmonics.

    `breaks` are m + 1 phases in rad and `values`, shape (m,), are the constants between them.
    `low`, bool, (m,), marks pieces below the mean; `harmonics`, (n, 3), has rows (order, cosine,
    sine).
    """
    import numpy as np

    lines = np.column_stack([values, 0.0 * values])  # values and slopes
    return Pieces(breaks, lines, low, np.reshape(harmonics, (-1, 3)))


def _sum_of_harmonics(harmonics: "np.ndarray", phases: Any) -> "np.ndarray":
    """Return the sum of harmonics at phases in rad, an array with the shape of `phases`.

    `harmonics`, shape (n, 3), has rows (order, cosine amplitude, sine amplitude).
    """
    import numpy as np

    angles = np.multiply.outer(phases, harmonics[:, 0])
    return np.cos(angles) @ harmonics[:, 1] + np.sin(angles) @ harmonics[:, 2]


def _harmonic_pieces(mean: float, harmonics: "np.ndarray") -> Pieces:
    """Return the `Pieces` of a mean plus harmonics, divided where the sum crosses the mean.

    The harmonics, shape (n, 3), are rows (order, cosine, sine). So each piece lies entirely above
    or entirely below the mean.
    """
    import numpy as np

    # Imported here, because loading it takes 0.3 s and only these profiles need it.
    from scipy.optimize import brentq

    def oscillation(phase: float) -> float:
        return float(_sum_of_harmonics(harmonics, phase))

    # Search for changes of sign on a fine grid, and then refine each of them.
    highest_order = max(int(harmonics[:, 0].max(initial=0.0)), 1)
    phases = np.linspace(0.0, 2.0 * math.pi, _SAMPLES_PER_WAVE * highest_order + 1)
    signs = np.sign(_sum_of_harmonics(harmonics, phases))
    sign_changes = np.nonzero(signs[:-1] * signs[1:] < 0)[0]
    crossings = [brentq(oscillation, phases[i], phases[i + 1], xtol=1e-15) for i in sign_changes]
    breaks = np.array([0.0, *crossings, 2.0 * math.pi])
    midpoints = (breaks[:-1] + breaks[1:]) / 2.0
    low = _sum_of_harmonics(harmonics, midpoints) < 0.0
    return _constant_pieces(breaks, np.full(midpoints.size, mean), low, harmonics)
