"""Kernels on their own: closed forms against matrix exponentials, first crossings against looks.

A look is a fine grid of the closed form: it proves no crossing, but no proof may contradict it.
"""

import math

import mpmath
import numpy as np
import pytest

from gearlib.kernels.closed_form.arc_tangents import RATES, enter
from gearlib.kernels.closed_form.crossing import descent_time, landing
from gearlib.kernels.closed_form.damped_oscillator import evolve, level, turning_time
from gearlib.kernels.closed_form.flight import (
    climb_time,
    fall_time,
    fly,
    lowest_time,
    phi,
)
from gearlib.kernels.closed_form.mesh_constants import contact_of, mesh
from gearlib.kernels.codes import BACKLASH, INVERSE, NORMAL
from gearlib.kernels.orbit import orbit_period
from gearlib.kernels.overflow import within_range
from gearlib.models.propagators.closed_form import ratios
from tests.paper import PAPER

#: (stiffness, damping ratio, tuning): without, light, heavy, critical and more than critical.
LEVELS = [(0.8, 0.0, 0.9), (1.3, 0.06, 0.8), (0.7, 0.5, 1.4), (1.0, 1.0, 0.7), (0.5, 3.0, 1.1)]


def exactly(matrix, time):
    """Return exp(matrix time) in 50 digits, rounded once."""
    with mpmath.workdps(50):
        found = mpmath.expm(mpmath.matrix(matrix) * mpmath.mpf(time))
        return np.array(found.tolist(), float)


def states(seed, count=40):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        yield rng, rng.uniform(-3.0, 3.0), rng.choice([0.0, 1.0], p=[0.1, 0.9]) * rng.normal()


@pytest.mark.parametrize(("stiffness", "damping", "tuning"), LEVELS)
def test_contact_is_the_damped_oscillator(stiffness, damping, tuning):
    lev = level(stiffness, damping, tuning)
    matrix = [[0.0, 1.0], [-stiffness / tuning**2, -2.0 * damping / tuning]]
    for time in (1e-6, 0.3, 2.0, 7.0):
        whole = exactly(matrix, time)
        for _, u, v in states(0, 5):
            # The closed form sums terms of the size of the state.
            expected = whole @ [u, v]
            np.testing.assert_allclose(evolve(lev, u, v, time), expected, atol=1e-14 * 10.0)


@pytest.mark.parametrize(("stiffness", "damping", "tuning"), LEVELS)
def test_the_first_turning_point(stiffness, damping, tuning):
    lev = level(stiffness, damping, tuning)
    for _, u, v in states(1):
        turn = turning_time(lev, u, v)
        looked = np.linspace(0.0, min(turn, 30.0), 400)[1:-1]
        speeds = np.array([evolve(lev, u, v, t)[1] for t in looked])
        assert (speeds > 0.0).all() or (speeds < 0.0).all()
        if turn < math.inf:
            assert abs(evolve(lev, u, v, turn)[1]) < 1e-13
        else:
            # What oscillates turns.
            assert damping**2 >= stiffness


@pytest.mark.parametrize(("stiffness", "damping", "tuning"), LEVELS)
def test_the_first_fall_through_a_line(stiffness, damping, tuning):
    lev, fallen = level(stiffness, damping, tuning), 0
    for rng, u, v in states(2, 300):
        # On the line, barely above it, far above it.
        line = u - rng.choice([0.0, 1e-6, 0.1, 1.0, 3.0])
        horizon = rng.choice([0.2, 2.0, 20.0])
        found = descent_time(lev, u, v, line, horizon)
        end = min(found, horizon)
        looked = np.array([evolve(lev, u, v, t)[0] for t in np.linspace(0.0, end, 400)[:-1]])
        assert looked.min() >= line - 1e-13
        if found < math.inf:
            fallen += 1
            assert found <= horizon
            height, speed = evolve(lev, u, v, found)
            assert abs(height - line) < 1e-13 and speed <= 1e-13
        else:
            later = evolve(lev, u, v, horizon)[0]
            assert later >= line - 1e-13
    assert fallen > 50


def test_shallow_dips_are_seen():
    # Its lowest point, half a turn on, lies at -1.
    lev = level(1.0, 0.0, 1.0)
    for depth in (1e-3, 1e-6, 1e-9, 1e-12):
        found = descent_time(lev, 1.0, 0.0, depth - 1.0, 10.0)
        assert found == pytest.approx(math.pi - math.sqrt(2.0 * depth), abs=depth + 1e-15 / depth)
        assert descent_time(lev, 1.0, 0.0, -depth - 1.0, 10.0) == math.inf


