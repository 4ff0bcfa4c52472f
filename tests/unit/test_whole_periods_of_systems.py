"""Whole periods with many coordinates equal events one by one: thousands of random systems."""

import math
import types

import numpy as np
import pytest

from gearlib import GearPair, Harmonics, OneDegreePair, SixDegreePair, simulate
from gearlib.kernels.jit import kernel
from gearlib.kernels.piecewise_linear import run
from gearlib.kernels.piecewise_linear.run import contact_at, go, set_harmonics
from gearlib.kernels.piecewise_linear.system import ORDER, carry, dot, image, scratch, tables
from gearlib.kernels.piecewise_linear.whole_periods import (
    _prepare,
    _stays_above,
    pass_period,
    period_tables,
)
from gearlib.kernels.polynomial import (
    bernstein_matrix,
    fall_by_shape,
    first_fall,
    lowest_of_parabola,
)
from gearlib.models.propagators import piecewise_linear as propagators
from tests.paper import PAPER

CASES, SEEDS, PERIODS, LIMIT = 500, 4, 2, 1000
MATRIX = bernstein_matrix(ORDER)
WORK = np.empty((50, ORDER + 2))


@kernel
def event_by_event(system, to_bernstein, z, periods):
    """Take z through mesh periods event by event.

    Return the number of events and the largest s among the states at the ends of steps.
    """
    s, table = scratch(z.size), tables(system)
    record = np.empty((64, 4 + (ORDER + 1) * z.size))
    contact, on_line, at_rest = contact_at(system, z)
    events, backlash = 0, -np.inf
    for i in range(periods):
        set_harmonics(system, z, 2.0 * np.pi * i)
        contact, count, record, rows = go(
            system, table, to_bernstein, z, contact, on_line, at_rest, s, record, 0, LIMIT
        )
        on_line, at_rest = 0, False
        events += count
        for j in range(rows):
            start = record[j, 4 : 4 + z.size]
            backlash = max(backlash, dot(system.near, start) - dot(system.far, start))
    return events, backlash


@kernel
def whole_periods(system, part, to_bernstein, z, periods):
    """The same by the part that decides the events."""
    contact, on_line, at_rest = contact_at(system, z)
    short, rest, way = image(part.into, z), image(part.rest_into, z), period_tables(part.system)
    events = 0
    for i in range(periods):
        set_harmonics(part.system, short, 2.0 * np.pi * i)
        contact, count = pass_period(
            part.system, way, to_bernstein, short, contact, on_line, at_rest, LIMIT
        )
        on_line, at_rest = 0, False
        events += count
    carry(part.rest, rest, 2.0 * np.pi, periods)
    z[:] = image(part.back, short) + image(part.rest_back, rest)
    return events


def random_model(rng):
    """Return a model over all that `System` knows: damped or not, friction, run-out, rigid."""

    def choose(usual, *special):
        return float(rng.choice(special)) if rng.random() < 0.3 else float(usual)

    def waves(size):
        return Harmonics(tuple(rng.uniform(-size, size, rng.integers(0, 3))))

    pair = GearPair(
        max_stiffness=4e8,
        stiffness_ratio=choose(rng.uniform(0.1, 1.0), 1.0),
        contact_ratio=choose(rng.uniform(1.0, 2.0), 1.0, 2.0),
        reduced_mass=3.123,
        load=3289.5396,
        backlash=choose(10 ** rng.uniform(-7, -4), 0.0, math.inf),
        material_damping=choose(10 ** rng.uniform(2, 4.5), 0.0),
        backlash_damping=choose(10 ** rng.uniform(2, 4.5), 0.0),
    )
    if rng.random() < 0.25:
        return OneDegreePair(pair=pair, excitation=waves(2000.0), deviation=waves(3e-6))
    masses, radii = rng.uniform(5.0, 30.0, 2), rng.uniform(0.05, 0.2, 2)
    bearings = [choose(10 ** rng.uniform(7, 9.5), math.inf) for _ in range(4)]
    return SixDegreePair(
        pair=pair,
        base_radii=tuple(radii),
        inertias=tuple(rng.uniform(0.3, 1.0, 2) * masses * radii**2),
        masses=tuple(masses),
        bearing_stiffness=tuple(bearings),
        bearing_damping=tuple(
            0.0 if math.isinf(c) else choose(rng.uniform(0, 0.2) * math.sqrt(c * 15.0), 0.0)
            for c in bearings
        ),
        eccentricities=tuple(choose(rng.uniform(0, 1e-5), 0.0) for _ in range(2)),
        run_out_phase=0.9,
        teeth=(24, 31),
        torques=tuple(pair.load * radii * choose(1.0, 0.9, 1.1)),
        deviation=waves(1e-6),
        friction=tuple(rng.uniform(0, 0.1, 2)) if rng.random() < 0.4 else (0.0, 0.0),
        pitch_phase=rng.uniform(0, 6),
        moving_backlash=bool(rng.random() < 0.7),
        preload=bool(rng.random() < 0.7),
    )


