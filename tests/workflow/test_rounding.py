"""What follows from rounding is no result: datasets again from moved starts, and planted faults.

`make rounding` does so with all datasets of the project, `python -m tests.rounding --small` with
those of the small workflow.
"""

import numpy as np
import pytest
import xarray as xr

from tests.rounding import comparison
from tests.rounding.__main__ import moved_environment

#: A run, carried sweeps, trains from many starts, chaos with its label: seconds each.
AGAIN = ("train_sweep.nc", "phase_lag.nc", "resonance/k1/up")
SETTLED = {"flag_values": np.arange(2, dtype=np.int8), "flag_meanings": "unsettled settled"}


@pytest.mark.slow
def test_moved_starts_give_the_same_numbers(first_run, project, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", moved_environment()["PYTHONPATH"])
    results = project / "results"
    names = [
        str(path.relative_to(results))
        for path in sorted(results.rglob("*.nc"))
        if any(str(path.relative_to(results)).startswith(start) for start in AGAIN)
    ]
    assert len(names) == len(AGAIN)
    old = {name: (results / name).read_bytes() for name in names}
    for name in names:
        (results / name).unlink()
    project.snakemake("-j1", *(f"results/{name}" for name in names))
    for name in names:
        assert (results / name).read_bytes() != old[name], f"no start of {name} was moved"
        first = first_run[0] / "results" / name
        assert comparison.files_differ(name, first, results / name) == []


def chaotic_run(start):
    """Return the orbit of the logistic map from a start, a number of it, and a settled one."""
    x, y = start, 0.3
    values = []
    for _ in range(200):
        x, y = 4.0 * x * (1.0 - x), 0.5 * y
        values.append(x)
    return xr.Dataset(
        {"largest": max(values[100:]), "force": ("phase", values), "other": ("phase", [y] * 200)}
    )


def test_a_number_out_of_a_chaotic_run_is_noticed():
    one, other = chaotic_run(0.3), chaotic_run(0.3 + 1e-12)
    found = comparison.differences("planted", one, other)
    assert [sentence.split(":")[1].strip() for sentence in found] == ["largest", "force"]
    for dataset in (one, other):
        dataset["settled"] = ("phase", np.repeat(np.array([1, 0], np.int8), [20, 180]), SETTLED)
    # The label is that of the course; the one number that was taken of it is still there.
    found = comparison.differences("planted", one, other)
    assert [sentence.split(":")[1].strip() for sentence in found] == ["largest"]


def test_labels_themselves_must_be_the_same():
    one = xr.Dataset({"settled": ("tuning", np.array([1, 0], np.int8), SETTLED)})
    other = xr.Dataset({"settled": ("tuning", np.array([1, 1], np.int8), SETTLED)})
    assert comparison.differences("x", one, one) == []
    assert "settled" in comparison.differences("x", one, other)[0]


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ("nu 0.8150", "nu 0.8150", True),
        ("nu 0.8150", "nu 0.8151", True),
        ("nu 0.8150", "nu 0.8152", False),
        ("12 periods", "13 periods", False),
        ("1.2e-05", "1.3e-05", True),
        ("first", "second", False),
    ],
)
def test_printed_numbers_may_differ_by_a_unit_of_the_last_digit(one, other, same):
    assert comparison.same_words(one, other) == same


def test_numbers_are_compared_over_the_largest_one_and_gaps_with_gaps():
    one = xr.Dataset({"x": ("i", [1.0, 1e-9, np.nan])})
    assert comparison.differences("x", one, one + 9e-7) == []
    assert comparison.differences("x", one, one + 2e-6)
    assert comparison.differences("x", one, one.fillna(0.0))
