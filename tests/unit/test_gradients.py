"""Verdicts on ways to differentiate: the rules, ours on difficult problems, the columns."""

import math
from typing import get_args

import numpy as np
import pytest

from gearlib.config.trials import Way
from gearlib.figures import failures_figure as figure
from gearlib.studies.trials import difficult_problems, gradients
from gearlib.studies.trials.gradients import PROBLEMS, VERDICTS, decide

EXPECTED = np.array([[1.0, 2.0], [0.1, 0.0]])


@pytest.mark.parametrize(
    ("change", "expected"),
    # Velocities count nu = 0.5 times; each derivative over its own size, 1 and 0.1.
    [
        ([[0.9e-4, 1.8e-4], [0.9e-5, 0.0]], "right"),
        ([[0.0, 0.0], [1.1e-5, 0.0]], "inaccurate"),
        ([[0.0, 0.0], [0.0, 0.03]], "silently_wrong"),
        ([[0.0, 0.0], [math.nan, 0.0]], "said_so"),
    ],
)
def test_rules(change, expected):
    assert decide(EXPECTED + np.array(change), EXPECTED, 0.5)[0] == expected


def test_problems_are_of_a_pair_and_differ_on_both_sides():
    known = difficult_problems.problems()
    assert len(PROBLEMS) == 10
    for name in PROBLEMS:
        pair = known[name].model
        assert 1.0 < pair.contact_ratio < 2.0
        assert all(gradients._value(known[name], p) > 0.0 for p in gradients.parameters(pair))


@pytest.fixture(scope="module")
def data():
    return gradients.compute(["exact", "smoothed"], ["graze_past_6", "double_crossing"])


def test_ours_is_right_where_smoothing_is_not(data):
    found = [[VERDICTS[int(code)] for code in row] for row in data.verdict.values]
    assert found == [["right", "inaccurate"], ["right", "silently_wrong"]]
    # That of the judge, rounding over its step.
    assert float(data.error.sel(way="exact").max()) < 1e-5


def test_every_way_of_the_configuration_is_known():
    known = {"exact", *gradients._DIFFERENCES, *gradients._PEERS}
    assert known == set(get_args(Way))
    assert set(figure._GRADIENTS) == set(VERDICTS)
