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


def test_settled_motions_are_the_periodic_orbit_and_not_a_late_transient():
    (result,) = many_starts.motions_from_equilibrium(TRAIN, [1.2], SETTINGS)
    assert result.settled and (result.period == TRAIN.repeats).all()
    orbit = periodic_orbit(TRAIN, 1.2, guess=result.state[0], period=TRAIN.repeats)
    exact = simulate(TRAIN, 1.2, periods=12, record_periods=12, initial_state=tuple(orbit.state))
    every = many_starts.summarise(TRAIN, [result], SETTINGS, ["dynamic_factor"])
    for start in range(5):
        ours = every.dynamic_factor.isel(start=start, tuning=0)
        np.testing.assert_allclose(ours, exact.dynamic_factor, rtol=1e-11)
    assert float(every.settled_share[0]) == float(every.largest_share[0]) == 1.0


def test_motions_that_part_are_told_by_their_range():
    # Where branches that move alike are unstable.
    (result,) = many_starts.motions_from_equilibrium(TRAIN, [1.6], SETTINGS)
    every = many_starts.summarise(TRAIN, [result], SETTINGS, ["dynamic_factor"])
    assert not result.settled and int(every.settled[0]) == 0 and int(every.period[0]) == 0
    assert (result.orbit < 0).any() and not result.period[result.orbit < 0].any()
    low, high = (
        many_starts.ranges_over_starts(every, ["dynamic_factor"])[f"dynamic_factor_{end}"].values
        for end in ("low", "high")
    )
    assert (high > 1.1 * low).all()


def test_shares_are_those_of_the_motions_that_starts_lead_to():
    # Between the jumps of k1 one motion keeps contact, another loses it.
    keeps = simulate(PAIR, 0.80, periods=400, record_periods=1)
    loses = simulate(PAIR, 0.82, periods=400, record_periods=1)
    assert float(keeps.fraction_normal) == 1.0 > float(loses.fraction_normal)
    low, high = keeps.final_state.values, loses.final_state.values
    states = np.array([low, high, low, low])
    result = many_starts.final_motions(PAIR, 0.81, states, SETTINGS | {"first_starts": 4})
    every = many_starts.summarise(PAIR, [result], SETTINGS, ["displacement_max"])
    assert result.orbit.tolist() == [0, 1, 0, 0]
    assert float(every.largest_share[0]) == 0.75 and int(every.motion_count[0]) == 2
    assert float(every.settled_share[0]) == 1.0 and int(every.settled[0]) == 0
    # On the boundary of the basins, to rounding, the start alone decides: that counts as neither.
    for _ in range(60):
        middle = 0.5 * (low + high)
        leads = many_starts.final_motions(
            PAIR, 0.81, [keeps.final_state.values, middle], SETTINGS
        ).orbit[1]
        low, high = (middle, high) if leads == 0 else (low, middle)
    at_it = many_starts.final_motions(
        PAIR, 0.81, [*states[:2], low], SETTINGS | {"first_starts": 3}
    )
    assert at_it.orbit.tolist() == [0, 1, -1] and at_it.period[2] == 0
