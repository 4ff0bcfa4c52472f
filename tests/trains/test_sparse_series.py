"""Trains of many meshes that lose contact one by one: power series agree with modes."""

import numpy as np
import pytest

import gearlib
from gearlib.engines import orbit
from gearlib.engines.linear import sparse_series
from gearlib.engines.linear.periods import EVENT_COLUMNS
from tests.trains.random_trains import random_problem

#: Costs of modes at which they are computed always, or wherever the series can be used, never.
ALWAYS, NEVER = 0, 10**9


def motion(train, tuning, state, mode_cost, periods=2):
    """Run a train and return (results, events, maps, count of combinations with modes).

    `mode_cost` decides whether the engine computes modes of a combination or integrates by series.
    """
    propagator = train.propagator(tuning)
    tables = propagator.acquire_tables()
    tables.mode_cost[0] = mode_cost
    propagator.unused_tables[:] = [(propagator.system, tables)]
    z, size = np.array(state), train.size
    samples, events = propagator.empty_raw_samples(50 * periods), np.empty((4, EVENT_COLUMNS))
    summary, maps = (
        np.empty((len(train.meshes), orbit.SUMMARY_COLUMNS)),
        np.empty((periods, size, size)),
    )
    spans = periods, periods
    _, events, count, status, *_ = propagator.run_system(
        z, samples, events, 10**5, summary, spans, maps
    )
    assert status == 0
    tables = (propagator.unused_large_tables or propagator.unused_tables).pop()[1]
    propagator.unused_tables.clear()
    return (z, samples, summary), events[:count], maps, int(tables.combination_count[0])


def many_planets():
    """Return (train, tuning, state) in which eight planets lose contact at different times."""
    train = gearlib.planetary(planets=8, teeth=(73, 271), stiffness_ratio=(0.7, 0.7))
    state, n = np.array(train.start_state("static")), train.size // 2
    state[:n] += 2.0 * np.sin(1.7 * np.arange(n))
    return train, 1900.0 * 2.0 * np.pi / train.reference_angular_frequency, state


@pytest.mark.parametrize("seed", [None, *range(4)])
def test_the_series_propagates_a_train_as_the_modes_do(seed, monkeypatch):
    """Compare states, samples, events and maps by the series with those by modes."""
    # Random trains cover friction, deviations, run-out, narrow and infinite backlash, but they have
    # so few meshes that the engine would use modes.
    if seed is not None:
        monkeypatch.setattr(sparse_series, "_MIN_SERIES_COMPONENTS", 0)
    problem = many_planets() if seed is None else random_problem(np.random.default_rng(seed))
    results, events, maps, count = motion(*problem, NEVER)
    mode_results, mode_events, mode_maps, mode_count = motion(*problem, ALWAYS)
    assert count == 0 < mode_count
    if seed is None:
        assert mode_count > 20 and len(events) > 60
    assert len(events) == len(mode_events)
    atol = np.where(np.arange(EVENT_COLUMNS) == orbit.EVENT_PHASE, 1e-11, 1e-10)
    assert (np.abs(events - mode_events) <= atol).all()
    for values, others in zip(results, mode_results, strict=True):
        np.testing.assert_allclose(values, others, rtol=0, atol=1e-11)
    np.testing.assert_allclose(maps, mode_maps, rtol=0, atol=1e-11 * np.abs(mode_maps).max())