@kernel
def prepared(system, i, p):
    """Return the tables with those of one contact code and stretch filled."""
    table = period_tables(system)
    _prepare(system, table, i, p)
    return table


def test_the_tail_bounds_all_higher_terms():
    # Terms from degree 8 on: g (A h)^k / k!, summed in magnitude, by numpy.
    rng = np.random.default_rng(1)
    for _ in range(20):
        system = random_model(rng).system(rng.uniform(0.4, 1.4))[0]
        i, p = rng.integers(3), rng.integers(system.substeps.size)
        table = prepared(system, i, p)
        h = (system.starts[p + 1] - system.starts[p]) / system.substeps[p]
        for functional, tail in ((system.near, table.near_tail), (system.far, table.far_tail)):
            row, expected = functional.copy(), np.zeros_like(functional)
            for k in range(1, ORDER + 1):
                row = row @ system.a[i, p] * (h / k)
                expected += np.abs(row) * (k >= 8)
            np.testing.assert_allclose(tail[i, p], expected, rtol=1e-12, atol=1e-300)


@kernel
def stays_above(rows, tail, z, wide):
    return _stays_above(rows, tail, 0, 0, 1.0, z, wide)


def test_every_term_can_bring_a_distance_to_its_line():
    # 1 + c s^k, and c at most for what is beyond the eighth.
    rows, tail, wide = np.zeros((1, 1, 6, 9, 4)), np.zeros((1, 1, 9)), np.zeros((6, 4))
    tail[0, 0, 8] = 1.0
    for k in range(8):
        rows[0, 0, k // 4, k, k % 4] = 1.0
    for k in range(1, 9):
        z = np.zeros(9)
        for z[0], z[k], above in ((1.0, -2.0, False), (1.0, -0.5, True), (-1.0, 0.5, False)):
            assert stays_above(rows, tail, z, wide) == above, k


def test_a_parabola_is_lowest_where_it_is():
    rng = np.random.default_rng(2)
    s = np.linspace(0.0, 1.0, 2001)
    for a, b, c in rng.normal(size=(500, 3)):
        looked = (a + b * s + c * s * s).min()
        found = lowest_of_parabola(a, b, c)
        # A look misses the lowest point by half a step at most.
        assert looked - abs(c) * 0.25e-3**2 - 1e-15 <= found <= looked + 1e-15


@pytest.mark.parametrize("seed", range(SEEDS))
def test_whole_periods_equal_events_one_by_one(seed):
    rng = np.random.default_rng(seed)
    events, calm = 0, 0
    for _ in range(CASES):
        model, nu = random_model(rng), 10 ** rng.uniform(-0.6, 0.4)
        far = -model.backlash_ratio if math.isfinite(model.backlash_ratio) else 0.0
        state = (
            float(rng.choice([0.0, far])) if rng.random() < 0.3 else rng.uniform(-3, 3),
            0.0 if rng.random() < 0.2 else rng.uniform(-3, 3),
        )
        system, _ = model.system(nu)
        plain = model.initial(system, state)
        if isinstance(model, SixDegreePair):
            # The rest of the state moves as well.
            m = 2 + len(model.flexible())
            plain[0] += 0.5
            plain[1] -= 0.5
            plain[m + 2 : 2 * m] += rng.uniform(-1.0, 1.0, m - 2)
        set_harmonics(system, plain, 0.0)
        fast, nudged = plain.copy(), plain.copy()
        # What one part in 1e12 does to this orbit: rounding cannot do more.
        nudged[: 2 if plain.size < 5 else 4] += 1e-12
        count, backlash = event_by_event(system, MATRIX, plain, PERIODS)
        event_by_event(system, MATRIX, nudged, PERIODS)
        part = model.part(system)
        fast_count = whole_periods(system, part, MATRIX, fast, PERIODS)
        jammed = max(count, fast_count) > LIMIT
        if jammed or (math.isfinite(model.backlash_ratio) and backlash > 1e-9):
            # Moving bearings closed the backlash altogether, which ends a run where a flank is
            # left; before, the order of the two lines hangs on rounding.
            continue
        compared = np.concatenate([part.into, part.rest_into])
        scale = 1.0 + float(abs(plain).max())
        error = float(abs(compared @ (fast - plain)).max())
        spread = float(abs(compared @ (nudged - plain)).max())
        assert error <= 1e-11 * scale + 10.0 * spread, (model, nu, state, error, spread)
        if spread < 1e-10 * scale:
            calm += 1
            # A touch within rounding is two events one way and none the other.
            assert (fast_count - count) % 2 == 0, (model, nu, state)
            assert fast_count == count or error < 1e-11 * scale, (model, nu, state)
            events += fast_count
    assert calm > 0.7 * CASES and events > CASES


def test_shape_tells_what_bernstein_form_tells():
    rng = np.random.default_rng(0)
    told = np.zeros(3, dtype=int)
    for case in range(20_000):
        decay = rng.uniform(0.2, 0.9)
        c = rng.normal(size=ORDER + 1) * decay ** np.arange(ORDER + 1)
        first = case % 2
        c[0] = 0.0 if first else abs(c[0])
        found = fall_by_shape(c, first)
        told[0 if found < 0.0 else 1 if found > 1.0 else 2] += 1
        if found >= 0.0:
            expected = first_fall(c.copy(), MATRIX, WORK)
            # Coefficients carry 1e-16 of their sum; a flat root moves by that over its slope.
            slope = 1.0 if found > 1.0 else abs(np.polyval(np.polyder(c[::-1]), found))
            assert abs(found - expected) <= 1e-14 * abs(c).sum() / slope, (case, c)
    assert told.min() > 500


@pytest.mark.parametrize("depth", [1e-3, 1e-6, 1e-9, -1e-9, -1e-3])
def test_shape_misses_no_dip(depth):
    # A parabola that dips below the line, or stays above it, in the middle of the interval.
    c = np.zeros(ORDER + 1)
    c[:3] = 0.25 - depth, -1.0, 1.0
    assert fall_by_shape(c, 0) in (-1.0, first_fall(c.copy(), MATRIX, WORK))


@pytest.mark.parametrize(("record_periods", "count"), [(3, 0), (2, 1)])
def test_tables_of_whole_periods_are_made_for_periods_before_the_record(
    record_periods, count, monkeypatch
):
    made = []

    def tables(system):
        made.append(system)
        return period_tables(system)

    scope = vars(run) | {"period_tables": tables}
    kernel = types.FunctionType(run.run_linear.py_func.__code__, scope)
    monkeypatch.setattr(propagators, "run_linear", kernel)
    simulate(OneDegreePair(pair=PAPER), 0.9, periods=3, record_periods=record_periods)
    assert len(made) == count
