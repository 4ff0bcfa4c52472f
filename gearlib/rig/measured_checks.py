"""What measured columns are refused for, in one sentence each, and what is repaired and said."""

import numpy as np

from gearlib import checks

_DIRECTIONS = {"up": 1, "down": -1, "rest": 0, "1": 1, "+1": 1, "-1": -1, "0": 0}
_DIRECTIONS |= {"1.0": 1, "-1.0": -1, "0.0": 0}


def finite(where, values, gaps=False, endless=False):
    """Raise ValueError unless numbers are finite; NaN is a gap where there may be some.

    endless: whether infinity is allowed, PEtab's time of a steady state.
    """
    wrong = ~np.isfinite(values)
    if gaps:
        wrong &= ~np.isnan(values)
    if endless:
        wrong &= values != np.inf
    if wrong.any():
        row, count = int(wrong.argmax()), int(wrong.sum())
        more = f", and {count - 1} more" if count > 1 else ""
        if np.isnan(values[row]):
            allowed = "a number; with gaps: true in its channel an empty cell is one not measured"
            raise ValueError(f"{where}, row {row + 1}{more}, is empty or NaN: it must be {allowed}")
        raise checks.refusal(f"{where}, row {row + 1}{more}", float(values[row]), "finite")


def directions(where, given):
    """Return directions, texts or numbers, as integers; ValueError for any other."""
    found = np.empty(len(given.categories), np.int8)
    for code, word in enumerate(given.categories):
        if str(word).strip().lower() not in _DIRECTIONS:
            raise checks.refusal(where, word, "up, down or rest, or 1, -1, 0")
        found[code] = _DIRECTIONS[str(word).strip().lower()]
    return found[complete(where, given)]


def complete(where, given):
    """Return the codes of a column of texts; ValueError where a cell is empty."""
    codes = np.asarray(given.codes)
    if (codes < 0).any():
        row = int((codes < 0).argmax())
        raise ValueError(f"{where}, row {row + 1}, is empty: it must be a text")
    return codes


def _steps(time, group):
    """Return the steps of time, and which of them are within a group."""
    with np.errstate(invalid="ignore"):  # of steady states, at infinity
        steps = np.diff(time)
    return steps, np.ones(steps.shape, bool) if group is None else group[1:] == group[:-1]


def _first_come(group):
    """Return numbers of groups in the order in which they come first."""
    _, first, number = np.unique(group, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[number]


def in_order(where, time, group):
    """Return the order in which time rises within each group, None where it does already.

    group: number of the condition of each sample, or None; ValueError where a time is there twice.
    """
    if time.size < 2:
        return None
    steps, same = _steps(time, group)
    blocks = group is not None and np.count_nonzero(~same) >= np.unique(group).size
    order = None
    if (steps[same] < 0).any() or blocks:
        order = np.lexsort((time,) if group is None else (time, _first_come(group)))
        time, group = time[order], None if group is None else group[order]
        steps, same = _steps(time, group)
    twice = same & (steps == 0.0)
    if twice.any():
        at = int(twice.argmax())
        rows = [int(one) + 1 for one in (at, at + 1)] if order is None else order[at : at + 2] + 1
        count = int(twice.sum())
        more = f", and {count - 1} more times" if count > 1 else ""
        raise ValueError(
            f"{where} = {time[at]:.12g} is there twice, in rows {rows[0]} and {rows[1]}{more}: it "
            "must be once in each condition"
        )
    return order


def dates(where, given):
    """Return seconds since the first of the dates of a column, and that date as ISO 8601."""
    import pandas as pd

    codes = complete(where, given)
    try:
        found = pd.to_datetime(list(given.categories), utc=True, format="ISO8601")
    except ValueError:
        wrong = next(one for one in given.categories if not _is_date(pd, one))
        raise checks.refusal(where, wrong, "a date by ISO 8601") from None
    seconds = np.asarray((found - found.min()) / pd.Timedelta(1, "s"), float)
    return seconds[codes], found.min().isoformat()


def _is_date(pd, text):
    return not pd.isna(pd.to_datetime(text, utc=True, format="ISO8601", errors="coerce"))
