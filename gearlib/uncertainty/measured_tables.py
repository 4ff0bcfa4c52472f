"""Read CSV and UFF files into checked columns: name -> array of numbers or pandas categories.

A CSV is wide (a column for each channel) or long as in PEtab (a row for each measurement).
"""

import csv
import math
import re
from io import StringIO
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TextIO

import numpy as np
import xarray as xr

from gearlib import checks
from gearlib.config.measured_description import COUNTS, DATES, Channel
from gearlib.data import measured_names
from gearlib.integrators.method import MissingPackage, Package

PYUFF = Package("pyuff", "pyuff")
#: Names of the columns of a long PEtab table: the measured quantity and its value.
LONG_COLUMNS = ID_COLUMN, VALUE_COLUMN = "observableId", "measurement"
CONDITION_COLUMN, NOISE_COLUMN = "simulationConditionId", "noiseParameters"
#: Text of a direction -> its sign.
DIRECTION_SIGNS = {"up": 1, "down": -1, "rest": 0, "1": 1, "+1": 1, "-1": -1, "0": 0}
DIRECTION_SIGNS |= {"1.0": 1, "-1.0": -1, "0.0": 0}
#: Types of the abscissa of a dataset 58 that may be times: unknown, general, time.
_TIME_TYPES = (0, 1, 17)
#: Axis labels without a unit.
_NO_UNITS = ("", "NONE", "UNKNOWN", "EU")


def _read_header(file: TextIO, description: Any) -> list[str]:
    """Read a CSV file up to the line with the names of its columns; return the names.

    `description` is the content of the YAML file of the data set: number of lines to skip, column
    separator and comment sign. Raise ValueError if there is no such line.
    """
    for line in islice(file, description.skip, None):
        line = line.split(description.comment)[0] if description.comment else line
        (cells,) = csv.reader([line], delimiter=description.separator, skipinitialspace=True)
        if any(cell.strip() for cell in cells):
            return [cell.strip() for cell in cells]
    raise checks.InputError("data", description.data, "a file with column names, but it is empty")


def _required_columns(names: list[str], description: Any) -> list[str]:
    """Return the names of the columns to read; raise ValueError if one is missing or repeated.

    `names` are the columns of the CSV file, and `description` is the content of the YAML file of
    the data set. A wide table has a column for each channel; a long table has the columns of PEtab
    and one row per measurement.
    """
    required = list(description.channels)
    if set(LONG_COLUMNS) <= {*names}:
        optional = CONDITION_COLUMN, "time", NOISE_COLUMN
        required = [*LONG_COLUMNS, *(name for name in optional if name in names)]
        required += [
            key
            for key, channel in description.channels.items()
            if (channel.observableId or key) in ("time", "speed", "direction")
            and key in names
            and key not in required
        ]
    for name in required:
        column = f"the column {name!r}"
        if names.count(name) > 1:
            raise ValueError(f"{column} of {description.data} occurs more than once")
        if name not in names:
            hint = ""
            # A single column is usually a line with a different separator.
            if len(names) == 1:
                for separator in (";", "\t", "|", ","):
                    if name in map(str.strip, names[0].split(separator)):
                        hint = f", or separator must be {separator!r}"
                        break
            raise _missing_error(column, description, names, hint)
    return required


def _missing_error(name: str, description: Any, names: list, hint: str = "") -> ValueError:
    """Return the ValueError for a column, channel or observable that a data file does not have.

    `name` is its kind and name, such as "the column 'time'", `names` are the existing names, and
    `description` is the content of the YAML file. `hint` is appended to the message.
    """
    first_names = ", ".join(map(repr, names[:12]))
    return ValueError(
        f"{name} of {description.data} is missing: it must be one of {first_names}{hint}"
    )


