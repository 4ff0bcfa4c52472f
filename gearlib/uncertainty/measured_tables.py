"""CSV and UFF files as checked columns: name -> array of numbers, or texts with their codes.

A CSV is wide, a column for each channel, or long as PEtab has them, a row for each measurement.
"""

import csv
from io import StringIO
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from gearlib import checks
from gearlib.data import measured_names
from gearlib.integrators.method import MissingPackage, Package

PYUFF = Package("pyuff", "pyuff")
#: Names of the columns of a long table by PEtab.
LONG_COLUMNS = ("observableId", "measurement")
CONDITION_COLUMN, NOISE_COLUMN = "simulationConditionId", "noiseParameters"
#: Texts and numbers of a direction -> its sign.
_DIRECTIONS = {"up": 1, "down": -1, "rest": 0, "1": 1, "+1": 1, "-1": -1, "0": 0}
_DIRECTIONS |= {"1.0": 1, "-1.0": -1, "0.0": 0}


def read(path: Path, rig: Any, texts: set) -> dict:
    """Return the columns of a CSV or universal file by name, as arrays.

    `rig` is the description with the names of its channels; the columns named in `texts` are
    categories of pandas.
    """
    is_csv = path.suffix.lower() == ".csv"
    return _read_csv(path, rig, texts) if is_csv else _read_uff(path, rig)


def header(path: Path, rig: Any) -> tuple[list[str], int]:
    """Return the names of the columns of a CSV, and the number of their line, from 1.

    `rig` is the description of the table with its encoding, separator and comment character.
    """
    try:
        with open(path, encoding=_encoding(rig), newline="") as file:
            for line, text in islice(enumerate(file, 1), rig.skip, None):
                text = text.split(rig.comment)[0] if rig.comment else text
                (cells,) = csv.reader([text], delimiter=rig.separator, skipinitialspace=True)
                if any(cell.strip() for cell in cells):
                    return [cell.strip() for cell in cells], line
    except UnicodeDecodeError as error:
        raise checks.refusal("data", rig.data, f"{rig.encoding} text ({error.reason})") from None
    except (OSError, csv.Error) as error:
        raise checks.refusal("data", rig.data, f"a file beside its YAML ({error})") from None
    raise checks.refusal("data", rig.data, "a file with names of columns: it is empty")


def _encoding(rig: Any) -> str:
    """Return the encoding of a CSV; UTF-8 may begin with a byte order mark."""
    return "utf-8-sig" if rig.encoding == "utf-8" else rig.encoding


def _required_columns(names: list[str], rig: Any) -> list[str]:
    """Return the names of the columns to read, or raise ValueError if one is missing or repeated.

    `names` are all columns of the table; the channels of the description `rig` are required.
    """
    required = list(rig.channels)
    if set(LONG_COLUMNS) <= {*names}:
        optional = CONDITION_COLUMN, "time", NOISE_COLUMN
        required = [*LONG_COLUMNS, *(name for name in optional if name in names)]
        required += [
            key
            for key, channel in rig.channels.items()
            if (channel.observableId or key) in ("time", "speed", "direction")
            and key in names
            and key not in required
        ]
    for name in required:
        if names.count(name) > 1:
            raise ValueError(f"the column {name!r} of {rig.data} is there twice: it must be once")
        if name not in names:
            separators = [
                separator
                for separator in (";", "\t", "|", ",")
                if len(names) == 1 and name in map(str.strip, names[0].split(separator))
            ]
            hint = f", or separator must be {separators[0]!r}" if separators else ""
            raise ValueError(
                f"the column {name!r} of {rig.data} is missing: it must be one of "
                f"{', '.join(map(repr, names[:12]))}{hint}"
            )
    return required


