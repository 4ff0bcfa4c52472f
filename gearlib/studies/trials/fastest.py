"""Tabulate the fastest methods of this library and of other packages for each accuracy."""

import math
from collections.abc import Iterator, Sequence

import numpy as np
import xarray as xr

from gearlib.studies.trials.work_precision import LIBRARY_METHODS

#: Required errors are 10^-decade; the last decade is close to the rounding errors of floats.
DECADES = range(1, 16)
#: Prefix of columns -> kind of method.
COLUMN_PREFIXES = {"own": "method of this library", "other": "solver of another package"}
_NUMBERS = ("time_us_per_mesh_period", "evaluations_per_mesh_period", "error_in_static_deflections")
_COLUMNS = ("method", "knob", *_NUMBERS)


def find_fastest(errors: np.ndarray, seconds: np.ndarray, decade: int) -> int | None:
    """Return the index of the fastest setting with an error of at most 10^-decade, or None.

    `errors` and `seconds` (wall times) have one entry per setting, NaN if there is no result.
    """
    # The factor allows for rounding errors of the power.
    max_error = 10.0**-decade * (1.0 + 1e-9)
    # Disturbed measurements can result in negative times.
    accurate = np.flatnonzero((errors <= max_error) & (seconds > 0.0))
    if not accurate.size:
        return None
    return int(accurate[np.argmin(seconds[accurate])])


def table_rows(errors: Sequence[xr.Dataset], times: Sequence[xr.Dataset]) -> Iterator[list]:
    """Yield the rows of the table of the fastest methods, beginning with the column names.

    `errors` and `times` are results of `compute_errors` and `measure_times` of
    `gearlib.studies.trials.work_precision`, one for each method. The dimension "rung" is the index
    of a setting, "line" the label of the method, and "knob" the accuracy parameter with its value.
    Each problem and decade of accuracy (error 10^-decade) has a row with
    the fastest method of this library (columns "own_...") and the fastest solver of other packages
    (columns "other_...").
    """
    yield [
        *("problem", "accuracy_in_static_deflections", "own_is_times_faster"),
        *(f"{prefix}_{column}" for prefix in COLUMN_PREFIXES for column in _COLUMNS),
    ]

    def concatenate(datasets: Sequence[xr.Dataset], name: str) -> np.ndarray:
        """Concatenate a variable of all methods along its last dimension, the settings."""
        return np.concatenate([data[name].values for data in datasets], axis=-1)

    masks = []  # for each setting: whether the method belongs to this library
    for data in errors:
        masks.append([data.attrs["method"] in LIBRARY_METHODS] * data.sizes["rung"])
    in_library = np.concatenate(masks)
    candidates = {"own": in_library, "other": ~in_library}
    labels = concatenate(errors, "line")
    parameters = concatenate(errors, "knob")
    state_errors = concatenate(errors, "state_error")
    evaluations = concatenate(errors, "period_evaluations")
    seconds = concatenate(times, "period_time")
    for i, problem in enumerate(errors[0].problem.values):
        for decade in DECADES:
            cells, fastest_times = [], []
            for prefix, is_candidate in candidates.items():
                candidate_seconds = np.where(is_candidate, seconds[i], math.nan)
                k = find_fastest(state_errors[i], candidate_seconds, decade)  # index of a setting
                if k is None:
                    cells += [
                        f"no {COLUMN_PREFIXES[prefix]} reaches it",
                        *[""] * (len(_COLUMNS) - 1),
                    ]
                    continue
                fastest_times.append(seconds[i, k])
                numbers = 1e6 * seconds[i, k], evaluations[i, k], state_errors[i, k]
                cells += [labels[k], parameters[k], *(f"{value:.3g}" for value in numbers)]
            ratio = ""
            if len(fastest_times) == len(candidates):
                ratio = f"{fastest_times[1] / fastest_times[0]:.3g}"
            yield [str(problem), f"1e-{decade:02d}", ratio, *cells]
