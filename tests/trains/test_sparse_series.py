"""Trains of many meshes that lose contact one by one: power series agree with modes."""

from typing import NamedTuple

import numpy as np
import pytest

import gearlib
from gearlib.engines import orbit
from gearlib.engines.linear import sparse_series
from gearlib.engines.linear.periods import EVENT_COLUMNS
from gearlib.engines.linear.record import SUMMARY_COLUMNS
from tests.trains.random_trains import random_problem

#: Phases of the planets differ, so that hardly two meshes part at once.
EIGHT = gearlib.planetary(planets=8, teeth=(73, 271), stiffness_ratio=(0.7, 0.7))
#: Mesh frequency of tuning 1, Hz.
UNIT = EIGHT.reference_angular_frequency / (2.0 * np.pi)


class Motion(NamedTuple):
    """Results of a run."""

    state: np.ndarray  #: final state
    samples: np.ndarray
    events: np.ndarray
    summary: np.ndarray
    maps: np.ndarray
    modal_combinations: int  #: combinations of contacts whose modes were computed


#: Costs of modes at which they are computed always, or wherever the series can be used, never.
ALWAYS, NEVER = 0, 10**9


def motion(train, tuning, state, mode_cost, periods=2):
    """Return the `Motion` over some mesh periods with a cost of modes."""
    propagator = train.propagator(tuning)
    tables = propagator.take_tables()
    tables.mode_cost[0] = mode_cost
    propagator.unused_tables[:] = [(propagator.system, tables)]
    z, size = np.array(state), train.size
    raw, events = propagator.empty_raw_samples(50 * periods), np.empty((4, EVENT_COLUMNS))
    summary, maps = np.empty((len(train.meshes), SUMMARY_COLUMNS)), np.empty((periods, size, size))
    spans = periods, periods
    _, events, count, status, *_ = propagator.run_system(
        z, raw, events, 10**5, summary, spans, maps
    )
    assert status == 0
    tables = (propagator.unused_large_tables or propagator.unused_tables).pop()[1]
    propagator.unused_tables.clear()
    return Motion(z, raw, events[:count], summary, maps, int(tables.combination_count[0]))


def assert_equal_to_rounding(series, modes):
    """Assert that two motions differ by rounding only."""
    assert len(series.events) == len(modes.events)
    for k in range(EVENT_COLUMNS):
        atol = 1e-11 if k == orbit.EVENT_PHASE else 1e-10
        np.testing.assert_allclose(series.events[:, k], modes.events[:, k], rtol=0, atol=atol)
    for name in ("state", "samples", "summary"):
        values, expected = getattr(series, name), getattr(modes, name)
        np.testing.assert_allclose(values, expected, rtol=0, atol=1e-11)
    atol = 1e-11 * np.abs(modes.maps).max()
    np.testing.assert_allclose(series.maps, modes.maps, rtol=0, atol=atol)


def test_the_series_propagates_a_train_of_many_planets_as_its_modes_do():
    tuning = 1900.0 / UNIT
    # From this state all planets leave contact, each at its own time.
    state, n = np.array(EIGHT.start_state("static")), EIGHT.size // 2
    state[:n] += 2.0 * np.sin(1.7 * np.arange(n))
    series, modes = (motion(EIGHT, tuning, state, cost) for cost in (NEVER, ALWAYS))
    assert series.modal_combinations == 0 and modes.modal_combinations > 20
    assert len(modes.events) > 60
    assert_equal_to_rounding(series, modes)


@pytest.mark.parametrize("seed", range(4))
def test_the_series_propagates_random_trains_as_their_modes_do(seed, monkeypatch):
    # Trains with friction, deviations, run-out, narrow and infinite backlashes; few of many meshes.
    train, tuning, state = random_problem(np.random.default_rng(seed))
    modes = motion(train, tuning, state, ALWAYS)
    monkeypatch.setattr(sparse_series, "_MIN_SERIES_COMPONENTS", 0)
    series = motion(train, tuning, state, NEVER)
    assert series.modal_combinations == 0
    assert_equal_to_rounding(series, modes)
