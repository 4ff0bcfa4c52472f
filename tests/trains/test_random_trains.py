"""Random trains, exact against scipy split at events: no event missed, states to 1e-9.

``GEARLIB_TRAINS=500`` takes so many in place of a few: ten minutes.
"""

import os
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import gearlib
from tests.paper import PAPER
from tests.trains.against_scipy import by_heyoka, compare
from tests.trains.reference import Reference

COUNT = int(os.environ.get("GEARLIB_TRAINS", "16"))
#: Of the first 500 the one in which the reference has lost digits: 1.2e-9 behind a grazing touch.
ARBITRATED = (418,)


def test_a_deviation_through_a_change_of_contact():
    """The smallest train with harmonics that has an event."""
    train = gearlib.idler(PAPER.replace(material_damping=3000.0))
    wave = gearlib.Harmonics((1e-6,), ())
    train = train.replace(meshes=[replace(mesh, deviation=wave) for mesh in train.meshes])
    end, events = Reference(train, 0.9).run(np.zeros(train.size), 1)
    run = gearlib.simulate(train, 0.9, periods=1)
    assert run.event.size == len(events) == 2
    found = run.final_state.values * np.repeat([1.0, 0.9], train.size // 2)
    # Tolerances of the reference, 1e-12, over one period; with the fault 5e-5.
    np.testing.assert_allclose(found, end, rtol=0.0, atol=1e-10)


def test_a_ring_drives_planets_that_run_out():
    """Phases of drawn teeth on both sides, run-out of carried gears, wheels that drive."""
    train = gearlib.planetary(
        planets=2, teeth=(28, 98), driving="ring", stiffness_ratio=(0.6, 0.6), load=400.0
    )
    run_out = {"eccentricity": 3e-5, "eccentricity_phase": 0.7, "offset": (2e-6, 3e-6)}
    bodies = [
        replace(body, **run_out) if body.name in ("ring", "planet 2") else body
        for body in train.bodies
    ]
    flank = {"friction": (0.05, 0.03), "pitch_phase": 1.4, "tooth_thickness": (0.53, 0.45)}
    flank |= {"backlash": 4e-6}
    train = train.replace(bodies=bodies, meshes=[replace(m, **flank) for m in train.meshes])
    end, events = Reference(train, 3.0).run(train.start_state("static"), 4)
    run = gearlib.simulate(train, 3.0, periods=4, record_periods=4, initial_state="static")
    assert run.event.size == len(events) > 5 and set(run.event_to.values) == {-1, 0, 1}
    found = run.final_state.values * np.repeat([1.0, 3.0], train.size // 2)
    np.testing.assert_allclose(found, end, rtol=0.0, atol=1e-11 * np.abs(end).max())


@cache
def compared(seed):
    return compare(seed)


@pytest.mark.parametrize("seed", range(COUNT))
def test_no_event_of_a_random_train_is_missed(seed):
    one = compared(seed)
    if not one.right and seed in ARBITRATED:
        pytest.importorskip("heyoka")
        assert by_heyoka(seed) < 1e-11
        return
    assert one.right, one
    # Times of events near grazing have half of the digits of the state.
    assert one.missed or one.apart < 1e-5


def test_some_of_them_graze_and_some_have_events_at_once():
    found = [compared(seed) for seed in range(16)]
    assert sum(one.together < 1e-11 for one in found) >= 2
    assert sum(one.shortest < 0.02 for one in found if one.kind == "grazing") >= 1
