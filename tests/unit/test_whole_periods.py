"""Whole periods follow the orbit of events one by one: thousands of random meshes and states."""

import numpy as np
import pytest

from gearlib import GearPair
from gearlib.engines.jit import kernel
from gearlib.engines.orbit import orbit_period
from gearlib.engines.pair.events import ARC_COLUMNS, march_period
from gearlib.engines.pair.motion import contact_of, mesh_at_tuning
from gearlib.engines.pair.propagator import ratios
from gearlib.engines.pair.whole_periods import advance_periods, new_work, set_mesh, set_start
from tests.physics.test_random_meshes import random_mesh

MAX_ARCS = 10**6


@kernel
def event_by_event(mesh, x, v, periods):
    """Return (contact, x, v) after so many mesh periods, propagated from event to event."""
    no_arcs = np.empty((0, ARC_COLUMNS))
    contact = contact_of(mesh.backlash, x, v)
    for _ in range(periods):
        contact, x, v, _ = march_period(mesh, contact, x, v, no_arcs, MAX_ARCS)
    return contact, x, v


@kernel
def whole_periods(mesh, x, v, periods):
    """Return (contact, x, v, arcs in the last period) after mesh periods computed as a whole."""
    work, no_arcs = new_work(), np.empty((0, ARC_COLUMNS))
    set_mesh(work, mesh)
    set_start(work, x, v)
    contact = contact_of(mesh.backlash, x, v)
    return advance_periods(mesh, work, 0, contact, x, v, periods, MAX_ARCS, no_arcs)


@pytest.mark.parametrize("seed", range(2))
def test_whole_periods_equal_events_one_by_one(seed):
    rng, periods = np.random.default_rng(seed), 8
    for _ in range(2000):
        values, tuning, (x, v) = random_mesh(rng)
        mesh = mesh_at_tuning(ratios(GearPair.from_ratios(**values)), tuning)
        _, *end, arcs = whole_periods(mesh, x, v, periods)
        exact = np.array(event_by_event(mesh, x, v, periods)[1:])
        # What rounding alone does to this orbit: the run event by event from starts moved by one
        # part in 1e13, a thousand roundings. Chaotic and undamped orbits amplify it by any factor.
        starts = [(x + dx * max(1.0, abs(x)), v) for dx in (1e-13, -1e-13)] + [(x, v + 1e-13)]
        moved = [event_by_event(mesh, *start, periods)[1:] for start in starts]
        spread = np.abs(moved - exact).sum(axis=1).max()
        allowed = 1e-11 * (1.0 + np.abs(exact).sum()) + (10.0 * spread if spread > 1e-11 else 0.0)
        assert arcs <= MAX_ARCS and np.abs(end - exact).sum() <= allowed, (values, tuning, x, v)


@pytest.mark.parametrize("component", [0, 1])
def test_a_motion_repeats_if_both_displacement_and_velocity_do(component):
    tuning, displacement_range = 0.9, 1.0
    for period in (1, 2, 3, 5, 16):
        strobes = np.zeros((32, 2))  # displacement and velocity once in a mesh period
        strobes[:, component] = np.arange(32) % period
        assert orbit_period(strobes, tuning, displacement_range) == period
        strobes[:, component] += np.arange(32)
        assert orbit_period(strobes, tuning, displacement_range) == 0
