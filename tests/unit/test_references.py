"""Stored references: some of each file computed anew, digit by digit."""

import numpy as np
import pytest

from gearlib import GearPair
from tests.physics import (
    high_precision,
    high_precision_derivatives,
    test_random_meshes,
    test_sensitivities,
)
from tests.references import Stored, key_of, numbers, row_texts, texts
from tests.trains import high_precision_trains, test_sensitivities_of_trains

ACCURACY, RANDOM = Stored("accuracy"), test_random_meshes.REFERENCES


@pytest.mark.parametrize("nu", [0.6, 0.82])
def test_stored_references_of_accuracy_are_those_of_50_digits(nu):
    arguments = (1.569, 0.5879, 0.0, 0.0, 4.0, nu, 20, (0.0, 0.0))
    assert ACCURACY.entries[key_of(arguments)] == texts(high_precision.propagate(*arguments))


def test_stored_references_of_random_meshes_are_those_of_50_digits():
    found = 0
    for seed in range(test_random_meshes.SEEDS):
        ratios, tuning, state = test_random_meshes.random_mesh(np.random.default_rng(seed))
        arguments = (*ratios.values(), tuning, test_random_meshes.PERIODS, state)
        stored = RANDOM.entries.get(key_of(arguments))
        if stored is not None:
            found += 1
            assert stored == texts(high_precision.propagate(*arguments)), arguments
    # Powers may round otherwise on another machine, here and there.
    assert found > test_random_meshes.SEEDS // 2


def test_stored_derivatives_are_those_of_50_digits():
    # No way between the flanks, and over-damped.
    for ratios, tuning, state in test_sensitivities.SPECIAL[2:6:3]:
        pair = GearPair.from_ratios(**dict(zip(test_sensitivities.RATIOS, ratios, strict=True)))
        own = tuple(getattr(pair, name) for name in GearPair.RATIOS)
        arguments = own, tuning, 3, state
        stored = test_sensitivities.REFERENCES.entries[key_of(("of_run", *arguments))]
        assert stored == row_texts(high_precision_derivatives.of_run(*arguments))


def test_stored_derivatives_of_trains_are_those_of_50_digits():
    case = test_sensitivities_of_trains
    arguments = (*case.VALUES, 0.7), 1, case.STRIKING
    stored = case.REFERENCES.entries[key_of(("of_run", *arguments))]
    name = "backlash of mesh pinion-idler"
    row = high_precision_trains.of_one(*arguments, name)
    assert row_texts([row]) == [stored[high_precision_trains.NAMES.index(name)]]


def test_every_case_of_the_random_meshes_is_stored_once():
    assert len(RANDOM.entries) == test_random_meshes.SEEDS * test_random_meshes.CASES_PER_SEED


def test_a_case_that_is_not_stored_is_computed_with_a_warning():
    arguments = (1.5, 0.6, 0.05, 0.05, 3.0, 0.87, 1, (0.1, 0.2))
    with pytest.warns(UserWarning, match="accuracy.json lacks .*: make references"):
        found = ACCURACY.propagate(*arguments)
    expected = high_precision.propagate(*arguments)
    assert found == expected
    # What is kept is right to 20 digits.
    kept = numbers(texts(expected))
    assert abs(kept[0] - expected[0]) < 1e-19 * abs(expected[0])
