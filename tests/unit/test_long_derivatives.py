"""Derivatives of long runs, and in whatever basis arcs are taken through."""

import numpy as np
import pytest

from gearlib import OneDegreePair, planetary, simulate
from gearlib.models.propagators import slope_bases
from gearlib.models.propagators.tangents import Walk
from tests.physics.test_sensitivities import DAMPED

MODEL = OneDegreePair(pair=DAMPED)
NAMES = ("contact_ratio", "damping_ratio", "initial_displacement")


@pytest.mark.parametrize("start", [(1.0, 0.0), (0.5, -6.0)])
def test_derivatives_do_not_ask_how_much_is_recorded(start):
    runs = [
        simulate(
            MODEL, 0.9, periods=14, record_periods=record, initial_state=start,
            samples_per_period=16, sensitivities=NAMES,
        )
        for record in (14, 1)
    ]  # fmt: skip
    for name in NAMES:
        for variable in ("displacement", "velocity", "dynamic_force"):
            long, short = (run[f"d_{variable}_d_{name}"].values for run in runs)
            assert len(long) == 14 * len(short)
            # Roundings of two ways over the same periods.
            scale = np.abs(short).max()
            np.testing.assert_allclose(long[-len(short) :], short, rtol=0, atol=1e-10 * scale)


def walk(model, tuning, start, names, periods):
    """Return a walk through so many periods that has not begun."""
    propagator = model.propagator(tuning)
    along = propagator.directions(model, names)
    tangents = propagator.start_tangents(start, along)
    return propagator._walk(propagator.start(start), along, tangents, periods, 10_000)[0]


def test_what_repeats_is_taken_by_one_map():
    walks = [walk(MODEL, 0.9, (0.5, -6.0), NAMES, 400) for _ in range(2)]
    first, repeat = walks[0]._settled(400)
    assert 0 < first < 380 and repeat == 1
    walks[0].go()
    for i in range(400):
        walks[1]._through(i, i + 1)
    one, other = (own.tangents for own in walks)
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-12 * np.abs(other).max())


@pytest.mark.parametrize("near", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize(
    ("model", "tuning", "start", "names"),
    [
        (MODEL, 0.9, (0.5, -6.0), NAMES),
        (
            planetary(stiffness_ratio=(0.7, 0.7), reference_frequency=1475.7),
            1.0,
            "static",
            ("contact_ratio", "inertia of body sun", "backlash_damping"),
        ),
    ],
)
def test_blocks_of_any_size(model, tuning, start, names, near, monkeypatch):
    """One block for all, or as many as there are eigenvalues, says the same."""
    own = walk(model, tuning, start, names, 3)
    own.go()
    monkeypatch.setattr(slope_bases, "_NEAR", near)
    monkeypatch.setattr(slope_bases, "_CONDITION", 1e12)
    other: Walk = walk(model, tuning, start, names, 3)
    other.go()
    if near == 1e3:
        assert other._bases.blocks[0].max() == len(own.block[0])
    size = np.abs(own.tangents).max(axis=0)
    np.testing.assert_allclose(other.tangents / size, own.tangents / size, rtol=0, atol=1e-10)


def test_periods_without_events_are_taken_by_one_map(monkeypatch):
    model = planetary(stiffness_ratio=(0.7, 0.7), reference_frequency=1475.7)
    names = ("contact_ratio", "load", "inertia of body sun")
    walks = [walk(model, 1.3, "static", names, 160) for _ in range(2)]
    maps = []
    by_map = Walk._by_map
    monkeypatch.setattr(Walk, "_by_map", lambda *given: maps.append(given[2:]) or by_map(*given))
    walks[0].go()
    walks[1]._through(0, 160)
    assert maps == [(1, 159)]
    one, other = (own.tangents for own in walks)
    size = np.abs(other).max(axis=0)
    np.testing.assert_allclose(one / size, other / size, rtol=0, atol=1e-9)
