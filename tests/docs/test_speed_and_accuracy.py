"""The page on speed and accuracy: its sentences follow from its data, its data from the code."""

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
    """For each accuracy compare the fastest methods, and the quoted range of time ratios."""
    rows, ratios = POINTS[POINTS.microseconds > 0.0].sort_values("microseconds"), []
    for limit in (1e-3, 1e-6, 1e-9, 1e-12):
        for _, accurate_rows in rows[rows.state_error <= 1.001 * limit].groupby("problem"):
            is_other = accurate_rows.line.str.startswith(("scipy", "heyoka"))
            assert accurate_rows.line.iloc[0] in ("exact", "taylor")
            if is_other.any():
                assert accurate_rows[is_other].line.iloc[0] == "heyoka"
                ratios.append(
                    accurate_rows[is_other].microseconds.iloc[0]
                    / accurate_rows.microseconds.iloc[0]
                )
    assert f"{min(ratios):.0f} to {max(ratios):.0f} times" in PAGE.read_text(encoding="utf-8")


def test_event_locating_methods_stay_exact_and_fixed_steps_lose_their_order():
    for method in ("exact", "taylor", "heyoka"):
        assert {*FAILURES[method]} <= {"right", "refused"}
    # Contact events inside steps reduce the order of rk4 from 4 to 1.
    rk4 = POINTS[(POINTS.line == "rk4") & (POINTS.problem == "bouncing")]
    order, _ = np.polyfit(np.log(rk4.evaluations), -np.log(rk4.state_error), 1)
    assert order == pytest.approx(1.0, abs=0.3)


def test_listed_problems_and_methods_match_the_code():
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
    with xr.open_dataset(GOLDEN / "failures.nc") as golden:
        meanings = golden.verdict.attrs["flag_meanings"].split()
        codes = golden.verdict.sel(trial="exact").values
    assert [*FAILURES.exact] == [meanings[int(k)] for k in codes]


@pytest.mark.parametrize("scene", SETTINGS.scenes)
def test_the_table_of_models_matches_golden_data(scene):
    with xr.open_dataset(GOLDEN / f"models/{scene}.nc") as golden:
        chosen = golden.chosen.item()
    rows = MODELS[(MODELS.scene == scene) & (MODELS.chosen == "yes")]
    assert [*rows.model] == [chosen]