def _parse_rows(rows: str, description: Any, dtypes: dict, column_count: int) -> Any:
    """Parse the rows of a CSV file into a pandas data frame whose column names are indices.

    `rows` is the content without the header, and `description` has its separator, decimal mark and
    comment sign. `dtypes` maps indices of the columns to read to their types. An additional column,
    with the index `column_count`, has the surplus cells of rows that are too long.
    """
    import pandas as pd

    # Since version 3.1 pandas rounds numbers correctly by default.
    rounds_correctly = tuple(map(int, pd.__version__.split(".")[:2])) >= (3, 1)
    options = {} if rounds_correctly else {"float_precision": "round_trip"}
    # Without the additional column, pandas would silently drop surplus cells.
    header = description.separator.join(map(str, range(column_count + 1)))
    dtypes = {str(i): dtype for i, dtype in dtypes.items()} | {str(column_count): "category"}
    frame = pd.read_csv(
        StringIO(f"{header}\n{rows}", newline=""),
        dtype=dtypes,
        usecols=[*dtypes],
        sep=description.separator,
        decimal=description.decimal,
        comment=description.comment,
        skipinitialspace=True,
        low_memory=False,
        index_col=False,
        **options,
    )
    return frame.rename(columns=int)


def read_csv(path: Path, description: Any, text_columns: set) -> tuple[dict, list]:
    """Read the required columns of a CSV file; return (columns, names of all columns).

    `description` is the content of the YAML file of the data set, with the channels and the format
    of the file. The columns map names to arrays of numbers, or to pandas categories for names in
    `text_columns`. Raise ValueError if a column is missing or a cell is not a number.
    """
    # UTF-8 may begin with a byte order mark.
    encoding = "utf-8-sig" if description.encoding == "utf-8" else description.encoding
    try:
        with open(path, encoding=encoding, newline="") as file:
            names, rows = _read_header(file, description), file.read()
    except UnicodeError as error:
        allowed = f"{description.encoding} text ({getattr(error, 'reason', error)})"
        raise checks.InputError("data", description.data, allowed) from None
    except (OSError, csv.Error) as error:
        allowed = f"a file in the same folder ({error})"
        raise checks.InputError("data", description.data, allowed) from None
    indices = {name: names.index(name) for name in _required_columns(names, description)}
    dtypes = {i: "category" if name in text_columns else float for name, i in indices.items()}
    try:
        frame = _parse_rows(rows, description, dtypes, len(names))
    except ValueError:
        raise _not_a_number_error(rows, description, dtypes, names) from None
    checks.require(len(frame), "data", description.data, "a file with rows, but it has none")
    has_surplus = frame[len(names)].notna().to_numpy()
    if has_surplus.any():
        hint = " (a decimal comma needs another separator)" if description.separator == "," else ""
        raise ValueError(
            f"{description.data}, row {int(has_surplus.argmax()) + 1}: it must have {len(names)} "
            f"cells, one for each column, not more{hint}"
        )
    columns = {name: frame.pop(i) for name, i in indices.items()}
    for name, column in columns.items():
        columns[name] = column.array if name in text_columns else column.to_numpy()
    return columns, names


def _not_a_number_error(rows: str, description: Any, dtypes: dict, names: list) -> ValueError:
    """Return the ValueError for the first cell of a CSV file that should be a number but is not.

    `rows` is the content without the header, and `description` the content of the YAML file, with
    separator and decimal mark. `dtypes` maps indices of the columns that are read to their types,
    and `names` are the names of all columns. The cells are read again as strings to find the wrong
    one.
    """
    import pandas as pd

    number_columns = [i for i, dtype in dtypes.items() if dtype is float]
    # A cell with the other decimal mark is not a number.
    other_sign = "." if description.decimal == "," else ","
    try:
        frame = _parse_rows(rows, description, dict.fromkeys(number_columns, str), len(names))
    except ValueError as error:
        return checks.InputError(
            "data", description.data, f"a table ({' '.join(str(error).split())})"
        )
    for i in number_columns:
        cells = frame[i].str.replace(other_sign, "no sign", regex=False)
        cells = cells.str.replace(description.decimal, ".", regex=False)
        is_invalid = (pd.to_numeric(cells, errors="coerce").isna() & frame[i].notna()).to_numpy()
        if is_invalid.any():
            row = int(is_invalid.argmax())
            cell = f"{description.data}, column {names[i]!r}, row {row + 1}"
            allowed = f"a number, with the decimal mark {description.decimal!r} of the key decimal"
            return checks.InputError(cell, frame[i].iloc[row], allowed)
    return checks.InputError("data", description.data, "a table of numbers")