def _data_frame(path: Path, rig: Any, dtypes: dict, count: int, line: int) -> Any:
    """Return the data below a line of a CSV with `count` columns as a data frame of pandas.

    `dtypes` maps the index of each column that is read to its type, and `rig` describes the format.
    One column is added for surplus cells.
    """
    import pandas as pd

    # From version 3.1 on, pandas rounds numbers correctly by default.
    rounds_correctly = tuple(map(int, pd.__version__.split(".")[:2])) >= (3, 1)
    # Pandas would drop surplus cells of a row without an error.
    names = rig.separator.join(map(str, range(count + 1)))
    with open(path, encoding=_encoding(rig), newline="") as file:
        for _ in range(line):
            file.readline()
        table = StringIO(f"{names}\n{file.read()}", newline="")
    dtypes = {str(i): dtype for i, dtype in dtypes.items()} | {str(count): "category"}
    frame = pd.read_csv(
        table,
        dtype=dtypes,
        usecols=[*dtypes],
        sep=rig.separator,
        decimal=rig.decimal,
        comment=rig.comment,
        skipinitialspace=True,
        low_memory=False,
        index_col=False,
        **({} if rounds_correctly else {"float_precision": "round_trip"}),
    )
    return frame.rename(columns=int)


def _read_csv(path: Path, rig: Any, texts: set) -> dict:
    """Return columns of a CSV by name: numbers as arrays, `texts` as categories of pandas.

    `rig` is the description with the channels and the format of the CSV.
    """
    names, line = header(path, rig)
    indices = {name: names.index(name) for name in _required_columns(names, rig)}
    dtypes = {i: "category" if name in texts else float for name, i in indices.items()}
    try:
        frame = _data_frame(path, rig, dtypes, len(names), line)
    except UnicodeDecodeError as error:
        raise checks.refusal("data", rig.data, f"{rig.encoding} text ({error.reason})") from None
    except ValueError:
        raise _number_refusal(path, rig, dtypes, names, line) from None
    checks.require(len(frame), "data", rig.data, "a file with rows: it has none")
    has_surplus = frame[len(names)].notna().to_numpy()
    if has_surplus.any():
        hint = " (a decimal comma needs another separator)" if rig.separator == "," else ""
        raise ValueError(
            f"{rig.data}, row {int(has_surplus.argmax()) + 1}: it must have {len(names)} cells as "
            f"its names of columns have, not more{hint}"
        )
    columns = {name: frame.pop(i) for name, i in indices.items()}
    return {name: c.array if name in texts else c.to_numpy() for name, c in columns.items()}


def _number_refusal(path: Path, rig: Any, dtypes: dict, names: list, line: int) -> ValueError:
    """Return the error that names the first cell of a CSV that should be a number and is not.

    `rig` describes the format, `dtypes` maps indices of columns to types, and `names` are those of
    all columns, in the line with the number `line`.
    """
    import pandas as pd

    number_columns = [i for i, dtype in dtypes.items() if dtype is float]
    try:
        frame = _data_frame(path, rig, dict.fromkeys(number_columns, str), len(names), line)
    except ValueError as error:
        return checks.refusal("data", rig.data, f"a table ({' '.join(str(error).split())})")
    for i in number_columns:
        texts = frame[i].str.replace(rig.decimal, ".", regex=False)
        wrong = (pd.to_numeric(texts, errors="coerce").isna() & frame[i].notna()).to_numpy()
        if wrong.any():
            row = int(wrong.argmax())
            cell = f"{rig.data}, column {names[i]!r}, row {row + 1}"
            return checks.refusal(cell, frame[i].iloc[row], "a number")
    return checks.refusal("data", rig.data, "a table of numbers")


def _read_uff(path: Path, rig: Any) -> dict:
    """Return the channels and times of a universal file, sets 58 and 58b, as columns by name.

    `rig` is the description with the names of the channels.
    """
    if not PYUFF.available():
        raise MissingPackage(
            f"data = {rig.data!r} is not allowed: it must be a CSV, or {PYUFF.module} be there "
            f"({PYUFF.note()})"
        )
    import pyuff

    try:
        file = pyuff.UFF(str(path))
        types = file.get_set_types()
        sets = [file.read_sets(i) for i, number in enumerate(types) if int(number) == 58]
    except Exception as error:  # pyuff raises various errors for damaged files
        message = " ".join(str(error).split())
        raise checks.refusal("data", rig.data, f"a universal file ({message})") from None
    checks.require(sets, "data", rig.data, "a universal file with sets 58: it has none")
    names = [str(table["id1"]).strip() for table in sets]
    columns: dict = {}
    for name in [key for key in rig.channels if key != "time"]:
        if name not in names:
            raise ValueError(
                f"the channel {name!r} of {rig.data} is missing: it must be one of "
                f"{', '.join(map(repr, names[:12]))}"
            )
        if names.count(name) > 1:
            raise ValueError(f"the set {name!r} of {rig.data} is there twice: it must be once")
        table = sets[names.index(name)]
        if np.iscomplexobj(table["data"]):
            raise ValueError(f"the set {name!r} of {rig.data} is complex: it must be real")
        time = np.asarray(table["x"], float)
        if not np.array_equal(columns.setdefault("time", time), time):
            raise ValueError(
                f"the channels {list(columns)[1]!r} and {name!r} of {rig.data} have times of "
                "their own: they must be sampled together, or be two sets"
            )
        columns[name] = np.asarray(table["data"], float)
    return columns


