"""The fastest method of this library beside the fastest solver of another package, as a table."""

import math
from typing import NamedTuple

import numpy as np

from gearlib.studies.trials import work_precision


class Entry(NamedTuple):
    """The fastest of some methods within an accuracy."""

    line: str
    knob: str
    time: float  #: per mesh period, s
    evaluations: float  #: per mesh period
    error: float


class Row(NamedTuple):
    """The fastest methods of one problem within one accuracy; None: no method reaches it."""

    problem: str
    decade: int  #: state error <= 10^-decade
    own: Entry | None  #: of this library
    other: Entry | None  #: of other packages


#: Decades of the table: the last one is near the last place of a state.
DECADES = range(1, 16)


def fastest(error, seconds, decade):
    """Return the index of the fastest with an error <= 10^-decade; None: there is none.

    error, seconds (shape (n,), NaN: no candidate).
    """
    # A decade is reached with its bound, rounding of the power included. The slope of a disturbed
    # measurement may be negative: it is no time.
    able = np.flatnonzero((error <= 10.0**-decade * (1.0 + 1e-9)) & (seconds > 0.0))
    return int(able[np.argmin(seconds[able])]) if able.size else None


def joined(datasets, name):
    """Return a variable over (problem, rung) or (rung,) of all methods, end to end."""
    return np.concatenate([data[name].values for data in datasets], axis=-1)


def table(error_datasets, time_datasets):
    """Return the `Row` of every problem and decade, from the datasets of the same methods."""
    line, knob = joined(error_datasets, "line"), joined(error_datasets, "knob")
    error, evaluations = (
        joined(error_datasets, name) for name in ("state_error", "period_evaluations")
    )
    seconds = joined(time_datasets, "period_time")
    own = np.concatenate(
        [
            np.full(data.sizes["rung"], data.attrs["method"] in work_precision.OF_LIBRARY)
            for data in error_datasets
        ]
    )

    def entry(i, decade, chosen):
        k = fastest(error[i], np.where(chosen, seconds[i], math.nan), decade)
        if k is None:
            return None
        return Entry(line[k], knob[k], seconds[i, k], evaluations[i, k], error[i, k])

    return [
        Row(str(problem), decade, entry(i, decade, own), entry(i, decade, ~own))
        for i, problem in enumerate(error_datasets[0].problem.values)
        for decade in DECADES
    ]


#: What the table says in the place of a method where there is none.
UNREACHED = {"own": "no method of this library", "other": "no solver of another package"}
_COLUMNS = (
    "method",
    "knob",
    "time_us_per_mesh_period",
    "evaluations_per_mesh_period",
    "error_in_static_deflections",
)


def rows(errors, times):
    """Yield the `table` of the datasets of methods, replacing the file in one step."""
    names = [f"{who}_{column}" for who in UNREACHED for column in _COLUMNS]
    yield ["problem", "accuracy_in_static_deflections", "own_is_times_faster", *names]
    for row in table(errors, times):
        ratio = f"{row.other.time / row.own.time:.3g}" if row.own and row.other else ""
        cells = [*_cells(row.own, "own"), *_cells(row.other, "other")]
        yield [row.problem, f"1e-{row.decade:02d}", ratio, *cells]


def _cells(entry, who):
    if entry is None:
        return [f"{UNREACHED[who]} reaches it", *[""] * (len(_COLUMNS) - 1)]
    numbers = (1e6 * entry.time, entry.evaluations, entry.error)
    return [entry.line, entry.knob, *(f"{value:.3g}" for value in numbers)]
