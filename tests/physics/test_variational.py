"""Maps of small deviations against central differences of the period map, and Liouville."""

import math

import numpy as np
import pytest

from gearlib import Fourier, Harmonics, OneDegreePair, simulate
from gearlib.runs.variational import without_rotation
from tests.paper import PAPER
from tests.physics.test_six_degrees import EVERYTHING, gears

PAIR = PAPER.replace(material_damping=3953.7, backlash_damping=800.0)
LIMIT = 10**6
STATES = [(0.0, 0.0), (1.2, -2.5), (-1.0, 0.7), (-6.0, -1.0)]
NONLINEAR = [
    OneDegreePair(pair=PAIR),
    OneDegreePair(
        pair=PAIR.replace(backlash=10e-6),
        quadratic_damping=5e4,
        backlash_quadratic_damping=2e4,
        cubic_damping=4e5,
        backlash_cubic_damping=1e5,
    ),
    OneDegreePair(pair=PAIR, quadratic_stiffness=5e3, cubic_stiffness=2e9, profile=Fourier(5)),
    OneDegreePair(pair=PAIR, excitation=Harmonics((500.0,), (300.0,))),
]


def differences(pair, nu, state, step=1e-6):
    """Return the central differences of the end of one period by the state at its start."""
    n = state.size
    matrix = np.empty((n, n))
    for j in range(n):
        d = np.zeros(n)
        d[j] = step
        ends = [pair.propagator(nu).maps(state + side * d, 1, LIMIT)[0] for side in (1, -1)]
        matrix[:, j] = (ends[0] - ends[1]) / (2 * step)
    return matrix


@pytest.mark.parametrize("nu", [0.4, 0.66, 0.82, 0.95, 1.7])
@pytest.mark.parametrize("pair", [PAIR, *NONLINEAR])
@pytest.mark.parametrize("start", STATES)
def test_one_degree(pair, nu, start):
    state = np.array(start)
    # The starts lie exactly on no flank line after half a period more.
    state = pair.propagator(nu).maps(state, 1, LIMIT)[0]
    end, maps, code = pair.propagator(nu).maps(state, 3, LIMIT)
    assert code == 0
    for i in range(3):
        # Truncation of the differences: 1e-12 times third derivatives, which a nearly tangential
        # crossing makes large.
        expected = differences(pair, nu, state)
        scale = np.abs(expected).max()
        np.testing.assert_allclose(maps[i], expected, rtol=0, atol=2e-6 * scale)
        state = pair.propagator(nu).maps(state, 1, LIMIT)[0]
    np.testing.assert_allclose(state, end, atol=1e-9)


@pytest.mark.parametrize("nu", [0.55, 0.82, 0.95])
@pytest.mark.parametrize("backlash", [40e-6, 12e-6])
def test_liouville(nu, backlash):
    pair = PAIR.replace(backlash=backlash)
    run = simulate(pair, nu, periods=50, record_periods=50)
    _, maps, _ = pair.propagator(nu).maps(np.zeros(2), 50, LIMIT)
    logarithm = np.log(np.linalg.det(maps)).sum()
    lost = float(run.fraction_backlash)
    rate = 2.0 / nu * (pair.damping_ratio * (1 - lost) + pair.backlash_damping_ratio * lost)
    assert logarithm == pytest.approx(-rate * 100 * math.pi, rel=1e-12)


def test_the_two_kernels_of_one_degree_agree():
    state = np.array([1.0, -2.0])
    plain = PAIR.propagator(0.9).maps(state, 10, LIMIT)
    taylor = OneDegreePair(pair=PAIR).propagator(0.9).maps(state, 10, LIMIT)
    np.testing.assert_allclose(taylor[1], plain[1], rtol=0, atol=1e-12)


@pytest.mark.parametrize("nu", [0.55, 0.9])
@pytest.mark.parametrize(
    "pair",
    [
        gears(3e7, 3953.7, 500.0, free=True),
        gears(1e8, 3953.7, 800.0, **EVERYTHING, backlash=12e-6),
        gears(math.inf, 3953.7, 800.0),
    ],
)
def test_six_degrees(pair, nu):
    n = pair.size
    state = pair.propagator(nu).start((1.0, -2.0))
    assert state.size == n
    _, maps, code = pair.propagator(nu).maps(state, 1, LIMIT)
    assert code == 0
    expected = differences(pair, nu, state)
    np.testing.assert_allclose(maps[0], expected, rtol=0, atol=1e-6 * np.abs(expected).max())


def test_rigid_bearings_have_the_map_of_one_degree():
    pair = gears(math.inf, 3953.7, 800.0)
    _, six, _ = pair.propagator(0.9).maps(pair.propagator(0.9).start((1.0, -2.0)), 20, LIMIT)
    _, one, _ = pair.pair.propagator(0.9).maps(np.array([1.0, -2.0]), 20, LIMIT)
    product = np.linalg.multi_dot(six[::-1])
    found = np.linalg.eigvals(product)
    # The free rotation adds two multipliers 1.
    expected = np.concatenate([np.linalg.eigvals(np.linalg.multi_dot(one[::-1])), [1.0, 1.0]])
    # A double eigenvalue moves by the square root of rounding.
    np.testing.assert_allclose(np.sort(np.abs(found)), np.sort(np.abs(expected)), atol=1e-5)


def test_failed_runs_say_so():
    _, maps, code = PAIR.propagator(0.05).maps(np.zeros(2), 2, 2)
    assert code == 1 and np.isnan(maps).all()


def test_a_start_within_the_backlash():
    # On rigid bearings the maps are those of one degree of freedom, from wherever they start.
    rigid = gears(math.inf, 3953.7, 3953.7)
    for x in (1e-6, -1e-6, -1.0):
        end, maps, _ = rigid.pair.propagator(0.8).maps(np.array([x, -0.26]), 1, 10**6)
        six, six_maps, _ = rigid.propagator(0.8).maps(np.array([x, 0.0, -0.26, 0.0]), 1, 10**6)
        np.testing.assert_allclose(six[::2] + six[1::2], end, atol=1e-12)
        np.testing.assert_allclose(without_rotation(rigid, six_maps), maps, atol=1e-11)
