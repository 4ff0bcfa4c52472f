"""Stiffness profiles over one mesh period: rectangles, Fourier series, steps and tables.

numpy is imported in functions, because the configuration reads the declarations of the profiles.

The engines convert every profile to a `PiecewiseStiffness`. In a segment between two neighbouring
breakpoints, the stiffness divided by its mean is a linear function plus harmonics,

    c(tau) = value + slope (tau - breakpoint) + sum_n a_n cos(n tau) + b_n sin(n tau).

There is a breakpoint wherever c is not smooth or crosses its mean, so that c is either above or
below the mean throughout a segment.
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

#: Samples per period of the highest harmonic, to search for crossings of the mean.
_SAMPLES_PER_WAVE = 32


@dataclass(frozen=True)
class PiecewiseStiffness:
    """A periodic stiffness, linear plus harmonics between breakpoints.

    For gear pairs it is divided by its mean.
    """

    breakpoints: "np.ndarray"  #: phases that bound the m segments, from 0 to 2 pi, shape (m + 1,)
    values_and_slopes: "np.ndarray"  #: value at the start of each segment and slope, shape (m, 2)
    is_below_mean: "np.ndarray"  #: whether a segment lies below the mean, shape (m,)
    harmonics: "np.ndarray"  #: rows (order, cosine amplitude, sine amplitude), shape (n, 3)

    @property
    def min_jump_ratio(self) -> float:
        """Ratio of the smaller to the larger stiffness at the largest jump; 1 without jumps."""
        import numpy as np

        start_values, slopes = self.values_and_slopes.T
        end_values = start_values + slopes * np.diff(self.breakpoints)
        # The harmonics are continuous and add the same value on both sides of a breakpoint.
        harmonic_values = _sum_harmonics(self.harmonics, self.breakpoints)[:-1]
        # The stiffness is periodic, so that the last segment precedes the first one.
        before = np.roll(end_values, 1) + harmonic_values
        after = start_values + harmonic_values
        return float(np.min(np.minimum(before, after) / np.maximum(before, after)))

    def subdivide(self, breakpoints: "np.ndarray") -> "PiecewiseStiffness":
        """Return the same stiffness with additional breakpoints.

        `breakpoints` ascend from 0 to 2 pi and must include the existing breakpoints.
        """
        import numpy as np

        # The indices of the existing segments that contain the new segments.
        indices = np.searchsorted(self.breakpoints, breakpoints[:-1], side="right") - 1
        values, slopes = self.values_and_slopes[indices].T
        values = values + slopes * (breakpoints[:-1] - self.breakpoints[indices])
        values_and_slopes, is_below_mean = (
            np.stack([values, slopes], 1),
            self.is_below_mean[indices],
        )
        return PiecewiseStiffness(breakpoints, values_and_slopes, is_below_mean, self.harmonics)


class Profile:
    """The shape of the mesh stiffness of a pair over one mesh period.

    A new profile is a class above `PROFILES` with a method ``piecewise_stiffness``, and an entry in
    ``gearlib/__init__.py``.
    """

    @property
    def description(self) -> str:
        """Description of the stiffness; "" for the rectangular stiffness of the pair."""
        return ""

    def piecewise_stiffness(self, pair: Any = None) -> PiecewiseStiffness:
        """Convert the profile to a `PiecewiseStiffness`, divided by its mean if `pair` is given."""
        raise NotImplementedError

    def as_dict(self) -> dict:
        """Return the kind and the parameters of the profile as a dict of plain values."""
        return {"kind": type(self).__name__.lower(), **asdict(self)}


@dataclass(frozen=True)
class Rectangular(Profile):
    """The rectangular stiffness of Eq. (1): C_max around tau = 0, C_min elsewhere."""

    def piecewise_stiffness(self, pair: Any = None) -> PiecewiseStiffness:
        """Return the rectangular mesh stiffness of a `GearPair`, divided by its mean.

        Its segments are the maximum, the minimum and again the maximum stiffness.
        """
        import numpy as np

        high, low = stiffness_levels(pair.contact_ratio, pair.stiffness_ratio)
        # The period starts in the middle of the upper level, which is thus split in half.
        half_high_length, low_length = segment_lengths(pair.contact_ratio)
        lengths = np.array([half_high_length, low_length, half_high_length])
        nonempty = lengths > 0.0  # With a contact ratio of 1 or 2 there is only one level.
        breakpoints = np.append(0.0, np.cumsum(lengths[nonempty]))
        breakpoints[-1] = 2.0 * math.pi
        values = np.array([high, low, high])
        is_low = np.array([False, True, False])
        return _piecewise_constant(breakpoints, values[nonempty], is_low[nonempty])


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
        """Description of the stiffness."""
        return f"Fourier series of {self.harmonics} harmonics"

    def piecewise_stiffness(self, pair: Any = None) -> PiecewiseStiffness:
        """Return the truncated Fourier series of the rectangular mesh stiffness of a `GearPair`.

        The stiffness is divided by its mean, and the series has `self.harmonics` terms.
        """
        import numpy as np

        high, low = stiffness_levels(pair.contact_ratio, pair.stiffness_ratio)
        orders = np.arange(1, self.harmonics + 1)
        # The upper level of the rectangular wave is centred on phase 0.
        amplitudes = (high - low) / 2.0 * 4.0 / (math.pi * orders) * (-1.0) ** orders
        cosines = amplitudes * np.sin(orders * math.pi * (pair.contact_ratio - 2.0))
        harmonics = np.column_stack([orders, cosines, np.zeros(orders.size)])
        return _mean_plus_harmonics(1.0, harmonics)


@declared(kw_only=False)
class Series(Profile):
    """A mean stiffness plus harmonics.

    Raises
    ------
    ValueError
        If the mean is not > 0, or the harmonics make the stiffness negative at a phase.
    """

    mean: Annotated[Positive, described("Mean stiffness")]
    harmonics: Annotated[Harmonics, described("Harmonics added to the mean")]

    def __post_init__(self) -> None:
        """Raise ValueError if the stiffness, mean plus harmonics, is negative at any phase.

        The check samples `_SAMPLES_PER_WAVE` phases per period of the highest harmonic.
        """
        import numpy as np

        table = self.harmonics.table()
        phase = np.linspace(0.0, 2.0 * math.pi, _SAMPLES_PER_WAVE * len(table) + 1)
        minimum = self.mean + float(_sum_harmonics(table, phase).min())
        # Rounding can make the minimum of a series that touches zero slightly negative.
        if minimum < -1e-12 * self.mean:
            raise ValueError(
                f"harmonics = {self.harmonics!r} is not allowed: with mean = {self.mean!r} the "
                f"stiffness falls to {minimum:.6g}; it must be >= 0 at every phase"
            )

    @property
    def description(self) -> str:
        """Description of the stiffness."""
        return f"mean and harmonics up to order {len(self.harmonics.table())}"

    def piecewise_stiffness(self, pair: Any = None) -> PiecewiseStiffness:
        """Convert the series to a `PiecewiseStiffness`, divided by its mean if `pair` is given."""
        mean = self.mean if pair is None else 1.0
        return _mean_plus_harmonics(mean, self.harmonics.table(mean / self.mean))


@declared(kw_only=False)
class Steps(Profile):
    """A piecewise constant periodic stiffness.

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
        """Description of the stiffness."""
        return f"{len(self.phase)} steps"

    def piecewise_stiffness(self, pair: Any = None) -> PiecewiseStiffness:
        """Convert the steps to a `PiecewiseStiffness`, divided by its mean if `pair` is given."""
        import numpy as np

        starts, values = np.array(self.phase), np.array(self.stiffness)
        if starts[0] > 0.0:  # The last segment continues from phase 0 to the first start.
            starts, values = np.append(0.0, starts), np.append(values[-1], values)
        breakpoints = np.append(starts, 2.0 * math.pi)
        mean = float(values @ np.diff(breakpoints)) / (2.0 * math.pi)
        # Due to the tolerance, a constant stiffness is not below its rounded mean.
        is_low = values < (1.0 - 1e-12) * mean
        if pair is not None:
            values = values / mean
        return _piecewise_constant(breakpoints, values, is_low)


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
        """Description of the stiffness."""
        return f"table of {len(self.phase)} phases"

    @classmethod
    def read(
        cls, path: str | os.PathLike, phase: str = "phase", stiffness: str = "stiffness"
    ) -> "Tabulated":
        """Read the table from a CSV file with a header or from a netCDF file.

        Columns are separated by commas, semicolons or tabs; decimal commas are allowed with
        semicolons and tabs.

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
                table = cls(*_read_csv_columns(path, (phase, stiffness)))
            else:
                table = cls(*_read_netcdf_variables(path, (phase, stiffness)))
            phases, _ = table._closed_period()
            gap = float(np.diff(phases).max())
            # The tolerance allows for rounded phases of two opposite points.
            if gap > math.pi + 1e-3:
                raise ValueError(
                    f"{phase} = {table.phase[0]!r} ... {table.phase[-1]!r} is not allowed: "
                    f"it has a gap of {gap:.4g} rad; it must cover the mesh period, 0 to 2 pi rad, "
                    "without gaps of more than half a period"
                )
        except ValueError as error:
            raise ValueError(f"{path.name}: {error}") from None
        return table

    def mean(self) -> float:
        """Return the mean stiffness over one period in N/m."""
        import numpy as np

        phase, values = self._closed_period()
        return float(np.trapezoid(values, phase) / (2.0 * math.pi))

    def ratios(self) -> tuple[float, float, float]:
        """Return (max_stiffness, stiffness_ratio, contact_ratio) of an equivalent rectangle.

        This rectangular stiffness has the same maximum, minimum and mean as the table. It is
        max_stiffness for the fraction contact_ratio - 1 of the period, and
        stiffness_ratio * max_stiffness for the rest of the period.
        """
        high, low, mean = max(self.stiffness), min(self.stiffness), self.mean()
        if high == low:  # The contact ratio of a constant stiffness is arbitrary.
            return high, 1.0, 1.5
        return high, low / high, 1.0 + (mean - low) / (high - low)

    def piecewise_stiffness(self, pair: Any = None) -> PiecewiseStiffness:
        """Convert the table to a `PiecewiseStiffness`, divided by its mean.

        The breakpoints are the points of the table and its crossings of the mean. `pair` is not
        used, because the table contains the stiffness itself.
        """
        import numpy as np

        phase, values = self._closed_period()
        values = values / self.mean()
        # Find the phases at which the linear interpolation crosses the mean, which is 1.
        left, right = values[:-1] - 1.0, values[1:] - 1.0
        crosses_mean = left * right < 0.0
        fraction = left[crosses_mean] / (left - right)[crosses_mean]
        crossings = phase[:-1][crosses_mean] + np.diff(phase)[crosses_mean] * fraction
        # The table may start at any phase, but the breakpoints must lie between 0 and 2 pi.
        breakpoints = np.mod(np.concatenate([phase[1:], crossings]), 2.0 * math.pi)
        breakpoints = np.unique(np.append(breakpoints, [0.0, 2.0 * math.pi]))
        values = np.interp(breakpoints, phase, values, period=2.0 * math.pi)
        slopes = np.diff(values) / np.diff(breakpoints)
        is_below_mean = (values[:-1] + values[1:]) / 2.0 < 1.0
        values_and_slopes, no_harmonics = np.column_stack([values[:-1], slopes]), np.empty((0, 3))
        return PiecewiseStiffness(breakpoints, values_and_slopes, is_below_mean, no_harmonics)

    def _closed_period(self) -> tuple["np.ndarray", "np.ndarray"]:
        """Return phases and stiffnesses of the table, with the first point repeated at the end."""
        import numpy as np

        phase = np.array([*self.phase, self.phase[0] + 2.0 * math.pi])
        return phase, np.array([*self.stiffness, self.stiffness[0]])


#: Kind of profile -> class.
PROFILES = {kind.__name__.lower(): kind for kind in Profile.__subclasses__()}


def create_profile(kind: str, **values: Any) -> Profile:
    """Create a stiffness profile from its kind and parameters.

    `kind` is a key of `PROFILES`, e.g. "fourier". `values` are the parameters as plain values; a
    dict of harmonics is converted to `Harmonics`.
    """
    if isinstance(values.get("harmonics"), dict):
        values["harmonics"] = Harmonics(**values["harmonics"])
    return PROFILES[kind](**values)


def _read_csv_columns(path: Path, names: tuple[str, str]) -> list[tuple]:
    """Read two columns of a CSV file with a header, as tuples of numbers.

    `names` are the names of the columns with phase and stiffness. The column separator and the
    decimal mark, a point or a comma, are detected. If a line cannot be read, ValueError with the
    line number is raised.
    """
    table = []  # (line number, cells) of each nonempty line
    try:
        # Spreadsheets write a byte order mark, which "utf-8-sig" removes.
        lines = path.read_text(encoding="utf-8-sig").splitlines()
        header_line = next(filter(str.strip, lines), "")
        # The separator is the character that occurs most often in the header.
        separator = max(",;\t", key=header_line.count)
        for line_number, row in enumerate(csv.reader(lines, delimiter=separator), 1):
            cells = [cell.strip() for cell in row]
            if any(cells):
                table.append((line_number, cells))
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"it must be a CSV file in UTF-8 ({error})") from None
    header = table.pop(0)[1] if table else []
    indices = _column_indices(header, names)
    columns: tuple[list, list] = [], []
    # If the decimal mark is "", the first number with a point or a comma determines it.
    decimal_mark = "." if separator == "," else ""
    for line_number, cells in table:
        if len(cells) < len(header) or any(cells[len(header) :]):
            allowed = f"{len(header)}, one for each column"
            if separator == ",":
                allowed += "; decimal commas need semicolons between cells"
            name = f"the number of cells in line {line_number}"
            raise checks.InputError(name, len(cells), allowed)
        for name, i, column in zip(names, indices, columns, strict=True):
            cell = cells[i]
            decimal_mark = decimal_mark or next((mark for mark in cell if mark in ",."), "")
            try:
                # A file with both signs is rejected, because one could be a thousands separator.
                if decimal_mark == "," and "." in cell:
                    raise ValueError
                column.append(float(cell.replace(decimal_mark or ".", ".")))
            except ValueError:
                allowed = f"a number with the decimal mark {decimal_mark or '.'!r}"
                raise checks.InputError(f"line {line_number}: {name}", cell, allowed) from None
    return [*map(tuple, columns)]


def _read_netcdf_variables(path: Path, names: tuple[str, str]) -> list[tuple]:
    """Read two variables of a netCDF file, as tuples of numbers.

    `names` are the names of the variables with phase and stiffness. Raises ValueError if the file
    is not a netCDF file or lacks a variable.
    """
    import numpy as np

    # Imported here, because only netCDF files need xarray.
    import xarray as xr

    try:
        dataset = xr.load_dataset(path)
    except FileNotFoundError:
        raise
    except (OSError, ValueError):
        raise ValueError("it must be a file with the suffix .csv or a netCDF file") from None
    # This call raises ValueError if a variable is missing.
    _column_indices([*map(str, dataset.variables)], names)
    return [tuple(np.atleast_1d(dataset[name].values).tolist()) for name in names]


def _column_indices(known_names: list[str], names: tuple[str, str]) -> list[int]:
    """Return the indices of the phase column and the stiffness column in a file.

    `known_names` are the names of all columns, and `names` are the user's names of (phase,
    stiffness). Raises ValueError if a name is missing or occurs more than once.
    """
    for key, name in zip(("phase", "stiffness"), names, strict=True):
        allowed = f"the name of a column, one of {sorted(known_names)}"
        checks.require(checks.is_one_of(name, known_names), key, name, allowed)
        if known_names.count(name) > 1:
            raise ValueError(f"the column {name!r} occurs more than once")
    return [known_names.index(name) for name in names]


def _check_table(profile: Any, min_length: int) -> None:
    """Raise ValueError unless the phases of a stiffness profile increase and each has a value.

    `profile` is a `Steps` or `Tabulated` with at least `min_length` phases in [0, 2 pi).
    """
    phase, stiffness = profile.phase, profile.stiffness
    if len(phase) != len(stiffness) or len(phase) < min_length:
        raise ValueError(
            f"a table of {len(phase)} phases and {len(stiffness)} stiffnesses is not allowed: "
            f"it must have equally many, at least {min_length}"
        )
    increasing = all(current < next_phase for current, next_phase in pairwise(phase))
    if not increasing or phase[0] < 0.0 or phase[-1] >= 2.0 * math.pi:
        raise ValueError(
            f"phase = {phase[0]!r} ... {phase[-1]!r} is not allowed: "
            "it must increase strictly within [0, 2 pi)"
        )


def _piecewise_constant(breakpoints, values, is_below_mean, harmonics=()) -> PiecewiseStiffness:
    """Create a `PiecewiseStiffness` that is piecewise constant plus harmonics.

    `breakpoints` are m + 1 phases in rad, and `values`, shape (m,), are the constants between them.
    `is_below_mean`, shape (m,), marks segments below the mean. `harmonics`, shape (n, 3), has rows
    (order, cosine amplitude, sine amplitude).
    """
    import numpy as np

    values_and_slopes = np.column_stack([values, 0.0 * values])
    harmonics = np.reshape(harmonics, (-1, 3))
    return PiecewiseStiffness(breakpoints, values_and_slopes, is_below_mean, harmonics)


def _sum_harmonics(harmonics: "np.ndarray", phases: Any) -> "np.ndarray":
    """Evaluate a sum of harmonics at phases in rad; the result has the shape of `phases`.

    `harmonics`, shape (n, 3), has rows (order, cosine amplitude, sine amplitude).
    """
    import numpy as np

    angles = np.multiply.outer(phases, harmonics[:, 0])
    return np.cos(angles) @ harmonics[:, 1] + np.sin(angles) @ harmonics[:, 2]


def _mean_plus_harmonics(mean: float, harmonics: "np.ndarray") -> PiecewiseStiffness:
    """Create a `PiecewiseStiffness` from a mean and harmonics, with breakpoints at the mean.

    The breakpoints are the phases at which the stiffness crosses its mean. `harmonics`, shape
    (n, 3), has rows (order, cosine amplitude, sine amplitude).
    """
    import numpy as np

    # Imported here, because loading it takes 0.3 s and only these profiles need it.
    from scipy.optimize import brentq

    def oscillation(phase: float) -> float:
        return float(_sum_harmonics(harmonics, phase))

    # Find sign changes on a fine grid, and then refine the roots.
    highest_order = max(int(harmonics[:, 0].max(initial=0.0)), 1)
    phases = np.linspace(0.0, 2.0 * math.pi, _SAMPLES_PER_WAVE * highest_order + 1)
    signs = np.sign(_sum_harmonics(harmonics, phases))
    sign_changes = np.nonzero(signs[:-1] * signs[1:] < 0)[0]
    crossings = [brentq(oscillation, phases[i], phases[i + 1], xtol=1e-15) for i in sign_changes]
    breakpoints = np.array([0.0, *crossings, 2.0 * math.pi])
    midpoints = (breakpoints[:-1] + breakpoints[1:]) / 2.0
    is_below_mean = _sum_harmonics(harmonics, midpoints) < 0.0
    values = np.full(midpoints.size, mean)
    return _piecewise_constant(breakpoints, values, is_below_mean, harmonics)