@pytest.mark.parametrize("drag", [0.0, 1e-9, 0.03, 0.4, 3.0])
def test_flight_is_that_of_a_dragged_mass(drag):
    pull = 1.7
    matrix = [[0.0, 1.0, 0.0], [0.0, -2.0 * drag, pull], [0.0, 0.0, 0.0]]
    for time in (1e-3, 0.1, 0.7, 4.0):
        whole = exactly(matrix, time)
        for _, x, v in states(3, 5):
            np.testing.assert_allclose(fly(drag, pull, x, v, time), (whole @ [x, v, 1.0])[:2])
            if v < 0.0:
                assert abs(fly(drag, pull, x, v, lowest_time(drag, pull, v))[1]) < 1e-14
    for depth, v in ((0.0, 1.0), (0.2, 0.0), (1.5, 0.7), (40.0, 3.0)):
        climbed, _ = fly(drag, pull, -depth, v, climb_time(drag, pull, depth, v))
        assert abs(climbed) < 1e-14 * (1.0 + depth)
    lowest, _ = fly(drag, pull, 0.0, -2.0, lowest_time(drag, pull, -2.0))
    for share in (0.1, 0.9, 0.999):
        time = fall_time(drag, pull, -share * lowest, -2.0)
        height, speed = fly(drag, pull, -share * lowest, -2.0, time)
        assert abs(height) < 1e-14 and speed < 0.0


@pytest.mark.parametrize("z", [0.0, 1e-9, 0.3, 0.4999, 0.5001, 1.9])
def test_functions_of_the_flight(z):
    with mpmath.workdps(50):
        exact = mpmath.mpf(z)
        gone = (1 - mpmath.exp(-exact)) / exact if z else mpmath.mpf(1)
        expected = float(mpmath.exp(-exact)), float(gone), float((1 - gone) / exact) if z else 0.5
    # One minus a number of at most two digits' loss above 0.5.
    np.testing.assert_allclose(phi(z), expected, rtol=1e-15)


@pytest.mark.parametrize("drag", [0.0, 0.05, 0.8])
def test_where_a_flight_lands(drag):
    pull, sides = 1.3, []
    for rng, _, v in states(4, 200):
        gap = rng.choice([0.3, 1.0, 4.0, math.inf])
        x = -rng.uniform(0.0, min(gap, 5.0))
        time, side = landing(drag, pull, gap, x, 2.0 * v)
        sides.append(side)
        looked = [fly(drag, pull, x, 2.0 * v, t)[0] for t in np.linspace(0.0, time, 400)[1:-1]]
        assert min(looked, default=0.0) >= -gap - 1e-13 and max(looked, default=0.0) <= 1e-13
        place = 0.0 if side == 1 else -gap
        assert fly(drag, pull, x, 2.0 * v, time)[0] == pytest.approx(place, abs=1e-13)
    assert {*sides} == {-1, 1}


def test_constants_of_a_mesh_are_those_of_the_pair():
    pair, nu = PAPER.replace(material_damping=3953.7, backlash_damping=500.0), 0.9
    found = mesh(ratios(pair), nu)
    for lev, stiffness in ((found.high, pair.max_stiffness), (found.low, pair.min_stiffness)):
        assert lev.stiffness == pytest.approx(stiffness / pair.mean_stiffness, rel=1e-14)
        assert lev.a == pytest.approx(pair.damping_ratio / nu, rel=1e-14)
    assert found.drag == pytest.approx(pair.backlash_damping_ratio / nu, rel=1e-14)
    assert found.pull == pytest.approx(1.0 / nu**2, rel=1e-14)
    assert found.gap == pair.backlash_ratio
    # C_max holds over the share epsilon - 1 of the period.
    assert found.half_high == pytest.approx(math.pi * 0.569, rel=1e-14)
    assert 2.0 * found.half_high + found.whole_low == pytest.approx(2.0 * math.pi, rel=1e-14)


def test_contact_of_a_state_on_a_line_is_that_just_after():
    on_near = [contact_of(2.0, 0.0, v) for v in (1.0, 0.0, -1.0)]
    assert on_near == [NORMAL, NORMAL, BACKLASH]
    on_far = [contact_of(2.0, -2.0, v) for v in (1.0, 0.0, -1.0)]
    assert on_far == [BACKLASH, BACKLASH, INVERSE]
    assert [contact_of(2.0, x, 0.0) for x in (0.1, -1.0, -2.1)] == [NORMAL, BACKLASH, INVERSE]


@pytest.mark.parametrize("component", [0, 1])
@pytest.mark.parametrize("period", [1, 2, 3, 5, 16])
def test_a_period_takes_both_components(component, period):
    strobes = np.zeros((32, 2))
    strobes[:, component] = np.arange(32) % period
    assert orbit_period(strobes, 0.9, 1.0) == period
    strobes[:, component] += np.arange(32)
    assert orbit_period(strobes, 0.9, 1.0) == 0


def test_an_arc_in_the_contact_before_changes_no_tangent():
    m = mesh(ratios(PAPER.replace(material_damping=3953.7, backlash_damping=800.0)), 0.8)
    for contact in (NORMAL, BACKLASH, INVERSE):
        tangents = np.random.default_rng(2).normal(size=(2, 40))
        kept = tangents.copy()
        arc = np.array([0.1, 0.2, contact, 1.0, 0.0, -1.0])
        assert enter(m, np.ones((RATES, 40)), arc, contact, 2, tangents) == 2
        # To the last bit: what a flank takes away and gives back again would leave a rounding.
        np.testing.assert_array_equal(tangents, kept)


def test_states_have_room_for_their_squares():
    below = np.nextafter(1e150, 0.0)
    for x, v in ((1e150, 0.0), (0.0, -1e150), (math.nan, 0.0), (0.0, math.inf)):
        assert not within_range(x, v)
    assert within_range(below, -below)
