"""Work and precision: error measures, decades and tables, from constructed data."""

import numpy as np
import pytest
import xarray as xr

from gearlib.studies.trials import fastest, problems
from gearlib.studies.trials import work_precision as wp
from tests.tables import read_back


def motion(phases=(), kinds=()):
    codes = np.array(kinds, np.int8).reshape(-1, 2)
    return problems.Motion(np.zeros(2), np.array(phases, float), codes)


def test_error_of_the_events():
    exact = motion([1.0, 2.0], [(1, 0), (0, 1)])
    assert wp.event_error(motion([1.1, 1.7], exact.codes), exact) == pytest.approx(0.3)
    # Another number, another kind, none at all: nothing to compare.
    assert np.isnan(wp.event_error(motion([1.0], [(1, 0)]), exact))
    assert np.isnan(wp.event_error(motion([1.0, 2.0], [(1, 0), (0, -1)]), exact))
    assert np.isnan(wp.event_error(motion(), motion()))


def measured(method, line, error, seconds):
    """Return datasets of errors and times of one line with some rungs on one problem."""
    count = len(error)
    names = {"line": ("rung", [line] * count)}
    names["knob"] = ("rung", [f"{line} = {k}" for k in range(count)])
    errors = {"state_error": error, "period_evaluations": 10.0 * np.arange(count)}
    return [
        xr.Dataset(
            names | {name: (("problem", "rung"), [values]) for name, values in part.items()},
            {"problem": ["smooth"]},
            {"method": method},
        )
        for part in (errors, {"period_time": seconds})
    ]


def test_the_table_names_the_fastest_of_ours_and_of_the_others(tmp_path):
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
        # Slower, and said so.
        "1e-12": ["7e-06", "rk4", "1e+06", "heyoka", "heyoka = 1"],
        "1e-14": ["", ours, "", "heyoka", "heyoka = 1"],
        "1e-15": ["", ours, "", others, ""],
    }.items():
        assert [rows[accuracy][column] for column in columns] == expected
    assert rows["1e-12"]["other_error_in_static_deflections"] == "3e-15"
    assert rows["1e-12"]["other_evaluations_per_mesh_period"] == "10"