def long_samples(rig: Any, columns: dict) -> tuple[dict, dict, xr.Dataset]:
    """Return columns over samples, noise of each sample, and scalar speeds of a long table.

    `columns` are those of the table, one measurement in each row; `rig` describes its channels.
    Measurements at the same condition, time and speed are one sample; observables that were not
    measured there are NaN. Repeated measurements at infinite time, or without time, are separate
    samples.
    """
    id_column, value_column = LONG_COLUMNS
    where = f"{rig.data}, column "
    codes = complete(f"{where}{id_column!r}", columns[id_column])
    observables = [str(name) for name in columns[id_column].categories]
    values = columns[value_column]
    noise = columns.get(NOISE_COLUMN, np.full(values.size, np.nan))
    channel_codes = {key: i for i, key in enumerate(observables) if key in rig.channels}
    for key in rig.channels:
        if key not in channel_codes and key not in columns:
            raise ValueError(
                f"the observableId {key!r} of {rig.data} is missing: it must be one of "
                f"{', '.join(map(repr, observables[:12]))}"
            )
    gaps = np.isin(codes, [i for key, i in channel_codes.items() if rig.channels[key].gaps])
    check_finite(f"{where}{value_column!r}", np.where(gaps & np.isnan(values), 0.0, values))
    wrong = np.flatnonzero((noise < 0) | np.isinf(noise))
    if wrong.size:
        cell = f"{where}{NOISE_COLUMN!r}, row {wrong[0] + 1}"
        raise checks.refusal(cell, noise[wrong[0]], "a finite number >= 0")
    speeds = xr.Dataset()
    for key in list(channel_codes):
        name = rig.channels[key].observableId or key
        if name in measured_names.SPEEDS:
            rows = codes == channel_codes.pop(key)
            speeds[name] = _scalar_speed(rig, key, name, values[rows], noise[rows])
    has_channel = np.isin(codes, list(channel_codes.values()))
    codes, values, noise = codes[has_channel], values[has_channel], noise[has_channel]
    coordinates = [name for name in columns if name not in (*LONG_COLUMNS, NOISE_COLUMN)]
    wide = {name: columns[name][has_channel] for name in coordinates}
    samples, first_rows = _sample_indices(where, wide, codes, observables)
    wide, noises = {name: column[first_rows] for name, column in wide.items()}, {}
    for key, code in channel_codes.items():
        rows = codes == code
        wide[key], noises[key] = np.full((2, first_rows.size), np.nan)
        wide[key][samples[rows]], noises[key][samples[rows]] = values[rows], noise[rows]
    return wide, noises, speeds


def _sample_indices(where: str, coordinates: dict, codes: np.ndarray, observables: list) -> tuple:
    """Return the index of the sample of each measurement, and the first row of each sample.

    `coordinates` maps names to columns, such as time, and `codes` are the indices of the measured
    quantities in `observables`; both have one entry for each measurement. `where` begins error
    messages.
    """
    import pandas as pd

    numbers = {name: getattr(column, "codes", column) for name, column in coordinates.items()}
    frame = pd.DataFrame(numbers | {LONG_COLUMNS[0]: codes})
    steady = np.isinf(coordinates["time"]) if "time" in coordinates else np.ones(codes.shape, bool)
    repetition = frame.groupby(list(frame.columns), sort=False).cumcount().to_numpy()
    repeated = (repetition > 0) & ~steady
    if repeated.any():
        i = int(repeated.argmax())
        raise ValueError(
            f"{where}'time' = {coordinates['time'][i]:.12g} is there twice for the observableId "
            f"{observables[codes[i]]!r}, {int(repeated.sum())} times in all: it must be once in "
            "each condition"
        )
    frame = frame.drop(columns=LONG_COLUMNS[0]).assign(repetition=repetition)
    samples = frame.groupby(list(frame.columns), sort=False).ngroup().to_numpy()
    return samples, np.unique(samples, return_index=True)[1]


