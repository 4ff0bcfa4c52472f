"""Trains of many meshes that lose contact one by one: power series against modes."""

import numpy as np
import pytest

import gearlib
from gearlib.engines import orbit
from gearlib.engines.linear import sparse_series
from gearlib.engines.linear.periods import EVENT_COLUMNS
from tests.trains.random_trains import random_problem

#: Mode costs with which the engine always, or never, computes modes instead of power series.
ALWAYS_USE_MODES, NEVER_USE_MODES = 0, 10**9


def run_with_mode_cost(train, tuning, state, mode_cost, periods=2):
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


def eight_planet_problem():
    """Return (train, tuning, state) of eight planets that lose contact at different times."""
    train = gearlib.planetary(planets=8, teeth=(73, 271), stiffness_ratio=(0.7, 0.7))
    state, n = np.array(train.start_state("static")), train.size // 2
    state[:n] += 2.0 * np.sin(1.7 * np.arange(n))
    return train, 1900.0 * 2.0 * np.pi / train.reference_angular_frequency, state


@pytest.mark.parametrize("seed", [None, *range(4)])
def test_motion_by_power_series_matches_motion_by_modes(seed, monkeypatch):
    """Compare states, samples, events and maps by the series with those by modes."""
    # Random trains cover friction, deviations, run-out, narrow and infinite backlash, but they have
    # so few meshes that the engine would use modes.
    if seed is not None:
        monkeypatch.setattr(sparse_series, "_MIN_SERIES_COMPONENTS", 0)
    problem = (
        eight_planet_problem() if seed is None else random_problem(np.random.default_rng(seed))
    )
    results, events, maps, count = run_with_mode_cost(*problem, NEVER_USE_MODES)
    mode_results, mode_events, mode_maps, mode_count = run_with_mode_cost(
        *problem, ALWAYS_USE_MODES
    )
    assert count == 0 < mode_count
    if seed is None:
        assert mode_count > 20 and len(events) > 60
    assert len(events) == len(mode_events)
    atol = np.where(np.arange(EVENT_COLUMNS) == orbit.EVENT_PHASE, 1e-11, 1e-10)
    assert (np.abs(events - mode_events) <= atol).all()
    for series_values, mode_values in zip(results, mode_results, strict=True):
        np.testing.assert_allclose(series_values, mode_values, rtol=0, atol=1e-11)
    np.testing.assert_allclose(maps, mode_maps, rtol=0, atol=1e-11 * np.abs(mode_maps).max())