def read_uff(path: Path, description: Any) -> dict:
    """Read the channels of a universal file, its datasets of type 58; return name -> array.

    "time" is the common time of all channels. Directions and conditions are pandas categories.
    """
    if not PYUFF.available():
        raise MissingPackage(
            f"data = {description.data!r} is not allowed: it must be a CSV, or {PYUFF.module} "
            f"must be installed ({PYUFF.note()})"
        )
    import pyuff

    content = path.read_bytes()
    if not re.search(rb"^ {4}58b", content, re.MULTILINE | re.IGNORECASE):
        # pyuff reads blanks at the end of a line as numbers. Binary datasets are not changed.
        content = re.sub(rb"[ \t]+(?=\r?$)", b"", content, flags=re.MULTILINE)
    try:
        with TemporaryDirectory() as folder:
            copy = Path(folder, path.name)
            copy.write_bytes(content)
            file = pyuff.UFF(str(copy))
            types = file.get_set_types()
            records = [file.read_sets(i) for i, number in enumerate(types) if int(number) == 58]
    except Exception as error:  # pyuff raises various errors for damaged files
        message = " ".join(str(error).split())
        raise checks.InputError("data", description.data, f"a universal file ({message})") from None
    checks.require(
        records, "data", description.data, "a universal file with datasets 58, but it has none"
    )
    names = [str(record["id1"]).strip() for record in records]
    columns: dict = {}
    for name, channel in description.channels.items():
        allowed = "in a unit of time: a universal file has seconds, not dates"
        checks.require(channel.unit != DATES, f"channels.{name}.unit", channel.unit, allowed)
        if name == "time":
            continue
        if name not in names:
            raise _missing_error(f"the channel {name!r}", description, names)
        dataset = f"the set {name!r} of {description.data}"
        if names.count(name) > 1:
            raise ValueError(f"{dataset} occurs more than once")
        record = records[names.index(name)]
        if np.iscomplexobj(record["data"]):
            raise ValueError(f"{dataset} is complex: it must be real")
        count, value_count = record["num_pts"], record["data"].size
        if count > value_count:
            raise ValueError(
                f"{dataset} has {value_count} points: it must have {count}, as it states"
            )
        # Values beyond this number are padding.
        time = np.asarray(record["x"][:count], float)
        abscissa_type, label = record["abscissa_spec_data_type"], record["abscissa_axis_units_lab"]
        abscissa = f"the type of the abscissa of {dataset}"
        allowed = "17 (time), 0 (unknown) or 1 (general)"
        checks.require(abscissa_type in _TIME_TYPES, abscissa, abscissa_type, allowed)
        time_channel = description.channels.get("time", Channel(observableId="time", unit="s"))
        _check_axis_unit(time_channel, "time", dataset, label)
        # All channels share the times of the first one.
        if not np.array_equal(columns.setdefault("time", time), time):
            first_channel = list(columns)[1]  # after "time"
            raise ValueError(
                f"the channels {first_channel!r} and {name!r} of {description.data} have "
                "different times: they must be sampled together or be in separate data sets"
            )
        columns[name] = np.asarray(record["data"][:count], float)
        _check_axis_unit(channel, name, dataset, record["ordinate_axis_units_lab"])
        if (channel.observableId or name) in ("direction", "condition"):
            import pandas as pd

            columns[name] = pd.Categorical([f"{value:g}" for value in columns[name]])
    return columns


def _check_axis_unit(channel: Any, key: str, dataset: str, label: str) -> None:
    """Raise ValueError if the label of an axis states a different unit than its channel.

    `label` is the unit in a dataset of type 58 (samples over time) of a universal file. `channel`
    is the description of the channel in the YAML file, `key` its name, and `dataset` the name of
    the dataset in messages. Channels without calibration, in counts or of unknown gain, are not
    checked.
    """
    if channel.unit == COUNTS or channel.gain == "unknown" or label.upper() in _NO_UNITS:
        return
    factor, cf_unit = channel.scale(key)
    # The unit on the axis may be spelled in upper case, so both spellings are tried.
    for unit in _unit_spellings(label):
        try:
            axis_factor, axis_unit = channel.model_copy(update={"unit": unit}).scale(key)
        except ValueError:
            continue
        if axis_unit == cf_unit and math.isclose(axis_factor, factor, rel_tol=1e-9):
            return
        break
    allowed = f"{label!r}, the unit of the axis of {dataset}"
    raise checks.InputError(f"channels.{key}.unit", channel.unit, allowed)


