"""Trains of many meshes that part one after the other: the series in place of modes, and modes."""

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


def parted(train, size=2.0):
    """Return a state that all planets leave contact from, each at its own time."""
    state, n = np.array(train.start_state("static")), train.size // 2
    state[:n] += size * np.sin(1.7 * np.arange(n))
    return state


def motion(train, tuning, state, price, periods=2):
    """Return (state, samples, events, summary, maps, combinations with modes)."""
    propagator = train.propagator(tuning)
    tables = propagator.take_tables()
    tables.mode_cost[0] = price
    propagator.unused_tables[:] = [(propagator.system, tables)]
    z, size = np.array(state), train.size
    raw, events = propagator.empty_raw_samples(50 * periods), np.empty((4, EVENT_COLUMNS))
    summary, maps = np.empty((len(train.meshes), SUMMARY_COLUMNS)), np.empty((periods, size, size))
    spans = periods, periods
    done = propagator.run_system(z, raw, events, 10**5, summary, spans, maps)
    assert done[3] == 0
    tables = (propagator.unused_large_tables or propagator.unused_tables).pop()[1]
    propagator.unused_tables.clear()
    return z, raw, done[1][: done[2]], summary, maps, int(tables.combination_count[0])


def assert_same(one, other):
    """Assert that two motions are the same but for rounding."""
    assert len(one[2]) == len(other[2])
    columns = [k for k in range(EVENT_COLUMNS) if k != orbit.EVENT_PHASE]
    np.testing.assert_allclose(
        one[2][:, orbit.EVENT_PHASE], other[2][:, orbit.EVENT_PHASE], rtol=0, atol=1e-11
    )
    np.testing.assert_allclose(one[2][:, columns], other[2][:, columns], rtol=0, atol=1e-10)
    for k in (0, 1, 3):
        np.testing.assert_allclose(one[k], other[k], rtol=0, atol=1e-11)
    size = np.abs(other[4]).max()
    np.testing.assert_allclose(one[4], other[4], rtol=0, atol=1e-11 * size)


def test_many_planets_part_by_the_series_as_by_their_modes():
    tuning = 1900.0 / UNIT
    state = parted(EIGHT)
    series, modes = (motion(EIGHT, tuning, state, price) for price in (10**9, 0))
    assert series[5] == 0 and modes[5] > 20 and len(modes[2]) > 60
    assert_same(series, modes)


@pytest.mark.parametrize("seed", range(4))
def test_random_trains_go_by_the_series_as_by_their_modes(seed, monkeypatch):
    # Friction, deviations, run-out, narrow and infinite backlashes; few of them have many meshes.
    train, tuning, state = random_problem(np.random.default_rng(seed))
    modes = motion(train, tuning, state, 0)
    monkeypatch.setattr(sparse_series, "_MIN_SERIES_COMPONENTS", 0)
    series = motion(train, tuning, state, 10**9)
    assert series[5] == 0
    assert_same(series, modes)
