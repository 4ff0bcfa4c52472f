"""Motions from many starts: what all of them share, and what they do not."""

import numpy as np

from gearlib import GearPair, periodic_orbit, simulate
from gearlib.config import load
from gearlib.studies import many_starts, trains
from tests.paper import CONFIG as PROJECT

SETTINGS = {"periods": 120, "record_periods": 12, "starts": 5, "first_starts": 2, "seed": 3}
SETTINGS |= {"spread": 0.02}
CONFIG = load(PROJECT)
PAIR = GearPair(**CONFIG.pair_parameters(CONFIG.reducer.damping))
TRAIN = trains.reducer_train(PAIR, CONFIG.reducer.model_dump())


def test_settled_motions_are_the_periodic_orbit():
    (result,) = many_starts.motions_from_equilibrium(TRAIN, [1.2], SETTINGS)
    assert result.settled and (result.period == TRAIN.repeats).all()
    orbit = periodic_orbit(TRAIN, 1.2, guess=result.state[0], period=TRAIN.repeats)
    exact = simulate(TRAIN, 1.2, periods=12, record_periods=12, initial_state=tuple(orbit.state))
    summary = many_starts.summarise(TRAIN, [result], SETTINGS, ["dynamic_factor"])
    for start in range(5):
        ours = summary.dynamic_factor.isel(start=start, tuning=0)
        np.testing.assert_allclose(ours, exact.dynamic_factor, rtol=1e-11)
    assert float(summary.settled_share[0]) == float(summary.largest_share[0]) == 1.0


def test_motions_that_do_not_settle_are_summarised_by_a_range():
    # At this tuning motions in which all branches of the train move alike are unstable.
    (result,) = many_starts.motions_from_equilibrium(TRAIN, [1.6], SETTINGS)
    summary = many_starts.summarise(TRAIN, [result], SETTINGS, ["dynamic_factor"])
    assert not result.settled and int(summary.settled[0]) == 0 and int(summary.period[0]) == 0
    # The orbit -1 stands for a motion that has not settled.
    unsettled = result.orbit < 0
    assert unsettled.any() and not result.period[unsettled].any()
    low, high = (
        many_starts.ranges_over_starts(summary, ["dynamic_factor"])[f"dynamic_factor_{end}"].values
        for end in ("low", "high")
    )
    assert (high > 1.1 * low).all()


def test_shares_of_motions_are_those_of_the_starts_that_lead_to_them():
    # Between the two jumps of the main resonance one motion keeps contact, another loses it.
    keeps = simulate(PAIR, 0.80, periods=400, record_periods=1)
    loses = simulate(PAIR, 0.82, periods=400, record_periods=1)
    assert float(keeps.fraction_normal) == 1.0 > float(loses.fraction_normal)
    low, high = keeps.final_state.values, loses.final_state.values
    states = np.array([low, high, low, low])
    result = many_starts.final_motions(PAIR, 0.81, states, SETTINGS | {"first_starts": 4})
    summary = many_starts.summarise(PAIR, [result], SETTINGS, ["displacement_max"])
    assert result.orbit.tolist() == [0, 1, 0, 0]
    assert float(summary.largest_share[0]) == 0.75 and int(summary.motion_count[0]) == 2
    assert float(summary.settled_share[0]) == 1.0 and int(summary.settled[0]) == 0
    # On the boundary of the basins, to rounding, the start alone decides: that counts as neither.
    for _ in range(60):
        middle = 0.5 * (low + high)
        motions = many_starts.final_motions(PAIR, 0.81, [states[0], middle], SETTINGS)
        low, high = (middle, high) if motions.orbit[1] == 0 else (low, middle)
    starts = [*states[:2], low]
    result = many_starts.final_motions(PAIR, 0.81, starts, SETTINGS | {"first_starts": 3})
    assert result.orbit.tolist() == [0, 1, -1] and result.period[2] == 0