def _unit_spellings(label: str) -> tuple[str, str]:
    """Convert the unit of an axis label to the syntax of `gearlib.units`, such as m/s^2.

    Examples of labels are (m/s²), M/S2 and 1/min. Return the unit as spelled and in lower case.
    """
    # pyuff reads µ and ² in encodings other than UTF-8 as U+FFFD.
    unit = re.sub(r"(?<!\w)\ufffd(?=\w)", "u", label.strip(" ()[]"))
    unit = re.sub("[²\ufffd]", "^2", unit)
    unit = re.sub("^1/([A-Za-z]+)$", r"\1^-1", unit)
    unit = re.sub(r"(?<=[A-Za-z])(-?\d)", r"^\1", unit)
    return unit, unit.lower()


def reshape_long_table(description: Any, columns: dict) -> tuple[dict, dict, xr.Dataset]:
    """Convert a long table to columns over samples; return (columns, deviations, jump speeds).

    `columns` are the columns of the table, which has one row per measurement. Measurements at the
    same condition, time and speed form one sample, NaN for quantities that were not measured. The
    new columns and their standard deviations map names to arrays in the units of the table; speeds
    of jumps are a dataset of scalars in min-1. `description` is the content of the YAML file.
    """
    label = f"{description.data}, column "
    codes = category_codes(f"{label}{ID_COLUMN!r}", columns[ID_COLUMN])
    observables = [str(name) for name in columns[ID_COLUMN].categories]
    values = columns[VALUE_COLUMN]
    noise = columns.get(NOISE_COLUMN, np.full(values.size, np.nan))
    channel_codes = {key: i for i, key in enumerate(observables) if key in description.channels}
    for key in description.channels:
        if key not in channel_codes and key not in columns:
            raise _missing_error(f"the observableId {key!r}", description, observables)
    gap_codes = [i for key, i in channel_codes.items() if description.channels[key].gaps]
    may_be_nan = np.isin(codes, gap_codes)
    check_finite(f"{label}{VALUE_COLUMN!r}", np.where(may_be_nan & np.isnan(values), 0.0, values))
    wrong_rows = np.flatnonzero((noise < 0) | np.isinf(noise))
    if wrong_rows.size:
        cell = f"{label}{NOISE_COLUMN!r}, row {wrong_rows[0] + 1}"
        raise checks.InputError(cell, noise[wrong_rows[0]], "a finite number >= 0")
    speeds = xr.Dataset()
    for key in list(channel_codes):
        name = description.channels[key].observableId or key
        if name in measured_names.SPEEDS:
            rows = np.flatnonzero(codes == channel_codes.pop(key))
            if rows.size > 1:
                raise ValueError(
                    f"the observableId {key!r} of {description.data} occurs {rows.size} times: it "
                    "must occur only once"
                )
            factor, units = description.channels[key].scale(key)
            text = measured_names.SPEEDS[name][1]
            std = noise[rows[0]] * factor  # NaN if the table does not give it
            if not np.isfinite(std):
                std = description.channels[key].noise_std(key)
            attrs = {"units": units, "long_name": text, "noise_std": std}
            speeds[name] = (), values[rows[0]] * factor, attrs
    has_channel = np.isin(codes, list(channel_codes.values()))
    codes, values, noise = codes[has_channel], values[has_channel], noise[has_channel]
    # A table may have only jump speeds.
    other_columns = columns if codes.size else ()
    coordinates = [name for name in other_columns if name not in (*LONG_COLUMNS, NOISE_COLUMN)]
    sample_columns = {name: columns[name][has_channel] for name in coordinates}
    samples, first_rows = _sample_indices(label, sample_columns, codes, observables)
    sample_columns = {name: column[first_rows] for name, column in sample_columns.items()}
    noise_columns: dict = {}
    for key, code in channel_codes.items():
        rows = codes == code
        sample_columns[key], noise_columns[key] = np.full((2, first_rows.size), np.nan)
        sample_columns[key][samples[rows]] = values[rows]
        noise_columns[key][samples[rows]] = noise[rows]
    return sample_columns, noise_columns, speeds


