"""Orbits in lanes are those of the plain march: thousands of random meshes and states."""

import math

import numpy as np
import pytest

from gearlib.core.elementary import cos_sin, decay
from gearlib.core.flight import phi, phi_below_two
from gearlib.core.jit import kernel
from gearlib.core.lanes import (
    COUNT,
    LANDED,
    LANES,
    PHASE,
    SPEED,
    bounce,
    new_lanes,
    set_mesh,
    set_orbit,
)
from gearlib.core.many import next_landing, skip_in_lanes
from gearlib.core.march import ARC_COLUMNS, march_period
from gearlib.core.mesh import contact_of, mesh
from gearlib.stiffness import levels, stretches
from tests.unit.test_transit import LIMIT, random_case


@kernel
def plain_march(ratios, tunings, x0, v0, periods, ends):
    """Fill `ends`, shape (n, 3), by the plain march."""
    no_arcs = np.empty((0, ARC_COLUMNS))
    for j in range(tunings.shape[0]):
        m = mesh(ratios, tunings[j])
        contact, x, v = contact_of(m.gap, x0, v0), x0, v0
        for _ in range(periods):
            contact, x, v, _ = march_period(m, contact, x, v, no_arcs, LIMIT)
        ends[j, 0], ends[j, 1], ends[j, 2] = contact, x, v


def compare(ratios, tunings, x, v, periods):
    """Compare lanes with the plain march; return the worst error where rounding stays small."""
    n = tunings.size
    lanes, plain, moved = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3))
    statuses = np.ones(n, dtype=np.int64)
    states = np.tile([x, v], (n, 1))
    skip_in_lanes(ratios, tunings, np.arange(n), states, periods, LIMIT, lanes, statuses)
    assert not statuses.any()
    plain_march(ratios, tunings, x, v, periods, plain)
    # What rounding alone does to these orbits; see test_transit.
    spread = np.zeros(n)
    for dx, dv in ((1e-13, 0.0), (-1e-13, 0.0), (0.0, 1e-13)):
        plain_march(ratios, tunings, x + dx * max(1.0, abs(x)), v + dv, periods, moved)
        spread = np.maximum(spread, abs(moved[:, 1:] - plain[:, 1:]).sum(axis=1))
    scale = 1.0 + abs(plain[:, 1:]).sum(axis=1)
    error = abs(lanes[:, 1:] - plain[:, 1:]).sum(axis=1)
    wrong = error > 1e-11 * scale + 10.0 * spread
    assert not wrong.any(), (ratios, tunings[wrong], x, v, lanes[wrong], plain[wrong])
    calm = spread < 1e-12
    return (error / scale)[calm].max(initial=0.0)


@pytest.mark.parametrize("seed", range(4))
def test_lanes_equal_plain_march(seed):
    rng = np.random.default_rng(seed)
    for case in range(400):
        ratios, tuning, x, v = random_case(rng)
        if case % 2:
            # Meshes that bounce: lightly damped, near resonance, room in the backlash.
            ratios[4:6] = 10 ** rng.uniform(-4, -1, 2) * (rng.random(2) < 0.8)
            ratios[6] = rng.choice([2.0, 4.0, 20.0, math.inf])
            tuning = rng.uniform(0.4, 1.3)
            x, v = rng.uniform(-1.0, 2.0), rng.uniform(-1.0, 1.0)
        tunings = tuning * (1.0 + np.sort(rng.uniform(0.0, 0.2, 2 * LANES + 3)))
        compare(ratios, tunings, x, v, 20)


def ratios_of(contact_ratio, stiffness_ratio, damping, drag, gap):
    return np.array(
        [*levels(contact_ratio, stiffness_ratio), *stretches(contact_ratio), damping, drag, gap]
    )


@pytest.mark.parametrize("contact_ratio", [1.0, 1.569, 2.0])
@pytest.mark.parametrize("damping", [0.0, 0.0617, 1.0, 1.7])
@pytest.mark.parametrize("gap", [0.0, 1e-9, 0.3, 4.0, math.inf])
def test_special_meshes(contact_ratio, damping, gap):
    tunings = np.linspace(0.5, 1.4, 40)
    for drag in (0.0, 0.0617, 3.0):
        ratios = ratios_of(contact_ratio, 0.5879, damping, drag, gap)
        for x, v in ((0.0, 0.0), (0.0, -0.5), (1.0, 1.0), (-0.2, 0.0)):
            compare(ratios, tunings, x, v, 20)


def test_regular_orbits_to_twelve_digits():
    ratios = ratios_of(1.569, 0.5879, 0.0617, 0.0617, 4.0)
    assert compare(ratios, np.linspace(0.5, 1.4, 901), 0.0, 0.0, 300) < 1e-12


