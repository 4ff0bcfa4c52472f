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
#: Columns of a long table, by PEtab.
LONG = ("observableId", "measurement")
CONDITION, NOISE = "simulationConditionId", "noiseParameters"
#: Directions, texts or numbers.
_DIRECTIONS = {"up": 1, "down": -1, "rest": 0, "1": 1, "+1": 1, "-1": -1, "0": 0}
_DIRECTIONS |= {"1.0": 1, "-1.0": -1, "0.0": 0}


def read(path: Path, rig: Any, texts: set) -> dict:
    """Return the columns that a description names; texts: names of those that are no numbers."""
    is_csv = path.suffix.lower() == ".csv"
    return _read_csv(path, rig, texts) if is_csv else _read_uff(path, rig)


def header(path: Path, rig: Any) -> tuple[list[str], int]:
    """Return the names of the columns of a CSV and the line they stand in, from 1."""
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
    """Return the encoding of a CSV."""
    return "utf-8-sig" if rig.encoding == "utf-8" else rig.encoding


def _wanted(names: list[str], rig: Any) -> list[str]:
    """Return the columns of a CSV that a description names."""
    wanted = list(rig.channels)
    if set(LONG) <= {*names}:
        wanted = [*LONG, *(name for name in (CONDITION, "time", NOISE) if name in names)]
        wanted += [
            key for key, channel in rig.channels.items()
            if (channel.observableId or key) in ("time", "speed", "direction")
            and key in names and key not in wanted
        ]  # fmt: skip
    for name in wanted:
        if names.count(name) > 1:
            raise ValueError(f"the column {name!r} of {rig.data} is there twice: it must be once")
        if name not in names:
            separators = [
                separator for separator in (";", "\t", "|", ",")
                if len(names) == 1 and name in map(str.strip, names[0].split(separator))
            ]  # fmt: skip
            hint = f", or separator must be {separators[0]!r}" if separators else ""
            raise ValueError(
                f"the column {name!r} of {rig.data} is missing: it must be one of "
                f"{', '.join(map(repr, names[:12]))}{hint}"
            )
    return wanted


def _frame(path: Path, rig: Any, kinds: dict, count: int, line: int) -> Any:
    """Return numbered columns of a CSV below a line; kinds: number of a column -> its type."""
    import pandas as pd

    # Versions from 3.1 on round numbers correctly without being asked.
    exact = tuple(map(int, pd.__version__.split(".")[:2])) >= (3, 1)
    # A cell behind the last column would be dropped in silence: it gets a column of its own.
    names = rig.separator.join(map(str, range(count + 1)))
    with open(path, encoding=_encoding(rig), newline="") as file:
        for _ in range(line):
            file.readline()
        table = StringIO(f"{names}\n{file.read()}", newline="")
    kinds = {str(i): kind for i, kind in kinds.items()} | {str(count): "category"}
    frame = pd.read_csv(
        table,
        dtype=kinds,
        usecols=[*kinds],
        sep=rig.separator,
        decimal=rig.decimal,
        comment=rig.comment,
        skipinitialspace=True,
        low_memory=False,
        index_col=False,
        **({} if exact else {"float_precision": "round_trip"}),
    )
    return frame.rename(columns=int)


def _read_csv(path: Path, rig: Any, texts: set) -> dict:
    """Return columns of a CSV."""
    names, line = header(path, rig)
    wanted = {name: names.index(name) for name in _wanted(names, rig)}
    kinds = {i: "category" if name in texts else float for name, i in wanted.items()}
    try:
        frame = _frame(path, rig, kinds, len(names), line)
    except UnicodeDecodeError as error:
        raise checks.refusal("data", rig.data, f"{rig.encoding} text ({error.reason})") from None
    except ValueError:
        raise _no_number(path, rig, kinds, names, line) from None
    checks.require(len(frame), "data", rig.data, "a file with rows: it has none")
    beyond = frame[len(names)].notna().to_numpy()
    if beyond.any():
        hint = " (a decimal comma needs another separator)" if rig.separator == "," else ""
        raise ValueError(
            f"{rig.data}, row {int(beyond.argmax()) + 1}: it must have {len(names)} cells as its "
            f"names of columns have, not more{hint}"
        )
    columns = {name: frame.pop(i) for name, i in wanted.items()}
    return {name: c.array if name in texts else c.to_numpy() for name, c in columns.items()}