def _scalar_speed(rig: Any, key: str, name: str, values: Any, noise: Any) -> tuple:
    """Return the only measurement of a scalar speed as a variable: dims, value, attributes.

    `key` is the channel in the description `rig` and `name` the speed, such as "jump_up"; values
    and their noise have the unit of the channel.
    """
    if values.size > 1:
        raise ValueError(
            f"the observableId {key!r} of {rig.data} is there {values.size} times: it must be once"
        )
    channel = rig.channels[key]
    factor, units = channel.scale(key)
    deviation = noise[0] * factor if np.isfinite(noise[0]) else channel.noise_std(key)
    text = measured_names.SPEEDS[name][1]
    return (), values[0] * factor, {"units": units, "long_name": text, "noise_std": deviation}


def check_finite(where: str, values: np.ndarray, gaps: Any = False, steady: bool = False) -> None:
    """Raise ValueError unless numbers are finite; `where` names their column in the message.

    NaN is allowed with `gaps`, infinity with `steady`, as it is PEtab's time of a steady state.
    """
    wrong = ~np.isfinite(values) & ~(gaps & np.isnan(values)) & ~(steady & (values == np.inf))
    if wrong.any():
        row, count = int(wrong.argmax()), int(wrong.sum())
        where += f", row {row + 1}" + (f", and {count - 1} more" if count > 1 else "")
        if np.isnan(values[row]):
            raise ValueError(
                f"{where}, is empty or NaN: it must be a number; with gaps: true in its channel an "
                "empty cell is one not measured"
            )
        raise checks.refusal(where, float(values[row]), "finite")


def directions(where: str, column: Any) -> np.ndarray:
    """Return a column of directions, texts or numbers, as 1, -1 and 0, or raise ValueError.

    `column` is categorical; `where` names it in error messages.
    """
    texts = [str(category).strip().lower() for category in column.categories]
    for text, category in zip(texts, column.categories, strict=True):
        checks.require(text in _DIRECTIONS, where, category, "up, down or rest, or 1, -1, 0")
    return np.array([_DIRECTIONS[text] for text in texts], np.int8)[complete(where, column)]


def complete(where: str, column: Any) -> np.ndarray:
    """Return the category codes of a column of texts, or raise ValueError if a cell is empty.

    `where` names the column in the message.
    """
    codes = np.asarray(column.codes)
    if (codes < 0).any():
        row = int((codes < 0).argmax())
        raise ValueError(f"{where}, row {row + 1}, is empty: it must be a text")
    return codes


def in_order(where: str, time: np.ndarray, group: np.ndarray) -> np.ndarray | None:
    """Return the order of samples by time in each group, None if they are sorted already.

    `group` holds the number of the condition of each sample. ValueError is raised if a time occurs
    twice in a group; `where` names the column of times in the message.
    """
    import pandas as pd

    # Groups keep the order in which they occur first.
    order = np.lexsort((time, pd.factorize(group)[0]))
    time, group = time[order], group[order]
    repeated = (time[1:] == time[:-1]) & (group[1:] == group[:-1]) & np.isfinite(time[1:])
    if repeated.any():
        i, count = int(repeated.argmax()), int(repeated.sum())
        further = f", and {count - 1} more times" if count > 1 else ""
        raise ValueError(
            f"{where} = {time[i]:.12g} is there twice, in rows {order[i] + 1} and "
            f"{order[i + 1] + 1}{further}: it must be once in each condition"
        )
    return None if (np.diff(order) > 0).all() else order


def dates(where: str, column: Any) -> tuple[np.ndarray, str]:
    """Return seconds since the first date of a column, and this date as ISO 8601.

    `column` is categorical; `where` names it in error messages.
    """
    import pandas as pd

    codes = complete(where, column)
    days = pd.to_datetime(list(column.categories), utc=True, format="ISO8601", errors="coerce")
    if days.isna().any():
        wrong = column.categories[int(days.isna().argmax())]
        raise checks.refusal(where, wrong, "a date by ISO 8601")
    seconds = np.asarray((days - days.min()) / pd.Timedelta(1, "s"), float)
    return seconds[codes], days.min().isoformat()
