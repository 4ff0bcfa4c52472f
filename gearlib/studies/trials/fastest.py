"""The fastest method of this library beside the fastest solver of another package, as a table."""

import math

import numpy as np

from gearlib.studies.trials.work_precision import OF_LIBRARY

#: Decades of the table: the last one is near the last place of a state.
DECADES = range(1, 16)
#: Prefix of the columns -> what stands in the place of a method where there is none.
UNREACHED = {"own": "no method of this library", "other": "no solver of another package"}
_COLUMNS = (
    "method",
    "knob",
    "time_us_per_mesh_period",
    "evaluations_per_mesh_period",
    "error_in_static_deflections",
)


def fastest(error, seconds, decade):
    """Return the index of the fastest with an error <= 10^-decade; None: there is none.

    error, seconds (shape (n,), NaN: no candidate).
    """
    # A decade is reached with its bound, rounding of the power included. The slope of a disturbed
    # measurement may be negative: it is no time.
    able = np.flatnonzero((error <= 10.0**-decade * (1.0 + 1e-9)) & (seconds > 0.0))
    return int(able[np.argmin(seconds[able])]) if able.size else None


def rows(errors, times):
    """Yield the fastest of this library and of others, for every problem and decade.

    errors, times: datasets of `gearlib.studies.trials.work_precision`, one for each method.
    """
    yield [
        *("problem", "accuracy_in_static_deflections", "own_is_times_faster"),
        *(f"{owner}_{column}" for owner in UNREACHED for column in _COLUMNS),
    ]

    def joined(datasets, name):
        return np.concatenate([data[name].values for data in datasets], axis=-1)

    own = [[data.attrs["method"] in OF_LIBRARY] * data.sizes["rung"] for data in errors]
    candidates = {"own": np.concatenate(own), "other": ~np.concatenate(own)}
    lines, knobs, error = (joined(errors, name) for name in ("line", "knob", "state_error"))
    evaluations, seconds = joined(errors, "period_evaluations"), joined(times, "period_time")
    for i, problem in enumerate(errors[0].problem.values):
        for decade in DECADES:
            cells, fastest_times = [], []
            for owner, chosen in candidates.items():
                k = fastest(error[i], np.where(chosen, seconds[i], math.nan), decade)
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
