"""Sentences on the page on speed and accuracy must match its data, and its data the code."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from docs.hooks import evidence
from gearlib import config
from gearlib.studies.trials import difficult_problems, problems, work_precision
from tests.paper import CONFIG

ROOT = Path(__file__).resolve().parents[2]
GOLDEN = ROOT / "tests/golden/data"
PAGE = ROOT / "docs/speed_and_accuracy.md"
SETTINGS = config.load(CONFIG)
POINTS, FAILURES, MODELS = (
    evidence.read(f"speed_and_accuracy/{name}") for name in ("work_precision", "failures", "models")
)


def test_the_default_method_is_fastest_and_heyoka_leads_the_other_packages():
    """At each accuracy, the measured times must support the sentence and the ratios on the page."""
    rows, ratios = POINTS[POINTS.microseconds > 0.0].sort_values("microseconds"), []
    for max_error in (1e-3, 1e-6, 1e-9, 1e-12):
        # The factor 1.001 allows for the rounding of tabulated errors.
        for _, accurate_rows in rows[rows.state_error <= 1.001 * max_error].groupby("problem"):
            is_other = accurate_rows.line.str.startswith(("scipy", "heyoka"))
            assert accurate_rows.line.iloc[0] in ("exact", "taylor")
            if is_other.any():
                assert accurate_rows[is_other].line.iloc[0] == "heyoka"
                ratios.append(
                    accurate_rows[is_other].microseconds.iloc[0]
                    / accurate_rows.microseconds.iloc[0]
                )
    assert f"{min(ratios):.0f} to {max(ratios):.0f} times" in PAGE.read_text(encoding="utf-8")


def test_event_locating_methods_never_fail_and_fixed_steps_lose_their_order():
    """Methods that locate events must have no wrong result; rk4 must converge with order 1 only."""
    for method in ("exact", "taylor", "heyoka"):
        assert {*FAILURES[method]} <= {"right", "refused"}
    # Contact events inside steps reduce the order of rk4 from 4 to 1.
    rk4 = POINTS[(POINTS.line == "rk4") & (POINTS.problem == "bouncing")]
    order, _ = np.polyfit(np.log(rk4.evaluations), -np.log(rk4.state_error), 1)
    assert order == pytest.approx(1.0, abs=0.3)


def test_listed_problems_and_methods_match_the_code():
    """The tables of the page must contain the problems, trials and methods of the library."""
    names = list(difficult_problems.build_problems())
    assert [*FAILURES.problem] == names
    assert sorted(" ".join(evidence.DIFFICULTIES.values()).split()) == sorted(names)
    assert [*FAILURES.columns[1:]] == [trial.name for trial in SETTINGS.failures.trials]
    assert {*POINTS.problem} == set(problems.CASES)
    # The columns `line` and `knob` name the variant of a method and its accuracy parameter.
    measured_settings = {*zip(POINTS.line, POINTS.knob.fillna(""), strict=True)}
    for method in work_precision.LIBRARY_METHODS:
        for variant, parameter, _ in work_precision.method_settings(method):
            assert (variant.label, parameter) in measured_settings


def test_verdicts_on_the_exact_method_match_golden_data():
    """The table of failures must agree with golden data, which the workflow checks."""
    with xr.open_dataset(GOLDEN / "failures.nc") as golden:
        meanings = golden.verdict.attrs["flag_meanings"].split()
        flags = golden.verdict.sel(trial="exact").values
    assert [*FAILURES.exact] == [meanings[int(flag)] for flag in flags]


@pytest.mark.parametrize("scene", SETTINGS.scenes)
def test_the_table_of_models_matches_golden_data(scene):
    """The model that the table marks as chosen must be the one in golden data."""
    with xr.open_dataset(GOLDEN / f"models/{scene}.nc") as golden:
        chosen = golden.chosen.item()
    rows = MODELS[(MODELS.scene == scene) & (MODELS.chosen == "yes")]
    assert [*rows.model] == [chosen]
