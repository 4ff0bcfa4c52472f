"""Derivatives of long runs: what repeats is carried by one map, whatever is recorded."""

import numpy as np
import pytest

from gearlib import OneDegreePair, simulate
from gearlib.models.propagators.record import Record
from gearlib.models.propagators.tangents import _OFTEN, Walk
from tests.properties.known_models import DAMPED

MODEL = OneDegreePair(pair=DAMPED)
LIMIT = 10_000


def walked(tuning, start, periods, monkeypatch):
    """Return the walk over so many periods, unrecorded, and (span, by a map or not) of its ways."""
    ways = []
    by_map = Walk._by_map

    def noted(self, span):
        ways.append((span, by_map(self, span)))
        return ways[-1][1]

    monkeypatch.setattr(Walk, "_by_map", noted)
    propagator = MODEL.propagator(tuning)
    along = propagator.directions(MODEL, ["contact_ratio", "damping_ratio"])
    walk, code = propagator._walk(np.array(start), along, np.zeros((2, 2)), periods, LIMIT)
    assert code == 0
    for i in range(periods):
        walk._through(i)
    return walk, ways


def test_segments_without_events_go_by_maps(monkeypatch):
    # Its contact lasts: three segments a period, of which the middle one takes two steps.
    walk, ways = walked(1.9, (1.0, 0.0), 60, monkeypatch)
    assert len(walk.motion.events) == 0
    assert len(walk._maps) <= 4 and all(isinstance(one, tuple) for one in walk._maps.values())
    slow = [by_map for _, by_map in ways].count(False)
    assert slow == len(walk._maps) * (_OFTEN + 1) < len(ways) - slow


def test_no_map_is_kept_for_the_ways_from_and_to_events(monkeypatch):
    walk, ways = walked(0.9, (0.5, -6.0), 60, monkeypatch)
    assert len(walk.motion.events) > 60
    starts = walk.varied.cuts(0)
    # Whole segments and whole steps, in contact and in the backlash.
    assert len({span for span, _ in ways}) <= 2 * len(starts)
    assert any(by_map for _, by_map in ways)


@pytest.mark.parametrize("tuning", [1.9, 2.3, 3.1])
def test_a_record_has_the_steps_of_the_kernels(tuning, monkeypatch):
    added = []
    monkeypatch.setattr(Record, "add", lambda self, *piece: added.append(piece))
    propagator = MODEL.propagator(tuning)
    along = propagator.directions(MODEL, ["damping_ratio"])
    start = np.array([1.0, 0.0])
    walk, _ = propagator._walk(start, along, np.zeros((2, 1)), 7, LIMIT)
    assert len(walk.motion.events) == 0
    walk.go(record_from=2)
    assert len(added) == 5 * propagator.pieces


@pytest.mark.parametrize("start", [(1.0, 0.0), (0.5, -6.0)])
def test_derivatives_do_not_ask_how_much_is_recorded(start):
    names = ("contact_ratio", "damping_ratio", "initial_displacement")
    runs = [
        simulate(
            MODEL, 0.9, periods=14, record_periods=record, initial_state=start,
            samples_per_period=16, sensitivities=names,
        )
        for record in (14, 1)
    ]  # fmt: skip
    for name in names:
        for variable in ("displacement", "velocity", "dynamic_force"):
            long, short = (run[f"d_{variable}_d_{name}"].values for run in runs)
            assert len(long) == 14 * len(short)
            # Roundings of two ways over the same periods.
            scale = np.abs(short).max()
            np.testing.assert_allclose(long[-len(short) :], short, rtol=0, atol=1e-10 * scale)
