"""Read CSV and UFF 58 files as columns: name -> array, float or text."""

import csv
from itertools import islice

import numpy as np

from gearlib import checks
from gearlib.integrators.method import MissingPackage, Package

PYUFF = Package("pyuff", "pyuff")
#: Columns of a long table, by PEtab.
LONG = ("observableId", "measurement")
CONDITION, NOISE = "simulationConditionId", "noiseParameters"
#: Rows that are read at once where one is looked for that is no number.
_CHUNK = 200_000


def header(path, said):
    """Return the names of the columns of a CSV and the line they stand in, from 1.

    No numerical stack: a start of the workflow reads it. ValueError where there are none.
    """
    try:
        with open(path, encoding=_encoding(said), newline="") as file:
            for line, text in islice(enumerate(file, 1), said.skip, None):
                text = text.split(said.comment)[0] if said.comment else text
                (cells,) = csv.reader([text], delimiter=said.separator, skipinitialspace=True)
                if any(cell.strip() for cell in cells):
                    return [cell.strip() for cell in cells], line
    except UnicodeDecodeError as error:
        raise checks.refusal("data", said.data, f"{said.encoding} text ({error.reason})") from None
    except (OSError, csv.Error) as error:
        raise checks.refusal("data", said.data, f"a file beside its YAML ({error})") from None
    raise checks.refusal("data", said.data, "a file with names of columns: it is empty")


def _encoding(said):
    return "utf-8-sig" if said.encoding == "utf-8" else said.encoding


def named(path, said):
    """Return the columns of a CSV that a description names; ValueError where one is missing."""
    names, line = header(path, said)
    long = set(LONG) <= {*names}
    coordinates = ("time", "speed", "direction")
    if long:
        wanted = [*LONG, *(one for one in (CONDITION, "time", NOISE) if one in names)]
        wanted += [
            key for key, one in said.channels.items()
            if (one.observableId or key) in coordinates and key in names and key not in wanted
        ]  # fmt: skip
    else:
        wanted = list(said.channels)
    for name in wanted:
        if names.count(name) > 1:
            raise ValueError(f"the column {name!r} of {said.data} is there twice: it must be once")
        if name not in names:
            raise ValueError(
                f"the column {name!r} of {said.data} is missing: it must be one of "
                f"{', '.join(map(repr, names[:12]))}{_other_separator(names, name)}"
            )
    return names, wanted, line


def _other_separator(names, name):
    """Return the separator with which a column would be there."""
    for other in (";", "\t", "|", ","):
        if len(names) == 1 and name in [cell.strip() for cell in names[0].split(other)]:
            return f", or separator must be {other!r}"
    return ""


class _Rows:
    """The rows of a CSV below a first line that names columns 0, 1, ... and one more."""

    def __init__(self, file, line, count, separator):
        for _ in range(line):
            file.readline()
        self.file, self.begin = file, separator.join(map(str, range(count + 1))) + "\n"

    def read(self, size=-1):
        begin, self.begin = self.begin, ""
        return begin or self.file.read(size)

    def __iter__(self):
        return iter(self.read, "")


def _tables(path, said, kinds, count, line, **how):
    """Yield the table of a CSV, or parts of it; kinds: number of a column -> its type."""
    import pandas as pd

    how |= {"sep": said.separator, "decimal": said.decimal, "comment": said.comment}
    how |= {"skipinitialspace": True, "engine": "c", "low_memory": False, "index_col": False}
    with open(path, encoding=_encoding(said), newline="") as file:
        # A cell behind the last column would be dropped in silence: it gets a column of its own.
        rows = _Rows(file, line, count, said.separator)
        kinds = {str(i): kind for i, kind in kinds.items()} | {str(count): "category"}
        if _version(pd) < (3, 1):
            # Later ones round numbers correctly without being asked.
            how["float_precision"] = "round_trip"
        found = pd.read_csv(rows, dtype=kinds, usecols=[*kinds], **how)
        yield from found if "chunksize" in how else [found]


def _version(package):
    return tuple(map(int, package.__version__.split(".")[:2]))


