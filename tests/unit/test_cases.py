"""Several cases of the configuration side by side."""

import copy
from pathlib import Path

import pytest
import yaml

from gearlib.config import ConfigError, cases, load

PAPER = yaml.safe_load(Path("config.yaml").read_text(encoding="utf-8"))


def test_each_case_lays_its_keys_over_the_others():
    found = cases(PAPER | {"cases": {"plain": {}, "heavy": {"gear_pair": {"load": "6 kN"}}}})
    assert load(found["plain"]) == load(PAPER)
    heavy = load(found["heavy"])
    assert heavy.gear_pair.load == 6000.0
    assert heavy.gear_pair.backlash == load(PAPER).gear_pair.backlash
    assert heavy.figures == load(PAPER).figures


@pytest.mark.parametrize(
    ("given", "fault"),
    [
        ({}, "cases = {} is not allowed: it must be"),
        ("one", "cases = 'one' is not allowed: it must be"),
        ({"a b": {}}, "cases.a b is not allowed as a name: it must be"),
        ({"a": 3}, "cases.a = 3 is not allowed: it must be"),
        ({"a": {"gear_pair": {"load": -1}}}, "cases.a: gear_pair.load = -1 is not allowed"),
        ({"a": {"geers": {}}}, "cases.a: geers = {} is not a known key"),
    ],
)
def test_a_wrong_case_is_refused(given, fault):
    with pytest.raises(ConfigError) as refusal:
        cases(copy.deepcopy(PAPER) | {"cases": given})
    (sentence,) = str(refusal.value).splitlines()
    assert sentence.startswith(fault)