def _sample_indices(label: str, coordinates: dict, codes: np.ndarray, observables: list) -> tuple:
    """Return (index of the sample of each measurement, (n,), first row of each sample).

    Measurements, the rows of a long table, with equal `coordinates` (name -> column, such as time)
    form one sample. `codes`, (n,), are indices of the measured quantities in the list
    `observables`; messages begin with `label`. Raise ValueError if a quantity is measured twice at
    the same time.
    """
    import pandas as pd

    # Text columns are compared by their category codes.
    numbers = {name: getattr(column, "codes", column) for name, column in coordinates.items()}
    frame = pd.DataFrame(numbers | {ID_COLUMN: codes})
    # Repeated steady measurements, at infinite time or without a time, are separate samples.
    is_steady = np.isinf(coordinates.get("time", np.full(codes.shape, np.inf)))
    repetition = frame.groupby(list(frame.columns), sort=False).cumcount().to_numpy()
    is_repeated = (repetition > 0) & ~is_steady
    if is_repeated.any():
        i = int(is_repeated.argmax())
        raise ValueError(
            f"{label}'time' = {coordinates['time'][i]:.12g} occurs twice for the observableId "
            f"{observables[codes[i]]!r}, {int(is_repeated.sum())} times in all: it must occur once "
            "in each condition"
        )
    frame = frame.drop(columns=ID_COLUMN).assign(repetition=repetition)
    samples = frame.groupby(list(frame.columns), sort=False).ngroup().to_numpy()
    return samples, np.unique(samples, return_index=True)[1]


def check_finite(label: str, values: np.ndarray, gaps: Any = False, steady: bool = False) -> None:
    """Raise ValueError unless all numbers of a column are finite.

    `label` names the column in messages. With `gaps`, True or a mask, NaN (not measured) is
    allowed; with `steady`, infinity is allowed as the time of a steady state.
    """
    is_invalid = ~np.isfinite(values) & ~(gaps & np.isnan(values)) & ~(steady & (values == np.inf))
    if is_invalid.any():
        row, count = int(is_invalid.argmax()), int(is_invalid.sum())
        label += f", row {row + 1}" + (f", and {count - 1} more" if count > 1 else "")
        if np.isnan(values[row]):
            raise ValueError(
                f"{label}, is empty or NaN: it must be a number; with gaps: true in its "
                "channel, an empty cell means that nothing was measured"
            )
        raise checks.InputError(label, float(values[row]), "finite")


def category_codes(label: str, column: Any) -> np.ndarray:
    """Return the category codes of a column of strings, the indices of its distinct strings.

    `column` is a pandas categorical array; `label` names it in messages. Raise ValueError if a cell
    is empty (code -1).
    """
    codes = np.asarray(column.codes)
    if (codes < 0).any():
        row = int((codes < 0).argmax())
        raise ValueError(f"{label}, row {row + 1}, is empty: it must be a text")
    return codes


def seconds_since_first(label: str, column: Any) -> tuple[np.ndarray, str]:
    """Convert a column of dates to seconds since the earliest date; return (seconds, that date).

    `column` is a pandas categorical array of strings in ISO 8601 format, which is also the
    format of the returned date; `label` names the column in messages. Raise ValueError if a string
    is not a date.
    """
    import pandas as pd

    codes = category_codes(label, column)
    instants = pd.to_datetime(list(column.categories), utc=True, format="ISO8601", errors="coerce")
    if instants.isna().any():
        wrong_text = column.categories[int(instants.isna().argmax())]
        raise checks.InputError(label, wrong_text, "a date in ISO 8601 format")
    seconds = np.asarray((instants - instants.min()) / pd.Timedelta(1, "s"), float)
    return seconds[codes], instants.min().isoformat()