def _no_number(path: Path, rig: Any, kinds: dict, names: list, line: int) -> ValueError:
    """Return the refusal of the first cell that is no number."""
    import pandas as pd

    numbers = [i for i, kind in kinds.items() if kind is float]
    try:
        frame = _frame(path, rig, dict.fromkeys(numbers, str), len(names), line)
    except ValueError as error:
        return checks.refusal("data", rig.data, f"a table ({' '.join(str(error).split())})")
    for i in numbers:
        plain = frame[i].str.replace(rig.decimal, ".", regex=False)
        wrong = (pd.to_numeric(plain, errors="coerce").isna() & frame[i].notna()).to_numpy()
        if wrong.any():
            row = int(wrong.argmax())
            where = f"{rig.data}, column {names[i]!r}, row {row + 1}"
            return checks.refusal(where, frame[i].iloc[row], "a number")
    return checks.refusal("data", rig.data, "a table of numbers")


def _read_uff(path: Path, rig: Any) -> dict:
    """Return columns of the sets 58 and 58b of a universal file, named by their first line."""
    if not PYUFF.available():
        raise MissingPackage(
            f"data = {rig.data!r} is not allowed: it must be a CSV, or {PYUFF.module} be there "
            f"({PYUFF.note()})"
        )
    import pyuff

    try:
        file = pyuff.UFF(str(path))
        kinds = file.get_set_types()
        sets = [file.read_sets(i) for i, kind in enumerate(kinds) if int(kind) == 58]
    except Exception as error:  # whatever a damaged file leads pyuff to
        words = " ".join(str(error).split())
        raise checks.refusal("data", rig.data, f"a universal file ({words})") from None
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
    """Return columns over samples, the noise of each sample, and the single speeds.

    Measurements at the same condition, time and speed are one sample; where an observable was not
    measured it is NaN. At a time of infinity, or without times, an observable may be there several
    times: these are samples of their own.
    """
    where = f"{rig.data}, column "
    codes = complete(f"{where}{LONG[0]!r}", columns[LONG[0]])
    observables = [str(name) for name in columns[LONG[0]].categories]
    values = columns[LONG[1]]
    noise = columns.get(NOISE, np.full(values.size, np.nan))
    numbers = {key: i for i, key in enumerate(observables) if key in rig.channels}
    for key in rig.channels:
        if key not in numbers and key not in columns:
            raise ValueError(
                f"the observableId {key!r} of {rig.data} is missing: it must be one of "
                f"{', '.join(map(repr, observables[:12]))}"
            )
    gaps = np.isin(codes, [i for key, i in numbers.items() if rig.channels[key].gaps])
    check_finite(f"{where}{LONG[1]!r}", np.where(gaps & np.isnan(values), 0.0, values))
    wrong = np.flatnonzero((noise < 0) | np.isinf(noise))
    if wrong.size:
        row = f"{where}{NOISE!r}, row {wrong[0] + 1}"
        raise checks.refusal(row, noise[wrong[0]], "a finite number >= 0")
    speeds = xr.Dataset()
    for key in list(numbers):
        name = rig.channels[key].observableId or key
        if name in measured_names.SPEEDS:
            rows = codes == numbers.pop(key)
            speeds[name] = _single_speed(rig, key, name, values[rows], noise[rows])
    kept = np.isin(codes, list(numbers.values()))
    wide = {name: columns[name][kept] for name in columns if name not in (*LONG, NOISE)}
    codes, values, noise = codes[kept], values[kept], noise[kept]
    sample, first = _sample_numbers(where, wide, codes, observables)
    wide, noises = {name: column[first] for name, column in wide.items()}, {}
    for key, i in numbers.items():
        rows = codes == i
        wide[key], noises[key] = np.full((2, first.size), np.nan)
        wide[key][sample[rows]], noises[key][sample[rows]] = values[rows], noise[rows]
    return wide, noises, speeds