def read_csv(path, said, texts):
    """Return columns of a CSV. texts: names of the columns that are no numbers."""
    names, wanted, line = named(path, said)
    kinds = {names.index(one): "category" if one in texts else float for one in wanted}
    try:
        (frame,) = _tables(path, said, kinds, len(names), line)
    except UnicodeDecodeError as error:
        raise checks.refusal("data", said.data, f"{said.encoding} text ({error.reason})") from None
    except ValueError:
        raise _no_number(path, said, kinds, names, line) from None
    if frame.empty:
        raise checks.refusal("data", said.data, "a file with rows: it has none")
    beyond = frame[str(len(names))].notna().to_numpy()
    if beyond.any():
        hint = " (a decimal comma needs another separator)" if said.separator == "," else ""
        raise ValueError(
            f"{said.data}, row {int(beyond.argmax()) + 1}: it must have {len(names)} cells as its "
            f"names of columns have, not more{hint}"
        )
    columns = {name: frame.pop(str(names.index(name))) for name in wanted}
    return {name: c.array if name in texts else c.to_numpy() for name, c in columns.items()}


def _no_number(path, said, kinds, names, line):
    """Return the refusal of the first cell that is no number."""
    import pandas as pd

    row, numbers = 0, [i for i, kind in kinds.items() if kind is float]
    try:
        texts = dict.fromkeys(numbers, str)
        for part in _tables(path, said, texts, len(names), line, chunksize=_CHUNK):
            for i in numbers:
                cells = part[str(i)]
                plain = cells.str.replace(said.decimal, ".", regex=False)
                wrong = (pd.to_numeric(plain, errors="coerce").isna() & cells.notna()).to_numpy()
                if wrong.any():
                    at = int(wrong.argmax())
                    return ValueError(
                        f"{said.data}, column {names[i]!r}, row {row + at + 1} = "
                        f"{cells.iloc[at]!r} is not allowed: it must be a number"
                    )
            row += len(part)
    except ValueError as error:
        return checks.refusal("data", said.data, f"a table ({' '.join(str(error).split())})")
    return checks.refusal("data", said.data, "a table of numbers")


def _package(package, said):
    if not package.available():
        raise MissingPackage(
            f"data = {said.data!r} is not allowed: it must be a CSV, or {package.module} be there "
            f"({package.note()})"
        )


def _one_raster(found, times, said):
    """Return columns with the time that all channels share."""
    (first, time), *others = times.items()
    for name, other in others:
        if len(other) != len(time) or not np.array_equal(other, time):
            raise ValueError(
                f"the channels {first!r} and {name!r} of {said.data} have times of their own: they "
                "must be sampled together, or be two sets"
            )
    return {"time": np.asarray(time, float)} | found


def _asked(said):
    """Return the channels to be read; the time comes with them."""
    return [key for key in said.channels if key != "time"]


def _missing(name, said, there):
    shown = ", ".join(map(repr, list(there)[:12]))
    return ValueError(f"the channel {name!r} of {said.data} is missing: it must be one of {shown}")


def read_uff(path, said, texts):
    """Return columns of the sets 58 and 58b of a universal file, named by their first line."""
    _package(PYUFF, said)
    import pyuff

    try:
        file = pyuff.UFF(str(path))
        kinds = file.get_set_types()
        sets = [file.read_sets(i) for i, kind in enumerate(kinds) if int(kind) == 58]
    except Exception as error:  # whatever a damaged file leads pyuff to
        words = " ".join(str(error).split())
        raise checks.refusal("data", said.data, f"a universal file ({words})") from None
    if not sets:
        raise checks.refusal("data", said.data, "a universal file with sets 58: it has none")
    there = [str(one["id1"]).strip() for one in sets]
    found, times = {}, {}
    for name in _asked(said):
        if there.count(name) != 1:
            if name in there:
                raise ValueError(f"the set {name!r} of {said.data} is there twice: it must be once")
            raise _missing(name, said, there)
        one = sets[there.index(name)]
        if np.iscomplexobj(one["data"]):
            raise ValueError(f"the set {name!r} of {said.data} is complex: it must be real")
        found[name], times[name] = np.asarray(one["data"], float), one["x"]
    return _one_raster(found, times, said)


_READERS = {
    ".csv": read_csv,
    ".uff": read_uff,
    ".unv": read_uff,
}


def read(path, said, texts):
    """Return the columns that a description names, as of the readers above."""
    try:
        return _READERS[path.suffix.lower()](path, said, texts)
    except (ValueError, MemoryError):
        raise
    except Exception as error:  # whatever a damaged file leads other packages to
        words = " ".join(str(error).split())
        raise checks.refusal("data", said.data, f"a file that can be read ({words})") from None
