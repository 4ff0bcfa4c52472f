"""The page on speed and accuracy: its numbers are those of its data, its data those of the code."""

from pathlib import Path

import pytest
import xarray as xr

from docs.hooks import speed_and_accuracy as hook
from gearlib import config
from gearlib.studies.trials import difficult_problems, problems, work_precision
from tests.paper import CONFIG

ROOT = Path(__file__).resolve().parents[2]
GOLDEN = ROOT / "tests/golden/data"
SETTINGS = config.load(CONFIG)


def test_the_page_says_what_its_data_say():
    text = hook.PAGE.read_text(encoding="utf-8")
    assert hook.renewed(text) == text


def test_a_block_that_is_not_there_is_refused():
    with pytest.raises(ValueError, match="0 blocks `machine`"):
        hook.renewed("nothing")


def test_problems_and_methods_are_those_of_the_code():
    rows = hook.read("failures")
    names = list(difficult_problems.problems())
    assert [row["problem"] for row in rows] == names
    described = " ".join(problem_names for problem_names, _ in hook.DIFFICULTIES.values())
    assert sorted(described.split()) == sorted(names)
    problem, *trials = rows[0]
    assert problem == "problem" and trials == [trial.name for trial in SETTINGS.failures.trials]
    measured = hook.points()
    assert {row["problem"] for row in measured} == set(problems.CASES)
    # The columns `line` and `knob` name the variant of a method and its accuracy parameter.
    measured_settings = {(row["line"], row["knob"]) for row in measured}
    for method in work_precision.LIBRARY_METHODS:
        for variant, parameter, _ in work_precision.method_settings(method):
            assert (variant.label, parameter) in measured_settings


def test_verdicts_on_the_exact_method_are_the_golden_ones():
    with xr.open_dataset(GOLDEN / "failures.nc") as golden:
        meanings = golden.verdict.attrs["flag_meanings"].split()
        codes = golden.verdict.sel(trial="exact").values
    assert [row["exact"] for row in hook.read("failures")] == [meanings[int(k)] for k in codes]


@pytest.mark.parametrize("scene", SETTINGS.scenes)
def test_models_are_the_golden_ones(scene):
    with xr.open_dataset(GOLDEN / f"models/{scene}.nc") as golden:
        chosen = golden.chosen.item()
    rows = {row["model"]: row for row in hook.read("models") if row["scene"] == scene}
    assert rows[chosen]["chosen"] == "yes"
