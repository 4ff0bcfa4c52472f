"""Whole periods follow the orbit of events one by one: thousands of random meshes and states."""

import math

import numpy as np
import pytest

from gearlib.engines.jit import kernel
from gearlib.engines.orbit import orbit_period
from gearlib.engines.pair.events import ARC_COLUMNS, march_period
from gearlib.engines.pair.motion import contact_of, mesh_at_tuning
from gearlib.engines.pair.stiffness import segment_lengths, stiffness_levels
from gearlib.engines.pair.whole_periods import advance_periods, new_work, set_mesh, set_start

MAX_ARCS = 10**6


def ratios_of(contact_ratio, stiffness_ratio, damping, backlash_damping, backlash):
    """Return stiffness levels, segment lengths, both damping ratios and the backlash ratio."""
    stiffness = *stiffness_levels(contact_ratio, stiffness_ratio), *segment_lengths(contact_ratio)
    return np.array([*stiffness, damping, backlash_damping, backlash])


def random_case(rng):
    """Return (ratios, tuning, x, v) over all regimes, exact special values included."""

    def choose(usual, *special):
        return rng.choice(special) if rng.random() < 0.2 else usual

    contact_ratio = choose(rng.uniform(1.0, 2.0), 1.0, 2.0, 1.569)
    stiffness_ratio = choose(rng.uniform(0.05, 1.0), 1.0, 0.5879, 1e-3)
    damping = choose(10 ** rng.uniform(-3, 0.5), 0.0, 0.0617, 1.0)
    backlash_damping = choose(10 ** rng.uniform(-3, 0.5), 0.0, 0.0617)
    gap = choose(10 ** rng.uniform(-2, 1), 0.0, 4.0, math.inf)
    tuning = choose(10 ** rng.uniform(-1.2, 0.5), 50.0, 0.01)
    x = choose(rng.uniform(-6.0, 4.0), 0.0, -gap if math.isfinite(gap) else 0.0)
    v = choose(rng.uniform(-3.0, 3.0), 0.0)
    ratios = ratios_of(contact_ratio, stiffness_ratio, damping, backlash_damping, gap)
    return ratios, tuning, x, v


def bouncing_case(rng):
    """Return (ratios, tuning, x, v) of a motion with bounces: light damping, near resonance."""
    damping, backlash_damping = 10 ** rng.uniform(-4, -1, 2) * (rng.random(2) < 0.8)
    gap = rng.choice([2.0, 4.0, 20.0, math.inf])
    contact_ratio, stiffness_ratio = rng.uniform(1.05, 1.95), rng.uniform(0.2, 0.95)
    ratios = ratios_of(contact_ratio, stiffness_ratio, damping, backlash_damping, gap)
    return ratios, rng.uniform(0.4, 1.4), rng.uniform(-1.0, 2.0), rng.uniform(-1.0, 1.0)


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


def error_of_whole_periods(mesh, x, v, periods):
    """Return the error of `whole_periods` against `event_by_event`, 0 where rounding grows."""
    _, *end, arcs = whole_periods(mesh, x, v, periods)
    _, *exact = event_by_event(mesh, x, v, periods)
    assert arcs <= MAX_ARCS
    # What rounding alone does to this orbit: the run event by event from starts moved by one part
    # in 1e13, a thousand roundings. Chaotic and undamped orbits amplify it by any factor.
    spread = 0.0
    for dx, dv in ((1e-13, 0.0), (-1e-13, 0.0), (0.0, 1e-13)):
        _, *moved = event_by_event(mesh, x + dx * max(1.0, abs(x)), v + dv, periods)
        spread = max(spread, abs(moved[0] - exact[0]) + abs(moved[1] - exact[1]))
    scale = 1.0 + abs(exact[0]) + abs(exact[1])
    error = abs(end[0] - exact[0]) + abs(end[1] - exact[1])
    assert error <= 1e-11 * scale + 10.0 * spread, (mesh, x, v, end, exact)
    return error / scale if spread < 1e-11 else 0.0


@pytest.mark.parametrize("case", [random_case, bouncing_case])
@pytest.mark.parametrize("seed", range(2))
def test_whole_periods_equal_events_one_by_one(case, seed):
    rng = np.random.default_rng(seed)
    for _ in range(2000):
        ratios, tuning, x, v = case(rng)
        assert error_of_whole_periods(mesh_at_tuning(ratios, tuning), x, v, periods=8) < 1e-11


@pytest.mark.parametrize("component", [0, 1])
def test_a_motion_repeats_if_both_displacement_and_velocity_do(component):
    tuning, displacement_range = 0.9, 1.0
    for period in (1, 2, 3, 5, 16):
        strobes = np.zeros((32, 2))  # displacement and velocity once in a mesh period
        strobes[:, component] = np.arange(32) % period
        assert orbit_period(strobes, tuning, displacement_range) == period
        strobes[:, component] += np.arange(32)
        assert orbit_period(strobes, tuning, displacement_range) == 0
