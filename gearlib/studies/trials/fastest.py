"""Tabulate the fastest method of this library and the fastest solver of other packages."""

import math
from collections.abc import Iterator, Sequence

import numpy as np
import xarray as xr

from gearlib.studies.trials.work_precision import LIBRARY_METHODS

#: Required errors are 10^-decade; the last decade is close to the rounding errors of floats.
DECADES = range(1, 16)
#: Prefix of columns -> kind of method.
OWNERS = {"own": "method of this library", "other": "solver of another package"}
_NUMBERS = ("time_us_per_mesh_period", "evaluations_per_mesh_period", "error_in_static_deflections")
_COLUMNS = ("method", "knob", *_NUMBERS)


def find_fastest(errors: np.ndarray, seconds: np.ndarray, decade: int) -> int | None:
    """Return the index of the fastest setting with an error of at most 10^-decade, or None.

    `errors` and `seconds` (wall times) have one entry per setting of a method, NaN where it has no
    result.
    """
    # The factor allows for the rounding error of the power.
    max_error = 10.0**-decade * (1.0 + 1e-9)
    # Disturbed measurements may have negative times.
    accurate = np.flatnonzero((errors <= max_error) & (seconds > 0.0))
    if not accurate.size:
        return None
    return int(accurate[np.argmin(seconds[accurate])])


def table_rows(errors: Sequence[xr.Dataset], times: Sequence[xr.Dataset]) -> Iterator[list]:
    """Yield the rows of the table of the fastest methods: the names of the columns, then values.

    `errors` and `times` are results of the functions `errors` and `times` of
    `gearlib.studies.trials.work_precision`, one for each method. Their dimension "rung" is the
    index of a setting, for which "line" has the label of the method, and "knob" the accuracy
    parameter with its value. Each problem and decade of accuracy (error 10^-decade) has a row with
    the fastest method of this library (columns "own_...") and the fastest solver of other packages
    (columns "other_...").
    """
    yield [
        *("problem", "accuracy_in_static_deflections", "own_is_times_faster"),
        *(f"{owner}_{column}" for owner in OWNERS for column in _COLUMNS),
    ]

    def concatenated(datasets: Sequence[xr.Dataset], name: str) -> np.ndarray:
        """Return a variable for the settings of all methods, (..., settings)."""
        return np.concatenate([data[name].values for data in datasets], axis=-1)

    masks = []  # for the settings of each method: whether this library has the method
    for data in errors:
        masks.append([data.attrs["method"] in LIBRARY_METHODS] * data.sizes["rung"])
    in_library = np.concatenate(masks)
    candidates = {"own": in_library, "other": ~in_library}
    labels = concatenated(errors, "line")
    parameters = concatenated(errors, "knob")
    state_errors = concatenated(errors, "state_error")
    evaluations = concatenated(errors, "period_evaluations")
    seconds = concatenated(times, "period_time")
    for i, problem in enumerate(errors[0].problem.values):
        for decade in DECADES:
            cells, fastest_times = [], []
            for owner, is_candidate in candidates.items():
                candidate_seconds = np.where(is_candidate, seconds[i], math.nan)
                k = find_fastest(state_errors[i], candidate_seconds, decade)  # index of a setting
                if k is None:
                    cells += [f"no {OWNERS[owner]} reaches it", *[""] * (len(_COLUMNS) - 1)]
                    continue
                fastest_times.append(seconds[i, k])
                numbers = 1e6 * seconds[i, k], evaluations[i, k], state_errors[i, k]
                cells += [labels[k], parameters[k], *(f"{value:.3g}" for value in numbers)]
            ratio = ""
            if len(fastest_times) == len(candidates):
                ratio = f"{fastest_times[1] / fastest_times[0]:.3g}"
            yield [str(problem), f"1e-{decade:02d}", ratio, *cells]
