"""Periodic orbits: residuals, Liouville, unstable ones too; against runs that share no code."""

import math

import numpy as np
import pytest

from gearlib import GearPair, OneDegreePair, periodic_orbit, simulate
from gearlib.analysis.orbits.shooting import NoOrbit
from tests.paper import PAPER

DAMPED = PAPER.replace(material_damping=3953.7, backlash_damping=800.0)
DOUBLED = GearPair.from_ratios(
    contact_ratio=1.6, stiffness_ratio=0.6, damping=0.02, backlash=math.inf
)


def test_the_unstable_orbit_between_two_attractors():
    pair = PAPER.replace(material_damping=3953.7)
    low = periodic_orbit(pair, 0.8, guess=(0.0, 0.0))
    rest = simulate(pair, 0.9, periods=400).final_state.values
    for nu in np.arange(0.89, 0.799, -0.01):
        rest = simulate(pair, nu, periods=400, initial_state=tuple(rest)).final_state.values
    high = periodic_orbit(pair, 0.8, guess=rest)
    assert low.stable and high.stable and abs(high.state - low.state).max() > 0.5
    between = None
    for share in np.linspace(0.05, 0.95, 40):
        try:
            orbit = periodic_orbit(pair, 0.8, guess=low.state + share * (high.state - low.state))
        except NoOrbit:
            continue
        if not orbit.stable:
            between = orbit
            break
    assert between is not None and between.residual <= 1e-12
    # A saddle: one multiplier beyond 1, and the tiniest push leaves it.
    assert between.multipliers[0].real > 1.0 and abs(between.multipliers[1]) < 1.0
    start = (between.state[0] + 1e-6, between.state[1])
    pushed = simulate(pair, 0.8, periods=200, initial_state=start).final_state.values
    assert abs(pushed - between.state).max() > 0.1


def test_patterns():
    assert periodic_orbit(DAMPED, 0.7).pattern == (1,)
    assert periodic_orbit(DAMPED, 0.9).pattern == (1, 0, 1)
    data = periodic_orbit(DAMPED, 0.9).dataset()
    assert data.stable == 1 and data.pattern.attrs["flag_meanings"]
    assert all("long_name" in data[name].attrs for name in data.data_vars)


@pytest.mark.parametrize(
    ("tuning", "guess", "asked", "least"),
    [(0.7, None, 7, 1), (0.9, None, 4, 1), (1.7, (0.7, 0.9), 6, 2)],
)
def test_a_multiple_of_its_period_is_not_that_of_an_orbit(tuning, guess, asked, least):
    pair = DOUBLED if least == 2 else DAMPED
    found = periodic_orbit(pair, tuning, guess=guess, period=asked)
    again = periodic_orbit(pair, tuning, guess=found.state, period=least)
    assert found.period == again.period == least
    np.testing.assert_allclose(found.multipliers, again.multipliers, rtol=0, atol=1e-9)
    if least == 2:
        # Beside it lies that of one period, which it is not.
        once = periodic_orbit(pair, tuning, guess=found.state)
        assert once.period == 1 and np.abs(once.state - found.state).max() > 1e-3


@pytest.mark.parametrize("model", [PAPER, OneDegreePair(pair=PAPER, cubic_damping=4e5)])
def test_a_motion_from_rest_that_cannot_go_on_leads_to_no_orbit(model):
    with pytest.raises(NoOrbit, match="the motion from rest could not go on"):
        periodic_orbit(model, 0.9, max_events=1)