def test_one_bounce_at_a_time():
    # Every landing of every lane against the plain march from the landing before: chaotic orbits
    # cannot hide behind their own spread, nor a wrong event behind damping.
    rng = np.random.default_rng(5)
    landed = tried = 0
    for _ in range(60):
        gap = rng.choice([1.0, 4.0, math.inf])
        damping = rng.choice([0.0, 1e-3, 0.0617])
        ratios = ratios_of(rng.uniform(1.1, 1.9), rng.uniform(0.3, 0.9), damping, damping, gap)
        meshes = [mesh(ratios, tuning) for tuning in rng.uniform(0.5, 1.3, LANES)]
        lanes = new_lanes()
        for i, m in enumerate(meshes):
            set_mesh(lanes, i, m)
            help_lane(lanes, i, m, (0, 0.3, 1, rng.uniform(-0.3, 1.0), rng.uniform(-1.0, 1.0)))
        for _ in range(40):
            before = lanes.copy()
            bounce(lanes, LANES, 10**9)
            for i, m in enumerate(meshes):
                start = int(before[COUNT + i]), before[PHASE + i], 1, 0.0, before[SPEED + i]
                if before[SPEED + i] < 0.0:
                    continue
                tried += 1
                count, phase, speed = lanes[COUNT + i], lanes[PHASE + i], lanes[SPEED + i]
                if (count, phase) == (before[COUNT + i], before[PHASE + i]):
                    help_lane(lanes, i, m, start)
                    continue
                landed += 1
                found, *expected = next_landing(m, *start, start[0] + 9, LIMIT)
                assert found
                period = m.whole_low + 2.0 * m.half_high
                late = (count - expected[0]) * period + phase - expected[1]
                # Leaving slowly, a flank feels rounding as its inverse speed.
                allowed = 1e-13 + 1e-15 / max(1e-9, speed)
                assert abs(late) < allowed and abs(speed - expected[4]) < allowed
    assert tried > landed > 5000


def help_lane(lanes, i, m, start):
    """Put the next landing of the plain march into a lane."""
    found, count, phase, _, _, v, last, _ = next_landing(m, *start, start[0] + 50, LIMIT)
    if found:
        set_orbit(lanes, i, count, phase, v, *last)
    else:
        lanes[SPEED + i] = -1.0


def jump_of_the_next_landing(m, phase):
    """Return the landing speeds, a rounding apart, between which the next landing jumps."""

    def next_time(speed):
        _, count, at, *_ = next_landing(m, 0, phase, 1, 0.0, speed, 50, LIMIT)
        return 7.0 * count + at

    speeds = np.linspace(0.05, 1.5, 300)
    times = np.array([next_time(speed) for speed in speeds])
    jumps = np.flatnonzero(abs(np.diff(times)) > 0.3)
    if jumps.size == 0:
        return None
    low, high = speeds[jumps[0]], speeds[jumps[0] + 1]
    first = times[jumps[0]]
    while np.nextafter(low, high) < high:
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        if abs(next_time(middle) - first) < 0.15:
            low, first = middle, next_time(middle)
        else:
            high = middle
    return low, high


def test_grazing_the_flank_line():
    # The next landing jumps where a minimum just touches the line. On both sides of it, as close
    # as 1e-14, lanes with guesses from the one and from the other side find the right one or none.
    rng = np.random.default_rng(7)
    found = landed = 0
    for _ in range(80):
        ratios = ratios_of(rng.uniform(1.2, 1.8), rng.uniform(0.3, 0.9), 0.01, 0.01, math.inf)
        m = mesh(ratios, rng.uniform(0.5, 1.2))
        phase = rng.uniform(0.0, 6.2)
        sides = jump_of_the_next_landing(m, phase)
        if sides is None:
            continue
        found += 1
        for guess in sides:
            _, _, _, _, _, _, last, _ = next_landing(m, 0, phase, 1, 0.0, guess, 50, LIMIT)
            lanes = new_lanes()
            misses = 10.0 ** -np.linspace(3.0, 14.0, LANES // 2)
            speeds = np.concatenate([sides[0] - misses, sides[1] + misses])
            for i, speed in enumerate(speeds):
                set_mesh(lanes, i, m)
                set_orbit(lanes, i, 0, phase, speed, *last)
            bounce(lanes, LANES, 10**9)
            for i, speed in enumerate(speeds):
                if lanes[LANDED + i] == 1.0:
                    landed += 1
                    _, count, at, _, _, v, _, _ = next_landing(
                        m, 0, phase, 1, 0.0, speed, 50, LIMIT
                    )
                    assert lanes[COUNT + i] == count
                    # A flank left at a graze feels rounding as its square root.
                    assert abs(lanes[PHASE + i] - at) < 1e-7 and abs(lanes[SPEED + i] - v) < 1e-7
    assert found > 40 and landed > 200


def test_company_does_not_matter():
    ratios = ratios_of(1.569, 0.5879, 0.001, 0.0, 4.0)
    tunings = np.linspace(0.5, 1.4, 100)
    states, statuses = np.zeros((100, 2)), np.zeros(100, dtype=np.int64)
    together, alone = np.empty((100, 3)), np.empty((100, 3))
    skip_in_lanes(ratios, tunings, np.arange(100), states, 500, LIMIT, together, statuses)
    for i in range(100):
        skip_in_lanes(ratios, tunings, np.array([i]), states, 500, LIMIT, alone[i:], statuses[i:])
    np.testing.assert_array_equal(together, alone)


def test_limit_of_events_is_kept():
    ratios = ratios_of(1.569, 0.5879, 0.0617, 0.0617, 4.0)
    statuses, ends = np.zeros(1, dtype=np.int64), np.empty((1, 3))
    skip_in_lanes(ratios, np.array([0.9]), np.array([0]), np.zeros((1, 2)), 50, 1, ends, statuses)
    assert statuses[0] == 1


def test_elementary_functions():
    z = np.concatenate([np.linspace(0.0, 40.0, 10_001), [699.0, 1e4, math.inf]])
    assert max(abs(decay(t) - math.exp(-t)) / math.exp(-min(t, 40.0)) for t in z[:-2]) < 4e-16
    assert decay(math.inf) < 1e-300
    for angle in np.linspace(0.0, 60.0, 10_001):
        assert np.abs(np.subtract(cos_sin(angle), (math.cos(angle), math.sin(angle)))).max() < 3e-16
    for z in np.linspace(0.0, 2.0, 1001):
        np.testing.assert_allclose(phi_below_two(z), phi(z), rtol=1e-15, atol=5e-16)
