"""The smallest model that carries a scene: chosen by its changes, not by its name."""

import math

import numpy as np

from gearlib.studies import scenes
from tests.paper import PARAMETERS
from tests.tables import read_back

#: Arguments of `SixDegreePair`.
SIX_DEGREES = {"base_radii": [0.1, 0.1], "inertias": [0.06246] * 2, "masses": [17.27, 17.27]}
SIX_DEGREES |= {"bearing_stiffness": [math.inf] * 4, "bearing_damping": [0.0] * 4}
SIX_DEGREES |= {"eccentricities": [8e-6, 8e-6], "friction": [0.05, 0.05]}
RUN = {"periods": 120, "record_periods": 24, "samples_per_period": 16}


def compare(**run_changes):
    """Compare models of an undamped, chaotic and of a damped motion at a tuning of 0.82."""
    damped = PARAMETERS | {"material_damping": 3953.7, "backlash_damping": 3953.7}
    pairs = {"chaotic": PARAMETERS, "settled": damped}
    cases = [{"title": name, "tuning": 0.82, "pair": pair} for name, pair in pairs.items()]
    criteria = {"observables": ["displacement_max", "bounces"], "tolerance": 0.05}
    criteria["candidates"] = [*scenes.MODELS]
    random_states = {"starts": 4, "seed": 1, "spread": 0.02}
    run, harmonics = RUN | run_changes, 10
    return scenes.compare(cases, criteria, SIX_DEGREES, harmonics, run, random_states)


def test_values_that_rounding_decides_are_labelled_and_left_out_of_tables(tmp_path):
    # A change of the start by 1e-12 changes a chaotic motion. The third model, six_degrees, has
    # friction: its motion settles.
    first, second = compare(), compare(initial_state=(1e-12, -1e-12))
    for comparison in (first, second):
        assert comparison.free_of_rounding.sel(case="chaotic").values.tolist() == [0, 0, 1, 0]
        assert comparison.free_of_rounding.sel(case="settled").values.tolist() == [1] * 4
        assert comparison.change_free_of_rounding.values.tolist() == [0, 0, 1, 0]
    largest = float(abs(first.value).max())
    same = np.isclose(first.value, second.value, rtol=0.0, atol=1e-6 * largest)
    assert same[first.free_of_rounding == 1].all() and not same.all()
    # Chaos differs by more than the tolerance from start to start: no smaller model suffices.
    assert first.chosen.item() == "six_degrees"
    assert (first.change_high > first.change_low)[[0, 1, 3]].all()
    rows = read_back(scenes.rows([first], ["mine"]), tmp_path)
    assert [row["model"] for row in rows] == [*scenes.MODELS, scenes.TRUNCATED_MODEL]
    assert [row["chosen"] for row in rows].count("yes") == 1
    assert [row["change"] for row in rows] == ["differs", "differs", "nan", "differs"]
    assert [row["cost"] == "differs" for row in rows] == [True, True, False, True]