def _sample_numbers(where: str, keys: dict, codes: np.ndarray, observables: list) -> tuple:
    """Return the number of the sample of each row, and the first row of each sample."""
    import pandas as pd

    plain = {name: getattr(column, "codes", column) for name, column in keys.items()}
    frame = pd.DataFrame(plain | {LONG[0]: codes})
    endless = np.isinf(keys["time"]) if "time" in keys else np.ones(codes.shape, bool)
    again = frame.groupby(list(frame.columns), sort=False).cumcount().to_numpy()
    twice = (again > 0) & ~endless
    if twice.any():
        i = int(twice.argmax())
        raise ValueError(
            f"{where}'time' = {keys['time'][i]:.12g} is there twice for the observableId "
            f"{observables[codes[i]]!r}, {int(twice.sum())} times in all: it must be once in each "
            "condition"
        )
    frame = frame.drop(columns=LONG[0]).assign(again=again)
    sample = frame.groupby(list(frame.columns), sort=False).ngroup().to_numpy()
    return sample, np.unique(sample, return_index=True)[1]


def _single_speed(rig: Any, key: str, name: str, values: Any, noise: Any) -> tuple:
    """Return the one measurement of a speed at which the motion changes."""
    if values.size > 1:
        raise ValueError(
            f"the observableId {key!r} of {rig.data} is there {values.size} times: it must be once"
        )
    channel = rig.channels[key]
    factor, units = channel.scale(key)
    deviation = noise[0] * factor if np.isfinite(noise[0]) else channel.noise_std(key)
    words = measured_names.SPEEDS[name][1]
    return (), values[0] * factor, {"units": units, "long_name": words, "noise_std": deviation}


def check_finite(where: str, values: np.ndarray, gaps: Any = False, endless: bool = False) -> None:
    """Raise ValueError unless numbers are finite; NaN is a gap where there may be some.

    endless: whether infinity is allowed, PEtab's time of a steady state.
    """
    wrong = ~np.isfinite(values) & ~(gaps & np.isnan(values)) & ~(endless & (values == np.inf))
    if wrong.any():
        row, count = int(wrong.argmax()), int(wrong.sum())
        where += f", row {row + 1}" + (f", and {count - 1} more" if count > 1 else "")
        if np.isnan(values[row]):
            raise ValueError(
                f"{where}, is empty or NaN: it must be a number; with gaps: true in its channel an "
                "empty cell is one not measured"
            )
        raise checks.refusal(where, float(values[row]), "finite")


def directions(where: str, given: Any) -> np.ndarray:
    """Return directions, texts or numbers, as integers; ValueError for any other."""
    words = [str(word).strip().lower() for word in given.categories]
    for word, category in zip(words, given.categories, strict=True):
        checks.require(word in _DIRECTIONS, where, category, "up, down or rest, or 1, -1, 0")
    return np.array([_DIRECTIONS[word] for word in words], np.int8)[complete(where, given)]


def complete(where: str, given: Any) -> np.ndarray:
    """Return the codes of a column of texts; ValueError where a cell is empty."""
    codes = np.asarray(given.codes)
    if (codes < 0).any():
        row = int((codes < 0).argmax())
        raise ValueError(f"{where}, row {row + 1}, is empty: it must be a text")
    return codes


def in_order(where: str, time: np.ndarray, group: np.ndarray) -> np.ndarray | None:
    """Return the order in which time rises within each group, None where it does already.

    group: number of the condition of each sample; ValueError where a time is there twice.
    """
    import pandas as pd

    # Groups are numbered by the order in which they come first.
    order = np.lexsort((time, pd.factorize(group)[0]))
    time, group = time[order], group[order]
    same = (time[1:] == time[:-1]) & (group[1:] == group[:-1]) & np.isfinite(time[1:])
    if same.any():
        i, count = int(same.argmax()), int(same.sum())
        more = f", and {count - 1} more times" if count > 1 else ""
        raise ValueError(
            f"{where} = {time[i]:.12g} is there twice, in rows {order[i] + 1} and "
            f"{order[i + 1] + 1}{more}: it must be once in each condition"
        )
    return None if (np.diff(order) > 0).all() else order


def dates(where: str, given: Any) -> tuple[np.ndarray, str]:
    """Return seconds since the first of the dates of a column, and that date as ISO 8601."""
    import pandas as pd

    codes = complete(where, given)
    days = pd.to_datetime(list(given.categories), utc=True, format="ISO8601", errors="coerce")
    if days.isna().any():
        wrong = given.categories[int(days.isna().argmax())]
        raise checks.refusal(where, wrong, "a date by ISO 8601")
    seconds = np.asarray((days - days.min()) / pd.Timedelta(1, "s"), float)
    return seconds[codes], days.min().isoformat()
