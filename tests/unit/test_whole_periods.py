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

LIMIT = 10**6


def ratios_of(contact_ratio, stiffness_ratio, damping, drag, gap):
    stiffness = *stiffness_levels(contact_ratio, stiffness_ratio), *segment_lengths(contact_ratio)
    return np.array([*stiffness, damping, drag, gap])


def random_case(rng):
    """Return (ratios, tuning, x, v) over all regimes, exact special values included."""

    def choose(usual, *special):
        return rng.choice(special) if rng.random() < 0.2 else usual

    contact_ratio = choose(rng.uniform(1.0, 2.0), 1.0, 2.0, 1.569)
    stiffness_ratio = choose(rng.uniform(0.05, 1.0), 1.0, 0.5879, 1e-3)
    damping = choose(10 ** rng.uniform(-3, 0.5), 0.0, 0.0617, 1.0)
    drag = choose(10 ** rng.uniform(-3, 0.5), 0.0, 0.0617)
    gap = choose(10 ** rng.uniform(-2, 1), 0.0, 4.0, math.inf)
    tuning = choose(10 ** rng.uniform(-1.2, 0.5), 50.0, 0.01)
    x = choose(rng.uniform(-6.0, 4.0), 0.0, -gap if math.isfinite(gap) else 0.0)
    v = choose(rng.uniform(-3.0, 3.0), 0.0)
    return ratios_of(contact_ratio, stiffness_ratio, damping, drag, gap), tuning, x, v


def bouncing_case(rng):
    """Return the same of meshes that bounce: lightly damped, near resonance, room to move."""
    damping, drag = 10 ** rng.uniform(-4, -1, 2) * (rng.random(2) < 0.8)
    gap = rng.choice([2.0, 4.0, 20.0, math.inf])
    ratios = ratios_of(rng.uniform(1.05, 1.95), rng.uniform(0.2, 0.95), damping, drag, gap)
    return ratios, rng.uniform(0.4, 1.4), rng.uniform(-1.0, 2.0), rng.uniform(-1.0, 1.0)


@kernel
def event_by_event(m, x, v, periods):
    """Return (contact, x, v) event by event."""
    no_arcs = np.empty((0, ARC_COLUMNS))
    contact = contact_of(m.backlash, x, v)
    for _ in range(periods):
        contact, x, v, _ = march_period(m, contact, x, v, no_arcs, LIMIT)
    return contact, x, v


@kernel
def whole_periods(m, x, v, periods):
    """Return (contact, x, v) by whole periods."""
    work = new_work()
    set_mesh(work, m)
    set_start(work, x, v)
    return advance_periods(
        m, work, 0, contact_of(m.backlash, x, v), x, v, periods, LIMIT, np.empty((0, ARC_COLUMNS))
    )


def compare(m, x, v, periods):
    """Compare both ways; return the error where rounding stays small, else 0."""
    fast, plain = whole_periods(m, x, v, periods), event_by_event(m, x, v, periods)
    assert fast[3] <= LIMIT
    # What rounding alone does to this orbit: the run event by event from starts moved by one part
    # in 1e13, a thousand roundings. Chaotic and undamped orbits amplify it by any factor.
    spread = 0.0
    for dx, dv in ((1e-13, 0.0), (-1e-13, 0.0), (0.0, 1e-13)):
        moved = event_by_event(m, x + dx * max(1.0, abs(x)), v + dv, periods)
        spread = max(spread, abs(moved[1] - plain[1]) + abs(moved[2] - plain[2]))
    scale = 1.0 + abs(plain[1]) + abs(plain[2])
    error = abs(fast[1] - plain[1]) + abs(fast[2] - plain[2])
    assert error <= 1e-11 * scale + 10.0 * spread, (m, x, v, fast, plain)
    return error / scale if spread < 1e-11 else 0.0


@pytest.mark.parametrize("case", [random_case, bouncing_case])
@pytest.mark.parametrize("seed", range(2))
def test_whole_periods_equal_events_one_by_one(case, seed):
    rng = np.random.default_rng(seed)
    for _ in range(2000):
        ratios, tuning, x, v = case(rng)
        assert compare(mesh_at_tuning(ratios, tuning), x, v, 8) < 1e-11


@pytest.mark.parametrize("component", [0, 1])
def test_a_period_takes_both_components(component):
    for period in (1, 2, 3, 5, 16):
        strobes = np.zeros((32, 2))
        strobes[:, component] = np.arange(32) % period
        assert orbit_period(strobes, 0.9, 1.0) == period
        strobes[:, component] += np.arange(32)
        assert orbit_period(strobes, 0.9, 1.0) == 0
