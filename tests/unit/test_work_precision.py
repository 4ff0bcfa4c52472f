"""Work and precision: ladders, error measures, decades and tables, from constructed data."""

import numpy as np
import pytest
import xarray as xr

from gearlib import integrators
from gearlib.studies import jump
from gearlib.studies.trials import fastest, problems
from gearlib.studies.trials import work_precision as wp
from tests.paper import PARAMETERS
from tests.tables import read_back

SETTINGS = {
    "damping": 3953.7,
    "cubic_damping": 4e5,
    "periods": 4,
    "conservative_periods": 2,
    "record_periods": 3,
}


def run(state=(0.0, 0.0), phases=(), kinds=()):
    codes = np.array(kinds, np.int8).reshape(-1, 2)
    return problems.Motion(np.array(state, float), np.array(phases, float), codes)


def test_error_of_the_state():
    assert wp.state_error(run((1.0, 2.0)), run((1.5, 1.0))) == 1.0
    assert np.isnan(wp.state_error(run((np.nan, np.nan)), run()))


def test_error_of_the_events():
    one = run(phases=[1.0, 2.0], kinds=[(1, 0), (0, 1)])
    assert wp.event_error(run(phases=[1.1, 1.7], kinds=one.codes), one) == pytest.approx(0.3)
    # Another number, another kind, none at all: nothing to compare.
    assert np.isnan(wp.event_error(run(phases=[1.0], kinds=[(1, 0)]), one))
    assert np.isnan(wp.event_error(run(phases=[1.0, 2.0], kinds=[(1, 0), (0, -1)]), one))
    assert np.isnan(wp.event_error(run(), run()))


def test_every_method_has_a_ladder_that_it_accepts():
    model = problems.build("cubic", PARAMETERS, {}, SETTINGS).model
    for method in (one for one in integrators.methods() if one.available):
        for _, _, options in wp.method_settings(method.name):
            if integrators.METHODS[method.name].supports(model):
                integrators.choose(model, method.name, options)


def test_problems():
    model = problems.build("near_fold", PARAMETERS, {}, SETTINGS).model
    assert (model.material_damping, model.backlash_damping) == (3953.7, 0.0)
    undamped = problems.build("conservative", PARAMETERS, {}, SETTINGS)
    assert undamped.periods == undamped.record_periods == 2
    assert undamped.model.material_damping == 0.0 and not undamped.steady
    assert problems.build("cubic", PARAMETERS, {}, SETTINGS).model.cubic_damping == 4e5


def test_the_fastest_of_a_decade():
    error = np.array([1e-2, 1e-9, 3e-5, np.nan, 1e-12, 1e-3])
    seconds = np.array([1.0, 5.0, 2.0, 0.1, np.nan, -1.0])
    # The third is the quickest within 1e-3 and 1e-4, the second from there on to its own error; a
    # time below zero is none.
    found = [fastest.fastest(error, seconds, decade) for decade in fastest.DECADES]
    assert found == [0, 0, 2, 2, 1, 1, 1, 1, 1, *[None] * 6]


def measured(method, line, error, seconds):
    """Return datasets of errors and times of one line with some rungs on one problem."""
    count = len(error)
    named = {
        "line": ("rung", [line] * count),
        "knob": ("rung", [f"{line} = {k}" for k in range(count)]),
    }
    errors = {"state_error": error, "period_evaluations": 10.0 * np.arange(count)}
    parts = [errors, {"period_time": seconds}]
    return [
        xr.Dataset(
            named | {name: (("problem", "rung"), [values]) for name, values in part.items()},
            {"problem": ["smooth"]},
            {"method": method},
        )
        for part in parts
    ]


def test_the_table_names_the_fastest_of_ours_and_of_the_others(tmp_path):
    pairs = [
        measured("exact", "exact", [2e-12], [1e-6]),
        measured("rk4", "rk4", [1e-4, 1e-13], [5e-7, 1.0]),
        measured("heyoka", "heyoka", [3e-6, 3e-15], [4e-6, 7e-6]),
        measured("scipy", "scipy RK45", [5e-2, 1e-7], [3e-6, 9e-6]),
    ]
    errors, times = zip(*pairs, strict=True)
    table = read_back(fastest.rows(errors, times), tmp_path)
    rows = {row["accuracy_in_static_deflections"]: row for row in table}
    assert list(rows) == [f"1e-{decade:02d}" for decade in range(1, 16)]

    def short(accuracy):
        columns = ("own_method", "own_time_us_per_mesh_period", "other_method", "other_knob")
        return [rows[accuracy][c] for c in ("own_is_times_faster", *columns)]

    assert short("1e-01") == ["6", "rk4", "0.5", "scipy RK45", "scipy RK45 = 0"]
    assert short("1e-03") == ["8", "rk4", "0.5", "heyoka", "heyoka = 0"]
    assert short("1e-06") == ["7", "exact", "1", "heyoka", "heyoka = 1"]
    # Slower, and said so.
    assert short("1e-12") == ["7e-06", "rk4", "1e+06", "heyoka", "heyoka = 1"]
    assert rows["1e-12"]["other_error_in_static_deflections"] == "3e-15"
    assert rows["1e-12"]["other_evaluations_per_mesh_period"] == "10"
    ours, others = "no method of this library reaches it", "no solver of another package reaches it"
    assert short("1e-14") == ["", ours, "", "heyoka", "heyoka = 1"]
    assert short("1e-15") == ["", ours, "", others, ""]


def test_switches_of_a_scan():
    steps, large = jump.height_steps(np.array([1.0, 1.1, 3.0, 1.2, np.nan, 4.0]))
    np.testing.assert_allclose(steps, [0.1, 1.9, 1.8, 0.0, 0.0])
    assert large.tolist() == [False, True, True, False, False]
    assert not jump.height_steps(np.array([1.0, 1.05, 1.08]))[1].any()
