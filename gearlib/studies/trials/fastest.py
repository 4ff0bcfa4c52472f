"""The fastest method of this library beside the fastest solver of another package, as a table."""

import math

import numpy as np

from gearlib.studies.trials import work_precision

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
    """Yield the fastest of this library and of others, for every problem and decade."""
    names = [f"{who}_{column}" for who in UNREACHED for column in _COLUMNS]
    yield ["problem", "accuracy_in_static_deflections", "own_is_times_faster", *names]
    of_library = [data.attrs["method"] in work_precision.OF_LIBRARY for data in errors]
    own = np.repeat(of_library, [data.sizes["rung"] for data in errors])
    seconds = joined(times, "period_time")
    error, evaluations = (joined(errors, name) for name in ("state_error", "period_evaluations"))
    words = joined(errors, "line"), joined(errors, "knob")
    for i, problem in enumerate(errors[0].problem.values):
        for decade in DECADES:
            cells, found = [], {}
            for who, chosen in (("own", own), ("other", ~own)):
                k = fastest(error[i], np.where(chosen, seconds[i], math.nan), decade)
                if k is None:
                    cells += [f"{UNREACHED[who]} reaches it", *[""] * (len(_COLUMNS) - 1)]
                    continue
                found[who] = seconds[i, k]
                numbers = 1e6 * seconds[i, k], evaluations[i, k], error[i, k]
                cells += [*(one[k] for one in words), *(f"{value:.3g}" for value in numbers)]
            ratio = f"{found['other'] / found['own']:.3g}" if len(found) == len(UNREACHED) else ""
            yield [str(problem), f"1e-{decade:02d}", ratio, *cells]
