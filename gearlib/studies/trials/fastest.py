"""Tabulate the fastest method of this library and the fastest solver of another package."""

import math
from collections.abc import Iterator, Sequence

import numpy as np
import xarray as xr

from gearlib.studies.trials.work_precision import OF_LIBRARY

#: Decades of accuracy; the last one is close to the resolution of floating-point numbers.
DECADES = range(1, 16)
#: Prefix of the columns -> text that replaces a method if no method is accurate enough.
UNREACHED = {"own": "no method of this library", "other": "no solver of another package"}
_COLUMNS = (
    "method",
    "knob",
    "time_us_per_mesh_period",
    "evaluations_per_mesh_period",
    "error_in_static_deflections",
)


def fastest(errors: np.ndarray, seconds: np.ndarray, decade: int) -> int | None:
    """Return the index of the fastest method with an error of at most 10^-decade, None without any.

    `errors` and `seconds` have an entry for each setting of a method, NaN where it has no result.
    """
    # The limit allows for rounding of the power. Disturbed measurements may have negative times.
    limit = 10.0**-decade * (1.0 + 1e-9)
    accurate = np.flatnonzero((errors <= limit) & (seconds > 0.0))
    return int(accurate[np.argmin(seconds[accurate])]) if accurate.size else None


def rows(errors: Sequence[xr.Dataset], times: Sequence[xr.Dataset]) -> Iterator[list]:
    """Yield the rows of the table of the fastest methods: the names of the columns, then values.

    `errors` and `times` are datasets of `gearlib.studies.trials.work_precision`, one per method.
    Each problem and decade of accuracy has a row with the fastest method of this library ("own")
    and the fastest solver of other packages ("other").
    """
    yield [
        *("problem", "accuracy_in_static_deflections", "own_is_times_faster"),
        *(f"{owner}_{column}" for owner in UNREACHED for column in _COLUMNS),
    ]

    def joined(datasets: Sequence[xr.Dataset], name: str) -> np.ndarray:
        return np.concatenate([data[name].values for data in datasets], axis=-1)

    is_own = [[data.attrs["method"] in OF_LIBRARY] * data.sizes["rung"] for data in errors]
    candidates = {"own": np.concatenate(is_own), "other": ~np.concatenate(is_own)}
    lines, knobs, error = (joined(errors, name) for name in ("line", "knob", "state_error"))
    evaluations, seconds = joined(errors, "period_evaluations"), joined(times, "period_time")
    for i, problem in enumerate(errors[0].problem.values):
        for decade in DECADES:
            cells, fastest_times = [], []
            for owner, selected in candidates.items():
                k = fastest(error[i], np.where(selected, seconds[i], math.nan), decade)
                if k is None:
                    cells += [f"{UNREACHED[owner]} reaches it", *[""] * (len(_COLUMNS) - 1)]
                    continue
                fastest_times.append(seconds[i, k])
                numbers = 1e6 * seconds[i, k], evaluations[i, k], error[i, k]
                cells += [lines[k], knobs[k], *(f"{value:.3g}" for value in numbers)]
            ratio = ""
            if len(fastest_times) == len(candidates):
                ratio = f"{fastest_times[1] / fastest_times[0]:.3g}"
            yield [str(problem), f"1e-{decade:02d}", ratio, *cells]
