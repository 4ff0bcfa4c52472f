"""Work and precision: error measures, decades and tables, from constructed data."""

import numpy as np
import pytest
import xarray as xr

from gearlib.studies.trials import fastest, problems
from gearlib.studies.trials.work_precision import event_error
from tests.tables import read_back


def motion(phases=(), codes=()):
    """Return a `Motion` with events at these phases, codes of the contact before and after."""
    codes = np.array(codes, np.int8).reshape(-1, 2)
    return problems.Motion(np.zeros(2), np.array(phases, float), codes)


def test_the_error_of_events_is_that_of_their_phases_or_nan():
    exact = motion([1.0, 2.0], [(1, 0), (0, 1)])
    assert event_error(motion([1.1, 1.7], exact.codes), exact) == pytest.approx(0.3)
    # Events that differ in number or kind, or no events, cannot be compared.
    assert np.isnan(event_error(motion([1.0], [(1, 0)]), exact))
    assert np.isnan(event_error(motion([1.0, 2.0], [(1, 0), (0, -1)]), exact))
    assert np.isnan(event_error(motion(), motion()))


def measured(method, solver, errors, times):
    """Return datasets of the errors, and of the times (s), of a solver on one problem.

    Each has an entry for each setting ("rung") from coarse to fine, named "solver = 0" and so on.
    """
    count = len(errors)
    names = {"line": ("rung", [solver] * count)}
    names["knob"] = ("rung", [f"{solver} = {k}" for k in range(count)])
    errors = {"state_error": errors, "period_evaluations": 10.0 * np.arange(count)}
    return [
        xr.Dataset(
            names | {name: (("problem", "rung"), [values]) for name, values in part.items()},
            {"problem": ["smooth"]},
            {"method": method},
        )
        for part in (errors, {"period_time": times})
    ]


def test_the_table_names_the_fastest_method_of_the_library_and_of_other_packages(tmp_path):
    pairs = [
        measured("exact", "exact", [2e-12], [1e-6]),
        measured("rk4", "rk4", [1e-4, 1e-13], [5e-7, 1.0]),
        measured("heyoka", "heyoka", [3e-6, 3e-15], [4e-6, 7e-6]),
        measured("scipy", "scipy RK45", [5e-2, 1e-7], [3e-6, 9e-6]),
    ]
    table = read_back(fastest.rows(*zip(*pairs, strict=True)), tmp_path)
    rows = {row["accuracy_in_static_deflections"]: row for row in table}
    assert list(rows) == [f"1e-{decade:02d}" for decade in range(1, 16)]
    ours, others = "no method of this library reaches it", "no solver of another package reaches it"
    columns = ("own_is_times_faster", "own_method", "own_time_us_per_mesh_period")
    columns += ("other_method", "other_knob")
    for accuracy, expected in {
        "1e-01": ["6", "rk4", "0.5", "scipy RK45", "scipy RK45 = 0"],
        "1e-03": ["8", "rk4", "0.5", "heyoka", "heyoka = 0"],
        "1e-06": ["7", "exact", "1", "heyoka", "heyoka = 1"],
        # The library is slower here: 7e-6 times as fast.
        "1e-12": ["7e-06", "rk4", "1e+06", "heyoka", "heyoka = 1"],
        "1e-14": ["", ours, "", "heyoka", "heyoka = 1"],
        "1e-15": ["", ours, "", others, ""],
    }.items():
        assert [rows[accuracy][column] for column in columns] == expected
    assert rows["1e-12"]["other_error_in_static_deflections"] == "3e-15"
    assert rows["1e-12"]["other_evaluations_per_mesh_period"] == "10"
