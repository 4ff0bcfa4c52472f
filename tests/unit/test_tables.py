"""Tables of studies: of models, of causes of lost contact, of work and precision."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from gearlib.data.files import write_table
from gearlib.studies import scenes, stability
from gearlib.studies.trials import fastest, problems
from gearlib.studies.trials.work_precision import event_error
from tests.golden import data as golden
from tests.paper import PARAMETERS
from tests.tables import read_back


def test_numbers_that_rounding_decides_are_left_out_of_the_table_of_models(tmp_path):
    names = ["fig7_damping", "fig8_six_degrees"]
    comparisons = [golden.read(f"models/{name}.nc") for name in names]
    table = [[*row.values()] for row in read_back(scenes.rows(comparisons, names), tmp_path)]
    assert table == [
        ["fig7_damping", "one_degree", "0.004844", "0.05", "10", "yes"],
        ["fig7_damping", "six_degrees_plain", "0.002237", "0.05", "65", "no"],
        ["fig7_damping", "six_degrees", "nan", "0.05", "75", "no"],
        ["fig7_damping", "one_degree_harmonics", "0.00156", "0.05", "2000", "no"],
        ["fig8_six_degrees", "one_degree", "differs", "0.05", "differs", "no"],
        ["fig8_six_degrees", "six_degrees_plain", "differs", "0.05", "differs", "no"],
        ["fig8_six_degrees", "six_degrees", "nan", "0.05", "differs", "yes"],
        ["fig8_six_degrees", "one_degree_harmonics", "differs", "0.05", "differs", "no"],
    ]


def test_the_table_of_lost_contact_is_that_of_the_documentation(tmp_path):
    write_table(stability.rows(golden.read("tongues.nc")), tmp_path / "table.csv")
    expected = Path("docs/claims/parametric_resonance.csv").read_text(encoding="utf-8")
    assert (tmp_path / "table.csv").read_text(encoding="utf-8") == expected
    # Contact is also lost in a forced motion; the scan ends before it lasts again.
    run = {"periods": 120, "initial_state": [0.0, 0.0]}
    losses = stability.contact_loss({"free": PARAMETERS}, 0.82, 0.6, 1.1, run)
    (row,) = read_back(stability.rows(losses), tmp_path)
    assert (row["tuning"], row["cause"], row["lost"]) == ("0.82", "forced response", "yes")
    assert row["loss_from"] != "" == row["loss_to"]


def motion(phases, *codes):
    """Return a `Motion` with events at these phases, codes of the contact before and after."""
    codes = np.array(codes, np.int8).reshape(-1, 2)
    return problems.Motion(np.zeros(2), np.array(phases, float), codes)


def test_the_error_of_events_is_that_of_their_phases_or_nan():
    exact = motion([1.0, 2.0], (1, 0), (0, 1))
    assert event_error(motion([1.1, 1.7], (1, 0), (0, 1)), exact) == pytest.approx(0.3)
    # Events that differ in number or kind, or no events, cannot be compared.
    assert np.isnan(event_error(motion([1.0], (1, 0)), exact))
    assert np.isnan(event_error(motion([1.0, 2.0], (1, 0), (0, -1)), exact))
    assert np.isnan(event_error(motion([]), motion([])))


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
    assert [(row["problem"], row["accuracy_in_static_deflections"]) for row in table] == [
        ("smooth", f"1e-{decade:02d}") for decade in range(1, 16)
    ]
    ours, others = "no method of this library reaches it", "no solver of another package reaches it"
    # How many times the library is faster; then of both, name, setting, us, evaluations, error.
    for decade, expected in {
        1: "6,rk4,rk4 = 0,0.5,0,0.0001,scipy RK45,scipy RK45 = 0,3,0,0.05",
        3: "8,rk4,rk4 = 0,0.5,0,0.0001,heyoka,heyoka = 0,4,0,3e-06",
        6: "7,exact,exact = 0,1,0,2e-12,heyoka,heyoka = 1,7,10,3e-15",
        12: "7e-06,rk4,rk4 = 1,1e+06,10,1e-13,heyoka,heyoka = 1,7,10,3e-15",
        14: f",{ours},,,,,heyoka,heyoka = 1,7,10,3e-15",
        15: f",{ours},,,,,{others},,,,",
    }.items():
        assert ",".join([*table[decade - 1].values()][2:]) == expected
